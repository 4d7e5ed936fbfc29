//! A part of a drive as a sequence of its own.

use crate::sequence::HISTORY_S;
use crate::{Clock, NS_PER_S, SignalError, StateSequence};

impl StateSequence {
    /// What lies between two times since the first sample: stamps and positions are relative to its own first sample.
    ///
    /// # Errors
    /// [`SignalError::TooShort`] where fewer than two samples lie there.
    pub fn between(&self, from_s: f64, to_s: f64) -> Result<Self, SignalError> {
        let inside = |s: f32| (from_s..=to_s).contains(&f64::from(s));
        let got = self.time_s.iter().filter(|s| inside(**s)).count();
        let first = self.time_s.iter().copied().find(|s| inside(*s)).filter(|_| got >= 2);
        let Some(start_s) = first else {
            return Err(SignalError::TooShort { what: "part of a state sequence", got, needed: 2 });
        };
        let start_stamp_ns = self.start_stamp_ns + (f64::from(start_s) * NS_PER_S).round() as i64;
        let mut part = Self { sequence_id: start_stamp_ns as u64, start_stamp_ns, ..self.clone() };
        for clock in Clock::ALL {
            let earlier_s = if clock == Clock::Commands { HISTORY_S } else { 0.0 };
            let kept: Vec<bool> = self
                .stamps_s(clock)
                .iter()
                .map(|s| (f64::from(start_s) - earlier_s..=to_s).contains(&f64::from(*s)))
                .collect();
            for (channel, values) in part.table_mut() {
                if channel.clock == clock {
                    let mut place = 0..;
                    values.retain(|_| place.next().is_some_and(|k: usize| kept[k]));
                    let origin = match channel.name {
                        name if name.ends_with("time_s") => start_s,
                        "x_m" | "y_m" | "pose_x_m" | "pose_y_m" => values.first().copied().unwrap_or(0.0),
                        _ => 0.0,
                    };
                    values.iter_mut().for_each(|v| *v -= origin);
                }
            }
        }
        Ok(part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_begins_at_nothing_and_knows_the_commands_before_it() {
        let time_s: Vec<f32> = (0..100).map(|k| k as f32 * 0.25).collect();
        let counted: Vec<f32> = (0..100).map(|k| k as f32).collect();
        let whole = StateSequence {
            sequence_id: 7_000_000_000,
            start_stamp_ns: 7_000_000_000,
            v_x_mps: counted.clone(),
            v_y_mps: counted.clone(),
            yaw_rate_radps: counted.clone(),
            steering_rad: counted.clone(),
            x_m: counted.clone(),
            y_m: counted.clone(),
            yaw_rad: counted.clone(),
            command_time_s: time_s.clone(),
            command_steering_rad: counted,
            time_s,
            ..StateSequence::default()
        };
        let part = whole.between(5.0, 10.0).unwrap();
        part.check().unwrap();
        assert_eq!((part.start_stamp_ns, part.len(), part.duration_s()), (12_000_000_000, 21, 5.0));
        assert_eq!((part.v_x_mps[0], part.x_m[0], part.yaw_rad[0]), (20.0, 0.0, 20.0));
        assert_eq!((part.command_time_s[0], part.command_steering_rad[0]), (-2.0, 12.0));
        assert_eq!(part.command_time_s.last(), Some(&5.0));
        assert!(part.a_x_mps2.is_empty() && part.pose_time_s.is_empty());
        assert_eq!(part.between(0.0, 5.0).unwrap(), part);
        assert!(whole.between(30.0, 40.0).is_err());
    }
}
