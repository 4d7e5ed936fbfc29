//! What each effect changes in the signals: `effects_table FOLDER` writes `effects.md` and `effects.csv`.
//!
//! A car without effects is driven; beside it drives one with the effect, under the same commands. Every second it is put back
//! beside the first, so that the differences are the effect's and not those of another path. Sensors are exact; differences
//! are stated in their own unit and over the noise of a well-kept car's sensors.

use std::error::Error;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use gripsight_reference_car::{
    CarParameters, Course, DriverKind, EFFECTS, EffectSetting, EffectSpec, Scenario, SensorSample,
    SensorSettings, Simulation,
};

const CHANNELS: [(&str, &str); 5] =
    [("v_x", "m/s"), ("v_y", "m/s"), ("yaw rate", "rad/s"), ("a_x", "m/s2"), ("a_y", "m/s2")];
const CARS: [&str; 2] = ["f1tenth", "race_car"];
const WINDOW_S: f64 = 1.0;
const DURATION_S: f64 = 60.0;

/// What both cars report at one instant.
struct Pair {
    time_s: f64,
    with: [f64; 5],
    without: [f64; 5],
    v_y_dot: f64,
}

/// A part of the drive.
type Regime = (&'static str, fn(&Pair, &[f64; 5]) -> bool);

/// The regimes; the second argument holds each channel's largest magnitude without the effect.
const REGIMES: [Regime; 8] = [
    ("cornering hard", |p, most| p.without[4].abs() > 0.7 * most[4]),
    ("going straight", |p, most| p.without[4].abs() < 0.15 * most[4]),
    ("braking", |p, most| p.without[3] < -0.4 * most[3]),
    ("accelerating", |p, most| p.without[3] > 0.4 * most[3]),
    ("changing direction", |p, most| p.v_y_dot.abs() > 0.5 * most[4]),
    ("fast", |p, most| p.without[0] > 0.85 * most[0]),
    ("slow", |p, most| p.without[0] < 0.6 * most[0]),
    ("late in the run", |p, _| p.time_s > 0.8 * DURATION_S),
];

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("usage: effects_table FOLDER")?;
    let mut csv = BufWriter::new(File::create(Path::new(&folder).join("effects.csv"))?);
    let mut table = BufWriter::new(File::create(Path::new(&folder).join("effects.md"))?);
    writeln!(
        csv,
        "car,effect,size,channel,unit,rms_difference,rms_over_noise,largest_regime,regime_rms_over_all"
    )?;
    writeln!(table, "{HEADER}")?;
    for name in CARS {
        writeln!(
            table,
            "\n## {name}\n\n| effect | size | channel seen most | RMS | over noise | where | other channels |"
        )?;
        writeln!(table, "| --- | --- | --- | --- | --- | --- | --- |")?;
        for effect in EFFECTS {
            let car = CarParameters::by_name(name)?;
            let size = size(effect, car.wheelbase_m() < 1.0);
            let noise = noise(&car);
            let pairs = compare(&car, effect)?;
            let rows: Vec<Row> = (0..5).map(|channel| row(&pairs, channel, noise[channel])).collect();
            for row in &rows {
                let (channel, unit) = CHANNELS[row.channel];
                writeln!(
                    csv,
                    "{name},{},{size},{channel},{unit},{:.3e},{:.3},{},{:.2}",
                    effect.name, row.rms, row.over_noise, row.regime, row.regime_share
                )?;
            }
            writeln!(table, "{}", markdown(effect, &size, rows))?;
        }
    }
    Ok(())
}

const HEADER: &str = "# What each effect looks like

Made by `cargo run --release -p gripsight_reference_car --example effects_table -- tests/results/reference_car`; all numbers
are in effects.csv. Two cars on the esses track at 85 % of the grip, 60 s: one without effects, one with the effect at its
typical size under the same commands, put back beside the first every second. RMS is the root mean square of the difference
of what both report (exact sensors, 100 Hz); `over noise` divides it by the white noise of a well-kept car's sensor. `where`
names the part of the drive in which the difference is largest, and how many times its mean.";

struct Row {
    channel: usize,
    rms: f64,
    over_noise: f64,
    regime: &'static str,
    regime_share: f64,
}

fn markdown(effect: &EffectSpec, size: &str, mut rows: Vec<Row>) -> String {
    rows.sort_by(|a, b| b.over_noise.total_cmp(&a.over_noise));
    let first = &rows[0];
    let (channel, unit) = CHANNELS[first.channel];
    let others: Vec<String> = rows[1..]
        .iter()
        .filter(|r| r.over_noise > 0.05)
        .map(|r| format!("{} {:.2}", CHANNELS[r.channel].0, r.over_noise))
        .collect();
    let place = if first.regime_share > 1.1 {
        format!("{} ({:.1})", first.regime, first.regime_share)
    } else {
        "everywhere".into()
    };
    format!(
        "| `{}` | {size} | {channel} | {:.2e} {unit} | {:.2} | {place} | {} |",
        effect.name,
        first.rms,
        first.over_noise,
        others.join(", ")
    )
}

fn size(effect: &EffectSpec, small: bool) -> String {
    let of = |p: &gripsight_reference_car::ParameterSpec| {
        let unit = if p.unit == "1" { String::new() } else { format!(" {}", p.unit) };
        format!("{} {}{unit}", p.name, if small { p.typical_small } else { p.typical })
    };
    effect.parameters.iter().map(of).collect::<Vec<_>>().join("; ")
}

fn noise(car: &CarParameters) -> [f64; 5] {
    let s = SensorSettings::for_car(car);
    [s.v_x.white, s.v_y.white, s.yaw_rate.white, s.acceleration.white, s.acceleration.white]
}

fn compare(car: &CarParameters, effect: &EffectSpec) -> Result<Vec<Pair>, Box<dyn Error>> {
    let scenario = Scenario::new(car.clone())
        .course(Course::Track { name: "esses".to_owned(), reversed: false })
        .driver(DriverKind::Profile, 0.85)
        .sensors(SensorSettings::exact())
        .dither(0.1 * 9.81 * car.wheelbase_m() / (0.45 * car.top_speed_mps).powi(2))
        .duration(DURATION_S);
    let mut without = Simulation::new(scenario.clone())?;
    let mut with = Simulation::new(scenario.effect(EffectSetting::parse(effect.name)?))?;
    let mut pairs = Vec::new();
    let steps = (DURATION_S / 0.001) as u64;
    for step in 0..steps {
        without.drive().map_err(|end| format!("{}: {end}", effect.name))?;
        with.command(without.commanded());
        with.step().map_err(|end| format!("{}: {end}", effect.name))?;
        let v_y_dot = without
            .now()
            .map_or(0.0, |t| t.motion.specific_y_mps2 - t.motion.v_x_mps * t.motion.yaw_rate_radps);
        let time_s = without.time_s();
        if let (Some(with), Some(without)) = (signals(&with.drain().0), signals(&without.drain().0)) {
            pairs.push(Pair { time_s, with, without, v_y_dot });
        }
        if step % (WINDOW_S / 0.001) as u64 == 0 {
            with.follow(&without);
        }
    }
    Ok(pairs)
}

/// The channels, where both sensors report.
fn signals(samples: &[SensorSample]) -> Option<[f64; 5]> {
    let odometry =
        samples.iter().find_map(|s| if let SensorSample::Odometry(o) = s { Some(o) } else { None })?;
    let imu = samples.iter().find_map(|s| if let SensorSample::Imu(i) = s { Some(i) } else { None })?;
    Some([odometry.v_x_mps, odometry.v_y_mps, odometry.yaw_rate_radps, imu.a_x_mps2, imu.a_y_mps2])
}

fn row(pairs: &[Pair], channel: usize, noise: f64) -> Row {
    let rms = |chosen: &dyn Fn(&Pair) -> bool| {
        let squares: Vec<f64> = pairs
            .iter()
            .filter(|p| chosen(p))
            .map(|p| (p.with[channel] - p.without[channel]).powi(2))
            .collect();
        (squares.iter().sum::<f64>() / squares.len().max(1) as f64).sqrt()
    };
    let most: [f64; 5] =
        std::array::from_fn(|i| pairs.iter().map(|p| p.without[i].abs()).fold(0.0, f64::max));
    let all = rms(&|_| true);
    let mut largest = ("everywhere", 0.0);
    for (name, holds) in REGIMES {
        let here = rms(&|p| holds(p, &most));
        if here > largest.1 {
            largest = (name, here);
        }
    }
    let regime_share = if all > 0.0 { largest.1 / all } else { 0.0 };
    Row { channel, rms: all, over_noise: all / noise, regime: largest.0, regime_share }
}
