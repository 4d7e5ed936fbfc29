//! The control: whether a case's files alone tell its kind.

use gripsight_withheld_make::Kind;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::Rate;

/// What the files of a case look like from outside: sizes, counts, times, place in the order.
#[derive(Debug, Clone, PartialEq)]
pub struct Outside {
    /// What it tests.
    pub kind: Kind,
    /// Figures, the same ones for every case.
    pub figures: Vec<f64>,
}

/// Score of the nearest neighbour, leaving one out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Control {
    /// Cases whose nearest neighbour is of their kind.
    pub right: Rate,
    /// The same with kinds dealt out at random: mean and central 95 %.
    pub chance: [f64; 3],
    /// Share of random deals that do as well.
    pub p_value: f64,
}

const DEALS: usize = 1000;

/// Lets the nearest neighbour in standardised figures guess the kind of every case.
#[must_use]
pub fn control(cases: &[Outside]) -> Control {
    let neighbours = nearest(cases);
    let mut kinds: Vec<Kind> = cases.iter().map(|c| c.kind).collect();
    let hits =
        |kinds: &[Kind]| neighbours.iter().enumerate().filter(|(i, n)| kinds[*i] == kinds[**n]).count();
    let found = hits(&kinds);
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut dealt: Vec<usize> = (0..DEALS)
        .map(|_| {
            kinds.shuffle(&mut random);
            hits(&kinds)
        })
        .collect();
    dealt.sort_unstable();
    let share = |hits: usize| hits as f64 / cases.len().max(1) as f64;
    let quantile = |q: usize| dealt.get(DEALS * q / 1000).map_or(f64::NAN, |h| share(*h));
    let mean = dealt.iter().map(|h| share(*h)).sum::<f64>() / DEALS as f64;
    let as_well = dealt.iter().filter(|h| **h >= found).count();
    Control {
        right: Rate::new(found, neighbours.len()),
        chance: [quantile(25), mean, quantile(975)],
        p_value: as_well as f64 / DEALS as f64,
    }
}

/// The nearest other case of each.
fn nearest(cases: &[Outside]) -> Vec<usize> {
    if cases.len() < 2 {
        return Vec::new();
    }
    let width = cases.first().map_or(0, |c| c.figures.len());
    let count = cases.len() as f64;
    let scale: Vec<f64> = (0..width)
        .map(|k| {
            let mean = cases.iter().map(|c| c.figures[k]).sum::<f64>() / count;
            let variance = cases.iter().map(|c| (c.figures[k] - mean).powi(2)).sum::<f64>() / count;
            variance.sqrt().max(1e-12)
        })
        .collect();
    let distance = |a: &Outside, b: &Outside| -> f64 {
        a.figures.iter().zip(&b.figures).zip(&scale).map(|((a, b), s)| ((a - b) / s).powi(2)).sum()
    };
    (0..cases.len())
        .map(|i| {
            let others = (0..cases.len()).filter(|j| *j != i);
            others
                .min_by(|a, b| distance(&cases[i], &cases[*a]).total_cmp(&distance(&cases[i], &cases[*b])))
                .unwrap_or(i)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;

    fn cases(telling: bool) -> Vec<Outside> {
        let random = &mut ChaCha8Rng::seed_from_u64(1);
        (0..300)
            .map(|i| {
                let kind = Kind::ALL[i % 5];
                let tell = if telling { 3.0 * (i % 5) as f64 } else { 0.0 };
                Outside { kind, figures: vec![random.random::<f64>() + tell, random.random::<f64>()] }
            })
            .collect()
    }

    #[test]
    fn it_finds_what_tells_and_nothing_where_nothing_does() {
        let (telling, silent) = (control(&cases(true)), control(&cases(false)));
        assert!(telling.right.value() > 0.95 && telling.p_value < 0.01);
        assert!((silent.chance[0]..=silent.chance[2]).contains(&silent.right.value()));
        assert!(silent.p_value > 0.025);
    }
}
