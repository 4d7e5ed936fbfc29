//! A node: what its `main` sees of ROS 2.

use std::future::Future;
use std::marker::PhantomData;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use gripsight_msgs::Message;
use gripsight_msgs::standard::diagnostic_msgs::DiagnosticArray;
use gripsight_msgs::standard::rcl_interfaces::Log;
use gripsight_msgs::standard::rosgraph_msgs::Clock as ClockMessage;
use gripsight_msgs::standard::std_msgs::Header;
use ros2_client::{Context, ServiceMapping};
use tokio::sync::{mpsc, watch};
use tokio::task::JoinSet;

use crate::args::Args;
use crate::clock::Clock;
use crate::diagnostics::Diagnostics;
use crate::environment::{self, Environment};
use crate::error::Error;
use crate::ground::{context, is_stopped, overrides, ros_node, ros_topic, stopped};
use crate::guard::Guard;
use crate::inputs::{self, Arrivals};
use crate::logging;
use crate::names::Identity;
use crate::parameter_client::ParameterClient;
use crate::parameter_services::{ParameterServices, RepliesRead, serve_trigger};
use crate::parameters::{Descriptor, Parameter, ParameterStore};
use crate::publisher::{Publisher, RawCdr, RawPublisher};
use crate::qos::Qos;
use crate::readers::Readers;
use crate::subscription::{Subscription, forward};
use crate::value::{ParameterType, ParameterValue};

/// Time that the node's own tasks have to end.
const SHUTDOWN_TIME: Duration = Duration::from_millis(500);

/// Changes of parameters that wait for `/parameter_events`; more are lost there.
const WAITING_CHANGES: usize = 1000;

/// Why a node no longer runs.
pub(crate) enum Ended<E> {
    /// Its work is done, or was asked to end.
    Work(Result<(), E>),
    /// DDS has stopped beneath it: it hears and says nothing more.
    Deaf,
}

/// Calls of a service that only triggers.
#[derive(Debug)]
pub struct Trigger {
    calls: mpsc::Receiver<()>,
}

impl Trigger {
    /// The next call; none once the node ends.
    pub async fn next(&mut self) -> Option<()> {
        self.calls.recv().await
    }
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
    /// Who reads what the node publishes.
    readers: Readers,
    // Dropped in this order: the node, then the context.
    ros: Arc<Mutex<ros2_client::Node>>,
    context: Context,
    domain_id: u16,
    service_mappings: Vec<ServiceMapping>,
    /// Parameters that `/parameter_events` is to be told of.
    changes: Option<mpsc::Sender<(String, ParameterValue)>>,
}

impl Node {
    /// Starts the node that its program calls `name`, as the command line and the environment say.
    pub(crate) fn start(
        name: &str,
        arguments: impl IntoIterator<Item = String>,
        guard: &Guard,
    ) -> Result<Self, Error> {
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

        let memory_limit = Guard::limit(&parameters)?;
        let diagnostics = Diagnostics::default();
        guard.watch(diagnostics.clone(), memory_limit);

        let context = context(&environment)?;
        let ros = ros_node(&context, &identity)?;
        let mut node = Self {
            clock: if use_sim_time.get() { Clock::simulated() } else { Clock::default() },
            identity,
            parameters,
            reliable_inputs,
            diagnostics,
            tasks: JoinSet::new(),
            stop: watch::Sender::new(false),
            readers: Readers::default(),
            ros: Arc::new(Mutex::new(ros)),
            context,
            domain_id: environment.domain_id,
            service_mappings: environment.service_mappings.clone(),
            changes: None,
        };
        node.spawn(node.readers.clone().follow(node.context.domain_participant()));
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

    /// The DDS domain that it is in.
    pub(crate) fn domain(&self) -> u16 {
        self.domain_id
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

    /// Looks for values given to parameters that the node does not have, and tells `/parameter_events` of those that it has; to be
    /// called once it has declared all.
    pub(crate) fn check_parameters(&self) -> Result<(), Error> {
        self.parameters.undeclared()?.into_iter().for_each(|sentence| tracing::warn!("{sentence}"));
        if let Some(changes) = &self.changes {
            self.parameters.values().into_iter().for_each(|change| drop(changes.try_send(change)));
        }
        Ok(())
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
        let raw = self.raw_publisher(topic, M::TYPE, qos)?;
        Ok(Publisher { raw, kind: PhantomData })
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
        let (readers, diagnostics) = (self.readers.clone(), self.diagnostics.clone());
        let is_full = AtomicBool::new(false);
        Ok(RawPublisher { topic, writer, readers, diagnostics, patience: qos.patience(), is_full })
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
        let (diagnostics, stop) = (self.diagnostics.clone(), self.stop.subscribe());
        let arrivals = Arrivals::new(topic.clone(), M::TYPE, qos);
        self.tasks.spawn(forward(reader, topic.clone(), arrivals.clone(), sender, diagnostics, stop));
        Ok(Subscription { topic, messages, arrivals })
    }

    /// Offers a service of type std_srvs/srv/Trigger (relative, `~/` private, or absolute); `done` is what its reply says.
    ///
    /// # Errors
    /// [`Error::Name`], or [`Error::Create`] when DDS refuses.
    pub fn trigger(&mut self, name: &str, done: &'static str) -> Result<Trigger, Error> {
        let name = self.identity.resolve(name)?;
        let read = self.replies_read();
        let (sender, calls) = mpsc::channel(WAITING_CHANGES);
        for mapping in self.service_mappings.clone() {
            let serving = {
                let mut ros = self.ros.lock().unwrap_or_else(PoisonError::into_inner);
                serve_trigger(&mut ros, &name, mapping, &read, done, sender.clone())?
            };
            self.spawn(serving);
        }
        Ok(Trigger { calls })
    }

    /// A client that sets the parameters of another node (relative or absolute name).
    ///
    /// # Errors
    /// [`Error::Name`], or [`Error::Create`] when DDS refuses.
    pub fn parameter_client(&mut self, node: &str) -> Result<ParameterClient, Error> {
        let node = self.identity.resolve(node)?;
        let mut ros = self.ros.lock().unwrap_or_else(PoisonError::into_inner);
        ParameterClient::new(&mut ros, &node, self.context.domain_participant())
    }

    /// States that the node can do nothing without messages on one of these topics. Where none has come for five seconds a line in the
    /// log, and a part of the diagnostics, name the topics, the quality of service asked for, and who publishes there.
    pub fn needs(&mut self, one_of: impl IntoIterator<Item = Arrivals>) {
        let needed: Vec<Arrivals> = one_of.into_iter().collect();
        if !needed.is_empty() {
            let participant = self.context.domain_participant();
            self.spawn(inputs::watch(needed, participant, self.domain_id, self.diagnostics.clone()));
        }
    }

    /// Whether DDS has stopped beneath it.
    pub(crate) fn is_deaf(&self) -> bool {
        is_stopped(&self.context.domain_participant())
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
            // Without it time stands still, whatever else arrives.
            self.needs([ticks.arrivals()]);
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

    fn replies_read(&self) -> RepliesRead {
        let participant = self.context.domain_participant();
        RepliesRead { participant, readers: self.readers.clone(), writers: self.service_mappings.len() }
    }

    fn serve_parameters(&mut self, environment: &Environment) -> Result<(), Error> {
        let (changes, waiting) = mpsc::channel(WAITING_CHANGES);
        self.changes = Some(changes.clone());
        let services = ParameterServices { store: Arc::clone(&self.parameters), changes };
        let read = self.replies_read();
        for mapping in &environment.service_mappings {
            let serving = {
                let mut ros = self.ros.lock().unwrap_or_else(PoisonError::into_inner);
                services.clone().serve(&mut ros, &self.identity, *mapping, &read)?
            };
            self.spawn(serving);
        }
        self.tell_changes(waiting);
        Ok(())
    }

    /// `/parameter_events`: ros2-client publishes there whatever is set in its own store, which is kept in step for that alone; a second
    /// publisher of this crate's would be one too many. It stamps with a clock of its own, which nobody
    /// sets, where its store says `use_sim_time`, so that parameter stays out.
    fn tell_changes(&mut self, mut waiting: mpsc::Receiver<(String, ParameterValue)>) {
        let ros = Arc::downgrade(&self.ros);
        self.spawn(async move {
            while let Some((name, value)) = waiting.recv().await {
                let Some(ros) = ros.upgrade() else { return };
                if name != "use_sim_time" {
                    let ros = ros.lock().unwrap_or_else(PoisonError::into_inner);
                    // Nothing is refused: the store allows any parameter, and has no rules.
                    ros.set_parameter(&name, value.into()).ok();
                }
            }
        });
    }
}
