//! Topics in, topics out.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use gripsight_bag::{Reassembler, decode};
use gripsight_identification::{
    Candidate, Config, IdentificationError, Method, ResidualKind, ResidualModel, RunKey, SignalCorrections,
    train_residual, vehicle_hash,
};
use gripsight_identification_messages as messages;
use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::{PacejkaParams, ResidualModel as ModelMessage, StateSequence as SequenceMessage};
use gripsight_runtime::{Descriptor, Node, Publisher, Qos, vehicle_parameters};
use gripsight_signals::{Measurement, StateSequence};
use gripsight_vehicle::VehicleParameters;
use tokio::task::JoinHandle;

use crate::diagnostics::{Activity, Figures, status};
use crate::live::Live;
use crate::recent::Recent;

/// Sequences and models kept for candidates that come late or again. As many as telemetry keeps for late joiners: an identifier that has
/// started again begins with the oldest of those.
const KEPT: usize = 24;

/// Declares parameters and topics; gives the node's work.
pub(crate) fn setup(node: &mut Node) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<>> {
    let vehicle = vehicle_parameters(node)?;
    let method = node.parameter(
        "method",
        "robust".to_owned(),
        Descriptor::new("How residuals are taken; as the identifier's")
            .choices(&["robust", "paper"])
            .read_only(),
    )?;
    let residual = node.parameter(
        "residual",
        "s4".to_owned(),
        Descriptor::new("Network that learns the residual")
            .choices(&["s4", "mlp", "rnn", "none"])
            .read_only(),
    )?;
    let default = Config::default();
    let epochs = node.parameter(
        "epochs",
        0,
        Descriptor::new("Epochs of training at most, each turn; 0: 60, with method paper 10")
            .range(0.0..=1000.0)
            .read_only(),
    )?;
    let config = Config {
        method: if method.get() == "paper" { Method::Paper } else { Method::Robust },
        residual: ResidualKind::from_name(&residual.get()).unwrap_or_default(),
        epochs: usize::try_from(epochs.get()).ok().filter(|&n| n > 0),
        ..default
    };
    let mut sequences = node.subscription::<SequenceMessage>("sequence", Qos::latched().with_depth(64))?;
    let mut candidates = node.subscription::<PacejkaParams>("candidate", Qos::latched())?;
    let sensor = node.sensor_qos(50);
    let mut odometry = node.subscription::<Odometry>("odom", sensor)?;
    let mut drive = node.subscription::<AckermannDriveStamped>("drive", sensor)?;
    let mut learner = Learner {
        hash: vehicle_hash(&vehicle),
        vehicle: Arc::new(vehicle),
        config,
        reassembler: Reassembler::default(),
        sequences: Recent::new(KEPT),
        models: Recent::new(KEPT),
        waiting: None,
        training: None,
        next: None,
        activity: Activity::Idle,
        figures: Figures::default(),
        output: node.publisher("~/model", Qos::latched())?,
        live: Live::new(node.publisher("~/residual", Qos::reliable(10))?),
    };
    let diagnostics = node.diagnostics();

    Ok(async move {
        let mut ticks = tokio::time::interval(Duration::from_secs(1));
        loop {
            tokio::select! {
                Some(message) = sequences.next() => learner.take_sequence(message).await,
                Some(message) = odometry.next() => {
                    learner.live.take(Measurement::Odometry(decode::odometry(&message))).await;
                }
                Some(message) = drive.next() => {
                    learner.live.take(Measurement::Drive(decode::drive(&message))).await;
                }
                Some(message) = candidates.next() => learner.take_candidate(&message).await,
                trained = ended(&mut learner.training) => learner.take_result(trained).await,
                _ = ticks.tick() => {
                    learner.figures.sequences = learner.sequences.len();
                    learner.figures.residuals = learner.live.published;
                    diagnostics.report("residual", status(&learner.activity, &learner.figures));
                }
                else => return Ok(()),
            }
        }
    })
}

type Trained = (Result<ResidualModel, IdentificationError>, Duration);

/// A training under way on a thread of its own.
struct Training {
    key: RunKey,
    corrections: SignalCorrections,
    stop: Arc<AtomicBool>,
    task: JoinHandle<Trained>,
}

impl Drop for Training {
    /// A training that nobody waits for any more ends at its next epoch.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Resolves when the training ends; never without one.
async fn ended(training: &mut Option<Training>) -> Result<Trained, tokio::task::JoinError> {
    match training {
        Some(training) => (&mut training.task).await,
        None => std::future::pending().await,
    }
}

/// When a candidate is trained.
#[derive(Debug, PartialEq)]
enum Turn {
    /// It is.
    Running,
    /// At once; what is trained now is of the same run, and nobody waits for it any more.
    Now,
    /// After what is trained now. Two identifiers on one topic, each repeating its candidate, would else end each other's trainings for good.
    Next,
}

fn turn(training: Option<&RunKey>, candidate: &RunKey) -> Turn {
    match training {
        Some(training) if training == candidate => Turn::Running,
        Some(training) if training.run_id != candidate.run_id => Turn::Next,
        _ => Turn::Now,
    }
}

struct Learner {
    vehicle: Arc<VehicleParameters>,
    hash: String,
    config: Config,
    reassembler: Reassembler,
    sequences: Recent<u64, StateSequence>,
    models: Recent<RunKey, ModelMessage>,
    /// The candidate whose sequence has not come yet.
    waiting: Option<Candidate>,
    training: Option<Training>,
    /// The newest candidate of another run, while one is trained.
    next: Option<Candidate>,
    activity: Activity,
    figures: Figures,
    output: Publisher<ModelMessage>,
    live: Live,
}

impl Learner {
    async fn take_sequence(&mut self, message: SequenceMessage) {
        match self.reassembler.push(message) {
            Ok(Some(recorded)) => self.sequences.put(recorded.sequence.sequence_id, recorded.sequence),
            Ok(None) => return,
            Err(error) => {
                tracing::warn!("sequence left out: {error}");
                return;
            }
        }
        if let Some(candidate) = self.waiting.take() {
            self.answer(candidate).await;
        }
    }

    async fn take_candidate(&mut self, message: &PacejkaParams) {
        let Some(candidate) = messages::candidate(message) else { return };
        if candidate.key.vehicle_hash != self.hash {
            self.fail(format!(
                "{} was made for a car with other parameters than this node's ({}): give both nodes the same vehicle file",
                candidate.key, self.hash
            ));
            return;
        }
        self.answer(candidate).await;
    }

    /// Answers at once where the model is known, else trains it, in its turn.
    async fn answer(&mut self, candidate: Candidate) {
        if let Some(model) = self.models.get(&candidate.key) {
            self.output.publish(&model).await;
            return;
        }
        match turn(self.training.as_ref().map(|training| &training.key), &candidate.key) {
            Turn::Running => return,
            Turn::Next => {
                self.next = Some(candidate);
                return;
            }
            Turn::Now => {}
        }
        let Some(sequence) = self.sequences.get(&candidate.key.sequence_id) else {
            self.activity = Activity::WaitingForSequence { sequence_id: candidate.key.sequence_id };
            self.waiting = Some(candidate);
            return;
        };
        self.activity = Activity::Training { candidate: candidate.key.to_string() };
        self.training = Some(self.train(sequence, candidate));
    }

    fn train(&self, sequence: Arc<StateSequence>, candidate: Candidate) -> Training {
        let stop = Arc::new(AtomicBool::new(false));
        let (key, corrections) = (candidate.key.clone(), candidate.corrections);
        let (vehicle, config) = (Arc::clone(&self.vehicle), self.config.clone());
        let stopped = Arc::clone(&stop);
        let task = tokio::task::spawn_blocking(move || {
            let start = Instant::now();
            let result = train_residual(&sequence, &vehicle, &candidate, &config, &mut |_| {
                if stopped.load(Ordering::Relaxed) {
                    ControlFlow::Break(())
                } else {
                    ControlFlow::Continue(())
                }
            });
            (result, start.elapsed())
        });
        Training { key, corrections, stop, task }
    }

    async fn take_result(&mut self, ended: Result<Trained, tokio::task::JoinError>) {
        let corrections = self.training.take().map(|training| training.corrections);
        match ended {
            Ok((Ok(model), took)) => {
                self.figures.models += 1;
                self.figures.last_training_s = took.as_secs_f64();
                self.figures.last_validation_loss = model.validation_loss;
                tracing::info!(
                    "{}: {} epochs on {} samples in {:.2} s, validation loss {:.4}",
                    model.key,
                    model.epochs,
                    model.samples,
                    took.as_secs_f64(),
                    model.validation_loss
                );
                if let Some(corrections) = corrections {
                    self.live.follow(&self.vehicle, &model, corrections);
                }
                let message = messages::residual_model(&model, took.as_secs_f64());
                self.output.publish(&message).await;
                self.models.put(model.key, message);
                self.activity = Activity::Idle;
            }
            Ok((Err(error), _)) => self.fail(error.to_string()),
            Err(error) => self.fail(format!("the training ended abnormally: {error}")),
        }
        if let Some(candidate) = self.next.take() {
            self.answer(candidate).await;
        }
    }

    fn fail(&mut self, reason: String) {
        tracing::error!("{reason}");
        self.activity = Activity::Failed { reason };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_run_waits_its_turn_and_a_newer_candidate_of_the_same_does_not() {
        let key = |run_id: &str, iteration| RunKey {
            run_id: run_id.into(),
            sequence_id: 1,
            iteration,
            vehicle_hash: "c0ffee".into(),
            seed: 0,
        };
        let training = key("a", 1);
        assert_eq!(turn(None, &training), Turn::Now);
        assert_eq!(turn(Some(&training), &key("a", 1)), Turn::Running);
        assert_eq!(turn(Some(&training), &key("a", 2)), Turn::Now);
        assert_eq!(turn(Some(&training), &key("b", 0)), Turn::Next);
    }
}
