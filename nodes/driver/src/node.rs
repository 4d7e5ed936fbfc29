//! Odometry and tire sets in, drive commands out.

use std::time::Instant;

use gripsight_bag::decode;
use gripsight_driving::{DriveCommand, Driven, Driver, Solves, Trust};
use gripsight_identification::vehicle_hash;
use gripsight_msgs::standard::ackermann_msgs::{AckermannDrive, AckermannDriveStamped};
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::std_msgs::Header;
use gripsight_msgs::{ExtendedModel, Grip, IdentificationProgress, PacejkaParams};
use gripsight_runtime::{Clock, Diagnostics, Node, Publisher, Qos};
use tokio::time::MissedTickBehavior;

use crate::diagnostics::{Facts, status};
use crate::laps::{Lap, Laps};
use crate::model::{self, Tried};
use crate::sets::{Said, asks_for_turn_ins, longitudinal, read};
use crate::settings::Settings;

/// Depth of the command's queue: only the newest counts.
const DEPTH: usize = 1;
/// How often the age of the odometry is looked at, and the diagnostics renewed.
const LOOK: std::time::Duration = std::time::Duration::from_millis(50);

/// Declares parameters and topics; gives the node's work.
pub(crate) fn setup(node: &mut Node) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<>> {
    let (settings, driver) = Settings::declare(node)?;
    let mut odometry = node.subscription::<Odometry>("odom", node.sensor_qos(DEPTH))?;
    let mut sets = node.subscription::<PacejkaParams>("pacejka", Qos::latched())?;
    let mut models = node.subscription::<ExtendedModel>("extended_model", Qos::latched())?;
    let mut grips = node.subscription::<Grip>("grip", Qos::latched())?;
    let mut runs = node.subscription::<IdentificationProgress>("progress", Qos::latched())?;
    node.needs([odometry.arrivals()]);
    let hash = vehicle_hash(&settings.vehicle);
    let mut wheel = Wheel {
        output: node.publisher("drive", Qos::reliable(DEPTH))?,
        clock: node.clock(),
        diagnostics: node.diagnostics(),
        facts: Facts { rests_on: rests_on(driver.trust()), ..Facts::default() },
        laps: Laps::default(),
        start_ns: None,
        seen: None,
        last: DriveCommand::default(),
        turn_ins: false,
        fallen: None,
        driver,
        settings,
    };
    tracing::info!("a lap of {:.1} m", wheel.driver.track().length_m());

    Ok(async move {
        let mut ticks = tokio::time::interval(LOOK);
        ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                Some(message) = odometry.next() => wheel.steer(&message).await,
                Some(message) = sets.next() => wheel.take(&message, &hash),
                Some(message) = models.next() => wheel.try_model(&message, &hash),
                Some(message) = grips.next() => wheel.feel(&message, &hash),
                Some(message) = runs.next() => wheel.ask(&message, &hash),
                _ = ticks.tick() => wheel.look().await,
                else => return Ok(()),
            }
        }
    })
}

/// Everything at the wheel.
struct Wheel {
    settings: Settings,
    driver: Driver,
    output: Publisher<AckermannDriveStamped>,
    clock: Clock,
    diagnostics: Diagnostics,
    facts: Facts,
    laps: Laps,
    /// Stamp that counts as zero.
    start_ns: Option<i64>,
    /// When odometry came last.
    seen: Option<Instant>,
    last: DriveCommand,
    /// Whether the identification asks for turn-ins.
    turn_ins: bool,
    /// What the last grip said: the sequence of the set, and the share left of what it promises.
    fallen: Option<(u64, f64)>,
}

impl Wheel {
    async fn steer(&mut self, message: &Odometry) {
        let start_ns = *self.start_ns.get_or_insert_with(|| decode::stamp_ns(message.header.stamp));
        let state = self.settings.state(message, start_ns);
        let now_s = (decode::stamp_ns(self.clock.now()) - start_ns) as f64 * 1e-9;
        self.facts.age_s = now_s - state.stamp_s;
        self.last = self.driver.command(&state, now_s);
        self.seen = Some(Instant::now());
        self.publish(self.last).await;
        let Some(place) = self.driver.place().filter(|_| state.is_finite()) else { return };
        self.facts.outside_m = Laps::outside_m(place, self.driver.track());
        if let Some(lap) = self.laps.pass(state.stamp_s, place, self.driver.track()) {
            self.facts.last_lap = Some(lap);
            log(&lap, &self.driver, self.facts.age_s);
        }
    }

    fn take(&mut self, message: &PacejkaParams, hash: &str) {
        self.facts.refused = None;
        match read(message, hash, self.settings.take_provisional.get()) {
            Said::Set(set) => match self.driver.take(set) {
                Ok(()) => {
                    self.driver.take_longitudinal(longitudinal(message));
                    self.facts.sets += 1;
                    tracing::info!("{:?}: planning with a grip of {:.3}", set.trust, self.driver.grip());
                }
                Err(error) => self.refuse(error.to_string()),
            },
            Said::Withdrawn => {
                let of_it = |&(id, _): &(u64, f64)| id == message.handshake.sequence_id;
                self.driver.warn(self.fallen.filter(of_it).map(|(_, share)| share));
                tracing::warn!(
                    "the set is withdrawn, planning with a grip of {:.3}: {}",
                    self.driver.grip(),
                    message.reason
                );
            }
            Said::Nothing(why) => self.refuse(why.to_owned()),
        }
    }

    fn refuse(&mut self, why: String) {
        tracing::warn!("set not taken: {why}");
        self.facts.refused = Some(why);
    }

    fn try_model(&mut self, message: &ExtendedModel, hash: &str) {
        match model::take(&mut self.driver, message, hash) {
            Tried::Nothing => self.facts.model_refused = None,
            Tried::Taken(said) => {
                tracing::info!("the extended model is taken: {said}");
                (self.facts.model, self.facts.model_refused) = (said, None);
            }
            Tried::Refused(why) => {
                tracing::warn!("the extended model is not taken: {why}");
                self.facts.model_refused = Some(why);
            }
        }
    }

    fn feel(&mut self, message: &Grip, hash: &str) {
        if message.fallen && message.handshake.vehicle_hash == hash {
            self.fallen = Some((message.handshake.sequence_id, message.share));
            self.driver.warn(Some(message.share));
            tracing::warn!("planning with a grip of {:.3}: {}", self.driver.grip(), message.text);
        }
    }

    /// What the identification wants to be driven next: while it waits for its first sequence, what tells the most.
    fn ask(&mut self, message: &IdentificationProgress, hash: &str) {
        let wanted = match message.stage {
            IdentificationProgress::WAITING => true,
            IdentificationProgress::FINISHED if message.handshake.vehicle_hash == hash => {
                asks_for_turn_ins(&message.drive_next)
            }
            _ => return,
        };
        self.driver.ask_for_turn_ins(wanted);
        if wanted != self.turn_ins {
            let says = if wanted { "asks for turn-ins" } else { "asks for turn-ins no more" };
            tracing::info!("the identification {says}");
            self.turn_ins = wanted;
        }
    }

    /// Brakes where nothing is seen; says how it goes.
    async fn look(&mut self) {
        self.facts.blind = self.seen.is_none_or(|at| at.elapsed() > self.settings.odometry_timeout);
        if self.facts.blind && self.seen.is_some() {
            // The steering stays: turning the wheels blindly upsets a car more than it helps.
            let acceleration_mps2 = -self.driver.brake_mps2();
            self.publish(DriveCommand { speed_mps: 0.0, acceleration_mps2, ..self.last }).await;
        }
        if let Some(back) = self.driver.given_back().filter(|_| !self.facts.given_back) {
            let lap = |lap: &Driven| {
                format!("a lap of {:.2} s, {:.3} m from the line in the mean", lap.time_s, lap.mean_m)
            };
            let with = back.with.as_ref().map_or("a slide".to_owned(), lap);
            let without = back.without.as_ref().map_or("no lap".to_owned(), lap);
            let why = format!("given back after {with}; without it {without}");
            tracing::warn!("the extended model is {why}");
            (self.facts.model_refused, self.facts.given_back) = (Some(why), true);
        }
        let solves = self.driver.solves().copied();
        let failed = |solves: &Option<Solves>| solves.map_or(0, |solves| solves.not_converged);
        self.facts.replaced = failed(&solves) > failed(&self.facts.solves);
        self.facts.solves = solves;
        self.facts.grip = self.driver.grip();
        self.facts.held_back = self.driver.held_back();
        self.facts.rests_on = rests_on(self.driver.trust());
        self.diagnostics.report("driving", status(&self.facts));
    }

    async fn publish(&self, command: DriveCommand) {
        let header = Header { stamp: self.clock.now(), frame_id: "base_link".to_owned() };
        let drive = AckermannDrive {
            steering_angle: command.steering_rad as f32,
            speed: command.speed_mps as f32,
            acceleration: command.acceleration_mps2 as f32,
            ..AckermannDrive::default()
        };
        self.output.publish(&AckermannDriveStamped { header, drive }).await;
    }
}

fn log(lap: &Lap, driver: &Driver, age_s: f64) {
    tracing::info!(
        "lap {}: {:.2} s, to the line {:.3} m, at most {:.3} m, {} times off the track, grip planned {:.3}, {}, state {:.0} ms old",
        lap.number,
        lap.time_s,
        lap.mean_m,
        lap.worst_m,
        lap.exits,
        driver.grip(),
        rests_on(driver.trust()),
        1e3 * age_s,
    );
}

fn rests_on(trust: Trust) -> &'static str {
    match trust {
        Trust::Assumed => "the start's",
        Trust::Accepted => "accepted",
        Trust::AcceptedWithin => "accepted within what was shown",
        Trust::Provisional => "provisional",
    }
}
