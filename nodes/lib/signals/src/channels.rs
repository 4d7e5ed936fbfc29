//! The one table of channels: what a sequence holds, on which stamps, in which unit, and how it is checked.
//!
//! The sequence, the evenly sampled [`crate::Segment`], the message that carries a sequence and the checks are all made from
//! [`for_each_channel`]. A channel more is a row here and a line in `StateSequence.msg` (a test compares the two).

use serde::Serialize;

/// The stamps that a channel stands on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// Those of the odometry: `time_s`.
    Samples,
    /// Those of the commands as received: `command_time_s`. A value holds from its stamp to the next.
    Commands,
    /// Those of a localisation of its own: `pose_time_s`.
    Poses,
}

impl Clock {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Samples, Self::Commands, Self::Poses];
}

/// What kind of quantity a channel holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Stamps.
    Time,
    /// What a sensor or an estimator says of the motion.
    Measured,
    /// What was asked for.
    Command,
}

/// A row of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Channel {
    /// Its name, with the unit.
    pub name: &'static str,
    /// Its unit, as text.
    pub unit: &'static str,
    /// The stamps that it stands on.
    pub clock: Clock,
    /// Whether a sequence without it is none.
    pub required: bool,
    /// What it holds.
    pub kind: Kind,
    /// What it means.
    pub meaning: &'static str,
}

/// Gives the whole table to a macro: rows of `name, clock, required, kind, unit, meaning`. The stamps of a clock come before
/// its channels, and `time_s` first of all.
#[macro_export]
macro_rules! for_each_channel {
    ($callback:path) => {
        $callback! {
            time_s, Samples, true, Time, "s", "after header.stamp; strictly increasing, gaps and jitter kept as they were";
            v_x_mps, Samples, true, Measured, "m/s", "forward speed";
            v_y_mps, Samples, true, Measured, "m/s", "lateral speed, left positive; zero throughout where nothing measures it";
            yaw_rate_radps, Samples, true, Measured, "rad/s", "yaw rate, left turn positive";
            steering_rad, Samples, true, Command, "rad", "steering in force at the stamp: the command held, without one the measured angle; left positive";
            measured_steering_rad, Samples, false, Measured, "rad", "steering as a sensor reports it, left positive";
            x_m, Samples, false, Measured, "m", "position, relative to the first sample";
            y_m, Samples, false, Measured, "m", "position, relative to the first sample";
            yaw_rad, Samples, false, Measured, "rad", "heading in the frame of the pose, unwrapped";
            a_x_mps2, Samples, false, Measured, "m/s^2", "specific force of the inertial sensor, forward positive";
            a_y_mps2, Samples, false, Measured, "m/s^2", "specific force of the inertial sensor, left positive";
            gyro_yaw_rate_radps, Samples, false, Measured, "rad/s", "yaw rate of the inertial sensor, left turn positive";
            wheel_speed_fl_radps, Samples, false, Measured, "rad/s", "front left wheel, forward positive";
            wheel_speed_fr_radps, Samples, false, Measured, "rad/s", "front right wheel, forward positive";
            wheel_speed_rl_radps, Samples, false, Measured, "rad/s", "rear left wheel, forward positive";
            wheel_speed_rr_radps, Samples, false, Measured, "rad/s", "rear right wheel, forward positive";
            wheel_effort_front_nm, Samples, false, Measured, "N m", "torque on both front wheels together, driving positive";
            wheel_effort_rear_nm, Samples, false, Measured, "N m", "torque on both rear wheels together, driving positive";
            command_time_s, Commands, false, Time, "s", "stamps of the commands after header.stamp, from two seconds before it on; negative before it";
            command_steering_rad, Commands, false, Command, "rad", "commanded steering angle from its stamp to the next, left positive";
            command_speed_mps, Commands, false, Command, "m/s", "commanded speed";
            command_acceleration_mps2, Commands, false, Command, "m/s^2", "commanded acceleration";
            pose_time_s, Poses, false, Time, "s", "stamps of a localisation with a topic of its own, after header.stamp";
            pose_x_m, Poses, false, Measured, "m", "its position, relative to its first of the sequence";
            pose_y_m, Poses, false, Measured, "m", "its position, relative to its first of the sequence";
            pose_yaw_rad, Poses, false, Measured, "rad", "its heading, unwrapped";
        }
    };
}

macro_rules! table {
    ($($name:ident, $clock:ident, $required:literal, $kind:ident, $unit:literal, $meaning:literal;)*) => {
        /// Every channel, in the order in which sequences hold and messages carry them.
        pub const CHANNELS: &[Channel] = &[$(Channel {
            name: stringify!($name),
            unit: $unit,
            clock: Clock::$clock,
            required: $required,
            kind: Kind::$kind,
            meaning: $meaning,
        }),*];
    };
}

for_each_channel!(table);

impl Channel {
    /// The row of a name; `None` for a name that is no channel's.
    #[must_use]
    pub fn of(name: &str) -> Option<&'static Self> {
        CHANNELS.iter().find(|channel| channel.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_each_clock_begins_with_its_stamps() {
        for (place, channel) in CHANNELS.iter().enumerate() {
            assert_eq!(CHANNELS.iter().position(|c| c.name == channel.name), Some(place));
        }
        for clock in Clock::ALL {
            let first = CHANNELS.iter().find(|c| c.clock == clock).unwrap();
            assert_eq!((first.kind, first.unit), (Kind::Time, "s"));
            assert_eq!(CHANNELS.iter().filter(|c| c.clock == clock && c.kind == Kind::Time).count(), 1);
        }
        assert_eq!(Channel::of("a_y_mps2").map(|c| c.unit), Some("m/s^2"));
        assert_eq!(Channel::of("a_y"), None);
    }
}
