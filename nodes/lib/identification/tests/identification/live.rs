//! The live residual against the batch computation that the network was trained with.

#![allow(clippy::unwrap_used)]

use std::ops::ControlFlow;

use gripsight_identification::{
    Candidate, Config, FrictionPrior, Identification, LiveResidual, LiveSample, Method, ResidualKind,
    ResidualModel, SignalCorrections, Started, train_residual,
};
use gripsight_signals::{DriveSample, OdometrySample, StateSequence, TelemetrySample};
use gripsight_vehicle::VehicleParameters;

use crate::support::{drive, scenario, with_background};

fn samples(sequence: &StateSequence) -> Vec<TelemetrySample> {
    (0..sequence.len())
        .map(|k| {
            let stamp_ns = sequence.start_stamp_ns + (f64::from(sequence.time_s[k]) * 1e9).round() as i64;
            let odometry = OdometrySample {
                stamp_ns,
                v_x_mps: f64::from(sequence.v_x_mps[k]),
                v_y_mps: f64::from(sequence.v_y_mps[k]),
                yaw_rate_radps: f64::from(sequence.yaw_rate_radps[k]),
                ..OdometrySample::default()
            };
            let steering_angle_rad = f64::from(sequence.steering_rad[k]);
            let drive = DriveSample { stamp_ns, steering_angle_rad, ..DriveSample::default() };
            TelemetrySample { odometry, drive, ..TelemetrySample::default() }
        })
        .collect()
}

/// A drive, and the model that its first candidate is answered with.
fn learned(
    method: Method,
    residual: ResidualKind,
) -> (StateSequence, VehicleParameters, Candidate, ResidualModel) {
    let (_, sequence, vehicle) = drive(with_background(scenario("f1tenth", "club", 0.8, 0.9, 31)));
    let config = Config { method, residual, ..Config::default() };
    let prior = Some(FrictionPrior { mu: 0.8, sigma: 0.1 });
    let Started::Running(run) = Identification::start(&sequence, &vehicle, prior, None, &config).unwrap()
    else {
        panic!("refused");
    };
    let candidate = run.candidate().unwrap().clone();
    let model =
        train_residual(&sequence, &vehicle, &candidate, &config, &mut |_| ControlFlow::Continue(())).unwrap();
    (sequence, vehicle, candidate, model)
}

fn follow(live: &mut LiveResidual, samples: &[TelemetrySample]) -> Vec<Option<LiveSample>> {
    samples.iter().map(|s| live.push(s).unwrap()).collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (n, sum) = values.fold((0, 0.0), |(n, sum), v| (n + 1, sum + v * v));
    (sum / f64::from(n)).sqrt()
}

#[test]
fn every_sample_gets_what_the_whole_sequence_gives_and_a_gap_begins_anew() {
    let (sequence, vehicle, candidate, model) = learned(Method::Robust, ResidualKind::S4);
    let stride = (model.dt_s / 0.01).round() as usize;
    assert_eq!(stride, 2, "the telemetry is twice as fast as the model");
    let network = model.network().unwrap().unwrap();
    let corrections = SignalCorrections { steering_delay_s: 0.0, ..candidate.corrections };
    let mut live = LiveResidual::new(&vehicle, model.clone(), corrections).unwrap();
    let mut samples = samples(&sequence);
    samples.truncate(1200);
    let got = follow(&mut live, &samples);
    assert_eq!(got.iter().filter(|s| s.is_none()).count(), stride, "all but the first of each recurrence");
    for phase in 0..stride {
        let own: Vec<usize> = (phase..samples.len()).step_by(stride).collect();
        let channel =
            |f: &dyn Fn(&TelemetrySample) -> f64| own.iter().map(|&k| f(&samples[k])).collect::<Vec<_>>();
        let yaw_rate = |s: &TelemetrySample| s.odometry.yaw_rate_radps - corrections.yaw_rate_bias_radps;
        let inputs = [
            channel(&|s| s.odometry.v_x_mps),
            channel(&|s| {
                s.odometry.v_y_mps - corrections.v_y_lever_arm_m * yaw_rate(s) - corrections.v_y_bias_mps
            }),
            channel(&yaw_rate),
            channel(&|s| {
                s.drive.steering_angle_rad * corrections.steering_gain + corrections.steering_offset_rad
            }),
        ]
        .concat();
        let whole = network.forward_sequence(&inputs).unwrap();
        for (place, pair) in own.windows(2).enumerate() {
            let live = got[pair[1]].unwrap();
            for axis in 0..2 {
                let said = (live.nominal[axis] - live.corrected[axis]) * model.dt_s / live.dt_s;
                let expected = whole[axis * own.len() + place];
                assert!((said - expected).abs() < 1e-9, "{said} {expected}");
            }
        }
    }
    // A gap: the samples after it are predicted from one another again, and the first of them from nothing.
    let mut after = samples[..10].to_vec();
    for sample in &mut after {
        sample.odometry.stamp_ns += 60_000_000_000;
    }
    let got = follow(&mut live, &after);
    assert_eq!(got.iter().position(Option::is_some), Some(stride));
}

#[test]
fn the_network_makes_the_residual_smaller_and_none_leaves_it() {
    let (sequence, vehicle, candidate, model) = learned(Method::Paper, ResidualKind::S4);
    let mut live = LiveResidual::new(&vehicle, model.clone(), candidate.corrections).unwrap();
    let got: Vec<LiveSample> = follow(&mut live, &samples(&sequence)).into_iter().flatten().collect();
    assert!(got.len() > sequence.len() * 9 / 10, "{} of {}", got.len(), sequence.len());
    // Means over 0.1 s: one sample's residual at 10 ms is mostly noise of the sensors, which no network can know.
    let smooth = |f: fn(&LiveSample) -> f64| {
        rms(got.chunks_exact(10).map(|c| c.iter().map(f).sum::<f64>() / c.len() as f64))
    };
    let (nominal, corrected) = (smooth(|s| s.nominal[1]), smooth(|s| s.corrected[1]));
    assert!(corrected < 0.5 * nominal, "yaw rate: {corrected} of {nominal}");
    let outside = got.iter().filter(|s| s.extrapolated).count() as f64 / got.len() as f64;
    assert!((0.001..0.1).contains(&outside), "{outside}: the hull is that of 98 % of the slips");

    let none = ResidualModel { architecture: ResidualKind::None, ..model };
    let mut live = LiveResidual::new(&vehicle, none, candidate.corrections).unwrap();
    assert!(follow(&mut live, &samples(&sequence)).iter().flatten().all(|s| s.nominal == s.corrected));
}

/// At 200 samples a second for a model of 50, with stamps that jitter: each is predicted from the one a time step before, and none is left out.
#[test]
fn stamps_that_jitter_cost_no_sample() {
    let (sequence, vehicle, candidate, model) = learned(Method::Robust, ResidualKind::None);
    let mut live = LiveResidual::new(&vehicle, model.clone(), candidate.corrections).unwrap();
    let mut samples: Vec<_> = samples(&sequence).into_iter().step_by(2).take(400).collect();
    let step_ns = (0.25e9 * model.dt_s) as i64;
    for (k, sample) in samples.iter_mut().enumerate() {
        let jitter_ns = [0, -1, 700_000, -900_000, 1, 0, -1][k % 7];
        sample.odometry.stamp_ns = 1_000_000_000 + k as i64 * step_ns + jitter_ns;
        sample.drive.stamp_ns = sample.odometry.stamp_ns;
        sample.odometry.v_x_mps = sample.odometry.v_x_mps.max(2.0);
    }
    let lives = follow(&mut live, &samples);
    let first = lives.iter().position(Option::is_some).unwrap();
    assert_eq!(first, 4);
    for sample in &lives[first..] {
        let dt_s = sample.as_ref().expect("a sample without its residual").dt_s;
        assert!((dt_s / model.dt_s - 1.0).abs() < 0.1, "{dt_s}");
    }
}
