//! What a simulator says of itself.

use serde::{Deserialize, Deserializer, Serialize};

use crate::SimulatorError;

/// A motion that can be set and seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Forward velocity.
    VXMps,
    /// Velocity to the left, at the simulator's reference point.
    VYMps,
    /// Yaw rate.
    YawRateRadps,
    /// Angle of the road wheels.
    SteeringRad,
    /// Specific force to the left.
    AYMps2,
}

impl Channel {
    /// As on the wire.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::VXMps => "v_x_mps",
            Self::VYMps => "v_y_mps",
            Self::YawRateRadps => "yaw_rate_radps",
            Self::SteeringRad => "steering_rad",
            Self::AYMps2 => "a_y_mps2",
        }
    }
}

/// What an input means; gripsight converts what was recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum InputKind {
    /// Angle of the road wheels or its command, rad.
    SteeringAngle,
    /// Rate of that angle, rad/s.
    SteeringRate,
    /// Speed asked for, m/s.
    Speed,
    /// Acceleration asked for, m/s2.
    Acceleration,
    /// Throttle, brake negative: `pedal_per_mps2` of the simulator's file times the acceleration asked for.
    Pedal,
}

/// An input.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// Its name.
    pub name: String,
    /// What it means.
    pub kind: InputKind,
}

/// A parameter of the simulator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SimulatorParameter {
    /// Its name; the effect is called `simulator.<name>`.
    pub name: String,
    /// Its value now.
    pub value: f64,
    /// The least it can be.
    pub low: f64,
    /// The most it can be.
    pub high: f64,
    /// Its unit; `1` for none.
    #[serde(default = "one")]
    pub unit: String,
    /// Where it stands in the parameter file: the keys that lead to it, joined by dots (`tire.p_dy1`); one text, or a list where the same
    /// figure stands in several places (the tires of an axle, wheel by wheel). Behind a minus (`-sv_min`) the figure stands with the other sign.
    #[serde(default, rename = "key", deserialize_with = "one_or_more")]
    pub keys: Vec<String>,
    /// Where it stands in the code, in words; such a parameter is never patched.
    #[serde(default)]
    pub in_code: Option<String>,
    /// Whether it counts something.
    #[serde(default)]
    pub integer: bool,
    /// Where in the car it acts, if that can be said: a site of gap.json, such as `front_axle`.
    #[serde(default)]
    pub site: Option<String>,
}

fn one() -> String {
    "1".to_owned()
}

fn one_or_more<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<String>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Keys {
        One(String),
        More(Vec<String>),
    }
    Ok(match Option::<Keys>::deserialize(deserializer)? {
        None => Vec::new(),
        Some(Keys::One(key)) => vec![key],
        Some(Keys::More(keys)) => keys,
    })
}

/// What a simulator says of itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// Its name.
    pub name: String,
    /// Time between its steps.
    pub step_s: f64,
    /// Motions that can be set between steps.
    pub states: Vec<Channel>,
    /// What it takes.
    pub inputs: Vec<Input>,
    /// What it gives.
    pub outputs: Vec<Channel>,
    /// What can be changed in it.
    pub parameters: Vec<SimulatorParameter>,
    /// Whether a measured forward speed may be imposed.
    pub imposes_v_x: bool,
    /// What it has no term for, in words.
    #[serde(default)]
    pub lacks: Vec<String>,
}

impl Description {
    /// Place of an output.
    #[must_use]
    pub fn output(&self, channel: Channel) -> Option<usize> {
        self.outputs.iter().position(|&c| c == channel)
    }

    /// Place of a state.
    #[must_use]
    pub fn state(&self, channel: Channel) -> Option<usize> {
        self.states.iter().position(|&c| c == channel)
    }

    /// Values of the parameters as they are.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        self.parameters.iter().map(|p| p.value).collect()
    }

    /// # Errors
    /// [`SimulatorError::Description`] with the first thing that cannot be.
    pub fn check(&self) -> Result<(), SimulatorError> {
        let wrong = |text: String| Err(SimulatorError::Description(text));
        if !(1e-5..=0.2).contains(&self.step_s) {
            return wrong(format!("step_s is {}, between 1e-5 and 0.2 s is possible", self.step_s));
        }
        if !self.outputs.contains(&Channel::YawRateRadps) {
            return wrong("yaw_rate_radps is not among the outputs".to_owned());
        }
        if let Some(state) = self.states.iter().find(|s| !self.outputs.contains(s)) {
            return wrong(format!("the state {} is not among the outputs", state.name()));
        }
        let steers =
            self.inputs.iter().any(|i| matches!(i.kind, InputKind::SteeringAngle | InputKind::SteeringRate));
        if !steers {
            return wrong("no input is a steering angle or rate".to_owned());
        }
        if self.imposes_v_x && self.state(Channel::VXMps).is_none() {
            return wrong("v_x_mps can be imposed only where it is a state (imposes_v_x: False)".to_owned());
        }
        for (place, p) in self.parameters.iter().enumerate() {
            let name = &p.name;
            if self.parameters[..place].iter().any(|other| other.name == *name) {
                return wrong(format!("two parameters are named {name}"));
            }
            let ordered = p.low < p.high && (p.low..=p.high).contains(&p.value);
            if !(ordered && p.low.is_finite() && p.high.is_finite()) {
                return wrong(format!(
                    "parameter {name}: {} is not between {} and {}",
                    p.value, p.low, p.high
                ));
            }
        }
        Ok(())
    }
}
