//! The node's parameters, as a scenario.

use std::fmt::Write as _;
use std::path::Path;

use anyhow::{Context, bail};
use gripsight_reference_car::{
    CarParameters, Course, DriverKind, EffectSetting, Friction, GRAVITY_MPS2, Scenario, Track,
};
use gripsight_runtime::{Descriptor, Node, Parameter};

/// Longest run: the scenario must have an end, the node has none.
const ENDLESS_S: f64 = 36_000.0;

/// Who drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Wheel {
    /// The topic `drive`.
    Topic,
    /// The scenario's own driver.
    Own,
}

/// What the parameters say.
pub(crate) struct Settings {
    pub(crate) scenario: Scenario,
    pub(crate) wheel: Wheel,
    /// Seconds of the car per second.
    pub(crate) rate: Parameter<f64>,
    /// Friction of the road.
    pub(crate) mu: Parameter<f64>,
    pub(crate) publish_clock: bool,
    /// Age from which a drive command no longer counts.
    pub(crate) command_timeout_s: f64,
}

impl Settings {
    /// Declares the parameters.
    pub(crate) fn declare(node: &mut Node) -> anyhow::Result<Self> {
        let text = |node: &mut Node, name: &str, default: &str, meaning: &str| {
            node.parameter(name, default.to_owned(), Descriptor::new(meaning).read_only()).map(|p| p.get())
        };
        let car = text(node, "car", "f1tenth", "f1tenth, formula_student, race_car or passenger_car")?;
        let track = text(node, "track", "club", "Name of a closed track")?;
        let driver = text(node, "driver", "topic", "Who drives: topic, pure_pursuit or profile")?;
        let effects = node.parameter(
            "effects",
            Vec::<String>::new(),
            Descriptor::new("Effects at work: NAME, NAME=VALUE or NAME=PARAMETER:VALUE,...").read_only(),
        )?;
        let flag = |node: &mut Node, name: &str, default: bool, meaning: &str| {
            node.parameter(name, default, Descriptor::new(meaning).read_only()).map(|p| p.get())
        };
        let reverse = flag(node, "reverse", false, "Drive the track clockwise")?;
        let realistic = flag(
            node,
            "realistic",
            true,
            "Load transfers, relaxation and combined slip at the car's own size",
        )?;
        let publish_clock = flag(node, "publish_clock", false, "Publish /clock")?;
        let folder = text(
            node,
            "write_folder",
            "",
            "Folder for track.csv, vehicle.yaml and driver.yaml, as the node driver takes them; empty: none",
        )?;
        let mut number = |name: &str, default: f64, low: f64, high: f64, meaning: &str| {
            node.parameter(name, default, Descriptor::new(meaning).range(low..=high).read_only())
                .map(|p| p.get())
        };
        let pace = number("pace", 0.8, 0.05, 2.0, "Share of the grip that the own driver plans to use")?;
        let noise = number("noise", 1.0, 0.0, 100.0, "Sensor noise over its usual size")?;
        let camera_rate_hz =
            number("camera_rate_hz", 0.0, 0.0, 60.0, "Pictures of the road a second; zero: none")?;
        let command_timeout_s = number(
            "command_timeout_s",
            0.5,
            0.05,
            60.0,
            "Age from which a drive command no longer counts (s)",
        )?;
        let seed = node.parameter(
            "seed",
            1_i64,
            Descriptor::new("Seed of noise, gusts, dither and the road's looks").read_only(),
        )?;
        let rate = node.parameter(
            "rate",
            1.0,
            Descriptor::new("Seconds of the car per second").range(0.01..=100.0),
        )?;

        let friction =
            node.parameter("mu", 0.9, Descriptor::new("Friction of the road").range(0.01..=3.0))?;
        let mu = friction.get();

        let car = CarParameters::by_name(&car)?;
        let course = Course::by_name(&track, &car, reverse)?;
        if !folder.is_empty() {
            data_sheet(Path::new(&folder), &car, &track, reverse)?;
        }
        let (wheel, kind) = match driver.as_str() {
            "topic" => (Wheel::Topic, DriverKind::PurePursuit),
            "pure_pursuit" => (Wheel::Own, DriverKind::PurePursuit),
            "profile" => (Wheel::Own, DriverKind::Profile),
            other => bail!("parameter driver: expected topic, pure_pursuit or profile, got {other}"),
        };
        let asked = effects.get().iter().map(|e| EffectSetting::parse(e)).collect::<Result<Vec<_>, _>>()?;
        let mut scenario = Scenario::new(car)
            .course(course)
            .driver(kind, pace)
            .friction(Friction::Uniform { mu })
            .duration(ENDLESS_S)
            .seed(seed.get().unsigned_abs());
        if realistic {
            scenario.effects = scenario.car.own_effects(mu);
            scenario.effects.retain(|own| asked.iter().all(|a| a.name != own.name));
        }
        scenario.effects.extend(asked);
        let mut sensors = scenario.sensors.scaled(noise);
        sensors.camera_rate_hz = camera_rate_hz;
        let scenario = scenario.sensors(sensors);
        Ok(Self { scenario, wheel, rate, mu: friction, publish_clock, command_timeout_s })
    }
}

/// Points of the track that are left out between two of the file.
const EVERY: usize = 8;

/// What a team knows of its car and its track, as files.
fn data_sheet(folder: &Path, car: &CarParameters, track: &str, reversed: bool) -> anyhow::Result<()> {
    let line = Track::by_name(track, car.track_scale, reversed)?;
    let width_m = line.half_width_m();
    let mut rows = String::from("x_m,y_m,w_tr_right_m,w_tr_left_m\n");
    for point in line.points().iter().step_by(EVERY) {
        let _ = writeln!(rows, "{},{},{width_m},{width_m}", point.x_m, point.y_m);
    }
    std::fs::create_dir_all(folder).with_context(|| format!("folder {}", folder.display()))?;
    let folder = folder.canonicalize().with_context(|| format!("folder {}", folder.display()))?;
    let drive = &car.drive;
    let driver = format!(
        "/**/driver:\n  ros__parameters:\n    track: {}\n    drive_mps2: {:?}\n    brake_mps2: {:?}\n    power_w_per_kg: {:?}\n    top_speed_mps: {:?}\n",
        folder.join("track.csv").display(),
        drive.drive_limit * GRAVITY_MPS2,
        drive.brake_limit * GRAVITY_MPS2,
        drive.power_w / car.mass_kg,
        car.top_speed_mps,
    );
    // The driver's file last: whoever waits for it finds the others.
    for (name, text) in
        [("track.csv", rows), ("vehicle.yaml", car.vehicle_file(&car.name)), ("driver.yaml", driver)]
    {
        let path = folder.join(name);
        std::fs::write(&path, text).with_context(|| format!("file {}", path.display()))?;
    }
    Ok(())
}
