//! One car under worse and worse recording, and from other starts and priors.

use anyhow::Result;
use gripsight_identification::{Config, FrictionPrior, ResidualKind};
use gripsight_reference_car::{Friction, Scenario, SensorSettings};
use gripsight_signals::StateSequence;
use gripsight_vehicle::{MagicFormula, PacejkaParameters};

use crate::support::{Run, reference, truth_of};
use crate::{PLAIN, row};

/// Drives that everything is done to: car, track, friction, pace, seed.
const DRIVES: [(&str, &str, f64, f64, u64); 3] = [
    ("f1tenth", "esses", 0.7, 0.95, 352),
    ("formula_student", "club", 0.9, 0.9, 353),
    ("passenger_car", "esses", 0.8, 0.95, 354),
];

type Change = fn(Scenario) -> Scenario;

/// What may be wrong with a recording.
const RECORDINGS: [(&str, Change); 8] = [
    ("as it is", |s| s),
    ("noise x3", |s| noisy(s, 3.0)),
    ("noise x10", |s| noisy(s, 10.0)),
    ("20 Hz", |s| sensors(s, |set| (set.odometry.rate_hz, set.imu.rate_hz) = (20.0, 20.0))),
    ("jitter 3 ms", |s| sensors(s, |set| set.odometry.jitter_s = 0.003)),
    ("10 % dropped", |s| sensors(s, |set| (set.odometry.dropped, set.drive_dropped) = (0.1, 0.1))),
    ("friction +20 % at 15 s", |s| stepped(s, 1.2)),
    ("friction -20 % at 15 s", |s| stepped(s, 0.8)),
];

fn noisy(scenario: Scenario, factor: f64) -> Scenario {
    let sensors = scenario.sensors.scaled(factor);
    scenario.sensors(sensors)
}

fn sensors(scenario: Scenario, change: impl Fn(&mut SensorSettings)) -> Scenario {
    let mut settings = scenario.sensors;
    change(&mut settings);
    scenario.sensors(settings)
}

fn stepped(scenario: Scenario, factor: f64) -> Scenario {
    let mu = scenario.friction.nominal();
    scenario.friction(Friction::Changing { mu, mu_after: factor * mu, at_s: 15.0, over_s: 1.0 })
}

/// The same without the samples from 12 to 14 s.
fn with_gap(sequence: &StateSequence) -> StateSequence {
    let keep: Vec<usize> =
        (0..sequence.len()).filter(|&k| !(12.0..14.0).contains(&sequence.time_s[k])).collect();
    let cut = |v: &Vec<f32>| {
        if v.is_empty() { Vec::new() } else { keep.iter().map(|&k| v[k]).collect() }
    };
    StateSequence {
        time_s: cut(&sequence.time_s),
        v_x_mps: cut(&sequence.v_x_mps),
        v_y_mps: cut(&sequence.v_y_mps),
        yaw_rate_radps: cut(&sequence.yaw_rate_radps),
        steering_rad: cut(&sequence.steering_rad),
        x_m: cut(&sequence.x_m),
        y_m: cut(&sequence.y_m),
        yaw_rad: cut(&sequence.yaw_rad),
        ..StateSequence::default()
    }
}

fn simulated(scenario: Scenario, name: &str) -> Run {
    let (recording, sequence, vehicle) = reference::drive(scenario);
    let truth = truth_of(&recording, &vehicle);
    Run { name: name.to_owned(), vehicle, sequence, truth }
}

pub(crate) fn run() -> Result<()> {
    let plain = Config { residual: ResidualKind::None, ..Config::default() };
    for (car, track, mu, pace, seed) in DRIVES {
        let scenario = || reference::with_background(reference::scenario(car, track, mu, pace, seed));
        for (what, change) in RECORDINGS {
            let run = simulated(change(scenario()), &format!("{car}: {what}"));
            println!("{}", row(&run, PLAIN, None, &plain)?);
        }
        let mut run = simulated(scenario(), &format!("{car}: 2 s gap"));
        let whole = std::mem::take(&mut run.sequence);
        run.sequence = with_gap(&whole);
        println!("{}", row(&run, PLAIN, None, &plain)?);
        run.sequence = whole;
        for wrong in [-0.3, 0.0, 0.3] {
            run.name = format!("{car}: prior off by {wrong}");
            let prior = FrictionPrior { mu: mu + wrong, sigma: 0.1 };
            println!("{}", row(&run, PLAIN, Some(prior), &plain)?);
        }
        for mu0 in [0.3, 0.51, 0.8, 1.2] {
            for (k, c, e) in [(6.0, 1.4, 0.0), (12.0, 1.1, -1.0), (3.0, 1.9, 0.5)] {
                let axle = MagicFormula::from_stiffness(k, c, mu0, e);
                let initial = PacejkaParameters { front: axle, rear: axle };
                run.name = format!("{car}: start mu0 {mu0} k {k} c {c} e {e}");
                println!("{}", row(&run, PLAIN, None, &Config { initial, ..plain.clone() })?);
            }
        }
    }
    Ok(())
}
