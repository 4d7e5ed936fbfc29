//! The quantities that a stack's messages carry, one name each: what a topics file maps, and what the aligner joins.

use serde::{Deserialize, Serialize};

/// How a signal gets from its own stamps to those of the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Join {
    /// Between the neighbours, linearly.
    Linear,
    /// As [`Join::Linear`], the shorter way round.
    Angle,
    /// From its stamp until the next.
    Hold,
}

macro_rules! signals {
    ($($variant:ident, $name:literal, $unit:literal, $join:ident, $most:literal, $meaning:literal;)*) => {
        /// A quantity that a message carries.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum Signal {
            $(#[doc = concat!($meaning, ", in ", $unit)] #[serde(rename = $name)] $variant,)*
        }

        impl Signal {
            /// All of them.
            pub const ALL: [Self; [$($name),*].len()] = [$(Self::$variant),*];

            /// Its name in topics files.
            #[must_use]
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => $name),* }
            }

            /// The unit that it has here.
            #[must_use]
            pub fn unit(self) -> &'static str {
                match self { $(Self::$variant => $unit),* }
            }

            /// What it means.
            #[must_use]
            pub fn meaning(self) -> &'static str {
                match self { $(Self::$variant => $meaning),* }
            }

            /// How it is put on the samples.
            #[must_use]
            pub fn join(self) -> Join {
                match self { $(Self::$variant => Join::$join),* }
            }

            /// No car gives more than this, in its unit: beyond it the unit is another, or the sample is broken.
            #[must_use]
            pub fn most(self) -> f64 {
                match self { $(Self::$variant => $most),* }
            }
        }
    };
}

// The limits: 150 m/s is beyond Indianapolis; a spinning 1:10 car turns at about 30 rad/s; a road wheel does not point backwards; 20 g are a
// crash; 150 m/s over a radius of 5 cm are 3000 rad/s.
signals! {
    ForwardSpeed, "v_x", "m/s", Linear, 150.0, "forward speed";
    LateralSpeed, "v_y", "m/s", Linear, 150.0, "lateral speed, left positive";
    YawRate, "yaw_rate", "rad/s", Linear, 60.0, "yaw rate, left turn positive";
    X, "x", "m", Linear, 1e8, "position in the map";
    Y, "y", "m", Linear, 1e8, "position in the map";
    Heading, "heading", "rad", Angle, 1e4, "heading in the map, left turn positive";
    Steering, "steering", "rad", Hold, 1.6, "commanded steering angle of the road wheels, left positive";
    SpeedCommand, "speed_command", "m/s", Hold, 1e3, "commanded speed";
    AccelerationCommand, "acceleration_command", "m/s^2", Hold, 1e3, "commanded acceleration";
    MeasuredSteering, "measured_steering", "rad", Linear, 1.6, "measured steering angle of the road wheels, left positive";
    ForwardAcceleration, "a_x", "m/s^2", Linear, 200.0, "specific force forward";
    LateralAcceleration, "a_y", "m/s^2", Linear, 200.0, "specific force to the left";
    Gyro, "gyro_yaw_rate", "rad/s", Linear, 60.0, "yaw rate of the inertial unit, left turn positive";
    WheelSpeedFl, "wheel_speed_fl", "rad/s", Linear, 3000.0, "speed of the front left wheel";
    WheelSpeedFr, "wheel_speed_fr", "rad/s", Linear, 3000.0, "speed of the front right wheel";
    WheelSpeedRl, "wheel_speed_rl", "rad/s", Linear, 3000.0, "speed of the rear left wheel";
    WheelSpeedRr, "wheel_speed_rr", "rad/s", Linear, 3000.0, "speed of the rear right wheel";
    WheelEffortFl, "wheel_effort_fl", "N m", Linear, 1e5, "torque on the front left wheel";
    WheelEffortFr, "wheel_effort_fr", "N m", Linear, 1e5, "torque on the front right wheel";
    WheelEffortRl, "wheel_effort_rl", "N m", Linear, 1e5, "torque on the rear left wheel";
    WheelEffortRr, "wheel_effort_rr", "N m", Linear, 1e5, "torque on the rear right wheel";
}

impl Signal {
    /// The three of a pose.
    pub const POSE: [Self; 3] = [Self::X, Self::Y, Self::Heading];
    /// Of the wheels, in the order of [`crate::WHEELS`].
    pub const WHEEL_SPEEDS: [Self; 4] =
        [Self::WheelSpeedFl, Self::WheelSpeedFr, Self::WheelSpeedRl, Self::WheelSpeedRr];
    /// Of the wheels, in the order of [`crate::WHEELS`].
    pub const WHEEL_EFFORTS: [Self; 4] =
        [Self::WheelEffortFl, Self::WheelEffortFr, Self::WheelEffortRl, Self::WheelEffortRr];

    /// The signal of a name in a topics file.
    #[must_use]
    pub fn of(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|signal| signal.name() == name)
    }
}

/// One value for each signal; NaN where there is none.
#[derive(Debug, Clone, Copy)]
pub struct Values([f64; Signal::ALL.len()]);

impl Default for Values {
    fn default() -> Self {
        Self([f64::NAN; Signal::ALL.len()])
    }
}

impl PartialEq for Values {
    /// No value equals no value.
    fn eq(&self, other: &Self) -> bool {
        self.0.iter().zip(&other.0).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
    }
}

impl Values {
    /// The value of a signal; NaN where there is none.
    #[must_use]
    pub fn get(&self, signal: Signal) -> f64 {
        self.0[signal as usize]
    }

    /// Sets the value of a signal.
    pub fn set(&mut self, signal: Signal, value: f64) {
        self.0[signal as usize] = value;
    }

    /// The signals that have a value.
    pub fn present(&self) -> impl Iterator<Item = (Signal, f64)> + '_ {
        Signal::ALL.into_iter().map(|s| (s, self.get(s))).filter(|(_, v)| !v.is_nan())
    }
}

impl FromIterator<(Signal, f64)> for Values {
    fn from_iter<I: IntoIterator<Item = (Signal, f64)>>(values: I) -> Self {
        let mut all = Self::default();
        values.into_iter().for_each(|(signal, value)| all.set(signal, value));
        all
    }
}
