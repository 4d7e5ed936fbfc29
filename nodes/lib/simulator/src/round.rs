//! A round of the forward search: the candidate that explains most beside those found.
//!
//! Derivatives by the candidates at the model so far, by all in the first round, then by the likeliest as far as those reach; the likeliest few
//! are followed along their own line, the likeliest two of these fitted together with those found before.

use crate::SimulatorError;
use crate::fit::{Fitted, Fitter, State};
use crate::linear::Normal;
use crate::look::LOOKS;
use crate::model::Residuals;
use crate::search::{FIT, Found, MOST_ROLLOUTS, SLOW, STEPS, UNEXPLAINED, is_silent};

/// Candidates that are followed along their line.
const FOLLOWED: usize = 6;
/// Candidates that are fitted, and where none of these explains the gap.
const FITTED: usize = 2;
const FITTED_IF_UNEXPLAINED: usize = 3;
/// Candidates whose derivatives are taken anew after the first round.
const SCREENED: usize = 14;

/// A candidate that may be there.
#[derive(Debug, Clone)]
pub(crate) struct Likely {
    pub(crate) candidate: usize,
    /// What it would gain.
    pub(crate) gain: f64,
    /// Values of all candidates where it would.
    pub(crate) values: Vec<f64>,
}

/// What a round goes on from.
pub(crate) struct Ahead {
    pub(crate) state: State,
    pub(crate) active: Vec<usize>,
    pub(crate) columns: Vec<Residuals>,
}

impl Fitter<'_> {
    /// The model with one candidate more, where one is evident.
    ///
    /// # Errors
    /// What the simulator says.
    pub(crate) fn round(&self, found: &mut Found) -> Result<Option<Fitted>, SimulatorError> {
        let layout = &self.layout;
        let (ahead, mut likely) = self.ahead(found)?;
        let before = ahead.state.training(layout);
        let unlikely = likely.split_off(FOLLOWED.min(likely.len()));
        let mut followed = self.follow(&ahead.state, &ahead.columns, &likely)?;
        let mut fits: Vec<Fitted> = Vec::new();
        let least = |fits: &[Fitted]| fits.iter().map(|f| f.state.training(layout)).fold(before, f64::min);
        let unexplained = UNEXPLAINED * self.residuals();
        for (k, (c, trial)) in followed.iter().enumerate() {
            // Where even the best gains less than its name costs, nothing is fitted.
            let is_worth_it = before - trial.training(layout) >= 0.5 * self.needed();
            let is_one_more = k < FITTED_IF_UNEXPLAINED
                && least(&fits) > unexplained
                && self.rollouts() + FIT <= MOST_ROLLOUTS;
            let is_due =
                fits.is_empty() || k < FITTED && self.rollouts() + FIT <= MOST_ROLLOUTS || is_one_more;
            if is_worth_it && is_due {
                fits.push(self.with(&ahead, *c, trial)?);
            }
        }
        if ahead.active.is_empty() && least(&fits) > unexplained {
            fits.extend(self.ratio(&ahead, &fits)?);
        }
        let left = least(&fits);
        if !found.zoomed
            && left > unexplained.max(SLOW * before)
            && self.rollouts() + self.zooming() + FIT <= MOST_ROLLOUTS
        {
            found.zoomed = true;
            if let Some((c, trial)) = self.zoom(&ahead.state, &ahead.active)? {
                fits.push(self.with(&ahead, c, &trial)?);
            }
        }
        // What shows in a few windows alone, such as a grip that the simulator does not reach, is unlikely by its derivatives: where most is
        // left, or much and nothing is evident, the others are followed as well.
        let left = least(&fits);
        let is_evident = fits.iter().any(|f| f.state.training(layout) <= left && f.last_margin() > 0.0);
        let affordable = self.rollouts() + (LOOKS * unlikely.len()) as f64 + FIT <= MOST_ROLLOUTS;
        if left > unexplained && (left > SLOW * before || !is_evident) && affordable {
            let more = self.follow(&ahead.state, &ahead.columns, &unlikely)?;
            let likeliest = followed.first().map_or(before, |(_, trial)| trial.training(layout));
            if let Some((c, trial)) = more.first().filter(|(_, trial)| trial.training(layout) < likeliest) {
                fits.push(self.with(&ahead, *c, trial)?);
            }
            followed.extend(more);
            followed.sort_by(|a, b| a.1.training(layout).total_cmp(&b.1.training(layout)));
        }
        found.compared = followed.iter().map(|(c, s)| (*c, s.training(layout))).collect();
        fits.sort_by(|a, b| a.state.training(layout).total_cmp(&b.state.training(layout)));
        let Some(best) = fits.first() else { return Ok(None) };
        let is_alike =
            |f: &&Fitted| f.sizes.len() == best.sizes.len() && self.alike(&best.state.costs, &f.state.costs);
        let alike: Vec<&Fitted> = fits.iter().filter(is_alike).collect();
        let chosen = self.mendable(&alike).unwrap_or(best);
        // A limit that another one hides shows nothing once that is taken: here both are seen.
        let last = |f: &Fitted| f.members().last().copied();
        let others = alike.iter().filter_map(|f| Some((last(chosen)?, last(f)?)));
        found.alike.extend(others.filter(|(chosen, other)| chosen != other));
        let best = self.settled(chosen.clone())?;
        Ok(self.carries_over(&best, &ahead.state, best.last_margin()).then_some(best))
    }

    /// Derivatives at the model so far, and what they say of the candidates, likeliest first.
    fn ahead(&self, found: &mut Found) -> Result<(Ahead, Vec<Likely>), SimulatorError> {
        let active = found.active();
        let all: Vec<usize> = (0..self.model.candidates.len()).filter(|c| !found.mute.contains(c)).collect();
        let looked = match found.columns.is_empty() {
            true => all,
            false => self.screened(found.state(), &found.columns, &active, &all),
        };
        let state = self.derivatives(found, &looked)?;
        let columns = found.columns.clone();
        let mut likely = self.likely(&state, &columns, &active, &looked);
        let silent: Vec<usize> =
            looked.iter().copied().filter(|c| !active.contains(c) && is_silent(&columns[*c])).collect();
        let (seen, mute) = self.scan(&state, &silent)?;
        likely.extend(seen);
        found.mute.extend(mute);
        likely.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        Ok((Ahead { state, active, columns }, likely))
    }

    /// A candidate fitted together with those found.
    pub(crate) fn with(
        &self,
        ahead: &Ahead,
        candidate: usize,
        trial: &State,
    ) -> Result<Fitted, SimulatorError> {
        let together: Vec<usize> = ahead.active.iter().copied().chain([candidate]).collect();
        let known = together.iter().map(|&c| ahead.columns[c].clone()).collect();
        self.fit(trial, &together, self.learned(&ahead.state, trial, &together, known), STEPS)
    }

    /// As far as derivatives reach: what each candidate would gain beside those found, and where it would come to lie.
    fn likely(&self, state: &State, columns: &[Residuals], active: &[usize], among: &[usize]) -> Vec<Likely> {
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
            Some(Likely { candidate: c, gain: normal.gain(&step), values })
        };
        let others = among.iter().copied().filter(|c| !active.contains(c) && !is_silent(&columns[*c]));
        others
            .filter_map(look)
            .filter(|l| l.gain > 0.0 && l.values[l.candidate] != state.point.values[l.candidate])
            .collect()
    }

    /// The candidates whose derivatives are worth taking anew: those found, the likeliest by the derivatives last taken, and those that these
    /// say nothing of.
    fn screened(&self, state: &State, columns: &[Residuals], active: &[usize], all: &[usize]) -> Vec<usize> {
        let mut likely = self.likely(state, columns, active, all);
        likely.sort_by(|a, b| b.gain.total_cmp(&a.gain));
        let best: Vec<usize> = likely.iter().take(SCREENED).map(|l| l.candidate).collect();
        let wanted = |c: &usize| active.contains(c) || best.contains(c) || is_silent(&columns[*c]);
        all.iter().copied().filter(wanted).collect()
    }
}
