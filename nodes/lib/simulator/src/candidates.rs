//! What may differ between car and simulator: the simulator's own parameters, and effects wrapped around it.

use crate::commands::CommandEffects;
use crate::{Channel, Description, InputKind, SimulatorFile};

/// An effect of the library around a simulator: before it, on its command, or behind it, on what is recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are those of the library; see `name`")]
pub enum Wrapped {
    SteeringDelay,
    SteeringLag,
    SteeringGain,
    SteeringOffset,
    SteeringBacklash,
    SteeringRateLimit,
    VXScale,
    VYLeverArm,
    VYBias,
    GyroScale,
    GyroBias,
    OdometryDelay,
    OdometryLowPass,
}

/// Name, parameter, unit, site, bounds and a size that is small for a car of any scale.
type Facts = (&'static str, &'static str, &'static str, &'static str, [f64; 2], f64);

impl Wrapped {
    /// All of them.
    pub const ALL: [Self; 13] = [
        Self::SteeringDelay,
        Self::SteeringLag,
        Self::SteeringGain,
        Self::SteeringOffset,
        Self::SteeringBacklash,
        Self::SteeringRateLimit,
        Self::VXScale,
        Self::VYLeverArm,
        Self::VYBias,
        Self::GyroScale,
        Self::GyroBias,
        Self::OdometryDelay,
        Self::OdometryLowPass,
    ];

    fn facts(self) -> Facts {
        match self {
            Self::SteeringDelay => ("steering_delay", "delay_s", "s", "steering", [0.0, 0.3], 0.01),
            Self::SteeringLag => ("steering_lag", "tau_s", "s", "steering", [0.0, 0.3], 0.01),
            Self::SteeringGain => ("steering_gain", "gain", "1", "steering", [-0.99, 60.0], 0.02),
            Self::SteeringOffset => ("steering_offset", "offset_rad", "rad", "steering", [-0.2, 0.2], 0.004),
            Self::SteeringBacklash => {
                ("steering_backlash", "half_width_rad", "rad", "steering", [0.0, 0.1], 0.004)
            }
            // Fitted as one over the rate: zero is no limit.
            Self::SteeringRateLimit => {
                ("steering_rate_limit", "rate_radps", "rad/s", "steering", [0.0, 20.0], 0.2)
            }
            Self::VXScale => ("v_x_scale", "scale", "1", "v_x", [-0.3, 0.3], 0.01),
            Self::VYLeverArm => ("v_y_lever_arm", "x_m", "m", "v_y", [-3.0, 3.0], 0.02),
            Self::VYBias => ("v_y_bias", "bias_mps", "m/s", "v_y", [-1.0, 1.0], 0.01),
            Self::GyroScale => ("gyro_scale", "scale", "1", "yaw_rate", [-0.9, 3.0], 0.01),
            Self::GyroBias => ("gyro_bias", "bias_radps", "rad/s", "yaw_rate", [-0.5, 0.5], 0.01),
            Self::OdometryDelay => ("odometry_delay", "delay_s", "s", "v_y", [0.0, 0.2], 0.01),
            Self::OdometryLowPass => ("odometry_low_pass", "tau_s", "s", "v_y", [0.0, 0.3], 0.01),
        }
    }

    /// Canonical name.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.facts().0
    }

    /// Whether the simulator itself must be run to see it.
    fn needs_rollout(self) -> bool {
        self as usize <= Self::VXScale as usize
    }
}

/// What a candidate changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A parameter of the simulator, by its place in the description.
    Own(usize),
    /// A wrapped effect.
    Wrapped(Wrapped),
}

/// Something that may differ.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// What it changes.
    pub kind: Kind,
    /// As in gap.json: `simulator.<parameter>`, or the effect's name.
    pub name: String,
    /// What its size is called.
    pub parameter: String,
    /// Unit of the size.
    pub unit: String,
    /// Where it acts, where that is known.
    pub site: Option<String>,
    /// Value as the simulator has it; 0 for a wrapped effect.
    pub null: f64,
    /// The least it can be.
    pub low: f64,
    /// The most it can be.
    pub high: f64,
    /// A small change: what derivatives are taken over.
    pub step: f64,
    /// Whether it counts something.
    pub integer: bool,
    /// Whether the simulator itself must be run to see it.
    pub needs_rollout: bool,
}

impl Candidate {
    /// The size as it is stated: a rate limit is fitted as one over itself.
    #[must_use]
    pub fn stated(&self, value: f64) -> f64 {
        if self.kind == Kind::Wrapped(Wrapped::SteeringRateLimit) { value.recip() } else { value }
    }

    /// Whether it is one of the simulator's own parameters.
    #[must_use]
    pub fn is_own(&self) -> bool {
        matches!(self.kind, Kind::Own(_))
    }
}

/// Every candidate that the simulator, the recording and the user leave open. `imposed`: the forward speed is imposed.
#[must_use]
pub fn candidates(
    description: &Description,
    file: &SimulatorFile,
    compared: &[(Channel, f64)],
    imposed: bool,
    without: &[String],
) -> Vec<Candidate> {
    let own = description.parameters.iter().enumerate().filter(|(_, p)| !file.fixed.contains(&p.name)).map(
        |(place, p)| {
            // A fifth of a tenth of the value; where that is nothing, of the range.
            let size = if p.value == 0.0 { 0.1 * (p.high - p.low) } else { p.value.abs() };
            Candidate {
                kind: Kind::Own(place),
                name: format!("simulator.{}", p.name),
                parameter: p.name.clone(),
                unit: p.unit.clone(),
                site: p.site.clone(),
                null: p.value,
                low: p.low,
                high: p.high,
                step: if p.integer { 1.0 } else { 0.02 * size },
                integer: p.integer,
                needs_rollout: true,
            }
        },
    );
    let angle = description.inputs.iter().any(|i| i.kind == InputKind::SteeringAngle);
    let has = |c: Channel| compared.iter().any(|(other, _)| *other == c);
    let wrapped = Wrapped::ALL.into_iter().filter(|w| match w {
        Wrapped::VXScale => imposed,
        Wrapped::VYLeverArm | Wrapped::VYBias | Wrapped::OdometryDelay | Wrapped::OdometryLowPass => {
            has(Channel::VYMps)
        }
        Wrapped::GyroScale | Wrapped::GyroBias => true,
        // Where the simulator takes a rate, the angle is what was recorded and there is nothing between.
        Wrapped::SteeringBacklash | Wrapped::SteeringRateLimit => angle,
        _ => true,
    });
    let wrapped = wrapped.map(|w| {
        let (name, parameter, unit, site, [low, high], step) = w.facts();
        Candidate {
            kind: Kind::Wrapped(w),
            name: name.to_owned(),
            parameter: parameter.to_owned(),
            unit: unit.to_owned(),
            site: Some(site.to_owned()),
            null: 0.0,
            low,
            high,
            step,
            integer: false,
            needs_rollout: w.needs_rollout(),
        }
    });
    own.chain(wrapped).filter(|c| !without.contains(&c.name)).collect()
}

/// The wrapped effects at the values of a point.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct Around {
    pub(crate) command: CommandEffects,
    pub(crate) v_x_scale: f64,
    pub(crate) v_y_lever_arm_m: f64,
    pub(crate) v_y_bias_mps: f64,
    pub(crate) gyro_scale: f64,
    pub(crate) gyro_bias_radps: f64,
    pub(crate) odometry_delay_s: f64,
    pub(crate) odometry_low_pass_s: f64,
}

impl Around {
    pub(crate) fn set(&mut self, effect: Wrapped, value: f64) {
        let place = match effect {
            Wrapped::SteeringDelay => &mut self.command.delay_s,
            Wrapped::SteeringLag => &mut self.command.lag_s,
            Wrapped::SteeringGain => &mut self.command.gain,
            Wrapped::SteeringOffset => &mut self.command.offset_rad,
            Wrapped::SteeringBacklash => &mut self.command.backlash_rad,
            Wrapped::SteeringRateLimit => &mut self.command.slowness_s_per_rad,
            Wrapped::VXScale => &mut self.v_x_scale,
            Wrapped::VYLeverArm => &mut self.v_y_lever_arm_m,
            Wrapped::VYBias => &mut self.v_y_bias_mps,
            Wrapped::GyroScale => &mut self.gyro_scale,
            Wrapped::GyroBias => &mut self.gyro_bias_radps,
            Wrapped::OdometryDelay => &mut self.odometry_delay_s,
            Wrapped::OdometryLowPass => &mut self.odometry_low_pass_s,
        };
        *place = value;
    }
}
