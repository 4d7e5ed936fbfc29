//! How the tires' longitudinal force follows its command: a force needs slip, slip needs wheels that have spun up.

use gripsight_vehicle::GRAVITY_MPS2;

use crate::recording::{Recording, Run};
use crate::rollout::Window;
use crate::terms::TURNING_SHARE;

/// Longitudinal stiffness of tires over their load, per unit of slip: 10 to 30 of most. Pacejka, Tire and Vehicle Dynamics, section 4.3.
const SLIP_STIFFNESS: f64 = 20.0;

/// Time in which wheels take on the slip that a force takes at a speed: what turns is the inertia of [`TURNING_SHARE`], what brakes it is the force that
/// grows with the slip speed over the speed. Of the reference cars 2.4e-4 to 4.6e-4 s per m/s.
pub(crate) fn slip_time_s(v_x_mps: f64) -> f64 {
    TURNING_SHARE * v_x_mps / (SLIP_STIFFNESS * GRAVITY_MPS2)
}

impl Run {
    /// The step after sample `k` over the time in which the tires' longitudinal force follows its command; an acceleration that stands in for the force is
    /// the force.
    pub(crate) fn steps_of_force(&self, k: usize, has_command: bool) -> f64 {
        const SHORTEST_S: f64 = 1e-6;
        let lag_s = if has_command { slip_time_s(self.v_x_mps[k]) } else { 0.0 };
        self.dt_s / lag_s.max(SHORTEST_S)
    }

    /// The tires' longitudinal force over the nominal mass a sample after `k`, from what it is there.
    pub(crate) fn force_after_mps2(&self, force_mps2: f64, k: usize, has_command: bool) -> f64 {
        let command = self.force_x_mps2[k];
        command + (force_mps2 - command) * (-self.steps_of_force(k, has_command)).exp()
    }
}

/// The longitudinal force at a window's start, from what was commanded before it.
pub(crate) fn force_before_mps2(recording: &Recording, window: &Window) -> f64 {
    /// Of a time in which the force follows of 0.03 s, that of a car at 100 m/s.
    const FORGOTTEN_S: f64 = 0.2;
    let run = &recording.runs[window.segment];
    let first = window.from - window.from.min((FORGOTTEN_S / run.dt_s).ceil() as usize);
    let begin = run.force_x_mps2[first.saturating_sub(1)];
    (first..window.from).fold(begin, |force, k| run.force_after_mps2(force, k, recording.has_command))
}

/// How the tires' longitudinal force follows the command of a step, over the nominal mass.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Following {
    /// At both ends of the step, and at the end of the next.
    at_sample_mps2: [f64; 3],
    /// What is commanded in it.
    command_mps2: f64,
    /// The step over the time in which the force follows.
    steps: f64,
    /// How far ahead of a sample the acceleration is measured there ([`Recording::force_ahead`]).
    ahead: f64,
}

impl Following {
    /// In the step after sample `k` of a run, from what the force is there.
    pub(crate) fn of(recording: &Recording, run: &Run, k: usize, force_mps2: f64) -> Self {
        let has_command = recording.has_command;
        let end = run.force_after_mps2(force_mps2, k, has_command);
        let next = run.force_after_mps2(end, (k + 1).min(run.len() - 1), has_command);
        Self {
            at_sample_mps2: [force_mps2, end, next],
            command_mps2: run.force_x_mps2[k],
            steps: run.steps_of_force(k, has_command),
            ahead: recording.force_ahead,
        }
    }

    /// At the step's end.
    pub(crate) fn end_mps2(&self) -> f64 {
        self.at_sample_mps2[1]
    }

    /// `share` of the step after its start: at a sample as far ahead as the acceleration is measured there, else the mean over the one of `substeps` around.
    pub(crate) fn at_mps2(&self, share: f64, substeps: usize) -> f64 {
        let [start, end, next] = self.at_sample_mps2;
        let ahead = |from: f64, to: f64| from + (to - from) * self.ahead;
        let half = 0.5 / substeps as f64;
        match share {
            0.0 => ahead(start, end),
            1.0 => ahead(end, next),
            _ => self.mean_mps2((share - half).max(0.0), (share + half).min(1.0)),
        }
    }

    /// Mean over a part of the step.
    fn mean_mps2(&self, from: f64, to: f64) -> f64 {
        let left = |share: f64| (-share * self.steps).exp();
        let mean = (left(from) - left(to)) / ((to - from) * self.steps);
        self.command_mps2 + (self.at_sample_mps2[0] - self.command_mps2) * mean
    }
}
