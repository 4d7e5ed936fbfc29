//! How well stated confidence agrees with what was right.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::Rate;

/// Stated confidence in a bin.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct CalibrationBin {
    /// Mean stated confidence.
    pub stated: f64,
    /// How often it was right.
    pub right: Rate,
}

/// Expected calibration error, and what it is for a perfect forecaster of the same statements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Calibration {
    /// Bins of equal width, empty ones left out.
    pub bins: Vec<CalibrationBin>,
    /// Mean distance of stated and observed over the bins, weighted by cases.
    pub error: f64,
    /// 95 % quantile of that error where every statement is true.
    pub perfect: f64,
    /// Statements.
    pub cases: usize,
}

const BINS: usize = 10;
const RESAMPLES: usize = 1000;

/// Compares statements (confidence, right).
#[must_use]
pub(crate) fn calibration(statements: &[(f64, bool)]) -> Calibration {
    let bins = bins(statements);
    let mut random = ChaCha8Rng::seed_from_u64(0);
    let mut errors: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let drawn: Vec<(f64, bool)> =
                statements.iter().map(|&(p, _)| (p, random.random::<f64>() < p)).collect();
            error(&self::bins(&drawn))
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let perfect = errors.get(RESAMPLES * 95 / 100).copied().unwrap_or(f64::NAN);
    Calibration { error: error(&bins), bins, perfect, cases: statements.len() }
}

fn bins(statements: &[(f64, bool)]) -> Vec<CalibrationBin> {
    let place = |p: f64| ((p * BINS as f64) as usize).min(BINS - 1);
    (0..BINS)
        .filter_map(|bin| {
            let inside: Vec<&(f64, bool)> = statements.iter().filter(|s| place(s.0) == bin).collect();
            (!inside.is_empty()).then(|| CalibrationBin {
                stated: inside.iter().map(|s| s.0).sum::<f64>() / inside.len() as f64,
                right: Rate::count(inside, |s| s.1),
            })
        })
        .collect()
}

fn error(bins: &[CalibrationBin]) -> f64 {
    let cases: usize = bins.iter().map(|b| b.right.of).sum();
    let sum: f64 = bins.iter().map(|b| b.right.of as f64 * (b.stated - b.right.value()).abs()).sum();
    sum / cases as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn true_statements_are_calibrated_and_boasts_are_not() {
        let random = &mut ChaCha8Rng::seed_from_u64(5);
        let honest: Vec<(f64, bool)> = (0..400)
            .map(|_| {
                let p = random.random::<f64>();
                (p, random.random::<f64>() < p)
            })
            .collect();
        let boasts: Vec<(f64, bool)> = honest.iter().map(|&(p, right)| (0.5 + 0.5 * p, right)).collect();
        let (honest, boasts) = (calibration(&honest), calibration(&boasts));
        assert!(honest.error <= honest.perfect, "{} {}", honest.error, honest.perfect);
        assert!(boasts.error > boasts.perfect, "{} {}", boasts.error, boasts.perfect);
    }
}
