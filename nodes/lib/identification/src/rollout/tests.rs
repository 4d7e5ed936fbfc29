//! The derivatives that fits go by, and what the front wheels' drag does.

use gripsight_vehicle::{Dual, MagicFormula, PacejkaParameters};

use super::*;
use crate::SignalCorrections;

const LEN: usize = 30;

/// A left turn of 0.6 s, ever tighter, then less so.
fn segment() -> Segment {
    let wave = |scale: f64, per_s: f64| (0..LEN).map(|k| scale * (per_s * 0.02 * k as f64).sin()).collect();
    Segment {
        dt_s: 0.02,
        v_x_mps: (0..LEN).map(|k| 6.0 + 0.5 * (0.06 * k as f64).cos()).collect(),
        v_y_mps: vec![0.0; LEN],
        yaw_rate_radps: wave(1.5, 4.0),
        steering_rad: wave(0.08, 4.0),
        ..Segment::default()
    }
}

fn parameters() -> [f64; PARAMETERS] {
    let axle = |stiffness| MagicFormula::from_stiffness(stiffness, 1.5, 0.9, -0.2);
    let signals = SignalCorrections { steering_delay_s: 0.033, ..SignalCorrections::NONE };
    let nuisance = Nuisance { relaxation_m: 0.08, combined_slip: 0.8, load_transfer: 0.9 };
    vector_of(&PacejkaParameters { front: axle(10.0), rear: axle(14.0) }, &signals, &nuisance)
}

/// v_y and yaw rate at the end of the rollout.
fn end<T: Real>(vehicle: &VehicleParameters, p: &[T]) -> [T; 2] {
    let segments = [segment()];
    let a_x_mps2 = [(0..LEN).map(|k| 3.0 * (0.2 * k as f64).sin()).collect()];
    let model = TireRollout { vehicle, segments: &segments, a_x_mps2: &a_x_mps2 };
    let mut out = Vec::new();
    let start = [0.1, -0.2].map(T::from);
    model.rollout(p, start, &Window { segment: 0, from: 0, len: LEN }, &mut out);
    [out[2 * LEN - 2], out[2 * LEN - 1]]
}

#[test]
fn derivatives_are_those_of_the_rollout() {
    let vehicle = VehicleParameters { drive_front_share: Some(0.4), ..VehicleParameters::f1tenth() };
    let at = parameters();
    let duals: Vec<Dual<PARAMETERS>> = (0..PARAMETERS).map(|j| Dual::variable(at[j], j)).collect();
    let found = end(&vehicle, &duals);
    for j in 0..PARAMETERS {
        let h = 1e-5 * at[j].abs().max(0.1);
        let moved = |by: f64| {
            end(&vehicle, &std::array::from_fn::<_, PARAMETERS, _>(|i| at[i] + if i == j { by } else { 0.0 }))
        };
        let (up, down) = (moved(h), moved(-h));
        for channel in 0..2 {
            let numeric = (up[channel] - down[channel]) / (2.0 * h);
            let exact = found[channel].derivatives()[j];
            approx::assert_relative_eq!(exact, numeric, max_relative = 1e-3, epsilon = 1e-4);
        }
    }
}

#[test]
fn drag_of_the_outer_front_wheel_turns_the_car_out_of_the_corner() {
    let tall = VehicleParameters::f1tenth();
    let flat = VehicleParameters { h_cg_m: 0.0, ..tall.clone() };
    let mut p = parameters();
    p[TRANSFER] = 0.0;
    let [with, without] = [&tall, &flat].map(|vehicle| end(vehicle, &p)[1]);
    assert!(without > 0.5 && (0.9 * without..0.999 * without).contains(&with), "{with} {without}");
}
