//! The graded answer: how likely something is the matter at each site, which mechanism it is, how large; and what has changed between two
//! drives, whatever either leaves unexplained.
//!
//! It stands beside the verdict and does not decide it: its probabilities are those of the library and the free terms of each site under one
//! noise model, and are not calibrated on sealed cases yet. On development cases of the reference car it names hardly anything that is not there,
//! but misses the smaller one of two effects more often than the search does, and its intervals are too narrow for large effects, which the
//! last linearisation is too far from.

use std::collections::BTreeMap;

use gripsight_estimation::{Estimate, Windows};
use gripsight_model::{Flexible, Recording, Site};
use gripsight_signals::{DataHealth, StateSequence};
use serde::Serialize;

use crate::budget::{Scorer, large_slip_rad};
use crate::changes::compare;
use crate::diagnose::{SEARCH_WINDOWS, fit_tires, library};
use crate::engine::Engine;
use crate::finding::{mechanisms, sites};
use crate::infer::{Inferred, infer, linearised};
use crate::outcome::EffectParameter;
use crate::state::State;
use crate::trust::TireTrust;
use crate::usable::{Usable, usable};
use crate::{GapError, Request};

/// A mechanism that may be at work at a site.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MechanismAnswer {
    /// Canonical name of the effect.
    pub name: &'static str,
    /// Probability that it matters.
    pub probability: f64,
}

/// What the data say of one site.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SiteAnswer {
    /// Canonical name of the site.
    pub name: &'static str,
    /// Probability that something is the matter there.
    pub probability: f64,
    /// What the site closes of what all effects and flexible terms together do, on the windows that were fitted.
    pub closed_fraction: Estimate,
    /// Which of the library's effects, the likeliest first.
    pub mechanisms: Vec<MechanismAnswer>,
    /// Probability that something is the matter there that no effect of the library does.
    pub other_probability: f64,
    /// Share of [`Self::closed_fraction`] that no effect of the library closes.
    pub unexplained_fraction: f64,
}

/// An effect with its size, were it at work.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SizedEffect {
    /// Canonical name.
    pub name: &'static str,
    /// Probability that it matters.
    pub probability: f64,
    /// Whether it is stated as a cause: more likely than not, needed on data held out, and not small beside what looks like it and no effect of
    /// the library does.
    pub accepted: bool,
    /// Share of the error on data held out, noise included, that is left without it and that it closes; unknown (`null`) where it is not in the
    /// model.
    pub needed_fraction: f64,
    /// Sizes by name, with 90 % intervals.
    pub parameters: BTreeMap<&'static str, EffectParameter>,
    /// Effects that are there where it is not.
    pub confused_with: Vec<&'static str>,
}

/// A difference between two drives of one car.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Change {
    /// Canonical name of the site.
    pub site: &'static str,
    /// Canonical name of the effect; `tires`; or `other` for what no effect of the library does.
    pub name: &'static str,
    /// The later drive less the earlier one, of the first parameter, with its 90 % interval; unknown (`null`) of tires and `other`.
    pub difference: EffectParameter,
    /// Probability that it has changed.
    pub probability: f64,
}

/// The graded answer.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Graded {
    /// Site by site, the likeliest first.
    pub sites: Vec<SiteAnswer>,
    /// Effect by effect, the likeliest first.
    pub mechanisms: Vec<SizedEffect>,
    /// What has changed since the earlier drive, the likeliest first; empty without one.
    pub changes: Vec<Change>,
    /// How often everything was linearised.
    pub rounds: usize,
    /// How many times less the errors tell than if they were independent.
    pub dispersion: f64,
}

/// Gives the graded answer for a recording, and with `earlier` what has changed since. `progress` is told what is being done.
///
/// # Errors
/// [`GapError`] says what is wrong with the data, the car or the request, or that the data cannot tell.
pub fn graded(
    request: &Request<'_>,
    earlier: Option<&StateSequence>,
    progress: &mut dyn FnMut(&str),
) -> Result<Graded, GapError> {
    let Some(earlier) = earlier else {
        let usable = prepared(request)?;
        let recording = &usable.recording;
        let fitted = alone(request, &usable, None, progress)?;
        return Ok(Graded {
            sites: sites(&fitted),
            mechanisms: mechanisms(recording, request.vehicle, &fitted),
            changes: Vec::new(),
            rounds: fitted.rounds,
            dispersion: fitted.dispersion,
        });
    };
    let before = Request { sequence: earlier, held_out: None, ..request.clone() };
    let [first, second] = [prepared(&before)?, prepared(request)?];
    let [one, two] = [&first.recording, &second.recording];
    if one.channels != two.channels || one.has_command != two.has_command {
        return Err(GapError::Earlier("the two drives do not record the same signals".to_owned()));
    }
    let fitted = alone(&before, &first, None, progress)?;
    progress("comparing the drives");
    let later = alone(request, &second, Some(&fitted), progress)?;
    let compared =
        compare(&Engine::new(one, request.vehicle, fitted.tires, TireTrust::drive()), &fitted, &later)
            .ok_or(GapError::NotFinite)?;
    Ok(Graded {
        sites: sites(&later),
        mechanisms: mechanisms(two, request.vehicle, &later),
        changes: compared.changes(&fitted),
        rounds: fitted.rounds,
        dispersion: fitted.dispersion,
    })
}

fn prepared(request: &Request<'_>) -> Result<Usable, GapError> {
    usable(request, &DataHealth::of(request.sequence)?)
}

/// The inference on one drive; with another drive's, in its columns and around its model.
fn alone(
    request: &Request<'_>,
    usable: &Usable,
    like: Option<&Inferred>,
    progress: &mut dyn FnMut(&str),
) -> Result<Inferred, GapError> {
    let Usable { recording, windows: split } = usable;
    let tires = match (like, request.given_tires()) {
        (Some(like), _) => like.tires,
        (None, Some(tires)) => tires,
        (None, None) => fit_tires(recording, request.vehicle, &split.training)?,
    };
    let trust =
        if like.is_some() || request.given_tires().is_some() { TireTrust::file() } else { TireTrust::free() };
    let mut engine = Engine::new(recording, request.vehicle, tires, trust);
    let windows = split.training.thinned(SEARCH_WINDOWS);
    let null = fitted_null(&engine, &windows)?;
    let found = if let Some(like) = like {
        linearised(&mut engine, &null, like, &windows)
    } else {
        let (library, _) = library(request, recording, trust != TireTrust::free())?;
        let slip_rad = large_slip_rad(&engine, &null, &windows);
        let flexible = Flexible::by_site(recording, slip_rad, request.vehicle.wheelbase_m(), &Site::ALL);
        let other = request.held_out.map(|h| Recording::beside(h, Some(recording))).transpose()?;
        let scorer = Scorer::new(&engine.clone(), other.as_ref(), split);
        infer(&mut engine, &null, &library, flexible, &windows, &scorer, progress)
    };
    found.ok_or(GapError::NotFinite)
}

/// Tires and background fitted, nothing else.
fn fitted_null(engine: &Engine<'_>, windows: &Windows) -> Result<State, GapError> {
    const STEPS: usize = 30;
    let null = engine.look(&[], &engine.blank(), None, windows, STEPS);
    if null.finite { Ok(null) } else { Err(GapError::NotFinite) }
}
