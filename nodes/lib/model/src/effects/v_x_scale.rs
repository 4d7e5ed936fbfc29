//! The forward speed is reported too large.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, Figure, both_sides, spec};
use crate::site::Site;
use crate::terms::{Car, Outputs};

/// The forward speed is reported too large.
#[derive(Debug)]
pub(super) struct VxScale;

impl Effect for VxScale {
    const SPEC: EffectSpec = EffectSpec {
        // The curvature that the steering asks for is the yaw rate over v_x: forces alone tell the scales apart.
        alike: &[EffectId::GyroScale],
        figure: Some(Figure { name: "v_x_scale", stated: |_| Some(1.0), value: |_, scale| 1.0 + scale }),
        ..spec(
            "v_x_scale",
            "v_xm = (1 + s) v_x",
            "rolling radius, scale of the odometry",
            "any drive, with an accelerometer or a range of speeds",
            &[Site::Vx],
            &[both_sides("scale", "1", [0.025, 0.025])],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.speed_factor *= (p[0] + 1.0).recip();
    }

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        for v in &mut out.v_x_mps {
            *v *= p[0] + 1.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, outputs};
    use super::*;

    #[test]
    fn the_car_is_slower_than_it_says() {
        assert_absent_at_null::<VxScale>();
        let (before, mut after) = (outputs(), outputs());
        VxScale::sense(&[0.25], &mut after);
        assert!(after.v_x_mps.iter().zip(&before.v_x_mps).all(|(after, before)| *after == before * 1.25));
        let mut car = car();
        VxScale::car(&[0.25], &mut car);
        assert_eq!(car.speed_factor, 0.8);
    }
}
