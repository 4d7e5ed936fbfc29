//! What can go wrong with a topic.

use std::fmt;

use anyhow::{Context as _, bail};

/// The topics that pass through the node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Topic {
    Odom,
    Drive,
    Imu,
    Wheels,
    Picture,
}

impl Topic {
    pub(crate) const ALL: [Self; 5] = [Self::Odom, Self::Drive, Self::Imu, Self::Wheels, Self::Picture];

    /// Its relative name.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Odom => "odom",
            Self::Drive => "drive",
            Self::Imu => "imu",
            Self::Wheels => "wheels",
            Self::Picture => "image/compressed",
        }
    }

    pub(crate) fn by_name(name: &str) -> anyhow::Result<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name).with_context(|| {
            format!("topic `{name}`: expected one of {}", Self::ALL.map(Self::name).join(", "))
        })
    }
}

/// Kinds of faults. What a fault's size means stands beside each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) enum Kind {
    /// Messages are lost; share of them.
    Drop,
    /// They come late; s of the messages' own time.
    Delay,
    /// They come twice; share of them.
    Duplicate,
    /// They come in another order; how many are turned round at a time.
    Reorder,
    /// Their bytes are not what was sent; share of them.
    Corrupt,
    /// Values stand still while stamps go on.
    Freeze,
    /// Values are not numbers.
    Nan,
    /// Stamps are off; s.
    Time,
    /// The frame is another.
    Frame,
    /// Only each n-th comes; n.
    Rate,
    /// Degrees, km/h and g in place of the units of ROS.
    Units,
    /// A second source speaks on the same topic, its values times one plus the size.
    Second,
    /// The camera sees nothing.
    Dark,
}

impl Kind {
    pub(crate) const ALL: [Self; 13] = [
        Self::Drop,
        Self::Delay,
        Self::Duplicate,
        Self::Reorder,
        Self::Corrupt,
        Self::Freeze,
        Self::Nan,
        Self::Time,
        Self::Frame,
        Self::Rate,
        Self::Units,
        Self::Second,
        Self::Dark,
    ];

    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Drop => "drop",
            Self::Delay => "delay",
            Self::Duplicate => "duplicate",
            Self::Reorder => "reorder",
            Self::Corrupt => "corrupt",
            Self::Freeze => "freeze",
            Self::Nan => "nan",
            Self::Time => "time",
            Self::Frame => "frame",
            Self::Rate => "rate",
            Self::Units => "units",
            Self::Second => "second",
            Self::Dark => "dark",
        }
    }

    pub(crate) fn by_name(name: &str) -> anyhow::Result<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).with_context(|| {
            format!("fault `{name}`: expected one of {}", Self::ALL.map(Self::name).join(", "))
        })
    }

    /// Smallest and largest size that is drawn; what is stated may lie outside.
    pub(crate) fn sizes(self) -> [f64; 2] {
        match self {
            Self::Drop | Self::Duplicate | Self::Corrupt => [0.05, 1.0],
            Self::Delay => [0.02, 2.0],
            Self::Reorder => [2.0, 20.0],
            Self::Time => [0.01, 100.0],
            Self::Rate => [2.0, 20.0],
            Self::Second => [0.02, 1.0],
            Self::Freeze | Self::Nan | Self::Frame | Self::Units | Self::Dark => [1.0, 1.0],
        }
    }

    /// Whether the kind means anything for a topic.
    pub(crate) fn concerns(self, topic: Topic) -> bool {
        match self {
            Self::Dark => topic == Topic::Picture,
            Self::Nan | Self::Units | Self::Second => topic != Topic::Picture,
            _ => true,
        }
    }
}

/// A fault of a topic, from `start_s` after the first message on.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Fault {
    pub(crate) kind: Kind,
    pub(crate) topic: Topic,
    pub(crate) start_s: f64,
    pub(crate) duration_s: f64,
    /// What it means stands with the kind.
    pub(crate) size: f64,
}

impl Fault {
    /// Reads `KIND TOPIC START_S DURATION_S SIZE`, as faults are written.
    pub(crate) fn parse(text: &str) -> anyhow::Result<Self> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let [kind, topic, numbers @ ..] = words.as_slice() else {
            bail!("fault `{text}`: expected `KIND TOPIC START_S DURATION_S SIZE`");
        };
        let numbers = numbers
            .iter()
            .map(|number| number.parse::<f64>().ok().filter(|number| number.is_finite()))
            .collect::<Option<Vec<_>>>();
        let Some([start_s, duration_s, size]) = numbers.as_deref() else {
            bail!("fault `{text}`: expected three numbers (START_S DURATION_S SIZE) after the topic");
        };
        let (kind, topic) = (Kind::by_name(kind)?, Topic::by_name(topic)?);
        if !kind.concerns(topic) {
            bail!("fault `{text}`: `{}` means nothing on {}", kind.name(), topic.name());
        }
        Ok(Self { kind, topic, start_s: *start_s, duration_s: *duration_s, size: *size })
    }

    /// When it is over, in s after the first message.
    pub(crate) fn end_s(&self) -> f64 {
        self.start_s + self.duration_s
    }

    pub(crate) fn is_at_work(&self, time_s: f64) -> bool {
        (self.start_s..self.end_s()).contains(&time_s)
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, topic, start_s, duration_s, size } = self;
        write!(formatter, "{} {} {start_s:.3} {duration_s:.3} {size:.4}", kind.name(), topic.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_as_they_are_written() {
        let fault = Fault::parse("delay odom 12 1.5 0.25").unwrap();
        assert_eq!((fault.kind, fault.topic, fault.end_s()), (Kind::Delay, Topic::Odom, 13.5));
        assert!(fault.is_at_work(12.0) && !fault.is_at_work(13.5) && !fault.is_at_work(11.9));
        assert_eq!(Fault::parse(&fault.to_string()).unwrap(), fault);
    }

    #[test]
    fn what_is_wrong_is_named() {
        for (text, part) in [
            ("drop", "KIND TOPIC"),
            ("lose odom 1 2 3", "lose"),
            ("drop odometry 1 2 3", "odometry"),
            ("drop odom 1 2", "three numbers"),
            ("drop odom 1 2 NaN", "three numbers"),
            ("dark odom 1 2 3", "means nothing"),
        ] {
            let message = Fault::parse(text).unwrap_err().to_string();
            assert!(message.contains(part), "{text}: {message}");
        }
    }
}
