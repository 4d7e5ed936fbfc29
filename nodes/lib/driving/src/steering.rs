//! Who steers: one interface for the pursuit and for the predictive controller.
//!
//! Both get the same [`Moment`]: the car as measured, the commands under way, what is planned. Each answers with the road-wheel angle to ask for, or
//! says why it has none.

use std::collections::VecDeque;
use std::str::FromStr;

use gripsight_vehicle::VehicleParameters;

use crate::plan::Plan;
use crate::state::{Asked, CarState, predict, wheels_rad};
use crate::{Place, Track};

/// Delays below this are not worth a prediction.
pub(crate) const PROMPT_S: f64 = 0.004;
/// Front slip over that of the axle's largest force from which more only scrubs.
pub(crate) const MOST_SLIP: f64 = 1.15;

/// Which controller steers.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Controller {
    /// [`crate::Pursuit`].
    #[default]
    Pursuit,
    /// [`crate::Predictive`]; the pursuit, where that has no answer.
    Predictive,
}

impl FromStr for Controller {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        match name {
            "pursuit" => Ok(Self::Pursuit),
            "mpc" => Ok(Self::Predictive),
            other => Err(format!("no controller is called {other:?}; known: pursuit, mpc")),
        }
    }
}

/// Why a controller has no angle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NoAngle {
    /// The car is slower than its slip angles mean anything.
    Slow,
    /// The solver did not converge, or its answer is none that a car can steer.
    NotConverged,
}

/// Gives the road-wheel angle to ask for.
pub(crate) trait Steering {
    fn angle_rad(&mut self, at: &Moment<'_>) -> Result<f64, NoAngle>;
}

/// A moment of a drive, for whoever steers.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Moment<'a> {
    /// The car as measured.
    pub(crate) now: &'a CarState,
    /// Where it is.
    pub(crate) place: Place,
    /// The line.
    pub(crate) track: &'a Track,
    /// What is planned on which tires.
    pub(crate) plan: &'a Plan,
    pub(crate) vehicle: &'a VehicleParameters,
    /// Commands, the last one the last; some are still on their way.
    pub(crate) asked: &'a VecDeque<Asked>,
    /// From the measurement to the command.
    pub(crate) age_s: f64,
    /// From the command to the wheels' first answer, and the time constant of what follows.
    pub(crate) delay_s: f64,
    pub(crate) lag_s: f64,
    /// Nobody measured the tires: the table's limit is not the car's.
    pub(crate) assumed: bool,
    /// Lateral acceleration on top of what the line asks for: a slalom.
    pub(crate) weave_mps2: f64,
    pub(crate) speed_gain_1ps: f64,
}

impl Moment<'_> {
    /// When the command goes out.
    pub(crate) fn goes_s(&self) -> f64 {
        self.now.stamp_s + self.age_s
    }

    /// Since the command before; 0 where there is none.
    pub(crate) fn dt_s(&self) -> f64 {
        self.asked.back().map_or(0.0, |last| self.goes_s() - last.from_s)
    }

    /// The car `lead_s` after the command begins to act, with what was asked before. `lacks`: accelerations of v_y and of the yaw rate that the model
    /// does not have.
    pub(crate) fn car(&self, lead_s: f64, lacks: [f64; 2]) -> (CarState, Place) {
        if self.age_s + self.delay_s + lead_s <= PROMPT_S {
            return (*self.now, self.place);
        }
        let late = (self.age_s, self.delay_s, self.lag_s);
        let car = predict(self.now, late, lead_s, lacks, self.asked, self.vehicle, &self.plan.tires);
        (car, self.track.place(car.x_m, car.y_m, Some(self.place.station_m)))
    }

    /// The wheels' angle when the command begins to act; `None`: nothing was asked for so far.
    pub(crate) fn wheels_rad(&self) -> Option<f64> {
        wheels_rad(self.asked, self.goes_s() + self.delay_s, self.delay_s, self.lag_s)
    }

    /// The wheels' angle when the car was measured.
    pub(crate) fn wheels_now_rad(&self) -> Option<f64> {
        wheels_rad(self.asked, self.now.stamp_s, self.delay_s, self.lag_s)
    }

    /// An angle with no more slip at the front wheels than has a use: more than that of the largest force only scrubs, and where the car swings out its
    /// front wheels go with its travel, or it turns further.
    pub(crate) fn within_slip(&self, car: &CarState, angle_rad: f64) -> f64 {
        let ahead = car.v_y_mps + self.vehicle.l_f_m * car.yaw_rate_radps;
        let front_rad = ahead.atan2(car.v_x_mps.max(0.1));
        let slip_rad = MOST_SLIP * self.plan.table.front_slip_rad();
        let rear_rad = car.rear_slip_rad(self.vehicle);
        let turning_mps2 = car.v_x_mps * car.yaw_rate_radps;
        let left_rad = slip_rad * (1.0 - self.plan.table.swings(rear_rad, turning_mps2));
        let [right, left] = if rear_rad > 0.0 { [slip_rad, left_rad] } else { [left_rad, slip_rad] };
        angle_rad.clamp(front_rad - right, front_rad + left)
    }
}
