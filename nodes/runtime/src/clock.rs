//! The node's clock: the machine's, or `/clock` when the parameter `use_sim_time` is true.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

use gripsight_msgs::standard::builtin_interfaces::Time;

/// Tells the time. Stamps of diagnostics and logs come from here; mathematics uses the stamps of
/// the messages.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    /// The last `/clock` (ns), when it rules.
    simulated_ns: Option<Arc<AtomicI64>>,
}

impl Clock {
    /// A clock that stands at 0 until [`Clock::set`] moves it.
    pub(crate) fn simulated() -> Self {
        Self { simulated_ns: Some(Arc::default()) }
    }

    pub(crate) fn set(&self, time: Time) {
        if let Some(simulated_ns) = &self.simulated_ns {
            let now_ns = i64::from(time.sec) * 1_000_000_000 + i64::from(time.nanosec);
            simulated_ns.store(now_ns, Ordering::Relaxed);
        }
    }

    /// The time now.
    pub fn now(&self) -> Time {
        let now_ns = match &self.simulated_ns {
            Some(simulated_ns) => simulated_ns.load(Ordering::Relaxed),
            None => SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .map_or(0, |since| i64::try_from(since.as_nanos()).unwrap_or(i64::MAX)),
        };
        let sec = i32::try_from(now_ns.div_euclid(1_000_000_000)).unwrap_or(i32::MAX);
        Time { sec, nanosec: now_ns.rem_euclid(1_000_000_000) as u32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulated_time_is_what_was_said_last() {
        let clock = Clock::simulated();
        assert_eq!(clock.now(), Time::default());
        for time in [Time { sec: 12, nanosec: 5 }, Time { sec: -1, nanosec: 999_999_999 }] {
            clock.set(time);
            assert_eq!(clock.now(), time);
        }
    }

    #[test]
    fn the_machine_s_time_is_not_set() {
        let clock = Clock::default();
        clock.set(Time { sec: 12, nanosec: 5 });
        assert!(clock.now().sec > 1_700_000_000);
    }
}
