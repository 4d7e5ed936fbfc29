//! The single-track model with effects: what is fitted, and how it is run over a window.
//!
//! With no effect, or with all at their null values, it is exactly `vehicle::SingleTrack` with the inertia of the turning wheels in its yaw inertia. Parameters, in order: the tires (cornering stiffness
//! over load B C D, C, D, E; front, then rear), the hold of the steering command, then those of the effects, then those of the
//! flexible terms.

use crate::rollout::{Rollout, Window};
use gripsight_vehicle::{OWN_TIRE_PARAMETERS, OwnTires, Real, VehicleParameters};

use crate::correction::Correction;
use crate::effects::EffectId;
use crate::flexible::Flexible;
use crate::motion::Mover;
use crate::recording::{Channel, Recording};
use crate::road_wheels::RoadWheels;
use crate::terms::{Car, Outputs};

/// Parameters of the tires.
pub const TIRES: usize = OWN_TIRE_PARAMETERS;
/// Place of the hold of the command: how long after its stamp a recorded steering angle acts, within one sample. A command that jumps at its stamp and is
/// held until the next is on average half a sample late, a course that moves on between samples not at all.
pub const HOLD: usize = TIRES;
/// Parameters before those of the effects.
pub const BASE: usize = TIRES + 1;

/// The model with a list of effects, on a recording.
#[derive(Debug, Clone)]
pub struct ExtendedModel<'a> {
    /// What it is run on.
    pub recording: &'a Recording,
    /// The car as the file states it.
    pub vehicle: &'a VehicleParameters,
    /// Its effects, in the order of their parameters.
    pub effects: Vec<EffectId>,
    /// Free terms on top, if any; their parameters are the last.
    pub flexible: Option<Flexible>,
    /// Learned accelerations on top, if any.
    pub residual: Option<&'a dyn Correction>,
    /// Longest step of the integration.
    pub substep_s: f64,
}

impl<'a> ExtendedModel<'a> {
    /// The model with some effects, and nothing on top.
    #[must_use]
    pub fn new(
        recording: &'a Recording,
        vehicle: &'a VehicleParameters,
        effects: &[EffectId],
        substep_s: f64,
    ) -> Self {
        Self { recording, vehicle, effects: effects.to_vec(), flexible: None, residual: None, substep_s }
    }

    /// Each effect with its parameters.
    pub fn with_parameters<'p, T>(&'p self, p: &'p [T]) -> impl Iterator<Item = (EffectId, &'p [T])> {
        let mut from = BASE;
        self.effects.iter().map(move |&e| {
            let n = e.spec().parameters.len();
            from += n;
            (e, &p[from - n..from])
        })
    }

    /// Parameters of the flexible terms.
    pub fn flexible_parameters<'p, T>(&self, p: &'p [T]) -> &'p [T] {
        &p[BASE + self.effects.iter().map(|e| e.spec().parameters.len()).sum::<usize>()..]
    }

    fn flatten<T: Real>(&self, outputs: &Outputs<T>, window: &Window, out: &mut Vec<T>) {
        let n = outputs.v_y_mps.len();
        let kinematic = self.kinematic(outputs, window);
        let derived: Vec<T> =
            if self.recording.derived_a_y { self.derived_a_y(outputs, window) } else { Vec::new() };
        let series: Vec<(&[T], T)> = self
            .recording
            .channels
            .iter()
            .map(|c| {
                let values: &[T] = match c {
                    Channel::LateralVelocity => &outputs.v_y_mps,
                    Channel::YawRate | Channel::Gyro => &outputs.yaw_rate_radps,
                    Channel::LateralAcceleration if self.recording.derived_a_y => &derived,
                    Channel::LateralAcceleration => &outputs.a_y_mps2,
                    Channel::Heading => &outputs.heading_rad,
                    Channel::LongitudinalAcceleration => &outputs.a_x_mps2,
                    Channel::Speed => &outputs.v_x_mps,
                    Channel::LateralKinematics => &kinematic,
                };
                let mean = if c.without_mean() {
                    values.iter().fold(T::from(0.0), |s, v| s + *v) / n as f64
                } else {
                    T::from(0.0)
                };
                (values, mean)
            })
            .collect();
        out.clear();
        for k in 0..n {
            out.extend(series.iter().map(|(values, mean)| values[k] - *mean));
        }
    }

    /// The kinematic channel of the signals as predicted.
    fn kinematic<T: Real>(&self, out: &Outputs<T>, window: &Window) -> Vec<T> {
        if !self.recording.channels.contains(&Channel::LateralKinematics) {
            return Vec::new();
        }
        let v_x = &self.recording.runs[window.segment].v_x_mps[window.from..];
        let rate = |k: usize| out.a_y_mps2[k] - out.yaw_rate_radps[k] * v_x[k];
        let mut integral = T::from(0.0);
        (0..out.v_y_mps.len())
            .map(|k| {
                if k > 0 {
                    integral += (rate(k) + rate(k - 1)) * (0.5 * out.dt_s);
                }
                out.v_y_mps[k] - integral
            })
            .collect()
    }

    /// The lateral acceleration as whoever recorded it made it: from the reported v_y, v_x and r.
    fn derived_a_y<T: Real>(&self, out: &Outputs<T>, window: &Window) -> Vec<T> {
        let v_x = &self.recording.runs[window.segment].v_x_mps[window.from..];
        let n = out.v_y_mps.len();
        (0..n)
            .map(|k| {
                let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
                let slope = (out.v_y_mps[b] - out.v_y_mps[a]) / ((b - a).max(1) as f64 * out.dt_s);
                slope + out.yaw_rate_radps[k] * v_x[k]
            })
            .collect()
    }

    /// The motion over a window, as recorded by its sensors.
    pub fn predict<T: Real>(&self, p: &[T], start: [T; 2], window: &Window) -> Outputs<T> {
        self.predict_pushed(p, start, [T::from(0.0); 2], window)
    }

    /// The same with accelerations of v_y and yaw rate added throughout.
    pub fn predict_pushed<T: Real>(
        &self,
        p: &[T],
        start: [T; 2],
        push: [T; 2],
        window: &Window,
    ) -> Outputs<T> {
        let tires = OwnTires::from_parameters(&p[..TIRES]);
        let mut car = Car::nominal(self.vehicle, [tires.front.d, tires.rear.d]);
        for (effect, values) in self.with_parameters(p) {
            effect.car(values, &mut car);
        }
        let wheels = RoadWheels::of(self, p, window);
        let mut outputs = Mover::new(self, p, &car, tires, &wheels, window).run(start, push);
        self.sense(p, car.cog_shift_m, &mut outputs);
        outputs
    }

    /// From the motion of the centre of gravity, which lies `shift_m` ahead of the nominal one, to the recorded signals.
    pub(crate) fn sense<T: Real>(&self, p: &[T], shift_m: T, outputs: &mut Outputs<T>) {
        for k in 0..outputs.v_y_mps.len() {
            let (r, acceleration) = (outputs.yaw_rate_radps[k], outputs.yaw_acceleration_radps2[k]);
            outputs.v_y_mps[k] -= shift_m * r;
            outputs.a_y_mps2[k] -= shift_m * acceleration;
            outputs.a_x_mps2[k] += shift_m * r * r;
        }
        for (effect, values) in self.with_parameters(p) {
            effect.sense(values, outputs);
        }
        if let Some(flexible) = &self.flexible {
            flexible.sense(self.flexible_parameters(p), outputs);
        }
    }
}

impl Rollout for ExtendedModel<'_> {
    fn channels(&self) -> usize {
        self.recording.channels.len()
    }

    fn rollout<T: Real>(&self, parameters: &[T], start: [T; 2], window: &Window, out: &mut Vec<T>) {
        let outputs = self.predict(parameters, start, window);
        self.flatten(&outputs, window, out);
    }

    fn measured(&self, window: &Window, out: &mut Vec<f64>) {
        out.clear();
        let run = &self.recording.runs[window.segment];
        let range = window.from..window.from + window.len;
        let channels = &self.recording.channels;
        let means: Vec<f64> = channels
            .iter()
            .zip(&run.measured)
            .map(|(c, v)| {
                if c.without_mean() { v[range.clone()].iter().sum::<f64>() / window.len as f64 } else { 0.0 }
            })
            .collect();
        let asked = |c: &Channel, k: usize| *c != Channel::LongitudinalAcceleration || !run.jumps[k];
        for k in range {
            let of = channels.iter().zip(&run.measured).zip(&means);
            out.extend(of.map(|((c, v), m)| if asked(c, k) { v[k] - m } else { f64::NAN }));
        }
    }

    fn start_guess(&self, window: &Window) -> [f64; 2] {
        let run = &self.recording.runs[window.segment];
        // The first few samples, as a line to the start: less noise than the first alone.
        let count = 7.min(window.len);
        let line = |c: usize| {
            let y = &run.measured[c][window.from..window.from + count];
            let middle = (count - 1) as f64 / 2.0;
            let mean = y.iter().sum::<f64>() / count as f64;
            let square: f64 = (0..count).map(|i| (i as f64 - middle).powi(2)).sum();
            let slope: f64 = y.iter().enumerate().map(|(i, v)| (i as f64 - middle) * v).sum::<f64>();
            mean - middle * slope / square.max(1e-9)
        };
        [line(0), line(1)]
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use gripsight_signals::StateSequence;
    use gripsight_vehicle::{GRAVITY_MPS2, Input, SingleTrack, State};

    pub(crate) fn recording(seconds: usize) -> Recording {
        let n = 100 * seconds;
        let at = |f: &dyn Fn(f32) -> f32| (0..n).map(|k| f(k as f32 * 0.01)).collect::<Vec<f32>>();
        let noise = |k: usize, size: f32| size * (((k * 7919 + 13) % 1009) as f32 / 504.5 - 1.0);
        let sequence = StateSequence {
            time_s: at(&|t| t),
            v_x_mps: at(&|t| 5.0 + (0.7 * t).sin()),
            v_y_mps: (0..n).map(|k| noise(k, 0.02)).collect(),
            yaw_rate_radps: (0..n).map(|k| (k as f32 * 0.02).sin() + noise(k + 5, 0.01)).collect(),
            steering_rad: at(&|t| 0.15 * (5.0 * t).sin()),
            a_x_mps2: (0..n).map(|k| noise(k + 9, 0.1)).collect(),
            a_y_mps2: (0..n).map(|k| 5.0 * (k as f32 * 0.02).sin() + noise(k + 31, 0.1)).collect(),
            ..StateSequence::default()
        };
        Recording::new(&sequence).unwrap()
    }

    pub(crate) fn tires() -> OwnTires {
        OwnTires::from_parameters(&[10.5, 1.5, 1.0, 0.1, 10.64, 1.4, 0.95, -0.2])
    }

    #[test]
    fn a_recording_without_a_channel_is_the_same_in_the_others() {
        let whole = recording(12);
        let kept: Vec<Channel> = whole.channels.iter().copied().filter(|c| *c != Channel::YawRate).collect();
        let part = whole.with_channels(&kept);
        assert_eq!(part.channels, kept);
        assert!(kept.len() + 1 == whole.channels.len());
        for (c, channel) in part.channels.iter().enumerate() {
            let own = whole.channels.iter().position(|of| of == channel).unwrap();
            assert_eq!((part.sigma[c], part.weights[c]), (whole.sigma[own], whole.weights[own]));
            assert_eq!(part.runs[0].measured[c], whole.runs[0].measured[own]);
        }
    }

    #[test]
    fn null_values_leave_the_nominal_model() {
        let recording = recording(4);
        let vehicle = VehicleParameters::f1tenth();
        let window = Window { segment: 0, from: 120, len: 60 };
        let run = &recording.runs[0];
        let mut base = tires().to_parameters().to_vec();
        base.push(0.0);
        // The nominal model, stepped by its own crate, on the same tires as the fit sees them.
        let turned = VehicleParameters {
            yaw_inertia_kgm2: vehicle.yaw_inertia_kgm2 + crate::terms::wheels_kgm2(&vehicle),
            ..vehicle.clone()
        };
        let car = SingleTrack::new(&turned, &OwnTires::from_parameters(&base).assumed_effective());
        let input = |k: usize| Input { v_x_mps: run.v_x_mps[k], steering_rad: run.steering_rad[k] };
        let mut x = State { v_y_mps: 0.05, yaw_rate_radps: 0.4 };
        let mut expected = vec![[x.v_y_mps, x.yaw_rate_radps]];
        for k in window.from..window.from + window.len - 1 {
            x = car.step(x, &input(k), &input(k + 1), run.dt_s, 0.0025);
            expected.push([x.v_y_mps, x.yaw_rate_radps]);
        }
        let check = |effects: &[EffectId]| {
            let model = ExtendedModel::new(&recording, &vehicle, effects, 0.0025);
            let mut p = base.clone();
            p.extend(effects.iter().flat_map(|e| e.spec().parameters.iter().map(|s| s.null)));
            let out = model.predict(&p, [0.05, 0.4], &window);
            for (k, e) in expected.iter().enumerate() {
                approx::assert_relative_eq!(out.v_y_mps[k], e[0], max_relative = 1e-12, epsilon = 1e-14);
                approx::assert_relative_eq!(
                    out.yaw_rate_radps[k],
                    e[1],
                    max_relative = 1e-12,
                    epsilon = 1e-14
                );
            }
            (out.v_y_mps, out.yaw_rate_radps, out.a_y_mps2, out.heading_rad)
        };
        // Among themselves the models agree to the last bit, one effect at a time and all together.
        let plain = check(&[]);
        for &effect in EffectId::ALL {
            assert_eq!(check(&[effect]), plain, "{}", effect.name());
        }
        assert_eq!(check(EffectId::ALL), plain);
    }

    #[test]
    fn every_effect_shows_where_its_signals_are() {
        // Some effects show only against a longitudinal command.
        let recording = Recording { has_command: true, ..recording(4) };
        let vehicle = VehicleParameters::f1tenth();
        let window = Window { segment: 0, from: 120, len: 60 };
        let mut base = tires().to_parameters().to_vec();
        base.push(0.0);
        let run = |effects: &[EffectId], size: f64| {
            let model = ExtendedModel::new(&recording, &vehicle, effects, 0.0025);
            let mut p = base.clone();
            for effect in effects {
                p.extend(effect.spec().parameters.iter().map(|s| s.null + size * s.size[0]));
            }
            let out = model.predict(&p, [0.05, 0.4], &window);
            [out.v_y_mps, out.yaw_rate_radps, out.a_y_mps2, out.a_x_mps2, out.v_x_mps]
        };
        let plain = run(&[], 0.0);
        // Without a lap there is no patch.
        for &effect in EffectId::ALL.iter().filter(|e| **e != EffectId::LowGripPatch) {
            assert!(run(&[effect], 5.0) != plain, "{}", effect.name());
        }
    }

    #[test]
    fn the_force_follows_a_command_as_wheels_take_on_slip_and_an_acceleration_stands_for_itself() {
        let vehicle = VehicleParameters::f1tenth();
        let window = Window { segment: 0, from: 120, len: 12 };
        let mut p = tires().to_parameters().to_vec();
        p.push(0.0);
        const JUMP: usize = 123;
        // What a jump of the force by 1 m/s2 at a sample does to speed and acceleration. Wheels that spin up hold back on the way.
        let answer = |has_command: bool, from: usize| {
            let run = |more_mps2: f64| {
                let mut recording = Recording { has_command, ..recording(4) };
                let run = &mut recording.runs[0];
                run.steering_rad.fill(0.0);
                run.force_x_mps2[from..].iter_mut().for_each(|force| *force += more_mps2);
                let out =
                    ExtendedModel::new(&recording, &vehicle, &[], 0.0025).predict(&p, [0.0; 2], &window);
                (out, crate::longitudinal_force::slip_time_s(recording.runs[0].v_x_mps[JUMP]))
            };
            let ((plain, _), (out, lag_s)) = (run(0.0), run(1.0));
            let less = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a - b).collect::<Vec<f64>>();
            (less(&out.a_x_mps2, &plain.a_x_mps2), less(&out.v_x_mps, &plain.v_x_mps), lag_s)
        };
        let (a_x_mps2, v_x_mps, lag_s) = answer(true, JUMP);
        assert!(lag_s > 1e-3, "{lag_s}");
        let dt_s = recording(4).runs[0].dt_s;
        for (k, (a_x, v_x)) in a_x_mps2.iter().zip(&v_x_mps).enumerate() {
            let since_s = (k as f64 - (JUMP - window.from) as f64).max(0.0) * dt_s;
            let left = (-since_s / lag_s).exp();
            approx::assert_abs_diff_eq!(*a_x, 1.0 - left, epsilon = 1e-4);
            approx::assert_abs_diff_eq!(*v_x, since_s - lag_s * (1.0 - left), epsilon = 1e-4 * dt_s);
        }
        // Of a jump before the window it is told, too.
        let (a_x_mps2, _, _) = answer(true, window.from - 1);
        approx::assert_abs_diff_eq!(a_x_mps2[0], 1.0 - (-dt_s / lag_s).exp(), epsilon = 1e-4);
        let (a_x_mps2, ..) = answer(false, JUMP);
        assert!(a_x_mps2.iter().all(|a| *a == 0.0), "{a_x_mps2:?}");
    }

    #[test]
    fn what_pushes_along_the_road_turns_the_wheels_too_and_a_command_has_that_in_it() {
        const TURNED: f64 = 1.06;
        let vehicle = VehicleParameters::f1tenth();
        let window = Window { segment: 0, from: 120, len: 2 };
        let a_x_mps2 = |effects: &[EffectId], own: &[f64], more_mps2: f64| {
            let mut recording = Recording { has_command: true, ..recording(4) };
            recording.runs[0].force_x_mps2.iter_mut().for_each(|force| *force += more_mps2);
            let model = ExtendedModel::new(&recording, &vehicle, effects, 0.0025);
            let mut p = tires().to_parameters().to_vec();
            p.push(0.0);
            p.extend(own);
            model.predict(&p, [0.05, 0.4], &window).a_x_mps2[0]
        };
        let plain = a_x_mps2(&[], &[], 0.0);
        let more = |effect, own: &[f64]| a_x_mps2(&[effect], own, 0.0) - plain;
        approx::assert_relative_eq!(a_x_mps2(&[], &[], 1.0) - plain, 1.0, epsilon = 1e-9);
        let resistance = more(EffectId::RollingResistance, &[0.03]);
        approx::assert_relative_eq!(resistance, -0.03 * GRAVITY_MPS2 / TURNED, epsilon = 1e-9);
        // An accelerometer on a slope feels what holds the wheels back.
        let slope = more(EffectId::RoadSlope, &[0.05, 0.0, 0.0]);
        approx::assert_relative_eq!(
            slope,
            GRAVITY_MPS2 * 0.05_f64.sin() * (1.0 - 1.0 / TURNED),
            epsilon = 1e-9
        );
        // A mass that the file does not know makes the same command do less; the wheels are as they were.
        let mass =
            a_x_mps2(&[EffectId::MassError], &[1.1], 1.0) - a_x_mps2(&[EffectId::MassError], &[1.1], 0.0);
        approx::assert_relative_eq!(mass, TURNED / 1.16, epsilon = 1e-9);
    }
}
