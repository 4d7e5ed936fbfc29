//! The car that gripsight found, as the parameter files of others' simulators.
//!
//! What a simulator has no term for stands in [`Exported::left_out`]. What gripsight does not find (drive train, springs) is filled with
//! figures that keep out of the way, and the files say so.

mod commonroad;
mod open_car_dynamics;
mod slipx;

use gripsight_model::{Car, CarFile, EffectId, ModelError, OutsideTerm};
use gripsight_vehicle::OwnTires;

/// Whose files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// A car folder of slipx, as `slipx.load_car` reads it.
    Slipx,
    /// A folder of CommonRoad's vehicle models, as `setup_vehicle_parameters(1, folder)` reads it.
    Commonroad,
    /// The parameters of an Open-Car-Dynamics vehicle (single track, MF_SIMPLE tires), as its parameter manager takes them.
    OpenCarDynamics,
}

/// Files, and what they cannot say.
#[derive(Debug, Clone, PartialEq)]
pub struct Exported {
    /// Path in a folder and text of each; a single one without a name is the file itself.
    pub files: Vec<(String, String)>,
    /// Effects that the simulator has no term for.
    pub left_out: Vec<EffectId>,
    /// Whether both axles had to share one tire.
    pub axles_share_a_tire: bool,
}

/// Why a car has no such files.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The effects are not those of the library.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The simulator takes smaller cars only.
    #[error("slipx takes cars of at most {most_kg} kg, this one has {mass_kg:.0}")]
    TooHeavy {
        /// This car.
        mass_kg: f64,
        /// The largest.
        most_kg: f64,
    },
}

/// The figures of the car with its effects in them.
struct Figures {
    name: String,
    mass_kg: f64,
    yaw_inertia_kgm2: f64,
    l_f_m: f64,
    l_r_m: f64,
    h_cg_m: f64,
    wheel_radius_m: f64,
    max_steering_rad: f64,
    drive_front_share: f64,
    brake_front_share: f64,
    relaxation_m: f64,
    drag_n_s2pm2: f64,
    steering_offset_rad: f64,
    /// Time constant and shape of the servo.
    lag: Option<[f64; 2]>,
    rate_radps: Option<f64>,
    tires: OwnTires,
}

/// Wheel radius over wheelbase of a car whose own is not known.
const RADIUS_SHARE: f64 = 0.15;

fn figures(file: &CarFile, effects: &[(EffectId, Vec<f64>)]) -> Figures {
    let vehicle = &file.vehicle;
    let mut car = Car::nominal(vehicle, [file.tires.front.d, file.tires.rear.d]);
    effects.iter().for_each(|(effect, own)| effect.car(own, &mut car));
    let of = |term: OutsideTerm| {
        effects.iter().find(|(e, _)| e.spec().outside == Some(term)).map(|(_, own)| own.as_slice())
    };
    Figures {
        name: vehicle.name.clone().unwrap_or_else(|| "car".to_owned()),
        mass_kg: car.mass_kg,
        yaw_inertia_kgm2: car.yaw_inertia_kgm2,
        l_f_m: car.l_f_m,
        l_r_m: car.l_r_m,
        h_cg_m: of(OutsideTerm::CogHeight).map_or(vehicle.h_cg_m, |own| own[0]),
        wheel_radius_m: vehicle.wheel_radius_m.unwrap_or(RADIUS_SHARE * vehicle.wheelbase_m()),
        max_steering_rad: vehicle.max_steering_rad,
        drive_front_share: vehicle.front_drive_share(),
        brake_front_share: vehicle.front_brake_share(),
        relaxation_m: car.relaxation_m,
        drag_n_s2pm2: car.drag_1pm * vehicle.mass_kg,
        steering_offset_rad: of(OutsideTerm::SteeringOffset).map_or(0.0, |own| own[0]),
        lag: of(OutsideTerm::SteeringLag).map(|own| [own[0], own[1]]).filter(|own| own[0] > 0.0),
        rate_radps: of(OutsideTerm::SteeringRateLimit).filter(|own| own[0] > 0.0).map(|own| 1.0 / own[0]),
        tires: file.tires,
    }
}

/// What every target takes with the car's figures.
const FIGURES: [OutsideTerm; 4] =
    [OutsideTerm::Mass, OutsideTerm::YawInertia, OutsideTerm::AxleDistances, OutsideTerm::CogHeight];

/// A car's files for a simulator.
///
/// # Errors
/// [`ExportError::Model`] where its effects are not those of the library, [`ExportError::TooHeavy`] where the simulator does not take it.
pub fn export(target: Target, car: &CarFile) -> Result<Exported, ExportError> {
    let effects = car.effects()?;
    let figures = figures(car, &effects);
    let (files, more): (_, &[OutsideTerm]) = match target {
        Target::Slipx => (slipx::files(&figures)?, &slipx::TERMS),
        Target::Commonroad => (commonroad::files(&figures), &commonroad::TERMS),
        Target::OpenCarDynamics => (open_car_dynamics::files(&figures), &open_car_dynamics::TERMS),
    };
    let named = effects.iter().map(|(effect, _)| *effect);
    let has =
        |e: &EffectId| e.spec().outside.is_some_and(|term| FIGURES.contains(&term) || more.contains(&term));
    let left_out = named.filter(|e| !has(e)).collect();
    Ok(Exported { files, left_out, axles_share_a_tire: target == Target::Commonroad })
}
