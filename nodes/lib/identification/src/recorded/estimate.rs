//! The motion as the smoother gives it: where it is wanted, and beside what is recorded.

use gripsight_signals::{
    Check, Checks, Finding, Pair, StateSequence, is_dead_reckoning, is_integral_of_twist,
    lateral_speed_check, stands_still,
};
use gripsight_state_estimation::{Motion, Smoothed, smooth};

use super::{EstimatedChannel, EstimatedMotion, Why};
use crate::Estimate;

/// An accelerometer off by more than this is not used to estimate v_y.
const USELESS: f64 = 0.15;

/// What the estimate is made of: everything but what is in doubt.
pub(super) fn source(
    sequence: &StateSequence,
    checks: &Checks,
    wanted: &[(&'static str, Why)],
) -> StateSequence {
    let mut source = sequence.clone();
    source.v_y_mps.fill(0.0);
    // The estimate goes by the gyroscope where there is one, with a scale of its own: it must not be in another unit or turned; and where it
    // disagrees with a yaw rate that nothing speaks against, it is the gyroscope that is wrong.
    let yaw_rate_wrong = wanted.iter().any(|(channel, _)| *channel == "yaw_rate_radps");
    let gyro = checks.of(Pair::YawRateAndGyro).map(|c| c.finding);
    if gyro.is_some_and(|f| {
        matches!(f, Finding::Unit { .. } | Finding::Sign) || f.disagrees() && !yaw_rate_wrong
    }) {
        source.gyro_yaw_rate_radps.clear();
    }
    let useless = |pair| {
        checks.of(pair).is_some_and(|c: &Check| c.finding.disagrees() && (c.ratio - 1.0).abs() > USELESS)
    };
    if useless(Pair::LateralAccelerationAndMotion) || useless(Pair::ForwardAccelerationAndMotion) {
        source.a_x_mps2.clear();
        source.a_y_mps2.clear();
    }
    source
}

/// v_y against the one that poses and inertial unit give together, where it is measured and a localisation is recorded: poses over half a second, as the
/// first look takes them, are too noisy to tell on any but small cars.
pub(super) fn sharper(sequence: &StateSequence, checks: &Checks) -> Option<Check> {
    /// The motion changes little within it.
    const STEP_S: f64 = 0.1;
    /// Over which poses are held against speeds.
    const SPAN_S: f64 = 0.5;
    let counted = is_dead_reckoning(sequence) || is_integral_of_twist(sequence);
    let turned = checks.of(Pair::YawRateAndHeading).map(|c| c.finding);
    let no_sense = matches!(turned, Some(Finding::Sign | Finding::Unit { .. }));
    if counted || no_sense || sequence.poses().time_s.is_empty() || stands_still(sequence, &sequence.v_y_mps)
    {
        return None;
    }
    let scaled = matches!(turned, Some(Finding::Scale { .. }));
    let wanted = ("yaw_rate_radps", Why::Contradicted { pair: Pair::YawRateAndHeading, ratio: 1.0 });
    let smoothed =
        smooth(&source(sequence, checks, if scaled { std::slice::from_ref(&wanted) } else { &[] })).ok()?;
    let [mut reported, mut known, mut turning] = [const { Vec::new() }; 3];
    let t = &sequence.time_s;
    let mut from = 0;
    while from < t.len() {
        let to = (from + 1..t.len()).find(|&k| f64::from(t[k] - t[from]) >= STEP_S).unwrap_or(t.len());
        let mean = |f: &dyn Fn(usize) -> f64| (from..to).map(f).sum::<f64>() / (to - from) as f64;
        reported.push(mean(&|k| sequence.v_y_mps[k].into()));
        known.push(mean(&|k| smoothed.motion[k].v_y_mps));
        turning.push(mean(&|k| smoothed.motion[k].yaw_rate_radps));
        from = to;
    }
    let variances = smoothed.motion.iter().map(|m| m.v_y_sigma_mps().powi(2));
    let mean = variances.sum::<f64>() / smoothed.motion.len().max(1) as f64;
    // Poses that say the speed ahead no better than this over half a second do not say the one to the side any better.
    let samples = (SPAN_S * sequence.len() as f64 / sequence.duration_s().max(SPAN_S)).max(1.0);
    let sigma_mps = mean.sqrt().hypot(smoothed.levels.v_x_mps / samples.sqrt());
    Some(lateral_speed_check(&reported, &known, &turning, sigma_mps))
}

/// Puts the estimate in the place of what was wanted.
pub(super) fn fill(
    sequence: &mut StateSequence,
    smoothed: &Smoothed,
    wanted: &[(&'static str, Why)],
) -> EstimatedMotion {
    let mut channels = Vec::new();
    let known = known_well(smoothed);
    for &(channel, why) in wanted {
        let place = ["v_x_mps", "v_y_mps", "yaw_rate_radps"].iter().position(|c| *c == channel).unwrap_or(1);
        let value = |m: &Motion| [m.v_x_mps, m.v_y_mps, m.yaw_rate_radps][place];
        let column: Vec<f32> = smoothed.motion.iter().map(|m| value(m) as f32).collect();
        let variances: Vec<f64> = smoothed
            .motion
            .iter()
            .zip(&known)
            .filter(|(_, known)| **known)
            .map(|(m, _)| m.covariance[place][place].max(0.0))
            .collect();
        let sigma = (variances.iter().sum::<f64>() / variances.len().max(1) as f64).sqrt();
        match place {
            0 => sequence.v_x_mps = column,
            2 => sequence.yaw_rate_radps = column,
            _ => sequence.v_y_mps = column,
        }
        channels.push(EstimatedChannel { channel, why, sigma });
    }
    sequence.retain(|k| known[k]);
    let (scale, sigma) = smoothed.v_x_scale;
    EstimatedMotion {
        channels,
        pose_delay_s: smoothed
            .pose_delay_s
            .map(|(delay_s, sigma_s)| Estimate::from_error(delay_s, Some(sigma_s))),
        v_x_scale: Estimate::from_error(1.0 + scale, Some(sigma)),
        jumps_s: smoothed.jumps_s.clone(),
        left_out: smoothed.left_out,
        unknown_samples: known.iter().filter(|k| !**k).count(),
    }
}

/// Samples whose v_y is known about as well as usual. Where a localisation fails for a while the smoother bridges it, and a few such samples would
/// outweigh all others.
fn known_well(smoothed: &Smoothed) -> Vec<bool> {
    /// Usual standard deviations.
    const WORSE: f64 = 4.0;
    let sigmas: Vec<f64> = smoothed.motion.iter().map(Motion::v_y_sigma_mps).collect();
    let usual = crate::data::median(&mut sigmas.clone()).unwrap_or(f64::INFINITY);
    sigmas.iter().map(|&sigma| sigma <= WORSE * usual).collect()
}
