//! Learning while driving: what the camera saw is kept until the tires tell what it was worth.

use std::collections::VecDeque;

use crate::calibration::{Calibration, Example, FloorFriction};
use crate::error::FrictionError;
use crate::estimate::Estimate;

/// Least distance between two pictures that are kept, metres, least time, and that where no distance is known, nanoseconds.
const STEP_M: f64 = 1.0;
const LEAST_STEP_NS: i64 = 200_000_000;
const STEP_NS: i64 = 300_000_000;
/// How long pictures are kept, nanoseconds.
const KEPT_NS: i64 = 180_000_000_000;
/// Pictures that one lesson takes at most.
const PICTURES_A_LESSON: usize = 12;
/// Pictures kept in all; beyond it every second one of each lesson goes, the oldest lessons having been halved most often.
const MOST_EXAMPLES: usize = 160;
/// Share of the road's friction that is used in a corner whose pictures count before others.
const HARD: f64 = 0.5;
const GRAVITY_MPS2: f64 = 9.81;

/// Whether two pictures, each at a stamp and a distance, show the same road: the same metre, or that of the same fifth of a second.
pub(crate) fn is_near(now: (i64, Option<f64>), then: (i64, Option<f64>)) -> bool {
    let apart_ns = (now.0 - then.0).abs();
    match now.1.zip(then.1) {
        Some((now_m, then_m)) => (now_m - then_m).abs() < STEP_M || apart_ns < LEAST_STEP_NS,
        None => apart_ns < STEP_NS,
    }
}

/// A picture on its way to a label.
#[derive(Debug, Clone)]
struct Sighting {
    stamp_ns: i64,
    distance_m: Option<f64>,
    lateral_mps2: f64,
    appearance: Vec<f64>,
    network_mu: Option<f64>,
}

/// What an identification found of the road, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct Lesson {
    /// First and last stamp of the data, nanoseconds.
    pub span_ns: [i64; 2],
    /// The friction that the tires reach there.
    pub friction: FloorFriction,
    /// A name of its own for the lesson.
    pub name: String,
}

/// Pairs pictures with what the tires tell later.
#[derive(Debug, Clone, Default)]
pub struct Learner {
    sightings: VecDeque<Sighting>,
    examples: Vec<Example>,
}

impl Learner {
    /// Goes on from what was learned before.
    #[must_use]
    pub fn new(known: Option<&Calibration>) -> Self {
        Self { sightings: VecDeque::new(), examples: known.map_or(vec![], |c| c.examples().to_vec()) }
    }

    /// Takes in a picture's reading, seen after `distance_m` of travel at a lateral acceleration of `lateral_mps2`.
    pub fn see(&mut self, estimate: &Estimate, distance_m: Option<f64>, lateral_mps2: f64) {
        let (Some(stamp_ns), Some(appearance)) = (estimate.stamp_ns, estimate.appearance.clone()) else {
            return;
        };
        if estimate.reason.is_some_and(|r| r.is_of_the_picture()) {
            return;
        }
        if let Some(last) = self.sightings.back_mut() {
            if stamp_ns < last.stamp_ns {
                // A clock set back: nothing of before belongs to what comes.
                self.sightings.clear();
            } else {
                if is_near((stamp_ns, distance_m), (last.stamp_ns, last.distance_m)) {
                    last.lateral_mps2 = last.lateral_mps2.max(lateral_mps2.abs());
                    return;
                }
            }
        }
        let network_mu = estimate.network_mu;
        let lateral_mps2 = lateral_mps2.abs();
        self.sightings.push_back(Sighting { stamp_ns, distance_m, lateral_mps2, appearance, network_mu });
        while self.sightings.front().is_some_and(|first| stamp_ns - first.stamp_ns > KEPT_NS) {
            self.sightings.pop_front();
        }
    }

    /// Takes in what the tires told; each picture is taught once. Gives how many pictures it labelled.
    ///
    /// Pictures of hard corners come first: there the friction was found.
    pub fn teach(&mut self, lesson: &Lesson) -> usize {
        let [from, to] = lesson.span_ns;
        let within = |s: &Sighting| (from..=to).contains(&s.stamp_ns);
        let mut seen: Vec<Sighting> = self.sightings.iter().filter(|s| within(s)).cloned().collect();
        self.sightings.retain(|s| !within(s));
        let hard = HARD * lesson.friction.mu * GRAVITY_MPS2;
        if seen.iter().filter(|s| s.lateral_mps2 >= hard).count() >= 3 {
            seen.retain(|s| s.lateral_mps2 >= hard);
        }
        let stride = seen.len().div_ceil(PICTURES_A_LESSON).max(1);
        let before = self.examples.len();
        self.examples.extend(seen.iter().step_by(stride).map(|s| Example {
            appearance: s.appearance.clone(),
            mu: lesson.friction.mu,
            sigma: lesson.friction.sigma,
            source: lesson.name.clone(),
            part: 0,
            network_mu: s.network_mu,
        }));
        let taught = self.examples.len() - before;
        while self.examples.len() > MOST_EXAMPLES {
            self.halve();
        }
        taught
    }

    fn halve(&mut self) {
        let (mut last, mut place) = (String::new(), 0usize);
        self.examples.retain(|e| {
            place = if e.source == last { place + 1 } else { 0 };
            last.clone_from(&e.source);
            place.is_multiple_of(2)
        });
        // Nothing but lessons of one picture: the older half goes.
        if self.examples.len() > MOST_EXAMPLES {
            self.examples.drain(..self.examples.len() / 2);
        }
    }

    /// The calibration by all lessons so far: some tenths of a second of computing.
    ///
    /// # Errors
    /// As [`Calibration::learn`].
    pub fn calibration(&self, track: &str) -> Result<Calibration, FrictionError> {
        Calibration::learn(track, &self.examples)
    }

    /// Forgets all lessons and pictures.
    pub fn forget(&mut self) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimate::{Reason, Source};

    const S: i64 = 1_000_000_000;

    fn seen(stamp_ns: i64, look: f64, reason: Option<Reason>) -> Estimate {
        Estimate {
            stamp_ns: Some(stamp_ns),
            source: Source::Camera,
            reason,
            detail: None,
            mu: 0.8,
            sigma: 0.3,
            probability: vec![],
            entropy: 0.0,
            energy: 0.0,
            unfamiliarity: None,
            quality: None,
            appearance: Some(crate::appearance::LEAST_SCALE.map(|s| s * look).to_vec()),
            network_mu: Some(0.8),
            known: None,
            distance_m: 0.0,
            pictures: 1,
        }
    }

    fn lesson(from_s: i64, to_s: i64, mu: f64, name: &str) -> Lesson {
        Lesson {
            span_ns: [from_s * S, to_s * S],
            friction: FloorFriction { mu, sigma: 0.05 },
            name: name.into(),
        }
    }

    /// Drives `seconds` at 5 m/s and 10 pictures a second over a floor that looks like `look`.
    fn drive(learner: &mut Learner, from_s: i64, seconds: i64, look: f64) {
        for k in 0..seconds * 10 {
            let (stamp_ns, at_s) = (from_s * S + k * S / 10, from_s as f64 + k as f64 / 10.0);
            let wobble = 0.3 * ((k * 7 % 13) as f64 / 13.0 - 0.5);
            learner.see(&seen(stamp_ns, look + wobble, None), Some(5.0 * at_s), 6.0 * (at_s * 0.7).sin());
        }
    }

    #[test]
    fn two_lessons_teach_two_floors_that_the_network_takes_for_one() {
        let mut learner = Learner::default();
        drive(&mut learner, 0, 30, 0.0);
        assert!(learner.teach(&lesson(0, 30, 0.9, "first")) >= 5);
        drive(&mut learner, 40, 30, 6.0);
        assert!(learner.teach(&lesson(40, 70, 0.4, "second")) >= 5);
        let calibration = learner.calibration("lab").unwrap();
        for (look, mu) in [(0.0, 0.9), (6.0, 0.4)] {
            let got = calibration.read(&crate::appearance::LEAST_SCALE.map(|s| s * look));
            assert!((got.mu - mu).abs() < 0.1 && got.weight() > 0.9, "{look}: {got:?}");
        }
        // Going on from it is going on.
        assert_eq!(Learner::new(Some(&calibration)).calibration("lab").unwrap().hash(), calibration.hash());
    }

    #[test]
    fn a_picture_is_taught_once_and_none_from_outside_the_span() {
        let mut learner = Learner::default();
        drive(&mut learner, 0, 30, 0.0);
        assert_eq!(learner.teach(&lesson(100, 130, 0.9, "elsewhere")), 0);
        assert!(learner.teach(&lesson(0, 20, 0.9, "first")) > 0);
        assert_eq!(learner.teach(&lesson(0, 20, 0.5, "again")), 0);
        learner.forget();
        assert!(learner.calibration("lab").is_err());
    }

    #[test]
    fn bad_pictures_and_pictures_of_a_standstill_do_not_count() {
        let mut learner = Learner::default();
        (0..50).for_each(|k| learner.see(&seen(k * S, 0.0, Some(Reason::Dark)), Some(k as f64 * 2.0), 5.0));
        (50..90).for_each(|k| learner.see(&seen(k * S, 0.0, None), Some(100.0), 0.0));
        assert_eq!(learner.teach(&lesson(0, 100, 0.9, "one")), 1);
    }

    #[test]
    fn memory_is_bounded() {
        let mut learner = Learner::default();
        for k in 0..60 {
            drive(&mut learner, 100 * k, 20, k as f64);
            learner.teach(&lesson(100 * k, 100 * k + 20, 0.5, &format!("lesson {k}")));
            assert!(learner.examples.len() <= MOST_EXAMPLES);
        }
        assert!(learner.examples.iter().any(|e| e.source == "lesson 59"));
    }
}
