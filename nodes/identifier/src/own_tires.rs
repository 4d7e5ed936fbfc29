//! The car's own tires beside each run: for the diagnosis, which needs them with their load transfer, combined slip and relaxation.

use std::sync::Arc;

use gripsight_diagnosis::own_tires;
use gripsight_identification::{Outcome, Usable};
use gripsight_signals::StateSequence;
use gripsight_vehicle::{TirePosterior, VehicleParameters};
use tokio::sync::watch;

use crate::outputs::Outputs;

/// A run that ended, and what it ran on.
pub(crate) type Ended = Option<(Arc<StateSequence>, Arc<Outcome>)>;

/// Fits them to the sequence of the newest run and publishes them, beside the next run: the MPC's set never waits for them.
pub(crate) async fn publish_each(
    mut runs: watch::Receiver<Ended>,
    vehicle: &Arc<VehicleParameters>,
    outputs: &Outputs,
) {
    while runs.changed().await.is_ok() {
        let Some((sequence, outcome)) = runs.borrow_and_update().clone() else { continue };
        let (of, run, car) = (Arc::clone(&sequence), Arc::clone(&outcome), Arc::clone(vehicle));
        match tokio::task::spawn_blocking(move || fitted(&of, &run, &car)).await {
            Ok(Ok(tires)) => outputs.own_tires(&tires, &outcome.key, &sequence).await,
            Ok(Err(reason)) => tracing::warn!("sequence {}: no own tires: {reason}", sequence.sequence_id),
            Err(error) => tracing::error!("the fit of the own tires ended abnormally: {error}"),
        }
    }
}

fn fitted(
    sequence: &StateSequence,
    outcome: &Outcome,
    vehicle: &VehicleParameters,
) -> Result<TirePosterior, String> {
    let usable = Usable::measured_or_estimated(sequence, vehicle).map_err(|error| error.to_string())?;
    // A set that may be used is near the car's own tires.
    let start = outcome.accepted.then_some(outcome.phi_p);
    let beside = (outcome.status.name(), outcome.key.vehicle_hash.as_str());
    own_tires(&usable.sequence, vehicle, start, beside).map_err(|error| error.to_string())
}
