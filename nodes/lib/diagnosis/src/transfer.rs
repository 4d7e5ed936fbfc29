//! Whether the size of an effect carries over. A cause has one size: the same on another drive, the same at low and at high speed. What stands in
//! for it has the size that suits the data it was fitted to.

use gripsight_estimation::Windows;
use gripsight_estimation::shooting;
use gripsight_estimation::shooting::Prior;
use gripsight_model::{EffectId, median};
use nalgebra::{DMatrix, DVector};

use crate::engine::Engine;
use crate::rooms::by_noise;
use crate::state::State;

/// A change of a size by this share and more says no more.
const MOST: f64 = 1.0;
/// What a size is taken to change by where there are no other data.
pub(crate) const UNTRIED: f64 = 0.2;
/// A relative size known to no better than this is not known.
const UNKNOWN: f64 = 100.0;
/// Ridge that keeps a problem that data do not show solvable.
const LEAST_INFORMATION: f64 = 1e-9;

/// For each effect of a state how far its size drifts, as a share of it: what `other` data (a model on them, and their windows) ask for, the rest of the model moving along within its
/// priors, plus half the largest difference between halves of the windows (slow and fast, calm and at the limit, off and on the power,
/// right and left), the rest of the model as it is; of what sits in one part of the lap only the former.
pub(crate) fn drifts(
    engine: &Engine<'_>,
    state: &State,
    windows: &Windows,
    other: Option<(&Engine<'_>, Windows)>,
) -> Vec<f64> {
    let here = by_noise(engine);
    let other = other.map(|(engine, windows)| {
        let starts = engine.score(&state.effects, None, &state.parameters, &windows).starts;
        (by_noise(engine), windows, starts)
    });
    let halves = halves(engine, windows, &state.starts);
    let drift = |&effect: &EffectId| {
        let elsewhere = other.as_ref().map_or(UNTRIED, |(there, on, starts)| {
            change(there, state, effect, (on, starts), true).map_or(MOST, f64::abs)
        });
        let between = halves.iter().map(|[low, high]| {
            let [low, high] =
                [low, high].map(|(part, starts)| change(&here, state, effect, (part, starts), false));
            low.zip(high).map_or(MOST, |(low, high)| 0.5 * (high - low).abs())
        });
        // Halves of the windows are other places: what sits in one is not compared between them.
        let between = if effect.is_of_a_place() { 0.0 } else { between.fold(0.0, f64::max).min(MOST) };
        elsewhere.min(MOST) + between
    };
    state.named.iter().map(drift).collect()
}

type Part = (Windows, Vec<[f64; 2]>);

/// The windows in halves, by the mean of a figure over each.
fn halves(engine: &Engine<'_>, windows: &Windows, starts: &[[f64; 2]]) -> Vec<[Part; 2]> {
    let runs = &engine.recording.runs;
    let turn = |run: usize, k: usize| runs[run].v_x_mps[k] * runs[run].smooth[1][k];
    let figures: [&dyn Fn(usize, usize) -> f64; 4] = [
        &|run, k| runs[run].v_x_mps[k],
        &|run, k| turn(run, k).abs(),
        &|run, k| runs[run].a_x_mps2[k],
        &turn,
    ];
    let split = |figure: &&dyn Fn(usize, usize) -> f64| {
        let mean = |w: &gripsight_model::Window| {
            (w.from..w.from + w.len).map(|k| figure(w.segment, k)).sum::<f64>() / w.len as f64
        };
        let means: Vec<f64> = windows.windows.iter().map(mean).collect();
        let middle = median(means.clone());
        [false, true].map(|upper| {
            let kept: Vec<usize> = (0..means.len()).filter(|&k| (means[k] > middle) == upper).collect();
            (windows.picked(&kept), kept.iter().map(|&k| starts[k]).collect())
        })
    };
    figures.iter().map(split).collect()
}

/// Relative change of an effect's size that windows ask for, to first order; `None` where they do not tell, or a bound holds the size.
fn change(
    engine: &Engine<'_>,
    state: &State,
    effect: EffectId,
    (windows, starts): (&Windows, &[[f64; 2]]),
    rest_moves: bool,
) -> Option<f64> {
    let rows = state.rows(effect);
    let sizing = rows.start..rows.start + effect.sizing();
    let mut parameters = engine.parameters(&state.named, &state.effects, &state.parameters, 1.0);
    for (j, p) in parameters.iter_mut().enumerate() {
        let moves = if rows.contains(&j) { sizing.contains(&j) } else { rest_moves };
        p.free &= moves && (!state.is_held(j) || state.is_gone(effect, j));
        // Data may ask for any size; the rest stays near what it was fitted to.
        p.prior = p.prior.filter(|_| !rows.contains(&j)).map(|prior| Prior { mean: p.start, ..prior });
    }
    let model = engine.model(&state.effects, None);
    let problem = engine.problem(&model, &windows.windows, &parameters, 0);
    let all = shooting::linearize(&problem, &state.parameters, starts);
    let free: Vec<usize> = (0..parameters.len()).filter(|&j| parameters[j].free).collect();
    let absent = engine.absent(effect);
    let others: Vec<usize> = (0..free.len()).filter(|&row| !rows.contains(&free[row])).collect();
    // One direction scales the effect; the others are the rest of the model's parameters.
    let n = 1 + others.len();
    let mut directions = DMatrix::zeros(free.len(), n);
    for (row, &j) in free.iter().enumerate().filter(|(_, j)| rows.contains(j)) {
        directions[(row, 0)] = state.parameters[j] - absent[j - rows.start];
    }
    for (i, &row) in others.iter().enumerate() {
        directions[(row, i + 1)] = 1.0;
    }
    let information =
        directions.tr_mul(&all.information) * &directions + DMatrix::identity(n, n) * LEAST_INFORMATION;
    let gradient: DVector<f64> = directions.tr_mul(&all.gradient);
    let inverse = information.try_inverse()?;
    let step = -(&inverse * gradient)[0];
    (step.is_finite() && inverse[(0, 0)] >= 0.0 && inverse[(0, 0)].sqrt() < UNKNOWN).then_some(step)
}

#[cfg(test)]
mod tests {
    use gripsight_estimation::split;
    use gripsight_vehicle::VehicleParameters;

    use super::*;
    use crate::testing::{drive, tires};
    use crate::trust::TireTrust;

    #[test]
    fn a_cause_has_one_size_and_a_stand_in_has_several() {
        const LAG_S: f64 = 0.06;
        let vehicle = VehicleParameters::f1tenth();
        let [recording, other] = [LAG_S, LAG_S].map(|lag_s| drive(&vehicle, lag_s));
        let [slower] = [0.5 * LAG_S].map(|lag_s| drive(&vehicle, lag_s));
        let drift = |effect: EffectId, start: f64, other: &gripsight_model::Recording| {
            let windows = split(&recording, false).training;
            let engine = Engine::new(&recording, &vehicle, tires(), TireTrust::file());
            let null = engine.fit(&[], &engine.blank(), None, &windows, 15);
            let mut values = engine.carry(&null, &[effect]);
            let first = values.len() - effect.spec().parameters.len();
            values[first] = start;
            let state = engine.fit(&[effect], &values, Some(null.starts), &windows, 15);
            let there = Engine { recording: other, ..engine.clone() };
            let apart = Some((&there, split(other, false).training));
            drifts(&engine, &state, &windows, apart)[0]
        };
        let cause = drift(EffectId::SteeringLag, 0.03, &other);
        assert!(cause < 0.1, "{cause}");
        let stand_in = drift(EffectId::TireRelaxation, 0.1, &other);
        assert!(stand_in > 2.0 * cause, "{stand_in} {cause}");
        // Half the lag on the other drive is a change by half of the size.
        let changed = drift(EffectId::SteeringLag, 0.03, &slower);
        assert!((0.35..0.75).contains(&changed), "{changed}");
    }
}
