//! The points of the report's pictures.

use crate::engine::Engine;
use crate::outcome::{Prediction, Series, TirePair};
use crate::place::heat;
use crate::state::{Nominal, State};
use gripsight_estimation::{Score, Windows, by_block, mean, of_length};
use gripsight_model::{Rollout, Window};

/// Length of the overlay of the worst stretch.
const WORST_S: f64 = 5.0;
const HORIZONS_S: [f64; 5] = [0.1, 0.2, 0.5, 1.0, 2.0];

pub(crate) fn series(
    engine: &Engine<'_>,
    nominal: &Nominal,
    [null, state]: [&State; 2],
    (tires, slip_driven_rad): (&TirePair, [f64; 2]),
    all: &Windows,
    nominal_score: &Score,
    scored: &Windows,
) -> Series {
    let predictions = predictions(engine, nominal, state, all, nominal_score);
    Series {
        tire_curves: curves(tires, slip_driven_rad),
        slip_driven_rad,
        worst: worst(engine, &predictions, all, nominal_score),
        predictions,
        heat: heat(engine, nominal, all, nominal_score),
        g_g: g_g(engine),
        horizon: horizon(engine, nominal, null, state, scored),
    }
}

/// The largest slips driven, of front and rear axle.
pub(crate) fn slips(engine: &Engine<'_>, all: &Windows) -> [f64; 2] {
    let mut most = [0.0_f64; 2];
    for w in &all.windows {
        let run = &engine.recording.runs[w.segment];
        for k in w.from..w.from + w.len {
            let [f, r] = engine.slip_rad(run, k);
            most = [most[0].max(f.abs()), most[1].max(r.abs())];
        }
    }
    most
}

fn curves(tires: &TirePair, driven_rad: [f64; 2]) -> [Vec<[f64; 3]>; 2] {
    const POINTS: usize = 60;
    let TirePair { without_effect: without, with_effect: with } = tires;
    let axle = |a: &gripsight_vehicle::MagicFormula, b: &gripsight_vehicle::MagicFormula, most: f64| {
        (0..=POINTS)
            .map(|k| {
                let slip = 1.5 * most.max(0.02) * k as f64 / POINTS as f64;
                [slip, a.normalized_force(slip), b.normalized_force(slip)]
            })
            .collect()
    };
    [axle(&without.front, &with.front, driven_rad[0]), axle(&without.rear, &with.rear, driven_rad[1])]
}

/// What the nominal model and the model with the effects predict over all windows, beside what was measured. Every window starts anew
/// from its best state.
fn predictions(
    engine: &Engine<'_>,
    nominal: &Nominal,
    state: &State,
    all: &Windows,
    nominal_score: &Score,
) -> Vec<Prediction> {
    let extended = engine.score(&state.effects, None, &state.parameters, all);
    let models = [engine.model(&nominal.effects, None), engine.model(&state.effects, None)];
    let channels = engine.recording.channels.len();
    let [mut before, mut after] = [Vec::new(), Vec::new()];
    let mut out = Vec::new();
    for (i, w) in all.windows.iter().enumerate() {
        models[0].rollout(&nominal.parameters, nominal_score.starts[i], w, &mut before);
        models[1].rollout(&state.parameters, extended.starts[i], w, &mut after);
        let run = &engine.recording.runs[w.segment];
        out.extend(before.chunks(channels).zip(after.chunks(channels)).enumerate().map(|(k, (a, b))| {
            let at = w.from + k;
            Prediction {
                time_s: run.time_s(at),
                begins: k == 0,
                v_x_mps: run.v_x_mps[at],
                v_y_mps: [run.measured[0][at], a[0], b[0]],
                yaw_rate_radps: [run.measured[1][at], a[1], b[1]],
            }
        }));
    }
    out
}

/// The stretch of windows with the largest errors of the nominal model.
fn worst(engine: &Engine<'_>, predictions: &[Prediction], all: &Windows, score: &Score) -> Vec<Prediction> {
    let Some(first) = all.windows.first() else { return Vec::new() };
    let count = ((WORST_S / (first.len as f64 * engine.recording.dt_s())).round() as usize)
        .clamp(1, all.windows.len());
    let best = (0..=all.windows.len() - count)
        .max_by(|&a, &b| {
            let sum = |i: usize| score.squares[i..i + count].iter().sum::<f64>();
            sum(a).total_cmp(&sum(b))
        })
        .unwrap_or(0);
    let samples = |windows: &[Window]| windows.iter().map(|w| w.len).sum::<usize>();
    let from = samples(&all.windows[..best]);
    let to = from + samples(&all.windows[best..best + count]);
    predictions.get(from..to).map(<[_]>::to_vec).unwrap_or_default()
}

fn g_g(engine: &Engine<'_>) -> Vec<[f64; 2]> {
    const POINTS: usize = 1500;
    let all: Vec<[f64; 2]> = engine
        .recording
        .runs
        .iter()
        .flat_map(|r| (0..r.len()).map(|k| [r.a_x_mps2[k], r.v_x_mps[k] * r.smooth[1][k]]))
        .collect();
    all.iter().step_by((all.len() / POINTS).max(1)).copied().collect()
}

fn horizon(
    engine: &Engine<'_>,
    nominal: &Nominal,
    null: &State,
    state: &State,
    on: &Windows,
) -> Vec<[f64; 4]> {
    HORIZONS_S
        .into_iter()
        .filter_map(|h| {
            let windows = of_length(engine.recording, on, h);
            if windows.windows.len() < 2 {
                return None;
            }
            let error = |effects: &[gripsight_model::EffectId], p: &[f64]| {
                mean(&by_block(engine.recording, &windows, &engine.score(effects, None, p, &windows)))
            };
            Some([
                h,
                error(&nominal.effects, &nominal.parameters),
                error(&null.effects, &null.parameters),
                error(&state.effects, &state.parameters),
            ])
        })
        .collect()
}
