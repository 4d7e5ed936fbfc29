//! The direct fit: signal corrections and tires together, by shooting. It is the start of the robust method, the baseline that the
//! residual loop has to beat, and the source of all intervals.
//!
//! 1. Signals and stiffnesses on the windows of low lateral acceleration, from several steering delays: what the tires do at the limit, which
//!    no simple model gets right, stays out of delay, gain, lever arm and bias.
//! 2. All parameters on all windows, the signals held softly at what step 1 found.
//! 3. An axle whose peak the data do not reach gets its D from the friction prior (else it stays at what is likely), and step 2 is repeated.

use gripsight_vehicle::{GRAVITY_MPS2, MagicFormula, PacejkaParameters, SingleTrack, VehicleParameters};

use crate::data::{Data, Part, median, quantile};
use crate::rollout::{PARAMETERS, SIGNALS, TireRollout, corrections_of, tires_of};
use crate::shooting::{Fit, Parameter, Prior, Problem, Rollout, StopReason, Window, fit};
use crate::tires::parameters;
use crate::{FrictionPrior, IdentificationError, PerAxle, Range, SignalCorrections};

/// What is likely of the signals before the data are looked at: (mean, sigma, low, high) in the order of [`SignalCorrections`]; the lever
/// arm in wheelbases, the bias of v_y in mean speeds.
const SIGNAL_PRIORS: [(f64, f64, f64, f64); 6] = [
    // Delay: commands reach the wheels after 0 to 0.1 s; 0.3 s would be undrivable.
    (0.04, 0.06, 0.0, 0.3),
    // Gain and offset: a servo's calibration.
    (1.0, 0.05, 0.6, 1.5),
    (0.0, 0.02, -0.15, 0.15),
    // Lever arm: the odometry's point lies somewhere between the axles.
    (0.0, 0.2, -0.8, 0.8),
    // Bias of v_y: a heading error of half a degree.
    (0.0, 0.01, -0.1, 0.1),
    // Gyroscope.
    (0.0, 0.01, -0.1, 0.1),
];

/// Steering delays that step 1 starts from, s.
const DELAY_STARTS_S: [f64; 3] = [0.01, 0.06, 0.14];
/// Robustness of the window loss, in noises.
const ROBUST_K: f64 = 3.0;
/// Step 1 looks at windows below this share of the largest lateral acceleration, and needs so many of them.
const LOW_SHARE: f64 = 0.5;
const LOW_WINDOWS: usize = 12;
/// Standard errors of step 1 are widened by this before they hold the signals in step 2: its tires are too simple.
const WIDENED: f64 = 2.0;

/// Result of the direct fit.
#[derive(Debug, Clone)]
pub(crate) struct Direct {
    pub(crate) tires: PacejkaParameters,
    pub(crate) corrections: SignalCorrections,
    /// The last fit, for intervals.
    pub(crate) fit: Fit,
    /// Standard errors of the signal corrections.
    pub(crate) signal_errors: [Option<f64>; 6],
    /// What was held likely of them before the data were looked at.
    pub(crate) signal_priors: [Prior; 6],
    /// Scatter of v_y and yaw rate about the rollouts, what residuals were divided by.
    pub(crate) sigma: [f64; 2],
    pub(crate) slips: PerAxle<Slips>,
    pub(crate) peak: PerAxle<PeakEvidence>,
}

/// Slip angles visited, from the fitted trajectories (free of sensor noise).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Slips {
    /// All of them.
    pub(crate) samples_rad: Vec<f64>,
    /// 0.5th to 99.5th percentile.
    pub(crate) range_rad: Range,
}

/// Whether an axle's peak shows in the data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PeakEvidence {
    pub(crate) reached: bool,
    /// Slope of the curve at the largest slips visited, over that at zero.
    pub(crate) slope_left: f64,
    /// Standard error of D over D.
    pub(crate) relative_error: f64,
}

/// The slope that a curve may have left at the largest slips visited to count as past its knee.
const SLOPE_LEFT: f64 = 0.25;
/// Relative standard error of D above which the data do not determine it.
const PEAK_ERROR: f64 = 0.08;

pub(crate) fn direct(
    data: &Data,
    vehicle: &VehicleParameters,
    prior: Option<FrictionPrior>,
    warm: Option<(&PacejkaParameters, &SignalCorrections)>,
) -> Result<Direct, IdentificationError> {
    let model = TireRollout { vehicle, segments: &data.segments };
    let training = data.part(Part::Training);
    let mut lateral: Vec<f64> = data.samples(|s, k| (s.v_x_mps[k] * s.yaw_rate_radps[k]).abs()).collect();
    let limit_mps2 = quantile(&mut lateral, 0.98).unwrap_or(0.0);
    let low = low_windows(data, &training, LOW_SHARE * limit_mps2);

    // Step 1.
    let mut all = signal_parameters(data, vehicle);
    let signal_priors = std::array::from_fn(|j| all[j].prior.unwrap_or(Prior { mean: 0.0, sigma: 1.0 }));
    let grip = 1.2 * limit_mps2 / GRAVITY_MPS2;
    let first = MagicFormula::from_stiffness(8.0, crate::tires::C_PRIOR.mean, grip.clamp(0.1, 3.0), 0.0);
    let start = warm.map_or(PacejkaParameters { front: first, rear: first }, |(tires, _)| *tires);
    let mut tires: Vec<Parameter> =
        [start.front, start.rear].iter().flat_map(|axle| parameters(axle, prior)).collect();
    tires.append(&mut all);
    let mut all = tires;
    for j in [1, 2, 3, 5, 6, 7] {
        all[j].free = false;
    }
    let mut sigma = data.noise.map(|s| s.max(1e-6));
    let delays: Vec<f64> = warm.map_or(DELAY_STARTS_S.to_vec(), |(_, c)| vec![c.steering_delay_s]);
    let solve = |all: &[Parameter], windows: &[Window], sigma: &[f64; 2], iterations| {
        let problem = Problem {
            model: &model,
            windows,
            sigma,
            parameters: all,
            robust_k: ROBUST_K,
            max_iterations: iterations,
        };
        fit(&problem, None)
    };
    let scan = delays.iter().map(|&delay_s| {
        let mut all = all.clone();
        all[SIGNALS].start = delay_s;
        solve(&all, &low, &sigma, 8)
    });
    let best = scan
        .min_by(|a, b| a.linearization.cost.total_cmp(&b.linearization.cost))
        .filter(|f| f.stop != StopReason::NotFinite)
        .ok_or(IdentificationError::NotFinite { what: "cost of the first fit" })?;
    restart(&mut all, &best.parameters);
    sigma = scatter(&model, &best, &low, &data.noise);
    let signals = solve(&all, &low, &sigma, 20);

    // Step 2.
    restart(&mut all, &signals.parameters);
    for j in SIGNALS..PARAMETERS {
        let error = signals.standard_error(j).unwrap_or(f64::INFINITY);
        if let Some(p) = all[j].prior {
            let sigma = (WIDENED * error).min(p.sigma).max(1e-3 * p.sigma);
            all[j].prior = Some(Prior { mean: signals.parameters[j], sigma });
        }
    }
    for j in [1, 2, 3, 5, 6, 7] {
        all[j].free = true;
    }
    let mut found = solve(&all, &training, &sigma, 15);
    sigma = scatter(&model, &found, &training, &data.noise);
    restart(&mut all, &found.parameters);
    found = solve(&all, &training, &sigma, 30);

    // Step 3.
    let slips = visited(&model, &found, &training);
    let peak = PerAxle { front: evidence(&found, 0, &slips.front), rear: evidence(&found, 4, &slips.rear) };
    if !(peak.front.reached && peak.rear.reached) {
        restart(&mut all, &found.parameters);
        for (offset, axle) in [(0, &peak.front), (4, &peak.rear)] {
            if !axle.reached {
                all[offset + 2].free = false;
                all[offset + 2].start = prior.map_or(found.parameters[offset + 2].max(grip), |p| p.mu);
                all[offset + 1].start = crate::tires::C_PRIOR.mean;
                all[offset + 3].start = crate::tires::E_PRIOR.mean;
            }
        }
        found = solve(&all, &training, &sigma, 30);
    }
    if found.stop == StopReason::NotFinite || found.parameters.iter().any(|v| !v.is_finite()) {
        return Err(IdentificationError::NotFinite { what: "direct fit" });
    }
    let slips = visited(&model, &found, &training);
    Ok(Direct {
        tires: tires_of(&found.parameters),
        corrections: corrections_of(&found.parameters),
        signal_errors: std::array::from_fn(|j| found.standard_error(SIGNALS + j)),
        signal_priors,
        fit: found,
        sigma,
        slips,
        peak,
    })
}

/// The signal parameters with their priors, scaled to the car.
fn signal_parameters(data: &Data, vehicle: &VehicleParameters) -> Vec<Parameter> {
    let scales = [1.0, 1.0, 1.0, vehicle.wheelbase_m(), data.mean_speed_mps, 1.0];
    SIGNAL_PRIORS
        .iter()
        .zip(scales)
        .map(|(&(mean, sigma, low, high), scale)| Parameter {
            start: mean * scale,
            low: low * scale,
            high: high * scale,
            free: true,
            prior: Some(Prior { mean: mean * scale, sigma: sigma * scale }),
        })
        .collect()
}

fn restart(all: &mut [Parameter], at: &[f64]) {
    all.iter_mut().zip(at).for_each(|(p, &v)| p.start = v);
}

/// Windows of low lateral acceleration; all where there are too few.
fn low_windows(data: &Data, windows: &[Window], below_mps2: f64) -> Vec<Window> {
    let low: Vec<Window> = windows
        .iter()
        .copied()
        .filter(|w| {
            let s = &data.segments[w.segment];
            (w.from..w.from + w.len).all(|k| (s.v_x_mps[k] * s.yaw_rate_radps[k]).abs() < below_mps2)
        })
        .collect();
    if low.len() < LOW_WINDOWS { windows.to_vec() } else { low }
}

/// Typical scatter of each channel about the fit: the median window's root mean square, at least the noise.
fn scatter(model: &TireRollout<'_>, fit: &Fit, windows: &[Window], noise: &[f64; 2]) -> [f64; 2] {
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    let mut squares = [Vec::new(), Vec::new()];
    for (window, start) in windows.iter().zip(&fit.starts) {
        model.rollout(&fit.parameters, *start, window, &mut predicted);
        model.measured(window, &mut measured);
        for channel in 0..2 {
            let errors = predicted.iter().zip(&measured).skip(channel).step_by(2);
            squares[channel].push(errors.map(|(p, m)| (p - m).powi(2)).sum::<f64>() / window.len as f64);
        }
    }
    std::array::from_fn(|c| median(&mut squares[c]).unwrap_or(0.0).sqrt().max(0.5 * noise[c]).max(1e-6))
}

/// Slip angles along the fitted trajectories.
fn visited(model: &TireRollout<'_>, fit: &Fit, windows: &[Window]) -> PerAxle<Slips> {
    let mut slips = PerAxle { front: Vec::new(), rear: Vec::new() };
    let mut trajectory = Vec::new();
    let car = SingleTrack::new(model.vehicle, &tires_of(&fit.parameters));
    for (window, start) in windows.iter().zip(&fit.starts) {
        crate::judge::trajectory(model, &fit.parameters, *start, window, &mut trajectory);
        for (state, input) in &trajectory {
            let (front, rear) = car.slip_angles_rad(state, input);
            slips.front.push(front);
            slips.rear.push(rear);
        }
    }
    slips.map(|samples_rad| {
        let mut sorted = samples_rad.clone();
        let low = quantile(&mut sorted, 0.005).unwrap_or(f64::NAN);
        let high = quantile(&mut sorted, 0.995).unwrap_or(f64::NAN);
        Slips { samples_rad, range_rad: Range { low, high } }
    })
}

/// Whether an axle's peak shows: the curve has flattened within the slips visited, and the data fix D.
fn evidence(fit: &Fit, offset: usize, slips: &Slips) -> PeakEvidence {
    let axle = tires_of(&fit.parameters);
    let axle = if offset == 0 { axle.front } else { axle.rear };
    let furthest = slips.range_rad.low.abs().max(slips.range_rad.high.abs());
    let step = 1e-3 * furthest.max(1e-6);
    let slope =
        (axle.normalized_force(furthest + step) - axle.normalized_force(furthest - step)) / (2.0 * step);
    let slope_left = slope / axle.normalized_stiffness();
    let relative_error = fit.standard_error(offset + 2).map_or(f64::INFINITY, |s| s / axle.d);
    let bounded = fit.on_bound.contains(&(offset + 2));
    let reached = slope_left < SLOPE_LEFT && relative_error < PEAK_ERROR && !bounded;
    PeakEvidence { reached, slope_left, relative_error }
}
