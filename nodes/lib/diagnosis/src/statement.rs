//! What is said of an effect: how likely it is a cause, and what shares that chance.

use crate::decisions;

/// An effect of the model that is left in the end.
#[derive(Debug, Clone)]
pub(crate) struct Statement {
    pub(crate) term: usize,
    /// Effects that do nearly the same and are not among the candidates.
    pub(crate) untried: usize,
    /// Effects that do nearly the same, by term, with the evidence of the model that has them in its place, over that of the model.
    pub(crate) rivals: Vec<(usize, f64)>,
    /// Logarithm of the predictive ratio of held-out data, with it over without it.
    pub(crate) held_out_log_ratio: f64,
    /// How many half widths of its interval its size is away from nothing.
    pub(crate) size_over_half_width: f64,
    /// Share of the error on data held out, noise included, that is left without it and that it closes.
    pub(crate) closes: f64,
    /// What it explains over what of the unnamed looks like it; infinite where nothing unnamed is needed.
    pub(crate) over_unexplained: f64,
    /// Whether rollouts of held-out data surely miss by more with it than without it.
    pub(crate) refuted: bool,
}

impl Statement {
    /// Chance that the effect, or what does nearly the same, is a cause.
    pub(crate) fn chance_of_alike(&self) -> f64 {
        let by_size = decisions::chance(self.size_over_half_width);
        if self.refuted { by_size.min(decisions::NEEDLESS) } else { by_size }
    }

    /// Chance that one of the candidates that do nearly the same is a cause: what is not among the candidates has its share.
    pub(crate) fn chance_of_candidates(&self) -> f64 {
        let tried = 1.0 + self.rivals.iter().map(|(_, ratio)| ratio).sum::<f64>();
        self.chance_of_alike() * tried / (tried + self.unasked())
    }

    /// Chance that the effect is a cause.
    pub(crate) fn chance(&self) -> f64 {
        self.chance_of_alike() / self.sharers()
    }

    /// Chance that another candidate, by term, is the cause in its place.
    pub(crate) fn chance_instead(&self, term: usize) -> f64 {
        let ratio = self.rivals.iter().find(|(t, _)| *t == term).map_or(0.0, |(_, ratio)| *ratio);
        self.chance() * ratio
    }

    /// Chance that a candidate is the cause, where the effect or what does nearly the same is one.
    pub(crate) fn asked(&self) -> f64 {
        self.chance_of_candidates() / self.chance_of_alike()
    }

    /// Evidence for what does nearly the same and is not among the candidates, over that for the effect.
    fn unasked(&self) -> f64 {
        self.untried as f64 * decisions::unasked(self.size_over_half_width, self.over_unexplained)
    }

    /// What a chance is shared among: the effect, its rivals and what does nearly the same and nobody asked for, as they are likely.
    fn sharers(&self) -> f64 {
        1.0 + self.unasked() + self.rivals.iter().map(|(_, ratio)| ratio).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Vec<(bool, Statement)> {
        let path =
            concat!(env!("CARGO_MANIFEST_DIR"), "/../../../tests/results/withheld/development_effects.csv");
        let table = std::fs::read_to_string(path).unwrap();
        let row = |line: &str| {
            let cells: Vec<&str> = line.split(',').collect();
            let number = |i: usize| cells[i].parse::<f64>().unwrap();
            let [closes, size_over_half_width, over_unexplained, untried] = [5, 6, 7, 8].map(number);
            let statement = Statement {
                term: 0,
                untried: untried as usize,
                rivals: Vec::new(),
                held_out_log_ratio: 0.0,
                size_over_half_width,
                closes,
                over_unexplained,
                refuted: false,
            };
            (cells[4] == "1", statement)
        };
        let counts = |(_, s): &(bool, Statement)| s.over_unexplained >= decisions::LEAST_OVER_UNEXPLAINED;
        table.lines().skip(1).map(row).filter(counts).collect()
    }

    #[test]
    fn the_chance_is_that_of_the_fit_to_the_development_effects() {
        let rows = rows();
        assert!(rows.len() > 100, "{}", rows.len());
        let chances = || rows.iter().map(|(cause, s)| (f64::from(u8::from(*cause)), s.chance()));
        // At the best fit as many are causes as the chances promise: overall, and among those that are named.
        let (causes, promised) = chances().fold((0.0, 0.0), |sum, (c, p)| (sum.0 + c, sum.1 + p));
        assert!((causes - promised).abs() < 0.03 * causes, "{causes} causes, {promised} promised");
        let loss = -chances().map(|(c, p)| (c * p + (1.0 - c) * (1.0 - p)).ln()).sum::<f64>();
        let share = causes / rows.len() as f64;
        let constant = -(causes * share.ln() + (rows.len() as f64 - causes) * (1.0 - share).ln());
        assert!(loss < 0.75 * constant, "log loss {loss}, that of a constant {constant}");
    }

    #[test]
    fn a_size_far_from_nothing_raises_the_chance_and_what_is_not_tried_lowers_it() {
        let weak = Statement {
            term: 0,
            untried: 0,
            rivals: Vec::new(),
            held_out_log_ratio: 0.0,
            size_over_half_width: 0.7,
            closes: 0.01,
            over_unexplained: 0.1,
            refuted: false,
        };
        assert!(weak.chance() < 0.1, "{}", weak.chance());
        let strong = Statement {
            size_over_half_width: 8.0,
            closes: 0.5,
            over_unexplained: f64::INFINITY,
            ..weak.clone()
        };
        assert!(strong.chance() > 0.8, "{}", strong.chance());
        for less in [
            Statement { size_over_half_width: 1.0, ..strong.clone() },
            Statement { untried: 1, ..strong.clone() },
            Statement { refuted: true, ..strong.clone() },
        ] {
            assert!(less.chance() < strong.chance());
        }
    }

    #[test]
    fn a_chance_is_shared_with_what_does_as_well() {
        let alone = Statement {
            term: 3,
            untried: 0,
            rivals: Vec::new(),
            held_out_log_ratio: 50.0,
            size_over_half_width: 8.0,
            closes: 0.5,
            over_unexplained: f64::INFINITY,
            refuted: false,
        };
        let beside = Statement { rivals: vec![(4, 1.0), (5, 0.5)], ..alone.clone() };
        let whole = alone.chance();
        assert!((beside.chance() - whole / 2.5).abs() < 1e-12);
        assert!((beside.chance_instead(5) - whole / 5.0).abs() < 1e-12);
        assert!(beside.chance_instead(6) == 0.0);
        // One of the candidates it is; where nobody asked for another that does the same, less surely.
        assert!((beside.chance_of_candidates() - whole).abs() < 1e-12);
        let weak = Statement { size_over_half_width: 0.5, ..beside.clone() };
        let share = |s: &Statement| {
            Statement { untried: 1, ..s.clone() }.chance_of_candidates() / s.chance_of_candidates()
        };
        approx::assert_relative_eq!(share(&weak), 2.5 / 3.5, max_relative = 0.01);
        // What it would leave of a large effect would show, unless something like it does.
        assert!(share(&beside) > 0.85, "{}", share(&beside));
        let unexplained = Statement { over_unexplained: 5.0, ..beside };
        approx::assert_relative_eq!(share(&unexplained), 2.5 / 3.5, max_relative = 1e-9);
    }
}
