//! What has changed between two drives of one car: every parameter is there in both drives, and its *difference* is what is asked for.
//!
//! Both drives are linearised in the same way. The parameters of the earlier drive theta and the differences delta are unknown
//! together; whatever either drive leaves unexplained is in the parameters and flexible terms of both, and only what one has and the other
//! has not is a change:
//!
//! ```text
//! cost(theta, delta) = cost_earlier(theta) / phi_earlier + cost_later(theta + delta) / phi_later
//! ```
//!
//! What two drives of an unchanged car differ by, since the model does not carry over from one stretch of road to another, is in [`Between`].

use std::ops::Range;

use gripsight_estimation::selection::{ColumnPrior, Quadratic, Selection, Term, configuration, select};
use gripsight_model::{BASE, EffectId, Site, TIRES};
use nalgebra::{DMatrix, DVector};

use crate::decisions;
use crate::engine::Engine;
use crate::frame::of_other_tires;

use crate::answer::Change;
use crate::between::Between;
use crate::infer::FIRST;
use crate::inferred::Inferred;
use crate::outcome::EffectParameter;
use crate::sizes::{Sized, half_widths_of_difference};
use crate::tire_change::ForceChange;
use crate::trust::TireTrust;

/// Share of a size that matters by which an effect may differ between two drives of a car that nobody has touched.
const SAME: f64 = 0.03;
/// Share of what is usual by which a flexible term may.
const SAME_FLEXIBLE: f64 = 0.5;
/// Standard deviation of a change of the tires, over that of tires that are the same.
const OTHER_TIRES: f64 = 10.0;
/// Of the draws of configurations.
pub(crate) const SEED: u64 = 23;
/// Share of a dispersion above which it is the same.
pub(crate) const SETTLED: f64 = 0.95;

/// The differences of two drives.
#[derive(Debug, Clone)]
pub(crate) struct Compared {
    selection: Selection,
    /// What each effect of the columns differs by, where it differs, with the half widths of 90 % intervals.
    by: Vec<Sized>,
    /// How many times larger than they may be the contradictions are that no change explains.
    pub(crate) dispersion: f64,
    terms: usize,
    /// What the tires of front and rear axle differ by, where they differ.
    tires: [ForceChange; 2],
}

/// Compares. `later`: the later drive, linearised in the same columns; `slip_rad`: of front and rear axle, at which their forces are compared.
pub(crate) fn compare(
    engine: &Engine<'_>,
    earlier: &Inferred,
    later: &Inferred,
    slip_rad: [f64; 2],
) -> Option<Compared> {
    let n = earlier.columns.len();
    let scaled = |of: &Inferred| Quadratic {
        information: &of.weighed.total.information / of.dispersion,
        gradient: &of.weighed.total.gradient / of.dispersion,
    };
    let (a, b) = (scaled(earlier), scaled(later));
    // The later drive was linearised elsewhere: its gradient where the earlier one was.
    let apart = DVector::from_fn(n, |i, _| earlier.values[i] - later.values[i]);
    let here = Quadratic { gradient: &b.gradient + &b.information * apart, information: b.information };
    let between = Between::of(earlier, later)?;
    // The columns: the earlier drive's parameters, their changes, and what else sets the later drive apart.
    let random = between.root.ncols();
    let mut both = DMatrix::zeros(n, 2 * n + random);
    both.view_mut((0, 0), (n, n)).fill_with_identity();
    both.view_mut((0, n), (n, n)).fill_with_identity();
    both.view_mut((0, 2 * n), (n, random)).copy_from(&between.root);
    let mut problem = Quadratic {
        information: both.tr_mul(&(&here.information * &both)),
        gradient: both.tr_mul(&here.gradient),
    };
    let mut of_earlier = problem.information.view_mut((0, 0), (n, n));
    of_earlier += &a.information;
    let mut of_earlier = problem.gradient.rows_mut(0, n);
    of_earlier += &a.gradient;
    let mut terms = earlier.terms.clone();
    terms.extend(differences(engine, earlier, between.of_one));
    let apart = ColumnPrior { offset: 0.0, sigma: vec![1.0], bounds: [f64::NEG_INFINITY, f64::INFINITY] };
    terms.push(Term { from: 2 * n, priors: vec![apart; random], log_weights: vec![0.0] });
    let mut start = earlier.selection.best.clone();
    start.resize(terms.len(), 0);
    // What the drives contradict each other by is at first all a failing of the model. What is so large that it stands out all the same is a change, explains
    // its share of the contradictions, and lets smaller ones stand out.
    let mut dispersion = between.dispersion(&here, &DVector::zeros(n));
    let mut selection = select(&problem, dispersion, &terms, &start, SEED)?;
    loop {
        let left = between.dispersion(&here, &selection.best_step.rows(n, n).into_owned());
        if left > SETTLED * dispersion {
            break;
        }
        dispersion = left;
        selection = select(&problem, dispersion, &terms, &selection.best, SEED)?;
    }
    // A difference that no effect does is worth a word only where it closes as much as free terms must in a drive by itself; so is an effect whose derivative
    // vanishes where it is absent, as no size of it is far from nothing or near.
    let asked = (groups(earlier, |e| e.spec().flat_at_null), later.weighed.cost / later.dispersion);
    while let Some(needless) = needless(&problem, dispersion, &terms, &selection.best, &asked) {
        for t in needless {
            terms[t] = terms[t].only(0);
        }
        let start: Vec<usize> =
            selection.best.iter().zip(&terms).map(|(a, t)| (*a).min(t.log_weights.len() - 1)).collect();
        selection = select(&problem, dispersion, &terms, &start, SEED)?;
    }
    Compared::of(engine, earlier, (&problem, &terms), (selection, dispersion), slip_rad)
}

/// A term's step with standard deviations where it is wide open.
fn wide(selection: &Selection, term: usize) -> Sized {
    let wide = selection.mean[term].len() - 1;
    (selection.mean[term][wide].clone(), selection.sigma[term][wide].clone())
}

/// Of groups of differences, each of which must close a share of an error to be worth a word, the one that closes least and too little.
fn needless(
    problem: &Quadratic,
    dispersion: f64,
    terms: &[Term],
    best: &[usize],
    (groups, all): &(Vec<Range<usize>>, f64),
) -> Option<Range<usize>> {
    let cost = |chosen: &[usize]| {
        let step = configuration(problem, dispersion, terms, chosen)?.step;
        Some(2.0 * problem.gradient.dot(&step) + (&problem.information * &step).dot(&step))
    };
    let whole = cost(best)?;
    let of = |differences: &Range<usize>| {
        let mut without = best.to_vec();
        without[differences.clone()].fill(0);
        let closes = (cost(&without).filter(|_| without != best)? - whole) / all;
        (closes < decisions::LEAST_CLOSED).then(|| (differences.clone(), closes))
    };
    let least = groups.iter().filter_map(of).min_by(|a, b| a.1.total_cmp(&b.1));
    least.map(|(differences, _)| differences)
}

/// The differences that no effect does, site by site, then the effects that are asked for, as places among the terms of both drives.
fn groups(earlier: &Inferred, asked: impl Fn(EffectId) -> bool) -> Vec<Range<usize>> {
    let effects = earlier.columns.effects.iter().filter(|e| asked(**e));
    let effects = effects.filter_map(|e| earlier.term_of(*e)).map(|t| t..t + 1);
    let sites = Site::ALL.into_iter().map(|site| earlier.terms_of_site(site));
    let of_both = |t: Range<usize>| t.start + earlier.terms.len()..t.end + earlier.terms.len();
    sites.chain(effects).map(of_both).collect()
}

/// The differences as terms: nothing to speak of, or a change. `of_one`: share of what is unexplained that belongs to one of the drives.
pub(crate) fn differences(engine: &Engine<'_>, earlier: &Inferred, of_one: f64) -> Vec<Term> {
    let n = earlier.columns.len();
    let unbounded = [f64::NEG_INFINITY, f64::INFINITY];
    let weights = || vec![(1.0 - decisions::PRIOR).ln(), decisions::PRIOR.ln()];
    let same = TireTrust::drive();
    let mean = engine.nominal.to_parameters();
    let tires = (0..TIRES)
        .map(|j| {
            let sigma = match j % 4 {
                0 => same.stiffness * mean[j],
                1 => same.shape,
                2 => same.peak * mean[j],
                _ => same.curvature,
            };
            ColumnPrior { offset: 0.0, sigma: vec![sigma, OTHER_TIRES * sigma], bounds: unbounded }
        })
        .collect();
    let hold =
        (TIRES..BASE).map(|_| ColumnPrior { offset: 0.0, sigma: vec![1e-4], bounds: unbounded }).collect();
    let mut out = vec![
        Term { from: n, priors: tires, log_weights: weights() },
        Term { from: n + TIRES, priors: hold, log_weights: vec![0.0] },
    ];
    for &effect in &earlier.columns.effects {
        let range = earlier.columns.of_effect(effect).unwrap_or(0..0);
        let open = earlier.is_open(effect);
        let prior = |(i, spec): (usize, &gripsight_model::ParameterSpec)| {
            let size = engine.size(spec);
            let (same, wide) = (SAME * size, decisions::WIDE * size);
            let same = if i < effect.sizing() { same } else { wide };
            // What the later drive has is a size that the effect can have: no lag goes back by more than there is of it.
            let before = earlier.values[range.start + i];
            ColumnPrior {
                offset: 0.0,
                sigma: if open { vec![same, wide] } else { vec![same] },
                bounds: spec.range.map(|r| spec.null + r * size - before),
            }
        };
        let priors = effect.spec().parameters.iter().enumerate().map(prior).collect();
        let log_weights = if open { weights() } else { vec![0.0] };
        out.push(Term { from: n + range.start, priors, log_weights });
    }
    for site in Site::ALL {
        let range = earlier.columns.of_site(site);
        let weight = decisions::PRIOR / range.len() as f64;
        // What the library lacks at a site depends on the ground: over another one it is as large, and another; two of
        // that size differ by sqrt 2 times it.
        let lacking = range.clone().map(|c| earlier.sizes.values[c].abs()).fold(0.0, f64::max);
        let apart = lacking * (2.0 * of_one).sqrt();
        let prior = |column: usize| {
            let same = apart.hypot(SAME_FLEXIBLE * decisions::usual_flexible(site, column - range.start));
            ColumnPrior {
                offset: 0.0,
                sigma: vec![same, same.hypot(decisions::FLEXIBLE_WIDE)],
                bounds: unbounded,
            }
        };
        out.extend(range.clone().map(|column| Term {
            from: n + column,
            priors: vec![prior(column)],
            log_weights: vec![(1.0 - weight).ln(), weight.ln()],
        }));
    }
    out
}

impl Compared {
    /// What a selection comes to.
    pub(crate) fn of(
        engine: &Engine<'_>,
        earlier: &Inferred,
        (problem, terms): (&Quadratic, &[Term]),
        (selection, dispersion): (Selection, f64),
        slip_rad: [f64; 2],
    ) -> Option<Self> {
        let n = earlier.columns.len();
        let of = |(i, &effect): (usize, &EffectId)| {
            let sized = wide(&selection, earlier.terms.len() + FIRST + i);
            (sized.0.clone(), half_widths_of_difference(engine, effect, &sized))
        };
        let by = earlier.columns.effects.iter().enumerate().map(of).collect();
        let tires = {
            let mut chosen = selection.best.clone();
            let place = earlier.terms.len();
            chosen[place] = terms[place].log_weights.len() - 1;
            let other = configuration(problem, dispersion, terms, &chosen)?;
            let columns: Vec<usize> = (0..TIRES).chain(n..n + TIRES).collect();
            let covariance = other.covariance().select_rows(&columns).select_columns(&columns);
            let before: Vec<f64> = (0..TIRES).map(|c| earlier.values[c] + other.step[c]).collect();
            let by = other.step.rows(n, TIRES);
            // The share of grip that matters.
            let sizes = of_other_tires().map(|e| engine.size(&e.spec().parameters[0]));
            let size = sizes.fold(0.0, f64::max);
            ForceChange::of_axles(size, [&before, by.as_slice()], &covariance, slip_rad)
        };
        Some(Self { selection, by, dispersion, terms: earlier.terms.len(), tires })
    }

    /// Probability that a term differs; none where no difference is asked for.
    fn probability(&self, term: usize) -> f64 {
        match &self.selection.probability[self.terms + term][..] {
            [_, .., differs] => *differs,
            _ => 0.0,
        }
    }

    /// Probability that an effect differs: that of the fit, and no more than the chance that such a size is a cause.
    pub(crate) fn of_effect(&self, earlier: &Inferred, effect: EffectId) -> f64 {
        let Some(term) = earlier.term_of(effect).filter(|_| earlier.is_open(effect)) else { return 0.0 };
        let told = self.standing_out(earlier, effect).map_or(0.0, |(_, told)| told);
        self.probability(term).min(decisions::chance(told))
    }

    /// Of an effect's parameters that size it the one whose difference stands out most, and by how many half widths of its 90 % interval it differs.
    pub(crate) fn standing_out(&self, earlier: &Inferred, effect: EffectId) -> Option<(usize, f64)> {
        let (by, half_widths) = self.by.get(earlier.term_of(effect)? - FIRST)?;
        let told = by.iter().zip(half_widths).map(|(d, half)| d.abs() / half);
        told.take(effect.sizing()).enumerate().max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Which terms differ in the most probable comparison.
    pub(crate) fn changed(&self) -> Vec<bool> {
        self.selection.best[self.terms..2 * self.terms].iter().map(|&c| c > 0).collect()
    }

    /// The earlier drive's model with what has changed: parameters and configuration.
    pub(crate) fn changed_model(&self, earlier: &Inferred) -> (Vec<f64>, Vec<usize>) {
        let n = earlier.values.len();
        let (mut values, mut chosen) = (earlier.values.clone(), earlier.chosen.clone());
        for (t, term) in earlier.terms.iter().enumerate().filter(|(t, _)| self.changed()[*t]) {
            chosen[t] = term.log_weights.len() - 1;
            let columns = term.from..term.from + term.priors.len();
            let step = self.selection.best_step.rows(n + term.from, term.priors.len());
            values[columns].iter_mut().zip(&step).for_each(|(v, by)| *v += by);
        }
        (values, chosen)
    }

    /// Parameters of the later drive there.
    pub(crate) fn later_values(&self, earlier: &Inferred) -> Vec<f64> {
        let (n, step) = (earlier.values.len(), &self.selection.best_step);
        (0..n).map(|c| earlier.values[c] + step[c] + step[n + c]).collect()
    }

    /// Probability that the tires differ.
    pub(crate) fn of_tires(&self) -> f64 {
        self.probability(0)
    }

    /// Probability that something differs at a site that no effect of the library does.
    pub(crate) fn of_site(&self, earlier: &Inferred, site: Site) -> f64 {
        let terms = earlier.terms_of_site(site);
        self.selection.probability_that(|c| c[self.terms..][terms.clone()].iter().any(|&a| a > 0))
    }

    /// Parameters of an effect in the earlier drive: as fitted to it where its model has the effect, else what both drives together make of them.
    pub(crate) fn earlier(&self, earlier: &Inferred, effect: EffectId) -> Option<Vec<f64>> {
        let range = earlier.columns.of_effect(effect)?;
        if earlier.chosen[earlier.term_of(effect)?] > 0 {
            return Some(earlier.values[range].to_vec());
        }
        Some(range.map(|c| earlier.values[c] + self.selection.best_step[c]).collect())
    }

    /// Differences of an effect's parameters, where it differs, and their standard deviations.
    pub(crate) fn difference(&self, earlier: &Inferred, effect: EffectId) -> Option<Sized> {
        Some(wide(&self.selection, self.terms + earlier.term_of(effect)?))
    }

    /// The difference of an effect as it is stated: of what is reported of it, else of the parameter that stands out most.
    fn stated(&self, earlier: &Inferred, effect: EffectId) -> Option<(&'static str, EffectParameter)> {
        let (spec, before) = (effect.spec(), self.earlier(earlier, effect)?);
        let (difference, half_widths) = self.by.get(earlier.term_of(effect)? - FIRST)?;
        let (most, _) = self.standing_out(earlier, effect)?;
        let parameter = &spec.parameters[most];
        let Some(reported) = spec.reported.first() else {
            let (value, half) = (difference[most], half_widths[most]);
            let (low, high) = (value - half, value + half);
            let before = Some(before[most]);
            return Some((
                parameter.name,
                EffectParameter { value, low, high, unit: parameter.unit, before },
            ));
        };
        let own = (reported.value)(&before);
        let after: Vec<f64> = before.iter().zip(difference).map(|(b, d)| b + d).collect();
        let (value, low, high) = reported.with_ends(&after, half_widths);
        let (value, low, high) = (value - own, low - own, high - own);
        Some((reported.name, EffectParameter { value, low, high, unit: reported.unit, before: Some(own) }))
    }

    /// Other tires, axle by axle. One of them has changed where the tires have; the other one where its own difference stands out.
    fn tire_changes(&self) -> Vec<Change> {
        let [front, rear] = &self.tires;
        let most = front.told().max(rear.told());
        let of = |(site, axle): (Site, &ForceChange)| {
            let alone = if axle.told() < most { decisions::chance(axle.told()) } else { 1.0 };
            Change {
                site: site.name(),
                name: "tires",
                parameter: Some("force_over_load"),
                at_slip_rad: Some(axle.slip_rad),
                difference: EffectParameter {
                    value: axle.by,
                    low: axle.by - axle.half_width,
                    high: axle.by + axle.half_width,
                    unit: "1",
                    before: Some(axle.before),
                },
                probability: self.of_tires().min(alone),
            }
        };
        [(Site::FrontAxle, front), (Site::RearAxle, rear)].map(of).to_vec()
    }

    /// All that is worth a word, the likeliest first.
    pub(crate) fn changes(&self, earlier: &Inferred) -> Vec<Change> {
        let nothing =
            |unit| EffectParameter { value: f64::NAN, low: f64::NAN, high: f64::NAN, unit, before: None };
        let mut out = self.tire_changes();
        for &effect in &earlier.columns.effects {
            let Some((parameter, difference)) = self.stated(earlier, effect) else { continue };
            out.push(Change {
                site: effect.spec().sites.first().map_or("", |s| s.name()),
                name: effect.name(),
                parameter: Some(parameter),
                at_slip_rad: None,
                difference,
                probability: self.of_effect(earlier, effect),
            });
        }
        for site in Site::ALL {
            let probability = self.of_site(earlier, site);
            out.push(Change {
                site: site.name(),
                name: "other",
                parameter: None,
                at_slip_rad: None,
                difference: nothing("1"),
                probability,
            });
        }
        out.retain(|c| c.probability >= decisions::LISTED);
        out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        out
    }
}
