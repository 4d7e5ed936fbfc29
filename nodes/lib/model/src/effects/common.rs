//! What several effects share.

use gripsight_vehicle::{GRAVITY_MPS2, Real};

use super::{Need, ParameterSpec};
use crate::terms::{Axles, Car, Moment};

/// What effects along the car need.
pub(super) const COMMAND: &[Need] = &[Need::LongitudinalCommand];
/// What effects of the inertial unit need.
pub(super) const ACCELEROMETER: &[Need] = &[Need::Accelerometer];
/// For effects that are stated per g.
pub(super) const PER_G: f64 = 1.0 / GRAVITY_MPS2;
/// By how much less than its load a tire's force grows is taken as the same for every tire: that share of a load's size nobody knows.
pub(super) const LOAD_SENSITIVITY_SHARE: f64 = 0.06;
/// The grip factor never falls below this.
pub(super) const LEAST_GRIP: f64 = 0.1;
/// No axle is lighter than this share of the weight.
const LEAST_LOAD_SHARE: f64 = 0.05;

/// A factor on a figure of the car file.
pub(super) const fn ratio(size: f64) -> ParameterSpec {
    ParameterSpec { name: "ratio", unit: "1", null: 1.0, size: [size, size], range: [-3.0, 5.0] }
}

/// A share of a force at the front axle that comes on top of the one stated.
pub(super) const fn share() -> ParameterSpec {
    ParameterSpec { name: "share", unit: "1", null: 0.0, size: [0.1, 0.1], range: [-5.0, 5.0] }
}

/// How well the split of a force between the axles is known, as a standard deviation: a few percent where it is stated, else anything.
pub(super) fn split(stated: Option<f64>) -> f64 {
    if stated.is_some() { 0.03 } else { 0.3 }
}

/// Scales the grip of both axles: D at constant cornering stiffness.
pub(super) fn scale<T: Real>(axles: &mut Axles<T>, front: T, rear: T) {
    for (axle, factor) in [(&mut axles.front, front), (&mut axles.rear, rear)] {
        axle.grip *= if factor.re() < LEAST_GRIP { T::from(LEAST_GRIP) } else { factor };
    }
}

/// Adds to the axle loads.
pub(super) fn add_load<T: Real>(car: &Car<T>, axles: &mut Axles<T>, front_n: T, rear_n: T) {
    let least_n = car.mass_kg * (GRAVITY_MPS2 * LEAST_LOAD_SHARE);
    for (axle, more_n) in [(&mut axles.front, front_n), (&mut axles.rear, rear_n)] {
        axle.load_n += more_n;
        if axle.load_n.re() < least_n.re() {
            axle.load_n = least_n;
        }
    }
}

/// The road's angle at a place: its mean and the first harmonic of the distance over the lap, or over the way driven where none was closed;
/// without a pose, of the heading, as on a tilted plane.
pub(super) fn angle<T: Real>(p: &[T], at: &Moment<T>) -> T {
    p[0] + p[1] * at.place_rad.cos() + p[2] * at.place_rad.sin()
}
