//! Effects of the road's shape. The angle is its mean and the first harmonic of the distance over the lap, or over the way driven where none
//! was closed; without a pose, of the heading, as on a tilted plane.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::loads::COMMAND;
use super::{Effect, EffectId, EffectSpec, Reported, both_sides, spec};
use crate::terms::{Axles, Car, Moment, Motion};

/// The angle at a place.
fn angle<T: Real>(p: &[T], at: &Moment<T>) -> T {
    p[0] + p[1] * at.place_rad.cos() + p[2] * at.place_rad.sin()
}

/// The largest angle of the lap, with its sign.
fn extreme(p: &[f64]) -> f64 {
    let wave = p[1].hypot(p[2]);
    if p[0] < 0.0 { p[0] - wave } else { p[0] + wave }
}

/// The steepest climb. A lap that ends where it began climbs as much as it falls: of the two the climb is stated.
fn climb(p: &[f64]) -> f64 {
    p[0] + p[1].hypot(p[2])
}

/// The road leans to one side.
#[derive(Debug)]
pub(super) struct RoadBank;

impl Effect for RoadBank {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::ImuTilt],
        reported: &[Reported { name: "angle_rad", unit: "rad", value: extreme }],
        ..spec(
            "road_bank",
            "v_y' -= g sin(angle); F_z from g cos(angle) - v r sin(angle); positive: left side high",
            "gravity across the road",
            "an accelerometer beside v_y' + v r",
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

/// The road climbs.
#[derive(Debug)]
pub(super) struct RoadSlope;

impl Effect for RoadSlope {
    const SPEC: EffectSpec = EffectSpec {
        needs: COMMAND,
        reported: &[Reported { name: "angle_rad", unit: "rad", value: climb }],
        ..spec(
            "road_slope",
            "v_x' -= g sin(angle); positive: uphill",
            "gravity along the road",
            "any drive",
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
