//! Distance travelled at the moment of a picture, from the speeds that the odometry reports.
//!
//! Speeds are integrated over stamps, because positions jump where a localisation corrects itself.

use std::collections::VecDeque;

/// Longest time between two speeds that is integrated over, nanoseconds; a longer gap adds no distance.
const LONGEST_GAP_NS: i64 = 500_000_000;
/// How far before the newest speed a picture may lie, nanoseconds.
const HISTORY_NS: i64 = 3_000_000_000;

#[derive(Debug, Clone, Copy)]
struct Mark {
    stamp_ns: i64,
    distance_m: f64,
    speed_mps: f64,
}

/// Integrates speeds and answers for the recent past.
#[derive(Debug, Clone, Default)]
pub struct Odometer {
    marks: VecDeque<Mark>,
}

impl Odometer {
    /// Takes in a speed, either direction. A stamp before the last one starts afresh; a speed that is not finite is left out.
    pub fn push(&mut self, stamp_ns: i64, speed_mps: f64) {
        if !speed_mps.is_finite() {
            return;
        }
        if self.marks.back().is_some_and(|last| stamp_ns < last.stamp_ns) {
            self.marks.clear();
        }
        let distance_m = self.marks.back().map_or(0.0, |last| {
            let dt_ns = stamp_ns - last.stamp_ns;
            let dt_s = if dt_ns > LONGEST_GAP_NS { 0.0 } else { dt_ns as f64 * 1e-9 };
            last.distance_m + 0.5 * (last.speed_mps.abs() + speed_mps.abs()) * dt_s
        });
        self.marks.push_back(Mark { stamp_ns, distance_m, speed_mps });
        while self.marks.front().is_some_and(|first| stamp_ns - first.stamp_ns > HISTORY_NS) {
            self.marks.pop_front();
        }
    }

    /// Whether any speed has come in.
    #[must_use]
    pub fn is_running(&self) -> bool {
        !self.marks.is_empty()
    }

    /// Distance travelled at `stamp_ns` since the first speed, metres. `None` before the history, or more than half a second
    /// after it.
    #[must_use]
    pub fn at(&self, stamp_ns: i64) -> Option<f64> {
        let after = self.marks.partition_point(|m| m.stamp_ns <= stamp_ns);
        let before = self.marks.get(after.checked_sub(1)?)?;
        let since_s = (stamp_ns - before.stamp_ns) as f64 * 1e-9;
        match self.marks.get(after) {
            Some(next) => {
                let share = since_s / ((next.stamp_ns - before.stamp_ns) as f64 * 1e-9);
                Some(before.distance_m + share * (next.distance_m - before.distance_m))
            }
            None if stamp_ns - before.stamp_ns > LONGEST_GAP_NS => None,
            None => Some(before.distance_m + before.speed_mps.abs() * since_s),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    const MS: i64 = 1_000_000;

    #[test]
    fn distance_is_the_integral_of_speed_at_any_stamp() {
        let mut odometer = Odometer::default();
        for k in 0..=200 {
            odometer.push(k * 10 * MS, 3.0 * k as f64 * 0.01);
        }
        for t_s in [0.0, 0.5, 1.2345, 2.0] {
            let got = odometer.at((t_s * 1e9) as i64).unwrap();
            assert_relative_eq!(got, 1.5 * t_s * t_s, epsilon = 2e-4);
        }
        assert_relative_eq!(odometer.at(2100 * MS).unwrap(), 6.0 + 0.6, epsilon = 1e-9);
        assert_eq!(odometer.at(2600 * MS), None);
        assert_eq!(odometer.at(-MS), None);
    }

    #[test]
    fn gaps_add_nothing_and_a_clock_set_back_starts_afresh() {
        let mut odometer = Odometer::default();
        odometer.push(0, 10.0);
        odometer.push(2_000 * MS, 10.0);
        assert_eq!(odometer.at(2_000 * MS), Some(0.0));
        odometer.push(2_010 * MS, -10.0);
        assert_relative_eq!(odometer.at(2_010 * MS).unwrap(), 0.1, epsilon = 1e-12);
        odometer.push(0, 1.0);
        assert_eq!(odometer.at(0), Some(0.0));
        odometer.push(100 * MS, f64::NAN);
        assert_relative_eq!(odometer.at(100 * MS).unwrap(), 0.1, epsilon = 1e-12);
    }
}
