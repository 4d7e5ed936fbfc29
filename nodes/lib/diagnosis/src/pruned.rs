//! What a configuration does not need: by the linearisation where that is clear, else by rollouts.

use gripsight_estimation::selection::{Quadratic, Selection, configuration};
use gripsight_model::Site;
use rayon::prelude::*;

use crate::around::{Around, Refined};
use crate::infer::FIRST;

/// Loss of the linear evidence up to which rollouts are asked whether an effect is needed.
const CLEAR: f64 = 40.0;
/// Loss up to which a part is asked for again once another one has gone.
const DOUBTFUL: f64 = 10.0;

/// A configuration of which nothing is needless.
pub(crate) struct Pruned {
    pub(crate) chosen: Vec<usize>,
    pub(crate) fitted: Refined,
    /// What the evidence loses without each effect, by term.
    pub(crate) losses: Vec<(usize, f64)>,
}

impl Around<'_, '_> {
    /// What could be taken out of a configuration: each effect, the flexible terms of each site, and both of one site.
    fn moves(&self, chosen: &[usize]) -> Vec<Vec<usize>> {
        let effects = (FIRST..FIRST + self.columns.effects.len()).filter(|&i| chosen[i] > 0);
        let flexible = |site: Site| -> Vec<usize> {
            let terms = self.columns.of_site(site).map(|c| self.columns.term_of_flexible(c));
            terms.filter(|&t| chosen[t] > 0).collect()
        };
        let mut out: Vec<Vec<usize>> = Vec::new();
        for i in effects {
            out.push(vec![i]);
            let sites = self.columns.effects[i - FIRST].spec().sites;
            let beside: Vec<usize> = sites.iter().flat_map(|s| flexible(*s)).collect();
            if !beside.is_empty() {
                out.push([vec![i], beside].concat());
            }
        }
        out.extend(Site::ALL.into_iter().map(flexible).filter(|f| !f.is_empty()));
        out
    }

    /// How much the evidence falls without a part of a configuration: by rollouts, where the linearisation does not make it clear.
    fn loss(&self, problem: &Quadratic, chosen: &[usize], part: &[usize], with: f64) -> Option<f64> {
        let linear = |chosen: &[usize]| {
            configuration(problem, self.dispersion, self.terms, chosen).map(|c| c.log_evidence)
        };
        let mut without = chosen.to_vec();
        let mut weight = 0.0;
        let mut flat = false;
        for &i in part {
            without[i] = 0;
            weight += self.terms[i].log_weights[1] - self.terms[i].log_weights[0];
            let effect = self.columns.effects.get(i - FIRST);
            // A difference quotient promises what it likes.
            flat |= effect.is_some_and(|e| e.spec().flat_at_null);
        }
        let promised = linear(chosen)? - linear(&without)? + weight;
        if promised > CLEAR && !flat {
            return Some(promised);
        }
        self.nearby(problem, &without).map(|(log, _)| with - log)
    }

    /// Probability of each term's mattering, with the odds of the effects in the most probable configuration corrected by what the evidence
    /// loses without them by rollouts.
    pub(crate) fn confirmed(
        &self,
        problem: &Quadratic,
        selection: &Selection,
        losses: &[(usize, f64)],
    ) -> Option<Vec<f64>> {
        let mut out: Vec<f64> =
            selection.probability.iter().map(|p| if p.len() > 1 { p[p.len() - 1] } else { 1.0 }).collect();
        let log = |chosen: &[usize]| {
            let found = configuration(problem, self.dispersion, self.terms, chosen);
            found.map(|c| c.log_evidence)
        };
        let best = log(&selection.best)?;
        for &(i, loss) in losses {
            let mut without = selection.best.clone();
            without[i] = 0;
            let weight = self.terms[i].log_weights[1] - self.terms[i].log_weights[0];
            let promised = best - log(&without)? + weight;
            let odds = (out[i].clamp(1e-6, 1.0 - 1e-6) / (1.0 - out[i]).max(1e-6)).ln() + loss - promised;
            out[i] = 1.0 / (1.0 + (-odds).exp());
        }
        Some(out)
    }

    /// Drops what rollouts find needless, the most needless first; the others are asked again once it is gone.
    pub(crate) fn pruned(&self, problem: &Quadratic, chosen: &[usize]) -> Option<Pruned> {
        let mut chosen = chosen.to_vec();
        let (mut with, _) = self.nearby(problem, &chosen)?;
        let moves = self.moves(&chosen);
        let mut losses: Vec<(Vec<usize>, f64)> = moves
            .into_par_iter()
            .filter_map(|part| self.loss(problem, &chosen, &part, with).map(|loss| (part, loss)))
            .collect();
        losses.sort_by(|a, b| a.1.total_cmp(&b.1));
        let mut out: Vec<(usize, f64)> = Vec::new();
        let mut dropped = false;
        for (mut part, mut loss) in losses {
            let whole = part.len();
            part.retain(|&i| chosen[i] > 0);
            if dropped && !part.is_empty() && (part.len() < whole || loss < DOUBTFUL) {
                loss = self.loss(problem, &chosen, &part, with).unwrap_or(loss);
            }
            if loss < 0.0 && !part.is_empty() {
                part.iter().for_each(|&i| chosen[i] = 0);
                with = self.nearby(problem, &chosen)?.0;
                dropped = true;
            } else if let [i] = part[..]
                && i < FIRST + self.columns.effects.len()
            {
                out.push((i, loss));
            }
        }
        let fitted = self.by_rollouts(problem, &chosen)?;
        Some(Pruned { chosen, fitted, losses: out })
    }
}
