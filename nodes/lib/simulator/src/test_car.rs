//! A small car inside the tests, as a simulator and as the car.

use std::sync::atomic::{AtomicUsize, Ordering};

use gripsight_signals::StateSequence;
use ndarray::{Array1, Array2, Array3};
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, Normal};

use crate::wire::Batch;
use crate::{
    Channel, Command, Commands, Description, Input, InputKind, Roll, SimulatorError, SimulatorParameter,
};

/// Single track, tires that saturate by tanh, a steering buffer and a rate limit.
pub(crate) struct TestCar {
    description: Description,
    passes: AtomicUsize,
    /// Relaxation length of the tires: something the simulator has no parameter for.
    pub(crate) relaxation_m: f64,
    /// Whether tires follow a straight line up to their grip: it shows where it is reached, and nowhere else.
    pub(crate) clips: bool,
    /// What the car makes of a commanded angle.
    pub(crate) steering_gain: f64,
}

impl TestCar {
    pub(crate) fn new() -> Self {
        let p = |name: &str, value: f64, low: f64, high: f64, integer: bool| SimulatorParameter {
            name: name.to_owned(),
            value,
            low,
            high,
            unit: "1".to_owned(),
            keys: (!integer).then(|| name.to_owned()).into_iter().collect(),
            in_code: integer.then(|| "the buffer".to_owned()),
            integer,
            site: None,
        };
        let description = Description {
            name: "test car".to_owned(),
            step_s: 0.01,
            states: vec![Channel::VXMps, Channel::VYMps, Channel::YawRateRadps],
            inputs: vec![Input { name: "steering".to_owned(), kind: InputKind::SteeringAngle }],
            outputs: vec![Channel::VXMps, Channel::VYMps, Channel::YawRateRadps],
            parameters: vec![
                p("c_front", 60.0, 20.0, 150.0, false),
                p("c_rear", 70.0, 20.0, 150.0, false),
                p("grip", 9.0, 3.0, 20.0, false),
                p("inertia", 11.0, 3.0, 30.0, false),
                p("delay_steps", 2.0, 0.0, 25.0, true),
                p("rate", 6.0, 0.3, 20.0, false),
            ],
            imposes_v_x: true,
            lacks: vec!["tire relaxation".to_owned()],
        };
        Self { description, passes: AtomicUsize::new(0), relaxation_m: 0.0, clips: false, steering_gain: 1.0 }
    }

    fn pass(&self, batch: &Batch, b: usize) -> Vec<[f64; 3]> {
        let row = |n: usize| if n > 1 { b } else { 0 };
        let p: Vec<f64> = batch.parameters.row(b).to_vec();
        let steps = batch.commands.shape()[1];
        let mut buffer = vec![0.0; p[4].round() as usize];
        let (mut angle, mut forces) = (0.0, [0.0; 2]);
        let mut x = [0.0; 3];
        let mut out = Vec::with_capacity(steps + 1);
        for k in 0..=steps {
            if let Some(j) = batch.place_steps.iter().position(|&s| s == k as i64) {
                x = std::array::from_fn(|s| batch.motions[[row(batch.motions.shape()[0]), j, s]]);
            } else if k > 0 {
                if let Some(kicks) = &batch.kicks {
                    (0..3).for_each(|s| x[s] += kicks[[row(kicks.shape()[0]), k - 1, s]]);
                }
                if let Some(v) = &batch.v_x_mps {
                    x[0] = v[[row(v.nrows()), k]];
                }
            }
            out.push(x);
            if k == steps {
                break;
            }
            buffer.insert(0, batch.commands[[row(batch.commands.shape()[0]), k, 0]]);
            let asked = buffer.pop().unwrap_or(0.0);
            angle += (asked - angle).clamp(-p[5] * 0.01, p[5] * 0.01);
            let [v, v_y, r] = x;
            let share = |s: f64| if self.clips { s.clamp(-1.0, 1.0) } else { s.tanh() };
            let tire = |c: f64, slip: f64| p[2] * share(c * slip / p[2]) / 2.0;
            let steady = [tire(p[0], angle - (v_y + 0.16 * r) / v), tire(p[1], -(v_y - 0.16 * r) / v)];
            for (f, s) in forces.iter_mut().zip(steady) {
                let share =
                    if self.relaxation_m > 0.0 { 1.0 - (-v * 0.01 / self.relaxation_m).exp() } else { 1.0 };
                *f += share * (s - *f);
            }
            x[1] += 0.01 * (forces[0] + forces[1] - v * r);
            x[2] += 0.01 * p[3] * (forces[0] - forces[1]);
        }
        out
    }

    /// Drives a car like this, with other parameters, and records it with noise.
    pub(crate) fn recorded(
        &self,
        changed: &[(usize, f64)],
        duration_s: f64,
        seed: u64,
    ) -> (StateSequence, Commands) {
        let samples = (duration_s / 0.01) as usize;
        let mut p = self.description.values();
        changed.iter().for_each(|&(place, value)| p[place] = value);
        let phase = seed as f64;
        let steering = |t: f64| {
            0.10 * (1.3 * t + phase).sin() + 0.05 * (4.1 * t).sin() + 0.04 * (9.7 * t + 2.0 * phase).sin()
        };
        let speed = |t: f64| 5.0 + 1.5 * (0.4 * t + phase).sin();
        let time = |k: usize| 0.01 * k as f64;
        let batch = Batch {
            parameters: Array2::from_shape_vec((1, p.len()), p).unwrap(),
            commands: Array3::from_shape_fn((1, samples, 1), |(_, k, _)| {
                self.steering_gain * steering(time(k))
            }),
            place_steps: Array1::from_vec(vec![0]),
            motions: Array3::from_shape_fn((1, 1, 3), |(_, _, s)| [speed(0.0), 0.0, 0.0][s]),
            v_x_mps: Some(Array2::from_shape_fn((1, samples + 1), |(_, k)| speed(time(k)))),
            kicks: None,
            output_steps: Array1::from_iter(0..=samples as i64),
        };
        let states = self.pass(&batch, 0);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let normal = Normal::new(0.0, 1.0).unwrap();
        let mut noisy = |s: usize, sigma: f64| -> Vec<f32> {
            states[..samples].iter().map(|x| (x[s] + sigma * normal.sample(&mut rng)) as f32).collect()
        };
        let sequence = StateSequence {
            time_s: (0..samples).map(|k| time(k) as f32).collect(),
            v_x_mps: noisy(0, 0.01),
            v_y_mps: noisy(1, 0.01),
            yaw_rate_radps: noisy(2, 0.01),
            steering_rad: (0..samples).map(|k| steering(time(k)) as f32).collect(),
            ..StateSequence::default()
        };
        let commands = Commands::new((0..samples).map(|k| Command {
            time_s: time(k),
            steering_rad: steering(time(k)),
            ..Command::default()
        }));
        (sequence, commands)
    }
}

impl Roll for TestCar {
    fn description(&self) -> &Description {
        &self.description
    }

    fn busy(&self) -> std::time::Duration {
        std::time::Duration::ZERO
    }

    fn passes(&self) -> usize {
        self.passes.load(Ordering::Relaxed)
    }

    fn rollout(&self, batch: &Batch) -> Result<Array3<f64>, SimulatorError> {
        self.passes.fetch_add(batch.passes(), Ordering::Relaxed);
        let mut out = Array3::zeros((batch.passes(), batch.output_steps.len(), 3));
        for b in 0..batch.passes() {
            let rows = self.pass(batch, b);
            for (m, &k) in batch.output_steps.iter().enumerate() {
                (0..3).for_each(|c| out[[b, m, c]] = rows[k as usize][c]);
            }
        }
        Ok(out)
    }
}
