//! The loop itself: plant, driver, referee and what is learnt, look by look.

use anyhow::{Context, Result};
use gripsight_driving::{CarState, Driver, Drivetrain, Limits, Settings, TireSet};
use gripsight_identification::FrictionPrior;
use gripsight_reference_car::{Command, Course, EffectSetting, SensorSample, Simulation};
use gripsight_vehicle::VehicleParameters;

use crate::effects::Recent;
use crate::learner::Learner;
use crate::plant;
use crate::referee::Referee;
use crate::run::Case;

/// Looks at the truth a second.
const LOOKS_HZ: u64 = 100;

/// A car being driven.
pub(crate) struct Loop {
    pub(crate) sim: Simulation,
    pub(crate) driver: Driver,
    pub(crate) referee: Referee,
    pub(crate) learner: Option<Learner>,
    /// Telemetry to diagnose from.
    pub(crate) recent: Option<Recent>,
    pub(crate) vehicle: VehicleParameters,
    /// Commands given, and the processor's time that they took.
    pub(crate) commands: u64,
    pub(crate) commands_s: f64,
    drivetrain: Drivetrain,
    steps: u64,
    halves: usize,
    verbose: bool,
}

/// The processor's time that this thread has taken: other programs do not count.
pub(crate) fn processor_s() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

impl Loop {
    /// At the line, rolling at a speed that any of these roads allows.
    pub(crate) fn new(case: &Case, start: TireSet, verbose: bool) -> Result<Self> {
        Self::paced(case, start, &[], Settings::default().share, verbose)
    }

    /// The same on a car with effects, with a share of the grip.
    pub(crate) fn paced(
        case: &Case,
        start: TireSet,
        effects: &[EffectSetting],
        share: f64,
        verbose: bool,
    ) -> Result<Self> {
        let reversed = case.seed % 2 == 1;
        let vehicle = plant::vehicle(&case.car)?;
        let drivetrain = plant::drivetrain(&case.car);
        let track = plant::track(&case.car, &case.track, reversed)?;
        let limits = Limits::new(&vehicle, &case.tires.tires, case.tires.grip(), &drivetrain);
        let driver = Driver::new(
            vehicle.clone(),
            drivetrain.clone(),
            track.clone(),
            start,
            Settings { share, controller: case.controller, ..Settings::default() },
        )?;
        let course = Course::Track { name: case.track.clone(), reversed };
        let mut scenario = plant::scenario(&case.car, course, case.mu, case.seed);
        scenario.driver.pace = (0.25 / case.mu).min(1.0);
        scenario.effects.extend(effects.iter().cloned());
        let sim = Simulation::new(scenario)?;
        let referee = Referee::new(track, &limits, sim.track().context("no track")?.half_width_m());
        Ok(Self {
            sim,
            driver,
            referee,
            learner: None,
            recent: None,
            vehicle,
            commands: 0,
            commands_s: 0.0,
            drivetrain,
            steps: 0,
            halves: 0,
            verbose,
        })
    }

    /// Identifies while it drives, and asks for what tells the most.
    pub(crate) fn learn(&mut self, prior: Option<FrictionPrior>) {
        self.learner = Some(Learner::new(self.vehicle.clone(), prior));
        self.driver.ask_for_turn_ins(true);
    }

    /// The road changes, everywhere and at once; `set`: the plant's tires on it.
    pub(crate) fn change_floor(&mut self, mu: f64, set: TireSet) -> Result<()> {
        self.sim.set_friction(mu)?;
        self.referee.floor(&Limits::new(&self.vehicle, &set.tires, set.grip(), &self.drivetrain));
        Ok(())
    }

    /// Drives until the next look; the reason for which the run cannot go on.
    pub(crate) fn look(&mut self) -> Result<Option<&'static str>> {
        for _ in 0..1000 / LOOKS_HZ {
            if self.sim.step().is_err() {
                return Ok(Some("rollover"));
            }
            self.steps += 1;
            for sample in self.sim.drain().0 {
                if let Some(recent) = &mut self.recent {
                    recent.push(&sample)?;
                }
                if let Some(learner) = &mut self.learner {
                    learner.push(&sample, &mut self.driver)?;
                }
                if let SensorSample::Odometry(s) = sample {
                    let state = CarState {
                        stamp_s: s.stamp_s,
                        x_m: s.x_m,
                        y_m: s.y_m,
                        heading_rad: s.heading_rad,
                        v_x_mps: s.v_x_mps,
                        v_y_mps: s.v_y_mps,
                        yaw_rate_radps: s.yaw_rate_radps,
                    };
                    let begin_s = processor_s();
                    let command = self.driver.command(&state, s.stamp_s);
                    self.commands_s += processor_s() - begin_s;
                    self.commands += 1;
                    self.sim.command(Command {
                        steering_rad: command.steering_rad,
                        speed_mps: command.speed_mps,
                        acceleration_mps2: Some(command.acceleration_mps2),
                    });
                }
            }
        }
        let Some(now) = self.sim.now() else { return Ok(None) };
        self.referee.promised(now, self.learner.as_ref().and_then(|learner| learner.promised));
        if let Some(reason) = self.referee.look(now, &self.driver) {
            return Ok(Some(reason));
        }
        let half = self.driver.halves() > self.halves;
        if let Some(learner) = &mut self.learner
            && (learner.is_due() || half)
        {
            learner.identify(&mut self.driver, self.verbose)?;
        }
        if half {
            self.halves = self.driver.halves();
            if self.verbose {
                eprintln!(
                    "  {:.1} s, half lap {}: planned {:.3} {}{}",
                    self.sim.time_s(),
                    self.halves,
                    self.driver.grip(),
                    if self.driver.held_back() { "held back " } else { "" },
                    self.referee.laps.last().map_or(String::new(), |l| format!("last lap {:.2} s", l.time_s)),
                );
            }
        }
        Ok(None)
    }
}
