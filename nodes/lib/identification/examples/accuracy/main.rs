//! Scores the identification against true forces and true signal errors.
//!
//! ```text
//! accuracy reference FIRST_SEED            drives of the reference car, whose seeds count up from the first
//! accuracy bags FOLDER...                  bag folders with `truth_axle_forces.csv`
//! accuracy draws FROM TO DURATION_S [OFF SIGMA]
//!                                          drives drawn from seeds: what intervals, and claims of a peak, are worth; with a prior OFF from the road's mu
//! accuracy robustness                      one drive under worse and worse recording, and from other starts and priors
//! ```
//!
//! Writes a row a run to standard output (csv); `summary.py` beside the results makes the tables of it. No truth is read by the product.
//! The truth of an axle is the four-parameter Magic Formula fitted to the plant's own F_y/F_z at the slips of the single-track car ("floor").
mod cases;
mod robustness;
#[allow(dead_code)]
#[path = "../support/mod.rs"]
mod support;

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result, bail};
use gripsight_identification::{Config, FrictionPrior, ResidualKind, identify};
use support::{Run, balanced, floor, read_with_truth, reference, reference_run, score, truth_of};

/// Drives of the reference car with all background effects, perfect mounting and no signal errors: car, track, friction, pace.
const DRIVES: [(&str, &str, f64, f64); 16] = [
    ("f1tenth", "club", 0.9, 0.9),
    ("f1tenth", "esses", 0.7, 0.95),
    ("f1tenth", "bean", 1.1, 0.95),
    ("f1tenth", "clover", 0.8, 0.9),
    ("formula_student", "club", 0.9, 0.9),
    ("formula_student", "clover", 0.7, 0.95),
    ("formula_student", "esses", 1.1, 0.95),
    ("formula_student", "bean", 0.8, 0.9),
    ("race_car", "club", 0.9, 0.95),
    ("race_car", "clover", 0.8, 0.95),
    ("race_car", "esses", 0.7, 0.95),
    ("race_car", "bean", 1.0, 0.9),
    ("passenger_car", "club", 0.9, 0.95),
    ("passenger_car", "clover", 0.7, 0.95),
    ("passenger_car", "esses", 0.8, 0.95),
    ("passenger_car", "bean", 1.0, 0.9),
];

const SIGNALS: [&str; 6] = ["delay", "gain", "offset", "lever", "vybias", "gyro"];

/// The columns of [`row`].
fn header() -> String {
    let axle = |a: char| format!("k{a}_true,k{a},k{a}_lo,k{a}_hi");
    let peak = |a: char| format!("d{a}_floor,d{a}_true,d{a},d{a}_lo,d{a}_hi,d{a}_reached");
    let signals = SIGNALS.map(|n| format!("{n}_true,{n},{n}_lo,{n}_hi")).join(",");
    format!(
        "run,rmse_f,floor_f,rmse_r,floor_r,balanced_rmse_f,balanced_floor_f,balanced_rmse_r,balanced_floor_r,{},{},{},{},{signals},relax,combined,transfer,slip_f,slip_r,seconds,iterations,accepted,reasons",
        axle('f'),
        axle('r'),
        peak('f'),
        peak('r')
    )
}

/// Identifies a run and sets the result beside the truth; `signals` are the errors put into it.
pub(crate) fn row(
    run: &Run,
    signals: [f64; 6],
    prior: Option<FrictionPrior>,
    config: &Config,
) -> Result<String> {
    let begin = Instant::now();
    let outcome = identify(&run.sequence, &run.vehicle, prior, None, config, &mut |_| {})
        .with_context(|| run.name.clone())?;
    let seconds = begin.elapsed().as_secs_f64();
    let floors = [floor(&run.truth.front)?, floor(&run.truth.rear)?];
    let rmse = score(&outcome.phi_p, &run.truth);
    let loads_n = [run.vehicle.static_load_front_n(), run.vehicle.static_load_rear_n()];
    let mut cells = vec![run.name.clone()];
    let mut add = |values: &[f64]| cells.extend(values.iter().map(|v| format!("{v:.4}")));
    add(&[rmse[0], floors[0].1, rmse[1], floors[1].1]);
    let truth = balanced(&run.truth, &run.vehicle);
    let rmse = score(&outcome.phi_p, &truth);
    add(&[rmse[0], floor(&truth.front)?.1, rmse[1], floor(&truth.rear)?.1]);
    let stiffness = &outcome.cornering_stiffness_n_per_rad;
    for (k, load_n, floor) in
        [(&stiffness.front, loads_n[0], &floors[0]), (&stiffness.rear, loads_n[1], &floors[1])]
    {
        add(&[floor.0.normalized_stiffness(), k.value / load_n, k.low / load_n, k.high / load_n]);
    }
    let peak = &outcome.peak_friction;
    for (d, truth, floor) in
        [(&peak.front, &run.truth.front, &floors[0]), (&peak.rear, &run.truth.rear, &floors[1])]
    {
        let furthest = truth.slip_rad.iter().fold(0.0_f64, |most, slip| most.max(slip.abs()));
        let reached = f64::from(u8::from(d.reached));
        add(&[floor.0.d, floor.0.max_force_within(furthest), d.value, d.low, d.high, reached]);
    }
    let found = &outcome.signal_intervals;
    let found = [
        found.steering_delay_s,
        found.steering_gain,
        found.steering_offset_rad,
        found.v_y_lever_arm_m,
        found.v_y_bias_mps,
        found.yaw_rate_bias_radps,
    ];
    for (truth, e) in signals.iter().zip(found) {
        add(&[*truth, e.value, e.low, e.high]);
    }
    let nuisance = &outcome.nuisance;
    add(&[nuisance.relaxation_m, nuisance.combined_slip, nuisance.load_transfer]);
    let slips = outcome.slip_range_rad.map(|slip| slip.high.max(-slip.low));
    add(&[slips.front, slips.rear, seconds]);
    cells.push(outcome.iterations.to_string());
    cells.push(u8::from(outcome.accepted).to_string());
    cells.push(format!("\"{}\"", outcome.reasons.join(" | ").replace('"', "'")));
    Ok(cells.join(","))
}

/// Signals without errors, but for the hold of a command.
const PLAIN: [f64; 6] = [0.5 * cases::HOLD_S, 1.0, 0.0, 0.0, 0.0, 0.0];

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((mode, rest)) = arguments.split_first() else { bail!("reference, bags, draws or robustness?") };
    println!("{}", header());
    match (mode.as_str(), rest) {
        ("reference", [first]) => {
            for ((car, track, mu, pace), seed) in DRIVES.into_iter().zip(first.parse::<u64>()?..) {
                let run = reference_run(car, track, mu, pace, seed, true);
                println!("{}", row(&run, PLAIN, None, &Config::default())?);
            }
        }
        ("bags", folders) => {
            for folder in folders {
                let run = read_with_truth(Path::new(folder), f64::INFINITY)?;
                println!("{}", row(&run, PLAIN, None, &Config::default())?);
            }
        }
        ("draws", [from, to, duration_s, prior @ ..]) => {
            let off = match prior {
                [off, sigma] => Some((off.parse::<f64>()?, sigma.parse()?)),
                _ => None,
            };
            let config = Config { residual: ResidualKind::None, ..Config::default() };
            for seed in from.parse()?..to.parse()? {
                let case = cases::draw(seed, duration_s.parse()?)?;
                let road = case.scenario.friction.nominal();
                let prior = off.map(|(off, sigma)| FrictionPrior { mu: (road + off).max(0.1), sigma });
                let (recording, sequence, vehicle) = reference::drive(case.scenario);
                let truth = truth_of(&recording, &vehicle);
                let run = Run { name: case.name, vehicle, sequence, truth };
                println!("{}", row(&run, case.signals, prior, &config)?);
            }
        }
        ("robustness", []) => robustness::run()?,
        _ => bail!("unknown arguments {arguments:?}"),
    }
    Ok(())
}
