//! The simulator with its wrapped effects, over every window of a recording.

use ndarray::{Array1, Array2, Array3};

use crate::candidates::{Around, Candidate, Kind};
use crate::drive::{Drive, Stretch, Window};
use crate::plan::{Plan, late};
use crate::wire::Batch;
use crate::{Channel, InputKind, Roll, SimulatorError, SimulatorFile};

/// Values of all candidates, and the motion that every window starts in.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// By candidate.
    pub values: Vec<f64>,
    /// By window, then by state that is free.
    pub starts: Vec<Vec<f64>>,
}

/// A simulator over a recording.
pub struct Model<'a> {
    pub(crate) roll: &'a dyn Roll,
    pub(crate) file: &'a SimulatorFile,
    pub(crate) drive: &'a Drive,
    pub(crate) candidates: &'a [Candidate],
    /// Whether the measured forward speed is imposed.
    pub(crate) imposed: bool,
    /// States whose start is free, with their place among the simulator's states and a small change of them.
    pub(crate) free: Vec<(Channel, usize, f64)>,
}

/// Residuals of a recording: measured less predicted, over the noise; window after window, sample after sample, channel after channel.
pub type Residuals = Vec<f64>;

/// Disturbances of the states: at every sample of every stretch, by state.
pub(crate) type Kicks = Vec<Vec<Vec<f64>>>;

impl<'a> Model<'a> {
    /// A simulator over a recording.
    #[must_use]
    pub fn new(
        roll: &'a dyn Roll,
        file: &'a SimulatorFile,
        drive: &'a Drive,
        candidates: &'a [Candidate],
        imposed: bool,
    ) -> Self {
        let description = roll.description();
        let states = description.states.iter().enumerate();
        let free = states
            .filter_map(|(place, &state)| match state {
                Channel::VXMps if !imposed => Some((state, place, 0.05)),
                Channel::VYMps => Some((state, place, 0.02)),
                Channel::YawRateRadps => Some((state, place, 0.02)),
                _ => None,
            })
            .collect();
        Self { roll, file, drive, candidates, imposed, free }
    }

    /// The simulator as it came, started as measured.
    #[must_use]
    pub fn null(&self) -> Point {
        let starts = self.drive.windows.iter().map(|w| {
            let s = &self.drive.stretches[w.stretch];
            let at = |v: &[f64]| {
                // The mean of a few samples: less noise, and no motion to speak of.
                let span = &v[w.from..(w.from + 3).min(v.len())];
                span.iter().sum::<f64>() / span.len() as f64
            };
            self.free
                .iter()
                .map(|(state, _, _)| self.measured_state(s, *state).map_or(0.0, |v| at(&v)))
                .collect()
        });
        Point { values: self.candidates.iter().map(|c| c.null).collect(), starts: starts.collect() }
    }

    /// A measured state at the simulator's reference point.
    fn measured_state(&self, s: &Stretch, state: Channel) -> Option<Vec<f64>> {
        match state {
            Channel::VXMps => Some(s.v_x_mps.clone()),
            Channel::VYMps => {
                let ahead_m = self.file.reference.v_y_ahead_m;
                let pairs = s.segment.v_y_mps.iter().zip(&s.segment.yaw_rate_radps);
                Some(pairs.map(|(v_y, r)| v_y - ahead_m * r).collect())
            }
            other => s.channel(other).map(<[f64]>::to_vec),
        }
    }

    /// Residuals at several points.
    ///
    /// # Errors
    /// What the simulator says.
    pub fn residuals(&self, points: &[Point]) -> Result<Vec<Residuals>, SimulatorError> {
        self.kicked(points, &[])
    }

    /// Residuals at several points, each with its disturbance where there are any.
    pub(crate) fn kicked(&self, points: &[Point], kicks: &[Kicks]) -> Result<Vec<Residuals>, SimulatorError> {
        if points.is_empty() {
            return Ok(Vec::new());
        }
        // What only the sensors see needs no pass of its own.
        let mut passes: Vec<(usize, Vec<f64>)> = Vec::new();
        let mut pass_of: Vec<usize> = Vec::with_capacity(points.len());
        for (place, point) in points.iter().enumerate() {
            let values = self.own(&point.values);
            let same = |(other, seen): &(usize, Vec<f64>)| {
                *seen == values && kicks.is_empty() && self.drives_alike(&points[*other], point)
            };
            let known = passes.iter().position(same).unwrap_or(passes.len());
            if known == passes.len() {
                passes.push((place, values));
            }
            pass_of.push(known);
        }
        let mut out: Vec<Residuals> = vec![Vec::new(); points.len()];
        for number in 0..self.drive.stretches.len() {
            let windows: Vec<(usize, &Window)> =
                self.drive.windows.iter().enumerate().filter(|(_, w)| w.stretch == number).collect();
            if windows.is_empty() {
                continue;
            }
            let stretch = &self.drive.stretches[number];
            let plan = Plan::new(stretch, &windows, self.roll.description().step_s);
            let batch = self.batch(stretch, number, &windows, &plan, points, &passes, kicks);
            let outputs = self.roll.rollout(&batch)?;
            for ((residuals, &pass), point) in out.iter_mut().zip(&pass_of).zip(points) {
                let predicted = self.predicted(&windows, &plan, &outputs, pass, point);
                residuals
                    .extend(self.measured(&windows).zip(predicted).map(|((m, sigma), y)| (m - y) / sigma));
            }
        }
        Ok(out)
    }

    /// How many residuals each window has.
    #[must_use]
    pub fn window_len(&self, w: &Window) -> usize {
        w.len * self.drive.channels.len()
    }

    /// Whether the simulator itself sees the same at two points.
    fn drives_alike(&self, a: &Point, b: &Point) -> bool {
        let (x, y) = (self.around(&a.values), self.around(&b.values));
        x.command == y.command && x.v_x_scale == y.v_x_scale && a.starts == b.starts
    }

    fn around(&self, values: &[f64]) -> Around {
        let mut around = Around::default();
        for (candidate, value) in self.candidates.iter().zip(values) {
            if let Kind::Wrapped(effect) = candidate.kind {
                around.set(effect, *value);
            }
        }
        around
    }

    /// The simulator's own parameters at some values of the candidates.
    fn own(&self, values: &[f64]) -> Vec<f64> {
        let mut out = self.roll.description().values();
        for (candidate, &value) in self.candidates.iter().zip(values) {
            if let Kind::Own(place) = candidate.kind {
                out[place] = if candidate.integer { value.round() } else { value };
            }
        }
        out
    }

    #[allow(clippy::too_many_arguments, reason = "the parts of one message")]
    fn batch(
        &self,
        stretch: &Stretch,
        number: usize,
        windows: &[(usize, &Window)],
        plan: &Plan,
        points: &[Point],
        passes: &[(usize, Vec<f64>)],
        kicks: &[Kicks],
    ) -> Batch {
        let description = self.roll.description();
        let (step_s, steps) = (description.step_s, plan.steps);
        let arounds: Vec<Around> = points.iter().map(|p| self.around(&p.values)).collect();
        let grid = |values: &[f64]| plan.at_steps(values, steps);
        let (v_x, a_x) = (grid(&stretch.v_x_mps), grid(&stretch.a_x_mps2));
        // Commands are the same wherever the effects on them are.
        let shared = arounds.iter().all(|a| a.command == arounds[0].command);
        let commands: Vec<Array2<f64>> = arounds[..if shared { 1 } else { arounds.len() }]
            .iter()
            .map(|a| self.inputs(stretch, a, step_s, steps, &v_x, &a_x))
            .collect();
        let row_of = |b: usize| if shared { 0 } else { passes[b].0 };
        let rows = if shared { 1 } else { passes.len() };
        let commands = Array3::from_shape_fn((rows, steps, description.inputs.len()), |(b, k, u)| {
            commands[row_of(b)][[k, u]]
        });
        let states: Vec<Vec<f64>> = description
            .states
            .iter()
            .map(|&s| self.measured_state(stretch, s).map_or_else(|| vec![0.0; steps + 1], |v| grid(&v)))
            .collect();
        // The angle that a simulator is placed at is the one that its rates lead on from.
        let angles: Vec<Vec<f64>> = arounds
            .iter()
            .map(|a| {
                let start_s = stretch.segment.start_time_s;
                self.drive.commands.steering(&a.command, self.takes_rate(), start_s, step_s, steps + 1)
            })
            .collect();
        let motions = Array3::from_shape_fn((passes.len(), plan.places.len(), states.len()), |(b, j, s)| {
            let (step, window) = plan.places[j];
            let point = &points[passes[b].0];
            let free = self.free.iter().position(|(_, place, _)| *place == s);
            match (window, free) {
                (Some(w), Some(f)) => point.starts[windows[w].0][f],
                _ if description.states[s] == Channel::SteeringRad => angles[passes[b].0][step],
                _ => states[s][step] * self.true_speed(description.states[s], &arounds[passes[b].0]),
            }
        });
        let imposed = self.imposed.then(|| {
            let same = arounds.iter().all(|a| a.v_x_scale == arounds[0].v_x_scale);
            let rows = if same { 1 } else { passes.len() };
            Array2::from_shape_fn((rows, steps + 1), |(b, k)| {
                v_x[k] * self.true_speed(Channel::VXMps, &arounds[passes[b].0])
            })
        });
        let kicks = (!kicks.is_empty()).then(|| {
            // Rates at samples become changes a step.
            let by_state: Vec<Vec<Vec<f64>>> = kicks
                .iter()
                .map(|k| {
                    (0..states.len())
                        .map(|s| grid(&k[number].iter().map(|row| row[s]).collect::<Vec<_>>()))
                        .collect()
                })
                .collect();
            Array3::from_shape_fn((passes.len(), steps, states.len()), |(b, k, s)| {
                by_state[passes[b].0][s][k] * step_s
            })
        });
        Batch {
            parameters: Array2::from_shape_fn((passes.len(), description.parameters.len()), |(b, p)| {
                passes[b].1[p]
            }),
            commands,
            place_steps: plan.places.iter().map(|(step, _)| *step as i64).collect(),
            motions,
            v_x_mps: imposed,
            kicks,
            output_steps: Array1::from_iter(plan.outputs.iter().map(|&k| k as i64)),
        }
    }

    /// Whether the simulator takes the rate of a measured angle.
    fn takes_rate(&self) -> bool {
        self.roll.description().inputs.iter().any(|i| i.kind == InputKind::SteeringRate)
    }

    fn true_speed(&self, state: Channel, around: &Around) -> f64 {
        if state == Channel::VXMps { (1.0 + around.v_x_scale).recip() } else { 1.0 }
    }

    /// The simulator's inputs (steps x inputs).
    fn inputs(
        &self,
        stretch: &Stretch,
        around: &Around,
        step_s: f64,
        steps: usize,
        v_x: &[f64],
        a_x: &[f64],
    ) -> Array2<f64> {
        let (commands, start_s) = (&self.drive.commands, stretch.segment.start_time_s);
        // One step more: a rate needs the angle after it, too.
        let angle = commands.steering(&around.command, self.takes_rate(), start_s, step_s, steps + 1);
        let acceleration = if commands.carries(|c| c.acceleration_mps2) {
            commands.held(|c| c.acceleration_mps2, start_s, step_s, steps)
        } else {
            a_x[..steps].to_vec()
        };
        let speed = if commands.carries(|c| c.speed_mps) {
            commands.held(|c| c.speed_mps, start_s, step_s, steps)
        } else {
            v_x[..steps].to_vec()
        };
        let pedal = self.file.pedal_per_mps2.unwrap_or(1.0);
        let inputs = &self.roll.description().inputs;
        Array2::from_shape_fn((steps, inputs.len()), |(k, u)| match inputs[u].kind {
            InputKind::SteeringAngle => angle[k],
            InputKind::SteeringRate => (angle[k + 1] - angle[k]) / step_s,
            InputKind::Speed => speed[k],
            InputKind::Acceleration => acceleration[k],
            InputKind::Pedal => pedal * acceleration[k],
        })
    }

    /// What one pass predicts of the recorded channels.
    fn predicted(
        &self,
        windows: &[(usize, &Window)],
        plan: &Plan,
        outputs: &Array3<f64>,
        b: usize,
        point: &Point,
    ) -> Vec<f64> {
        let description = self.roll.description();
        let around = self.around(&point.values);
        let place = |c: Channel| description.output(c);
        let mut out = Vec::with_capacity(windows.iter().map(|(_, w)| self.window_len(w)).sum());
        for (number, (_, window)) in windows.iter().enumerate() {
            let series = |c: usize| plan.window(outputs, b, c, number, window.len);
            let yaw_rate = place(Channel::YawRateRadps).map(series).unwrap_or_default();
            let channels: Vec<Vec<f64>> = self
                .drive
                .channels
                .iter()
                .map(|(channel, _)| {
                    let mut y = place(*channel).map_or_else(|| vec![0.0; window.len], series);
                    match channel {
                        Channel::VYMps => {
                            let ahead_m = self.file.reference.v_y_ahead_m + around.v_y_lever_arm_m;
                            y.iter_mut().zip(&yaw_rate).for_each(|(v, r)| *v += ahead_m * r);
                            late(
                                &mut y,
                                around.odometry_delay_s,
                                around.odometry_low_pass_s,
                                self.drive.dt_s,
                            );
                            y.iter_mut().for_each(|v| *v += around.v_y_bias_mps);
                        }
                        Channel::YawRateRadps => y
                            .iter_mut()
                            .for_each(|r| *r = (1.0 + around.gyro_scale) * *r + around.gyro_bias_radps),
                        _ => {}
                    }
                    y
                })
                .collect();
            out.extend((0..window.len).flat_map(|i| channels.iter().map(move |c| c[i])));
        }
        out
    }

    /// The measurements, each with the noise of its channel, in the order of [`Self::predicted`].
    fn measured<'b>(&'b self, windows: &'b [(usize, &'b Window)]) -> impl Iterator<Item = (f64, f64)> + 'b {
        windows.iter().flat_map(move |(_, w)| {
            let s = &self.drive.stretches[w.stretch];
            (w.from..w.from + w.len).flat_map(move |i| {
                self.drive
                    .channels
                    .iter()
                    .map(move |(c, sigma)| (s.channel(*c).map_or(f64::NAN, |v| v[i]), *sigma))
            })
        })
    }
}
