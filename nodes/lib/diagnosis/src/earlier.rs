//! A drive from before: what a later one of the same car is compared with.

use crate::budget::large_slip_rad;
use crate::engine::Engine;
use crate::outcome::Diagnosis;
use crate::rooms::Left;
use crate::trust::TireTrust;
use crate::{GapError, Request, Verdict, diagnose};
use gripsight_estimation::{Windows, split};
use gripsight_model::Recording;

/// A drive from before with its own diagnosis. A later drive is compared with all that was found in it: tires, effects, and what they left.
#[derive(Debug, Clone)]
pub struct Earlier {
    /// What it was explained with.
    pub diagnosis: Diagnosis,
    recording: Recording,
    windows: Windows,
}

impl Earlier {
    /// Diagnoses the drive from before; `request` as of a drive of its own. `progress` as of [`diagnose`].
    ///
    /// # Errors
    /// Those of [`diagnose`], and [`GapError::Earlier`] where its data cannot tell.
    pub fn diagnosed(request: &Request<'_>, progress: &mut dyn FnMut(&str)) -> Result<Self, GapError> {
        let diagnosis = diagnose(request, progress)?;
        if diagnosis.verdict == Verdict::NotIdentifiable {
            return Err(GapError::Earlier(diagnosis.reasons.join("; ")));
        }
        let recording = Recording::new(request.sequence)?;
        let windows = split(&recording, false).training.thinned(WINDOWS);
        Ok(Self { diagnosis, recording, windows })
    }

    /// What it was explained with, in words.
    pub(crate) fn text(&self) -> String {
        let named: Vec<&str> = self.diagnosis.effects.iter().filter(|e| e.accepted).map(|e| e.name).collect();
        let of = if named.is_empty() { "tires alone".to_owned() } else { named.join(", ") };
        format!("the drive before is explained by {of}, left as they were but for what is named here")
    }

    /// What its model leaves of it, room by room.
    pub(crate) fn left(&self, request: &Request<'_>) -> Result<Left, GapError> {
        let model = &self.diagnosis.extended_model;
        let mut engine = Engine::new(&self.recording, request.vehicle, model.tires, TireTrust::drive());
        (engine.held, engine.usual) = model.parameters()?;
        let state = engine.look(&[], &engine.blank(), None, &self.windows, ITERATIONS);
        let slip_rad = large_slip_rad(&engine, &state, &self.windows);
        Ok(Left::by(&engine, &state, &self.windows, slip_rad))
    }
}

/// Windows that its model is looked at on, at most, and iterations of the fit of their starts.
const WINDOWS: usize = 70;
const ITERATIONS: usize = 10;
