//! The outer front wheel, which carries more of the side force than the inner one, turns the car out of the corner.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::{Effect, EffectSpec, Lagging, ParameterSpec, spec};
use crate::site::Site;
use crate::terms::{Car, Moment, Motion};

/// The outer front wheel, which carries more of the side force than the inner one, turns the car out of the corner.
///
/// The side force of a front wheel turned by d has the share sin d backwards along the car. Half a track t off the middle, with loads that differ by
/// the share 2 h a_y/(g t) of their mean, the two leave a moment in which the track cancels; h is the height of the centre of gravity, less what a tire's
/// force grows less than its load does.
#[derive(Debug)]
pub(super) struct OuterWheelMoment;

impl Effect for OuterWheelMoment {
    const SPEC: EffectSpec = EffectSpec {
        is_nuisance: true,
        usual: Some(|_, size| size),
        lagging: &[Lagging::Roll],
        ..spec(
            "outer_wheel_moment",
            "I_z r' -= F_yf sin(d) h a_y/g, a_y behind the roll",
            "double track; Milliken, Race Car Vehicle Dynamics, chapter 18",
            "tight corners",
            &[Site::FrontAxle],
            &[ParameterSpec { name: "h_m", unit: "m", null: 0.0, size: [0.04, 0.3], range: [0.0, 2.5] }],
        )
    };

    fn motion<T: Real>(p: &[T], car: &Car<T>, at: &Moment<T>, motion: &mut Motion<T>) {
        let front_n = at.front_use * car.front_load_at_rest_n();
        let lever_m = p[0] * at.rolled_a_y_mps2 / GRAVITY_MPS2;
        motion.yaw_radps2 -= front_n * at.steering_rad.sin_cos().0 * lever_m / car.turned_kgm2();
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, car, moment};
    use super::*;

    #[test]
    fn two_wheels_half_a_track_off_the_middle_turn_the_car_as_the_lever_says() {
        const H_M: f64 = 0.05;
        const TRACK_M: f64 = 0.2;
        assert_absent_at_null::<OuterWheelMoment>();
        let (car, at) = (car(), Moment { steering_rad: 0.2, ..moment() });
        let mut motion = Motion::none();
        OuterWheelMoment::motion(&[H_M], &car, &at, &mut motion);
        let load_n = car.axles_at_rest().front.load_n;
        let shifted_n = load_n * H_M * at.rolled_a_y_mps2 / (GRAVITY_MPS2 * TRACK_M);
        let backwards_n = |wheel_load_n: f64| at.front_use * wheel_load_n * at.steering_rad.sin();
        let [left_n, right_n] = [load_n / 2.0 - shifted_n, load_n / 2.0 + shifted_n].map(backwards_n);
        let moment_nm = (left_n - right_n) * TRACK_M / 2.0;
        approx::assert_relative_eq!(motion.yaw_radps2, moment_nm / car.turned_kgm2(), epsilon = 1e-9);
    }
}
