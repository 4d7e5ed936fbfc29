//! What is known of an effect beside its equation in code.

use gripsight_vehicle::VehicleParameters;

use super::EffectId;
use crate::site::Site;

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
                "with the tires' peak unknown it is the same as other tires: give --pacejka or a reference bag"
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

impl Reported {
    /// Value with the ends of its interval: from moving each fitted parameter by its own half width, where that is known.
    #[must_use]
    pub fn with_ends(&self, fitted: &[f64], half_widths: &[f64]) -> (f64, f64, f64) {
        let value = (self.value)(fitted);
        let (mut low, mut high) = (value, value);
        for (i, half) in half_widths.iter().enumerate().filter(|(_, half)| half.is_finite()) {
            for end in [-half, *half] {
                let mut moved = fitted.to_vec();
                moved[i] += end;
                let v = (self.value)(&moved);
                (low, high) = (low.min(v), high.max(v));
            }
        }
        (value, low, high)
    }
}

/// How much of its first parameter a car may well have without anything being the matter: from the car, and from a size that matters.
pub type Usual = fn(&VehicleParameters, f64) -> f64;

/// A figure of the car as a team states it.
#[derive(Debug, Clone, Copy)]
pub struct Figure {
    /// Name as in the vehicle file, unit included; of a sensor's scale the signal's.
    pub name: &'static str,
    /// What is stated; `None` where nothing is.
    pub stated: fn(&VehicleParameters) -> Option<f64>,
    /// The figure where the effect's first parameter has a value.
    pub value: fn(&VehicleParameters, f64) -> f64,
}

/// A quantity that has a name outside of the library, too: others' simulators have a term for it, an identification states it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutsideTerm {
    /// Mass of the car.
    Mass,
    /// Inertia about the vertical axis.
    YawInertia,
    /// Distances of the axles from the centre of gravity.
    AxleDistances,
    /// Height of the centre of gravity, m.
    CogHeight,
    /// Relaxation length of the tires, m.
    Relaxation,
    /// Grip lost by the side's loads being unlike.
    LateralLoadTransfer,
    /// Drag of the air.
    Drag,
    /// Dead time between command and wheels, s.
    SteeringDelay,
    /// Wheel angle over command, less one.
    SteeringGain,
    /// Wheel angle at a command of zero, rad.
    SteeringOffset,
    /// Time constant (s) and shape of the servo.
    SteeringLag,
    /// One over the largest rate of the wheels, s/rad.
    SteeringRateLimit,
    /// Where v_y is measured, ahead of the centre of gravity, m.
    VYLeverArm,
    /// Added to v_y by its sensor, m/s.
    VYBias,
    /// Added to the yaw rate by its sensor, rad/s.
    YawRateBias,
}

/// What follows with a lag in the motion for an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lagging {
    /// Slip angles that follow the steady ones with a lag.
    Slip,
    /// The lateral acceleration behind the roll of the body.
    Roll,
    /// The longitudinal acceleration as the springs carry it in pitch.
    Pitch,
}

/// What no fit of the model can know of an effect's size, as a standard deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unknown {
    /// As a share of the size.
    pub share: f64,
    /// In samples, times the way driven in each.
    pub samples: f64,
}

impl Unknown {
    /// The standard deviation of a size, in its unit, on a recording with steps of `dt_s`.
    #[must_use]
    pub fn sigma(&self, size: f64, dt_s: f64, typical_speed_mps: f64) -> f64 {
        self.share * size + self.samples * dt_s * typical_speed_mps
    }
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
    /// Where it sits: both axles where one parameter acts on both.
    pub sites: &'static [Site],
    /// What must be recorded to see it.
    pub needs: &'static [Need],
    /// What the fit moves.
    pub parameters: &'static [ParameterSpec],
    /// How many of the parameters, the first ones, size it; later ones place or shape it.
    pub sizing: usize,
    /// What the report states, where it is not the fit's parameters themselves.
    pub reported: &'static [Reported],
    /// Starts of the refit, in multiples of the size; one number applies to all parameters.
    pub starts: &'static [f64],
    /// Whether its derivative vanishes at the null value, so that screening must look at its first start instead.
    pub flat_at_null: bool,
    /// Effects that do nearly the same to the signals: only a fit of both tells which it is. Where such a one is not among the candidates
    /// (left out, or invisible), it shares the name.
    pub alike: &'static [EffectId],
    /// How much of it every car may have; nothing of an effect that a sound car has nothing of.
    pub usual: Option<Usual>,
    /// The figure of the car that its first parameter is the error of.
    pub figure: Option<Figure>,
    /// What it is outside of the library.
    pub outside: Option<OutsideTerm>,
    /// Whether it is fitted along and never a candidate.
    pub is_nuisance: bool,
    /// Whether it sits in one part of the lap.
    pub of_a_place: bool,
    /// Whether it pushes along the car: the command and the longitudinal acceleration show it, and the tires' lateral forces hardly mind.
    pub along: bool,
    /// Whether the recorded steering is a command where this is at work, held until the next; a measured angle is neither.
    pub of_a_command: bool,
    /// What follows with a lag in the motion for it.
    pub lagging: &'static [Lagging],
    /// An effect that is there as well wherever this one is, and takes a part of its size.
    pub company: Option<EffectId>,
    /// The effect whose name both get where both are found.
    pub goes_by: Option<EffectId>,
    /// What no fit can know of its size.
    pub unknown: Unknown,
    /// Standard deviation, in sizes that matter, of what fits find of it in cars that have none of it: whatever the model lacks may look like it.
    /// `tests/results/withheld/fit_spread.py` finds it on development cases.
    pub spread: f64,
}

/// A parameter with its null at 0 and bounds on both sides.
pub(super) const fn both_sides(name: &'static str, unit: &'static str, size: [f64; 2]) -> ParameterSpec {
    ParameterSpec { name, unit, null: 0.0, size, range: [-5.0, 5.0] }
}

/// A parameter that cannot be negative, null at 0.
pub(super) const fn positive(name: &'static str, unit: &'static str, size: [f64; 2]) -> ParameterSpec {
    ParameterSpec { name, unit, null: 0.0, size, range: [0.0, 5.0] }
}

/// A spec with the usual choices; the rest is filled in by the effect.
pub(super) const fn spec(
    name: &'static str,
    equation: &'static str,
    source: &'static str,
    excitation: &'static str,
    sites: &'static [Site],
    parameters: &'static [ParameterSpec],
) -> EffectSpec {
    EffectSpec {
        name,
        equation,
        source,
        excitation,
        sites,
        needs: &[],
        parameters,
        sizing: parameters.len(),
        reported: &[],
        starts: &[0.0],
        flat_at_null: false,
        alike: &[],
        usual: None,
        figure: None,
        outside: None,
        is_nuisance: false,
        of_a_place: false,
        along: false,
        of_a_command: false,
        lagging: &[],
        company: None,
        goes_by: None,
        unknown: Unknown { share: 0.0, samples: 0.0 },
        spread: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_known_grows_with_the_size_or_with_the_way_of_a_sample() {
        let of = |share, samples| Unknown { share, samples }.sigma(0.3, 0.01, 20.0);
        assert_eq!(of(0.0, 0.0), 0.0);
        approx::assert_relative_eq!(of(0.5, 0.0), 0.15, epsilon = 1e-12);
        approx::assert_relative_eq!(of(0.0, 0.1), 0.02, epsilon = 1e-12);
    }
}
