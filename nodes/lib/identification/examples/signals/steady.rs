//! The true understeer gradient: a steady turn of the plant itself (ISO 4138), with all that it has: compliance, roll steer, load transfer.

use gripsight_reference_car::{Course, Recording, Simulation, TruthSample};

use crate::cases::Case;

/// A turn has settled after so long.
const SETTLED_S: f64 = 5.0;
/// The angle that gives the lateral acceleration is halved in on so often: to a ten-thousandth of the lock.
const HALVINGS: usize = 13;

/// Median speed of a drive where it turns at half of a lateral acceleration or more.
pub(crate) fn speed_in_turns_mps(recording: &Recording, a_y_mps2: f64) -> Option<f64> {
    let turning = |t: &&TruthSample| (t.motion.v_x_mps * t.motion.yaw_rate_radps).abs() > 0.5 * a_y_mps2;
    let mut speeds: Vec<f64> = recording.truth.iter().filter(turning).map(|t| t.motion.v_x_mps).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.get(speeds.len() / 2).copied()
}

/// Slip of the front axle less that of the rear one in steady turns to both sides, over their lateral acceleration, rad per m/s2. The steering angle is
/// that at the wheels before their suspension gives way. `None` where the car does not turn as hard at that speed.
pub(crate) fn understeer_rad_per_mps2(case: &Case, speed_mps: f64, a_y_mps2: f64) -> Option<f64> {
    let [_, gain, offset_rad, ..] = case.signals;
    let car = &case.scenario.car;
    // Lateral acceleration and difference of the slips, as means of both sides.
    let turn = |asked_rad: f64| -> Option<(f64, f64)> {
        let mut sum = (0.0, 0.0);
        for side in [1.0, -1.0] {
            // The angle that is asked for where the linkage is off.
            let angle_rad = (side * asked_rad - offset_rad) / gain;
            let course = Course::StepSteer { speed_mps, angle_rad, rise_s: 0.5 };
            let scenario = case.scenario.clone().course(course).dither(0.0).duration(SETTLED_S + 1.0);
            let recording = Simulation::new(scenario).ok()?.run(|_| {});
            let m = recording.truth.last().filter(|t| t.motion.time_s > SETTLED_S)?.motion;
            let front = (m.v_y_mps + car.l_f_m * m.yaw_rate_radps).atan2(m.v_x_mps);
            let rear = (m.v_y_mps - car.l_r_m * m.yaw_rate_radps).atan2(m.v_x_mps);
            sum.0 += 0.5 * side * m.v_x_mps * m.yaw_rate_radps;
            sum.1 += 0.5 * (asked_rad - side * (front - rear));
        }
        Some(sum)
    };
    let (mut low, mut high) = (0.0, car.max_steering_rad);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        match turn(middle) {
            Some((a_y, _)) if a_y < a_y_mps2 => low = middle,
            _ => high = middle,
        }
    }
    turn(low).filter(|(a_y, _)| (a_y / a_y_mps2 - 1.0).abs() < 0.02).map(|(a_y, difference)| difference / a_y)
}
