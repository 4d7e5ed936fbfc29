//! Numbers of the linear single-track model that an engineer knows.

use nalgebra::Matrix2;

use crate::{PacejkaParameters, VehicleParameters};

/// Cornering stiffness of the front and the rear axle, B C D F_z, in N/rad.
#[must_use]
pub fn cornering_stiffness_n_per_rad(vehicle: &VehicleParameters, tires: &PacejkaParameters) -> (f64, f64) {
    (
        tires.front.normalized_stiffness() * vehicle.static_load_front_n(),
        tires.rear.normalized_stiffness() * vehicle.static_load_rear_n(),
    )
}

/// Understeer gradient d(steering)/d(a_y), rad per m/s2: m/L (l_r/K_f - l_f/K_r). Positive: understeer.
#[must_use]
pub fn understeer_gradient_rad_per_mps2(vehicle: &VehicleParameters, tires: &PacejkaParameters) -> f64 {
    let (front, rear) = cornering_stiffness_n_per_rad(vehicle, tires);
    vehicle.mass_kg / vehicle.wheelbase_m() * (vehicle.l_r_m / front - vehicle.l_f_m / rear)
}

/// Largest real part of the eigenvalues of the straight-running car at a speed, 1/s: negative means stable.
#[must_use]
pub fn straight_line_growth_rate_1ps(
    vehicle: &VehicleParameters,
    tires: &PacejkaParameters,
    v_x_mps: f64,
) -> f64 {
    let (k_f, k_r) = cornering_stiffness_n_per_rad(vehicle, tires);
    let (m, i_z, l_f, l_r) = (vehicle.mass_kg, vehicle.yaw_inertia_kgm2, vehicle.l_f_m, vehicle.l_r_m);
    let system = Matrix2::new(
        -(k_f + k_r) / (m * v_x_mps),
        -v_x_mps - (k_f * l_f - k_r * l_r) / (m * v_x_mps),
        -(k_f * l_f - k_r * l_r) / (i_z * v_x_mps),
        -(k_f * l_f * l_f + k_r * l_r * l_r) / (i_z * v_x_mps),
    );
    system.complex_eigenvalues().iter().map(|e| e.re).fold(f64::NEG_INFINITY, f64::max)
}

/// Speed above which an oversteering car is unstable; `None` for a car that understeers.
#[must_use]
pub fn critical_speed_mps(vehicle: &VehicleParameters, tires: &PacejkaParameters) -> Option<f64> {
    let gradient = understeer_gradient_rad_per_mps2(vehicle, tires);
    (gradient < 0.0).then(|| (-vehicle.wheelbase_m() / gradient).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_oversteering_car_is_unstable_above_its_critical_speed() {
        let car = VehicleParameters::f1tenth();
        let tires = PacejkaParameters::from_array([9.0, 1.5, 1.0, 0.0, 5.0, 1.5, 1.0, 0.0]);
        let v_mps = critical_speed_mps(&car, &tires).unwrap();
        assert!(straight_line_growth_rate_1ps(&car, &tires, 0.98 * v_mps) < 0.0);
        assert!(straight_line_growth_rate_1ps(&car, &tires, 1.02 * v_mps) > 0.0);
        let understeer = PacejkaParameters::from_array([5.0, 1.5, 1.0, 0.0, 9.0, 1.5, 1.0, 0.0]);
        assert_eq!(critical_speed_mps(&car, &understeer), None);
        assert!(straight_line_growth_rate_1ps(&car, &understeer, 30.0) < 0.0);
    }
}
