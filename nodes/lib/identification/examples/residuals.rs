//! What a residual network adds: least squares alone and with S4, MLP and RNN, and the networks without the least-squares start, each with and
//! without the vision prior.
//!
//! ```text
//! cargo run --release -p gripsight_identification --example residuals -- PICTURE.svg SEED... > tests/results/identification/residuals.csv
//! ```
//!
//! The 1:10 car on the club track, mu 0.8, load transfer, relaxation and combined slip on; the prior is the road's mu.
#[allow(dead_code)]
mod support;

use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};
use gripsight_identification::{Config, FrictionPrior, ResidualKind, identify};
use support::picture::{Line, add, draw};
use support::{floor, reference_run, score};

/// Road and prior.
const MU: f64 = 0.8;
/// Network, and whether least squares comes first.
const METHODS: [(ResidualKind, bool); 7] = [
    (ResidualKind::None, true),
    (ResidualKind::S4, true),
    (ResidualKind::Mlp, true),
    (ResidualKind::Rnn, true),
    (ResidualKind::S4, false),
    (ResidualKind::Mlp, false),
    (ResidualKind::Rnn, false),
];

fn name(residual: ResidualKind, direct_start: bool) -> String {
    match (residual, direct_start) {
        (ResidualKind::None, _) => "least squares alone".to_owned(),
        (network, true) => format!("least squares + {}", network.name()),
        (network, false) => format!("{} alone", network.name()),
    }
}

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (picture, seeds) = arguments.split_first().context("where to draw the picture?")?;
    let seeds = seeds.iter().map(|seed| seed.parse()).collect::<Result<Vec<u64>, _>>()?;
    println!(
        "seed,method,prior,rmse_front,rmse_rear,floor_front,floor_rear,rollout_v_y_mps,rollout_yaw_rate_radps,turns,converged,source,accepted,seconds"
    );
    let mut lines: Vec<Line> = Vec::new();
    let mut floors = [0.0; 2];
    for seed in &seeds {
        let run = reference_run("f1tenth", "club", MU, 0.9, *seed, true);
        let floor = [floor(&run.truth.front)?.1, floor(&run.truth.rear)?.1];
        (0..2).for_each(|axle| floors[axle] += floor[axle] / seeds.len() as f64);
        for prior in [None, Some(FrictionPrior { mu: MU, sigma: 0.1 })] {
            for (residual, direct_start) in METHODS {
                let config = Config { residual, direct_start, ..Config::default() };
                let begin = Instant::now();
                let outcome = identify(&run.sequence, &run.vehicle, prior, None, &config, &mut |_| {})?;
                let seconds = begin.elapsed().as_secs_f64();
                let rmse = score(&outcome.phi_p, &run.truth);
                let (method, prior) = (name(residual, direct_start), prior.map_or("none", |_| "0.8"));
                println!(
                    "{seed},{method},{prior},{:.4},{:.4},{:.4},{:.4},{:.5},{:.5},{},{},{:?},{},{seconds:.2}",
                    rmse[0],
                    rmse[1],
                    floor[0],
                    floor[1],
                    outcome.rmse.rollout.v_y_mps.after,
                    outcome.rmse.rollout.yaw_rate_radps.after,
                    outcome.iterations,
                    outcome.converged,
                    outcome.source,
                    outcome.accepted
                );
                let name = if prior == "none" { method } else { format!("{method}, prior") };
                add(&mut lines, name, rmse);
            }
        }
    }
    draw("Least squares and residual networks", &lines, floors, Path::new(picture))
}
