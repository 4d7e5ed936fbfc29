//! A place on the course with less grip. Start and length are fitted as shares of the lap, or of the way driven where none was closed.

use gripsight_vehicle::Real;

use super::common::scale;
use super::{Effect, EffectSpec, Need, ParameterSpec, spec};
use crate::site::Site;
use crate::terms::{Axles, Car, Moment};

/// A place on the course with less grip. Start and length are fitted as shares of the lap, or of the way driven where none was closed.
#[derive(Debug)]
pub(super) struct LowGripPatch;

/// Width of the patch's edges over its length.
const EDGE: f64 = 0.1;

impl Effect for LowGripPatch {
    const SPEC: EffectSpec = EffectSpec {
        of_a_place: true,
        sizing: 1,
        needs: &[Need::Passes],
        flat_at_null: true,
        ..spec(
            "low_grip_patch",
            "D (1 - depth w(s)), w = 1 on the patch, with soft edges",
            "dirt, water, paint",
            "two or more passes above 60 % of the limit",
            &[Site::FrontAxle, Site::RearAxle],
            &[
                ParameterSpec { name: "depth", unit: "1", null: 0.0, size: [0.2, 0.2], range: [0.0, 4.0] },
                ParameterSpec {
                    name: "start_share",
                    unit: "lap",
                    null: 0.5,
                    size: [1.0, 1.0],
                    range: [-1.0, 1.0],
                },
                ParameterSpec {
                    name: "length_share",
                    unit: "lap",
                    null: 0.05,
                    size: [0.05, 0.05],
                    range: [-0.7, 3.0],
                },
            ],
        )
    };

    fn grip<T: Real>(p: &[T], _car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
        if at.lap_m <= 0.0 {
            return;
        }
        let middle = p[1] + p[2] * 0.5;
        let mut off = middle - at.lap_share;
        off -= off.re().round();
        let edge = p[2] * EDGE;
        let side = |x: T| (x / edge).tanh();
        let weight = (side(p[2] * 0.5 - off) + side(p[2] * 0.5 + off)) * 0.5;
        let factor = T::from(1.0) - p[0] * weight;
        scale(axles, factor, factor);
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn grip_is_lost_on_the_patch_alone_and_only_where_there_is_a_lap() {
        assert_absent_at_null::<LowGripPatch>();
        let grip = |lap_share: f64, lap_m: f64| {
            let mut axles = car().axles_at_rest();
            let at = Moment { lap_share, lap_m, ..moment() };
            LowGripPatch::grip(&[0.3, 0.95, 0.1], &car(), &at, &mut axles);
            axles.front.grip
        };
        approx::assert_relative_eq!(grip(0.0, 60.0), 0.7, epsilon = 1e-3);
        approx::assert_relative_eq!(grip(0.5, 60.0), 1.0, epsilon = 1e-6);
        assert_eq!(grip(0.0, 0.0), 1.0);
    }
}
