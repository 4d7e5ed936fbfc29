//! One line a window, or a floor: what was found, and when a change of the grip was noticed.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::Context;
use gripsight_identification::{AcceptedSet, GripChange, Outcome, Reading};
use gripsight_signals::{NS_PER_S, StateSequence};

/// Name of the file.
pub(super) const FILE: &str = "windows.csv";

/// The windows of a run, in their order.
#[derive(Debug, Default)]
pub(super) struct Windows {
    /// Stamp of the first sample of all.
    start_ns: Option<i64>,
    count: usize,
    lines: String,
    notices: String,
}

impl Windows {
    /// Takes down where the grip changed within a drive.
    pub(super) fn add_changes(&mut self, changes: &[GripChange]) {
        for change in changes {
            tracing::warn!("{change}");
            let _ = writeln!(self.notices, "{change}; each floor is identified by itself");
        }
    }

    /// Adds a line to [`Self::notices`].
    pub(super) fn note(&mut self, line: &str) {
        let _ = writeln!(self.notices, "{line}");
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// Takes down what a window gave, and whether the set in use before still fitted it.
    pub(super) fn add(&mut self, sequence: &StateSequence, result: &Outcome, set: Option<&AcceptedSet>) {
        let start_ns = *self.start_ns.get_or_insert(sequence.start_stamp_ns);
        self.count += 1;
        let from_s = seconds(sequence.start_stamp_ns - start_ns);
        if let (Some(reading), Some(set)) = (&result.grip, set)
            && let Some(notice) = reading.notice(set)
        {
            let [now_s, since_s] = [reading.stamp_ns, reading.since_ns].map(|ns| seconds(ns - start_ns));
            let notice = format!("{now_s:.1} s: {notice}, since {since_s:.1} s");
            tracing::warn!("{notice}");
            let _ = writeln!(self.notices, "{notice}");
        }
        let (k, d) = (&result.cornering_stiffness_n_per_rad, &result.peak_friction);
        let _ = write!(
            self.lines,
            "{from_s:.3},{:.3},{},{:.4},{:.4},{:.1},{:.1},{:.4},{:.4},{},{},",
            from_s + sequence.duration_s(),
            result.status.name(),
            result.phi_p.front.d,
            result.phi_p.rear.d,
            k.front.value,
            k.rear.value,
            d.front.value,
            d.rear.value,
            d.front.reached,
            d.rear.reached
        );
        let _ = match &result.grip {
            Some(Reading { error_ratio, peak_factor, changed, .. }) => writeln!(
                self.lines,
                "{error_ratio:.3},{:.4},{:.4},{changed}",
                peak_factor.front.value, peak_factor.rear.value
            ),
            None => writeln!(self.lines, ",,,"),
        };
    }

    /// When the grip was seen to have changed, and what the floors before the last gave: a line each.
    pub(super) fn notices(&self) -> &str {
        &self.notices
    }

    /// Writes [`FILE`].
    pub(super) fn write(&self, folder: &Path) -> anyhow::Result<PathBuf> {
        const HEADER: &str = "from_s,to_s,status,d_set_front,d_set_rear,k_front_n_per_rad,k_rear_n_per_rad,d_front,d_rear,reached_front,reached_rear,\
            error_ratio,d_front_now,d_rear_now,changed\n";
        let path = folder.join(FILE);
        std::fs::write(&path, HEADER.to_owned() + &self.lines)
            .with_context(|| format!("cannot write {}", path.display()))?;
        Ok(path)
    }
}

fn seconds(ns: i64) -> f64 {
    ns as f64 / NS_PER_S
}
