//! Which faults a run has: stated, or drawn from a seed.

use anyhow::bail;
use rand::seq::IndexedRandom as _;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::fault::{Fault, Kind, Topic};

/// Shortest and longest fault that is drawn (s).
const DURATIONS_S: [f64; 2] = [0.2, 6.0];

/// What is drawn from.
#[derive(Clone, Debug)]
pub(crate) struct Lot {
    pub(crate) seed: u64,
    pub(crate) count: usize,
    pub(crate) kinds: Vec<Kind>,
    pub(crate) topics: Vec<Topic>,
    /// Between these times after the first message all of them begin and end (s).
    pub(crate) span_s: [f64; 2],
}

impl Lot {
    /// Draws the faults, in the order in which they begin.
    pub(crate) fn draw(&self) -> anyhow::Result<Vec<Fault>> {
        let [from_s, to_s] = self.span_s;
        if to_s - from_s < DURATIONS_S[0] {
            bail!("parameters from_s and to_s: {from_s} to {to_s} s is too short for a fault");
        }
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut faults = Vec::with_capacity(self.count);
        for _ in 0..self.count {
            // First the kind, then the topic: the kinds are equally frequent, whatever they concern.
            let concerned = |kind: &Kind| self.topics.iter().any(|topic| kind.concerns(*topic));
            let kinds: Vec<Kind> = self.kinds.iter().copied().filter(concerned).collect();
            let Some(&kind) = kinds.choose(&mut rng) else {
                bail!("parameters kinds and topics: no fault of these kinds concerns these topics");
            };
            let topics: Vec<Topic> =
                self.topics.iter().copied().filter(|topic| kind.concerns(*topic)).collect();
            let Some(&topic) = topics.choose(&mut rng) else { continue };
            let duration_s = log_between(&mut rng, DURATIONS_S).min(to_s - from_s);
            let start_s = from_s + rng.random::<f64>() * (to_s - from_s - duration_s);
            let mut size = log_between(&mut rng, kind.sizes());
            // Clocks and second sources err to both sides.
            if matches!(kind, Kind::Time | Kind::Second) && rng.random() {
                size = -size;
            }
            faults.push(Fault { kind, topic, start_s, duration_s, size });
        }
        faults.sort_by(|a, b| a.start_s.total_cmp(&b.start_s));
        Ok(faults)
    }
}

/// A number between two, as often within each factor.
fn log_between(rng: &mut ChaCha8Rng, [low, high]: [f64; 2]) -> f64 {
    low * (high / low).powf(rng.random::<f64>())
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    fn lot(seed: u64) -> Lot {
        let (kinds, topics) = (Kind::ALL.to_vec(), Topic::ALL.to_vec());
        Lot { seed, count: 400, kinds, topics, span_s: [3.0, 28.0] }
    }

    #[test]
    fn a_seed_draws_the_same_faults_and_all_kinds_within_the_span() {
        let faults = lot(7).draw().unwrap();
        assert_eq!(faults, lot(7).draw().unwrap());
        assert_ne!(faults, lot(8).draw().unwrap());
        assert!(faults.is_sorted_by(|a, b| a.start_s <= b.start_s));
        assert!(faults.iter().all(|f| f.start_s >= 3.0 && f.end_s() <= 28.0 && f.kind.concerns(f.topic)));
        let kinds: HashSet<Kind> = faults.iter().map(|fault| fault.kind).collect();
        assert_eq!(kinds.len(), Kind::ALL.len());
    }

    #[test]
    fn nothing_to_draw_from_is_an_error() {
        assert!(Lot { kinds: vec![Kind::Dark], topics: vec![Topic::Odom], ..lot(1) }.draw().is_err());
        assert!(Lot { span_s: [3.0, 3.1], ..lot(1) }.draw().is_err());
    }
}
