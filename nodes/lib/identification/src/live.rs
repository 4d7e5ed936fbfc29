//! The residual while driving: every sample against what the model said of it one of its time steps before, by the streaming recurrence.

use std::collections::VecDeque;

use gripsight_s4::{ResidualNetwork, StreamState};
use gripsight_signals::TelemetrySample;
use gripsight_vehicle::{Input, SingleTrack, State, VehicleParameters};

use crate::data::SLOW_MPS;
use crate::rollout::substep_s;
use crate::{IdentificationError, PerAxle, ResidualModel, SignalCorrections};

/// A sample is a time step of the model after another when their distance is off by less than this share of it.
const STEP_TOLERANCE: f64 = 0.25;
/// Steering is remembered for this much longer than its delay.
const STEERING_SPARE_S: f64 = 0.1;

/// What one sample leaves over.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LiveSample {
    /// Stamp of the sample predicted.
    pub stamp_ns: i64,
    /// Time from the sample that the prediction starts from.
    pub dt_s: f64,
    /// Measured less single-track model: v_y in m/s, yaw rate in rad/s.
    pub nominal: [f64; 2],
    /// Measured less corrected model, in the same units.
    pub corrected: [f64; 2],
    /// Slip angles of the sample predicted, rad.
    pub slip_rad: PerAxle<f64>,
    /// Whether one of them lies outside those trained on.
    pub extrapolated: bool,
}

/// Follows telemetry with a residual model.
///
/// The network runs on the time step that it was trained for. Where telemetry is n times as fast, n recurrences take turns, so that every sample
/// is predicted. A sample without another one a time step before it is not, and its recurrence begins at rest.
#[derive(Debug, Clone)]
pub struct LiveResidual {
    model: ResidualModel,
    network: Option<ResidualNetwork>,
    car: SingleTrack,
    stiffness: f64,
    corrected: Corrected,
    /// The samples of the last time step, oldest first.
    recent: VecDeque<Passed>,
    /// The last sample was predicted from one: the next is from the one after that.
    follows: bool,
}

/// A sample that later ones are predicted from.
#[derive(Debug, Clone)]
struct Passed {
    stamp_ns: i64,
    state: State,
    input: Input,
    /// The network after this sample, and what it said of the next time step.
    memory: Option<StreamState>,
    residual: [f64; 2],
}

impl LiveResidual {
    /// `corrections`: those of the candidate that the model answers.
    ///
    /// # Errors
    /// [`IdentificationError::Network`] for weights that do not fit.
    pub fn new(
        vehicle: &VehicleParameters,
        model: ResidualModel,
        corrections: SignalCorrections,
    ) -> Result<Self, IdentificationError> {
        let phi = &model.phi_p;
        Ok(Self {
            network: model.network()?,
            car: SingleTrack::new(vehicle, phi),
            stiffness: phi.front.normalized_stiffness().max(phi.rear.normalized_stiffness()),
            corrected: Corrected::new(corrections),
            recent: VecDeque::new(),
            follows: false,
            model,
        })
    }

    /// The model in use.
    #[must_use]
    pub fn model(&self) -> &ResidualModel {
        &self.model
    }

    /// Forgets every sample: after a jump of the clock.
    pub fn reset(&mut self) {
        self.corrected.clear();
        self.recent.clear();
        self.follows = false;
    }

    /// Takes the next sample, in the order of stamps; `None` where nothing predicts it. Allocates only where a recurrence begins.
    ///
    /// # Errors
    /// [`IdentificationError::Network`] where the network overflows: every sample is forgotten then.
    pub fn push(&mut self, sample: &TelemetrySample) -> Result<Option<LiveSample>, IdentificationError> {
        let stamp_ns = sample.odometry.stamp_ns;
        let (state, input) = self.corrected.push(sample);
        if input.v_x_mps < SLOW_MPS {
            self.recent.clear();
            return Ok(None);
        }
        let origin = self.origin(stamp_ns);
        self.follows = origin.is_some();
        let (live, memory) = match origin {
            Some((dt_s, origin)) => {
                let live = self.compare(stamp_ns, &state, &input, dt_s, &origin);
                (Some(live), origin.memory)
            }
            None => (None, self.network.as_ref().map(ResidualNetwork::stream_state)),
        };
        let mut passed = Passed { stamp_ns, state, input, memory, residual: [0.0; 2] };
        if let (Some(network), Some(memory)) = (&self.network, &mut passed.memory) {
            let seen = [input.v_x_mps, state.v_y_mps, state.yaw_rate_radps, input.steering_rad];
            if let Err(error) = network.step(memory, &seen, &mut passed.residual) {
                self.reset();
                return Err(error.into());
            }
        }
        self.recent.push_back(passed);
        Ok(live)
    }

    /// The sample one time step before `stamp_ns`, and how long before; older ones are forgotten.
    fn origin(&mut self, stamp_ns: i64) -> Option<(f64, Passed)> {
        let dt_s = self.model.dt_s;
        while let Some(oldest) = self.recent.front() {
            let before_s = (stamp_ns - oldest.stamp_ns) as f64 * 1e-9;
            // The first is the one that comes nearest, so that stamps which jitter later stay within the tolerance.
            let spacing_s =
                self.recent.get(1).map_or(before_s, |o| (o.stamp_ns - oldest.stamp_ns) as f64 * 1e-9);
            let nearest_s = if self.follows { 0.0 } else { dt_s - 0.5 * spacing_s };
            if before_s < nearest_s.max((1.0 - STEP_TOLERANCE) * dt_s) {
                return None;
            }
            let passed = self.recent.pop_front()?;
            if before_s < (1.0 + STEP_TOLERANCE) * dt_s {
                return Some((before_s, passed));
            }
        }
        None
    }

    fn compare(&self, stamp_ns: i64, state: &State, input: &Input, dt_s: f64, origin: &Passed) -> LiveSample {
        let step_s = substep_s(self.stiffness, origin.input.v_x_mps);
        let predicted = self.car.step(origin.state, &origin.input, input, dt_s, step_s);
        let nominal = [state.v_y_mps - predicted.v_y_mps, state.yaw_rate_radps - predicted.yaw_rate_radps];
        let share = dt_s / self.model.dt_s;
        let (front, rear) = self.car.slip_angles_rad(state, input);
        let hull = &self.model.slip_range_rad;
        LiveSample {
            stamp_ns,
            dt_s,
            nominal,
            corrected: [nominal[0] - share * origin.residual[0], nominal[1] - share * origin.residual[1]],
            slip_rad: PerAxle { front, rear },
            extrapolated: !(hull.front.contains(front) && hull.rear.contains(rear)),
        }
    }
}

/// Takes what identification found of the signals out of samples, in the order of their stamps.
#[derive(Debug, Clone)]
pub(crate) struct Corrected {
    corrections: SignalCorrections,
    /// Recorded steering by stamp, oldest first.
    steering: VecDeque<(i64, f64)>,
}

impl Corrected {
    pub(crate) fn new(corrections: SignalCorrections) -> Self {
        Self { corrections, steering: VecDeque::new() }
    }

    /// Forgets every sample.
    pub(crate) fn clear(&mut self) {
        self.steering.clear();
    }

    /// State of the centre of gravity and input, signals corrected.
    pub(crate) fn push(&mut self, sample: &TelemetrySample) -> (State, Input) {
        let (odometry, c) = (&sample.odometry, &self.corrections);
        let yaw_rate_radps = odometry.yaw_rate_radps - c.yaw_rate_bias_radps;
        let state = State {
            v_y_mps: odometry.v_y_mps - c.v_y_lever_arm_m * yaw_rate_radps - c.v_y_bias_mps,
            yaw_rate_radps,
        };
        self.steering.push_back((odometry.stamp_ns, sample.drive.steering_angle_rad));
        let at_ns = odometry.stamp_ns - (c.steering_delay_s * 1e9).round() as i64;
        let keep_ns = at_ns - (STEERING_SPARE_S * 1e9) as i64;
        while self.steering.front().is_some_and(|(stamp_ns, _)| *stamp_ns < keep_ns) {
            self.steering.pop_front();
        }
        let steering_rad = interpolated(&self.steering, at_ns) * c.steering_gain + c.steering_offset_rad;
        (state, Input { v_x_mps: odometry.v_x_mps, steering_rad })
    }
}

/// The value at `at_ns`, held before the first and after the last; 0 where there is none.
fn interpolated(series: &VecDeque<(i64, f64)>, at_ns: i64) -> f64 {
    let after = series.partition_point(|(stamp_ns, _)| *stamp_ns <= at_ns);
    let value = |k: usize| series.get(k).copied();
    match (after.checked_sub(1).and_then(value), value(after)) {
        (Some((t0, a)), Some((t1, b))) => a + (b - a) * (at_ns - t0) as f64 / (t1 - t0) as f64,
        (Some((_, only)), None) | (None, Some((_, only))) => only,
        (None, None) => 0.0,
    }
}
