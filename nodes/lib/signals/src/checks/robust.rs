//! A straight line that single bad points do not bend.

/// Slope and offset of a line, with the slope's 90 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Slope {
    pub(super) value: f64,
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) offset: f64,
}

/// Most points that pairs are made of: more would cost time and tell little more.
const MOST: usize = 400;
/// Blocks left out in turn for the interval.
const BLOCKS: usize = 10;

/// The median of the slopes between all pairs of points whose second coordinates differ by more than `least`, weighted by that difference;
/// `None` where there are too few.
pub(super) fn slope(first: &[f64], second: &[f64], least: f64) -> Option<Slope> {
    let stride = first.len().div_ceil(MOST).max(1);
    let points: Vec<(f64, f64)> = first
        .iter()
        .zip(second)
        .step_by(stride)
        .map(|(&a, &b)| (a, b))
        .filter(|(a, b)| a.is_finite() && b.is_finite())
        .collect();
    let all: Vec<usize> = (0..points.len()).collect();
    let value = median_slope(&points, &all, least)?;
    let mut offsets: Vec<f64> = points.iter().map(|(a, b)| a - value * b).collect();
    let middle = offsets.len() / 2;
    let offset = *offsets.select_nth_unstable_by(middle, f64::total_cmp).1;
    let per_block = points.len().div_ceil(BLOCKS);
    let parts: Vec<f64> = (0..BLOCKS)
        .filter_map(|block| {
            let kept: Vec<usize> = all.iter().copied().filter(|i| i / per_block != block).collect();
            median_slope(&points, &kept, least)
        })
        .collect();
    let n = parts.len() as f64;
    if parts.len() < BLOCKS / 2 {
        return None;
    }
    let mean = parts.iter().sum::<f64>() / n;
    let variance = parts.iter().map(|p| (p - mean).powi(2)).sum::<f64>() * (n - 1.0) / n;
    // 90 % of a t distribution with nine degrees of freedom.
    let half = 1.833 * variance.sqrt();
    Some(Slope { value, low: value - half, high: value + half, offset })
}

fn median_slope(points: &[(f64, f64)], kept: &[usize], least: f64) -> Option<f64> {
    const LEAST_PAIRS: usize = 30;
    let mut slopes: Vec<(f64, f64)> = Vec::new();
    for (n, &i) in kept.iter().enumerate() {
        for &j in &kept[n + 1..] {
            let apart = points[j].1 - points[i].1;
            if apart.abs() > least {
                slopes.push(((points[j].0 - points[i].0) / apart, apart.abs()));
            }
        }
    }
    if slopes.len() < LEAST_PAIRS {
        return None;
    }
    slopes.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * slopes.iter().map(|s| s.1).sum::<f64>();
    let mut sum = 0.0;
    slopes
        .iter()
        .find(|(_, weight)| {
            sum += weight;
            sum >= half
        })
        .map(|s| s.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_third_of_the_points_may_be_wild() {
        let second: Vec<f64> = (0..200).map(|k| (f64::from(k) * 0.37).sin()).collect();
        let first: Vec<f64> =
            second.iter().enumerate().map(|(k, b)| if k % 3 == 0 { 50.0 } else { 1.1 * b + 0.2 }).collect();
        let found = slope(&first, &second, 0.05).unwrap();
        approx::assert_abs_diff_eq!(found.value, 1.1, epsilon = 0.02);
        assert!(found.low <= 1.1 + 1e-6 && found.high >= 1.1 - 1e-6);
        assert_eq!(slope(&first, &[0.0; 200], 0.05), None);
    }
}
