//! Another split of the brake force than the file states.

use gripsight_vehicle::Real;

use super::common::{COMMAND, share, split};
use super::{Effect, EffectSpec, Figure, spec};
use crate::site::Site;
use crate::terms::Car;

/// Another split of the brake force than the file states.
#[derive(Debug)]
pub(super) struct BrakeSplit;

impl Effect for BrakeSplit {
    const SPEC: EffectSpec = EffectSpec {
        needs: COMMAND,
        figure: Some(Figure {
            name: "brake_front_share",
            stated: |car| car.brake_front_share,
            value: |car, more| car.front_brake_share() + more,
        }),
        is_nuisance: true,
        usual: Some(|car, _| split(car.brake_front_share)),
        ..spec(
            "brake_split",
            "brake_front_share += share",
            "the balance moves with pads, pressure and the motor that brakes along; often nobody stated it",
            "braking in corners",
            &[Site::DriveTrain],
            &[share()],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.brake_front_share += p[0];
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car};
    use super::*;

    #[test]
    fn the_front_axle_takes_another_share() {
        assert_absent_at_null::<BrakeSplit>();
        let mut other = car();
        BrakeSplit::car(&[0.2], &mut other);
        assert_eq!(other.brake_front_share, car().brake_front_share + 0.2);
    }
}
