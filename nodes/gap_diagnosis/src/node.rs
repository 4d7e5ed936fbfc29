//! Topics in, topics out. A diagnosis never stands in the way of the control nodes: one at a time, on few threads, on the newest
//! sequence, the ones between passed over.

use std::cell::RefCell;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use gripsight_bag::Reassembler;
use gripsight_diagnosis::{Diagnosis, Earlier, GapError, Request, diagnose};
use gripsight_identification::export::stamp_text;
use gripsight_identification::{Usable, vehicle_hash};
use gripsight_identification_messages as messages;
use gripsight_msgs::{
    ExtendedModel, GapReport, StateSequence as SequenceMessage, TirePosterior as PosteriorMessage,
};
use gripsight_report::Header;
use gripsight_runtime::{
    Descriptor, Diagnostics, Node, Parameter, Publisher, Qos, Subscription, vehicle_parameters,
};
use gripsight_signals::StateSequence;
use gripsight_vehicle::{TirePosterior, VehicleParameters};
use tokio::sync::watch;

use crate::diagnostics::{Facts, Last, status};
use crate::{message, report};

/// Declares parameters and topics; gives the node's work.
pub(crate) fn setup(node: &mut Node) -> anyhow::Result<impl Future<Output = anyhow::Result<()>> + use<>> {
    let vehicle = Arc::new(vehicle_parameters(node)?);
    let threads = node.parameter(
        "threads",
        1,
        Descriptor::new("Threads that a diagnosis may use").range(1.0..=64.0).read_only(),
    )?;
    rayon::ThreadPoolBuilder::new().num_threads(threads.get() as usize).build_global()?;
    let report_folder = node.parameter(
        "report_folder",
        String::new(),
        Descriptor::new("Folder for the reports' files; empty: none are written"),
    )?;
    let without = node.parameter(
        "without",
        Vec::<String>::new(),
        Descriptor::new("Effects to leave out of the library, by name"),
    )?;
    let compare_with_first = node.parameter(
        "compare_with_first",
        false,
        Descriptor::new("Whether every sequence is compared with the first one that can tell, too"),
    )?;
    let sequences = node.subscription::<SequenceMessage>("sequence", Qos::latched().with_depth(64))?;
    let tires = node.subscription::<PosteriorMessage>("posterior", Qos::latched())?;
    let output = node.publisher::<GapReport>("~/report", Qos::latched())?;
    let model = node.publisher::<ExtendedModel>("~/extended_model", Qos::latched())?;
    let diagnostics = node.diagnostics();

    Ok(async move {
        let facts = RefCell::new(Facts {
            last: Last::None,
            diagnoses: 0,
            received: 0,
            took_s: 0.0,
            has_tires: false,
        });
        let (newest, sequence) = watch::channel(None);
        let (known, tires_known) = watch::channel(None);
        let first = RefCell::new(None);
        let diagnoser = Diagnoser {
            vehicle,
            report_folder,
            without,
            compare_with_first,
            first,
            output,
            model,
            facts: &facts,
        };
        tokio::select! {
            () = collect_sequences(sequences, newest, &facts) => {}
            () = collect_tires(tires, known, &diagnoser.vehicle, &facts) => {}
            () = say(&diagnostics, &facts) => {}
            () = diagnoser.diagnose_each(sequence, tires_known) => {}
        }
        Ok(())
    })
}

async fn collect_sequences(
    mut messages: Subscription<SequenceMessage>,
    newest: watch::Sender<Option<Arc<StateSequence>>>,
    facts: &RefCell<Facts>,
) {
    let mut reassembler = Reassembler::default();
    while let Some(message) = messages.next().await {
        match reassembler.push(message) {
            // A window that still grows is for whoever needs a safe set soon; a diagnosis waits for the whole of it.
            Ok(Some(recorded)) if recorded.sequence.grows() => {}
            Ok(Some(recorded)) => {
                facts.borrow_mut().received += 1;
                newest.send_replace(Some(Arc::new(recorded.sequence)));
            }
            Ok(None) => {}
            Err(error) => tracing::warn!("sequence left out: {error}"),
        }
    }
}

async fn collect_tires(
    mut posteriors: Subscription<PosteriorMessage>,
    newest: watch::Sender<Option<Arc<TirePosterior>>>,
    vehicle: &VehicleParameters,
    facts: &RefCell<Facts>,
) {
    let hash = vehicle_hash(vehicle);
    while let Some(message) = posteriors.next().await {
        match messages::own_tires(&message) {
            Ok(posterior) if posterior.vehicle_hash == hash => {
                facts.borrow_mut().has_tires = true;
                newest.send_replace(Some(Arc::new(posterior)));
            }
            Ok(_) => tracing::warn!("tires left out: of a car with other parameters"),
            Err(error) => tracing::warn!("tires left out: {error}"),
        }
    }
}

async fn say(diagnostics: &Diagnostics, facts: &RefCell<Facts>) {
    let mut ticks = tokio::time::interval(Duration::from_secs(1));
    loop {
        ticks.tick().await;
        diagnostics.report("gap", status(&facts.borrow()));
    }
}

/// What is said of a sequence.
struct Said {
    diagnosis: Diagnosis,
    /// Compared with the first one.
    since: Option<Diagnosis>,
    /// That first one, or this where it is.
    first: Option<Arc<Earlier>>,
}

struct Diagnoser<'a> {
    vehicle: Arc<VehicleParameters>,
    report_folder: Parameter<String>,
    without: Parameter<Vec<String>>,
    compare_with_first: Parameter<bool>,
    /// The first sequence that could tell, since comparing was asked for.
    first: RefCell<Option<Arc<Earlier>>>,
    output: Publisher<GapReport>,
    model: Publisher<ExtendedModel>,
    facts: &'a RefCell<Facts>,
}

impl Diagnoser<'_> {
    /// One diagnosis after the other, each of the newest sequence, from the car's own tires as the identifier knows them.
    async fn diagnose_each(
        &self,
        mut sequences: watch::Receiver<Option<Arc<StateSequence>>>,
        tires: watch::Receiver<Option<Arc<TirePosterior>>>,
    ) {
        while sequences.changed().await.is_ok() {
            let Some(sequence) = sequences.borrow_and_update().clone() else { continue };
            let start = Instant::now();
            // A statement of its own: within the call the guard would be held across the await, and the next set to arrive would block
            // the node's only thread for good.
            let known = tires.borrow().clone();
            let result = self.diagnose(Arc::clone(&sequence), known).await;
            let mut last = match result {
                Ok(said) => self.publish(said, &sequence).await,
                Err(reason) => Last::Failed { reason },
            };
            if let Last::Failed { reason } = &mut last {
                tracing::error!("sequence {}: {reason}", sequence.sequence_id);
            }
            let mut facts = self.facts.borrow_mut();
            facts.last = last;
            facts.diagnoses += 1;
            facts.took_s = start.elapsed().as_secs_f64();
        }
    }

    async fn diagnose(
        &self,
        sequence: Arc<StateSequence>,
        posterior: Option<Arc<TirePosterior>>,
    ) -> Result<Said, String> {
        let (vehicle, without) = (Arc::clone(&self.vehicle), self.without.get());
        let compares = self.compare_with_first.get();
        // Who no longer asks, and asks again, begins anew.
        let first = self.first.borrow().clone().filter(|_| compares);
        let work = move || -> anyhow::Result<Said> {
            // As offline: what nothing measures is estimated; what contradicts itself stays, to be named.
            let usable = Usable::measured_or_estimated(&sequence, &vehicle)?;
            let request = Request {
                posterior: posterior.as_deref(),
                without: &without,
                ..Request::new(&usable.sequence, &vehicle)
            };
            said(&request, first, compares)
        };
        match tokio::task::spawn_blocking(work).await {
            Ok(result) => result.map_err(|error| format!("{error:#}")),
            Err(error) => Err(format!("the diagnosis ended abnormally: {error}")),
        }
    }

    async fn publish(&self, said: Said, sequence: &StateSequence) -> Last {
        let Said { diagnosis, since, first } = said;
        let hash = vehicle_hash(&self.vehicle);
        let folder = self.report_folder.get();
        let written = if folder.is_empty() {
            Ok(PathBuf::new())
        } else {
            let header = Header {
                car: self.vehicle.name.clone().unwrap_or_else(|| "car".to_owned()),
                bag: format!("live, sequence {}", sequence.sequence_id),
                data_stamp: stamp_text(sequence.start_stamp_ns),
                tool_version: env!("CARGO_PKG_VERSION").to_owned(),
                vehicle_hash: hash.clone(),
                seed: None,
                command: "gap_diagnosis".to_owned(),
            };
            let folder = PathBuf::from(folder);
            report::write(&folder, &diagnosis, since.as_ref(), &header, sequence.sequence_id)
        };
        *self.first.borrow_mut() = first;
        let directory = match written {
            Ok(directory) => directory.display().to_string(),
            Err(error) => {
                tracing::error!("report not written: {error:#}");
                String::new()
            }
        };
        let report = message::report(&diagnosis, since.as_ref(), sequence, &hash, directory);
        self.output.publish(&report).await;
        self.model.publish(&message::extended_model(&diagnosis, &report)).await;
        let because = diagnosis.reasons.first().cloned().unwrap_or_default();
        tracing::info!("sequence {}: {}: {because}", sequence.sequence_id, diagnosis.verdict.name());
        Last::Done { verdict: diagnosis.verdict.name(), because }
    }
}

/// Diagnoses a sequence, and compares it with the first one; where there is none yet, it may be the one.
fn said(request: &Request<'_>, first: Option<Arc<Earlier>>, compares: bool) -> anyhow::Result<Said> {
    let progress = &mut |step: &str| tracing::debug!("{step}");
    if compares && first.is_none() {
        match Earlier::diagnosed(request, progress) {
            Ok(first) => {
                let id = request.sequence.sequence_id;
                tracing::info!("sequence {id}: what later ones are compared with");
                let diagnosis = first.diagnosis.clone();
                return Ok(Said { diagnosis, since: None, first: Some(Arc::new(first)) });
            }
            // It cannot tell: what it lacks is said below, and the next one may be the first.
            Err(GapError::Earlier(_)) => {}
            Err(error) => return Err(error.into()),
        }
    }
    let diagnosis = diagnose(request, progress)?;
    let since = first.as_deref().map(|first| {
        // Tires from elsewhere are not asked for: the first sequence's own are what this one's are compared with.
        diagnose(&Request { earlier: Some(first), posterior: None, ..request.clone() }, progress)
    });
    let since = since.transpose().unwrap_or_else(|error| {
        tracing::warn!("not compared with the first sequence: {error}");
        None
    });
    Ok(Said { diagnosis, since, first })
}
