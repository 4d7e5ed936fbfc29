//! How sure an effect is the cause.

/// Chance, shared with what is alike and was not tried, from which an effect is named: below even odds it is a candidate.
pub(crate) const LEAST_CHANCE: f64 = 0.5;

/// What tells an effect that is the cause from one that stands in for it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Signs {
    /// The most that the free terms of a room explain beside the effects found: a cause leaves them nothing, a stand-in does.
    pub(crate) left: f64,
    /// The same of the room that the effect sits in.
    pub(crate) left_in_its_room: f64,
    /// What the effect explains beside the others, per residual as well.
    pub(crate) explained: f64,
    /// How far its size drifts between data, as a share of it.
    pub(crate) drift: f64,
    /// Its size over the size that matters.
    pub(crate) relative_size: f64,
    /// How many effects the data cannot tell from it.
    pub(crate) confused: usize,
    /// How many effects do nearly the same and were not among the candidates.
    pub(crate) untried: usize,
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
        /// Of an effect that nothing speaks against.
        const ODDS: f64 = 4.99;
        const MOST: f64 = 0.99;
        let odds = ODDS - self.doubts().iter().map(|doubt| doubt.odds).sum::<f64>();
        (1.0 + (-odds).exp()).recip().min(MOST)
    }

    /// What speaks against it.
    fn doubts(self) -> [Doubt; 5] {
        const PER_LOG_SHARE: f64 = 0.89;
        const PER_LOG_DRIFT: f64 = 1.57;
        const PER_LEFT: f64 = 0.32;
        const PER_LEFT_UNTRIED: f64 = 2.33;
        const PER_SIZE: f64 = 1.40;
        const PER_TWIN: f64 = 0.93;
        /// Share of what the effect explains, and drift, below which no more is learned.
        const LEAST_SHARE: f64 = 0.01;
        const LEAST_DRIFT: f64 = 0.05;
        /// Size over the size that matters from which an effect is large, and by how much more it grows no more unlikely: no drive that the
        /// rule was fitted on has a cause of more than twice that size, so that it knows large stand-ins alone.
        const LARGE: f64 = 2.0;
        const LARGER: f64 = 1.0;
        const LEAST_EXPLAINED: f64 = 1e-3;
        // What an effect's own room may explain beside it, in steps of so much, up to so many; less where one that is alike was not tried.
        let steps = |usual: f64, step: f64| ((self.left_in_its_room - usual) / step).clamp(0.0, 3.0);
        let untried = if self.untried > 0 { steps(0.02, 0.03) } else { 0.0 };
        let share = self.left / self.explained.max(LEAST_EXPLAINED);
        let percent = |share: f64| (100.0 * share).round();
        [
            Doubt {
                odds: PER_LOG_SHARE * (share / LEAST_SHARE).ln_1p(),
                text: format!("free terms would explain {} % of what it explains", percent(share)),
            },
            Doubt {
                odds: PER_LOG_DRIFT * (self.drift / LEAST_DRIFT).ln_1p(),
                text: format!("its size differs by {} % between parts of the data", percent(self.drift)),
            },
            Doubt {
                odds: PER_LEFT * steps(0.03, 0.05) + PER_LEFT_UNTRIED * untried,
                text: "free terms of its own place find more to explain".to_owned(),
            },
            Doubt {
                odds: PER_SIZE * (self.relative_size - LARGE).clamp(0.0, LARGER),
                text: format!("its size is {:.1} times one that matters", self.relative_size),
            },
            Doubt {
                odds: PER_TWIN * self.confused as f64,
                text: "other effects do nearly as well".to_owned(),
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
            explained: 2.0,
            drift: 0.05,
            relative_size: 1.0,
            confused: 0,
            untried: 0,
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
        assert!(!named(Signs { left: 0.6, drift: 0.3, ..cause }));
        // A large size speaks against it, and the larger one no more; alone it does not take the name.
        let large = Signs { relative_size: 3.0, left: 0.1, ..cause };
        assert!(named(large) && large.chance() < Signs { left: 0.1, ..cause }.chance());
        assert_eq!(large.chance(), Signs { relative_size: 4.4, ..large }.chance());
        assert!(named(Signs { left: 0.3, drift: 0.1, ..cause }));
        assert!(!named(Signs { left: 0.3, drift: 0.1, ..large }));
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
}
