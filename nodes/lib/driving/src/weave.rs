//! A slalom within the track, where identification wants turn-ins that the line does not have.
//!
//! A car that follows a smooth line slowly hardly slips: after 8 to 10 s of it the rear stiffness of a passenger car was known to a factor of 2 to 3 only, and
//! in 18 of 30 runs on development tracks the first set came more than 10 s after the first corner. Weaving, all 30 had one after 8 s.

use std::f64::consts::TAU;

use gripsight_vehicle::GRAVITY_MPS2;

use crate::state::CarState;
use crate::{Place, Track};

/// Frequency: above that at which a line bends, below that at which a car no longer follows. A slalom of 0.25 g is 6 cm wide to each side.
const FREQUENCY_HZ: f64 = 1.0;
/// Largest lateral acceleration over the grip planned with.
const SHARE: f64 = 0.5;
/// Share of the grip planned with that the line may ask for and the slalom together: tires that nobody measured are planned with half of it.
const TOGETHER: f64 = 1.3;
/// Largest angle of the wheels for it: a car that starts goes straight.
const TURNED_RAD: f64 = 0.06;
/// Time ahead in which the line is looked at, and at how many places.
const AHEAD_S: f64 = 0.5;
const LOOKS: usize = 5;
/// Share of the way to the track's edge within which the car stays.
const ROOM: f64 = 0.5;

/// Lateral acceleration of the slalom at a moment, on top of what the line asks for. `grip`: that planned with.
pub(crate) fn weave_mps2(state: &CarState, place: Place, track: &Track, wheelbase_m: f64, grip: f64) -> f64 {
    let most_mps2 = grip * GRAVITY_MPS2;
    let speed_sq = state.v_x_mps * state.v_x_mps;
    let asked = |look: usize| {
        let ahead_s = AHEAD_S * look as f64 / (LOOKS - 1) as f64;
        let at = track.at(place.station_m + ahead_s * state.v_x_mps);
        at.curvature_1pm.abs() * speed_sq / most_mps2
    };
    let asked = (0..LOOKS).map(asked).fold(0.0, f64::max);
    let here = track.at(place.station_m);
    let away = place.offset_m.abs() / (ROOM * here.left_m.min(here.right_m));
    let left = (1.0 - asked / TOGETHER).min(1.0 - away).max(0.0);
    let sways_mps2 = (SHARE * most_mps2).min(TURNED_RAD * speed_sq / wheelbase_m);
    sways_mps2 * left * (TAU * FREQUENCY_HZ * state.stamp_s).sin()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRIP: f64 = 0.3;

    /// A circle of a radius, 2 m wide to each side.
    fn circle(radius_m: f64) -> Track {
        let row = |k: usize| {
            let (sin, cos) = (TAU * k as f64 / 200.0).sin_cos();
            [radius_m * cos, radius_m * sin, 2.0, 2.0]
        };
        Track::from_points(&(0..200).map(row).collect::<Vec<_>>()).unwrap()
    }

    fn largest(radius_m: f64, offset_m: f64) -> f64 {
        let track = circle(radius_m);
        let at = |k: usize| {
            let state = CarState {
                stamp_s: 0.01 * k as f64,
                x_m: radius_m,
                y_m: 0.0,
                heading_rad: 0.25 * TAU,
                v_x_mps: 10.0,
                v_y_mps: 0.0,
                yaw_rate_radps: 0.0,
            };
            weave_mps2(&state, Place { station_m: 5.0, offset_m }, &track, 2.7, GRIP)
        };
        (0..200).map(at).fold(0.0, |most, a| most.max(a.abs()))
    }

    #[test]
    fn it_takes_what_the_line_leaves_and_stays_in_the_middle_of_the_track() {
        // Half of the grip where the line is straight, less in a bend, nothing in one that asks for more than is planned with.
        let straight = largest(1e4, 0.0);
        assert!((straight - 0.5 * GRIP * GRAVITY_MPS2).abs() < 0.01 * straight, "{straight}");
        let bend = largest(100.0, 0.0);
        assert!(0.0 < bend && bend < 0.8 * straight, "{bend}");
        assert!(largest(20.0, 0.0) == 0.0);
        assert!(largest(1e4, 0.5) < 0.6 * straight && largest(1e4, -1.0) == 0.0);
    }
}
