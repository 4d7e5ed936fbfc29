//! The front suspension and the steering give way under side force.

use gripsight_vehicle::Real;

use super::{Effect, EffectSpec, ParameterSpec, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment};

/// The front suspension and the steering give way under side force.
#[derive(Debug)]
pub(super) struct ComplianceSteer;

impl Effect for ComplianceSteer {
    const SPEC: EffectSpec = EffectSpec {
        spread: 0.08,
        ..spec(
            "compliance_steer",
            "d -= c F_yf/F_zf",
            "elastic steering and suspension; Milliken, Race Car Vehicle Dynamics, chapter 23",
            "medium lateral acceleration, transients",
            &[Site::FrontAxle],
            &[ParameterSpec {
                name: "rad_per_g",
                unit: "rad/g",
                null: 0.0,
                size: [0.015, 0.008],
                range: [-2.0, 5.0],
            }],
        )
    };

    fn loads<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        axles.front.steer_rad -= p[0] * at.front_use;
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn the_front_wheels_give_way_to_their_force() {
        assert_absent_at_null::<ComplianceSteer>();
        let mut axles = car().axles_at_rest();
        ComplianceSteer::loads(&[0.02], &car(), &Moment { front_use: 0.5, ..moment() }, &mut axles);
        assert_eq!([axles.front.steer_rad, axles.rear.steer_rad], [-0.01, 0.0]);
    }
}
