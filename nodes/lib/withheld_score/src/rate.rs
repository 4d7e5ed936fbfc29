//! Rates with their intervals.

use serde::{Deserialize, Serialize};

/// A share of cases with its 95 % Wilson interval (E. B. Wilson, JASA 22, 1927).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// Cases in which it was so.
    pub hits: usize,
    /// Cases.
    pub of: usize,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

impl Rate {
    /// The rate of `hits` out of `of`.
    #[must_use]
    pub fn new(hits: usize, of: usize) -> Self {
        const Z: f64 = 1.959_964;
        if of == 0 {
            return Self { hits, of, low: 0.0, high: 1.0 };
        }
        let (n, p) = (of as f64, hits as f64 / of as f64);
        let middle = p + Z * Z / (2.0 * n);
        let half = Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        let whole = 1.0 + Z * Z / n;
        Self { hits, of, low: ((middle - half) / whole).max(0.0), high: ((middle + half) / whole).min(1.0) }
    }

    /// How often `yes` holds.
    pub fn count<T>(items: impl IntoIterator<Item = T>, mut yes: impl FnMut(T) -> bool) -> Self {
        let (mut hits, mut of) = (0, 0);
        for item in items {
            of += 1;
            hits += usize::from(yes(item));
        }
        Self::new(hits, of)
    }

    /// Hits over cases; not a number without cases.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.hits as f64 / self.of as f64
    }
}

/// The middle one of some numbers; not a number where there are none.
#[must_use]
pub fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|v| v.is_finite());
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[n / 2],
        n => f64::midpoint(values[n / 2 - 1], values[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use approx::assert_relative_eq;

    use super::*;

    #[test]
    fn wilson() {
        // Textbook values (Newcombe 1998, table I): 81 of 263, 0 of 20.
        let rate = Rate::new(81, 263);
        assert_relative_eq!(rate.low, 0.2553, epsilon = 1e-4);
        assert_relative_eq!(rate.high, 0.3662, epsilon = 1e-4);
        let rate = Rate::new(0, 20);
        assert_relative_eq!(rate.low, 0.0, epsilon = 1e-12);
        assert_relative_eq!(rate.high, 0.1611, epsilon = 1e-4);
        assert!(Rate::new(0, 0).value().is_nan());
    }

    #[test]
    fn middles() {
        assert_relative_eq!(median(vec![3.0, 1.0, f64::NAN, 2.0]), 2.0);
        assert_relative_eq!(median(vec![4.0, 1.0]), 2.5);
        assert!(median(vec![]).is_nan());
    }
}
