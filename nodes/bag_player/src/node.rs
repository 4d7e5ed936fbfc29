//! The bag's messages in, its topics and `/clock` out.

use std::collections::BTreeMap;
use std::future::Future;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use gripsight_bag::{Bag, BagError, Topic};
use gripsight_msgs::standard::builtin_interfaces::Time;
use gripsight_msgs::standard::rosgraph_msgs::Clock;
use gripsight_runtime::{Descriptor, Diagnostics, Node, Parameter, Publisher, Qos, RawPublisher};
use tokio::sync::mpsc::Receiver;

use crate::diagnostics::{Stage, State, status};
use crate::pace::Pace;
use crate::source::{Recorded, read};

/// Topics that belong to the running system, not to the recording.
const NOT_PLAYED: [&str; 3] = ["/clock", "/rosout", "/parameter_events"];

/// Longest time (bag and machine) between two `/clock`.
const CLOCK_PERIOD: Duration = Duration::from_millis(10);

/// Samples that a publisher keeps.
const DEPTH: usize = 1000;

/// How often the player looks for subscribers.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// Declares the node's parameters and topics, and gives its work.
pub(crate) fn setup(node: &mut Node) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<>> {
    let path = node.parameter(
        "bag",
        String::new(),
        Descriptor::new("The bag: an .mcap file or a rosbag2 folder; required").read_only(),
    )?;
    let topics = node.parameter(
        "topics",
        Vec::<String>::new(),
        Descriptor::new("Topics of the bag to play; empty: all").read_only(),
    )?;
    if path.get().is_empty() {
        bail!("parameter bag: expected a path (--ros-args -p bag:=FILE)");
    }
    let bag = Bag::open(Path::new(&path.get()))?;
    let publishers = publishers(node, &bag, &topics.get())?;
    let player = Player {
        rate: node.parameter(
            "rate",
            1.0,
            Descriptor::new("Seconds of the bag per second").range(0.01..=1000.0),
        )?,
        paused: node.parameter("paused", false, Descriptor::new("Hold bag and clock where they are"))?,
        wait_for: node.parameter(
            "wait_for",
            Vec::<String>::new(),
            Descriptor::new(
                "Topics of the bag that must all have a subscriber before playing; empty: one of any",
            )
            .read_only(),
        )?,
        settle_s: node.parameter(
            "settle_s",
            1.0,
            Descriptor::new("Time for further subscribers after those (s)").range(0.0..=60.0).read_only(),
        )?,
        linger_s: node.parameter(
            "linger_s",
            2.0,
            Descriptor::new("Time after the end in which lost messages are sent again (s)")
                .range(0.0..=600.0)
                .read_only(),
        )?,
        clock: node.publisher("/clock", Qos::reliable(10))?,
        diagnostics: node.diagnostics(),
        publishers,
        state: State::default(),
        next_tick: Instant::now(),
    };
    for topic in player.wait_for.get() {
        if !player.publishers.contains_key(&topic) {
            bail!("parameter wait_for: the bag has no topic {topic} that is played");
        }
    }
    tracing::info!("playing {} topics of {}", player.publishers.len(), path.get());
    Ok(player.play(bag))
}

/// Publishers, and whether they are latched, by the topic's name in the bag.
type Publishers = BTreeMap<String, (RawPublisher, bool)>;

/// A publisher per topic that is played.
fn publishers(node: &mut Node, bag: &Bag, wanted: &[String]) -> anyhow::Result<Publishers> {
    if let Some(missing) = wanted.iter().find(|name| bag.topics().iter().all(|topic| topic.name != **name)) {
        bail!("parameter topics: the bag has no topic {missing}");
    }
    let mut publishers = BTreeMap::new();
    for topic in bag.topics() {
        let is_wanted = wanted.is_empty() || wanted.contains(&topic.name);
        if !is_wanted || NOT_PLAYED.contains(&topic.name.as_str()) {
            continue;
        }
        if topic.encoding != "cdr" || !topic.type_name.contains("/msg/") {
            let Topic { name, type_name, encoding, .. } = topic;
            tracing::warn!("{name} is not played: type `{type_name}`, encoding `{encoding}`");
            continue;
        }
        let is_latched = is_latched(topic);
        let qos = if is_latched { Qos::latched() } else { Qos::reliable(DEPTH) }.patient();
        let publisher = node
            .raw_publisher(&topic.name, &topic.type_name, qos)
            .with_context(|| format!("topic {} of the bag", topic.name))?;
        publishers.insert(topic.name.clone(), (publisher, is_latched));
    }
    Ok(publishers)
}

/// True for a topic that was latched when it was recorded.
fn is_latched(topic: &Topic) -> bool {
    let offered = &topic.offered_qos_profiles;
    ["durability: transient_local", "durability: 1"].iter().any(|text| offered.contains(text))
}

struct Player {
    rate: Parameter<f64>,
    paused: Parameter<bool>,
    wait_for: Parameter<Vec<String>>,
    settle_s: Parameter<f64>,
    linger_s: Parameter<f64>,
    clock: Publisher<Clock>,
    publishers: Publishers,
    diagnostics: Diagnostics,
    state: State,
    /// When clock and diagnostics are due again.
    next_tick: Instant,
}

impl Player {
    async fn play(mut self, bag: Bag) -> anyhow::Result<()> {
        self.wait_for_subscribers().await;
        let started = Instant::now();
        let end = self.play_messages(read(bag)).await;
        self.state.stage = Stage::Finished;
        let result = match end {
            Ok(()) => Ok(()),
            Err(error @ BagError::Truncated { .. }) => {
                tracing::warn!("played what is there: {error}");
                self.state.truncated = Some(error.to_string());
                Ok(())
            }
            Err(error) => Err(error.into()),
        };
        self.report();
        tracing::info!(
            "played {} messages, {:.2} s of the bag in {:.2} s; {} passed over",
            self.state.published,
            self.state.played_s,
            started.elapsed().as_secs_f64(),
            self.state.passed_over,
        );
        tokio::time::sleep(Duration::from_secs_f64(self.linger_s.get())).await;
        result
    }

    async fn wait_for_subscribers(&mut self) {
        self.report();
        let wait_for = self.wait_for.get();
        let is_heard = |(publisher, _): &(RawPublisher, bool)| publisher.subscriptions() > 0;
        loop {
            let ready = if wait_for.is_empty() {
                self.publishers.values().any(is_heard)
            } else {
                wait_for.iter().filter_map(|topic| self.publishers.get(topic)).all(is_heard)
            };
            if ready {
                break;
            }
            tokio::time::sleep(LOOK_PERIOD).await;
        }
        tokio::time::sleep(Duration::from_secs_f64(self.settle_s.get())).await;
        tracing::info!("subscribers are there");
    }

    async fn play_messages(
        &mut self,
        mut messages: Receiver<Result<Recorded, BagError>>,
    ) -> Result<(), BagError> {
        let mut first: Option<(u64, Pace)> = None;
        while let Some(message) = messages.recv().await {
            let message = message?;
            let (start_ns, pace) = first.get_or_insert_with(|| {
                (message.log_time_ns, Pace::new(Instant::now(), message.log_time_ns, 0.0))
            });
            self.state.played_s = message.log_time_ns.saturating_sub(*start_ns) as f64 * 1e-9;
            self.wait_until_due(message.log_time_ns, pace).await;
            match (self.publishers.get(&message.topic), message.body) {
                (Some((publisher, is_latched)), Some(body))
                    if *is_latched || publisher.subscriptions() > 0 =>
                {
                    publisher.publish(body).await;
                    self.state.published += 1;
                }
                _ => self.state.passed_over += 1,
            }
        }
        Ok(())
    }

    /// Moves the clock on until the bag is at `bag_ns`, at the rate of the moment.
    async fn wait_until_due(&mut self, bag_ns: u64, pace: &mut Pace) {
        loop {
            let now = Instant::now();
            let is_paused = self.paused.get();
            self.state.rate = self.rate.get();
            self.state.stage = if is_paused { Stage::Paused } else { Stage::Playing };
            *pace = pace.with_rate(now, if is_paused { 0.0 } else { self.state.rate });
            if now >= self.next_tick {
                self.next_tick = now + CLOCK_PERIOD;
                self.report();
                self.publish_clock(pace.bag_ns(now).min(bag_ns)).await;
            }
            match pace.due(bag_ns) {
                Some(due) if due <= now && !is_paused => {
                    self.state.lag_s = (now - due).as_secs_f64();
                    return;
                }
                Some(due) if !is_paused => tokio::time::sleep_until(due.min(self.next_tick).into()).await,
                _ => tokio::time::sleep_until(self.next_tick.into()).await,
            }
        }
    }

    async fn publish_clock(&self, bag_ns: u64) {
        let sec = i32::try_from(bag_ns / 1_000_000_000).unwrap_or(i32::MAX);
        let nanosec = (bag_ns % 1_000_000_000) as u32;
        self.clock.publish(&Clock { clock: Time { sec, nanosec } }).await;
    }

    fn report(&self) {
        self.diagnostics.report("player", status(&self.state));
    }
}
