//! The side force follows the slip angle with a lag of one relaxation length.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, Lagging, OutsideTerm, positive, spec};
use crate::site::Site;
use crate::terms::Car;

/// The side force follows the slip angle with a lag of one relaxation length.
#[derive(Debug)]
pub(super) struct TireRelaxation;

impl Effect for TireRelaxation {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::Relaxation),
        // A third of the radius of the wheel; where that is not known, of a size that matters.
        usual: Some(|car, size| 0.33 * car.wheel_radius_m.unwrap_or(0.6 * size)),
        lagging: &[Lagging::Slip],
        alike: &[EffectId::SteeringDelay, EffectId::SteeringLag],
        starts: &[0.5, 0.15],
        spread: 0.10,
        ..spec(
            "tire_relaxation",
            "sigma/v alpha' + alpha = alpha_ss (linearly: sigma/v F' + F = F_ss)",
            "Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 1.2.4 and chapter 7",
            "steering above 1 Hz at low speed",
            &[Site::FrontAxle, Site::RearAxle],
            &[positive("sigma_m", "m", [0.08, 0.5])],
        )
    };

    fn car<T: Real>(p: &[T], car: &mut Car<T>) {
        car.relaxation_m += p[0];
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car};
    use super::*;

    #[test]
    fn it_is_handed_to_the_slip_angles() {
        assert_absent_at_null::<TireRelaxation>();
        let mut car = car();
        TireRelaxation::car(&[0.1], &mut car);
        assert_eq!(car.relaxation_m, 0.1);
    }
}
