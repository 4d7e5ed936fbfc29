//! What may be wrong with the signals, and how likely that is.

use gripsight_vehicle::VehicleParameters;

use crate::data::{Data, median};
use crate::rollout::PARAMETERS;
use gripsight_estimation::shooting::{Parameter, Prior};

/// What is likely of the signals before the data are looked at: (mean, sigma, low, high) in the order of [`SignalCorrections`]; the lever
/// arm in wheelbases, the bias of v_y in mean speeds.
const SIGNAL_PRIORS: [(f64, f64, f64, f64); 6] = [
    // Delay: commands reach the wheels after 0 to 0.1 s. Whatever lags adds to it (filters, stamps), and held below what a recording shows the lag
    // would go into lever arm and stiffness: the bound is wide, and more than a steering can have is said.
    (0.04, 0.1, 0.0, 0.5),
    // Gain and offset: a servo's calibration.
    (1.0, 0.03, 0.6, 1.5),
    (0.0, 0.01, -0.15, 0.15),
    // Lever arm: the odometry's point is meant to be the centre of gravity; the data overrule that where it is another.
    (0.0, 0.07, -0.8, 0.8),
    // Bias of v_y: a heading error of half a degree.
    (0.0, 0.01, -0.1, 0.1),
    // Gyroscope.
    (0.0, 0.005, -0.1, 0.1),
];

/// Relaxation length in wheelbases: mean, sigma, low, high.
const RELAXATION_SHARES: [f64; 4] = [0.12, 0.1, 0.005, 0.6];
/// Share of the friction ellipse: mean, sigma, low, high.
const COMBINED_SLIP: [f64; 4] = [0.8, 0.3, 0.0, 1.3];
/// Share of the longitudinal load transfer: mean, sigma, low, high. Half of it may be in a height that is guessed, and in load sensitivity.
const LOAD_TRANSFER: [f64; 4] = [0.8, 0.4, 0.0, 2.0];
/// The signal parameters with their priors, scaled to the car.
pub(super) fn signal_parameters(data: &Data, vehicle: &VehicleParameters) -> Vec<Parameter> {
    let scales = [1.0, 1.0, 1.0, vehicle.wheelbase_m(), data.mean_speed_mps, 1.0];
    let mut all: Vec<Parameter> = SIGNAL_PRIORS
        .iter()
        .zip(scales)
        .map(|(&(mean, sigma, low, high), scale)| Parameter {
            start: mean * scale,
            low: low * scale,
            high: high * scale,
            free: true,
            prior: Some(Prior { mean: mean * scale, sigma: sigma * scale }),
        })
        .collect();
    // No odometry refers to a point ahead of the front axle.
    all[3].high = vehicle.l_f_m;
    if let Some(bias) = yaw_rate_bias(data) {
        all[5].start = bias.mean.clamp(all[5].low, all[5].high);
        all[5].prior = Some(bias);
        all[5].free = false;
    }
    let [mean, sigma, low, high] = RELAXATION_SHARES.map(|share| share * vehicle.wheelbase_m());
    all.push(Parameter { start: mean, low, high, free: true, prior: Some(Prior { mean, sigma }) });
    for [mean, sigma, low, high] in [COMBINED_SLIP, LOAD_TRANSFER] {
        all.push(Parameter { start: mean, low, high, free: true, prior: Some(Prior { mean, sigma }) });
    }
    // The scales of the motion's signals are held at one.
    all.resize(PARAMETERS, Parameter { start: 1.0, low: 0.3, high: 3.0, free: false, prior: None });
    all
}

/// Bias of the yaw rate against the heading, which no tire has a say in; `None` without a pose.
fn yaw_rate_bias(data: &Data) -> Option<Prior> {
    // Differences over windows: white noise of the heading averages out.
    let mut differences: Vec<f64> = Vec::new();
    for (window, _) in &data.windows {
        let s = &data.segments[window.segment];
        let end = window.from + window.len - 1;
        let turned = s.yaw_rad.get(end)? - s.yaw_rad[window.from];
        let rate = &s.yaw_rate_radps[window.from..=end];
        let integral = rate.windows(2).map(|w| 0.5 * (w[0] + w[1])).sum::<f64>() * s.dt_s;
        differences.push((integral - turned) / ((window.len - 1) as f64 * s.dt_s));
    }
    let n = differences.len() as f64;
    let mean = median(&mut differences)?;
    let spread = median(&mut differences.iter().map(|d| (d - mean).abs()).collect::<Vec<_>>())? / 0.6745;
    Some(Prior { mean, sigma: (1.2533 * spread / n.sqrt()).max(1e-4) })
}
