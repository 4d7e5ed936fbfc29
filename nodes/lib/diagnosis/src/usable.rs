//! Whether a recording can be diagnosed at all, and the answer where it cannot.

use gripsight_estimation::{Estimate, HORIZON_S, Split, split};
use gripsight_model::{ModelError, NEEDED_S, Recording};
use gripsight_signals::DataHealth;
use gripsight_vehicle::{OwnTires, PacejkaParameters};

use crate::outcome::{Diagnosis, GapBudget, Series, TirePair, Verdict, Where};
use crate::{ExtendedModelFile, GapError, Request};
use gripsight_model::noise::spread;

/// Held-out time that a score needs.
const LEAST_HELD_OUT_S: f64 = 3.0;

/// A recording that can be diagnosed.
#[derive(Debug, Clone)]
pub(crate) struct Usable {
    pub(crate) recording: Recording,
    pub(crate) windows: Split,
}

/// Prepares the recording and checks that something can be learned from it.
pub(crate) fn usable(request: &Request<'_>, health: &DataHealth) -> Result<Usable, GapError> {
    let recording = Recording::new(request.sequence)?;
    let here = request.held_out.is_none();
    let mut windows = split(&recording, here);
    if windows.held_out.duration_s(recording.dt_s()) < LEAST_HELD_OUT_S && here {
        windows = split(&recording, false);
    }
    let usable_s =
        windows.training.duration_s(recording.dt_s()) + windows.held_out.duration_s(recording.dt_s());
    if usable_s < NEEDED_S {
        return Err(GapError::Model(ModelError::TooLittle {
            usable_s,
            recorded_s: recording.recorded_s,
            needed_s: NEEDED_S,
            least_speed_mps: recording.least_speed_mps,
        }));
    }
    informative(&recording, health)?;
    Ok(Usable { recording, windows })
}

/// Whether an error means that the data, sound as they are, cannot tell.
pub(crate) fn cannot_tell(error: &GapError) -> bool {
    matches!(
        error,
        GapError::Model(ModelError::TooLittle { .. } | ModelError::TooCoarse { .. })
            | GapError::NoInformation { .. }
    )
}

/// The diagnosis of data that cannot tell.
pub(crate) fn refused(request: &Request<'_>, error: &GapError, data_health: DataHealth) -> Diagnosis {
    let next = match error {
        GapError::Model(ModelError::TooLittle { .. }) => {
            "a minute of driving without a stop, and without pauses in the recording"
        }
        GapError::Model(ModelError::TooCoarse { .. }) => "odometry and steering at 50 Hz or more",
        _ => {
            "corners to both sides, up to half of the grip or more, with v_y, yaw rate and steering recorded"
        }
    };
    let effective = request.tires.unwrap_or(PacejkaParameters::from_array([f64::NAN; 8]));
    let tires = request.given_tires().unwrap_or(OwnTires::from_parameters(&[f64::NAN; 8]));
    let unknown = Estimate::UNKNOWN;
    Diagnosis {
        verdict: Verdict::NotIdentifiable,
        reasons: vec![error.to_string()],
        effects: Vec::new(),
        sites: Vec::new(),
        changes: Vec::new(),
        drives: Vec::new(),
        invisible: Vec::new(),
        detection_limits: Vec::new(),
        figures: Vec::new(),
        places: Where::default(),
        identities: Vec::new(),
        gap: GapBudget {
            nominal: unknown,
            retuned: unknown,
            steps: Vec::new(),
            after: unknown,
            unstructured_ceiling: unknown,
            s4_residual: unknown,
            noise_floor: unknown,
            horizon_s: HORIZON_S,
            channel_noise: std::collections::BTreeMap::new(),
            scored_on: "nothing",
        },
        gap_closed_fraction: unknown,
        tires: TirePair { without_effect: effective, with_effect: effective },
        extended_model: request.model.cloned().unwrap_or_else(|| ExtendedModelFile::of_tires(tires)),
        data_health,
        drive_next: vec![next.to_owned()],
        inference: None,
        series: Series::default(),
    }
}

/// Refuses recordings in which nothing happens.
fn informative(recording: &Recording, health: &DataHealth) -> Result<(), GapError> {
    const LEAST_STEERING_RAD: f64 = 2e-3;
    const LEAST_A_Y_MPS2: f64 = 0.4;
    const LEAST_V_Y_MPS: f64 = 1e-5;
    const MOST_FROZEN: f64 = 0.5;
    let rms = |values: &mut dyn Iterator<Item = f64>| {
        let (n, s) = values.fold((0.0_f64, 0.0_f64), |(n, s), v| (n + 1.0, s + v * v));
        if n > 0.0 { f64::sqrt(s / n) } else { 0.0 }
    };
    let steering = rms(&mut recording.runs.iter().flat_map(|r| r.steering_rad.iter().copied()));
    let a_y = rms(&mut recording
        .runs
        .iter()
        .flat_map(|r| r.v_x_mps.iter().zip(&r.measured[1]).map(|(v, w)| v * w)));
    if a_y < LEAST_A_Y_MPS2 || steering < LEAST_STEERING_RAD {
        return Err(GapError::NoInformation {
            what: "cornering",
            detail: format!(
                "RMS lateral acceleration {a_y:.2} m/s2 (at least {LEAST_A_Y_MPS2} needed), RMS steering {steering:.4} rad (at least {LEAST_STEERING_RAD})"
            ),
        });
    }
    if spread(&recording.runs, 0, false) < LEAST_V_Y_MPS {
        return Err(GapError::NoInformation {
            what: "v_y",
            detail: "the odometry's lateral velocity never changes: its estimator does not provide it"
                .to_owned(),
        });
    }
    for what in ["v_y_mps", "yaw_rate_radps"] {
        let frozen_s: f64 =
            health.frozen.iter().filter(|f| f.channel == what).map(|f| f.to_s - f.from_s).sum();
        if frozen_s > MOST_FROZEN * health.duration_s {
            return Err(GapError::NoInformation {
                what,
                detail: format!("it stands still for {frozen_s:.1} s of {:.1} s", health.duration_s),
            });
        }
    }
    Ok(())
}
