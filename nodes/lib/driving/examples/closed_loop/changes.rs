//! Floors that change in the middle of the run: how far until the car drives to the new grip, and how often it leaves the track on the way.

use std::fmt::Write as _;
use std::time::Instant;

use anyhow::Result;
use gripsight_driving::{Controller, TireSet};
use gripsight_reference_car::CarParameters;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::drive::Loop;
use crate::run::{Case, Variant};
use crate::store::{Store, mean, median, parts, quantile};
use crate::{Arguments, plant};

/// Frictions of a dry and of a wet floor, between which each run draws its own.
const DRY: (f64, f64) = (0.8, 1.0);
const WET: (f64, f64) = (0.4, 0.6);
/// Whole laps on a floor before it changes somewhere in the next.
const LAPS: usize = 4;
/// Floors of a run.
const FLOORS: usize = 3;
/// Plan over the new floor's grip from which a car is too fast for it, and below which it has not yet found it.
const TOO_FAST: f64 = 1.05;
const FOUND: f64 = 0.9;

/// What the driver learns of the change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Knows {
    /// Nothing: it drives on the first floor's true tires.
    Untold,
    /// What is identified while driving.
    Identified,
    /// The same with a prior as good as the camera's, which sees the new floor.
    Prior,
    /// The true tires of the new floor, at the change.
    Told,
}

impl Knows {
    const ALL: [Self; 4] = [Self::Untold, Self::Identified, Self::Prior, Self::Told];

    fn name(self) -> &'static str {
        match self {
            Self::Untold => "untold",
            Self::Identified => "identified",
            Self::Prior => "with_prior",
            Self::Told => "told",
        }
    }
}

/// A change. A run that ends before has none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Row {
    car: String,
    track: String,
    seed: u64,
    knows: String,
    /// From 1.
    change: usize,
    mu_before: f64,
    mu_after: f64,
    lap_m: f64,
    /// Place of the change.
    station_m: f64,
    speed_mps: f64,
    /// Distance until the plan fits the new floor; empty: never.
    distance_m: Option<f64>,
    /// Whole laps after the change.
    lap_1_s: Option<f64>,
    lap_2_s: Option<f64>,
    lap_3_s: Option<f64>,
    /// Times off the track, until the lap after the change ends and until the floor changes again.
    exits_at_once: u32,
    exits: u32,
    worst_m: f64,
    wreck: String,
    run_seconds: f64,
}

impl Row {
    fn wet(&self) -> bool {
        self.mu_after < self.mu_before
    }
}

/// A run's floors.
struct Plan {
    case: Case,
    knows: Knows,
    /// Friction, the plant's tires on it, and the share of the lap after [`LAPS`] where it ends.
    floors: Vec<(f64, TireSet, f64)>,
}

/// Drives what was asked for and is not in changes.csv yet; the summary.
pub(crate) fn experiment(arguments: &Arguments) -> Result<String> {
    arguments.check(&Knows::ALL.map(Knows::name))?;
    let store = Store::<Row>::open(&arguments.out.join("changes.csv"))?;
    let mut work = Vec::new();
    for car in &arguments.cars {
        let car = CarParameters::by_name(car)?;
        for seed in arguments.seeds() {
            for track in &arguments.tracks {
                let driven = |knows: Knows| {
                    store.rows.iter().any(|r| {
                        (r.car.as_str(), r.track.as_str(), r.seed, r.knows.as_str())
                            == (car.name.as_str(), track.as_str(), seed, knows.name())
                    })
                };
                let missing = |k: &Knows| arguments.asks_for(k.name()) && !driven(*k);
                let missing: Vec<Knows> = Knows::ALL.into_iter().filter(missing).collect();
                work.extend(missing.into_iter().map(|knows| (car.clone(), track.clone(), seed, knows)));
            }
        }
    }
    let rows = store.fill(work, arguments.verbose, |(car, track, seed, knows)| {
        let plan = plan(&car, &track, seed, knows, arguments.controller)?;
        drive(&plan, arguments.verbose)
    })?;
    Ok(summary(&rows))
}

fn plan(car: &CarParameters, track: &str, seed: u64, knows: Knows, controller: Controller) -> Result<Plan> {
    let name = track.bytes().fold(0_u64, |sum, b| sum.wrapping_mul(31).wrapping_add(u64::from(b)));
    let mut random = ChaCha8Rng::seed_from_u64(seed ^ name ^ 0x00f1_0075);
    let [dry, wet] = [DRY, WET].map(|(low, high)| parts(random.random_range(low..high), 1e2));
    // Both directions of the track begin on either floor.
    let wet_first = (seed / 2) % 2 == 1;
    let mut floors = Vec::new();
    for floor in 0..FLOORS {
        let mu = if (floor % 2 == 0) == wet_first { wet } else { dry };
        floors.push((mu, plant::projection(car, mu)?, random.random_range(0.05..0.95)));
    }
    let (mu, tires, _) = floors[0];
    let case =
        Case { car: car.clone(), track: track.to_owned(), mu, seed, laps: FLOORS * LAPS, tires, controller };
    Ok(Plan { case, knows, floors })
}

fn drive(plan: &Plan, verbose: bool) -> Result<Vec<Row>> {
    let begin = Instant::now();
    let Plan { case, knows, floors } = plan;
    let start = match knows {
        Knows::Untold | Knows::Told => case.tires,
        Knows::Identified | Knows::Prior => TireSet::start(),
    };
    let prior = |mu: f64, floor: usize| match knows {
        Knows::Prior => Variant::Prior.prior(mu, case.seed + 1000 * floor as u64),
        _ => None,
    };
    let mut run = Loop::new(case, start, verbose)?;
    if matches!(knows, Knows::Identified | Knows::Prior) {
        run.learn(prior(case.mu, 0));
    }
    if verbose {
        eprintln!("{} {} seed {} {}", case.car.name, case.track, case.seed, knows.name());
    }
    let lap_m = run.driver.track().length_m();
    let mut rows: Vec<Row> = Vec::new();
    let mut wreck = None;
    for (index, (mu, tires, ends)) in floors.iter().enumerate() {
        let grip = tires.grip();
        let (from_m, laps, exits) = (run.referee.along_m(), run.referee.laps.len(), run.referee.exits());
        let until_m = (laps as f64 + LAPS as f64 + if index > 0 { 1.0 } else { 0.0 } + ends) * lap_m;
        let longest_s = run.sim.time_s() + 4.0 * (LAPS + 2) as f64 * run.referee.fastest_lap_s();
        if index > 0 {
            let before = floors[index - 1].0;
            if verbose {
                eprintln!("  {:.1} s: {before} to {mu}, a grip of {grip:.3}", run.sim.time_s());
            }
            run.change_floor(*mu, *tires)?;
            if *knows == Knows::Told {
                run.driver.take(*tires)?;
            }
            if let Some(learner) = &mut run.learner {
                learner.look_again(prior(*mu, index));
            }
            rows.push(Row {
                car: case.car.name.clone(),
                track: case.track.clone(),
                seed: case.seed,
                knows: knows.name().to_owned(),
                change: index,
                mu_before: before,
                mu_after: *mu,
                lap_m: parts(lap_m, 1e2),
                station_m: parts(from_m % lap_m, 1e2),
                speed_mps: run.sim.now().map_or(f64::NAN, |now| parts(now.motion.v_x_mps, 1e2)),
                distance_m: None,
                lap_1_s: None,
                lap_2_s: None,
                lap_3_s: None,
                exits_at_once: 0,
                exits: 0,
                worst_m: 0.0,
                wreck: String::new(),
                run_seconds: 0.0,
            });
        }
        while wreck.is_none() && run.referee.along_m() < until_m {
            wreck = run.look()?;
            if run.sim.time_s() > longest_s {
                wreck = wreck.or(Some("too slow"));
            }
            let Some(row) = rows.last_mut().filter(|_| index > 0) else { continue };
            let planned = run.driver.grip();
            let fits = if row.wet() { planned <= TOO_FAST * grip } else { planned >= FOUND * grip };
            if fits && row.distance_m.is_none() {
                row.distance_m = Some(parts(run.referee.along_m() - from_m, 1e2));
            }
            row.exits = run.referee.exits() - exits;
            if run.referee.laps.len() <= laps + 1 {
                row.exits_at_once = row.exits;
            }
            row.worst_m = row.worst_m.max(parts(run.sim.now().map_or(0.0, |n| n.offset_m.abs()), 1e3));
        }
        if let Some(row) = rows.last_mut().filter(|_| index > 0) {
            let lap = |n: usize| run.referee.laps.get(laps + n).map(|lap| parts(lap.time_s, 1e3));
            (row.lap_1_s, row.lap_2_s, row.lap_3_s) = (lap(1), lap(2), lap(3));
            row.wreck = wreck.unwrap_or("").to_owned();
        }
        if wreck.is_some() {
            break;
        }
    }
    let run_seconds = parts(begin.elapsed().as_secs_f64(), 1e2);
    rows.iter_mut().for_each(|row| row.run_seconds = run_seconds);
    Ok(rows)
}

/// A table for each car.
fn summary(rows: &[Row]) -> String {
    let mut text = String::new();
    let mut cars: Vec<&str> = rows.iter().map(|r| r.car.as_str()).collect();
    cars.sort_unstable();
    cars.dedup();
    for car in cars {
        let _ = writeln!(
            text,
            "## {car}\n\n| change | driver | changes | distance until it drives to the new grip (laps), median | 90 % | never | lap 1 after | lap 2 | lap 3 | changes with an exit before the next lap ends | over those of who is told | exits | wrecks |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|"
        );
        for wet in [true, false] {
            for knows in Knows::ALL {
                // Who is never told comes back to a floor that it has never left.
                let of = |knows: Knows| {
                    rows.iter().filter(move |r| {
                        r.car == car
                            && r.wet() == wet
                            && r.knows == knows.name()
                            && (knows != Knows::Untold || r.change == 1)
                    })
                };
                let told = |r: &Row| {
                    of(Knows::Told).find(|t| (&t.track, t.seed, t.change) == (&r.track, r.seed, r.change))
                };
                let count = of(knows).count();
                if count == 0 {
                    continue;
                }
                let laps = |r: &Row| r.distance_m.map_or(f64::INFINITY, |m| m / r.lap_m);
                let reached: Vec<f64> = of(knows).map(laps).filter(|l| l.is_finite()).collect();
                let behind = |lap: fn(&Row) -> Option<f64>| {
                    let ratios = of(knows).filter_map(|r| Some(lap(r)? / lap(told(r)?)? - 1.0)).collect();
                    let median = 100.0 * median(ratios);
                    if knows == Knows::Told {
                        format!("{:.2} s", mean(of(knows).filter_map(lap)))
                    } else {
                        format!("{median:+.1} %")
                    }
                };
                let left = |r: &Row| u32::from(r.exits_at_once > 0);
                let pairs = || of(knows).filter_map(|r| Some((left(r), left(told(r)?))));
                let (own, others) = pairs().fold((0, 0), |sums, pair| (sums.0 + pair.0, sums.1 + pair.1));
                let _ = writeln!(
                    text,
                    "| {} | {} | {count} | {:.3} | {:.3} | {} | {} | {} | {} | {} | {own} of {others} | {} | {} |",
                    if wet { "dry to wet" } else { "wet to dry" },
                    knows.name(),
                    median(reached.clone()),
                    quantile(reached.clone(), 0.9),
                    count - reached.len(),
                    behind(|r| r.lap_1_s),
                    behind(|r| r.lap_2_s),
                    behind(|r| r.lap_3_s),
                    of(knows).map(left).sum::<u32>(),
                    of(knows).map(|r| r.exits).sum::<u32>(),
                    of(knows).filter(|r| !r.wreck.is_empty()).count(),
                );
            }
        }
        text.push('\n');
    }
    text
}
