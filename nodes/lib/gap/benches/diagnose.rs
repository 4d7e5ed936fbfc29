//! The diagnosis of drives of 15 to 60 s at 100 Hz, and of 60 s with fewer candidates: `cargo bench -p gripsight_gap`.

#[path = "../tests/common/mod.rs"]
mod common;

use std::time::Duration;

use common::{drive, nominal};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use gripsight_gap::{EffectId, Request, diagnose};
use gripsight_reference_car::CarParameters;

fn diagnosis(c: &mut Criterion) {
    let Ok(car) = CarParameters::by_name("formula_student") else { return };
    let vehicle = nominal(&car);
    let mut group = c.benchmark_group("diagnose");
    group.sample_size(10).warm_up_time(Duration::from_secs(1)).measurement_time(Duration::from_secs(30));
    for (duration_s, candidates) in [(15.0, 34), (30.0, 34), (60.0, 34), (60.0, 16), (60.0, 4)] {
        let Ok(recording) = drive(&car, &["tire_relaxation=0.45"], duration_s, 31) else { continue };
        let only: Vec<String> = EffectId::ALL.iter().take(candidates).map(|e| e.name().to_owned()).collect();
        let request = Request { only: &only, ..Request::new(&recording, &vehicle) };
        let name = BenchmarkId::new(format!("{duration_s} s"), candidates);
        group.bench_function(name, |b| b.iter(|| diagnose(&request, &mut |_| {})));
    }
    group.finish();
}

criterion_group!(benches, diagnosis);
criterion_main!(benches);
