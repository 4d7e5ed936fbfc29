//! The lateral velocity is reported behind a filter.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, positive, spec};
use crate::site::Site;
use crate::terms::{Lag, Outputs};

/// The lateral velocity is reported behind a filter.
#[derive(Debug)]
pub(super) struct OdometryLowPass;

impl Effect for OdometryLowPass {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::OdometryDelay],
        starts: &[0.5],
        ..spec(
            "odometry_low_pass",
            "tau v_ym' + v_ym = v_y",
            "a filter in the estimator",
            "transients",
            &[Site::Vy],
            &[positive("tau_s", "s", [0.06, 0.06])],
        )
    };

    fn sense<T: Real>(p: &[T], out: &mut Outputs<T>) {
        let [first, second, ..] = out.v_y_mps[..] else { return };
        // Before the window the input is taken as a ramp that goes on.
        let slope = (second - first) / out.dt_s;
        let lag = Lag::new(out.dt_s, p[0]);
        let (mut before, mut y) = (first, first - slope * p[0]);
        for v in out.v_y_mps.iter_mut().skip(1) {
            y = lag.step(y, before, *v);
            before = *v;
            *v = y;
        }
        out.v_y_mps[0] = first - slope * p[0];
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{DT_S, assert_absent_at_null, outputs};
    use super::*;

    #[test]
    fn a_ramp_comes_late_by_the_time_constant() {
        assert_absent_at_null::<OdometryLowPass>();
        let ramp: Vec<f64> = (0..50).map(|k| 0.2 * f64::from(k) * DT_S).collect();
        let mut after = Outputs { v_y_mps: ramp.clone(), ..outputs() };
        OdometryLowPass::sense(&[0.06], &mut after);
        for (late, now) in after.v_y_mps.iter().zip(&ramp) {
            approx::assert_relative_eq!(*late, now - 0.2 * 0.06, epsilon = 1e-12);
        }
    }
}
