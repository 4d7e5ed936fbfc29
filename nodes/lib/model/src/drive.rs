//! The car driven step by step, as whoever simulates it does: nothing of what comes is known.
//!
//! The equations, and the code, are those of [`ExtendedModel::predict`](crate::ExtendedModel::predict): over the same inputs both give the same
//! motion. What a step adds is a past of its own (wheels behind their command, slip behind its angle, sensors behind the car).

use gripsight_vehicle::{OwnTires, VehicleParameters};

use crate::effects::{EffectId, Wheels};
use crate::model::{BASE, ExtendedModel, TIRES};
use crate::motion::{Mover, Moving};
use crate::recording::{Recording, Run};
use crate::road_wheels::RoadWheels;
use crate::rollout::Window;
use crate::station::Laps;
use crate::terms::{Car, Outputs};

/// Time that a jump of the inputs takes.
const JUMP_S: f64 = 1e-6;
/// Inputs that are further apart have jumped.
const SAME: f64 = 1e-12;
/// What sensors behind a filter or a delay can remember.
const SENSED_S: f64 = 2.0;
/// The two samples of a step.
const STEP: Window = Window { segment: 0, from: 0, len: 2 };

/// What acts on the car from the start of a step on.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Controls {
    /// Steering as commanded or recorded, left positive.
    pub steering_rad: f64,
    /// How fast it changes during the step.
    pub steering_rate_radps: f64,
    /// Forward speed and longitudinal acceleration where they are imposed; `None`: the car's own, which the force drives.
    pub along: Option<Along>,
    /// Commanded longitudinal force over the nominal mass.
    pub force_x_mps2: f64,
    /// Distance along the lap over its length, on a [`DrivenCar`] that is on a course.
    pub lap_share: f64,
}

/// The motion along the car, imposed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Along {
    /// Forward speed as the car reports it.
    pub v_x_mps: f64,
    /// How fast it changes during the step.
    pub v_x_rate_mps2: f64,
    /// Longitudinal acceleration (specific force).
    pub a_x_mps2: f64,
    /// How fast it changes during the step.
    pub a_x_rate_mps3: f64,
}

/// Where the car is and how it moves, and what its sensors say of it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Driven {
    /// Position of the centre of gravity, forward at the start.
    pub x_m: f64,
    /// Position, left at the start.
    pub y_m: f64,
    /// Heading, left positive, 0 at the start.
    pub yaw_rad: f64,
    /// Forward speed of the centre of gravity.
    pub v_x_mps: f64,
    /// Lateral velocity of the centre of gravity.
    pub v_y_mps: f64,
    /// Yaw rate.
    pub yaw_rate_radps: f64,
    /// Yaw acceleration.
    pub yaw_acceleration_radps2: f64,
    /// Lateral acceleration of the centre of gravity (specific force).
    pub a_y_mps2: f64,
    /// Angle of the road wheels.
    pub wheel_rad: f64,
    /// Forward speed as reported.
    pub sensed_v_x_mps: f64,
    /// Lateral velocity as reported.
    pub sensed_v_y_mps: f64,
    /// Yaw rate as reported.
    pub sensed_yaw_rate_radps: f64,
    /// Lateral specific force as reported.
    pub sensed_a_y_mps2: f64,
    /// Longitudinal specific force as reported.
    pub sensed_a_x_mps2: f64,
}

/// What is driven.
#[derive(Debug, Clone, PartialEq)]
pub struct DrivenCar {
    /// The car as the file states it.
    pub vehicle: VehicleParameters,
    /// Its own tires.
    pub tires: OwnTires,
    /// Its effects with their parameters.
    pub effects: Vec<(EffectId, Vec<f64>)>,
    /// Longest step of the integration.
    pub substep_s: f64,
    /// Whether the imposed longitudinal motion comes of a known [`Controls::force_x_mps2`]; else the acceleration stands in for the force.
    pub force_known: bool,
    /// Whether [`Controls::lap_share`] says where on a course the car is; else the heading stands in for it.
    pub on_course: bool,
}

/// A car on its way, step by step.
#[derive(Debug, Clone)]
pub struct Drive {
    driven: DrivenCar,
    effects: Vec<EffectId>,
    parameters: Vec<f64>,
    car: Car<f64>,
    /// One run of two samples: the step.
    recording: Recording,
    wheels: Vec<Wheels<f64>>,
    /// Inputs, wheels and motion where the last step ended.
    inputs: Inputs,
    wheel_rad: f64,
    moving: Moving<f64>,
    /// Own forward speed, whatever is reported.
    v_x_mps: f64,
    time_s: f64,
    position_m: [f64; 2],
    past: Outputs<f64>,
    sensed: Driven,
}

/// The inputs of an instant.
#[derive(Debug, Clone, Copy)]
struct Inputs {
    steering_rad: f64,
    v_x_mps: f64,
    a_x_mps2: f64,
    force_x_mps2: f64,
    lap_share: f64,
}

impl Inputs {
    /// Whether what is followed in lines goes on where it was.
    fn goes_on_from(&self, last: &Self) -> bool {
        let apart = [
            self.steering_rad - last.steering_rad,
            self.v_x_mps - last.v_x_mps,
            self.a_x_mps2 - last.a_x_mps2,
        ];
        apart.iter().all(|a| a.abs() <= SAME)
    }
}

impl Drive {
    /// The car at its start: moving with v_x, v_y (m/s) and a yaw rate (rad/s), settled as if it had gone on so.
    #[must_use]
    pub fn begin(
        driven: &DrivenCar,
        [v_x_mps, v_y_mps, yaw_rate_radps]: [f64; 3],
        controls: &Controls,
    ) -> Self {
        let mut parameters = driven.tires.to_parameters().to_vec();
        parameters.resize(BASE, 0.0);
        parameters.extend(driven.effects.iter().flat_map(|(_, own)| own));
        let mut car = Car::nominal(&driven.vehicle, [driven.tires.front.d, driven.tires.rear.d]);
        driven.effects.iter().for_each(|(effect, own)| effect.car(own, &mut car));
        let has_command = driven.force_known || controls.along.is_none();
        let along =
            controls.along.unwrap_or(Along { v_x_mps: v_x_mps / car.speed_factor, ..Along::default() });
        let inputs = Inputs {
            steering_rad: controls.steering_rad,
            v_x_mps: along.v_x_mps,
            a_x_mps2: along.a_x_mps2,
            force_x_mps2: if has_command { controls.force_x_mps2 } else { along.a_x_mps2 },
            lap_share: controls.lap_share,
        };
        let mut drive = Self {
            driven: driven.clone(),
            effects: driven.effects.iter().map(|(effect, _)| *effect).collect(),
            parameters,
            car,
            recording: step_of(driven.on_course, has_command, [v_y_mps, yaw_rate_radps]),
            wheels: vec![Wheels::default(); driven.effects.len()],
            inputs,
            wheel_rad: 0.0,
            moving: Moving::still(),
            v_x_mps: along.v_x_mps * car.speed_factor,
            time_s: 0.0,
            position_m: [0.0; 2],
            past: Outputs::of(driven.substep_s, 0),
            sensed: Driven::default(),
        };
        drive.wheel_rad = drive.follow(inputs.steering_rad, JUMP_S);
        drive.set_step(inputs, inputs, driven.substep_s);
        let wheels = RoadWheels::line(drive.wheel_rad, drive.wheel_rad);
        drive.moving = drive.with_mover(&wheels, |mover| mover.begin([v_y_mps, yaw_rate_radps], [0.0; 2]));
        drive.sense(driven.substep_s);
        drive
    }

    /// A step, and what is seen at its end. All steps of a drive have one length where sensors are behind a delay or a filter.
    pub fn step(&mut self, controls: &Controls, dt_s: f64) -> Driven {
        let (from, to) = self.inputs_of(controls, dt_s);
        if !from.goes_on_from(&self.inputs) {
            // Only the accelerations and the wheels jump with them.
            let before = self.moving;
            self.advance(self.inputs, from, JUMP_S);
            self.moving = Moving { rates: self.moving.rates, ..before };
        }
        let before = self.moving;
        self.advance(from, to, dt_s);
        let turned_rad = self.moving.heading_rad - before.heading_rad;
        let v_y_mps = 0.5 * (before.x[0] + self.moving.x[0]);
        let speed_before_mps = self.v_x_mps;
        self.v_x_mps = if controls.along.is_some() {
            to.v_x_mps * self.car.speed_factor
        } else {
            (self.v_x_mps + self.moving.speed_mps - before.speed_mps).max(0.0)
        };
        let v_x_mps = 0.5 * (speed_before_mps + self.v_x_mps);
        let (sin, cos) = (before.heading_rad + 0.5 * turned_rad).sin_cos();
        self.position_m[0] += (v_x_mps * cos - v_y_mps * sin) * dt_s;
        self.position_m[1] += (v_x_mps * sin + v_y_mps * cos) * dt_s;
        self.time_s += dt_s;
        self.inputs = to;
        self.sense(dt_s);
        self.now()
    }

    /// What is seen now.
    #[must_use]
    pub fn now(&self) -> Driven {
        self.sensed
    }

    /// The inputs at the step's start and end.
    fn inputs_of(&self, controls: &Controls, dt_s: f64) -> (Inputs, Inputs) {
        let factor = self.car.speed_factor;
        let rates = &self.moving.rates;
        let along = controls.along.unwrap_or(Along {
            v_x_mps: self.v_x_mps / factor,
            v_x_rate_mps2: rates.v_x_mps2.max(-self.v_x_mps / dt_s) / factor,
            a_x_mps2: rates.a_x_mps2,
            a_x_rate_mps3: 0.0,
        });
        let known = self.recording.has_command;
        let at = |since_s: f64| Inputs {
            steering_rad: controls.steering_rad + controls.steering_rate_radps * since_s,
            v_x_mps: along.v_x_mps + along.v_x_rate_mps2 * since_s,
            a_x_mps2: along.a_x_mps2 + along.a_x_rate_mps3 * since_s,
            force_x_mps2: if known { controls.force_x_mps2 } else { along.a_x_mps2 },
            lap_share: controls.lap_share,
        };
        (at(0.0), at(dt_s))
    }

    /// The wheels behind the steering, `dt_s` on.
    fn follow(&mut self, steering_rad: f64, dt_s: f64) -> f64 {
        let effects = self.driven.effects.iter().zip(&mut self.wheels);
        effects.fold(steering_rad, |angle, ((effect, own), wheels)| effect.follow(own, wheels, angle, dt_s))
    }

    fn set_step(&mut self, from: Inputs, to: Inputs, dt_s: f64) {
        let place = |share: f64| std::f64::consts::TAU * share;
        let heading_rad = self.moving.heading_rad;
        let on_course = self.driven.on_course;
        let run = &mut self.recording.runs[0];
        (run.start_time_s, run.dt_s) = (self.time_s, dt_s);
        for (k, at) in [from, to].iter().enumerate() {
            run.v_x_mps[k] = at.v_x_mps;
            run.a_x_mps2[k] = at.a_x_mps2;
            run.recorded_a_x_mps2[k] = at.a_x_mps2;
            run.force_x_mps2[k] = at.force_x_mps2;
            run.lap_share[k] = at.lap_share;
            run.place_rad[k] = if on_course { place(at.lap_share) } else { heading_rad };
        }
    }

    fn advance(&mut self, from: Inputs, to: Inputs, dt_s: f64) {
        let wheel_rad = self.follow(to.steering_rad, dt_s);
        let wheels = RoadWheels::line(self.wheel_rad, wheel_rad);
        self.set_step(from, to, dt_s);
        let mut moving = self.moving;
        self.with_mover(&wheels, |mover| mover.advance(0, &mut moving, [0.0; 2]));
        self.moving = moving;
        self.wheel_rad = wheel_rad;
    }

    fn with_mover<R>(&self, wheels: &RoadWheels<f64>, then: impl FnOnce(&Mover<'_, '_, f64>) -> R) -> R {
        let tires = OwnTires::from_parameters(&self.parameters[..TIRES]);
        let model = self.model();
        then(&Mover::new(&model, &self.parameters, &self.car, tires, wheels, &STEP))
    }

    fn model(&self) -> ExtendedModel<'_> {
        ExtendedModel::new(&self.recording, &self.driven.vehicle, &self.effects, self.driven.substep_s)
    }

    fn sense(&mut self, dt_s: f64) {
        let Moving { x: [v_y_mps, yaw_rate_radps], speed_mps, heading_rad, rates, .. } = self.moving;
        let most = (SENSED_S / dt_s).ceil().max(2.0) as usize;
        self.past.dt_s = dt_s;
        let newest = [
            (&mut self.past.v_y_mps, v_y_mps),
            (&mut self.past.yaw_rate_radps, yaw_rate_radps),
            (&mut self.past.yaw_acceleration_radps2, rates.yaw_radps2),
            (&mut self.past.a_y_mps2, rates.a_y_mps2),
            (&mut self.past.a_x_mps2, rates.a_x_mps2),
            (&mut self.past.v_x_mps, speed_mps),
            (&mut self.past.heading_rad, heading_rad),
        ];
        for (series, value) in newest {
            series.push(value);
            // Now and then, so that a step costs the same however long the drive is.
            if series.len() > 2 * most {
                series.drain(..series.len() - most);
            }
        }
        let mut sensed = self.past.clone();
        self.model().sense(&self.parameters, self.car.cog_shift_m, &mut sensed);
        let last = |series: &[f64]| series.last().copied().unwrap_or(f64::NAN);
        self.sensed = Driven {
            x_m: self.position_m[0],
            y_m: self.position_m[1],
            yaw_rad: heading_rad,
            v_x_mps: self.v_x_mps,
            v_y_mps,
            yaw_rate_radps,
            yaw_acceleration_radps2: rates.yaw_radps2,
            a_y_mps2: rates.a_y_mps2,
            wheel_rad: self.wheel_rad,
            sensed_v_x_mps: self.v_x_mps / self.car.speed_factor,
            sensed_v_y_mps: last(&sensed.v_y_mps),
            sensed_yaw_rate_radps: last(&sensed.yaw_rate_radps),
            sensed_a_y_mps2: last(&sensed.a_y_mps2),
            sensed_a_x_mps2: last(&sensed.a_x_mps2),
        };
    }
}

/// A recording of one step, empty yet.
fn step_of(on_course: bool, has_command: bool, smooth: [f64; 2]) -> Recording {
    let two = || vec![0.0; 2];
    Recording {
        runs: vec![Run {
            start_time_s: 0.0,
            dt_s: JUMP_S,
            v_x_mps: two(),
            steering_rad: two(),
            held_steering_rad: Vec::new(),
            a_x_mps2: two(),
            recorded_a_x_mps2: two(),
            force_x_mps2: two(),
            lap_share: two(),
            heading_rad: two(),
            place_rad: two(),
            smooth: smooth.map(|v| vec![v; 2]),
            measured: Vec::new(),
            jumps: Vec::new(),
        }],
        channels: Vec::new(),
        sigma: Vec::new(),
        weights: Vec::new(),
        laps: Laps::of_length(if on_course { 1.0 } else { 0.0 }),
        has_command,
        force_ahead: 0.0,
        derived_a_y: false,
        recorded_s: 0.0,
        least_speed_mps: 0.0,
        identities: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::tests::{recording, tires};

    /// A recorded drive's inputs, given step by step, against the model run over the whole of it.
    fn apart(effects: &[(EffectId, &[f64])]) -> f64 {
        const LEN: usize = 300;
        let mut recording = recording(4);
        let run = &mut recording.runs[0];
        // Nothing is known of what was before.
        run.steering_rad[1] = run.steering_rad[0];
        run.recorded_a_x_mps2.clone_from(&run.a_x_mps2);
        let run = run.clone();
        let driven = DrivenCar {
            vehicle: VehicleParameters::f1tenth(),
            tires: tires(),
            effects: effects.iter().map(|(e, own)| (*e, own.to_vec())).collect(),
            substep_s: 0.0025,
            force_known: false,
            on_course: false,
        };
        let ids: Vec<EffectId> = effects.iter().map(|e| e.0).collect();
        let mut p = tires().to_parameters().to_vec();
        p.push(0.0);
        p.extend(effects.iter().flat_map(|e| e.1));
        let window = Window { segment: 0, from: 0, len: LEN };
        let native =
            ExtendedModel::new(&recording, &driven.vehicle, &ids, 0.0025).predict(&p, [0.05, 0.4], &window);
        let controls = |k: usize| {
            let rate = |s: &[f64]| (s[k + 1] - s[k]) / run.dt_s;
            Controls {
                steering_rad: run.steering_rad[k],
                steering_rate_radps: rate(&run.steering_rad),
                along: Some(Along {
                    v_x_mps: run.v_x_mps[k],
                    v_x_rate_mps2: rate(&run.v_x_mps),
                    a_x_mps2: run.a_x_mps2[k],
                    a_x_rate_mps3: rate(&run.a_x_mps2),
                }),
                ..Controls::default()
            }
        };
        let mut drive = Drive::begin(&driven, [0.0, 0.05, 0.4], &controls(0));
        let mut most: f64 = 0.0;
        for k in 0..LEN - 1 {
            let now = drive.step(&controls(k), run.dt_s);
            let pairs = [
                (now.sensed_v_y_mps, native.v_y_mps[k + 1]),
                (now.sensed_yaw_rate_radps, native.yaw_rate_radps[k + 1]),
                (now.sensed_a_y_mps2, native.a_y_mps2[k + 1]),
            ];
            most = pairs
                .iter()
                .fold(most, |m, (a, b)| if (a - b).is_nan() { f64::NAN } else { m.max((a - b).abs()) });
        }
        most
    }

    #[test]
    fn step_by_step_is_the_rollout_with_any_effect() {
        assert!(apart(&[]) < 1e-9, "{}", apart(&[]));
        // A place needs a course.
        for effect in EffectId::ALL
            .iter()
            .filter(|e| !e.is_of_a_place() && e.name() != "road_bank" && e.name() != "road_slope")
        {
            let own: Vec<f64> = effect.spec().parameters.iter().map(|p| p.null + p.size[0]).collect();
            let off = apart(&[(*effect, &own)]);
            assert!(off < 1e-7, "{}: {off}", effect.name());
        }
        let all = apart(&[
            (EffectId::SteeringDelay, &[0.043]),
            (EffectId::SteeringLag, &[0.03, 0.2]),
            (EffectId::SteeringRateLimit, &[0.6]),
            (EffectId::SteeringBacklash, &[0.01]),
            (EffectId::TireRelaxation, &[0.1]),
            (EffectId::OdometryLowPass, &[0.05]),
        ]);
        assert!(all < 1e-7, "{all}");
    }

    #[test]
    fn a_held_command_is_there_at_once_and_the_force_drives_the_car() {
        let driven = DrivenCar {
            vehicle: VehicleParameters::f1tenth(),
            tires: tires(),
            effects: Vec::new(),
            substep_s: 0.001,
            force_known: true,
            on_course: false,
        };
        let straight = Controls { force_x_mps2: 2.0, ..Controls::default() };
        let mut drive = Drive::begin(&driven, [3.0, 0.0, 0.0], &straight);
        let mut now = drive.now();
        for _ in 0..100 {
            now = drive.step(&straight, 0.01);
        }
        approx::assert_relative_eq!(now.v_x_mps, 5.0, max_relative = 1e-9);
        approx::assert_relative_eq!(now.x_m, 4.0, max_relative = 1e-3);
        let left = Controls { steering_rad: 0.05, ..straight };
        // A step of a tenth of a millisecond: the front tires push at once.
        let turned = drive.clone().step(&left, 1e-4);
        approx::assert_relative_eq!(turned.wheel_rad, 0.05);
        assert!(turned.a_y_mps2 > 1.0 && turned.yaw_rate_radps > 0.0, "{turned:?}");
        for _ in 0..200 {
            now = drive.step(&Controls { force_x_mps2: -30.0, ..left }, 0.01);
        }
        assert!(
            now.v_x_mps == 0.0 && now.y_m > 0.0 && now.yaw_rad > 0.0 && now.yaw_rate_radps.is_finite(),
            "{now:?}"
        );
    }
}
