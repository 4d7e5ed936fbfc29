//! The parameters of an Open-Car-Dynamics vehicle, by the names that its models declare: single track, MF_SIMPLE tires, first-order steering.

use gripsight_model::OutsideTerm;
use serde_json::{Map, Value};

use super::Figures;

/// What it has a term for, beside the car's figures.
pub(super) const TERMS: [OutsideTerm; 3] =
    [OutsideTerm::SteeringLag, OutsideTerm::SteeringRateLimit, OutsideTerm::SteeringOffset];

/// Steering that is there at once, and as fast as it likes.
const AT_ONCE_S: f64 = 0.001;
const RATE_RADPS: f64 = 100.0;

pub(super) fn files(f: &Figures) -> Vec<(String, String)> {
    let mut all = Map::new();
    let mut put = |name: String, value: f64| {
        all.insert(name, Value::from(value));
    };
    for (name, value) in [
        ("mass_vehicle_kg", f.mass_kg),
        ("moment_of_inertia_kgpm2.z", f.yaw_inertia_kgm2),
        ("wheelbase_m", f.l_f_m + f.l_r_m),
        ("cog.distance_from_front_axle_m", f.l_f_m),
        ("tire.rolling_radius_m.front", f.wheel_radius_m),
        ("tire.rolling_radius_m.rear", f.wheel_radius_m),
        ("tire.rolling_resistance_coefficient", 0.0),
    ] {
        put(format!("vehicle_dynamics_single_track.{name}"), value);
    }
    for (wheel, tire) in [
        ("front_left", &f.tires.front),
        ("front_right", &f.tires.front),
        ("rear_left", &f.tires.rear),
        ("rear_right", &f.tires.rear),
    ] {
        for (name, value) in [("B", tire.b), ("C", tire.c), ("D", tire.d), ("E", tire.e)] {
            put(format!("vehicle_dynamics_single_track.z.tire_model.{wheel}.lateral.{name}"), value);
        }
    }
    for (name, value) in [
        ("T_PT1", f.lag.map_or(AT_ONCE_S, |[tau_s, _]| tau_s)),
        ("angle_max_rad", f.max_steering_rad),
        ("angle_rate_max_radps", f.rate_radps.unwrap_or(RATE_RADPS)),
        ("static_offset_rad", f.steering_offset_rad),
    ] {
        put(format!("steering_actuator.{name}"), value);
    }
    let text = serde_json::to_string_pretty(&Value::Object(all)).unwrap_or_default() + "\n";
    vec![(String::new(), text)]
}
