//! The inertial unit is not level.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::common::ACCELEROMETER;
use super::{Effect, EffectId, EffectSpec, both_sides, spec};
use crate::site::Site;
use crate::terms::Outputs;

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
            &[Site::Imu],
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

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, outputs};
    use super::*;

    #[test]
    fn gravity_shows_in_it() {
        assert_absent_at_null::<ImuTilt>();
        let (before, mut after) = (outputs(), outputs());
        ImuTilt::sense(&[0.02], &mut after);
        for (after, before) in after.a_y_mps2.iter().zip(&before.a_y_mps2) {
            let tilted = before * 0.02_f64.cos() + GRAVITY_MPS2 * 0.02_f64.sin();
            approx::assert_relative_eq!(*after, tilted, epsilon = 1e-12);
        }
    }
}
