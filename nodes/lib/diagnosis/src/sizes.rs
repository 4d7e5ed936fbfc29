//! Sizes of effects with their intervals: everything linearised once more, around the model that is left in the end.

use std::collections::BTreeMap;

use gripsight_estimation::Windows;
use gripsight_estimation::selection::{Quadratic, Term};
use gripsight_model::EffectId;
use nalgebra::{DMatrix, DVector};

use crate::around::{Around, Refined};
use crate::decisions;
use crate::engine::Engine;
use crate::hypotheses::terms;
use crate::joint::{Columns, Joint};
use crate::outcome::EffectParameter;

/// Half width of a 90 % interval in standard deviations.
pub(crate) const NINETY: f64 = 1.645;

/// Parameters at the best model, and how well each is known there; not a number where the model does not have it.
#[derive(Debug, Clone)]
pub(crate) struct Sizes {
    pub(crate) values: Vec<f64>,
    pub(crate) sigma: Vec<f64>,
}

/// Parameters of an effect with their standard deviations.
pub(crate) type Sized = (Vec<f64>, Vec<f64>);

impl Sizes {
    /// Linearises around a fitted configuration, and takes one more step there. Standard deviations are the larger of those of the posterior and
    /// of a sandwich with blocks as clusters (errors that are alike within a block), which has a t distribution over so few blocks.
    pub(crate) fn of(
        around: &Around<'_, '_>,
        library: &[EffectId],
        chosen: &[usize],
        fitted: &Refined,
        windows: &Windows,
    ) -> Option<Self> {
        let (engine, columns) = (around.engine, around.columns);
        let joint = Joint::around(engine, columns, &fitted.values, &fitted.starts, windows)?;
        let weighed = joint.weighed(&vec![1.0; engine.sigma.len()]);
        let terms = terms(engine, columns, &fitted.values, library);
        let active = active(around, &terms, chosen);
        let n = active.len();
        let phi = around.dispersion;
        let prior = DVector::from_iterator(n, active.iter().map(|a| a.precision));
        let info = |q: &Quadratic| {
            DMatrix::from_fn(n, n, |r, c| q.information[(active[r].column, active[c].column)])
        };
        let slope = |q: &Quadratic| DVector::from_iterator(n, active.iter().map(|a| q.gradient[a.column]));
        let precision = info(&weighed.total) / phi + DMatrix::from_diagonal(&prior);
        let inverse = precision.cholesky()?.inverse();
        let pull = DVector::from_fn(n, |i, _| prior[i] * active[i].offset) - slope(&weighed.total) / phi;
        let step = &inverse * pull;
        let mut scatter = DMatrix::from_diagonal(&prior);
        let blocks = weighed.blocks.len() as f64;
        let few = blocks / (blocks - 1.0).max(1.0) / (phi * phi);
        for block in &weighed.blocks {
            let score = slope(block) + info(block) * &step;
            scatter += &score * score.transpose() * few;
        }
        let sandwich = &inverse * scatter * &inverse;
        let wider = ninety_of_t(blocks - 1.0) / NINETY;
        let mut out = Self { values: fitted.values.clone(), sigma: vec![f64::NAN; columns.len()] };
        for (i, a) in active.iter().enumerate() {
            out.values[a.column] += step[i].clamp(a.bounds[0], a.bounds[1]);
            out.sigma[a.column] =
                inverse[(i, i)].max(0.0).sqrt().max(wider * sandwich[(i, i)].max(0.0).sqrt());
        }
        out.values.iter().all(|v| v.is_finite()).then_some(out)
    }

    /// Parameters of an effect; `None` where the model does not have it.
    pub(crate) fn effect(&self, columns: &Columns, effect: EffectId) -> Option<Sized> {
        let range = columns.of_effect(effect)?;
        let sigma = self.sigma.get(range.clone())?.to_vec();
        sigma.iter().all(|s| s.is_finite()).then(|| (self.values[range].to_vec(), sigma))
    }
}

/// A column that the model has.
struct Active {
    column: usize,
    precision: f64,
    /// Mean of the prior, and the bounds, less the present value.
    offset: f64,
    bounds: [f64; 2],
}

fn active(around: &Around<'_, '_>, terms: &[Term], chosen: &[usize]) -> Vec<Active> {
    let in_use = around.in_use(chosen);
    let of = |(term, &alternative): (&Term, &usize)| {
        let from = term.from;
        let each = |(k, p): (usize, &gripsight_estimation::selection::ColumnPrior)| Active {
            column: from + k,
            precision: p.sigma[alternative].powi(-2),
            offset: p.offset,
            bounds: p.bounds,
        };
        term.priors.iter().enumerate().map(each).collect::<Vec<_>>()
    };
    terms.iter().zip(chosen).flat_map(of).filter(|a| in_use[a.column]).collect()
}

/// The 95 % quantile of Student's t distribution: tabled up to ten degrees of freedom, where it is within 10 % of the normal's.
fn ninety_of_t(degrees: f64) -> f64 {
    const TABLE: [f64; 10] = [6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860, 1.833, 1.812];
    let place = degrees.max(1.0) as usize - 1;
    TABLE.get(place).copied().unwrap_or(NINETY + 0.167 * 10.0 / degrees)
}

/// Half widths of the 90 % intervals of an effect's parameters: what the fit knows, what no fit can know, and errors of the model that all data share.
fn half_widths(engine: &Engine<'_>, effect: EffectId, (own, sigma): &Sized) -> Vec<f64> {
    let spec = effect.spec();
    let recording = engine.recording;
    let half = |((v, s), p): ((&f64, &f64), &gripsight_model::ParameterSpec)| {
        let size = v - p.null;
        let shared = decisions::SHARED_ERROR * size.hypot(engine.size(p));
        let unknown = spec.unknown.sigma(size, recording.dt_s(), recording.typical_speed_mps());
        NINETY * s.hypot(shared).hypot(unknown)
    };
    own.iter().zip(sigma).zip(spec.parameters).map(half).collect()
}

/// How many half widths of its interval an effect's size is away from what it is where it is absent: of the parameters that size it the largest.
pub(crate) fn told(engine: &Engine<'_>, effect: EffectId, sized: &Sized) -> f64 {
    let absent = engine.absent(effect);
    let away = |(i, half): (usize, &f64)| (sized.0[i] - absent[i]).abs() / half;
    half_widths(engine, effect, sized).iter().enumerate().take(effect.sizing()).map(away).fold(0.0, f64::max)
}

/// Parameters of an effect as reported, with 90 % intervals.
pub(crate) fn reported(
    engine: &Engine<'_>,
    effect: EffectId,
    sized: &Sized,
) -> BTreeMap<&'static str, EffectParameter> {
    let spec = effect.spec();
    let own = &sized.0;
    let halves = half_widths(engine, effect, sized);
    let given = engine.given(effect);
    if spec.reported.is_empty() {
        let one = |(i, p): (usize, &gripsight_model::ParameterSpec)| {
            let (value, half) = (own[i], halves[i]);
            let before = given.map(|given| given[i]);
            (p.name, EffectParameter { value, low: value - half, high: value + half, unit: p.unit, before })
        };
        return spec.parameters.iter().enumerate().map(one).collect();
    }
    spec.reported
        .iter()
        .map(|r| {
            let value = (r.value)(own);
            // Ends from moving each fitted parameter by its own interval.
            let (mut low, mut high) = (value, value);
            for i in 0..own.len() {
                for sign in [-1.0, 1.0] {
                    let mut moved = own.clone();
                    moved[i] += sign * if halves[i].is_finite() { halves[i] } else { 0.0 };
                    let v = (r.value)(&moved);
                    (low, high) = (low.min(v), high.max(v));
                }
            }
            (r.name, EffectParameter { value, low, high, unit: r.unit, before: given.map(r.value) })
        })
        .collect()
}
