//! Simulated drives whose car, road, driver and imperfections are drawn from a seed.

use anyhow::Result;
use gripsight_reference_car::{CarParameters, Course, DriverKind, EffectSetting, Friction, Scenario};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// A drive and the signal errors that were put into it.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) name: String,
    pub(crate) scenario: Scenario,
    /// In the order of the signal corrections.
    pub(crate) signals: [f64; 6],
}

/// A command stands for so long.
pub(crate) const HOLD_S: f64 = 0.01;
const CARS: [&str; 4] = ["f1tenth", "formula_student", "race_car", "passenger_car"];
const TRACKS: [&str; 4] = ["club", "esses", "bean", "clover"];

/// The drive of a seed: any car on any track and friction, at a pace from tame to the limit, with the background that every car has at half to
/// one and a half times its usual size, and with imperfect signals.
pub(crate) fn draw(seed: u64, duration_s: f64) -> Result<Case> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let car = CarParameters::by_name(CARS[seed as usize % CARS.len()])?;
    let track = TRACKS[random.random_range(0..TRACKS.len())];
    let mu = random.random_range(0.5..1.2);
    let pace = random.random_range(0.75..1.0);
    let length_m = car.wheelbase_m();
    let small = length_m < 1.0;
    let mut sized =
        |name: &str, usual: f64| EffectSetting::new(name, &[usual * random.random_range(0.5..1.5)]);
    let mut effects = vec![
        sized("tire_relaxation", if small { 0.08 } else { 0.45 })?,
        sized("lateral_load_transfer", 0.15)?,
        sized("longitudinal_load_transfer", car.h_cg_m)?,
        sized("combined_slip", 0.9)?,
        sized("aero_drag", car.drag_1pm)?,
        sized("rolling_resistance", car.rolling_resistance)?,
    ];
    let lag_s = random.random_range(0.005..0.04);
    let delay_s = random.random_range(0.0..0.06);
    let gain = random.random_range(-0.03..0.03);
    let offset_rad = random.random_range(-0.01..0.01);
    let lever_m = length_m * random.random_range(-0.1..0.1);
    let v_y_bias_mps = car.top_speed_mps * random.random_range(-0.005..0.005);
    let gyro_bias_radps = random.random_range(-0.005..0.005);
    for (name, value) in [
        ("steering_lag", lag_s),
        ("steering_delay", delay_s),
        ("steering_gain", gain),
        ("steering_offset", offset_rad),
        ("v_y_lever_arm", lever_m),
        ("v_y_bias", v_y_bias_mps),
        ("gyro_bias", gyro_bias_radps),
    ] {
        effects.push(EffectSetting::new(name, &[value])?);
    }
    let name = format!("{} {track} mu {mu:.2} pace {pace:.2} seed {seed}", car.name);
    let course = Course::by_name(track, &car, random.random())?;
    let scenario = Scenario::new(car)
        .course(course)
        .driver(DriverKind::PurePursuit, pace)
        .friction(Friction::Uniform { mu })
        .duration(duration_s)
        .seed(seed);
    let scenario = effects.into_iter().fold(scenario, Scenario::effect);
    // A command is held for a step: half of that is delay, too.
    let signals =
        [delay_s + lag_s + 0.5 * HOLD_S, 1.0 + gain, offset_rad, lever_m, v_y_bias_mps, gyro_bias_radps];
    Ok(Case { name, scenario, signals })
}
