//! How the driver is to drive.

use crate::predictive::Predictive;
use crate::pursuit::Pursuit;
use crate::steering::Controller;

/// How boldly to drive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Share of a known grip to plan with.
    pub share: f64,
    /// Grip planned over what was driven without a slide, where the peak is not known; 1: never beyond.
    pub step: f64,
    /// The same where a prior says that there is more.
    pub prior_step: f64,
    /// Grip planned over what the set promises at most, where the peak is not known: a promise is the lower end of an interval.
    pub beyond: f64,
    /// Who steers.
    pub controller: Controller,
    /// Pursuit.
    pub pursuit: Pursuit,
    /// Predictive control.
    pub predictive: Predictive,
    /// Gain of the speed controller.
    pub speed_gain_1ps: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            share: 0.98,
            step: 1.15,
            prior_step: 1.2,
            beyond: 1.5,
            controller: Controller::default(),
            pursuit: Pursuit::default(),
            predictive: Predictive::default(),
            speed_gain_1ps: 8.0,
        }
    }
}
