//! Scores what sets promise against true forces.
//!
//! ```text
//! envelope draws FROM TO DURATION_S          drives of the reference car drawn from seeds, at paces from a stroll to the limit
//! envelope bags FOLDER...                    bag folders, with `truth_axle_forces.csv` where a plant knows its forces
//! envelope priors FROM TO DURATION_S         the same drives with friction priors off by -0.6 to 0.6, of any sigma
//! envelope grip FROM TO                      drives whose grip falls, or does not, while the set found before is watched
//! envelope floors FROM TO                    drives over two floors: what the set of each promises
//! envelope paces FROM TO                     the same on one floor at two paces: none should be cut
//! ```
//!
//! Writes a row a run to standard output (csv); `envelope.py` beside the results makes the tables of it. No truth is read by the product.
//! The truth of an axle is the four-parameter Magic Formula fitted to the plant's own F_y/F_z ("floor"), as in `accuracy`.
#[allow(dead_code)]
#[path = "../accuracy/cases.rs"]
mod cases;
mod floors;
mod grip;
#[allow(dead_code)]
#[path = "../support/mod.rs"]
mod support;

use std::path::Path;
use std::time::Instant;

use anyhow::{Result, bail};
use gripsight_identification::{
    Config, FrictionPrior, Outcome, PeakFriction, PerAxle, ResidualKind, Status, identify,
};
use gripsight_reference_car::TireParameters;
use gripsight_vehicle::MagicFormula;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::{Run, Truth, floor, read, read_with_truth, reference, truth_of};

/// Paces drawn, as shares of the grip that the driver plans to use.
const PACES: (f64, f64) = (0.35, 1.0);
/// How far a prior may be off.
const OFF: f64 = 0.6;
/// A peak counts as reached from this share of it on.
const PLATEAU: f64 = 0.95;

/// What is known of an axle.
struct Known {
    truth: Option<Truth>,
    /// Slip at which the tire gives [`PLATEAU`] of its peak, and that peak over the load, where they are known by its formula.
    plateau_rad: Option<f64>,
    peak: Option<f64>,
}

fn header() -> String {
    let axle = |a: char| {
        format!(
            "over_{a},over_found_{a},short_{a},slip_{a},plateau_{a},reached_{a},said_{a},k_true_{a},k_{a},k_lo_{a},k_hi_{a},d_true_{a},d_{a},d_set_{a},d_prior_{a},over_prior_{a},over_shown_{a},peak_true_{a}"
        )
    };
    format!("run,mu,pace,prior,sigma,status,seconds,v_max,unstable,{},{},reasons", axle('f'), axle('r'))
}

/// Largest force over a true curve that a set promises within some slips, over a peak.
fn over(set: &MagicFormula, truth: &MagicFormula, within_rad: f64, peak: f64) -> f64 {
    let slips = (1..=200).map(|k| within_rad * f64::from(k) / 200.0);
    slips
        .map(|slip| (set.normalized_force(slip) - truth.normalized_force(slip)) / peak)
        .fold(f64::NEG_INFINITY, f64::max)
}

fn axle(outcome: &Outcome, known: &Known, front: bool) -> Result<Vec<f64>> {
    let of = |front_value: f64, rear: f64| if front { front_value } else { rear };
    let tires = |t: &gripsight_vehicle::PacejkaParameters| if front { t.front } else { t.rear };
    let pick = |p: &PerAxle<PeakFriction>| if front { p.front } else { p.rear };
    let (set, found, said) = (tires(&outcome.phi_p), tires(&outcome.found), pick(&outcome.peak_friction));
    let slip = if front { outcome.slip_range_rad.front } else { outcome.slip_range_rad.rear };
    let driven_rad = slip.high.max(-slip.low);
    let valid_rad = of(outcome.valid_within.slip_rad.front, outcome.valid_within.slip_rad.rear);
    let within = if valid_rad.is_finite() { valid_rad } else { driven_rad };
    let stiffness = &outcome.cornering_stiffness_n_per_rad;
    let k = if front { stiffness.front } else { stiffness.rear };
    let load_n = of(outcome.vehicle.static_load_front_n(), outcome.vehicle.static_load_rear_n());
    let mut row = vec![f64::NAN; 18];
    let truth = known.truth.as_ref().map(floor).transpose()?.map(|(truth, _)| truth);
    if let Some(truth) = &truth {
        // Over the peak of the plant's tire; where it is not known, over the largest force driven.
        let shown = truth.max_force_within(driven_rad);
        let peak = known.peak.unwrap_or(shown).max(shown);
        row[0] = over(&set, truth, within, peak);
        row[1] = over(&found, truth, driven_rad, peak);
        row[16] = over(&set, truth, within, shown);
        row[17] = peak;
        row[2] = 1.0 - set.max_force_within(within) / truth.max_force_within(driven_rad);
        let plateau = known.plateau_rad.unwrap_or_else(|| {
            let rising = (1..2000).map(|k| f64::from(k) * 1e-3);
            rising.into_iter().find(|&a| truth.normalized_force(a) >= PLATEAU * truth.d).unwrap_or(f64::NAN)
        });
        row[4] = plateau;
        row[5] = f64::from(u8::from(driven_rad >= plateau));
        row[7] = truth.normalized_stiffness();
        row[11] = truth.max_force_within(driven_rad);
    }
    (row[3], row[6]) = (driven_rad, f64::from(u8::from(said.reached)));
    (row[8], row[9], row[10]) = (k.value / load_n, k.low / load_n, k.high / load_n);
    (row[12], row[13]) = (found.d, set.d);
    if let Some(set) = &outcome.provisional {
        let peak = pick(&set.peak_friction);
        row[14] = if peak.from_prior { peak.value } else { f64::NAN };
        if let Some(truth) = &truth {
            row[15] = over(&tires(&set.phi_p), truth, driven_rad, row[17]);
        }
    }
    Ok(row)
}

/// Identifies a run and sets what it promises beside the truth.
fn row(
    run: &Run,
    known: &PerAxle<Known>,
    mu: f64,
    pace: f64,
    prior: Option<FrictionPrior>,
) -> Result<String> {
    let config = Config { residual: ResidualKind::None, ..Config::default() };
    let begin = Instant::now();
    let outcome = match identify(&run.sequence, &run.vehicle, prior, None, &config, &mut |_| {}) {
        Ok(outcome) => outcome,
        Err(error) => {
            return Ok(format!("{},{mu},{pace},,,failed,,,{},\"{error}\"", run.name, ",".repeat(35)));
        }
    };
    let seconds = begin.elapsed().as_secs_f64();
    let mut cells = vec![run.name.clone()];
    let mut add = |values: &[f64]| cells.extend(values.iter().map(|v| format!("{v:.4}")));
    add(&[mu, pace, prior.map_or(f64::NAN, |p| p.mu), prior.map_or(f64::NAN, |p| p.sigma)]);
    cells.push(outcome.status.name().to_owned());
    let unstable = |tires| {
        gripsight_vehicle::handling::straight_line_growth_rate_1ps(
            &run.vehicle,
            tires,
            outcome.v_x_range_mps.high,
        ) > 0.0
    };
    let unstable = outcome.status != Status::Rejected && unstable(&outcome.phi_p);
    let mut add = |values: &[f64]| cells.extend(values.iter().map(|v| format!("{v:.4}")));
    add(&[seconds, outcome.v_x_range_mps.high, f64::from(u8::from(unstable))]);
    add(&axle(&outcome, &known.front, true)?);
    add(&axle(&outcome, &known.rear, false)?);
    cells.push(format!("\"{}\"", outcome.reasons.join(" | ").replace('"', "'")));
    Ok(cells.join(","))
}

/// Slip at which a tire of the reference car gives [`PLATEAU`] of its peak: the brush with elliptic pressure of its `tire.rs`.
fn plateau_rad(tire: &TireParameters, road: f64) -> f64 {
    const FALL: f64 = 2.0;
    let shape = |s: f64| {
        let brush = std::f64::consts::FRAC_2_PI * (s.atan() + s / (1.0 + s * s));
        brush * (1.0 - (1.0 - tire.sliding_share) * s * s / (s * s + FALL * FALL))
    };
    let slips = || (1..12_000).map(|k| f64::from(k) * 1e-3);
    let peak = slips().map(shape).fold(0.0, f64::max);
    let slip = slips().find(|&s| shape(s) >= PLATEAU * peak).unwrap_or(f64::NAN);
    let limit = road * tire.grip / peak;
    (slip * 4.0 / std::f64::consts::PI * limit / tire.cornering_stiffness_per_rad).atan()
}

/// A drive of the reference car from a seed.
fn drawn(seed: u64, duration_s: f64) -> Result<(Run, PerAxle<Known>, f64, f64)> {
    let mut case = cases::draw(seed, duration_s)?;
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x00ab_cdef);
    let pace = random.random_range(PACES.0..PACES.1);
    case.scenario.driver.pace = pace;
    let (car, mu) = (case.scenario.car.clone(), case.scenario.friction.nominal());
    let (recording, sequence, vehicle) = reference::drive(case.scenario);
    let truth = truth_of(&recording, &vehicle);
    let known = |truth: &Truth, tire: &TireParameters| Known {
        truth: Some(truth.clone()),
        plateau_rad: Some(plateau_rad(tire, mu)),
        peak: Some(mu * tire.grip),
    };
    let known =
        PerAxle { front: known(&truth.front, &car.tire_front), rear: known(&truth.rear, &car.tire_rear) };
    let name = format!("{} pace {pace:.2}", case.name);
    Ok((Run { name, vehicle, sequence, truth }, known, mu, pace))
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((mode, rest)) = arguments.split_first() else {
        bail!("draws, bags, priors, grip, floors or paces?")
    };
    if let ("grip", [from, to]) = (mode.as_str(), rest) {
        return grip::run(from.parse()?, to.parse()?);
    }
    if let ("floors", [from, to]) = (mode.as_str(), rest) {
        return floors::run(from.parse()?, to.parse()?, true);
    }
    if let ("paces", [from, to]) = (mode.as_str(), rest) {
        return floors::run(from.parse()?, to.parse()?, false);
    }
    println!("{}", header());
    match (mode.as_str(), rest) {
        ("draws" | "priors", [from, to, duration_s]) => {
            for seed in from.parse::<u64>()?..to.parse()? {
                let (run, known, mu, pace) = drawn(seed, duration_s.parse()?)?;
                let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x0bad_beef);
                let prior = (mode == "priors").then(|| {
                    let off: f64 = random.random_range(-OFF..OFF);
                    let sigma: f64 = 0.03 * 15_f64.powf(random.random_range(0.0..1.0));
                    FrictionPrior { mu: (mu + off).max(0.1), sigma }
                });
                println!("{}", row(&run, &known, mu, pace, prior)?);
            }
        }
        ("bags", folders) => {
            for folder in folders.iter().map(Path::new) {
                let with_truth = folder.join("truth_axle_forces.csv").exists();
                let run = if with_truth {
                    read_with_truth(folder, f64::INFINITY)?
                } else {
                    let (vehicle, sequence) = read(folder, f64::INFINITY)?;
                    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
                    Run { name, vehicle, sequence, truth: PerAxle::default() }
                };
                let known = run.truth.clone().map(|t| Known {
                    truth: with_truth.then_some(t),
                    plateau_rad: None,
                    peak: None,
                });
                println!("{}", row(&run, &known, f64::NAN, f64::NAN, None)?);
            }
        }
        _ => bail!("unknown arguments {arguments:?}"),
    }
    Ok(())
}
