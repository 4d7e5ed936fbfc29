//! Topics in, topics out.

use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use gripsight_bag::Reassembler;
use gripsight_identification::export::{Provenance, TireFiles};
use gripsight_identification::{AcceptedSet, Config, FrictionPrior, Method, Outcome};
use gripsight_identification_messages as messages;
use gripsight_msgs::{
    FrictionPrior as FrictionMessage, ResidualModel as ModelMessage, StateSequence as SequenceMessage,
};
use gripsight_runtime::{Descriptor, Diagnostics, Node, Parameter, Qos, Subscription, vehicle_parameters};
use gripsight_signals::StateSequence;
use gripsight_vehicle::VehicleParameters;
use tokio::sync::watch;

use crate::diagnostics::{Facts, LastRun, status};
use crate::outputs::Outputs;
use crate::run::{Run, RunError};

/// Declares parameters and topics; gives the node's work.
pub(crate) fn setup(node: &mut Node) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<>> {
    let vehicle = Arc::new(vehicle_parameters(node)?);
    let settings = Settings::declare(node)?;
    let sequences = node.subscription::<SequenceMessage>("sequence", Qos::latched().with_depth(64))?;
    let frictions = node.subscription::<FrictionMessage>("friction", Qos::latched())?;
    let models = node.subscription::<ModelMessage>("model", Qos::latched())?;
    let outputs = Outputs::new(node)?;
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
        let (newest, sequence) = watch::channel(None);
        let (prior, prior_in_force) = watch::channel(None);
        tokio::select! {
            () = collect_sequences(sequences, newest) => {}
            () = collect_friction(frictions, prior, &facts) => {}
            () = report(&diagnostics, &facts) => {}
            () = identify_each(sequence, prior_in_force, models, &outputs, &vehicle, &settings, &facts) => {}
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

/// One run after the other, each on the newest sequence, each starting from the set accepted last.
async fn identify_each(
    mut sequences: watch::Receiver<Option<Arc<StateSequence>>>,
    prior: watch::Receiver<Option<FrictionPrior>>,
    mut models: Subscription<ModelMessage>,
    outputs: &Outputs,
    vehicle: &Arc<VehicleParameters>,
    settings: &Settings,
    facts: &RefCell<Facts>,
) {
    outputs.waiting().await;
    let mut accepted: Option<AcceptedSet> = None;
    while sequences.changed().await.is_ok() {
        let Some(sequence) = sequences.borrow_and_update().clone() else { continue };
        let start = Instant::now();
        let run = Run {
            sequence: Arc::clone(&sequence),
            vehicle: Arc::clone(vehicle),
            prior: *prior.borrow(),
            previous: accepted.clone(),
            config: settings.config(),
            model_timeout: Duration::from_secs_f64(settings.model_timeout_s.get()),
            start,
            outputs,
            models: &mut models,
            on_step: &|text| facts.borrow_mut().running = Some(text.to_owned()),
        };
        let result = run.finish().await;
        if let Ok(outcome) = &result {
            outputs.conclude(outcome, &sequence).await;
            log(outcome);
            let notice =
                outcome.grip.as_ref().zip(accepted.as_ref()).and_then(|(grip, set)| grip.notice(set));
            if let Some(notice) = &notice {
                tracing::warn!("sequence {}: {notice}", sequence.sequence_id);
            }
            facts.borrow_mut().grip = notice;
            accepted = outcome.accepted_set().or(accepted);
            write_files(outcome, &sequence, settings);
        }
        let mut facts = facts.borrow_mut();
        facts.runs += 1;
        facts.running = None;
        facts.last_run_s = start.elapsed().as_secs_f64();
        facts.in_force = accepted.as_ref().map(|set| set.sequence_id);
        facts.last = last_run(&result);
        facts.accepted += usize::from(matches!(facts.last, LastRun::Accepted { .. }));
        if let Err(error) = &result {
            tracing::error!("sequence {}: {error}", sequence.sequence_id);
        }
    }
}

fn last_run(result: &Result<Outcome, RunError>) -> LastRun {
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
        if outcome.accepted { "accepted" } else { "rejected" },
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
        notes: outcome.reasons.clone(),
    };
    let files = TireFiles {
        tires: &outcome.phi_p,
        vehicle: &outcome.vehicle,
        provenance: &provenance,
        floor: &settings.floor.get(),
        driven_mps: outcome.v_x_range_mps.high,
    };
    match files.write(Path::new(&folder), outcome.accepted) {
        Ok(_) => tracing::info!("files written to {folder}"),
        Err(error) => tracing::error!("files not written: {error}"),
    }
}

/// Names a run: unique per start, so that answers to an earlier run are not taken for this one's.
fn run_id() -> String {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    format!("identifier-{:x}", since_epoch.as_nanos())
}
