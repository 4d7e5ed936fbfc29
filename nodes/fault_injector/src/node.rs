//! The car's topics in, the same topics with faults out.

use std::cell::RefCell;
use std::future::Future;
use std::io::Cursor;
use std::sync::Arc;
use std::time::Duration;

use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::builtin_interfaces::Time;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::sensor_msgs::{CompressedImage, Imu, JointState};
use gripsight_runtime::{Descriptor, Diagnostics, Node, Qos, RawPublisher, Subscription};

use crate::diagnostics::{State, status};
use crate::fault::{Fault, Kind, Topic};
use crate::plan::Lot;
use crate::signal::Signal;
use crate::stream::Stream;

/// Samples that a publisher keeps.
const DEPTH: usize = 1000;
/// Samples of a sensor that wait.
const SENSOR_DEPTH: usize = 50;
/// Side of the black picture (px).
const BLACK_PX: u32 = 224;
/// How often diagnostics are renewed.
const REPORT_PERIOD: Duration = Duration::from_millis(200);

/// Declares parameters and topics; gives the node's work.
pub(crate) fn setup(node: &mut Node) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<>> {
    let seed = node
        .parameter(
            "seed",
            1_i64,
            Descriptor::new("Seed of the faults that are drawn, and of what they hit").read_only(),
        )?
        .get()
        .unsigned_abs();
    let faults = plan(node, seed)?;
    let black: Arc<[u8]> = black()?.into();
    let shared =
        RefCell::new(Shared { start_ns: None, faults: faults.clone(), begun: 0, state: State::default() });
    let odom = Passage::<Odometry>::new(node, Topic::Odom, &faults, seed, &black)?;
    let drive = Passage::<AckermannDriveStamped>::new(node, Topic::Drive, &faults, seed, &black)?;
    let imu = Passage::<Imu>::new(node, Topic::Imu, &faults, seed, &black)?;
    let wheels = Passage::<JointState>::new(node, Topic::Wheels, &faults, seed, &black)?;
    let pictures = Passage::<CompressedImage>::new(node, Topic::Picture, &faults, seed, &black)?;
    let diagnostics = node.diagnostics();
    tracing::info!("{} faults planned", faults.len());
    Ok(async move {
        tokio::select! {
            () = odom.run(&shared) => {}
            () = drive.run(&shared) => {}
            () = imu.run(&shared) => {}
            () = wheels.run(&shared) => {}
            () = pictures.run(&shared) => {}
            () = report(&diagnostics, &shared) => {}
        }
        Ok(())
    })
}

/// The faults: those stated, and those drawn.
fn plan(node: &mut Node, seed: u64) -> anyhow::Result<Vec<Fault>> {
    let texts = |node: &mut Node, name: &str, default: Vec<String>, meaning: &str| {
        node.parameter(name, default, Descriptor::new(meaning).read_only()).map(|parameter| parameter.get())
    };
    let stated = texts(
        node,
        "faults",
        Vec::new(),
        "Faults: KIND TOPIC START_S DURATION_S SIZE, in s after the first message",
    )?;
    let kinds = texts(
        node,
        "kinds",
        Kind::ALL.map(|kind| kind.name().to_owned()).to_vec(),
        "Kinds that are drawn from",
    )?;
    let topics =
        texts(node, "topics", vec!["odom".to_owned(), "drive".to_owned()], "Topics that are drawn from")?;
    let count =
        node.parameter("draw", 0_i64, Descriptor::new("Faults to draw").range(0.0..=10_000.0).read_only())?;
    let mut number = |name: &str, default: f64, meaning: &str| {
        let descriptor = Descriptor::new(meaning).range(0.0..=1e6).read_only();
        node.parameter(name, default, descriptor).map(|parameter| parameter.get())
    };
    let from_s = number("from_s", 3.0, "No fault drawn begins earlier after the first message [s]")?;
    let to_s = number("to_s", 28.0, "No fault drawn ends later [s]")?;
    let mut faults = stated.iter().map(|text| Fault::parse(text)).collect::<anyhow::Result<Vec<_>>>()?;
    let lot = Lot {
        seed,
        count: usize::try_from(count.get())?,
        kinds: kinds.iter().map(|name| Kind::by_name(name)).collect::<anyhow::Result<_>>()?,
        topics: topics.iter().map(|name| Topic::by_name(name)).collect::<anyhow::Result<_>>()?,
        span_s: [from_s, to_s],
    };
    if lot.count > 0 {
        faults.extend(lot.draw()?);
    }
    faults.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
    Ok(faults)
}

/// A picture of nothing.
fn black() -> anyhow::Result<Vec<u8>> {
    let mut file = Cursor::new(Vec::new());
    image::RgbImage::new(BLACK_PX, BLACK_PX).write_to(&mut file, image::ImageFormat::Jpeg)?;
    Ok(file.into_inner())
}

/// What the topics' tasks have in common; they run in one task and take turns.
struct Shared {
    /// Stamp of the first message on any topic.
    start_ns: Option<i64>,
    faults: Vec<Fault>,
    /// Faults that have begun.
    begun: usize,
    state: State,
}

impl Shared {
    /// Seconds after the first message; tells faults that begin and end.
    fn time_s(&mut self, stamp: Time) -> f64 {
        let now_ns = i64::from(stamp.sec) * 1_000_000_000 + i64::from(stamp.nanosec);
        let start_ns = *self.start_ns.get_or_insert_with(|| {
            tracing::info!("the first message is stamped {now_ns} ns");
            now_ns
        });
        let time_s = (now_ns - start_ns) as f64 * 1e-9;
        while let Some(fault) = self.faults.get(self.begun).filter(|fault| fault.start_s <= time_s) {
            tracing::info!("fault {} of {}: {fault}", self.begun + 1, self.faults.len());
            self.begun += 1;
        }
        let at_work = self.faults.iter().filter(|fault| fault.is_at_work(time_s));
        self.state.at_work = at_work.map(ToString::to_string).collect();
        self.state.to_come = self.faults.len() - self.begun;
        time_s
    }
}

/// A topic's way through the node.
struct Passage<M> {
    incoming: Subscription<M>,
    outgoing: RawPublisher,
    stream: Stream<M>,
}

impl<M: Signal> Passage<M> {
    fn new(
        node: &mut Node,
        topic: Topic,
        faults: &[Fault],
        seed: u64,
        black: &Arc<[u8]>,
    ) -> anyhow::Result<Self> {
        let qos = node.sensor_qos(SENSOR_DEPTH);
        Ok(Self {
            incoming: node.subscription(&format!("in/{}", topic.name()), qos)?,
            outgoing: node.raw_publisher(topic.name(), M::TYPE, Qos::reliable(DEPTH))?,
            stream: Stream::new(topic, faults, seed, Arc::clone(black)),
        })
    }

    async fn run(mut self, shared: &RefCell<Shared>) {
        while let Some(mut message) = self.incoming.next().await {
            let time_s = shared.borrow_mut().time_s(message.header().stamp);
            let bodies = self.stream.pass(time_s, message);
            {
                let state = &mut shared.borrow_mut().state;
                state.taken += 1;
                state.given += bodies.len() as u64;
            }
            for body in bodies {
                self.outgoing.publish(body).await;
            }
        }
    }
}

async fn report(diagnostics: &Diagnostics, shared: &RefCell<Shared>) {
    let mut ticks = tokio::time::interval(REPORT_PERIOD);
    loop {
        ticks.tick().await;
        let state = shared.borrow().state.clone();
        diagnostics.report("injector", status(&state));
    }
}
