//! How large the gap is, step by step, on data that no model was fitted to.

use gripsight_estimation::{
    Estimate, HORIZON_S, Split, Windows, bootstrap, by_block, interval, mean, of_length, of_picked, split,
};
use gripsight_model::{EffectId, ExtendedModel, Flexible, Recording, Site};
use std::collections::BTreeMap;

use crate::engine::Engine;
use crate::outcome::{GapBudget, GapStep};
use crate::residual::Residual;
use crate::state::{Nominal, State};

/// Errors on the scored blocks with retuned tires, then with one effect after the other.
#[derive(Debug, Clone)]
pub(crate) struct Steps {
    errors: Vec<Vec<(f64, f64)>>,
    /// Those effects.
    named: Vec<EffectId>,
}

impl Steps {
    /// Scores retuned tires, the effects of `state` one after the other, and `state`.
    pub(crate) fn of(
        engine: &Engine<'_>,
        scorer: &Scorer<'_>,
        windows: &Split,
        null: &State,
        state: &State,
    ) -> Self {
        let mut errors = vec![scorer.blocks(&null.effects, None, &null.parameters)];
        let part = |count: usize| error_of_part(engine, scorer, windows, state, &state.named[..count]);
        errors.extend((1..state.named.len()).map(part));
        if !state.named.is_empty() {
            errors.push(scorer.blocks(&state.effects, None, &state.parameters));
        }
        Self { errors, named: state.named.clone() }
    }

    fn retuned(&self) -> &[(f64, f64)] {
        &self.errors[0]
    }

    pub(crate) fn last(&self) -> &[(f64, f64)] {
        &self.errors[self.errors.len() - 1]
    }

    /// What the effect taken as number `step`, from 1, closes after those before it.
    fn closed(&self, step: usize) -> Estimate {
        match (self.errors.get(step - 1), self.errors.get(step)) {
            (Some(from), Some(to)) => closed(from, to, self.retuned()),
            _ => Estimate::UNKNOWN,
        }
    }

    /// The effects that make the errors larger as they are taken, the worst first.
    fn doubtful(&self) -> Vec<EffectId> {
        let shares = self.named.iter().enumerate().map(|(i, e)| (*e, self.closed(i + 1).value));
        let mut larger: Vec<(EffectId, f64)> = shares.filter(|(_, closed)| *closed < 0.0).collect();
        larger.sort_by(|a, b| a.1.total_cmp(&b.1));
        larger.into_iter().map(|(effect, _)| effect).collect()
    }

    /// An effect of `state` without which the others surely leave smaller errors (the 90 % interval), if there is one.
    pub(crate) fn refuted(
        &self,
        engine: &Engine<'_>,
        scorer: &Scorer<'_>,
        windows: &Split,
        state: &State,
    ) -> Option<EffectId> {
        self.doubtful().into_iter().find(|effect| {
            let others: Vec<EffectId> = self.named.iter().copied().filter(|e| e != effect).collect();
            let without = error_of_part(engine, scorer, windows, state, &others);
            closed(&without, self.last(), self.retuned()).high < 0.0
        })
    }
}

/// Errors of a model with some of the effects of a state, fitted from there.
fn error_of_part(
    engine: &Engine<'_>,
    scorer: &Scorer<'_>,
    windows: &Split,
    state: &State,
    named: &[EffectId],
) -> Vec<(f64, f64)> {
    let values = engine.carry(state, named);
    let part = engine.fit(named, &values, Some(state.starts.clone()), &windows.training, STEP_ITERATIONS);
    scorer.blocks(&part.effects, None, &part.parameters)
}

/// Errors of the models on the scored blocks.
#[derive(Debug, Clone)]
pub(crate) struct Budget {
    pub(crate) nominal: Vec<(f64, f64)>,
    pub(crate) steps: Steps,
    pub(crate) ceiling: Vec<(f64, f64)>,
    /// Retuned tires and a residual network; nothing where it could not be trained.
    residual: Option<Vec<(f64, f64)>>,
    pub(crate) floor: Estimate,
    pub(crate) closed: Estimate,
    pub(crate) scored_on: &'static str,
    /// What the likeliest of the others would close beside the named.
    candidates: Vec<(EffectId, Estimate)>,
}

/// The models that are scored.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Models<'m> {
    /// Parameters as they came.
    pub(crate) nominal: &'m Nominal,
    /// Tires retuned.
    pub(crate) null: &'m State,
    /// With the effects named.
    pub(crate) state: &'m State,
    /// The errors of both, and between them.
    pub(crate) steps: &'m Steps,
    /// The likeliest of the others, each with the parameters to begin with.
    pub(crate) candidates: &'m [(EffectId, Vec<f64>)],
}

/// What models are scored on: the held-out blocks, or another bag.
#[derive(Debug, Clone)]
pub(crate) struct Scorer<'a> {
    pub(crate) engine: Engine<'a>,
    pub(crate) windows: Windows,
    scored_on: &'static str,
}

/// Where too little was driven to hold any out.
const TOO_LITTLE: &str = "training blocks (too little data to hold any out)";

impl<'a> Scorer<'a> {
    /// Whether it scores on data that nothing is fitted to.
    pub(crate) fn is_apart(&self) -> bool {
        self.scored_on != TOO_LITTLE
    }

    /// Error of a model on each block.
    fn blocks(&self, effects: &[EffectId], flexible: Option<&Flexible>, p: &[f64]) -> Vec<(f64, f64)> {
        by_block(
            self.engine.recording,
            &self.windows,
            &self.engine.score(effects, flexible, p, &self.windows),
        )
    }

    pub(crate) fn new(engine: &Engine<'a>, other: Option<&'a Recording>, windows: &Split) -> Self {
        match other {
            // The other bag has its own noise; models and weights are those fitted here.
            Some(recording) => Self {
                engine: Engine { recording, ..engine.clone() },
                windows: of_length(recording, &split(recording, false).training, HORIZON_S),
                scored_on: "another bag",
            },
            None if windows.held_out.windows.is_empty() => Self {
                engine: engine.clone(),
                windows: of_length(engine.recording, &windows.training, HORIZON_S),
                scored_on: TOO_LITTLE,
            },
            None => Self {
                engine: engine.clone(),
                windows: windows.held_out.clone(),
                scored_on: "held-out blocks",
            },
        }
    }
}

/// Iterations of the fits of the steps between, and of the other candidates.
const STEP_ITERATIONS: usize = 7;
/// How many of the other candidates are scored.
pub(crate) const CANDIDATES: usize = 3;
/// An interval of a share that is wider says nothing.
const WIDEST_SHARE: f64 = 2.0;

impl Budget {
    /// Scores the models.
    pub(crate) fn of(engine: &Engine<'_>, scorer: &Scorer<'_>, windows: &Split, models: &Models<'_>) -> Self {
        let Models { nominal, null, state, steps, candidates } = *models;
        let candidates = candidates
            .iter()
            .map(|(effect, own)| {
                let named = [&state.named[..], &[*effect]].concat();
                let mut values = engine.carry(state, &named);
                let from = values.len() - own.len();
                values[from..].copy_from_slice(own);
                let beside = engine.fit(
                    &named,
                    &values,
                    Some(state.starts.clone()),
                    &windows.training,
                    STEP_ITERATIONS,
                );
                let error = scorer.blocks(&beside.effects, None, &beside.parameters);
                (*effect, closed(steps.last(), &error, steps.retuned()))
            })
            .collect();
        let slip = large_slip_rad(engine, &windows.training);
        let flexible = Flexible::new(engine.recording, slip, engine.vehicle.wheelbase_m(), &Site::ALL);
        let (ceiling, residual) = rayon::join(
            || engine.fit_flexible(state, &flexible, &windows.training),
            || Residual::learned(engine, null, &windows.training),
        );
        let residual = residual.map(|residual| {
            let Scorer { engine, windows, .. } = scorer;
            let model = ExtendedModel { residual: Some(&residual), ..engine.model(&null.effects, None) };
            by_block(engine.recording, windows, &engine.score_model(&model, &null.parameters, windows))
        });
        let whole = if state.named.is_empty() {
            Estimate::default()
        } else {
            closed(steps.retuned(), steps.last(), steps.retuned())
        };
        Self {
            nominal: scorer.blocks(&nominal.effects, None, &nominal.parameters),
            ceiling: scorer.blocks(&state.effects, Some(&flexible), &ceiling),
            residual,
            steps: steps.clone(),
            // By construction of the noise's figure the floor is 1.
            floor: Estimate { value: 1.0, low: 1.0, high: 1.0 },
            closed: whole,
            scored_on: scorer.scored_on,
            candidates,
        }
    }

    pub(crate) fn retuned(&self) -> f64 {
        mean(self.steps.retuned())
    }

    pub(crate) fn after(&self) -> f64 {
        mean(self.steps.last())
    }

    /// What an effect of the model closes after those before it, and another would close beside them.
    pub(crate) fn closed_by(&self, effect: EffectId) -> Estimate {
        let step = self.steps.named.iter().position(|e| *e == effect).map(|i| i + 1);
        let candidate = || self.candidates.iter().find(|c| c.0 == effect).map_or(Estimate::UNKNOWN, |c| c.1);
        step.map_or_else(candidate, |step| self.steps.closed(step))
    }

    /// As the result states it.
    pub(crate) fn stated(&self, recording: &Recording) -> GapBudget {
        let channel_noise: BTreeMap<&'static str, f64> = recording
            .channels
            .iter()
            .zip(&recording.sigma)
            .filter(|(c, _)| c.scored())
            .map(|(c, s)| (c.name(), *s))
            .collect();
        let Steps { named, errors } = &self.steps;
        let after = interval(self.steps.last());
        let ceiling = interval(&self.ceiling);
        let steps = named.iter().zip(errors.iter().skip(1));
        GapBudget {
            nominal: interval(&self.nominal),
            retuned: interval(self.steps.retuned()),
            steps: steps.map(|(e, blocks)| GapStep { effect: e.name(), error: interval(blocks) }).collect(),
            after,
            unstructured_ceiling: if ceiling.value > after.value { after } else { ceiling },
            s4_residual: self.residual.as_deref().map_or(Estimate::UNKNOWN, interval),
            noise_floor: self.floor,
            horizon_s: HORIZON_S,
            channel_noise,
            scored_on: self.scored_on,
        }
    }
}

/// (from - to)/(retuned - floor), with its interval over blocks; unknown where the gap's own interval reaches down to the noise, or
/// the share's is wider than twice the gap.
fn closed(from: &[(f64, f64)], to: &[(f64, f64)], retuned: &[(f64, f64)]) -> Estimate {
    let gap = bootstrap(retuned.len(), |picked| of_picked(retuned, picked) - 1.0);
    if gap.low.is_nan() || gap.low <= 0.0 {
        return Estimate::UNKNOWN;
    }
    let share = bootstrap(retuned.len(), |picked| {
        let whole = (of_picked(retuned, picked) - 1.0).max(1e-3);
        (of_picked(from, picked) - of_picked(to, picked)) / whole
    });
    if share.high - share.low <= WIDEST_SHARE { share } else { Estimate::UNKNOWN }
}

/// A large slip angle of the recording on the fitted tires.
pub(crate) fn large_slip_rad(engine: &Engine<'_>, windows: &Windows) -> f64 {
    let mut slips = Vec::new();
    for w in &windows.windows {
        let run = &engine.recording.runs[w.segment];
        for k in (w.from..w.from + w.len).step_by(5) {
            let [f, r] = engine.slip_rad(run, k);
            slips.push(f.abs().max(r.abs()));
        }
    }
    gripsight_model::quantile(slips, 0.8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn blocks(means: &[f64]) -> Vec<(f64, f64)> {
        means.iter().map(|m| (100.0 * m, 100.0)).collect()
    }

    #[test]
    fn what_makes_held_out_errors_larger_is_told_the_worst_first() {
        let errors = |levels: &[f64]| {
            levels.iter().map(|l| blocks(&[0.9 * l, 1.1 * l, *l, 1.05 * l, 0.95 * l, *l])).collect()
        };
        let of = |levels: &[f64]| Steps {
            errors: errors(levels),
            named: vec![EffectId::SteeringLag, EffectId::VyBias, EffectId::GyroScale],
        };
        assert!(of(&[20.0, 9.0, 5.0, 4.9]).doubtful().is_empty());
        assert_eq!(of(&[20.0, 9.0, 10.0, 4.0]).doubtful(), [EffectId::VyBias]);
        assert_eq!(of(&[20.0, 9.0, 10.0, 12.0]).doubtful(), [EffectId::GyroScale, EffectId::VyBias]);
    }

    #[test]
    fn a_share_is_stated_only_of_a_gap_that_is_clear() {
        let retuned = blocks(&[9.0, 11.0, 10.0, 12.0, 8.0, 10.0]);
        let after = blocks(&[2.8, 3.2, 3.0, 3.1, 2.9, 3.0]);
        let clear = closed(&retuned, &after, &retuned);
        approx::assert_relative_eq!(clear.value, 7.0 / 9.0, epsilon = 1e-12);
        assert!(clear.low < clear.value && clear.value < clear.high && clear.high < 1.0);
        // No gap, a gap that sits in one block, and a model that runs off in one block.
        let none = blocks(&[0.9, 1.1, 1.0, 1.05, 0.95, 1.0]);
        let one_place = blocks(&[1.0, 1.0, 1.0, 1.0, 1.0, 90.0]);
        let runs_off = blocks(&[3.0, 3.0, 3.0, 3.0, 3.0, 500.0]);
        for (to, whole) in [(&none, &none), (&after, &one_place), (&runs_off, &retuned)] {
            assert!(closed(whole, to, whole).value.is_nan());
        }
    }
}
