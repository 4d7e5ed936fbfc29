//! The forward speed that is imposed: a smoothing spline, as stiff as the recording itself says.
//!
//! ```text
//! z_k = v(t_k) + e_k,  e white,     d v = a dt,  d a = dw (white, q R a second)
//! ```
//!
//! The least of `-2 log likelihood` over q, with R eliminated, says how stiff (Wahba 1978; Kohn and Ansley 1987): what noise is left on an
//! imposed speed is an error of every yaw rate that a simulator answers with.

/// A symmetric matrix of two: its corner, its side, its other corner.
type Pair = [f64; 3];

/// Ratios of the jerk's density to the noise's variance that are looked at, m^2/s^5 over m^2/s^2: decades, halved.
const DECADES: std::ops::RangeInclusive<i32> = -8..=20;

/// Speed and acceleration at every sample of every run: `runs`, samples `dt_s` apart.
pub(crate) fn smooth(runs: &[(&[f64], f64)]) -> Vec<Vec<[f64; 2]>> {
    let ratios = DECADES.map(|d| 10_f64.powf(0.5 * f64::from(d)));
    let unlikely = |q: f64| {
        let (mut logarithms, mut squares, mut count) = (0.0, 0.0, 0.0);
        for (z, dt_s) in runs {
            for step in filter(z, *dt_s, q) {
                logarithms += step.variance.ln();
                squares += step.surprise * step.surprise / step.variance;
                count += 1.0;
            }
        }
        logarithms + count * f64::max(squares, f64::MIN_POSITIVE).ln()
    };
    let best = ratios.map(|q| (unlikely(q), q)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or(1.0, |b| b.1);
    runs.iter().map(|(z, dt_s)| smoothed(z, *dt_s, best)).collect()
}

/// A step of the filter: speed and acceleration there, before and after the measurement, with their covariances over the noise's variance.
struct Step {
    before: [f64; 2],
    covariance_before: Pair,
    after: [f64; 2],
    covariance: Pair,
    surprise: f64,
    variance: f64,
}

/// From the third sample on: the first two tell where it begins.
fn filter(z: &[f64], dt_s: f64, q: f64) -> Vec<Step> {
    let [z0, z1, rest @ ..] = z else { return Vec::new() };
    let mut x = [*z1, (z1 - z0) / dt_s];
    let mut p: Pair = [1.0, dt_s.recip(), 2.0 / (dt_s * dt_s)];
    let grown = [q * dt_s.powi(3) / 3.0, q * dt_s * dt_s / 2.0, q * dt_s];
    rest.iter()
        .map(|z| {
            let before = [x[0] + dt_s * x[1], x[1]];
            let ahead = [
                p[0] + dt_s * (2.0 * p[1] + dt_s * p[2]) + grown[0],
                p[1] + dt_s * p[2] + grown[1],
                p[2] + grown[2],
            ];
            let (surprise, variance) = (z - before[0], ahead[0] + 1.0);
            let gain = [ahead[0] / variance, ahead[1] / variance];
            x = [before[0] + gain[0] * surprise, before[1] + gain[1] * surprise];
            p = [ahead[0] / variance, ahead[1] / variance, ahead[2] - gain[1] * ahead[1]];
            Step { before, covariance_before: ahead, after: x, covariance: p, surprise, variance }
        })
        .collect()
}

/// Backwards through the filter (Rauch, Tung and Striebel 1965).
fn smoothed(z: &[f64], dt_s: f64, q: f64) -> Vec<[f64; 2]> {
    let steps = filter(z, dt_s, q);
    let Some(last) = steps.last() else { return z.iter().map(|v| [*v, 0.0]).collect() };
    let mut now = last.after;
    let mut out = vec![now];
    for (step, next) in steps.iter().zip(&steps[1..]).rev() {
        let [p0, p1, p2] = step.covariance;
        let [n0, n1, n2] = next.covariance_before;
        let determinant = n0 * n2 - n1 * n1;
        // Covariance with what comes next, times the inverse of that's own.
        let [c00, c01, c10, c11] = [p0 + dt_s * p1, p1, p1 + dt_s * p2, p2];
        let away = [now[0] - next.before[0], now[1] - next.before[1]];
        let solved =
            [(n2 * away[0] - n1 * away[1]) / determinant, (n0 * away[1] - n1 * away[0]) / determinant];
        now = [
            step.after[0] + c00 * solved[0] + c01 * solved[1],
            step.after[1] + c10 * solved[0] + c11 * solved[1],
        ];
        out.push(now);
    }
    // The first two samples, from the third backwards.
    for _ in 0..2 {
        now = [now[0] - dt_s * now[1], now[1]];
        out.push(now);
    }
    out.reverse();
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng as _;
    use rand_distr::{Distribution as _, Normal};

    #[test]
    fn a_noisy_speed_is_smoothed_as_far_as_it_is_smooth_and_a_clean_one_is_kept() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(2);
        let normal = Normal::new(0.0, 0.05).unwrap();
        let time = |k: usize| 0.01 * k as f64;
        let truth: Vec<f64> = (0..3000).map(|k| 8.0 + 1.5 * (0.9 * time(k)).sin()).collect();
        let noisy: Vec<f64> = truth.iter().map(|v| v + normal.sample(&mut rng)).collect();
        let rms = |of: &[[f64; 2]], want: &dyn Fn(usize) -> [f64; 2], c: usize| {
            let square = |(k, s): (usize, &[f64; 2])| (s[c] - want(k)[c]).powi(2);
            (of.iter().enumerate().map(square).sum::<f64>() / of.len() as f64).sqrt()
        };
        let want = |k: usize| [truth[k], 1.35 * (0.9 * time(k)).cos()];
        let [smooth_noisy, smooth_clean] = [&noisy, &truth].map(|z| smooth(&[(z, 0.01)]).remove(0));
        assert!(rms(&smooth_noisy, &want, 0) < 0.01, "{}", rms(&smooth_noisy, &want, 0));
        assert!(rms(&smooth_noisy, &want, 1) < 0.15, "{}", rms(&smooth_noisy, &want, 1));
        assert!(rms(&smooth_clean, &want, 0) < 1e-5 && rms(&smooth_clean, &want, 1) < 0.01);
        // A car that brakes all at once is not smoothed into one that brakes slowly.
        let braking: Vec<f64> =
            (0..600).map(|k| if k < 300 { 8.0 } else { 8.0 - 0.09 * (k - 300) as f64 / 3.0 }).collect();
        let noisy: Vec<f64> = braking.iter().map(|v| v + 0.1 * normal.sample(&mut rng)).collect();
        let s = smooth(&[(&noisy, 0.01)]).remove(0);
        assert!((s[300][0] - 8.0).abs() < 0.03, "{}", s[300][0]);
    }
}
