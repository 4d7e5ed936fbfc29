//! The whole question: which differences make the simulator unlike the car, how large, and how much they close.

use std::collections::BTreeMap;
use std::time::Instant;

use gripsight_signals::{DataHealth, StateSequence};

use crate::budget::{Scored, places, series};
use crate::candidates::{Candidate, Kind, Wrapped};
use crate::file::ForwardSpeed;
use crate::fit::Fitter;
use crate::linear::window_squares;
use crate::outcome::{
    Estimate, GapBudget, GapStep, Invisible, Mechanism, MissingTerm, RankedEffect, Reason,
    SimulatorDiagnosis, SimulatorUse, Site, Sized, UnitError, Verdict,
};
use crate::search::Found;
use crate::{Channel, Commands, Drive, Model, Roll, SimulatorError, SimulatorFile, WINDOW_S, candidates};

/// Share of the gap from which something is worth a name: what parameters and free terms leave or close below it is not what a team
/// looks for.
const MATTERS: f64 = 0.1;
/// How sure free terms must be, in standard deviations over held-out blocks.
const SURE_Z: f64 = 2.0;
/// A gap below this, times the noise, is none: of the simulator as it came, and of what its best parameters leave. With the right terms a fit
/// comes down to the noise.
const NO_GAP: f64 = 1.5;

/// What is asked.
#[derive(Debug)]
pub struct Question<'a> {
    /// The simulator's file.
    pub file: &'a SimulatorFile,
    /// What the car reported.
    pub sequence: &'a StateSequence,
    /// What was commanded, at its own stamps.
    pub commands: Commands,
    /// Names of effects to leave out.
    pub without: &'a [String],
}

/// Finds out.
///
/// # Errors
/// [`SimulatorError`].
pub fn diagnose(
    roll: &dyn Roll,
    question: &Question<'_>,
    progress: &mut dyn FnMut(&str),
) -> Result<SimulatorDiagnosis, SimulatorError> {
    let description = roll.description();
    let imposed = description.imposes_v_x && question.file.v_x == ForwardSpeed::Auto;
    let mut wanted = vec![Channel::VYMps, Channel::YawRateRadps];
    if !imposed {
        wanted.push(Channel::VXMps);
    }
    wanted.retain(|c| description.output(*c).is_some());
    let drive = Drive::new(question.sequence, question.commands.clone(), &wanted)?;
    let list = candidates(description, question.file, &drive.channels, imposed, question.without);
    let (start, before, busy) = (Instant::now(), roll.passes(), roll.busy());
    let model = Model::new(roll, question.file, &drive, &list, imposed);
    let fitter = Fitter::new(&model);
    let found = fitter.search(progress)?;
    progress("what no parameter explains");
    let flexible = fitter.flexible(found.state())?;
    let layout = &fitter.layout;
    let scored = Scored::new(layout, model.free.len());
    let null = window_squares(layout, &found.null.projected);
    let steps: Vec<Vec<f64>> = found.steps.iter().map(|s| window_squares(layout, &s.projected)).collect();
    let after = steps.last().unwrap_or(&null);
    let error = |m: &[f64]| scored.estimate(&[m], |e| e[0]);
    let ceiling = error(&flexible.all);
    // Noise that is filtered, or ripples like it, is taken for more than there is: free terms leave no less than the noise does.
    let floor = ceiling.value.min(1.0);
    let closed = |from: &[f64], to: &[f64]| {
        scored.estimate(&[&null, from, to], |e| {
            if e[0] > 1.05 * floor { (e[1] - e[2]) / (e[0] - floor) } else { f64::NAN }
        })
    };
    let (nominal, left) = (error(&null), error(after));
    // Nothing was fitted to it: every window counts, and one in which the car nearly spun does not make a gap.
    let as_it_came = Scored::everywhere(layout, model.free.len()).estimate(&[&null], |e| e[0]).low;
    let free_closes = closed(after, &flexible.all);
    let z = scored.z(after, &flexible.all);
    let terms_help = z > SURE_Z && free_closes.value > MATTERS;
    // A gap all over the drive that no parameter explains is the simulator's, whether anything was named or not.
    let unexplained = left.low > NO_GAP * floor;
    let is_missing = unexplained || nominal.value > NO_GAP * floor && terms_help;
    let named_close = closed(&null, after);
    let verdict = match () {
        () if is_missing => Verdict::MissingStructure,
        () if found.fit.is_some() => Verdict::Effects,
        // A few blocks hold all of it: something happened there, which need not be the simulator's.
        () if as_it_came > NO_GAP * floor => Verdict::NoneOfThese,
        () => Verdict::NoGap,
    };
    // Beside missing structure a parameter may stand in for it: it is named where it closes more than the free terms do.
    let names_effects = verdict == Verdict::Effects || is_missing && named_close.value > free_closes.value;
    let effects = effects(&list, &found, question.file, names_effects, &|k| {
        closed(if k == 0 { &null } else { &steps[k - 1] }, &steps[k])
    });
    // A small part of the whole gap may be most of what parameters leave.
    let of_what_is_left =
        if unexplained { ((left.value - floor) / (nominal.value - floor)).min(1.0) } else { 1.0 };
    let mut missing: Vec<MissingTerm> = flexible
        .alone
        .iter()
        .map(|(name, m)| MissingTerm { name: (*name).to_owned(), closed_fraction: closed(after, m).value })
        .filter(|m| is_missing && m.closed_fraction > 0.5 * MATTERS * of_what_is_left)
        .collect();
    missing.sort_by(|a, b| b.closed_fraction.total_cmp(&a.closed_fraction));
    let mut reasons = vec![Reason::Gap { nominal: nominal.value, after: left.value }];
    reasons.extend(taken(&list, &found));
    if is_missing {
        reasons.push(Reason::Missing { closed_fraction: free_closes.value, z });
    }
    reasons.push(if imposed { Reason::SpeedImposed } else { Reason::SpeedSimulated });
    let state = found.state();
    let own_changes = found.fit.as_ref().map(|f| f.sizes.as_slice()).unwrap_or_default();
    // Parameters that stand in for a term do so on this drive: they are written down where they are most of the answer.
    let is_mended = names_effects && (!is_missing || named_close.low > 0.5);
    let changes = own_changes.iter().filter_map(|s| match list[s.candidate].kind {
        Kind::Own(_) if is_mended => Some((list[s.candidate].parameter.clone(), s.value)),
        _ => None,
    });
    Ok(SimulatorDiagnosis {
        verdict,
        reasons,
        sites: sites(&effects),
        invisible: invisible(roll, &list, &drive, imposed),
        missing,
        places: places(&drive, layout, &found.null.projected),
        gap: GapBudget {
            nominal,
            retuned: nominal,
            steps: effects
                .iter()
                .take(steps.len())
                .zip(&steps)
                .map(|(e, m)| GapStep { effect: e.name.clone(), error: error(m) })
                .collect(),
            after: left,
            unstructured_ceiling: ceiling,
            noise_floor: Estimate { value: floor, low: floor, high: floor },
            horizon_s: WINDOW_S,
            channel_noise: drive.channels.iter().map(|(c, sigma)| (c.name(), *sigma)).collect(),
            scored_on: scored.on,
        },
        gap_closed_fraction: named_close,
        effects,
        tires: None,
        data_health: DataHealth::of(question.sequence).map_err(|e| SimulatorError::Drive(e.to_string()))?,
        simulator: SimulatorUse {
            name: description.name.clone(),
            rollouts: (roll.passes() - before) as f64 / drive.stretches.len().max(1) as f64,
            candidates: list.len(),
            lacks: description.lacks.clone(),
            took_s: [start.elapsed(), roll.busy() - busy].map(|t| t.as_secs_f64()),
        },
        changes: changes.collect(),
        residuals: found.null.projected.clone(),
        fitted: list.iter().zip(&state.point.values).map(|(c, v)| (c.name.clone(), *v)).collect(),
        series: series(&drive, layout, [&found.null.projected, &state.projected]),
    })
}

/// What of a drive an error is taken over.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Span {
    /// The blocks that no fit of this drive has seen.
    HeldOut,
    /// All of it: another drive than the one that was fitted.
    Whole,
}

/// What a simulator leaves of a drive.
#[derive(Debug, Clone, PartialEq)]
pub struct Verified {
    /// Mean square over the noise variance.
    pub over_noise: f64,
    /// Whether it is below that of the simulator as it came by more than noise gives.
    pub is_clearly_less: bool,
}

/// Error of a simulator over the noise, with given sizes of effects around it and of its own parameters: what a patch is verified by.
/// `as_it_came`: the residuals of a diagnosis of the same drive ([`SimulatorDiagnosis::residuals`]).
///
/// # Errors
/// [`SimulatorError`].
pub fn error_over(
    roll: &dyn Roll,
    question: &Question<'_>,
    sizes: &[(String, f64)],
    span: Span,
    as_it_came: &[f64],
) -> Result<Verified, SimulatorError> {
    let description = roll.description();
    let imposed = description.imposes_v_x && question.file.v_x == ForwardSpeed::Auto;
    let mut wanted = vec![Channel::VYMps, Channel::YawRateRadps];
    if !imposed {
        wanted.push(Channel::VXMps);
    }
    wanted.retain(|c| description.output(*c).is_some());
    let drive = Drive::new(question.sequence, question.commands.clone(), &wanted)?;
    let list = candidates(description, question.file, &drive.channels, imposed, question.without);
    let model = Model::new(roll, question.file, &drive, &list, imposed);
    let mut fitter = Fitter::new(&model);
    if span == Span::Whole {
        fitter.layout.held_out.fill(true);
    }
    let mut point = model.null();
    for (c, value) in list.iter().zip(&mut point.values) {
        let known = sizes.iter().find(|(name, _)| *name == c.name);
        *value = known.map_or(*value, |(_, size)| *size);
    }
    let state = fitter.at(point)?;
    let scored = Scored::new(&fitter.layout, model.free.len());
    let squares = window_squares(&fitter.layout, &state.projected);
    let is_clearly_less =
        as_it_came.len() == state.projected.len() && scored.is_clearly_better(as_it_came, &state.projected);
    Ok(Verified { over_noise: scored.estimate(&[&squares], |e| e[0]).value, is_clearly_less })
}

fn effects(
    list: &[Candidate],
    found: &Found,
    file: &SimulatorFile,
    accepted: bool,
    closed: &dyn Fn(usize) -> Estimate,
) -> Vec<RankedEffect> {
    let sizes = found.fit.as_ref().map(|f| f.sizes.clone()).unwrap_or_default();
    let mut out: Vec<RankedEffect> = Vec::new();
    for (k, size) in sizes.iter().enumerate() {
        let c = &list[size.candidate];
        let alike = names(list, found.confused.get(k));
        out.push(RankedEffect {
            name: c.name.clone(),
            accepted,
            parameters: sized(c, size.value, size.low, size.high),
            gap_closed_fraction: closed(k),
            confidence: 0.99 / (1.0 + alike.len() as f64),
            confused_with: alike,
            site: c.site.clone(),
            unit_error: unit_error(c, size.low, size.high, file),
        });
    }
    // What was looked at last and not taken.
    let unknown = Estimate { value: f64::NAN, low: f64::NAN, high: f64::NAN };
    let others = found.compared.iter().filter(|(c, _)| !sizes.iter().any(|s| s.candidate == *c));
    for (other, _) in others.take(3) {
        let c = &list[*other];
        out.push(RankedEffect {
            name: c.name.clone(),
            accepted: false,
            parameters: BTreeMap::new(),
            gap_closed_fraction: unknown,
            confidence: 0.0,
            confused_with: Vec::new(),
            site: c.site.clone(),
            unit_error: None,
        });
    }
    out
}

fn sized(c: &Candidate, value: f64, low: f64, high: f64) -> BTreeMap<String, Sized> {
    let (mut low, mut high) = (low.max(c.low), high.min(c.high));
    let value = if c.integer { value.round() } else { value };
    (low, high) = (low.min(value), high.max(value));
    (low, high) = (c.stated(low).min(c.stated(high)), c.stated(low).max(c.stated(high)));
    let before = c.is_own().then_some(c.null);
    let sized = Sized { value: c.stated(value), low, high, unit: c.unit.clone(), before };
    BTreeMap::from([(c.parameter.clone(), sized)])
}

/// The ratio of units that a gain, or the yaw rate's scale, is: only where its interval holds one.
fn unit_error(c: &Candidate, low: f64, high: f64, file: &SimulatorFile) -> Option<UnitError> {
    let scales = [Kind::Wrapped(Wrapped::SteeringGain), Kind::Wrapped(Wrapped::GyroScale)];
    if !scales.contains(&c.kind) {
        return None;
    }
    let known =
        [("degrees for radians", 180.0 / std::f64::consts::PI), ("km/h for m/s", 3.6), ("g for m/s2", 9.81)];
    let known = known.into_iter().map(|(n, r)| (n.to_owned(), r));
    let stated = file.unit_ratios.iter().map(|(n, r)| (n.clone(), *r));
    known
        .chain(stated)
        .flat_map(|(n, r)| [(n.clone(), r), (n, r.recip())])
        .find(|(_, r)| (1.0 + low..=1.0 + high).contains(r))
        .map(|(name, ratio)| UnitError { name, ratio })
}

fn names(list: &[Candidate], of: Option<&Vec<usize>>) -> Vec<String> {
    of.into_iter().flatten().map(|&c| list[c].name.clone()).collect()
}

fn taken(list: &[Candidate], found: &Found) -> Vec<Reason> {
    let mut out = Vec::new();
    for (k, size) in found.fit.iter().flat_map(|f| &f.sizes).enumerate() {
        let name = list[size.candidate].name.clone();
        out.push(Reason::Taken { name: name.clone(), wald: size.wald, needed: size.needed });
        let with = names(list, found.confused.get(k));
        if !with.is_empty() {
            out.push(Reason::Confused { name, with });
        }
    }
    out
}

fn sites(effects: &[RankedEffect]) -> Vec<Site> {
    let mut by_name: BTreeMap<String, Vec<&RankedEffect>> = BTreeMap::new();
    for e in effects.iter().filter(|e| e.accepted) {
        by_name.entry(e.site.clone().unwrap_or_else(|| "unknown".to_owned())).or_default().push(e);
    }
    let site = |(name, of): (String, Vec<&RankedEffect>)| Site {
        name,
        probability: of.iter().map(|e| e.confidence).fold(0.0, f64::max),
        closed_fraction: of
            .first()
            .map_or(Estimate { value: f64::NAN, low: f64::NAN, high: f64::NAN }, |e| e.gap_closed_fraction),
        mechanisms: of
            .iter()
            .map(|e| Mechanism { name: e.name.clone(), probability: e.confidence })
            .collect(),
    };
    by_name.into_iter().map(site).collect()
}

fn invisible(roll: &dyn Roll, list: &[Candidate], drive: &Drive, imposed: bool) -> Vec<Invisible> {
    let mut out = Vec::new();
    let compared = |c: Channel| drive.channels.iter().any(|(other, _)| *other == c);
    let mut tell = |name: &str, reason: &'static str| out.push(Invisible { name: name.to_owned(), reason });
    if roll.description().output(Channel::VYMps).is_none() {
        tell("v_y", "the simulator knows no side slip");
    } else if !compared(Channel::VYMps) {
        tell("v_y", "the bag records no lateral velocity, or one that is always the same");
    }
    if imposed {
        tell("v_x", "the measured forward speed is imposed: the simulator's longitudinal side is not judged");
    }
    if list.is_empty() {
        tell("parameters", "the simulator names none");
    }
    out
}

#[cfg(test)]
mod tests;
