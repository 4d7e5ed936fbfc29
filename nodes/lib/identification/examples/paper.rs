//! The paper's Tables II and III: `--method paper` from mu0 = 0.51, with and without the vision prior, three networks.
//!
//! ```text
//! cargo run --release -p gripsight_identification --example paper -- PICTURE.svg SEED... > tests/results/identification/paper.csv
//! cargo run --release -p gripsight_identification --example paper -- PICTURE.svg FOLDER... > tests/results/identification/paper_foreign.csv
//! ```
//!
//! Seeds are drives of the reference car: load transfer, relaxation and combined slip on, the road's mu 0.8. Folders are drives of
//! `tests/plants/make_foreign_bags.py`. The prior is the road's own mu, as in the paper: its texture matches its friction. Each drive is used whole, and cut where the paper's experiment triggers: within the first acceleration, to the shortest drive that is identified from.
//! Smoothing, end and directions of the sweep, and when the loop ends, were chosen on seeds 21 to 24.
#[allow(dead_code)]
mod support;

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};
use gripsight_identification::{Config, FrictionPrior, Method, PerAxle, ResidualKind, identify};
use gripsight_signals::StateSequence;
use support::picture::{Line, add, draw};
use support::{Run, floor, read_with_truth, reference_run, score};

/// Road of the reference car.
const MU: f64 = 0.8;
/// The paper's loop took 7 turns.
const TURNS: u32 = 8;
/// From standing through the first acceleration: less is refused.
const FIRST_S: f32 = 9.0;
const NETWORKS: [ResidualKind; 3] = [ResidualKind::Mlp, ResidualKind::Rnn, ResidualKind::S4];

/// What was recorded until `FIRST_S`.
fn first(whole: &StateSequence) -> StateSequence {
    let until = whole.time_s.partition_point(|&t| t < FIRST_S);
    let cut = |v: &Vec<f32>| v.iter().copied().take(until).collect();
    StateSequence {
        time_s: cut(&whole.time_s),
        v_x_mps: cut(&whole.v_x_mps),
        v_y_mps: cut(&whole.v_y_mps),
        yaw_rate_radps: cut(&whole.yaw_rate_radps),
        steering_rad: cut(&whole.steering_rad),
        x_m: cut(&whole.x_m),
        y_m: cut(&whole.y_m),
        yaw_rad: cut(&whole.yaw_rad),
        ..StateSequence::default()
    }
}

/// A drive, and the friction of its road.
fn drive(named: &str) -> Result<(Run, f64)> {
    if let Ok(seed) = named.parse() {
        return Ok((reference_run("f1tenth", "club", MU, 0.9, seed, true), MU));
    }
    let folder = Path::new(named);
    let about: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.join("about.json"))?)?;
    let mu = about["mu"].as_f64().context("about.json without mu")?;
    Ok((read_with_truth(folder, f64::INFINITY)?, mu))
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (picture, drives) = arguments.split_first().context("where to draw the picture?")?;
    println!(
        "run,data,network,prior,rmse_front,rmse_rear,floor_front,floor_rear,turns,converged,seconds,slip_front,slip_rear"
    );
    let mut lines: Vec<Line> = Vec::new();
    let mut floors = [0.0; 2];
    for named in drives {
        let (run, mu) = drive(named)?;
        let floor = [floor(&run.truth.front)?.1, floor(&run.truth.rear)?.1];
        (0..2).for_each(|axle| floors[axle] += floor[axle] / drives.len() as f64);
        let begin = first(&run.sequence);
        for (data, sequence) in [("whole", &run.sequence), ("first", &begin)] {
            for prior in [None, Some(FrictionPrior { mu, sigma: 0.1 })] {
                for residual in NETWORKS {
                    let config = Config {
                        method: Method::Paper,
                        residual,
                        max_iterations: TURNS,
                        ..Config::default()
                    };
                    let begin = Instant::now();
                    let outcome = identify(sequence, &run.vehicle, prior, None, &config, &mut |_| {})?;
                    let seconds = begin.elapsed().as_secs_f64();
                    let rmse = score(&outcome.phi_p, &run.truth);
                    let PerAxle { front, rear } = outcome.slip_range_rad.map(|slip| slip.high.max(-slip.low));
                    let (network, prior) = (residual.name(), if prior.is_some() { "road" } else { "none" });
                    println!(
                        "{},{data},{network},{prior},{:.4},{:.4},{:.4},{:.4},{},{},{seconds:.2},{front:.3},{rear:.3}",
                        run.name, rmse[0], rmse[1], floor[0], floor[1], outcome.iterations, outcome.converged
                    );
                    let with = if prior == "none" { "" } else { ", prior" };
                    let name = format!("{network}, {data} drive{with}");
                    add(&mut lines, name, rmse);
                }
            }
        }
    }
    draw("The paper's procedure", &lines, floors, Path::new(picture))
}
