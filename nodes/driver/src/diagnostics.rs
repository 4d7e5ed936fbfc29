//! How the driver is, from what the node knows.

use gripsight_driving::Solves;
use gripsight_runtime::{Level, Status};

use crate::laps::Lap;

/// What the node knows.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Facts {
    /// The odometry is too old to drive by.
    pub(crate) blind: bool,
    /// Age of the odometry when its command went out.
    pub(crate) age_s: f64,
    /// How far the car is outside of the track's edge.
    pub(crate) outside_m: Option<f64>,
    /// Grip (acceleration over g) that is planned with, and whether a slide or a warning holds it back.
    pub(crate) grip: f64,
    pub(crate) held_back: bool,
    /// Why the last set was not taken.
    pub(crate) refused: Option<String>,
    /// The last extended model taken, and why the last one was not.
    pub(crate) model: String,
    pub(crate) model_refused: Option<String>,
    /// A model was given back.
    pub(crate) given_back: bool,
    /// Sets taken, and what the one in use rests on.
    pub(crate) sets: u32,
    pub(crate) rests_on: &'static str,
    pub(crate) last_lap: Option<Lap>,
    /// How predictive control did, where it was chosen, and whether the pursuit has steered in its place since the last report.
    pub(crate) solves: Option<Solves>,
    pub(crate) replaced: bool,
}

/// ERROR where the car cannot be driven; WARN off the track, held back, or on tires that nobody measured.
pub(crate) fn status(facts: &Facts) -> Status {
    let (level, message) = if facts.blind {
        (Level::Error, "no odometry: braking".to_owned())
    } else if let Some(outside_m) = facts.outside_m {
        (Level::Warn, format!("off the track by {outside_m:.2} m"))
    } else if let Some(why) = &facts.refused {
        (Level::Warn, format!("the last set was not taken: {why}"))
    } else if let Some(why) = &facts.model_refused {
        (Level::Warn, format!("the extended model was not taken: {why}"))
    } else if let Some(solves) = facts.solves.filter(|_| facts.replaced) {
        let text = format!(
            "predictive control did not converge: the pursuit steered, {} commands so far",
            solves.not_converged
        );
        (Level::Warn, text)
    } else if facts.held_back {
        let text =
            format!("held back to a grip of {:.2}: the road gave less than the set promises", facts.grip);
        (Level::Warn, text)
    } else if facts.sets == 0 {
        (Level::Warn, "no set so far: driving on the start's tires".to_owned())
    } else {
        (Level::Ok, "driving".to_owned())
    };
    let status = Status::new(level, message)
        .value("grip planned (g)", format!("{:.3}", facts.grip))
        .value("age of the odometry (s)", format!("{:.3}", facts.age_s))
        .value("sets taken", facts.sets)
        .value("tires", facts.rests_on)
        .value("extended model", if facts.model.is_empty() { "none" } else { &facts.model });
    let status = match &facts.solves {
        None => status.value("controller", "pursuit"),
        Some(solves) => status
            .value("controller", "mpc")
            .value("commands of the controller", solves.commands)
            .value("of the pursuit, not converged", solves.not_converged)
            .value("of the pursuit, too slow a car", solves.slow),
    };
    match &facts.last_lap {
        None => status,
        Some(lap) => status
            .value("last lap (s)", format!("{:.2}", lap.time_s))
            .value("laps", lap.number)
            .value("largest distance to the line (m)", format!("{:.2}", lap.worst_m)),
    }
}

#[cfg(test)]
mod tests {
    use gripsight_runtime::manual_covers;

    use super::*;

    #[test]
    fn levels() {
        let driving = Facts { sets: 1, grip: 0.8, ..Facts::default() };
        assert_eq!(status(&driving).level, Level::Ok);
        let cases = [
            (Facts { blind: true, ..driving.clone() }, Level::Error, "braking"),
            (Facts { outside_m: Some(0.12), ..driving.clone() }, Level::Warn, "off the track by 0.12 m"),
            (Facts { refused: Some("of another car".into()), ..driving.clone() }, Level::Warn, "another car"),
            (Facts { model_refused: Some("no better".into()), ..driving.clone() }, Level::Warn, "no better"),
            (
                Facts {
                    solves: Some(Solves { not_converged: 3, ..Solves::default() }),
                    replaced: true,
                    ..driving.clone()
                },
                Level::Warn,
                "the pursuit steered, 3 commands",
            ),
            (Facts { held_back: true, ..driving.clone() }, Level::Warn, "grip of 0.80"),
            (Facts { sets: 0, ..driving }, Level::Warn, "start's tires"),
        ];
        let said: Vec<Status> = cases
            .into_iter()
            .map(|(facts, level, part)| {
                let status = status(&facts);
                assert!(status.level == level && status.message.contains(part), "{status:?}");
                status
            })
            .collect();
        assert_eq!(manual_covers(include_str!("../README.md"), &said), Ok(()));
    }
}
