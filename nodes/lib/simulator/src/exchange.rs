//! Other sets of candidates that may do better than the set found.
//!
//! A forward search takes first what does half of two causes at once, and what repairs it next. From where it ended, derivatives tell of every
//! small set at once what it would leave; the likeliest are fitted and the better one is kept: an exchange step of best-subset selection
//! (Miller 2002, Subset Selection in Regression, ch. 3).
//!
//! ```text
//! S: c_S + 2 g'd + d'H d,   d_c = null_c - theta_c of those given up,   d_S = -(H_SS)^-1 (g_S + H_SF d_F)
//! ```

use nalgebra::{DMatrix, DVector};

use crate::SimulatorError;
use crate::fit::{Fitted, Fitter, State};
use crate::linear::Normal;
use crate::model::Residuals;
use crate::search::{FIT, Found, MOST_FOUND, MOST_ROLLOUTS, STEPS, is_silent};

/// Sets that are fitted.
const FITTED: usize = 4;
/// Candidates whose derivatives are taken anew.
const SCREENED: usize = 10;

/// A set of candidates, with what it would leave and where it would lie, as far as derivatives reach.
#[derive(Debug, Clone)]
struct Set {
    members: Vec<usize>,
    cost: f64,
    values: Vec<f64>,
}

impl Fitter<'_> {
    /// Holds the model found against other sets of at most `most` candidates that would leave less than a cost `enough`. A better one takes its
    /// place (`true`); what the data cannot tell from it is written down, and of what cannot be told apart the simulator's own parameters are
    /// kept: they can be mended.
    ///
    /// # Errors
    /// What the simulator says.
    pub(crate) fn exchange(
        &self,
        found: &mut Found,
        most: usize,
        enough: f64,
    ) -> Result<bool, SimulatorError> {
        if most == 0 || found.columns.is_empty() || self.rollouts() + SCREENED as f64 + FIT > MOST_ROLLOUTS {
            return Ok(false);
        }
        let layout = &self.layout;
        let (state, columns) = self.columns_of_likely_sets(found, most)?;
        let active = found.active();
        let scale = (state.training(layout) / self.residuals()).max(1.0);
        let worth = |f: &Fitted| f.state.training(layout) + scale * self.needed() * f.sizes.len() as f64;
        let mut fits: Vec<Fitted> = found.fit.iter().cloned().collect();
        let present = fits.first().map_or_else(|| state.training(layout), worth);
        for set in self.sets_to_fit(&state, &columns, &active, most, enough) {
            if self.rollouts() + FIT > MOST_ROLLOUTS {
                break;
            }
            let known: Vec<(usize, &Residuals)> = columns.iter().enumerate().collect();
            let Some(start) = self.trials(&state, &known, &[set.values])?.into_iter().next() else {
                continue;
            };
            let own = set.members.iter().map(|&c| columns[c].clone()).collect();
            let fit = self.pruned(self.fit(&start, &set.members, own, STEPS)?)?;
            // More candidates than before must carry over beside them, fewer or others beside none.
            let other = if fit.sizes.len() > active.len() { &state } else { &found.null };
            if self.carries_over(&fit, other, fit.least_margin()) {
                fits.push(fit.largest_first());
            }
        }
        fits.sort_by(|a, b| worth(a).total_cmp(&worth(b)));
        let Some(best) = fits.first().cloned() else { return Ok(false) };
        fits.retain(|f| f.sizes.len() == best.sizes.len() && self.alike(&best.state.costs, &f.state.costs));
        let is_new = worth(&best) < present && !fits.iter().any(|f| f.has_same_members(&active));
        let chosen = self.mendable(&fits.iter().collect::<Vec<_>>()).unwrap_or(&best).clone();
        let chosen = self.settled(chosen)?;
        found.confused = confused(&chosen, &fits);
        found.fit = Some(chosen);
        Ok(is_new)
    }

    /// Of fits that leave the same, the first of those with the most parameters of the simulator's own: they can be mended.
    pub(crate) fn mendable<'b>(&self, alike: &[&'b Fitted]) -> Option<&'b Fitted> {
        let own = |f: &Fitted| f.members().iter().filter(|&&c| self.model.candidates[c].is_own()).count();
        let most = alike.iter().map(|f| own(f)).max()?;
        alike.iter().copied().find(|f| own(f) == most)
    }

    /// Derivatives at the model found by what is in it and in the likeliest sets, by those that are known from elsewhere.
    fn columns_of_likely_sets(
        &self,
        found: &mut Found,
        most: usize,
    ) -> Result<(State, Vec<Residuals>), SimulatorError> {
        let active = found.active();
        let here = found.state();
        let mut known = found.columns.clone();
        if let Some(fit) = &found.fit {
            active.iter().zip(&fit.columns).for_each(|(&c, column)| known[c].clone_from(column));
        }
        let mut pool: Vec<usize> = active.clone();
        for c in self.sets(here, &known, &active, most).iter().flat_map(|s| s.members.iter().copied()) {
            if pool.len() < active.len() + SCREENED && !pool.contains(&c) {
                pool.push(c);
            }
        }
        let state = self.derivatives(found, &pool)?;
        let taken = found.taken.as_ref().map(|(_, taken)| taken.as_slice()).unwrap_or_default();
        let mut columns = found.columns.clone();
        columns.iter_mut().enumerate().filter(|(c, _)| !taken.contains(c)).for_each(|(_, v)| v.fill(0.0));
        Ok((state, columns))
    }

    /// The sets that are worth a fit.
    fn sets_to_fit(
        &self,
        state: &State,
        columns: &[Residuals],
        active: &[usize],
        most: usize,
        enough: f64,
    ) -> Vec<Set> {
        let mut out: Vec<Set> = Vec::new();
        for set in self.sets(state, columns, active, most) {
            // What a set gains over one that is in it is less than its name costs: the smaller one came first.
            let is_more = out.iter().any(|s| s.members.iter().all(|c| set.members.contains(c)));
            if out.len() < FITTED && !is_more && set.cost < enough {
                out.push(set);
            }
        }
        out
    }

    /// Sets of candidates other than the active one, the best by what they would leave and cost first.
    fn sets(&self, state: &State, columns: &[Residuals], active: &[usize], most: usize) -> Vec<Set> {
        let layout = &self.layout;
        let among: Vec<usize> =
            (0..columns.len()).filter(|&c| active.contains(&c) || !is_silent(&columns[c])).collect();
        let projected: Vec<Residuals> =
            among.iter().map(|&c| state.starts.project(layout, &columns[c]).0).collect();
        let normal = Normal::new(layout, &state.projected, &projected.iter().collect::<Vec<_>>());
        let cost = state.training(layout);
        let scale = (cost / self.residuals()).max(1.0);
        let mut out = Vec::new();
        for size in 1..=most.min(MOST_FOUND) {
            for picked in combinations(among.len(), size) {
                let members: Vec<usize> = picked.iter().map(|&p| among[p]).collect();
                if members.len() == active.len() && members.iter().all(|c| active.contains(c)) {
                    continue;
                }
                if let Some(set) = self.set(state, &normal, &among, &picked, active) {
                    out.push(Set { cost: cost + set.cost, ..set });
                }
            }
        }
        let name = scale * self.needed();
        // Sets of more candidates must gain what their names cost; others may be as good.
        out.retain(|s| {
            let more = s.members.len().saturating_sub(active.len());
            more == 0 || cost - s.cost > more as f64 * name
        });
        let worth = |s: &Set| s.cost + name * s.members.len() as f64;
        out.sort_by(|a, b| worth(a).total_cmp(&worth(b)));
        out
    }

    /// What a set would change the cost by.
    fn set(
        &self,
        state: &State,
        normal: &Normal,
        among: &[usize],
        picked: &[usize],
        active: &[usize],
    ) -> Option<Set> {
        let mut values = state.point.values.clone();
        active.iter().for_each(|&c| values[c] = self.model.candidates[c].null);
        let given_up = DVector::from_iterator(
            among.len(),
            among
                .iter()
                .enumerate()
                .map(|(p, &c)| if picked.contains(&p) { 0.0 } else { values[c] - state.point.values[c] }),
        );
        let slope = &normal.gradient + &normal.information * &given_up;
        let h = DMatrix::from_fn(picked.len(), picked.len(), |a, b| {
            let own = if a == b { 1.0 + 1e-6 } else { 1.0 };
            normal.information[(picked[a], picked[b])] * own
        });
        let step =
            h.cholesky()?.solve(&DVector::from_iterator(picked.len(), picked.iter().map(|&p| -slope[p])));
        let mut all = given_up;
        for (&p, s) in picked.iter().zip(step.iter()) {
            let c = among[p];
            values[c] = self.within(c, state.point.values[c] + s);
            all[p] = values[c] - state.point.values[c];
        }
        let cost = -normal.gain(&all);
        cost.is_finite().then(|| Set { members: picked.iter().map(|&p| among[p]).collect(), cost, values })
    }
}

/// By candidate of a fit: what stands for it in the others.
fn confused(chosen: &Fitted, others: &[Fitted]) -> Vec<Vec<usize>> {
    let members = chosen.members();
    let of = |member: &usize| {
        let without = others.iter().map(Fitted::members).filter(|o| !o.contains(member));
        let mut out: Vec<usize> = Vec::new();
        for c in without.flatten().filter(|c| !members.contains(c)) {
            if !out.contains(&c) {
                out.push(c);
            }
        }
        out
    };
    members.iter().map(of).collect()
}

/// Every choice of `size` of the first `count` numbers.
fn combinations(count: usize, size: usize) -> Vec<Vec<usize>> {
    let mut out: Vec<Vec<usize>> = vec![Vec::new()];
    for _ in 0..size {
        out = out
            .into_iter()
            .flat_map(|c| (c.last().map_or(0, |l| l + 1)..count).map(move |k| [c.as_slice(), &[k]].concat()))
            .collect();
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_car::TestCar;
    use crate::{Channel, Drive, Model, Roll as _, SimulatorFile, candidates};

    #[test]
    fn a_set_that_repairs_half_of_each_cause_gives_way_to_the_causes() {
        let car = TestCar::new();
        let (sequence, commands) = car.recorded(&[(0, 48.0), (4, 6.0)], 40.0, 3);
        let file = SimulatorFile::parse("command: [none]", std::env::temp_dir().as_path()).unwrap();
        let drive = Drive::new(&sequence, commands, &[Channel::VYMps, Channel::YawRateRadps]).unwrap();
        let list = candidates(car.description(), &file, &drive.channels, true, &[]);
        let place = |name: &str| list.iter().position(|c| c.name == name).unwrap();
        let model = Model::new(&car, &file, &drive, &list, true);
        let fitter = Fitter::new(&model);
        let all: Vec<usize> = (0..list.len()).collect();
        let (null, columns) = fitter.around(model.null(), None, &all).unwrap();
        let wrong = [place("steering_lag"), place("simulator.inertia")];
        let known = wrong.iter().map(|&c| columns[c].clone()).collect();
        let mut found = Found {
            fit: Some(fitter.fit(&null, &wrong, known, STEPS).unwrap()),
            columns,
            ..Found::new(null)
        };
        let mut exchanges = 0;
        while fitter.exchange(&mut found, 2, f64::INFINITY).unwrap() {
            exchanges += 1;
        }
        assert!((1..=2).contains(&exchanges), "{exchanges}");
        let right = [place("simulator.c_front"), place("simulator.delay_steps")];
        assert!(found.fit.as_ref().unwrap().has_same_members(&right), "{:?}", found.active());
        // Delays before and inside the simulator are one; of the two the one that can be mended is kept.
        let delay = found.active().iter().position(|&c| c == right[1]).unwrap();
        assert!(found.confused[delay].contains(&place("steering_delay")), "{:?}", found.confused);
        assert!(found.confused[1 - delay].is_empty(), "{:?}", found.confused);
    }

    #[test]
    fn every_choice_is_made_once() {
        assert_eq!(combinations(3, 2), [[0, 1], [0, 2], [1, 2]]);
        assert_eq!(combinations(5, 3).len(), 10);
        assert_eq!(combinations(2, 3), Vec::<Vec<usize>>::new());
    }
}
