//! The suite's own messages, as in `msg/`.

mod common;
mod friction;
mod gap;
mod longitudinal;
mod progress;
mod residual;
mod sequence;
mod tires;

pub use common::{Handshake, Interval, Range};
pub use friction::FrictionPrior;
pub use gap::{ExtendedModel, GapChange, GapEffect, GapParameter, GapRegion, GapReport};
pub use longitudinal::{Longitudinal, LongitudinalLimit};
pub use progress::{DriveNext, IdentificationProgress};
pub use residual::{Residual, ResidualModel};
pub use sequence::{Excitation, StateSequence};
pub use tires::{Grip, MagicFormula, PacejkaParams, PeakFriction, SignalCorrections, TirePosterior};
