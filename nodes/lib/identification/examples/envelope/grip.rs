//! What watching a set while driving is worth: false alarms, and how late a fall of grip is told.

use anyhow::Result;
use gripsight_identification::{Config, GripWatch, ResidualKind, identify};
use gripsight_reference_car::Friction;
use gripsight_signals::{DriveSample, OdometrySample, StateSequence, TelemetrySample};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::cases;
use crate::support::reference;

/// The set is found on the time before, and the grip falls at this time.
const FALLS_S: f64 = 25.0;
const DURATION_S: f64 = 45.0;
/// What is left of the grip, drawn; above one: nothing falls.
const LEFT: (f64, f64) = (0.5, 1.3);

fn sample(sequence: &StateSequence, k: usize) -> TelemetrySample {
    let stamp_ns = (f64::from(sequence.time_s[k]) * 1e9) as i64;
    TelemetrySample {
        odometry: OdometrySample {
            stamp_ns,
            v_x_mps: f64::from(sequence.v_x_mps[k]),
            v_y_mps: f64::from(sequence.v_y_mps[k]),
            yaw_rate_radps: f64::from(sequence.yaw_rate_radps[k]),
            ..OdometrySample::default()
        },
        drive: DriveSample {
            stamp_ns,
            steering_angle_rad: f64::from(sequence.steering_rad[k]),
            ..DriveSample::default()
        },
        ..TelemetrySample::default()
    }
}

/// The part of a sequence before a time.
fn before(sequence: &StateSequence, time_s: f64) -> StateSequence {
    let n = sequence.time_s.partition_point(|&t| f64::from(t) < time_s);
    let cut = |v: &Vec<f32>| v[..n.min(v.len())].to_vec();
    StateSequence {
        time_s: cut(&sequence.time_s),
        v_x_mps: cut(&sequence.v_x_mps),
        v_y_mps: cut(&sequence.v_y_mps),
        yaw_rate_radps: cut(&sequence.yaw_rate_radps),
        steering_rad: cut(&sequence.steering_rad),
        ..StateSequence::default()
    }
}

/// Prints a row a drive: grip left, the lowest share that was given before and after, looks, and times of the first look that misses a tenth and of the warning.
pub(crate) fn run(from: u64, to: u64) -> Result<()> {
    println!("run,left,status,promised,looks,least_before,least_after,missing_s,warned_s,driven_s");
    for seed in from..to {
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x0fa1_1515);
        let left: f64 = random.random_range(LEFT.0..LEFT.1).min(1.0);
        let pace = random.random_range(0.6..0.95);
        let mut case = cases::draw(seed, DURATION_S)?;
        let mu = case.scenario.friction.nominal();
        case.scenario.driver.pace = pace;
        case.scenario.friction = Friction::Changing { mu, mu_after: left * mu, at_s: FALLS_S, over_s: 0.1 };
        let (_, sequence, vehicle) = reference::drive(case.scenario);
        let config = Config { residual: ResidualKind::None, ..Config::default() };
        let known = before(&sequence, FALLS_S);
        let Ok(outcome) = identify(&known, &vehicle, None, None, &config, &mut |_| {}) else { continue };
        let Some(set) = outcome.accepted_set() else {
            println!("{},{left:.3},{},,,,,,,", case.name, outcome.status.name());
            continue;
        };
        let mut watch = GripWatch::new(&vehicle, &set)?;
        let (mut looks, mut least, mut missing_s, mut warned_s) = (0, [f64::INFINITY; 2], f64::NAN, f64::NAN);
        for k in 0..sequence.len() {
            let Some(look) = watch.push(&sample(&sequence, k)) else { continue };
            let now_s = f64::from(sequence.time_s[k]);
            looks += 1;
            let after = usize::from(now_s > FALLS_S);
            least[after] = least[after].min(look.share);
            if missing_s.is_nan() && after == 1 && look.share < 0.9 {
                missing_s = now_s;
            }
            if warned_s.is_nan() && look.fallen {
                warned_s = now_s;
            }
        }
        let promised = set.promised.front.d.min(set.promised.rear.d);
        println!(
            "{},{left:.3},{},{promised:.3},{looks},{:.3},{:.3},{missing_s:.2},{warned_s:.2},{:.1}",
            case.name,
            outcome.status.name(),
            least[0],
            least[1],
            sequence.duration_s()
        );
    }
    Ok(())
}
