//! Signals by the names of topics and fields, of types that are not known.

use gripsight_signals::Signal;

use super::survey::{Number, Survey};
use crate::decode::wheel_of;
use crate::topics::KNOWN_TYPES;

/// A signal that a name promises.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Guess {
    pub(super) signal: Signal,
    pub(super) topic: String,
    pub(super) path: String,
    /// Unit, gain and offset, as the file writes them behind the field.
    pub(super) options: String,
    pub(super) why: String,
    /// Order among the guesses for one signal: fewer is better.
    rank: usize,
}

/// Servo of an F1TENTH car: the stack's own `steering_angle_to_servo_gain` and `..._offset`.
const SERVO: &str = ", gain: -1.2135, offset: 0.5304";
/// Its motor: `speed_to_erpm_gain`.
const ERPM: &str = ", gain: 4614.0";

/// Guesses for every topic whose type is not known, the best of each signal first.
pub(super) fn guesses(topics: &[Survey]) -> Vec<Guess> {
    let mut found: Vec<Guess> = topics
        .iter()
        .filter(|t| !KNOWN_TYPES.iter().any(|k| k.name == t.type_name))
        .flat_map(|t| t.numbers.iter().filter(|n| n.moves()).filter_map(move |n| guess(t, n)))
        .collect();
    found.sort_by_key(|g| (g.signal, g.rank));
    found.dedup_by_key(|g| g.signal);
    // A pose is whole, and of one message; a lone `y` may be anything.
    let topics: Vec<&str> =
        found.iter().filter(|g| Signal::POSE.contains(&g.signal)).map(|g| g.topic.as_str()).collect();
    if topics.len() != Signal::POSE.len() || topics.iter().any(|topic| *topic != topics[0]) {
        found.retain(|g| !Signal::POSE.contains(&g.signal));
    }
    found
}

fn guess(t: &Survey, n: &Number) -> Option<Guess> {
    let field = n.path.to_lowercase();
    let whole = format!("{}.{field}", t.name.to_lowercase());
    let has = |words: &[&str]| words.iter().any(|word| whole.contains(word));
    let last = field.rsplit('.').next().unwrap_or(&field).trim_end_matches("[0]").to_owned();
    let is = |names: &[&str]| names.contains(&last.as_str());
    if field.contains("stamp") || field.contains("covariance") || field.contains("status") {
        return None;
    }
    let commanded = has(&["cmd", "command", "target", "desired", "setpoint", "request"]);
    let alone = last == "data";
    let span = format!("{} Hz, {:.3} to {:.3}", t.rate_hz.round(), n.low, n.high);
    let (signal, options, rank) = if has(&["wheel"]) && has(&["speed", "vel", "rpm"]) && !commanded {
        let wheel = wheel_of(&last).or_else(|| wheel_of(&whole))?;
        let options = if has(&["rpm"]) { ", unit: rpm" } else { "" };
        (Signal::WHEEL_SPEEDS[wheel], options.to_owned(), 0)
    } else if has(&["servo"]) && (alone || is(&["position", "servo_position"])) {
        (Signal::Steering, SERVO.to_owned(), usize::from(has(&["sensors"])))
    } else if has(&["steer"]) {
        if has(&["rate", "torque", "mode", "enable", "effort", "current", "velocity", "speed"]) {
            return None;
        }
        let signal = if commanded { Signal::Steering } else { Signal::MeasuredSteering };
        let most = n.low.abs().max(n.high.abs());
        let wheel = has(&["steering_wheel", "hand"]);
        let unit = if most > Signal::Steering.most() || has(&["deg"]) { ", unit: deg" } else { "" };
        let ratio = if wheel || most > 60.0 { ", gain: 15.0" } else { "" };
        (signal, format!("{unit}{ratio}"), usize::from(!ratio.is_empty()))
    } else if is(&["yaw_rate", "yawrate", "heading_rate", "angular_rate_z", "gyro_z", "r"])
        || alone && has(&["yaw_rate", "yawrate"])
    {
        let unit = if has(&["deg"]) || n.high.abs().max(n.low.abs()) > 60.0 { ", unit: deg/s" } else { "" };
        (Signal::YawRate, unit.to_owned(), 0)
    } else if is(&["v_y", "vy", "lateral_velocity", "velocity_y", "vel_y"]) {
        (Signal::LateralSpeed, speed_unit(&whole, n), 0)
    } else if is(&[
        "speed",
        "velocity",
        "vel",
        "v_x",
        "vx",
        "v",
        "longitudinal_velocity",
        "velocity_x",
        "vel_x",
        "ground_speed",
        "hor_spd",
    ]) || last.starts_with("vehicle_speed")
        || last.starts_with("speed_")
        || alone && has(&["speed", "velocity"])
    {
        if has(&["angular", "wheel", "limit", "max"]) {
            return None;
        }
        let erpm = t.type_name.starts_with("vesc_msgs") || n.high.abs().max(n.low.abs()) > 500.0;
        let unit = if erpm { ERPM.to_owned() } else { speed_unit(&whole, n) };
        let signal = if commanded { Signal::SpeedCommand } else { Signal::ForwardSpeed };
        (signal, unit, usize::from(last == "v"))
    } else if is(&["a_x", "ax", "accel_x", "acceleration_x", "longitudinal_acceleration"]) {
        (Signal::ForwardAcceleration, String::new(), 0)
    } else if is(&["a_y", "ay", "accel_y", "acceleration_y", "lateral_acceleration"]) {
        (Signal::LateralAcceleration, String::new(), 0)
    } else if is(&["x", "pos_x", "position_x", "x_m"])
        && !has(&["vel", "acc", "angular", "mag", "orientation", "linear", "gyr"])
    {
        (Signal::X, String::new(), 0)
    } else if is(&["y", "pos_y", "position_y", "y_m"])
        && !has(&["vel", "acc", "angular", "mag", "orientation", "linear", "gyr"])
    {
        (Signal::Y, String::new(), 0)
    } else if is(&["yaw", "heading", "psi", "theta"]) && !has(&["rate", "acc"]) {
        let unit = if n.high.abs().max(n.low.abs()) > 10.0 || has(&["deg"]) { ", unit: deg" } else { "" };
        (Signal::Heading, unit.to_owned(), 0)
    } else {
        return None;
    };
    let why =
        if options.is_empty() { span } else { format!("{span}: check{}", options.trim_start_matches(',')) };
    Some(Guess { signal, topic: t.name.clone(), path: n.path.clone(), options, why, rank })
}

fn speed_unit(whole: &str, n: &Number) -> String {
    let has = |words: &[&str]| words.iter().any(|word| whole.contains(word));
    if has(&["kph", "kmh", "km_h", "kmph"]) || n.high > Signal::ForwardSpeed.most() {
        ", unit: km/h".to_owned()
    } else if has(&["mph"]) {
        ", unit: mph".to_owned()
    } else {
        String::new()
    }
}
