//! What a grip and a set of tires let the driver plan.

use gripsight_vehicle::{PacejkaParameters, VehicleParameters};

use crate::Track;
use crate::predictive::PathModel;
use crate::profile::{Drivetrain, Limits, SpeedProfile};
use crate::tires::{SteeringTable, TireSet, Trust, with_grip};

/// Share of the tires' peak that steering counts on however little is planned.
const STEERS: f64 = 0.7;

/// Share of the peak that steering counts on at most to plan with, where that peak is not known.
const ROOM: f64 = 0.9;

/// Share of what measured tires brake and drive with, where nobody has measured them: a road that gives less is noticed in a corner, and whoever comes
/// into it later has less room.
const UNMEASURED: f64 = 0.85 / 0.9;

/// What is planned with.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub(crate) tires: PacejkaParameters,
    pub(crate) grip: f64,
    pub(crate) limits: Limits,
    pub(crate) profile: SpeedProfile,
    pub(crate) table: SteeringTable,
    pub(crate) model: PathModel,
}

impl Plan {
    /// The tires of a set with their grip a little above what is planned, so that the plan stays below it.
    pub(crate) fn new(
        vehicle: &VehicleParameters,
        drivetrain: &Drivetrain,
        track: &Track,
        set: &TireSet,
        grip: f64,
    ) -> Self {
        let TireSet { tires, likely_peaks, .. } = set;
        let known = tires.front.d.min(tires.rear.d);
        // A plan beyond what the set promises is steered with some room above it, too.
        let peak = if grip > known { grip / ROOM } else { known };
        // A car that is faster than a plan that was taken back still needs all that its tires give.
        let likely_peaks = likely_peaks.unwrap_or([tires.front.d, tires.rear.d]);
        let tires = with_grip(tires, likely_peaks, peak.min((grip / ROOM).max(STEERS * peak)));
        let mut limits = Limits::new(vehicle, &tires, grip, drivetrain);
        if set.trust == Trust::Assumed {
            limits.drive_mps2 *= UNMEASURED;
            limits.brake_mps2 *= UNMEASURED;
        }
        Self {
            profile: SpeedProfile::new(track, &limits),
            table: SteeringTable::new(vehicle, &tires),
            model: PathModel::new(vehicle, &tires),
            tires,
            grip,
            limits,
        }
    }
}
