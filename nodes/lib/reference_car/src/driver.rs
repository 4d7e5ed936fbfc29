//! Closed-loop drivers on a track and open-loop steering programs on a plane.

use std::f64::consts::TAU;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::car::{CarParameters, GRAVITY_MPS2};
use crate::profile::{Limits, SpeedProfile};
use crate::scenario::{Course, DriverKind, Scenario};
use crate::track::{Track, TrackPosition};

/// What a driver or another program asks of the car.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Command {
    /// Road-wheel angle.
    pub steering_rad: f64,
    /// Speed aimed at.
    pub speed_mps: f64,
    /// Longitudinal force over the nominal mass; without it the car's own controller holds the speed.
    pub acceleration_mps2: Option<f64>,
}

/// What a driver sees.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct View {
    pub(crate) time_s: f64,
    pub(crate) x_m: f64,
    pub(crate) y_m: f64,
    pub(crate) heading_rad: f64,
    pub(crate) v_x_mps: f64,
    pub(crate) v_y_mps: f64,
    pub(crate) yaw_rate_radps: f64,
    pub(crate) place: TrackPosition,
}

#[derive(Debug, Clone)]
enum Task {
    Follow { kind: DriverKind, profile: SpeedProfile },
    Circle { kind: DriverKind, from_mps: f64, to_mps: f64 },
    Ramp { speed_mps: f64, rate_radps: f64 },
    Step { speed_mps: f64, angle_rad: f64, rise_s: f64 },
    Sweep { speed_mps: f64, amplitude_rad: f64, from_hz: f64, to_hz: f64 },
}

/// A driver at work.
#[derive(Debug, Clone)]
pub(crate) struct Driver {
    task: Task,
    limits: Limits,
    wheelbase_m: f64,
    max_steering_rad: f64,
    understeer_rad_per_mps2: f64,
    l_f_m: f64,
    l_r_m: f64,
    peak_slip_rad: [f64; 2],
    duration_s: f64,
    dither_rad: f64,
    dither: [(f64, f64); 6],
}

/// Slip at the tire's peak over the slip at which the linear tire would reach the peak force.
const PEAK_SLIP: f64 = 2.5;
/// Speed controller's gain.
const SPEED_GAIN_1PS: f64 = 3.0;
/// When a manoeuvre's steering begins.
const MANOEUVRE_START_S: f64 = 1.0;

impl Driver {
    pub(crate) fn new(scenario: &Scenario, track: Option<&Track>) -> Self {
        let car = &scenario.car;
        let settings = scenario.driver;
        let trail_braking = settings.kind == DriverKind::Profile;
        let limits = Limits::new(car, scenario.friction.nominal(), settings.pace, trail_braking);
        let task = match (&scenario.course, track) {
            (Course::Track { .. }, Some(track)) => {
                Task::Follow { kind: settings.kind, profile: SpeedProfile::new(track, &limits) }
            }
            (Course::SteadyCircle { radius_m, .. }, _) => {
                let to_mps = (limits.lateral_mps2 * radius_m).sqrt();
                Task::Circle { kind: settings.kind, from_mps: 0.25 * to_mps, to_mps }
            }
            (Course::RampSteer { speed_mps, rate_radps }, _) => {
                Task::Ramp { speed_mps: *speed_mps, rate_radps: *rate_radps }
            }
            (Course::StepSteer { speed_mps, angle_rad, rise_s }, _) => {
                Task::Step { speed_mps: *speed_mps, angle_rad: *angle_rad, rise_s: *rise_s }
            }
            (Course::SineSweep { speed_mps, amplitude_rad, from_hz, to_hz }, _) => Task::Sweep {
                speed_mps: *speed_mps,
                amplitude_rad: *amplitude_rad,
                from_hz: *from_hz,
                to_hz: *to_hz,
            },
            (Course::Track { .. }, None) => Task::Ramp { speed_mps: 0.0, rate_radps: 0.0 },
        };
        let mut random = ChaCha8Rng::seed_from_u64(scenario.seed ^ 0x5eed_d217);
        let dither = std::array::from_fn(|i| {
            let hertz = 0.6 * 1.45_f64.powi(i as i32) * random.random_range(0.9..1.1);
            (hertz, random.random_range(0.0..TAU))
        });
        Self {
            task,
            limits,
            wheelbase_m: car.wheelbase_m(),
            max_steering_rad: car.max_steering_rad,
            understeer_rad_per_mps2: understeer(car),
            l_f_m: car.l_f_m,
            l_r_m: car.l_r_m,
            peak_slip_rad: [car.tire_front, car.tire_rear].map(|tire| {
                PEAK_SLIP * scenario.friction.nominal() * tire.grip / tire.cornering_stiffness_per_rad
            }),
            duration_s: scenario.duration_s,
            dither_rad: settings.dither_rad,
            dither,
        }
    }

    /// Speed at which the run begins.
    pub(crate) fn start_speed_mps(&self) -> f64 {
        match &self.task {
            Task::Follow { profile, .. } => profile.at(0.0).0,
            Task::Circle { from_mps, .. } => *from_mps,
            Task::Ramp { speed_mps, .. } | Task::Step { speed_mps, .. } | Task::Sweep { speed_mps, .. } => {
                *speed_mps
            }
        }
    }

    pub(crate) fn command(&self, view: &View, track: Option<&Track>) -> Command {
        let program = |angle_rad: f64, speed_mps: f64| self.finish(view, angle_rad, speed_mps, 0.0, 1.0);
        let since_s = (view.time_s - MANOEUVRE_START_S).max(0.0);
        match (&self.task, track) {
            (Task::Follow { kind, profile }, Some(track)) => {
                let (speed_mps, slope) = profile.at(view.place.station_m);
                let (steering_rad, room) = self.steer(*kind, view, track, speed_mps);
                self.finish(view, steering_rad, speed_mps * room, slope, room)
            }
            (Task::Circle { kind, from_mps, to_mps }, Some(track)) => {
                let speed_mps = from_mps + (to_mps - from_mps) * view.time_s / self.duration_s;
                let (steering_rad, room) = self.steer(*kind, view, track, speed_mps);
                self.finish(view, steering_rad, speed_mps, (to_mps - from_mps) / self.duration_s, room)
            }
            (Task::Ramp { speed_mps, rate_radps }, _) => program(rate_radps * since_s, *speed_mps),
            (Task::Step { speed_mps, angle_rad, rise_s }, _) => {
                let share =
                    if *rise_s > 0.0 { (since_s / rise_s).min(1.0) } else { f64::from(since_s > 0.0) };
                program(angle_rad * share, *speed_mps)
            }
            (Task::Sweep { speed_mps, amplitude_rad, from_hz, to_hz }, _) => {
                let span_s = (self.duration_s - MANOEUVRE_START_S).max(1e-3);
                let growth = (to_hz / from_hz).ln();
                let turns = if growth.abs() < 1e-9 {
                    from_hz * since_s
                } else {
                    from_hz * span_s / growth * ((growth * since_s / span_s).exp() - 1.0)
                };
                program(amplitude_rad * (TAU * turns).sin(), *speed_mps)
            }
            (Task::Follow { .. } | Task::Circle { .. }, None) => Command::default(),
        }
    }

    /// Pure pursuit, and for the profile driver what the slip angles need on top. Second: 1, less when the car slides.
    fn steer(&self, kind: DriverKind, view: &View, track: &Track, speed_mps: f64) -> (f64, f64) {
        let ahead_s = if kind == DriverKind::Profile { 0.28 } else { 0.4 };
        let ahead_m = (ahead_s * view.v_x_mps).max(1.5 * self.wheelbase_m);
        let aim = track.at(view.place.station_m + ahead_m);
        let (sin, cos) = view.heading_rad.sin_cos();
        let (dx, dy) = (aim.x_m - view.x_m, aim.y_m - view.y_m);
        let (along, across) = (cos * dx + sin * dy, cos * dy - sin * dx);
        let curvature = 2.0 * across / (along * along + across * across).max(1e-9);
        let mut steering_rad = (self.wheelbase_m * curvature).atan();
        if kind == DriverKind::Profile {
            let wanted = curvature * view.v_x_mps;
            let late = wanted - view.yaw_rate_radps;
            steering_rad += self.understeer_rad_per_mps2 * wanted * view.v_x_mps;
            steering_rad += 0.25 * self.wheelbase_m * late / view.v_x_mps.max(1.0);
            // More slip than the front tires' peak only scrubs.
            let front = (view.v_y_mps + self.l_f_m * view.yaw_rate_radps).atan2(view.v_x_mps.max(0.1));
            steering_rad = steering_rad.clamp(front - self.peak_slip_rad[0], front + self.peak_slip_rad[0]);
        }
        let wide = view.place.offset_m.abs() / track.half_width_m();
        let rear = (view.v_y_mps - self.l_r_m * view.yaw_rate_radps).atan2(view.v_x_mps.max(0.1)).abs();
        let sliding = 2.0 * (rear / self.peak_slip_rad[1] - 0.6).max(0.0) + (wide - 0.8).max(0.0) * 0.5;
        let fast = (view.v_x_mps / speed_mps.max(0.1) - 1.1).max(0.0);
        (steering_rad, (1.0 - sliding - fast).clamp(0.1, 1.0))
    }

    fn finish(&self, view: &View, steering_rad: f64, speed_mps: f64, slope_mps2: f64, room: f64) -> Command {
        let limits = &self.limits;
        let asked = slope_mps2 * room + SPEED_GAIN_1PS * (speed_mps - view.v_x_mps);
        let left = limits.left_beside(view.v_x_mps * view.yaw_rate_radps);
        let drive = limits.drive_mps2.min(limits.power_w_per_kg / view.v_x_mps.max(0.1));
        // Cornering alone slows the car: some drive must always be left.
        let most = drive * left.max(0.3) * room;
        let acceleration = asked.clamp(-limits.brake_mps2 * left.max(0.1) * room, most);
        let dither =
            self.dither.iter().map(|(hz, phase)| (TAU * hz * view.time_s + phase).sin()).sum::<f64>() / 2.0;
        let steering_rad = steering_rad + self.dither_rad * dither;
        Command {
            steering_rad: steering_rad.clamp(-self.max_steering_rad, self.max_steering_rad),
            speed_mps,
            acceleration_mps2: Some(acceleration),
        }
    }
}

/// Steering angle per lateral acceleration that the tires' stiffness asks for.
fn understeer(car: &CarParameters) -> f64 {
    (1.0 / car.tire_front.cornering_stiffness_per_rad - 1.0 / car.tire_rear.cornering_stiffness_per_rad)
        / GRAVITY_MPS2
}
