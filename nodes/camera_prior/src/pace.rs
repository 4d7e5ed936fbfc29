//! Which pictures are read: a camera sends more of them than the road has to show.
//!
//! Ten to thirteen a second, from a camera of 25, 30 or 60: a surface that changes is to be half seen within 0.5 s, and the average is one over road.

/// Leaves out pictures that follow the last one read too closely to show another road.
#[derive(Debug)]
pub(crate) struct Pace {
    /// Least time between the stamps of two pictures that are read, nanoseconds.
    least_interval_ns: i64,
    read_ns: Option<i64>,
}

impl Pace {
    pub(crate) fn new(least_interval_s: f64) -> Self {
        Self { least_interval_ns: (least_interval_s * 1e9) as i64, read_ns: None }
    }

    /// Whether a picture with this stamp is to be read. A stamp that stands still or goes back is the estimator's to judge.
    pub(crate) fn is_due(&mut self, stamp_ns: i64) -> bool {
        let since_ns = self.read_ns.map(|read_ns| stamp_ns.saturating_sub(read_ns));
        let due = since_ns.is_none_or(|since_ns| since_ns <= 0 || since_ns >= self.least_interval_ns);
        if due {
            self.read_ns = Some(stamp_ns);
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn of_thirty_pictures_a_second_every_third_is_read() {
        let mut pace = Pace::new(0.075);
        let read: Vec<i64> = (0..30).filter(|k| pace.is_due(k * 100 * MS / 3)).collect();
        assert_eq!(read, (0..30).step_by(3).collect::<Vec<_>>());
        let mut every = Pace::new(0.0);
        assert!((0..30).all(|k| every.is_due(k * 100 * MS / 3)));
    }

    #[test]
    fn stamps_that_stand_still_or_go_back_are_passed_on() {
        let mut pace = Pace::new(0.075);
        assert!(pace.is_due(1000 * MS) && pace.is_due(1000 * MS) && !pace.is_due(1010 * MS));
        // A bag started again: from then on the new stamps count.
        assert!(pace.is_due(10 * MS) && !pace.is_due(20 * MS) && pace.is_due(90 * MS));
        assert!(pace.is_due(i64::MAX) && pace.is_due(i64::MIN));
    }
}
