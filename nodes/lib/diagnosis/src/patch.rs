//! Effects whose derivative vanishes where they are absent: what a finite size of them does.

use gripsight_model::Rollout;
use rayon::prelude::*;

use crate::engine::Engine;
use crate::joint::{Columns, Joint};
use gripsight_estimation::Windows;
use gripsight_model::EffectId;
use gripsight_model::Site;

/// Places tried along the lap, and the length tried, in shares of the lap.
const PLACES: usize = 12;
const LENGTH: f64 = 0.075;

/// The predictions with one column at `to` less those with it as it is, over the difference; window after window.
pub(crate) fn quotient(
    engine: &Engine<'_>,
    columns: &Columns,
    values: &[f64],
    starts: &[[f64; 2]],
    windows: &Windows,
    column: usize,
    to: f64,
) -> Vec<Vec<f64>> {
    let effect_of =
        |c: usize| columns.effects.iter().find(|e| columns.of_effect(**e).is_some_and(|r| r.contains(&c)));
    let own = effect_of(column).copied();
    let present = |e: EffectId| {
        let range = columns.of_effect(e).unwrap_or(0..0);
        Some(e) == own || range.zip(e.spec().parameters).any(|(c, p)| (values[c] - p.null).abs() > 1e-12)
    };
    let sites: Vec<Site> =
        Site::ALL.into_iter().filter(|r| columns.of_site(*r).any(|c| values[c] != 0.0)).collect();
    let (model, here, map) = columns.model(engine, values, present, &sites);
    let mut there = here.clone();
    let step = to - values[column];
    map.iter().zip(&mut there).filter(|(c, _)| **c == column).for_each(|(_, v)| *v = to);
    let run = |(window, start): (&gripsight_model::Window, &[f64; 2])| {
        let (mut a, mut b) = (Vec::new(), Vec::new());
        model.rollout(&here, *start, window, &mut a);
        model.rollout(&there, *start, window, &mut b);
        a.iter().zip(&b).map(|(a, b)| (b - a) / step).collect()
    };
    windows.windows.par_iter().zip(starts).map(run).collect()
}

/// Where a patch would explain most: its start and length, in shares of the lap, and what a depth there does; `None` where none would explain
/// anything.
pub(crate) fn likeliest(
    effect: EffectId,
    engine: &Engine<'_>,
    columns: &Columns,
    values: &[f64],
    starts: &[[f64; 2]],
    windows: &Windows,
    joint: &Joint,
) -> Option<([f64; 2], Vec<Vec<f64>>)> {
    let range = columns.of_effect(effect)?;
    let depth = engine.size(&effect.spec().parameters[0]);
    let gains = (0..PLACES).map(|i| {
        let start = i as f64 / PLACES as f64;
        let mut placed = values.to_vec();
        placed[range.start + 1] = start;
        placed[range.start + 2] = LENGTH;
        let slopes = quotient(engine, columns, &placed, starts, windows, range.start, depth);
        (joint.promise(engine, &slopes), start, slopes)
    });
    let best = gains.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(gain, ..)| *gain > 0.0)?;
    Some(([best.1, LENGTH], best.2))
}
