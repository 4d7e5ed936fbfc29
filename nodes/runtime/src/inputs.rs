//! Says where a topic that a node needs brings nothing: which topic, what the node asked for, and who publishes there.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use ros2_client::qos::{Durability, Reliability};
use rustdds::DomainParticipant;
use rustdds::discovery::DiscoveredWriterData;
use rustdds::policy;
use tokio::time::Instant;

use crate::diagnostics::{Diagnostics, Level, Status};
use crate::qos::Qos;

/// Silence that is told.
const SILENCE: Duration = Duration::from_secs(5);
/// What has been told and is still so is told again after this.
const AGAIN: Duration = Duration::from_secs(60);
/// Topics named as having the right type.
const MOST_HINTS: usize = 3;

/// What arrives on a topic. Clones count the same.
#[derive(Clone, Debug)]
pub struct Arrivals {
    topic: String,
    type_name: &'static str,
    qos: Qos,
    count: Arc<AtomicU64>,
}

impl Arrivals {
    pub(crate) fn new(topic: String, type_name: &'static str, qos: Qos) -> Self {
        Self { topic, type_name, qos, count: Arc::default() }
    }

    pub(crate) fn add(&self) {
        self.count.fetch_add(1, Ordering::Relaxed);
    }

    fn count(&self) -> u64 {
        self.count.load(Ordering::Relaxed)
    }
}

/// Looks once a second whether something arrives on one of `needed`, for as long as it is polled.
pub(crate) async fn watch(
    needed: Vec<Arrivals>,
    participant: DomainParticipant,
    domain_id: u16,
    diagnostics: Diagnostics,
) {
    let names: Vec<&str> = needed.iter().map(|topic| topic.topic.as_str()).collect();
    let (names, part) = (names.join(" and "), format!("input {}", names.join(", ")));
    let mut silence = Silence::new(Instant::now());
    let mut looks = tokio::time::interval(Duration::from_secs(1));
    loop {
        looks.tick().await;
        let count = needed.iter().map(Arrivals::count).sum();
        let told = silence.look(Instant::now(), count, || {
            let publishers: Vec<Publisher> =
                participant.discovered_writers().iter().filter_map(Publisher::of).collect();
            let topics = needed.iter().map(|topic| explain(topic, &publishers));
            format!("{} (ROS_DOMAIN_ID={domain_id})", topics.collect::<Vec<_>>().join("; "))
        });
        match told {
            Told::Nothing => {}
            Told::Silent { text, news } => {
                if news {
                    tracing::warn!("{text}");
                }
                diagnostics.report(&part, Status::new(Level::Warn, text));
            }
            Told::Arrives { after_silence } => {
                if after_silence {
                    tracing::info!("messages arrive on {names}");
                }
                diagnostics.report(&part, Status::new(Level::Ok, "messages arrive"));
            }
        }
    }
}

/// What there is to say after a look.
#[derive(Debug, PartialEq)]
enum Told {
    Nothing,
    Silent { text: String, news: bool },
    Arrives { after_silence: bool },
}

/// When messages were last seen, and what was said about it.
struct Silence {
    count: u64,
    since: Instant,
    said: Option<(String, Instant)>,
}

impl Silence {
    fn new(now: Instant) -> Self {
        Self { count: 0, since: now, said: None }
    }

    fn look(&mut self, now: Instant, count: u64, why: impl FnOnce() -> String) -> Told {
        if count != self.count {
            (self.count, self.since) = (count, now);
            return Told::Arrives { after_silence: self.said.take().is_some() };
        }
        if now - self.since < SILENCE {
            return Told::Nothing;
        }
        let text = why();
        let news = match &self.said {
            Some((said, when)) => *said != text || now - *when >= AGAIN,
            None => true,
        };
        if news {
            self.said = Some((text.clone(), now));
        }
        Told::Silent { text, news }
    }
}

/// A publisher of another process.
#[derive(Clone, Debug)]
struct Publisher {
    topic: String,
    type_name: String,
    reliable: bool,
    latched: bool,
}

impl Publisher {
    /// `None` for what is no ROS 2 topic.
    fn of(writer: &DiscoveredWriterData) -> Option<Self> {
        let data = &writer.publication_topic_data;
        Some(Self {
            topic: data.topic_name.strip_prefix("rt")?.to_owned(),
            type_name: data
                .type_name
                .replace("::", "/")
                .replace("/dds_/", "/")
                .trim_end_matches('_')
                .to_owned(),
            reliable: matches!(data.reliability, Some(policy::Reliability::Reliable { .. })),
            latched: !matches!(data.durability, None | Some(policy::Durability::Volatile)),
        })
    }

    /// Why its messages cannot arrive at a subscription, if so.
    fn misfit(&self, asked: &Arrivals) -> Option<String> {
        let (reliable, latched) = asks(asked.qos);
        if self.type_name != asked.type_name {
            Some(format!("of another type, {}", self.type_name))
        } else if reliable && !self.reliable {
            Some("incompatible: it offers best effort, reliable is asked for".to_owned())
        } else if latched && !self.latched {
            Some("incompatible: it offers volatile, transient local is asked for".to_owned())
        } else {
            None
        }
    }
}

/// Whether a quality of service is reliable, and whether it is transient local.
fn asks(qos: Qos) -> (bool, bool) {
    let profile = qos.profile();
    (profile.reliability != Reliability::BestEffort, profile.durability == Durability::TransientLocal)
}

fn qos_text(reliable: bool, latched: bool) -> String {
    let reliability = if reliable { "reliable" } else { "best effort" };
    format!("{reliability}, {}", if latched { "transient local" } else { "volatile" })
}

fn explain(asked: &Arrivals, publishers: &[Publisher]) -> String {
    let Arrivals { topic, type_name, qos, .. } = asked;
    let (reliable, latched) = asks(*qos);
    let here: Vec<&Publisher> = publishers.iter().filter(|publisher| publisher.topic == *topic).collect();
    let who = match here.as_slice() {
        [] => format!("nobody publishes there{}", hints(asked, publishers)),
        _ => {
            let each = here.iter().map(|publisher| match publisher.misfit(asked) {
                Some(misfit) => misfit,
                None => format!(
                    "{}, which fits but sends nothing",
                    qos_text(publisher.reliable, publisher.latched)
                ),
            });
            let number = here.len();
            let plural = if number == 1 { "" } else { "s" };
            format!("{number} publisher{plural}: {}", each.collect::<Vec<_>>().join("; "))
        }
    };
    format!("nothing arrives on {topic} ({type_name}, {}): {who}", qos_text(reliable, latched))
}

/// Topics that could have been meant.
fn hints(asked: &Arrivals, publishers: &[Publisher]) -> String {
    let mut topics: Vec<&str> = publishers
        .iter()
        .filter(|publisher| publisher.type_name == asked.type_name)
        .map(|publisher| publisher.topic.as_str())
        .collect();
    topics.sort_unstable();
    topics.dedup();
    topics.truncate(MOST_HINTS);
    if topics.is_empty() {
        return String::new();
    }
    format!("; messages of this type are on {} (remap it, or name it in the stack's file)", topics.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(qos: Qos) -> Arrivals {
        Arrivals::new("/odom".to_owned(), "nav_msgs/msg/Odometry", qos)
    }

    fn publisher(topic: &str, type_name: &str, reliable: bool) -> Publisher {
        Publisher { topic: topic.into(), type_name: type_name.into(), reliable, latched: false }
    }

    #[test]
    fn the_line_names_topic_quality_and_publishers() {
        let odometry = "nav_msgs/msg/Odometry";
        let none = explain(&asked(Qos::sensor(5)), &[publisher("/car/odom", odometry, true)]);
        assert_eq!(
            none,
            "nothing arrives on /odom (nav_msgs/msg/Odometry, best effort, volatile): nobody publishes there; messages of \
             this type are on /car/odom (remap it, or name it in the stack's file)"
        );
        let misfit = explain(&asked(Qos::replay()), &[publisher("/odom", odometry, false)]);
        assert!(misfit.ends_with("1 publisher: incompatible: it offers best effort, reliable is asked for"));
        let latched = explain(&asked(Qos::latched()), &[publisher("/odom", odometry, true)]);
        assert!(latched.contains("it offers volatile"), "{latched}");
        let other = explain(&asked(Qos::sensor(5)), &[publisher("/odom", "std_msgs/msg/String", true)]);
        assert!(other.contains("of another type, std_msgs/msg/String"), "{other}");
        let silent = explain(&asked(Qos::sensor(5)), &[publisher("/odom", odometry, true)]);
        assert!(
            silent.ends_with("1 publisher: reliable, volatile, which fits but sends nothing"),
            "{silent}"
        );
    }

    #[test]
    fn silence_is_told_once_until_something_changes() {
        let start = Instant::now();
        let mut silence = Silence::new(start);
        let mut look = |s: u64, count: u64, why: &str| {
            silence.look(start + Duration::from_secs(s), count, || why.to_owned())
        };
        let silent = |text: &str, news: bool| Told::Silent { text: text.to_owned(), news };
        assert_eq!(look(4, 0, "a"), Told::Nothing);
        assert_eq!(look(5, 0, "a"), silent("a", true));
        assert_eq!(look(6, 0, "a"), silent("a", false));
        assert_eq!(look(7, 0, "b"), silent("b", true));
        assert_eq!(look(67, 0, "b"), silent("b", true));
        assert_eq!(look(68, 3, "b"), Told::Arrives { after_silence: true });
        assert_eq!(look(69, 4, "b"), Told::Arrives { after_silence: false });
        assert_eq!(look(73, 4, "b"), Told::Nothing);
        assert_eq!(look(74, 4, "a"), silent("a", true));
    }
}
