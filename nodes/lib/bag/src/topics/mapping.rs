//! One signal's way out of a message: topic, field, unit, gain, offset, stamp.

use gripsight_signals::Signal;
use serde::Deserialize;

/// Standard gravity, as ISO 80000-3 has it.
const GRAVITY_MPS2: f64 = 9.806_65;

/// Where a signal comes from, as a topics file says.
///
/// `value = sign * unit * (number - offset) / gain`: gain and offset are those by which the stack makes the message's number of the
/// quantity, as VESC's `steering_angle_to_servo_gain` and `..._offset` or a steering ratio are.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mapping {
    /// The topic; empty: the signal is not taken from anywhere.
    pub topic: String,
    /// The field, such as `twist.twist.linear.x`, `velocity[0]`, `velocity[wheel_fl]`; a quaternion is read as its heading. Empty: the
    /// one that messages of a known type have for the signal.
    #[serde(default)]
    pub field: String,
    /// What the stack multiplies the quantity by.
    #[serde(default = "one")]
    pub gain: f64,
    /// What it adds then.
    #[serde(default)]
    pub offset: f64,
    /// 1 or -1: an axis that points the other way.
    #[serde(default = "one")]
    pub sign: f64,
    /// The message's unit, such as `deg`, `km/h`, `g`, `rpm`; that of the signal without it.
    #[serde(default)]
    pub unit: Option<String>,
    /// `header`, `log` or a field that is a `builtin_interfaces/Time`; without it the header where the message has one, else the log.
    #[serde(default)]
    pub stamp: Option<String>,
    /// Whether a bag may lack the topic; the signal is then left out.
    #[serde(default)]
    pub optional: bool,
    /// Of a pose: how far ahead of the centre of gravity its point lies, m (the rear axle: negative). The pose is then moved there.
    #[serde(default)]
    pub ahead_m: f64,
}

fn one() -> f64 {
    1.0
}

/// Units by the unit that they are turned into: name and factor.
const UNITS: [(&str, &[(&str, f64)]); 6] = [
    ("rad", &[("rad", 1.0), ("deg", std::f64::consts::PI / 180.0), ("mrad", 1e-3)]),
    (
        "rad/s",
        &[("rad/s", 1.0), ("deg/s", std::f64::consts::PI / 180.0), ("rpm", std::f64::consts::PI / 30.0)],
    ),
    ("m/s", &[("m/s", 1.0), ("km/h", 1.0 / 3.6), ("mph", 0.447_04), ("kn", 1852.0 / 3600.0)]),
    ("m/s^2", &[("m/s^2", 1.0), ("m/s2", 1.0), ("g", GRAVITY_MPS2)]),
    ("m", &[("m", 1.0), ("cm", 0.01), ("mm", 1e-3), ("km", 1e3)]),
    ("N m", &[("N m", 1.0), ("Nm", 1.0)]),
];

impl Mapping {
    /// A topic whose messages are of a known type.
    #[must_use]
    pub fn of_topic(topic: &str) -> Self {
        Self {
            topic: topic.to_owned(),
            field: String::new(),
            gain: 1.0,
            offset: 0.0,
            sign: 1.0,
            unit: None,
            stamp: None,
            optional: false,
            ahead_m: 0.0,
        }
    }

    /// Factor and offset from the message's number to the signal: `value = factor * (number - offset)`.
    pub(super) fn scale(&self, signal: Signal) -> Result<(f64, f64), String> {
        if !self.gain.is_finite() || self.gain == 0.0 {
            return Err(format!("gain is {}", self.gain));
        }
        if !self.offset.is_finite() {
            return Err(format!("offset is {}", self.offset));
        }
        if !self.ahead_m.is_finite() || self.ahead_m != 0.0 && !Signal::POSE.contains(&signal) {
            return Err(format!("ahead_m is {}: it is a pose's, in m", self.ahead_m));
        }
        if self.sign.abs() != 1.0 {
            return Err(format!("sign is {}, not 1 or -1", self.sign));
        }
        let known = UNITS.iter().find(|(unit, _)| *unit == signal.unit()).map_or(&[][..], |(_, known)| known);
        let unit = self.unit.as_deref().unwrap_or(signal.unit());
        let Some((_, factor)) = known.iter().find(|(name, _)| *name == unit) else {
            let names: Vec<&str> = known.iter().map(|(name, _)| *name).collect();
            return Err(format!("unit `{unit}`; known are {}", names.join(", ")));
        };
        Ok((self.sign * factor / self.gain, self.offset))
    }
}
