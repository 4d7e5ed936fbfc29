//! Drive commands in, sensors and `/clock` out.

use std::future::Future;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use anyhow::bail;
use gripsight_bag::{decode, encode};
use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::standard::rosgraph_msgs::Clock;
use gripsight_msgs::standard::sensor_msgs::{CompressedImage, Imu, JointState};
use gripsight_reference_car::{Command, EndReason, Exposure, RoadCamera, Simulation};
use gripsight_runtime::{Diagnostics, Node, Publisher, Qos, Subscription};
use gripsight_signals::Measurement;
use tokio::sync::mpsc;

use crate::diagnostics::{State, status};
use crate::settings::{Settings, Wheel};

/// How often the car catches up with the clock.
const PERIOD: Duration = Duration::from_millis(5);
/// How often diagnostics are renewed.
const REPORT_PERIOD: Duration = Duration::from_millis(200);
/// Lag (s) that is given up: the car's time then goes on from where it is.
const LAG_GIVEN_UP_S: f64 = 1.0;
/// Depth of the sensors' queues.
const DEPTH: usize = 50;
/// Depth of the queue of pictures.
const PICTURE_DEPTH: usize = 2;

/// Declares parameters and topics; gives the node's work.
pub(crate) fn setup(node: &mut Node) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<>> {
    let settings = Settings::declare(node)?;
    let (commands, drive) = match settings.wheel {
        Wheel::Topic => (Some(node.subscription("drive", Qos::sensor(DEPTH))?), None),
        Wheel::Own => (None, Some(node.publisher("drive", Qos::reliable(DEPTH))?)),
    };
    let clock =
        if settings.publish_clock { Some(node.publisher("/clock", Qos::reliable(10))?) } else { None };
    let pictures = (settings.scenario.sensors.camera_rate_hz > 0.0)
        .then(|| node.publisher("image/compressed", Qos::reliable(PICTURE_DEPTH)))
        .transpose()?
        .map(|topic| develop(topic, settings.scenario.seed));
    let outputs = Outputs {
        odometry: node.publisher("odom", Qos::reliable(DEPTH))?,
        imu: node.publisher("imu", Qos::reliable(DEPTH))?,
        wheels: node.publisher("wheels", Qos::reliable(DEPTH))?,
        drive,
        clock,
        pictures,
        start_ns: SystemTime::now().duration_since(UNIX_EPOCH).map(|d| d.as_nanos() as i64).unwrap_or(0),
    };
    let car = LiveCar {
        simulation: Simulation::new(settings.scenario.clone())?,
        floor: settings.mu.get(),
        settings,
        outputs,
        diagnostics: node.diagnostics(),
        state: State::default(),
        last_command: None,
    };
    tracing::info!("{} on its track", car.settings.scenario.car.name);
    Ok(car.drive(commands))
}

struct Outputs {
    odometry: Publisher<Odometry>,
    imu: Publisher<Imu>,
    wheels: Publisher<JointState>,
    /// The own driver's commands.
    drive: Option<Publisher<AckermannDriveStamped>>,
    clock: Option<Publisher<Clock>>,
    /// Exposures with their stamps, to be drawn and published.
    pictures: Option<mpsc::Sender<(i64, Exposure)>>,
    /// Stamp of the car's time zero.
    start_ns: i64,
}

struct LiveCar {
    simulation: Simulation,
    /// Friction of the road under it.
    floor: f64,
    settings: Settings,
    outputs: Outputs,
    diagnostics: Diagnostics,
    state: State,
    last_command: Option<Instant>,
}

impl LiveCar {
    async fn drive(
        mut self,
        mut commands: Option<Subscription<AckermannDriveStamped>>,
    ) -> anyhow::Result<()> {
        if self.settings.wheel == Wheel::Topic {
            // Nobody knows yet where it should go.
            self.simulation.put(0.0, 0.0, 0.0);
            self.simulation.command(Command::default());
        }
        let mut ticks = tokio::time::interval(PERIOD);
        let (mut last, mut reported, mut due_s) = (Instant::now(), Instant::now(), 0.0);
        loop {
            tokio::select! {
                Some(message) = next(&mut commands) => {
                    self.last_command = Some(Instant::now());
                    self.simulation.command(asked(&message));
                    continue;
                }
                _ = ticks.tick() => {}
            }
            let now = Instant::now();
            due_s += (now - last).as_secs_f64() * self.settings.rate.get();
            last = now;
            self.change_floor();
            let end = self.catch_up(due_s, now);
            self.state.lag_s = due_s - self.simulation.time_s();
            if self.state.lag_s > LAG_GIVEN_UP_S {
                due_s = self.simulation.time_s();
            }
            self.publish().await;
            if now - reported > REPORT_PERIOD || end.is_err() {
                reported = now;
                self.state.end = end.err().map(|reason| reason.to_string());
                self.diagnostics.report("car", status(&self.state));
            }
            if let Err(reason) = end {
                bail!("{reason}");
            }
        }
    }

    /// Lays the floor that the parameter asks for.
    fn change_floor(&mut self) {
        let mu = self.settings.mu.get();
        if mu != self.floor {
            match self.simulation.set_friction(mu) {
                Ok(()) => tracing::info!("the floor changes from {} to {mu}", self.floor),
                Err(error) => tracing::warn!("{error}"),
            }
            self.floor = mu;
        }
    }

    /// Steps until the car's time is `due_s`, for at most one period.
    fn catch_up(&mut self, due_s: f64, now: Instant) -> Result<(), EndReason> {
        if self.settings.wheel == Wheel::Topic {
            self.state.command_timeout_s = self.settings.command_timeout_s;
            let age_s = self.last_command.map_or(f64::INFINITY, |at| (now - at).as_secs_f64());
            self.state.command_age_s = Some(age_s);
            if age_s > self.settings.command_timeout_s && self.simulation.commanded().speed_mps != 0.0 {
                let steering_rad = self.simulation.commanded().steering_rad;
                self.simulation.command(Command { steering_rad, ..Command::default() });
            }
        }
        while self.simulation.time_s() < due_s && now.elapsed() < PERIOD {
            match self.settings.wheel {
                Wheel::Topic => self.simulation.step()?,
                Wheel::Own => self.simulation.drive()?,
            }
        }
        self.state.driven_s = self.simulation.time_s();
        self.state.v_x_mps = self.simulation.now().map_or(0.0, |t| t.motion.v_x_mps);
        Ok(())
    }

    async fn publish(&mut self) {
        let out = &self.outputs;
        for sample in self.simulation.drain().0 {
            match sample.measurement(out.start_ns) {
                Measurement::Odometry(m) => out.odometry.publish(&encode::odometry(&m)).await,
                Measurement::Imu(m) => out.imu.publish(&encode::imu(&m)).await,
                Measurement::Wheels(m) => out.wheels.publish(&encode::wheels(&m)).await,
                Measurement::Mapped(_) => {}
                Measurement::Drive(m) => {
                    if let Some(drive) = &out.drive {
                        drive.publish(&encode::drive(&m)).await;
                    }
                }
            }
        }
        for exposure in self.simulation.drain_exposures() {
            if let Some(pictures) = &out.pictures {
                // Where drawing cannot keep up, pictures are left out.
                let _full = pictures.try_send((exposure.stamp_ns(out.start_ns), exposure));
            }
        }
        if let Some(clock) = &out.clock {
            let now_ns = out.start_ns + (self.simulation.time_s() * 1e9) as i64;
            clock.publish(&Clock { clock: encode::time(now_ns) }).await;
        }
    }
}

/// Draws and publishes pictures beside the car, which does not wait for them.
fn develop(topic: Publisher<CompressedImage>, seed: u64) -> mpsc::Sender<(i64, Exposure)> {
    let (sender, mut exposures) = mpsc::channel::<(i64, Exposure)>(PICTURE_DEPTH);
    let camera = Arc::new(RoadCamera::new(seed));
    tokio::spawn(async move {
        while let Some((stamp_ns, exposure)) = exposures.recv().await {
            let camera = Arc::clone(&camera);
            match tokio::task::spawn_blocking(move || camera.expose(&exposure)).await {
                Ok(Ok(file)) => topic.publish(&encode::jpeg(stamp_ns, file)).await,
                Ok(Err(error)) => tracing::warn!("a picture is left out: {error}"),
                Err(error) => tracing::warn!("a picture is left out: {error}"),
            }
        }
    });
    sender
}

/// The next command; never, where none are taken.
async fn next(commands: &mut Option<Subscription<AckermannDriveStamped>>) -> Option<AckermannDriveStamped> {
    match commands {
        Some(commands) => commands.next().await,
        None => std::future::pending().await,
    }
}

/// A command without acceleration asks for its speed.
fn asked(message: &AckermannDriveStamped) -> Command {
    let sample = decode::drive(message);
    Command {
        steering_rad: sample.steering_angle_rad,
        speed_mps: sample.speed_mps,
        acceleration_mps2: (sample.acceleration_mps2 != 0.0).then_some(sample.acceleration_mps2),
    }
}
