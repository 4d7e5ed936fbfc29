//! Runs a scenario given as JSON and writes its truth table: for scripts that compare the reference car with other plants.
//!
//! `run_scenario --template CAR` prints the default scenario of a car as JSON; `run_scenario < scenario.json` writes the
//! truth as comma-separated values; `run_scenario --time < scenario.json` prints simulated seconds over seconds taken.

use std::error::Error;
use std::io::{BufWriter, stdin, stdout};
use std::time::Instant;

use gripsight_reference_car::{CarParameters, Scenario, Simulation, write_truth_csv};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [option, car] = arguments.as_slice()
        && option == "--template"
    {
        serde_json::to_writer_pretty(stdout(), &Scenario::new(CarParameters::by_name(car)?))?;
        return Ok(());
    }
    let scenario: Scenario = serde_json::from_reader(stdin())?;
    let simulated_s = scenario.duration_s;
    let simulation = Simulation::new(scenario)?;
    let start = Instant::now();
    let recording = simulation.run(|_| {});
    let taken_s = start.elapsed().as_secs_f64();
    if arguments.iter().any(|a| a == "--time") {
        println!("{}", simulated_s / taken_s);
    } else {
        write_truth_csv(BufWriter::new(stdout()), &recording.truth, 0.0)?;
    }
    eprintln!("{}", recording.end);
    Ok(())
}
