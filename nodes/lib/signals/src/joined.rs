//! Several drives of one car as one sequence.

use crate::{Clock, SignalError, StateSequence};

/// Drives that are put together lie this far apart: a gap for whatever looks at them, longer than any delay.
const APART_S: f64 = 10.0;
/// Drives are recorded alike when their time steps differ by less than this share.
const SAME_STEP: f64 = 0.05;

/// Drives one after the other, with a gap between.
#[derive(Debug, Clone, PartialEq)]
pub struct Joined {
    /// All of them. Channels that one of them lacks are left out.
    pub sequence: StateSequence,
    /// When each begins and ends there, s.
    pub spans_s: Vec<[f64; 2]>,
}

impl Joined {
    /// Puts drives together.
    ///
    /// # Errors
    /// [`SignalError::Config`] for drives that were recorded at different rates, or no drive at all.
    pub fn of(drives: &[StateSequence]) -> Result<Self, SignalError> {
        let Some(first) = drives.first() else {
            return Err(SignalError::Config { name: "number of drives", got: 0.0, must: "at least 1" });
        };
        let step_s = |s: &StateSequence| s.duration_s() / s.len().saturating_sub(1).max(1) as f64;
        if let Some(other) = drives.iter().find(|s| (step_s(s) / step_s(first) - 1.0).abs() > SAME_STEP) {
            let (name, must) =
                ("time step of a drive in s", "that of the first, to 5 %: resample it, or take it alone");
            return Err(SignalError::Config { name, got: step_s(other), must });
        }
        let mut all = first.clone();
        let mut spans_s = vec![[0.0, first.duration_s()]];
        for drive in &drives[1..] {
            let after_s = all.duration_s() + APART_S;
            spans_s.push([after_s, after_s + drive.duration_s()]);
            for ((channel, values), (_, more)) in all.table_mut().into_iter().zip(drive.table()) {
                if values.is_empty() || more.is_empty() {
                    values.clear();
                } else if channel.name.ends_with("time_s") {
                    values.extend(more.iter().map(|t| t + after_s as f32));
                } else {
                    values.extend(more);
                }
            }
        }
        // A clock without its stamps has no channels.
        for clock in Clock::ALL {
            let stamped = all
                .table()
                .iter()
                .any(|(c, v)| c.clock == clock && c.name.ends_with("time_s") && !v.is_empty());
            if !stamped {
                all.table_mut().into_iter().filter(|(c, _)| c.clock == clock).for_each(|(_, v)| v.clear());
            }
        }
        Ok(Self { sequence: all, spans_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive(n: usize, v_y: f32) -> StateSequence {
        let time_s = (0..n).map(|k| k as f32 * 0.01).collect();
        let filled = |v: f32| vec![v; n];
        StateSequence {
            time_s,
            v_x_mps: filled(3.0),
            v_y_mps: filled(v_y),
            yaw_rate_radps: filled(0.1),
            steering_rad: filled(0.0),
            ..StateSequence::default()
        }
    }

    #[test]
    fn drives_follow_each_other_and_keep_what_all_of_them_have() {
        let (a, b) = (drive(100, 1.0), StateSequence { a_x_mps2: vec![0.0; 50], ..drive(50, 2.0) });
        let Joined { sequence: all, spans_s } = Joined::of(&[a.clone(), b]).unwrap();
        assert_eq!((all.len(), all.a_x_mps2.len()), (150, 0));
        assert!(f64::from(all.time_s[100] - all.time_s[99]) > 0.99 * APART_S);
        assert_eq!((all.v_y_mps[99], all.v_y_mps[100]), (1.0, 2.0));
        for (k, span) in [(0, spans_s[0][0]), (99, spans_s[0][1]), (100, spans_s[1][0]), (149, spans_s[1][1])]
        {
            assert!((f64::from(all.time_s[k]) - span).abs() < 1e-3, "{k}: {span}");
        }
        assert_eq!(Joined::of(std::slice::from_ref(&a)).unwrap().sequence, a);
        let slow = StateSequence { time_s: (0..50).map(|k| k as f32 * 0.02).collect(), ..drive(50, 2.0) };
        assert!(Joined::of(&[a, slow]).is_err() && Joined::of(&[]).is_err());
    }
}
