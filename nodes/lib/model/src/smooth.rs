//! Zero-phase smoothing and differentiation by local quadratics (Savitzky and Golay 1964).

/// Value and first derivative of the quadratic fitted to the `half` samples on each side, at every sample; towards the ends the
/// neighbourhood shrinks on both sides alike.
pub fn local_quadratic(series: &[f64], half: usize, dt_s: f64) -> (Vec<f64>, Vec<f64>) {
    let n = series.len();
    let mut value = Vec::with_capacity(n);
    let mut slope = Vec::with_capacity(n);
    for k in 0..n {
        let h = half.min(k).min(n - 1 - k);
        if h == 0 {
            let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
            value.push(series[k]);
            slope.push(if b > a { (series[b] - series[a]) / ((b - a) as f64 * dt_s) } else { 0.0 });
            continue;
        }
        let (mut s2, mut s4, mut y0, mut y1, mut y2) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for i in 0..=2 * h {
            let x = i as f64 - h as f64;
            let y = series[k + i - h];
            s2 += x * x;
            s4 += x.powi(4);
            y0 += y;
            y1 += x * y;
            y2 += x * x * y;
        }
        let m = (2 * h + 1) as f64;
        // With one neighbour on each side the quadratic goes through the points.
        value.push(if h == 1 { series[k] } else { (s4 * y0 - s2 * y2) / (m * s4 - s2 * s2) });
        slope.push(y1 / s2 / dt_s);
    }
    (value, slope)
}

/// The median; 0 of nothing.
pub fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// A quantile between 0 and 1; 0 of nothing.
pub fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_unstable_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share.clamp(0.0, 1.0)).round() as usize]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_is_kept() {
        let dt_s = 0.02;
        let series: Vec<f64> = (0..60).map(|k| 1.0 + 0.3 * f64::from(k) - 0.02 * f64::from(k * k)).collect();
        let (value, slope) = local_quadratic(&series, 5, dt_s);
        for k in 5..55 {
            approx::assert_relative_eq!(value[k], series[k], epsilon = 1e-9);
            approx::assert_relative_eq!(slope[k], (0.3 - 0.04 * k as f64) / dt_s, epsilon = 1e-9);
        }
    }
}
