//! Sizes of effects with their intervals: everything linearised once more, around the model that is left in the end.

use std::collections::BTreeMap;

use gripsight_estimation::Windows;
use gripsight_estimation::selection::{Quadratic, Term};
use gripsight_estimation::shooting::within;
use gripsight_model::EffectId;
use nalgebra::{DMatrix, DVector};

use crate::around::{Around, Refined};
use crate::columns::Columns;
use crate::decisions;
use crate::engine::Engine;
use crate::hypotheses::terms;
use crate::infer::FIRST;
use crate::joint::{Joint, Weighed};
use crate::outcome::EffectParameter;

/// Half width of a 90 % interval in standard deviations.
pub(crate) const NINETY: f64 = 1.645;

/// Parameters at the best model, and how well each is known there; not a number where the model does not have it.
#[derive(Debug, Clone)]
pub(crate) struct Sizes {
    pub(crate) values: Vec<f64>,
    pub(crate) sigma: Vec<f64>,
    /// Open effects that the model lacks, each as it would be if it alone were added.
    pub(crate) added: Vec<(EffectId, Sized)>,
}

/// Parameters of an effect with their standard deviations.
pub(crate) type Sized = (Vec<f64>, Vec<f64>);

impl Sizes {
    /// Values of which nothing is known.
    pub(crate) fn unknown(values: Vec<f64>) -> Self {
        Self { sigma: vec![f64::NAN; values.len()], values, added: Vec::new() }
    }

    /// Linearises around a fitted configuration, and takes one more step there.
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
        let mut out = Self::unknown(fitted.values.clone());
        let own = active(around, &terms, chosen);
        let Stepped { step, sigma, .. } = stepped(&weighed, around.dispersion, &own)?;
        for (i, a) in own.iter().enumerate() {
            out.values[a.column] += step[i];
            out.sigma[a.column] = sigma[i];
        }
        let lacking = |(i, effect): (usize, &EffectId)| {
            let (term, range) = (FIRST + i, columns.of_effect(*effect)?);
            // Later parameters shape it, and show only where it is.
            let seen = range.clone().take(effect.sizing()).all(|c| weighed.total.information[(c, c)] > 0.0);
            if chosen[term] > 0 || terms[term].log_weights.len() == 1 || !seen {
                return None;
            }
            let mut fuller = chosen.to_vec();
            fuller[term] = 1;
            let all = active(around, &terms, &fuller);
            let Stepped { step, sigma, .. } = stepped(&weighed, around.dispersion, &all)?;
            let own = all.iter().enumerate().filter(|(_, a)| range.contains(&a.column));
            Some((*effect, own.map(|(i, a)| (fitted.values[a.column] + step[i], sigma[i])).unzip()))
        };
        out.added = columns.effects.iter().enumerate().filter_map(lacking).collect();
        out.values.iter().all(|v| v.is_finite()).then_some(out)
    }

    /// Parameters of an effect; `None` where it could not be added to the model.
    pub(crate) fn effect(&self, columns: &Columns, effect: EffectId) -> Option<Sized> {
        let range = columns.of_effect(effect)?;
        let sigma = self.sigma.get(range.clone())?.to_vec();
        let own = sigma.iter().all(|s| s.is_finite()).then(|| (self.values[range].to_vec(), sigma));
        own.or_else(|| self.added.iter().find(|(e, _)| *e == effect).map(|(_, sized)| sized.clone()))
    }
}

/// Covariance of some columns of the model without any effect, as [`Sizes`] has their standard deviations, row after row.
pub(crate) fn own_covariance(
    around: &Around<'_, '_>,
    weighed: &Weighed,
    columns: &[usize],
) -> Option<Vec<Vec<f64>>> {
    let active = active(around, around.terms, &vec![0; around.terms.len()]);
    let Stepped { inverse, sigma, .. } = stepped(weighed, around.dispersion, &active)?;
    let places = columns.iter().map(|c| active.iter().position(|a| a.column == *c));
    let places: Vec<usize> = places.collect::<Option<_>>()?;
    // Correlations are the posterior's.
    let wider = |i: usize| sigma[i] / inverse[(i, i)].sqrt();
    let row = |&i: &usize| places.iter().map(|&j| inverse[(i, j)] * wider(i) * wider(j)).collect();
    Some(places.iter().map(row).collect())
}

/// Where the columns of a configuration go by one step.
struct Stepped {
    step: DVector<f64>,
    /// Posterior covariance.
    inverse: DMatrix<f64>,
    sigma: Vec<f64>,
}

/// The step of a configuration's columns within their bounds, with their standard deviations: the larger of those of the posterior and of a
/// sandwich with blocks as clusters (errors that are alike within a block), which has a t distribution over so few blocks. Both are of columns that no
/// bound holds: where the little of an effect ends is no knowledge of what is beside it.
fn stepped(weighed: &Weighed, phi: f64, active: &[Active]) -> Option<Stepped> {
    let n = active.len();
    let prior = DVector::from_iterator(n, active.iter().map(|a| a.precision));
    let info =
        |q: &Quadratic| DMatrix::from_fn(n, n, |r, c| q.information[(active[r].column, active[c].column)]);
    let slope = |q: &Quadratic| DVector::from_iterator(n, active.iter().map(|a| q.gradient[a.column]));
    let precision = info(&weighed.total) / phi + DMatrix::from_diagonal(&prior);
    let gradient = slope(&weighed.total) / phi - DVector::from_fn(n, |i, _| prior[i] * active[i].offset);
    let [low, high] = [0, 1].map(|side| DVector::from_iterator(n, active.iter().map(|a| a.bounds[side])));
    let step = within(&precision, &gradient, &low, &high)?;
    let inverse = precision.cholesky()?.inverse();
    let unbound = -(&inverse * gradient);
    let mut scatter = DMatrix::from_diagonal(&prior);
    let blocks = weighed.blocks.len() as f64;
    let few = blocks / (blocks - 1.0).max(1.0) / (phi * phi);
    for block in &weighed.blocks {
        let score = slope(block) + info(block) * &unbound;
        scatter += &score * score.transpose() * few;
    }
    let sandwich = &inverse * scatter * &inverse;
    let wider = ninety_of_t(blocks - 1.0) / NINETY;
    let sigma = |i: usize| inverse[(i, i)].max(0.0).sqrt().max(wider * sandwich[(i, i)].max(0.0).sqrt());
    let sigma = (0..n).map(sigma).collect();
    Some(Stepped { step, inverse, sigma })
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
pub(crate) fn ninety_of_t(degrees: f64) -> f64 {
    const TABLE: [f64; 10] = [6.314, 2.920, 2.353, 2.132, 2.015, 1.943, 1.895, 1.860, 1.833, 1.812];
    let place = degrees.max(1.0) as usize - 1;
    TABLE.get(place).copied().unwrap_or(NINETY + 0.167 * 10.0 / degrees)
}

/// An effect's parameters, each with the half width of its interval.
pub(crate) fn with_half_widths(engine: &Engine<'_>, effect: EffectId, sized: &Sized) -> Vec<(f64, f64)> {
    sized.0.iter().copied().zip(half_widths(engine, effect, sized)).collect()
}

/// Half widths of the 90 % intervals of an effect's parameters: what the fit knows, what no fit can know, errors of the model that all data share, and
/// what is found in cars without the effect.
fn half_widths(engine: &Engine<'_>, effect: EffectId, (own, sigma): &Sized) -> Vec<f64> {
    let spec = effect.spec();
    let recording = engine.recording;
    let half = |((v, s), p): ((&f64, &f64), &gripsight_model::ParameterSpec)| {
        let size = v - p.null;
        let shared = decisions::SHARED_ERROR * size.hypot(engine.size(p));
        let unknown = spec.unknown.sigma(size, recording.dt_s(), recording.typical_speed_mps());
        let spread = if spec.usual.is_none() { spec.spread * engine.size(p) } else { 0.0 };
        NINETY * s.hypot(shared).hypot(unknown).hypot(spread)
    };
    own.iter().zip(sigma).zip(spec.parameters).map(half).collect()
}

/// Half widths of the 90 % intervals of what an effect's parameters differ by between two drives: as of an effect of that size.
pub(crate) fn half_widths_of_difference(
    engine: &Engine<'_>,
    effect: EffectId,
    (by, sigma): &Sized,
) -> Vec<f64> {
    let size = by.iter().zip(effect.spec().parameters).map(|(by, p)| p.null + by);
    half_widths(engine, effect, &(size.collect(), sigma.clone()))
}

/// How many half widths of its interval an effect's size is away from what it is where it is absent: of the parameters that size it the largest.
pub(crate) fn told(engine: &Engine<'_>, effect: EffectId, sized: &Sized) -> f64 {
    let absent = engine.absent(effect);
    let spec = effect.spec();
    // Of what every car has a little of, that little is as good as nothing; its size it is all the same.
    let usual = if spec.usual.is_some() { NINETY * spec.spread } else { 0.0 };
    let away = |(i, half): (usize, &f64)| {
        (sized.0[i] - absent[i]).abs() / half.hypot(usual * engine.size(&spec.parameters[i]))
    };
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
            let (value, low, high) = r.with_ends(own, &halves);
            (r.name, EffectParameter { value, low, high, unit: r.unit, before: given.map(r.value) })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_its_bound_holds_moves_nothing_beside_it() {
        // Two columns that are alike, in two blocks; what is left asks for less of the second than nothing.
        const INFORMATION: [f64; 4] = [10.0, 8.0, 8.0, 10.0];
        let block = |gradient: [f64; 2]| Quadratic {
            information: DMatrix::from_row_slice(2, 2, &INFORMATION),
            gradient: DVector::from_row_slice(&gradient),
        };
        let blocks = vec![block([-1.0, 3.0]), block([-1.2, 3.2])];
        let total = Quadratic {
            information: blocks.iter().map(|b| &b.information).sum(),
            gradient: blocks.iter().map(|b| &b.gradient).sum(),
        };
        let weighed = Weighed { total, blocks, cost: 0.0, residuals: 0.0 };
        let stepped = |low: f64| {
            let free = Active { column: 0, precision: 0.0, offset: 0.0, bounds: [-9.0, 9.0] };
            stepped(
                &weighed,
                1.0,
                &[free, Active { column: 1, precision: 0.0, offset: 0.0, bounds: [low, 9.0] }],
            )
            .unwrap()
        };
        let (open, held) = (stepped(-9.0), stepped(0.0));
        assert!(open.step[1] < -0.5 && open.step[0] > 0.5, "{:?}", open.step);
        assert_eq!(held.step[1], 0.0);
        approx::assert_relative_eq!(held.step[0], 2.2 / 20.0, epsilon = 1e-12);
        assert_eq!((held.sigma, held.inverse), (open.sigma, open.inverse));
    }

    #[test]
    fn the_spread_of_each_effect_is_that_of_the_development_cases() {
        let path =
            concat!(env!("CARGO_MANIFEST_DIR"), "/../../../tests/results/withheld/development_spread.csv");
        let table = std::fs::read_to_string(path).unwrap();
        let mut largest = BTreeMap::<&str, f64>::new();
        for line in table.lines().skip(1) {
            let cells: Vec<&str> = line.split(',').collect();
            let spread = largest.entry(cells[0]).or_default();
            *spread = spread.max(cells[4].parse().unwrap());
        }
        assert!(largest.len() > 30, "{}", largest.len());
        for effect in EffectId::candidates() {
            let of_table = largest.get(effect.name()).copied().unwrap_or(0.0);
            assert!((effect.spec().spread - of_table).abs() < 0.006, "{}: {of_table}", effect.name());
        }
    }
}
