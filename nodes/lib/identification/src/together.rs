//! Several drives of one car set against what they give together; and a set tried on another drive.

use gripsight_vehicle::{MagicFormula, PacejkaParameters};

use crate::conclude::unstable_at_mps;
use crate::{Outcome, PerAxle, Status, TireCurve, ValidWithin};

/// A difference in force matters from this share of the largest force on: what counts as a promise too high.
const HARMFUL: f64 = 0.1;
/// Points that two curves are compared at.
const POINTS: usize = 40;

/// Where a drive alone says something else than all of them together.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disagreement {
    /// Which drive, from 0.
    pub drive: usize,
    /// Whether it is the front axle.
    pub front: bool,
    /// Slip at which they differ most, rad.
    pub slip_rad: f64,
    /// Force of the drive alone less that of all together there, over the largest of all together.
    pub share: f64,
}

/// Where drives differ from what they give together by more than both intervals and by what matters.
#[must_use]
pub fn disagreements(together: &Outcome, alone: &[Outcome]) -> Vec<Disagreement> {
    let mut found = Vec::new();
    for (drive, outcome) in alone.iter().enumerate().filter(|(_, o)| o.status != Status::Rejected) {
        for front in [true, false] {
            let of = |o: &Outcome| if front { o.curves.front.clone() } else { o.curves.rear.clone() };
            let (all, own) = (of(together), of(outcome));
            let within = furthest(together, front).min(furthest(outcome, front));
            let largest = all.identified.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
            let differs = (1..=POINTS).filter_map(|k| {
                let slip_rad = within * k as f64 / POINTS as f64;
                let ([a, a_half], [b, b_half]) = (at(&all, slip_rad)?, at(&own, slip_rad)?);
                let share = (b - a) / largest;
                ((b - a).abs() > a_half.hypot(b_half) && share.abs() > HARMFUL).then_some((slip_rad, share))
            });
            if let Some((slip_rad, share)) = differs.max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())) {
                found.push(Disagreement { drive, front, slip_rad, share });
            }
        }
    }
    found
}

fn furthest(outcome: &Outcome, front: bool) -> f64 {
    let slip = if front { outcome.slip_range_rad.front } else { outcome.slip_range_rad.rear };
    slip.high.abs().max(slip.low.abs())
}

/// Force over load and its half-width at a slip; `None` beyond the curve.
fn at(curve: &TireCurve, slip_rad: f64) -> Option<[f64; 2]> {
    let after = curve.slip_rad.partition_point(|&s| s < slip_rad);
    let (from, to) = (after.checked_sub(1)?, after);
    let (a, b) = (*curve.slip_rad.get(from)?, *curve.slip_rad.get(to)?);
    let share = (slip_rad - a) / (b - a);
    let between = |v: &[f64]| v[from] + share * (v[to] - v[from]);
    let value = between(&curve.identified);
    Some([value, between(&curve.high) - value])
}

/// How an axle of a set stands on another drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxleCheck {
    /// Compared up to this slip: what was driven, and what the set is valid for.
    pub slip_rad: f64,
    /// Root mean square of the difference in force over those slips, over the largest force that the drive shows.
    pub error: f64,
    /// Largest promise above what the drive shows, over the largest force; negative where there is none.
    pub above: f64,
    /// The same above the upper end of the drive's 90 % interval.
    pub above_interval: f64,
    /// How far the largest promise lies below the largest force that the drive shows.
    pub below: f64,
}

/// A set tried on another drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Verification {
    /// Axle by axle.
    pub axles: PerAxle<AxleCheck>,
    /// Why the set must not be used, or cannot be judged on this drive; empty where it may be used.
    pub against: Vec<String>,
}

/// Tries a set on another drive, of which `drive` is what it shows by itself: no promise may lie above that by more than the interval and by what matters.
#[must_use]
pub fn verify(set: &PacejkaParameters, valid: Option<&ValidWithin>, drive: &Outcome) -> Verification {
    let axle = |front: bool, set: &MagicFormula, valid_rad: Option<f64>| {
        let curve = if front { &drive.curves.front } else { &drive.curves.rear };
        let driven_rad = furthest(drive, front);
        let slip_rad = valid_rad.filter(|v| v.is_finite()).map_or(driven_rad, |v| v.min(driven_rad));
        let points: Vec<(f64, f64, f64)> = (1..=POINTS)
            .filter_map(|k| {
                let slip_rad = slip_rad * k as f64 / POINTS as f64;
                let [force, half] = at(curve, slip_rad)?;
                Some((set.normalized_force(slip_rad), force, half))
            })
            .collect();
        let largest = points.iter().map(|p| p.1).fold(f64::MIN_POSITIVE, f64::max);
        let most = |of: &dyn Fn(&(f64, f64, f64)) -> f64| {
            points.iter().map(of).fold(f64::NEG_INFINITY, f64::max) / largest
        };
        let square = points.iter().map(|p| (p.0 - p.1).powi(2)).sum::<f64>() / points.len().max(1) as f64;
        AxleCheck {
            slip_rad,
            error: square.sqrt() / largest,
            above: most(&|p| p.0 - p.1),
            above_interval: most(&|p| p.0 - p.1 - p.2),
            below: 1.0 - set.max_force_within(slip_rad) / largest,
        }
    };
    let axles = PerAxle {
        front: axle(true, &set.front, valid.map(|v| v.slip_rad.front)),
        rear: axle(false, &set.rear, valid.map(|v| v.slip_rad.rear)),
    };
    let mut against = Vec::new();
    if drive.status == Status::Rejected {
        against.push("this drive shows too little to judge by".to_owned());
        against.extend(drive.reasons.iter().cloned());
    } else {
        for (name, check) in [("front", axles.front), ("rear", axles.rear)] {
            if check.above > HARMFUL && check.above_interval > 0.0 {
                against.push(format!(
                    "the {name} tires are promised {:.0} % of the largest force too much, by {:.0} % beyond what this drive leaves open (at most {:.0} %)",
                    100.0 * check.above,
                    100.0 * check.above_interval,
                    100.0 * HARMFUL
                ));
            }
        }
    }
    if let Some(v_mps) = unstable_at_mps(&drive.vehicle, set, &drive.v_x_range_mps) {
        against.push(format!(
            "with these tires the car would be unstable above {v_mps:.1} m/s, and was driven at {:.1} m/s",
            drive.v_x_range_mps.high
        ));
    }
    Verification { axles, against }
}
