//! One run as a state machine that the offline loop and the live node share.
//!
//! ```text
//! start ──> candidate 0 ──> train_residual ──> sweep ──> advance ──> candidate 1 ──> ... ──> advance ──> outcome
//! ```
//!
//! Live, [`crate::train_residual`] runs in another node; [`identify`] does both in a loop. Every step is a pure function of its arguments.

use std::ops::ControlFlow;

use gripsight_signals::{DataHealth, Excitation, NS_PER_S, StateSequence};
use gripsight_vehicle::{MagicFormula, PacejkaParameters, VehicleParameters};

use crate::conclude::{Request, conclude, refused};
use crate::data::{Data, MIN_WINDOWS, Part};
use crate::direct::{Direct, direct, speeds_part};
use crate::extract::extract;
use crate::judge::rollout_errors;
use crate::residual::{left_over, train_on};
use crate::rollout::{TireRollout, vector_of};
use crate::start::{check, initial_tires, no_softer};
use crate::sweep::{Point, Sweep, sweep};
use crate::tires::curve_change;
use crate::{
    AcceptedSet, Candidate, Config, DriveNext, FrictionPrior, IdentificationError, IterationRecord,
    Longitudinal, Manoeuvre, Method, Monitor, Objection, Outcome, PerAxle, Reading, Recorded, ResidualModel,
    RunKey, Usable, longitudinal,
};

/// What a run wants next.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// A residual model for this candidate.
    Candidate(Candidate),
    /// Nothing: it has ended.
    Done(Box<Outcome>),
}

/// How a run begins.
#[derive(Debug, Clone)]
pub enum Started {
    /// It waits for the residual model of its [`Identification::candidate`].
    Running(Box<Identification>),
    /// The telemetry cannot tell about the tires: not accepted, with reasons.
    Refused(Box<Outcome>),
}

/// Where [`identify`] stands. Whoever wants times takes them when told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stage {
    /// Signals are corrected and start values fitted.
    Preparing,
    /// The residual of a candidate is learned.
    Training {
        /// Turn of the outer loop, from 1.
        iteration: u32,
        /// Epochs done.
        epoch: usize,
        /// Epochs at most.
        epochs_max: usize,
        /// Validation loss after the epoch; NaN before the first.
        loss: f64,
    },
    /// The virtual steady-state test is driven.
    Sweeping {
        /// Turn of the outer loop, from 1.
        iteration: u32,
    },
    /// Tires are fitted to what it showed, and judged.
    Fitting {
        /// Turn of the outer loop, from 1.
        iteration: u32,
    },
}

/// What the virtual steady-state test of a candidate with its residual model showed: see [`Identification::sweep`].
#[derive(Debug, Clone, PartialEq)]
pub struct Swept {
    key: RunKey,
    sweep: Sweep,
    epochs: usize,
    residual_loss: f64,
}

/// An identification under way.
#[derive(Debug, Clone)]
pub struct Identification {
    pub(crate) data: Data,
    pub(crate) vehicle: VehicleParameters,
    pub(crate) prior: Option<FrictionPrior>,
    pub(crate) previous: Option<AcceptedSet>,
    /// Whether the previous set still fits.
    pub(crate) grip: Option<Reading>,
    pub(crate) config: Config,
    pub(crate) initial: PacejkaParameters,
    pub(crate) direct: Direct,
    /// Error of the direct fit on the validation part, in noises.
    pub(crate) direct_error: f64,
    /// Turns taken.
    pub(crate) history: Vec<IterationRecord>,
    pub(crate) candidate: Candidate,
    /// What the drive tells of the drive train.
    pub(crate) longitudinal: Longitudinal,
    /// What the signals say of each other.
    pub(crate) recorded: Recorded,
    /// What the initial tires leave over, see [`left_over`].
    initial_left: [f64; 2],
    ended: bool,
}

/// A v_y that nothing recorded checks and that the model follows far better turned than as it is recorded: with the wrong sign tires come out too stiff, as
/// nothing else that is asked of them shows.
fn turned_lateral_speed(
    data: &Data,
    vehicle: &VehicleParameters,
    recorded: &Recorded,
    direct: &Direct,
) -> Option<Objection> {
    /// What a model that fits leaves of v_y, in its noises: below there is nothing to mend.
    const FITS: f64 = 2.0;
    /// The turned v_y has to leave less than this share of what the recorded one does. On development drives (`signals lies 9500 9506 40`) one that really is
    /// turned leaves 0.10 to 0.35, any other from 0.93 on.
    const BETTER: f64 = 0.5;
    let unchecked = recorded.checks.unchecked.iter().any(|u| u.signal == "v_y_mps");
    // At one speed a lever arm of v_y, which is not free then, may ask for tires that no car has, too.
    if !unchecked || !speeds_part(data) || direct.scatter[0] < FITS * data.noise[0] {
        return None;
    }
    let turned = self::direct(&data.with_v_y_turned(), vehicle, None, None).ok()?;
    let (scatter_mps, turned_scatter_mps) = (direct.scatter[0], turned.scatter[0]);
    (turned_scatter_mps < BETTER * scatter_mps)
        .then_some(Objection::TurnedLateralSpeed { scatter_mps, turned_scatter_mps })
}

impl Identification {
    /// Looks at the telemetry, corrects the signals, finds start values. Telemetry that cannot tell about the tires ends the run at once, not
    /// accepted, with reasons.
    ///
    /// `prior` starts D and holds it where the peak is not reached; `previous` is where the run starts (warm start) and what the result
    /// has to beat. Where the telemetry shows that the grip is no longer that of `previous`, what lies before the change is left out, and D's prior
    /// is what the last seconds say of it with the shape of the previous curves (not with the paper's method).
    ///
    /// # Errors
    /// [`IdentificationError`] for telemetry that is malformed, settings out of range, or a previous set of another car.
    pub fn start(
        sequence: &StateSequence,
        vehicle: &VehicleParameters,
        prior: Option<FrictionPrior>,
        previous: Option<&AcceptedSet>,
        config: &Config,
    ) -> Result<Started, IdentificationError> {
        Self::start_on(&Usable::of(sequence, vehicle)?, sequence, vehicle, prior, previous, config)
    }

    /// The same with the recording made ready.
    pub(crate) fn start_on(
        usable: &Usable,
        sequence: &StateSequence,
        vehicle: &VehicleParameters,
        prior: Option<FrictionPrior>,
        previous: Option<&AcceptedSet>,
        config: &Config,
    ) -> Result<Started, IdentificationError> {
        check(vehicle, prior, previous, config)?;
        let key = RunKey::first(sequence, vehicle, config);
        let mut initial = initial_tires(prior, previous, config.method, &config.initial);
        let health = DataHealth::of(sequence)?;
        let longitudinal = longitudinal(&usable.sequence, vehicle);
        let refuse_on = |recorded: &Recorded, reasons: Vec<String>, drive: Option<DriveNext>| {
            let request = Request {
                key: &key,
                vehicle,
                prior,
                config,
                initial: &initial,
                longitudinal: &longitudinal,
                recorded,
            };
            let drive_next = drive.into_iter().collect();
            Started::Refused(Box::new(refused(&request, &health, reasons, drive_next)))
        };
        let refuse = |reasons, drive| refuse_on(&usable.recorded, reasons, drive);
        let objections = &usable.recorded.objections;
        if !objections.is_empty() {
            return Ok(refuse(objections.iter().map(ToString::to_string).collect(), None));
        }
        if let Some(reason) = Excitation::of(&usable.sequence)?.insufficient {
            let drive = "drive corners both ways, at growing speed, for half a minute";
            return Ok(refuse(vec![reason], Some(Manoeuvre::CornersBothWays.because(drive))));
        }
        let mut data = match Data::new(usable, vehicle, &health, MIN_WINDOWS) {
            Err(error @ IdentificationError::TooLittle { drive, .. }) => {
                return Ok(refuse(vec![error.to_string()], Some(Manoeuvre::DriveOn.because(drive))));
            }
            other => other?,
        };
        let grip = match (previous, config.method) {
            (Some(set), Method::Robust) => Monitor::new(vehicle, set)?.read(&data, sequence).ok(),
            _ => None,
        };
        let mut prior = prior;
        if let Some(change) = grip.as_ref().filter(|reading| reading.changed) {
            data.leave_out_before((change.since_ns - sequence.start_stamp_ns) as f64 / NS_PER_S);
            prior = change.prior().or(prior);
        }
        let warm = previous.map(|p| (&p.phi_p, &p.corrections));
        let direct = direct(&data, vehicle, prior, warm)?;
        if let Some(objection) = turned_lateral_speed(&data, vehicle, &usable.recorded, &direct) {
            let mut recorded = usable.recorded.clone();
            recorded.objections.push(objection);
            return Ok(refuse_on(&recorded, vec![objection.to_string()], None));
        }
        if config.method == Method::Paper {
            initial =
                initial_tires(prior, previous, config.method, &no_softer(&config.initial, &direct.tires));
        }
        let phi_p = match config.method {
            Method::Robust if config.direct_start => direct.tires,
            _ => initial,
        };
        let candidate =
            Candidate { key, phi_p, corrections: direct.corrections, mean_speed_mps: data.mean_speed_mps };
        let mut run = Self {
            data,
            vehicle: vehicle.clone(),
            prior,
            previous: previous.cloned(),
            grip,
            config: config.clone(),
            initial,
            direct,
            direct_error: f64::INFINITY,
            history: Vec::new(),
            candidate,
            longitudinal,
            recorded: usable.recorded.clone(),
            initial_left: [1.0; 2],
            ended: false,
        };
        run.direct_error = run.validation_error(&run.direct.tires);
        run.initial_left = run.left_over(&run.initial);
        Ok(Started::Running(Box::new(run)))
    }

    /// The candidate that waits for its residual model; `None` once the run has ended.
    #[must_use]
    pub fn candidate(&self) -> Option<&Candidate> {
        (!self.ended).then_some(&self.candidate)
    }

    /// The turns taken so far.
    #[must_use]
    pub fn history(&self) -> &[IterationRecord] {
        &self.history
    }

    /// Drives the virtual test with the residual model of the waiting candidate.
    ///
    /// # Errors
    /// [`IdentificationError::WrongModel`] for a model that answers another candidate (the run goes on waiting),
    /// [`IdentificationError::Ended`] after the end, [`IdentificationError::Network`] for weights that do not fit.
    pub fn sweep(&self, model: &ResidualModel) -> Result<Swept, IdentificationError> {
        self.check_answer(&model.key, model.phi_p == self.candidate.phi_p)?;
        Ok(Swept {
            key: model.key.clone(),
            sweep: sweep(&self.vehicle, model, self.candidate.mean_speed_mps, self.config.method)?,
            epochs: model.epochs,
            residual_loss: model.validation_loss,
        })
    }

    /// Fits the tires to the virtual test, and asks for the next residual model or ends.
    ///
    /// # Errors
    /// [`IdentificationError::WrongModel`] for the test of another candidate, [`IdentificationError::Ended`] after the end.
    pub fn advance(&mut self, swept: &Swept) -> Result<Next, IdentificationError> {
        self.check_answer(&swept.key, true)?;
        let turn = self.turn(swept)?;
        let settled = turn.change < self.config.settled_below();
        self.candidate.phi_p = turn.phi_p;
        self.candidate.key.iteration = turn.iteration;
        self.history.push(turn);
        let converged = settled || self.stalled();
        if converged || self.candidate.key.iteration >= self.config.max_iterations {
            self.ended = true;
            return Ok(Next::Done(Box::new(conclude(self, converged)?)));
        }
        Ok(Next::Candidate(self.candidate.clone()))
    }

    /// Takes all turns, learning the residual of each here.
    pub(crate) fn finished(
        mut self,
        usable: &Usable,
        progress: &mut dyn FnMut(Stage),
    ) -> Result<Outcome, IdentificationError> {
        let epochs_max = self.config.epochs_at_most();
        loop {
            let iteration = self.candidate.key.iteration + 1;
            progress(Stage::Training { iteration, epoch: 0, epochs_max, loss: f64::NAN });
            let model = train_on(usable, &self.vehicle, &self.candidate, &self.config, &mut |p| {
                progress(Stage::Training { iteration, epoch: p.epoch, epochs_max, loss: p.validation_loss });
                ControlFlow::Continue(())
            })?;
            progress(Stage::Sweeping { iteration });
            let swept = self.sweep(&model)?;
            progress(Stage::Fitting { iteration });
            if let Next::Done(outcome) = self.advance(&swept)? {
                return Ok(*outcome);
            }
        }
    }

    fn check_answer(&self, key: &RunKey, same_tires: bool) -> Result<(), IdentificationError> {
        if self.ended {
            return Err(IdentificationError::Ended);
        }
        if *key != self.candidate.key || !same_tires {
            let (expected, got) = (self.candidate.key.to_string(), key.to_string());
            return Err(IdentificationError::WrongModel { expected, got });
        }
        Ok(())
    }

    /// The paper's method ends where a turn leaves no less of the held-out data unexplained than the best before it; the robust one where the last
    /// turns no longer predict the validation part better than what was there before them.
    fn stalled(&self) -> bool {
        const TURNS: usize = 2;
        if let (Method::Paper, [before @ .., last]) = (self.config.method, &self.history[..]) {
            return before.iter().any(|turn| turn.residual_left <= last.residual_left);
        }
        let Some(before) = self.history.len().checked_sub(TURNS) else { return false };
        if !self.config.direct_start {
            return false;
        }
        let errors =
            |turns: &[IterationRecord]| turns.iter().map(|t| t.validation_rmse).fold(f64::INFINITY, f64::min);
        let best = errors(&self.history[..before]).min(self.direct_error);
        errors(&self.history[before..]) >= best
    }

    /// One turn of the outer loop.
    fn turn(&self, swept: &Swept) -> Result<IterationRecord, IdentificationError> {
        let Swept { sweep, epochs, residual_loss, .. } = swept;
        let robust = self.config.method == Method::Robust;
        let fit = |points: &[Point], start: &MagicFormula, reached: bool| {
            extract(points, start, (robust && !reached).then_some((start.d, start.d)), robust)
        };
        let (at, peak) = (&self.candidate.phi_p, &self.direct.peak);
        let front = fit(&sweep.points.front, &at.front, peak.front.reached)?;
        let rear = fit(&sweep.points.rear, &at.rear, peak.rear.reached)?;
        let phi_p = PacejkaParameters { front: front.axle, rear: rear.axle };
        let slips =
            PerAxle { front: self.direct.slips.front.range_rad, rear: self.direct.slips.rear.range_rad };
        Ok(IterationRecord {
            iteration: self.candidate.key.iteration + 1,
            phi_p,
            change: curve_change(at, &phi_p, &slips),
            fit_rmse: (0.5 * (front.rmse.powi(2) + rear.rmse.powi(2))).sqrt(),
            evaluations: front.evaluations + rear.evaluations,
            sweep_speed_mps: sweep.speed_mps,
            extrapolated_share: sweep.extrapolated_share,
            validation_rmse: self.validation_error(&phi_p),
            residual_left: self.residual_left(&phi_p),
            epochs: *epochs,
            residual_loss: *residual_loss,
        })
    }

    fn left_over(&self, tires: &PacejkaParameters) -> [f64; 2] {
        left_over(&self.data, &self.vehicle, &Candidate { phi_p: *tires, ..self.candidate.clone() })
    }

    /// Highest speed driven.
    pub(crate) fn top_speed_mps(&self) -> f64 {
        self.data.samples(|s, k| s.v_x_mps[k]).fold(0.0, f64::max)
    }

    /// What some tires leave over, as a share of what the initial ones did.
    fn residual_left(&self, tires: &PacejkaParameters) -> f64 {
        let [v_y, yaw_rate] = self.left_over(tires);
        (0.5 * ((v_y / self.initial_left[0]).powi(2) + (yaw_rate / self.initial_left[1]).powi(2))).sqrt()
    }

    /// Error of rollouts on the validation part, in noises.
    pub(crate) fn validation_error(&self, tires: &PacejkaParameters) -> f64 {
        self.error_on(Part::Validation, tires)
    }

    /// Error of rollouts on a part, in noises.
    pub(crate) fn error_on(&self, part: Part, tires: &PacejkaParameters) -> f64 {
        let rollout = TireRollout::new(&self.vehicle, &self.data);
        let windows = self.data.part(part);
        let p = vector_of(tires, &self.direct.corrections, &self.direct.nuisance);
        rollout_errors(&rollout, &p, &windows, &self.direct.scatter).normalized
    }
}

/// A whole run. `progress` is told what begins.
///
/// # Errors
/// As [`Identification::start`].
pub fn identify(
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    prior: Option<FrictionPrior>,
    previous: Option<&AcceptedSet>,
    config: &Config,
    progress: &mut dyn FnMut(Stage),
) -> Result<Outcome, IdentificationError> {
    progress(Stage::Preparing);
    let usable = Usable::of(sequence, vehicle)?;
    match Identification::start_on(&usable, sequence, vehicle, prior, previous, config)? {
        Started::Running(run) => run.finished(&usable, progress),
        Started::Refused(outcome) => Ok(*outcome),
    }
}
