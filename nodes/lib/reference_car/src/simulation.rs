//! A run: the plant, its actuators, the road, the driver and the sensors, step by step.

use crate::camera::Exposure;
use crate::car::GRAVITY_MPS2;
use crate::driver::{Command, Driver, View};
use crate::error::{EndReason, ReferenceCarError};
use crate::mechanisms::Mechanisms;
use crate::motion::{Motion, TruthSample};
use crate::plant::Plant;
use crate::plant_state::{Actuation, Evaluation, PlantState, Surroundings};
use crate::road::Road;
use crate::samples::{DriveSample, SensorSample};
use crate::scenario::{Course, Scenario};
use crate::sensors::Sensors;
use crate::steering::Steering;
use crate::track::{Track, TrackPosition};

/// Roll angle behind which no car comes back.
const ROLLED_OVER_RAD: f64 = 0.9;

/// What a run recorded.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Reports of the sensors, by stamp.
    pub samples: Vec<SensorSample>,
    /// The truth at each odometry stamp.
    pub truth: Vec<TruthSample>,
    /// When and where the camera took pictures.
    pub exposures: Vec<Exposure>,
    /// How the run ended.
    pub end: EndReason,
}

/// A run that can be taken step by step or as a whole.
#[derive(Debug, Clone)]
pub struct Simulation {
    scenario: Scenario,
    mechanisms: Mechanisms,
    plant: Plant,
    state: PlantState,
    steering: Steering,
    road: Road,
    track: Option<Track>,
    place: TrackPosition,
    driver: Driver,
    sensors: Sensors,
    command: Command,
    force_n: f64,
    steps: u64,
    next_command: u64,
    before: Option<TruthSample>,
    at_rest_s: f64,
    samples: Vec<SensorSample>,
    truth: Vec<TruthSample>,
    truth_times: Vec<f64>,
    exposures: Vec<Exposure>,
    exposed: u64,
}

impl Simulation {
    /// A run of a scenario, at its start.
    ///
    /// # Errors
    /// The first part of the scenario that makes no sense.
    pub fn new(scenario: Scenario) -> Result<Self, ReferenceCarError> {
        scenario.validate()?;
        let mechanisms = scenario.mechanisms()?;
        let car = &scenario.car;
        let track = match &scenario.course {
            Course::Track { name, reversed } => Some(Track::by_name(name, car.track_scale, *reversed)?),
            Course::SteadyCircle { radius_m, reversed } => Some(Track::circle(*radius_m, *reversed)),
            _ => None,
        };
        let driver = Driver::new(&scenario, track.as_ref());
        let (x_m, y_m, heading_rad) =
            track.as_ref().map_or((0.0, 0.0, 0.0), |t| (t.at(0.0).x_m, t.at(0.0).y_m, t.at(0.0).heading_rad));
        let speed_mps = driver.start_speed_mps();
        let state = PlantState::rolling(x_m, y_m, heading_rad, speed_mps, car.drive.wheel_radius_m);
        Ok(Self {
            plant: Plant::new(car, &mechanisms, scenario.friction.nominal()),
            state,
            steering: Steering::new(mechanisms.steering, car.max_steering_rad, scenario.step_s),
            road: Road::new(&scenario, &mechanisms, track.as_ref().map(Track::length_m)),
            place: TrackPosition::default(),
            driver,
            sensors: Sensors::new(
                &scenario.sensors,
                mechanisms.sensors,
                -mechanisms.cog_shift_m,
                scenario.step_s,
                scenario.seed,
            ),
            track,
            command: Command::default(),
            force_n: 0.0,
            steps: 0,
            next_command: 0,
            before: None,
            at_rest_s: 0.0,
            samples: Vec::new(),
            truth: Vec::new(),
            truth_times: Vec::new(),
            exposures: Vec::new(),
            exposed: 0,
            mechanisms,
            scenario,
        })
    }

    /// Drives the whole scenario. `progress` is told the share done, about a hundred times.
    ///
    /// Standstill, reverse, spin, rollover, leaving the track and numbers that stop being finite end the run early; the
    /// recording holds everything up to that moment.
    pub fn run(mut self, mut progress: impl FnMut(f64)) -> Recording {
        let total = (self.scenario.duration_s / self.scenario.step_s).round() as u64;
        let mut end = EndReason::Completed;
        while self.steps <= total {
            if self.steps.is_multiple_of((total / 100).max(1)) {
                progress(self.steps as f64 / total as f64);
            }
            if let Err(reason) = self.drive() {
                end = reason;
                break;
            }
        }
        let exposures = self.drain_exposures();
        let (samples, truth) = self.drain();
        Recording { samples, truth, exposures, end }
    }

    /// One step with the scenario's own driver.
    ///
    /// # Errors
    /// The reason for which a run cannot go on.
    pub fn drive(&mut self) -> Result<(), EndReason> {
        if self.steps >= self.next_command {
            let rate_per_step = self.scenario.driver.rate_hz * self.scenario.step_s;
            self.next_command = self.steps + ((1.0 / rate_per_step).round() as u64).max(1);
            let command = self.driver.command(&self.view(), self.track.as_ref());
            self.command(command);
        }
        self.step()?;
        self.trouble().map_or(Ok(()), Err)
    }

    /// Time since the start of the run.
    pub fn time_s(&self) -> f64 {
        self.steps as f64 * self.scenario.step_s
    }

    /// The scenario of this run.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The track, where there is one.
    pub fn track(&self) -> Option<&Track> {
        self.track.as_ref()
    }

    /// The truth of the last step; none before the first.
    pub fn now(&self) -> Option<&TruthSample> {
        self.before.as_ref()
    }

    /// Peak friction and cornering stiffness (N/rad) of the front and of the rear axle at rest.
    pub fn axles_at_rest(&self) -> [(f64, f64); 2] {
        let mu = self.scenario.friction.nominal();
        [true, false]
            .map(|front| (self.plant.axle_peak(front, mu), self.plant.axle_stiffness_n_per_rad(front)))
    }

    /// Asks something else of the car from now on, and records it as the drive command.
    pub fn command(&mut self, command: Command) {
        let limit_rad = self.scenario.car.max_steering_rad;
        let steering_rad = if command.steering_rad.is_finite() { command.steering_rad } else { 0.0 };
        let speed_mps = if command.speed_mps.is_finite() { command.speed_mps } else { 0.0 };
        let asked = command.acceleration_mps2.filter(|a| a.is_finite());
        self.command = Command {
            steering_rad: steering_rad.clamp(-limit_rad, limit_rad),
            speed_mps,
            acceleration_mps2: asked.map(|a| self.feasible(a)),
        };
        let sample = DriveSample {
            stamp_s: self.time_s(),
            steering_rad: self.command.steering_rad,
            speed_mps,
            acceleration_mps2: self.acceleration(),
        };
        self.samples.extend(self.sensors.drive(sample));
    }

    /// The command in force.
    pub fn commanded(&self) -> Command {
        self.command
    }

    /// Puts this car where another one is, moving as that one does; actuators and sensors stay as they are.
    pub fn follow(&mut self, other: &Self) {
        self.state = other.state;
        self.place = other.place;
    }

    /// The road's friction from now on, everywhere and at once, as when rain sets in; patches keep their share.
    ///
    /// # Errors
    /// `InvalidParameter` for a friction that is not above zero.
    pub fn set_friction(&mut self, mu: f64) -> Result<(), ReferenceCarError> {
        self.road.set_friction(mu)
    }

    /// Puts the car into a motion where it is; actuators, springs and tires stay as they are, and wheels go on rolling with the slip they had.
    pub fn put(&mut self, v_x_mps: f64, v_y_mps: f64, yaw_rate_radps: f64) {
        let s = &mut self.state;
        let faster = v_x_mps / s.v_x_mps;
        if faster.is_finite() {
            s.wheel_radps.iter_mut().for_each(|w| *w *= faster);
        }
        (s.v_x_mps, s.v_y_mps, s.yaw_rate_radps) = (v_x_mps, v_y_mps, yaw_rate_radps);
    }

    /// Forward speed, lateral speed and yaw rate now.
    pub fn speeds(&self) -> [f64; 3] {
        [self.state.v_x_mps, self.state.v_y_mps, self.state.yaw_rate_radps]
    }

    /// Pushes the car: adds to its lateral speed and yaw rate at once.
    pub fn nudge(&mut self, v_y_mps: f64, yaw_rate_radps: f64) {
        self.state.v_y_mps += v_y_mps;
        self.state.yaw_rate_radps += yaw_rate_radps;
    }

    /// Takes what the sensors reported since the last call, by stamp, and the truth at the odometry's stamps.
    pub fn drain(&mut self) -> (Vec<SensorSample>, Vec<TruthSample>) {
        let mut samples = std::mem::take(&mut self.samples);
        samples.sort_by(|a, b| a.stamp_s().total_cmp(&b.stamp_s()));
        (samples, std::mem::take(&mut self.truth))
    }

    /// Takes the camera's exposures since the last call.
    pub fn drain_exposures(&mut self) -> Vec<Exposure> {
        std::mem::take(&mut self.exposures)
    }

    /// One step of the integration; the sensors report.
    ///
    /// # Errors
    /// `NotFinite` when the state stops being finite (the car then keeps its last finite state), `Rollover` when it lies on
    /// its side.
    pub fn step(&mut self) -> Result<(), EndReason> {
        let (dt_s, time_s) = (self.scenario.step_s, self.time_s());
        self.place = self.place_now();
        let around = self.surroundings(time_s);
        let (angle_rad, middle_rad) = self.steering.step(self.command.steering_rad);
        let before_n = self.force_n;
        self.actuate(dt_s);
        let now = Actuation { steering_rad: angle_rad, force_n: self.force_n };
        let e = self.plant.evaluate(&self.state, &now, &around);
        let middle = Actuation {
            steering_rad: middle_rad,
            force_n: if self.mechanisms.drive_lag_s > 0.0 {
                (before_n + self.force_n) / 2.0
            } else {
                self.force_n
            },
        };
        self.record(time_s, &e, &around);
        self.photograph(time_s);
        let next = self.plant.step(&self.state, &e, &middle, &around, dt_s);
        if !next.is_finite() {
            return Err(EndReason::NotFinite { time_s });
        }
        self.state = next;
        self.steps += 1;
        if next.roll_rad.abs() > ROLLED_OVER_RAD {
            return Err(EndReason::Rollover { time_s: self.time_s(), roll_rad: next.roll_rad });
        }
        Ok(())
    }

    fn record(&mut self, time_s: f64, e: &Evaluation, around: &Surroundings) {
        let reported =
            self.sensors.lateral_speed(self.state.v_y_mps, self.state.yaw_rate_radps, self.scenario.step_s);
        let motion = Motion::new(time_s, &self.state, e, reported);
        let road = (around.bank_rad, around.slope_rad);
        let truth = TruthSample::new(motion, e, around.friction, self.place, road, self.force_n);
        let before = self.before.unwrap_or(truth);
        self.sensors.sample(&before.motion, &truth.motion, &mut self.samples, &mut self.truth_times);
        self.truth.extend(self.truth_times.drain(..).map(|t| TruthSample::between(&before, &truth, t)));
        self.before = Some(truth);
    }

    /// Exposes at the first step that is not before the camera's next instant.
    fn photograph(&mut self, time_s: f64) {
        let rate_hz = self.scenario.sensors.camera_rate_hz;
        if rate_hz > 0.0 && time_s + 1e-9 >= self.exposed as f64 / rate_hz {
            self.exposed += 1;
            let position_m = self.place.station_m;
            let mu = self.road.seen(time_s, position_m);
            self.exposures.push(Exposure { stamp_s: time_s, position_m, mu });
        }
    }

    fn view(&self) -> View {
        let s = &self.state;
        View {
            time_s: self.time_s(),
            x_m: s.x_m,
            y_m: s.y_m,
            heading_rad: s.heading_rad,
            v_x_mps: s.v_x_mps,
            v_y_mps: s.v_y_mps,
            yaw_rate_radps: s.yaw_rate_radps,
            place: self.place_now(),
        }
    }

    fn place_now(&self) -> TrackPosition {
        match &self.track {
            Some(track) => track.project(self.state.x_m, self.state.y_m, self.place.station_m),
            None => TrackPosition {
                station_m: self.place.station_m + self.state.v_x_mps * self.scenario.step_s,
                offset_m: 0.0,
            },
        }
    }

    fn surroundings(&mut self, time_s: f64) -> Surroundings {
        let car = &self.scenario.car;
        let turn = match &self.track {
            Some(track) => self.state.heading_rad - track.at(self.place.station_m).heading_rad,
            None => 0.0,
        };
        self.road.at(time_s, self.place.station_m, turn, car, self.scenario.step_s)
    }

    /// The longitudinal acceleration in force: the command's, or the speed controller's.
    fn acceleration(&self) -> f64 {
        self.command.acceleration_mps2.unwrap_or_else(|| {
            let asked = 4.0 * (self.command.speed_mps - self.state.v_x_mps);
            self.feasible(asked)
        })
    }

    fn feasible(&self, acceleration_mps2: f64) -> f64 {
        let car = &self.scenario.car;
        let drive = &car.drive;
        let power = drive.power_w / (car.mass_kg * self.state.v_x_mps.abs().max(0.1));
        acceleration_mps2
            .clamp(-drive.brake_limit * GRAVITY_MPS2, power.min(drive.drive_limit * GRAVITY_MPS2))
    }

    fn actuate(&mut self, dt_s: f64) {
        let asked_n = self.acceleration() * self.scenario.car.mass_kg;
        let tau_s = self.mechanisms.drive_lag_s;
        let share = if tau_s > 0.0 { -(-dt_s / tau_s).exp_m1() } else { 1.0 };
        self.force_n += share * (asked_n - self.force_n);
    }

    /// A reason to end a scripted run.
    fn trouble(&mut self) -> Option<EndReason> {
        let s = &self.state;
        let time_s = self.time_s();
        let slow = self.scenario.car.low_speed_mps();
        let speed = s.v_x_mps.hypot(s.v_y_mps);
        let slip_rad = s.v_y_mps.atan2(s.v_x_mps);
        if speed > slow && slip_rad.abs() > 1.0 {
            return Some(EndReason::Spin { time_s, slip_rad });
        }
        if s.v_x_mps < -0.2 * slow {
            return Some(EndReason::Reverse { time_s, v_x_mps: s.v_x_mps });
        }
        self.at_rest_s = if speed < 0.2 * slow { self.at_rest_s + self.scenario.step_s } else { 0.0 };
        if self.at_rest_s > 0.5 {
            return Some(EndReason::Standstill { time_s });
        }
        let track = self.track.as_ref()?;
        let offset_m = self.place.offset_m;
        (offset_m.abs() > 2.0 * track.half_width_m()).then_some(EndReason::LeftTrack { time_s, offset_m })
    }
}
