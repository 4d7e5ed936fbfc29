//! From a state sequence to Pacejka parameters: signal corrections, residual learning, virtual steering sweep, fit, acceptance.

pub mod shooting;
