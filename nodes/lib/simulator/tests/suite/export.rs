//! The files that are written for others' simulators are loaded by these; where one is not installed here, that is said.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use gripsight_model::{CarFile, EffectId};
use gripsight_simulator::{Target, export};
use gripsight_vehicle::{OwnTires, PacejkaParameters, VehicleParameters};

use crate::support::python;

fn car() -> CarFile {
    let own = |name: &str, value: f64| BTreeMap::from([(name.to_owned(), value)]);
    let lag = BTreeMap::from([("tau_s".to_owned(), 0.05), ("q".to_owned(), 0.25)]);
    CarFile {
        vehicle: VehicleParameters { name: Some("blue car".to_owned()), ..VehicleParameters::f1tenth() },
        tires: OwnTires::assumed(&PacejkaParameters::from_array([9.0, 1.5, 0.95, 0.1, 10.0, 1.4, 1.0, -0.2])),
        effects: BTreeMap::from([
            ("tire_relaxation".to_owned(), own("sigma_m", 0.07)),
            ("mass_error".to_owned(), own("ratio", 1.1)),
            ("steering_rate_limit".to_owned(), own("s_per_rad", 0.4)),
            ("steering_delay".to_owned(), own("delay_s", 0.03)),
            ("steering_lag".to_owned(), lag),
        ]),
    }
}

fn written(target: Target, out: &Path) -> Vec<EffectId> {
    let exported = export(target, &car()).unwrap();
    for (name, text) in &exported.files {
        let path = if name.is_empty() { out.to_owned() } else { out.join(name) };
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    exported.left_out
}

/// Runs Python where a package is there; its answers as numbers.
fn asked(package: &str, script: &str, path: &Path) -> Option<Vec<f64>> {
    let run = |script: &str| Command::new(python()).args(["-c", script]).arg(path).output().unwrap();
    if !run(&format!("import {package}")).status.success() {
        eprintln!("skipped: no {package} here (launch_scripts/setup.sh --tests)");
        return None;
    }
    let output = run(script);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    Some(text.split_whitespace().map(|v| v.parse().unwrap()).collect())
}

fn assert_near(got: &[f64], expected: &[f64]) {
    assert_eq!(got.len(), expected.len(), "{got:?}");
    for (a, b) in got.iter().zip(expected) {
        approx::assert_relative_eq!(*a, *b, max_relative = 1e-6);
    }
}

#[test]
fn slipx_loads_the_car_and_its_tires_are_the_ones_found() {
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(written(Target::Slipx, folder.path()), [EffectId::SteeringDelay]);
    let script = "
import sys, slipx
p = slipx.load_car(sys.argv[1]).params_for_tier(slipx.Tier.L2_DoubleTrack)
print(p.mass, p.lf, p.c_alpha_f, p.c_alpha_r, p.tyre_front.mu_y0, p.tyre_rear.shape_c, p.tyre_rear.curvature_e, p.tyre_front.relax_length,
      p.steer_rate_max, p.steer_bandwidth, p.steer_damping)
";
    let Some(got) = asked("slipx", script, folder.path()) else { return };
    let vehicle = car().vehicle;
    let mass_kg = 1.1 * vehicle.mass_kg;
    let load_n = |share_m: f64| mass_kg * gripsight_vehicle::GRAVITY_MPS2 * share_m / vehicle.wheelbase_m();
    let stiffness = [9.0 * 1.5 * 0.95 * load_n(vehicle.l_r_m), 10.0 * 1.4 * 1.0 * load_n(vehicle.l_f_m)];
    let expected =
        [mass_kg, vehicle.l_f_m, stiffness[0], stiffness[1], 0.95, 1.4, -0.2, 0.07, 2.5, 40.0, 1.0];
    assert_near(&got, &expected);
}

#[test]
fn a_car_that_slipx_does_not_take_is_refused() {
    let mut car = car();
    car.vehicle.mass_kg = 740.0;
    let error = export(Target::Slipx, &car).unwrap_err();
    assert!(error.to_string().contains("15 kg") && error.to_string().contains("814"), "{error}");
}

#[test]
fn commonroad_loads_the_car_and_its_single_track_model_turns_left() {
    let folder = tempfile::tempdir().unwrap();
    let left_out = written(Target::Commonroad, folder.path());
    assert_eq!(left_out, [EffectId::SteeringDelay, EffectId::SteeringLag, EffectId::TireRelaxation]);
    let script = "
import sys, pathlib
from vehiclemodels.vehicle_parameters import setup_vehicle_parameters
from vehiclemodels.vehicle_dynamics_st import vehicle_dynamics_st
p = setup_vehicle_parameters(1, pathlib.Path(sys.argv[1]))
rates = vehicle_dynamics_st([0.0, 0.0, 0.05, 5.0, 0.0, 0.0, 0.0], [0.0, 0.0], p)
print(p.m, p.a, p.b, p.steering.v_max, -p.tire.p_ky1 / p.tire.p_dy1, rates[5])
";
    let Some(got) = asked("vehiclemodels", script, folder.path()) else { return };
    let vehicle = car().vehicle;
    let mean = |front: f64, rear: f64| (front * vehicle.l_r_m + rear * vehicle.l_f_m) / vehicle.wheelbase_m();
    let stiffness = mean(9.0 * 1.5 * 0.95, 10.0 * 1.4 * 1.0);
    let force_n = stiffness * 0.05 * 1.1 * vehicle.mass_kg * 9.81 * vehicle.l_r_m / vehicle.wheelbase_m();
    let turns = force_n * vehicle.l_f_m / vehicle.yaw_inertia_kgm2;
    let expected =
        [1.1 * vehicle.mass_kg, vehicle.l_f_m, vehicle.l_r_m, 2.5, stiffness / mean(0.95, 1.0), turns];
    assert_near(&got, &expected);
}

#[test]
fn open_car_dynamics_has_each_wheel_s_tire_by_the_names_of_its_models() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("vehicle.json");
    assert_eq!(written(Target::OpenCarDynamics, &path), [EffectId::SteeringDelay, EffectId::TireRelaxation]);
    let text = std::fs::read_to_string(&path).unwrap();
    let all: BTreeMap<String, f64> = serde_json::from_str(&text).unwrap();
    let of = |name: &str| all[name];
    let tire = |wheel: &str, name: &str| {
        of(&format!("vehicle_dynamics_single_track.z.tire_model.{wheel}.lateral.{name}"))
    };
    let got = [tire("front_left", "B"), tire("rear_right", "E"), of("steering_actuator.T_PT1")];
    assert_eq!(got, [9.0, -0.2, 0.05]);
    let loaded = asked(
        "ocd_vehicle_models_py",
        "
import json, sys
from ocd_vehicle_models_py import AerodynamicsType, DrivetrainType, SteeringActuatorType, TireType, VehicleDynamicsType, VehicleFactory
vehicle = VehicleFactory.create_vehicle(drivetrain=DrivetrainType.FX, steering=SteeringActuatorType.PT1,
    vdm=VehicleDynamicsType.SINGLE_TRACK, tire=TireType.MF_SIMPLE, aero=AerodynamicsType.DEFAULT)
manager = vehicle.get_param_manager()
manager.set_parameters_from_dict(json.load(open(sys.argv[1])))
print(manager.get_parameters_as_dict()['vehicle_dynamics_single_track.mass_vehicle_kg'])
",
        &path,
    );
    if let Some(loaded) = loaded {
        assert_near(&loaded, &[1.1 * car().vehicle.mass_kg]);
    }
}
