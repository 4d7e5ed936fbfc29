//! What an effect leaves in one-step residuals of (dv_y/dt, dr/dt), to first order.

use gripsight_signals::Segment;
use gripsight_vehicle::{GRAVITY_MPS2, Input, PacejkaParameters, SingleTrack, State, VehicleParameters};

/// Effects with a signature, by canonical name.
pub(super) const NAMES: [&str; 21] = [
    "steering_delay",
    "steering_gain",
    "steering_offset",
    "steering_backlash",
    "gyro_scale",
    "gyro_bias",
    "v_y_bias",
    "v_y_lever_arm",
    "odometry_delay",
    "v_x_scale",
    "tire_relaxation",
    "lateral_load_transfer",
    "longitudinal_load_transfer",
    "combined_slip",
    "grip_scale",
    "tire_wear",
    "aero_downforce",
    "mass_error",
    "yaw_inertia_error",
    "compliance_steer",
    "differential_yaw_moment",
];

/// A sample: rates measured and predicted, derivatives of the prediction, forces.
struct Point {
    time_s: f64,
    v_x_mps: f64,
    yaw_rate_radps: f64,
    steering_rad: f64,
    steering_rate_radps: f64,
    acceleration_mps2: f64,
    measured: [f64; 2],
    predicted: [f64; 2],
    by_v_y: [f64; 2],
    by_yaw_rate: [f64; 2],
    by_steering: [f64; 2],
    by_v_x: [f64; 2],
    /// F_y/F_z of the axles.
    utilization: [f64; 2],
    /// Rates that one newton per newton of load on each axle makes.
    front: [f64; 2],
    rear: [f64; 2],
}

/// A stretch of samples without gaps.
pub(super) struct Stretch {
    points: Vec<Point>,
    dt_s: f64,
    wheelbase_m: f64,
}

/// Step of the finite differences.
const STEP: f64 = 1e-5;

impl Stretch {
    pub(super) fn new(segment: &Segment, vehicle: &VehicleParameters, tires: &PacejkaParameters) -> Self {
        let car = SingleTrack::new(vehicle, tires);
        let central = |series: &[f64], k: usize| (series[k + 1] - series[k - 1]) / (2.0 * segment.dt_s);
        let loads = [vehicle.static_load_front_n(), vehicle.static_load_rear_n()];
        let arms = [vehicle.l_f_m, -vehicle.l_r_m];
        let [front, rear] =
            [0, 1].map(|i| [loads[i] / vehicle.mass_kg, loads[i] * arms[i] / vehicle.yaw_inertia_kgm2]);
        let point = |k: usize| {
            let rates = |v_y: f64, rate: f64, steering: f64, v_x: f64| {
                let state = State {
                    v_y_mps: segment.v_y_mps[k] + v_y,
                    yaw_rate_radps: segment.yaw_rate_radps[k] + rate,
                };
                let input = Input {
                    v_x_mps: segment.v_x_mps[k] + v_x,
                    steering_rad: segment.steering_rad[k] + steering,
                };
                let d = car.derivative(&state, &input);
                let (f, r) = car.lateral_forces_n(&state, &input);
                ([d.v_y_mps, d.yaw_rate_radps], [f / loads[0], r / loads[1]])
            };
            let (predicted, utilization) = rates(0.0, 0.0, 0.0, 0.0);
            let by = |moved: ([f64; 2], [f64; 2])| [0, 1].map(|c| (moved.0[c] - predicted[c]) / STEP);
            Point {
                time_s: segment.time_s(k),
                v_x_mps: segment.v_x_mps[k],
                yaw_rate_radps: segment.yaw_rate_radps[k],
                steering_rad: segment.steering_rad[k],
                steering_rate_radps: central(&segment.steering_rad, k),
                acceleration_mps2: segment.command_acceleration_mps2.get(k).copied().unwrap_or(0.0),
                measured: [central(&segment.v_y_mps, k), central(&segment.yaw_rate_radps, k)],
                by_v_y: by(rates(STEP, 0.0, 0.0, 0.0)),
                by_yaw_rate: by(rates(0.0, STEP, 0.0, 0.0)),
                by_steering: by(rates(0.0, 0.0, STEP, 0.0)),
                by_v_x: by(rates(0.0, 0.0, 0.0, STEP)),
                predicted,
                utilization,
                front,
                rear,
            }
        };
        let points = (1..segment.len().saturating_sub(1)).map(point).collect();
        Self { points, dt_s: segment.dt_s, wheelbase_m: vehicle.l_f_m + vehicle.l_r_m }
    }

    pub(super) fn residuals(&self) -> impl Iterator<Item = [f64; 2]> {
        self.points.iter().map(|p| [0, 1].map(|c| p.measured[c] - p.predicted[c]))
    }

    /// The signature of `NAMES[name]`, sample by sample.
    pub(super) fn signature(&self, name: usize) -> impl Iterator<Item = [f64; 2]> {
        (0..self.points.len()).map(move |k| self.at(NAMES[name], k))
    }

    fn at(&self, name: &str, k: usize) -> [f64; 2] {
        let p = &self.points[k];
        let times = |v: [f64; 2], factor: f64| v.map(|x| x * factor);
        let axles = |f: f64, r: f64| [0, 1].map(|c| p.front[c] * f + p.rear[c] * r);
        let plus = |a: [f64; 2], b: [f64; 2]| [a[0] + b[0], a[1] + b[1]];
        let [front, rear] = p.utilization;
        let a_y = p.v_x_mps * p.yaw_rate_radps / GRAVITY_MPS2;
        let a_x = p.acceleration_mps2 / GRAVITY_MPS2;
        match name {
            "steering_delay" => times(p.by_steering, -p.steering_rate_radps),
            "steering_gain" => times(p.by_steering, p.steering_rad),
            "steering_offset" => p.by_steering,
            "steering_backlash" => times(p.by_steering, -p.steering_rate_radps.signum()),
            "gyro_scale" => plus([0.0, p.predicted[1]], times(p.by_yaw_rate, -p.yaw_rate_radps)),
            "gyro_bias" => times(p.by_yaw_rate, -1.0),
            "v_y_bias" => times(p.by_v_y, -1.0),
            "v_y_lever_arm" => plus([p.measured[1], 0.0], times(p.by_v_y, -p.yaw_rate_radps)),
            "odometry_delay" => times(p.by_v_y, p.measured[0]),
            "v_x_scale" => times(p.by_v_x, -p.v_x_mps),
            "tire_relaxation" => {
                let rate = |axle: usize| self.change(k, |p| p.utilization[axle]) / p.v_x_mps.max(0.1);
                axles(-rate(0), -rate(1))
            }
            "lateral_load_transfer" => axles(-front * a_y * a_y, -rear * a_y * a_y),
            "longitudinal_load_transfer" => axles(-front * a_x, rear * a_x),
            "combined_slip" => axles(-front * a_x * a_x, -rear * a_x * a_x),
            "grip_scale" => axles(front.powi(3), rear.powi(3)),
            "tire_wear" => times(axles(front.powi(3), rear.powi(3)), -p.time_s),
            "aero_downforce" => times(axles(front, rear), p.v_x_mps.powi(2)),
            "mass_error" => [axles(-front, -rear)[0], 0.0],
            "yaw_inertia_error" => [0.0, -p.predicted[1]],
            "compliance_steer" => times(p.by_steering, -front),
            _ => [0.0, -(p.yaw_rate_radps * self.wheelbase_m / p.v_x_mps.max(0.1)).tanh()],
        }
    }

    /// Rate of change at a sample; nought at the ends.
    fn change(&self, k: usize, value: impl Fn(&Point) -> f64) -> f64 {
        match (k.checked_sub(1).and_then(|k| self.points.get(k)), self.points.get(k + 1)) {
            (Some(before), Some(after)) => (value(after) - value(before)) / (2.0 * self.dt_s),
            _ => 0.0,
        }
    }
}
