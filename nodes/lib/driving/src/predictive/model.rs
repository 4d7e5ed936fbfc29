//! The single-track model along the line, linear around a predicted motion.
//!
//! ```text
//! x    = (e, p, v_y, w, d)                         offset, heading against the line, lateral velocity, yaw rate, wheels' angle
//! e'   = v_x sin p + v_y cos p
//! p'   = w - k (v_x cos p - v_y sin p)/(1 - k e)   k: curvature of the line
//! v_y' = (F_f cos d + F_r)/m - v_x w + d_y         d_y, d_w: what the model lacks, as the last tenths of a second showed it
//! w'   = (l_f F_f cos d - l_r F_r)/I_z + d_w
//! F_i  = F_zi (n_i(a) + n_i'(a) (alpha_i - a))     a: the slip predicted for axle i, as far as n_i' is a tenth of that at zero
//! ```
//!
//! The tangent is taken below the peak: on its flat top a linear model knows of no way back, on a falling branch it would steer the other way.
//! The slip at which the last tangent reaches the peak's force is therefore the most that has a use.

use gripsight_vehicle::{
    Dual, Input, MagicFormula, PacejkaParameters, Real, SingleTrack, State, VehicleParameters,
};

use crate::TrackPoint;

/// Quantities of the motion.
pub(crate) const STATES: usize = 5;
/// Of them, those with a differential equation of the car: the wheels follow their command.
pub(crate) const MOVES: usize = 4;
/// Slope over that at zero from which tangents are taken.
const STEEP: f64 = 0.1;
/// Largest slip of tires that stay steep.
const END_RAD: f64 = 0.5;
/// Step in which a curve is looked through.
const LOOK_RAD: f64 = 0.002;

/// Offset, heading against the line, lateral velocity, yaw rate, wheels' angle.
pub(crate) type Motion = [f64; STATES];

/// What lies along the line at an instant of the horizon.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Along {
    pub(crate) point: TrackPoint,
    pub(crate) v_x_mps: f64,
}

/// Rates of the motion near a predicted one: `jacobian x + rest`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Linear {
    pub(crate) jacobian: [[f64; STATES]; MOVES],
    pub(crate) rest: [f64; MOVES],
    /// Slip of the front wheels near it: `slip x + slip_rest`.
    pub(crate) slip: [f64; STATES],
    pub(crate) slip_rest_rad: f64,
}

/// The car on its planned tires.
#[derive(Debug, Clone)]
pub(crate) struct PathModel {
    car: SingleTrack<Dual<STATES>>,
    front: Axle,
    rear: Axle,
    mass_kg: f64,
    yaw_inertia_kgm2: f64,
    l_f_m: f64,
    l_r_m: f64,
}

#[derive(Debug, Clone, Copy)]
struct Axle {
    tire: MagicFormula,
    load_n: f64,
    /// Slip up to which tangents are taken, and the one at which the last tangent reaches the peak's force.
    tangent_rad: f64,
    most_rad: f64,
}

impl Axle {
    fn new(tire: MagicFormula, load_n: f64) -> Self {
        let steep = STEEP * tire.normalized_stiffness();
        let slips = || (1..=(END_RAD / LOOK_RAD) as u32).map(|k| f64::from(k) * LOOK_RAD);
        let tangent_rad =
            slips().take_while(|slip| tangent(&tire, *slip).1 > steep).last().unwrap_or(LOOK_RAD);
        let (force, slope) = tangent(&tire, tangent_rad);
        let left = (tire.max_force_within(END_RAD) - force).max(0.0);
        Self { tire, load_n, tangent_rad, most_rad: (tangent_rad + left / slope.max(steep)).min(END_RAD) }
    }

    fn force_n(&self, slip_rad: Dual<STATES>) -> Dual<STATES> {
        let near_rad = slip_rad.re().clamp(-self.tangent_rad, self.tangent_rad);
        let (force, slope) = tangent(&self.tire, near_rad);
        let value = force + slope * (slip_rad.re() - near_rad);
        Dual::chain(self.load_n * value, [(self.load_n * slope, &slip_rad)])
    }
}

/// Normalised force and its slope at a slip.
fn tangent(tire: &MagicFormula, slip_rad: f64) -> (f64, f64) {
    let fixed = |v: f64| Dual::<1>::from(v);
    let tire = MagicFormula { b: fixed(tire.b), c: fixed(tire.c), d: fixed(tire.d), e: fixed(tire.e) };
    let force = tire.normalized_force(Dual::variable(slip_rad, 0));
    (force.re(), force.derivatives()[0])
}

impl PathModel {
    pub(crate) fn new(vehicle: &VehicleParameters, tires: &PacejkaParameters) -> Self {
        let fixed = |t: &MagicFormula| MagicFormula {
            b: Dual::from(t.b),
            c: Dual::from(t.c),
            d: Dual::from(t.d),
            e: Dual::from(t.e),
        };
        let duals = PacejkaParameters { front: fixed(&tires.front), rear: fixed(&tires.rear) };
        Self {
            car: SingleTrack::new(vehicle, &duals),
            front: Axle::new(tires.front, vehicle.static_load_front_n()),
            rear: Axle::new(tires.rear, vehicle.static_load_rear_n()),
            mass_kg: vehicle.mass_kg,
            yaw_inertia_kgm2: vehicle.yaw_inertia_kgm2,
            l_f_m: vehicle.l_f_m,
            l_r_m: vehicle.l_r_m,
        }
    }

    /// Slip of the front wheels beyond which more gives nothing.
    pub(crate) fn most_slip_rad(&self) -> f64 {
        self.front.most_rad
    }

    /// The tangent at a motion; `lacks`: d_y and d_w.
    pub(crate) fn linear(&self, near: &Motion, along: &Along, lacks: [f64; 2]) -> Linear {
        let [e, p, v_y, w, d]: [Dual<STATES>; STATES] =
            std::array::from_fn(|lane| Dual::variable(near[lane], lane));
        let v_x = Dual::from(along.v_x_mps);
        let (sin, cos) = p.sin_cos();
        let curvature = along.point.curvature_1pm;
        // Whoever is beyond the centre of a bend has left the track long ago.
        let nearer = Dual::from(1.0) - e * curvature;
        let nearer = if nearer.re() > 0.2 { nearer } else { Dual::from(0.2) };
        let state = State { v_y_mps: v_y, yaw_rate_radps: w };
        let slips = self.car.slip_angles_rad(&state, &Input { v_x_mps: v_x, steering_rad: d });
        let (front, rear) = (self.front.force_n(slips.0) * d.cos(), self.rear.force_n(slips.1));
        let rates = [
            v_x * sin + v_y * cos,
            w - (v_x * cos - v_y * sin) / nearer * curvature,
            (front + rear) / self.mass_kg - v_x * w + lacks[0],
            (front * self.l_f_m - rear * self.l_r_m) / self.yaw_inertia_kgm2 + lacks[1],
        ];
        let jacobian = rates.map(|rate| *rate.derivatives());
        let rest = std::array::from_fn(|row| {
            let moved: f64 = jacobian[row].iter().zip(near).map(|(slope, x)| slope * x).sum();
            rates[row].re() - moved
        });
        let slip = *slips.0.derivatives();
        let slipped: f64 = slip.iter().zip(near).map(|(slope, x)| slope * x).sum();
        Linear { jacobian, rest, slip, slip_rest_rad: slips.0.re() - slipped }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model() -> (PathModel, VehicleParameters, PacejkaParameters) {
        let vehicle = VehicleParameters::f1tenth();
        let tires = PacejkaParameters::from_array([7.0, 1.6, 0.9, 0.1, 9.0, 1.5, 0.95, -0.2]);
        (PathModel::new(&vehicle, &tires), vehicle, tires)
    }

    fn along(curvature_1pm: f64) -> Along {
        let point =
            TrackPoint { x_m: 0.0, y_m: 0.0, heading_rad: 0.0, curvature_1pm, right_m: 1.0, left_m: 1.0 };
        Along { point, v_x_mps: 4.0 }
    }

    #[test]
    fn the_tangent_touches_the_single_track_model() {
        let (model, vehicle, tires) = model();
        let near: Motion = [0.1, -0.05, 0.1, 1.2, 0.1];
        let linear = model.linear(&near, &along(0.3), [0.0; 2]);
        let at = |x: &Motion| -> [f64; MOVES] {
            std::array::from_fn(|row| {
                linear.rest[row] + linear.jacobian[row].iter().zip(x).map(|(slope, x)| slope * x).sum::<f64>()
            })
        };
        let car = SingleTrack::new(&vehicle, &tires);
        let exact = |x: &Motion| -> [f64; MOVES] {
            let state = State { v_y_mps: x[2], yaw_rate_radps: x[3] };
            let rate = car.derivative(&state, &Input { v_x_mps: 4.0, steering_rad: x[4] });
            let along_mps = 4.0 * x[1].cos() - x[2] * x[1].sin();
            [
                4.0 * x[1].sin() + x[2] * x[1].cos(),
                x[3] - 0.3 * along_mps / (1.0 - 0.3 * x[0]),
                rate.v_y_mps,
                rate.yaw_rate_radps,
            ]
        };
        for lane in 0..STATES {
            for (by, most) in [(0.0, 1e-9), (1e-4, 1e-4)] {
                let mut x = near;
                x[lane] += by;
                for (linear, exact) in at(&x).into_iter().zip(exact(&x)) {
                    assert!((linear - exact).abs() < most, "lane {lane} by {by}: {linear} {exact}");
                }
            }
        }
    }

    #[test]
    fn more_slip_never_gives_less_force() {
        let (model, ..) = model();
        // Far beyond the peak of the front axle.
        let near: Motion = [0.0, 0.0, 0.0, 0.0, 0.6];
        let linear = model.linear(&near, &along(0.0), [0.0; 2]);
        assert!(linear.jacobian[3][4] > 0.0, "{:?}", linear.jacobian[3]);
    }
}
