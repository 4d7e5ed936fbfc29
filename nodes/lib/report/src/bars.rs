//! Horizontal bars: how a total is made up.

use maud::{Markup, html};

use crate::Role;

/// One bar.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Bar {
    /// What it is.
    pub(crate) name: String,
    /// Whose.
    pub(crate) role: Role,
    /// Where it begins.
    pub(crate) from: f64,
    /// Where it ends.
    pub(crate) to: f64,
    /// 90 % interval of `to`.
    pub(crate) interval: Option<(f64, f64)>,
    /// The figure beside it.
    pub(crate) value: String,
}

/// Largest end over the smallest from which a linear scale hides the small ones.
const LINEAR: f64 = 100.0;

/// The smallest positive and the largest end.
fn range(bars: &[Bar]) -> (f64, f64) {
    let ends = bars.iter().flat_map(|b| [b.from, b.to, b.interval.map_or(0.0, |i| i.1)]);
    ends.filter(|v| v.is_finite() && *v > 0.0)
        .fold((f64::INFINITY, 0.0), |(least, most), v| (least.min(v), most.max(v)))
}

/// Whether the bars are drawn on a logarithmic scale.
pub(crate) fn logarithmic(bars: &[Bar]) -> bool {
    let (least, most) = range(bars);
    most > LINEAR * least
}

/// Bars one below the other on one scale: from 0, or, where the ends are far apart, by the logarithm from the smallest end on.
pub(crate) fn bars(bars: &[Bar]) -> Markup {
    let (least, most) = range(bars);
    let by_logarithm = logarithmic(bars);
    let share = |v: f64| {
        let share = if by_logarithm { (v.max(least) / least).ln() / (most / least).ln() } else { v / most };
        if most > 0.0 && share.is_finite() { (100.0 * share).clamp(0.0, 100.0) } else { 0.0 }
    };
    let place = |from: f64, to: f64| {
        let (left, right) = (share(from.min(to)), share(from.max(to)));
        format!("left:{left:.2}%;width:{:.2}%", right - left)
    };
    html! {
        div.bars {
            @for bar in bars {
                div { (bar.name) }
                div.track {
                    div.bar style=(format!("{};background:{}", place(bar.from, bar.to), bar.role.css())) {}
                    @if let Some((low, high)) = bar.interval { div.span style=(place(low, high)) {} }
                }
                div.value { (bar.value) }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_end_sets_the_scale() {
        let bar = |from: f64, to: f64, interval| Bar {
            name: "x".into(),
            role: Role::Nominal,
            from,
            to,
            interval,
            value: String::new(),
        };
        let text = bars(&[bar(0.0, 5.0, None), bar(5.0, 2.5, Some((2.0, 10.0))), bar(0.0, f64::NAN, None)])
            .into_string();
        assert!(text.contains("left:0.00%;width:50.00%"), "{text}");
        assert!(
            text.contains("left:25.00%;width:25.00%") && text.contains("left:20.00%;width:80.00%"),
            "{text}"
        );
        assert!(!text.contains("NaN"));

        // Far apart: from 1 to 10^4 every decade has the same room.
        let wide = [bar(0.0, 1e4, None), bar(1e4, 1e2, None), bar(0.0, 1.0, None)];
        assert!(logarithmic(&wide));
        let text = bars(&wide).into_string();
        assert!(text.contains("left:50.00%;width:50.00%") && text.contains("width:0.00%"), "{text}");
    }
}
