//! What the network reads on the reference car's road pictures: one CSV line per size, true friction and seed.
//!
//! `cargo run --release --example read_reference_camera -- FIRST_SEED > readings.csv`: 40 roads each. Seeds from 5000 are for
//! development, from 9000 for the model card.

#[path = "../tests/reference_roads/mod.rs"]
mod reference_roads;

use reference_roads::{SIDES, estimator, read};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let first: u64 = std::env::args().nth(1).ok_or("usage: read_reference_camera FIRST_SEED")?.parse()?;
    let mut estimator = estimator()?;
    println!("side,true_mu,seed,valid,reason,mu,sigma,p_dry,p_wet,p_water,p_snow,p_ice");
    for side in SIDES {
        for true_mu in (1..=9).map(|tenths| f64::from(tenths) / 10.0) {
            for (seed, got) in (first..).zip(read(&mut estimator, side, true_mu, first..first + 40)) {
                let p: Vec<String> = got.probability.iter().map(|p| format!("{p:.4}")).collect();
                let (reason, p) = (got.reason.map_or("", |r| r.as_str()), p.join(","));
                let (valid, mu, sigma) = (got.valid(), got.mu, got.sigma);
                println!("{side},{true_mu:.1},{seed},{valid},{reason},{mu:.4},{sigma:.4},{p}");
            }
        }
    }
    Ok(())
}
