//! The road climbs.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::common::{COMMAND, angle};
use super::{Effect, EffectSpec, Reported, both_sides, spec};
use crate::site::Site;
use crate::terms::{Car, Moment, Motion};

/// The steepest climb. A lap that ends where it began climbs as much as it falls: of the two the climb is stated.
fn climb(p: &[f64]) -> f64 {
    p[0] + p[1].hypot(p[2])
}

/// The road climbs.
#[derive(Debug)]
pub(super) struct RoadSlope;

impl Effect for RoadSlope {
    const SPEC: EffectSpec = EffectSpec {
        of_a_place: true,
        along: true,
        needs: COMMAND,
        reported: &[Reported { name: "angle_rad", unit: "rad", value: climb }],
        ..spec(
            "road_slope",
            "v_x' -= g sin(angle); positive: uphill",
            "gravity along the road",
            "any drive",
            &[Site::RoadAndWind],
            &[
                both_sides("mean_rad", "rad", [0.03, 0.03]),
                both_sides("cosine_rad", "rad", [0.03, 0.03]),
                both_sides("sine_rad", "rad", [0.03, 0.03]),
            ],
        )
    };

    fn motion<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, motion: &mut Motion<T>) {
        motion.gravity_x_mps2 -= angle(p, at).sin() * GRAVITY_MPS2;
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn uphill_it_pulls_back() {
        assert_absent_at_null::<RoadSlope>();
        let mut motion = Motion::none();
        let at = Moment { place_rad: 0.0, ..moment() };
        RoadSlope::motion(&[0.02, 0.03, 0.5], &car(), &at, &mut motion);
        assert_eq!(motion.gravity_x_mps2, -GRAVITY_MPS2 * 0.05_f64.sin());
    }

    #[test]
    fn the_steepest_climb_is_stated_wherever_on_the_lap_it_is() {
        let stated = RoadSlope::SPEC.reported[0].value;
        for p in [[0.0, 0.03, 0.0], [-1e-4, -0.03, 0.0], [1e-4, 0.0, -0.03]] {
            approx::assert_relative_eq!(stated(&p), 0.03, epsilon = 2e-4);
        }
        assert!(stated(&[-0.02, 0.0, 0.0]) < 0.0);
    }
}
