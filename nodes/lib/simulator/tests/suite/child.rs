//! What is said of a simulator that dies, hangs, or answers nonsense; and what a sound one answers.

use std::time::Instant;

use gripsight_simulator::wire::Batch;
use gripsight_simulator::{Roll, Simulator};
use ndarray::{Array1, Array2, Array3};

use crate::support::bicycle;

const STEPS: usize = 60;

/// A left turn at 5 m/s, with the stiffnesses given.
fn batch(stiffness: &[f64]) -> Batch {
    let parameters = Array2::from_shape_fn((stiffness.len(), 2), |(b, p)| [stiffness[b], 2.0][p]);
    Batch {
        parameters,
        commands: Array3::from_elem((1, STEPS, 1), 0.05),
        place_steps: Array1::from_vec(vec![0, 30]),
        motions: Array3::from_shape_fn((1, 2, 3), |(_, _, s)| [5.0, 0.0, 0.0][s]),
        v_x_mps: None,
        kicks: None,
        output_steps: Array1::from_iter(0..=STEPS as i64),
    }
}

#[test]
fn a_sound_one_gives_the_same_however_many_processes_share_the_passes() {
    let one = Simulator::start(&bicycle("sound", "processes: 1")).unwrap();
    let three = Simulator::start(&bicycle("prints", "processes: 3")).unwrap();
    assert_eq!(one.description().parameters.len(), 2);
    let batch = batch(&[30.0, 40.0, 50.0, 60.0]);
    let first = one.rollout(&batch).unwrap();
    assert_eq!(first, three.rollout(&batch).unwrap());
    assert_eq!((first.shape(), one.passes()), ([4, STEPS + 1, 3].as_slice(), 4));
    // Two steps of delay: nothing before, a turn to the left after; put back at step 30, with the steering still in force.
    assert!(first[[0, 2, 2]] == 0.0 && first[[0, 4, 2]] > 0.0 && first[[3, 10, 2]] > first[[0, 10, 2]]);
    assert!(first[[0, 30, 2]] == 0.0 && first[[0, 31, 2]] > 0.0);
}

#[test]
fn a_forward_speed_is_imposed_and_kicks_are_added() {
    let simulator = Simulator::start(&bicycle("sound", "processes: 1")).unwrap();
    let plain = batch(&[40.0]);
    let slow = Batch { v_x_mps: Some(Array2::from_elem((1, STEPS + 1), 4.0)), ..plain.clone() };
    let kicks = Array3::from_shape_fn((1, STEPS, 3), |(_, k, s)| if k == 20 && s == 2 { 0.3 } else { 0.0 });
    let kicked = Batch { kicks: Some(kicks), ..plain.clone() };
    let [plain, slow, kicked] = [plain, slow, kicked].map(|b| simulator.rollout(&b).unwrap());
    assert!(slow[[0, 10, 0]] == 4.0 && plain[[0, 10, 0]] == 5.0);
    assert_eq!(plain[[0, 20, 2]], kicked[[0, 20, 2]]);
    approx::assert_abs_diff_eq!(kicked[[0, 21, 2]], plain[[0, 21, 2]] + 0.3, epsilon = 1e-12);
}

#[test]
fn what_python_cannot_divide_is_not_finite_and_ends_nothing() {
    let simulator = Simulator::start(&bicycle("sound", "processes: 1")).unwrap();
    // The first stretch is begun standing still.
    let mut batch = batch(&[40.0]);
    batch.motions[[0, 0, 0]] = 0.0;
    let seen = simulator.rollout(&batch).unwrap();
    assert!(seen[[0, 0, 2]] == 0.0 && (1..30).all(|k| seen[[0, k, 2]].is_nan()));
    assert!((30..=STEPS).all(|k| seen[[0, k, 2]].is_finite()) && seen[[0, 40, 2]] > 0.0);
}

#[test]
fn what_is_wrong_is_said_in_time() {
    let start = Instant::now();
    for (how, says) in [
        ("dies_at_once", ["ended (exit status: 1) when it was started", "cannot open car.yaml"]),
        ("never_calls", ["no answer when it was started within 0.7 s", "time_limit_s"]),
        ("no_yaw_rate", ["yaw_rate_radps is not among the outputs", ""]),
        ("bounds", ["parameter mass: 9 is not between 1 and 2", ""]),
        ("unknown_channel", ["unknown variant `yaw_rate`", "yaw_rate_radps"]),
        ("garbage", ["eight bytes of length", ".npz"]),
        ("version", ["version 2", "version 1"]),
    ] {
        let limit = if how == "never_calls" { 0.7 } else { 20.0 };
        let file = bicycle(how, &format!("processes: 1\ntime_limit_s: {limit}"));
        let error = Simulator::start(&file).unwrap_err().to_string();
        assert!(says.iter().all(|s| error.contains(s)), "{how}: {error}");
    }
    for (how, says) in [
        ("dies", ["ended (exit status: 7) in a rollout", "the lookup table is empty"]),
        ("hangs", ["no answer in a rollout within 3 s", "time_limit_s"]),
        ("raises", ["failed in a rollout", "ValueError: no such tire"]),
        ("shape", ["has the shape [2, 60, 3]", "expected [2, 61, 3]"]),
    ] {
        let limit = if how == "hangs" { 3.0 } else { 20.0 };
        let file = bicycle(how, &format!("processes: 1\ntime_limit_s: {limit}"));
        let simulator = Simulator::start(&file).unwrap();
        let error = simulator.rollout(&batch(&[40.0, 50.0])).unwrap_err().to_string();
        assert!(says.iter().all(|s| error.contains(s)), "{how}: {error}");
    }
    assert!(start.elapsed().as_secs() < 60);
    let nothing =
        gripsight_simulator::SimulatorFile::parse("command: [no_such_command]", ".".as_ref()).unwrap();
    let error = Simulator::start(&nothing).unwrap_err().to_string();
    assert!(error.contains("`no_such_command` does not start"), "{error}");
}
