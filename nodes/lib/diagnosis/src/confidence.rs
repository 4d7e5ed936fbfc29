//! How sure an effect is the cause.

/// Chance, shared with what is alike and was not tried, from which an effect is named: below even odds it is a candidate.
pub(crate) const LEAST_CHANCE: f64 = 0.5;
/// Less than this is explained by none of the effects found, as far as their chances go.
const LEAST_EXPLAINED: f64 = 1e-3;

/// What tells an effect that is the cause from one that stands in for it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Signs {
    /// The most that the free terms of a room explain beside the effects found: a cause leaves them nothing, a stand-in does.
    pub(crate) left: f64,
    /// The same of the room that the effect sits in.
    pub(crate) left_in_its_room: f64,
    /// Whether the effect pushes along the car, where little else stands in for it.
    pub(crate) is_along: bool,
    /// What the effect explains beside the others, per residual as well.
    pub(crate) explained: f64,
    /// How far its size drifts between data, as a share of it.
    pub(crate) drift: f64,
    /// How many effects the data cannot tell from it.
    pub(crate) confused: usize,
    /// How many effects do nearly the same and were not among the candidates.
    pub(crate) untried: usize,
    /// How far the tires beside it lie from those handed over, in units of the trust in them.
    pub(crate) tire_shift: f64,
    /// How many of the effects found beside it are no causes themselves, as far as can be told: a cause needs none, and what stands in for
    /// something else leaves others to mend the difference.
    pub(crate) doubtful_beside: f64,
}

/// A sign that speaks against an effect.
#[derive(Debug, Clone)]
struct Doubt {
    /// What it takes off the logarithm of the odds.
    odds: f64,
    /// In words.
    text: String,
}

impl Signs {
    /// Chance that the effect, or one of those alike that were not tried, is the cause: a logistic regression on the effects found in
    /// development cases (true ones against those that stood in for others or for nothing), 2026-11-21; see tests/results/withheld.
    pub(crate) fn chance(self) -> f64 {
        /// Of an effect that nothing speaks against, and how much more of one along the car.
        const ODDS: f64 = 5.16;
        const ALONG: f64 = 2.48;
        const MOST: f64 = 0.99;
        let along = if self.is_along { ALONG } else { 0.0 };
        let odds = ODDS + along - self.doubts().iter().map(|doubt| doubt.odds).sum::<f64>();
        (1.0 + (-odds).exp()).recip().min(MOST)
    }

    /// The signs of several effects found together, with how many of the others are doubtful: each by its chance with nothing beside it, and in
    /// full from a tenth of what the effect itself explains.
    pub(crate) fn together(alone: &[Self]) -> Vec<Self> {
        const COUNTS: f64 = 0.1;
        let doubt = |of: &Self, other: &Self| {
            let share = other.explained.max(LEAST_EXPLAINED) / of.explained.max(LEAST_EXPLAINED);
            (1.0 - other.chance()) * (share / COUNTS).min(1.0)
        };
        let beside = |i: usize| {
            let others = alone.iter().enumerate().filter(|(j, _)| *j != i);
            others.map(|(_, other)| doubt(&alone[i], other)).sum()
        };
        alone.iter().enumerate().map(|(i, &of)| Self { doubtful_beside: beside(i), ..of }).collect()
    }

    /// What speaks against it.
    fn doubts(self) -> [Doubt; 6] {
        const PER_LOG_SHARE: f64 = 0.71;
        const PER_LOG_DRIFT: f64 = 1.96;
        const PER_LEFT_UNTRIED: f64 = 2.35;
        const PER_TWIN: f64 = 0.37;
        const PER_SHIFT: f64 = 0.83;
        const PER_BESIDE: f64 = 1.00;
        /// Share of what the effect explains, and drift, below which no more is learned.
        const LEAST_SHARE: f64 = 0.01;
        const LEAST_DRIFT: f64 = 0.05;
        /// A shift of the tires that says no more where it is larger.
        const MOST_SHIFT: f64 = 4.0;
        /// What an effect's own room may explain beside it where one that is alike was not tried, and steps of more, up to so many.
        const USUAL: f64 = 0.02;
        const STEP: f64 = 0.03;
        const MOST_STEPS: f64 = 3.0;
        /// A share above that is told in words.
        const MANY_TIMES: f64 = 10.0;
        let steps = ((self.left_in_its_room - USUAL) / STEP).clamp(0.0, MOST_STEPS);
        let untried = if self.untried > 0 { steps } else { 0.0 };
        let share = self.left / self.explained.max(LEAST_EXPLAINED);
        let percent = |share: f64| (100.0 * share).round();
        [
            Doubt {
                odds: PER_LOG_SHARE * (share / LEAST_SHARE).ln_1p(),
                text: if share > MANY_TIMES {
                    "free terms would explain many times what it explains".to_owned()
                } else {
                    format!("free terms would explain {} % of what it explains", percent(share))
                },
            },
            Doubt {
                odds: PER_LOG_DRIFT * (self.drift / LEAST_DRIFT).ln_1p(),
                text: format!("its size differs by {} % between parts of the data", percent(self.drift)),
            },
            Doubt {
                odds: PER_LEFT_UNTRIED * untried,
                text: "free terms of its own place find more to explain, and what is alike was not tried"
                    .to_owned(),
            },
            Doubt {
                odds: PER_TWIN * self.confused as f64,
                text: "other effects do nearly as well".to_owned(),
            },
            Doubt {
                odds: PER_SHIFT * self.tire_shift.min(MOST_SHIFT),
                text: "the tires beside it are unlike those handed over".to_owned(),
            },
            Doubt {
                odds: PER_BESIDE * self.doubtful_beside,
                text: "it needs others beside it that are hardly causes themselves".to_owned(),
            },
        ]
    }

    /// The doubts that weigh, the heaviest first.
    pub(crate) fn heavy_doubts(self) -> Vec<String> {
        const HEAVY: f64 = 1.0;
        let mut doubts = self.doubts().to_vec();
        doubts.sort_by(|a, b| b.odds.total_cmp(&a.odds));
        doubts.into_iter().filter(|d| d.odds > HEAVY).map(|d| d.text).collect()
    }

    /// Chance that it is the effect itself.
    pub(crate) fn confidence(self) -> f64 {
        self.chance() / (1 + self.untried) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_is_named_that_leaves_the_rooms_nothing_and_has_one_likely_size() {
        let cause = Signs {
            left: 0.01,
            left_in_its_room: 0.0,
            is_along: false,
            explained: 2.0,
            drift: 0.05,
            confused: 0,
            untried: 0,
            tire_shift: 0.3,
            doubtful_beside: 0.0,
        };
        let named = |signs: Signs| signs.chance() >= LEAST_CHANCE;
        assert!(named(cause) && cause.confidence() > 0.9);
        // Twins share the chance; they do not take the name.
        let twin = Signs { confused: 1, ..cause };
        assert!(named(twin) && twin.confidence() < cause.confidence());
        // What is alike and was not tried shares the name, and is believed less where its room has something to explain.
        let untried = Signs { untried: 1, ..cause };
        assert!(named(untried) && untried.confidence() < 0.5);
        assert!(named(Signs { left_in_its_room: 0.1, ..cause }));
        assert!(!named(Signs { left_in_its_room: 0.1, ..untried }));
        // Much is left and the size drifts: not sideways, where much can stand in for it.
        let unsure = Signs { left: 0.6, drift: 0.3, ..cause };
        assert!(!named(unsure) && named(Signs { is_along: true, ..unsure }));
        assert!(named(Signs { left: 0.3, drift: 0.1, ..cause }));
        // Tires that are unlike those handed over speak against it.
        assert!(Signs { tire_shift: 2.0, ..cause }.chance() < cause.chance());
        // The same leftovers beside an effect whose size carries over, and beside one whose size does not.
        assert!(named(Signs { left: 0.2, ..cause }));
        assert!(!named(Signs { left: 0.2, drift: 0.8, ..cause }));
        // What hardly matters itself cannot be told from the rest.
        assert!(!named(Signs { explained: 0.0, drift: 0.3, ..cause }));
        // The chance is none too sure, and falls as more is left.
        let chances: Vec<f64> =
            [0.0, 0.02, 0.1, 0.5, 2.0].map(|left| Signs { left, ..cause }.chance()).to_vec();
        assert!(chances[0] <= 0.99 && chances.windows(2).all(|w| w[0] >= w[1]), "{chances:?}");
    }

    #[test]
    fn what_needs_doubtful_effects_beside_it_is_doubted_itself() {
        let cause = Signs {
            left: 0.1,
            left_in_its_room: 0.0,
            is_along: false,
            explained: 2.0,
            drift: 0.1,
            confused: 0,
            untried: 0,
            tire_shift: 0.3,
            doubtful_beside: 0.0,
        };
        let doubtful = Signs { drift: 1.0, explained: 0.5, ..cause };
        let of_first = |signs: &[Signs]| Signs::together(signs)[0].chance();
        assert_eq!(of_first(&[cause]), cause.chance());
        // Another cause beside it hardly matters, doubtful ones do, the more so the more there are; what explains next to nothing does not.
        assert!(of_first(&[cause, cause]) > 0.9 * cause.chance());
        assert!(of_first(&[cause, doubtful]) < of_first(&[cause, cause]));
        assert!(of_first(&[cause, doubtful, doubtful, doubtful]) < LEAST_CHANCE);
        let small = Signs { explained: 0.002, ..doubtful };
        assert!(of_first(&[cause, small, small, small]) > 0.9 * cause.chance());
    }
}
