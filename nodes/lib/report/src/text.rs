//! Numbers as people read them, on pages and on the terminal.

/// A dash where there is nothing to say.
const NOTHING: &str = "–";

/// A number with so many significant digits, without an exponent; a dash where it is not finite.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    fixed(value, decimals(value.abs(), digits))
}

/// Decimals that show a magnitude with so many significant digits.
fn decimals(magnitude: f64, digits: usize) -> usize {
    if !(magnitude.is_finite() && magnitude >= 1e-9) {
        return digits.saturating_sub(1);
    }
    (digits as i32 - 1 - magnitude.log10().floor() as i32).clamp(0, 9) as usize
}

/// With a fixed number of decimals; a dash where it is not finite.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return NOTHING.into();
    }
    let text = format!("{value:.decimals$}");
    let unsigned = text.trim_start_matches('-');
    // A true minus sign is as wide as a figure; a zero has none.
    if unsigned.len() == text.len() || unsigned.chars().all(|c| c == '0' || c == '.') {
        unsigned.to_owned()
    } else {
        format!("−{unsigned}")
    }
}

/// "low … high", with the decimals that the interval's width deserves; a dash where an end is not finite.
#[must_use]
pub fn interval(low: f64, high: f64) -> String {
    if !(low.is_finite() && high.is_finite()) {
        return NOTHING.into();
    }
    let decimals = interval_decimals(low, high);
    format!("{} … {}", fixed(low, decimals), fixed(high, decimals))
}

/// A value with the decimals of its interval, and the interval.
#[must_use]
pub fn with_interval(value: f64, low: f64, high: f64) -> (String, String) {
    if !(low.is_finite() && high.is_finite()) {
        return (significant(value, 3), NOTHING.into());
    }
    (fixed(value, interval_decimals(low, high)), interval(low, high))
}

/// A value with its interval behind it, where it has one.
#[must_use]
pub fn estimate_of(value: f64, low: f64, high: f64) -> String {
    let (text, range) = with_interval(value, low, high);
    if low == high { text } else { format!("{text} ({range})") }
}

/// Two digits of the interval's width, but no more than four of the numbers.
fn interval_decimals(low: f64, high: f64) -> usize {
    let (width, size) = ((high - low).abs(), low.abs().max(high.abs()));
    if width <= 1e-9 * size { decimals(size, 3) } else { decimals(width, 2).min(decimals(size, 4)) }
}

/// A share as percent.
#[must_use]
pub fn percent(share: f64) -> String {
    if share.is_finite() { format!("{} %", fixed(100.0 * share, 0)) } else { NOTHING.into() }
}

/// "low … high %" of two shares: whole percents, or tenths where the interval is narrower than two of them.
#[must_use]
pub fn percent_interval(low: f64, high: f64) -> String {
    if !(low.is_finite() && high.is_finite()) {
        return NOTHING.into();
    }
    let decimals = share_decimals(low, high);
    format!("{} … {} %", fixed(100.0 * low, decimals), fixed(100.0 * high, decimals))
}

/// A share with its interval behind it, both with the decimals of [`percent_interval`].
#[must_use]
pub fn percent_estimate(share: f64, low: f64, high: f64) -> String {
    let decimals = share_decimals(low, high);
    format!("{} % ({})", fixed(100.0 * share, decimals), percent_interval(low, high))
}

fn share_decimals(low: f64, high: f64) -> usize {
    usize::from(high - low < 0.02)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digits_follow_the_number() {
        assert_eq!(significant(0.012_345, 3), "0.0123");
        assert_eq!(significant(123.456, 3), "123");
        assert_eq!(significant(12345.6, 3), "12346");
        assert_eq!(significant(-1.5, 3), "−1.50");
        assert_eq!(significant(0.0, 3), "0.00");
        assert_eq!(significant(-1e-12, 3), "0.00");
        assert_eq!(significant(f64::NAN, 3), "–");
    }

    #[test]
    fn an_interval_sets_the_decimals() {
        assert_eq!(with_interval(0.080_123, 0.079, 0.081_4), ("0.0801".into(), "0.0790 … 0.0814".into()));
        assert_eq!(with_interval(61.23, 50.0, 70.0), ("61".into(), "50 … 70".into()));
        assert_eq!(with_interval(61.23, f64::NAN, 70.0), ("61.2".into(), "–".into()));
        assert_eq!(with_interval(2.384_08, 2.383_8, 2.384_35).0, "2.384");
        assert_eq!(interval(-0.000_4, 0.3), "0.00 … 0.30");
        assert_eq!(interval(1.0, 1.0), "1.00 … 1.00");
    }

    #[test]
    fn shares_are_whole_percents_or_tenths() {
        assert_eq!(percent_interval(0.6, 0.8), "60 … 80 %");
        assert_eq!(percent_interval(0.955_4, 0.961_8), "95.5 … 96.2 %");
        assert_eq!(percent_interval(-0.000_009, 0.000_058), "0.0 … 0.0 %");
        assert_eq!(percent_interval(f64::NAN, 0.5), "–");
        assert_eq!(percent_estimate(0.004, 0.002, 0.005), "0.4 % (0.2 … 0.5 %)");
    }
}
