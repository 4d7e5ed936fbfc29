//! Which candidates differ: a forward search, whose end is held against other sets.
//!
//! A [round](crate::round) adds the likeliest candidate. Where the model found leaves more than noise, and at the end, it is held against
//! [other sets](crate::exchange). A candidate is taken where
//!
//! ```text
//! |size / standard error|  >  t(1 % / candidates; degrees of freedom)        (Student, errors robust to clusters; both sides: 2 % in all)
//! ```
//!
//! and what the windows say that no fit has seen does not outweigh that.

use crate::SimulatorError;
use crate::fit::{Fitted, Fitter, State, needed};
use crate::model::Residuals;

/// Rollouts of the recording that a whole diagnosis may take; those that come at its end with a round before, with a fit before, and alone.
pub(crate) const MOST_ROLLOUTS: f64 = 300.0;
const LAST: f64 = 100.0;
pub(crate) const FIT: f64 = 60.0;
const FREE_TERMS: f64 = 30.0;
/// Effects at most.
pub(crate) const MOST_FOUND: usize = 3;
/// Cost per residual above which what is left is more than noise.
pub(crate) const UNEXPLAINED: f64 = 1.5;
/// Share of the cost from which what is left beside the likeliest candidate says that derivatives may not lead to the cause.
pub(crate) const SLOW: f64 = 0.5;
/// Odds of 20 to 1, as twice the logarithm.
const CLEAR: f64 = 6.0;
/// Gauss-Newton steps of a fit.
pub(crate) const STEPS: usize = 10;
/// Gauss-Newton steps of a fit that is only on the way to the one that counts.
const FEW_STEPS: usize = 3;

/// The end of a search.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    /// The simulator as it came.
    pub(crate) null: State,
    /// The model with all effects found.
    pub(crate) fit: Option<Fitted>,
    /// The simulator with the first effect, the first two and so on, in the order of the fit.
    pub(crate) steps: Vec<State>,
    /// By effect: candidates that the data cannot tell from it.
    pub(crate) confused: Vec<Vec<usize>>,
    /// Candidates taken in a round, with others that left the same there.
    pub(crate) alike: Vec<(usize, usize)>,
    /// The candidates that the last round followed, with the cost that each leaves beside those found, best first.
    pub(crate) compared: Vec<(usize, f64)>,
    /// Candidates that show nothing anywhere between their bounds.
    pub(crate) mute: Vec<usize>,
    /// Derivatives by every candidate, where they were last taken.
    pub(crate) columns: Vec<Residuals>,
    /// Where that was last, and of which candidates.
    pub(crate) taken: Option<(State, Vec<usize>)>,
    /// Whether values far apart have been looked at.
    pub(crate) zoomed: bool,
}

impl Found {
    /// Of a simulator as it came: nothing found yet.
    pub(crate) fn new(null: State) -> Self {
        Self {
            null,
            fit: None,
            steps: Vec::new(),
            confused: Vec::new(),
            alike: Vec::new(),
            compared: Vec::new(),
            mute: Vec::new(),
            columns: Vec::new(),
            taken: None,
            zoomed: false,
        }
    }

    /// The last model.
    pub(crate) fn state(&self) -> &State {
        self.fit.as_ref().map_or(&self.null, |f| &f.state)
    }

    /// The candidates taken, in their order.
    pub(crate) fn active(&self) -> Vec<usize> {
        self.fit.as_ref().map(Fitted::members).unwrap_or_default()
    }
}

impl Fitter<'_> {
    /// Searches.
    ///
    /// # Errors
    /// What the simulator says.
    pub(crate) fn search(&self, progress: &mut dyn FnMut(&str)) -> Result<Found, SimulatorError> {
        progress("the simulator as it came");
        let mut found = Found::new(self.at(self.model.null())?);
        loop {
            let size = found.active().len();
            let (noise, left) = (UNEXPLAINED * self.residuals(), found.state().training(&self.layout));
            // What is left beside the effects found may be one more, or others together: where derivatives show which, they are fitted at once.
            if size > 0 && left > noise && self.exchange(&mut found, size + 1, SLOW * left)? {
                continue;
            }
            if size < MOST_FOUND && self.rollouts() + LAST <= MOST_ROLLOUTS {
                progress(&format!("effect {}", size + 1));
                if let Some(fitted) = self.round(&mut found)? {
                    found.fit = Some(self.pruned(fitted)?);
                    found.confused.clear();
                    continue;
                }
            }
            progress("other sets of effects");
            let most = if left > noise {
                size + 2
            } else if size > 0 {
                size + 1
            } else {
                0
            };
            if !self.exchange(&mut found, most, noise.max(UNEXPLAINED * left))? {
                break;
            }
        }
        if let Some(mut fit) = found.fit.take() {
            progress("what the sizes are worth");
            self.widen(&mut fit)?;
            found.steps = self.steps_on_the_way(&fit)?;
            let members = fit.members();
            found.confused.resize(members.len(), Vec::new());
            for (member, confused) in members.iter().zip(&mut found.confused) {
                let others = found.alike.iter().filter(|(taken, _)| taken == member).map(|(_, other)| *other);
                others.filter(|c| !members.contains(c)).for_each(|c| {
                    if !confused.contains(&c) {
                        confused.push(c);
                    }
                });
            }
            found.fit = Some(fit);
        }
        Ok(found)
    }

    /// Takes derivatives by some candidates at the model found, and returns it with those by its starts. What is known there already is not asked
    /// for again.
    ///
    /// # Errors
    /// What the simulator says.
    pub(crate) fn derivatives(&self, found: &mut Found, wanted: &[usize]) -> Result<State, SimulatorError> {
        let here = found.state().clone();
        found.columns.resize(self.model.candidates.len(), vec![0.0; here.residuals.len()]);
        let (state, mut taken) = match found.taken.take() {
            Some((state, taken)) if state.point == here.point => (state, taken),
            _ => (self.around(here.point, Some(here.residuals), &[])?.0, Vec::new()),
        };
        let missing: Vec<usize> = wanted.iter().copied().filter(|c| !taken.contains(c)).collect();
        for (&c, column) in missing.iter().zip(self.columns_of(&state, &missing)?) {
            found.columns[c] = column;
        }
        taken.extend(missing);
        found.taken = Some((state.clone(), taken));
        Ok(state)
    }

    /// A fit without what is not evident in it.
    pub(crate) fn pruned(&self, mut fit: Fitted) -> Result<Fitted, SimulatorError> {
        while let Some(place) = fit.least_evident()
            && fit.sizes.len() > 1
            && self.rollouts() + FREE_TERMS <= MOST_ROLLOUTS
        {
            let mut kept = fit.members();
            let given_up = kept.remove(place);
            let mut values = fit.state.point.values.clone();
            values[given_up] = self.model.candidates[given_up].null;
            let mut columns = fit.columns.clone();
            columns.remove(place);
            let start = self.trials(&fit.state, &[], &[values])?.into_iter().next();
            fit = self.fit(start.as_ref().unwrap_or(&fit.state), &kept, columns, STEPS)?;
        }
        Ok(fit)
    }

    /// A fit that ended where nothing more is gained: a size is worth nothing, and neither is its interval, where it was stopped on its way.
    pub(crate) fn settled(&self, fit: Fitted) -> Result<Fitted, SimulatorError> {
        if fit.is_settled || self.rollouts() + FIT > MOST_ROLLOUTS {
            return Ok(fit);
        }
        self.fit(&fit.state, &fit.members(), fit.columns.clone(), STEPS)
    }

    /// The simulator with the first candidate of a fit, the first two and so on.
    fn steps_on_the_way(&self, end: &Fitted) -> Result<Vec<State>, SimulatorError> {
        let members = end.members();
        let step = |count: usize| {
            if count == members.len() {
                return Ok(end.state.clone());
            }
            let mut values = self.model.null().values;
            members[..count].iter().for_each(|&c| values[c] = end.state.point.values[c]);
            let start = self.trials(&end.state, &[], &[values])?.into_iter().next();
            let start = start.unwrap_or_else(|| end.state.clone());
            if self.rollouts() + FREE_TERMS > MOST_ROLLOUTS {
                return Ok(start);
            }
            Ok(self.fit(&start, &members[..count], end.columns[..count].to_vec(), FEW_STEPS)?.state)
        };
        (1..=members.len()).map(step).collect()
    }

    /// What a size over its standard error, squared, must exceed where every window tells of it.
    pub(crate) fn needed(&self) -> f64 {
        needed(self.model.candidates.len(), (self.layout.clusters().1 as f64 - 1.0).max(1.0))
    }

    /// Residuals of the training windows.
    pub(crate) fn residuals(&self) -> f64 {
        self.layout.training().map(|w| self.layout.windows[w].1 as f64).sum()
    }

    /// Whether the windows that no fit has seen leave a margin (of a size over its standard error, squared, over what it must exceed): they count
    /// as more data against it, and must not clearly contradict.
    pub(crate) fn carries_over(&self, fitted: &Fitted, before: &State, margin: f64) -> bool {
        let scale = (fitted.state.training(&self.layout) / self.residuals()).max(1.0);
        let gained = (before.held_out(&self.layout) - fitted.state.held_out(&self.layout)) / scale;
        stands(margin, gained)
    }

    /// Whether two models leave the same, as far as the training windows tell.
    pub(crate) fn alike(&self, best: &[f64], other: &[f64]) -> bool {
        const Z: f64 = 1.645;
        let layout = &self.layout;
        let mut blocks: std::collections::BTreeMap<usize, f64> = std::collections::BTreeMap::new();
        for w in layout.training() {
            *blocks.entry(layout.block[w]).or_default() += other[w] - best[w];
        }
        let n = blocks.len() as f64;
        let sum: f64 = blocks.values().sum();
        let spread =
            (blocks.values().map(|d| (d - sum / n).powi(2)).sum::<f64>() * n / (n - 1.0).max(1.0)).sqrt();
        let scale = (layout.training().map(|w| best[w]).sum::<f64>() / self.residuals()).max(1.0);
        sum.is_finite() && (sum / scale < CLEAR || sum < Z * spread)
    }
}

/// Whether a margin outweighs what held-out windows lose.
fn stands(margin: f64, gained: f64) -> bool {
    gained > -CLEAR && margin + gained.min(0.0) > 0.0
}

/// Whether a small change shows nowhere.
pub(crate) fn is_silent(column: &Residuals) -> bool {
    column.iter().all(|d| d.abs() < 1e-9)
}

#[cfg(test)]
mod tests;
