//! The point that v_y is taken at sways over the wheels as the body rolls.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::{Effect, EffectSpec, both_sides, spec};
use crate::site::Site;
use crate::terms::{Lag, Outputs, ROLL_TIME_S};

/// The point that v_y is taken at sways over the wheels as the body rolls.
///
/// A body that rolls by so many radians per g about an axis so far below the point carries it outwards by their product: 0.05 rad/g and 0.4 m are 0.02 m/g on
/// a passenger car. What slips over the road are the wheels, and v_y of the point is theirs less what it sways by.
#[derive(Debug)]
pub(super) struct VyRollRate;

impl Effect for VyRollRate {
    const SPEC: EffectSpec = EffectSpec {
        is_nuisance: true,
        usual: Some(|_, size| size),
        ..spec(
            "v_y_roll_rate",
            "v_ym = v_y - s d(a_y)/dt/g, a_y behind the roll",
            "velocity of a point above the roll axis; Milliken, Race Car Vehicle Dynamics, chapter 18",
            "transients",
            &[Site::Vy],
            &[both_sides("s_m_per_g", "m/g", [0.002, 0.02])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        let [first, second, ..] = out.a_y_mps2[..] else { return };
        let lag = Lag::new(out.dt_s, T::from(ROLL_TIME_S));
        // As if the first change had gone on for long.
        let mut rolled = first - (second - first) * (ROLL_TIME_S / out.dt_s);
        let mut before = first;
        for (k, v) in out.v_y_mps.iter_mut().enumerate() {
            let a_y = out.a_y_mps2[k];
            if k > 0 {
                rolled = lag.step(rolled, before, a_y);
            }
            before = a_y;
            *v -= p[0] * (a_y - rolled) * (1.0 / (ROLL_TIME_S * GRAVITY_MPS2));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{assert_absent_at_null, outputs};
    use super::*;

    #[test]
    fn a_point_above_the_roll_axis_sways_outwards_as_fast_as_the_lateral_acceleration_grows() {
        const M_PER_G: f64 = 0.02;
        const JERK_MPS3: f64 = 30.0;
        assert_absent_at_null::<VyRollRate>();
        let mut before = outputs();
        for (k, a_y) in before.a_y_mps2.iter_mut().enumerate() {
            *a_y = 1.0 + JERK_MPS3 * before.dt_s * k as f64;
        }
        let mut after = before.clone();
        VyRollRate::sense(&[M_PER_G], &mut after);
        for (then, now) in before.v_y_mps.iter().zip(&after.v_y_mps) {
            approx::assert_relative_eq!(then - now, M_PER_G * JERK_MPS3 / GRAVITY_MPS2, max_relative = 1e-9);
        }
        assert_eq!(after.a_y_mps2, before.a_y_mps2);
    }
}
