//! The wheels follow the command through a servo: a lag of second order.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, OutsideTerm, ParameterSpec, Wheels, positive, spec};
use crate::site::Site;

/// The wheels follow the command through a servo: a lag of second order.
#[derive(Debug)]
pub(super) struct SteeringLag;

/// Share of a step between samples below which a lag is taken as a shift.
const SHORT_LAG: f64 = 1.0 / 30.0;

impl Effect for SteeringLag {
    const SPEC: EffectSpec = EffectSpec {
        outside: Some(OutsideTerm::SteeringLag),
        sizing: 1,
        of_a_command: true,
        alike: &[EffectId::SteeringDelay, EffectId::TireRelaxation, EffectId::SteeringBacklash],
        starts: &[0.5, 0.15],
        ..spec(
            "steering_lag",
            "q tau^2 d'' + tau d' + d = u",
            "a servo: damping 1/(2 sqrt q), from heavily damped (0.05: as good as first order) to 0.7 (0.5)",
            "steering up to 3 Hz",
            &[Site::Steering],
            &[
                positive("tau_s", "s", [0.06, 0.06]),
                ParameterSpec { name: "q", unit: "1", null: 0.25, size: [0.1, 0.1], range: [-2.0, 2.5] },
            ],
        )
    };

    fn follow<T: Real>(p: &[T], wheels: &mut Wheels<T>, steering_rad: T, dt_s: f64) -> T {
        let (tau_s, q, zero) = (p[0], p[1], T::from(0.0));
        let [before, off, rate, slope, shares @ ..] =
            wheels.kept.get_or_insert([steering_rad, zero, zero, zero, zero, zero, zero, zero]);
        if wheels.step_s != dt_s {
            let short = tau_s.re() < dt_s * SHORT_LAG;
            *shares = if short { Decay::at_once() } else { Decay::of(tau_s, q, dt_s) }.shares;
            wheels.step_s = dt_s;
        }
        // The wheels settle to u - tau u' where the command goes on straight: what they are off by, and its rate.
        let now = (steering_rad - *before) / dt_s;
        let turned = now - *slope;
        (*off, *rate) = Decay { shares: *shares }.after(*off + turned * tau_s, *rate - turned);
        (*before, *slope) = (steering_rad, now);
        steering_rad + (*off - now * tau_s)
    }
}

/// How q tau^2 e'' + tau e' + e = 0 goes on over a step: e(h) and e'(h) as shares of e(0) and e'(0).
struct Decay<T> {
    /// Of e(h) in e(0) and e'(0), then of e'(h).
    shares: [T; 4],
}

impl<T: Real> Decay<T> {
    fn at_once() -> Self {
        Self { shares: [T::from(0.0); 4] }
    }

    fn of(tau_s: T, q: T, h_s: f64) -> Self {
        let half = (q * tau_s * 2.0).recip();
        let square = (q * tau_s * tau_s).recip();
        // cosh and sinh(x)/x of the root of (half^2 - square) h^2, which may be negative, times exp(-half h).
        let argument = (half * half - square) * (h_s * h_s);
        let damped = (-half * h_s).exp();
        let (even, odd) = if argument.re().abs() < 1e-3 {
            (
                argument / 2.0 + 1.0 + argument * argument / 24.0,
                argument / 6.0 + 1.0 + argument * argument / 120.0,
            )
        } else if argument.re() > 0.0 {
            let root = argument.sqrt();
            let (up, down) = (root.exp(), (-root).exp());
            ((up + down) * 0.5, (up - down) * 0.5 / root)
        } else {
            let root = (-argument).sqrt();
            (root.cos(), root.sin() / root)
        };
        let (even, odd) = (even * damped, odd * damped * h_s);
        Self { shares: [even + odd * half, odd, -odd * square, even - odd * half] }
    }

    fn after(&self, off: T, rate: T) -> (T, T) {
        let [a, b, c, d] = self.shares;
        (a * off + b * rate, c * off + d * rate)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::assert_absent_at_null;
    use super::*;

    #[test]
    fn without_a_time_constant_the_wheels_are_there_at_once() {
        assert_absent_at_null::<SteeringLag>();
    }

    #[test]
    fn the_lag_is_the_second_order_equation_at_any_damping() {
        const DT_S: f64 = 0.01;
        let command: Vec<f64> = (0..60).map(|k| (k as f64 * 0.3).sin() * 0.1).collect();
        for (tau_s, q) in [(0.06, 0.05), (0.06, 0.25), (0.03, 0.4), (0.1, 0.5), (0.002, 0.25)] {
            // Fine steps of q tau^2 d'' + tau d' + d = u, the command straight between samples.
            const FINE: usize = 4000;
            let (mut d, mut rate) = (command[0], 0.0);
            let mut expected = vec![d];
            for k in 1..command.len() {
                for i in 0..FINE {
                    let share = (i as f64 + 0.5) / FINE as f64;
                    let u = command[k - 1] + (command[k] - command[k - 1]) * share;
                    let h_s = DT_S / FINE as f64;
                    rate += h_s * (u - d - tau_s * rate) / (q * tau_s * tau_s);
                    d += h_s * rate;
                }
                expected.push(d);
            }
            let mut followed = command.clone();
            SteeringLag::steer(&[tau_s, q], &mut followed, DT_S);
            for (a, b) in followed.iter().zip(&expected) {
                approx::assert_relative_eq!(a, b, epsilon = 2e-4);
            }
        }
    }
}
