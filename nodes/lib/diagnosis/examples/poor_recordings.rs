//! What the diagnosis says of recordings that are short, slow or broken, as a table.
//!
//!     cargo run --release -p gripsight_diagnosis --example poor_recordings > tests/results/gap/poor.md
//!
//! One drive of the 1:10 car with a bias of v_y, on v_x, v_y, yaw rate and steering alone, diagnosed by the whole library; then worse and worse
//! copies of it.

#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/poor.rs"]
mod poor;

use common::{drive, nominal};
use gripsight_diagnosis::{Request, diagnose};
use gripsight_reference_car::CarParameters;
use gripsight_signals::StateSequence;

const BIAS_MPS: f64 = 0.1;
const LENGTH_S: f64 = 60.0;
/// Seed of the drive: no threshold was set on it.
const SEED: u64 = 71;

fn main() -> anyhow::Result<()> {
    let car = CarParameters::by_name("f1tenth")?;
    let all = drive(&car, &[&format!("v_y_bias={BIAS_MPS}")], LENGTH_S, SEED)?;
    let vehicle = nominal(&car);
    let frozen = {
        let mut frozen = poor::picked(&all, |_, _| true);
        frozen.v_y_mps[1000..].fill(all.v_y_mps[1000]);
        frozen
    };
    let recordings: [(&str, StateSequence); 12] = [
        ("60 s at 100 Hz", poor::picked(&all, |_, _| true)),
        ("20 s", poor::picked(&all, |_, t| t < 20.0)),
        ("10 s", poor::picked(&all, |_, t| t < 10.0)),
        ("6 s", poor::picked(&all, |_, t| t < 6.0)),
        ("20 Hz", poor::picked(&all, |k, _| k % 5 == 0)),
        ("5 Hz", poor::picked(&all, |k, _| k % 20 == 0)),
        ("a gap of 3 s", poor::picked(&all, |_, t| !(8.0..11.0).contains(&t))),
        ("a gap every 4 s", poor::picked(&all, |_, t| t % 4.0 < 3.0)),
        ("a stop of 6 s", poor::stopped(&all, BIAS_MPS)),
        ("v_y frozen after 10 s", frozen),
        ("one NaN in v_y", poor::with_nan(&all, 700)),
        ("a straight only", poor::straight(&all)),
    ];
    println!("# Short, slow and broken recordings\n");
    println!("| recording | verdict | first candidate | confidence | what it says |");
    println!("| --- | --- | --- | --- | --- |");
    for (name, recording) in recordings {
        match diagnose(&Request::new(&recording, &vehicle), &mut |_| {}) {
            Ok(d) => {
                let first = d.effects.first();
                let size = |e: &gripsight_diagnosis::RankedEffect| {
                    let sizes = e
                        .parameters
                        .iter()
                        .map(|(n, p)| format!("{n} {:.3} [{:.3}, {:.3}] {}", p.value, p.low, p.high, p.unit));
                    format!("`{}` {}", e.name, sizes.collect::<Vec<_>>().join(", "))
                };
                let next = d.drive_next.first().map(|n| format!("; {n}")).unwrap_or_default();
                println!(
                    "| {name} | `{}` | {} | {} | {}{next} |",
                    d.verdict.name(),
                    first.map(size).unwrap_or_default(),
                    first.map(|e| format!("{:.2}", e.confidence)).unwrap_or_default(),
                    d.reasons.last().cloned().unwrap_or_default(),
                );
            }
            Err(error) => println!("| {name} | refused | | | {error} |"),
        }
    }
    Ok(())
}
