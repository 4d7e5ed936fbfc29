//! Effects between the recorded steering and the road wheels.

use gripsight_vehicle::Real;

use super::{Effect, EffectSpec, ParameterSpec, Reported, both_sides, positive, spec};
use crate::terms::{Lag, delayed};

/// The wheels follow the command with a first-order lag.
#[derive(Debug)]
pub(super) struct SteeringLag;

impl Effect for SteeringLag {
    const SPEC: EffectSpec = EffectSpec {
        starts: &[0.5, 0.15],
        ..spec(
            "steering_lag",
            "tau d' + d = u",
            "a servo, to first order",
            "steering up to 3 Hz",
            &[positive("tau_s", "s", [0.06, 0.06])],
        )
    };

    fn steer<T: Real>(p: &[T], steering_rad: &mut [T], dt_s: f64) {
        let Some(&first) = steering_rad.first() else { return };
        let lag = Lag::new(dt_s, p[0]);
        let (mut before, mut y) = (first, first);
        for u in steering_rad.iter_mut() {
            y = lag.step(y, before, *u);
            before = *u;
            *u = y;
        }
    }
}

/// The wheels follow the command late.
#[derive(Debug)]
pub(super) struct SteeringDelay;

impl Effect for SteeringDelay {
    const SPEC: EffectSpec = EffectSpec {
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
