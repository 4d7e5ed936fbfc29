//! A double-track race car with switchable effects, tracks, drivers and sensors: the plant that everything is tested on.
//!
//! ```
//! use gripsight_reference_car::{CarParameters, EffectSetting, Scenario, Simulation};
//!
//! let car = CarParameters::by_name("f1tenth")?;
//! let scenario = Scenario::new(car).effect(EffectSetting::parse("steering_delay=0.04")?).duration(2.0);
//! let recording = Simulation::new(scenario)?.run(|_share| {});
//! assert!(recording.end.is_completed());
//! # Ok::<(), gripsight_reference_car::ReferenceCarError>(())
//! ```
//!
//! It shares no model with the crates that identify and diagnose: another tire (brush), four wheels, springs, actuators
//! and sensors as mechanisms. Frames and signs follow REP-103; everything is a function of the scenario and its seed.

mod car;
mod driver;
mod effects;
mod error;
mod motion;
mod plant;
mod profile;
mod road;
mod scenario;
mod sensors;
mod simulation;
mod steering;
mod tire;
mod track;
mod truth;

pub use car::{CAR_NAMES, CarParameters, DriveParameters, GRAVITY_MPS2, PitchParameters, RollParameters};
pub use driver::Command;
pub use effects::{EFFECTS, EffectSetting, EffectSpec, Mechanisms, ParameterSpec, Patch, effect_spec};
pub use error::{EndReason, ReferenceCarError};
pub use motion::{Motion, TruthSample, WheelTruth};
pub use scenario::{Course, DriverKind, DriverSettings, Friction, MANOEUVRE_NAMES, Scenario};
pub use sensors::{
    DriveSample, ImuSample, Noise, OdometrySample, Sampling, SensorSample, SensorSettings, WheelSample,
};
pub use simulation::{Recording, Simulation};
pub use tire::{Contact, Tire, TireForce, TireParameters};
pub use track::{TRACK_NAMES, Track, TrackPoint, TrackPosition};
pub use truth::{truth_columns, write_truth_csv};
