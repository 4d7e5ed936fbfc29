//! The node's state in words.

use gripsight_friction::{Estimate, Reason, Source};
use gripsight_runtime::{Level, Status};

/// Counts since the start.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Pictures read, usable or not.
    pub(crate) read: u64,
    /// Pictures refused.
    pub(crate) refused: u64,
    /// Pictures left out because a newer one was waiting, or had been read.
    pub(crate) dropped: u64,
    /// Pictures left out because they followed the last one read too closely to show another road.
    pub(crate) left_out: u64,
}

/// What the state is judged by.
pub(crate) struct Facts<'a> {
    /// Why there is no network, where one was wanted.
    pub(crate) no_network: Option<&'a str>,
    /// Whether the configured friction stands.
    pub(crate) configured: bool,
    pub(crate) counts: Counts,
    /// Pictures read since the last look.
    pub(crate) newly_read: u64,
    /// The last estimate.
    pub(crate) last: Option<&'a Estimate>,
    /// Whether odometry has arrived.
    pub(crate) odometry: bool,
    /// Longest time that reading a picture took since the last look, ms.
    pub(crate) longest_ms: f64,
    /// Lessons that the tires have given since the start, and the hash of what the track has taught.
    pub(crate) lessons: u64,
    pub(crate) calibration: &'a str,
}

/// ERROR: no network, or no pictures. WARN: the last picture is not usable, or there is no odometry.
pub(crate) fn status(facts: &Facts<'_>) -> Status {
    let refused = facts.last.and_then(|e| e.reason.map(|reason| (reason, e.detail.as_deref())));
    let (level, text) = if let Some(why) = facts.no_network {
        (Level::Error, format!("the configured friction stands, there is no network: {why}"))
    } else if facts.configured {
        (Level::Ok, "the configured friction stands, as asked for".to_owned())
    } else if facts.newly_read == 0 {
        (Level::Error, "no picture arrives".to_owned())
    } else if let Some((reason, detail)) = refused {
        let level = if reason == Reason::NetworkFailed { Level::Error } else { Level::Warn };
        (level, format!("the last picture is not usable: {}", detail.unwrap_or(reason.as_str())))
    } else if !facts.odometry {
        (Level::Warn, "no odometry: pictures are averaged by number, not by distance, and a frozen camera goes unnoticed".into())
    } else if facts.last.is_some_and(Estimate::new_floor) {
        (Level::Ok, "reading a floor that the track has not taught yet".to_owned())
    } else {
        (Level::Ok, "reading the road".to_owned())
    };
    let Counts { read, refused, dropped, left_out } = facts.counts;
    let status = Status::new(level, text)
        .value("pictures read", read)
        .value("pictures refused", refused)
        .value("pictures dropped for newer ones", dropped)
        .value("pictures left out as the same road", left_out)
        .value("lessons from the tires", facts.lessons)
        .value("calibration", facts.calibration)
        .value("longest time for a picture [ms]", format!("{:.1}", facts.longest_ms));
    match facts.last {
        Some(e) => status
            .value("source", if e.source == Source::Camera { "camera" } else { "configured" })
            .value("mu", format!("{:.3}", e.mu))
            .value("sigma", format!("{:.3}", e.sigma))
            .value("entropy", format!("{:.2}", e.entropy)),
        None => status,
    }
}

#[cfg(test)]
mod tests {
    use gripsight_friction::Known;
    use gripsight_runtime::manual_covers;

    use super::*;

    fn estimate(reason: Option<Reason>) -> Estimate {
        Estimate {
            stamp_ns: Some(0),
            source: Source::Camera,
            reason,
            detail: None,
            mu: 0.5,
            sigma: 0.1,
            probability: vec![0.2; 5],
            entropy: 0.3,
            energy: -2.0,
            unfamiliarity: Some(0.7),
            quality: None,
            appearance: None,
            network_mu: None,
            known: None,
            distance_m: 3.0,
            pictures: 4,
        }
    }

    #[test]
    fn the_manual_lists_every_state() {
        let (good, dark, failed) =
            (estimate(None), estimate(Some(Reason::Dark)), estimate(Some(Reason::NetworkFailed)));
        let unlike = Known { mu: 0.5, sigma: 0.1, distance: 1.2 };
        let new = Estimate { known: Some(unlike), ..estimate(None) };
        let states = [
            facts(&good),
            facts(&new),
            facts(&dark),
            facts(&failed),
            Facts { newly_read: 0, ..facts(&good) },
            Facts { newly_read: 0, configured: true, ..facts(&good) },
            Facts { odometry: false, ..facts(&good) },
            Facts { no_network: Some("no library"), ..facts(&good) },
        ];
        assert_eq!(manual_covers(include_str!("../README.md"), &states.map(|facts| status(&facts))), Ok(()));
    }

    fn facts(last: &Estimate) -> Facts<'_> {
        Facts {
            no_network: None,
            configured: false,
            counts: Counts::default(),
            newly_read: 30,
            last: Some(last),
            odometry: true,
            longest_ms: 2.0,
            lessons: 0,
            calibration: "",
        }
    }

    #[test]
    fn each_condition_has_its_level() {
        let (good, dark, failed) =
            (estimate(None), estimate(Some(Reason::Dark)), estimate(Some(Reason::NetworkFailed)));
        assert_eq!(status(&facts(&good)).level, Level::Ok);
        assert_eq!(status(&Facts { newly_read: 0, ..facts(&good) }).level, Level::Error);
        assert_eq!(status(&Facts { odometry: false, ..facts(&good) }).level, Level::Warn);
        assert_eq!(status(&facts(&failed)).level, Level::Error);
        let warned = status(&facts(&dark));
        assert_eq!((warned.level, warned.message.contains("dark")), (Level::Warn, true));
        assert_eq!(status(&Facts { newly_read: 0, configured: true, ..facts(&good) }).level, Level::Ok);
        let missing = status(&Facts { no_network: Some("no library"), ..facts(&good) });
        assert_eq!((missing.level, missing.message.contains("no library")), (Level::Error, true));
    }
}
