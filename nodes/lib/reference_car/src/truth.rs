//! The truth as a table: one row per odometry stamp, units in the names.

use std::io::Write;

use crate::error::ReferenceCarError;
use crate::motion::TruthSample;

const WHEELS: [&str; 4] = ["fl", "fr", "rl", "rr"];

/// The column names of the truth table, in order.
pub fn truth_columns() -> Vec<String> {
    let mut names: Vec<String> = [
        "stamp_s",
        "x_m",
        "y_m",
        "heading_rad",
        "v_x_mps",
        "v_y_mps",
        "yaw_rate_radps",
        "yaw_acceleration_radps2",
        "specific_x_mps2",
        "specific_y_mps2",
        "roll_rad",
        "pitch_rad",
        "steering_front_rad",
        "force_command_n",
        "station_m",
        "offset_m",
        "bank_rad",
        "slope_rad",
        "f_x_front_n",
        "f_y_front_n",
        "f_z_front_n",
        "f_x_rear_n",
        "f_y_rear_n",
        "f_z_rear_n",
    ]
    .map(str::to_owned)
    .to_vec();
    for wheel in WHEELS {
        for quantity in
            ["f_x_n", "f_y_n", "f_z_n", "slip_angle_rad", "slip_ratio", "road_friction", "speed_radps"]
        {
            let (stem, unit) = quantity.rsplit_once('_').unwrap_or((quantity, ""));
            names.push(match quantity {
                "slip_ratio" | "road_friction" => format!("{quantity}_{wheel}"),
                _ => format!("{stem}_{wheel}_{unit}"),
            });
        }
    }
    names
}

fn row(t: &TruthSample) -> Vec<f64> {
    let m = &t.motion;
    let mut values = vec![
        m.time_s,
        m.x_m,
        m.y_m,
        m.heading_rad,
        m.v_x_mps,
        m.v_y_mps,
        m.yaw_rate_radps,
        m.yaw_acceleration_radps2,
        m.specific_x_mps2,
        m.specific_y_mps2,
        m.roll_rad,
        m.pitch_rad,
        m.steering_rad,
        t.force_command_n,
        t.station_m,
        t.offset_m,
        t.bank_rad,
        t.slope_rad,
    ];
    values.extend(t.front_axle_n());
    values.extend(t.rear_axle_n());
    for (wheel, speed_radps) in t.wheels.iter().zip(m.wheel_radps) {
        values.extend([
            wheel.f_x_n,
            wheel.f_y_n,
            wheel.f_z_n,
            wheel.slip_angle_rad,
            wheel.slip_ratio,
            wheel.road_friction,
            speed_radps,
        ]);
    }
    values
}

/// Writes the truth as comma-separated values with a header; times are shifted by `start_s`.
///
/// # Errors
/// `Truth` when the writer fails.
pub fn write_truth_csv(
    mut to: impl Write,
    truth: &[TruthSample],
    start_s: f64,
) -> Result<(), ReferenceCarError> {
    writeln!(to, "{}", truth_columns().join(","))?;
    for sample in truth {
        let mut values = row(sample);
        if let Some(time_s) = values.first_mut() {
            *time_s += start_s;
        }
        let cells: Vec<String> = values.iter().map(|v| format!("{v:.6}")).collect();
        writeln!(to, "{}", cells.join(","))?;
    }
    Ok(())
}
