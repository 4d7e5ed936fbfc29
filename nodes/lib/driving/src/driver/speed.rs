//! Motor and brakes: towards the speed that is planned.

use super::Driver;
use crate::Place;
use crate::state::CarState;
use crate::steering::MOST_SLIP;

/// Share of the drive that is always left: cornering alone slows the car.
const LEAST_DRIVE: f64 = 0.5;
/// Share of the brakes that is always left beside the turning, at the planned speed and when too fast: a car that pushes over its front wheels gets
/// slower or leaves.
const LEAST_BRAKE: [f64; 2] = [0.15, 0.5];
/// Speed beyond the plan, over that, which is too fast.
const TOO_FAST: f64 = 0.1;
/// Share of the half width from which the car slows down.
const WIDE: f64 = 0.6;

impl Driver {
    /// Speed aimed at, and the acceleration towards it.
    pub(super) fn longitudinal(&self, state: &CarState, place: Place, angle_rad: f64) -> (f64, f64) {
        let limits = &self.plan.limits;
        let point = self.track.at(place.station_m);
        let width = if place.offset_m > 0.0 { point.left_m } else { point.right_m };
        let wide = (place.offset_m.abs() / width - WIDE).max(0.0);
        let room = (1.0 - 0.5 * wide).max(0.5);
        // A command acts later: it is meant for where the car then is.
        let ahead_m = limits.told.ahead_s() * state.v_x_mps;
        let (speed_mps, slope) = self.plan.profile.at(place.station_m + ahead_m);
        let speed_mps = speed_mps * room;
        let turned = state.v_x_mps * state.yaw_rate_radps;
        let speed_mps = self.gets_around_mps(state, place, angle_rad).min(speed_mps);
        // Front tires that steer and a body that slides sideways hold the car back, and so do air and rolling.
        let slides = -state.v_y_mps * state.yaw_rate_radps;
        let scrubs = (self.vehicle.l_r_m / self.vehicle.wheelbase_m() * turned * angle_rad.sin()).max(0.0);
        let resisted = slides + scrubs + limits.told.resistance_mps2(state.v_x_mps);
        // Where the car turns in, its yaw rate is ahead of what its slips say that the tires push with, and brakes that went by it let a car go on that is
        // too fast; where it pushes over its front wheels the yaw rate is behind, and they would take the grip that it turns with. Slips on tires that
        // nobody measured say nothing.
        let measured = if self.is_assumed() { None } else { self.governor.pushes_mps2(&self.vehicle) };
        let left = limits.left_beside(measured.unwrap_or(turned), point.curvature_1pm);
        let wanted = slope * room + resisted + self.settings.speed_gain_1ps * (speed_mps - state.v_x_mps);
        // A tire that slides has no force to spare, and what drives or brakes it turns the car further.
        let steady = 1.0 - self.plan.table.swings(state.rear_slip_rad(&self.vehicle), turned);
        let drive = limits.drive_at_mps2(state.v_x_mps)
            * left.max(LEAST_DRIVE)
            * if wide > 0.0 { 0.5 } else { 1.0 }
            * steady;
        // Whoever is too fast, or was too fast for a plan that was taken back, does not get around by steering: the brakes come first.
        let over = ((state.v_x_mps / speed_mps.max(0.1) - 1.0) / TOO_FAST).clamp(0.0, 1.0);
        let over = if self.held_back() { 1.0 } else { over };
        let least = LEAST_BRAKE[0] + (LEAST_BRAKE[1] - LEAST_BRAKE[0]) * over;
        let brake = limits.brake_mps2 * left.max(least) * steady;
        (speed_mps, wanted.clamp(-brake, drive))
    }

    /// Speed at which the car gets around here, where its front axle gives all that it has and that is less than the line asks for; else no limit. Who
    /// waits until the car is wide has to brake with what it turns with.
    fn gets_around_mps(&self, state: &CarState, place: Place, angle_rad: f64) -> f64 {
        let turned = state.v_x_mps * state.yaw_rate_radps;
        let asked = state.v_x_mps.powi(2) * self.track.at(place.station_m).curvature_1pm;
        let ahead_rad =
            (state.v_y_mps + self.vehicle.l_f_m * state.yaw_rate_radps).atan2(state.v_x_mps.max(0.1));
        let stiffer = if self.is_assumed() { self.governor.stiffer() } else { 1.0 };
        let slip = stiffer * (angle_rad - ahead_rad) * asked.signum() / self.plan.table.front_slip_rad();
        let slides = ((slip - 1.0) / (MOST_SLIP - 1.0)).clamp(0.0, 1.0);
        if slides == 0.0 || turned * asked <= 0.0 || turned.abs() >= asked.abs() {
            return f64::INFINITY;
        }
        state.v_x_mps * (1.0 + slides * ((turned / asked).sqrt() - 1.0))
    }
}
