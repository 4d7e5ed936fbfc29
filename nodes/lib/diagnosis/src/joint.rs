//! Everything at once: tires, effects and flexible terms of all sites linearised together around the present model.

use std::ops::Range;

use gripsight_vehicle::{Dual, Real};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::columns::Columns;
use crate::engine::{Engine, ROBUST_K};
use gripsight_estimation::Windows;
use gripsight_estimation::selection::Quadratic;
use gripsight_model::{EffectId, ExtendedModel, Rollout, Site, Window};

/// One window around the present model.
#[derive(Debug, Clone)]
struct Part {
    /// (measured - predicted) over the engine's sigma, sample after sample, channel after channel.
    residual: DVector<f64>,
    /// Derivatives of the prediction over sigma (N x P).
    jacobian: DMatrix<f64>,
    /// The same by the start state (N x 2).
    start: DMatrix<f64>,
    /// Which channel each row belongs to.
    channel: Vec<usize>,
    /// Place of each row in the layout of the model: what is not measured has none.
    kept: Vec<usize>,
}

/// The joint problem around a model.
#[derive(Debug, Clone)]
pub(crate) struct Joint {
    parts: Vec<Part>,
    block: Vec<usize>,
    channels: usize,
    columns: usize,
    /// Columns that were linearised; the others have no derivatives.
    linearised: Vec<usize>,
}

/// The joint problem with its noise, block by block.
#[derive(Debug, Clone)]
pub(crate) struct Weighed {
    pub(crate) total: Quadratic,
    pub(crate) blocks: Vec<Quadratic>,
    /// Weighted sum of squares, and how many residuals it has.
    pub(crate) cost: f64,
    pub(crate) residuals: f64,
}

/// Columns that are worked on together: the derivatives of a number are of fixed count.
const LANES: usize = 24;

impl Joint {
    /// Linearises all columns at `values`, from given start states. Terms that are absent there are run only where their own columns are looked at.
    pub(crate) fn around(
        engine: &Engine<'_>,
        columns: &Columns,
        values: &[f64],
        starts: &[[f64; 2]],
        windows: &Windows,
    ) -> Option<Self> {
        Self::of_sites(engine, columns, values, starts, windows, &Site::ALL)
    }

    /// The same, of flexible terms only those of some sites, and those that are there.
    pub(crate) fn of_sites(
        engine: &Engine<'_>,
        columns: &Columns,
        values: &[f64],
        starts: &[[f64; 2]],
        windows: &Windows,
        asked: &[Site],
    ) -> Option<Self> {
        let present = |e: EffectId| {
            let range = columns.of_effect(e).unwrap_or(0..0);
            range.zip(e.spec().parameters).any(|(c, p)| (values[c] - p.null).abs() > 1e-12)
        };
        let open: Vec<Site> =
            Site::ALL.into_iter().filter(|r| columns.of_site(*r).any(|c| values[c] != 0.0)).collect();
        let is_asked = |r: &Site| asked.contains(r) || open.contains(r);
        let elsewhere: Vec<Range<usize>> =
            Site::ALL.into_iter().filter(|r| !is_asked(r)).map(|r| columns.of_site(r)).collect();
        let seeds: Vec<Range<usize>> = columns
            .chunks(LANES)
            .into_iter()
            .filter(|seeds| !elsewhere.iter().any(|range| overlap(range, seeds)))
            .collect();
        let models: Vec<_> = seeds
            .iter()
            .map(|seeds| {
                let here = |e: EffectId| {
                    columns.of_effect(e).is_some_and(|r| r.start >= seeds.start && r.end <= seeds.end)
                };
                let sites: Vec<Site> = Site::ALL
                    .into_iter()
                    .filter(|r| open.contains(r) || overlap(&columns.of_site(*r), seeds))
                    .collect();
                columns.model(engine, values, |e| present(e) || here(e), &sites)
            })
            .collect();
        let channels = engine.recording.channels.len();
        let mut parts: Vec<Part> = windows
            .windows
            .par_iter()
            .zip(starts)
            .map(|(window, start)| {
                let mut measured = Vec::new();
                models[0].0.measured(window, &mut measured);
                let kept: Vec<usize> = (0..measured.len()).filter(|&i| !measured[i].is_nan()).collect();
                let n = kept.len();
                let mut part = Part {
                    residual: DVector::zeros(n),
                    jacobian: DMatrix::zeros(n, columns.len()),
                    start: DMatrix::zeros(n, 2),
                    channel: kept.iter().map(|i| i % channels).collect(),
                    kept: Vec::new(),
                };
                let mut predicted = Vec::new();
                for (number, (seeds, (model, own, map))) in seeds.iter().zip(&models).enumerate() {
                    seeded(model, own, map, seeds, *start, window, &mut predicted);
                    for (row, &i) in kept.iter().enumerate() {
                        let sigma = engine.sigma[i % channels];
                        let derivatives = predicted[i].derivatives();
                        for (lane, column) in seeds.clone().enumerate() {
                            part.jacobian[(row, column)] = derivatives[lane] / sigma;
                        }
                        if number == 0 {
                            part.residual[row] = (measured[i] - predicted[i].re()) / sigma;
                            for s in 0..2 {
                                part.start[(row, s)] = derivatives[LANES + s] / sigma;
                            }
                        }
                    }
                }
                part.kept = kept;
                part
            })
            .collect();
        // A window in which the model runs away tells nothing, and would drown all others.
        let lost = parts.iter_mut().filter(|p| !p.is_calm()).map(Part::blank).count();
        let finite = 2 * lost < parts.len();
        let (block, columns) = (windows.block.clone(), columns.len());
        finite.then(|| Self {
            parts,
            block,
            channels,
            columns,
            linearised: seeds.into_iter().flatten().collect(),
        })
    }

    /// What is left of each sample beyond what another recording of the same windows leaves of it; samples that one of them lacks are left out.
    pub(crate) fn beyond(self, other: &Self) -> Self {
        let parts = self.parts.iter().zip(&other.parts).map(|(part, other)| part.beyond(other)).collect();
        Self { parts, ..self }
    }

    /// Puts a column's difference quotient in place of its derivative: for an effect whose derivative vanishes where it is absent. `differences`:
    /// predictions with the effect less those without, over its value, window after window in the layout of the model.
    pub(crate) fn with_column(&mut self, engine: &Engine<'_>, column: usize, slopes: &[Vec<f64>]) {
        for (part, slope) in self.parts.iter_mut().zip(slopes) {
            for (row, (&place, &channel)) in part.kept.iter().zip(&part.channel).enumerate() {
                part.jacobian[(row, column)] = slope[place] / engine.sigma[channel];
            }
        }
    }

    /// What a column of difference quotients would take off the sum of squares by a step up, everything but the start states as it is.
    pub(crate) fn promise(&self, engine: &Engine<'_>, slopes: &[Vec<f64>]) -> f64 {
        let one = vec![1.0; self.channels];
        let (mut product, mut square) = (0.0, 0.0);
        // Where nothing comes of it nothing is promised.
        let felt = self.parts.iter().zip(slopes).filter(|(_, slope)| slope.iter().any(|s| *s != 0.0));
        for (part, slope) in felt {
            let column = DMatrix::from_fn(part.kept.len(), 1, |r, _| {
                slope[part.kept[r]] / engine.sigma[part.channel[r]]
            });
            let alone = Part { jacobian: column, ..part.without_columns() };
            let (residual, jacobian, _) = alone.projected(&one);
            product += jacobian.column(0).dot(&residual);
            square += jacobian.norm_squared();
        }
        if product > 0.0 && square > 0.0 { product * product / square } else { 0.0 }
    }

    /// The windows of each block.
    fn blocks(&self) -> Vec<Vec<usize>> {
        let mut out: Vec<(usize, Vec<usize>)> = Vec::new();
        for (k, &b) in self.block.iter().enumerate() {
            match out.last_mut().filter(|l| l.0 == b) {
                Some(last) => last.1.push(k),
                None => out.push((b, vec![k])),
            }
        }
        out.into_iter().map(|b| b.1).collect()
    }

    /// The problem where channel `c` has `scale[c]` times the noise that it was linearised with.
    pub(crate) fn weighed(&self, scale: &[f64]) -> Weighed {
        let n = self.columns;
        let zero = || Quadratic { information: DMatrix::zeros(n, n), gradient: DVector::zeros(n) };
        let parts: Vec<(Quadratic, f64, f64)> = self
            .blocks()
            .par_iter()
            .map(|members| {
                let reduced: Vec<_> =
                    members.iter().map(|&k| self.parts[k].reduced(scale, &self.linearised)).collect();
                let rows: usize = reduced.iter().map(|r| r.0.len()).sum();
                let mut tall = DMatrix::zeros(rows, self.linearised.len());
                let mut side = DVector::zeros(rows);
                let (mut at, mut cost) = (0, 0.0);
                for (residual, jacobian, loss) in &reduced {
                    tall.rows_mut(at, residual.len()).copy_from(jacobian);
                    side.rows_mut(at, residual.len()).copy_from(residual);
                    at += residual.len();
                    cost += loss;
                }
                // A product of matrices is blocked, one with a transpose is not.
                let across = tall.transpose();
                let (product, square) = (&across * &side, across * tall);
                let mut block = zero();
                for (i, &a) in self.linearised.iter().enumerate() {
                    block.gradient[a] = -product[i];
                    for (j, &b) in self.linearised.iter().enumerate() {
                        block.information[(a, b)] = square[(i, j)];
                    }
                }
                (block, cost, rows as f64)
            })
            .collect();
        let mut out = Weighed { total: zero(), blocks: Vec::new(), cost: 0.0, residuals: 0.0 };
        for (block, cost, rows) in parts {
            out.total.information += &block.information;
            out.total.gradient += &block.gradient;
            out.blocks.push(block);
            out.cost += cost;
            out.residuals += rows;
        }
        out
    }

    /// Mean square of what a step leaves of each channel, in units of the engine's sigma: median over windows.
    pub(crate) fn left_by_channel(&self, step: &DVector<f64>) -> Vec<f64> {
        let one = vec![1.0; self.channels];
        let of_part = |part: &Part| {
            let (residual, jacobian, _) = part.projected(&one);
            let left = residual - jacobian * step;
            let mut sums = vec![(0.0, 0.0); self.channels];
            for (v, &c) in left.iter().zip(&part.channel) {
                sums[c].0 += v * v;
                sums[c].1 += 1.0;
            }
            sums
        };
        let mut squares = vec![Vec::with_capacity(self.parts.len()); self.channels];
        for sums in self.parts.par_iter().map(of_part).collect::<Vec<_>>() {
            for (c, (s, n)) in sums.into_iter().enumerate().filter(|(_, s)| s.1 > 0.0) {
                squares[c].push(s / n);
            }
        }
        squares.into_iter().map(|s| if s.is_empty() { 1.0 } else { gripsight_model::median(s) }).collect()
    }
}

/// A model looked at by plain rollouts, its derivatives those of a linearisation nearby.
#[derive(Debug, Clone)]
pub(crate) struct Trial {
    /// Robust weighted sum of squares, start states at their best.
    pub(crate) cost: f64,
    /// Half its derivative by each of the columns asked for.
    pub(crate) gradient: DVector<f64>,
    /// How far the best start states are from those given.
    pub(crate) shifts: Vec<[f64; 2]>,
}

impl Joint {
    /// Looks at a model of some of the columns with its `own` values. `scale`: noise of each channel over that of the linearisation; the engine's
    /// noise is the present one.
    pub(crate) fn trial(
        &self,
        engine: &Engine<'_>,
        (model, own): (&ExtendedModel<'_>, &[f64]),
        starts: &[[f64; 2]],
        windows: &Windows,
        scale: &[f64],
        by: &[usize],
    ) -> Option<Trial> {
        let parts: Vec<(f64, DVector<f64>, [f64; 2])> = self
            .parts
            .par_iter()
            .zip(&windows.windows)
            .zip(starts)
            .map(|((part, window), start)| {
                let (mut measured, mut predicted) = (Vec::new(), Vec::new());
                model.measured(window, &mut measured);
                model.rollout(own, *start, window, &mut predicted);
                let kept = measured.iter().zip(&predicted).filter(|(m, _)| !m.is_nan());
                let residual = DVector::from_iterator(
                    part.channel.len(),
                    kept.zip(&part.channel).map(|((m, p), &c)| (m - p) / engine.sigma[c]),
                );
                part.looked_at(residual, scale, by)
            })
            .collect();
        let shifts = parts.iter().map(|p| p.2).collect();
        let zero = (0.0, DVector::zeros(by.len()));
        let (cost, gradient) = parts.iter().fold(zero, |(c, g), p| (c + p.0, g + &p.1));
        let out = Trial { cost, gradient, shifts };
        (out.cost.is_finite() && out.gradient.iter().all(|g| g.is_finite())).then_some(out)
    }
}

/// Derivative of a prediction, in units of the noise for a unit of a parameter, from which a rollout has run away: half a second of any car with
/// any tires stays below by orders of magnitude.
const RUN_AWAY: f64 = 1e7;

impl Part {
    fn is_calm(&self) -> bool {
        let calm = |v: &f64| v.is_finite() && v.abs() < RUN_AWAY;
        self.residual.iter().chain(self.jacobian.iter()).chain(self.start.iter()).all(calm)
    }

    fn beyond(&self, other: &Self) -> Self {
        let place = |row: &usize| other.kept.binary_search(&self.kept[*row]).ok();
        let rows: Vec<usize> = (0..self.kept.len()).filter(|row| place(row).is_some()).collect();
        let left = rows.iter().map(|row| self.residual[*row] - place(row).map_or(0.0, |o| other.residual[o]));
        let mut out = Self {
            residual: DVector::from_iterator(rows.len(), left),
            jacobian: self.jacobian.select_rows(&rows),
            start: self.start.select_rows(&rows),
            channel: rows.iter().map(|&row| self.channel[row]).collect(),
            kept: rows.iter().map(|&row| self.kept[row]).collect(),
        };
        // Where either model runs away nothing is told.
        if [self, other].iter().any(|part| part.start.iter().all(|s| *s == 0.0)) {
            out.blank();
        }
        out
    }

    /// The window with nothing said.
    fn blank(&mut self) {
        self.residual.fill(0.0);
        self.jacobian.fill(0.0);
        self.start.fill(0.0);
    }

    /// Cost, half its gradient, and the shift of the start state, for other residuals under the present noise.
    fn looked_at(
        &self,
        residual: DVector<f64>,
        scale: &[f64],
        by: &[usize],
    ) -> (f64, DVector<f64>, [f64; 2]) {
        let n = residual.len() as f64;
        let start =
            DMatrix::from_fn(self.start.nrows(), 2, |r, c| self.start[(r, c)] / scale[self.channel[r]]);
        let square = start.tr_mul(&start) + DMatrix::identity(2, 2) * 1e-12;
        let shift = square
            .try_inverse()
            .map_or_else(|| DVector::zeros(2), |inverse| inverse * start.tr_mul(&residual));
        let left = residual - &start * &shift;
        let (weight, cost) = robust(left.norm_squared(), n);
        let weighed = DVector::from_fn(left.len(), |r, _| left[r] / scale[self.channel[r]]);
        let slope = by.iter().map(|&c| -weight * self.jacobian.column(c).dot(&weighed));
        (cost, DVector::from_iterator(by.len(), slope), [shift[0], shift[1]])
    }

    fn without_columns(&self) -> Self {
        Self {
            residual: self.residual.clone(),
            jacobian: DMatrix::zeros(0, 0),
            start: self.start.clone(),
            channel: self.channel.clone(),
            kept: self.kept.clone(),
        }
    }

    /// Residuals and derivatives with the start state taken out.
    fn projected(&self, scale: &[f64]) -> (DVector<f64>, DMatrix<f64>, DMatrix<f64>) {
        let weights: Vec<f64> = self.channel.iter().map(|&c| 1.0 / scale[c]).collect();
        let weights = DVector::from_vec(weights);
        let by = |m: &DMatrix<f64>| {
            let mut out = m.clone();
            out.column_iter_mut().for_each(|mut column| column.component_mul_assign(&weights));
            out
        };
        let residual = self.residual.component_mul(&weights);
        let (jacobian, start) = (by(&self.jacobian), by(&self.start));
        let square = start.tr_mul(&start) + DMatrix::identity(2, 2) * 1e-12;
        let Some(inverse) = square.try_inverse() else { return (residual, jacobian, start) };
        let shares = inverse * start.transpose();
        let residual_less = &residual - &start * (&shares * &residual);
        let jacobian_less = &jacobian - &start * (&shares * &jacobian);
        (residual_less, jacobian_less, start)
    }

    /// The same of some columns with the window's robust weight, and its cost.
    fn reduced(&self, scale: &[f64], columns: &[usize]) -> (DVector<f64>, DMatrix<f64>, f64) {
        let part = Self { jacobian: self.jacobian.select_columns(columns), ..self.without_columns() };
        let (residual, jacobian, _) = part.projected(scale);
        let (weight, cost) = robust(residual.norm_squared(), residual.len() as f64);
        (residual * weight.sqrt(), jacobian * weight.sqrt(), cost)
    }
}

/// Weight and cost of a window of `n` residuals with a sum of squares: what is far out counts less and less.
fn robust(square: f64, n: f64) -> (f64, f64) {
    let root = (1.0 + square / n / (ROBUST_K * ROBUST_K)).sqrt();
    (1.0 / root, n * 2.0 * ROBUST_K * ROBUST_K * (root - 1.0))
}

fn overlap(a: &Range<usize>, b: &Range<usize>) -> bool {
    a.start < b.end && b.start < a.end
}

/// A prediction with the derivatives of some columns, and, in the last two lanes, those of the start state.
fn seeded(
    model: &ExtendedModel<'_>,
    own: &[f64],
    map: &[usize],
    seeds: &Range<usize>,
    start: [f64; 2],
    window: &Window,
    out: &mut Vec<Dual<{ LANES + 4 }>>,
) {
    type Number = Dual<{ LANES + 4 }>;
    let theta: Vec<Number> = own
        .iter()
        .zip(map)
        .map(|(&v, &column)| {
            if seeds.contains(&column) { Number::variable(v, column - seeds.start) } else { Number::from(v) }
        })
        .collect();
    let start = [Number::variable(start[0], LANES), Number::variable(start[1], LANES + 1)];
    model.rollout(&theta, start, window, out);
}
