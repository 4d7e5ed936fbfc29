//! The diagnosis on a terminal, in some 25 lines.

use std::fmt::Write;

use crate::Estimate;
use crate::outcome::{Diagnosis, Place};

impl Diagnosis {
    /// The diagnosis in some 25 lines.
    #[must_use]
    pub fn text(&self) -> String {
        let mut out = String::new();
        let named: Vec<&str> = self.effects.iter().filter(|e| e.accepted).map(|e| e.name).collect();
        let verdict = self.verdict.name();
        let line = if named.is_empty() { String::new() } else { format!(": {}", named.join(", ")) };
        let health = &self.data_health;
        let _ = writeln!(out, "verdict    {verdict}{line}");
        let _ = writeln!(
            out,
            "data       {:.0} s at {:.0} Hz, jitter {:.1} ms, {} gaps, {} frozen spans",
            health.duration_s,
            health.rate_hz,
            1e3 * health.jitter_s,
            health.gaps.len(),
            health.frozen.len()
        );
        for identity in &self.identities {
            let _ = writeln!(out, "identity   {}: {}", identity.name, identity.finding);
        }
        let gap = &self.gap;
        let _ = writeln!(
            out,
            "gap        mean squared error over noise, {} s rollouts, {}",
            gap.horizon_s, gap.scored_on
        );
        for (name, e) in [
            ("nominal", gap.nominal),
            ("retuned", gap.retuned),
            ("after", gap.after),
            ("ceiling", gap.unstructured_ceiling),
            ("noise", gap.noise_floor),
        ] {
            let _ = writeln!(out, "  {name:<9}{}", figure(e));
        }
        let _ = writeln!(
            out,
            "closed     {} of the gap between retuned tires and noise",
            figure(self.gap_closed_fraction)
        );
        for e in self.effects.iter().take(5) {
            let mark = if e.accepted { '*' } else { ' ' };
            let parameters: Vec<String> = e
                .parameters
                .iter()
                .map(|(name, p)| format!("{name} {:.4} [{:.4}, {:.4}]", p.value, p.low, p.high))
                .collect();
            let group = if e.confused_with.is_empty() {
                String::new()
            } else {
                format!(" or {}", e.confused_with.join(", "))
            };
            let _ = writeln!(
                out,
                "{mark} {:<26} {}  closes {:.0} %  sure {:.2}{group}",
                e.name,
                parameters.join(", "),
                100.0 * e.gap_closed_fraction.value,
                e.confidence
            );
        }
        if let Some(worst) = worst(&self.places.channel) {
            let _ = writeln!(
                out,
                "where      {} holds {:.0} % of the squared error",
                worst.channel,
                100.0 * worst.share
            );
        }
        if let Some(p) = worst(&self.places.lateral_acceleration) {
            let _ = writeln!(
                out,
                "           most at {:.1} to {:.1} {} of lateral acceleration",
                p.low, p.high, p.unit
            );
        }
        if !self.invisible.is_empty() {
            let names: Vec<&str> = self.invisible.iter().map(|i| i.name).collect();
            let _ = writeln!(out, "invisible  {}", names.join(", "));
        }
        for reason in self.reasons.iter().skip(1) {
            let _ = writeln!(out, "because    {reason}");
        }
        for next in &self.drive_next {
            let _ = writeln!(out, "next       {next}");
        }
        out
    }
}

fn worst(places: &[Place]) -> Option<&Place> {
    places.iter().max_by(|a, b| a.share.total_cmp(&b.share))
}

fn figure(e: Estimate) -> String {
    format!("{:.3} [{:.3}, {:.3}]", e.value, e.low, e.high)
}
