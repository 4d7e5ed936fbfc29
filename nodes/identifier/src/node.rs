//! Topics in, topics out.

use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use gripsight_bag::{Reassembler, decode};
use gripsight_identification::export::{Provenance, TireFiles};
use gripsight_identification::{Config, FrictionPrior, Method, Outcome, Status, vehicle_hash};
use gripsight_identification_messages as messages;
use gripsight_msgs::standard::ackermann_msgs::AckermannDriveStamped;
use gripsight_msgs::standard::nav_msgs::Odometry;
use gripsight_msgs::{
    FrictionPrior as FrictionMessage, PacejkaParams, ResidualModel as ModelMessage,
    StateSequence as SequenceMessage,
};
use gripsight_runtime::{Descriptor, Diagnostics, Node, Parameter, Qos, Subscription, vehicle_parameters};
use gripsight_signals::{Measurement, StateSequence};
use gripsight_vehicle::VehicleParameters;
use tokio::sync::watch;

use crate::diagnostics::{Facts, LastRun, status};
use crate::outputs::Outputs;
use crate::own_tires::{Ended, publish_each};
use crate::run::{Run, RunError};
use crate::watch::{InForce, Watch, withdraw};

/// Declares parameters and topics; gives the node's work.
pub(crate) fn setup(node: &mut Node) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<>> {
    let vehicle = Arc::new(vehicle_parameters(node)?);
    let settings = Settings::declare(node)?;
    let sequences = node.subscription::<SequenceMessage>("sequence", Qos::latched().with_depth(64))?;
    let frictions = node.subscription::<FrictionMessage>("friction", Qos::latched())?;
    let models = node.subscription::<ModelMessage>("model", Qos::latched())?;
    let sensor = node.sensor_qos(50);
    let odometry = node.subscription::<Odometry>("odom", sensor)?;
    let drive = node.subscription::<AckermannDriveStamped>("drive", sensor)?;
    let outputs = Outputs::new(node, settings.output_folder.clone())?;
    let diagnostics = node.diagnostics();

    Ok(async move {
        let facts = RefCell::new(Facts {
            last: LastRun::None,
            running: None,
            runs: 0,
            accepted: 0,
            last_run_s: 0.0,
            prior: "none".to_owned(),
            in_force: None,
            grip: None,
        });
        let in_force = RefCell::new(None);
        let (newest, sequence) = watch::channel(None);
        let (prior, prior_in_force) = watch::channel(None);
        let (ended, runs) = watch::channel(None);
        tokio::select! {
            () = collect_sequences(sequences, newest) => {}
            () = collect_friction(frictions, prior, &facts) => {}
            () = report(&diagnostics, &facts) => {}
            () = outputs.keep_controller(&diagnostics) => {}
            () = follow_grip(odometry, drive, &vehicle, &in_force, &outputs) => {}
            () = publish_each(runs, &vehicle, &outputs) => {}
            () = identify_each(sequence, prior_in_force, models, ended, &outputs, &vehicle, &settings, &in_force, &facts) => {}
        }
        Ok(())
    })
}

struct Settings {
    method: Parameter<String>,
    seed: Parameter<i64>,
    max_iterations: Parameter<i64>,
    tolerance: Parameter<f64>,
    model_timeout_s: Parameter<f64>,
    publish_provisional: Parameter<bool>,
    output_folder: Parameter<String>,
    floor: Parameter<String>,
}

impl Settings {
    fn declare(node: &mut Node) -> Result<Self, gripsight_runtime::Error> {
        let default = Config::default();
        Ok(Self {
            method: node.parameter(
                "method",
                "robust".to_owned(),
                Descriptor::new("How tires are found; as s4_residual's").choices(&["robust", "paper"]),
            )?,
            seed: node.parameter(
                "seed",
                0,
                Descriptor::new("Seed of everything random").range(0.0..=9e15),
            )?,
            max_iterations: node.parameter(
                "max_iterations",
                i64::from(default.max_iterations),
                Descriptor::new("Turns of the outer loop at most").range(1.0..=100.0),
            )?,
            tolerance: node.parameter(
                "tolerance",
                default.tolerance,
                Descriptor::new(
                    "Change of the tire curves, as a share of their peak, under which a run has converged",
                )
                .range(1e-6..=1.0),
            )?,
            model_timeout_s: node.parameter(
                "model_timeout_s",
                30.0,
                Descriptor::new("How long a residual model is waited for [s]").range(1.0..=3600.0),
            )?,
            publish_provisional: node.parameter(
                "publish_provisional",
                false,
                Descriptor::new("Whether ~/pacejka carries sets whose peak rests on a friction prior, too"),
            )?,
            output_folder: node.parameter(
                "output_folder",
                String::new(),
                Descriptor::new("Folder for the files of other stacks; empty: none are written"),
            )?,
            floor: node.parameter(
                "floor",
                "unknown".to_owned(),
                Descriptor::new("The surface's name, written into the MPC's file"),
            )?,
        })
    }

    fn config(&self) -> Config {
        Config {
            run_id: run_id(),
            method: if self.method.get() == "paper" { Method::Paper } else { Method::Robust },
            seed: self.seed.get() as u64,
            max_iterations: self.max_iterations.get() as u32,
            tolerance: self.tolerance.get(),
            ..Config::default()
        }
    }
}

/// Keeps the newest whole sequence: a run that takes longer than a hop leaves the ones between out.
async fn collect_sequences(
    mut messages: Subscription<SequenceMessage>,
    newest: watch::Sender<Option<Arc<StateSequence>>>,
) {
    let mut reassembler = Reassembler::default();
    while let Some(message) = messages.next().await {
        match reassembler.push(message) {
            Ok(Some(recorded)) => {
                newest.send_replace(Some(Arc::new(recorded.sequence)));
            }
            Ok(None) => {}
            Err(error) => tracing::warn!("sequence left out: {error}"),
        }
    }
}

async fn collect_friction(
    mut messages: Subscription<FrictionMessage>,
    newest: watch::Sender<Option<FrictionPrior>>,
    facts: &RefCell<Facts>,
) {
    while let Some(message) = messages.next().await {
        let prior = messages::friction_prior(&message);
        facts.borrow_mut().prior = match &prior {
            Some(p) => format!("{:.2} +- {:.2}", p.mu, p.sigma),
            None => format!("none: {}", message.reason),
        };
        newest.send_replace(prior);
    }
}

async fn report(diagnostics: &Diagnostics, facts: &RefCell<Facts>) {
    let mut ticks = tokio::time::interval(Duration::from_secs(1));
    loop {
        ticks.tick().await;
        diagnostics.report("identification", status(&facts.borrow()));
    }
}

/// Watches the set in force on what the car reports.
async fn follow_grip(
    mut odometry: Subscription<Odometry>,
    mut drive: Subscription<AckermannDriveStamped>,
    vehicle: &VehicleParameters,
    in_force: &RefCell<Option<InForce>>,
    outputs: &Outputs,
) {
    let mut watch = Watch::new();
    loop {
        let measurement = tokio::select! {
            Some(message) = odometry.next() => Measurement::Odometry(decode::odometry(&message)),
            Some(message) = drive.next() => Measurement::Drive(decode::drive(&message)),
            else => return,
        };
        watch.take(measurement, vehicle, in_force, outputs).await;
    }
}

/// One run after the other, each on the newest sequence, each starting from the set accepted last.
#[expect(clippy::too_many_arguments, reason = "the node's whole state, each part with another task beside")]
async fn identify_each(
    mut sequences: watch::Receiver<Option<Arc<StateSequence>>>,
    prior: watch::Receiver<Option<FrictionPrior>>,
    mut models: Subscription<ModelMessage>,
    ended: watch::Sender<Ended>,
    outputs: &Outputs,
    vehicle: &Arc<VehicleParameters>,
    settings: &Settings,
    in_force: &RefCell<Option<InForce>>,
    facts: &RefCell<Facts>,
) {
    outputs.waiting().await;
    outputs.recall(&vehicle_hash(vehicle), settings.publish_provisional.get()).await;
    while sequences.changed().await.is_ok() {
        let Some(sequence) = sequences.borrow_and_update().clone() else { continue };
        let start = Instant::now();
        let previous = in_force.borrow().as_ref().map(|in_force| in_force.set.clone());
        let run = Run {
            sequence: Arc::clone(&sequence),
            vehicle: Arc::clone(vehicle),
            prior: *prior.borrow(),
            previous: previous.clone(),
            config: settings.config(),
            model_timeout: Duration::from_secs_f64(settings.model_timeout_s.get()),
            start,
            outputs,
            models: &mut models,
            on_step: &|text| facts.borrow_mut().running = Some(text.to_owned()),
        };
        let result = run.finish().await.map(Arc::new);
        if let Ok(outcome) = &result {
            let message = outputs.conclude(outcome, &sequence).await;
            log(outcome);
            let notice =
                outcome.grip.as_ref().zip(previous.as_ref()).and_then(|(grip, set)| grip.notice(set));
            if let Some(notice) = &notice {
                tracing::warn!("sequence {}: {notice}", sequence.sequence_id);
            }
            hand_on(outcome, message, notice.clone(), settings.publish_provisional.get(), in_force, outputs)
                .await;
            facts.borrow_mut().grip = notice;
            write_files(outcome, &sequence, settings);
            // A window that still grows is for whoever needs a safe set soon.
            if !sequence.grows() {
                ended.send_replace(Some((Arc::clone(&sequence), Arc::clone(outcome))));
            }
        }
        let mut facts = facts.borrow_mut();
        facts.runs += 1;
        facts.running = None;
        facts.last_run_s = start.elapsed().as_secs_f64();
        facts.in_force = in_force.borrow().as_ref().filter(|i| !i.withdrawn).map(|i| i.set.sequence_id);
        facts.last = last_run(&result);
        facts.accepted += usize::from(matches!(facts.last, LastRun::Accepted { .. }));
        if let Err(error) = &result {
            tracing::error!("sequence {}: {error}", sequence.sequence_id);
        }
    }
}

/// Hands the end of a run on to the MPC: a set that knows more than the one in force takes its place; one that no longer fits is withdrawn.
async fn hand_on(
    outcome: &Outcome,
    message: PacejkaParams,
    notice: Option<String>,
    provisional: bool,
    in_force: &RefCell<Option<InForce>>,
    outputs: &Outputs,
) {
    let replaces = outcome.replaces(in_force.borrow().as_ref().filter(|i| !i.withdrawn).map(|i| &i.set));
    if let Some(set) = outcome.accepted_set().filter(|_| replaces) {
        outputs.publish(&message).await;
        // Who takes the prior's peak also needs what the drive alone shows: it goes first, so that who comes late finds the prior's.
        if let Some(beside) = messages::provisional(outcome).filter(|_| provisional) {
            outputs.publish(&PacejkaParams { header: message.header.clone(), ..beside }).await;
        }
        *in_force.borrow_mut() = Some(InForce { set, message, withdrawn: false });
        return;
    }
    if provisional && outcome.status == Status::Provisional {
        outputs.publish(&message).await;
    }
    let falls = |i: &InForce| outcome.grip.as_ref().is_some_and(|grip| grip.fallen(&i.set));
    let withdraws = in_force.borrow().as_ref().is_some_and(|i| !i.withdrawn && falls(i));
    if let (true, Some(notice)) = (withdraws, notice) {
        withdraw(in_force, notice, outputs).await;
    }
}

fn last_run(result: &Result<Arc<Outcome>, RunError>) -> LastRun {
    match result {
        Ok(outcome) if outcome.accepted => LastRun::Accepted { remarks: outcome.reasons.join("; ") },
        Ok(outcome) => LastRun::Rejected { reason: outcome.reasons.join("; ") },
        Err(error) => LastRun::Failed { reason: error.to_string() },
    }
}

fn log(outcome: &Outcome) {
    let (k, d) = (&outcome.cornering_stiffness_n_per_rad, &outcome.peak_friction);
    tracing::info!(
        "sequence {}: {} after {} iterations; cornering stiffness {:.1} / {:.1} N/rad, peak friction {:.3} / {:.3}{}{}",
        outcome.key.sequence_id,
        outcome.status.name(),
        outcome.iterations,
        k.front.value,
        k.rear.value,
        d.front.value,
        d.rear.value,
        if outcome.reasons.is_empty() { "" } else { "; " },
        outcome.reasons.join("; "),
    );
}

/// The MPC's and the lookup controllers' files; a set that was rejected leaves the last good ones where they are.
fn write_files(outcome: &Outcome, sequence: &StateSequence, settings: &Settings) {
    let folder = settings.output_folder.get();
    if folder.is_empty() {
        return;
    }
    let provenance = Provenance {
        car: outcome.vehicle.name.clone().unwrap_or_else(|| "car".to_owned()),
        bag: format!("live, sequence {}", sequence.sequence_id),
        data_stamp_ns: sequence.start_stamp_ns,
        tool_version: env!("CARGO_PKG_VERSION").to_owned(),
        vehicle_hash: outcome.key.vehicle_hash.clone(),
        seed: outcome.key.seed,
        command: "identifier".to_owned(),
        status: outcome.status,
        valid_within: outcome.valid_within,
        notes: outcome.reasons.clone(),
    };
    let files = TireFiles {
        tires: &outcome.phi_p,
        vehicle: &outcome.vehicle,
        provenance: &provenance,
        floor: &settings.floor.get(),
        driven_mps: outcome.v_x_range_mps.high,
    };
    let folder = Path::new(&folder);
    // Where it cannot be made, the writing says why.
    std::fs::create_dir_all(folder).ok();
    match files.write(folder) {
        Ok(_) => tracing::info!("files written to {}", folder.display()),
        Err(error) => tracing::error!("files not written: {error}"),
    }
}

/// Names a run: unique per start, so that answers to an earlier run are not taken for this one's.
fn run_id() -> String {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    format!("identifier-{:x}", since_epoch.as_nanos())
}
