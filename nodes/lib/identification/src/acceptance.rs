//! What a set may be used for, and why: every reason with its figure.
//!
//! What counts is the error in force over the slips driven and its harm to a controller. A curve that is known to a factor of [`KNOWN_WITHIN`] to either
//! side is handed on, with no force promised beyond what was shown of it; one that is known worse is not.

use gripsight_vehicle::GRAVITY_MPS2;

use crate::conclude::unstable_at_mps;
use crate::envelope::{Envelope, KNOWN_WITHIN};
use crate::tires::MOST_FORCE;
use crate::{DriveNext, Identification, Manoeuvre, Outcome, PeakFriction, Range, Status, ValidWithin};

/// Scatter of v_y that is said, as a share of the slip at which the rear tires' linear force would meet their peak.
const V_Y_SHARE: f64 = 0.25;

/// Share of the force shown up to which turn-ins tell the stiffness: where curves bend they tell the peak.
const TURN_IN_SHARE: f64 = 0.5;

/// Lateral acceleration to go to over that shown, where the peak was not reached.
const HARDER: f64 = 1.1;

/// No steering that a driver can race with answers later than this.
const LONGEST_DELAY_S: f64 = 0.2;

/// What speaks against a set, what it must be read with, and the driving that would help.
#[derive(Default)]
struct Verdict {
    against: Vec<String>,
    /// The curve is not known well enough where the peak is missing: a friction prior may help.
    unknown: Vec<String>,
    remarks: Vec<String>,
    drive: Vec<DriveNext>,
}

/// Fills in status, set, limits, reasons and advice.
pub(crate) fn judge(run: &Identification, envelope: &Envelope, outcome: &mut Outcome) {
    let mut verdict = Verdict::default();
    changed_grip(run, outcome, &mut verdict);
    verdict.remarks.extend(run.recorded.estimated.iter().map(ToString::to_string));
    one_floor(run, &mut verdict);
    bounds(outcome, &mut verdict);
    prediction(run, outcome, &mut verdict);
    stability(run, envelope, outcome, &mut verdict);
    lateral_velocity(outcome, &mut verdict);
    forces(run, envelope, outcome, &mut verdict);
    peaks(run, outcome, &mut verdict);
    convergence(outcome, &mut verdict);
    signals(run, outcome, &mut verdict);
    let peaks = &outcome.peak_friction;
    outcome.status = match (verdict.against.is_empty(), verdict.unknown.is_empty(), &outcome.provisional) {
        (true, true, _) if peaks.front.reached && peaks.rear.reached => Status::Accepted,
        (true, true, _) => Status::AcceptedWithin,
        (true, false, Some(_)) => Status::Provisional,
        _ => Status::Rejected,
    };
    if outcome.status == Status::Rejected {
        // What speaks against the fit speaks against its peak by a prior, too.
        outcome.provisional = None;
    }
    outcome.accepted = outcome.status.accepted();
    (outcome.phi_p, outcome.valid_within) = match (outcome.status, &outcome.provisional) {
        (Status::Accepted | Status::AcceptedWithin, _) => (envelope.tires, envelope.valid_within),
        (Status::Provisional, Some(set)) => (set.phi_p, ValidWithin::NOWHERE),
        _ => (outcome.found, ValidWithin::NOWHERE),
    };
    outcome.reasons = verdict.against.into_iter().chain(verdict.unknown).chain(verdict.remarks).collect();
    outcome.drive_next = verdict.drive;
}

/// What became of the previous set's grip.
fn changed_grip(run: &Identification, outcome: &Outcome, verdict: &mut Verdict) {
    if let (Some(set), Some(reading)) = (&run.previous, &outcome.grip)
        && let Some(notice) = reading.notice(set)
    {
        let left_s = run.data.windows.iter().map(|(w, _)| w.len as f64 * run.data.dt_s).sum::<f64>();
        verdict.remarks.push(format!(
            "{notice}; tires fitted to the {left_s:.1} s driven since, with that as D's prior"
        ));
    }
}

/// A grip that changed under way: what was fitted is neither the one nor the other.
fn one_floor(run: &Identification, verdict: &mut Verdict) {
    let Some(change) = &run.direct.grip_change else { return };
    verdict.against.push(format!("{change}; one set is true on neither floor"));
    verdict.drive.push(
        Manoeuvre::EachFloorByItself
            .because("identify what lies before the change and what lies after it, each by itself"),
    );
}

/// Parameters that are not finite or on a bound. On a bound is what the drive does not hold: a peak that was not reached, or the shape. No more is promised
/// than was shown, whatever it is; and a stiffness on its bound is not known.
fn bounds(outcome: &Outcome, verdict: &mut Verdict) {
    if !outcome.found.is_finite() {
        verdict.against.push("the tires are not finite".to_owned());
    }
    if !outcome.on_bound.is_empty() {
        let names = outcome.on_bound.join(", ");
        verdict.remarks.push(format!("on a bound, and hardly told by the data: {names}"));
    }
}

/// What the scatter of v_y makes of the rear slip at the mean speed, against the slip at which the rear tires bend: what to mend first where the curves are
/// not known well enough.
fn lateral_velocity(outcome: &Outcome, verdict: &mut Verdict) {
    let rear = &outcome.found.rear;
    let knee_rad = rear.d / rear.normalized_stiffness();
    let scatter_mps = outcome.rmse.noise[0];
    let scatter_rad = scatter_mps / outcome.mean_speed_mps;
    if scatter_rad <= V_Y_SHARE * knee_rad {
        return;
    }
    verdict.remarks.push(format!(
        "v_y scatters by {scatter_mps:.3} m/s about any model: {:.1} degrees of slip where the rear tires bend at {:.1} degrees",
        scatter_rad.to_degrees(),
        knee_rad.to_degrees(),
    ));
    verdict.drive.push(Manoeuvre::MeasureLateralVelocity.because(
        "feed a v_y that is measured: motion capture, two antennas, an optical sensor, or an estimator with side slip",
    ));
}

/// Whether the tires found say more of held-out data than those that the run began with. A set in use is another matter: it may be as good, and is
/// kept by whoever has it.
fn prediction(run: &Identification, outcome: &Outcome, verdict: &mut Verdict) {
    let rollout = &outcome.rmse.rollout;
    if rollout.after.is_nan() || run.previous.is_none() && rollout.after > rollout.before {
        verdict.against.push(format!(
            "held-out rollouts miss by {:.3} noises, with the initial tires by {:.3}: what was found is of no use",
            rollout.after, rollout.before
        ));
    }
}

/// Whether the car would run straight at the speeds that it was driven at.
fn stability(run: &Identification, envelope: &Envelope, outcome: &Outcome, verdict: &mut Verdict) {
    if let Some(v_mps) = unstable_at_mps(&run.vehicle, &envelope.tires, &outcome.v_x_range_mps) {
        verdict.against.push(format!(
            "the car would be unstable above {v_mps:.1} m/s, and was driven at {:.1} m/s",
            outcome.v_x_range_mps.high
        ));
    }
}

/// Curves that are not known well enough to steer by.
fn forces(run: &Identification, envelope: &Envelope, outcome: &Outcome, verdict: &mut Verdict) {
    let shown = &run.direct.peak;
    let stiffness = &outcome.cornering_stiffness_n_per_rad;
    let (driven, valid) = (&outcome.slip_range_rad, &envelope.valid_within.slip_rad);
    let short = |driven: &Range, valid_rad: f64| {
        let driven_rad = driven.high.max(-driven.low);
        (valid_rad < (1.0 - 1e-6) * driven_rad).then_some([valid_rad, driven_rad].map(f64::to_degrees))
    };
    for (axle, k, factor, short) in [
        ("front", stiffness.front, envelope.factor.front, short(&driven.front, valid.front)),
        ("rear", stiffness.rear, envelope.factor.rear, short(&driven.rear, valid.rear)),
    ] {
        let stiff = k.value / k.low;
        if stiff.is_nan() || stiff > KNOWN_WITHIN {
            verdict.against.push(format!(
                "{axle} cornering stiffness is known to a factor of {stiff:.1} only (90 % interval; {KNOWN_WITHIN:.1} can be steered by)"
            ));
        } else if factor.is_nan() || factor > KNOWN_WITHIN {
            verdict.unknown.push(format!(
                "{axle} force over the slips driven is known to a factor of {factor:.1} only (90 % interval; {KNOWN_WITHIN:.1} can be steered by)"
            ));
        } else if let Some([known_deg, driven_deg]) = short {
            verdict.remarks.push(format!(
                "{axle} force is known up to {known_deg:.1} degrees of slip, and not at the {driven_deg:.1} degrees that were touched: the set ends there"
            ));
        } else {
            continue;
        }
        let why = format!("drive longer, with more turn-ins below the limit of the {axle} tires");
        let a_y_mps2 = TURN_IN_SHARE * shown.front.height.min(shown.rear.height) * GRAVITY_MPS2;
        verdict.drive.push(Manoeuvre::TurnIns.because(why).at(outcome.mean_speed_mps).up_to(a_y_mps2));
    }
}

/// Whether the loop settled.
fn convergence(outcome: &Outcome, verdict: &mut Verdict) {
    if !outcome.converged {
        verdict.remarks.push(format!(
            "not converged: the last of {} turns changed the curves by {:.1} %",
            outcome.iterations,
            100.0 * outcome.history.last().map_or(f64::NAN, |t| t.change)
        ));
    }
}

/// Corrections of the signals that the data do not hold.
fn signals(run: &Identification, outcome: &Outcome, verdict: &mut Verdict) {
    let Verdict { against, remarks, drive, .. } = verdict;
    for (name, value) in &run.direct.signals_on_bound {
        // A controller steers by the stiffness: one that the data do not hold must not reach it.
        let list = if name.ends_with(".k") { &mut *against } else { &mut *remarks };
        list.push(format!(
            "{name} is on its bound, {value:.3}: the data do not hold it, or ask for what it cannot be"
        ));
    }
    let delay_s = outcome.signals.steering_delay_s;
    if delay_s > LONGEST_DELAY_S {
        remarks.push(format!(
            "the car answers {delay_s:.2} s after the recorded steering, later than a steering (at most {LONGEST_DELAY_S} s): filtered odometry or clocks \
             that differ; lever arm and stiffnesses bear what a delay does not explain of it"
        ));
    }
    for weak in &outcome.weak_signals {
        remarks.push(format!(
            "{} rests on its prior (sigma {:.3}): the data give {:.0} % of what is known of it",
            weak.name,
            weak.prior_sigma,
            100.0 * weak.data_share
        ));
    }
    if outcome.weak_signals.iter().any(|w| w.name == "steering_gain" || w.name == "v_y_lever_arm_m") {
        drive.push(
            Manoeuvre::SameCornersAtTwoSpeeds
                .because(
                    "the same corners at half and at full speed: gain and lever arm then part from the tires",
                )
                .at(0.5 * outcome.mean_speed_mps),
        );
    }
}

/// Slip at which every tire slides, on gravel, too: where no peak shows by then more slip shows none.
const MOST_PEAK_SLIP_RAD: f64 = 0.6;

/// What shows the peak of an axle that was driven up to a slip and gave so much of its load.
fn to_the_peak(axle: &str, furthest_rad: f64, height: f64) -> DriveNext {
    let furthest = furthest_rad.to_degrees();
    if furthest_rad > MOST_PEAK_SLIP_RAD {
        return Manoeuvre::MeasureLateralVelocity.because(format!(
            "every tire slides at the {furthest:.0} degrees of slip that the {axle} tires have here, but the force there is known too badly to show it: look at v_y and \
             speed where the car is slow or spins, and feed a v_y that is measured"
        ));
    }
    let why = format!("corner harder until the {axle} tires slide (more than {furthest:.1} degrees of slip)");
    Manoeuvre::CornerHarder.because(why).up_to(HARDER * height * GRAVITY_MPS2)
}

/// Peaks that were not reached, and priors that have a say there.
fn peaks(run: &Identification, outcome: &Outcome, verdict: &mut Verdict) {
    let Verdict { against, remarks, drive, .. } = verdict;
    let peak = &outcome.peak_friction;
    let evidence = &run.direct.peak;
    for (axle, friction, slip, shown) in [
        ("front", &peak.front, &outcome.slip_range_rad.front, &evidence.front),
        ("rear", &peak.rear, &outcome.slip_range_rad.rear, &evidence.rear),
    ] {
        if shown.height > MOST_FORCE {
            against.push(format!(
                "the {axle} tires would have given {:.1} times their static load, and none gives more than {MOST_FORCE:.1}: are speed, yaw rate \
                 and clock in SI units throughout?",
                shown.height
            ));
        }
        let PeakFriction { reached, .. } = *friction;
        if reached {
            continue;
        }
        let furthest_rad = slip.low.abs().max(slip.high.abs());
        let furthest = furthest_rad.to_degrees();
        let what = format!(
            "{axle} peak not reached: slip stayed within {furthest:.1} degrees, the force shown is {:.2} of the load",
            shown.height
        );
        remarks.push(match run.prior {
            None => what,
            Some(prior) if shown.contradicts_prior => {
                format!(
                    "{what}; the friction prior of {:.2} contradicts the data, which fit far worse with it",
                    prior.mu
                )
            }
            Some(prior) if !shown.is_the_priors(prior) => {
                format!(
                    "{what}; the friction prior of {:.2} is below the force that these tires showed",
                    prior.mu
                )
            }
            Some(prior) => {
                format!("{what}; the provisional set rests on the friction prior of {:.2}", prior.mu)
            }
        });
        drive.push(to_the_peak(axle, furthest_rad, shown.height));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nobody_is_asked_for_more_slip_than_any_tire_needs() {
        let few = to_the_peak("front", 0.1, 0.5);
        assert_eq!(few.manoeuvre, Manoeuvre::CornerHarder);
        assert!(few.why.contains("more than 5.7 degrees"), "{}", few.why);
        let many = to_the_peak("front", 1.1, 0.85);
        assert_eq!((many.manoeuvre, many.a_y_mps2), (Manoeuvre::MeasureLateralVelocity, None));
        assert!(many.why.contains("63 degrees"), "{}", many.why);
    }
}
