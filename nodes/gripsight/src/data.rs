//! What is to be said of a sequence's signals.

use gripsight_signals::{BadKind, BadSpan, Check, Checks, Finding, Pair, StateSequence, cross_check, masked};

/// A sequence, and what its signals say of each other.
pub(crate) struct Prepared {
    /// As it was recorded.
    pub(crate) sequence: StateSequence,
    /// What the signals say of each other.
    pub(crate) checks: Checks,
    /// Bad samples, which identification leaves out.
    pub(crate) bad: Vec<BadSpan>,
}

impl Prepared {
    /// Compares the signals with each other, and looks for bad samples.
    pub(crate) fn new(sequence: StateSequence) -> anyhow::Result<Self> {
        Ok(Self { checks: cross_check(&sequence)?, bad: masked(&sequence)?.bad, sequence })
    }

    /// In sentences.
    pub(crate) fn notes(&self) -> Vec<String> {
        let mut notes: Vec<String> = self.checks.disagreeing().map(disagreement).collect();
        for kind in [BadKind::Outlier, BadKind::Frozen, BadKind::Jump] {
            let spans: Vec<&BadSpan> = self.bad.iter().filter(|b| b.kind == kind).collect();
            let Some(first) = spans.first() else { continue };
            let what = match kind {
                BadKind::Outlier => "single samples that stand out, left out",
                BadKind::Frozen => "stretches over which a sensor repeated itself, left out",
                BadKind::Jump => "jumps of the localisation",
            };
            notes.push(format!("{} {what} (first: {} at {:.2} s)", spans.len(), first.channel, first.from_s));
        }
        let unchecked: Vec<String> =
            self.checks.unchecked.iter().map(|u| format!("{} of {}", u.property, u.signal)).collect();
        if !unchecked.is_empty() {
            notes.push(format!("nothing recorded checks: {}", unchecked.join("; ")));
        }
        notes
    }
}

/// What a check that speaks against a signal means.
pub(crate) fn disagreement(check: &Check) -> String {
    let (first, second) = match check.pair {
        Pair::YawRateAndHeading => ("the yaw rate", "the pose's heading"),
        Pair::YawRateAndGyro => ("the yaw rate", "the gyroscope"),
        Pair::SpeedAndPose => ("v_x", "the way from pose to pose"),
        Pair::LateralSpeedAndPose => ("v_y", "the sideways way from pose to pose"),
        Pair::LateralAccelerationAndMotion => ("a_y", "v_x times yaw rate and the change of v_y"),
        Pair::ForwardAccelerationAndMotion => ("a_x", "the change of v_x"),
        Pair::LateralSpeedAndAcceleration => ("the change of v_y", "what a_y leaves for it"),
        Pair::MeasuredAndCommandedSteering => ("the measured steering", "the command"),
    };
    let figures = format!("{:.3} times {second} ({:.3} to {:.3})", check.ratio, check.low, check.high);
    match check.finding {
        Finding::Sign => {
            format!("{first} has the other sign than {second}: `sign: -1` in a topics file turns it")
        }
        Finding::Unit { probably } => {
            format!("{first} is {figures}: one of them is probably in {probably} (`unit:` in a topics file)")
        }
        Finding::NotMeasured { .. } => {
            format!(
                "{first} is {figures}: not measured, or of another point; a model or a formula may have made it"
            )
        }
        _ => format!("{first} is {figures}"),
    }
}
