//! Effects between the recorded steering and the road wheels.

use gripsight_vehicle::Real;

use super::{Effect, EffectId, EffectSpec, ParameterSpec, Reported, both_sides, positive, spec};
use crate::terms::delayed;

/// The wheels follow the command through a servo: a lag of second order.
#[derive(Debug)]
pub(super) struct SteeringLag;

/// Share of a step between samples below which a lag is taken as a shift.
const SHORT_LAG: f64 = 1.0 / 30.0;

impl Effect for SteeringLag {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::SteeringDelay, EffectId::TireRelaxation, EffectId::SteeringBacklash],
        starts: &[0.5, 0.15],
        ..spec(
            "steering_lag",
            "q tau^2 d'' + tau d' + d = u",
            "a servo: damping 1/(2 sqrt q), from heavily damped (0.05: as good as first order) to 0.7 (0.5)",
            "steering up to 3 Hz",
            &[
                positive("tau_s", "s", [0.06, 0.06]),
                ParameterSpec { name: "q", unit: "1", null: 0.25, size: [0.1, 0.1], range: [-2.0, 2.5] },
            ],
        )
    };

    fn steer<T: Real>(p: &[T], steering_rad: &mut [T], dt_s: f64) {
        let Some(&first) = steering_rad.first() else { return };
        let (tau_s, q) = (p[0], p[1]);
        let short = tau_s.re() < dt_s * SHORT_LAG;
        let decay = if short { Decay::at_once() } else { Decay::of(tau_s, q, dt_s) };
        // The wheels settle to u - tau u' where the command goes on straight: what they are off by, and its rate.
        let (mut before, mut off, mut rate) = (first, T::from(0.0), T::from(0.0));
        let mut slope = T::from(0.0);
        for u in steering_rad.iter_mut() {
            let now = (*u - before) / dt_s;
            let turned = now - slope;
            (off, rate) = decay.after(off + turned * tau_s, rate - turned);
            (before, slope) = (*u, now);
            *u += off - now * tau_s;
        }
    }
}

/// How q tau^2 e'' + tau e' + e = 0 goes on over a step: e(h) and e'(h) as shares of e(0) and e'(0).
struct Decay<T> {
    shares: [[T; 2]; 2],
}

impl<T: Real> Decay<T> {
    fn at_once() -> Self {
        Self { shares: [[T::from(0.0); 2]; 2] }
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
        Self { shares: [[even + odd * half, odd], [-odd * square, even - odd * half]] }
    }

    fn after(&self, off: T, rate: T) -> (T, T) {
        let [a, b] = &self.shares;
        (a[0] * off + a[1] * rate, b[0] * off + b[1] * rate)
    }
}

/// The wheels follow the command late.
#[derive(Debug)]
pub(super) struct SteeringDelay;

impl Effect for SteeringDelay {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::SteeringLag, EffectId::TireRelaxation],
        starts: &[0.5, 1.5],
        ..spec(
            "steering_delay",
            "d(t) = u(t - T)",
            "transport time of command and servo",
            "steering up to 3 Hz",
            &[positive("delay_s", "s", [0.05, 0.05])],
        )
    };

    fn steer<T: Real>(p: &[T], steering_rad: &mut [T], dt_s: f64) {
        let late = delayed(steering_rad, p[0], dt_s);
        steering_rad.copy_from_slice(&late);
    }
}

/// The wheels turn more than the recording says.
#[derive(Debug)]
pub(super) struct SteeringGain;

impl Effect for SteeringGain {
    const SPEC: EffectSpec = spec(
        "steering_gain",
        "d = (1 + g) u",
        "steering ratio, servo scale",
        "low lateral acceleration over a range of speeds",
        &[both_sides("gain", "1", [0.05, 0.05])],
    );

    fn steer<T: Real>(p: &[T], steering_rad: &mut [T], _dt_s: f64) {
        for u in steering_rad {
            *u *= p[0] + 1.0;
        }
    }
}

/// The wheels are not straight when the recording says so.
#[derive(Debug)]
pub(super) struct SteeringOffset;

impl Effect for SteeringOffset {
    const SPEC: EffectSpec = spec(
        "steering_offset",
        "d = u + d0",
        "steering centre, alignment",
        "straights, both turn directions",
        &[both_sides("offset_rad", "rad", [0.01, 0.005])],
    );

    fn steer<T: Real>(p: &[T], steering_rad: &mut [T], _dt_s: f64) {
        for u in steering_rad {
            *u += p[0];
        }
    }
}

/// Play in the steering.
#[derive(Debug)]
pub(super) struct SteeringBacklash;

impl Effect for SteeringBacklash {
    const SPEC: EffectSpec = EffectSpec {
        alike: &[EffectId::SteeringLag],
        starts: &[0.6, 1.8],
        ..spec(
            "steering_backlash",
            "d stays while abs(u - d) is below the half width, then is dragged along",
            "play operator",
            "small reversals",
            &[positive("half_width_rad", "rad", [0.008, 0.003])],
        )
    };

    fn steer<T: Real>(p: &[T], steering_rad: &mut [T], _dt_s: f64) {
        let Some(&first) = steering_rad.first() else { return };
        let mut wheel = first;
        for u in steering_rad.iter_mut() {
            let (low, high) = (*u - p[0], *u + p[0]);
            if wheel.re() < low.re() {
                wheel = low;
            } else if wheel.re() > high.re() {
                wheel = high;
            }
            *u = wheel;
        }
    }
}

/// The limit of an inverse rate: infinite, in files `null`, where there is none.
fn rate_radps(s_per_rad: f64) -> f64 {
    if s_per_rad > 1e-6 { 1.0 / s_per_rad } else { f64::INFINITY }
}

/// The steering is not faster than a rate. Fitted as its inverse, so that "no limit" is 0.
#[derive(Debug)]
pub(super) struct SteeringRateLimit;

impl Effect for SteeringRateLimit {
    const SPEC: EffectSpec = EffectSpec {
        reported: &[Reported { name: "rate_radps", unit: "rad/s", value: |p| rate_radps(p[0]) }],
        starts: &[1.0, 2.0, 3.5],
        flat_at_null: true,
        ..spec(
            "steering_rate_limit",
            "abs(d') <= rate",
            "slew rate of the servo or the power steering",
            "fast steering",
            &[ParameterSpec {
                name: "s_per_rad",
                unit: "s/rad",
                null: 0.0,
                size: [0.4, 2.0],
                range: [0.0, 6.0],
            }],
        )
    };

    fn steer<T: Real>(p: &[T], steering_rad: &mut [T], dt_s: f64) {
        let Some(&first) = steering_rad.first() else { return };
        if p[0].re() < 1e-9 {
            return;
        }
        let most = p[0].recip() * dt_s;
        let mut wheel = first;
        for u in steering_rad.iter_mut() {
            let way = *u - wheel;
            wheel = if way.re() > most.re() {
                wheel + most
            } else if way.re() < -most.re() {
                wheel - most
            } else {
                *u
            };
            *u = wheel;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
