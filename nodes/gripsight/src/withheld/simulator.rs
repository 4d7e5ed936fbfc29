//! `gripsight withheld simulator`: the reference car as a simulator, for the pairs of the blind check.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use anyhow::Context;
use clap::Args;
use gripsight_reference_car::{Command, Scenario, Simulation};
use gripsight_simulator::{Channel, Description, Input, InputKind, SimulatorParameter, Stepped, serve};
use gripsight_withheld_make::reference_pairs::FIGURES;

use crate::Outcome;

/// Be the reference car, for `gripsight diagnose --simulator`; started by it.
#[derive(Debug, Args)]
pub(crate) struct SimulatorArgs {
    /// The car.
    car: PathBuf,
    /// Its figures.
    figures: PathBuf,
}

/// Runs the subcommand.
pub(crate) fn run(args: &SimulatorArgs) -> anyhow::Result<Outcome> {
    let text =
        |path: &PathBuf| fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()));
    let scenario: Scenario = serde_json::from_str(&text(&args.car)?)
        .with_context(|| format!("cannot use {}", args.car.display()))?;
    let figures: BTreeMap<String, f64> = serde_saphyr::from_str(&text(&args.figures)?)
        .with_context(|| format!("cannot use {}", args.figures.display()))?;
    serve(&mut ReferenceSimulator::new(scenario, &figures))?;
    Ok(Outcome::Done)
}

struct ReferenceSimulator {
    description: Description,
    scenario: Scenario,
    running: Option<Simulation>,
}

impl ReferenceSimulator {
    fn new(scenario: Scenario, figures: &BTreeMap<String, f64>) -> Self {
        let parameter = |f: &gripsight_withheld_make::reference_pairs::Figure| {
            f.of(&scenario)?;
            let value = *figures.get(f.name)?;
            Some(SimulatorParameter {
                name: f.name.to_owned(),
                value,
                low: f.low * value,
                high: f.high * value,
                unit: f.unit.to_owned(),
                keys: vec![f.name.to_owned()],
                in_code: None,
                integer: false,
                site: Some(f.site.to_owned()),
            })
        };
        let motion = vec![Channel::VXMps, Channel::VYMps, Channel::YawRateRadps];
        let input = |name: &str, kind| Input { name: name.to_owned(), kind };
        let description = Description {
            name: "reference car".to_owned(),
            step_s: scenario.step_s,
            states: motion.clone(),
            inputs: vec![
                input("steering", InputKind::SteeringAngle),
                input("acceleration", InputKind::Acceleration),
            ],
            outputs: motion,
            parameters: FIGURES.iter().filter_map(parameter).collect(),
            imposes_v_x: true,
            lacks: Vec::new(),
        };
        Self { description, scenario, running: None }
    }
}

impl Stepped for ReferenceSimulator {
    fn description(&self) -> &Description {
        &self.description
    }

    fn place(&mut self, parameters: &[f64], motion: &[f64], fresh: bool) -> Result<Vec<f64>, String> {
        if fresh {
            let mut scenario = self.scenario.clone();
            for (p, value) in self.description.parameters.iter().zip(parameters) {
                if let Some(figure) = FIGURES.iter().find(|f| f.name == p.name) {
                    figure.put(&mut scenario, *value);
                }
            }
            self.running = Some(Simulation::new(scenario).map_err(|e| e.to_string())?);
        }
        let [v_x_mps, v_y_mps, yaw_rate_radps] = motion else {
            return Err("three speeds are needed".to_owned());
        };
        let Some(car) = &mut self.running else { return Err("the car is not there yet".to_owned()) };
        car.put(*v_x_mps, *v_y_mps, *yaw_rate_radps);
        Ok(motion.to_vec())
    }

    fn step(&mut self, command: &[f64]) -> Vec<f64> {
        let Some(car) = &mut self.running else { return vec![f64::NAN; 3] };
        let asked = |i: usize| command.get(i).copied().unwrap_or(0.0);
        car.command(Command { steering_rad: asked(0), speed_mps: 0.0, acceleration_mps2: Some(asked(1)) });
        let moved = car.step();
        // What its sensors report nobody asks for.
        car.drain();
        if moved.is_ok() { car.speeds().to_vec() } else { vec![f64::NAN; 3] }
    }
}
