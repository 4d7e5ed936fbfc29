//! The node's publishers, and the messages that only it makes.

use std::path::Path;
use std::time::{Duration, SystemTime};

use gripsight_bag::encode;
use gripsight_identification::{Candidate, Config, DriveNext, IterationRecord, Outcome, RunKey};
use gripsight_identification_messages as messages;
use gripsight_msgs::standard::std_msgs::Header;
use gripsight_msgs::{
    Grip, IdentificationProgress as Progress, PacejkaParams, TirePosterior as PosteriorMessage,
};
use gripsight_runtime::{Diagnostics, Node, Parameter, Publisher, Qos};
use gripsight_signals::StateSequence;
use gripsight_vehicle::{TirePosterior, VehicleParameters};

use crate::controller::Controller;
use crate::memory;

/// Where results go.
pub(crate) struct Outputs {
    candidate: Publisher<PacejkaParams>,
    pacejka: Publisher<PacejkaParams>,
    posterior: Publisher<PosteriorMessage>,
    grip: Publisher<Grip>,
    progress: Publisher<Progress>,
    /// A controller that takes parameters in place of messages.
    controller: Option<Controller>,
    /// Where the set that the MPC was told last is kept; empty: nowhere.
    folder: Parameter<String>,
}

impl Outputs {
    pub(crate) fn new(node: &mut Node, folder: Parameter<String>) -> anyhow::Result<Self> {
        Ok(Self {
            candidate: node.publisher("~/candidate", Qos::latched())?,
            pacejka: node.publisher("~/pacejka", Qos::latched())?,
            posterior: node.publisher("~/posterior", Qos::latched())?,
            grip: node.publisher("~/grip", Qos::latched())?,
            progress: node.publisher("~/progress", Qos::latched())?,
            controller: Controller::declare(node)?,
            folder,
        })
    }

    /// Asks for the residual model of a candidate.
    pub(crate) async fn propose(
        &self,
        candidate: &Candidate,
        vehicle: &VehicleParameters,
        sequence: &StateSequence,
    ) {
        let message = PacejkaParams { header: header(sequence), ..messages::proposed(candidate, vehicle) };
        self.candidate.publish(&message).await;
    }

    /// Publishes the end of a run, and gives its message.
    pub(crate) async fn conclude(&self, outcome: &Outcome, sequence: &StateSequence) -> PacejkaParams {
        let message = PacejkaParams { header: header(sequence), ..messages::result(outcome) };
        self.candidate.publish(&message).await;
        message
    }

    /// Publishes a set on the MPC's topic, and keeps it for the next start.
    pub(crate) async fn publish(&self, message: &PacejkaParams) {
        self.hand_on(message).await;
        let folder = self.folder.get();
        if !folder.is_empty()
            && let Err(error) = memory::keep(Path::new(&folder), message, SystemTime::now())
        {
            tracing::error!("the set is not kept for the next start: {error}");
        }
    }

    async fn hand_on(&self, message: &PacejkaParams) {
        self.pacejka.publish(message).await;
        if let Some(controller) = &self.controller {
            controller.take(message);
        }
    }

    /// Keeps a controller that takes parameters in step, where there is one.
    pub(crate) async fn keep_controller(&self, diagnostics: &Diagnostics) {
        match &self.controller {
            Some(controller) => controller.hand_on(diagnostics).await,
            None => std::future::pending().await,
        }
    }

    /// Publishes the car's own tires beside the end of a run.
    pub(crate) async fn own_tires(&self, tires: &TirePosterior, key: &RunKey, sequence: &StateSequence) {
        let message = PosteriorMessage { header: header(sequence), ..messages::tire_posterior(tires, key) };
        self.posterior.publish(&message).await;
    }

    /// Publishes what the last start of this car knew, where there was one: as provisional, on the MPC's topic only where it takes such sets.
    pub(crate) async fn recall(&self, vehicle_hash: &str, provisional: bool) {
        let folder = self.folder.get();
        if folder.is_empty() {
            return;
        }
        match memory::recall(Path::new(&folder), vehicle_hash, SystemTime::now()) {
            Ok(Some(set)) => {
                tracing::info!("{}", set.reason);
                self.candidate.publish(&set).await;
                if provisional {
                    self.hand_on(&set).await;
                }
            }
            Ok(None) => {}
            Err(error) => tracing::warn!("what was known before this start is not used: {error}"),
        }
    }

    /// Publishes how the set in force grips.
    pub(crate) async fn grip(&self, message: &Grip) {
        self.grip.publish(message).await;
        if let Some(controller) = &self.controller {
            controller.feel(message);
        }
    }

    /// Says that there has been no sequence yet.
    pub(crate) async fn waiting(&self) {
        let message = Progress {
            stage: Progress::WAITING,
            change: f64::NAN,
            tolerance: f64::NAN,
            cost: f64::NAN,
            extrapolated_share: f64::NAN,
            text: "waiting for the first sequence".to_owned(),
            ..Progress::default()
        };
        self.progress.publish(&message).await;
    }

    /// Says where a run stands.
    pub(crate) async fn progress(&self, step: &Step<'_>) {
        let last = step.last;
        let message = Progress {
            header: header(step.sequence),
            handshake: messages::handshake(step.key),
            stage: step.stage,
            max_iterations: step.config.max_iterations,
            change: last.map_or(f64::NAN, |i| i.change),
            tolerance: step.config.settled_below(),
            cost: last.map_or(f64::NAN, |i| i.fit_rmse),
            extrapolated_share: last.map_or(f64::NAN, |i| i.extrapolated_share),
            elapsed_s: step.elapsed.as_secs_f64(),
            drive_next: messages::drive_next(step.drive_next),
            text: step.text.clone(),
        };
        self.progress.publish(&message).await;
    }
}

/// Where a run stands.
pub(crate) struct Step<'a> {
    pub(crate) key: &'a RunKey,
    pub(crate) sequence: &'a StateSequence,
    pub(crate) config: &'a Config,
    /// One of the message's stages.
    pub(crate) stage: u8,
    pub(crate) last: Option<&'a IterationRecord>,
    pub(crate) elapsed: Duration,
    pub(crate) drive_next: &'a [DriveNext],
    pub(crate) text: String,
}

/// The results of a sequence are stamped with its last sample.
fn header(sequence: &StateSequence) -> Header {
    let last_ns = sequence.start_stamp_ns + (sequence.duration_s() * 1e9).round() as i64;
    Header { stamp: encode::time(last_ns), frame_id: String::new() }
}
