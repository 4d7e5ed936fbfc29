//! The state, its motion and its Jacobian.

use nalgebra::{SMatrix, SVector};

use crate::levels::Wander;

/// Size of the state.
pub(crate) const N: usize = 20;
pub(crate) type Vector = SVector<f64, N>;
pub(crate) type Matrix = SMatrix<f64, N, N>;

pub(crate) const X: usize = 0;
pub(crate) const Y: usize = 1;
pub(crate) const PSI: usize = 2;
/// How far the localisation has wandered off: position, m, and heading, rad.
pub(crate) const OFF: [usize; 3] = [3, 4, 5];
/// Place, heading and what they are off by.
pub(crate) const PLACE: usize = 6;
pub(crate) const V_X: usize = 6;
pub(crate) const V_Y: usize = 7;
pub(crate) const R: usize = 8;
pub(crate) const A_X: usize = 9;
pub(crate) const A_Y: usize = 10;
pub(crate) const ALPHA: usize = 11;
/// Place, speeds, yaw rate and accelerations: the states before the constants.
pub(crate) const MOTION: usize = 12;
/// Biases of the accelerometers, m/s2, and of the yaw rate, rad/s.
pub(crate) const B_X: usize = 12;
pub(crate) const B_Y: usize = 13;
pub(crate) const B_R: usize = 14;
/// How far ahead of the point of the poses the inertial unit sits, m.
pub(crate) const ARM: usize = 15;
/// Scale of the speed: reported over true, less one.
pub(crate) const SCALE: usize = 16;
/// How much later poses are than their delay was taken to be, s.
pub(crate) const LATE: usize = 17;
/// Scale of the lateral acceleration: reported over true, less one.
pub(crate) const TILT: usize = 18;
/// Scale of the yaw rate: reported over true, less one.
pub(crate) const RATE: usize = 19;

/// Strengths of the white noises that drive a_x, a_y (m2/s5) and alpha (rad2/s5), and how the localisation wanders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Drive {
    pub(crate) a_x: f64,
    pub(crate) a_y: f64,
    pub(crate) alpha: f64,
    pub(crate) position: Wander,
    pub(crate) heading: Wander,
}

impl Drive {
    /// How each of [`OFF`] wanders.
    pub(crate) fn wander(&self) -> [Wander; 3] {
        [self.position, self.position, self.heading]
    }
}

/// The rate of change of the state.
pub(crate) fn rate(s: &Vector) -> Vector {
    let (sin, cos) = s[PSI].sin_cos();
    let mut d = Vector::zeros();
    d[X] = s[V_X] * cos - s[V_Y] * sin;
    d[Y] = s[V_X] * sin + s[V_Y] * cos;
    d[PSI] = s[R];
    d[V_X] = s[A_X] + s[V_Y] * s[R];
    d[V_Y] = s[A_Y] - s[V_X] * s[R];
    d[R] = s[ALPHA];
    // a_y = dv_y/dt + v_x r: what turns the car ever harder is no surprise.
    d[A_Y] = s[V_X] * s[ALPHA] + s[A_X] * s[R];
    d
}

/// Its Jacobian.
pub(crate) fn jacobian(s: &Vector) -> Matrix {
    let (sin, cos) = s[PSI].sin_cos();
    let mut a = Matrix::zeros();
    a[(X, PSI)] = -s[V_X] * sin - s[V_Y] * cos;
    a[(X, V_X)] = cos;
    a[(X, V_Y)] = -sin;
    a[(Y, PSI)] = s[V_X] * cos - s[V_Y] * sin;
    a[(Y, V_X)] = sin;
    a[(Y, V_Y)] = cos;
    a[(PSI, R)] = 1.0;
    a[(V_X, A_X)] = 1.0;
    a[(V_X, V_Y)] = s[R];
    a[(V_X, R)] = s[V_Y];
    a[(V_Y, A_Y)] = 1.0;
    a[(V_Y, V_X)] = -s[R];
    a[(V_Y, R)] = -s[V_X];
    a[(R, ALPHA)] = 1.0;
    a[(A_Y, V_X)] = s[ALPHA];
    a[(A_Y, ALPHA)] = s[V_X];
    a[(A_Y, A_X)] = s[R];
    a[(A_Y, R)] = s[A_X];
    a
}

/// `left` times a matrix that is mostly zeros, as transitions are: an eighth of the work of a full product.
pub(crate) fn times(left: &Matrix, mostly_zeros: &Matrix) -> Matrix {
    let mut product = Matrix::zeros();
    for (mut into, by) in product.column_iter_mut().zip(mostly_zeros.column_iter()) {
        for (column, &share) in left.column_iter().zip(by.iter()).filter(|(_, share)| **share != 0.0) {
            into.axpy(share, &column, 1.0);
        }
    }
    product
}

/// `turn^T symmetric turn` of a `turn` that is mostly zeros.
pub(crate) fn between(symmetric: &Matrix, turn: &Matrix) -> Matrix {
    let product = times(&times(symmetric, turn).transpose(), turn);
    (product + product.transpose()) * 0.5
}

/// State, transition and noise after a step: midpoint rule, transition to second order.
pub(crate) fn step(s: &Vector, dt_s: f64, drive: &Drive) -> (Vector, Matrix, Matrix) {
    let middle = s + rate(s) * (0.5 * dt_s);
    let mut next = s + rate(&middle) * dt_s;
    let a = jacobian(&middle) * dt_s;
    let mut transition = Matrix::identity() + a + times(&a, &a) * 0.5;
    let mut noise = Matrix::zeros();
    // An acceleration that walks makes a speed that walks along: the exact covariance of the pair.
    for (rate, value, strength) in [(A_X, V_X, drive.a_x), (A_Y, V_Y, drive.a_y), (ALPHA, R, drive.alpha)] {
        noise[(rate, rate)] = strength * dt_s;
        noise[(value, value)] = strength * dt_s.powi(3) / 3.0;
        noise[(rate, value)] = strength * dt_s * dt_s / 2.0;
        noise[(value, rate)] = noise[(rate, value)];
    }
    for (place, wander) in OFF.into_iter().zip(drive.wander()) {
        let kept = (-dt_s / wander.time_s).exp();
        next[place] = kept * s[place];
        transition[(place, place)] = kept;
        noise[(place, place)] = wander.sigma.powi(2) * (1.0 - kept * kept);
    }
    (next, transition, noise)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STILL: Wander = Wander { sigma: 0.0, time_s: 0.5 };

    #[test]
    fn the_transition_is_the_derivative_of_the_step() {
        let mut s = Vector::from_fn(|i, _| 0.3 + 0.17 * i as f64);
        s[V_X] = 5.0;
        let drive = Drive { a_x: 1.0, a_y: 1.0, alpha: 1.0, position: STILL, heading: STILL };
        let (_, transition, _) = step(&s, 0.01, &drive);
        for j in 0..N {
            let mut up = s;
            let mut down = s;
            up[j] += 1e-6;
            down[j] -= 1e-6;
            let slope = (step(&up, 0.01, &drive).0 - step(&down, 0.01, &drive).0) / 2e-6;
            for i in 0..N {
                approx::assert_abs_diff_eq!(slope[i], transition[(i, j)], epsilon = 2e-5);
            }
        }
    }

    #[test]
    fn products_skip_nothing_but_zeros() {
        let a = jacobian(&Vector::from_fn(|i, _| 0.3 + 0.17 * i as f64));
        let full = Matrix::from_fn(|i, j| (i as f64 - 0.7 * j as f64).sin());
        approx::assert_abs_diff_eq!(times(&full, &a), full * a, epsilon = 1e-12);
        let symmetric = full + full.transpose();
        approx::assert_abs_diff_eq!(between(&symmetric, &a), a.transpose() * symmetric * a, epsilon = 1e-12);
    }

    #[test]
    fn a_steady_circle_stays_one() {
        let mut s = Vector::zeros();
        s[V_X] = 4.0;
        s[R] = 1.0;
        s[A_Y] = 4.0;
        for _ in 0..628 {
            s = step(&s, 0.01, &Drive { a_x: 0.0, a_y: 0.0, alpha: 0.0, position: STILL, heading: STILL }).0;
        }
        approx::assert_abs_diff_eq!(s[V_X], 4.0, epsilon = 1e-3);
        approx::assert_abs_diff_eq!(s[V_Y], 0.0, epsilon = 1e-3);
        assert!(s[X].hypot(s[Y]) < 0.03);
    }
}
