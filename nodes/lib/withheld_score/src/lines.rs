//! The targets, line by line, beside what was reached.

use gripsight_withheld_make::Kind;
use serde::{Deserialize, Serialize};

use crate::calibration::Calibration;
use crate::judge::{Answer, SizeCheck};
use crate::rate::median;
use crate::scores::of_kind;
use crate::{Rate, Targets};

/// A target beside what was reached.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// What is measured.
    pub what: String,
    /// The target, in words.
    pub wanted: String,
    /// The rate, where it is one.
    pub rate: Option<Rate>,
    /// The value.
    pub value: Option<f64>,
    /// Whether the target is met; none where there is no case.
    pub met: Option<bool>,
}

/// The lines of a family: `scope` are the cases that the targets speak of, `own` all of them.
pub(crate) fn lines(scope: &[&Answer], own: &[&Answer], calibration: &Calibration, t: &Targets) -> Vec<Line> {
    let singles = of_kind(scope, Kind::Single);
    let deleted = of_kind(scope, Kind::Deleted);
    let with_excess: Vec<&Answer> = deleted
        .iter()
        .filter(|a| {
            let excess = a.label.effects.first().and_then(|e| e.oracle).and_then(|o| o.excess_without);
            excess.is_some_and(|x| x >= t.least_excess)
        })
        .copied()
        .collect();
    let named: Vec<f64> =
        singles.iter().filter_map(|a| a.first_named()).map(|e| 1.0 + e.confused_with.len() as f64).collect();
    let group_size = named.iter().sum::<f64>() / named.len() as f64;
    let sizes: Vec<SizeCheck> = scope.iter().flat_map(|a| a.sizes()).collect();
    let coverage = Rate::count(&sizes, |s| s.covered);
    let shrinkage = median(scope.iter().filter_map(|a| a.shrinkage_over_oracle()).collect());
    let residual = median(scope.iter().filter_map(|a| a.residual_over_oracle()).collect());
    let time_s = median(own.iter().map(|a| a.time_s).collect());
    let perfect = match calibration.cases {
        0 => "as a perfect forecaster's".to_owned(),
        cases => format!("<= {:.3} (a perfect forecaster, {cases} cases)", calibration.perfect),
    };
    let errors = sizes.iter().map(|s| ((s.value - s.truth) / s.truth).abs()).collect();
    let causes: Vec<(&Answer, &str)> = own
        .iter()
        .filter(|a| matches!(a.label.kind, Kind::Single | Kind::Pair))
        .flat_map(|a| a.label.effects.iter().map(|e| (*a, e.name.as_str())))
        .collect();
    vec![
        at_least("one effect: its site blamed", Rate::count(&singles, |a| a.site_right()), t.site),
        at_least("one effect: first name exact", Rate::count(&singles, |a| a.exact()), t.exact),
        at_least(
            "one effect: first name within its group",
            Rate::count(&singles, |a| a.within_group()),
            t.within_group,
        ),
        figure("mean size of groups", format!("<= {}", t.group_size), group_size, group_size <= t.group_size),
        at_most(
            "no effect: false alarms, all paces",
            Rate::count(of_kind(own, Kind::None), |a| a.false_alarm()),
            t.false_alarms,
        ),
        at_least(
            "not in the library: none of these",
            Rate::count(of_kind(scope, Kind::OutOfLibrary), |a| a.abstained()),
            t.out_of_library,
        ),
        at_most(
            "left out: confident stand-ins",
            Rate::count(&deleted, |a| a.confident_name(t)),
            t.confident_stand_ins,
        ),
        at_least(
            "left out, with an excess: none of these",
            Rate::count(&with_excess, |a| a.abstained()),
            t.deleted_none_of_these,
        ),
        at_least(
            "two effects: both named",
            Rate::count(of_kind(scope, Kind::Pair), |a| a.found() == 2),
            t.pairs,
        ),
        Line {
            what: "90 % intervals that hold the size".to_owned(),
            wanted: format!("{:.0} to {:.0} %", 100.0 * t.coverage[0], 100.0 * t.coverage[1]),
            value: Some(coverage.value()),
            rate: Some(coverage),
            met: (coverage.of > 0).then(|| (t.coverage[0]..=t.coverage[1]).contains(&coverage.value())),
        },
        Line {
            what: "size: median relative error".to_owned(),
            wanted: "-".to_owned(),
            rate: None,
            value: finite(median(errors)),
            met: None,
        },
        counted("causes named, all cases", Rate::count(&causes, |(a, cause)| a.names().any(|n| n == *cause))),
        counted("a name for no cause, all cases", Rate::count(own, |a| a.names_no_cause())),
        counted("no effect: none of these", Rate::count(of_kind(own, Kind::None), |a| a.abstained())),
        figure(
            "calibration error of stated confidence",
            perfect,
            calibration.error,
            calibration.error <= calibration.perfect,
        ),
        figure(
            "held-out shrinkage over the oracle's, median",
            format!(">= {}", t.shrinkage),
            shrinkage,
            shrinkage >= t.shrinkage,
        ),
        Line {
            what: "the same of an S4 residual, which names nothing".to_owned(),
            wanted: "-".to_owned(),
            rate: None,
            value: finite(residual),
            met: None,
        },
        Line {
            what: "time for a case, median (s)".to_owned(),
            wanted: format!("<= {} for 60 s", t.time_s),
            rate: None,
            value: finite(time_s),
            met: None,
        },
    ]
}

pub(crate) fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

pub(crate) fn at_least(what: &str, rate: Rate, least: f64) -> Line {
    let met = (rate.of > 0).then(|| rate.value() >= least);
    Line {
        what: what.to_owned(),
        wanted: format!(">= {:.0} %", 100.0 * least),
        rate: Some(rate),
        value: finite(rate.value()),
        met,
    }
}

pub(crate) fn at_most(what: &str, rate: Rate, most: f64) -> Line {
    let met = (rate.of > 0).then(|| rate.value() <= most);
    Line {
        what: what.to_owned(),
        wanted: format!("<= {:.0} %", 100.0 * most),
        rate: Some(rate),
        value: finite(rate.value()),
        met,
    }
}

/// A rate without a target.
fn counted(what: &str, rate: Rate) -> Line {
    Line {
        what: what.to_owned(),
        wanted: "-".to_owned(),
        value: Some(rate.value()),
        rate: Some(rate),
        met: None,
    }
}

pub(crate) fn figure(what: &str, wanted: String, value: f64, met: bool) -> Line {
    let met = value.is_finite().then_some(met);
    Line { what: what.to_owned(), wanted, rate: None, value: finite(value), met }
}
