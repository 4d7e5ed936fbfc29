//! The yaw rate is reported with an offset.

use gripsight_vehicle::Real;

use super::{Effect, EffectSpec, OutsideTerm, both_sides, spec};
use crate::site::Site;
use crate::terms::Outputs;

/// The yaw rate is reported with an offset.
#[derive(Debug)]
pub(super) struct GyroBias;

impl Effect for GyroBias {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::YawRateBias),
        ..spec(
            "gyro_bias",
            "r_m = r + b",
            "bias of the gyroscope",
            "straights",
            &[Site::YawRate],
            &[both_sides("bias_radps", "rad/s", [0.02, 0.005])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for r in &mut out.yaw_rate_radps {
            *r += p[0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, outputs};
    use super::*;

    #[test]
    fn the_yaw_rate_is_off_by_the_same_throughout() {
        assert_absent_at_null::<GyroBias>();
        let (before, mut after) = (outputs(), outputs());
        GyroBias::sense(&[0.01], &mut after);
        let mut both = after.yaw_rate_radps.iter().zip(&before.yaw_rate_radps);
        assert!(both.all(|(after, before)| *after == before + 0.01));
    }
}
