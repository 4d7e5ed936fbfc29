//! Effects whose derivative vanishes where they are absent: what a finite size of them does.

use gripsight_model::{Rollout, Window};
use rayon::prelude::*;

use crate::columns::Columns;
use crate::engine::Engine;
use crate::joint::Joint;
use gripsight_estimation::Windows;
use gripsight_model::EffectId;
use gripsight_model::Site;

/// Lengths tried, in shares of the lap, and how many places along the lap for each of them: half a length apart.
const LENGTHS: [f64; 3] = [0.04, 0.08, 0.16];

fn places(length: f64) -> impl Iterator<Item = [f64; 2]> {
    let count = (2.0 / length).round() as usize;
    (0..count).map(move |i| [i as f64 / count as f64, length])
}

/// The predictions of a model as it is, window after window; nothing of windows in which what is asked is not `felt`.
pub(crate) fn predictions(
    engine: &Engine<'_>,
    columns: &Columns,
    values: &[f64],
    starts: &[[f64; 2]],
    (windows, felt): (&Windows, &(dyn Fn(&Window) -> bool + Sync)),
    with: Option<EffectId>,
) -> Vec<Vec<f64>> {
    let present = |e: EffectId| {
        let range = columns.of_effect(e).unwrap_or(0..0);
        Some(e) == with || range.zip(e.spec().parameters).any(|(c, p)| (values[c] - p.null).abs() > 1e-12)
    };
    let sites: Vec<Site> =
        Site::ALL.into_iter().filter(|r| columns.of_site(*r).any(|c| values[c] != 0.0)).collect();
    let (model, own, _) = columns.model(engine, values, present, &sites);
    let run = |(window, start): (&Window, &[f64; 2])| {
        let mut out = Vec::new();
        if felt(window) {
            model.rollout(&own, *start, window, &mut out);
        }
        out
    };
    windows.windows.par_iter().zip(starts).map(run).collect()
}

/// The predictions with one column of an effect at `to` less those as they are (`here`), over the difference; window after window, of which only
/// those are run in which it is `felt`.
#[expect(clippy::too_many_arguments, reason = "a point in a model, and where it goes")]
pub(crate) fn quotient(
    engine: &Engine<'_>,
    columns: &Columns,
    values: &[f64],
    starts: &[[f64; 2]],
    (windows, felt): (&Windows, &(dyn Fn(&Window) -> bool + Sync)),
    here: &[Vec<f64>],
    (effect, column): (EffectId, usize),
    to: f64,
) -> Vec<Vec<f64>> {
    let mut there = values.to_vec();
    there[column] = to;
    let step = to - values[column];
    let moved = predictions(engine, columns, &there, starts, (windows, felt), Some(effect));
    // Where it is not felt nothing was run.
    let over = |(a, b): (&Vec<f64>, Vec<f64>)| {
        if b.is_empty() { vec![0.0; a.len()] } else { a.iter().zip(b).map(|(a, b)| (b - a) / step).collect() }
    };
    here.iter().zip(moved).map(over).collect()
}

/// Where a patch would explain most: its start and length, in shares of the lap, and what a depth there does; `None` where none would explain
/// anything.
#[expect(clippy::too_many_arguments, reason = "a point in a model, and what is asked of it")]
pub(crate) fn likeliest(
    effect: EffectId,
    engine: &Engine<'_>,
    columns: &Columns,
    values: &[f64],
    starts: &[[f64; 2]],
    windows: &Windows,
    here: &[Vec<f64>],
    joint: &Joint,
) -> Option<([f64; 2], Vec<Vec<f64>>)> {
    let range = columns.of_effect(effect)?;
    let depth = engine.size(&effect.spec().parameters[0]);
    let tried: Vec<[f64; 2]> = LENGTHS.into_iter().flat_map(places).collect();
    let gains = tried.into_par_iter().map(|[start, length]| {
        let mut placed = values.to_vec();
        placed[range.start + 1] = start;
        placed[range.start + 2] = length;
        let there = |w: &Window| {
            let run = &engine.recording.runs[w.segment];
            let middle = start + length / 2.0;
            let off = |share: &f64| (share - middle - (share - middle).round()).abs();
            run.lap_share[w.from..w.from + w.len].iter().any(|share| off(share) < length)
        };
        let slopes =
            quotient(engine, columns, &placed, starts, (windows, &there), here, (effect, range.start), depth);
        (joint.promise(engine, &slopes), [start, length], slopes)
    });
    let gains: Vec<_> = gains.collect();
    let best = gains.into_iter().max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(gain, ..)| *gain > 0.0)?;
    Some((best.1, best.2))
}
