//! What a diagnosis names, as the driver takes it: tried on the last lap first.

use gripsight_driving::{Driver, Named, Trial};
use gripsight_msgs::ExtendedModel;

/// What became of a message.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Tried {
    /// Driven with from now on.
    Taken(String),
    /// Not driven with, and why.
    Refused(String),
    /// It names nothing that a controller has a use for.
    Nothing,
}

/// Hands the named effects to the driver.
pub(crate) fn take(driver: &mut Driver, message: &ExtendedModel, vehicle_hash: &str) -> Tried {
    if message.handshake.vehicle_hash != vehicle_hash {
        return Tried::Refused("of a car with other parameters".to_owned());
    }
    let mut named = Named::default();
    let used: Vec<&str> = message
        .effects
        .iter()
        .filter(|effect| {
            let value = |name: &str| {
                let parameter = effect.parameters.iter().find(|p| p.name == name);
                parameter.map(|p| p.estimate.value)
            };
            effect.accepted && named.take_in(&effect.name, value)
        })
        .map(|effect| effect.name.as_str())
        .collect();
    if named == *driver.named() {
        return Tried::Nothing;
    }
    let names = if used.is_empty() { "no effect".to_owned() } else { used.join(", ") };
    match driver.take_named(named) {
        None => Tried::Refused(format!(
            "{names}: less than a lap to try it on, figures that no car has, or given back before"
        )),
        Some(trial) if trial.taken => Tried::Taken(said(&names, &trial)),
        Some(trial) => Tried::Refused(said(&names, &trial)),
    }
}

fn said(names: &str, trial: &Trial) -> String {
    let [v_y, yaw_rate] = [trial.v_y_mps, trial.yaw_rate_radps];
    let later = trial.later_s.map(|by_s| format!("; a steering {:.0} ms later would do better", 1e3 * by_s));
    format!(
        "{names}: over {:.1} s it predicts v_y to {:.4} m/s and yaw rate to {:.4} rad/s, the model in use to {:.4} and {:.4}{}",
        trial.driven_s,
        v_y[1],
        yaw_rate[1],
        v_y[0],
        yaw_rate[0],
        later.unwrap_or_default()
    )
}

#[cfg(test)]
mod tests {
    use gripsight_driving::{CarState, Drivetrain, Longitudinal, Settings, TireSet, Track};
    use gripsight_msgs::{GapEffect, GapParameter, Interval};
    use gripsight_vehicle::VehicleParameters;

    use super::*;

    fn message(name: &str, parameter: &str, value: f64) -> ExtendedModel {
        let estimate = Interval { value, low: value, high: value };
        let parameters = vec![GapParameter { name: parameter.to_owned(), estimate, unit: String::new() }];
        let effect = GapEffect { name: name.to_owned(), accepted: true, parameters, ..GapEffect::default() };
        let mut message = ExtendedModel { effects: vec![effect], ..ExtendedModel::default() };
        message.handshake.vehicle_hash = "a".to_owned();
        message
    }

    #[test]
    fn a_model_is_refused_until_there_is_a_lap_and_where_it_is_wrong() {
        let circle = (0..60).map(|k| {
            let p = f64::from(k) * std::f64::consts::TAU / 60.0;
            [10.0 * p.cos(), 10.0 * p.sin(), 0.5, 0.5]
        });
        let track = Track::from_points(&circle.collect::<Vec<_>>()).unwrap();
        let drivetrain = Drivetrain {
            drive_mps2: 5.0,
            brake_mps2: 5.0,
            power_w_per_kg: 1e6,
            top_speed_mps: 7.0,
            told: Longitudinal::UNKNOWN,
        };
        let vehicle = VehicleParameters::f1tenth();
        let (start, settings) = (TireSet::start(), Settings::default());
        let mut driver = Driver::new(vehicle, drivetrain, track, start, settings).unwrap();
        let bias = message("v_y_bias", "bias_mps", 0.5);
        let refused = |tried: Tried, part: &str| {
            let Tried::Refused(why) = tried else { panic!("{tried:?}") };
            assert!(why.contains(part), "{why}");
        };
        refused(take(&mut driver, &bias, "b"), "other parameters");
        refused(take(&mut driver, &bias, "a"), "less than a lap");
        for k in 0..1000 {
            let stamp_s = f64::from(k) * 0.01;
            let (sin, cos) = (0.3 * stamp_s).sin_cos();
            let (x_m, y_m, heading_rad) = (10.0 * cos, 10.0 * sin, 0.3 * stamp_s + 1.57);
            let (v_x_mps, v_y_mps, yaw_rate_radps) = (3.0, 0.0, 0.3);
            let car = CarState { stamp_s, x_m, y_m, heading_rad, v_x_mps, v_y_mps, yaw_rate_radps };
            driver.command(&car, stamp_s);
        }
        refused(take(&mut driver, &bias, "a"), "v_y_bias: over 10.0 s it predicts v_y to");
        assert_eq!(take(&mut driver, &message("aero_downforce", "c_f", 1.0), "a"), Tried::Nothing);
    }
}
