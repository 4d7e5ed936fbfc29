//! The steering lookup table: lateral acceleration in steady cornering.
//!
//! In a steady turn both axles carry the same share of the lateral acceleration a = v_x w:
//!
//! ```text
//! n_f(alpha_f) cos d = n_r(alpha_r) = a/g
//! tan(d - alpha_f) + tan(alpha_r)   = L a/v_x^2
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | n_f, n_r | F_y/F_z of the axles | 1 |
//! | alpha_f, alpha_r | slip angles | rad |
//! | d | road-wheel angle | rad |
//! | L | wheelbase | m |
//!
//! The first line is paper eq. 14, the second its eq. 3 and 4 without v_y. The turn is followed from straight running to growing
//! steering angles by Newton's method, and ends where an axle passes its peak, where the car would spin (the determinant of the
//! two equations turns positive), or where more steering no longer gives more acceleration.

use std::fmt::Write as _;

use gripsight_vehicle::{Dual, GRAVITY_MPS2, MagicFormula, PacejkaParameters, Real, VehicleParameters};

/// Number of speeds.
const SPEEDS: usize = 65;
/// Number of steering angles.
const ANGLES: usize = 60;
/// Range of speeds of 1:10 cars.
const SPEED_RANGE_MPS: (f64, f64) = (0.5, 7.0);
/// Largest steering angle.
const MAX_STEERING_RAD: f64 = 0.4;
/// Wheelbase up to which a car counts as 1:10.
const SMALL_CAR_M: f64 = 0.5;
/// Wheelbase of the cars that the range of speeds was made for.
const REFERENCE_WHEELBASE_M: f64 = 0.32;
/// Step of the walk along the turn.
const STEP_RAD: f64 = 1e-3;

/// Lateral acceleration over speed and steering angle, NaN where there is no steady turn below the peak.
#[derive(Debug, Clone, PartialEq)]
pub struct SteeringLookup {
    /// Speeds: the header row.
    pub speed_mps: Vec<f64>,
    /// Road-wheel angles: the header column. Spaced by squares, so that half of them lie in the lowest quarter.
    pub steering_rad: Vec<f64>,
    /// Rows by steering angle, columns by speed.
    pub lateral_acceleration_mps2: Vec<Vec<f64>>,
}

impl SteeringLookup {
    /// The table of a car on given tires.
    ///
    /// The speeds of a car of 1:10 are 0.5 to 7 m/s. A larger car's are that range times the root of its wheelbase over 0.32 m
    /// (equal lateral acceleration at equal steering), or more where `driven_mps`, its highest speed, needs it.
    #[must_use]
    pub fn new(vehicle: &VehicleParameters, tires: &PacejkaParameters, driven_mps: f64) -> Self {
        let wheelbase_m = vehicle.wheelbase_m();
        let scale = if wheelbase_m <= SMALL_CAR_M {
            1.0
        } else {
            (wheelbase_m / REFERENCE_WHEELBASE_M).sqrt().max(driven_mps.max(0.0) / SPEED_RANGE_MPS.1)
        };
        let (low_mps, high_mps) = SPEED_RANGE_MPS;
        let speed = |k: usize| scale * (low_mps + (high_mps - low_mps) * k as f64 / (SPEEDS - 1) as f64);
        let angle = |k: usize| MAX_STEERING_RAD * (k as f64 / (ANGLES - 1) as f64).powi(2);
        let speed_mps: Vec<f64> = (0..SPEEDS).map(speed).collect();
        let steering_rad: Vec<f64> = (0..ANGLES).map(angle).collect();
        let columns: Vec<Vec<f64>> =
            speed_mps.iter().map(|&v_mps| column(wheelbase_m, tires, v_mps, &steering_rad)).collect();
        let row = |k: usize| columns.iter().map(|c| c[k]).collect();
        Self { lateral_acceleration_mps2: (0..ANGLES).map(row).collect(), speed_mps, steering_rad }
    }

    /// As CSV: the first row holds 0 and the speeds, each further row a steering angle and its accelerations.
    #[must_use]
    pub fn to_csv(&self) -> String {
        let mut text = String::from("0");
        self.speed_mps.iter().for_each(|v| {
            let _ = write!(text, ",{v:.6}");
        });
        text.push('\n');
        for (steering_rad, row) in self.steering_rad.iter().zip(&self.lateral_acceleration_mps2) {
            let _ = write!(text, "{steering_rad:.8}");
            row.iter().for_each(|a| {
                let _ = if a.is_nan() { write!(text, ",nan") } else { write!(text, ",{a:.6}") };
            });
            text.push('\n');
        }
        text
    }
}

/// Accelerations at one speed, for steering angles that grow from 0. The first is 0 even where the car cannot run straight:
/// readers search up to the first NaN.
fn column(wheelbase_m: f64, tires: &PacejkaParameters, v_mps: f64, steering_rad: &[f64]) -> Vec<f64> {
    let turn = Turn {
        front: lift(&tires.front),
        rear: lift(&tires.rear),
        curvature: wheelbase_m * GRAVITY_MPS2 / (v_mps * v_mps),
    };
    let mut accelerations = vec![f64::NAN; steering_rad.len()];
    let Some(first) = accelerations.first_mut() else { return accelerations };
    *first = 0.0;
    let mut slip_rad = (0.0, 0.0);
    for k in 1..steering_rad.len() {
        let (from, to) = (steering_rad[k - 1], steering_rad[k]);
        let steps = ((to - from) / STEP_RAD).ceil();
        let walked = (1..=steps as usize)
            .try_fold(slip_rad, |slip, n| turn.solve(from + (to - from) * n as f64 / steps, slip));
        let Some(next) = walked else { break };
        let a_mps2 = GRAVITY_MPS2 * turn.rear.normalized_force(next.1.into()).re();
        if a_mps2 <= accelerations[k - 1] {
            break;
        }
        accelerations[k] = a_mps2;
        slip_rad = next;
    }
    accelerations
}

/// Derivatives by the front and the rear slip angle.
type Slips = Dual<2>;

fn lift(tire: &MagicFormula) -> MagicFormula<Slips> {
    MagicFormula { b: tire.b.into(), c: tire.c.into(), d: tire.d.into(), e: tire.e.into() }
}

/// The two equations of a steady turn at one speed.
struct Turn {
    front: MagicFormula<Slips>,
    rear: MagicFormula<Slips>,
    /// L g/v_x^2.
    curvature: f64,
}

impl Turn {
    /// The slip angles (front, rear) at a steering angle, from a guess near by; `None` where the turn is lost or not stable.
    fn solve(&self, steering_rad: f64, guess_rad: (f64, f64)) -> Option<(f64, f64)> {
        const ITERATIONS: usize = 12;
        const TOLERANCE: f64 = 1e-11;
        let (mut front_rad, mut rear_rad) = guess_rad;
        for _ in 0..ITERATIONS {
            let (front, rear) = (Slips::variable(front_rad, 0), Slips::variable(rear_rad, 1));
            let (n_f, n_r) = (self.front.normalized_force(front), self.rear.normalized_force(rear));
            let forces = n_f * steering_rad.cos() - n_r;
            let directions = (-front + steering_rad).tan() + rear.tan() - n_r * self.curvature;
            let ([a, b], [c, d]) = (*forces.derivatives(), *directions.derivatives());
            let (forces, directions) = (forces.re(), directions.re());
            let determinant = a * d - b * c;
            let below_the_peak = n_f.derivatives()[0] > 0.0 && n_r.derivatives()[1] > 0.0;
            if !(below_the_peak && determinant < 0.0) {
                return None;
            }
            if forces.abs() < TOLERANCE && directions.abs() < TOLERANCE {
                return Some((front_rad, rear_rad));
            }
            front_rad -= (d * forces - b * directions) / determinant;
            rear_rad -= (a * directions - c * forces) / determinant;
        }
        None
    }
}
