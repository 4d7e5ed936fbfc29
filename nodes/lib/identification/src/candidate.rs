//! What travels between the identifier and the residual learner: a parameter set to learn against, and its key.

use std::fmt;

use gripsight_signals::StateSequence;
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};
use serde::{Deserialize, Serialize};

use crate::{Config, Nuisance, Status, ValidWithin};

/// An estimate with its 90 % interval; ends that are not known are NaN (null in JSON).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// Best estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Estimate {
    /// Half-width of a 90 % interval in standard errors.
    pub const Z90: f64 = 1.644_853_6;

    /// From a standard error; without one the ends are NaN.
    #[must_use]
    pub fn from_error(value: f64, standard_error: Option<f64>) -> Self {
        let half = standard_error.map_or(f64::NAN, |s| Self::Z90 * s);
        Self { value, low: value - half, high: value + half }
    }
}

/// Two ends of what was visited.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Range {
    /// Smallest value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
}

impl Range {
    /// The range of some values; NaN ends where there are none.
    #[must_use]
    pub fn of(values: impl Iterator<Item = f64>) -> Self {
        values.fold(Self { low: f64::NAN, high: f64::NAN }, |r, v| Self {
            low: r.low.min(v),
            high: r.high.max(v),
        })
    }

    /// Whether a value lies inside.
    #[must_use]
    pub fn contains(&self, value: f64) -> bool {
        (self.low..=self.high).contains(&value)
    }
}

/// One value for each axle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct PerAxle<T> {
    /// Front axle.
    pub front: T,
    /// Rear axle.
    pub rear: T,
}

impl<T> PerAxle<T> {
    /// The same thing done to both.
    pub fn map<U>(self, mut f: impl FnMut(T) -> U) -> PerAxle<U> {
        PerAxle { front: f(self.front), rear: f(self.rear) }
    }
}

/// What is taken out of the signals before tires are fitted.
///
/// ```text
/// wheel angle(t) = offset + gain * recorded(t - delay)
/// v_y measured   = v_y + lever_arm * w + bias,     yaw rate measured = w + bias
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SignalCorrections {
    /// The wheels follow the recorded steering by this much: transport, the servo's lag and half a command's hold together, which one recorded
    /// steering cannot tell apart.
    pub steering_delay_s: f64,
    /// Wheel angle over recorded steering.
    pub steering_gain: f64,
    /// Wheel angle at recorded steering 0, left positive.
    pub steering_offset_rad: f64,
    /// Point where v_y is measured, ahead of the centre of gravity positive.
    pub v_y_lever_arm_m: f64,
    /// Added to v_y by the sensor, left positive.
    pub v_y_bias_mps: f64,
    /// Added to the yaw rate by the sensor, left turn positive.
    pub yaw_rate_bias_radps: f64,
}

impl SignalCorrections {
    /// The signals as recorded.
    pub const NONE: Self = Self {
        steering_delay_s: 0.0,
        steering_gain: 1.0,
        steering_offset_rad: 0.0,
        v_y_lever_arm_m: 0.0,
        v_y_bias_mps: 0.0,
        yaw_rate_bias_radps: 0.0,
    };

    /// In the order of the fields.
    #[must_use]
    pub fn to_array(&self) -> [f64; 6] {
        [
            self.steering_delay_s,
            self.steering_gain,
            self.steering_offset_rad,
            self.v_y_lever_arm_m,
            self.v_y_bias_mps,
            self.yaw_rate_bias_radps,
        ]
    }

    /// The inverse of [`Self::to_array`].
    #[must_use]
    pub fn from_array(v: [f64; 6]) -> Self {
        Self {
            steering_delay_s: v[0],
            steering_gain: v[1],
            steering_offset_rad: v[2],
            v_y_lever_arm_m: v[3],
            v_y_bias_mps: v[4],
            yaw_rate_bias_radps: v[5],
        }
    }
}

/// What ties the steps of one run together, on topics and offline.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RunKey {
    /// Names one run; unique per start of its sender. No result depends on it.
    pub run_id: String,
    /// The sequence that the run is about.
    pub sequence_id: u64,
    /// Turn of the outer loop, 0 at the start.
    pub iteration: u32,
    /// The car's parameters, see [`vehicle_hash`].
    pub vehicle_hash: String,
    /// Seed of everything random in the run.
    pub seed: u64,
}

impl RunKey {
    /// The key of a run as it begins.
    #[must_use]
    pub fn first(sequence: &StateSequence, vehicle: &VehicleParameters, config: &Config) -> Self {
        Self {
            run_id: config.run_id.clone(),
            sequence_id: sequence.sequence_id,
            iteration: 0,
            vehicle_hash: vehicle_hash(vehicle),
            seed: config.seed,
        }
    }
}

impl fmt::Display for RunKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { run_id, sequence_id, iteration, vehicle_hash, seed } = self;
        write!(
            f,
            "run {run_id}, sequence {sequence_id}, iteration {iteration}, vehicle {vehicle_hash}, seed {seed}"
        )
    }
}

/// The car's parameters as a key: results are not used with another car.
#[must_use]
pub fn vehicle_hash(vehicle: &VehicleParameters) -> String {
    format!("{:016x}", vehicle.hash())
}

/// A parameter set that asks for a residual model: all that training needs beside the sequence and the car.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// Which run and iteration.
    pub key: RunKey,
    /// The tires that the residual is taken against.
    pub phi_p: PacejkaParameters,
    /// What is taken out of the signals first.
    pub corrections: SignalCorrections,
    /// Mean forward speed while moving.
    pub mean_speed_mps: f64,
}

/// Friction as known beforehand, from the camera or from a person.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FrictionPrior {
    /// Expected peak friction.
    pub mu: f64,
    /// Its standard deviation.
    pub sigma: f64,
}

/// A set that was accepted: where a later run starts, what it has to beat, and what a [`Monitor`](crate::Monitor) watches.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AcceptedSet {
    /// The car that it belongs to.
    pub vehicle_hash: String,
    /// The sequence that it came from.
    pub sequence_id: u64,
    /// The tires found.
    pub phi_p: PacejkaParameters,
    /// The tires handed on: no more force than was shown.
    pub promised: PacejkaParameters,
    /// What they may be used for.
    pub status: Status,
    /// Slips and forces up to which they are valid.
    pub valid_within: ValidWithin,
    /// The signals' corrections that go with the tires found.
    pub corrections: SignalCorrections,
    /// The tires of the fit itself, which a [`Monitor`](crate::Monitor) watches.
    pub fitted: PacejkaParameters,
    /// What the fit allowed for beside these.
    pub nuisance: Nuisance,
    /// Root mean square error of held-out rollouts: v_y in m/s, yaw rate in rad/s.
    pub rollout_rmse: [f64; 2],
    /// Whether the peak was reached.
    pub peak_reached: PerAxle<bool>,
}
