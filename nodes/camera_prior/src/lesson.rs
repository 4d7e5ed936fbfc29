//! What a set of tires teaches the camera.

use gripsight_bag::decode;
use gripsight_friction::{Lesson, road_friction};
use gripsight_msgs::PacejkaParams;

/// The road's friction by an accepted set, of the axles whose peak was reached and rests on no prior, and the driving that it rests on.
pub(crate) fn lesson(message: &PacejkaParams, lesson_ns: i64) -> Option<Lesson> {
    if message.status != PacejkaParams::ACCEPTED {
        return None;
    }
    let peaks: Vec<[f64; 3]> = [&message.front_peak, &message.rear_peak]
        .into_iter()
        .filter(|peak| peak.reached && !peak.from_prior)
        .map(|peak| [peak.friction.value, peak.friction.low, peak.friction.high])
        .collect();
    let to = decode::stamp_ns(message.header.stamp);
    let name = format!("{} {}", message.handshake.run_id, message.handshake.sequence_id);
    Some(Lesson { span_ns: [to - lesson_ns, to], friction: road_friction(&peaks)?, name })
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
        assert!((got.friction.mu - 0.8).abs() < 1e-9 && got.span_ns == [70_000_000_000, 100_000_000_000]);
        for (reached, from_prior) in [(false, false), (true, true)] {
            let front_peak = peak(reached, from_prior);
            assert_eq!(lesson(&PacejkaParams { front_peak, ..message.clone() }, 1), None);
        }
        for status in [PacejkaParams::PROPOSED, PacejkaParams::ACCEPTED_WITHIN, PacejkaParams::PROVISIONAL] {
            assert_eq!(lesson(&PacejkaParams { status, ..message.clone() }, 1), None);
        }
    }
}
