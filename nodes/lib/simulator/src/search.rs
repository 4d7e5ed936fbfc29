//! Which candidates differ: one after the other, each decided by the same comparison.
//!
//! A round: derivatives by the candidates at the model so far, by all in the first round, then by the likeliest as far as those reach; the
//! likeliest few are followed along their own line, the likeliest two of these fitted together with those found before. The better one is
//! taken where
//!
//! ```text
//! |size / standard error|  >  t(1 % / candidates; degrees of freedom)        (Student, errors robust to clusters; both sides: 2 % in all)
//! ```
//!
//! and the windows that no fit has seen are predicted better, too.

use crate::SimulatorError;
use crate::fit::{Fitted, Fitter, State, needed};
use crate::linear::Normal;
use crate::look::LOOKS;
use crate::model::Residuals;

/// Candidates that are followed along their line in a round.
const FOLLOWED: usize = 6;
/// Candidates whose derivatives are taken anew after the first round.
const SCREENED: usize = 14;
/// Rollouts of the recording that a whole diagnosis may take, those that a last round and the free terms do, and a fit and the free terms.
const MOST_ROLLOUTS: f64 = 300.0;
const LAST: f64 = 110.0;
const FIT: f64 = 45.0;
/// Effects at most.
const MOST_FOUND: usize = 3;
/// Cost per residual above which what the likeliest candidate leaves is more than noise.
const UNEXPLAINED: f64 = 1.5;
/// Share of the cost from which what is left beside the likeliest candidate says that derivatives may not lead to the cause.
const SLOW: f64 = 0.5;
/// Gauss-Newton steps of a fit.
const STEPS: usize = 10;

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
    /// Candidates that show nothing anywhere between their bounds.
    mute: Vec<usize>,
    /// Derivatives by every candidate, where they were last taken.
    columns: Vec<Residuals>,
    /// Whether values far apart have been looked at.
    zoomed: bool,
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
        let mut found = Found {
            null,
            fits: Vec::new(),
            rounds: Vec::new(),
            mute: Vec::new(),
            columns: Vec::new(),
            zoomed: false,
        };
        while found.fits.len() < MOST_FOUND && self.rollouts() + LAST <= MOST_ROLLOUTS {
            progress(&format!("effect {}", found.fits.len() + 1));
            let (round, taken) = self.round(&mut found)?;
            found.rounds.push(round);
            match taken {
                Some(fitted) => {
                    found.fits.push(fitted);
                    self.reconsider(&mut found)?;
                }
                None => break,
            }
        }
        if let Some(last) = found.fits.last_mut() {
            progress("what the sizes are worth");
            self.widen(last)?;
        }
        Ok(found)
    }

    /// Takes out what was taken first and is not needed any more beside what was taken last.
    fn reconsider(&self, found: &mut Found) -> Result<(), SimulatorError> {
        let layout = &self.layout;
        for k in (0..found.fits.len().saturating_sub(1)).rev() {
            let Some(last) = found.fits.last() else { return Ok(()) };
            // Where rollouts are short, a size far beyond its error says enough.
            let is_clear = last.sizes.get(k).is_some_and(|s| s.wald > 4.0 * s.needed);
            if is_clear && self.rollouts() + FIT > MOST_ROLLOUTS {
                continue;
            }
            let together = found.active();
            let kept: Vec<usize> = together.iter().copied().filter(|c| *c != together[k]).collect();
            let mut values = last.state.point.values.clone();
            values[together[k]] = self.model.candidates[together[k]].null;
            let Some(start) = self.trials(&last.state, &[], &[values])?.into_iter().next() else { continue };
            let mut columns = last.columns.clone();
            columns.remove(k);
            let without = self.fit(&start, &kept, columns, STEPS)?;
            let residuals = self.residuals();
            let best = last.state.training(layout).min(without.state.training(layout));
            let scale = (best / residuals).max(1.0);
            if without.state.training(layout) < last.state.training(layout) + scale * self.needed() {
                // The steps on the way hold what is gone: only the end is kept, under the names that remain.
                found.fits.remove(k);
                found.rounds.remove(k);
                let end = found.fits.len() - 1;
                for place in k..end {
                    found.fits[place] = self.step_on_the_way(&without, &kept[..=place])?;
                }
                found.fits[end] = without;
            }
        }
        Ok(())
    }

    /// The first few of the candidates of a fit alone.
    fn step_on_the_way(&self, end: &Fitted, first: &[usize]) -> Result<Fitted, SimulatorError> {
        let mut values = self.model.null().values;
        first.iter().for_each(|&c| values[c] = end.state.point.values[c]);
        let start = self.trials(&end.state, &[], &[values])?.into_iter().next();
        let columns = end.columns[..first.len()].to_vec();
        self.fit(start.as_ref().unwrap_or(&end.state), first, columns, 3)
    }

    /// What a size over its standard error, squared, must exceed where every window tells of it.
    pub(crate) fn needed(&self) -> f64 {
        needed(self.model.candidates.len(), (self.layout.clusters().1 as f64 - 1.0).max(1.0))
    }

    fn round(&self, found: &mut Found) -> Result<(Round, Option<Fitted>), SimulatorError> {
        let layout = &self.layout;
        let active = found.active();
        let here = found.state();
        let all: Vec<usize> = (0..self.model.candidates.len()).filter(|c| !found.mute.contains(c)).collect();
        let looked = match found.columns.is_empty() {
            true => all,
            false => self.screened(here, &found.columns, &active, &all),
        };
        let (state, known) = self.around(here.point.clone(), Some(here.residuals.clone()), &looked)?;
        let mut columns = std::mem::take(&mut found.columns);
        columns.resize(self.model.candidates.len(), vec![0.0; state.residuals.len()]);
        looked.iter().zip(known).for_each(|(&c, column)| columns[c] = column);
        let before = state.training(layout);
        let mut likely = self.likely(&state, &columns, &active, &looked);
        let silent: Vec<usize> =
            looked.iter().copied().filter(|c| !active.contains(c) && is_silent(&columns[*c])).collect();
        likely.retain(|(c, _, _)| !silent.contains(c));
        let (seen, mute) = self.scan(&state, &silent)?;
        likely.extend(seen);
        found.mute.extend(mute);
        likely.sort_by(|a, b| b.1.total_cmp(&a.1));
        let unlikely = likely.split_off(FOLLOWED.min(likely.len()));
        let mut followed = self.follow(&state, &columns, &likely)?;
        // Where even the best gains less than its name costs, nothing is fitted.
        let needed = self.needed();
        let mut fits: Vec<Fitted> = Vec::new();
        let mut tried: Vec<usize> = Vec::new();
        let fit = |c: usize, trial: &State| {
            let together: Vec<usize> = active.iter().copied().chain([c]).collect();
            let known = together.iter().map(|&c| columns[c].clone()).collect();
            self.fit(trial, &together, self.learned(&state, trial, &together, known), STEPS)
        };
        for (c, trial) in &followed {
            if tried.len() == 2 || tried.contains(c) {
                continue;
            }
            tried.push(*c);
            if before - trial.training(layout) < 0.5 * needed {
                continue;
            }
            fits.push(fit(*c, trial)?);
        }
        let left = fits.iter().map(|f| f.state.training(layout)).fold(before, f64::min);
        let affordable = self.rollouts() + self.zooming() <= MOST_ROLLOUTS;
        if !found.zoomed && affordable && left > (UNEXPLAINED * self.residuals()).max(SLOW * before) {
            found.zoomed = true;
            if let Some((c, trial)) = self.zoom(&state, &active)? {
                fits.push(fit(c, &trial)?);
            }
        }
        fits.sort_by(|a, b| a.state.training(layout).total_cmp(&b.state.training(layout)));
        // What shows in a few windows alone, such as a grip that the simulator does not reach, is unlikely by its derivatives: where most is
        // left, or much and nothing is evident, the others are followed as well.
        let left = fits.first().map_or(before, |f| f.state.training(layout));
        let affordable = self.rollouts() + (LOOKS * unlikely.len()) as f64 + FIT <= MOST_ROLLOUTS;
        let is_slow = left > SLOW * before || !fits.first().is_some_and(Fitted::is_evident);
        if is_slow && left > UNEXPLAINED * self.residuals() && affordable {
            let more = self.follow(&state, &columns, &unlikely)?;
            let likeliest = followed.first().map_or(before, |(_, trial)| trial.training(layout));
            if let Some((c, trial)) = more.first().filter(|(_, trial)| trial.training(layout) < likeliest) {
                fits.push(fit(*c, trial)?);
                fits.sort_by(|a, b| a.state.training(layout).total_cmp(&b.state.training(layout)));
            }
            followed.extend(more);
            followed.sort_by(|a, b| a.1.training(layout).total_cmp(&b.1.training(layout)));
        }
        let compared = followed.iter().map(|(c, s)| (*c, s.training(layout))).collect();
        let mut round = Round { compared, confused: Vec::new() };
        found.columns = columns;
        if let Some(best) = fits.first_mut()
            && !best.is_settled
            && self.rollouts() + FIT <= MOST_ROLLOUTS
        {
            // A size is worth nothing, and neither is its interval, where a fit was stopped on its way.
            let together: Vec<usize> = best.sizes.iter().map(|s| s.candidate).collect();
            *best = self.fit(&best.state, &together, best.columns.clone(), STEPS)?;
        }
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
        let carries_over = chosen.state.held_out(layout) < state.held_out(layout);
        Ok((round, (chosen.is_evident() && carries_over).then(|| chosen.clone())))
    }

    /// As far as derivatives reach: what each candidate would gain beside those found, and where it would come to lie.
    fn likely(
        &self,
        state: &State,
        columns: &[Residuals],
        active: &[usize],
        among: &[usize],
    ) -> Vec<(usize, f64, Vec<f64>)> {
        let layout = &self.layout;
        let project = |c: usize| state.starts.project(layout, &columns[c]).0;
        let beside: Vec<Residuals> = active.iter().map(|&c| project(c)).collect();
        let look = |c: usize| {
            let own = project(c);
            let together: Vec<usize> = active.iter().copied().chain([c]).collect();
            let parts: Vec<&Residuals> = beside.iter().chain([&own]).collect();
            let normal = Normal::new(layout, &state.projected, &parts);
            let mut step = normal.step(1e-6)?;
            for (s, &c) in step.iter_mut().zip(&together) {
                *s = self.within(c, state.point.values[c] + *s) - state.point.values[c];
            }
            let mut values = state.point.values.clone();
            together.iter().zip(step.iter()).for_each(|(&c, s)| values[c] += s);
            Some((c, normal.gain(&step), values))
        };
        let others = among.iter().copied().filter(|c| !active.contains(c) && !is_silent(&columns[*c]));
        others
            .filter_map(look)
            .filter(|(c, gain, values)| *gain > 0.0 && values[*c] != state.point.values[*c])
            .collect()
    }

    /// The candidates whose derivatives are worth taking anew: those found, the likeliest by the derivatives last taken, and those that these
    /// say nothing of.
    fn screened(&self, state: &State, columns: &[Residuals], active: &[usize], all: &[usize]) -> Vec<usize> {
        let mut likely = self.likely(state, columns, active, all);
        likely.sort_by(|a, b| b.1.total_cmp(&a.1));
        let best: Vec<usize> = likely.iter().take(SCREENED).map(|(c, _, _)| *c).collect();
        let wanted = |c: &usize| active.contains(c) || best.contains(c) || is_silent(&columns[*c]);
        all.iter().copied().filter(wanted).collect()
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
