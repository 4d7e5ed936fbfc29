//! What becomes of recordings whose signals lie or are missing: drives of the reference car with known tires.
//!
//! ```text
//! signals no_v_y FROM TO DURATION_S      v_y measured, and estimated from poses of four kinds of localisation
//! signals lies FROM TO DURATION_S        signals scaled, turned, in other units, or made by an observer, with poses and an inertial unit and without
//! signals bags FOLDER...                 bag folders: v_y as recorded, and estimated from the poses recorded
//! signals foreign FOLDER...              the bag folders of other plants with their true forces: v_y as recorded, and estimated as with no_v_y
//! signals delays FOLDER...               the same bags: the delay of the poses that is found, and its standard deviation
//! signals honest FROM TO DURATION_S      what the cross checks give on honest drives: the tolerances rest on it
//! ```
//!
//! Writes a row a run to standard output (csv); `signals.py` beside the results makes the tables of it.
#[allow(dead_code)]
#[path = "../accuracy/cases.rs"]
mod cases;
mod lies;
mod steady;
#[allow(dead_code)]
#[path = "../support/mod.rs"]
mod support;

use std::path::Path;

use anyhow::{Result, bail};
use gripsight_identification::{
    Config, FrictionPrior, Outcome, PerAxle, ResidualKind, Usable, identify, understeer_rad,
};
use gripsight_reference_car::Recording;
use gripsight_signals::StateSequence;
use gripsight_state_estimation::smooth;
use gripsight_vehicle::{GRAVITY_MPS2, MagicFormula, PacejkaParameters, VehicleParameters};
use lies::{LOCALISATIONS, lies, localised};
use support::{Truth, floor, read, read_with_truth, reference, truth_of};

/// The seeds of the noise of poses are apart from those of drives.
const POSE_SEED: u64 = 0x00b0_5e5e;

fn quick() -> Config {
    Config { residual: ResidualKind::None, ..Config::default() }
}

const HEADER: &str = "run,what,status,k_true_f,k_f,k_lo_f,k_hi_f,over_f,slip_f,d_true_f,d_f,k_true_r,k_r,k_lo_r,k_hi_r,over_r,slip_r,d_true_r,d_r,\
    understeer_true,understeer,understeer_lo,understeer_hi,estimated,v_y_sigma,delay,reason";

/// Largest promise above the true curve within the slips, over the largest true force driven.
fn over(set: &MagicFormula, truth: &MagicFormula, within_rad: f64, shown: f64) -> f64 {
    let slips = (1..=200).map(|k| within_rad * f64::from(k) / 200.0);
    slips
        .map(|slip| (set.normalized_force(slip) - truth.normalized_force(slip)) / shown)
        .fold(f64::NEG_INFINITY, f64::max)
}

/// Understeer gradient of the true curves over the lateral accelerations that the one found is of, rad per m/s2: what is known of plants that cannot be
/// asked for a steady turn.
fn of_curves(truth: &PerAxle<MagicFormula>, up_to_a_y_mps2: f64) -> f64 {
    let tires = PacejkaParameters { front: truth.front, rear: truth.rear };
    understeer_rad(&tires, up_to_a_y_mps2 / GRAVITY_MPS2) / up_to_a_y_mps2
}

/// The true understeer gradient up to a lateral acceleration, rad per m/s2.
type Gradient<'a> = &'a dyn Fn(f64) -> f64;

/// A row of one identification.
fn row(
    run: &str,
    what: &str,
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    truth: Option<&PerAxle<MagicFormula>>,
    gradient: Gradient<'_>,
    prior: Option<FrictionPrior>,
) -> String {
    let outcome = match identify(sequence, vehicle, prior, None, &quick(), &mut |_| {}) {
        Ok(outcome) => outcome,
        Err(error) => return format!("{run},{what},failed{}\"{error}\"", ",".repeat(24)),
    };
    let mut cells = vec![run.to_owned(), what.to_owned(), outcome.status.name().to_owned()];
    let o = &outcome;
    let loads_n = PerAxle { front: vehicle.static_load_front_n(), rear: vehicle.static_load_rear_n() };
    let axle = |front: bool| -> Vec<f64> {
        let pick = |p: &PerAxle<f64>| if front { p.front } else { p.rear };
        let (k, slip) = if front {
            (o.cornering_stiffness_n_per_rad.front, o.slip_range_rad.front)
        } else {
            (o.cornering_stiffness_n_per_rad.rear, o.slip_range_rad.rear)
        };
        let (set, found) = if front { (o.phi_p.front, o.found.front) } else { (o.phi_p.rear, o.found.rear) };
        let true_curve = truth.map(|t| if front { t.front } else { t.rear });
        let driven = slip.high.max(-slip.low);
        let valid = pick(&o.valid_within.slip_rad);
        let within = if valid.is_finite() { valid } else { driven };
        let load_n = pick(&loads_n);
        let shown = |t: &MagicFormula| t.max_force_within(driven);
        let nan = f64::NAN;
        vec![
            true_curve.map_or(nan, |t| t.normalized_stiffness() * load_n),
            k.value,
            k.low,
            k.high,
            true_curve.filter(|_| o.accepted).map_or(nan, |t| over(&set, &t, within, shown(&t))),
            driven,
            true_curve.map_or(nan, |t| shown(&t)),
            found.max_force_within(driven),
        ]
    };
    cells.extend(axle(true).iter().chain(&axle(false)).map(|v| format!("{v:.4}")));
    let found = o.handling.understeer_gradient_rad_per_mps2;
    let truth = gradient(o.handling.up_to_a_y_mps2);
    for value in [truth, found.value, found.low, found.high] {
        cells.push(format!("{:.4}", (value * GRAVITY_MPS2).to_degrees()));
    }
    cells.extend(estimated(o));
    cells.push(format!("\"{}\"", o.reasons.join(" | ").replace('"', "'")));
    cells.join(",")
}

/// Channels estimated, the standard deviation of v_y, and the delay of the poses.
fn estimated(outcome: &Outcome) -> [String; 3] {
    let Some(motion) = &outcome.recorded.estimated else {
        return [String::new(), String::new(), String::new()];
    };
    let names: Vec<&str> = motion.channels.iter().map(|c| c.channel).collect();
    let sigma = motion
        .channels
        .iter()
        .filter(|c| c.channel == "v_y_mps")
        .map(|c| format!("{:.4}", c.sigma))
        .collect();
    let delay = motion.pose_delay_s.map(|d| format!("{:.4}", d.value)).unwrap_or_default();
    [names.join(" "), sigma, delay]
}

struct Drive {
    name: String,
    sequence: StateSequence,
    vehicle: VehicleParameters,
    truth: PerAxle<MagicFormula>,
    mu: f64,
    case: cases::Case,
    recording: Recording,
}

impl Drive {
    /// The plant's own, at the speed of this drive's turns.
    fn gradient(&self, a_y_mps2: f64) -> f64 {
        let speed_mps = steady::speed_in_turns_mps(&self.recording, a_y_mps2);
        speed_mps.and_then(|v| steady::understeer_rad_per_mps2(&self.case, v, a_y_mps2)).unwrap_or(f64::NAN)
    }
}

fn drawn(seed: u64, duration_s: f64) -> Result<Drive> {
    let case = cases::draw(seed, duration_s)?;
    let mu = case.scenario.friction.nominal();
    let (recording, sequence, vehicle) = reference::drive(case.scenario.clone());
    let truth = truth_of(&recording, &vehicle);
    let curve = |t: &Truth| floor(t).map(|(curve, _)| curve);
    let truth = PerAxle { front: curve(&truth.front)?, rear: curve(&truth.rear)? };
    Ok(Drive { name: case.name.clone(), sequence, vehicle, truth, mu, case, recording })
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let Some((mode, rest)) = arguments.split_first() else {
        bail!("no_v_y, lies, bags, foreign, delays or honest?")
    };
    match mode.as_str() {
        "honest" => {}
        "delays" => println!("run,what,delay_s,found_s,sigma_s"),
        _ => println!("{HEADER}"),
    }
    match (mode.as_str(), rest) {
        ("no_v_y", [from, to, duration_s]) => {
            for seed in from.parse::<u64>()?..to.parse()? {
                let d = drawn(seed, duration_s.parse()?)?;
                let row = |what, sequence: &_| {
                    row(&d.name, what, sequence, &d.vehicle, Some(&d.truth), &|a_y| d.gradient(a_y), None)
                };
                println!("{}", row("v_y measured", &d.sequence));
                for (what, localisation) in LOCALISATIONS {
                    let mut sequence = localised(&d.sequence, localisation, seed ^ POSE_SEED);
                    sequence.v_y_mps.fill(0.0);
                    println!("{}", row(what, &sequence));
                }
            }
        }
        ("lies", [from, to, duration_s]) => {
            for seed in from.parse::<u64>()?..to.parse()? {
                let d = drawn(seed, duration_s.parse()?)?;
                let prior = Some(FrictionPrior { mu: d.mu + 0.33, sigma: 0.1 });
                let what = "friction prior 0.33 too high; beside it poses and IMU";
                // What lies is about forces: no steady turn is driven for it.
                let row = |what: &str, sequence: &_, prior| {
                    let gradient = |a_y| of_curves(&d.truth, a_y);
                    row(&d.name, what, sequence, &d.vehicle, Some(&d.truth), &gradient, prior)
                };
                println!("{}", row(what, &d.sequence, prior));
                for (what, sequence) in lies(&d.sequence, &d.vehicle, &d.truth, seed ^ POSE_SEED) {
                    println!("{}", row(&what, &sequence, None));
                }
            }
        }
        ("bags", folders) => {
            for folder in folders.iter().map(Path::new) {
                let (vehicle, sequence) = read(folder, f64::INFINITY)?;
                let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let row =
                    |what, sequence: &_| row(&name, what, sequence, &vehicle, None, &|_| f64::NAN, None);
                println!("{}", row("as recorded", &sequence));
                let mut without = sequence.clone();
                without.v_y_mps.fill(0.0);
                println!("{}", row("without v_y", &without));
            }
        }
        ("foreign", folders) => {
            for folder in folders.iter().map(Path::new) {
                let run = read_with_truth(folder, f64::INFINITY)?;
                let curve = |t: &Truth| floor(t).map(|(curve, _)| curve);
                let truth = PerAxle { front: curve(&run.truth.front)?, rear: curve(&run.truth.rear)? };
                let row = |what, sequence: &_| {
                    let gradient = |a_y| of_curves(&truth, a_y);
                    row(&run.name, what, sequence, &run.vehicle, Some(&truth), &gradient, None)
                };
                println!("{}", row("v_y measured", &run.sequence));
                for (place, (what, localisation)) in LOCALISATIONS.into_iter().enumerate() {
                    let mut sequence = localised(&run.sequence, localisation, place as u64 ^ POSE_SEED);
                    sequence.v_y_mps.fill(0.0);
                    println!("{}", row(what, &sequence));
                }
            }
        }
        ("delays", folders) => {
            for (seed, folder) in (0..).zip(folders.iter().map(Path::new)) {
                let run = read_with_truth(folder, f64::INFINITY)?;
                for (what, localisation) in LOCALISATIONS {
                    let mut sequence = localised(&run.sequence, localisation, seed ^ POSE_SEED);
                    sequence.v_y_mps.fill(0.0);
                    let (found_s, sigma_s) = smooth(&sequence)?.pose_delay_s.unwrap_or((f64::NAN, f64::NAN));
                    println!("{},{what},{},{found_s:.5},{sigma_s:.5}", run.name, localisation.delay_s);
                }
            }
        }
        ("honest", [from, to, duration_s]) => {
            println!("run,what,pair,finding,ratio,low,high,spans");
            for seed in from.parse::<u64>()?..to.parse()? {
                let d = drawn(seed, duration_s.parse()?)?;
                honest(&d.name, "odometry", &d.sequence, &d.vehicle)?;
                for (what, localisation) in LOCALISATIONS {
                    honest(
                        &d.name,
                        what,
                        &localised(&d.sequence, localisation, seed ^ POSE_SEED),
                        &d.vehicle,
                    )?;
                }
            }
        }
        _ => bail!("unknown arguments {arguments:?}"),
    }
    Ok(())
}

/// What every check gives.
fn honest(run: &str, what: &str, sequence: &StateSequence, vehicle: &VehicleParameters) -> Result<()> {
    for c in Usable::of(sequence, vehicle)?.recorded.checks.checks {
        let [pair, finding] =
            [serde_json::to_value(c.pair)?, serde_json::to_value(c.finding)?["kind"].clone()]
                .map(|v| v.as_str().unwrap_or_default().to_owned());
        println!("{run},{what},{pair},{finding},{:.4},{:.4},{:.4},{}", c.ratio, c.low, c.high, c.spans);
    }
    Ok(())
}
