//! Pages and pictures: the one look of every gripsight report.
//!
//! A page is one HTML file without scripts or references: it opens from a USB stick and prints on two sheets. Pictures are SVG
//! inside it. Colours have fixed [`Role`]s in every picture.
//!
//! [`identification_page`] shows the result of an identification, [`gap_page`] that of a diagnosis ([`gap_text`] says the same on a terminal),
//! [`simulator_page`] that of one with the user's own simulator, [`withheld_page`] the score of the blind check, [`calibration_page`] what a track has taught the camera. They are built of [`Chart`]s,
//! bars and tables; nothing here computes what is not only for the eye. Each page is a feature of its own (`gap`, `identification`, `simulator`, `withheld`,
//! `calibration`; by default all), so that a node links only what its page shows.

#![cfg_attr(not(feature = "default"), allow(dead_code, reason = "a page alone does not take every brick"))]

mod bars;
#[cfg(feature = "calibration")]
mod calibration;
mod chart;
mod error;
#[cfg(feature = "gap")]
mod gap;
mod health;
#[cfg(feature = "identification")]
mod identification;
mod page;
mod role;
#[cfg(feature = "simulator")]
mod simulator;
pub mod text;
#[cfg(feature = "gap")]
mod topics;
#[cfg(feature = "withheld")]
mod withheld;

#[cfg(feature = "calibration")]
pub use calibration::{CalibrationInput, CalibrationPicture, calibration_page};
pub use chart::{Axis, Chart, Layer};
pub use error::ReportError;
#[cfg(feature = "gap")]
pub use gap::{Before, GapInput, gap_page, gap_text};
#[cfg(feature = "identification")]
pub use identification::{
    IdentificationInput, UNKNOWN, drive_train, estimate, identification_page, peak_friction, status,
    understeer,
};
pub use page::Header;
pub use role::Role;
#[cfg(feature = "simulator")]
pub use simulator::{PatchSaid, SimulatorInput, simulator_page, simulator_text};
#[cfg(feature = "gap")]
pub use topics::{TopicUse, topic_notes, topic_uses};
#[cfg(feature = "withheld")]
pub use withheld::{WithheldInput, withheld_page};
