//! Numbers that the equations are written for: `f64`, and dual numbers that carry derivatives along.
//!
//! A dual number holds a value and its derivatives by N quantities; every operation follows the chain rule, so that a simulation with dual
//! numbers gives its exact derivatives. `num-dual` does the same and is what the tests compare with; here the rollouts of the fits
//! spend most of their time, and two things make them several times faster: derivatives lie in the number itself, and a function whose
//! derivatives are known, such as the Magic Formula, is one operation ([`Real::chain`]) instead of one for each of its terms.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A number that the model can be evaluated with: `f64`, or a [`Dual`] carrying derivatives.
pub trait Real:
    Copy
    + Debug
    + Send
    + Sync
    + From<f64>
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + AddAssign<f64>
    + SubAssign<f64>
{
    /// The value.
    fn re(&self) -> f64;

    /// A function with known derivatives: its value, and for each of its arguments the derivative by it.
    fn chain<const K: usize>(value: f64, arguments: [(f64, &Self); K]) -> Self;

    /// A sum of numbers, each times a constant.
    #[inline]
    fn weighted<const K: usize>(terms: [(f64, &Self); K]) -> Self {
        let value = terms.iter().map(|(factor, term)| factor * term.re()).sum();
        Self::chain(value, terms)
    }

    /// 1/x.
    #[inline]
    fn recip(self) -> Self {
        let value = self.re().recip();
        Self::chain(value, [(-value * value, &self)])
    }

    /// The square root.
    #[inline]
    fn sqrt(self) -> Self {
        let value = self.re().sqrt();
        Self::chain(value, [(0.5 / value, &self)])
    }

    /// The exponential function.
    #[inline]
    fn exp(self) -> Self {
        let value = self.re().exp();
        Self::chain(value, [(value, &self)])
    }

    /// The sine.
    #[inline]
    fn sin(self) -> Self {
        self.sin_cos().0
    }

    /// The cosine.
    #[inline]
    fn cos(self) -> Self {
        self.sin_cos().1
    }

    /// Sine and cosine.
    #[inline]
    fn sin_cos(self) -> (Self, Self) {
        let (sin, cos) = self.re().sin_cos();
        (Self::chain(sin, [(cos, &self)]), Self::chain(cos, [(-sin, &self)]))
    }

    /// The tangent.
    #[inline]
    fn tan(self) -> Self {
        let value = self.re().tan();
        Self::chain(value, [(1.0 + value * value, &self)])
    }

    /// The inverse of the tangent.
    #[inline]
    fn atan(self) -> Self {
        let x = self.re();
        Self::chain(x.atan(), [(1.0 / (1.0 + x * x), &self)])
    }

    /// The hyperbolic tangent.
    #[inline]
    fn tanh(self) -> Self {
        let value = self.re().tanh();
        Self::chain(value, [(1.0 - value * value, &self)])
    }
}

impl Real for f64 {
    #[inline]
    fn re(&self) -> f64 {
        *self
    }

    #[inline]
    fn chain<const K: usize>(value: f64, _: [(f64, &Self); K]) -> Self {
        value
    }
}

/// A value and its derivatives by N quantities.
// Aligned to vector registers: loads that straddle two lines of the cache cost a seventh of a rollout's time.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub struct Dual<const N: usize> {
    derivatives: [f64; N],
    re: f64,
    /// Whether any derivative may differ from zero: most of a model is constant.
    varies: bool,
}

impl<const N: usize> Dual<N> {
    /// The quantity number `lane` itself: its derivative is 1 by itself, 0 by all others. A constant where there is no such lane.
    #[must_use]
    pub fn variable(value: f64, lane: usize) -> Self {
        let mut derivatives = [0.0; N];
        let slot = derivatives.get_mut(lane);
        let varies = slot.is_some();
        slot.into_iter().for_each(|d| *d = 1.0);
        Self { re: value, derivatives, varies }
    }

    /// The derivatives.
    #[must_use]
    pub fn derivatives(&self) -> &[f64; N] {
        &self.derivatives
    }

    /// Derivatives of a function of two numbers, of which this is the first, from those by each. Those by a constant may be infinite.
    #[inline]
    fn combine(&mut self, by_self: f64, by_other: f64, other: &Self) {
        let pairs = self.derivatives.iter_mut().zip(&other.derivatives);
        match (self.varies, other.varies) {
            (true, true) => pairs.for_each(|(d, o)| *d = by_self * *d + by_other * o),
            (true, false) => pairs.for_each(|(d, _)| *d *= by_self),
            (false, true) => pairs.for_each(|(d, o)| *d = by_other * o),
            (false, false) => {}
        }
        self.varies |= other.varies;
    }
}

impl<const N: usize> From<f64> for Dual<N> {
    #[inline]
    fn from(re: f64) -> Self {
        Self { re, derivatives: [0.0; N], varies: false }
    }
}

impl<const N: usize> Real for Dual<N> {
    #[inline]
    fn re(&self) -> f64 {
        self.re
    }

    #[inline]
    fn chain<const K: usize>(value: f64, arguments: [(f64, &Self); K]) -> Self {
        let mut out = Self::from(value);
        out.varies = arguments.iter().any(|(_, argument)| argument.varies);
        if out.varies {
            // The factor of a constant may be infinite.
            let factors = arguments.map(|(factor, argument)| if argument.varies { factor } else { 0.0 });
            for lane in 0..N {
                let mut sum = 0.0;
                for k in 0..K {
                    sum += factors[k] * arguments[k].1.derivatives[lane];
                }
                out.derivatives[lane] = sum;
            }
        }
        out
    }
}

impl<const N: usize> Neg for Dual<N> {
    type Output = Self;

    #[inline]
    fn neg(mut self) -> Self {
        self.re = -self.re;
        self.derivatives.iter_mut().for_each(|d| *d = -*d);
        self
    }
}

impl<const N: usize> Add for Dual<N> {
    type Output = Self;

    #[inline]
    fn add(mut self, other: Self) -> Self {
        self += other;
        self
    }
}

impl<const N: usize> Sub for Dual<N> {
    type Output = Self;

    #[inline]
    fn sub(mut self, other: Self) -> Self {
        self -= other;
        self
    }
}

impl<const N: usize> Mul for Dual<N> {
    type Output = Self;

    #[inline]
    fn mul(mut self, other: Self) -> Self {
        self *= other;
        self
    }
}

impl<const N: usize> Div for Dual<N> {
    type Output = Self;

    #[inline]
    fn div(mut self, other: Self) -> Self {
        let value = self.re / other.re;
        self.combine(1.0 / other.re, -value / other.re, &other);
        self.re = value;
        self
    }
}

impl<const N: usize> Add<f64> for Dual<N> {
    type Output = Self;

    #[inline]
    fn add(mut self, other: f64) -> Self {
        self.re += other;
        self
    }
}

impl<const N: usize> Sub<f64> for Dual<N> {
    type Output = Self;

    #[inline]
    fn sub(mut self, other: f64) -> Self {
        self.re -= other;
        self
    }
}

impl<const N: usize> Mul<f64> for Dual<N> {
    type Output = Self;

    #[inline]
    fn mul(mut self, factor: f64) -> Self {
        self.re *= factor;
        if self.varies {
            self.derivatives.iter_mut().for_each(|d| *d *= factor);
        }
        self
    }
}

impl<const N: usize> Div<f64> for Dual<N> {
    type Output = Self;

    #[inline]
    fn div(mut self, divisor: f64) -> Self {
        self.re /= divisor;
        if self.varies {
            let factor = 1.0 / divisor;
            self.derivatives.iter_mut().for_each(|d| *d *= factor);
        }
        self
    }
}

impl<const N: usize> AddAssign for Dual<N> {
    #[inline]
    fn add_assign(&mut self, other: Self) {
        self.re += other.re;
        if other.varies {
            self.varies = true;
            self.derivatives.iter_mut().zip(&other.derivatives).for_each(|(d, o)| *d += o);
        }
    }
}

impl<const N: usize> SubAssign for Dual<N> {
    #[inline]
    fn sub_assign(&mut self, other: Self) {
        self.re -= other.re;
        if other.varies {
            self.varies = true;
            self.derivatives.iter_mut().zip(&other.derivatives).for_each(|(d, o)| *d -= o);
        }
    }
}

impl<const N: usize> MulAssign for Dual<N> {
    #[inline]
    fn mul_assign(&mut self, other: Self) {
        self.combine(other.re, self.re, &other);
        self.re *= other.re;
    }
}

impl<const N: usize> AddAssign<f64> for Dual<N> {
    #[inline]
    fn add_assign(&mut self, other: f64) {
        self.re += other;
    }
}

impl<const N: usize> SubAssign<f64> for Dual<N> {
    #[inline]
    fn sub_assign(&mut self, other: f64) {
        self.re -= other;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num_dual::{DualNum, DualVec64};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn agrees_with_num_dual(x in -2.0..2.0, y in 0.1..3.0) {
            let ours = |x: Dual<2>, y: Dual<2>| {
                let (sin, cos) = (x * y).sin_cos();
                let mut z = (x / y).atan() * sin - (cos + 2.0) / y.sqrt() + (-x).exp() * 0.3;
                z += x.tanh();
                z -= (x * 0.1).tan() / 4.0 - 1.5;
                z * y.recip() + x.sin() * y.cos()
            };
            let found = ours(Dual::variable(x, 0), Dual::variable(y, 1));
            let (_, derivatives) = num_dual::gradient(
                |v| {
                    let (x, y): (DualVec64<nalgebra::U2>, DualVec64<nalgebra::U2>) = (v[0], v[1]);
                    let (sin, cos) = (x * y).sin_cos();
                    let z = (x / y).atan() * sin - (cos + 2.0) / y.sqrt() + (-x).exp() * 0.3 + x.tanh()
                        - ((x * 0.1).tan() / 4.0 - 1.5);
                    z * y.recip() + x.sin() * y.cos()
                },
                &nalgebra::SVector::<f64, 2>::new(x, y),
            );
            for lane in 0..2 {
                approx::assert_relative_eq!(
                    found.derivatives()[lane], derivatives[lane], epsilon = 1e-12, max_relative = 1e-10);
            }
        }
    }
}
