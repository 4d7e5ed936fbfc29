//! Another split of the drive force than the file states.

use gripsight_vehicle::Real;

use super::common::{COMMAND, share, split};
use super::{Effect, EffectSpec, Figure, spec};
use crate::site::Site;
use crate::terms::Car;

/// Another split of the drive force than the file states.
#[derive(Debug)]
pub(super) struct DriveSplit;

impl Effect for DriveSplit {
    const SPEC: EffectSpec = EffectSpec {
        needs: COMMAND,
        figure: Some(Figure {
            name: "drive_front_share",
            stated: |car| car.drive_front_share,
            value: |car, more| car.front_drive_share() + more,
        }),
        is_nuisance: true,
        usual: Some(|car, _| split(car.drive_front_share)),
        ..spec(
            "drive_split",
            "drive_front_share += share",
            "all-wheel drives split the torque by slip and preload; often nobody stated it",
            "accelerating in corners",
            &[Site::DriveTrain],
            &[share()],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.drive_front_share += p[0];
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car};
    use super::*;

    #[test]
    fn the_front_axle_takes_another_share() {
        assert_absent_at_null::<DriveSplit>();
        let mut other = car();
        DriveSplit::car(&[0.2], &mut other);
        assert_eq!(other.drive_front_share, car().drive_front_share + 0.2);
    }
}
