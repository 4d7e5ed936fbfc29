//! Pages and pictures: the one look of every gripsight report.
//!
//! A page is one HTML file without scripts or references: it opens from a USB stick and prints on two sheets. Pictures are SVG
//! inside it. Colours have fixed [`Role`]s in every picture.
//!
//! [`identification_page`] shows the result of an identification, [`gap_page`] that of a diagnosis ([`gap_text`] says the same on a terminal),
//! [`simulator_page`] that of one with the user's own simulator, [`withheld_page`] the score of the blind check, [`calibration_page`] what a track has taught the camera. They are built of [`Chart`]s,
//! bars and tables; nothing here computes what is not only for the eye.

mod bars;
mod calibration;
mod chart;
mod error;
mod gap;
mod health;
mod identification;
mod page;
mod role;
mod simulator;
pub mod text;
mod topics;
mod withheld;

pub use calibration::{CalibrationInput, CalibrationPicture, calibration_page};
pub use chart::{Axis, Chart, Layer};
pub use error::ReportError;
pub use gap::{Before, GapInput, gap_page, gap_text};
pub use identification::{IdentificationInput, identification_page};
pub use page::Header;
pub use role::Role;
pub use simulator::{PatchSaid, SimulatorInput, simulator_page, simulator_text};
pub use topics::{TopicUse, topic_notes, topic_uses};
pub use withheld::{WithheldInput, withheld_page};
