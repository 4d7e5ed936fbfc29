//! Brush tire with elliptic contact pressure, load-dependent stiffness and friction, and friction that falls with sliding.
//!
//! ```text
//! linear forces   l_x = C_x s_x,  l_y = C_y s_y,   s_x = kappa/(1+kappa),  s_y = tan(alpha)/(1 + k kappa)
//! saturation      s   = (pi/4) |(l_x, l_y)| / (n mu F_z)
//! force           F   = n mu F_z g(s) (l_x, l_y)/|(l_x, l_y)|
//! shape           g   = 2/pi (atan s + s/(1 + s^2)) (1 - (1 - q) s^2/(s^2 + s_s^2))
//! load            C   = c F_z (1 - e_c (F_z/F_z0 - 1)),   mu = mu_road grip (1 - e (F_z/F_z0 - 1))
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | kappa, alpha | longitudinal slip, slip angle (positive gives a force to the left) | -, rad |
//! | c | stiffness over load | 1/rad, 1 |
//! | mu | peak friction at this load; n makes the peak of g equal one | - |
//! | q, s_s | sliding friction over the peak's, and where the fall happens | - |
//! | e, e_c | load sensitivity of friction and of stiffness | - |
//! | k | coupling of the two directions: 0 none, 1 the whole brush | - |
//!
//! The first factor of g is the exact force of bristles whose stress grows linearly from the leading edge and is cut off
//! by friction under Hertz's elliptic pressure `p = p_0 sqrt(1 - x^2)`: they stick up to `x = (1 - s^2)/(1 + s^2)`.
//! (The parabolic pressure of the textbook brush gives a force with a `|alpha| alpha` term instead.) The second factor
//! stands in for friction that falls with the sliding speed.
//! Not implemented: aligning moment on the body, turn slip, width of the contact patch.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_4};

use serde::{Deserialize, Serialize};

/// A tire's parameters, made dimensionless by its load.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TireParameters {
    /// Cornering stiffness over load, 1/rad.
    pub cornering_stiffness_per_rad: f64,
    /// Longitudinal stiffness over load, per unit of slip.
    pub longitudinal_stiffness: f64,
    /// Peak friction over the road's friction.
    pub grip: f64,
    /// Friction at full sliding over the peak.
    pub sliding_share: f64,
}

/// Where the fall of friction is half done, in units of s.
const FALL_SLIP: f64 = 2.0;
/// Smallest share of the nominal friction or stiffness that load sensitivity leaves.
const LEAST_LOAD_FACTOR: f64 = 0.3;
/// Share of the friction's load sensitivity that the stiffness has.
const STIFFNESS_SENSITIVITY_SHARE: f64 = 0.3;

/// One tire as fitted: parameters, nominal load and load sensitivity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tire {
    parameters: TireParameters,
    nominal_load_n: f64,
    load_sensitivity: f64,
    coupling: f64,
    peak_scale: f64,
}

/// What the road asks of a tire.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contact {
    /// Longitudinal slip, positive when driving.
    pub kappa: f64,
    /// Tangent of the slip angle, positive when it pushes left.
    pub tan_alpha: f64,
    /// Normal load, not negative.
    pub load_n: f64,
    /// Friction of the road under this tire.
    pub road_friction: f64,
}

/// Force in the tire's own frame.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct TireForce {
    /// Longitudinal force, forward positive.
    pub f_x_n: f64,
    /// Lateral force, left positive.
    pub f_y_n: f64,
    /// Secant of the longitudinal force over its slip: what the wheel's integrator needs.
    pub f_x_per_slip_n: f64,
}

impl Tire {
    /// A tire at its nominal load. `load_sensitivity` is e and `coupling` k of the module's equations.
    pub fn new(
        parameters: TireParameters,
        nominal_load_n: f64,
        load_sensitivity: f64,
        coupling: f64,
    ) -> Self {
        let peak =
            (1..1000).map(|i| shape(f64::from(i) * 0.01, parameters.sliding_share)).fold(0.0, f64::max);
        Self { parameters, nominal_load_n, load_sensitivity, coupling, peak_scale: 1.0 / peak }
    }

    /// Peak force over load at `load_n` on a road of friction `road_friction`.
    pub fn peak_friction(&self, load_n: f64, road_friction: f64) -> f64 {
        road_friction * self.parameters.grip * self.load_factor(load_n, self.load_sensitivity)
    }

    /// Cornering stiffness at `load_n`, N/rad.
    pub fn cornering_stiffness_n_per_rad(&self, load_n: f64) -> f64 {
        self.parameters.cornering_stiffness_per_rad * load_n * self.stiffness_factor(load_n)
    }

    /// The force for a contact; zero without load.
    pub fn force(&self, contact: Contact) -> TireForce {
        let load_n = contact.load_n;
        if load_n <= 0.0 {
            return TireForce::default();
        }
        let stiffness_factor = self.stiffness_factor(load_n);
        let c_x = self.parameters.longitudinal_stiffness * load_n * stiffness_factor;
        let c_y = self.parameters.cornering_stiffness_per_rad * load_n * stiffness_factor;
        let k = self.coupling;
        let slip = contact.kappa.max(-0.999);
        let l_x = c_x * slip / (1.0 + slip);
        let l_y = c_y * contact.tan_alpha / (1.0 + (k * slip).max(-0.999));
        let limit_n = self.peak_scale * self.peak_friction(load_n, contact.road_friction) * load_n;
        let x_share = self.transmitted(l_x, k * l_y, limit_n);
        let y_share = self.transmitted(l_y, k * l_x, limit_n);
        TireForce { f_x_n: l_x * x_share, f_y_n: l_y * y_share, f_x_per_slip_n: c_x * x_share }
    }

    /// Share of a linear force that the patch transmits while `other` acts across it.
    fn transmitted(&self, own: f64, other: f64, limit_n: f64) -> f64 {
        let total = (own * own + other * other).sqrt();
        let slip = FRAC_PI_4 * total / limit_n;
        if slip < 1e-9 { 1.0 } else { FRAC_PI_4 * shape(slip, self.parameters.sliding_share) / slip }
    }

    fn load_factor(&self, load_n: f64, sensitivity: f64) -> f64 {
        (1.0 - sensitivity * (load_n / self.nominal_load_n - 1.0)).max(LEAST_LOAD_FACTOR)
    }

    fn stiffness_factor(&self, load_n: f64) -> f64 {
        self.load_factor(load_n, STIFFNESS_SENSITIVITY_SHARE * self.load_sensitivity)
    }
}

/// g(s) of the module's equations before its peak is scaled to one.
fn shape(slip: f64, sliding_share: f64) -> f64 {
    let squared = slip * slip;
    let brush = FRAC_2_PI * (slip.atan() + slip / (1.0 + squared));
    brush * (1.0 - (1.0 - sliding_share) * squared / (squared + FALL_SLIP * FALL_SLIP))
}
