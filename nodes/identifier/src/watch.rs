//! The set in use against what the car does, sample by sample.

use std::cell::RefCell;

use gripsight_bag::encode;
use gripsight_identification::{AcceptedSet, GripLook, GripWatch};
use gripsight_identification_messages as messages;
use gripsight_msgs::standard::std_msgs::Header;
use gripsight_msgs::{Grip, PacejkaParams};
use gripsight_signals::{AlignConfig, Aligner, Measurement, NS_PER_S, SignalError};
use gripsight_vehicle::VehicleParameters;

use crate::outputs::Outputs;

/// A stamp that goes back further than this means that the clock was set back; less is one late message.
const CLOCK_JUMP_S: f64 = 1.0;
/// Where nothing is wrong the grip is published this often.
const EVERY_S: f64 = 1.0;

/// The set that the MPC has.
#[derive(Debug, Clone)]
pub(crate) struct InForce {
    pub(crate) set: AcceptedSet,
    /// As it was published.
    pub(crate) message: PacejkaParams,
    /// Whether it was withdrawn since.
    pub(crate) withdrawn: bool,
}

/// Watches the set in force, whichever it is.
pub(crate) struct Watch {
    aligner: Aligner,
    watch: Option<GripWatch>,
    next_ns: i64,
}

impl Watch {
    pub(crate) fn new() -> Self {
        Self { aligner: Aligner::new(AlignConfig::default()), watch: None, next_ns: i64::MIN }
    }

    /// Takes a message of the car; publishes the grip, and withdraws the set that it no longer holds.
    pub(crate) async fn take(
        &mut self,
        measurement: Measurement,
        vehicle: &VehicleParameters,
        in_force: &RefCell<Option<InForce>>,
        outputs: &Outputs,
    ) {
        if let Err(SignalError::StampWentBack { back_s, .. }) = self.aligner.push(measurement)
            && back_s > CLOCK_JUMP_S
        {
            *self = Self::new();
        }
        self.follow(vehicle, in_force);
        while let Some(sample) = self.aligner.poll() {
            let Some(look) = self.watch.as_mut().and_then(|watch| watch.push(&sample)) else { continue };
            let (withdraws, message) = {
                let in_force = in_force.borrow();
                let Some(in_force) = in_force.as_ref() else { continue };
                (look.fallen && !in_force.withdrawn, grip(&look, in_force))
            };
            if withdraws || look.stamp_ns >= self.next_ns {
                self.next_ns = look.stamp_ns + (EVERY_S * NS_PER_S) as i64;
                outputs.grip(&message).await;
            }
            if withdraws {
                tracing::warn!("{}", message.text);
                withdraw(in_force, message.text, outputs).await;
            }
        }
    }

    /// Goes over to the set in force where it is another one.
    fn follow(&mut self, vehicle: &VehicleParameters, in_force: &RefCell<Option<InForce>>) {
        let in_force = in_force.borrow();
        let Some(InForce { set, .. }) = in_force.as_ref() else { return };
        if self.watch.as_ref().is_none_or(|watch| watch.set() != set) {
            match GripWatch::new(vehicle, set) {
                Ok(watch) => self.watch = Some(watch),
                Err(error) => tracing::error!("the grip is not watched: {error}"),
            }
        }
    }
}

/// Tells the MPC that the set in force must not be used any longer.
pub(crate) async fn withdraw(in_force: &RefCell<Option<InForce>>, reason: String, outputs: &Outputs) {
    let message = in_force.borrow_mut().as_mut().map(|in_force| {
        in_force.withdrawn = true;
        messages::withdrawn(&in_force.message, reason)
    });
    if let Some(message) = message {
        outputs.publish(&message).await;
    }
}

fn grip(look: &GripLook, in_force: &InForce) -> Grip {
    let text = if look.fallen {
        format!(
            "grip has fallen: the car gives {:.0} % of the {:.1} m/s2 that the set of sequence {} promises",
            100.0 * look.share,
            look.promised_mps2.abs(),
            in_force.set.sequence_id
        )
    } else if look.share.is_nan() {
        "too little force is asked for to tell the grip".to_owned()
    } else {
        "as promised".to_owned()
    };
    Grip {
        header: Header { stamp: encode::time(look.stamp_ns), frame_id: String::new() },
        handshake: in_force.message.handshake.clone(),
        fallen: look.fallen,
        share: look.share,
        promised_mps2: look.promised_mps2,
        text,
    }
}
