//! The library of candidate effects: one small file each, all in the same form.
//!
//! # How to add an effect
//!
//! 1. Write a file with a type that implements [`Effect`]: its [`EffectSpec`] (name, equation, source, site, parameters with units, null value,
//!    bounds and a typical size, what must be recorded and driven to see it, and whatever else concerns this effect alone) and the hooks that
//!    it needs. All hooks do nothing by default:
//!    * [`Effect::follow`]: between the recorded steering and the road wheels;
//!    * [`Effect::car`]: constants (mass, inertia, axle distances, relaxation length, speed factor);
//!    * [`Effect::loads`], [`Effect::grip`]: per axle and instant: load, extra steering angle, grip, usable share;
//!    * [`Effect::motion`]: accelerations from outside the tires;
//!    * [`Effect::sense`]: from the car's motion to the recorded signals.
//! 2. Write the equation for any [`Real`]; with the parameters at their null value it must leave everything exactly as it was
//!    (multiply by 1, add 0), and its derivative there should not vanish, or the screening cannot see it (set `starts` else).
//! 3. Name the file below, and add the type to the list. The test `null_values_leave_the_nominal_model` takes it up by itself.

mod aero_downforce;
mod aero_drag;
mod brake_split;
mod cog_shift;
mod combined_slip;
mod common;
mod compliance_steer;
mod differential_yaw_moment;
mod drive_split;
mod grip_balance;
mod grip_scale;
mod gyro_bias;
mod gyro_scale;
mod imu_lever_arm;
mod imu_tilt;
mod lateral_load_transfer;
mod longitudinal_load_transfer;
mod low_grip_patch;
mod mass_error;
mod odometry_delay;
mod odometry_low_pass;
mod outer_wheel_moment;
mod road_bank;
mod road_slope;
mod roll_steer;
mod rolling_resistance;
mod spec;
mod steering_backlash;
mod steering_delay;
mod steering_gain;
mod steering_lag;
mod steering_offset;
mod steering_rate_limit;
#[cfg(test)]
mod testing;
mod tire_relaxation;
mod tire_wear;
mod v_x_scale;
mod v_y_bias;
mod v_y_lever_arm;
mod v_y_roll_rate;
mod yaw_inertia_error;

use gripsight_vehicle::{Real, VehicleParameters};

use crate::ModelError;
use crate::terms::{Axles, Car, Moment, Motion, Outputs};

pub use spec::{EffectSpec, Figure, Lagging, Need, OutsideTerm, ParameterSpec, Reported, Unknown, Usual};
use spec::{both_sides, positive, spec};

/// What an effect between the steering and the road wheels remembers from angle to angle.
#[derive(Debug, Clone)]
pub struct Wheels<T> {
    /// Its own numbers, from the first angle on.
    kept: Option<[T; 8]>,
    /// The step that they were made for, where they depend on one.
    step_s: f64,
    /// Angles, each with how long ago it was.
    past: Vec<(f64, T)>,
}

impl<T> Default for Wheels<T> {
    fn default() -> Self {
        Self { kept: None, step_s: f64::NAN, past: Vec::new() }
    }
}

/// An effect. See the module's text.
pub trait Effect {
    /// Names, site, units, bounds, source, and rules of its own.
    const SPEC: EffectSpec;

    /// Between the recorded steering and the road wheels: the wheels' angle where the steering has come to an angle in a line, `dt_s` after the
    /// angle before. Before the first the car went on straight.
    fn follow<T: Real>(_p: &[T], _wheels: &mut Wheels<T>, steering_rad: T, _dt_s: f64) -> T {
        steering_rad
    }

    /// The same for a series: changes it, `dt_s` apart.
    fn steer<T: Real>(p: &[T], steering_rad: &mut [T], dt_s: f64) {
        let mut wheels = Wheels::default();
        for angle in steering_rad {
            *angle = Self::follow(p, &mut wheels, *angle, dt_s);
        }
    }

    /// The same for a held command: a series of its means over each step, of which it makes those of the wheels.
    fn steer_held<T: Real>(p: &[T], steering_rad: &mut [T], dt_s: f64) {
        Self::steer(p, steering_rad, dt_s);
    }

    /// By how long it hands the steering on later, and otherwise as it came.
    fn transport_s(_p: &[f64]) -> f64 {
        0.0
    }

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

        /// What a car has of an effect at least that every car has, of a size that matters.
const LEAST_USUAL: f64 = 1e-3;

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

            /// [`Effect::follow`] with its parameters `p`.
            pub fn follow<T: Real>(self, p: &[T], wheels: &mut Wheels<T>, steering_rad: T, dt_s: f64) -> T {
                match self {
                    $(Self::$variant => <$effect>::follow(p, wheels, steering_rad, dt_s),)+
                }
            }

            /// [`Effect::steer`] with its parameters `p`.
            pub fn steer<T: Real>(self, p: &[T], steering_rad: &mut [T], dt_s: f64) {
                match self {
                    $(Self::$variant => <$effect>::steer(p, steering_rad, dt_s),)+
                }
            }

            /// [`Effect::steer_held`] with its parameters `p`.
            pub fn steer_held<T: Real>(self, p: &[T], steering_rad: &mut [T], dt_s: f64) {
                match self {
                    $(Self::$variant => <$effect>::steer_held(p, steering_rad, dt_s),)+
                }
            }

            /// [`Effect::transport_s`] with its parameters `p`.
            #[must_use]
            pub fn transport_s(self, p: &[f64]) -> f64 {
                match self {
                    $(Self::$variant => <$effect>::transport_s(p),)+
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
    TireRelaxation = tire_relaxation::TireRelaxation,
    LateralLoadTransfer = lateral_load_transfer::LateralLoadTransfer,
    LongitudinalLoadTransfer = longitudinal_load_transfer::LongitudinalLoadTransfer,
    CombinedSlip = combined_slip::CombinedSlip,
    GripScale = grip_scale::GripScale,
    GripBalance = grip_balance::GripBalance,
    LowGripPatch = low_grip_patch::LowGripPatch,
    TireWear = tire_wear::TireWear,
    SteeringLag = steering_lag::SteeringLag,
    SteeringDelay = steering_delay::SteeringDelay,
    SteeringGain = steering_gain::SteeringGain,
    SteeringOffset = steering_offset::SteeringOffset,
    SteeringBacklash = steering_backlash::SteeringBacklash,
    SteeringRateLimit = steering_rate_limit::SteeringRateLimit,
    AeroDownforce = aero_downforce::AeroDownforce,
    AeroDrag = aero_drag::AeroDrag,
    RollingResistance = rolling_resistance::RollingResistance,
    MassError = mass_error::MassError,
    YawInertiaError = yaw_inertia_error::YawInertiaError,
    CogShift = cog_shift::CogShift,
    RoadBank = road_bank::RoadBank,
    RoadSlope = road_slope::RoadSlope,
    ComplianceSteer = compliance_steer::ComplianceSteer,
    RollSteer = roll_steer::RollSteer,
    DifferentialYawMoment = differential_yaw_moment::DifferentialYawMoment,
    VyRollRate = v_y_roll_rate::VyRollRate,
    VyLeverArm = v_y_lever_arm::VyLeverArm,
    VyBias = v_y_bias::VyBias,
    OdometryDelay = odometry_delay::OdometryDelay,
    OdometryLowPass = odometry_low_pass::OdometryLowPass,
    VxScale = v_x_scale::VxScale,
    ImuLeverArm = imu_lever_arm::ImuLeverArm,
    ImuTilt = imu_tilt::ImuTilt,
    GyroScale = gyro_scale::GyroScale,
    GyroBias = gyro_bias::GyroBias,
    DriveSplit = drive_split::DriveSplit,
    BrakeSplit = brake_split::BrakeSplit,
    OuterWheelMoment = outer_wheel_moment::OuterWheelMoment,
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
            known: Self::candidates().map(|e| e.name()).collect::<Vec<_>>().join(", "),
        })
    }

    /// The effect that is a quantity with a name outside of the library.
    #[must_use]
    pub fn of_outside(term: OutsideTerm) -> Option<Self> {
        Self::ALL.iter().copied().find(|e| e.spec().outside == Some(term))
    }

    /// Those that may be named as a cause, in the library's order.
    pub fn candidates() -> impl Iterator<Item = Self> {
        Self::ALL.iter().copied().filter(|e| !e.spec().is_nuisance)
    }

    /// Those that every car has a little of, in the library's order.
    pub fn background() -> impl Iterator<Item = Self> {
        Self::ALL.iter().copied().filter(|e| e.spec().usual.is_some())
    }

    /// How much of its first parameter a car may well have without anything being the matter, in its unit; `size` is one that matters on this
    /// car. Where the vehicle file states how well the figure is known whose error it is, that; nothing of an effect that a sound car has nothing of.
    #[must_use]
    pub fn usual(self, vehicle: &VehicleParameters, size: f64) -> Option<f64> {
        let stated = self.spec().figure.and_then(|figure| {
            let sigma = vehicle.sigma.get(figure.name)?;
            let null = self.spec().parameters.first()?.null;
            let by_unit = (figure.value)(vehicle, null + 1.0) - (figure.value)(vehicle, null);
            Some(sigma / by_unit.abs())
        });
        let usual = stated.or_else(|| self.spec().usual.map(|usual| usual(vehicle, size)));
        // A figure that is stated as nothing (a centre of gravity on the ground: no load transfer) leaves next to nothing.
        usual.map(|usual| usual.max(LEAST_USUAL * size))
    }

    /// Whether it sits in one part of the lap.
    #[must_use]
    pub const fn is_of_a_place(self) -> bool {
        self.spec().of_a_place
    }

    /// Whether it pushes along the car: the command and the longitudinal acceleration show it, and the tires' lateral forces hardly mind.
    #[must_use]
    pub const fn is_along(self) -> bool {
        self.spec().along
    }

    /// How many of its parameters, the first ones, size it; later ones place or shape it.
    #[must_use]
    pub const fn sizing(self) -> usize {
        self.spec().sizing
    }

    /// Canonical name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.spec().name
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gripsight_vehicle::FIGURES;

    #[test]
    fn names_are_unique_and_found() {
        for &effect in EffectId::ALL {
            assert_eq!(EffectId::by_name(effect.name()), Some(effect));
            let spec = effect.spec();
            assert!(!spec.parameters.is_empty() && !spec.equation.is_empty() && !spec.source.is_empty());
            assert!((1..=spec.parameters.len()).contains(&spec.sizing), "{}", spec.name);
            for p in spec.parameters {
                assert!(
                    p.size.iter().all(|s| *s > 0.0) && p.range[0] <= 0.0 && p.range[1] > 0.0,
                    "{}",
                    p.name
                );
            }
        }
        assert_eq!(EffectId::by_name("magic"), None);
        assert_eq!(EffectId::candidates().count(), 34);
    }

    #[test]
    fn figures_are_those_whose_uncertainty_may_be_stated_and_a_stated_one_counts() {
        let mut named: Vec<&str> =
            EffectId::ALL.iter().filter_map(|e| e.spec().figure.map(|figure| figure.name)).collect();
        let mut known = FIGURES.to_vec();
        named.sort_unstable();
        known.sort_unstable();
        assert_eq!(named, known);
        let car = VehicleParameters::f1tenth();
        let sigma = |figure: &str, sigma: f64| VehicleParameters {
            sigma: [(figure.to_owned(), sigma)].into(),
            ..car.clone()
        };
        // A tenth of the inertia is a tenth of the ratio; a centimetre of l_f a centimetre of shift.
        let inertia = sigma("yaw_inertia_kgm2", 0.1 * car.yaw_inertia_kgm2);
        approx::assert_relative_eq!(
            EffectId::YawInertiaError.usual(&inertia, 1.0).unwrap(),
            0.1,
            epsilon = 1e-12
        );
        approx::assert_relative_eq!(
            EffectId::CogShift.usual(&sigma("l_f_m", 0.01), 1.0).unwrap(),
            0.01,
            epsilon = 1e-12
        );
        assert_eq!(EffectId::CogShift.usual(&car, 1.0), None);
    }

    #[test]
    fn what_every_car_has_goes_by_its_figures() {
        let car =
            VehicleParameters { wheel_radius_m: Some(0.05), h_cg_m: 0.1, ..VehicleParameters::f1tenth() };
        let usual = |e: EffectId| e.usual(&car, 2.0);
        assert_eq!(usual(EffectId::TireRelaxation), Some(0.33 * 0.05));
        assert_eq!(usual(EffectId::LongitudinalLoadTransfer), Some(0.33 * 0.1));
        assert_eq!(usual(EffectId::YawInertiaError), Some(0.67 * 2.0));
        assert_eq!(usual(EffectId::OuterWheelMoment), Some(2.0));
        assert_eq!(usual(EffectId::VyRollRate), Some(2.0));
        assert_eq!(usual(EffectId::GyroScale), None);
        let stated = VehicleParameters { drive_front_share: Some(0.5), ..car };
        assert_eq!(EffectId::DriveSplit.usual(&stated, 0.1), Some(0.03));
        assert_eq!(EffectId::BrakeSplit.usual(&stated, 0.1), Some(0.3));
        assert_eq!(EffectId::background().count(), 9);
        let flat = VehicleParameters { h_cg_m: 0.0, ..VehicleParameters::f1tenth() };
        assert_eq!(EffectId::LongitudinalLoadTransfer.usual(&flat, 2.0), Some(0.002));
    }
}
