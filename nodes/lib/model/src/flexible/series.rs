//! Small things about series of samples.

use gripsight_vehicle::Real;

/// Root of the mean square, never nothing.
pub(super) fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (n, square) = values.fold((0.0_f64, 0.0), |(n, s), v| (n + 1.0, s + v * v));
    (square / n.max(1.0)).sqrt().max(1e-6)
}

/// The slope at sample `k`, from its neighbours.
pub(super) fn slope(series: &[f64], k: usize, dt_s: f64) -> f64 {
    let (a, b) = (k.saturating_sub(1), (k + 1).min(series.len() - 1));
    (series[b] - series[a]) / ((b - a).max(1) as f64 * dt_s)
}

/// The value `lag_s` before sample `k`.
pub(super) fn before(series: &[f64], k: usize, lag_s: f64, dt_s: f64) -> f64 {
    let place = (k as f64 - lag_s / dt_s).max(0.0);
    let left = (place as usize).min(series.len() - 1);
    let right = (left + 1).min(series.len() - 1);
    series[left] + (series[right] - series[left]) * (place - left as f64)
}

/// The value `lags_s[0]` before sample `k`, then what each further lag adds to it: a series that is late or smoothed is a sum of such increments,
/// each of the size of what is moved.
pub(super) fn increments(terms: &mut [f64], series: &[f64], k: usize, lags_s: &[f64], dt_s: f64, size: f64) {
    let mut newer = 0.0;
    for (term, &lag_s) in terms.iter_mut().zip(lags_s) {
        let older = before(series, k, lag_s, dt_s) / size;
        *term = older - newer;
        newer = older;
    }
}

/// The sum of terms by their parameters.
pub(super) fn weighted<T: Real>(terms: &[f64], p: &[T]) -> T {
    terms.iter().zip(p).fold(T::from(0.0), |s, (t, c)| s + *c * *t)
}

/// Sine and cosine of the harmonics of an angle.
pub(super) fn harmonics<const N: usize>(angle_rad: f64) -> [f64; N] {
    let mut out = [0.0; N];
    for (i, pair) in out.chunks_mut(2).enumerate() {
        let (sin, cos) = ((i + 1) as f64 * angle_rad).sin_cos();
        pair.copy_from_slice(&[sin, cos]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_has_its_slope_and_its_past() {
        let ramp: Vec<f64> = (0..20).map(|k| 0.3 * f64::from(k)).collect();
        for k in [0, 7, 19] {
            approx::assert_relative_eq!(slope(&ramp, k, 0.1), 3.0, epsilon = 1e-12);
        }
        approx::assert_relative_eq!(before(&ramp, 10, 0.25, 0.1), 2.25, epsilon = 1e-12);
        assert_eq!(before(&ramp, 1, 0.5, 0.1), 0.0);
        approx::assert_relative_eq!(rms([3.0, -4.0].into_iter()), 12.5_f64.sqrt(), epsilon = 1e-12);
        assert_eq!(weighted(&[1.0, 2.0], &[10.0, 100.0]), 210.0);
    }
}
