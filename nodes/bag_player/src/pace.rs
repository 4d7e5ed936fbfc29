//! Which time of the bag is now: a line through one known pair of times, with the rate as slope.

use std::time::{Duration, Instant};

/// Bag time as a function of the machine's.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    wall: Instant,
    bag_ns: u64,
    /// Seconds of the bag per second; 0 stands still.
    rate: f64,
}

impl Pace {
    /// At `wall` the bag is at `bag_ns`, and goes on at `rate`.
    pub(crate) fn new(wall: Instant, bag_ns: u64, rate: f64) -> Self {
        Self { wall, bag_ns, rate }
    }

    /// The bag's time at `wall` (ns).
    pub(crate) fn bag_ns(&self, wall: Instant) -> u64 {
        let elapsed_ns = wall.saturating_duration_since(self.wall).as_secs_f64() * self.rate * 1e9;
        self.bag_ns.saturating_add(elapsed_ns as u64)
    }

    /// When the bag is at `bag_ns`; `None` when it stands still before it.
    pub(crate) fn due(&self, bag_ns: u64) -> Option<Instant> {
        let ahead_s = bag_ns.saturating_sub(self.bag_ns) as f64 * 1e-9;
        if ahead_s == 0.0 {
            return Some(self.wall);
        }
        let wait = Duration::try_from_secs_f64(ahead_s / self.rate).ok()?;
        self.wall.checked_add(wait)
    }

    /// The same line up to `wall`, another rate from there.
    pub(crate) fn with_rate(self, wall: Instant, rate: f64) -> Self {
        if rate == self.rate { self } else { Self::new(wall, self.bag_ns(wall), rate) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START_NS: u64 = 1_700_000_000_000_000_000;

    fn after(start: Instant, seconds: f64) -> Instant {
        start + Duration::from_secs_f64(seconds)
    }

    #[test]
    fn due_is_the_inverse_of_bag_time() {
        let start = Instant::now();
        for rate in [0.5, 1.0, 10.0] {
            let pace = Pace::new(start, START_NS, rate);
            for ahead_ns in [0, 1_000, 250_000_000, 30_000_000_000] {
                let due = pace.due(START_NS + ahead_ns).unwrap();
                assert!(pace.bag_ns(due).abs_diff(START_NS + ahead_ns) < 1_000, "{rate} {ahead_ns}");
            }
        }
    }

    #[test]
    fn a_new_rate_counts_from_its_moment() {
        let start = Instant::now();
        let pace = Pace::new(start, START_NS, 1.0).with_rate(after(start, 2.0), 10.0);
        assert!(pace.bag_ns(after(start, 3.0)).abs_diff(START_NS + 12_000_000_000) < 1_000);
    }

    #[test]
    fn rate_zero_stands_still() {
        let start = Instant::now();
        let pace = Pace::new(start, START_NS, 0.0);
        assert_eq!(pace.bag_ns(after(start, 5.0)), START_NS);
        assert_eq!(pace.due(START_NS + 1), None);
        assert_eq!(pace.due(START_NS), Some(start));
    }

    #[test]
    fn a_message_from_before_is_due_at_once() {
        let start = Instant::now();
        assert_eq!(Pace::new(start, START_NS, 1.0).due(START_NS - 5), Some(start));
    }
}
