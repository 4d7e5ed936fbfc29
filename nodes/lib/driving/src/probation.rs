//! The first lap with a new model beside the last one without: a name that predicts better may still drive worse.

use crate::extended::Named;

/// Mean distance to the line, and time, over those of the lap before from which a lap is worse.
const FARTHER: f64 = 1.5;
const SLOWER: f64 = 1.03;
/// Growth of that distance, in wheelbases, that is nothing: a car that is steered late may be nearer to its line by luck, as it cuts its corners less.
const NOTHING_WHEELBASES: f64 = 0.05;
/// Part of a lap that may have been driven before the model was taken.
const LATE: f64 = 0.1;

/// How a lap was driven.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Driven {
    /// Its time.
    pub time_s: f64,
    /// Mean distance to the line.
    pub mean_m: f64,
}

/// A model that was given back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GivenBack {
    /// What was named.
    pub named: Named,
    /// The last lap without it, where there was one.
    pub without: Option<Driven>,
    /// The first with it; `None`: the car slid before it was over.
    pub with: Option<Driven>,
}

/// Watches the laps.
#[derive(Debug, Clone)]
pub(crate) struct Probation {
    wheelbase_m: f64,
    began_s: Option<f64>,
    sum_m: f64,
    looks: f64,
    last: Option<Driven>,
    /// When a model was taken, the one before, and the lap before, if a whole one was driven.
    taken: Option<(f64, Named, Option<Driven>)>,
    pub(crate) given_back: Option<GivenBack>,
}

impl Probation {
    pub(crate) fn new(wheelbase_m: f64) -> Self {
        Self { wheelbase_m, began_s: None, sum_m: 0.0, looks: 0.0, last: None, taken: None, given_back: None }
    }

    /// A model takes the place of another one.
    pub(crate) fn begin(&mut self, stamp_s: f64, before: Named) {
        self.taken = Some((stamp_s, before, self.last));
    }

    /// The next place; `ends`: a lap ends with it. Gives the model to go back to, where the lap was worse.
    pub(crate) fn pass(&mut self, stamp_s: f64, offset_m: f64, ends: bool, used: &Named) -> Option<Named> {
        self.sum_m += offset_m.abs();
        self.looks += 1.0;
        if !ends {
            return None;
        }
        let lap = self
            .began_s
            .map(|began_s| (began_s, Driven { time_s: stamp_s - began_s, mean_m: self.sum_m / self.looks }));
        (self.began_s, self.sum_m, self.looks) = (Some(stamp_s), 0.0, 0.0);
        let (began_s, lap) = lap?;
        self.last = Some(lap);
        let (taken_s, before, without) = self.taken?;
        if taken_s > began_s + LATE * lap.time_s {
            // Most of it was driven without.
            self.taken = Some((taken_s, before, Some(lap)));
            return None;
        }
        self.taken = None;
        let without = without?;
        // A car that goes faster may be farther from the line.
        let faster = SLOWER * lap.time_s < without.time_s;
        let near = (FARTHER * without.mean_m).max(without.mean_m + NOTHING_WHEELBASES * self.wheelbase_m);
        if faster || lap.mean_m < near && lap.time_s < SLOWER * without.time_s {
            return None;
        }
        self.given_back = Some(GivenBack { named: *used, without: Some(without), with: Some(lap) });
        Some(before)
    }

    /// The car slides, or seems to. Gives the model to go back to, where the one in use has yet to prove itself.
    pub(crate) fn slides(&mut self, used: &Named) -> Option<Named> {
        let (_, before, without) = self.taken.take()?;
        self.given_back = Some(GivenBack { named: *used, without, with: None });
        Some(before)
    }

    /// Whether effects of the same kinds were given back.
    pub(crate) fn was_given_back(&self, named: &Named) -> bool {
        self.given_back.is_some_and(|back| back.named.kinds() == named.kinds())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lap_that_is_worse_gives_the_model_back() {
        let named = Named { v_y_lever_arm_m: Some(0.1), ..Named::default() };
        // Laps of 10 s: without, with it from shortly after the line on, and the one that is judged.
        let back = |offset_m: f64, lap_s: f64| {
            let mut probation = Probation::new(0.3);
            assert_eq!(probation.pass(0.0, 0.02, true, &named), None);
            assert_eq!(probation.pass(10.0, 0.02, true, &named), None);
            probation.begin(10.1, Named::default());
            let back = probation.pass(10.0 + lap_s, offset_m, true, &named);
            (back, probation)
        };
        assert_eq!(back(0.025, 10.1).0, None);
        let (before, probation) = back(0.05, 10.0);
        assert_eq!(before, Some(Named::default()));
        assert!(probation.was_given_back(&Named { v_y_lever_arm_m: Some(0.2), ..Named::default() }));
        assert!(!probation.was_given_back(&Named { steering_delay_s: Some(0.1), ..named }));
        assert_eq!(back(0.034, 10.0).0, None, "14 mm farther are nothing to a car of 0.3 m");
        assert_eq!(back(0.036, 10.0).0, Some(Named::default()));
        assert_eq!(back(0.02, 10.5).0, Some(Named::default()));
        assert_eq!(back(0.05, 5.0).0, None);
        // What counts is the last lap without: a car that had been held back there may be farther from the line.
        let mut held_back = Probation::new(0.3);
        for (stamp_s, offset_m) in [(0.0, 0.02), (10.0, 0.02)] {
            assert_eq!(held_back.pass(stamp_s, offset_m, true, &named), None);
        }
        held_back.begin(29.0, Named::default());
        assert_eq!(held_back.pass(30.0, 0.02, true, &named), None);
        assert_eq!(held_back.pass(40.0, 0.05, true, &named), None);
        // A slide ends it at once, and only while it has yet to prove itself.
        let mut proven = back(0.02, 10.0).1;
        assert_eq!(proven.slides(&named), None);
        proven.begin(20.1, Named::default());
        assert_eq!(proven.slides(&named), Some(Named::default()));
        assert_eq!(proven.given_back.unwrap().with, None);
    }
}
