//! Residual networks with memory: the S4D layer, its baselines, and a trainer that runs in process.
//!
//! The network learns `e_k = [dv_y, dw]`, what a vehicle model leaves unexplained in one time step, from the sequence
//! `u_k = [v_x, v_y, w, d]` of states and steering:
//!
//! ```text
//! x_k = W_e (u_k - mean)/scale + b_e                                  encoder, 4 -> H
//! h_k = A_bar h_(k-1) + x_k,   y_k = 2 Re(C_bar h_k) + D x_k          S4D, one state space per channel
//! e_k = (W_d dropout(gelu(y_k)) + b_d) output_scale                   decoder, H -> 2
//!
//! A_bar = exp(Delta A),   C_bar = C (A_bar - 1)/A                     zero-order hold
//! y = K * x + D x,   K_k = 2 Re sum_n C_bar_n A_bar_n^k               the same map as a convolution
//! ```
//!
//! | symbol | name | shape | meaning |
//! | --- | --- | --- | --- |
//! | H | `d_model` | | channels of the hidden sequence |
//! | N | `d_state` | | states per channel, in N/2 conjugate pairs |
//! | L | | | samples of a sequence |
//! | Delta | `log_dt` | (H) | step, in samples |
//! | A | `log_a_real`, `a_imag` | (H, N/2) | `-exp(log_a_real) + i a_imag`, diagonal, S4D-Lin at the start |
//! | C, D | `c`, `d` | (H, N/2, 2), (H) | output matrix, direct path; B = 1 |
//! | u | | (4, L) | m/s, m/s, rad/s, rad |
//! | e | | (2, L) | m/s and rad/s per time step |
//!
//! Whole sequences ([`ResidualNetwork::forward_sequence`] and [`train`]) convolve by FFT; streaming
//! ([`ResidualNetwork::step`]) runs the recurrence without allocating. Both are equal to rounding. Every gradient is written
//! by hand and every parameter is trained; `log_dt, log_a_real, a_imag` have their own rate and no weight decay.
//! The baselines of the paper, a multilayer perceptron and an Elman network, are other [`Architecture`]s of the same
//! [`ResidualNetwork`].
//!
//! All arithmetic is in `f64`, and every random number comes from a seed: the same input gives the same bits on the same
//! build and machine (the FFT picks its instructions by processor).
//!
//! Not implemented: the normal-plus-low-rank form of S4, mini-batches, layer normalisation and skip connections.
//!
//! Sources: Wu et al., arXiv 2603.09399, section on dynamic residual error modelling (eqs. `s4_cont` to `s4_conv`); Gu, Gupta,
//! Goel, Re, arXiv 2206.11893 (S4D and the S4D-Lin initialisation).
//!
//! ```
//! use gripsight_s4::{NetworkConfig, Normalization, ResidualNetwork, Sequence, TrainingConfig, TrainingSet, train};
//! use std::ops::ControlFlow;
//!
//! # fn main() -> Result<(), gripsight_s4::Error> {
//! let length = 64;
//! let sequence = Sequence {
//!     inputs: (0..4 * length).map(|k| (0.1 * k as f64).sin()).collect(),
//!     targets: (0..2 * length).map(|k| (0.1 * k as f64).cos()).collect(),
//!     weights: vec![1.0; length],
//! };
//! let set = TrainingSet::new(4, 2, &[sequence])?;
//! let network = ResidualNetwork::new(NetworkConfig::default(), Normalization::fit(&set), 1)?;
//! let settings = TrainingConfig { epochs_max: 20, ..TrainingConfig::default() };
//! let (network, report) = train(&network, &set, None, &settings, &mut |_| ControlFlow::Continue(()))?;
//! assert!(report.best_loss < report.initial_loss);
//!
//! let mut state = network.stream_state();
//! let mut residual = [0.0; 2];
//! network.step(&mut state, &[3.0, 0.1, 0.5, 0.05], &mut residual)?;
//! # Ok(())
//! # }
//! ```

mod config;
mod error;
mod layers;
mod network;
mod normalization;
mod pipeline;
mod training;

pub use config::{Architecture, NetworkConfig};
pub use error::Error;
pub use layers::{ParameterBlock, ParameterGroup};
pub use network::{Gradients, ResidualNetwork, StreamState};
pub use normalization::Normalization;
pub use training::{
    Evaluation, Progress, Schedule, Sequence, StopReason, TrainingConfig, TrainingReport, TrainingSet, train,
};
