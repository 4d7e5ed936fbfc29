//! Drives as telemetry: driven, cut to one length, moved to one start, written as bags.

use std::path::Path;

use gripsight_bag::{BagWriter, encode};
use gripsight_reference_car::{EndReason, Scenario, Simulation};
use gripsight_signals::Measurement;

use crate::WithheldError;

/// The first stamp of every bag, since 1970.
const START_NS: i64 = 1_700_000_000_000_000_000;
/// Cut off at both ends: start-up, and what a moved stamp leaves open.
pub(crate) const MARGIN_S: f64 = 0.5;

/// Drives the reference car; `Err` says how a run ended that did not come to its end.
pub(crate) fn driven(scenario: &Scenario) -> Result<Result<Vec<Measurement>, EndReason>, WithheldError> {
    let recording = Simulation::new(scenario.clone())?.run(|_| {});
    Ok(if recording.end.is_completed() {
        Ok(recording.samples.iter().map(|sample| sample.measurement(START_NS)).collect())
    } else {
        Err(recording.end)
    })
}

/// What lies in a span of time, by stamp, its start moved to the one start of all bags.
pub(crate) fn cut(measurements: &[Measurement], from_ns: i64, duration_s: f64) -> Vec<Measurement> {
    let to_ns = from_ns + ns(duration_s);
    let mut inside: Vec<Measurement> = measurements
        .iter()
        .filter(|m| (from_ns..to_ns).contains(&m.stamp_ns()))
        .map(|m| moved(*m, START_NS - from_ns))
        .collect();
    inside.sort_by_key(Measurement::stamp_ns);
    inside
}

/// The part of a run between the margins.
pub(crate) fn between_margins(measurements: &[Measurement], duration_s: f64) -> Vec<Measurement> {
    cut(measurements, START_NS + ns(MARGIN_S), duration_s)
}

pub(crate) fn ns(seconds: f64) -> i64 {
    (seconds * gripsight_signals::NS_PER_S).round() as i64
}

fn moved(mut measurement: Measurement, by_ns: i64) -> Measurement {
    *measurement.stamp_ns_mut() += by_ns;
    measurement
}

/// Writes a bag; every bag of a batch is written here, whoever drove.
pub(crate) fn write(path: &Path, measurements: &[Measurement]) -> Result<(), WithheldError> {
    let mut bag = BagWriter::create(path)?;
    for measurement in measurements {
        let stamp_ns = measurement.stamp_ns();
        match measurement {
            Measurement::Odometry(m) => bag.write("/car_state/odom", stamp_ns, &encode::odometry(m))?,
            Measurement::Drive(m) => bag.write("/drive", stamp_ns, &encode::drive(m))?,
            Measurement::Imu(m) => bag.write("/imu/data", stamp_ns, &encode::imu(m))?,
            Measurement::Wheels(m) => bag.write("/wheel_speeds", stamp_ns, &encode::wheels(m))?,
            Measurement::Mapped(_) => {}
        }
    }
    Ok(bag.finish()?)
}
