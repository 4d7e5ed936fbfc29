//! A closed cubic curve through points: twice continuously differentiable, so that its curvature is continuous.
//!
//! With knots s_i and spacings h_i the second derivatives M_i solve the cyclic tridiagonal system
//!
//! ```text
//! h_{i-1} M_{i-1} + 2 (h_{i-1} + h_i) M_i + h_i M_{i+1} = 6 ((y_{i+1} - y_i)/h_i - (y_i - y_{i-1})/h_{i-1})
//! ```
//!
//! (de Boor, A Practical Guide to Splines, periodic case), by two sweeps of the Thomas algorithm and the Sherman-Morrison formula.

/// One coordinate of a closed curve.
pub(crate) struct ClosedSpline<'a> {
    knots: &'a [f64],
    values: &'a [f64],
    bends: Vec<f64>,
}

impl<'a> ClosedSpline<'a> {
    /// Through `values` at `knots`; the last knot is the end of the lap, where the first value comes again.
    pub(crate) fn new(knots: &'a [f64], values: &'a [f64]) -> Self {
        let n = values.len();
        let h = |i: usize| knots[i + 1] - knots[i];
        let before = |i: usize| if i == 0 { h(n - 1) } else { h(i - 1) };
        let slope = |i: usize| (values[(i + 1) % n] - values[i]) / h(i);
        let right: Vec<f64> = (0..n).map(|i| 6.0 * (slope(i) - slope((i + n - 1) % n))).collect();
        // The corners of the cyclic matrix go into a rank-one change.
        let corner = before(0);
        let gamma = -2.0 * (before(0) + h(0));
        let mut diagonal: Vec<f64> = (0..n).map(|i| 2.0 * (before(i) + h(i))).collect();
        diagonal[0] -= gamma;
        diagonal[n - 1] -= corner * corner / gamma;
        let mut change = vec![0.0; n];
        (change[0], change[n - 1]) = (gamma, corner);
        let off = |i: usize| h(i);
        let plain = thomas(&diagonal, off, right);
        let moved = thomas(&diagonal, off, change);
        let ratio = corner / gamma;
        let share = (plain[0] + ratio * plain[n - 1]) / (1.0 + moved[0] + ratio * moved[n - 1]);
        let bends = plain.iter().zip(&moved).map(|(p, m)| p - share * m).collect();
        Self { knots, values, bends }
    }

    /// Value, slope and second derivative at `s` within segment `i`.
    pub(crate) fn at(&self, i: usize, s: f64) -> (f64, f64, f64) {
        let j = (i + 1) % self.values.len();
        let h = self.knots[i + 1] - self.knots[i];
        let (a, b) = ((self.knots[i + 1] - s) / h, (s - self.knots[i]) / h);
        let (m0, m1) = (self.bends[i], self.bends[j]);
        let value = a * self.values[i]
            + b * self.values[j]
            + ((a * a * a - a) * m0 + (b * b * b - b) * m1) * h * h / 6.0;
        let slope = (self.values[j] - self.values[i]) / h
            + ((3.0 * b * b - 1.0) * m1 - (3.0 * a * a - 1.0) * m0) * h / 6.0;
        (value, slope, a * m0 + b * m1)
    }
}

/// Solves a symmetric tridiagonal system; `off(i)` stands beside diagonal i and i + 1.
fn thomas(diagonal: &[f64], off: impl Fn(usize) -> f64, mut right: Vec<f64>) -> Vec<f64> {
    let n = diagonal.len();
    let mut pivots = diagonal.to_vec();
    for i in 1..n {
        let factor = off(i - 1) / pivots[i - 1];
        pivots[i] -= factor * off(i - 1);
        right[i] -= factor * right[i - 1];
    }
    right[n - 1] /= pivots[n - 1];
    for i in (0..n - 1).rev() {
        right[i] = (right[i] - off(i) * right[i + 1]) / pivots[i];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_comes_back_with_its_slope_and_bend() {
        let n = 40_u32;
        let knots: Vec<f64> = (0..=n).map(|i| std::f64::consts::TAU * f64::from(i) / f64::from(n)).collect();
        let values: Vec<f64> = knots[..n as usize].iter().map(|s| s.sin()).collect();
        let spline = ClosedSpline::new(&knots, &values);
        for (i, pair) in knots.windows(2).enumerate() {
            let s = 0.3 * pair[0] + 0.7 * pair[1];
            let (value, slope, bend) = spline.at(i, s);
            approx::assert_abs_diff_eq!(value, s.sin(), epsilon = 1e-5);
            approx::assert_abs_diff_eq!(slope, s.cos(), epsilon = 1e-3);
            approx::assert_abs_diff_eq!(bend, -s.sin(), epsilon = 1e-2);
        }
    }
}
