//! Straight lines that single bad points do not bend.

/// Slope and offset of a line, with the slope's 90 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Slope {
    pub(super) value: f64,
    pub(super) low: f64,
    pub(super) high: f64,
    pub(super) offset: f64,
}

impl Slope {
    /// Where nothing tells.
    pub(super) const UNKNOWN: Self =
        Self { value: f64::NAN, low: f64::NAN, high: f64::NAN, offset: f64::NAN };

    /// The slope of the second over the first, where nothing but the first has noise.
    pub(super) fn inverse(self) -> Self {
        let (low, high) = (self.low.min(self.high), self.low.max(self.high));
        // An interval around zero has no inverse: it tells nothing.
        let (low, high) =
            if low * high > 0.0 { (1.0 / high, 1.0 / low) } else { (f64::NEG_INFINITY, f64::INFINITY) };
        Self { value: 1.0 / self.value, low, high, offset: self.offset }
    }
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
    let (low, high) = interval(value, points.len(), |kept| median_slope(&points, kept, least))?;
    Some(Slope { value, low, high, offset })
}

/// The median of first over second, weighted by the second, of points whose second is above `least`: a slope without an offset.
pub(super) fn ratio(first: &[f64], second: &[f64], least: f64) -> Option<Slope> {
    const LEAST_POINTS: usize = 20;
    let points: Vec<(f64, f64)> = first
        .iter()
        .zip(second)
        .filter(|(a, b)| a.is_finite() && b.is_finite() && b.abs() > least)
        .map(|(&a, &b)| (a, b))
        .collect();
    let of = |kept: &[usize]| {
        let ratios = kept.iter().map(|&i| (points[i].0 / points[i].1, points[i].1.abs())).collect();
        (kept.len() >= LEAST_POINTS / 2).then(|| weighted_median(ratios)).flatten()
    };
    let all: Vec<usize> = (0..points.len()).collect();
    let value = of(&all).filter(|_| points.len() >= LEAST_POINTS)?;
    let (low, high) = interval(value, points.len(), of)?;
    Some(Slope { value, low, high, offset: 0.0 })
}

/// The slope of `first` over `second` with other causes of the first beside it and an offset: least squares in which a point counts the less the
/// farther off it lies (Tukey's bisquare; Beaton and Tukey, Technometrics 16 (1974) 147). `None` where what is left of `second` beside the others
/// is smaller than `least`.
pub(super) fn slope_beside(first: &[f64], second: &[f64], beside: &[&[f64]], least: f64) -> Option<Slope> {
    let rows: Vec<Vec<f64>> = (0..first.len())
        .map(|i| std::iter::once(second[i]).chain(beside.iter().map(|b| b[i])).chain([1.0]).collect())
        .collect();
    let usable = finite(&rows, first);
    // What of the second the others do not explain.
    let others: Vec<Vec<f64>> = rows.iter().map(|r| r[1..].to_vec()).collect();
    let shared = solve(&others, second, &usable, &vec![1.0; usable.len()])?;
    let own = usable
        .iter()
        .map(|&i| (second[i] - others[i].iter().zip(&shared).map(|(a, b)| a * b).sum::<f64>()).powi(2))
        .sum::<f64>();
    if usable.len() < 20 || (own / usable.len() as f64).sqrt() < least {
        return None;
    }
    let (found, weights) = bisquare(&rows, first, &usable)?;
    let value = found[0];
    let (low, high) = interval(value, usable.len(), |kept| {
        let kept: Vec<usize> = kept.iter().map(|&k| usable[k]).collect();
        bisquare(&rows, first, &kept).map(|(f, _)| f[0])
    })?;
    // Of few points, blocks left out in turn tell too little of the spread: the interval is not narrower than that of independent noise.
    let half = half_width(&rows, first, &usable, &weights, &found)?;
    let (low, high) = (low.min(value - half), high.max(value + half));
    Some(Slope { value, low, high, offset: found[found.len() - 1] })
}

fn finite(rows: &[Vec<f64>], first: &[f64]) -> Vec<usize> {
    (0..rows.len()).filter(|&i| first[i].is_finite() && rows[i].iter().all(|v| v.is_finite())).collect()
}

/// Coefficients and weights of the points.
fn bisquare(rows: &[Vec<f64>], first: &[f64], kept: &[usize]) -> Option<(Vec<f64>, Vec<f64>)> {
    let mut weights = vec![1.0; kept.len()];
    let mut found = solve(rows, first, kept, &weights)?;
    for turn in 0..20 {
        let left: Vec<f64> = kept
            .iter()
            .map(|&i| first[i] - rows[i].iter().zip(&found).map(|(a, b)| a * b).sum::<f64>())
            .collect();
        let mut sizes: Vec<f64> = left.iter().map(|r| r.abs()).collect();
        let middle = sizes.len() / 2;
        let scale = (1.4826 * *sizes.select_nth_unstable_by(middle, f64::total_cmp).1).max(1e-12);
        for (weight, r) in weights.iter_mut().zip(&left) {
            // The first turns go by absolute values, which lead near enough.
            *weight = if turn < 8 {
                scale / r.abs().max(0.1 * scale)
            } else {
                (1.0 - (r / (4.685 * scale)).powi(2)).max(0.0).powi(2)
            };
        }
        found = solve(rows, first, kept, &weights)?;
    }
    Some((found, weights))
}

/// The slope of `first` over `second` by what both owe to a third, with other causes beside them: errors of the second, which lower the slope by least squares,
/// have no part in it (instrumental variables: Wright 1928; Angrist and Krueger 2001). `None` where the third tells too little of the second.
pub(super) fn slope_through(
    first: &[f64],
    second: &[f64],
    beside: &[&[f64]],
    through: &[f64],
) -> Option<Slope> {
    /// An F statistic below which an instrument is weak (Staiger and Stock 1997).
    const STRONG: f64 = 10.0;
    let rows: Vec<Vec<f64>> = (0..first.len())
        .map(|i| {
            [second[i], through[i]].into_iter().chain(beside.iter().map(|b| b[i])).chain([1.0]).collect()
        })
        .collect();
    let usable = finite(&rows, first);
    let regressors: Vec<Vec<f64>> = rows.iter().map(|r| [&r[..1], &r[2..]].concat()).collect();
    let others: Vec<Vec<f64>> = rows.iter().map(|r| r[2..].to_vec()).collect();
    // The instrument beside the others, with the products that the slope is made of, of points weighed by how well the direct slope fits them.
    let products = |kept: &[usize]| -> Option<(f64, f64, f64)> {
        let (_, weights) = bisquare(&regressors, first, kept)?;
        let shared = solve(&others, through, kept, &weights)?;
        let mut sums = (0.0, 0.0, 0.0);
        for (&i, w) in kept.iter().zip(&weights) {
            let own = through[i] - others[i].iter().zip(&shared).map(|(a, b)| a * b).sum::<f64>();
            sums = (sums.0 + w * own * first[i], sums.1 + w * own * second[i], sums.2 + w * own * own);
        }
        Some(sums)
    };
    let by = |kept: &[usize]| products(kept).map(|(a, b, _)| a / b);
    let (product, shared, square) = products(&usable)?;
    let spread = left_beside(second, &[beside, &[through]].concat())?;
    if usable.len() < 20 || shared * shared < STRONG * square * spread * spread {
        return None;
    }
    let value = product / shared;
    let (low, high) =
        interval(value, usable.len(), |kept| by(&kept.iter().map(|&k| usable[k]).collect::<Vec<_>>()))?;
    Some(Slope { value, low, high, offset: 0.0 })
}

/// Half the 90 % interval of the first coefficient of a weighted fit, its noise independent from point to point.
fn half_width(
    rows: &[Vec<f64>],
    first: &[f64],
    kept: &[usize],
    weights: &[f64],
    found: &[f64],
) -> Option<f64> {
    let others: Vec<Vec<f64>> = rows.iter().map(|r| r[1..].to_vec()).collect();
    let second: Vec<f64> = rows.iter().map(|r| r[0]).collect();
    let shared = solve(&others, &second, kept, weights)?;
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let (mut own, mut left, mut points) = (0.0, 0.0, 0.0);
    for (&i, w) in kept.iter().zip(weights) {
        own += w * (second[i] - dot(&others[i], &shared)).powi(2);
        left += w * (first[i] - dot(&rows[i], found)).powi(2);
        points += w;
    }
    let freedom = points - found.len() as f64;
    if own <= 0.0 || freedom < 1.0 {
        return None;
    }
    // 90 % of a t distribution, by its expansion about the normal one (Abramowitz and Stegun 26.7.5).
    let z: f64 = 1.645;
    let t = z + (z.powi(3) + z) / (4.0 * freedom);
    Some(t * (left / freedom / own).sqrt())
}

/// Root mean square of what others and an offset leave of a series, the largest twentieth apart; `None` where there is too little.
pub(super) fn left_beside(series: &[f64], beside: &[&[f64]]) -> Option<f64> {
    let rows: Vec<Vec<f64>> =
        (0..series.len()).map(|i| beside.iter().map(|b| b[i]).chain([1.0]).collect()).collect();
    let usable: Vec<usize> =
        (0..rows.len()).filter(|&i| series[i].is_finite() && rows[i].iter().all(|v| v.is_finite())).collect();
    let found = solve(&rows, series, &usable, &vec![1.0; usable.len()])?;
    let mut squares: Vec<f64> = usable
        .iter()
        .map(|&i| (series[i] - rows[i].iter().zip(&found).map(|(a, b)| a * b).sum::<f64>()).powi(2))
        .collect();
    squares.sort_unstable_by(f64::total_cmp);
    squares.truncate((squares.len() * 19).div_ceil(20));
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

/// Weighted least squares by normal equations; `None` where they are singular.
fn solve(rows: &[Vec<f64>], y: &[f64], kept: &[usize], weights: &[f64]) -> Option<Vec<f64>> {
    let n = rows.first()?.len();
    // Columns of one size each.
    let sizes: Vec<f64> = (0..n)
        .map(|j| kept.iter().map(|&i| rows[i][j].powi(2)).sum::<f64>().sqrt().max(f64::MIN_POSITIVE))
        .collect();
    let mut a = vec![vec![0.0; n + 1]; n];
    for (&i, w) in kept.iter().zip(weights) {
        for p in 0..n {
            let left = w * rows[i][p] / sizes[p];
            (0..n).for_each(|q| a[p][q] += left * rows[i][q] / sizes[q]);
            a[p][n] += left * y[i];
        }
    }
    for p in 0..n {
        let pivot = (p..n).max_by(|&i, &j| a[i][p].abs().total_cmp(&a[j][p].abs()))?;
        a.swap(p, pivot);
        if a[p][p].abs() < 1e-9 {
            return None;
        }
        for i in 0..n {
            if i != p {
                let factor = a[i][p] / a[p][p];
                (p..=n).for_each(|q| a[i][q] -= factor * a[p][q]);
            }
        }
    }
    Some((0..n).map(|p| a[p][n] / a[p][p] / sizes[p]).collect())
}

/// 90 % interval of an estimate by leaving out blocks of points in turn.
fn interval(value: f64, points: usize, of: impl Fn(&[usize]) -> Option<f64>) -> Option<(f64, f64)> {
    let per_block = points.div_ceil(BLOCKS).max(1);
    let parts: Vec<f64> = (0..BLOCKS)
        .filter_map(|block| {
            let kept: Vec<usize> = (0..points).filter(|i| i / per_block != block).collect();
            of(&kept)
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
    Some((value - half, value + half))
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
    weighted_median(slopes)
}

/// The value below which half of the weight lies, of (value, weight).
fn weighted_median(mut values: Vec<(f64, f64)>) -> Option<f64> {
    values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * values.iter().map(|s| s.1).sum::<f64>();
    let mut sum = 0.0;
    values
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

    #[test]
    fn what_else_moves_the_first_is_told_apart() {
        let wave = |f: f64, n: usize| (0..n).map(|k| (f * k as f64).sin()).collect::<Vec<_>>();
        let (second, other) = (wave(0.37, 200), wave(0.21, 200));
        let first: Vec<f64> = second
            .iter()
            .zip(&other)
            .enumerate()
            .map(|(k, (b, o))| if k % 7 == 0 { -20.0 } else { 0.6 * b + 3.0 * o + 0.1 })
            .collect();
        let found = slope_beside(&first, &second, &[&other], 0.05).unwrap();
        approx::assert_abs_diff_eq!(found.value, 0.6, epsilon = 1e-3);
        approx::assert_abs_diff_eq!(found.offset, 0.1, epsilon = 1e-3);
        // Made of the other alone: nothing of its own is left.
        assert_eq!(slope_beside(&first, &other, &[&other], 0.05), None);
    }

    #[test]
    fn a_ratio_has_no_offset() {
        let way: Vec<f64> = (0..80).map(|k| 2.0 + 0.1 * (f64::from(k) * 1.3).sin()).collect();
        let speed: Vec<f64> =
            way.iter().enumerate().map(|(k, w)| if k % 9 == 0 { 9.0 } else { 1.1 * w }).collect();
        approx::assert_abs_diff_eq!(ratio(&speed, &way, 0.1).unwrap().value, 1.1, epsilon = 1e-6);
    }
}
