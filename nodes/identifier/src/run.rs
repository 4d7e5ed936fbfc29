//! One identification with the s4_residual node as its other half.

use std::sync::Arc;
use std::time::{Duration, Instant};

use gripsight_identification::{
    AcceptedSet, Candidate, Config, FrictionPrior, Identification, IdentificationError, Next, Outcome,
    ResidualModel, RunKey, Started,
};
use gripsight_identification_messages as messages;
use gripsight_msgs::{IdentificationProgress as Progress, ResidualModel as ModelMessage};
use gripsight_runtime::Subscription;
use gripsight_signals::StateSequence;
use gripsight_vehicle::VehicleParameters;

use crate::outputs::{Outputs, Step};

/// A candidate is repeated this often until its model comes.
const REPEAT: Duration = Duration::from_secs(1);

/// Why a run gave no outcome.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RunError {
    #[error(transparent)]
    Identification(#[from] IdentificationError),
    #[error(
        "no residual model for {key} within {waited_s:.0} s: is s4_residual running, with the same vehicle file?"
    )]
    NoAnswer { key: Box<RunKey>, waited_s: f64 },
    #[error("the computation ended abnormally: {0}")]
    Computation(#[from] tokio::task::JoinError),
    #[error("the node is shutting down")]
    ShuttingDown,
}

/// What a run works with.
pub(crate) struct Run<'a> {
    pub(crate) sequence: Arc<StateSequence>,
    pub(crate) vehicle: Arc<VehicleParameters>,
    pub(crate) prior: Option<FrictionPrior>,
    pub(crate) previous: Option<AcceptedSet>,
    pub(crate) config: Config,
    pub(crate) model_timeout: Duration,
    pub(crate) outputs: &'a Outputs,
    pub(crate) models: &'a mut Subscription<ModelMessage>,
    /// Told where the run stands, for the diagnostics.
    pub(crate) on_step: &'a dyn Fn(&str),
}

impl Run<'_> {
    /// Asks, fits and repeats until an outcome stands.
    pub(crate) async fn finish(mut self) -> Result<Outcome, RunError> {
        let start = Instant::now();
        let (sequence, vehicle) = (Arc::clone(&self.sequence), Arc::clone(&self.vehicle));
        let (prior, previous, config) = (self.prior, self.previous.clone(), self.config.clone());
        let started = tokio::task::spawn_blocking(move || {
            Identification::start(&sequence, &vehicle, prior, previous.as_ref(), &config)
        })
        .await??;
        let mut identification = match started {
            Started::Running(run) => run,
            Started::Refused(outcome) => return Ok(*outcome),
        };
        let mut next = identification.candidate().cloned().map(Next::Candidate);
        loop {
            let candidate = match next {
                Some(Next::Candidate(candidate)) => candidate,
                Some(Next::Done(outcome)) => {
                    let text = if outcome.accepted { "accepted" } else { "rejected" };
                    self.step(&outcome.key, Progress::FINISHED, &identification, start, text.to_owned())
                        .await;
                    return Ok(*outcome);
                }
                None => return Err(IdentificationError::Ended.into()),
            };
            let iteration = candidate.key.iteration + 1;
            let text = format!("iteration {iteration}: learning the residual");
            self.step(&candidate.key, Progress::TRAINING, &identification, start, text).await;
            let model = self.model_for(&candidate).await?;
            let text = format!("iteration {iteration}: virtual test and fit");
            self.step(&candidate.key, Progress::FITTING, &identification, start, text).await;
            let (back, advanced) = tokio::task::spawn_blocking(move || {
                let next = identification.advance(&model);
                (identification, next)
            })
            .await?;
            identification = back;
            next = Some(advanced?);
        }
    }

    /// Asks for the model of a candidate until it comes.
    async fn model_for(&mut self, candidate: &Candidate) -> Result<ResidualModel, RunError> {
        let deadline = tokio::time::sleep(self.model_timeout);
        tokio::pin!(deadline);
        let mut repeat = tokio::time::interval(REPEAT);
        loop {
            tokio::select! {
                _ = repeat.tick() => self.outputs.propose(candidate, &self.vehicle, &self.sequence).await,
                message = self.models.next() => {
                    let message = message.ok_or(RunError::ShuttingDown)?;
                    // Late and repeated answers, and those to others, are no news.
                    if messages::run_key(&message.handshake) == candidate.key {
                        return Ok(messages::learned_model(&message)?);
                    }
                }
                () = &mut deadline => {
                    let waited_s = self.model_timeout.as_secs_f64();
                    return Err(RunError::NoAnswer { key: Box::new(candidate.key.clone()), waited_s });
                }
            }
        }
    }

    async fn step(&self, key: &RunKey, stage: u8, run: &Identification, start: Instant, text: String) {
        (self.on_step)(&text);
        let last = run.history().last();
        let (sequence, config, elapsed) = (&*self.sequence, &self.config, start.elapsed());
        self.outputs.progress(&Step { key, sequence, config, stage, last, elapsed, text }).await;
    }
}
