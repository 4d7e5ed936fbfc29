//! The yaw rate is reported too large.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, Figure, both_sides, spec};
use crate::site::Site;
use crate::terms::Outputs;

/// The yaw rate is reported too large.
#[derive(Debug)]
pub(super) struct GyroScale;

impl Effect for GyroScale {
    const SPEC: EffectSpec = EffectSpec {
        // The curvature that the steering asks for is the yaw rate over v_x: forces alone tell the scales apart.
        alike: &[EffectId::VxScale],
        figure: Some(Figure { name: "yaw_rate_scale", stated: |_| Some(1.0), value: |_, scale| 1.0 + scale }),
        ..spec(
            "gyro_scale",
            "r_m = (1 + s) r",
            "scale error of the gyroscope",
            "any drive",
            &[Site::YawRate],
            &[both_sides("scale", "1", [0.03, 0.03])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for r in &mut out.yaw_rate_radps {
            *r *= p[0] + 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, outputs};
    use super::*;

    #[test]
    fn the_yaw_rate_alone_is_larger() {
        assert_absent_at_null::<GyroScale>();
        let (before, mut after) = (outputs(), outputs());
        GyroScale::sense(&[0.25], &mut after);
        let mut both = after.yaw_rate_radps.iter().zip(&before.yaw_rate_radps);
        assert!(both.all(|(after, before)| *after == before * 1.25));
        assert_eq!(after.v_y_mps, before.v_y_mps);
    }
}
