//! The lateral velocity is reported late.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, positive, spec};
use crate::site::Site;
use crate::terms::{Outputs, delayed};

/// The lateral velocity is reported late.
#[derive(Debug)]
pub(super) struct OdometryDelay;

impl Effect for OdometryDelay {
    const SPEC: EffectSpec = EffectSpec {
        // A delay that is not enough, so that a lag is needed beside it, is a filter of higher order.
        goes_by: Some(EffectId::OdometryLowPass),
        alike: &[EffectId::OdometryLowPass],
        starts: &[0.5],
        ..spec(
            "odometry_delay",
            "v_ym(t) = v_y(t - T)",
            "time in the estimator",
            "transients",
            &[Site::Vy],
            &[positive("delay_s", "s", [0.05, 0.05])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        out.v_y_mps = delayed(&out.v_y_mps, p[0], out.dt_s);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{DT_S, assert_absent_at_null, outputs};
    use super::*;

    #[test]
    fn only_the_lateral_velocity_is_late() {
        assert_absent_at_null::<OdometryDelay>();
        let (before, mut after) = (outputs(), outputs());
        OdometryDelay::sense(&[2.0 * DT_S], &mut after);
        for (late, before) in after.v_y_mps[2..].iter().zip(&before.v_y_mps) {
            approx::assert_relative_eq!(late, before, epsilon = 1e-9);
        }
        assert_eq!(after.yaw_rate_radps, before.yaw_rate_radps);
    }
}
