//! Numbers as people read them, on pages and on the terminal.

/// A dash where there is nothing to say.
const NOTHING: &str = "–";

/// A number with so many significant digits, without an exponent; a dash where it is not finite.
#[must_use]
pub fn significant(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return NOTHING.into();
    }
    let text = format!("{value:.*}", decimals(value.abs(), digits));
    minus(if text.trim_start_matches('-').chars().all(|c| c == '0' || c == '.') {
        text.trim_start_matches('-').into()
    } else {
        text
    })
}

/// Decimals that show a magnitude with so many significant digits.
fn decimals(magnitude: f64, digits: usize) -> usize {
    if magnitude < 1e-9 {
        return digits.saturating_sub(1);
    }
    (digits as i32 - 1 - magnitude.log10().floor() as i32).clamp(0, 9) as usize
}

/// With a fixed number of decimals; a dash where it is not finite.
#[must_use]
pub fn fixed(value: f64, decimals: usize) -> String {
    if value.is_finite() { minus(format!("{value:.decimals$}")) } else { NOTHING.into() }
}

/// "low … high", with the decimals that the interval's width deserves; a dash where an end is not finite.
#[must_use]
pub fn interval(low: f64, high: f64) -> String {
    if !(low.is_finite() && high.is_finite()) {
        return NOTHING.into();
    }
    let decimals = decimals((high - low).abs(), 2);
    format!("{} … {}", fixed(low, decimals), fixed(high, decimals))
}

/// A value with the decimals of its interval.
#[must_use]
pub fn with_interval(value: f64, low: f64, high: f64) -> (String, String) {
    if !(low.is_finite() && high.is_finite()) {
        return (significant(value, 3), NOTHING.into());
    }
    (fixed(value, decimals((high - low).abs(), 2)), interval(low, high))
}

/// A share as percent.
#[must_use]
pub fn percent(share: f64) -> String {
    if share.is_finite() { format!("{} %", fixed(100.0 * share, 0)) } else { NOTHING.into() }
}

/// A true minus sign is as wide as a figure.
fn minus(text: String) -> String {
    text.replace('-', "−")
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
        assert_eq!(interval(1.0, 1.0), "1.0 … 1.0");
    }
}
