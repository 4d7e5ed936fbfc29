//! The end of a run: which tires, with which intervals, and whether they may be used.

use gripsight_signals::DataHealth;
use gripsight_vehicle::{
    MagicFormula, PacejkaParameters, VehicleParameters,
    handling::{critical_speed_mps, straight_line_growth_rate_1ps},
};

use crate::data::Part;
use crate::direct::PeakEvidence;
use crate::envelope::Envelope;
use crate::judge::{best_starts, errors_over_horizon, one_step_errors, rollout_errors};
use crate::picture::{curves, trace};
use crate::rollout::{NAMES, PARAMETERS, SIGNALS, TireRollout, vector_of};
use crate::tires::on_bound;
use crate::{
    Change, Config, DriveNext, Estimate, FrictionPrior, Handling, HorizonError, Identification,
    IdentificationError, Longitudinal, Nuisance, Outcome, PeakFriction, PerAxle, ProvisionalSet, Range,
    Recorded, ResidualKind, Rmse, RmseReport, RunKey, SignalCorrections, SignalEstimates, Source, Status,
    Trace, ValidWithin, WeakSignal,
};

/// The residual loop has to beat the direct fit on the validation part by this share: of near equals the simpler wins.
const LOOP_GAIN: f64 = 0.01;
/// And it may not be worse than the direct fit by more than this share where there are more data, on the training part: the best of some turns
/// on a few seconds may be luck.
const LOOP_LOSS: f64 = 0.02;
/// Longest horizon of the rollout errors.
const HORIZON_S: f64 = 2.0;
/// Below this share of information from the data a correction rests on its prior.
const WEAK_SHARE: f64 = 0.5;

/// What a run was asked.
pub(crate) struct Request<'a> {
    pub(crate) key: &'a RunKey,
    pub(crate) vehicle: &'a VehicleParameters,
    pub(crate) prior: Option<FrictionPrior>,
    pub(crate) config: &'a Config,
    pub(crate) initial: &'a PacejkaParameters,
    pub(crate) longitudinal: &'a Longitudinal,
    pub(crate) recorded: &'a Recorded,
}

/// The outcome of telemetry that was not fitted at all.
pub(crate) fn refused(
    request: &Request<'_>,
    health: &DataHealth,
    reasons: Vec<String>,
    drive_next: Vec<DriveNext>,
) -> Outcome {
    let unknown = Estimate::from_error(f64::NAN, None);
    let nowhere = Range { low: f64::NAN, high: f64::NAN };
    let peak = |axle: &MagicFormula| PeakFriction {
        value: axle.d,
        low: f64::NAN,
        high: f64::NAN,
        reached: false,
        from_prior: false,
    };
    let change = Change { before: f64::NAN, after: f64::NAN };
    let rmse = Rmse { before: f64::NAN, after: f64::NAN, v_y_mps: change, yaw_rate_radps: change };
    Outcome {
        phi_p: *request.initial,
        found: *request.initial,
        status: Status::Rejected,
        valid_within: ValidWithin::NOWHERE,
        provisional: None,
        cornering_stiffness_n_per_rad: PerAxle { front: unknown, rear: unknown },
        peak_friction: PerAxle { front: peak(&request.initial.front), rear: peak(&request.initial.rear) },
        iterations: 0,
        converged: false,
        accepted: false,
        reasons,
        slip_range_rad: PerAxle { front: nowhere, rear: nowhere },
        v_x_range_mps: nowhere,
        mean_speed_mps: f64::NAN,
        signals: SignalCorrections::NONE,
        signal_intervals: SignalEstimates::from_array([unknown; 6]),
        weak_signals: Vec::new(),
        nuisance: Nuisance { relaxation_m: f64::NAN, combined_slip: f64::NAN, load_transfer: f64::NAN },
        fitted: *request.initial,
        rmse: RmseReport { one_step: rmse, rollout: rmse, horizon_s: f64::NAN, noise: [f64::NAN; 2] },
        rollout_error: Vec::new(),
        source: Source::Start,
        on_bound: Vec::new(),
        initial: *request.initial,
        least_squares: None,
        history: Vec::new(),
        curves: PerAxle::default(),
        prior: request.prior,
        grip: None,
        grip_change: None,
        handling: Handling::unknown(),
        longitudinal: request.longitudinal.clone(),
        health: health.clone(),
        drive_next,
        key: request.key.clone(),
        config: request.config.clone(),
        vehicle: request.vehicle.clone(),
        recorded: request.recorded.clone(),
        trace: Trace::default(),
    }
}

/// The outcome of a run that went through its turns.
pub(crate) fn conclude(run: &Identification, converged: bool) -> Result<Outcome, IdentificationError> {
    let (found, source) = choose(run);
    let stiffness = stiffness(run, &found);
    let envelope = Envelope::of(run, &found, &stiffness)?;
    let corrections = run.direct.corrections;
    let rollout = TireRollout::new(&run.vehicle, &run.data);
    let test = run.data.part(Part::Test);
    let noise = run.direct.scatter;
    let after = vector_of(&found, &corrections, &run.direct.nuisance);
    let before_corrections = run.previous.as_ref().map_or(SignalCorrections::NONE, |p| p.corrections);
    let before = vector_of(&run.initial, &before_corrections, &run.direct.nuisance);
    let rmse = |errors: fn(
        &TireRollout<'_>,
        &[f64; PARAMETERS],
        &[gripsight_model::Window],
        &[f64; 2],
    ) -> crate::judge::Errors| {
        let (b, a) = (errors(&rollout, &before, &test, &noise), errors(&rollout, &after, &test, &noise));
        let channel = |c: usize| Change { before: b.rms[c], after: a.rms[c] };
        Rmse { before: b.normalized, after: a.normalized, v_y_mps: channel(0), yaw_rate_radps: channel(1) }
    };
    let window_len = test.first().map_or(0, |w| w.len);
    let starts = best_starts(&rollout, &after, &test, &noise);
    let len = (HORIZON_S / run.data.dt_s).round() as usize;
    let over = |p: &[f64; PARAMETERS]| errors_over_horizon(&rollout, &run.data, p, &test, &starts, len);
    let rollout_error = over(&before)
        .into_iter()
        .zip(over(&after))
        .enumerate()
        .map(|(k, (before, after))| {
            let change = |c: usize| Change { before: before[c], after: after[c] };
            HorizonError {
                horizon_s: k as f64 * run.data.dt_s,
                v_y_mps: change(0),
                yaw_rate_radps: change(1),
            }
        })
        .collect();
    let slips = PerAxle { front: run.direct.slips.front.range_rad, rear: run.direct.slips.rear.range_rad };
    let (key, request_initial) = (run.candidate.key.clone(), run.initial);
    let mut outcome = Outcome {
        phi_p: found,
        found,
        status: Status::Rejected,
        valid_within: ValidWithin::NOWHERE,
        provisional: provisional(run),
        cornering_stiffness_n_per_rad: stiffness,
        peak_friction: peak_friction(run, &found),
        iterations: key.iteration,
        converged,
        accepted: false,
        reasons: Vec::new(),
        slip_range_rad: slips,
        v_x_range_mps: Range::of(run.data.samples(|s, k| s.v_x_mps[k])),
        mean_speed_mps: run.data.mean_speed_mps,
        signals: corrections,
        signal_intervals: signal_intervals(run),
        weak_signals: weak_signals(run),
        nuisance: run.direct.allowed,
        fitted: run.direct.fitted,
        rmse: RmseReport {
            one_step: rmse(one_step_errors),
            rollout: rmse(rollout_errors),
            horizon_s: window_len as f64 * run.data.dt_s,
            noise,
        },
        rollout_error,
        source,
        on_bound: on_bound(&found),
        initial: request_initial,
        least_squares: Some(run.direct.tires),
        history: run.history.clone(),
        curves: curves(run, &found),
        prior: run.prior,
        grip: run.grip.clone(),
        grip_change: run.direct.grip_change,
        handling: Handling::of(run, &found),
        longitudinal: run.longitudinal.clone(),
        health: run.data.health.clone(),
        drive_next: Vec::new(),
        key,
        config: run.config.clone(),
        vehicle: run.vehicle.clone(),
        recorded: run.recorded.clone(),
        trace: trace(run, &before, &after),
    };
    crate::acceptance::judge(run, &envelope, &mut outcome);
    Ok(outcome)
}

/// The tires that predict the validation part best; with the paper's method those that leave the smallest residual on it.
fn choose(run: &Identification) -> (PacejkaParameters, Source) {
    let by_loop =
        if run.config.residual == ResidualKind::None { Source::NominalLoop } else { Source::ResidualLoop };
    if run.config.method == crate::Method::Paper {
        let best = run.history.iter().min_by(|a, b| a.residual_left.total_cmp(&b.residual_left));
        return (best.map_or(run.initial, |turn| turn.phi_p), by_loop);
    }
    // A network learns from the whole sequence, the old road and what is held back of the new one included.
    if run.grip.as_ref().is_some_and(|reading| reading.changed) {
        return (run.direct.tires, Source::LeastSquares);
    }
    let best = run.history.iter().min_by(|a, b| a.validation_rmse.total_cmp(&b.validation_rmse));
    let better = |tires: &PacejkaParameters, validation_rmse: f64| {
        validation_rmse < (1.0 - LOOP_GAIN) * run.direct_error
            && run.error_on(Part::Training, tires)
                < (1.0 + LOOP_LOSS) * run.error_on(Part::Training, &run.direct.tires)
    };
    match best {
        Some(turn) if !run.config.direct_start || better(&turn.phi_p, turn.validation_rmse) => {
            (turn.phi_p, by_loop)
        }
        _ => (run.direct.tires, Source::LeastSquares),
    }
}

/// An estimate around `value` from the direct fit's standard error, widened by what other gains and lever arms would change and by how far the
/// direct fit lies off.
fn around(value: f64, direct: f64, error: Option<f64>, shift: f64) -> Estimate {
    let half = error.map_or(f64::NAN, |e| (Estimate::Z90 * e).hypot(shift)) + (value - direct).abs();
    Estimate { value, low: value - half, high: value + half }
}

fn stiffness(run: &Identification, tires: &PacejkaParameters) -> PerAxle<Estimate> {
    let axle = |axle: &MagicFormula, direct: &MagicFormula, offset: usize, load_n: f64| {
        let (k, d) = (axle.normalized_stiffness(), direct.normalized_stiffness());
        let e = around(k, d, run.direct.standard_error(offset), run.direct.shift[offset]);
        Estimate { value: e.value * load_n, low: e.low.max(0.0) * load_n, high: e.high * load_n }
    };
    PerAxle {
        front: axle(&tires.front, &run.direct.tires.front, 0, run.vehicle.static_load_front_n()),
        rear: axle(&tires.rear, &run.direct.tires.rear, 4, run.vehicle.static_load_rear_n()),
    }
}

/// D of the tires found, which the data alone have a say in.
fn peak_friction(run: &Identification, tires: &PacejkaParameters) -> PerAxle<PeakFriction> {
    let axle = |axle: &MagicFormula, direct: &MagicFormula, peak: &PeakEvidence| {
        let off = (axle.d - direct.d).abs();
        let (low, high) = if peak.reached {
            ((axle.d - peak.below - off).max(0.0), axle.d + peak.above + off)
        } else {
            (f64::NAN, f64::NAN)
        };
        PeakFriction { value: axle.d, low, high, reached: peak.reached, from_prior: false }
    };
    let (peak, direct) = (&run.direct.peak, &run.direct.tires);
    PerAxle {
        front: axle(&tires.front, &direct.front, &peak.front),
        rear: axle(&tires.rear, &direct.rear, &peak.rear),
    }
}

/// The set with the friction prior; `None` where it has no say.
fn provisional(run: &Identification) -> Option<ProvisionalSet> {
    let with_prior = run.direct.with_prior?;
    let axle = |axle: &MagicFormula, peak: &PeakEvidence, d_sigma: Option<f64>| {
        let (below, above) = match d_sigma {
            Some(sigma) => (Estimate::Z90 * sigma, Estimate::Z90 * sigma),
            None => (peak.below, peak.above),
        };
        PeakFriction {
            value: axle.d,
            low: (axle.d - below).max(0.0),
            high: axle.d + above,
            reached: peak.reached,
            from_prior: d_sigma.is_some(),
        }
    };
    let (peak, tires, sigma) = (&run.direct.peak, &with_prior.tires, &with_prior.d_sigma);
    let peak_friction = PerAxle {
        front: axle(&tires.front, &peak.front, sigma.front),
        rear: axle(&tires.rear, &peak.rear, sigma.rear),
    };
    Some(ProvisionalSet { phi_p: *tires, peak_friction })
}

fn signal_intervals(run: &Identification) -> SignalEstimates {
    SignalEstimates::from_array(std::array::from_fn(|j| {
        let value = run.direct.fit.parameters[SIGNALS + j];
        // Where data and prior contradict each other one of them is wrong: widened by Birge's ratio, as the Particle Data Group does.
        let prior = run.direct.signal_priors[j];
        let error = run.direct.signal_errors[j]
            .map(|e| e * ((value - prior.mean).abs() / prior.sigma.hypot(e)).max(1.0))
            .map(|e| e.hypot(run.direct.shift[SIGNALS + j] / Estimate::Z90));
        Estimate::from_error(value, error)
    }))
}

/// Corrections of which the prior knew more than the data.
fn weak_signals(run: &Identification) -> Vec<WeakSignal> {
    (0..6)
        .filter_map(|j| {
            let prior_sigma = run.direct.signal_priors[j].sigma;
            let error = run.direct.signal_errors[j].unwrap_or(prior_sigma);
            if j == 5 && run.data.has_heading() {
                return None;
            }
            let data_share = 1.0 - (error / prior_sigma).powi(2).min(1.0);
            (data_share < WEAK_SHARE).then_some(WeakSignal {
                name: NAMES[SIGNALS + j],
                data_share,
                prior_sigma,
            })
        })
        .collect()
}

/// A speed within the range driven at which the straight-running car is unstable, if any.
pub(crate) fn unstable_at_mps(
    vehicle: &VehicleParameters,
    tires: &PacejkaParameters,
    speeds: &Range,
) -> Option<f64> {
    let grows = |v: f64| straight_line_growth_rate_1ps(vehicle, tires, v) > 0.0;
    (speeds.high.is_finite() && grows(speeds.high))
        .then(|| critical_speed_mps(vehicle, tires).unwrap_or(speeds.high))
}
