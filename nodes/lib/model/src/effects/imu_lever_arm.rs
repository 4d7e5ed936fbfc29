//! The inertial unit is not at the centre of gravity.

use gripsight_vehicle::Real;

use super::common::ACCELEROMETER;
use super::{Effect, EffectSpec, Unknown, both_sides, spec};
use crate::site::Site;
use crate::terms::Outputs;

/// The inertial unit is not at the centre of gravity.
#[derive(Debug)]
pub(super) struct ImuLeverArm;

impl Effect for ImuLeverArm {
    const SPEC: EffectSpec = EffectSpec {
        // Within a sample nobody knows when command and inertial unit were read.
        unknown: Unknown { share: 0.0, samples: 0.12 },
        needs: ACCELEROMETER,
        spread: 0.04,
        ..spec(
            "imu_lever_arm",
            "a_ym = a_y + x r' - y r^2, a_xm = a_x - y r' - x r^2",
            "acceleration of a point of a rigid body",
            "transients",
            &[Site::Imu],
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

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, outputs};
    use super::*;

    #[test]
    fn a_point_off_the_centre_feels_the_turning() {
        assert_absent_at_null::<ImuLeverArm>();
        let (before, mut after) = (outputs(), outputs());
        ImuLeverArm::sense(&[0.1, 0.02], &mut after);
        for k in 0..before.a_y_mps2.len() {
            let (r, acceleration) = (before.yaw_rate_radps[k], before.yaw_acceleration_radps2[k]);
            let across = before.a_y_mps2[k] + 0.1 * acceleration - 0.02 * r * r;
            let along = before.a_x_mps2[k] - 0.02 * acceleration - 0.1 * r * r;
            approx::assert_relative_eq!(after.a_y_mps2[k], across, epsilon = 1e-12);
            approx::assert_relative_eq!(after.a_x_mps2[k], along, epsilon = 1e-12);
        }
    }
}
