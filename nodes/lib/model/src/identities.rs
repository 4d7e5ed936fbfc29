//! Three identities of plane motion that hold for any tire: a gap that shows in them lies with sensors, road or clocks, not with forces.
//!
//! ```text
//! a_x = v_x' - v_y r        a_y = v_y' + v_x r        r = heading'
//! ```
//!
//! Where one side was derived from the other they hold by construction and say nothing.

use gripsight_signals::Segment;
use serde::Serialize;

use crate::smooth::{local_quadratic, median};

/// Name of the identity between yaw rate and heading.
pub const HEADING: &str = "yaw_rate = heading'";
/// Name of the identity between lateral acceleration and lateral motion.
pub const LATERAL: &str = "a_y = v_y' + v_x r";

/// One identity, tested.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Identity {
    /// The identity.
    pub name: &'static str,
    /// Whether it can say anything; if not, the sides are missing or derived from each other.
    pub informative: bool,
    /// Constant part of left less right.
    pub offset: f64,
    /// Slope of the left side over the right one, less 1.
    pub scale: f64,
    /// RMS of what remains, over what the noise of both sides explains.
    pub rms_over_noise: f64,
    /// In words.
    pub finding: String,
}

/// Smoothing to each side.
const SMOOTH_S: f64 = 0.15;
/// Noise of two measurements has nothing in common; where the fastest changes of two sides do, one was made of the other.
const DERIVED_CORRELATION: f64 = 0.35;
/// What remains between two sides of which one was made of the other, over the noise that both share: less than this.
const DERIVED_REMAINDER: f64 = 0.5;
/// No accelerometer on a driving car is this quiet.
const QUIET_MPS2: f64 = 0.02;

/// What one identity says of a stretch.
struct Sides {
    /// The left side, as measured.
    left: Vec<f64>,
    /// The integral of the right side: it holds the measurement that the identity differentiates as it is.
    right_integral: Vec<f64>,
}

/// Tests the identities on even stretches.
pub(crate) fn check(segments: &[Segment]) -> Vec<Identity> {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).collect::<Vec<f64>>();
    let a_x = |s: &Segment| {
        let turning = integral(&product(&s.v_y_mps, &s.yaw_rate_radps), s.dt_s);
        let right_integral = s.v_x_mps.iter().zip(&turning).map(|(v, i)| v - i).collect();
        (!s.a_x_mps2.is_empty()).then(|| Sides { left: s.a_x_mps2.clone(), right_integral })
    };
    let a_y = |s: &Segment| {
        let turning = integral(&product(&s.v_x_mps, &s.yaw_rate_radps), s.dt_s);
        let right_integral = s.v_y_mps.iter().zip(&turning).map(|(v, i)| v + i).collect();
        (!s.a_y_mps2.is_empty()).then(|| Sides { left: s.a_y_mps2.clone(), right_integral })
    };
    let heading = |s: &Segment| {
        (!s.yaw_rad.is_empty())
            .then(|| Sides { left: s.yaw_rate_radps.clone(), right_integral: s.yaw_rad.clone() })
    };
    vec![
        test("a_x = v_x' - v_y r", segments, &a_x),
        test(LATERAL, segments, &a_y),
        test(HEADING, segments, &heading),
    ]
}

/// The integral by the trapezoidal rule, 0 at the first sample.
fn integral(series: &[f64], dt_s: f64) -> Vec<f64> {
    let mut sum = 0.0;
    let steps = series.windows(2).map(|pair| {
        sum += 0.5 * (pair[0] + pair[1]) * dt_s;
        sum
    });
    std::iter::once(0.0).chain(steps).take(series.len()).collect()
}

fn half(s: &Segment) -> usize {
    (SMOOTH_S / s.dt_s).round().max(2.0) as usize
}

fn test(name: &'static str, segments: &[Segment], sides: &dyn Fn(&Segment) -> Option<Sides>) -> Identity {
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    let mut rough: Vec<f64> = Vec::new();
    let mut damped: Vec<f64> = Vec::new();
    let mut fast: Vec<(f64, f64)> = Vec::new();
    for s in segments {
        let half = half(s);
        let Some(Sides { left, right_integral }) = sides(s).filter(|_| s.len() > 2 * half + 2) else {
            continue;
        };
        let direct = local_quadratic(&right_integral, 1, s.dt_s).1;
        // A smoothing derivative damps fast changes. Taken of the integral of either side it damps both alike, and the scale is not biased.
        let slope = |integral: &[f64]| local_quadratic(integral, half, s.dt_s).1;
        let (slow_left, slow_right) = (slope(&integral(&left, s.dt_s)), slope(&right_integral));
        let smooth_left = local_quadratic(&left, half, s.dt_s).0;
        for k in half..s.len() - half {
            pairs.push((slow_left[k], slow_right[k]));
            rough.push((left[k] - smooth_left[k]).abs());
            damped.push((smooth_left[k] - slow_left[k]).abs());
            let second = |x: &[f64]| x[k + 1] - 2.0 * x[k] + x[k - 1];
            fast.push((second(&left), second(&direct)));
        }
    }
    let missing = Identity {
        name,
        informative: false,
        offset: 0.0,
        scale: 0.0,
        rms_over_noise: 0.0,
        finding: "not recorded".to_owned(),
    };
    if pairs.len() < 50 {
        return missing;
    }
    let n = pairs.len() as f64;
    let (ml, mr) = (pairs.iter().map(|p| p.0).sum::<f64>() / n, pairs.iter().map(|p| p.1).sum::<f64>() / n);
    let cov = pairs.iter().map(|p| (p.0 - ml) * (p.1 - mr)).sum::<f64>() / n;
    let var_r = pairs.iter().map(|p| (p.1 - mr).powi(2)).sum::<f64>() / n;
    let slope = if var_r > 0.0 { cov / var_r } else { 1.0 };
    let offset = ml - slope * mr;
    let left_over = median(pairs.iter().map(|p| (p.0 - slope * p.1 - offset).abs()).collect()) / 0.674_5;
    let noise = (median(rough) / 0.674_5).max(1e-9);
    let quiet = crate::noise::of(segments.iter().map(|s| s.a_y_mps2.as_slice()), 4) < QUIET_MPS2;
    let alike = correlation(&fast) > DERIVED_CORRELATION || (name == LATERAL && quiet);
    // Of signals without noise to speak of nobody can tell: their fastest changes are the car's.
    let told = noise > median(damped) / 0.674_5;
    let derived = alike && told && left_over < DERIVED_REMAINDER * noise;
    let finding = if derived {
        "one side was derived from the other: says nothing".to_owned()
    } else {
        format!("scale {:+.1} %, offset {offset:+.4}", 100.0 * (slope - 1.0))
    };
    Identity {
        name,
        informative: !derived,
        offset,
        scale: slope - 1.0,
        rms_over_noise: left_over / noise,
        finding,
    }
}

/// Correlation of the fastest changes, with outliers clipped.
fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let scale =
        |f: &dyn Fn(&(f64, f64)) -> f64| median(pairs.iter().map(|p| f(p).abs()).collect()).max(1e-12);
    let (a, b) = (scale(&|p| p.0), scale(&|p| p.1));
    let clip = |v: f64| v.clamp(-3.0, 3.0);
    let (mut xy, mut xx, mut yy) = (0.0, 0.0, 0.0);
    for p in pairs {
        let (x, y) = (clip(p.0 / a), clip(p.1 / b));
        xy += x * y;
        xx += x * x;
        yy += y * y;
    }
    xy / (xx * yy).sqrt().max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A car that weaves at 1 Hz, with sensors that tell the truth but for a scale of the gyroscope.
    fn weaving(gyro_scale: f64) -> Segment {
        let omega = std::f64::consts::TAU;
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut at = |f: &dyn Fn(f64) -> f64, size: f64| -> Vec<f64> {
            (0..3000).map(|k| f(k as f64 * 0.01) + size * rng.random_range(-1.0..1.0)).collect()
        };
        let r = |t: f64| 0.2 + (omega * t).sin();
        let (v_x, v_y) = (|t: f64| 8.0 + 2.0 * (0.5 * t).sin(), |t: f64| 0.3 * (omega * t).cos());
        Segment {
            dt_s: 0.01,
            v_x_mps: at(&v_x, 0.01),
            v_y_mps: at(&v_y, 0.01),
            yaw_rate_radps: at(&|t| r(t) * gyro_scale, 0.01),
            yaw_rad: at(&|t| 0.2 * t - (omega * t).cos() / omega, 0.002),
            a_x_mps2: at(&|t| (0.5 * t).cos() - v_y(t) * r(t), 0.1),
            a_y_mps2: at(&|t| -0.3 * omega * (omega * t).sin() + v_x(t) * r(t), 0.1),
            ..Segment::default()
        }
    }

    #[test]
    fn fast_weaving_is_no_scale() {
        for identity in check(&[weaving(1.0)]) {
            assert!(identity.informative && identity.scale.abs() < 0.01, "{identity:?}");
        }
    }

    #[test]
    fn a_scale_of_the_gyroscope_shows_where_it_is_read() {
        let [a_x, a_y, heading] = check(&[weaving(1.05)]).try_into().unwrap();
        approx::assert_abs_diff_eq!(heading.scale, 0.05, epsilon = 0.01);
        approx::assert_abs_diff_eq!(a_y.scale, -0.05, epsilon = 0.015);
        assert!(a_x.scale.abs() < 0.015, "{a_x:?}");
    }
}
