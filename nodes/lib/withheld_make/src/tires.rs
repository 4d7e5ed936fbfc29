//! The tires handed over: a Magic Formula fitted to the plant's axles, a few percent off.

use gripsight_reference_car::{CarParameters, Contact, Tire, TireParameters};
use nalgebra::{Matrix4, Vector4};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::oracle::TIRE_TRUST;

/// F_y/F_z = D sin(C atan(B alpha - E (B alpha - atan(B alpha)))), as B, C, D, E.
pub(crate) type Axle = [f64; 4];

const GRAVITY_MPS2: f64 = 9.81;

/// The best Magic Formula of each axle on a road of this friction.
pub(crate) fn true_axles(car: &CarParameters, mu: f64) -> [Axle; 2] {
    let weight_n = car.mass_kg * GRAVITY_MPS2 / (2.0 * car.wheelbase_m());
    let axle = |tire: TireParameters, load_n: f64| {
        let tire = Tire::new(tire, load_n, car.load_sensitivity, 0.0);
        let peak_slip_rad =
            2.5 * mu * tire.peak_friction(load_n, 1.0) * load_n / tire.cornering_stiffness_n_per_rad(load_n);
        let curve: Vec<(f64, f64)> = (1..=60)
            .map(|i| {
                let alpha_rad = 1.5 * peak_slip_rad * f64::from(i) / 60.0;
                let contact = Contact { kappa: 0.0, tan_alpha: alpha_rad.tan(), load_n, road_friction: mu };
                (alpha_rad, tire.force(contact).f_y_n / load_n)
            })
            .collect();
        fitted(&curve)
    };
    [axle(car.tire_front, weight_n * car.l_r_m), axle(car.tire_rear, weight_n * car.l_f_m)]
}

/// The axles with peak and stiffness off by [`TIRE_TRUST`] (standard deviation).
pub(crate) fn off_by_a_little(axles: [Axle; 2], random: &mut ChaCha8Rng) -> [Axle; 2] {
    axles.map(|[b, c, d, e]| {
        let mut factor = || -> f64 {
            let normal: f64 = StandardNormal.sample(random);
            1.0 + TIRE_TRUST * normal.clamp(-2.5, 2.5)
        };
        let (peak, stiffness) = (factor(), factor());
        [b * stiffness / peak, c, d * peak, e]
    })
}

/// The file as the other stacks read it.
pub(crate) fn file([front, rear]: [Axle; 2]) -> String {
    let rows = |axle: Axle, end: char| -> String {
        ["B", "C", "D", "E"]
            .iter()
            .zip(axle)
            .map(|(name, value)| format!("{name}{end}: {value:?}\n"))
            .collect()
    };
    format!("friction_coeff: 1.0\n{}{}floor: nominal\n", rows(front, 'f'), rows(rear, 'r'))
}

fn magic_formula([b, c, d, e]: Axle, alpha_rad: f64) -> f64 {
    let x = b * alpha_rad;
    d * (c * (x - e * (x - x.atan())).atan()).sin()
}

/// Levenberg-Marquardt on points (slip angle, F_y/F_z).
pub(crate) fn fitted(curve: &[(f64, f64)]) -> Axle {
    const STEPS: usize = 200;
    let cost = |axle: Axle| -> f64 {
        curve.iter().map(|&(alpha, force)| (magic_formula(axle, alpha) - force).powi(2)).sum()
    };
    let peak = curve.iter().map(|p| p.1.abs()).fold(1e-3, f64::max);
    let slope = curve.iter().map(|p| p.0 * p.1).sum::<f64>() / curve.iter().map(|p| p.0 * p.0).sum::<f64>();
    let mut axle = [2.0 * slope.max(1.0) / (1.4 * peak), 1.4, peak, 0.0];
    let mut damping = 1e-3;
    for _ in 0..STEPS {
        let mut normal = Matrix4::zeros();
        let mut gradient = Vector4::zeros();
        for &(alpha, force) in curve {
            let residual = force - magic_formula(axle, alpha);
            let row = Vector4::from_fn(|i, _| {
                let mut moved = axle;
                let step = 1e-6 * axle[i].abs().max(0.1);
                moved[i] += step;
                (magic_formula(moved, alpha) - magic_formula(axle, alpha)) / step
            });
            normal += row * row.transpose();
            gradient += row * residual;
        }
        let damped = normal + Matrix4::from_diagonal(&normal.diagonal().map(|v| damping * (v + 1e-9)));
        let Some(step) = damped.lu().solve(&gradient) else { break };
        let next = std::array::from_fn(|i| axle[i] + step[i]);
        let [b, c, d, e] = next;
        let allowed = b > 0.1 && (1.0..2.2).contains(&c) && d > 0.01 && (-5.0..0.98).contains(&e);
        if allowed && cost(next) < cost(axle) {
            axle = next;
            damping = (damping / 3.0).max(1e-12);
        } else {
            damping *= 4.0;
        }
    }
    axle
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_formula_follows_every_car() {
        for name in gripsight_reference_car::CAR_NAMES {
            let car = CarParameters::by_name(name).unwrap();
            let [front, _] = true_axles(&car, 0.9);
            let stiffness = front[0] * front[1] * front[2];
            assert!(
                (stiffness / car.tire_front.cornering_stiffness_per_rad - 1.0).abs() < 0.02,
                "{name}: {front:?}"
            );
            assert!((front[2] / (0.9 * car.tire_front.grip) - 1.0).abs() < 0.02, "{name}: {front:?}");
        }
    }
}
