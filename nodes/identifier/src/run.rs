//! One identification with the s4_residual node as its other half.

use std::sync::Arc;
use std::time::{Duration, Instant};

use gripsight_identification::{
    AcceptedSet, Candidate, Config, DriveNext, FrictionPrior, Identification, IdentificationError,
    IterationRecord, Method, Next, Outcome, ResidualModel, RunKey, Started,
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
    #[error(
        "s4_residual learns by the method {theirs}, this node finds tires by {own}: give both nodes the same `method`"
    )]
    OtherMethod { theirs: &'static str, own: &'static str },
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
    /// When it began.
    pub(crate) start: Instant,
    pub(crate) outputs: &'a Outputs,
    pub(crate) models: &'a mut Subscription<ModelMessage>,
    /// Told where the run stands, for the diagnostics.
    pub(crate) on_step: &'a dyn Fn(&str),
}

impl Run<'_> {
    /// Asks, fits and repeats until an outcome stands.
    pub(crate) async fn finish(mut self) -> Result<Outcome, RunError> {
        let key = RunKey::first(&self.sequence, &self.vehicle, &self.config);
        self.step(&key, Progress::PREPARING, None, "correcting the signals, fitting directly".to_owned())
            .await;
        let (sequence, vehicle) = (Arc::clone(&self.sequence), Arc::clone(&self.vehicle));
        let (prior, previous, config) = (self.prior, self.previous.clone(), self.config.clone());
        let started = tokio::task::spawn_blocking(move || {
            Identification::start(&sequence, &vehicle, prior, previous.as_ref(), &config)
        })
        .await??;
        let outcome = match started {
            Started::Running(run) => self.turns(run).await?,
            Started::Refused(outcome) => *outcome,
        };
        let (last, text) = (outcome.history.last(), outcome.status.name().to_owned());
        self.said(&outcome.key, Progress::FINISHED, last, &outcome.drive_next, text).await;
        Ok(outcome)
    }

    /// Turn by turn, to the outcome.
    async fn turns(&mut self, mut run: Box<Identification>) -> Result<Outcome, RunError> {
        let mut candidate = run.candidate().cloned().ok_or(IdentificationError::Ended)?;
        loop {
            let (key, last) = (&candidate.key, run.history().last());
            let text = |what: &str| format!("iteration {}: {what}", key.iteration + 1);
            self.step(key, Progress::TRAINING, last, text("learning the residual")).await;
            let model = match self.model_for(&candidate).await {
                Err(error) => {
                    self.step(key, Progress::GIVEN_UP, last, error.to_string()).await;
                    return Err(error);
                }
                Ok(model) => model,
            };
            self.step(key, Progress::SWEEPING, last, text("virtual test")).await;
            let last = last.cloned();
            let (back, swept) = tokio::task::spawn_blocking(move || {
                let swept = run.sweep(&model);
                (run, swept)
            })
            .await?;
            let (mut back, swept) = (back, swept?);
            self.step(key, Progress::FITTING, last.as_ref(), text("fitting the tires")).await;
            let (back, next) = tokio::task::spawn_blocking(move || {
                let next = back.advance(&swept);
                (back, next)
            })
            .await?;
            run = back;
            match next? {
                Next::Candidate(next) => candidate = next,
                Next::Done(outcome) => return Ok(*outcome),
            }
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
                        let model = messages::learned_model(&message)?;
                        of_method(model.horizon, self.config.method)?;
                        return Ok(model);
                    }
                }
                () = &mut deadline => {
                    let waited_s = self.model_timeout.as_secs_f64();
                    return Err(RunError::NoAnswer { key: Box::new(candidate.key.clone()), waited_s });
                }
            }
        }
    }

    async fn step(&self, key: &RunKey, stage: u8, last: Option<&IterationRecord>, text: String) {
        self.said(key, stage, last, &[], text).await;
    }

    async fn said(
        &self,
        key: &RunKey,
        stage: u8,
        last: Option<&IterationRecord>,
        drive_next: &[DriveNext],
        text: String,
    ) {
        (self.on_step)(&text);
        let (sequence, config, elapsed) = (&*self.sequence, &self.config, self.start.elapsed());
        self.outputs.progress(&Step { key, sequence, config, stage, last, elapsed, drive_next, text }).await;
    }
}

/// Refuses a model that was learned by another method than it is to be used by: the paper's takes residuals one step ahead, the robust one
/// over several.
fn of_method(horizon: usize, own: Method) -> Result<(), RunError> {
    let name = |method| if method == Method::Paper { "paper" } else { "robust" };
    let theirs = if horizon == 1 { Method::Paper } else { Method::Robust };
    if theirs == own { Ok(()) } else { Err(RunError::OtherMethod { theirs: name(theirs), own: name(own) }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_of_another_method_is_refused_with_both_names() {
        assert!(of_method(1, Method::Paper).is_ok() && of_method(10, Method::Robust).is_ok());
        let refused = of_method(1, Method::Robust).unwrap_err().to_string();
        assert!(refused.contains("method paper") && refused.contains("by robust"), "{refused}");
    }
}
