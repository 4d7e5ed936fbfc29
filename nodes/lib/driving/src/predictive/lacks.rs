//! What the model lacks: accelerations that the last tenths of a second showed beyond it.
//!
//! Loads that roll over, tires that also drive: the single-track model knows nothing of them. A controller that believed it alone would stay beside
//! the line in every bend.

use gripsight_vehicle::{Input, SingleTrack, State};

use crate::CarState;
use crate::steering::Moment;

/// Time over which it is averaged, beside delay and lag.
const AVERAGE_S: f64 = 0.15;
/// Longest step between two states.
const GAP_S: f64 = 0.05;
/// Integration step.
const SUBSTEP_S: f64 = 0.002;
/// Share of the tires' largest acceleration that may be missing: more is a slide, of which others take care.
const MOST: f64 = 0.3;

/// Accelerations that the model lacks.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lacks {
    before: Option<(CarState, f64)>,
    /// Of v_y, and of the yaw rate.
    mean: [f64; 2],
}

impl Lacks {
    /// Takes the next state; gives what is lacking.
    pub(crate) fn look(&mut self, at: &Moment<'_>) -> [f64; 2] {
        let now = at.now;
        let wheels_rad = at.wheels_now_rad().unwrap_or(0.0);
        let Some((from, from_wheels_rad)) = self.before.replace((*now, wheels_rad)) else {
            return self.mean;
        };
        let dt_s = now.stamp_s - from.stamp_s;
        if !(1e-4..GAP_S).contains(&dt_s) {
            self.mean = [0.0; 2];
            return self.mean;
        }
        let model = SingleTrack::new(at.vehicle, &at.plan.tires);
        let start = State { v_y_mps: from.v_y_mps, yaw_rate_radps: from.yaw_rate_radps };
        let [first, last] = [(from.v_x_mps, from_wheels_rad), (now.v_x_mps, wheels_rad)]
            .map(|(v_x_mps, steering_rad)| Input { v_x_mps, steering_rad });
        let expected = model.step(start, &first, &last, dt_s, SUBSTEP_S);
        let seen =
            [(now.v_y_mps - expected.v_y_mps) / dt_s, (now.yaw_rate_radps - expected.yaw_rate_radps) / dt_s];
        let most_mps2 = MOST * at.plan.table.most_mps2();
        let arm_1pm = at.vehicle.mass_kg * at.vehicle.l_f_m / at.vehicle.yaw_inertia_kgm2;
        for (lane, most) in [most_mps2, most_mps2 * arm_1pm].into_iter().enumerate() {
            self.mean[lane] +=
                (dt_s / (AVERAGE_S + at.delay_s + at.lag_s)).min(1.0) * (seen[lane] - self.mean[lane]);
            self.mean[lane] = self.mean[lane].clamp(-most, most);
        }
        self.mean
    }
}
