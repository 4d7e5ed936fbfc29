//! The hypotheses: every effect and every flexible term, there or not, with the prior of its size in either case.

use gripsight_estimation::selection::{ColumnPrior, Term};
use gripsight_model::{EffectId, HOLD, Site};

use crate::columns::Columns;
use crate::decisions;
use crate::engine::Engine;
use crate::priors::TIRE_BOUNDS;

/// The terms with their priors around the present values.
pub(crate) fn terms(
    engine: &Engine<'_>,
    columns: &Columns,
    values: &[f64],
    library: &[EffectId],
) -> Vec<Term> {
    let mean = engine.nominal.to_parameters();
    let tires = engine
        .trust
        .sigmas(&mean)
        .into_iter()
        .enumerate()
        .map(|(j, (sigma, _))| {
            let [low, high] = TIRE_BOUNDS[j % 4];
            ColumnPrior {
                offset: mean[j] - values[j],
                sigma: vec![sigma],
                bounds: [low - values[j], high - values[j]],
            }
        })
        .collect();
    let dt_s = engine.recording.dt_s();
    let [mean_s, sigma_s] = engine.hold_s();
    let hold = ColumnPrior {
        offset: mean_s - values[HOLD],
        sigma: vec![sigma_s],
        bounds: [-values[HOLD], 0.5 * dt_s - values[HOLD]],
    };
    let mut out = vec![
        Term { from: 0, priors: tires, log_weights: vec![0.0] },
        Term { from: HOLD, priors: vec![hold], log_weights: vec![0.0] },
    ];
    for &effect in &columns.effects {
        let range = columns.of_effect(effect).unwrap_or(0..0);
        let selectable = library.contains(&effect);
        let absent = engine.absent(effect);
        let priors = effect
            .spec()
            .parameters
            .iter()
            .enumerate()
            .map(|(i, spec)| {
                let (size, value) = (engine.size(spec), values[range.start + i]);
                let wide = decisions::WIDE * size;
                let narrow = if i >= effect.sizing() {
                    wide
                } else {
                    let usual = engine.usual(effect).unwrap_or(decisions::USUAL_SHARE * size);
                    // What no fit can know of a size, and what looks like the effect in any car, is nobody's fault either.
                    let recording = engine.recording;
                    let unknown = effect.spec().unknown;
                    let unknown = unknown.sigma(0.0, recording.dt_s(), recording.typical_speed_mps());
                    usual.hypot(unknown).hypot(effect.spec().spread * size)
                };
                // Where a place is has no usual value: it is looked for from where it promises most.
                let somewhere = effect.is_of_a_place() && i >= effect.sizing();
                ColumnPrior {
                    offset: if somewhere { 0.0 } else { absent[i] - value },
                    sigma: if selectable { vec![narrow, wide.max(narrow)] } else { vec![narrow] },
                    bounds: [
                        spec.null + spec.range[0] * size - value,
                        spec.null + spec.range[1] * size - value,
                    ],
                }
            })
            .collect();
        let log_weights =
            if selectable { vec![(1.0 - decisions::PRIOR).ln(), decisions::PRIOR.ln()] } else { vec![0.0] };
        out.push(Term { from: range.start, priors, log_weights });
    }
    for site in Site::ALL {
        let range = columns.of_site(site);
        let prior = decisions::PRIOR / range.len() as f64;
        for column in range.clone() {
            let prior_of = ColumnPrior {
                offset: -values[column],
                sigma: vec![decisions::usual_flexible(site, column - range.start), decisions::FLEXIBLE_WIDE],
                bounds: [f64::NEG_INFINITY, f64::INFINITY],
            };
            let log_weights = vec![(1.0 - prior).ln(), prior.ln()];
            out.push(Term { from: column, priors: vec![prior_of], log_weights });
        }
    }
    out
}
