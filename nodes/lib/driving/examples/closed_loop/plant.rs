//! The reference car, its track, and its tires projected on Phi_p.

use anyhow::{Context, Result};
use gripsight_driving::{Drivetrain, Longitudinal, TireSet, Track, Trust};
use gripsight_identification::nelder_mead::{NelderMeadConfig, minimize};
use gripsight_identification::tires::BOUNDS;
use gripsight_reference_car as reference;
use gripsight_reference_car::{CarParameters, Course, Friction, Scenario, Simulation};
use gripsight_vehicle::{MagicFormula, PacejkaParameters, VehicleParameters};

/// What a data sheet says of a built-in car.
pub(crate) fn vehicle(car: &CarParameters) -> Result<VehicleParameters> {
    Ok(VehicleParameters::from_ros_yaml(&car.vehicle_file(&car.name))?)
}

/// What it says of motor and brakes.
pub(crate) fn drivetrain(car: &CarParameters) -> Drivetrain {
    Drivetrain {
        drive_mps2: car.drive.drive_limit * reference::GRAVITY_MPS2,
        brake_mps2: car.drive.brake_limit * reference::GRAVITY_MPS2,
        power_w_per_kg: car.drive.power_w / car.mass_kg,
        top_speed_mps: car.top_speed_mps,
        told: Longitudinal::UNKNOWN,
    }
}

/// What holds a built-in car back on a road: what a driver on its true tires is told.
pub(crate) fn told(car: &CarParameters, mu: f64) -> Longitudinal {
    let effects = car.own_effects(mu);
    let of = |name: &str, parameter: &str| {
        let effect = effects.iter().find(|e| e.name == name);
        effect.and_then(|e| e.parameters.get(parameter)).copied()
    };
    Longitudinal {
        rolling_resistance_mps2: of("rolling_resistance", "c").map(|c| c * reference::GRAVITY_MPS2),
        drag_1pm: of("aero_drag", "c_1pm"),
        ..Longitudinal::UNKNOWN
    }
}

/// A built-in track as a driver reads it.
pub(crate) fn track(car: &CarParameters, name: &str, reversed: bool) -> Result<Track> {
    let track = reference::Track::by_name(name, car.track_scale, reversed)?;
    let width = track.half_width_m();
    let rows: Vec<[f64; 4]> =
        track.points().iter().step_by(8).map(|p| [p.x_m, p.y_m, width, width]).collect();
    Ok(Track::from_points(&rows)?)
}

/// Length of the ramps: full lock is reached before.
const RAMP_S: f64 = 15.0;
/// Slips that a driver has a use for.
const MOST_SLIP_RAD: f64 = 0.3;

/// A car on a road, with everything that the car has of its own.
pub(crate) fn scenario(car: &CarParameters, course: Course, mu: f64, seed: u64) -> Scenario {
    let mut scenario = Scenario::new(car.clone())
        .course(course)
        .friction(Friction::Uniform { mu })
        .duration(36_000.0)
        .seed(seed);
    scenario.effects = car.own_effects(mu);
    scenario
}

/// The effective tires of the plant on a road: the Magic Formulas nearest to its axle forces over the static loads, steered slowly up to the lock
/// at constant speed, both ways. The axle that gave way there promises no more than it gave; a formula says more beyond.
pub(crate) fn projection(car: &CarParameters, mu: f64) -> Result<TireSet> {
    let vehicle = vehicle(car)?;
    let loads = [vehicle.static_load_front_n(), vehicle.static_load_rear_n()];
    let mut points: [Vec<(f64, f64)>; 2] = Default::default();
    for reversed in [false, true] {
        let course = Course::by_name("ramp_steer", car, reversed)?;
        let driven = scenario(car, course, mu, 1).duration(RAMP_S);
        for t in Simulation::new(driven)?.run(|_| {}).truth {
            let m = &t.motion;
            let front = m.steering_rad - ((m.v_y_mps + vehicle.l_f_m * m.yaw_rate_radps) / m.v_x_mps).atan();
            let rear = -((m.v_y_mps - vehicle.l_r_m * m.yaw_rate_radps) / m.v_x_mps).atan();
            for (axle, slip, force) in [(0, front, t.front_axle_n()[1]), (1, rear, t.rear_axle_n()[1])] {
                if m.v_x_mps > car.low_speed_mps() && slip.abs() < MOST_SLIP_RAD {
                    points[axle].push((slip, force / loads[axle]));
                }
            }
        }
    }
    let reached =
        points.each_ref().map(|points| points.iter().map(|(slip, _)| slip.abs()).fold(0.0, f64::max));
    let [front, rear] = points.map(|points| nearest(&points));
    let tires = PacejkaParameters { front: front?, rear: rear? };
    // Slip over that at which the stiffness alone would give the force.
    let into = |tire: &MagicFormula, slip_rad: f64| {
        slip_rad * tire.normalized_stiffness() / tire.normalized_force(slip_rad)
    };
    let front_gave_way = into(&tires.front, reached[0]) > into(&tires.rear, reached[1]);
    let valid_slip_rad =
        if front_gave_way { [reached[0], f64::INFINITY] } else { [f64::INFINITY, reached[1]] };
    Ok(TireSet { trust: Trust::Accepted, valid_slip_rad, ..TireSet::assumed(tires) })
}

fn nearest(points: &[(f64, f64)]) -> Result<MagicFormula> {
    let config = NelderMeadConfig { max_evaluations: 3000, ..NelderMeadConfig::default() };
    let axle = |x: &[f64]| MagicFormula { b: x[0], c: x[1], d: x[2], e: x[3] };
    let cost = |x: &[f64]| {
        let tire = axle(x);
        points.iter().step_by(5).map(|&(slip, force)| (tire.normalized_force(slip) - force).powi(2)).sum()
    };
    let starts = [[6.0, 1.4, 0.5, 0.0], [10.0, 1.4, 1.0, 0.0], [20.0, 1.6, 0.7, -1.0]];
    let found =
        starts.iter().map(|start| minimize(cost, start, &BOUNDS, &config)).collect::<Result<Vec<_>, _>>()?;
    let best = found.into_iter().min_by(|a, b| a.cost.total_cmp(&b.cost)).context("no fit")?;
    Ok(axle(&best.x))
}
