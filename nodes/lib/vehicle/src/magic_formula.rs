//! The Magic Formula with four parameters (Pacejka), normalised by the vertical load.
//!
//! F_y/F_z = D sin(C atan(B a - E (B a - atan(B a)))),   a = slip angle in rad
//!
//! D is dimensionless: the paper seeds it with the friction prior mu_hat. No load sensitivity, shifts, camber or combined slip.

use std::f64::consts::FRAC_PI_2;

use serde::{Deserialize, Serialize};

use crate::Real;

/// Parameters of one axle. All dimensionless but `b` (1/rad).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MagicFormula<T = f64> {
    /// Stiffness factor, 1/rad.
    pub b: T,
    /// Shape factor.
    pub c: T,
    /// Peak factor: the friction coefficient.
    pub d: T,
    /// Curvature factor.
    pub e: T,
}

impl<T: Real> MagicFormula<T> {
    /// F_y/F_z at a slip angle. Odd, and bounded by D.
    #[must_use]
    pub fn normalized_force(&self, slip_angle_rad: T) -> T {
        let (force, [by_slip, by_b, by_c, by_d, by_e]) = self.derived(slip_angle_rad.re());
        T::chain(
            force,
            [(by_slip, &slip_angle_rad), (by_b, &self.b), (by_c, &self.c), (by_d, &self.d), (by_e, &self.e)],
        )
    }

    /// F_y/F_z at a slip angle of a tire with `grip` times the peak and the same stiffness, of which a share is `usable`.
    #[must_use]
    pub fn gripping_force(&self, slip_angle_rad: T, grip: T, usable: T) -> T {
        let (times, share) = (grip.re(), usable.re());
        let reached_rad = slip_angle_rad.re() / times;
        let (force, [by_slip, by_b, by_c, by_d, by_e]) = self.derived(reached_rad);
        let whole = times * share;
        T::chain(
            force * times * share,
            [
                (by_slip * share, &slip_angle_rad),
                ((force - by_slip * reached_rad) * share, &grip),
                (force * times, &usable),
                (by_b * whole, &self.b),
                (by_c * whole, &self.c),
                (by_d * whole, &self.d),
                (by_e * whole, &self.e),
            ],
        )
    }

    /// F_y/F_z at a slip angle, with its derivatives by that angle, B, C, D and E.
    fn derived(&self, slip_angle_rad: f64) -> (f64, [f64; 5]) {
        let (b, c, d, e, a) = (self.b.re(), self.c.re(), self.d.re(), self.e.re(), slip_angle_rad);
        let ba = b * a;
        let bend = ba - ba.atan();
        let z = ba - e * bend;
        let u = z.atan();
        let (sin, cos) = (c * u).sin_cos();
        // By z, and by B a.
        let by_z = d * c * cos / (1.0 + z * z);
        let by_ba = by_z * (1.0 - e + e / (1.0 + ba * ba));
        (d * sin, [by_ba * b, by_ba * a, d * u * cos, sin, -by_z * bend])
    }

    /// Slope at zero slip, B C D, 1/rad: times the load it is the cornering stiffness.
    #[must_use]
    pub fn normalized_stiffness(&self) -> T {
        self.b * self.c * self.d
    }
}

impl MagicFormula {
    /// From the stiffness B C D instead of B: with `k` fixed, `d`, `c` and `e` move the shape only, which fits far better
    /// conditioned than B, C, D, E (a flat ridge).
    #[must_use]
    pub fn from_stiffness(normalized_stiffness_1prad: f64, c: f64, d: f64, e: f64) -> Self {
        Self { b: normalized_stiffness_1prad / (c * d), c, d, e }
    }

    /// Slip angle of the largest force, up to 1.5 rad; `None` where the force still grows there, or B or D is not positive.
    ///
    /// The force is largest where C atan(z) = pi/2, z = B a - E (B a - atan(B a)); with E above 1 z itself may turn back before.
    #[must_use]
    pub fn peak_slip_rad(&self) -> Option<f64> {
        const END_RAD: f64 = 1.5;
        let Self { b, c, d, e } = *self;
        if !(b > 0.0 && d > 0.0 && c > 0.0) {
            return None;
        }
        let z = |ba: f64| ba - e * (ba - ba.atan());
        let turns_back = if e > 1.0 { (e - 1.0).recip().sqrt() } else { f64::INFINITY };
        let end = (b * END_RAD).min(turns_back);
        let asked = if c > 1.0 { (FRAC_PI_2 / c).tan() } else { f64::INFINITY };
        if z(end) < asked {
            return (end == turns_back).then_some(turns_back / b);
        }
        let (mut low, mut high) = (0.0, end);
        // Until nothing lies between.
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if z(middle) < asked { low = middle } else { high = middle }
        }
        (high < b * END_RAD).then_some(high / b)
    }

    /// The largest F_y/F_z up to a slip angle.
    #[must_use]
    pub fn max_force_within(&self, slip_angle_rad: f64) -> f64 {
        match self.peak_slip_rad() {
            Some(peak_rad) if peak_rad < slip_angle_rad => self.normalized_force(peak_rad),
            _ => self.normalized_force(slip_angle_rad),
        }
    }

    /// Whether all parameters are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        [self.b, self.c, self.d, self.e].iter().all(|v| v.is_finite())
    }
}

/// Phi_p of the paper: both axles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PacejkaParameters<T = f64> {
    /// Front axle.
    pub front: MagicFormula<T>,
    /// Rear axle.
    pub rear: MagicFormula<T>,
}

impl PacejkaParameters {
    /// As (B, C, D, E) front, then rear: the order of every vector of eight.
    #[must_use]
    pub fn to_array(&self) -> [f64; 8] {
        let (f, r) = (&self.front, &self.rear);
        [f.b, f.c, f.d, f.e, r.b, r.c, r.d, r.e]
    }

    /// The inverse of [`Self::to_array`].
    #[must_use]
    pub fn from_array(v: [f64; 8]) -> Self {
        Self {
            front: MagicFormula { b: v[0], c: v[1], d: v[2], e: v[3] },
            rear: MagicFormula { b: v[4], c: v[5], d: v[6], e: v[7] },
        }
    }

    /// Whether all parameters are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.front.is_finite() && self.rear.is_finite()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Dual;
    use proptest::prelude::*;

    fn tires() -> impl Strategy<Value = MagicFormula> {
        (3.0..30.0, 1.0..2.0, 0.1..1.8, -2.0..0.95).prop_map(|(b, c, d, e)| MagicFormula { b, c, d, e })
    }

    proptest! {
        #[test]
        fn odd_and_bounded(tire in tires(), a in -1.5..1.5) {
            let f = tire.normalized_force(a);
            prop_assert!(f.abs() <= tire.d + 1e-12);
            prop_assert_eq!(f, -tire.normalized_force(-a));
        }

        #[test]
        fn no_force_is_larger_than_at_the_peak(tire in tires(), c in 0.9..2.0, e in -2.0..2.0, share in 0.0..1.0) {
            let tire = MagicFormula { c, e, ..tire };
            let peak_rad = tire.peak_slip_rad();
            let most = tire.normalized_force(peak_rad.unwrap_or(1.5));
            prop_assert!(tire.normalized_force(share * 1.5) <= most + 1e-12);
            prop_assert!(peak_rad.is_none_or(|peak| peak < 1.5));
        }

        #[test]
        fn slope_at_zero_is_bcd(tire in tires()) {
            let lift = |v: f64| Dual::<1>::from(v);
            let dual = MagicFormula { b: lift(tire.b), c: lift(tire.c), d: lift(tire.d), e: lift(tire.e) };
            let slope = dual.normalized_force(Dual::variable(0.0, 0)).derivatives()[0];
            approx::assert_relative_eq!(slope, tire.normalized_stiffness(), max_relative = 1e-12);
        }

        #[test]
        fn derivatives_are_those_of_the_curve(tire in tires(), a in -1.5..1.5) {
            let lane = |lane: usize, v: f64| Dual::<5>::variable(v, lane);
            let dual = MagicFormula { b: lane(0, tire.b), c: lane(1, tire.c), d: lane(2, tire.d), e: lane(3, tire.e) };
            let exact = *dual.normalized_force(lane(4, a)).derivatives();
            let at = [tire.b, tire.c, tire.d, tire.e, a];
            for lane in 0..5 {
                let h = 1e-6 * at[lane].abs().max(0.1);
                let force = |by: f64| {
                    let mut v = at;
                    v[lane] += by;
                    MagicFormula { b: v[0], c: v[1], d: v[2], e: v[3] }.normalized_force(v[4])
                };
                let difference = (force(h) - force(-h)) / (2.0 * h);
                approx::assert_relative_eq!(exact[lane], difference, epsilon = 1e-5, max_relative = 1e-4);
            }
        }

        #[test]
        fn grip_and_usable_share_are_chained_as_they_are_written(
            tire in tires(), a in -0.5..0.5, grip in 0.3..1.5, usable in 0.1..1.0,
        ) {
            let lane = |lane: usize, v: f64| Dual::<7>::variable(v, lane);
            let dual = MagicFormula { b: lane(0, tire.b), c: lane(1, tire.c), d: lane(2, tire.d), e: lane(3, tire.e) };
            let (a, grip, usable) = (lane(4, a), lane(5, grip), lane(6, usable));
            let (one, written) = (dual.gripping_force(a, grip, usable), dual.normalized_force(a / grip) * grip * usable);
            approx::assert_relative_eq!(one.re(), written.re(), max_relative = 1e-12, epsilon = 1e-15);
            for (by, written) in one.derivatives().iter().zip(written.derivatives()) {
                approx::assert_relative_eq!(by, written, max_relative = 1e-10, epsilon = 1e-12);
            }
        }

        #[test]
        fn the_peak_is_the_largest_force(tire in tires(), a in 0.0..1.5) {
            prop_assert!(tire.normalized_force(a) <= tire.max_force_within(1.5) + 1e-4 * tire.d);
        }

        #[test]
        fn stiffness_form_is_the_same_curve(tire in tires()) {
            let again = MagicFormula::from_stiffness(tire.normalized_stiffness(), tire.c, tire.d, tire.e);
            approx::assert_relative_eq!(again.b, tire.b, max_relative = 1e-12);
        }
    }
}
