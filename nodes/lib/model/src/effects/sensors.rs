//! Effects between the car's motion and the recorded signals.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::{Effect, EffectId, EffectSpec, Need, both_sides, positive, spec};
use crate::terms::{Car, Lag, Outputs, delayed};

const ACCELEROMETER: &[Need] = &[Need::Accelerometer];

/// The yaw rate is reported too large.
#[derive(Debug)]
pub(super) struct GyroScale;

impl Effect for GyroScale {
    const SPEC: EffectSpec = spec(
        "gyro_scale",
        "r_m = (1 + s) r",
        "scale error of the gyroscope",
        "any drive",
        &[both_sides("scale", "1", [0.03, 0.03])],
    );

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for r in &mut out.yaw_rate_radps {
            *r *= p[0] + 1.0;
        }
    }
}

/// The yaw rate is reported with an offset.
#[derive(Debug)]
pub(super) struct GyroBias;

impl Effect for GyroBias {
    const SPEC: EffectSpec = spec(
        "gyro_bias",
        "r_m = r + b",
        "bias of the gyroscope",
        "straights",
        &[both_sides("bias_radps", "rad/s", [0.02, 0.005])],
    );

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for r in &mut out.yaw_rate_radps {
            *r += p[0];
        }
    }
}

/// The lateral velocity is taken at another point than the centre of gravity.
#[derive(Debug)]
pub(super) struct VyLeverArm;

impl Effect for VyLeverArm {
    const SPEC: EffectSpec = spec(
        "v_y_lever_arm",
        "v_ym = v_y + x r",
        "velocity of a point of a rigid body; x ahead of the centre of gravity",
        "cornering over a range of speeds",
        &[both_sides("x_m", "m", [0.05, 0.4])],
    );

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for (v, r) in out.v_y_mps.iter_mut().zip(&out.yaw_rate_radps) {
            *v += p[0] * *r;
        }
    }
}

/// The lateral velocity is reported with an offset.
#[derive(Debug)]
pub(super) struct VyBias;

impl Effect for VyBias {
    const SPEC: EffectSpec = spec(
        "v_y_bias",
        "v_ym = v_y + b",
        "a sensor that is not mounted straight, an estimator's bias",
        "straights",
        &[both_sides("bias_mps", "m/s", [0.06, 0.1])],
    );

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for v in &mut out.v_y_mps {
            *v += p[0];
        }
    }
}

/// The lateral velocity is reported late.
#[derive(Debug)]
pub(super) struct OdometryDelay;

impl Effect for OdometryDelay {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::OdometryLowPass],
        starts: &[0.5],
        ..spec(
            "odometry_delay",
            "v_ym(t) = v_y(t - T)",
            "time in the estimator",
            "transients",
            &[positive("delay_s", "s", [0.05, 0.05])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        out.v_y_mps = delayed(&out.v_y_mps, p[0], out.dt_s);
    }
}

/// The lateral velocity is reported behind a filter.
#[derive(Debug)]
pub(super) struct OdometryLowPass;

impl Effect for OdometryLowPass {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::OdometryDelay],
        starts: &[0.5],
        ..spec(
            "odometry_low_pass",
            "tau v_ym' + v_ym = v_y",
            "a filter in the estimator",
            "transients",
            &[positive("tau_s", "s", [0.06, 0.06])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        let [first, second, ..] = out.v_y_mps[..] else { return };
        // Before the window the input is taken as a ramp that goes on.
        let slope = (second - first) / out.dt_s;
        let lag = Lag::new(out.dt_s, p[0]);
        let (mut before, mut y) = (first, first - slope * p[0]);
        for v in out.v_y_mps.iter_mut().skip(1) {
            y = lag.step(y, before, *v);
            before = *v;
            *v = y;
        }
        out.v_y_mps[0] = first - slope * p[0];
    }
}

/// The forward speed is reported too large.
#[derive(Debug)]
pub(super) struct VxScale;

impl Effect for VxScale {
    const SPEC: EffectSpec = spec(
        "v_x_scale",
        "v_xm = (1 + s) v_x",
        "rolling radius, scale of the odometry",
        "any drive, with an accelerometer or a range of speeds",
        &[both_sides("scale", "1", [0.025, 0.025])],
    );

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.speed_factor *= (p[0] + 1.0).recip();
    }

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for v in &mut out.v_x_mps {
            *v *= p[0] + 1.0;
        }
    }
}

/// The inertial unit is not at the centre of gravity.
#[derive(Debug)]
pub(super) struct ImuLeverArm;

impl Effect for ImuLeverArm {
    const SPEC: EffectSpec = EffectSpec {
        needs: ACCELEROMETER,
        ..spec(
            "imu_lever_arm",
            "a_ym = a_y + x r' - y r^2, a_xm = a_x - y r' - x r^2",
            "acceleration of a point of a rigid body",
            "transients",
            &[both_sides("x_m", "m", [0.05, 0.25]), both_sides("y_m", "m", [0.05, 0.25])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for k in 0..out.a_y_mps2.len() {
            let (r, acceleration) = (out.yaw_rate_radps[k], out.yaw_acceleration_radps2[k]);
            out.a_y_mps2[k] += p[0] * acceleration - p[1] * r * r;
            out.a_x_mps2[k] -= p[1] * acceleration + p[0] * r * r;
        }
    }
}

/// The inertial unit is not level.
#[derive(Debug)]
pub(super) struct ImuTilt;

impl Effect for ImuTilt {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::RoadBank],
        needs: ACCELEROMETER,
        ..spec(
            "imu_tilt",
            "a_ym = a_y cos(roll) + g sin(roll)",
            "a sensor that is not mounted level",
            "any drive",
            &[both_sides("roll_rad", "rad", [0.02, 0.02])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        let (sin, cos) = p[0].sin_cos();
        for a in &mut out.a_y_mps2 {
            *a = *a * cos + sin * GRAVITY_MPS2;
        }
    }
}
