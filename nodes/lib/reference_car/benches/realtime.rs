//! Simulated time over time taken: the whole run (plant, driver, sensors, truth) at 1 kHz on one core.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use gripsight_reference_car::{CAR_NAMES, CarParameters, Course, EffectSetting, Scenario, Simulation};

/// Simulated length of one run; criterion's elements are milliseconds of it.
const LENGTH_S: u32 = 20;

fn run(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("run");
    group.sample_size(10);
    group.throughput(Throughput::Elements(u64::from(LENGTH_S) * 1000));
    for name in CAR_NAMES {
        let Ok(car) = CarParameters::by_name(name) else { continue };
        let mut scenario = Scenario::new(car)
            .course(Course::Track { name: "club".to_owned(), reversed: false })
            .duration(f64::from(LENGTH_S));
        scenario.effects = scenario.car.own_effects(0.9);
        for extra in [
            "steering_lag",
            "steering_backlash",
            "compliance_steer",
            "differential_yaw_moment",
            "low_grip_patch",
        ] {
            scenario.effects.extend(EffectSetting::parse(extra));
        }
        group.bench_with_input(BenchmarkId::from_parameter(name), &scenario, |bencher, scenario| {
            bencher.iter(|| {
                let simulation = Simulation::new(black_box(scenario.clone()));
                simulation.map(|s| s.run(|_| {}).truth.len()).unwrap_or(0)
            });
        });
    }
    group.finish();
}

criterion_group!(benches, run);
criterion_main!(benches);
