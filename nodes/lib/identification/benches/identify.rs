//! Whole identifications of 30 s at 100 Hz, and their parts.
#![allow(missing_docs)]

#[path = "../tests/identification/support.rs"]
#[allow(dead_code)]
mod support;

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use gripsight_identification::{
    Config, Identification, LiveResidual, ResidualKind, Started, identify, train_residual,
};
use gripsight_signals::{DriveSample, OdometrySample, TelemetrySample};
use support::{drive, scenario, with_background};

fn whole(c: &mut Criterion) {
    let (_, sequence, vehicle) = drive(with_background(scenario("f1tenth", "club", 0.9, 0.9, 3)));
    let mut group = c.benchmark_group("30 s at 100 Hz");
    group.sample_size(10);
    for residual in [ResidualKind::None, ResidualKind::S4] {
        let config = Config { residual, ..Config::default() };
        group.bench_function(format!("identify, residual {}", residual.name()), |b| {
            b.iter(|| identify(black_box(&sequence), &vehicle, None, None, &config, &mut |_| {}));
        });
    }
    let config = Config::default();
    group.bench_function("start: signals and direct fit", |b| {
        b.iter(|| Identification::start(black_box(&sequence), &vehicle, None, None, &config));
    });
    if let Ok(Started::Running(run)) = Identification::start(&sequence, &vehicle, None, None, &config)
        && let Some(candidate) = run.candidate()
    {
        group.bench_function("train_residual, S4", |b| {
            b.iter(|| {
                let mut go_on = |_| std::ops::ControlFlow::Continue(());
                train_residual(black_box(&sequence), &vehicle, candidate, &config, &mut go_on)
            });
        });
        let mut go_on = |_| std::ops::ControlFlow::Continue(());
        let model = train_residual(&sequence, &vehicle, candidate, &config, &mut go_on);
        let live = model.and_then(|model| LiveResidual::new(&vehicle, model, candidate.corrections));
        if let Ok(mut live) = live {
            let mut sample = telemetry(0);
            group.bench_function("live residual, one sample", |b| {
                b.iter(|| {
                    sample.odometry.stamp_ns += 10_000_000;
                    live.push(black_box(&sample))
                });
            });
        }
    }
    group.finish();
}

/// A car in a steady turn.
fn telemetry(stamp_ns: i64) -> TelemetrySample {
    let odometry =
        OdometrySample { stamp_ns, v_x_mps: 6.0, v_y_mps: -0.05, yaw_rate_radps: 1.0, ..Default::default() };
    let drive = DriveSample { stamp_ns, steering_angle_rad: 0.08, ..Default::default() };
    TelemetrySample { odometry, drive, ..TelemetrySample::default() }
}

criterion_group!(benches, whole);
criterion_main!(benches);
