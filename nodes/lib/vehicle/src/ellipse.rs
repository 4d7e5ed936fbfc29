//! What an axle has left for the side while it drives or brakes the car.
//!
//! ```text
//! along    a = share a_x m/m_axle             over the mass that it carries at rest
//! load     g = 1 -+ m a_x h/(L F_z)           over that at rest: less in front while the car gains speed
//! lateral  g sqrt(1 - (a/(g mu g_0))^2)       friction ellipse
//! ```

use crate::VehicleParameters;

/// Share that is always left: beyond the ellipse nothing is known.
const LEAST: f64 = 0.1;

/// An axle beside an acceleration of the car.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AxleEllipse {
    /// What drives it, over the mass that it carries at rest, m/s2; negative: brakes.
    pub along_mps2: f64,
    /// Load over that at rest.
    pub load: f64,
    /// Largest lateral force over that at rest without drive.
    pub lateral: f64,
}

impl VehicleParameters {
    /// Both axles, front and rear, beside an acceleration `a_x_mps2` of the car on tires that give `grip_mps2` at most.
    #[must_use]
    pub fn friction_ellipse(&self, a_x_mps2: f64, grip_mps2: f64) -> [AxleEllipse; 2] {
        let front = if a_x_mps2 > 0.0 { self.front_drive_share() } else { self.front_brake_share() };
        let moved_n = self.mass_kg * a_x_mps2 * self.h_cg_m / self.wheelbase_m();
        let axle = |share: f64, load_n: f64, gained_n: f64| {
            let along_mps2 = share * a_x_mps2 * self.mass_kg / (load_n / crate::GRAVITY_MPS2);
            let load = (1.0 + gained_n / load_n).max(LEAST);
            let used = along_mps2 / (load * grip_mps2);
            AxleEllipse { along_mps2, load, lateral: load * (1.0 - used * used).max(LEAST).sqrt() }
        };
        [
            axle(front, self.static_load_front_n(), -moved_n),
            axle(1.0 - front, self.static_load_rear_n(), moved_n),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GRAVITY_MPS2;

    #[test]
    fn a_rear_driven_car_gaining_speed_has_less_left_behind_for_the_drive_and_more_for_the_load() {
        let car = VehicleParameters { drive_front_share: Some(0.0), ..VehicleParameters::f1tenth() };
        let [front, rear] = car.friction_ellipse(2.0, 8.0);
        assert_eq!(front.along_mps2, 0.0);
        assert!(front.load < 1.0 && rear.load > 1.0);
        approx::assert_relative_eq!(front.lateral, front.load);
        // By hand: the rear axle carries l_f/L of the mass and drives all of it.
        let along = 2.0 * car.wheelbase_m() / car.l_f_m;
        let load = 1.0 + 2.0 * car.h_cg_m / (GRAVITY_MPS2 * car.l_f_m);
        approx::assert_relative_eq!(rear.along_mps2, along, max_relative = 1e-12);
        approx::assert_relative_eq!(rear.load, load, max_relative = 1e-12);
        approx::assert_relative_eq!(
            rear.lateral,
            load * (1.0 - (along / (8.0 * load)).powi(2)).sqrt(),
            max_relative = 1e-12
        );
    }

    #[test]
    fn without_drive_nothing_is_lost_and_beyond_the_ellipse_something_is_left() {
        let car = VehicleParameters::f1tenth();
        for axle in car.friction_ellipse(0.0, 8.0) {
            assert_eq!((axle.along_mps2, axle.load, axle.lateral), (0.0, 1.0, 1.0));
        }
        for axle in car.friction_ellipse(-30.0, 8.0) {
            assert!(axle.lateral > 0.0 && axle.load > 0.0);
        }
    }
}
