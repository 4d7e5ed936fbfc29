//! The residual network of crate `s4` on top of a fitted model: what a black box explains, without a name.
//!
//! It is taught, at every second hundredth of a second, the constant acceleration of v_y and yaw rate that, over 0.2 s around, with a free
//! start, lets the model meet the measurement best (one step's errors would be mostly noise). In a rollout it is fed with the predicted
//! states, its memory with the measured ones before the start.

use gripsight_estimation::{HORIZON_S, Windows, of_length};
use gripsight_model::{Correction, CorrectionStream, ExtendedModel, Run, Window};
use std::ops::ControlFlow;

use gripsight_s4::{
    NetworkConfig, Normalization, ResidualNetwork, Sequence, StreamState, TrainingConfig, TrainingSet, train,
};
use gripsight_vehicle::{Dual, Real as _};
use nalgebra::{Matrix4, Vector4};
use rayon::prelude::*;

use crate::engine::Engine;
use crate::state::State;

/// Step of the network.
const STEP_S: f64 = 0.02;
/// Half of the time over which one acceleration is fitted.
const HALF_S: f64 = 0.1;
/// Time before a window that fills the network's memory.
const WARM_UP_S: f64 = 0.6;
/// Of so many training blocks one says when to stop.
const VALIDATION_EVERY: usize = 5;
const EPOCHS: usize = 80;
/// Inputs (v_x, v_y, yaw rate, steering) and outputs (accelerations of v_y and yaw rate) of the network.
const INPUTS: usize = 4;
const OUTPUTS: usize = 2;

/// Shares of a network's output that are tried.
const SHARES: [f64; 4] = [0.0, 0.3, 0.6, 1.0];

/// A trained network.
#[derive(Debug)]
pub(crate) struct Residual {
    network: ResidualNetwork,
    /// How much of its output is used.
    share: f64,
    /// The least and the greatest that each output was taught: what a network says beyond is no knowledge, and drives a rollout off.
    taught: [[f64; 2]; OUTPUTS],
}

impl Residual {
    /// Learns what a fitted model leaves over; `None` where there is too little to learn from.
    ///
    /// A network that feeds on its own predictions may run off. So a second one is taught on the model's own predictions as well, and of
    /// both the share that does best in rollouts of the validation blocks is used; that may be none.
    pub(crate) fn learned(engine: &Engine<'_>, base: &State, windows: &Windows) -> Option<Self> {
        let lessons = Lessons::of(engine, base, windows);
        let validation = of_length(engine.recording, &windows.of_blocks(is_validation), HORIZON_S);
        let mut best: Option<(f64, Self)> = None;
        let taught = lessons.range();
        let (measured, predicted) = rayon::join(|| lessons.teach(false), || lessons.teach(true));
        for network in [measured.ok()?, predicted.ok()?] {
            for share in SHARES {
                let residual = Self { network: network.clone(), share, taught };
                let model = ExtendedModel { residual: Some(&residual), ..engine.model(&base.effects, None) };
                let error: f64 =
                    engine.score_model(&model, &base.parameters, &validation).squares.iter().sum();
                if best.as_ref().is_none_or(|(least, _)| error < *least) {
                    best = Some((error, residual));
                }
            }
        }
        best.map(|(_, residual)| residual)
    }
}

impl Correction for Residual {
    fn stream<'r>(&'r self, run: &'r Run, window: &Window) -> Box<dyn CorrectionStream + 'r> {
        let stride = stride(run.dt_s);
        let steps = ((WARM_UP_S / (stride as f64 * run.dt_s)) as usize).min(window.from / stride);
        let mut stream = Stream {
            residual: self,
            run,
            from: window.from,
            stride,
            memory: self.network.stream_state(),
            output: [0.0; OUTPUTS],
        };
        for k in (1..=steps).rev().map(|i| window.from - i * stride) {
            stream.step(k, [run.smooth[0][k], run.smooth[1][k]]);
        }
        Box::new(stream)
    }
}

fn is_validation(block: usize) -> bool {
    block.is_multiple_of(VALIDATION_EVERY)
}

fn stride(dt_s: f64) -> usize {
    (STEP_S / dt_s).round().max(1.0) as usize
}

/// A network that follows a rollout.
struct Stream<'r> {
    residual: &'r Residual,
    run: &'r Run,
    from: usize,
    stride: usize,
    memory: StreamState,
    output: [f64; OUTPUTS],
}

impl CorrectionStream for Stream<'_> {
    fn next(&mut self, k: usize, state: [f64; 2]) -> [f64; OUTPUTS] {
        if k.is_multiple_of(self.stride) {
            self.step(self.from + k, state);
        }
        self.output
    }
}

impl Stream<'_> {
    fn step(&mut self, k: usize, [v_y_mps, yaw_rate_radps]: [f64; 2]) {
        let input = [self.run.v_x_mps[k], v_y_mps, yaw_rate_radps, self.run.steering_rad[k]];
        // What is not finite goes on as such: the rollout then has failed.
        if self.residual.network.step(&mut self.memory, &input, &mut self.output).is_err() {
            self.output = [f64::NAN; OUTPUTS];
        }
        for (output, [least, greatest]) in self.output.iter_mut().zip(self.residual.taught) {
            *output = self.residual.share * output.clamp(least, greatest);
        }
    }
}

/// Inputs and targets of one stretch, and the training block of each sample.
struct Lesson {
    inputs: [Vec<f64>; INPUTS],
    targets: [Vec<f64>; OUTPUTS],
    block: Vec<Option<usize>>,
    /// Whether its states are the model's instead of the measured ones.
    predicted: bool,
}

struct Lessons(Vec<Lesson>);

impl Lessons {
    fn of(engine: &Engine<'_>, base: &State, windows: &Windows) -> Self {
        let model = engine.model(&base.effects, None);
        let mut lessons = Vec::new();
        for (segment, run) in engine.recording.runs.iter().enumerate() {
            let mut blocks = vec![None; run.len()];
            let mut states = run.smooth.clone();
            let here = windows.windows.iter().zip(&windows.block).zip(&base.starts);
            for ((window, &block), &start) in here.filter(|((w, _), _)| w.segment == segment) {
                let range = window.from..window.from + window.len;
                let predicted = model.predict(&base.parameters, start, window);
                blocks[range.clone()].fill(Some(block));
                states[0][range.clone()].copy_from_slice(&predicted.v_y_mps);
                states[1][range].copy_from_slice(&predicted.yaw_rate_radps);
            }
            let half = (HALF_S / run.dt_s).round().max(2.0) as usize;
            let places: Vec<usize> = (0..run.len()).step_by(stride(run.dt_s)).collect();
            let taught: Vec<Option<(usize, [f64; 2])>> = places
                .par_iter()
                .map(|&k| {
                    let from = k.checked_sub(half)?;
                    // Nothing of a block that is held out gets into a target.
                    let block = blocks[from].filter(|_| blocks.get(k + half).is_some_and(Option::is_some))?;
                    let window = Window { segment, from, len: 2 * half + 1 };
                    Some((block, acceleration(engine, &model, &base.parameters, &window)?))
                })
                .collect();
            let input = |series: &[f64]| places.iter().map(|&k| series[k]).collect::<Vec<f64>>();
            let target = |i: usize| taught.iter().map(|t| t.map_or(0.0, |(_, a)| a[i])).collect::<Vec<f64>>();
            for (predicted, [v_y_mps, yaw_rate_radps]) in [(false, &run.smooth), (true, &states)] {
                lessons.push(Lesson {
                    inputs: [&run.v_x_mps, v_y_mps, yaw_rate_radps, &run.steering_rad].map(|s| input(s)),
                    targets: [target(0), target(1)],
                    block: taught.iter().map(|t| t.map(|(block, _)| block)).collect(),
                    predicted,
                });
            }
        }
        Self(lessons)
    }

    /// The least and the greatest target of each output; those that nothing is known of are 0.
    fn range(&self) -> [[f64; 2]; OUTPUTS] {
        std::array::from_fn(|i| {
            let targets = self.0.iter().flat_map(|lesson| &lesson.targets[i]);
            targets.fold([0.0; 2], |[least, greatest], t| [t.min(least), t.max(greatest)])
        })
    }

    /// A network taught on the measured states, or on the predicted ones as well.
    fn teach(&self, predicted: bool) -> Result<ResidualNetwork, gripsight_s4::Error> {
        let training = self.set(predicted, false)?;
        let validation = self.set(predicted, true)?;
        let shape = NetworkConfig { inputs: INPUTS, outputs: OUTPUTS, ..NetworkConfig::default() };
        let network = ResidualNetwork::new(shape, Normalization::fit(&training), 0)?;
        let settings =
            TrainingConfig { epochs_max: EPOCHS, patience: EPOCHS / 4, ..TrainingConfig::default() };
        let done =
            train(&network, &training, Some(&validation), &settings, &mut |_| ControlFlow::Continue(()))?;
        Ok(done.0)
    }

    /// Everything as inputs, the samples of training or of validation as targets.
    fn set(&self, predicted: bool, validation: bool) -> Result<TrainingSet, gripsight_s4::Error> {
        let counts = |block: &Option<usize>| block.is_some_and(|b| is_validation(b) == validation);
        let lessons = self.0.iter().filter(|lesson| predicted || !lesson.predicted);
        let sequences: Vec<Sequence> = lessons
            .map(|lesson| Sequence {
                inputs: lesson.inputs.concat(),
                targets: lesson.targets.concat(),
                weights: lesson.block.iter().map(|b| f64::from(u8::from(counts(b)))).collect(),
            })
            .collect();
        TrainingSet::new(INPUTS, OUTPUTS, &sequences)
    }
}

/// The accelerations that let the model meet v_y and yaw rate over a window best: one Gauss-Newton step, the start free.
fn acceleration(
    engine: &Engine<'_>,
    model: &ExtendedModel<'_>,
    parameters: &[f64],
    window: &Window,
) -> Option<[f64; 2]> {
    let run = &engine.recording.runs[window.segment];
    let p: Vec<Dual<4>> = parameters.iter().map(|&v| Dual::from(v)).collect();
    let start = [0, 1].map(|c| Dual::variable(run.smooth[c][window.from], c));
    let push = [2, 3].map(|i| Dual::variable(0.0, i));
    let predicted = model.predict_pushed(&p, start, push, window);
    let (mut information, mut gradient) = (Matrix4::zeros(), Vector4::zeros());
    for (c, series) in [&predicted.v_y_mps, &predicted.yaw_rate_radps].into_iter().enumerate() {
        let measured = &run.measured[c][window.from..];
        for (value, target) in series.iter().zip(measured) {
            let slope = Vector4::from(*value.derivatives()) / engine.recording.sigma[c];
            information += slope * slope.transpose();
            gradient += slope * ((target - value.re()) / engine.recording.sigma[c]);
        }
    }
    let step = information.cholesky()?.solve(&gradient);
    step.iter().all(|v| v.is_finite()).then_some([step[2], step[3]])
}

#[cfg(test)]
mod tests {
    use gripsight_estimation::split;
    use gripsight_vehicle::VehicleParameters;

    use super::*;
    use crate::testing::{drive, tires};
    use crate::trust::TireTrust;

    #[test]
    fn far_from_what_it_was_taught_a_network_says_no_more_than_it_was_taught() {
        const LAG_S: f64 = 0.06;
        let vehicle = VehicleParameters::f1tenth();
        let recording = drive(&vehicle, LAG_S);
        let engine = Engine::new(&recording, &vehicle, tires(), TireTrust::file());
        let windows = split(&recording, true).training;
        let null = engine.fit(&[], &engine.blank(), None, &windows, 15);
        let residual = Residual { share: 1.0, ..Residual::learned(&engine, &null, &windows).unwrap() };
        let window = windows.windows[0];
        let mut stream = residual.stream(&recording.runs[window.segment], &window);
        let mut at_the_end = false;
        for far in [-1e6, 1e6] {
            for (said, [least, greatest]) in stream.next(0, [far, -far]).into_iter().zip(residual.taught) {
                assert!((least..=greatest).contains(&said), "{said} of {least} to {greatest}");
                at_the_end |= said == least || said == greatest;
            }
        }
        assert!(at_the_end);
    }
}
