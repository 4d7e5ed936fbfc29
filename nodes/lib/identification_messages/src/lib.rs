//! Identification's types as messages and back: candidates, residual models, outcomes. Numbers survive bit for bit.

mod longitudinal;

use gripsight_identification::{
    Candidate, DriveNext, Estimate, FrictionPrior, INPUTS, IdentificationError, LiveSample, Longitudinal,
    OUTPUTS, Outcome, PeakFriction, Range, ResidualKind, ResidualModel, RunKey, SignalCorrections, Status,
};
use gripsight_msgs as msg;
use gripsight_vehicle::{
    MagicFormula, PacejkaParameters, PosteriorParameter, TirePosterior, VehicleError, VehicleParameters,
};

/// The key of a run as a message.
#[must_use]
pub fn handshake(key: &RunKey) -> msg::Handshake {
    msg::Handshake {
        run_id: key.run_id.clone(),
        sequence_id: key.sequence_id,
        iteration: key.iteration,
        vehicle_hash: key.vehicle_hash.clone(),
        seed: key.seed,
    }
}

/// What to drive next as messages.
#[must_use]
pub fn drive_next(next: &[DriveNext]) -> Vec<msg::DriveNext> {
    let message = |next: &DriveNext| msg::DriveNext {
        manoeuvre: next.manoeuvre.name().to_owned(),
        v_x_mps: next.v_x_mps.unwrap_or(f64::NAN),
        a_y_mps2: next.a_y_mps2.unwrap_or(f64::NAN),
        why: next.why.clone(),
    };
    next.iter().map(message).collect()
}

/// The inverse of [`handshake`].
#[must_use]
pub fn run_key(handshake: &msg::Handshake) -> RunKey {
    RunKey {
        run_id: handshake.run_id.clone(),
        sequence_id: handshake.sequence_id,
        iteration: handshake.iteration,
        vehicle_hash: handshake.vehicle_hash.clone(),
        seed: handshake.seed,
    }
}

/// A candidate that asks for its residual model: status PROPOSED. What only an outcome knows is NaN.
#[must_use]
pub fn proposed(candidate: &Candidate, vehicle: &VehicleParameters) -> msg::PacejkaParams {
    let unknown = msg::Interval { value: f64::NAN, low: f64::NAN, high: f64::NAN };
    let nowhere = msg::Range { low: f64::NAN, high: f64::NAN };
    let peak = msg::PeakFriction { friction: unknown, reached: false, from_prior: false };
    msg::PacejkaParams {
        header: msg::standard::std_msgs::Header::default(),
        handshake: handshake(&candidate.key),
        status: msg::PacejkaParams::PROPOSED,
        reason: String::new(),
        front: formula(&candidate.phi_p.front),
        rear: formula(&candidate.phi_p.rear),
        front_load_n: vehicle.static_load_front_n(),
        rear_load_n: vehicle.static_load_rear_n(),
        front_cornering_stiffness_n_per_rad: unknown,
        rear_cornering_stiffness_n_per_rad: unknown,
        front_peak: peak,
        rear_peak: peak,
        front_slip_rad: nowhere,
        rear_slip_rad: nowhere,
        front_valid_slip_rad: f64::NAN,
        rear_valid_slip_rad: f64::NAN,
        front_valid_force_n: f64::NAN,
        rear_valid_force_n: f64::NAN,
        signals: signals(&candidate.corrections),
        v_x_mean_mps: candidate.mean_speed_mps,
        longitudinal: longitudinal::message(&Longitudinal::default()),
    }
}

/// The candidate of a message with status PROPOSED; `None` for any other status.
#[must_use]
pub fn candidate(message: &msg::PacejkaParams) -> Option<Candidate> {
    (message.status == msg::PacejkaParams::PROPOSED).then(|| Candidate {
        key: run_key(&message.handshake),
        phi_p: PacejkaParameters { front: axle(&message.front), rear: axle(&message.rear) },
        corrections: corrections(&message.signals),
        mean_speed_mps: message.v_x_mean_mps,
    })
}

/// A status as its message's constant.
#[must_use]
pub fn status(status: Status) -> u8 {
    match status {
        Status::Accepted => msg::PacejkaParams::ACCEPTED,
        Status::AcceptedWithin => msg::PacejkaParams::ACCEPTED_WITHIN,
        Status::Provisional => msg::PacejkaParams::PROVISIONAL,
        Status::Rejected => msg::PacejkaParams::REJECTED,
    }
}

/// The set with the friction prior beside the result of a run: status PROVISIONAL; `None` where the prior has no say.
#[must_use]
pub fn provisional(outcome: &Outcome) -> Option<msg::PacejkaParams> {
    let set = outcome.provisional.as_ref()?;
    Some(msg::PacejkaParams {
        status: msg::PacejkaParams::PROVISIONAL,
        front: formula(&set.phi_p.front),
        rear: formula(&set.phi_p.rear),
        front_peak: peak_friction(&set.peak_friction.front),
        rear_peak: peak_friction(&set.peak_friction.rear),
        front_valid_slip_rad: f64::NAN,
        rear_valid_slip_rad: f64::NAN,
        front_valid_force_n: f64::NAN,
        rear_valid_force_n: f64::NAN,
        ..result(outcome)
    })
}

/// A set that was published and must not be used any longer: status WITHDRAWN, with the reason.
#[must_use]
pub fn withdrawn(published: &msg::PacejkaParams, reason: String) -> msg::PacejkaParams {
    msg::PacejkaParams { status: msg::PacejkaParams::WITHDRAWN, reason, ..published.clone() }
}

/// The end of a run, the reasons joined.
#[must_use]
pub fn result(outcome: &Outcome) -> msg::PacejkaParams {
    let (k, peak, slip) =
        (&outcome.cornering_stiffness_n_per_rad, &outcome.peak_friction, &outcome.slip_range_rad);
    let valid = &outcome.valid_within;
    msg::PacejkaParams {
        header: msg::standard::std_msgs::Header::default(),
        handshake: handshake(&outcome.key),
        status: status(outcome.status),
        reason: outcome.reasons.join("; "),
        front: formula(&outcome.phi_p.front),
        rear: formula(&outcome.phi_p.rear),
        front_load_n: outcome.vehicle.static_load_front_n(),
        rear_load_n: outcome.vehicle.static_load_rear_n(),
        front_cornering_stiffness_n_per_rad: interval(&k.front),
        rear_cornering_stiffness_n_per_rad: interval(&k.rear),
        front_peak: peak_friction(&peak.front),
        rear_peak: peak_friction(&peak.rear),
        front_slip_rad: range(&slip.front),
        rear_slip_rad: range(&slip.rear),
        front_valid_slip_rad: valid.slip_rad.front,
        rear_valid_slip_rad: valid.slip_rad.rear,
        front_valid_force_n: valid.force_n.front,
        rear_valid_force_n: valid.force_n.rear,
        signals: signals(&outcome.signals),
        v_x_mean_mps: outcome.mean_speed_mps,
        longitudinal: longitudinal::message(&outcome.longitudinal),
    }
}

/// The car's own tires beside a run.
#[must_use]
pub fn tire_posterior(posterior: &TirePosterior, key: &RunKey) -> msg::TirePosterior {
    let parameters = &posterior.parameters;
    msg::TirePosterior {
        header: msg::standard::std_msgs::Header::default(),
        handshake: handshake(key),
        status: posterior.status.clone(),
        names: parameters.iter().map(|p| p.name.clone()).collect(),
        units: parameters.iter().map(|p| p.unit.clone()).collect(),
        mean: parameters.iter().map(|p| p.mean).collect(),
        covariance: posterior.covariance.concat(),
        data: posterior.data.clone(),
    }
}

/// The inverse of [`tire_posterior`].
///
/// # Errors
/// [`VehicleError::Posterior`] says what of the message is not whole.
pub fn own_tires(message: &msg::TirePosterior) -> Result<TirePosterior, VehicleError> {
    let n = message.names.len();
    if message.units.len() != n || message.mean.len() != n || message.covariance.len() != n * n {
        return Err(VehicleError::Posterior(
            "names, units, mean and covariance do not fit together".to_owned(),
        ));
    }
    let parameter = |i: usize| PosteriorParameter {
        name: message.names[i].clone(),
        unit: message.units[i].clone(),
        mean: message.mean[i],
    };
    let posterior = TirePosterior {
        status: message.status.clone(),
        vehicle_hash: message.handshake.vehicle_hash.clone(),
        parameters: (0..n).map(parameter).collect(),
        covariance: (0..n).map(|i| message.covariance[i * n..(i + 1) * n].to_vec()).collect(),
        data: message.data.clone(),
    };
    posterior.checked()
}

/// A residual model as a message; `training_time_s` is what the sender's clock took.
#[must_use]
pub fn residual_model(model: &ResidualModel, training_time_s: f64) -> msg::ResidualModel {
    msg::ResidualModel {
        header: msg::standard::std_msgs::Header::default(),
        handshake: handshake(&model.key),
        front: formula(&model.phi_p.front),
        rear: formula(&model.phi_p.rear),
        architecture: model.architecture.name().to_owned(),
        d_model: model.d_model as u32,
        d_state: model.d_state as u32,
        layers: model.layers as u32,
        dt_s: model.dt_s,
        horizon: model.horizon as u32,
        inputs: INPUTS.map(str::to_owned).to_vec(),
        input_mean: model.input_mean.clone(),
        input_scale: model.input_scale.clone(),
        outputs: OUTPUTS.map(str::to_owned).to_vec(),
        output_scale: model.output_scale.clone(),
        weights: model.weights.clone(),
        front_slip_rad: range(&model.slip_range_rad.front),
        rear_slip_rad: range(&model.slip_range_rad.rear),
        v_x_mps: range(&model.v_x_range_mps),
        epochs: model.epochs as u32,
        samples: model.samples as u32,
        training_loss: model.training_loss,
        validation_loss: model.validation_loss,
        training_time_s,
    }
}

/// The inverse of [`residual_model`].
///
/// # Errors
/// [`IdentificationError::Unknown`] for an architecture, inputs or outputs that this version does not know.
pub fn learned_model(message: &msg::ResidualModel) -> Result<ResidualModel, IdentificationError> {
    let unknown = |what, got: String| IdentificationError::Unknown { what, got };
    let architecture = ResidualKind::from_name(&message.architecture)
        .ok_or_else(|| unknown("architecture", message.architecture.clone()))?;
    for (what, got, expected) in
        [("inputs", &message.inputs, &INPUTS[..]), ("outputs", &message.outputs, &OUTPUTS[..])]
    {
        if got != expected {
            return Err(unknown(what, got.join(", ")));
        }
    }
    let back = |r: &msg::Range| Range { low: r.low, high: r.high };
    Ok(ResidualModel {
        key: run_key(&message.handshake),
        phi_p: PacejkaParameters { front: axle(&message.front), rear: axle(&message.rear) },
        architecture,
        d_model: message.d_model as usize,
        d_state: message.d_state as usize,
        layers: message.layers as usize,
        dt_s: message.dt_s,
        horizon: message.horizon as usize,
        input_mean: message.input_mean.clone(),
        input_scale: message.input_scale.clone(),
        output_scale: message.output_scale.clone(),
        weights: message.weights.clone(),
        slip_range_rad: gripsight_identification::PerAxle {
            front: back(&message.front_slip_rad),
            rear: back(&message.rear_slip_rad),
        },
        v_x_range_mps: back(&message.v_x_mps),
        epochs: message.epochs as usize,
        samples: message.samples as usize,
        training_loss: message.training_loss,
        validation_loss: message.validation_loss,
    })
}

/// The live residual of a sample, by the model that answers `key`; its stamp is left to the sender.
#[must_use]
pub fn live_residual(live: &LiveSample, key: &RunKey) -> msg::Residual {
    msg::Residual {
        header: msg::standard::std_msgs::Header::default(),
        handshake: handshake(key),
        dt_s: live.dt_s,
        v_y_nominal_mps: live.nominal[0],
        yaw_rate_nominal_radps: live.nominal[1],
        v_y_corrected_mps: live.corrected[0],
        yaw_rate_corrected_radps: live.corrected[1],
        front_slip_rad: live.slip_rad.front,
        rear_slip_rad: live.slip_rad.rear,
        extrapolated: live.extrapolated,
    }
}

/// The friction of a prior that may be used; `None` where the sender says that it may not.
#[must_use]
pub fn friction_prior(message: &msg::FrictionPrior) -> Option<FrictionPrior> {
    message.valid.then_some(FrictionPrior { mu: message.mu, sigma: message.sigma })
}

fn formula(f: &MagicFormula) -> msg::MagicFormula {
    msg::MagicFormula { b: f.b, c: f.c, d: f.d, e: f.e }
}

fn axle(f: &msg::MagicFormula) -> MagicFormula {
    MagicFormula { b: f.b, c: f.c, d: f.d, e: f.e }
}

fn interval(e: &Estimate) -> msg::Interval {
    msg::Interval { value: e.value, low: e.low, high: e.high }
}

fn range(r: &Range) -> msg::Range {
    msg::Range { low: r.low, high: r.high }
}

fn peak_friction(p: &PeakFriction) -> msg::PeakFriction {
    msg::PeakFriction {
        friction: msg::Interval { value: p.value, low: p.low, high: p.high },
        reached: p.reached,
        from_prior: p.from_prior,
    }
}

fn signals(c: &SignalCorrections) -> msg::SignalCorrections {
    msg::SignalCorrections {
        steering_delay_s: c.steering_delay_s,
        steering_gain: c.steering_gain,
        steering_offset_rad: c.steering_offset_rad,
        v_y_lever_arm_m: c.v_y_lever_arm_m,
        v_y_bias_mps: c.v_y_bias_mps,
        yaw_rate_bias_radps: c.yaw_rate_bias_radps,
    }
}

fn corrections(c: &msg::SignalCorrections) -> SignalCorrections {
    SignalCorrections {
        steering_delay_s: c.steering_delay_s,
        steering_gain: c.steering_gain,
        steering_offset_rad: c.steering_offset_rad,
        v_y_lever_arm_m: c.v_y_lever_arm_m,
        v_y_bias_mps: c.v_y_bias_mps,
        yaw_rate_bias_radps: c.yaw_rate_bias_radps,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gripsight_identification::PerAxle;
    use gripsight_vehicle::OwnTires;

    fn key() -> RunKey {
        RunKey {
            run_id: "a".into(),
            sequence_id: 7,
            iteration: 2,
            vehicle_hash: "0123456789abcdef".into(),
            seed: 5,
        }
    }

    fn tires() -> PacejkaParameters {
        PacejkaParameters::from_array([0.1, 1.0 / 3.0, 0.51, -0.7, 5.1, 1.3, 1.1, 0.2])
    }

    #[test]
    fn a_candidate_survives_its_message() {
        let sent = Candidate {
            key: key(),
            phi_p: tires(),
            corrections: SignalCorrections::from_array([0.1, 0.9, 1e-3, -0.2, 1.0 / 7.0, 3e-17]),
            mean_speed_mps: 10.0 / 3.0,
        };
        let message = proposed(&sent, &VehicleParameters::f1tenth());
        assert_eq!(candidate(&message), Some(sent));
        let other = msg::PacejkaParams { status: msg::PacejkaParams::ACCEPTED, ..message };
        assert_eq!(candidate(&other), None);
    }

    #[test]
    fn the_car_s_own_tires_survive_their_message_and_half_of_them_are_refused() {
        let parameters = PosteriorParameter::of_tires(&OwnTires::assumed(&tires()));
        let n = parameters.len();
        let row = |i: usize| (0..n).map(|j| 1.0 / (3.0 + i as f64 + 2.0 * j as f64)).collect();
        let sent = TirePosterior {
            status: "accepted_within".into(),
            vehicle_hash: key().vehicle_hash,
            covariance: (0..n).map(row).collect(),
            parameters,
            data: vec!["00ff".into()],
        };
        let message = tire_posterior(&sent, &key());
        assert_eq!(own_tires(&message).unwrap(), sent);
        let broken = |change: &dyn Fn(&mut msg::TirePosterior)| {
            let mut bad = message.clone();
            change(&mut bad);
            own_tires(&bad).unwrap_err().to_string()
        };
        assert!(broken(&|m| m.covariance.truncate(3)).contains("do not fit together"));
        assert!(broken(&|m| m.mean[2] = f64::NAN).contains("not a finite number"));
        assert!(broken(&|m| m.names[7].push('x')).contains("`rear.e` is missing"));
    }

    #[test]
    fn a_residual_model_survives_its_message_and_a_foreign_one_is_refused() {
        let side = Range { low: -0.1, high: 0.2 };
        let sent = ResidualModel {
            key: key(),
            phi_p: tires(),
            architecture: ResidualKind::S4,
            d_model: 2,
            d_state: 4,
            layers: 1,
            dt_s: 0.01,
            horizon: 10,
            input_mean: vec![1.0 / 3.0; 4],
            input_scale: vec![2.0; 4],
            output_scale: vec![1e-3; 2],
            weights: vec![f64::MIN_POSITIVE, -0.0, 1.0 / 3.0],
            slip_range_rad: PerAxle { front: side, rear: side },
            v_x_range_mps: Range { low: 1.0, high: 2.0 },
            epochs: 3,
            samples: 4,
            training_loss: 0.5,
            validation_loss: 0.6,
        };
        let message = residual_model(&sent, 0.1);
        assert_eq!(learned_model(&message).unwrap(), sent);
        assert!(
            learned_model(&msg::ResidualModel { architecture: "gru".into(), ..message.clone() }).is_err()
        );
        assert!(learned_model(&msg::ResidualModel { inputs: vec!["v_x_mps".into()], ..message }).is_err());
    }
}
