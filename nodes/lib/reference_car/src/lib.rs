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

mod camera;
mod car;
mod cars;
mod driver;
mod effect_table;
mod effects;
mod error;
mod mechanisms;
mod motion;
mod plant;
mod plant_state;
mod profile;
mod road;
mod samples;
mod scenario;
mod sensor_settings;
mod sensors;
mod simulation;
mod steering;
mod tire;
mod track;
mod truth;

pub use camera::{Exposure, RoadCamera, RoadPicture};
pub use car::{CarParameters, DriveParameters, GRAVITY_MPS2, PitchParameters, RollParameters};
pub use cars::CAR_NAMES;
pub use driver::Command;
pub use effect_table::{EFFECTS, EffectSpec, ParameterSpec, effect_spec};
pub use effects::EffectSetting;
pub use error::{EndReason, ReferenceCarError};
pub use mechanisms::{Mechanisms, Patch};
pub use motion::{Motion, TruthSample, WheelTruth};
pub use samples::{DriveSample, ImuSample, OdometrySample, SensorSample, WheelSample};
pub use scenario::{Course, DriverKind, DriverSettings, Friction, MANOEUVRE_NAMES, Scenario};
pub use sensor_settings::{Noise, Sampling, SensorSettings};
pub use simulation::{Recording, Simulation};
pub use tire::{Contact, Tire, TireForce, TireParameters};
pub use track::{TRACK_NAMES, Track, TrackPoint, TrackPosition};
pub use truth::{truth_columns, write_truth_csv};
