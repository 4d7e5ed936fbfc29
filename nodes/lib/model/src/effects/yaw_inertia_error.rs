//! Another yaw inertia than the file states.

use gripsight_vehicle::Real;

use super::common::ratio;
use super::{Effect, EffectSpec, Figure, OutsideTerm, spec};
use crate::site::Site;
use crate::terms::Car;

/// Another yaw inertia than the file states.
#[derive(Debug)]
pub(super) struct YawInertiaError;

impl Effect for YawInertiaError {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::YawInertia),
        figure: Some(Figure {
            name: "yaw_inertia_kgm2",
            stated: |car| Some(car.yaw_inertia_kgm2),
            value: |car, ratio| car.yaw_inertia_kgm2 * ratio,
        }),
        // It is seldom measured: a tenth.
        usual: Some(|_, size| 0.67 * size),
        spread: 0.22,
        ..spec(
            "yaw_inertia_error",
            "I_z *= ratio",
            "yaw inertia is seldom measured",
            "steering above 1 Hz",
            &[Site::LoadsAndBody],
            &[ratio(0.15)],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.yaw_inertia_kgm2 *= p[0];
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car};
    use super::*;

    #[test]
    fn the_yaw_inertia_is_another() {
        assert_absent_at_null::<YawInertiaError>();
        let mut slower = car();
        YawInertiaError::car(&[1.25], &mut slower);
        assert_eq!(slower.yaw_inertia_kgm2, 1.25 * car().yaw_inertia_kgm2);
    }
}
