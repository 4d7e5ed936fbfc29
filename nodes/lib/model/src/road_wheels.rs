//! The angle of the road wheels: the recorded steering behind whatever lies between the two.
//!
//! A measured angle moves on between samples, in lines. A command jumps at its stamp and is held until the next: the wheels follow its mean over each step,
//! and only an instant at a sample sees the jump itself.

use gripsight_vehicle::Real;

use crate::effects::{EffectId, Wheels};
use crate::model::{ExtendedModel, HOLD};
use crate::recording::Run;
use crate::rollout::Window;
use crate::terms::delayed;

/// Time before a window from which the steering is followed.
const RUN_IN_S: f64 = 0.6;
/// How long after a jump of the command a sample sees what it does: as good as at once, beside any tire's relaxation.
const LOOK_S: f64 = 3e-4;

/// The share of a jump that has passed a lag of `lag_s` when a sample sees it. An exponential has no derivative at a lag of nothing, whence no fit would lead
/// away; the fraction that agrees with it for any lag of a tire has one.
pub(crate) fn at_once<T: Real>(lag_s: T) -> T {
    (lag_s / LOOK_S + 1.0).recip()
}

/// Road-wheel angles over a window and some time before it.
#[derive(Debug, Clone)]
pub(crate) struct RoadWheels<T> {
    /// At the samples; of a held command from each sample to the next, on average.
    course_rad: Vec<T>,
    is_held: bool,
    /// How many of them lie before the window.
    run_in: usize,
    /// What a sample of the window sees beyond the middle of the steps before and after it; empty of a measured angle.
    jumps_rad: Vec<f64>,
}

impl<T: Real> RoadWheels<T> {
    /// What a model with parameters `p` makes of the recorded steering.
    pub(crate) fn of(model: &ExtendedModel<'_>, p: &[T], window: &Window) -> Self {
        let run = &model.recording.runs[window.segment];
        let run_in = ((RUN_IN_S / run.dt_s).ceil() as usize).min(window.from);
        // One sample more than the window: delays interpolate with both neighbours.
        let range = window.from - run_in..(window.from + window.len + 1).min(run.len());
        let course: Vec<T> = run.steering_course_rad()[range].iter().map(|&u| T::from(u)).collect();
        let is_held = run.steering_is_held();
        let hold_s = if is_held { p[HOLD] - 0.5 * run.dt_s } else { p[HOLD] };
        let mut wheels =
            Self { course_rad: delayed(&course, hold_s, run.dt_s), is_held, run_in, jumps_rad: Vec::new() };
        if is_held {
            wheels.jumps_rad = wheels.jumps(model, p, run, window);
        }
        for (effect, own) in model.with_parameters(p) {
            let course = &mut wheels.course_rad;
            if is_held {
                effect.steer_held(own, course, run.dt_s);
            } else {
                effect.steer(own, course, run.dt_s);
            }
        }
        if let Some(flexible) = &model.flexible {
            let own = model.flexible_parameters(p);
            flexible.steer(own, run, window.from - run_in, &mut wheels.course_rad);
        }
        wheels
    }

    /// The wheels of one step in a line.
    pub(crate) fn line(from_rad: T, to_rad: T) -> Self {
        Self { course_rad: vec![from_rad, to_rad], is_held: false, run_in: 0, jumps_rad: Vec::new() }
    }

    /// What the samples of a window see of the command's jumps behind the model's effects; the course has none of these yet.
    fn jumps(&self, model: &ExtendedModel<'_>, p: &[T], run: &Run, window: &Window) -> Vec<f64> {
        let p: Vec<f64> = p.iter().map(Real::re).collect();
        // An effect that is absent is in the way of nothing.
        let present = |(effect, own): &(EffectId, &[f64])| own[0] != effect.spec().parameters[0].null;
        let effects: Vec<_> = model.with_parameters(&p).filter(present).collect();
        // What is handed on late and as it came jumps then.
        let (late, others): (Vec<_>, Vec<_>) =
            effects.into_iter().partition(|(effect, own)| effect.transport_s(own) > 0.0);
        let transport_s: f64 = late.iter().map(|(effect, own)| effect.transport_s(own)).sum();
        let course: Vec<f64> = self.course_rad.iter().map(Real::re).collect();
        let course_rad = if late.is_empty() { course } else { delayed(&course, transport_s, run.dt_s) };
        let handed_on = RoadWheels { course_rad, is_held: true, run_in: self.run_in, jumps_rad: Vec::new() };
        (0..window.len)
            .map(|k| {
                let command_rad = run.command_rad(window.from + k, transport_s);
                let jump_rad = command_rad - handed_on.at_sample_rad(self.run_in + k);
                others
                    .iter()
                    .fold(jump_rad, |jump_rad, (effect, own)| seen(*effect, own, jump_rad, 0.5 * run.dt_s))
            })
            .collect()
    }

    /// Samples before the window.
    pub(crate) fn run_in(&self) -> usize {
        self.run_in
    }

    /// At a sample, counted from the run-in's first.
    pub(crate) fn at_sample_rad(&self, i: usize) -> T {
        let course = &self.course_rad;
        let here = course[i.min(course.len() - 1)];
        if self.is_held { (course[i.saturating_sub(1)] + here) * 0.5 } else { here }
    }

    /// What the wheels of a held command are until they jump at a sample, counted from the run-in's first, and what from then on.
    pub(crate) fn around_jump_rad(&self, i: usize) -> [T; 2] {
        let at = |i: usize| self.course_rad[i.min(self.course_rad.len() - 1)];
        if self.is_held { [at(i.saturating_sub(1)), at(i)] } else { [self.at_sample_rad(i); 2] }
    }

    /// `share` of a step after sample `k` of the window; a jump at a sample is half made there.
    pub(crate) fn angle_rad(&self, k: usize, share: f64) -> T {
        let from = self.run_in + k;
        match share {
            0.0 => self.at_sample_rad(from),
            1.0 => self.at_sample_rad(from + 1),
            _ if self.is_held => self.course_rad[from],
            _ => {
                let [from, to] = [from, from + 1].map(|i| self.at_sample_rad(i));
                from + (to - from) * share
            }
        }
    }

    /// What an instant at a sample sees beyond that angle.
    pub(crate) fn jump_rad(&self, k: usize, share: f64) -> f64 {
        let at = |k: usize| self.jumps_rad.get(k).copied().unwrap_or(0.0);
        match share {
            0.0 => at(k),
            1.0 => at(k + 1),
            _ => 0.0,
        }
    }
}

/// What is left behind an effect of a jump, `since_s` after it.
fn seen(effect: EffectId, own: &[f64], jump_rad: f64, since_s: f64) -> f64 {
    let mut wheels = Wheels::default();
    let still_rad = effect.follow(own, &mut wheels, 0.0, since_s);
    effect.follow(own, &mut wheels, jump_rad, since_s) - still_rad
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drive::{Along, Controls, Drive, DrivenCar};
    use crate::model::tests::{recording, tires};
    use crate::recording::Recording;
    use gripsight_vehicle::VehicleParameters;

    const WINDOW: Window = Window { segment: 0, from: 100, len: 150 };
    /// Not a multiple of the samples' step: commands come between samples.
    const COMMAND_STEP_S: f64 = 0.023;

    fn command_rad(time_s: f64) -> f64 {
        0.15 * (5.0 * (time_s / COMMAND_STEP_S).floor() * COMMAND_STEP_S).sin()
    }

    /// The drive as it is recorded: commands held in between, or only the angle in force at the samples.
    fn recorded(held: bool) -> Recording {
        const FINE: usize = 1000;
        let mut recording = recording(4);
        let run = &mut recording.runs[0];
        let at = |k: usize, i: usize| command_rad((k as f64 + (i as f64 + 0.5) / FINE as f64) * 0.01);
        run.steering_rad = (0..run.len()).map(|k| command_rad(k as f64 * 0.01 + 1e-9)).collect();
        if held {
            let mean = |k| (0..FINE).map(|i| at(k, i)).sum::<f64>() / FINE as f64;
            run.held_steering_rad = (0..run.len()).map(mean).collect();
        }
        recording
    }

    /// How far a recording's rollout is off the car that was driven by the commands as they came: largest error of yaw rate over its largest value.
    fn off(held: bool, effects: &[(EffectId, &[f64])]) -> f64 {
        const STEPS: usize = 10;
        let recording = recorded(held);
        let run = &recording.runs[0];
        let vehicle = VehicleParameters::f1tenth();
        let driven = DrivenCar {
            vehicle: vehicle.clone(),
            tires: tires(),
            effects: effects.iter().map(|(e, own)| (*e, own.to_vec())).collect(),
            substep_s: 0.001,
            force_known: false,
            on_course: false,
        };
        let controls = |k: usize, i: usize| {
            let (share, dt_s) = (i as f64 / STEPS as f64, run.dt_s);
            let between = |s: &[f64]| s[k] + (s[k + 1] - s[k]) * share;
            let rate = |s: &[f64]| (s[k + 1] - s[k]) / dt_s;
            Controls {
                steering_rad: command_rad((k as f64 + share) * dt_s + 1e-9),
                along: Some(Along {
                    v_x_mps: between(&run.v_x_mps),
                    v_x_rate_mps2: rate(&run.v_x_mps),
                    a_x_mps2: between(&run.a_x_mps2),
                    a_x_rate_mps3: rate(&run.a_x_mps2),
                }),
                ..Controls::default()
            }
        };
        let mut drive = Drive::begin(&driven, [0.0; 3], &controls(0, 0));
        let mut now = Vec::new();
        for k in 0..WINDOW.from + WINDOW.len {
            now.push(drive.now());
            for i in 0..STEPS {
                drive.step(&controls(k, i), run.dt_s / STEPS as f64);
            }
        }
        let ids: Vec<EffectId> = effects.iter().map(|e| e.0).collect();
        let mut p = tires().to_parameters().to_vec();
        p.push(0.5 * run.dt_s);
        p.extend(effects.iter().flat_map(|e| e.1));
        let start = now[WINDOW.from];
        let out = ExtendedModel::new(&recording, &vehicle, &ids, 0.005).predict(
            &p,
            [start.v_y_mps, start.yaw_rate_radps],
            &WINDOW,
        );
        let now = &now[WINDOW.from..];
        let most = |f: &dyn Fn(usize) -> f64| (0..WINDOW.len).map(|k| f(k).abs()).fold(0.0, f64::max);
        most(&|k| out.yaw_rate_radps[k] - now[k].yaw_rate_radps) / most(&|k| now[k].yaw_rate_radps)
    }

    #[test]
    fn a_held_command_moves_the_car_as_it_came() {
        const EXACT: &[(EffectId, &[f64])] = &[
            (EffectId::SteeringLag, &[0.05, 0.25]),
            (EffectId::SteeringLag, &[0.005, 0.25]),
            (EffectId::SteeringDelay, &[0.043]),
            (EffectId::SteeringBacklash, &[0.01]),
            (EffectId::SteeringGain, &[0.2]),
            (EffectId::TireRelaxation, &[0.003]),
            (EffectId::TireRelaxation, &[0.01]),
        ];
        // A limited rate is followed in lines, which a jump within a step is not; tires that roll far forget a jump.
        const IN_LINES: &[(EffectId, &[f64])] =
            &[(EffectId::TireRelaxation, &[0.1]), (EffectId::SteeringRateLimit, &[2.0])];
        assert!(off(true, &[]) < 4e-4, "{}", off(true, &[]));
        for effect in EXACT {
            let (held, lines) = (off(true, &[*effect]), off(false, &[*effect]));
            assert!(held < 4e-4 && held < 0.3 * lines, "{effect:?}: {held}, interpolated {lines}");
        }
        for effect in IN_LINES {
            let (held, lines) = (off(true, &[*effect]), off(false, &[*effect]));
            assert!(held < 2e-3 && held < 1.05 * lines, "{effect:?}: {held}, interpolated {lines}");
        }
    }

    #[test]
    fn a_sample_sees_a_jump_before_the_tires_have_rolled_on_it() {
        const JUMP: usize = 50;
        let mut recording = recording(4);
        let run = &mut recording.runs[0];
        let command_rad = |k: usize| if k < WINDOW.from + JUMP { 0.0 } else { 0.05 };
        run.steering_rad = (0..run.len()).map(command_rad).collect();
        run.held_steering_rad = run.steering_rad.clone();
        let hold_s = 0.5 * run.dt_s;
        let vehicle = VehicleParameters::f1tenth();
        let a_y_mps2 = |effects: &[EffectId], own: &[f64]| {
            let mut p = tires().to_parameters().to_vec();
            p.push(hold_s);
            p.extend(own);
            ExtendedModel::new(&recording, &vehicle, effects, 0.005).predict(&p, [0.0; 2], &WINDOW).a_y_mps2
        };
        let at_once = a_y_mps2(&[], &[]);
        // Of a lag of 2 ms a sample sees next to nothing at the jump, all of it one step later.
        let relaxed = a_y_mps2(&[EffectId::TireRelaxation], &[0.002 * recording.runs[0].v_x_mps[0]]);
        let before_mps2 = at_once[JUMP - 1];
        let seen = |k: usize| (relaxed[k] - before_mps2) / (at_once[JUMP] - before_mps2);
        assert!(seen(JUMP - 1).abs() < 0.02 && seen(JUMP) < 0.2, "{} {}", seen(JUMP - 1), seen(JUMP));
        let later = relaxed[JUMP + 1] / at_once[JUMP + 1];
        assert!((later - 1.0).abs() < 0.02, "{later}");
    }

    #[test]
    fn a_step_has_its_mean_and_a_sample_the_jump() {
        let recording = recorded(true);
        let run = &recording.runs[0];
        let vehicle = VehicleParameters::f1tenth();
        let wheels = |effects: &[EffectId], own: &[f64], hold_s: f64| {
            let model = ExtendedModel::new(&recording, &vehicle, effects, 0.005);
            let mut p = tires().to_parameters().to_vec();
            p.push(hold_s);
            p.extend(own);
            RoadWheels::of(&model, &p, &WINDOW)
        };
        let jumps = |wheels: &RoadWheels<f64>| wheels.jumps_rad.iter().fold(0.0_f64, |m, j| m.max(j.abs()));
        let held = wheels(&[], &[], 0.5 * run.dt_s);
        for k in 0..WINDOW.len - 1 {
            let at = WINDOW.from + k;
            assert_eq!(held.angle_rad(k, 0.5), run.held_steering_rad[at]);
            let seen_rad = held.angle_rad(k, 0.0) + held.jump_rad(k, 0.0);
            approx::assert_relative_eq!(seen_rad, run.steering_rad[at], epsilon = 1e-12);
            approx::assert_relative_eq!(held.angle_rad(k, 1.0), held.angle_rad(k + 1, 0.0));
        }
        assert!(jumps(&held) > 0.005, "{}", jumps(&held));
        // Behind an actuator nothing is seen at once.
        assert!(jumps(&wheels(&[EffectId::SteeringLag], &[0.06, 0.25], 0.5 * run.dt_s)) < 1e-3);
        // What is handed on late jumps as it came.
        let late = wheels(&[EffectId::SteeringDelay], &[0.043], 0.5 * run.dt_s);
        for k in 0..WINDOW.len - 1 {
            let command_rad = command_rad((WINDOW.from + k) as f64 * run.dt_s - 0.043 + 1e-9);
            let seen_rad = late.angle_rad(k, 0.0) + late.jump_rad(k, 0.0);
            approx::assert_relative_eq!(seen_rad, command_rad, epsilon = 1e-6);
        }
        assert!(jumps(&late) > 0.005, "{}", jumps(&late));
        // A course that moves on between samples is half a step earlier.
        let moving = wheels(&[], &[], 0.0);
        for k in 0..WINDOW.len - 1 {
            let held = &run.held_steering_rad[WINDOW.from + k..];
            approx::assert_relative_eq!(moving.angle_rad(k, 0.5), 0.5 * (held[0] + held[1]), epsilon = 1e-12);
        }
    }
}
