//! The score as a table for the terminal.

use std::fmt::Write as _;

use crate::{Line, PairScores, Rate, Scores};

impl PairScores {
    /// Targets beside what was reached, and right answers by simulator.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = format!("simulator and car: {} pairs\n", self.pairs);
        for line in &self.lines {
            let _ = writeln!(text, "  {:<46} {:<30} {}", line.what, reached(line), line.verdict());
        }
        for (simulator, rate) in &self.by_simulator {
            let _ = writeln!(text, "  right, {simulator}: {}", short(rate));
        }
        text
    }
}

impl Scores {
    /// Targets beside what was reached, by family; the control; baselines.
    #[must_use]
    pub fn text(&self) -> String {
        let mut text = String::new();
        for family in &self.families {
            let _ = writeln!(text, "{}: {} cases", family.family.name(), family.cases);
            for line in &family.lines {
                let _ = writeln!(text, "  {:<46} {:<30} {}", line.what, reached(line), line.verdict());
            }
            let kinds: Vec<String> =
                family.by_kind.iter().map(|(kind, rate)| format!("{kind} {}", short(rate))).collect();
            let _ = writeln!(text, "  right over all cases: {}", kinds.join(", "));
            for (method, rate) in &family.baselines {
                let _ = writeln!(text, "  {method:<46} {}", long(rate));
            }
        }
        for (family, control) in &self.control {
            let [low, mean, high] = control.chance.map(|share| 100.0 * share);
            let _ = writeln!(
                text,
                "control on files alone, {family}: {}, chance {mean:.0} % [{low:.0}, {high:.0}]",
                long(&control.right)
            );
        }
        text
    }
}

impl Line {
    /// Whether the target is met, in a word; the target itself where it is not.
    #[must_use]
    pub fn verdict(&self) -> String {
        match self.met {
            Some(true) => format!("met ({})", self.wanted),
            Some(false) => format!("MISSED ({})", self.wanted),
            None => self.wanted.clone(),
        }
    }
}

fn reached(line: &Line) -> String {
    match (&line.rate, line.value) {
        (Some(rate), _) => long(rate),
        (None, Some(value)) => format!("{value:.3}"),
        (None, None) => "no case".to_owned(),
    }
}

fn long(rate: &Rate) -> String {
    if rate.of == 0 {
        return "no case".to_owned();
    }
    let [value, low, high] = [rate.value(), rate.low, rate.high].map(|share| 100.0 * share);
    format!("{value:.1} % [{low:.0}, {high:.0}] ({}/{})", rate.hits, rate.of)
}

fn short(rate: &Rate) -> String {
    format!("{}/{}", rate.hits, rate.of)
}
