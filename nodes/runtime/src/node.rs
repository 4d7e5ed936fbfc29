//! A node: what its `main` sees of ROS 2.

use std::future::Future;
use std::marker::PhantomData;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use gripsight_msgs::Message;
use gripsight_msgs::standard::diagnostic_msgs::DiagnosticArray;
use gripsight_msgs::standard::rcl_interfaces::{Log, ParameterEvent};
use gripsight_msgs::standard::rosgraph_msgs::Clock as ClockMessage;
use gripsight_msgs::standard::std_msgs::Header;
use ros2_client::{Context, MessageTypeName, Name, NodeName, NodeOptions, ros2};
use rustdds::DomainParticipantBuilder;
use tokio::sync::{mpsc, watch};
use tokio::task::JoinSet;

use crate::args::Args;
use crate::clock::Clock;
use crate::diagnostics::Diagnostics;
use crate::environment::{self, Environment};
use crate::error::Error;
use crate::logging;
use crate::names::Identity;
use crate::parameter_file::parameters_for;
use crate::parameter_services::ParameterServices;
use crate::parameters::{Descriptor, Parameter, ParameterStore};
use crate::publisher::{Publisher, RawCdr, RawPublisher};
use crate::qos::Qos;
use crate::subscription::{Subscription, forward};
use crate::value::{ParameterType, ParameterValue};

/// Time that the node's own tasks have to end.
const SHUTDOWN_TIME: Duration = Duration::from_secs(2);

/// DDS is looked after this often.
const WATCH_PERIOD: Duration = Duration::from_secs(1);

/// Why a node no longer runs.
pub(crate) enum Ended<E> {
    /// Its work is done, or was asked to end.
    Work(Result<(), E>),
    /// DDS has stopped beneath it: it hears and says nothing more.
    Deaf,
}

/// A running node.
pub struct Node {
    identity: Identity,
    parameters: Arc<ParameterStore>,
    reliable_inputs: Parameter<bool>,
    clock: Clock,
    diagnostics: Diagnostics,
    tasks: JoinSet<()>,
    stop: watch::Sender<bool>,
    // Dropped in this order: the node, which ends its spinner, then the context.
    ros: Arc<Mutex<ros2_client::Node>>,
    context: Context,
}

impl Node {
    /// Starts the node that its program calls `name`, as the command line and the environment say.
    pub(crate) fn start(name: &str, arguments: impl IntoIterator<Item = String>) -> Result<Self, Error> {
        let args = Args::parse(arguments)?;
        let variable = |name: &str| std::env::var(name).ok();
        let environment = Environment::read(variable)?;
        let log_lines = logging::start(&args);
        environment::ignored(variable).into_iter().for_each(|reason| tracing::warn!("{reason}"));

        let identity = Identity::new(name, &args.remaps)?;
        let parameters = Arc::new(ParameterStore::new(overrides(&args, name, &identity)?));
        let use_sim_time = parameters.declare(
            "use_sim_time",
            false,
            Descriptor::new("Take the time from /clock instead of the machine").read_only(),
        )?;
        let reliable_inputs = parameters.declare(
            "reliable_inputs",
            false,
            Descriptor::new("Lose no sample of the inputs: for replay, when the publisher is reliable")
                .read_only(),
        )?;

        let context = context(&environment)?;
        let mut ros = ros_node(&context, &identity)?;
        let spinner = ros.spinner().map_err(|error| Error::create("spinner", error))?;
        let mut node = Self {
            clock: if use_sim_time.get() { Clock::simulated() } else { Clock::default() },
            identity,
            parameters,
            reliable_inputs,
            diagnostics: Diagnostics::default(),
            tasks: JoinSet::new(),
            stop: watch::Sender::new(false),
            ros: Arc::new(Mutex::new(ros)),
            context,
        };
        tokio::spawn(async move {
            if let Err(error) = spinner.spin().await {
                tracing::error!("the ROS 2 graph is no longer followed: {error}");
            }
        });
        node.follow_clock(use_sim_time.get())?;
        node.publish_log(log_lines)?;
        node.publish_diagnostics()?;
        node.serve_parameters(&environment)?;
        Ok(node)
    }

    /// The node's full name, such as `/car/telemetry`.
    pub fn name(&self) -> String {
        self.identity.fully_qualified()
    }

    /// The node's clock.
    pub fn clock(&self) -> Clock {
        self.clock.clone()
    }

    /// Where the node reports how it is.
    pub fn diagnostics(&self) -> Diagnostics {
        self.diagnostics.clone()
    }

    /// Declares a parameter, with the default that it has unless a file or the command line says
    /// otherwise.
    ///
    /// # Errors
    /// [`Error::Parameter`] when the value given has the wrong type or lies outside the range, or
    /// the name is taken.
    pub fn parameter<T: ParameterType>(
        &mut self,
        name: &str,
        default: T,
        descriptor: Descriptor,
    ) -> Result<Parameter<T>, Error> {
        self.parameters.declare(name, default, descriptor)
    }

    /// Quality of service of a sensor input: best effort with this depth, or that of a replay when
    /// the parameter `reliable_inputs` is true.
    pub fn sensor_qos(&self, depth: usize) -> Qos {
        if self.reliable_inputs.get() { Qos::replay() } else { Qos::sensor(depth) }
    }

    /// Publishes messages of type `M` on a topic (relative, `~/` private, or absolute).
    ///
    /// # Errors
    /// [`Error::Name`], or [`Error::Create`] when DDS refuses.
    pub fn publisher<M: Message>(&mut self, topic: &str, qos: Qos) -> Result<Publisher<M>, Error> {
        Ok(Publisher { raw: self.raw_publisher(topic, M::TYPE, qos)?, kind: PhantomData })
    }

    /// Publishes serialized messages of the type `type_name` (`package/msg/Type`) on a topic.
    ///
    /// # Errors
    /// [`Error::Name`], or [`Error::Create`] when DDS refuses.
    pub fn raw_publisher(&mut self, topic: &str, type_name: &str, qos: Qos) -> Result<RawPublisher, Error> {
        let topic = self.identity.resolve(topic)?;
        let mut ros = self.ros.lock().unwrap_or_else(PoisonError::into_inner);
        let writer = ros_topic(&ros, &topic, type_name, qos)
            .and_then(|dds| ros.create_publisher::<RawCdr>(&dds, Some(qos.profile())))
            .map_err(|error| Error::create(format!("publisher of {topic}"), error))?;
        let (node, diagnostics) = (Arc::downgrade(&self.ros), self.diagnostics.clone());
        Ok(RawPublisher { topic, writer, node, diagnostics })
    }

    /// Subscribes to messages of type `M` on a topic (relative, `~/` private, or absolute).
    ///
    /// # Errors
    /// [`Error::Name`], or [`Error::Create`] when DDS refuses.
    pub fn subscription<M: Message>(&mut self, topic: &str, qos: Qos) -> Result<Subscription<M>, Error> {
        let topic = self.identity.resolve(topic)?;
        let mut ros = self.ros.lock().unwrap_or_else(PoisonError::into_inner);
        let reader = ros_topic(&ros, &topic, M::TYPE, qos)
            .and_then(|dds| ros.create_subscription::<M>(&dds, Some(qos.profile())))
            .map_err(|error| Error::create(format!("subscription to {topic}"), error))?;
        drop(ros);
        let (sender, messages) = mpsc::channel(qos.depth());
        let diagnostics = self.diagnostics.clone();
        self.tasks.spawn(forward(reader, topic.clone(), sender, diagnostics, self.stop.subscribe()));
        Ok(Subscription { topic, messages })
    }

    /// Runs `work` until it ends, `end` resolves or DDS has stopped, then stops the node's own tasks in order.
    pub(crate) async fn run<E>(
        self,
        work: impl Future<Output = Result<(), E>>,
        end: impl Future<Output = ()>,
    ) -> Ended<E> {
        let result = tokio::select! {
            result = work => Ended::Work(result),
            () = end => Ended::Work(Ok(())),
            () = stopped(self.context.domain_participant()) => Ended::Deaf,
        };
        self.close().await;
        result
    }

    async fn close(mut self) {
        // The receivers may be gone already; then there is nothing to stop.
        self.stop.send(true).ok();
        let all = async { while self.tasks.join_next().await.is_some() {} };
        if tokio::time::timeout(SHUTDOWN_TIME, all).await.is_err() {
            self.tasks.shutdown().await;
        }
    }

    /// Runs `work` beside the node until it ends or the node shuts down.
    fn spawn(&mut self, work: impl Future<Output = ()> + Send + 'static) {
        let mut stop = self.stop.subscribe();
        self.tasks.spawn(async move {
            tokio::select! {
                () = work => {}
                _ = stop.wait_for(|stop| *stop) => {}
            }
        });
    }

    fn follow_clock(&mut self, use_sim_time: bool) -> Result<(), Error> {
        if use_sim_time {
            let mut ticks = self.subscription::<ClockMessage>("/clock", Qos::sensor(1))?;
            let clock = self.clock.clone();
            self.spawn(async move {
                while let Some(tick) = ticks.next().await {
                    clock.set(tick.clock);
                }
            });
        }
        Ok(())
    }

    fn publish_log(&mut self, mut lines: mpsc::Receiver<Log>) -> Result<(), Error> {
        let rosout = self.publisher::<Log>("/rosout", Qos::rosout())?;
        let (clock, name) = (self.clock.clone(), self.name());
        let logger = name.trim_start_matches('/').replace('/', ".");
        self.spawn(async move {
            while let Some(line) = lines.recv().await {
                rosout.publish(&Log { stamp: clock.now(), name: logger.clone(), ..line }).await;
            }
        });
        Ok(())
    }

    fn publish_diagnostics(&mut self) -> Result<(), Error> {
        let publisher = self.publisher::<DiagnosticArray>("/diagnostics", Qos::reliable(10))?;
        let (diagnostics, clock, name) = (self.diagnostics.clone(), self.clock.clone(), self.name());
        self.spawn(async move {
            let mut ticks = tokio::time::interval(Duration::from_secs(1));
            loop {
                ticks.tick().await;
                let header = Header { stamp: clock.now(), frame_id: String::new() };
                publisher.publish(&DiagnosticArray { header, status: diagnostics.messages(&name) }).await;
            }
        });
        Ok(())
    }

    fn serve_parameters(&mut self, environment: &Environment) -> Result<(), Error> {
        let publisher = self.publisher::<ParameterEvent>("/parameter_events", Qos::reliable(1000))?;
        let (events, mut waiting) = mpsc::channel(1000);
        let services = ParameterServices {
            store: Arc::clone(&self.parameters),
            events,
            clock: self.clock.clone(),
            node: self.name(),
        };
        let serving = {
            let mut ros = self.ros.lock().unwrap_or_else(PoisonError::into_inner);
            let participant = self.context.domain_participant();
            services.serve(&mut ros, &self.identity, environment.service_mapping, &participant)?
        };
        self.spawn(serving);
        self.spawn(async move {
            while let Some(event) = waiting.recv().await {
                publisher.publish(&event).await;
            }
        });
        Ok(())
    }
}

/// Resolves once DDS no longer runs. RustDDS 0.15.1 ends its threads where a system call is interrupted, which happens to a process
/// that was stopped and goes on: after Ctrl-Z and `fg`, beneath a debugger. Only a command that nobody takes any more shows it.
async fn stopped(participant: rustdds::DomainParticipant) {
    let mut looks = tokio::time::interval(WATCH_PERIOD);
    while participant.assert_liveliness().is_ok() {
        looks.tick().await;
    }
}

/// Parameters from the files, then those of the command line, which win.
fn overrides(args: &Args, name: &str, identity: &Identity) -> Result<Vec<(String, ParameterValue)>, Error> {
    let full_name = identity.fully_qualified();
    let mut found = Vec::new();
    for path in &args.parameter_files {
        let of_file = |reason: String| Error::ParameterFile { path: path.clone(), reason };
        let text = std::fs::read_to_string(path).map_err(|error| of_file(error.to_string()))?;
        found.extend(parameters_for(&text, &full_name).map_err(of_file)?);
    }
    let is_ours = |node: &str| node == name || node == identity.name || node == full_name;
    for given in args.parameters.iter().filter(|given| given.node.as_deref().is_none_or(is_ours)) {
        let value =
            ParameterValue::parse(&given.value).map_err(|reason| Error::parameter(&given.name, reason))?;
        found.push((given.name.clone(), value));
    }
    Ok(found)
}

fn context(environment: &Environment) -> Result<Context, Error> {
    let mut builder = DomainParticipantBuilder::new(environment.domain_id);
    if environment.localhost_only {
        builder = builder.with_only_networks([std::net::Ipv4Addr::LOCALHOST]);
    }
    let participant = builder.build().map_err(|error| Error::create("DDS participant", error))?;
    Context::from_domain_participant(participant).map_err(|error| Error::create("ROS 2 context", error))
}

/// The ros2-client node, without the services that this crate supplies itself.
fn ros_node(context: &Context, identity: &Identity) -> Result<ros2_client::Node, Error> {
    let full_name = identity.fully_qualified();
    let name = NodeName::new(&identity.namespace, &identity.name)
        .map_err(|error| Error::Name { name: full_name.clone(), reason: error.to_string() })?;
    let options = NodeOptions::new().enable_rosout(false).start_parameter_services(false);
    context.new_node(name, options).map_err(|error| Error::create(format!("node {full_name}"), error))
}

fn ros_topic(
    node: &ros2_client::Node,
    topic: &str,
    type_name: &str,
    qos: Qos,
) -> Result<rustdds::Topic, ros2::CreateError> {
    let wrong = |reason: String| ros2::CreateError::BadParameter { reason };
    let name = Name::parse(topic).map_err(|error| wrong(error.to_string()))?;
    let (package, type_name) = type_name
        .split_once("/msg/")
        .ok_or_else(|| wrong(format!("`{type_name}` is not of the form package/msg/Type")))?;
    node.create_topic(&name, MessageTypeName::new(package, type_name), &qos.profile())
}
