//! The diagnosis on a terminal, in some 25 lines.

use std::fmt::Write;

use crate::Estimate;
use crate::outcome::{Diagnosis, Place, Verdict};

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
        if self.verdict == Verdict::NotIdentifiable {
            self.reasons_text(&mut out, 0);
            return out;
        }
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
            ("S4", gap.s4_residual),
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
                .map(|(name, p)| match p.value.is_finite() {
                    true => {
                        let before =
                            p.before.map(|before| format!(", before {before:.4}")).unwrap_or_default();
                        format!("{name} {:.4} [{:.4}, {:.4}]{before}", p.value, p.low, p.high)
                    }
                    false => format!("{name} none"),
                })
                .collect();
            let group = if e.confused_with.is_empty() {
                String::new()
            } else {
                format!(" or {}", e.confused_with.join(", "))
            };
            let _ = writeln!(
                out,
                "{mark} {:<26} {}  closes {}  sure {:.2}{group}",
                e.name,
                parameters.join(", "),
                percent(e.gap_closed_fraction.value),
                e.confidence
            );
        }
        self.places_text(&mut out);
        if !self.invisible.is_empty() {
            let names: Vec<&str> = self.invisible.iter().map(|i| i.name).collect();
            let _ = writeln!(out, "invisible  {}", names.join(", "));
        }
        self.reasons_text(&mut out, 1);
        out
    }

    fn reasons_text(&self, out: &mut String, skipped: usize) {
        for reason in self.reasons.iter().skip(skipped) {
            let _ = writeln!(out, "because    {reason}");
        }
        for next in &self.drive_next {
            let _ = writeln!(out, "next       {next}");
        }
    }

    /// The channels by their share, and the circumstances that stand out most from an even spread.
    fn places_text(&self, out: &mut String) {
        const SHOWN: usize = 3;
        let w = &self.places;
        let mut channels: Vec<&Place> = w.channel.iter().collect();
        channels.sort_by(|a, b| b.share.total_cmp(&a.share));
        let shares: Vec<String> =
            channels.iter().map(|p| format!("{} {}", p.channel, percent(p.share))).collect();
        let _ = writeln!(out, "where      of the squared error: {}", shares.join(", "));
        let circumstances: [(&str, &[Place]); 7] = [
            ("speed", &w.speed),
            ("lateral acceleration", &w.lateral_acceleration),
            ("slip", &w.slip),
            ("steering rate", &w.steering_rate),
            ("longitudinal acceleration", &w.longitudinal_acceleration),
            ("place on the lap", &w.track_position),
            ("time", &w.time),
        ];
        // Bins hold equally many samples: an even spread is one over their number.
        let mut worst: Vec<(f64, &str, &Place)> = circumstances
            .into_iter()
            .filter_map(|(name, bins)| worst(bins).map(|p| (p.share * bins.len() as f64, name, p)))
            .collect();
        worst.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (times, name, p) in worst.into_iter().take(SHOWN) {
            let _ = writeln!(
                out,
                "           {name} {:.3} to {:.3} {}: {}, {times:.1} times its share of the samples",
                p.low,
                p.high,
                p.unit,
                percent(p.share)
            );
        }
    }
}

fn worst(places: &[Place]) -> Option<&Place> {
    places.iter().max_by(|a, b| a.share.total_cmp(&b.share))
}

fn figure(e: Estimate) -> String {
    if !e.value.is_finite() {
        return "not stated".to_owned();
    }
    let digits = if e.value.abs() < 100.0 { 3 } else { 0 };
    format!("{:.digits$} [{:.digits$}, {:.digits$}]", e.value, e.low, e.high)
}

fn percent(share: f64) -> String {
    if share.is_finite() { format!("{:.0} %", 100.0 * share) } else { "not stated".to_owned() }
}
