//! What the driver keeps of a slide.

/// Growth with each half lap, as the slide may have been a puddle.
const REGAINED: f64 = 1.01;
/// Share of what the road gave when the car slid, or of what was planned then, to go on with.
pub(super) const CAUGHT: f64 = 0.96;

/// A plan held back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Caught {
    /// Grip to plan with at most.
    pub(super) grip: f64,
    /// Grip that was planned with when the car slid.
    planned: f64,
    /// Somebody else says so, too.
    warned: bool,
    /// A set was identified since.
    judged: bool,
    /// The half lap with the slide is over.
    over: bool,
}

impl Caught {
    /// The road gives `grip` where `planned` was planned with.
    pub(super) fn new(grip: f64, planned: f64, warned: bool) -> Self {
        Self { grip: grip.max(0.05), planned, warned, judged: false, over: false }
    }

    /// The same after an earlier slide, of which less may be left.
    pub(super) fn after(self, before: Option<Self>) -> Self {
        let Some(before) = before else { return self };
        let (grip, planned) = (self.grip.min(before.grip), self.planned.min(before.planned));
        Self { grip, planned, warned: self.warned || before.warned, ..self }
    }

    /// A set was taken: from data that may hold the slide.
    pub(super) fn judge(&mut self) {
        self.judged = true;
    }

    /// Half a lap ends. What the road has lies between what it gave and what it seemed not to give: half of the way with each half lap that is driven
    /// without another slide, once a set has seen the same road. Before that no further than the set in use has `promised`, if nobody withdrew it: a
    /// road that has become slippery stays so.
    pub(super) fn pass(&mut self, promised: f64) {
        let slid = CAUGHT * self.planned;
        let most = match self {
            Self { over: false, .. } => 0.0,
            Self { judged: true, .. } => slid,
            Self { warned: true, .. } => 0.0,
            _ => slid.min(promised),
        };
        self.grip = (REGAINED * self.grip).max(0.5 * (self.grip + most));
        self.over = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_of_what_was_lost_comes_back_with_each_half_lap_once_a_set_has_judged() {
        let mut caught = Caught::new(0.5, 0.8, true);
        (0..3).for_each(|_| caught.pass(0.9));
        approx::assert_relative_eq!(caught.grip, 0.5 * REGAINED.powi(3));
        let mut caught = Caught::new(0.5, 0.8, true);
        caught.judge();
        caught.pass(0.0);
        approx::assert_relative_eq!(caught.grip, 0.5 * REGAINED);
        let most = CAUGHT * 0.8;
        for _ in 0..4 {
            let lost = most - caught.grip;
            caught.pass(0.0);
            approx::assert_relative_eq!(most - caught.grip, 0.5 * lost, max_relative = 1e-9);
        }
        // Beyond it, as slowly as without a set; and a second slide begins anew, no higher than the first.
        (0..9).for_each(|_| caught.pass(0.0));
        assert!(caught.grip > most && caught.grip < 1.1 * most);
        let again = Caught::new(0.6, 0.9, false).after(Some(Caught::new(0.7, 0.8, true)));
        assert_eq!(again, Caught::new(0.6, 0.8, true));
    }

    #[test]
    fn a_promise_that_nobody_withdrew_is_come_back_to() {
        let mut caught = Caught::new(0.2, 0.5, false);
        caught.pass(0.4);
        assert!(caught.grip < 0.21, "the half lap with the slide");
        caught.pass(0.4);
        assert!((0.3..0.31).contains(&caught.grip), "{}", caught.grip);
        (0..4).for_each(|_| caught.pass(0.4));
        assert!((0.39..0.42).contains(&caught.grip), "{}", caught.grip);
    }
}
