//! What a drive tells of the drive train, as a message.

use gripsight_identification::{Given, Longitudinal, Told};
use gripsight_msgs as msg;

/// What is not told is NaN.
pub(crate) fn message(told: &Longitudinal) -> msg::Longitudinal {
    let limit = |given: Option<Given>| given.map_or((f64::NAN, false), |g| (g.value, g.reached));
    msg::Longitudinal {
        gain: interval(&told.gain),
        delay_s: interval(&told.delay_s),
        lag_s: interval(&told.lag_s),
        rolling_resistance_mps2: interval(&told.rolling_resistance_mps2),
        drag_1pm: interval(&told.drag_1pm),
        limits: told
            .limits
            .iter()
            .map(|at| {
                let (a_max_mps2, a_max_reached) = limit(at.a_max_mps2);
                let (a_min_mps2, a_min_reached) = limit(at.a_min_mps2);
                let v_x_mps = crate::range(&at.v_x_mps);
                msg::LongitudinalLimit { v_x_mps, a_max_mps2, a_max_reached, a_min_mps2, a_min_reached }
            })
            .collect(),
    }
}

fn interval(told: &Told) -> msg::Interval {
    let unknown = msg::Interval { value: f64::NAN, low: f64::NAN, high: f64::NAN };
    told.known().map_or(unknown, crate::interval)
}

#[cfg(test)]
mod tests {
    use gripsight_identification::{Estimate, LimitsAt, Range};

    use super::*;

    #[test]
    fn what_is_known_arrives_and_what_is_not_is_nan() {
        let known = Told::Known(Estimate { value: 0.9, low: 0.8, high: 1.0 });
        let shown = Some(Given { value: 3.0, reached: true });
        let limits =
            vec![LimitsAt { v_x_mps: Range { low: 1.0, high: 2.0 }, a_max_mps2: shown, a_min_mps2: None }];
        let sent = message(&Longitudinal { gain: known, limits, ..Longitudinal::default() });
        assert_eq!(sent.gain, msg::Interval { value: 0.9, low: 0.8, high: 1.0 });
        assert!(sent.delay_s.value.is_nan() && sent.drag_1pm.high.is_nan());
        let at = sent.limits[0];
        assert_eq!((at.v_x_mps.low, at.a_max_mps2, at.a_max_reached), (1.0, 3.0, true));
        assert!(at.a_min_mps2.is_nan() && !at.a_min_reached);
    }
}
