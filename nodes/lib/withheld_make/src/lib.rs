//! Cases for the blind check: drives whose effect is withheld, and labels that are sealed.
//!
//! [`Batch`] plans cases and makes them one by one; [`Journal`] remembers what is made; [`Labels`] seals and opens what was true.
//! [`oracle_fits`] says what each drive can show. Nothing here knows the models of identification and diagnosis
//! (`tests/independence.rs`).

mod batch;
mod draw;
mod drive;
mod error;
mod journal;
mod label;
mod measured;
mod oracle;
mod pairs;
mod plan;
pub mod reference_pairs;
mod tires;

pub use batch::{Batch, BatchSettings, files};
pub use draw::{Pool, names as effect_names};
pub use error::WithheldError;
pub use journal::Journal;
pub use label::{
    COMMITMENT, CaseLabel, Family, Kind, Labels, OracleFit, SealedEffect, sha256_hex, sizing_parameter,
};
pub use measured::MeasuredDrives;
pub use oracle::{TIRE_TRUST, oracle_fits};
pub use pairs::SimulatorPairs;
