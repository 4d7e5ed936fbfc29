//! A batch of cases.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use gripsight_bag::effect::Effect;
use gripsight_reference_car::{EffectSetting, Scenario, effect_spec};
use rand::seq::SliceRandom;
use rand::{RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::draw::{self, Drive, Pool};
use crate::label::{CaseLabel, Family, Kind, Labels, OracleFit, SealedEffect};
use crate::measured::{self, MeasuredDrive, MeasuredDrives};
use crate::oracle::oracle_fits;
use crate::pairs::{self, SimulatorPairs};
use crate::plan::{self, Planned};
use crate::{WithheldError, drive, tires};

/// Files of a case, in its folder.
pub mod files {
    /// The drive to be explained.
    pub const BAG: &str = "bag.mcap";
    /// Another drive of the same car in the same state.
    pub const HELD_OUT: &str = "heldout.mcap";
    /// In place of it where drives are compared: a drive of the same car from before its effects came.
    pub const EARLIER: &str = "earlier.mcap";
    /// The car.
    pub const VEHICLE: &str = "vehicle.yaml";
    /// The tires, a few percent off; not there for recorded drives.
    pub const TIRES: &str = "pacejka.yaml";
    /// Effects to leave out of the library, one a line.
    pub const WITHOUT: &str = "without.txt";
    /// The simulator of a pair, in place of vehicle, tires and effects to leave out.
    pub const SIMULATOR: &str = "simulator.yaml";
}

/// Drives tried until one comes to its end.
const TRIES: usize = 40;

/// What makes up a batch.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BatchSettings {
    /// Cases of the reference car.
    pub cases: usize,
    /// Seed of everything but the nonce.
    pub seed: u64,
    /// Cars and tracks.
    pub pool: Pool,
    /// Length of every bag.
    pub duration_s: f64,
    /// Drives of plants that others wrote.
    pub foreign: Option<MeasuredDrives>,
    /// Recorded bags.
    pub recorded: Option<MeasuredDrives>,
    /// Pairs of simulator and car.
    #[serde(default)]
    pub simulators: Option<SimulatorPairs>,
    /// Whether every case is two drives of a car, before and after its effects came, but for pairs of simulator and car.
    #[serde(default)]
    pub compared: bool,
}

/// A batch as it is planned. Cases can be made in any order.
#[derive(Debug, Clone)]
pub struct Batch {
    settings: BatchSettings,
    plan: Vec<Planned>,
    foreign: Vec<MeasuredDrive>,
    recorded: Vec<MeasuredDrive>,
}

impl Batch {
    /// Plans a batch, and reads the drives that others made.
    ///
    /// # Errors
    /// [`WithheldError`] names the drive that cannot be used.
    pub fn new(settings: BatchSettings) -> Result<Self, WithheldError> {
        let random = &mut ChaCha8Rng::seed_from_u64(settings.seed);
        let mut plan = if settings.compared {
            plan::compared(Family::Reference, settings.cases, &draw::names(true), 1, random)
        } else {
            plan::reference(settings.cases, random)
        };
        let mut drives = |asked: &Option<MeasuredDrives>, family| match asked {
            Some(MeasuredDrives { folder, cases }) => {
                let drives = measured::read(folder, family == Family::Foreign)?;
                plan.extend(if settings.compared {
                    plan::compared(family, *cases, &plan::injectable(), drives.len(), random)
                } else {
                    plan::measured(family, *cases, drives.len(), random)
                });
                Ok::<_, WithheldError>(drives)
            }
            None => Ok(Vec::new()),
        };
        let foreign = drives(&settings.foreign, Family::Foreign)?;
        let recorded = drives(&settings.recorded, Family::Recorded)?;
        if let Some(asked) = &settings.simulators {
            plan.extend(plan::pairs(asked.cases, pairs::COUNT, random));
        }
        plan.shuffle(random);
        Ok(Self { settings, plan, foreign, recorded })
    }

    /// What it is made of.
    #[must_use]
    pub fn settings(&self) -> &BatchSettings {
        &self.settings
    }

    /// Number of cases.
    #[must_use]
    pub fn len(&self) -> usize {
        self.plan.len()
    }

    /// Whether there is no case.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.plan.is_empty()
    }

    /// The labels of all cases, with a nonce.
    ///
    /// # Errors
    /// [`WithheldError::Content`] where the settings cannot be written as JSON.
    pub fn labels(&self, nonce: String, cases: Vec<CaseLabel>) -> Result<Labels, WithheldError> {
        let settings = serde_json::to_value(&self.settings)
            .and_then(serde_json::from_value::<BTreeMap<String, Value>>)
            .map_err(|e| WithheldError::content(Path::new("settings"), &e))?;
        Ok(Labels { nonce, seed: self.settings.seed, settings, cases })
    }

    /// Name of a case's folder.
    #[must_use]
    pub fn case_name(&self, index: usize) -> String {
        format!("case_{:04}", index + 1)
    }

    /// Makes a case: its folder in `folder`, complete or not there at all, and its label.
    ///
    /// # Errors
    /// [`WithheldError`].
    pub fn make(&self, index: usize, folder: &Path) -> Result<CaseLabel, WithheldError> {
        let mut random = ChaCha8Rng::seed_from_u64(self.settings.seed);
        random.set_stream(index as u64 + 1);
        let case = self.case_name(index);
        let part = folder.join(format!("{case}.part"));
        if part.exists() {
            fs::remove_dir_all(&part).map_err(WithheldError::io(&part))?;
        }
        fs::create_dir_all(&part).map_err(WithheldError::io(&part))?;
        let planned = &self.plan[index];
        let label = match planned.family {
            Family::Reference => self.reference_case(case.clone(), planned, &part, &mut random),
            Family::Foreign => self.measured_case(case.clone(), planned, &self.foreign, &part, &mut random),
            Family::Recorded => self.measured_case(case.clone(), planned, &self.recorded, &part, &mut random),
            Family::Simulator => match &self.settings.simulators {
                Some(asked) => {
                    pairs::pair(asked, case.clone(), planned, self.settings.duration_s, &part, &mut random)
                }
                None => Err(WithheldError::content(&part, &"a pair without simulators")),
            },
        }?;
        let whole = folder.join(&case);
        if whole.exists() {
            fs::remove_dir_all(&whole).map_err(WithheldError::io(&whole))?;
        }
        fs::rename(&part, &whole).map_err(WithheldError::io(&whole))?;
        Ok(label)
    }

    fn reference_case(
        &self,
        case: String,
        planned: &Planned,
        folder: &Path,
        random: &mut ChaCha8Rng,
    ) -> Result<CaseLabel, WithheldError> {
        let run_s = self.settings.duration_s + 2.0 * drive::MARGIN_S;
        let mut last = None;
        for _ in 0..TRIES {
            let Drive { mut scenario, race_pace, circumstances } =
                draw::drive(self.settings.pool, run_s, random)?;
            let lap_m = draw::lap_m(&scenario)?;
            let asked = planned
                .effects
                .iter()
                .map(|name| draw::sized(name, scenario.car.wheelbase_m() < 1.0, lap_m, random))
                .collect::<Result<Vec<_>, _>>()?;
            scenario.effects.retain(|own| asked.iter().all(|a| a.name != own.name));
            let untouched = scenario.effects.clone();
            scenario.effects.extend(asked.iter().cloned());
            let mut other = draw::another(&scenario, random);
            if self.settings.compared {
                other.effects = untouched;
            }
            let (first, second) = match (drive::driven(&scenario)?, drive::driven(&other)?) {
                (Ok(first), Ok(second)) => (first, second),
                (Err(end), _) | (_, Err(end)) => {
                    last = Some(end);
                    continue;
                }
            };
            let mu = scenario.friction.nominal();
            let axles = tires::off_by_a_little(tires::true_axles(&scenario.car, mu), random);
            let without = left_out(planned, random);
            let duration_s = self.settings.duration_s;
            drive::write(&folder.join(files::BAG), &drive::between_margins(&first, duration_s))?;
            drive::write(&folder.join(self.other_file()), &drive::between_margins(&second, duration_s))?;
            text(&folder.join(files::VEHICLE), &scenario.car.vehicle_file("car"))?;
            text(&folder.join(files::TIRES), &tires::file(axles))?;
            text(&folder.join(files::WITHOUT), &(without.join("\n") + "\n"))?;
            let stand_ins = stand_ins(planned, &without, &scenario)?;
            let fits = oracle_fits(&scenario, &asked, &stand_ins)?;
            let effects = asked
                .into_iter()
                .zip(fits)
                .map(|(setting, fit)| {
                    let severity = fit.severity * draw::beyond_usual(&scenario.car, mu, &setting);
                    sealed(setting, Some(OracleFit { severity, ..fit }))
                })
                .collect::<Result<_, _>>()?;
            return Ok(CaseLabel {
                case,
                family: planned.family,
                compared: self.settings.compared,
                kind: planned.kind,
                effects,
                without,
                race_pace,
                contained: Vec::new(),
                circumstances,
            });
        }
        let last = last.unwrap_or(gripsight_reference_car::EndReason::Completed);
        Err(WithheldError::NoDrive { tries: TRIES, last })
    }
}

impl Batch {
    fn measured_case(
        &self,
        case: String,
        planned: &Planned,
        drives: &[MeasuredDrive],
        folder: &Path,
        random: &mut ChaCha8Rng,
    ) -> Result<CaseLabel, WithheldError> {
        let drive = &drives[planned.source];
        // An effect on a stream that this drive lacks gives way to another one.
        let mut names = planned.effects.clone();
        let (asked, effects) = loop {
            let asked = names
                .iter()
                .map(|name| Ok(drive.unseen(draw::sized(name, drive.wheelbase_m < 1.0, 0.0, random)?)))
                .collect::<Result<Vec<_>, WithheldError>>()?;
            let effects = asked.iter().map(measured::effect).collect::<Result<Vec<_>, _>>()?;
            if effects.iter().all(|e| drive.takes(e)) {
                break (asked, effects);
            }
            names = draw::some(&plan::injectable(), names.len(), random);
        };
        let planned = Planned { effects: names, ..planned.clone() };
        let without = left_out(&planned, random);
        let untouched: &[Effect] = if self.settings.compared { &[] } else { &effects };
        let same = self.settings.compared && random.random_bool(0.5);
        let [first, second] =
            drive.stretches([&effects, untouched], same, self.settings.duration_s, random)?;
        drive::write(&folder.join(files::BAG), &first)?;
        drive::write(&folder.join(self.other_file()), &second)?;
        text(&folder.join(files::VEHICLE), &drive.vehicle)?;
        if let Some(axles) = drive.axles {
            text(&folder.join(files::TIRES), &tires::file(tires::off_by_a_little(axles, random)))?;
        }
        text(&folder.join(files::WITHOUT), &(without.join("\n") + "\n"))?;
        let mut circumstances = BTreeMap::from([("car".to_owned(), Value::from(drive.name.clone()))]);
        if self.settings.compared {
            circumstances.insert("same_stretch".to_owned(), Value::from(same));
        }
        Ok(CaseLabel {
            case,
            family: planned.family,
            compared: self.settings.compared,
            kind: planned.kind,
            effects: asked.into_iter().map(|setting| sealed(setting, None)).collect::<Result<_, _>>()?,
            without,
            race_pace: true,
            // What both drives have is no change.
            contained: if self.settings.compared { Vec::new() } else { drive.contained.clone() },
            circumstances,
        })
    }

    /// The file of a case's other drive.
    fn other_file(&self) -> &'static str {
        if self.settings.compared { files::EARLIER } else { files::HELD_OUT }
    }
}

fn left_out(planned: &Planned, random: &mut ChaCha8Rng) -> Vec<String> {
    let deleted = planned.effects.first().copied().filter(|_| planned.kind == Kind::Deleted);
    draw::left_out(&planned.effects, deleted, random)
}

/// Where the diagnosis has to do without the true effect: all effects that it has, at their typical size.
fn stand_ins(
    planned: &Planned,
    without: &[String],
    scenario: &Scenario,
) -> Result<Vec<EffectSetting>, WithheldError> {
    if planned.kind != Kind::Deleted {
        return Ok(Vec::new());
    }
    let mut names = draw::names(true);
    names.retain(|name| !without.iter().any(|w| w == name));
    names.into_iter().map(|name| draw::typical(name, scenario)).collect()
}

/// A lap that ends where it began climbs as much as it falls: the sign of its slope says where, and the library states the steepest climb.
const CLIMB: &str = "road_slope";

/// An effect with its size in the library's terms.
fn sealed(setting: EffectSetting, oracle: Option<OracleFit>) -> Result<SealedEffect, WithheldError> {
    let spec = effect_spec(&setting.name)?;
    let ratio = oracle.map_or(1.0, |fit| fit.size_ratio);
    let sizing: Vec<&str> = draw::sizing(spec).collect();
    let library_parameters = setting
        .parameters
        .iter()
        .map(|(name, value)| {
            let null = spec.parameters.iter().find(|p| p.name == name).and_then(|p| p.null);
            let scaled = null.map_or(*value, |null| null + ratio * (value - null));
            let size = if setting.name == CLIMB { scaled.abs() } else { scaled };
            (name.clone(), if sizing.contains(&name.as_str()) { size } else { *value })
        })
        .collect();
    Ok(SealedEffect { name: setting.name, parameters: setting.parameters, library_parameters, oracle })
}

fn text(path: &Path, content: &str) -> Result<(), WithheldError> {
    fs::write(path, content).map_err(WithheldError::io(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slope_is_sealed_by_its_climb_and_other_sizes_by_their_sign() {
        let in_the_library = |name: &str, value: f64| {
            let fit =
                OracleFit { severity: 3.0, size_ratio: 1.1, chi2_per_residual: 1.0, excess_without: None };
            let effect = sealed(EffectSetting::new(name, &[value]).unwrap(), Some(fit)).unwrap();
            let [constant, size] =
                [effect.parameters, effect.library_parameters].map(|p| p.into_values().next());
            assert_eq!(constant, Some(value));
            size.unwrap()
        };
        // Of a ratio what it is off by counts.
        let expected = [
            ("road_slope", -0.03, 0.033),
            ("road_slope", 0.03, 0.033),
            ("road_bank", -0.03, -0.033),
            ("mass_error", 1.1, 1.11),
        ];
        for (name, constant, size) in expected {
            assert!((in_the_library(name, constant) - size).abs() < 1e-12, "{name}");
        }
    }
}
