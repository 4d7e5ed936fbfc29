//! One run as a state machine that the offline loop and the live node share.
//!
//! ```text
//! start ──> candidate 0 ──> train_residual ──> advance ──> candidate 1 ──> ... ──> advance ──> outcome
//! ```
//!
//! Live, `train_residual` runs in another node; [`identify`] does both in a loop. Every step is a pure function of its arguments.

use std::ops::ControlFlow;

use gripsight_signals::StateSequence;
use gripsight_vehicle::VehicleParameters;

use crate::{AcceptedSet, Candidate, Config, FrictionPrior, IdentificationError, Outcome, ResidualModel};

/// What a run wants next.
#[derive(Debug, Clone, PartialEq)]
pub enum Next {
    /// A residual model for this candidate.
    Candidate(Candidate),
    /// Nothing: it has ended.
    Done(Box<Outcome>),
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
    /// The virtual steady-state test is driven and tires are fitted to it.
    Fitting {
        /// Turn of the outer loop, from 1.
        iteration: u32,
    },
    /// The outcome stands.
    Finished,
}

/// An identification under way.
#[derive(Debug, Clone)]
pub struct Identification {
    candidate: Option<Candidate>,
}

impl Identification {
    /// Looks at the telemetry, corrects the signals, finds start values.
    ///
    /// `prior` starts D and holds it where the peak is not reached; `previous` is where the run starts (warm start) and what
    /// the result has to beat.
    ///
    /// # Errors
    /// [`IdentificationError`] for telemetry that is malformed, frozen, too short or without excitation.
    pub fn start(
        _sequence: &StateSequence,
        _vehicle: &VehicleParameters,
        _prior: Option<FrictionPrior>,
        _previous: Option<&AcceptedSet>,
        _config: &Config,
    ) -> Result<(Self, Candidate), IdentificationError> {
        Err(IdentificationError::Ended)
    }

    /// The candidate that waits for its residual model; `None` once the run has ended.
    #[must_use]
    pub fn candidate(&self) -> Option<&Candidate> {
        self.candidate.as_ref()
    }

    /// Takes the residual model of the waiting candidate: drives the virtual test, fits the tires, and asks for the next or ends.
    ///
    /// # Errors
    /// [`IdentificationError::WrongModel`] for a model that answers another candidate (the run goes on waiting),
    /// [`IdentificationError::Ended`] after the end, [`IdentificationError::Network`] for weights that do not fit.
    pub fn advance(&mut self, _model: &ResidualModel) -> Result<Next, IdentificationError> {
        Err(IdentificationError::Ended)
    }
}

/// Learns what the single-track model with the candidate's tires leaves over. A pure function of sequence, car, candidate and settings.
/// `progress` is called after each epoch and may end the training.
///
/// # Errors
/// [`IdentificationError`], as in [`Identification::start`]; [`IdentificationError::Interrupted`] where `progress` ended it.
pub fn train_residual(
    _sequence: &StateSequence,
    _vehicle: &VehicleParameters,
    _candidate: &Candidate,
    _config: &Config,
    _progress: &mut dyn FnMut(gripsight_s4::Progress) -> ControlFlow<()>,
) -> Result<ResidualModel, IdentificationError> {
    Err(IdentificationError::Ended)
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
    let (mut run, mut candidate) = Identification::start(sequence, vehicle, prior, previous, config)?;
    loop {
        let iteration = candidate.key.iteration + 1;
        let epochs_max = 0;
        progress(Stage::Training { iteration, epoch: 0, epochs_max, loss: f64::NAN });
        let model = train_residual(sequence, vehicle, &candidate, config, &mut |p| {
            progress(Stage::Training { iteration, epoch: p.epoch, epochs_max, loss: p.validation_loss });
            ControlFlow::Continue(())
        })?;
        progress(Stage::Fitting { iteration });
        match run.advance(&model)? {
            Next::Candidate(next) => candidate = next,
            Next::Done(outcome) => {
                progress(Stage::Finished);
                return Ok(*outcome);
            }
        }
    }
}
