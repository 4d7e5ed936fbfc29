//! Every adapter answers; one whose simulator is not installed here says so.

use std::path::PathBuf;
use std::process::Command;

use gripsight_simulator::wire::Batch;
use gripsight_simulator::{Channel, Roll as _, Simulator, SimulatorError, SimulatorFile};
use ndarray::{Array1, Array2, Array3};

use crate::support::python;

/// Straight on at 6 m/s, then a little to the left, for a tenth of a second or more.
fn turns_left(simulator: &Simulator) {
    let d = simulator.description();
    let steps = (0.6 / d.step_s).round() as usize;
    let values: Vec<f64> = d.values();
    let motion = |s: usize| if d.states[s] == Channel::VXMps { 6.0 } else { 0.0 };
    let input = |u: usize| match d.inputs[u].kind {
        gripsight_simulator::InputKind::SteeringAngle => 0.05,
        gripsight_simulator::InputKind::SteeringRate => 0.05,
        gripsight_simulator::InputKind::Speed => 6.0,
        _ => 0.0,
    };
    let batch = Batch {
        parameters: Array2::from_shape_fn((2, values.len()), |(_, p)| values[p]),
        commands: Array3::from_shape_fn((1, steps, d.inputs.len()), |(_, _, u)| input(u)),
        place_steps: Array1::from_vec(vec![0]),
        motions: Array3::from_shape_fn((1, 1, d.states.len()), |(_, _, s)| motion(s)),
        v_x_mps: d.imposes_v_x.then(|| Array2::from_elem((1, steps + 1), 6.0)),
        kicks: None,
        output_steps: Array1::from_vec(vec![0, steps as i64]),
    };
    let outputs = simulator.rollout(&batch).unwrap();
    let yaw_rate = d.output(Channel::YawRateRadps).unwrap();
    assert!(outputs.iter().all(|v| v.is_finite()), "{}: {outputs}", d.name);
    assert!(outputs[[0, 1, yaw_rate]] > 0.01, "{}: {outputs}", d.name);
    assert_eq!(outputs.row_of(0), outputs.row_of(1));
}

trait RowOf {
    fn row_of(&self, b: usize) -> Vec<f64>;
}

impl RowOf for Array3<f64> {
    fn row_of(&self, b: usize) -> Vec<f64> {
        self.index_axis(ndarray::Axis(0), b).iter().copied().collect()
    }
}

/// Starts a simulator; `None`, said so, where what it needs is not here.
fn started(text: &str) -> Option<Simulator> {
    let text = format!("{text}\npython: '{}'\nprocesses: 1", python());
    let file = SimulatorFile::parse(&text, std::env::temp_dir().as_path()).unwrap();
    match Simulator::start(&file) {
        Ok(simulator) => Some(simulator),
        Err(SimulatorError::Died { last_words, .. })
            if ["No module named", "no dynamic_models.py", "no Open-Car-Dynamics in"]
                .iter()
                .any(|w| last_words.contains(w)) =>
        {
            eprintln!("skipped: {}", last_words.lines().last().unwrap_or_default());
            None
        }
        Err(other) => panic!("{other}"),
    }
}

#[test]
fn adapters_turn_left_when_told_to() {
    let checkout = std::env::var("GRIPSIGHT_F1TENTH_GYM").unwrap_or_else(|_| "no_checkout".to_owned());
    // A clone with its submodules, and the folder that holds eigen3/Eigen.
    let of = |name: &str, other: &str| std::env::var(name).unwrap_or_else(|_| other.to_owned());
    let open_car = format!(
        "adapter: open_car_dynamics\ntime_limit_s: 1200\noptions: {{checkout: '{}', eigen: '{}'}}",
        of("GRIPSIGHT_OPEN_CAR_DYNAMICS", "no_checkout"),
        of("GRIPSIGHT_EIGEN", "/usr/include")
    );
    let gym = format!("adapter: f1tenth_gym\noptions: {{checkout: '{checkout}'}}");
    for text in [
        "adapter: slipx",
        "adapter: commonroad\noptions: {model: st}",
        "adapter: commonroad\noptions: {model: std}",
        "adapter: commonroad\noptions: {model: mb}",
        "adapter: autoware_simple_planning",
        "adapter: autoware_simple_planning\noptions: {model: ideal_steer_acc}",
        &open_car,
        &gym,
    ] {
        if let Some(simulator) = started(text) {
            turns_left(&simulator);
        }
    }
}

#[test]
fn the_example_in_cpp_answers_like_the_same_car_in_python() {
    let adapters = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("adapters");
    let folder = tempfile::tempdir().unwrap();
    let library = folder.path().join("example_car.so");
    let built = Command::new("g++")
        .args(["-O2", "-shared", "-fPIC", "-std=c++17"])
        .arg(adapters.join("example_car.cpp"))
        .arg("-o")
        .arg(&library)
        .status();
    let Ok(status) = built else {
        eprintln!("skipped: there is no g++");
        return;
    };
    assert!(status.success());
    let text = format!("command: ['{}', -m, gripsight_simulator, example_car.so]\nprocesses: 2", python());
    let native = Simulator::start(&SimulatorFile::parse(&text, folder.path()).unwrap()).unwrap();
    let python = Simulator::start(&crate::support::bicycle("sound", "processes: 1")).unwrap();
    let batch = Batch {
        parameters: Array2::from_shape_vec((2, 2), vec![40.0, 2.0, 60.0, 5.0]).unwrap(),
        commands: Array3::from_shape_fn((1, 80, 1), |(_, k, _)| 0.05 * (0.1 * k as f64).sin()),
        place_steps: Array1::from_vec(vec![0, 40]),
        motions: Array3::from_shape_fn((1, 2, 3), |(_, _, s)| [5.0, 0.1, 0.0][s]),
        v_x_mps: Some(Array2::from_shape_fn((1, 81), |(_, k)| 5.0 + 0.01 * k as f64)),
        kicks: Some(Array3::from_elem((1, 80, 3), 1e-3)),
        output_steps: Array1::from_iter((0..=80).step_by(4)),
    };
    let [a, b] = [&native, &python].map(|s| s.rollout(&batch).unwrap());
    assert_eq!(a.shape(), [2, 21, 3]);
    for (x, y) in a.iter().zip(&b) {
        approx::assert_abs_diff_eq!(*x, *y, epsilon = 1e-12);
    }
}
