//! What a set of tires teaches the camera.

use gripsight_bag::decode;
use gripsight_friction::{Lesson, floor_friction};
use gripsight_msgs::PacejkaParams;

/// The floor's friction by a set that may be used, of the axles whose peak was reached and rests on no prior, and the driving that it rests on. One such
/// axle is enough. Where neither was reached the set only says what the floor holds at least, which is no label: taken for a value it is too low, and
/// whatever is put above it is nobody's measurement.
pub(crate) fn lesson(message: &PacejkaParams, lesson_ns: i64) -> Option<Lesson> {
    if ![PacejkaParams::ACCEPTED, PacejkaParams::ACCEPTED_WITHIN].contains(&message.status) {
        return None;
    }
    let peaks: Vec<[f64; 3]> = [&message.front_peak, &message.rear_peak]
        .into_iter()
        .filter(|peak| peak.reached && !peak.from_prior)
        .map(|peak| [peak.friction.value, peak.friction.low, peak.friction.high])
        .collect();
    let to = decode::stamp_ns(message.header.stamp);
    let name = format!("{} {}", message.handshake.run_id, message.handshake.sequence_id);
    Some(Lesson { span_ns: [to - lesson_ns, to], friction: floor_friction(&peaks)?, name })
}

#[cfg(test)]
mod tests {
    use gripsight_msgs::{Interval, PeakFriction};

    use super::*;

    #[test]
    fn only_peaks_that_were_reached_and_rest_on_no_prior_teach() {
        let peak = |reached, from_prior| PeakFriction {
            friction: Interval { value: 0.7, low: 0.68, high: 0.72 },
            reached,
            from_prior,
        };
        let mut message = PacejkaParams {
            status: PacejkaParams::ACCEPTED,
            front_peak: peak(true, false),
            rear_peak: peak(false, false),
            ..PacejkaParams::default()
        };
        message.header.stamp.sec = 100;
        let got = lesson(&message, 30_000_000_000).unwrap();
        assert!((got.friction.mu - 0.7).abs() < 1e-9 && got.span_ns == [70_000_000_000, 100_000_000_000]);
        let within = PacejkaParams { status: PacejkaParams::ACCEPTED_WITHIN, ..message.clone() };
        assert_eq!(lesson(&within, 30_000_000_000).unwrap().friction, got.friction);
        for (reached, from_prior) in [(false, false), (true, true)] {
            let front_peak = peak(reached, from_prior);
            assert_eq!(lesson(&PacejkaParams { front_peak, ..message.clone() }, 1), None);
        }
        for status in [PacejkaParams::PROPOSED, PacejkaParams::REJECTED, PacejkaParams::PROVISIONAL] {
            assert_eq!(lesson(&PacejkaParams { status, ..message.clone() }, 1), None);
        }
    }
}
