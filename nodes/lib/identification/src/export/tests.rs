//! Golden texts, round trips, the table against simulation, and what stays on disk.

use gripsight_vehicle::{Input, PacejkaParameters, SingleTrack, State, VehicleParameters};
use proptest::prelude::*;

use super::*;
use crate::{PerAxle, Status, ValidWithin};

fn tires() -> PacejkaParameters {
    PacejkaParameters::from_array([7.25, 1.5, 0.875, 0.25, 9.0, 1.375, 0.9375, -1e-7])
}

fn provenance() -> Provenance {
    Provenance {
        car: "car".into(),
        bag: "laps.mcap".into(),
        data_stamp_ns: 1_700_000_014_271_000_000,
        tool_version: "0.1.0".into(),
        vehicle_hash: "00ab".into(),
        seed: 7,
        command: "gripsight identify laps.mcap --seed 7\n--out DIR".into(),
        status: Status::AcceptedWithin,
        valid_within: ValidWithin {
            slip_rad: PerAxle { front: 0.125, rear: 0.1 },
            force_n: PerAxle { front: 12.5, rear: 14.25 },
        },
        notes: vec!["the peak was not reached".into()],
    }
}

const MPC: &str = "\
# tires of car, identified by gripsight 0.1.0
# data: 2023-11-14T22:13:34.271Z, laps.mcap
# vehicle hash 00ab, seed 7
# command: gripsight identify laps.mcap --seed 7 --out DIR
# status: accepted_within
# valid within: slip_rad front 0.1250 rear 0.1000, force_n front 12.50 rear 14.25
# note: the peak was not reached
# F_y = friction_coeff * D * F_z * sin(C * atan(B*a - E*(B*a - atan(B*a)))), slip angle a in rad
friction_coeff: 1.0
Bf: 7.25
Cf: 1.5
Df: 0.875
Ef: 0.25
Br: 9.0
Cr: 1.375
Dr: 0.9375
Er: -0.0000001
floor: \"wet \\\"tiles\\\": 3\"
";

const CONTROLLER: &str = "\
# tires of car, identified by gripsight 0.1.0
# data: 2023-11-14T22:13:34.271Z, laps.mcap
# vehicle hash 00ab, seed 7
# command: gripsight identify laps.mcap --seed 7 --out DIR
# status: accepted_within
# valid within: slip_rad front 0.1250 rear 0.1000, force_n front 12.50 rear 14.25
# note: the peak was not reached
C_Pf: [7.25, 1.5, 0.875, 0.25]
C_Pr: [9.0, 1.375, 0.9375, -0.0000001]
I_z: 0.05
h_cg: 0.06
l_f: 0.162
l_r: 0.145
l_wb: 0.307
m: 3.54
model_name: \"car\"
tire_model: pacejka
";

#[test]
fn the_files_are_as_their_readers_expect() {
    assert_eq!(mpc_yaml(&tires(), "wet \"tiles\": 3", &provenance()), MPC);
    assert_eq!(controller_txt(&tires(), &VehicleParameters::f1tenth(), &provenance()), CONTROLLER);
}

/// PyYAML resolves YAML 1.1: a float needs a point, and an exponent a sign.
#[test]
fn limits_are_read_back() {
    assert_eq!(read_valid_within(MPC), Some(provenance().valid_within));
    assert_eq!(read_valid_within("friction_coeff: 1.0"), None);
}

#[test]
fn a_yaml_1_1_reader_sees_floats() {
    let value = |line: &str| line.split_once(": ").map(|(_, v)| v.to_owned()).unwrap();
    for line in MPC.lines().filter(|l| !l.starts_with('#') && !l.starts_with("floor")) {
        let number = value(line);
        assert!(number.contains('.') && !number.contains(['e', 'E']), "{line}");
        number.parse::<f64>().unwrap();
    }
    let broken = PacejkaParameters::from_array([f64::NAN, 1.0, f64::INFINITY, 0.0, 1.0, 1.0, 1.0, 0.0]);
    let text = mpc_yaml(&broken, "x", &provenance());
    assert!(text.contains("Bf: .nan\n") && text.contains("Df: .inf\n"), "{text}");
}

proptest! {
    #[test]
    fn either_tire_file_is_read_back_bit_for_bit(v in proptest::array::uniform8(1e-6..1e6)) {
        let tires = PacejkaParameters::from_array(v);
        let car = VehicleParameters::f1tenth();
        prop_assert_eq!(read_tires(&mpc_yaml(&tires, "floor: 1", &provenance())).unwrap(), tires);
        prop_assert_eq!(read_tires(&controller_txt(&tires, &car, &provenance())).unwrap(), tires);
    }
}

#[test]
fn foreign_tire_files_are_read_or_refused_with_the_reason() {
    let scaled = read_tires(&MPC.replace("friction_coeff: 1.0", "friction_coeff: 0.5")).unwrap();
    assert_eq!((scaled.front.d, scaled.rear.d), (0.4375, 0.46875));
    let richer = format!("C_0d: 0.48\nmu: 1\n{CONTROLLER}");
    assert_eq!(read_tires(&richer).unwrap(), tires());

    let error = |text: &str| read_tires(text).unwrap_err().to_string();
    assert!(error("a: 1\nb: 2\n").contains("a, b"));
    assert!(error(&format!("{MPC}extra: 1\n")).contains("extra"));
    assert!(error(&MPC.replace("Er: -0.0000001\n", "")).contains("Er"));
    assert!(error(&MPC.replace("7.25", "-7.25")).contains("B front is -7.25"));
    assert!(error(&MPC.replace("0.25", ".nan")).contains("line 13"));
    assert!(error("][").starts_with("tire file"));
    assert!(error("").starts_with("tire file"));
}

/// Lateral acceleration after a slow ramp to a steering angle and a wait, by the differential equation itself.
fn settled_mps2(car: &VehicleParameters, tires: &PacejkaParameters, v_mps: f64, steering_rad: f64) -> f64 {
    let model = SingleTrack::new(car, tires);
    let mut x = State { v_y_mps: 0.0, yaw_rate_radps: 0.0 };
    const DT_S: f64 = 2e-3;
    let at = |k: usize| Input { v_x_mps: v_mps, steering_rad: steering_rad * (k as f64 / 5000.0).min(1.0) };
    for k in 0..15_000 {
        x = model.step(x, &at(k), &at(k + 1), DT_S, DT_S);
    }
    v_mps * x.yaw_rate_radps
}

#[test]
fn the_table_is_where_the_simulated_car_settles() {
    let understeer = PacejkaParameters::from_array([7.0, 1.6, 0.9, 0.1, 9.0, 1.5, 0.95, -0.2]);
    let oversteer = PacejkaParameters::from_array([8.0, 1.6, 0.95, 0.1, 7.5, 1.5, 0.9, -0.2]);
    let small = VehicleParameters::f1tenth();
    let large = VehicleParameters {
        mass_kg: 790.0,
        yaw_inertia_kgm2: 1000.0,
        l_f_m: 1.5,
        l_r_m: 1.4,
        ..VehicleParameters::f1tenth()
    };
    for (car, tires) in [(&small, &understeer), (&small, &oversteer), (&large, &understeer)] {
        let table = SteeringLookup::new(car, tires, 60.0);
        let mut compared = 0;
        for column in (0..65).step_by(8) {
            for row in (1..60).step_by(7) {
                let (v_mps, steering_rad) = (table.speed_mps[column], table.steering_rad[row]);
                let a_mps2 = table.lateral_acceleration_mps2[row][column];
                if a_mps2.is_nan() {
                    continue;
                }
                let settled = settled_mps2(car, tires, v_mps, steering_rad);
                approx::assert_relative_eq!(a_mps2, settled, max_relative = 1e-4, epsilon = 1e-6);
                compared += 1;
            }
        }
        assert!(compared > 30, "only {compared} cells hold a steady turn");
    }
}

#[test]
fn columns_grow_up_to_the_peak_and_are_nan_beyond() {
    let car = VehicleParameters::f1tenth();
    let tires = PacejkaParameters::from_array([7.0, 1.6, 0.9, 0.1, 9.0, 1.5, 0.95, -0.2]);
    let table = SteeringLookup::new(&car, &tires, 0.0);
    for column in 0..65 {
        let cells: Vec<f64> = table.lateral_acceleration_mps2.iter().map(|row| row[column]).collect();
        let end = cells.iter().position(|a| a.is_nan()).unwrap_or(60);
        assert_eq!(cells[0], 0.0);
        assert!(cells[..end].windows(2).all(|w| w[1] > w[0]));
        assert!(cells[end..].iter().all(|a| a.is_nan()));
    }
    // At the highest speed the grip of the front axle ends the column, and the table comes close to it.
    let last = table.lateral_acceleration_mps2.iter().map(|row| row[64]).rfind(|a| !a.is_nan()).unwrap();
    let limit = gripsight_vehicle::GRAVITY_MPS2 * 0.9;
    assert!(last < limit && last > 0.98 * limit, "{last} of {limit}");
}

#[test]
fn a_car_that_spins_has_no_steady_turn() {
    // Far above its critical speed: only straight running is left, and readers still find one number per column.
    let tires = PacejkaParameters::from_array([9.0, 1.5, 1.0, 0.0, 3.0, 1.5, 1.0, 0.0]);
    let table = SteeringLookup::new(&VehicleParameters::f1tenth(), &tires, 0.0);
    assert_eq!(table.lateral_acceleration_mps2[0][64], 0.0);
    assert!(table.lateral_acceleration_mps2[1..].iter().all(|row| row[64].is_nan()));
}

#[test]
fn the_grid_fits_the_car() {
    let small = SteeringLookup::new(&VehicleParameters::f1tenth(), &tires(), 20.0);
    assert_eq!((small.speed_mps.len(), small.steering_rad.len()), (65, 60));
    assert_eq!((small.speed_mps[0], small.speed_mps[64]), (0.5, 7.0));
    assert_eq!((small.steering_rad[0], small.steering_rad[59]), (0.0, 0.4));
    let large = VehicleParameters { l_f_m: 1.25, l_r_m: 1.73, ..VehicleParameters::f1tenth() };
    assert_eq!(SteeringLookup::new(&large, &tires(), 63.0).speed_mps[64], 63.0);
    assert!(SteeringLookup::new(&large, &tires(), 1.0).speed_mps[64] > 20.0);
}

#[test]
fn the_csv_has_its_headers_and_reads_back() {
    let table = SteeringLookup::new(&VehicleParameters::f1tenth(), &tires(), 0.0);
    let csv = table.to_csv();
    let rows: Vec<Vec<f64>> =
        csv.lines().map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect();
    assert_eq!(rows.len(), 61);
    assert!(rows.iter().all(|row| row.len() == 66));
    assert_eq!((rows[0][0], rows[0][1], rows[0][65]), (0.0, 0.5, 7.0));
    assert_eq!((rows[1][0], rows[60][0]), (0.0, 0.4));
    for (row, cells) in rows[1..].iter().zip(&table.lateral_acceleration_mps2) {
        for (written, cell) in row[1..].iter().zip(cells) {
            assert!((written - cell).abs() < 1e-6 || (written.is_nan() && cell.is_nan()));
        }
    }
}

/// Names in a folder, in order.
fn names(folder: &std::path::Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

#[test]
fn the_last_good_set_stays_and_a_rejected_one_never_replaces_it() {
    let folder = tempfile::tempdir().unwrap();
    let (car, first) = (VehicleParameters::f1tenth(), provenance());
    let worse = PacejkaParameters { front: tires().rear, ..tires() };
    let write = |tires: &PacejkaParameters, provenance: &Provenance, status: Status| {
        let provenance = &Provenance { status, ..provenance.clone() };
        let files = TireFiles { tires, vehicle: &car, provenance, floor: "default", driven_mps: 5.0 };
        files.write(folder.path()).unwrap()
    };
    let mpc = || read_tires(&std::fs::read_to_string(folder.path().join("pacejka.yaml")).unwrap()).unwrap();

    write(&tires(), &first, Status::AcceptedWithin);
    write(&tires(), &first, Status::AcceptedWithin);
    let good = ["car_lookup_table.csv", "car_pacejka.txt", "pacejka.yaml"];
    assert_eq!(names(folder.path()), good);

    write(&worse, &first, Status::Rejected);
    write(&worse, &first, Status::Provisional);
    assert!(names(folder.path()).contains(&"pacejka.provisional.yaml".to_owned()));
    let rejected = ["car_lookup_table.rejected.csv", "car_pacejka.rejected.txt", "pacejka.rejected.yaml"];
    assert!(rejected.iter().all(|name| names(folder.path()).contains(&(*name).to_owned())));
    assert_eq!(mpc(), tires());

    let later = Provenance { data_stamp_ns: first.data_stamp_ns + 3_600_000_000_000, ..provenance() };
    write(&worse, &later, Status::Accepted);
    assert_eq!(mpc(), worse);
    let dated = [
        "car_lookup_table.20231114T221334Z.csv",
        "car_lookup_table.csv",
        "car_pacejka.20231114T221334Z.txt",
        "car_pacejka.txt",
        "pacejka.20231114T221334Z.yaml",
        "pacejka.yaml",
    ];
    assert_eq!(names(folder.path()), dated);
    let kept = std::fs::read_to_string(folder.path().join(dated[4])).unwrap();
    assert_eq!(read_tires(&kept).unwrap(), tires());
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let (car, provenance) = (VehicleParameters::f1tenth(), provenance());
    let files = TireFiles {
        tires: &tires(),
        vehicle: &car,
        provenance: &provenance,
        floor: "default",
        driven_mps: 5.0,
    };
    let error = files.write(&file).unwrap_err().to_string();
    assert!(error.contains("file/"), "{error}");
}
