//! The road leans to one side.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::common::angle;
use super::{Effect, EffectId, EffectSpec, Reported, both_sides, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment, Motion};

/// The largest angle of the lap, with its sign.
fn extreme(p: &[f64]) -> f64 {
    let wave = p[1].hypot(p[2]);
    if p[0] < 0.0 { p[0] - wave } else { p[0] + wave }
}

/// The road leans to one side.
#[derive(Debug)]
pub(super) struct RoadBank;

impl Effect for RoadBank {
    const SPEC: EffectSpec = EffectSpec {
        of_a_place: true,
        alike: &[EffectId::ImuTilt],
        reported: &[Reported { name: "angle_rad", unit: "rad", value: extreme }],
        ..spec(
            "road_bank",
            "v_y' -= g sin(angle); F_z from g cos(angle) - v r sin(angle); positive: left side high",
            "gravity across the road",
            "an accelerometer beside v_y' + v r",
            &[Site::RoadAndWind],
            &[
                both_sides("mean_rad", "rad", [0.04, 0.04]),
                both_sides("cosine_rad", "rad", [0.04, 0.04]),
                both_sides("sine_rad", "rad", [0.04, 0.04]),
            ],
        )
    };

    fn loads<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        let (sin, cos) = angle(p, at).sin_cos();
        let into_road = cos - at.v_x_mps * at.yaw_rate_radps * sin / GRAVITY_MPS2;
        let into_road = if into_road.re() < 0.1 { T::from(0.1) } else { into_road };
        axles.front.load_n *= into_road;
        axles.rear.load_n *= into_road;
    }

    fn motion<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, motion: &mut Motion<T>) {
        motion.gravity_y_mps2 -= angle(p, at).sin() * GRAVITY_MPS2;
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn it_pulls_down_the_bank_and_changes_the_loads() {
        assert_absent_at_null::<RoadBank>();
        let at = moment();
        let mut motion = Motion::none();
        RoadBank::motion(&[0.05, 0.0, 0.0], &car(), &at, &mut motion);
        assert_eq!(motion.gravity_y_mps2, -GRAVITY_MPS2 * 0.05_f64.sin());
        let mut axles = car().axles_at_rest();
        RoadBank::loads(&[0.05, 0.0, 0.0], &car(), &at, &mut axles);
        let into_road = 0.05_f64.cos() - at.v_x_mps * at.yaw_rate_radps * 0.05_f64.sin() / GRAVITY_MPS2;
        let rest_n = car().axles_at_rest().front.load_n;
        approx::assert_relative_eq!(axles.front.load_n, rest_n * into_road, epsilon = 1e-9);
    }

    #[test]
    fn the_largest_angle_is_stated_with_its_sign() {
        assert!((RoadBank::SPEC.reported[0].value)(&[-0.03, 0.02, 0.0]) < -0.04);
    }
}
