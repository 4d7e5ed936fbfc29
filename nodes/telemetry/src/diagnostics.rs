//! The node's state in words.

use gripsight_runtime::{Level, Status};

use crate::buffer::Counts;

/// What the state is judged by.
pub(crate) struct Facts<'a> {
    pub(crate) counts: Counts,
    /// Messages taken since the last look, by stream.
    pub(crate) new: [usize; 4],
    /// Messages left out since the last look.
    pub(crate) newly_rejected: usize,
    /// Samples in the open window, and its length.
    pub(crate) filling: (usize, f64),
    pub(crate) last_problem: Option<&'a str>,
    /// Why the last window is not worth an identification.
    pub(crate) insufficient: Option<&'a str>,
}

/// ERROR: nothing arrives on `odom` or `drive`. WARN: messages were left out, or the last window is not worth an identification.
pub(crate) fn status(facts: &Facts<'_>) -> Status {
    let [odometry, drive, ..] = facts.new;
    let (level, text) = if odometry == 0 && drive == 0 {
        (Level::Error, "nothing arrives on odom and drive".to_owned())
    } else if odometry == 0 {
        (Level::Error, "nothing arrives on odom".to_owned())
    } else if drive == 0 {
        (Level::Error, "nothing arrives on drive".to_owned())
    } else if facts.newly_rejected > 0 {
        let last = facts.last_problem.unwrap_or("repeated stamps");
        (Level::Warn, format!("{} messages left out; last: {last}", facts.newly_rejected))
    } else if let Some(reason) = facts.insufficient {
        (Level::Warn, format!("the last window is not worth an identification: {reason}"))
    } else {
        (Level::Ok, "collecting".to_owned())
    };
    let Counts { taken, rejected, without_drive, clock_jumps, sequences } = facts.counts;
    Status::new(level, text)
        .value("messages odom, drive, imu, wheels", format!("{taken:?}"))
        .value("messages left out", rejected)
        .value("odometry without a drive command", without_drive)
        .value("clock jumps back", clock_jumps)
        .value("samples in the open window", facts.filling.0)
        .value("window [s]", facts.filling.1)
        .value("sequences published", sequences)
}

#[cfg(test)]
mod tests {
    use gripsight_runtime::manual_covers;

    use super::*;

    fn facts() -> Facts<'static> {
        Facts {
            counts: Counts::default(),
            new: [100, 50, 0, 0],
            newly_rejected: 0,
            filling: (10, 30.0),
            last_problem: None,
            insufficient: None,
        }
    }

    #[test]
    fn each_condition_has_its_level() {
        assert_eq!(status(&facts()).level, Level::Ok);
        assert_eq!(status(&Facts { new: [0, 50, 0, 0], ..facts() }).level, Level::Error);
        assert!(status(&Facts { new: [9, 0, 0, 0], ..facts() }).message.contains("drive"));
        let rejected = status(&Facts { newly_rejected: 3, last_problem: Some("v_x is NaN"), ..facts() });
        assert_eq!((rejected.level, rejected.message.contains("NaN")), (Level::Warn, true));
    }

    #[test]
    fn the_manual_lists_every_state() {
        let states = [
            facts(),
            Facts { new: [0, 0, 3, 3], ..facts() },
            Facts { new: [0, 50, 0, 0], ..facts() },
            Facts { new: [9, 0, 0, 0], ..facts() },
            Facts { newly_rejected: 3, ..facts() },
            Facts { insufficient: Some("too slow"), ..facts() },
        ];
        assert_eq!(manual_covers(include_str!("../README.md"), &states.map(|facts| status(&facts))), Ok(()));
    }
}
