//! The steering's ratio, which may be off by any factor: in other units, or one on the car and another one in the simulator.
//!
//! A derivative does not reach that far, and tires imitate what a ratio does: each alone does what both should, so that both lie nearer.

use crate::SimulatorError;
use crate::candidates::{Candidate, Kind, Wrapped};
use crate::fit::{Fitted, Fitter, State};
use crate::round::Ahead;
use crate::search::{FIT, MOST_ROLLOUTS, SLOW, STEPS, UNEXPLAINED};

/// Factors looked at, beside those between degrees and radians.
const FACTORS: [f64; 3] = [0.5, 0.75, 1.5];
/// Where both are looked for: shares of what the ratio, and the other one, explain alone. Starts of a fit, no more.
const OF_RATIO: f64 = 0.8;
const OF_OTHER: [f64; 3] = [0.25, 0.45, 0.7];

impl Fitter<'_> {
    /// In the first round: the ratio fitted alone or, where that leaves more than noise, together with the best of the other fits. Nothing where that, too, leaves
    /// more than noise: a ratio imitates tires and delays as well as they do it.
    ///
    /// # Errors
    /// What the simulator says.
    pub(crate) fn ratio(&self, ahead: &Ahead, fits: &[Fitted]) -> Result<Vec<Fitted>, SimulatorError> {
        let cost = |s: &State| s.training(&self.layout);
        let looked = self.factors(&ahead.state)?;
        let Some((ratio, trial)) = looked.filter(|(_, t)| cost(t) < SLOW * cost(&ahead.state)) else {
            return Ok(Vec::new());
        };
        let alone = self.with(ahead, ratio, &trial)?;
        let unexplained = UNEXPLAINED * self.residuals();
        if cost(&alone.state) <= unexplained {
            return Ok(vec![alone]);
        }
        let best = fits.iter().min_by(|a, b| cost(&a.state).total_cmp(&cost(&b.state)));
        let Some((best, other)) = best.and_then(|f| Some((f, *f.members().last()?))) else {
            return Ok(Vec::new());
        };
        if other == ratio || self.rollouts() + FIT > MOST_ROLLOUTS {
            return Ok(Vec::new());
        }
        let null = &ahead.state.point.values;
        let between = |c: usize, far: &State, share: f64| null[c] + share * (far.point.values[c] - null[c]);
        let ratios = [trial.point.values[ratio], between(ratio, &alone.state, OF_RATIO)];
        let places = ratios.into_iter().flat_map(|r| OF_OTHER.map(|share| (r, share)));
        let values = places.map(|(r, share)| {
            let mut values = null.clone();
            values[ratio] = r;
            values[other] = self.within(other, between(other, &best.state, share));
            values
        });
        let trials = self.trials(&alone.state, &[], &values.collect::<Vec<_>>())?;
        let start = trials.into_iter().min_by(|a, b| cost(a).total_cmp(&cost(b)));
        // Of two causes even a rough look leaves less than one of them fitted.
        let Some(start) = start.filter(|s| cost(s) < cost(&alone.state).min(cost(&best.state))) else {
            return Ok(Vec::new());
        };
        let together = [other, ratio];
        let known = together.iter().map(|&c| ahead.columns[c].clone()).collect();
        let columns = self.learned(&alone.state, &start, &together, known);
        let both = self.fit(&start, &together, columns, STEPS)?;
        let is_both = cost(&both.state) <= unexplained && both.least_margin() > 0.0;
        Ok(is_both.then_some(both).into_iter().collect())
    }

    /// The steering's ratio at the best of some factors.
    fn factors(&self, state: &State) -> Result<Option<(usize, State)>, SimulatorError> {
        let is_ratio = |c: &Candidate| c.kind == Kind::Wrapped(Wrapped::SteeringGain);
        let Some(ratio) = self.model.candidates.iter().position(is_ratio) else { return Ok(None) };
        let unit = 1_f64.to_degrees();
        let values = FACTORS.into_iter().chain([1.0 / unit, unit]).map(|factor| {
            let mut values = state.point.values.clone();
            values[ratio] = self.within(ratio, factor * (1.0 + values[ratio]) - 1.0);
            values
        });
        let trials = self.trials(state, &[], &values.collect::<Vec<_>>())?;
        let best =
            trials.into_iter().min_by(|a, b| a.training(&self.layout).total_cmp(&b.training(&self.layout)));
        Ok(best.map(|trial| (ratio, trial)))
    }
}
