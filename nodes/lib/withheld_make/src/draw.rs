//! Draws of cars, drives and effects. Sizes run from a quarter of the typical size to twice it.

use std::collections::BTreeMap;

use gripsight_reference_car::{
    CarParameters, Course, DriverKind, EFFECTS, EffectSetting, EffectSpec, Friction, Scenario, Track,
    effect_spec,
};
use rand::RngExt;
use rand::seq::{IndexedRandom, SliceRandom};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::WithheldError;

/// Which cars and tracks are drawn from. What was tuned on the one is tested on the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pool {
    /// Cars and tracks to develop on.
    Development,
    /// Cars and tracks to test on.
    Test,
}

impl Pool {
    fn cars(self) -> &'static [&'static str] {
        match self {
            Self::Development => &["f1tenth", "f1tenth", "formula_student", "race_car"],
            Self::Test => &["f1tenth", "f1tenth", "formula_student", "race_car", "passenger_car"],
        }
    }

    fn tracks(self) -> &'static [&'static str] {
        match self {
            // The last ten were in test batches whose labels are open now.
            Self::Development => &[
                "oval", "club", "esses", "bean", "clover", "harbor", "valley", "quarry", "delta", "lagoon",
                "ridge", "basin", "summit", "meadow", "canyon",
            ],
            Self::Test => &["plateau", "marsh"],
        }
    }

    /// Share by which a car's figures differ from the built-in one's.
    fn spread(self) -> f64 {
        match self {
            Self::Development => 0.1,
            Self::Test => 0.15,
        }
    }
}

/// Pace from which a drive counts as race pace.
const RACE_PACE: f64 = 0.8;
/// Effects with one meaningful sign, that of their typical size.
const ONE_SIGN: [&str; 20] = [
    "tire_relaxation",
    "lateral_load_transfer",
    "longitudinal_load_transfer",
    "combined_slip",
    "grip_scale",
    "low_grip_patch",
    "tire_wear",
    "steering_lag",
    "steering_delay",
    "steering_backlash",
    "steering_rate_limit",
    "aero_downforce",
    "aero_drag",
    "rolling_resistance",
    "compliance_steer",
    "differential_yaw_moment",
    "odometry_delay",
    "odometry_low_pass",
    "gusts",
    "drive_lag",
];
/// Pairs that are one thing by construction.
const TWINS: [(&str, &str); 4] = [
    ("grip_scale", "grip_balance"),
    ("steering_delay", "steering_lag"),
    ("odometry_delay", "odometry_low_pass"),
    ("aero_drag", "rolling_resistance"),
];
/// Names on the list of effects to leave out.
const LEFT_OUT: usize = 3;

/// A car on its way: everything but the effects.
#[derive(Debug, Clone)]
pub(crate) struct Drive {
    pub(crate) scenario: Scenario,
    pub(crate) race_pace: bool,
    pub(crate) circumstances: BTreeMap<String, Value>,
}

/// A car, a track, a driver, a road and sensors.
pub(crate) fn drive(pool: Pool, duration_s: f64, random: &mut ChaCha8Rng) -> Result<Drive, WithheldError> {
    let name = *pool.cars().choose(random).unwrap_or(&"f1tenth");
    let car = car(name, pool.spread(), random)?;
    let track = *pool.tracks().choose(random).unwrap_or(&"club");
    let reversed = random.random_bool(0.5);
    let race_pace = random.random_bool(0.75);
    let pace = random.random_range(if race_pace { RACE_PACE..0.93 } else { 0.55..RACE_PACE });
    let driver = if random.random_bool(0.7) { DriverKind::Profile } else { DriverKind::PurePursuit };
    let small = car.wheelbase_m() < 1.0;
    let dither = if small { random.random_range(0.01..0.03) } else { random.random_range(0.003..0.012) };
    let mu = random.random_range(0.7..1.1);
    let noise = random.random_range(0.5_f64.ln()..2.0_f64.ln()).exp();
    let dropped = if random.random_bool(0.3) { random.random_range(0.0..0.04) } else { 0.0 };
    let jitter = if random.random_bool(0.3) { random.random_range(0.0..0.002) } else { 0.0 };
    let mut scenario = Scenario::new(car)
        .course(Course::Track { name: track.to_owned(), reversed })
        .driver(driver, pace)
        .dither(dither)
        .friction(Friction::Uniform { mu })
        .duration(duration_s)
        .seed(random.random());
    let mut sensors = scenario.sensors.scaled(noise);
    for sampling in [&mut sensors.odometry, &mut sensors.imu, &mut sensors.wheels] {
        sampling.dropped = dropped;
        sampling.jitter_s = jitter;
    }
    sensors.drive_dropped = dropped;
    scenario = scenario.sensors(sensors);
    scenario.effects = background(&scenario.car, mu, random);
    let circumstances = [
        ("car", Value::from(name)),
        ("track", track.into()),
        ("reversed", reversed.into()),
        ("pace", pace.into()),
        ("mu", mu.into()),
        ("noise", noise.into()),
        ("dropped", dropped.into()),
        ("jitter_s", jitter.into()),
        ("dither_rad", dither.into()),
    ];
    let circumstances = circumstances.map(|(k, v)| (k.to_owned(), v)).into();
    Ok(Drive { scenario, race_pace, circumstances })
}

/// Another drive of the same car in the same state: another seed, driver and pace.
pub(crate) fn another(scenario: &Scenario, random: &mut ChaCha8Rng) -> Scenario {
    let kind = if random.random_bool(0.5) { DriverKind::Profile } else { DriverKind::PurePursuit };
    let pace = scenario.driver.pace * random.random_range(0.88..1.02);
    scenario.clone().driver(kind, pace).seed(random.random())
}

/// A built-in car with its figures off by up to `spread`.
fn car(name: &str, spread: f64, random: &mut ChaCha8Rng) -> Result<CarParameters, WithheldError> {
    let mut car = CarParameters::by_name(name)?;
    let mut vary = |value: &mut f64, share: f64| *value *= 1.0 + random.random_range(-share..share);
    vary(&mut car.mass_kg, spread);
    vary(&mut car.yaw_inertia_kgm2, spread);
    vary(&mut car.l_f_m, spread / 2.0);
    vary(&mut car.l_r_m, spread / 2.0);
    vary(&mut car.h_cg_m, spread);
    for tire in [&mut car.tire_front, &mut car.tire_rear] {
        vary(&mut tire.cornering_stiffness_per_rad, spread);
        vary(&mut tire.grip, spread / 5.0);
    }
    Ok(car)
}

/// What every car has a little of, as drawn.
const BACKGROUND: [&str; 4] =
    ["lateral_load_transfer", "longitudinal_load_transfer", "tire_relaxation", "combined_slip"];
/// How little: from this share of what the car would have to this.
const LITTLE: [f64; 2] = [0.1, 0.3];

/// Small amounts of what every car has: load transfer, relaxation, combined slip.
fn background(car: &CarParameters, mu: f64, random: &mut ChaCha8Rng) -> Vec<EffectSetting> {
    let mut own = car.own_effects(mu);
    own.retain(|effect| BACKGROUND.contains(&effect.name.as_str()));
    for effect in &mut own {
        let share = random.random_range(LITTLE[0]..LITTLE[1]);
        effect.parameters.values_mut().for_each(|value| *value *= share);
    }
    own
}

/// Share of an effect beyond what any car may have of it: all of it, but for the background.
pub(crate) fn beyond_usual(car: &CarParameters, mu: f64, setting: &EffectSetting) -> f64 {
    if !BACKGROUND.contains(&setting.name.as_str()) {
        return 1.0;
    }
    let own = car.own_effects(mu).into_iter().find(|own| own.name == setting.name);
    let value = |setting: &EffectSetting| setting.parameters.values().next().copied().unwrap_or(0.0);
    let usual = LITTLE[1] * own.as_ref().map_or(0.0, value);
    (1.0 - usual / value(setting).max(1e-9)).max(0.0)
}

/// Effects of the plant that the diagnosis has no name for.
const OUTSIDE_LIBRARY: [&str; 6] =
    ["cross_wind", "gusts", "tire_asymmetry", "steering_map", "camber_thrust", "drive_lag"];

/// Names of the plant's effects that the diagnosis' library has, or of those that it does not have.
#[must_use]
pub fn names(in_library: bool) -> Vec<&'static str> {
    EFFECTS.iter().map(|e| e.name).filter(|n| OUTSIDE_LIBRARY.contains(n) != in_library).collect()
}

/// So many names, one or two.
pub(crate) fn some<'a>(names: &[&'a str], count: usize, random: &mut ChaCha8Rng) -> Vec<&'a str> {
    if count == 2 { pair(names, random) } else { names.sample(random, count).copied().collect() }
}

/// Two names that are not one thing by construction.
pub(crate) fn pair<'a>(names: &[&'a str], random: &mut ChaCha8Rng) -> Vec<&'a str> {
    loop {
        let pair: Vec<&str> = names.sample(random, 2).copied().collect();
        let twins = TWINS.iter().any(|(a, b)| pair.contains(a) && pair.contains(b));
        if !twins {
            return pair;
        }
    }
}

/// An effect with a drawn size, for a 1:10 or a larger car on a lap of some length.
pub(crate) fn sized(
    name: &str,
    small: bool,
    lap_m: f64,
    random: &mut ChaCha8Rng,
) -> Result<EffectSetting, WithheldError> {
    let spec = effect_spec(name)?;
    let factor = random.random_range(0.25_f64.ln()..2.0_f64.ln()).exp();
    let sign = if ONE_SIGN.contains(&name) || random.random_bool(0.5) { 1.0 } else { -1.0 };
    let mut values = typical_values(spec, small);
    for (value, parameter) in values.iter_mut().zip(spec.parameters) {
        if let Some(null) = parameter.null {
            *value = null + sign * factor * (*value - null);
        }
    }
    match name {
        // The slower the servo, the stronger the effect.
        "steering_rate_limit" => values.iter_mut().for_each(|rate| *rate /= factor),
        "low_grip_patch" => {
            values = vec![
                (values.first().copied().unwrap_or(0.0)).min(0.6),
                lap_m * random.random_range(0.1..0.5),
                lap_m * random.random_range(0.03..0.08),
            ];
        }
        _ => {}
    }
    Ok(EffectSetting::new(name, &values)?)
}

/// An effect at its typical size for a car.
pub(crate) fn typical(name: &str, scenario: &Scenario) -> Result<EffectSetting, WithheldError> {
    let small = scenario.car.wheelbase_m() < 1.0;
    Ok(EffectSetting::new(name, &typical_values(effect_spec(name)?, small))?)
}

fn typical_values(spec: &EffectSpec, small: bool) -> Vec<f64> {
    spec.parameters.iter().map(|p| if small { p.typical_small } else { p.typical }).collect()
}

/// Length of the scenario's lap.
pub(crate) fn lap_m(scenario: &Scenario) -> Result<f64, WithheldError> {
    match &scenario.course {
        Course::Track { name, reversed } => {
            Ok(Track::by_name(name, scenario.car.track_scale, *reversed)?.length_m())
        }
        _ => Ok(0.0),
    }
}

/// The parameters that size an effect; the others place it.
pub(crate) fn sizing(spec: &EffectSpec) -> impl Iterator<Item = &'static str> {
    let parameters: &'static [_] = spec.parameters;
    parameters.iter().filter(|p| p.null.is_some()).map(|p| p.name)
}

/// The list of effects to leave out: drawn, without those at work, or with `deleted` among them; sorted.
pub(crate) fn left_out(at_work: &[&str], deleted: Option<&str>, random: &mut ChaCha8Rng) -> Vec<String> {
    let mut others = names(true);
    others.retain(|name| !at_work.contains(name));
    others.shuffle(random);
    let mut list: Vec<String> = deleted.into_iter().chain(others).take(LEFT_OUT).map(str::to_owned).collect();
    list.sort();
    list
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn lists_of_effects_to_leave_out_have_one_length_and_hide_what_is_deleted() {
        let random = &mut ChaCha8Rng::seed_from_u64(3);
        for _ in 0..50 {
            let kept = left_out(&["gyro_bias"], None, random);
            let deleted = left_out(&["gyro_bias"], Some("gyro_bias"), random);
            assert!(kept.len() == LEFT_OUT && deleted.len() == LEFT_OUT);
            assert!(!kept.contains(&"gyro_bias".to_owned()) && deleted.contains(&"gyro_bias".to_owned()));
            assert!(deleted.is_sorted());
        }
    }

    #[test]
    fn what_a_car_may_have_anyway_is_no_effect() {
        let car = CarParameters::by_name("f1tenth").unwrap();
        let own = car.own_effects(1.0);
        let of = |name: &str, share: f64| {
            let mut effect = own.iter().find(|e| e.name == name).unwrap().clone();
            effect.parameters.values_mut().for_each(|v| *v *= share);
            beyond_usual(&car, 1.0, &effect)
        };
        for name in BACKGROUND {
            assert_eq!(of(name, 0.25), 0.0);
            assert!((of(name, 0.9) - 2.0 / 3.0).abs() < 1e-12);
        }
        // Drag is put in, but no car of a batch has it otherwise.
        assert_eq!(of("aero_drag", 0.1), 1.0);
    }

    #[test]
    fn the_pools_share_no_track() {
        assert!(Pool::Test.tracks().iter().all(|t| !Pool::Development.tracks().contains(t)));
    }
}
