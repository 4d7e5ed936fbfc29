//! The lateral velocity is taken at another point than the centre of gravity.

use gripsight_vehicle::Real;

use super::{Effect, EffectSpec, OutsideTerm, both_sides, spec};
use crate::site::Site;
use crate::terms::Outputs;

/// The lateral velocity is taken at another point than the centre of gravity.
#[derive(Debug)]
pub(super) struct VyLeverArm;

impl Effect for VyLeverArm {
    const SPEC: EffectSpec = EffectSpec {
        spread: 0.01,
        outside: Some(OutsideTerm::VYLeverArm),
        ..spec(
            "v_y_lever_arm",
            "v_ym = v_y + x r",
            "velocity of a point of a rigid body; x ahead of the centre of gravity",
            "cornering over a range of speeds",
            &[Site::Vy],
            &[both_sides("x_m", "m", [0.05, 0.4])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for (v, r) in out.v_y_mps.iter_mut().zip(&out.yaw_rate_radps) {
            *v += p[0] * *r;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, outputs};
    use super::*;

    #[test]
    fn a_point_ahead_moves_with_the_yaw_rate() {
        assert_absent_at_null::<VyLeverArm>();
        let (before, mut after) = (outputs(), outputs());
        VyLeverArm::sense(&[0.3], &mut after);
        for k in 0..before.v_y_mps.len() {
            assert_eq!(after.v_y_mps[k], before.v_y_mps[k] + 0.3 * before.yaw_rate_radps[k]);
        }
        assert_eq!(after.yaw_rate_radps, before.yaw_rate_radps);
    }
}
