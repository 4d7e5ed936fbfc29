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
/// Below this share of the signal's own spread, two sides agree too well to be two measurements.
const DERIVED_SHARE: f64 = 3e-3;

/// Tests the identities on even stretches.
pub(crate) fn check(segments: &[Segment]) -> Vec<Identity> {
    let d = |s: &Segment, x: &[f64]| local_quadratic(x, half(s), s.dt_s);
    let a_x = |s: &Segment| {
        (!s.a_x_mps2.is_empty()).then(|| {
            let (v_y, _) = d(s, &s.v_y_mps);
            let (r, _) = d(s, &s.yaw_rate_radps);
            let (_, rate) = d(s, &s.v_x_mps);
            (s.a_x_mps2.clone(), (0..s.len()).map(|k| rate[k] - v_y[k] * r[k]).collect())
        })
    };
    let a_y = |s: &Segment| {
        (!s.a_y_mps2.is_empty()).then(|| {
            let (v_x, _) = d(s, &s.v_x_mps);
            let (r, _) = d(s, &s.yaw_rate_radps);
            let (_, rate) = d(s, &s.v_y_mps);
            (s.a_y_mps2.clone(), (0..s.len()).map(|k| rate[k] + v_x[k] * r[k]).collect())
        })
    };
    let heading =
        |s: &Segment| (!s.yaw_rad.is_empty()).then(|| (s.yaw_rate_radps.clone(), d(s, &s.yaw_rad).1));
    vec![
        test("a_x = v_x' - v_y r", segments, &a_x),
        test("a_y = v_y' + v_x r", segments, &a_y),
        test(HEADING, segments, &heading),
    ]
}

fn half(s: &Segment) -> usize {
    (SMOOTH_S / s.dt_s).round().max(2.0) as usize
}

type Sides = (Vec<f64>, Vec<f64>);

fn test(name: &'static str, segments: &[Segment], sides: &dyn Fn(&Segment) -> Option<Sides>) -> Identity {
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    let mut rough: Vec<f64> = Vec::new();
    for s in segments {
        let Some((left, right)) = sides(s) else { continue };
        let (smooth, _) = local_quadratic(&left, half(s), s.dt_s);
        let edge = half(s);
        if s.len() <= 2 * edge {
            continue;
        }
        for k in edge..s.len() - edge {
            pairs.push((smooth[k], right[k]));
            rough.push((left[k] - smooth[k]).abs());
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
    let var_l = pairs.iter().map(|p| (p.0 - ml).powi(2)).sum::<f64>() / n;
    let slope = if var_r > 0.0 { cov / var_r } else { 1.0 };
    let offset = ml - slope * mr;
    let left_over = median(pairs.iter().map(|p| (p.0 - slope * p.1 - offset).abs()).collect()) / 0.674_5;
    let plain = median(pairs.iter().map(|p| (p.0 - p.1).abs()).collect()) / 0.674_5;
    let noise = (median(rough) / 0.674_5).max(1e-9);
    let derived = plain < DERIVED_SHARE * var_l.sqrt();
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
