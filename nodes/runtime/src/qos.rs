//! Quality of service, always explicit: ros2-client's defaults differ from rclcpp's.

use std::time::Duration;

use ros2_client::QosProfile;
use ros2_client::qos::{Durability, History, Liveliness, Reliability, WhenFull};

/// A quality of service that the suite uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Qos {
    reliable: bool,
    latched: bool,
    depth: usize,
    lifespan: Option<Duration>,
    patience: Duration,
}

/// How long a writer whose readers have taken nothing of what it keeps for them waits before the oldest makes room.
const PATIENCE: Duration = Duration::from_secs(1);
/// And that of a bag's messages, of which none shall be lost: longer than it takes to notice that a reader has died (20 s with Fast DDS).
const REPLAY_PATIENCE: Duration = Duration::from_secs(30);

impl Qos {
    /// Samples that a reader waits for in a replay before the oldest is lost. The writer waits for
    /// the reader's acknowledgement long before.
    const REPLAY_DEPTH: usize = 10_000;

    /// Sensor data: best effort, the newest `depth` samples.
    pub const fn sensor(depth: usize) -> Self {
        Self { reliable: false, latched: false, depth, lifespan: None, patience: PATIENCE }
    }

    /// Data whose every sample counts, from one writer to readers that are there.
    pub const fn reliable(depth: usize) -> Self {
        Self { reliable: true, ..Self::sensor(depth) }
    }

    /// A bag's data at any speed: reliable and deep enough that nothing is lost.
    pub const fn replay() -> Self {
        Self::reliable(Self::REPLAY_DEPTH)
    }

    /// A result: reliable, and the last one reaches those who join later.
    pub const fn latched() -> Self {
        Self { latched: true, ..Self::reliable(1) }
    }

    /// The same with another depth: results that travel in several messages.
    #[must_use]
    pub const fn with_depth(self, depth: usize) -> Self {
        Self { depth, ..self }
    }

    /// The same for a writer that waits for half a minute before a reader that stands still loses anything.
    #[must_use]
    pub const fn patient(self) -> Self {
        Self { patience: REPLAY_PATIENCE, ..self }
    }

    /// As `/rosout` has it in rclcpp: reliable, the last 1000 lines of the last ten seconds.
    pub(crate) const fn rosout() -> Self {
        Self { latched: true, lifespan: Some(Duration::from_secs(10)), ..Self::reliable(1000) }
    }

    /// Samples kept.
    pub(crate) const fn depth(self) -> usize {
        self.depth
    }

    /// How long a message waits for room.
    pub(crate) const fn patience(self) -> Duration {
        self.patience
    }

    pub(crate) fn profile(self) -> QosProfile {
        QosProfile {
            reliability: if self.reliable {
                Reliability::Reliable { when_full: WhenFull::Wait(self.patience) }
            } else {
                Reliability::BestEffort
            },
            durability: if self.latched { Durability::TransientLocal } else { Durability::Volatile },
            history: History::KeepLast { depth: self.depth },
            deadline: None,
            lifespan: self.lifespan,
            liveliness: Liveliness::Automatic,
            liveliness_lease: None,
        }
    }
}
