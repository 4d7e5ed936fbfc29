//! The pursuit and the predictive controller beside each other: the same cars, tracks, roads and seeds, on the true tires.

use std::fmt::Write as _;

use anyhow::Result;
use gripsight_driving::Controller;
use gripsight_reference_car::CarParameters;
use serde::{Deserialize, Serialize};

use crate::drive::{Loop, processor_s};
use crate::run::Case;
use crate::store::{Store, mean, parts};
use crate::{Arguments, plant};

const BOTH: [(Controller, &str); 2] = [(Controller::Pursuit, "pursuit"), (Controller::Predictive, "mpc")];

/// A run; of its laps all but the first count, which begins slowly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Row {
    car: String,
    track: String,
    mu: f64,
    seed: u64,
    controller: String,
    laps: usize,
    time_s: f64,
    error_m: f64,
    worst_m: f64,
    half_width_m: f64,
    used: f64,
    /// In all laps.
    exits: u32,
    wreck: String,
    commands: u64,
    /// Commands that the pursuit gave in the place of the predictive controller: no convergence, too slow a car.
    not_converged: u64,
    slow: u64,
    /// The solver's, a command.
    iterations: f64,
    /// The processor's time for a command, state to command.
    command_us: f64,
    /// Simulated time over the processor's time for the whole run.
    times_real_time: f64,
}

/// Drives what was asked for and is not in controllers.csv yet; the summary.
pub(crate) fn experiment(arguments: &Arguments) -> Result<String> {
    arguments.check(&BOTH.map(|(_, name)| name))?;
    let store = Store::<Row>::open(&arguments.out.join("controllers.csv"))?;
    let mut work = Vec::new();
    for car in &arguments.cars {
        let car = CarParameters::by_name(car)?;
        for &mu in &arguments.frictions {
            let tires = plant::projection(&car, mu)?;
            for track in &arguments.tracks {
                for seed in arguments.seeds() {
                    for (controller, name) in BOTH {
                        let (car, track, laps) = (car.clone(), track.clone(), arguments.laps);
                        work.push((Case { car, track, mu, seed, laps, tires, controller }, name));
                    }
                }
            }
        }
    }
    work.retain(|(case, name)| {
        let (car, track) = (&case.car.name, &case.track);
        arguments.asks_for(name)
            && !store.rows.iter().any(|r| {
                (&r.car, &r.track, r.mu, r.seed, r.controller.as_str())
                    == (car, track, case.mu, case.seed, name)
            })
    });
    let rows = store
        .fill(work, arguments.verbose, |(case, name)| Ok(vec![drive(&case, name, arguments.verbose)?]))?;
    Ok(summary(&rows))
}

fn drive(case: &Case, name: &str, verbose: bool) -> Result<Row> {
    let begin_s = processor_s();
    let mut run = Loop::new(case, case.tires, verbose)?;
    run.driver.take_longitudinal(plant::told(&case.car, case.mu));
    let longest_s = 4.0 * case.laps as f64 * run.referee.fastest_lap_s();
    let mut wreck = None;
    while wreck.is_none() && run.referee.laps.len() < case.laps {
        wreck = run.look()?;
        if run.sim.time_s() > longest_s {
            wreck = wreck.or(Some("too slow"));
        }
    }
    let solves = run.driver.solves().copied().unwrap_or_default();
    let later = || run.referee.laps.iter().skip(1);
    Ok(Row {
        car: case.car.name.clone(),
        track: case.track.clone(),
        mu: case.mu,
        seed: case.seed,
        controller: name.to_owned(),
        laps: run.referee.laps.len(),
        time_s: parts(mean(later().map(|lap| lap.time_s)), 1e3),
        error_m: parts(mean(later().map(|lap| lap.error_m)), 1e4),
        worst_m: parts(later().map(|lap| lap.worst_m).fold(0.0, f64::max), 1e4),
        half_width_m: parts(run.driver.track().points()[0].left_m, 1e3),
        used: parts(mean(later().map(|lap| lap.used)), 1e4),
        exits: run.referee.exits(),
        wreck: wreck.unwrap_or("").to_owned(),
        commands: run.commands,
        not_converged: solves.not_converged,
        slow: solves.slow,
        iterations: parts(solves.iterations as f64 / solves.solved.max(1) as f64, 1e1),
        command_us: parts(1e6 * run.commands_s / run.commands.max(1) as f64, 1e1),
        times_real_time: parts(run.sim.time_s() / (processor_s() - begin_s), 1e1),
    })
}

/// A row for each car, road and controller.
fn summary(rows: &[Row]) -> String {
    let mut text = String::from(
        "| car | mu | controller | runs | lap (s) | error mean (m) | worst (m) | edge (m) | grip used | exits | wrecks | commands | not converged | iterations | a command (us) | times real time |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    let mut groups: Vec<(&str, f64)> = rows.iter().map(|r| (r.car.as_str(), r.mu)).collect();
    groups.sort_by(|a, b| a.partial_cmp(b).unwrap_or(std::cmp::Ordering::Equal));
    groups.dedup();
    for (car, mu) in groups {
        for (_, name) in BOTH {
            let of = || rows.iter().filter(move |r| r.car == car && r.mu == mu && r.controller == name);
            if of().count() == 0 {
                continue;
            }
            // A run that ended before its second lap has no figures of one.
            let average = |figure: fn(&Row) -> f64| mean(of().map(figure).filter(|f| f.is_finite()));
            let longest = |figure: fn(&Row) -> f64| of().map(figure).fold(0.0, f64::max);
            let _ = writeln!(
                text,
                "| {car} | {mu} | {name} | {} | {:.2} | {:.3} | {:.3} | {:.2} | {:.1} % | {} | {} | {} | {} | {:.1} | {:.0} | {:.0} |",
                of().count(),
                average(|r| r.time_s),
                average(|r| r.error_m),
                longest(|r| r.worst_m),
                longest(|r| r.half_width_m),
                100.0 * average(|r| r.used),
                of().map(|r| r.exits).sum::<u32>(),
                of().filter(|r| !r.wreck.is_empty()).count(),
                of().map(|r| r.commands).sum::<u64>(),
                of().map(|r| r.not_converged).sum::<u64>(),
                average(|r| r.iterations),
                average(|r| r.command_us),
                average(|r| r.times_real_time),
            );
        }
    }
    text
}
