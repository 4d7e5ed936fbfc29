//! All candidates from one Jacobian: expected gain, detection limits, and which effects look alike.

use nalgebra::{DMatrix, DVector};

use crate::effects::EffectId;
use crate::engine::{Engine, State};
use crate::windows::Windows;

/// What the Jacobian says of a candidate.
#[derive(Debug, Clone)]
pub(crate) struct Screened {
    pub(crate) effect: EffectId,
    /// Drop of the cost that one linear step promises, tires and hold moving along.
    pub(crate) gain: f64,
    /// That step.
    pub(crate) step: Vec<f64>,
    /// Standard error of each parameter, tires and hold moving along, at the scatter that the data show.
    pub(crate) error: Vec<f64>,
}

/// Result of a screening.
#[derive(Debug, Clone)]
pub(crate) struct Screening {
    pub(crate) candidates: Vec<Screened>,
    /// Largest cosine between what two candidates do to the signals, tires and hold moving along.
    pub(crate) cosine: DMatrix<f64>,
}

/// Ridge that keeps an effect that the data do not show from a gain of rounding errors.
const LEAST_INFORMATION: f64 = 1e-9;

/// Screens candidates around a fitted state.
pub(crate) fn screen(
    engine: &Engine<'_>,
    state: &State,
    candidates: &[EffectId],
    windows: &Windows,
) -> Screening {
    let mut effects = state.effects.clone();
    effects.extend(candidates);
    let mut values = state.parameters.clone();
    let mut places = Vec::new();
    for effect in candidates {
        places.push((values.len(), effect.spec().parameters.len()));
        values.extend(Engine::null_values(*effect));
    }
    // The hold stays a nuisance here whatever is among the candidates.
    let parameters = engine.parameters(&effects, &values, 1.0);
    let here = engine.linearize(&effects, &values, &state.starts, windows);
    let own = state.parameters.len();
    let free: Vec<usize> = (0..values.len()).filter(|&j| parameters[j].free).collect();
    let nuisance: Vec<usize> = (0..free.len()).filter(|&row| free[row] < own).collect();
    let row_of = |j: usize| free.iter().position(|&f| f == j);
    let dof = (here.residuals as f64 - 2.0 * state.starts.len() as f64).max(1.0);
    let scatter = (here.cost / dof).max(1.0);

    let pick = |rows: &[usize], columns: &[usize]| {
        DMatrix::from_fn(rows.len(), columns.len(), |a, b| here.information[(rows[a], columns[b])])
    };
    let mut inner = pick(&nuisance, &nuisance);
    for a in 0..nuisance.len() {
        inner[(a, a)] += LEAST_INFORMATION;
    }
    let inverse = inner.try_inverse().unwrap_or_else(|| DMatrix::zeros(nuisance.len(), nuisance.len()));
    let inner_gradient = DVector::from_iterator(nuisance.len(), nuisance.iter().map(|&r| here.gradient[r]));

    let blocks: Vec<Vec<usize>> =
        places.iter().map(|&(from, n)| (from..from + n).filter_map(row_of).collect()).collect();
    let all: Vec<usize> = blocks.iter().flatten().copied().collect();
    let cross = pick(&nuisance, &all);
    let reduced = pick(&all, &all) - cross.transpose() * &inverse * &cross;
    let gradient = DVector::from_iterator(all.len(), all.iter().map(|&r| here.gradient[r]))
        - cross.transpose() * &inverse * &inner_gradient;

    let mut at = 0;
    let spans: Vec<(usize, usize)> = blocks
        .iter()
        .map(|b| {
            at += b.len();
            (at - b.len(), b.len())
        })
        .collect();
    let candidates_out = candidates
        .iter()
        .zip(&spans)
        .map(|(&effect, &(from, n))| {
            let mut block = reduced.view((from, from), (n, n)).into_owned();
            for a in 0..n {
                block[(a, a)] += LEAST_INFORMATION;
            }
            let g = gradient.rows(from, n).into_owned();
            match block.clone().try_inverse() {
                Some(inverse) => {
                    let step = -(&inverse * &g);
                    Screened {
                        effect,
                        gain: (g.transpose() * &inverse * &g)[(0, 0)],
                        step: step.iter().copied().collect(),
                        error: (0..n).map(|a| (inverse[(a, a)].max(0.0) * scatter).sqrt()).collect(),
                    }
                }
                None => Screened { effect, gain: 0.0, step: vec![0.0; n], error: vec![f64::INFINITY; n] },
            }
        })
        .collect();
    let cosine = DMatrix::from_fn(spans.len(), spans.len(), |i, j| cosine(&reduced, spans[i], spans[j]));
    Screening { candidates: candidates_out, cosine }
}

/// The largest canonical correlation of two blocks.
fn cosine(information: &DMatrix<f64>, a: (usize, usize), b: (usize, usize)) -> f64 {
    let block = |r: (usize, usize), c: (usize, usize)| information.view((r.0, c.0), (r.1, c.1)).into_owned();
    let root = |m: DMatrix<f64>| {
        let n = m.nrows();
        (m + DMatrix::identity(n, n) * LEAST_INFORMATION).cholesky().and_then(|c| c.l().try_inverse())
    };
    match (root(block(a, a)), root(block(b, b))) {
        (Some(la), Some(lb)) => {
            let m = la * block(a, b) * lb.transpose();
            m.singular_values().max().clamp(0.0, 1.0)
        }
        _ => 0.0,
    }
}
