//! What is to be said of a recording's signals.

use gripsight_identification::{EstimatedMotion, Outcome, Recorded, Usable};
use gripsight_signals::{BadKind, BadSpan, StateSequence, Unchecked};
use gripsight_vehicle::VehicleParameters;
use serde::Serialize;
use serde_json::Value;

/// What the signals say of each other, the bad samples and what was estimated, in sentences.
pub(crate) fn notes(recorded: &Recorded) -> Vec<String> {
    let mut notes: Vec<String> = recorded.checks.disagreeing().map(ToString::to_string).collect();
    notes.extend(recorded.estimated.iter().map(ToString::to_string));
    for kind in [BadKind::Outlier, BadKind::Burst, BadKind::Frozen, BadKind::Jump] {
        let spans: Vec<&BadSpan> = recorded.bad_samples.iter().filter(|b| b.kind == kind).collect();
        let Some(first) = spans.first() else { continue };
        let what = match kind {
            BadKind::Outlier => "single samples that stand out, left out",
            BadKind::Burst => "stretches that no car's motion leads to, left out",
            BadKind::Frozen => "stretches over which a sensor repeated itself, left out",
            BadKind::Jump => "jumps of the localisation",
        };
        notes.push(format!("{} {what} (first: {} at {:.2} s)", spans.len(), first.channel, first.from_s));
    }
    let unchecked: Vec<String> =
        recorded.checks.unchecked.iter().map(|u| format!("{} of {}", u.property, u.signal)).collect();
    if !unchecked.is_empty() {
        notes.push(format!("nothing recorded checks: {}", unchecked.join("; ")));
    }
    notes
}

/// `signals` of a result: what nothing checks, bad samples, and what was estimated.
#[derive(Serialize)]
pub(crate) struct SignalsOf<'a> {
    unchecked: &'a [Unchecked],
    bad_samples: &'a [BadSpan],
    estimated: Option<&'a EstimatedMotion>,
}

impl<'a> SignalsOf<'a> {
    pub(crate) fn new(recorded: &'a Recorded) -> Self {
        Self {
            unchecked: &recorded.checks.unchecked,
            bad_samples: &recorded.bad_samples,
            estimated: recorded.estimated.as_ref(),
        }
    }
}

/// An identification's JSON with `checks[]` and, in `signals`, what [`SignalsOf`] holds.
pub(crate) fn with_checks(result: &Outcome) -> anyhow::Result<Value> {
    let mut json = serde_json::to_value(result)?;
    json["checks"] = serde_json::to_value(&result.recorded.checks.checks)?;
    if let Value::Object(more) = serde_json::to_value(SignalsOf::new(&result.recorded))? {
        more.into_iter().for_each(|(name, value)| json["signals"][name] = value);
    }
    Ok(json)
}

/// A recording as a diagnosis takes it: bad samples left out, and what nothing measures estimated; what contradicts itself stays, to be named.
pub(crate) fn for_diagnosis(
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
) -> anyhow::Result<(StateSequence, Recorded)> {
    let Usable { sequence, recorded } = Usable::measured_or_estimated(sequence, vehicle)?;
    Ok((sequence, recorded))
}
