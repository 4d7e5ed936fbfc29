//! The inference: which effects, at which sites, how large; and what no effect of the library does.
//!
//! 1. Everything is linearised at once around the present model ([`Joint`]): tires, all effects, and flexible terms of each site that can do
//!    roughly what any cause there does.
//! 2. The noise is fixed: what even all terms together leave of a channel counts as noise, and errors that are alike over a block count as
//!    often as they repeat (the dispersion: composite likelihood, Pauli, Racugno and Ventura 2011).
//! 3. Every effect has a narrow prior (as little as any car has, or as well as its figure is known) and a wide one; every site's flexible
//!    terms likewise. All configurations are compared ([`selection`](gripsight_estimation::selection)): an effect that is the cause makes its site's
//!    flexible terms needless; a stand-in does not.
//! 4. The most probable model is fitted by rollouts, and everything linearised anew around it, until the configuration stays.
//! 5. Data that nothing was fitted to decide what stays in it (`stated`), one part after the other (`moves`).

use nalgebra::DVector;

use crate::around::Around;
use crate::budget::Scorer;
use crate::columns::Columns;
use crate::engine::Engine;
use crate::finding::untried;
use crate::frame::Frame;
use crate::hypotheses::terms;
use crate::inferred::Inferred;
use crate::joint::{Joint, Weighed};
use crate::pruned::Pruned;
use crate::sizes::{Sizes, told};
use crate::state::State;
use crate::stated::Stated;
use gripsight_estimation::Windows;
use gripsight_estimation::selection::{Quadratic, Term, configuration, select};
use gripsight_model::BASE;
use gripsight_model::EffectId;
use gripsight_model::{Flexible, Site, Window};

/// Place of the first effect among the terms: after tires and hold.
pub(crate) const FIRST: usize = 2;
/// Linearisations at most.
const ROUNDS: usize = 7;
/// Rounds at most in which effects alone are compared: beside free terms a linearisation far from the cause would blame them.
const CLOSED_ROUNDS: usize = 4;
/// Rounds after which the noise stays.
const NOISE_ROUNDS: usize = 2;

/// Infers. `null`: the fitted model without effects; the engine's channel weights become those of the noise found.
pub(crate) fn infer(
    engine: &mut Engine<'_>,
    null: &State,
    library: &[EffectId],
    flexible: Flexible,
    windows: &Windows,
    scorer: &Scorer<'_>,
    progress: &mut dyn FnMut(&str),
) -> Option<Inferred> {
    let mut effects: Vec<EffectId> = EffectId::background().collect();
    effects.extend(library.iter().filter(|e| e.spec().usual.is_none()));
    let held = engine.held.iter().map(|(e, _)| *e).filter(|e| !effects.contains(e));
    effects.extend(held.collect::<Vec<_>>());
    let columns = Columns::new(effects, flexible);
    let mut values = columns.blank(engine);
    values[..BASE].copy_from_slice(&null.parameters[..BASE]);
    // What was handed over is there from the start.
    for effect in &columns.effects {
        if let (Some(own), Some(range)) = (null.of(*effect), columns.of_effect(*effect)) {
            values[range].copy_from_slice(own);
        }
    }
    let mut starts = null.starts.clone();
    let base = engine.sigma.clone();
    let mut chosen: Option<Vec<usize>> = None;
    let mut dispersion = 1.0;
    let mut rounds = 0;
    let mut open_flexible = false;
    let mut needless = vec![false; FIRST + columns.len()];
    // The best of effects alone.
    let mut closed: Option<Vec<usize>> = None;
    loop {
        rounds += 1;
        progress(&format!("comparing all models, round {rounds}"));
        let mut joint = Joint::around(engine, &columns, &values, &starts, windows)?;
        differences(engine, &columns, &mut values, &starts, windows, &mut joint);
        let terms = terms(engine, &columns, &values, library);
        let open: Vec<usize> = terms.iter().map(|t| t.log_weights.len() - 1).collect();
        let still = rounds > NOISE_ROUNDS;
        let scale =
            if still { vec![1.0; base.len()] } else { noise_scale(engine, &joint, &base, &terms, &open)? };
        let weighed = joint.weighed(&scale);
        if !still {
            dispersion = repeated(&weighed, &terms, &open)?;
        }
        open_flexible |= rounds > CLOSED_ROUNDS;
        let start = chosen.clone().unwrap_or_else(|| vec![0; terms.len()]);
        let first_flexible = FIRST + columns.effects.len();
        let offered: Vec<Term> = terms
            .iter()
            .enumerate()
            .map(|(i, t)| {
                let offered = !needless[i] && (open_flexible || i < first_flexible);
                if offered { t.clone() } else { t.only(0) }
            })
            .collect();
        let selection = select(&weighed.total, dispersion, &offered, &start, 17)?;
        let around = Around {
            engine,
            columns: &columns,
            terms: &terms,
            values: &values,
            starts: &starts,
            windows,
            dispersion,
            joint: &joint,
            scale: &scale,
        };
        let last = rounds == ROUNDS;
        if chosen.as_ref() != Some(&selection.best) && !last {
            let fitted = around.by_rollouts(&weighed.total, &selection.best)?;
            (values, starts) = (fitted.values, fitted.starts);
            chosen = Some(selection.best);
            continue;
        }
        let Pruned { chosen: best, fitted, losses } = around.pruned(&weighed.total, &selection.best)?;
        let same = chosen.as_ref() == Some(&best);
        if open_flexible {
            // What rollouts find needless beside free terms does not come back.
            for (i, n) in needless.iter_mut().enumerate().take(best.len()) {
                *n |= selection.best[i] > 0 && best[i] == 0;
            }
        }
        if (same && open_flexible && rounds > NOISE_ROUNDS) || last {
            let confirmed = around.confirmed(&weighed.total, &selection, &losses)?;
            progress("asking data that nothing was fitted to");
            let found = around.stated(library, &weighed, (best, fitted), closed, scorer)?;
            let sizes = Sizes::of(&around, library, &found.chosen, &found.fitted, windows)?;
            let Stated { chosen: best, beside, statements: mut stated, .. } = found;
            for statement in &mut stated {
                let effect = columns.effects[statement.term - FIRST];
                statement.untried = untried(effect, library).count();
                statement.size_over_half_width =
                    sizes.effect(&columns, effect).map_or(0.0, |sized| told(engine, effect, &sized));
            }
            return Some(Inferred {
                chosen: best,
                beside,
                stated: Some(stated),
                columns,
                tires: engine.nominal,
                values,
                confirmed,
                sizes,
                selection,
                terms,
                weighed,
                dispersion,
                sigma: engine.sigma.clone(),
                rounds,
            });
        }
        if !open_flexible {
            closed = Some(best.clone());
        }
        open_flexible |= same;
        (values, starts) = (fitted.values, fitted.starts);
        chosen = Some(best);
    }
}

/// Linearises another drive in the same columns: at given values, or around the best fit to it of a configuration from there on. The engine's channel
/// weights become those of the noise found.
pub(crate) fn linearised(
    engine: &mut Engine<'_>,
    frame: &Frame,
    (from, chosen): (&[f64], &[usize]),
    fitted: bool,
    windows: &Windows,
) -> Option<Inferred> {
    let Frame { columns, library, .. } = frame;
    let mut values = from.to_vec();
    // The same sensors: no less noise than the first drive was found to have.
    engine.sigma.clone_from(&frame.sigma);
    let base = engine.sigma.clone();
    let mut starts = starts(engine, columns, from, windows);
    for round in 1.. {
        let mut joint = Joint::around(engine, columns, &values, &starts, windows)?;
        differences(engine, columns, &mut values, &starts, windows, &mut joint);
        let terms = terms(engine, columns, &values, library);
        let open: Vec<usize> = terms.iter().map(|t| t.log_weights.len() - 1).collect();
        let scale = noise_scale(engine, &joint, &base, &terms, &open)?;
        let weighed = joint.weighed(&scale);
        let dispersion = repeated(&weighed, &terms, &open)?;
        if round == NOISE_ROUNDS {
            let selection = select(&weighed.total, dispersion, &terms, chosen, 17)?;
            let confirmed = selection
                .probability
                .iter()
                .map(|p| if p.len() > 1 { p[p.len() - 1] } else { 1.0 })
                .collect();
            let sizes = Sizes::unknown(values.clone());
            return Some(Inferred {
                chosen: selection.best.clone(),
                beside: Vec::new(),
                stated: None,
                columns: columns.clone(),
                tires: engine.nominal,
                values,
                confirmed,
                sizes,
                selection,
                terms,
                weighed,
                dispersion,
                sigma: engine.sigma.clone(),
                rounds: round,
            });
        }
        if !fitted {
            continue;
        }
        let around = Around {
            engine,
            columns,
            terms: &terms,
            values: &values,
            starts: &starts,
            windows,
            dispersion,
            joint: &joint,
            scale: &scale,
        };
        let fitted = around.by_rollouts_to_the_end(&weighed.total, chosen)?.fitted;
        (values, starts) = (fitted.values, fitted.starts);
    }
    None
}

/// The start states at which a model does best.
pub(crate) fn starts(
    engine: &Engine<'_>,
    columns: &Columns,
    values: &[f64],
    windows: &Windows,
) -> Vec<[f64; 2]> {
    let there = |range: std::ops::Range<usize>| range.into_iter().any(|c| values[c] != 0.0);
    let sites: Vec<Site> = Site::ALL.into_iter().filter(|s| there(columns.of_site(*s))).collect();
    let (model, own, _) = columns.model(engine, values, |e| columns.of_effect(e).is_some_and(&there), &sites);
    engine.score_model(&model, &own, windows).starts
}

/// What even all terms together leave of each channel counts as noise: by how much more than the weights have it, which are raised.
pub(crate) fn noise_scale(
    engine: &mut Engine<'_>,
    joint: &Joint,
    base: &[f64],
    terms: &[Term],
    open: &[usize],
) -> Option<Vec<f64>> {
    let mut scale = vec![1.0; base.len()];
    let step = configuration(&joint.weighed(&scale).total, 1.0, terms, open)?.step;
    for (c, left) in joint.left_by_channel(&step).into_iter().enumerate() {
        let sigma = base[c].max(engine.sigma[c] * left.sqrt());
        scale[c] = sigma / engine.sigma[c];
        engine.sigma[c] = sigma;
    }
    Some(scale)
}

/// How much larger the scatter of the blocks' gradients is than that of independent errors, at the best model with all terms open.
pub(crate) fn repeated(weighed: &Weighed, terms: &[Term], open: &[usize]) -> Option<f64> {
    let found = configuration(&weighed.total, 1.0, terms, open)?;
    let (step, covariance) = (&found.step, found.covariance());
    // Directions that the data know: H C is the share of the data in each.
    let known: f64 = (&weighed.total.information * &covariance).trace();
    let scatter: f64 = weighed
        .blocks
        .iter()
        .map(|b: &Quadratic| {
            let g: DVector<f64> = &b.gradient + &b.information * step;
            (g.transpose() * &covariance * &g)[(0, 0)]
        })
        .sum();
    let blocks = weighed.blocks.len() as f64;
    let dispersion = scatter / known.max(1.0) * blocks / (blocks - 1.0).max(1.0);
    dispersion.is_finite().then_some(dispersion.max(1.0))
}

/// For effects whose derivative vanishes where they are absent: the difference quotient to one of their starts, the one that promises most.
pub(crate) fn differences(
    engine: &Engine<'_>,
    columns: &Columns,
    values: &mut [f64],
    starts: &[[f64; 2]],
    windows: &Windows,
    joint: &mut Joint,
) {
    let everywhere = |_: &Window| true;
    let here = crate::patch::predictions(engine, columns, values, starts, (windows, &everywhere), None);
    for &effect in columns.effects.iter().filter(|e| e.spec().flat_at_null) {
        let Some(range) = columns.of_effect(effect) else { continue };
        let null = effect.spec().parameters[0].null;
        if (values[range.start] - null).abs() > 1e-12 {
            continue;
        }
        if effect.is_of_a_place() {
            if let Some(([start, length], slopes)) =
                crate::patch::likeliest(effect, engine, columns, values, starts, windows, &here, joint)
            {
                values[range.start + 1] = start;
                values[range.start + 2] = length;
                joint.with_column(engine, range.start, &slopes);
            }
            continue;
        }
        let size = engine.size(&effect.spec().parameters[0]);
        let slopes = effect
            .spec()
            .starts
            .iter()
            .map(|m| {
                let to = m * size;
                let at = (effect, range.start);
                crate::patch::quotient(engine, columns, values, starts, (windows, &everywhere), &here, at, to)
            })
            .map(|slopes| (joint.promise(engine, &slopes), slopes))
            .max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, slopes)) = slopes {
            joint.with_column(engine, range.start, &slopes);
        }
    }
}

#[cfg(test)]
mod tests {
    use gripsight_estimation::split;
    use gripsight_model::Channel;
    use gripsight_vehicle::VehicleParameters;

    use super::*;
    use crate::statement::Statement;
    use crate::testing::{drive, tires};
    use crate::trust::TireTrust;

    const LARGE_SLIP_RAD: f64 = 0.1;
    const LIBRARY: [EffectId; 4] =
        [EffectId::SteeringLag, EffectId::SteeringDelay, EffectId::VyBias, EffectId::GyroScale];

    fn inferred(lag_s: f64, without: &[EffectId]) -> Inferred {
        let vehicle = VehicleParameters::f1tenth();
        let recording = drive(&vehicle, lag_s);
        let mut engine = Engine::new(&recording, &vehicle, tires(), TireTrust::file());
        let windows = split(&recording, true).training;
        let null = engine.fit(&[], &engine.blank(), None, &windows, 15);
        let library: Vec<EffectId> = LIBRARY.into_iter().filter(|e| !without.contains(e)).collect();
        let flexible = Flexible::new(&recording, LARGE_SLIP_RAD, vehicle.wheelbase_m(), &Site::ALL);
        let both = split(&recording, true);
        let scorer = Scorer::new(&engine.clone(), None, &both);
        infer(&mut engine, &null, &library, flexible, &both.training, &scorer, &mut |_| {}).unwrap()
    }

    #[test]
    fn where_nothing_is_the_matter_nothing_is_found() {
        let found = inferred(0.0, &[]);
        assert!(found.columns.effects.iter().all(|e| found.probability(*e) < 0.5), "{:?}", found.confirmed);
        assert!(Site::ALL.iter().all(|s| found.other(*s) < 0.5), "{:?}", found.confirmed);
    }

    #[test]
    fn a_lag_is_found_with_its_size_and_left_out_its_site_is() {
        let found = inferred(0.06, &[]);
        let lag = found.term_of(EffectId::SteeringLag).unwrap();
        assert!(found.confirmed[lag] > 0.9 && found.chosen[lag] > 0, "{:?}", found.confirmed);
        let (size, sigma) = found.size(EffectId::SteeringLag);
        assert!((size[0] - 0.06).abs() < 0.01 && sigma[0] < 0.01, "{size:?} {sigma:?}");
        let without = inferred(0.06, &[EffectId::SteeringLag, EffectId::SteeringDelay]);
        let steering = without.other(Site::Steering);
        assert!(steering > 0.9, "{:?}", without.confirmed);
        assert!([EffectId::VyBias, EffectId::GyroScale].iter().all(|e| without.probability(*e) < 0.5));
    }

    #[test]
    fn a_comparison_asks_for_other_grip_beside_all_that_the_earlier_drive_has() {
        let found = inferred(0.06, &[]);
        let channels = [Channel::LateralVelocity, Channel::YawRate];
        let of =
            |considered: fn(EffectId) -> bool| Frame::of(&found, (&channels, &channels[1..]), considered);
        let frame = of(|e| e != EffectId::GripBalance);
        let grip = frame.columns.of_effect(EffectId::GripScale).unwrap();
        assert_eq!((frame.values.len(), frame.values[grip.start]), (frame.columns.len(), 0.0));
        assert_eq!(frame.sizes.values.len(), frame.values.len());
        assert!(
            frame.library.contains(&EffectId::GripScale)
                && frame.columns.of_effect(EffectId::GripBalance).is_none()
        );
        assert_eq!(frame.sigma, [found.sigma[1]]);
        for effect in &found.columns.effects {
            let [before, after] = [&found.columns, &frame.columns].map(|c| c.of_effect(*effect).unwrap());
            assert_eq!(found.values[before], frame.values[after]);
        }
        for site in Site::ALL {
            let [before, after] = [&found.columns, &frame.columns].map(|c| c.of_site(site));
            assert_eq!(found.values[before], frame.values[after]);
        }
        let bare = of(|_| false);
        assert_eq!((bare.values, bare.chosen), (found.values.clone(), found.chosen.clone()));
    }

    #[test]
    fn what_stands_in_for_others_stays_in_the_model_beside_what_is_named_and_only_there() {
        let mut found = inferred(0.06, &[]);
        let [lag, bias] = [EffectId::SteeringLag, EffectId::VyBias].map(|e| found.term_of(e).unwrap());
        let mut statement = found.statement(EffectId::SteeringLag).unwrap().clone();
        statement.rivals.clear();
        let of = |term, untried, closes| Statement { term, untried, closes, ..statement.clone() };
        let (named, stands_in) = ([EffectId::SteeringLag], [EffectId::VyBias, EffectId::SteeringLag]);
        found.stated = Some(vec![of(lag, 0, 0.2), of(bias, 3, 0.5)]);
        assert_eq!((&found.accepted()[..], &found.modelled()[..]), (&named[..], &stands_in[..]));
        found.refute(EffectId::VyBias);
        assert_eq!((&found.accepted()[..], &found.modelled()[..]), (&named[..], &named[..]));
        found.stated = Some(vec![of(lag, 3, 0.2)]);
        assert!(found.accepted().is_empty() && found.modelled().is_empty());
    }

    #[test]
    fn the_model_that_a_later_drive_is_compared_with_has_what_is_not_named_too() {
        let mut found = inferred(0.06, &[]);
        found.stated.iter_mut().flatten().for_each(|s| s.untried = 3);
        assert!(found.accepted().is_empty());
        let model = found.model();
        assert_eq!(model.effects.keys().collect::<Vec<_>>(), ["steering_lag"]);
        assert!((model.effects["steering_lag"]["tau_s"] - 0.06).abs() < 0.01, "{model:?}");
        assert!(EffectId::background().all(|e| model.usual.contains_key(e.name())), "{model:?}");
    }

    #[test]
    fn beside_a_stand_in_nothing_smaller_at_its_site_is_named() {
        let mut found = inferred(0.06, &[]);
        let effects = [EffectId::SteeringLag, EffectId::SteeringDelay, EffectId::VyBias];
        let [lag, delay, bias] = effects.map(|e| found.term_of(e).unwrap());
        let mut statement = found.statement(EffectId::SteeringLag).unwrap().clone();
        statement.rivals.clear();
        let of = |term, untried, closes| Statement { term, untried, closes, ..statement.clone() };
        let named = |found: &Inferred| effects.map(|e| found.is_accepted(e));
        found.stated = Some(vec![of(lag, 3, 0.5), of(delay, 0, 0.2), of(bias, 0, 0.2)]);
        assert_eq!(named(&found), [false, false, true]);
        assert!(found.probability(EffectId::SteeringDelay) < crate::decisions::NAMED);
        found.stated = Some(vec![of(lag, 0, 0.5), of(delay, 0, 0.2)]);
        assert_eq!(named(&found), [true, true, false]);
        found.stated = Some(vec![of(lag, 3, 0.1), of(delay, 0, 0.2)]);
        assert_eq!(named(&found), [false, true, false]);
    }
}
