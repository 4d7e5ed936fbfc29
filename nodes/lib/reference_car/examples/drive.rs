//! Drives one scenario and prints what happened: `drive [CAR] [TRACK] [MU] [PACE] [pursuit|profile] [EFFECT...]`.
//! A last argument ending in `.csv` receives the truth.

use std::error::Error;

use gripsight_reference_car::{
    CarParameters, Course, DriverKind, EffectSetting, Friction, Scenario, Simulation, write_truth_csv,
};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let get = |i: usize, default: &'static str| arguments.get(i).map_or(default, String::as_str).to_owned();
    let car = CarParameters::by_name(&get(0, "f1tenth"))?;
    let course = Course::by_name(&get(1, "club"), &car, false)?;
    let kind = if get(4, "pursuit") == "profile" { DriverKind::Profile } else { DriverKind::PurePursuit };
    let mut scenario = Scenario::new(car)
        .course(course)
        .friction(Friction::Uniform { mu: get(2, "0.9").parse()? })
        .driver(kind, get(3, "0.8").parse()?)
        .duration(60.0);
    for text in arguments.iter().skip(5).filter(|a| !a.ends_with(".csv")) {
        scenario = scenario.effect(EffectSetting::parse(text)?);
    }
    let simulation = Simulation::new(scenario)?;
    let track_m = simulation.track().map_or(0.0, |t| t.length_m());
    let recording = simulation.run(|_| {});
    let most = |pick: fn(&gripsight_reference_car::TruthSample) -> f64| {
        recording.truth.iter().map(|t| pick(t).abs()).fold(0.0, f64::max)
    };
    println!("{}; lap {track_m:.1} m, driven {:.0} samples", recording.end, recording.truth.len());
    println!(
        "v_x {:.2} m/s, a_y {:.2} m/s2, a_x {:.2}, front slip {:.3} rad, rear slip {:.3} rad, offset {:.2} m, roll {:.3}",
        most(|t| t.motion.v_x_mps),
        most(|t| t.motion.specific_y_mps2),
        most(|t| t.motion.specific_x_mps2),
        most(|t| t.wheels[0].slip_angle_rad),
        most(|t| t.wheels[2].slip_angle_rad),
        most(|t| t.offset_m),
        most(|t| t.motion.roll_rad),
    );
    if let Some(path) = arguments.last().filter(|a| a.ends_with(".csv")) {
        write_truth_csv(std::fs::File::create(path)?, &recording.truth, 0.0)?;
    }
    Ok(())
}
