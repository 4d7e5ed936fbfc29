//! The library of candidate effects: one small piece of code each, all in the same form.
//!
//! # How to add an effect
//!
//! 1. Write a type that implements [`Effect`] in the file of its family (or in a new one): its [`EffectSpec`] (name, equation, source,
//!    parameters with units, null value, bounds and a typical size, what must be recorded and driven to see it) and the hooks that
//!    it needs. All hooks do nothing by default:
//!    * [`Effect::steer`]: between the recorded steering and the road wheels;
//!    * [`Effect::car`]: constants (mass, inertia, axle distances, relaxation length, speed factor);
//!    * [`Effect::loads`], [`Effect::grip`]: per axle and instant: load, extra steering angle, grip, usable share;
//!    * [`Effect::motion`]: accelerations from outside the tires;
//!    * [`Effect::sense`]: from the car's motion to the recorded signals.
//! 2. Write the equation for any [`Real`]; with the parameters at their null value it must leave everything exactly as it was
//!    (multiply by 1, add 0), and its derivative there should not vanish, or the screening cannot see it (set `starts` else).
//! 3. Add the type to the list at the end of this file, and its place to `EffectId::room` where it is not among the lateral forces. The test `null_values_leave_the_nominal_model` takes it up by itself.

mod chassis;
mod grip;
mod loads;
mod longitudinal;
mod road;
mod sensors;
mod steering;
mod tire;

use gripsight_vehicle::Real;

use crate::ModelError;
use crate::flexible::Room;
use crate::terms::{Axles, Car, Moment, Motion, Outputs};

/// What must be recorded for an effect to show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Need {
    /// A longitudinal command (drive acceleration or wheel torque).
    LongitudinalCommand,
    /// An inertial unit's accelerations.
    Accelerometer,
    /// A pose with at least one and a half laps, or with a second drive over the same course.
    Passes,
    /// Tires known from elsewhere (a file or a reference drive) and trusted.
    ReferenceTires,
}

impl Need {
    /// What to do about it.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        match self {
            Self::LongitudinalCommand => "record the commanded acceleration along with the steering",
            Self::Accelerometer => "record an inertial unit's accelerations",
            Self::Passes => "record a pose and drive two laps or more, or hold out a second drive",
            Self::ReferenceTires => {
                "give the tires of an earlier drive (--pacejka), or that drive as the first bag"
            }
        }
    }

    /// In words, as a reason why an effect is invisible.
    #[must_use]
    pub fn reason(self) -> &'static str {
        match self {
            Self::LongitudinalCommand => "no longitudinal command is recorded",
            Self::Accelerometer => "no accelerometer is recorded",
            Self::Passes => {
                "no pose over at least one and a half laps is recorded, and no second drive is held out"
            }
            Self::ReferenceTires => {
                "with the tires free it is the same as other tires: give --pacejka or a reference bag"
            }
        }
    }
}

/// A parameter of an effect as the fit sees it.
#[derive(Debug, Clone, Copy)]
pub struct ParameterSpec {
    /// Name with unit, as reported.
    pub name: &'static str,
    /// Unit in the report; `1` for none.
    pub unit: &'static str,
    /// The value at which the effect is absent.
    pub null: f64,
    /// A size that matters on a 1:10 car and on a full-size car.
    pub size: [f64; 2],
    /// Bounds as multiples of the size around the null value.
    pub range: [f64; 2],
}

/// A number that the report states for an effect, computed from its fitted parameters.
#[derive(Debug, Clone, Copy)]
pub struct Reported {
    /// Name with unit.
    pub name: &'static str,
    /// Unit; `1` for none.
    pub unit: &'static str,
    /// From the fitted parameters.
    pub value: fn(&[f64]) -> f64,
}

/// Everything about an effect but its equation in code.
#[derive(Debug, Clone, Copy)]
pub struct EffectSpec {
    /// Canonical name.
    pub name: &'static str,
    /// The equation in one line.
    pub equation: &'static str,
    /// Where it comes from.
    pub source: &'static str,
    /// What must be driven to see it.
    pub excitation: &'static str,
    /// What must be recorded to see it.
    pub needs: &'static [Need],
    /// What the fit moves.
    pub parameters: &'static [ParameterSpec],
    /// What the report states, where it is not the fit's parameters themselves.
    pub reported: &'static [Reported],
    /// Starts of the refit, in multiples of the size; one number applies to all parameters.
    pub starts: &'static [f64],
    /// Whether its derivative vanishes at the null value, so that screening must look at its first start instead.
    pub flat_at_null: bool,
    /// Effects that do nearly the same to the signals: only a fit of both tells which it is. Where such a one is not among the candidates
    /// (left out, or invisible), it shares the name.
    pub alike: &'static [EffectId],
}

/// An effect. See the module's text.
pub trait Effect {
    /// Names, units, bounds, source.
    const SPEC: EffectSpec;

    /// Between the recorded steering and the road wheels: changes the series, `dt_s` apart.
    fn steer<T: Real>(_p: &[T], _steering_rad: &mut [T], _dt_s: f64) {}

    /// Changes constants of the car.
    fn car<T: Real>(_p: &[T], _car: &mut Car<T>) {}

    /// Changes loads and extra steering angles of the axles at an instant.
    fn loads<T: Real>(_p: &[T], _car: &Car<T>, _at: &Moment<T>, _axles: &mut Axles<T>) {}

    /// Changes grip and usable share of the axles at an instant; the loads are known.
    fn grip<T: Real>(_p: &[T], _car: &Car<T>, _at: &Moment<T>, _axles: &mut Axles<T>) {}

    /// Adds accelerations from outside the tires.
    fn motion<T: Real>(_p: &[T], _car: &Car<T>, _at: &Moment<T>, _motion: &mut Motion<T>) {}

    /// From the car's motion to the recorded signals.
    fn sense<T: Real>(_p: &[T], _out: &mut Outputs<T>) {}
}

/// Declares the list of effects, and sends each hook to the effect's own code.
macro_rules! library {
    ($($variant:ident = $effect:path),+ $(,)?) => {
        /// A candidate effect.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum EffectId {
            $(
                #[doc = concat!("`", stringify!($effect), "`")]
                $variant,
            )+
        }

        impl EffectId {
            /// All of the library, in its order.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// Names, units, bounds, source.
            #[must_use]
            pub const fn spec(self) -> &'static EffectSpec {
                match self {
                    $(Self::$variant => &<$effect as Effect>::SPEC,)+
                }
            }

            /// [`Effect::steer`] with its parameters `p`.
            pub fn steer<T: Real>(self, p: &[T], steering_rad: &mut [T], dt_s: f64) {
                match self {
                    $(Self::$variant => <$effect>::steer(p, steering_rad, dt_s),)+
                }
            }

            /// [`Effect::car`] with its parameters `p`.
            pub fn car<T: Real>(self, p: &[T], car: &mut Car<T>) {
                match self {
                    $(Self::$variant => <$effect>::car(p, car),)+
                }
            }

            /// [`Effect::loads`] with its parameters `p`.
            pub fn loads<T: Real>(self, p: &[T], car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
                match self {
                    $(Self::$variant => <$effect>::loads(p, car, at, axles),)+
                }
            }

            /// [`Effect::grip`] with its parameters `p`.
            pub fn grip<T: Real>(self, p: &[T], car: &Car<T>, at: &Moment<T>, axles: &mut Axles<T>) {
                match self {
                    $(Self::$variant => <$effect>::grip(p, car, at, axles),)+
                }
            }

            /// [`Effect::motion`] with its parameters `p`.
            pub fn motion<T: Real>(self, p: &[T], car: &Car<T>, at: &Moment<T>, motion: &mut Motion<T>) {
                match self {
                    $(Self::$variant => <$effect>::motion(p, car, at, motion),)+
                }
            }

            /// [`Effect::sense`] with its parameters `p`.
            pub fn sense<T: Real>(self, p: &[T], out: &mut Outputs<T>) {
                match self {
                    $(Self::$variant => <$effect>::sense(p, out),)+
                }
            }
        }
    };
}

library! {
    TireRelaxation = tire::TireRelaxation,
    LateralLoadTransfer = grip::LateralLoadTransfer,
    LongitudinalLoadTransfer = loads::LongitudinalLoadTransfer,
    CombinedSlip = tire::CombinedSlip,
    GripScale = grip::GripScale,
    GripBalance = grip::GripBalance,
    LowGripPatch = grip::LowGripPatch,
    TireWear = grip::TireWear,
    SteeringLag = steering::SteeringLag,
    SteeringDelay = steering::SteeringDelay,
    SteeringGain = steering::SteeringGain,
    SteeringOffset = steering::SteeringOffset,
    SteeringBacklash = steering::SteeringBacklash,
    SteeringRateLimit = steering::SteeringRateLimit,
    AeroDownforce = loads::AeroDownforce,
    AeroDrag = longitudinal::AeroDrag,
    RollingResistance = longitudinal::RollingResistance,
    MassError = chassis::MassError,
    YawInertiaError = chassis::YawInertiaError,
    CogShift = chassis::CogShift,
    RoadBank = road::RoadBank,
    RoadSlope = road::RoadSlope,
    ComplianceSteer = chassis::ComplianceSteer,
    RollSteer = chassis::RollSteer,
    DifferentialYawMoment = chassis::DifferentialYawMoment,
    VyLeverArm = sensors::VyLeverArm,
    VyBias = sensors::VyBias,
    OdometryDelay = sensors::OdometryDelay,
    OdometryLowPass = sensors::OdometryLowPass,
    VxScale = sensors::VxScale,
    ImuLeverArm = sensors::ImuLeverArm,
    ImuTilt = sensors::ImuTilt,
    GyroScale = sensors::GyroScale,
    GyroBias = sensors::GyroBias,
}

impl EffectId {
    /// The effect of a canonical name.
    #[must_use]
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|e| e.spec().name == name)
    }

    /// The effect of a name from outside.
    ///
    /// # Errors
    /// [`ModelError::UnknownEffect`] lists the names there are.
    pub fn known(name: &str) -> Result<Self, ModelError> {
        Self::by_name(name).ok_or_else(|| ModelError::UnknownEffect {
            name: name.to_owned(),
            known: Self::ALL.iter().map(|e| e.name()).collect::<Vec<_>>().join(", "),
        })
    }

    /// Whether it sits in one part of the lap.
    pub fn is_of_a_place(self) -> bool {
        matches!(self, Self::LowGripPatch | Self::RoadBank | Self::RoadSlope)
    }

    /// Whether it pushes along the car: the command and the longitudinal acceleration show it, and the tires' lateral forces hardly mind.
    pub fn is_along(self) -> bool {
        matches!(self, Self::AeroDrag | Self::RollingResistance | Self::MassError | Self::RoadSlope)
    }

    /// Where it sits: whose free terms can do what it does.
    pub fn room(self) -> Room {
        match self {
            Self::SteeringLag
            | Self::SteeringDelay
            | Self::SteeringGain
            | Self::SteeringOffset
            | Self::SteeringBacklash
            | Self::SteeringRateLimit
            | Self::ComplianceSteer => Room::Steering,
            Self::VyLeverArm
            | Self::VyBias
            | Self::OdometryDelay
            | Self::OdometryLowPass
            | Self::VxScale
            | Self::ImuLeverArm
            | Self::ImuTilt
            | Self::GyroScale
            | Self::GyroBias => Room::Sensors,
            Self::AeroDrag | Self::RollingResistance | Self::MassError => Room::Drive,
            Self::LowGripPatch | Self::RoadBank | Self::RoadSlope => Room::Outside,
            _ => Room::Forces,
        }
    }

    /// How many of its parameters, the first ones, size it; later ones place or shape it.
    pub fn sizing(self) -> usize {
        match self {
            Self::LowGripPatch | Self::SteeringLag => 1,
            _ => self.spec().parameters.len(),
        }
    }

    /// Canonical name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.spec().name
    }
}

/// A parameter with its null at 0 and bounds on both sides.
const fn both_sides(name: &'static str, unit: &'static str, size: [f64; 2]) -> ParameterSpec {
    ParameterSpec { name, unit, null: 0.0, size, range: [-5.0, 5.0] }
}

/// A parameter that cannot be negative, null at 0.
const fn positive(name: &'static str, unit: &'static str, size: [f64; 2]) -> ParameterSpec {
    ParameterSpec { name, unit, null: 0.0, size, range: [0.0, 5.0] }
}

/// A spec with the usual choices; the rest is filled in by the effect.
const fn spec(
    name: &'static str,
    equation: &'static str,
    source: &'static str,
    excitation: &'static str,
    parameters: &'static [ParameterSpec],
) -> EffectSpec {
    EffectSpec {
        name,
        equation,
        source,
        excitation,
        needs: &[],
        parameters,
        reported: &[],
        starts: &[0.0],
        flat_at_null: false,
        alike: &[],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_unique_and_found() {
        for &effect in EffectId::ALL {
            assert_eq!(EffectId::by_name(effect.name()), Some(effect));
            let spec = effect.spec();
            assert!(!spec.parameters.is_empty() && !spec.equation.is_empty() && !spec.source.is_empty());
            for p in spec.parameters {
                assert!(
                    p.size.iter().all(|s| *s > 0.0) && p.range[0] <= 0.0 && p.range[1] > 0.0,
                    "{}",
                    p.name
                );
            }
        }
        assert_eq!(EffectId::by_name("magic"), None);
        assert_eq!(EffectId::ALL.len(), 34);
    }

    #[test]
    fn stated_sizes_have_the_documented_sign_and_no_limit_is_no_number() {
        let stated = |effect: EffectId, p: &[f64]| (effect.spec().reported[0].value)(p);
        // Wherever on the lap it climbs, uphill is positive.
        for p in [[0.0, 0.03, 0.0], [-1e-4, -0.03, 0.0], [1e-4, 0.0, -0.03]] {
            approx::assert_relative_eq!(stated(EffectId::RoadSlope, &p), 0.03, epsilon = 2e-4);
        }
        assert!(stated(EffectId::RoadSlope, &[-0.02, 0.0, 0.0]) < 0.0);
        assert!(stated(EffectId::RoadBank, &[-0.03, 0.02, 0.0]) < -0.04);
        assert_eq!(stated(EffectId::SteeringRateLimit, &[0.0]), f64::INFINITY);
        approx::assert_relative_eq!(stated(EffectId::SteeringRateLimit, &[2.0]), 0.5);
    }
}
