//! The loop closed: a car on a road that it does not know is driven, identified while it drives, and driven faster.
//!
//! `launch_scripts/closed_loop.sh OUT [--quick]` runs it. In process, many times real time; the driver sees the noisy odometry, the identification
//! the noisy telemetry, and only the referee the truth.

mod changes;
mod controllers;
mod drive;
mod effects;
mod learner;
mod picture;
mod plant;
mod referee;
mod run;
mod store;
mod table;

use std::path::PathBuf;

use anyhow::{Result, ensure};
use clap::{Parser, ValueEnum};
use gripsight_driving::Controller;
use gripsight_reference_car::CarParameters;
use run::{Case, Variant, drive};
use store::Store;

/// What is driven for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Experiment {
    /// Laps from mu = 0.51 on an unknown road: laps.csv
    Laps,
    /// The floor changes in the middle of the run: changes.csv
    Changes,
    /// The first case, drawn: laps.svg
    Picture,
    /// The car has an effect that the controller's model lacks, on the true tires of the car without it: effects.csv
    Effects,
    /// The pursuit and the predictive controller beside each other, on the true tires: controllers.csv
    Controllers,
}

/// Drives the reference car from mu = 0.51 on roads that it does not know, with and without identification.
#[derive(Debug, Parser)]
#[command(
    name = "closed_loop",
    after_help = "Examples:\n  closed_loop out --quick\n  closed_loop out --cars f1tenth --tracks club,oval --frictions 0.6,0.9 --seeds 3\n  closed_loop out --experiment changes --cars f1tenth --seeds 12"
)]
struct Arguments {
    /// Folder for the rows and summary.md; what the rows hold already is not driven again
    out: PathBuf,
    /// What is driven for
    #[arg(long, value_enum, default_value = "laps")]
    experiment: Experiment,
    /// One track, one friction, the 1:10 car, two seeds; laps are drawn, too
    #[arg(long)]
    quick: bool,
    /// Cars
    #[arg(long, value_delimiter = ',', default_value = "f1tenth,passenger_car")]
    cars: Vec<String>,
    /// Tracks; no constant of the driver was chosen on the default ones
    #[arg(long, value_delimiter = ',', default_value = "ridge,basin,summit,meadow,canyon")]
    tracks: Vec<String>,
    /// Frictions of the road, for laps
    #[arg(long, value_delimiter = ',', default_value = "0.4,0.65,0.9")]
    frictions: Vec<f64>,
    /// Seeds of each, from 1
    #[arg(long, default_value_t = 2)]
    seeds: u64,
    /// First seed
    #[arg(long, default_value_t = 1)]
    from_seed: u64,
    /// Variants; all without
    #[arg(long, value_delimiter = ',')]
    variants: Vec<String>,
    /// Laps of a run, for laps
    #[arg(long, default_value_t = 5)]
    laps: usize,
    /// Who steers: pursuit or mpc; a folder holds the runs of one
    #[arg(long, default_value = "pursuit")]
    controller: Controller,
    /// Says on standard error what happens in each run; one after the other
    #[arg(long)]
    verbose: bool,
}

impl Arguments {
    /// Whether a variant was asked for.
    fn asks_for(&self, name: &str) -> bool {
        self.variants.is_empty() || self.variants.iter().any(|asked| asked == name)
    }

    fn check(&self, known: &[&str]) -> Result<()> {
        for name in &self.variants {
            ensure!(
                known.contains(&name.as_str()),
                "no variant is called {name:?}; known: {}",
                known.join(", ")
            );
        }
        Ok(())
    }

    fn seeds(&self) -> impl Iterator<Item = u64> + use<> {
        self.from_seed..self.from_seed + self.seeds
    }
}

fn main() -> Result<()> {
    let mut arguments = Arguments::parse();
    if arguments.quick {
        arguments.cars = vec!["f1tenth".to_owned()];
        arguments.tracks.truncate(1);
        arguments.frictions = vec![0.9];
        arguments.seeds = arguments.seeds.min(2);
    }
    std::fs::create_dir_all(&arguments.out)?;
    let summary = match arguments.experiment {
        Experiment::Laps => laps(&arguments)?,
        Experiment::Changes => changes::experiment(&arguments)?,
        Experiment::Picture => {
            print!("{}", picture::experiment(&arguments)?);
            return Ok(());
        }
        Experiment::Effects => effects::experiment(&arguments)?,
        Experiment::Controllers => controllers::experiment(&arguments)?,
    };
    std::fs::write(arguments.out.join("summary.md"), &summary)?;
    print!("{summary}");
    if arguments.quick && arguments.experiment == Experiment::Laps {
        print!("\n{}", picture::experiment(&arguments)?);
    }
    Ok(())
}

/// Laps on an unknown road, by variant.
fn laps(arguments: &Arguments) -> Result<String> {
    arguments.check(&Variant::ALL.map(Variant::name))?;
    let mut work = Vec::new();
    for car in &arguments.cars {
        let car = CarParameters::by_name(car)?;
        for &mu in &arguments.frictions {
            let tires = plant::projection(&car, mu)?;
            if arguments.verbose {
                eprintln!("{} on {mu}: {tires:?}", car.name);
            }
            for track in &arguments.tracks {
                for seed in arguments.seeds() {
                    let (car, track, laps) = (car.clone(), track.clone(), arguments.laps);
                    let controller = arguments.controller;
                    let case = Case { car, track, mu, seed, laps, tires, controller };
                    let asked = Variant::ALL.into_iter().filter(|v| arguments.asks_for(v.name()));
                    work.extend(asked.map(|variant| (case.clone(), variant)));
                }
            }
        }
    }
    // What is broken off has then driven every car, road and track equally often.
    let place = |track: &str| arguments.tracks.iter().position(|asked| asked == track);
    work.sort_by_key(|(case, _)| (case.seed, place(&case.track)));
    let store = Store::<table::Row>::open(&arguments.out.join("laps.csv"))?;
    work.retain(|(case, variant)| !store.rows.iter().any(|row| row.is_of(case, *variant)));
    let rows = store.fill(work, arguments.verbose, |(case, variant)| {
        if arguments.verbose {
            eprintln!("{} {} {} seed {} {}", case.car.name, case.track, case.mu, case.seed, variant.name());
        }
        let begin = std::time::Instant::now();
        let run = drive(&case, variant, arguments.verbose)?;
        Ok(table::rows(&case, variant, &run, begin.elapsed().as_secs_f64()))
    })?;
    Ok(table::summary(&rows))
}
