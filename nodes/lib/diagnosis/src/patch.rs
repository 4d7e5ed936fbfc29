//! Effects whose derivative vanishes where they are absent: what a finite size of them does.

use gripsight_model::Rollout;
use rayon::prelude::*;

use crate::columns::Columns;
use crate::engine::Engine;
use crate::joint::Joint;
use gripsight_estimation::Windows;
use gripsight_model::EffectId;
use gripsight_model::Site;

/// Places tried along the lap, and the length tried, in shares of the lap.
const PLACES: usize = 12;
const LENGTH: f64 = 0.075;

/// The predictions of a model as it is, window after window.
pub(crate) fn predictions(
    engine: &Engine<'_>,
    columns: &Columns,
    values: &[f64],
    starts: &[[f64; 2]],
    windows: &Windows,
    with: Option<EffectId>,
) -> Vec<Vec<f64>> {
    let present = |e: EffectId| {
        let range = columns.of_effect(e).unwrap_or(0..0);
        Some(e) == with || range.zip(e.spec().parameters).any(|(c, p)| (values[c] - p.null).abs() > 1e-12)
    };
    let sites: Vec<Site> =
        Site::ALL.into_iter().filter(|r| columns.of_site(*r).any(|c| values[c] != 0.0)).collect();
    let (model, own, _) = columns.model(engine, values, present, &sites);
    let run = |(window, start): (&gripsight_model::Window, &[f64; 2])| {
        let mut out = Vec::new();
        model.rollout(&own, *start, window, &mut out);
        out
    };
    windows.windows.par_iter().zip(starts).map(run).collect()
}

/// The predictions with one column of an effect at `to` less those as they are (`here`), over the difference; window after window.
#[expect(clippy::too_many_arguments, reason = "a point in a model, and where it goes")]
pub(crate) fn quotient(
    engine: &Engine<'_>,
    columns: &Columns,
    values: &[f64],
    starts: &[[f64; 2]],
    windows: &Windows,
    here: &[Vec<f64>],
    (effect, column): (EffectId, usize),
    to: f64,
) -> Vec<Vec<f64>> {
    let mut there = values.to_vec();
    there[column] = to;
    let step = to - values[column];
    let moved = predictions(engine, columns, &there, starts, windows, Some(effect));
    let over = |(a, b): (&Vec<f64>, Vec<f64>)| a.iter().zip(b).map(|(a, b)| (b - a) / step).collect();
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
    let gains = (0..PLACES).map(|i| {
        let start = i as f64 / PLACES as f64;
        let mut placed = values.to_vec();
        placed[range.start + 1] = start;
        placed[range.start + 2] = LENGTH;
        let slopes = quotient(engine, columns, &placed, starts, windows, here, (effect, range.start), depth);
        (joint.promise(engine, &slopes), start, slopes)
    });
    let best = gains.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(gain, ..)| *gain > 0.0)?;
    Some(([best.1, LENGTH], best.2))
}
