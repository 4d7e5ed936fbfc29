//! The identifier's messages as the driver takes them.

use gripsight_driving::{Actuator, Longitudinal, ReachedAt, TireSet, Trust};
use gripsight_identification::Manoeuvre;
use gripsight_msgs::{DriveNext, Interval, MagicFormula as FormulaMessage, PacejkaParams};
use gripsight_vehicle::{MagicFormula, PacejkaParameters};

/// What a message says to a driver.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Said {
    /// A set to drive on.
    Set(TireSet),
    /// The set in use must not be used any longer.
    Withdrawn,
    /// Nothing that concerns this driver, and why.
    Nothing(&'static str),
}

/// Reads a message. Sets of another car say nothing, nor does what is no end of a run.
pub(crate) fn read(message: &PacejkaParams, vehicle_hash: &str, provisional: bool) -> Said {
    if message.handshake.vehicle_hash != vehicle_hash {
        return Said::Nothing("of a car with other parameters");
    }
    let trust = match message.status {
        PacejkaParams::ACCEPTED => Trust::Accepted,
        PacejkaParams::ACCEPTED_WITHIN => Trust::AcceptedWithin,
        PacejkaParams::PROVISIONAL if provisional => Trust::Provisional,
        PacejkaParams::PROVISIONAL => return Said::Nothing("provisional, and take_provisional is false"),
        PacejkaParams::WITHDRAWN => return Said::Withdrawn,
        _ => return Said::Nothing("neither accepted nor withdrawn"),
    };
    let (front, rear) = (&message.front_peak, &message.rear_peak);
    let peaks = [front.friction.value, rear.friction.value];
    let signals = &message.signals;
    Said::Set(TireSet {
        tires: PacejkaParameters { front: formula(&message.front), rear: formula(&message.rear) },
        trust,
        valid_slip_rad: [message.front_valid_slip_rad, message.rear_valid_slip_rad],
        likely_peaks: Some(peaks).filter(|peaks| peaks.iter().all(|peak| peak.is_finite() && *peak > 0.0)),
        peak_reached: TireSet::limit_reached(peaks, [front.reached, rear.reached]),
        actuator: Actuator {
            delay_s: signals.steering_delay_s.max(0.0),
            gain: signals.steering_gain,
            offset_rad: signals.steering_offset_rad,
            ..Actuator::default()
        },
    })
}

/// What a message tells of the drive train, beside the set.
pub(crate) fn longitudinal(message: &PacejkaParams) -> Longitudinal {
    let told = &message.longitudinal;
    let value = |interval: &Interval| Some(interval.value).filter(|v| v.is_finite());
    let reached = |a: f64, reached: bool| Some(a.abs()).filter(|a| reached && a.is_finite());
    Longitudinal {
        gain: value(&told.gain),
        delay_s: value(&told.delay_s),
        lag_s: value(&told.lag_s),
        rolling_resistance_mps2: value(&told.rolling_resistance_mps2),
        drag_1pm: value(&told.drag_1pm),
        reached: told
            .limits
            .iter()
            .map(|at| ReachedAt {
                v_x_mps: [at.v_x_mps.low, at.v_x_mps.high],
                forward_mps2: reached(at.a_max_mps2, at.a_max_reached),
                backward_mps2: reached(at.a_min_mps2, at.a_min_reached),
            })
            .collect(),
    }
}

/// Whether more turn-ins are wanted.
pub(crate) fn asks_for_turn_ins(next: &[DriveNext]) -> bool {
    next.iter().filter_map(|next| Manoeuvre::by_name(&next.manoeuvre)).any(Manoeuvre::is_turning_in)
}

fn formula(m: &FormulaMessage) -> MagicFormula {
    MagicFormula { b: m.b, c: m.c, d: m.d, e: m.e }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gripsight_msgs::{LongitudinalLimit, Range};

    fn message(status: u8) -> PacejkaParams {
        let axle = FormulaMessage { b: 8.0, c: 1.4, d: 0.8, e: 0.0 };
        let mut message = PacejkaParams { status, front: axle, rear: axle, ..PacejkaParams::default() };
        message.handshake.vehicle_hash = "a".to_owned();
        (message.front_peak.friction.value, message.rear_peak.friction.value) = (0.9, 0.85);
        (message.front_valid_slip_rad, message.rear_valid_slip_rad) = (0.1, f64::NAN);
        (message.signals.steering_delay_s, message.signals.steering_gain) = (-0.001, 1.1);
        message
    }

    #[test]
    fn a_set_comes_with_what_it_is_good_for() {
        let Said::Set(set) = read(&message(PacejkaParams::ACCEPTED_WITHIN), "a", false) else { panic!() };
        assert_eq!((set.trust, set.likely_peaks), (Trust::AcceptedWithin, Some([0.9, 0.85])));
        assert_eq!((set.actuator.delay_s, set.actuator.gain), (0.0, 1.1));
        assert_eq!(set.grip(), set.tires.front.max_force_within(0.1));
        set.check().unwrap();
    }

    #[test]
    fn what_is_not_told_of_the_drive_train_stays_as_stated() {
        let mut message = message(PacejkaParams::ACCEPTED);
        for figure in [&mut message.longitudinal.gain, &mut message.longitudinal.drag_1pm] {
            figure.value = f64::NAN;
        }
        message.longitudinal.rolling_resistance_mps2.value = 0.2;
        let v_x_mps = Range { low: 2.0, high: 4.0 };
        let limit = LongitudinalLimit { v_x_mps, a_max_mps2: 3.0, a_min_mps2: -5.0, ..Default::default() };
        message.longitudinal.limits = vec![LongitudinalLimit { a_min_reached: true, ..limit }];
        let told = longitudinal(&message);
        assert_eq!((told.gain, told.drag_1pm, told.rolling_resistance_mps2), (None, None, Some(0.2)));
        assert_eq!((told.reached[0].forward_mps2, told.reached[0].backward_mps2), (None, Some(5.0)));
    }

    #[test]
    fn other_messages_are_told_apart() {
        let read = |status: u8, hash: &str, provisional: bool| read(&message(status), hash, provisional);
        assert_eq!(read(PacejkaParams::WITHDRAWN, "a", false), Said::Withdrawn);
        assert!(matches!(read(PacejkaParams::WITHDRAWN, "b", false), Said::Nothing(_)));
        assert!(matches!(read(PacejkaParams::PROPOSED, "a", true), Said::Nothing(_)));
        assert!(matches!(read(PacejkaParams::REJECTED, "a", true), Said::Nothing(_)));
        assert!(matches!(read(PacejkaParams::PROVISIONAL, "a", false), Said::Nothing(_)));
        let Said::Set(set) = read(PacejkaParams::PROVISIONAL, "a", true) else { panic!() };
        assert_eq!(set.trust, Trust::Provisional);
    }
}
