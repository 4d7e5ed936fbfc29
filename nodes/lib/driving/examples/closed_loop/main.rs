//! The loop closed: a car on a road that it does not know is driven, identified while it drives, and driven faster.
//!
//! `launch_scripts/closed_loop.sh OUT [--quick]` runs it. In process, many times real time; the driver sees the noisy odometry, the identification
//! the noisy telemetry, and only the referee the truth.

mod learner;
mod plant;
mod run;
mod table;

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use anyhow::{Result, ensure};
use clap::Parser;
use gripsight_reference_car::CarParameters;
use rayon::prelude::*;
use run::{Case, Variant, drive};
use table::Laps;

/// Drives the reference car from mu = 0.51 on roads that it does not know, with and without identification.
#[derive(Debug, Parser)]
#[command(
    name = "closed_loop",
    after_help = "Examples:\n  closed_loop out --quick\n  closed_loop out --cars f1tenth --tracks club,oval --frictions 0.6,0.9 --seeds 3\n  closed_loop out --quick --verbose"
)]
struct Arguments {
    /// Folder for laps.csv and summary.md; what laps.csv holds already is not driven again
    out: PathBuf,
    /// One track, one friction, the 1:10 car, two seeds
    #[arg(long)]
    quick: bool,
    /// Cars
    #[arg(long, value_delimiter = ',', default_value = "f1tenth,passenger_car")]
    cars: Vec<String>,
    /// Tracks
    #[arg(long, value_delimiter = ',', default_value = "harbor,valley,quarry,delta,lagoon")]
    tracks: Vec<String>,
    /// Frictions of the road
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
    /// Laps of a run
    #[arg(long, default_value_t = 5)]
    laps: usize,
    /// Says on standard error what happens in each run; one after the other
    #[arg(long)]
    verbose: bool,
}

fn main() -> Result<()> {
    let mut arguments = Arguments::parse();
    if arguments.quick {
        arguments.cars = vec!["f1tenth".to_owned()];
        arguments.tracks.truncate(1);
        arguments.frictions = vec![0.9];
        arguments.seeds = arguments.seeds.min(2);
    }
    for name in &arguments.variants {
        let known = Variant::ALL.map(Variant::name);
        ensure!(known.contains(&name.as_str()), "no variant is called {name:?}; known: {}", known.join(", "));
    }
    let mut work = Vec::new();
    for car in &arguments.cars {
        let car = CarParameters::by_name(car)?;
        for &mu in &arguments.frictions {
            let tires = plant::projection(&car, mu)?;
            if arguments.verbose {
                eprintln!("{} on {mu}: {tires:?}", car.name);
            }
            for track in &arguments.tracks {
                for seed in arguments.from_seed..arguments.from_seed + arguments.seeds {
                    let (car, track, laps) = (car.clone(), track.clone(), arguments.laps);
                    let case = Case { car, track, mu, seed, laps, tires };
                    let asked = |v: &Variant| {
                        arguments.variants.is_empty() || arguments.variants.iter().any(|n| n == v.name())
                    };
                    work.extend(
                        Variant::ALL.into_iter().filter(asked).map(|variant| (case.clone(), variant)),
                    );
                }
            }
        }
    }
    std::fs::create_dir_all(&arguments.out)?;
    let laps = Laps::open(&arguments.out.join("laps.csv"))?;
    work.retain(|(case, variant)| !laps.rows.iter().any(|row| row.is_of(case, *variant)));
    let (count, done, laps) = (work.len(), AtomicUsize::new(0), Mutex::new(laps));
    let one = |(case, variant): (Case, Variant)| -> Result<()> {
        if arguments.verbose {
            eprintln!("{} {} {} seed {} {}", case.car.name, case.track, case.mu, case.seed, variant.name());
        }
        let begin = std::time::Instant::now();
        let run = drive(&case, variant, arguments.verbose)?;
        let rows = table::rows(&case, variant, &run, begin.elapsed().as_secs_f64());
        laps.lock().unwrap_or_else(PoisonError::into_inner).add(rows)?;
        let number = done.fetch_add(1, Ordering::Relaxed) + 1;
        if number.is_multiple_of(10) || number == count {
            eprintln!("{number} of {count} runs");
        }
        Ok(())
    };
    if arguments.verbose {
        work.into_iter().try_for_each(one)?;
    } else {
        work.into_par_iter().try_for_each(one)?;
    }
    let laps = laps.into_inner().unwrap_or_else(PoisonError::into_inner);
    let summary = table::summary(&laps.rows);
    std::fs::write(arguments.out.join("summary.md"), &summary)?;
    print!("{summary}");
    Ok(())
}
