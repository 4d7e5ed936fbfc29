//! The steering table against the two-dimensional one that other stacks read.

use gripsight_driving::SteeringTable;
use gripsight_identification::export::SteeringLookup;
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};

#[test]
fn the_slip_table_is_the_inverse_of_the_exported_lookup_table() {
    let vehicle = VehicleParameters::f1tenth();
    let tires = PacejkaParameters::from_array([7.0, 1.6, 0.9, 0.1, 9.0, 1.5, 0.95, -0.2]);
    let table = SteeringTable::new(&vehicle, &tires);
    let lookup = SteeringLookup::new(&vehicle, &tires, 0.0);
    let mut compared = 0;
    for (row, &angle_rad) in lookup.steering_rad.iter().enumerate().skip(1) {
        for (column, &v_mps) in lookup.speed_mps.iter().enumerate() {
            let a = lookup.lateral_acceleration_mps2[row][column];
            if a.is_nan() || a > 0.9 * table.most_mps2() {
                continue;
            }
            let back_rad = table.steering_rad(a, v_mps);
            approx::assert_abs_diff_eq!(back_rad, angle_rad, epsilon = 2e-3);
            assert_eq!(table.steering_rad(-a, v_mps), -back_rad);
            compared += 1;
        }
    }
    assert!(compared > 500, "only {compared} cells");
}

#[test]
fn beyond_the_peak_the_angle_stays_that_of_the_largest_force() {
    let tires = PacejkaParameters::from_array([7.0, 1.6, 0.9, 0.1, 9.0, 1.5, 0.95, -0.2]);
    let table = SteeringTable::new(&VehicleParameters::f1tenth(), &tires);
    let most = table.most_mps2();
    assert_eq!(table.slips_rad(most), table.slips_rad(2.0 * most));
    assert!(table.slips_rad(0.5 * most).0 < table.slips_rad(most).0);
}
