//! What the nominal model leaves over, and the network that learns it.
//!
//! The paper's residual is one step's: e_k = x_{k+1} - f(x_k, u_k). At 10 ms that is mostly sensor noise, twice: in the target, and in the state
//! that the prediction starts from. The robust way asks instead which constant disturbance of the derivatives, over a short window with a
//! free start, explains the measurement best (least squares, one Gauss-Newton step), and puts it at the middle of the window:
//!
//! ```text
//! min over x_0, e:  sum_k |y_k - y(x_0, e)_k|^2 / sigma^2,      dx/dt = f(x, u) + e/dt
//! ```

use gripsight_model::Window;
use std::ops::ControlFlow;

use gripsight_s4::{Normalization, ResidualNetwork, Sequence, TrainingConfig, TrainingSet, train};
use gripsight_signals::{DataHealth, Segment, StateSequence};
use gripsight_vehicle::{
    Dual, Input, MagicFormula, PacejkaParameters, Real, SingleTrack, State, VehicleParameters,
};
use nalgebra::{Matrix4, Vector4};

use crate::data::{Data, MIN_WINDOWS, Part, quantile};
use crate::rollout::{delayed, substep_s};
use crate::{
    Candidate, Config, IdentificationError, Method, PerAxle, Range, ResidualKind, ResidualModel, RunKey,
    SignalCorrections, Usable, vehicle_hash,
};

/// Length of the windows of the robust residual: longer than the lateral motion's time constant, shorter than a change of the driving.
const RESIDUAL_WINDOW_S: f64 = 0.2;
/// Finest time step of the robust residual: what is learned is slower.
const RESIDUAL_STEP_S: f64 = 0.02;
/// Its coarsest step: a quarter of a window.
const COARSEST_STEP_S: f64 = 0.05;
/// Residuals that a network is trained on, at most, where the step can be coarser: those of a minute at the finest step.
const MOST_SAMPLES: usize = 3000;

/// Width of the means that take the noise out of the paper's residual: 3 dB less at about 3 Hz (ForzaETH: 2.5 Hz).
const SMOOTHING_S: f64 = 0.1;

/// One sample that a network is trained on.
#[derive(Debug, Clone, Copy)]
struct Sample {
    state: State,
    input: Input,
    residual: [f64; 2],
    part: Part,
}

/// Samples of one stretch, evenly spaced.
type Stretch = Vec<Sample>;

/// Learns what the single-track model with the candidate's tires leaves over. A pure function of sequence, car, candidate and settings.
/// `progress` is called after each epoch and may end the training.
///
/// # Errors
/// As [`Identification::start`](crate::Identification::start); [`IdentificationError::Interrupted`] where `progress` ended it, and
/// [`IdentificationError::WrongModel`] for a candidate of another car.
pub fn train_residual(
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    candidate: &Candidate,
    config: &Config,
    progress: &mut dyn FnMut(gripsight_s4::Progress) -> ControlFlow<()>,
) -> Result<ResidualModel, IdentificationError> {
    train_on(&Usable::of(sequence, vehicle)?, vehicle, candidate, config, progress)
}

/// The same with the recording made ready.
pub(crate) fn train_on(
    usable: &Usable,
    vehicle: &VehicleParameters,
    candidate: &Candidate,
    config: &Config,
    progress: &mut dyn FnMut(gripsight_s4::Progress) -> ControlFlow<()>,
) -> Result<ResidualModel, IdentificationError> {
    let own = RunKey {
        sequence_id: usable.sequence.sequence_id,
        vehicle_hash: vehicle_hash(vehicle),
        ..candidate.key.clone()
    };
    if own != candidate.key {
        return Err(IdentificationError::WrongModel {
            expected: own.to_string(),
            got: candidate.key.to_string(),
        });
    }
    if !candidate.phi_p.is_finite() {
        return Err(IdentificationError::NotFinite { what: "tires of the candidate" });
    }
    let data = Data::new(usable, vehicle, &DataHealth::of(&usable.sequence)?, MIN_WINDOWS)?;
    let car = SingleTrack::new(vehicle, &candidate.phi_p);
    let (stretches, dt_s, horizon) = match config.method {
        Method::Paper => (one_step(&data, &car, candidate), data.dt_s, 1),
        Method::Robust => disturbances(&data, vehicle, candidate),
    };
    let mut slips = hull(&stretches, &car);
    let mirrored = config.method == Method::Paper && one_sided(&slips);
    if mirrored {
        slips = slips.map(|r| Range { low: r.low.min(-r.high), high: r.high.max(-r.low) });
    }
    let speeds = stretches.iter().flatten().map(|s| s.input.v_x_mps);
    let mut model = ResidualModel {
        key: candidate.key.clone(),
        phi_p: candidate.phi_p,
        architecture: config.residual,
        d_model: 0,
        d_state: 0,
        layers: 0,
        dt_s,
        horizon,
        input_mean: Vec::new(),
        input_scale: Vec::new(),
        output_scale: Vec::new(),
        weights: Vec::new(),
        slip_range_rad: slips,
        v_x_range_mps: Range::of(speeds),
        epochs: 0,
        samples: stretches.iter().map(Vec::len).sum(),
        training_loss: 1.0,
        validation_loss: 1.0,
    };
    if config.residual == ResidualKind::None {
        return Ok(model);
    }
    let sides: &[f64] = if mirrored { &[1.0, -1.0] } else { &[1.0] };
    let network = fit_network(&stretches, sides, candidate, config, &mut model, progress)?;
    let normalization = network.normalization();
    model.d_model = network.config().d_model;
    model.d_state = if config.residual == ResidualKind::S4 { network.config().d_state } else { 0 };
    model.layers = network.config().layers;
    model.input_mean.clone_from(&normalization.input_mean);
    model.input_scale.clone_from(&normalization.input_scale);
    model.output_scale.clone_from(&normalization.output_scale);
    model.weights = network.weights().to_vec();
    Ok(model)
}

fn fit_network(
    stretches: &[Stretch],
    sides: &[f64],
    candidate: &Candidate,
    config: &Config,
    model: &mut ResidualModel,
    progress: &mut dyn FnMut(gripsight_s4::Progress) -> ControlFlow<()>,
) -> Result<ResidualNetwork, IdentificationError> {
    let training = training_set(stretches, sides, Part::Training)?;
    let validation = training_set(stretches, sides, Part::Validation)?;
    let shape = config.network();
    let network = ResidualNetwork::new(shape, Normalization::fit(&training), candidate.key.seed)?;
    let settings = TrainingConfig { seed: candidate.key.seed, ..config.training() };
    let mut interrupted = false;
    let (network, report) = train(&network, &training, Some(&validation), &settings, &mut |p| {
        let flow = progress(p);
        interrupted |= flow.is_break();
        flow
    })?;
    if interrupted {
        return Err(IdentificationError::Interrupted);
    }
    model.epochs = report.epochs;
    model.training_loss = network.evaluate(&training)?.loss;
    model.validation_loss = report.best_loss;
    Ok(network)
}

/// Everything as inputs, the samples of one part as targets; for side -1 as seen in a mirror.
fn training_set(
    stretches: &[Stretch],
    sides: &[f64],
    part: Part,
) -> Result<TrainingSet, gripsight_s4::Error> {
    let seen = |stretch: &Stretch, side: f64| {
        let channel = |f: &dyn Fn(&Sample) -> f64| stretch.iter().map(f).collect::<Vec<_>>();
        Sequence {
            inputs: [
                channel(&|s| s.input.v_x_mps),
                channel(&|s| side * s.state.v_y_mps),
                channel(&|s| side * s.state.yaw_rate_radps),
                channel(&|s| side * s.input.steering_rad),
            ]
            .concat(),
            targets: [channel(&|s| side * s.residual[0]), channel(&|s| side * s.residual[1])].concat(),
            weights: channel(&|s| f64::from(u8::from(s.part == part))),
        }
    };
    let sequences: Vec<Sequence> =
        sides.iter().flat_map(|&side| stretches.iter().map(move |stretch| seen(stretch, side))).collect();
    TrainingSet::new(crate::INPUTS.len(), crate::OUTPUTS.len(), &sequences)
}

/// 1st to 99th percentile of the slips trained on.
fn hull(stretches: &[Stretch], car: &SingleTrack) -> PerAxle<Range> {
    let training = stretches.iter().flatten().filter(|s| s.part == Part::Training);
    let (mut front, mut rear): (Vec<f64>, Vec<f64>) =
        training.map(|s| car.slip_angles_rad(&s.state, &s.input)).unzip();
    let range = |slips: &mut Vec<f64>| Range {
        low: quantile(slips, 0.01).unwrap_or(f64::NAN),
        high: quantile(slips, 0.99).unwrap_or(f64::NAN),
    };
    PerAxle { front: range(&mut front), rear: range(&mut rear) }
}

/// Slips to one side that stay within this share of those to the other say too little of it: the paper's sweep asks about both, and a network that has
/// seen one or two corners makes up the other side. Full-size cars' first 9 s have 0.05 to 0.3 (development), the reference car's 0.4 to 0.6.
const ONE_SIDED: f64 = 0.4;

/// Whether an axle hardly slipped to one side. The paper's networks then learn from the drive and from its mirror image.
fn one_sided(slips: &PerAxle<Range>) -> bool {
    [slips.front, slips.rear].iter().any(|r| (-r.low).min(r.high) < ONE_SIDED * (-r.low).max(r.high))
}

/// State of the centre of gravity and input at a sample, signals corrected.
fn corrected(segment: &Segment, k: usize, c: &SignalCorrections) -> (State, Input) {
    let yaw_rate_radps = segment.yaw_rate_radps[k] - c.yaw_rate_bias_radps;
    let state = State {
        v_y_mps: segment.v_y_mps[k] - c.v_y_lever_arm_m * yaw_rate_radps - c.v_y_bias_mps,
        yaw_rate_radps,
    };
    let recorded = delayed(&segment.steering_rad, k, c.steering_delay_s / segment.dt_s);
    let steering_rad = recorded * c.steering_gain + c.steering_offset_rad;
    (state, Input { v_x_mps: segment.v_x_mps[k], steering_rad })
}

fn part_of(data: &Data, segment: usize, k: usize) -> Option<Part> {
    // Windows lie in order.
    let after = data.windows.partition_point(|(w, _)| (w.segment, w.from) <= (segment, k));
    let (window, part) = data.windows.get(after.checked_sub(1)?)?;
    (window.segment == segment && k < window.from + window.len).then_some(*part)
}

fn samples_of(data: &Data, stretch: &Window) -> Vec<(usize, Part)> {
    (stretch.from..stretch.from + stretch.len)
        .filter_map(|k| part_of(data, stretch.segment, k).map(|part| (k, part)))
        .collect()
}

/// Means over windows of `width` samples, twice: a low-pass without delay. All channels alike, so that what is linear in them stays true.
fn smoothed(series: &[(State, Input)], width: usize) -> Vec<(State, Input)> {
    let half = width / 2;
    let once = |series: &[(State, Input)]| -> Vec<(State, Input)> {
        (0..series.len())
            .map(|k| {
                let reach = half.min(k).min(series.len() - 1 - k);
                let around = &series[k - reach..=k + reach];
                let mean = |f: &dyn Fn(&(State, Input)) -> f64| {
                    around.iter().map(f).sum::<f64>() / around.len() as f64
                };
                let state =
                    State { v_y_mps: mean(&|s| s.0.v_y_mps), yaw_rate_radps: mean(&|s| s.0.yaw_rate_radps) };
                let input =
                    Input { v_x_mps: mean(&|s| s.1.v_x_mps), steering_rad: mean(&|s| s.1.steering_rad) };
                (state, input)
            })
            .collect()
    };
    once(&once(series))
}

/// The paper's residual at every sample.
fn one_step(data: &Data, car: &SingleTrack, candidate: &Candidate) -> Vec<Stretch> {
    let stiffness = stiffest(candidate);
    let stretch = |stretch: &Window| -> Stretch {
        let segment = &data.segments[stretch.segment];
        let series: Vec<(State, Input)> = (stretch.from..stretch.from + stretch.len)
            .map(|k| corrected(segment, k, &candidate.corrections))
            .collect();
        let series = smoothed(&series, (SMOOTHING_S / segment.dt_s).round() as usize);
        let at = |k: usize| series[k - stretch.from];
        samples_of(data, stretch)
            .into_iter()
            .filter(|(k, _)| k + 1 < stretch.from + stretch.len)
            .map(|(k, part)| {
                let ((state, input), (next, next_input)) = (at(k), at(k + 1));
                let step_s = substep_s(stiffness, input.v_x_mps);
                let predicted = car.step(state, &input, &next_input, segment.dt_s, step_s);
                let residual =
                    [next.v_y_mps - predicted.v_y_mps, next.yaw_rate_radps - predicted.yaw_rate_radps];
                Sample { state, input, residual, part }
            })
            .collect()
    };
    data.stretches.iter().map(stretch).filter(|s: &Stretch| !s.is_empty()).collect()
}

/// Root mean squares of the paper's residual with a candidate's tires on the validation part: v_y in m/s, yaw rate in rad/s.
pub(crate) fn left_over(data: &Data, vehicle: &VehicleParameters, candidate: &Candidate) -> [f64; 2] {
    let stretches = one_step(data, &SingleTrack::new(vehicle, &candidate.phi_p), candidate);
    let held_out = || stretches.iter().flatten().filter(|s| s.part == Part::Validation);
    let samples = held_out().count().max(1) as f64;
    std::array::from_fn(|c| (held_out().map(|s| s.residual[c].powi(2)).sum::<f64>() / samples).sqrt())
}

fn stiffest(candidate: &Candidate) -> f64 {
    candidate.phi_p.front.normalized_stiffness().max(candidate.phi_p.rear.normalized_stiffness())
}

/// The robust residual, at every `stride`-th sample; with the time step and the windows' length in those steps.
fn disturbances(
    data: &Data,
    vehicle: &VehicleParameters,
    candidate: &Candidate,
) -> (Vec<Stretch>, f64, usize) {
    let stride = residual_stride(data);
    let half = (0.5 * RESIDUAL_WINDOW_S / data.dt_s).round().max(3.0) as usize;
    let dt_s = stride as f64 * data.dt_s;
    let tires = PacejkaParameters { front: lift(&candidate.phi_p.front), rear: lift(&candidate.phi_p.rear) };
    let car = SingleTrack::new(vehicle, &tires);
    let solver = Disturbance { car, noise: data.noise, stiffness: stiffest(candidate) };
    let stretch = |stretch: &Window| -> Stretch {
        let segment = &data.segments[stretch.segment];
        let series: Vec<(State, Input)> = (stretch.from..stretch.from + stretch.len)
            .map(|k| corrected(segment, k, &candidate.corrections))
            .collect();
        samples_of(data, stretch)
            .into_iter()
            .step_by(stride)
            .filter_map(|(k, part)| {
                let middle = k - stretch.from;
                let around = series.get(middle.checked_sub(half)?..=middle + half)?;
                let (state, rate) = solver.solve(around, segment.dt_s)?;
                let residual = [rate[0] * dt_s, rate[1] * dt_s];
                Some(Sample { state, input: series[middle].1, residual, part })
            })
            .collect()
    };
    let stretches = data.stretches.iter().map(stretch).filter(|s: &Stretch| !s.is_empty()).collect();
    (stretches, dt_s, (2 * half).div_ceil(stride))
}

/// Samples from one residual to the next: the finest step, and on a long drive a coarser one, which makes no more of them than a minute has.
fn residual_stride(data: &Data) -> usize {
    let finest = (RESIDUAL_STEP_S / data.dt_s).round().max(1.0) as usize;
    let samples: usize = data.stretches.iter().map(|s| s.len).sum();
    let coarsest = (COARSEST_STEP_S / data.dt_s).round() as usize;
    samples.div_ceil(MOST_SAMPLES).min(coarsest).max(finest)
}

/// Derivatives by the start state and the disturbance.
type Dual4 = Dual<4>;

fn lift(axle: &MagicFormula) -> MagicFormula<Dual4> {
    MagicFormula {
        b: Dual::from(axle.b),
        c: Dual::from(axle.c),
        d: Dual::from(axle.d),
        e: Dual::from(axle.e),
    }
}

/// Finds the constant disturbance of a window.
struct Disturbance {
    car: SingleTrack<Dual4>,
    noise: [f64; 2],
    stiffness: f64,
}

impl Disturbance {
    /// The state in the middle of the window and the disturbance of (dv_y/dt, dw/dt); `None` where the window does not tell.
    fn solve(&self, series: &[(State, Input)], dt_s: f64) -> Option<(State, [f64; 2])> {
        let (first, _) = series.first()?;
        let mut x = State {
            v_y_mps: Dual::variable(first.v_y_mps, 0),
            yaw_rate_radps: Dual::variable(first.yaw_rate_radps, 1),
        };
        let rate = [Dual4::variable(0.0, 2), Dual4::variable(0.0, 3)];
        let (mut information, mut gradient) = (Matrix4::zeros(), Vector4::zeros());
        let mut middle = x;
        for (k, (measured, input)) in series.iter().enumerate() {
            if k == series.len() / 2 {
                middle = x;
            }
            for (value, target, noise) in [
                (x.v_y_mps, measured.v_y_mps, self.noise[0]),
                (x.yaw_rate_radps, measured.yaw_rate_radps, self.noise[1]),
            ] {
                let slope = slope_of(value) / noise;
                information += slope * slope.transpose();
                gradient += slope * ((target - value.re()) / noise);
            }
            if let Some((_, next)) = series.get(k + 1) {
                let step_s = substep_s(self.stiffness, input.v_x_mps);
                x = self.car.step(x, &lift_input(input), &lift_input(next), dt_s, step_s);
                x.v_y_mps += rate[0] * dt_s;
                x.yaw_rate_radps += rate[1] * dt_s;
            }
        }
        let step = information.cholesky()?.solve(&gradient);
        let moved = |value: Dual4| value.re() + slope_of(value).dot(&step);
        let state = State { v_y_mps: moved(middle.v_y_mps), yaw_rate_radps: moved(middle.yaw_rate_radps) };
        let finite = step.iter().all(|v| v.is_finite());
        finite.then_some((state, [step[2], step[3]]))
    }
}

fn slope_of(value: Dual4) -> Vector4<f64> {
    Vector4::from(*value.derivatives())
}

fn lift_input(input: &Input) -> Input<Dual4> {
    Input { v_x_mps: Dual::from(input.v_x_mps), steering_rad: Dual::from(input.steering_rad) }
}
