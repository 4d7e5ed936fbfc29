//! A tire set as a driver takes it, and what steering it asks for.
//!
//! In a steady turn both axles carry the same share of the lateral acceleration a (paper eq. 3, 4 and 14):
//!
//! ```text
//! n_f(alpha_f) cos d = n_r(alpha_r) = a/g
//! tan(d - alpha_f) + tan(alpha_r)   = L a/v^2
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | n_f, n_r | F_y/F_z of the axles | 1 |
//! | alpha_f, alpha_r | slip angles | rad |
//! | d | road-wheel angle | rad |
//! | v, L | speed, wheelbase | m/s, m |
//!
//! The slips depend on a alone, so the table has one column for each axle instead of one for each speed; the second line then gives the angle
//! exactly. Model- and acceleration-based pursuit (Becker et al., arXiv 2209.04346) reads the same relation from a two-dimensional table.

use gripsight_vehicle::{GRAVITY_MPS2, MagicFormula, PacejkaParameters, VehicleParameters};

use crate::DrivingError;

/// No tire's peak lies at more than this many times the slip at which its stiffness alone would give that force: Magic Formulas with C of 1.25 and more, as
/// tires have, peak before.
const LATEST: f64 = 4.0;
/// Rear slip, over that at which the stiffness alone would give the largest force, from which the axle slides, and from which wholly. Magic Formulas with C
/// of 1.3 and more peak below 3.5; the curve of a set says less, as it ends with what was shown.
const REAR_SLIDES: [f64; 2] = [3.5, 5.5];
/// v_x times yaw rate, over the largest lateral acceleration, from which the slip of a sliding car grows, and from which fast.
const OVERTURNS: [f64; 2] = [1.1, 1.5];
/// Rows of the slip table.
const ROWS: usize = 200;
/// Share of the largest force that the table goes up to: at the peak itself the slip is not defined.
const MOST: f64 = 0.995;
/// Forces of the front axle that the largest turn is searched over.
const STEPS: usize = 50;

/// Peak of an axle over that of the weaker one, up to which it limits the car as well: likely peaks are known to about a tenth.
const AS_WEAK: f64 = 1.05;

/// What a set may be used for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trust {
    /// Nobody measured it: what the driver starts with.
    Assumed,
    /// The peak of both axles is known.
    Accepted,
    /// No force beyond what was shown.
    AcceptedWithin,
    /// The peak rests on a friction prior.
    Provisional,
}

/// From the steering asked to the command: `command(t) = (angle(t + delay) - offset)/gain`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Actuator {
    /// From the command to the road wheels; with the lag, where nobody tells them apart.
    pub delay_s: f64,
    /// Time constant of what follows.
    pub lag_s: f64,
    /// Road-wheel angle over command.
    pub gain: f64,
    /// Road-wheel angle at command zero.
    pub offset_rad: f64,
}

impl Default for Actuator {
    fn default() -> Self {
        Self { delay_s: 0.0, lag_s: 0.0, gain: 1.0, offset_rad: 0.0 }
    }
}

/// A Phi_p set with what it is good for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TireSet {
    /// The effective tires.
    pub tires: PacejkaParameters,
    /// What they may be used for.
    pub trust: Trust,
    /// Slips up to which the set is valid, front and rear, rad; infinite or NaN where not stated.
    pub valid_slip_rad: [f64; 2],
    /// Most likely peaks over the load, front and rear, where somebody says; the set itself may promise less, of one axle more so than of the other.
    pub likely_peaks: Option<[f64; 2]>,
    /// Whether the data reach what limits the car: [`TireSet::limit_reached`].
    pub peak_reached: bool,
    /// The steering actuator as identified with them.
    pub actuator: Actuator,
}

impl TireSet {
    /// A set without limits of its own.
    #[must_use]
    pub fn assumed(tires: PacejkaParameters) -> Self {
        let valid_slip_rad = [f64::INFINITY; 2];
        Self {
            tires,
            trust: Trust::Assumed,
            valid_slip_rad,
            likely_peaks: None,
            peak_reached: false,
            actuator: Actuator::default(),
        }
    }

    /// The tires that a stack starts from where nothing is known: the paper's mismatched start, D = 0.51.
    #[must_use]
    pub fn start() -> Self {
        Self::start_at(0.51)
    }

    /// The same at another friction.
    #[must_use]
    pub fn start_at(friction: f64) -> Self {
        let axle = MagicFormula::from_stiffness(6.0, 1.4, friction, 0.0);
        Self::assumed(PacejkaParameters { front: axle, rear: axle })
    }

    /// Lateral acceleration over g that the set promises: the weaker axle's largest force within the valid slips.
    #[must_use]
    pub fn grip(&self) -> f64 {
        let axle = |tire: &MagicFormula, valid_rad: f64| {
            tire.max_force_within(if valid_rad > 0.0 { valid_rad } else { f64::INFINITY }.min(1.5))
        };
        axle(&self.tires.front, self.valid_slip_rad[0]).min(axle(&self.tires.rear, self.valid_slip_rad[1]))
    }

    /// Whether it is known what the car turns with: the peak of the weaker axle was reached, or one of the other that is hardly higher.
    #[must_use]
    pub fn limit_reached(likely_peaks: [f64; 2], reached: [bool; 2]) -> bool {
        let weaker = likely_peaks[0].min(likely_peaks[1]);
        likely_peaks.iter().zip(reached).any(|(peak, reached)| reached && *peak <= AS_WEAK * weaker)
    }

    /// Checks that the set can be driven on.
    ///
    /// # Errors
    /// [`DrivingError::Tires`] with the figure that is wrong.
    pub fn check(&self) -> Result<(), DrivingError> {
        let grip = self.grip();
        let stiff = [self.tires.front, self.tires.rear].map(|t| t.normalized_stiffness());
        let Actuator { delay_s, gain, offset_rad, .. } = self.actuator;
        if !(self.tires.is_finite() && grip > 0.01 && stiff.iter().all(|&k| k > 0.1)) {
            return Err(DrivingError::Tires(format!("grip {grip}, stiffness over load {stiff:?} 1/rad")));
        }
        if !((0.0..1.0).contains(&delay_s) && gain > 0.1 && gain.is_finite() && offset_rad.abs() < 0.5) {
            return Err(DrivingError::Tires(format!(
                "steering delay {delay_s} s, gain {gain}, offset {offset_rad} rad"
            )));
        }
        Ok(())
    }
}

/// The same tires with a grip to plan and steer with: stiffness and shape stay. The front axle has that grip, the rear one no less, and as much more as
/// is likely: a table of a car that oversteers asks for less angle the more the car is to turn, and leads it off the track or spins it.
pub(crate) fn with_grip(tires: &PacejkaParameters, likely_peaks: [f64; 2], grip: f64) -> PacejkaParameters {
    let axle = |t: &MagicFormula, d: f64| MagicFormula::from_stiffness(t.normalized_stiffness(), t.c, d, t.e);
    let more = (likely_peaks[1] / likely_peaks[0]).max(1.0);
    PacejkaParameters { front: axle(&tires.front, grip), rear: axle(&tires.rear, grip * more) }
}

/// The steering table of a car on some tires.
#[derive(Debug, Clone, PartialEq)]
pub struct SteeringTable {
    wheelbase_m: f64,
    front: Column,
    rear: Column,
}

/// Slip angles of an axle by the force over the load, up to almost its largest.
#[derive(Debug, Clone, PartialEq)]
struct Column {
    most: f64,
    /// Slip at which the stiffness alone would give the largest force.
    stiff_rad: f64,
    slips_rad: Vec<f64>,
}

impl Column {
    fn new(tire: &MagicFormula) -> Self {
        // A curve that rises for ever has no peak, and gives the last hundredth of its force at any slip.
        let stiff_rad = tire.d / tire.normalized_stiffness();
        let latest_rad = LATEST * stiff_rad;
        let peak_rad = tire.peak_slip_rad().map_or(latest_rad, |peak| peak.min(latest_rad));
        let most = MOST * tire.normalized_force(peak_rad).max(1e-3);
        let share = |k: usize| most * k as f64 / (ROWS - 1) as f64;
        Self { most, stiff_rad, slips_rad: (0..ROWS).map(|k| slip_of(tire, share(k), peak_rad)).collect() }
    }

    fn slip_rad(&self, over_g: f64) -> f64 {
        let place = (over_g / self.most).clamp(0.0, 1.0) * (ROWS - 1) as f64;
        let row = (place.floor() as usize).min(ROWS - 2);
        self.slips_rad[row] + (place - row as f64) * (self.slips_rad[row + 1] - self.slips_rad[row])
    }
}

impl SteeringTable {
    /// From the tires.
    #[must_use]
    pub fn new(vehicle: &VehicleParameters, tires: &PacejkaParameters) -> Self {
        Self {
            wheelbase_m: vehicle.wheelbase_m(),
            front: Column::new(&tires.front),
            rear: Column::new(&tires.rear),
        }
    }

    fn most(&self) -> f64 {
        self.front.most.min(self.rear.most)
    }

    /// Largest lateral acceleration of the table.
    #[must_use]
    pub fn most_mps2(&self) -> f64 {
        self.most() * GRAVITY_MPS2
    }

    /// Road-wheel angle of a steady turn; beyond the largest acceleration that of the largest.
    #[must_use]
    pub fn steering_rad(&self, lateral_mps2: f64, speed_mps: f64) -> f64 {
        let over_g = (lateral_mps2.abs() / GRAVITY_MPS2).min(self.most());
        let speed = speed_mps.max(0.1);
        let turn = self.wheelbase_m * over_g * GRAVITY_MPS2 / (speed * speed);
        let rear_rad = self.rear.slip_rad(over_g);
        let mut angle_rad = 0.0_f64;
        for _ in 0..8 {
            let front_rad = self.front.slip_rad(over_g / angle_rad.cos().max(0.5));
            angle_rad = (front_rad + (turn - rear_rad.tan()).atan()).clamp(-1.2, 1.2);
        }
        angle_rad.copysign(lateral_mps2 * angle_rad)
    }

    /// Slip angles (front, rear) of a steady turn; beyond the largest acceleration those of the largest.
    #[must_use]
    pub fn slips_rad(&self, lateral_mps2: f64) -> (f64, f64) {
        let over_g = (lateral_mps2.abs() / GRAVITY_MPS2).min(self.most());
        let signed = |slip: f64| slip.copysign(lateral_mps2);
        (signed(self.front.slip_rad(over_g)), signed(self.rear.slip_rad(over_g)))
    }

    /// Slip angle of the front axle's largest force, be the rear one's smaller: a promise is a lower bound, and a car that goes wide needs all of it.
    #[must_use]
    pub(crate) fn front_slip_rad(&self) -> f64 {
        self.front.slip_rad(self.front.most)
    }

    /// How far the car swings out, from its rear slip and v_x times its yaw rate: 0 not at all, 1 wholly. It does where the rear axle slides and the car
    /// turns faster than any force of its tires turns its way, so that the slip grows.
    #[must_use]
    pub(crate) fn swings(&self, rear_slip_rad: f64, turning_mps2: f64) -> f64 {
        let within =
            |value: f64, [from, wholly]: [f64; 2]| ((value - from) / (wholly - from)).clamp(0.0, 1.0);
        let slides = within(rear_slip_rad.abs() / self.rear.stiff_rad, REAR_SLIDES);
        let turns = if rear_slip_rad * turning_mps2 > 0.0 { turning_mps2.abs() } else { 0.0 };
        slides * within(turns / self.most_mps2(), OVERTURNS)
    }

    /// Largest lateral acceleration over g of a steady turn at a curvature, the weaker axle pushing `grip` over its load at most: front wheels push
    /// square to themselves, so that some of it goes backward in a tight turn, the more the further they are steered into their slip.
    #[must_use]
    pub(crate) fn turns(&self, curvature_1pm: f64, grip: f64) -> f64 {
        let used = grip / self.most();
        let rear_most = used * self.rear.most;
        let turn_rad = (self.wheelbase_m * curvature_1pm.abs()).atan();
        let at = |k: usize| {
            let front = used * self.front.most * k as f64 / STEPS as f64;
            let angle_rad = self.front.slip_rad(front) + turn_rad - self.rear.slip_rad(front.min(rear_most));
            (front * angle_rad.cos().clamp(0.5, 1.0)).min(rear_most)
        };
        (STEPS / 2..=STEPS).map(at).fold(0.0, f64::max)
    }
}

/// Slip below the peak at which a tire gives a force.
fn slip_of(tire: &MagicFormula, force: f64, peak_rad: f64) -> f64 {
    let (mut low, mut high) = (0.0, peak_rad);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if tire.normalized_force(middle) < force {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_axle_that_gave_all_it_has_limits_the_car() {
        assert!(TireSet::limit_reached([0.38, 0.5], [true, false]));
        assert!(TireSet::limit_reached([0.38, 0.37], [true, false]));
        assert!(!TireSet::limit_reached([0.5, 0.37], [true, false]));
        assert!(!TireSet::limit_reached([0.38, 0.37], [false; 2]));
    }

    #[test]
    fn limits_of_a_set_hold_its_grip() {
        let mut set = TireSet::start();
        approx::assert_relative_eq!(set.grip(), 0.51, max_relative = 1e-3);
        set.valid_slip_rad = [0.02, f64::NAN];
        approx::assert_relative_eq!(set.grip(), set.tires.front.normalized_force(0.02));
        set.check().unwrap();
        set.tires.front.d = f64::NAN;
        assert!(set.check().unwrap_err().to_string().contains("NaN"));
        let late = Actuator { delay_s: 2.0, ..Actuator::default() };
        let set = TireSet { actuator: late, ..TireSet::start() };
        assert!(set.check().unwrap_err().to_string().contains("delay 2 s"));
    }

    #[test]
    fn another_grip_keeps_the_stiffness_and_never_makes_an_oversteering_car() {
        let start = TireSet::start().tires;
        let strong = with_grip(&start, [0.8, 1.0], 0.4);
        approx::assert_relative_eq!(strong.front.d, 0.4, max_relative = 1e-12);
        approx::assert_relative_eq!(strong.rear.d, 0.5, max_relative = 1e-12);
        let more = with_grip(&start, [1.0, 0.8], 0.9);
        approx::assert_relative_eq!(more.rear.d, 0.9, max_relative = 1e-12);
        approx::assert_relative_eq!(more.front.d, 0.9, max_relative = 1e-12);
        approx::assert_relative_eq!(
            more.rear.normalized_stiffness(),
            start.rear.normalized_stiffness(),
            max_relative = 1e-12
        );
    }

    #[test]
    fn a_tight_turn_costs_what_steered_wheels_push_backward() {
        let tires = TireSet::start_at(0.8).tires;
        let car = VehicleParameters::f1tenth();
        let table = SteeringTable::new(&car, &tires);
        assert!(table.turns(0.0, 0.8 * MOST) > 0.79 && table.turns(0.0, 0.4) > 0.399);
        // By hand: equal tires, so that the wheels stand at the turn's own angle.
        let tight: f64 = 1.0;
        let by_hand = 0.4 * (car.wheelbase_m() * tight).atan().cos();
        approx::assert_relative_eq!(table.turns(tight, 0.4), by_hand, max_relative = 1e-3);
        // A strong front axle has that to spare.
        let strong = MagicFormula { d: 1.2 * tires.front.d, ..tires.front };
        let table = SteeringTable::new(&car, &PacejkaParameters { front: strong, ..tires });
        approx::assert_relative_eq!(table.turns(tight, 0.4), 0.4, max_relative = 1e-3);
    }

    #[test]
    fn a_car_swings_out_where_its_slip_is_beyond_the_peak_and_grows() {
        let tires = TireSet::start_at(0.8).tires;
        let table = SteeringTable::new(&VehicleParameters::f1tenth(), &tires);
        // Stiffness alone gives the peak at 0.133 rad.
        let (within, beyond) = (0.4, 0.8);
        let (steady, fast) = (table.most_mps2(), 1.6 * table.most_mps2());
        approx::assert_relative_eq!(table.swings(beyond, fast), 1.0);
        approx::assert_relative_eq!(table.swings(-beyond, -fast), 1.0);
        for (slip_rad, turning_mps2) in [(within, fast), (beyond, steady), (beyond, -fast), (0.0, 0.0)] {
            approx::assert_relative_eq!(table.swings(slip_rad, turning_mps2), 0.0);
        }
        let halfway = table.swings(4.5 * 0.8 / 6.0, fast);
        assert!((0.45..0.55).contains(&halfway), "{halfway}");
        // A promise that ends with what was shown is no peak: its curve bends at once.
        let axle = MagicFormula { b: 8.0, c: 2.2, d: 0.3, e: -4.0 };
        let table =
            SteeringTable::new(&VehicleParameters::f1tenth(), &PacejkaParameters { front: axle, rear: axle });
        approx::assert_relative_eq!(table.swings(2.0 * table.slips_rad(table.most_mps2()).1, fast), 0.0);
    }

    #[test]
    fn a_curve_that_rises_for_ever_is_not_steered_to_the_lock() {
        let axle = |c: f64| MagicFormula::from_stiffness(15.0, c, 0.36, 0.0);
        let most = |c: f64| {
            let table = SteeringTable::new(
                &VehicleParameters::f1tenth(),
                &PacejkaParameters { front: axle(c), rear: axle(1.4) },
            );
            table.slips_rad(table.most_mps2()).0
        };
        // Stiffness alone gives the peak at 0.024 rad.
        assert!(most(1.0) < 0.1 && most(0.9) < 0.1, "{} {}", most(1.0), most(0.9));
        approx::assert_relative_eq!(most(1.4), axle(1.4).peak_slip_rad().unwrap(), max_relative = 0.2);
    }
}
