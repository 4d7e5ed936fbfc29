//! Axes: what they show, from where to where, and their numbers.

/// One axis of a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Quantity and unit.
    pub label: String,
    /// Ends; without them the data's.
    pub range: Option<(f64, f64)>,
    /// Whether 0 belongs to it whatever the data are.
    pub from_zero: bool,
}

impl Axis {
    /// An axis as long as the data.
    #[must_use]
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), range: None, from_zero: false }
    }

    /// With fixed ends.
    #[must_use]
    pub fn with_range(self, low: f64, high: f64) -> Self {
        Self { range: Some((low, high)), ..self }
    }

    /// With 0 on it.
    #[must_use]
    pub fn from_zero(self) -> Self {
        Self { from_zero: true, ..self }
    }

    /// Where it begins and ends, given what lies on it: finite and not empty, with a little room where the data set the ends.
    pub(super) fn ends(&self, values: impl Iterator<Item = f64>) -> (f64, f64) {
        const LARGEST: f64 = 1e12;
        let fixed = self.range.filter(|(low, high)| low.is_finite() && high.is_finite() && low < high);
        if let Some(ends) = fixed {
            return ends;
        }
        let start = if self.from_zero { (0.0, 0.0) } else { (f64::INFINITY, f64::NEG_INFINITY) };
        let (low, high) = values
            .filter(|v| v.is_finite())
            .map(|v| v.clamp(-LARGEST, LARGEST))
            .fold(start, |(low, high), v| (low.min(v), high.max(v)));
        if low > high {
            return (0.0, 1.0);
        }
        let span = high - low;
        if span <= 1e-9 * high.abs().max(low.abs()).max(1e-9) {
            let half = if high == 0.0 { 1.0 } else { high.abs() / 2.0 };
            return if self.from_zero && low == 0.0 { (0.0, half) } else { (low - half, high + half) };
        }
        let room = 0.05 * span;
        let at_zero = |end: f64| self.from_zero && end == 0.0;
        (if at_zero(low) { 0.0 } else { low - room }, if at_zero(high) { 0.0 } else { high + room })
    }
}

/// A tick's number: the decimals that a picture of this span needs.
pub(super) fn tick(value: f64, span: f64) -> String {
    let decimals = (1.0 - (span / 2.0).log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".into() } else { text.replace('-', "−") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_hold_the_data_and_zero_where_asked() {
        let ends = |axis: Axis, values: &[f64]| axis.ends(values.iter().copied());
        assert_eq!(ends(Axis::new("").with_range(-1.0, 2.0), &[9.0]), (-1.0, 2.0));
        assert_eq!(ends(Axis::new("").from_zero(), &[10.0, 20.0]), (0.0, 21.0));
        assert_eq!(ends(Axis::new(""), &[10.0, 20.0, f64::NAN]), (9.5, 20.5));
        assert_eq!(ends(Axis::new(""), &[]), (0.0, 1.0));
        assert_eq!(ends(Axis::new(""), &[4.0]), (2.0, 6.0));
        assert_eq!(ends(Axis::new("").from_zero(), &[0.0]), (0.0, 1.0));
    }

    #[test]
    fn ticks_are_short() {
        assert_eq!(tick(0.2, 1.0), "0.2");
        assert_eq!(tick(-0.025, 0.1), "−0.025");
        assert_eq!(tick(150.0, 400.0), "150");
        assert_eq!(tick(-1e-17, 1.0), "0");
    }
}
