//! Which candidates differ: one after the other, each decided by the same comparison.
//!
//! A round: derivatives by every candidate at the model so far; the likeliest are followed along their own line, the likeliest two of
//! these fitted together with those found before. The better one is taken where
//!
//! ```text
//! (size / standard error)^2  >  log(clusters) + 2 log(candidates)        (extended BIC, with errors robust to clusters)
//! ```
//!
//! and the windows that no fit has seen are predicted better, too.

use crate::SimulatorError;
use crate::fit::{Fitted, Fitter, State};
use crate::linear::Normal;
use crate::model::Residuals;

/// Candidates that are followed along their line in a round.
const FOLLOWED: usize = 6;
/// Effects at most.
const MOST_FOUND: usize = 3;
/// Cost per residual above which what the likeliest candidate leaves is more than noise.
const UNEXPLAINED: f64 = 1.5;
/// Gauss-Newton steps of a fit.
const STEPS: usize = 6;

/// What a round came to.
#[derive(Debug, Clone)]
pub(crate) struct Round {
    /// The candidates followed, with the cost that each leaves (alone beside those found before), best first.
    pub(crate) compared: Vec<(usize, f64)>,
    /// Those that the data cannot tell from the one taken.
    pub(crate) confused: Vec<usize>,
}

/// The end of a search.
#[derive(Debug, Clone)]
pub(crate) struct Found {
    /// The simulator as it came.
    pub(crate) null: State,
    /// The model after each effect taken.
    pub(crate) fits: Vec<Fitted>,
    /// A round for each effect taken, and the last, in which none was.
    pub(crate) rounds: Vec<Round>,
}

impl Found {
    /// The last model.
    pub(crate) fn state(&self) -> &State {
        self.fits.last().map_or(&self.null, |f| &f.state)
    }

    /// The candidates taken, in their order.
    pub(crate) fn active(&self) -> Vec<usize> {
        self.fits.last().map(|f| f.sizes.iter().map(|s| s.candidate).collect()).unwrap_or_default()
    }
}

impl Fitter<'_> {
    /// Searches.
    ///
    /// # Errors
    /// What the simulator says.
    pub(crate) fn search(&self, progress: &mut dyn FnMut(&str)) -> Result<Found, SimulatorError> {
        progress("the simulator as it came");
        let null = self.at(self.model.null())?;
        let mut found = Found { null, fits: Vec::new(), rounds: Vec::new() };
        while found.fits.len() < MOST_FOUND {
            progress(&format!("effect {}", found.fits.len() + 1));
            let (round, taken) = self.round(&found)?;
            found.rounds.push(round);
            match taken {
                Some(fitted) => {
                    found.fits.push(fitted);
                    self.reconsider(&mut found)?;
                }
                None => break,
            }
        }
        Ok(found)
    }

    /// Takes out what was taken first and is not needed any more beside what was taken last.
    fn reconsider(&self, found: &mut Found) -> Result<(), SimulatorError> {
        let layout = &self.layout;
        for k in (0..found.fits.len().saturating_sub(1)).rev() {
            let Some(last) = found.fits.last() else { return Ok(()) };
            let together = found.active();
            let kept: Vec<usize> = together.iter().copied().filter(|c| *c != together[k]).collect();
            let mut values = last.state.point.values.clone();
            values[together[k]] = self.model.candidates[together[k]].null;
            let Some(start) = self.trials(&last.state, &[], &[values])?.into_iter().next() else { continue };
            let without = self.fit(&start, &kept, STEPS)?;
            let residuals = self.residuals();
            let best = last.state.training(layout).min(without.state.training(layout));
            let scale = (best / residuals).max(1.0);
            if without.state.training(layout) < last.state.training(layout) + scale * self.needed() {
                // The steps on the way hold what is gone: only the end is kept, under the names that remain.
                found.fits.remove(k);
                found.rounds.remove(k);
                let end = found.fits.len() - 1;
                found.fits[end] = without;
                for (place, fit) in found.fits[..end].iter_mut().enumerate() {
                    if let Some(way) = (place >= k).then_some(&kept[..=place]) {
                        *fit = self.fit(&fit.state, way, 2)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// What a size over its standard error, squared, must exceed.
    pub(crate) fn needed(&self) -> f64 {
        let clusters = self.layout.training().count().min(40) as f64;
        clusters.ln() + 2.0 * (self.model.candidates.len().max(1) as f64).ln()
    }

    fn round(&self, found: &Found) -> Result<(Round, Option<Fitted>), SimulatorError> {
        let layout = &self.layout;
        let active = found.active();
        let all: Vec<usize> = (0..self.model.candidates.len()).collect();
        let here = found.state();
        let (state, columns) = self.around(here.point.clone(), Some(here.residuals.clone()), &all)?;
        let projected: Vec<Residuals> = columns.iter().map(|c| state.starts.project(layout, c).0).collect();
        let before = state.training(layout);
        // As far as the derivatives reach: what each would gain beside those found, and where it would come to lie.
        let mut likely: Vec<(usize, f64, Vec<f64>)> = all
            .iter()
            .filter(|c| !active.contains(c))
            .filter_map(|&c| {
                let together: Vec<usize> = active.iter().copied().chain([c]).collect();
                let parts: Vec<&Residuals> = together.iter().map(|&c| &projected[c]).collect();
                let normal = Normal::new(layout, &state.projected, &parts);
                let mut step = normal.step(1e-6)?;
                for (s, &c) in step.iter_mut().zip(&together) {
                    *s = self.within(c, state.point.values[c] + *s) - state.point.values[c];
                }
                let mut values = state.point.values.clone();
                together.iter().zip(step.iter()).for_each(|(&c, s)| values[c] += s);
                Some((c, normal.gain(&step), values))
            })
            .filter(|(c, gain, values)| *gain > 0.0 && values[*c] != state.point.values[*c])
            .collect();
        let silent: Vec<usize> =
            all.iter().copied().filter(|c| !active.contains(c) && is_silent(&projected[*c])).collect();
        likely.retain(|(c, _, _)| !silent.contains(c));
        likely.extend(self.scan(&state, &silent)?);
        likely.sort_by(|a, b| b.1.total_cmp(&a.1));
        likely.truncate(FOLLOWED);
        let mut followed = self.follow(&state, &columns, &likely)?;
        let left = followed.first().map_or(before, |(_, s)| s.training(layout)) / self.residuals();
        if left > UNEXPLAINED {
            followed.extend(self.zoom(&state, &active)?);
            followed.sort_by(|a, b| a.1.training(layout).total_cmp(&b.1.training(layout)));
        }
        let compared: Vec<(usize, f64)> = followed.iter().map(|(c, s)| (*c, s.training(layout))).collect();
        let mut round = Round { compared, confused: Vec::new() };
        // Where even the best gains less than its name costs, nothing is fitted.
        let needed = self.needed();
        let mut fits: Vec<Fitted> = Vec::new();
        let mut tried: Vec<usize> = Vec::new();
        for (c, trial) in &followed {
            if tried.len() == 2 || tried.contains(c) {
                continue;
            }
            tried.push(*c);
            if before - trial.training(layout) < 0.5 * needed {
                continue;
            }
            let together: Vec<usize> = active.iter().copied().chain([*c]).collect();
            fits.push(self.fit(trial, &together, STEPS)?);
        }
        fits.sort_by(|a, b| a.state.training(layout).total_cmp(&b.state.training(layout)));
        let Some(best) = fits.first() else { return Ok((round, None)) };
        let of = |f: &Fitted| f.sizes.last().map(|s| s.candidate);
        let costs: Vec<(usize, Vec<f64>)> = fits
            .iter()
            .skip(1)
            .map(|f| (of(f), f.state.costs.clone()))
            .chain(followed.iter().map(|(c, s)| (Some(*c), s.costs.clone())))
            .filter_map(|(c, costs)| Some((c?, costs)))
            .collect();
        for (c, costs) in costs {
            if Some(c) != of(best) && !round.confused.contains(&c) && self.alike(&best.state.costs, &costs) {
                round.confused.push(c);
            }
        }
        // Of what cannot be told apart, the simulator's own parameter can be mended.
        let own = |f: &&Fitted| {
            let c = of(f);
            c.is_some_and(|c| self.model.candidates[c].is_own() && round.confused.contains(&c))
        };
        let best_is_own = of(best).is_some_and(|c| self.model.candidates[c].is_own());
        let chosen = if best_is_own { best } else { fits.iter().skip(1).find(own).unwrap_or(best) };
        if let (Some(was), Some(now)) = (of(best), of(chosen))
            && was != now
        {
            round.confused.retain(|c| *c != now);
            round.confused.push(was);
        }
        let evident = chosen.sizes.last().is_some_and(|s| s.wald > needed);
        let carries_over = chosen.state.held_out(layout) < state.held_out(layout);
        Ok((round, (evident && carries_over).then(|| chosen.clone())))
    }

    /// Residuals of the training windows.
    fn residuals(&self) -> f64 {
        self.layout.training().map(|w| self.layout.windows[w].1 as f64).sum()
    }

    /// Whether two models leave the same, as far as the training windows tell.
    fn alike(&self, best: &[f64], other: &[f64]) -> bool {
        /// Odds of 20 to 1, as twice the logarithm.
        const CLEAR: f64 = 6.0;
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

/// Whether a small change shows nowhere.
fn is_silent(column: &Residuals) -> bool {
    column.iter().all(|d| d.abs() < 1e-9)
}

#[cfg(test)]
mod tests;
