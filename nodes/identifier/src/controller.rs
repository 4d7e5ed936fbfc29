//! Hands Phi_p on to a controller that takes it as parameters.

use std::time::Duration;

use anyhow::bail;
use gripsight_msgs::{Grip, MagicFormula, PacejkaParams};
use gripsight_runtime::{Descriptor, Diagnostics, Node, ParameterClient, ParameterValue, SetError};
use tokio::sync::watch;
use tokio::time::MissedTickBehavior;

use crate::diagnostics::controller_status;

/// How often is looked whether the controller is there, and tried again.
const LOOK: Duration = Duration::from_secs(1);
/// Share of the promised grip to go on with after a set is withdrawn without a figure.
const WITHDRAWN: f64 = 0.7;

type Of = fn(&PacejkaParams) -> f64;

/// What a controller can be told of a set, by name.
const FIGURES: [(&str, Of); 12] = [
    ("front.b", |set| set.front.b),
    ("front.c", |set| set.front.c),
    ("front.d", |set| set.front.d),
    ("front.e", |set| set.front.e),
    ("rear.b", |set| set.rear.b),
    ("rear.c", |set| set.rear.c),
    ("rear.d", |set| set.rear.d),
    ("rear.e", |set| set.rear.e),
    (GRIP, promised),
    ("steering_delay_s", |set| set.signals.steering_delay_s.max(0.0)),
    ("steering_gain", |set| set.signals.steering_gain),
    ("steering_offset_rad", |set| set.signals.steering_offset_rad),
];

/// The one figure that falls where the road gives less than the set promises.
const GRIP: &str = "grip";

/// Grip (lateral acceleration over g) that a set promises: the weaker axle's.
fn promised(set: &PacejkaParams) -> f64 {
    let axle = |force_n: f64, load_n: f64, tire: &MagicFormula| {
        let share = force_n / load_n;
        if share.is_finite() { share.min(tire.d) } else { tire.d }
    };
    let front = axle(set.front_valid_force_n, set.front_load_n, &set.front);
    front.min(axle(set.rear_valid_force_n, set.rear_load_n, &set.rear))
}

/// What the controller is to have.
#[derive(Debug, Clone, PartialEq)]
struct Wanted {
    set: PacejkaParams,
    /// Share of the promised grip that is left.
    left: f64,
}

/// A controller that is told each set as parameters.
pub(crate) struct Controller {
    client: ParameterClient,
    /// The controller's name of each figure.
    names: Vec<(String, &'static str, Of)>,
    wanted: watch::Sender<Option<Wanted>>,
}

impl Controller {
    /// Declares the parameters; none where no controller is named.
    pub(crate) fn declare(node: &mut Node) -> anyhow::Result<Option<Self>> {
        let name = node.parameter(
            "controller_node",
            String::new(),
            Descriptor::new("Node that is told each set by its service set_parameters; empty: none")
                .read_only(),
        )?;
        let names = node.parameter(
            "controller_parameters",
            FIGURES[..9].iter().map(|(figure, _)| format!("{figure}={figure}")).collect::<Vec<_>>(),
            Descriptor::new("Which of its parameters holds which figure of a set: THEIRS=FIGURE").read_only(),
        )?;
        if name.get().is_empty() {
            return Ok(None);
        }
        let names = mapping(&names.get())?;
        if !names.iter().any(|(_, figure, _)| *figure == GRIP) {
            tracing::warn!(
                "no parameter of {} holds `{GRIP}`: a withdrawn set does not slow it down",
                name.get()
            );
        }
        let client = node.parameter_client(&name.get())?;
        Ok(Some(Self { client, names, wanted: watch::Sender::new(None) }))
    }

    /// Takes what goes out on the MPC's topic.
    pub(crate) fn take(&self, message: &PacejkaParams) {
        if message.status == PacejkaParams::WITHDRAWN {
            // What the warning before it said is the better figure.
            self.falls(|left| if left < 1.0 { left } else { WITHDRAWN });
        } else {
            self.wanted.send_replace(Some(Wanted { set: message.clone(), left: 1.0 }));
        }
    }

    /// Takes how the set in use grips.
    pub(crate) fn feel(&self, grip: &Grip) {
        if grip.fallen {
            let share = if grip.share.is_finite() { grip.share.clamp(0.05, 1.0) } else { WITHDRAWN };
            self.falls(|left| left.min(share));
        }
    }

    fn falls(&self, to: impl Fn(f64) -> f64) {
        self.wanted.send_if_modified(|wanted| {
            let Some(wanted) = wanted else { return false };
            let left = to(wanted.left);
            std::mem::replace(&mut wanted.left, left).total_cmp(&left).is_ne()
        });
    }

    /// Tells the controller of each change, again where it was not there, and again when it comes back.
    pub(crate) async fn hand_on(&self, diagnostics: &Diagnostics) {
        let mut wanted = self.wanted.subscribe();
        let mut looks = tokio::time::interval(LOOK);
        looks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut told = false;
        loop {
            tokio::select! {
                changed = wanted.changed() => match changed {
                    Ok(()) => told = false,
                    Err(_) => return,
                },
                _ = looks.tick() => told &= self.client.is_there(),
            }
            let Some(now) = wanted.borrow_and_update().clone().filter(|_| !told) else { continue };
            let result = self.client.set(&parameters(&self.names, &now)).await;
            // A refusal stays one until there is another set.
            told = matches!(result, Ok(()) | Err(SetError::Refused { .. }));
            let sequence_id = now.set.handshake.sequence_id;
            let status = controller_status(&result, sequence_id, now.left);
            match &result {
                Ok(()) => tracing::info!("the controller has sequence {sequence_id}"),
                Err(SetError::Refused { .. }) => tracing::warn!("{}", status.message),
                Err(_) => {}
            }
            diagnostics.report("controller", status);
        }
    }
}

/// Reads THEIRS=FIGURE.
fn mapping(entries: &[String]) -> anyhow::Result<Vec<(String, &'static str, Of)>> {
    let read = |entry: &String| {
        let (theirs, figure) = entry.split_once('=').map(|(a, b)| (a.trim(), b.trim())).unwrap_or_default();
        match FIGURES.iter().find(|(name, _)| *name == figure) {
            Some((name, of)) if !theirs.is_empty() => Ok((theirs.to_owned(), *name, *of)),
            _ => {
                let known: Vec<&str> = FIGURES.iter().map(|(name, _)| *name).collect();
                bail!(
                    "parameter controller_parameters: `{entry}` is not THEIRS=FIGURE with one of {}",
                    known.join(", ")
                )
            }
        }
    };
    entries.iter().map(read).collect()
}

fn parameters(names: &[(String, &'static str, Of)], wanted: &Wanted) -> Vec<(String, ParameterValue)> {
    let value = |figure: &str, of: Of| of(&wanted.set) * if figure == GRIP { wanted.left } else { 1.0 };
    names
        .iter()
        .map(|(theirs, figure, of)| (theirs.clone(), ParameterValue::Double(value(figure, *of))))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(left: f64) -> Wanted {
        let axle = MagicFormula { b: 8.0, c: 1.4, d: 0.8, e: 0.1 };
        let set = PacejkaParams {
            front: axle,
            rear: MagicFormula { d: 0.9, ..axle },
            front_load_n: 10.0,
            rear_load_n: 20.0,
            front_valid_force_n: f64::NAN,
            rear_valid_force_n: 12.0,
            ..PacejkaParams::default()
        };
        Wanted { set, left }
    }

    #[test]
    fn figures_go_by_the_controllers_names_and_only_the_grip_falls() {
        let names = mapping(&["mu = grip".to_owned(), "Bf=front.b".to_owned()]).unwrap();
        let told = parameters(&names, &wanted(0.5));
        let expected = [("mu".to_owned(), 0.3), ("Bf".to_owned(), 8.0)];
        assert_eq!(told, expected.map(|(name, value)| (name, ParameterValue::Double(value))));
    }

    #[test]
    fn a_mapping_that_is_none_is_refused() {
        for entry in ["mu", "=grip", "mu=friction", ""] {
            let error = mapping(&[entry.to_owned()]).unwrap_err().to_string();
            assert!(error.contains(&format!("`{entry}`")) && error.contains("rear.e, grip"), "{error}");
        }
    }
}
