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
pub(crate) const HEADING: &str = "yaw_rate = heading'";
/// Name of the identity between lateral acceleration and lateral motion.
pub(crate) const LATERAL: &str = "a_y = v_y' + v_x r";

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
/// No accelerometer on a driving car is this quiet.
const QUIET_MPS2: f64 = 0.02;

/// Tests the identities on even stretches.
pub(crate) fn check(segments: &[Segment]) -> Vec<Identity> {
    let a_x = |s: &Segment, half: usize| {
        (!s.a_x_mps2.is_empty()).then(|| {
            let rate = local_quadratic(&s.v_x_mps, half, s.dt_s).1;
            let right = (0..s.len()).map(|k| rate[k] - s.v_y_mps[k] * s.yaw_rate_radps[k]).collect();
            (s.a_x_mps2.clone(), right)
        })
    };
    let a_y = |s: &Segment, half: usize| {
        (!s.a_y_mps2.is_empty()).then(|| {
            let rate = local_quadratic(&s.v_y_mps, half, s.dt_s).1;
            let right = (0..s.len()).map(|k| rate[k] + s.v_x_mps[k] * s.yaw_rate_radps[k]).collect();
            (s.a_y_mps2.clone(), right)
        })
    };
    let heading = |s: &Segment, half: usize| {
        (!s.yaw_rad.is_empty())
            .then(|| (s.yaw_rate_radps.clone(), local_quadratic(&s.yaw_rad, half, s.dt_s).1))
    };
    vec![
        test("a_x = v_x' - v_y r", segments, &a_x),
        test(LATERAL, segments, &a_y),
        test(HEADING, segments, &heading),
    ]
}

fn half(s: &Segment) -> usize {
    (SMOOTH_S / s.dt_s).round().max(2.0) as usize
}

type Sides = (Vec<f64>, Vec<f64>);

fn test(
    name: &'static str,
    segments: &[Segment],
    sides: &dyn Fn(&Segment, usize) -> Option<Sides>,
) -> Identity {
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    let mut rough: Vec<f64> = Vec::new();
    let mut fast: Vec<(f64, f64)> = Vec::new();
    for s in segments {
        let half = half(s);
        let (Some((left, right)), Some((_, direct))) = (sides(s, half), sides(s, 1)) else { continue };
        if s.len() <= 2 * half + 2 {
            continue;
        }
        let smooth = |x: &[f64]| local_quadratic(x, half, s.dt_s).0;
        let (slow_left, slow_right) = (smooth(&left), smooth(&right));
        for k in half..s.len() - half {
            pairs.push((slow_left[k], slow_right[k]));
            rough.push((left[k] - slow_left[k]).abs());
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
    let derived = alike && left_over < noise;
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
