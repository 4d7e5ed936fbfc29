//! Prints as CSV how the settings that the paper leaves open change the error on a simulated car.
//!
//!     cargo run --release -p gripsight_s4 --example defaults
//!
//! The car: a 1:10 single track with relaxation length 0.12 m and a servo lag of 50 ms, sampled at 100 Hz for 30 s; the nominal
//! model has neither, and other tires. Residuals are one-step errors in `v_y` and yaw rate, with three levels of noise on
//! `v_x, v_y` and yaw rate. Every fifth block of 1.5 s is held out for early stopping; `test_loss` is on another drive. Losses are mean
//! squared errors over the residual's mean square. Nothing that the project publishes is scored on this car.

use gripsight_s4::{
    Architecture, Error, NetworkConfig, Normalization, ResidualNetwork, Sequence, TrainingConfig,
    TrainingSet, train,
};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::ops::ControlFlow;

const DT_S: f64 = 0.01;
const SAMPLES: usize = 3000;
const SUBSTEPS: usize = 10;
const MASS_KG: f64 = 3.5;
const INERTIA_KGM2: f64 = 0.045;
const FRONT_M: f64 = 0.16;
const REAR_M: f64 = 0.17;
const RELAXATION_M: f64 = 0.12;
const SERVO_LAG_S: f64 = 0.05;

/// Lateral acceleration and yaw acceleration times `duration_s`, for slip angles and shapes `[B, C, D]` front and rear.
fn change(
    slips: [f64; 2],
    shapes: [[f64; 3]; 2],
    [v_x, yaw_rate, steer]: [f64; 3],
    duration_s: f64,
) -> [f64; 2] {
    let loads = [REAR_M, FRONT_M].map(|arm| MASS_KG * 9.81 * arm / (FRONT_M + REAR_M));
    let force = |axle: usize| {
        let [b, c, d] = shapes[axle];
        loads[axle] * d * (c * (b * slips[axle]).atan()).sin()
    };
    let (front, rear) = (force(0) * steer.cos(), force(1));
    [
        duration_s * ((front + rear) / MASS_KG - v_x * yaw_rate),
        duration_s * (front * FRONT_M - rear * REAR_M) / INERTIA_KGM2,
    ]
}

/// Slip angles front and rear.
fn slips([v_x, v_y, yaw_rate, steer]: [f64; 4]) -> [f64; 2] {
    [steer - ((v_y + FRONT_M * yaw_rate) / v_x).atan(), -((v_y - REAR_M * yaw_rate) / v_x).atan()]
}

/// Drives the car: `[v_x, v_y, yaw rate, steering command]` per sample, noise included.
fn drive(seed: u64, noise: f64) -> Vec<[f64; 4]> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let phase = 10.0 * normal();
    let (mut v_y, mut yaw_rate, mut steer, mut lagged) = (0.0, 0.0, 0.0, [0.0; 2]);
    let mut rows = Vec::new();
    for k in 0..=SAMPLES {
        let time_s = k as f64 * DT_S;
        let v_x = 4.0 + 1.5 * (0.5 * time_s + phase).sin();
        let jump = if (0.37 * time_s + phase).fract().abs() < 0.5 { 0.05 } else { -0.05 };
        let command = 0.18 * (1.9 * time_s + phase).sin() + 0.08 * (6.0 * time_s).sin() + jump;
        rows.push([
            v_x + 0.02 * noise * normal(),
            v_y + 0.01 * noise * normal(),
            yaw_rate + 0.02 * noise * normal(),
            command,
        ]);
        let substep_s = DT_S / SUBSTEPS as f64;
        for _ in 0..SUBSTEPS {
            steer += substep_s / SERVO_LAG_S * (command - steer);
            let now = slips([v_x, v_y, yaw_rate, steer]);
            for (lagged, now) in lagged.iter_mut().zip(now) {
                *lagged += substep_s * v_x / RELAXATION_M * (now - *lagged);
            }
            let [dv_y, dw] =
                change(lagged, [[7.4, 1.3, 0.85], [9.0, 1.4, 0.9]], [v_x, yaw_rate, steer], substep_s);
            v_y += dv_y;
            yaw_rate += dw;
        }
    }
    rows
}

/// Residuals of the nominal model on a drive; weights where `used` says so.
fn set(rows: &[[f64; 4]], used: impl Fn(usize) -> bool) -> Result<TrainingSet, Error> {
    let mut targets = vec![0.0; 2 * SAMPLES];
    for (k, pair) in rows.windows(2).enumerate() {
        let [v_x, v_y, yaw_rate, steer] = pair[0];
        let step = change(slips(pair[0]), [[5.0, 1.5, 0.6]; 2], [v_x, yaw_rate, steer], DT_S);
        targets[k] = pair[1][1] - v_y - step[0];
        targets[SAMPLES + k] = pair[1][2] - yaw_rate - step[1];
    }
    let inputs = (0..4).flat_map(|channel| rows[..SAMPLES].iter().map(move |row| row[channel])).collect();
    let weights = (0..SAMPLES).map(|k| f64::from(u8::from(used(k)))).collect();
    TrainingSet::new(4, 2, &[Sequence { inputs, targets, weights }])
}

fn main() -> Result<(), Error> {
    let base = NetworkConfig::default;
    let settings = TrainingConfig::default;
    let mut cases: Vec<(&str, NetworkConfig, TrainingConfig)> = Vec::new();
    for architecture in [Architecture::S4, Architecture::Mlp, Architecture::Rnn] {
        cases.push(("architecture", NetworkConfig { architecture, ..base() }, settings()));
        for dropout in [0.02, 0.1] {
            let case = NetworkConfig { architecture, ..base() };
            cases.push(("dropout", case, TrainingConfig { dropout, ..settings() }));
        }
        for (learning_rate, state_space_learning_rate) in
            [(0.01, 0.001), (0.01, 0.01), (0.03, 0.001), (0.1, 0.03)]
        {
            let case = NetworkConfig { architecture, ..base() };
            cases.push((
                "rates",
                case,
                TrainingConfig { learning_rate, state_space_learning_rate, ..settings() },
            ));
        }
    }
    for (step_min, step_max) in [(0.001, 0.1), (0.01, 0.5), (0.03, 1.0)] {
        cases.push(("steps", NetworkConfig { step_min, step_max, ..base() }, settings()));
    }
    for (d_model, d_state, layers) in
        [(8, 8, 1), (16, 8, 1), (16, 32, 1), (32, 16, 1), (16, 8, 2), (16, 16, 2)]
    {
        cases.push(("size", NetworkConfig { d_model, d_state, layers, ..base() }, settings()));
    }
    println!(
        "varied,noise,architecture,d_model,d_state,layers,step_min,step_max,\
         learning_rate,state_space_learning_rate,dropout,seed,epochs,validation_loss,test_loss"
    );
    for noise in [0.0, 0.3, 1.0] {
        let (rows, other) = (drive(1, noise), drive(2, noise));
        let held_out = |k: usize| (k / 150) % 5 == 3;
        let training = set(&rows, |k| k >= 20 && !held_out(k))?;
        let validation = set(&rows, held_out)?;
        let test = set(&other, |k| k >= 20)?;
        for (varied, config, settings) in &cases {
            for seed in 0..3 {
                let network = ResidualNetwork::new(config.clone(), Normalization::fit(&training), seed)?;
                let settings = TrainingConfig { seed, ..settings.clone() };
                let (network, report) =
                    train(&network, &training, Some(&validation), &settings, &mut |_| {
                        ControlFlow::Continue(())
                    })?;
                let NetworkConfig { architecture, d_model, d_state, layers, step_min, step_max, .. } = config;
                let TrainingConfig { learning_rate, state_space_learning_rate, dropout, .. } = settings;
                println!(
                    "{varied},{noise},{architecture:?},{d_model},{d_state},{layers},{step_min},{step_max},\
                     {learning_rate},{state_space_learning_rate},{dropout},{seed},{},{:.5},{:.5}",
                    report.epochs,
                    report.best_loss,
                    network.evaluate(&test)?.loss,
                );
            }
        }
    }
    Ok(())
}
