//! The lateral velocity is reported with an offset.

use gripsight_vehicle::Real;

use super::{Effect, EffectSpec, OutsideTerm, both_sides, spec};
use crate::site::Site;
use crate::terms::Outputs;

/// The lateral velocity is reported with an offset.
#[derive(Debug)]
pub(super) struct VyBias;

impl Effect for VyBias {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::VYBias),
        ..spec(
            "v_y_bias",
            "v_ym = v_y + b",
            "a sensor that is not mounted straight, an estimator's bias",
            "straights",
            &[Site::Vy],
            &[both_sides("bias_mps", "m/s", [0.06, 0.1])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for v in &mut out.v_y_mps {
            *v += p[0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, outputs};
    use super::*;

    #[test]
    fn it_is_off_by_the_same_throughout() {
        assert_absent_at_null::<VyBias>();
        let (before, mut after) = (outputs(), outputs());
        VyBias::sense(&[0.05], &mut after);
        assert!(after.v_y_mps.iter().zip(&before.v_y_mps).all(|(after, before)| *after == before + 0.05));
    }
}
