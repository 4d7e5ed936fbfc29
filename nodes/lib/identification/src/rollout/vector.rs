//! The parameter vector of the rollout, and what is in it.

use gripsight_vehicle::{MagicFormula, PacejkaParameters, Real};
use serde::{Deserialize, Serialize};

use crate::SignalCorrections;

/// Number of parameters of [`TireRollout`](super::TireRollout): (k, C, D, E) front and rear with k = B C D, the
/// signal corrections, the tires' relaxation length, how much longitudinal force takes from the lateral, how much of the
/// load transfer is felt, and the scales of the motion's signals.
pub(crate) const PARAMETERS: usize = 20;
/// Place of the first signal correction.
pub(crate) const SIGNALS: usize = 8;
/// Place of the relaxation length.
pub(crate) const RELAXATION: usize = 14;
/// Place of the share of combined slip.
pub(crate) const COMBINED: usize = 15;
/// Place of the share of load transfer.
pub(crate) const TRANSFER: usize = 16;
/// Place of v_x as reported over the true one,
pub(crate) const V_X_SCALE: usize = 17;
/// of the same of the yaw rate,
pub(crate) const YAW_RATE_SCALE: usize = 18;
/// and of the share of the rear axle's sideslip that the reported v_y shows: an observer on tires that are too stiff shows less than one.
pub(crate) const SLIP_SHARE: usize = 19;
/// Names of the parameters, with their units where they have one.
pub(crate) const NAMES: [&str; PARAMETERS] = [
    "front.k",
    "front.c",
    "front.d",
    "front.e",
    "rear.k",
    "rear.c",
    "rear.d",
    "rear.e",
    "steering_delay_s",
    "steering_gain",
    "steering_offset_rad",
    "v_y_lever_arm_m",
    "v_y_bias_mps",
    "yaw_rate_bias_radps",
    "relaxation_m",
    "combined_slip",
    "load_transfer",
    "v_x_scale",
    "yaw_rate_scale",
    "v_y_slip_share",
];

/// What the estimation allows for and Phi_p does not hold.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Nuisance {
    /// Relaxation length of the tires.
    pub relaxation_m: f64,
    /// How much of the friction ellipse is at work: 0 none, 1 all.
    pub combined_slip: f64,
    /// Share of the longitudinal load transfer that the tires feel: 0 none, 1 that of a rigid car on tires without load sensitivity.
    pub load_transfer: f64,
}

/// Nuisances of a parameter vector.
pub(crate) fn nuisance_of(p: &[f64]) -> Nuisance {
    Nuisance { relaxation_m: p[RELAXATION], combined_slip: p[COMBINED], load_transfer: p[TRANSFER] }
}

/// Tires of a parameter vector.
pub(crate) fn tires_of<T: Real>(p: &[T]) -> PacejkaParameters<T> {
    let axle = |v: &[T]| MagicFormula { b: v[0] / (v[1] * v[2]), c: v[1], d: v[2], e: v[3] };
    PacejkaParameters { front: axle(&p[..4]), rear: axle(&p[4..8]) }
}

/// The parameter vector of tires and corrections.
pub(crate) fn vector_of(
    tires: &PacejkaParameters,
    corrections: &SignalCorrections,
    nuisance: &Nuisance,
) -> [f64; PARAMETERS] {
    let axle = |f: &MagicFormula| [f.normalized_stiffness(), f.c, f.d, f.e];
    let (front, rear, signals) = (axle(&tires.front), axle(&tires.rear), corrections.to_array());
    std::array::from_fn(|j| match j {
        0..4 => front[j],
        4..8 => rear[j - 4],
        RELAXATION => nuisance.relaxation_m,
        COMBINED => nuisance.combined_slip,
        TRANSFER => nuisance.load_transfer,
        V_X_SCALE | YAW_RATE_SCALE | SLIP_SHARE => 1.0,
        _ => signals[j - SIGNALS],
    })
}

/// Signal corrections of a parameter vector.
pub(crate) fn corrections_of(p: &[f64]) -> SignalCorrections {
    SignalCorrections::from_array(std::array::from_fn(|j| p[SIGNALS + j]))
}
