//! All candidates from one Jacobian: expected gain, detection limits, and which effects look alike.

use gripsight_estimation::Windows;
use gripsight_model::{BASE, EffectId};
use nalgebra::{DMatrix, DVector};

use crate::engine::Engine;
use crate::state::State;

/// What the Jacobian says of a candidate.
#[derive(Debug, Clone)]
pub(crate) struct Screened {
    pub(crate) effect: EffectId,
    /// Drop of the cost that one linear step promises, tires and background moving along.
    pub(crate) gain: f64,
    /// That step.
    pub(crate) step: Vec<f64>,
    /// How the rest of the model goes along: places of its parameters in the state, and their changes by each of the effect's.
    along: Vec<(usize, Vec<f64>)>,
    /// Standard error of each parameter, tires and background moving along, at the scatter that the data show.
    pub(crate) error: Vec<f64>,
}

impl Screened {
    /// An effect that the Jacobian does not show.
    pub(crate) fn unseen(effect: EffectId) -> Self {
        let n = effect.spec().parameters.len();
        Self { effect, gain: 0.0, step: vec![0.0; n], along: Vec::new(), error: vec![f64::INFINITY; n] }
    }

    /// The state with tires, background and the effects claimed already where they would go along with a change of the effect. They
    /// explain some of what it does: where they stay, its own step leads away from the best fit.
    pub(crate) fn with_rest_along(&self, state: &State, change: &[f64]) -> State {
        let mut moved = state.clone();
        for (place, by) in self.along.iter().filter(|(place, _)| *place < state.parameters.len()) {
            moved.parameters[*place] += by.iter().zip(change).map(|(b, c)| b * c).sum::<f64>();
        }
        moved
    }
}

/// Result of a screening.
#[derive(Debug, Clone)]
pub(crate) struct Screening {
    pub(crate) candidates: Vec<Screened>,
    information: DMatrix<f64>,
    /// Rows of the tires, the background and the effects claimed already.
    own: Vec<usize>,
    /// Rows of each candidate.
    rows: Vec<Vec<usize>>,
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
    effects.extend(candidates.iter().filter(|c| !state.effects.contains(c)));
    let named: Vec<EffectId> = state.named.iter().chain(candidates).copied().collect();
    let mut values = state.parameters.clone();
    for effect in &effects[state.effects.len()..] {
        values.extend(engine.absent(*effect));
    }
    // A candidate that is part of the background keeps the background's prior here, and is let go where it is looked at.
    let quiet: Vec<EffectId> =
        named.iter().filter(|e| engine.usual(**e).is_none() || state.named.contains(e)).copied().collect();
    let parameters = engine.parameters(&quiet, &effects, &values, 1.0);
    let free_parameters = engine.parameters(&named, &effects, &values, 1.0);
    let here = engine.linearize(&quiet, &effects, &values, &state.starts, windows);
    let free: Vec<usize> = (0..values.len()).filter(|&j| parameters[j].free).collect();
    let row_of = |j: usize| free.iter().position(|&f| f == j);
    // What is on its bound does not move along.
    let bound = |j: &usize| state.is_held(*j);
    let own: Vec<usize> = state.free.iter().copied().filter(|j| !bound(j)).filter_map(row_of).collect();
    let place = |effect: EffectId| {
        let before: usize =
            effects.iter().take_while(|e| **e != effect).map(|e| e.spec().parameters.len()).sum();
        BASE + before..BASE + before + effect.spec().parameters.len()
    };
    let mut information = here.information;
    for row in 0..free.len() {
        information[(row, row)] += LEAST_INFORMATION;
    }
    let dof = (here.residuals as f64 - 2.0 * state.starts.len() as f64).max(1.0);
    let scatter = (here.cost / dof).max(1.0);
    let mut screening = Screening { candidates: Vec::new(), information, own, rows: Vec::new() };
    for &effect in candidates {
        let rows: Vec<usize> = place(effect).filter_map(row_of).collect();
        let others: Vec<usize> = screening.own.iter().filter(|r| !rows.contains(r)).copied().collect();
        let (mut block, coupling) = screening.reduced(&rows, &others);
        let mut g = pick_vector(&here.gradient, &rows) - &coupling * pick_vector(&here.gradient, &others);
        for (a, &row) in rows.iter().enumerate() {
            let j = free[row];
            if let (Some(tight), Some(loose)) = (parameters[j].prior, free_parameters[j].prior) {
                block[(a, a)] += loose.sigma.powi(-2) - tight.sigma.powi(-2);
                g[a] += (values[j] - loose.mean) * (loose.sigma.powi(-2) - tight.sigma.powi(-2));
            }
        }
        let n = rows.len();
        screening.candidates.push(match block.try_inverse() {
            Some(inverse) => Screened {
                effect,
                gain: (g.transpose() * &inverse * &g)[(0, 0)],
                step: (-(&inverse * &g)).iter().copied().collect(),
                along: others
                    .iter()
                    .enumerate()
                    .map(|(o, &row)| (free[row], (0..n).map(|a| -coupling[(a, o)]).collect()))
                    .collect(),
                error: (0..n).map(|a| (inverse[(a, a)].max(0.0) * scatter).sqrt()).collect(),
            },
            None => Screened::unseen(effect),
        });
        screening.rows.push(rows);
    }
    screening
}

fn pick_vector(v: &DVector<f64>, rows: &[usize]) -> DVector<f64> {
    DVector::from_iterator(rows.len(), rows.iter().map(|&r| v[r]))
}

impl Screening {
    /// The information on `rows` with `others` moving along, and how others' gradients come in.
    fn reduced(&self, rows: &[usize], others: &[usize]) -> (DMatrix<f64>, DMatrix<f64>) {
        let pick = |a: &[usize], b: &[usize]| {
            DMatrix::from_fn(a.len(), b.len(), |i, j| self.information[(a[i], b[j])])
        };
        let cross = pick(rows, others);
        let coupling = match pick(others, others).cholesky() {
            Some(c) => c.solve(&cross.transpose()).transpose(),
            None => DMatrix::zeros(rows.len(), others.len()),
        };
        (pick(rows, rows) - &coupling * cross.transpose(), coupling)
    }

    /// How alike two candidates look, tires and background moving along: the largest canonical correlation of what they do to the signals.
    pub(crate) fn cosine(&self, a: EffectId, b: EffectId) -> f64 {
        let place = |e: EffectId| self.candidates.iter().position(|c| c.effect == e);
        let (Some(a), Some(b)) = (place(a), place(b)) else { return 0.0 };
        let (a, b) = (&self.rows[a], &self.rows[b]);
        let others: Vec<usize> =
            self.own.iter().filter(|r| !a.contains(r) && !b.contains(r)).copied().collect();
        let rows: Vec<usize> = a.iter().chain(b).copied().collect();
        let (both, _) = self.reduced(&rows, &others);
        let (n, m) = (a.len(), b.len());
        let root = |from: usize, len: usize| {
            let block = both.view((from, from), (len, len)).into_owned();
            (block + DMatrix::identity(len, len) * LEAST_INFORMATION)
                .cholesky()
                .and_then(|c| c.l().try_inverse())
        };
        match (root(0, n), root(n, m)) {
            (Some(la), Some(lb)) => {
                let product = la * both.view((0, n), (n, m)) * lb.transpose();
                product.singular_values().max().clamp(0.0, 1.0)
            }
            _ => 0.0,
        }
    }
}
