//! The result of a run: identification.json, and what the report draws.

use gripsight_signals::DataHealth;
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};
use serde::{Deserialize, Serialize};

use crate::{
    AcceptedSet, Config, DriveNext, Estimate, FrictionPrior, GripChange, Handling, Longitudinal, Nuisance,
    PerAxle, Range, Reading, Recorded, RunKey, SignalCorrections, ValidWithin,
};

/// What a set may be used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Status {
    /// The peak of both axles is known.
    Accepted,
    /// No force is promised beyond what the drive has shown: [`Outcome::valid_within`].
    AcceptedWithin,
    /// The peak rests on a friction prior: for whoever asks for it.
    Provisional,
    /// Unusable.
    Rejected,
}

impl Status {
    /// Its name in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Accepted => "accepted",
            Self::AcceptedWithin => "accepted_within",
            Self::Provisional => "provisional",
            Self::Rejected => "rejected",
        }
    }

    /// Whether a controller may use the set without asking for more.
    #[must_use]
    pub fn accepted(self) -> bool {
        matches!(self, Self::Accepted | Self::AcceptedWithin)
    }
}

/// The set with a friction prior where the data do not reach the peak, beside the one that the data alone give.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ProvisionalSet {
    /// The tires.
    pub phi_p: PacejkaParameters,
    /// D; `from_prior` says of which axle it is the prior's.
    pub peak_friction: PerAxle<PeakFriction>,
}

/// Peak friction of one axle, and what the value rests on.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PeakFriction {
    /// Best estimate.
    pub value: f64,
    /// Lower end of the 90 % interval; null where the data say nothing and there is no prior.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the data reach the peak of the curve.
    pub reached: bool,
    /// Whether the value is the prior's: a soft bound, within which the data may have moved it.
    pub from_prior: bool,
}

/// 90 % intervals of what was taken out of the signals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SignalEstimates {
    /// s, the servo's lag and half a command's hold included
    pub steering_delay_s: Estimate,
    /// dimensionless
    pub steering_gain: Estimate,
    /// rad
    pub steering_offset_rad: Estimate,
    /// m
    pub v_y_lever_arm_m: Estimate,
    /// m/s
    pub v_y_bias_mps: Estimate,
    /// rad/s
    pub yaw_rate_bias_radps: Estimate,
}

impl SignalEstimates {
    /// In the order of the fields.
    pub(crate) fn from_array(e: [Estimate; 6]) -> Self {
        Self {
            steering_delay_s: e[0],
            steering_gain: e[1],
            steering_offset_rad: e[2],
            v_y_lever_arm_m: e[3],
            v_y_bias_mps: e[4],
            yaw_rate_bias_radps: e[5],
        }
    }
}

/// A correction that the data hardly tell: what its value rests on instead.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WeakSignal {
    /// Name of the correction.
    pub name: &'static str,
    /// Share of its information that comes from the data, 0 to 1; the rest is the prior's.
    pub data_share: f64,
    /// Standard deviation of the prior that holds it.
    pub prior_sigma: f64,
}

/// A figure with the tires that the run started from, and with those identified.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Change {
    /// With the initial tires and the signals as recorded.
    pub before: f64,
    /// With the tires identified and the signals corrected.
    pub after: f64,
}

/// Root mean square error on held-out data.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rmse {
    /// With the initial tires: both channels, each divided by its noise, dimensionless.
    pub before: f64,
    /// With the tires identified.
    pub after: f64,
    /// Lateral velocity, m/s.
    pub v_y_mps: Change,
    /// Yaw rate, rad/s.
    pub yaw_rate_radps: Change,
}

/// Errors over one sample and over a window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RmseReport {
    /// Prediction of the next sample from this one.
    pub one_step: Rmse,
    /// Open-loop rollout over `horizon_s` from the measured state.
    pub rollout: Rmse,
    /// Length of the rollouts.
    pub horizon_s: f64,
    /// Noise that the channels are divided by: v_y in m/s, yaw rate in rad/s.
    pub noise: [f64; 2],
}

/// Root mean square error of open-loop rollouts at a time after their start, on held-out data: what [`Rmse`] averages over a window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct HorizonError {
    /// After the start.
    pub horizon_s: f64,
    /// Lateral velocity, m/s.
    pub v_y_mps: Change,
    /// Yaw rate, rad/s.
    pub yaw_rate_radps: Change,
}

/// One turn of the outer loop.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct IterationRecord {
    /// From 1.
    pub iteration: u32,
    /// Tires after it.
    pub phi_p: PacejkaParameters,
    /// Largest change of the tire curves in it, as a share of their peak.
    pub change: f64,
    /// Root mean square error of the fit to the sweep's normalised forces.
    pub fit_rmse: f64,
    /// Evaluations that Nelder-Mead needed, both axles.
    pub evaluations: usize,
    /// Speed of the sweep.
    pub sweep_speed_mps: f64,
    /// Share of the sweep's samples outside the slips trained on.
    pub extrapolated_share: f64,
    /// Error of held-out rollouts with these tires (validation part).
    pub validation_rmse: f64,
    /// Root mean square of the one-step residual that these tires leave over on the validation part, as a share of what the initial ones did.
    pub residual_left: f64,
    /// Epochs that the residual was trained.
    pub epochs: usize,
    /// Its loss on the validation part.
    pub residual_loss: f64,
}

/// A tire curve for the report: F_y/F_z over slip.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct TireCurve {
    /// Slip angles of the points, rad, from 0.
    pub slip_rad: Vec<f64>,
    /// Start of the run.
    pub initial: Vec<f64>,
    /// Found.
    pub identified: Vec<f64>,
    /// Lower end of the 90 % band; NaN where not known.
    pub low: Vec<f64>,
    /// Upper end of the 90 % band; NaN where not known.
    pub high: Vec<f64>,
    /// Samples of the data whose absolute slip lies between this point and the next.
    pub density: Vec<u32>,
}

/// Where the tires came from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Nothing was fitted: these are the tires that the run started from.
    Start,
    /// The direct least-squares fit predicted held-out data better.
    LeastSquares,
    /// The residual loop predicted held-out data better.
    ResidualLoop,
    /// The loop without a network, a fit to the nominal model's own sweep, predicted held-out data better.
    NominalLoop,
}

/// Time series for the report's pictures; not part of identification.json.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trace {
    /// Since the start of the sequence, s.
    pub time_s: Vec<f64>,
    /// Forward velocity.
    pub v_x_mps: Vec<f64>,
    /// Lateral acceleration of the centre of gravity, v_x times yaw rate.
    pub a_y_mps2: Vec<f64>,
    /// Forward acceleration, from v_x.
    pub a_x_mps2: Vec<f64>,
    /// Position; empty without a pose.
    pub x_m: Vec<f64>,
    /// Position; empty without a pose.
    pub y_m: Vec<f64>,
    /// Slip angles with the signals corrected.
    pub slip_rad: PerAxle<Vec<f64>>,
    /// Lateral velocity as measured.
    pub v_y_mps: Vec<f64>,
    /// Rolled out with the initial tires.
    pub v_y_before_mps: Vec<f64>,
    /// Rolled out with the tires identified.
    pub v_y_after_mps: Vec<f64>,
    /// Yaw rate as measured.
    pub yaw_rate_radps: Vec<f64>,
    /// Rolled out with the initial tires.
    pub yaw_rate_before_radps: Vec<f64>,
    /// Rolled out with the tires identified.
    pub yaw_rate_after_radps: Vec<f64>,
}

/// The result of a run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Outcome {
    /// The tires to use, Phi_p: they promise no more force than the drive has shown. Where the set is rejected, those found.
    pub phi_p: PacejkaParameters,
    /// The tires found: the most likely curves, whatever was shown of them.
    pub found: PacejkaParameters,
    /// What the tires to use may be used for.
    pub status: Status,
    /// Slips and forces up to which they are valid.
    pub valid_within: ValidWithin,
    /// With the friction prior, where one was given and has a say.
    pub provisional: Option<ProvisionalSet>,
    /// B C D F_z of the tires found.
    pub cornering_stiffness_n_per_rad: PerAxle<Estimate>,
    /// D of the tires found.
    pub peak_friction: PerAxle<PeakFriction>,
    /// Turns of the outer loop taken.
    pub iterations: u32,
    /// Whether the last turn changed the tire curves by less than the tolerance; or the last two (the paper's method: one) no longer predict
    /// held-out data better than what was there before them.
    pub converged: bool,
    /// Whether the set may be used: [`Status::accepted`].
    pub accepted: bool,
    /// Why not; or what an accepted set must be read with. Each with its figure.
    pub reasons: Vec<String>,
    /// Slip angles visited.
    pub slip_range_rad: PerAxle<Range>,
    /// Forward speeds visited.
    pub v_x_range_mps: Range,
    /// Mean forward speed while moving.
    pub mean_speed_mps: f64,
    /// What was taken out of the signals.
    pub signals: SignalCorrections,
    /// The same with intervals.
    pub signal_intervals: SignalEstimates,
    /// Corrections that rest on their priors.
    pub weak_signals: Vec<WeakSignal>,
    /// What the direct fit allowed for beside the tires.
    pub nuisance: Nuisance,
    /// The tires of that fit, which go with all that it allowed for: above `found` by what longitudinal forces took from these.
    pub fitted: PacejkaParameters,
    /// Errors on held-out data.
    pub rmse: RmseReport,
    /// Rollout error over its horizon.
    pub rollout_error: Vec<HorizonError>,
    /// Which step of the method the tires came from.
    pub source: Source,
    /// Parameters on a bound, such as `rear.c`.
    pub on_bound: Vec<String>,
    /// Tires that the run started from.
    pub initial: PacejkaParameters,
    /// Tires of the direct fit.
    pub least_squares: Option<PacejkaParameters>,
    /// Turn by turn.
    pub history: Vec<IterationRecord>,
    /// Curves for the report.
    pub curves: PerAxle<TireCurve>,
    /// The friction prior that was used: what was given; or, where the grip has changed, what the monitor read.
    pub prior: Option<FrictionPrior>,
    /// Whether the previous set still fits; `None` without one.
    pub grip: Option<Reading>,
    /// Where the grip changed under way, if it did.
    pub grip_change: Option<GripChange>,
    /// Understeer gradient and handling diagram.
    pub handling: Handling,
    /// What the drive tells of the drive train.
    pub longitudinal: Longitudinal,
    /// What is wrong with the data.
    pub health: DataHealth,
    /// The driving that would help most.
    pub drive_next: Vec<DriveNext>,
    /// Which run this was.
    pub key: RunKey,
    /// The settings.
    pub config: Config,
    /// The car.
    pub vehicle: VehicleParameters,
    /// What the signals say of each other, and what became of them.
    #[serde(skip)]
    pub recorded: Recorded,
    /// Time series for the report.
    #[serde(skip)]
    pub trace: Trace,
}

/// A set within what was driven that promises this much less than the one in use does not take its place: what was shown is not forgotten in a slower lap.
const NO_LESS: f64 = 0.98;

impl Outcome {
    /// Whether the set is to be used in place of another one: it is accepted, and knows more, or the other one no longer fits.
    #[must_use]
    pub fn replaces(&self, in_use: Option<&AcceptedSet>) -> bool {
        let Some(set) = in_use else { return self.accepted };
        let changed = self.grip.as_ref().is_some_and(|reading| reading.changed);
        let shown = |tires: &PacejkaParameters| tires.front.d.min(tires.rear.d);
        let no_less = shown(&self.phi_p) >= NO_LESS * shown(&set.promised);
        // A peak that was reached is measured anew each time: whoever keeps the largest of all measurements drives on the luckiest error.
        let serves = match (set.status, self.status) {
            (Status::Accepted, Status::Accepted) => true,
            (Status::Accepted, _) => false,
            _ => no_less,
        };
        self.accepted && (changed || serves)
    }

    /// What later runs start from and the monitor watches; `None` where the set was not accepted.
    #[must_use]
    pub fn accepted_set(&self) -> Option<AcceptedSet> {
        self.accepted.then(|| AcceptedSet {
            vehicle_hash: self.key.vehicle_hash.clone(),
            sequence_id: self.key.sequence_id,
            phi_p: self.found,
            promised: self.phi_p,
            status: self.status,
            valid_within: self.valid_within,
            corrections: self.signals,
            fitted: self.fitted,
            nuisance: self.nuisance,
            rollout_rmse: [self.rmse.rollout.v_y_mps.after, self.rmse.rollout.yaw_rate_radps.after],
            peak_reached: self.peak_friction.map(|p| p.reached),
        })
    }
}
