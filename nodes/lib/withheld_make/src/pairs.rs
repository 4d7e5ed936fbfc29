//! Pairs of simulator and car: the car is the same simulator with something changed, or another kind of simulator.
//!
//! A maker of the simulators' own language drives them (`tests/plants/make_simulator_pairs.py`): it is told what to change, writes bags
//! and the unchanged simulator's files, and prints what became of the changes, each with its size over the detection limit. Changes that do
//! not show at [`LEAST_SEVERITY`] are drawn anew.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use rand::RngExt;
use rand::seq::IndexedRandom;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::batch::files;
use crate::label::{CaseLabel, Family, Kind, OracleFit, SealedEffect};
use crate::plan::Planned;
use crate::{WithheldError, reference_pairs};

/// Size over the detection limit from which a change is one that has to be found.
pub(crate) const LEAST_SEVERITY: f64 = 2.0;
/// What no parameter imitates of a structure that has to be found: squared, over the noise, per residual.
pub(crate) const LEAST_EXCESS: f64 = 1.0;
/// Exit code by which the maker says that this car cannot be kept on this track: another is drawn.
const NO_DRIVE: i32 = 3;
/// Draws until a change shows.
pub(crate) const TRIES: usize = 20;
/// The smallest change over the largest one that is drawn.
pub(crate) const SMALLEST: f64 = 0.2;

/// Pairs that a batch is to hold.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SimulatorPairs {
    /// The program that drives them.
    pub maker: PathBuf,
    /// The Python that runs it, and the simulators; their packages are installed there.
    pub python: PathBuf,
    /// Cases.
    pub cases: usize,
}

/// A parameter that is changed: its name, and the share of its value at the largest change.
type Share = (&'static str, f64);

/// A simulator of the batch.
pub(crate) struct PairSimulator {
    /// The maker's name of it.
    name: &'static str,
    /// Its parameters that are changed.
    own: &'static [Share],
    /// Whether effects around the steering command and v_y apply: a car without side slip shows none of the latter.
    around: &'static [&'static str],
    /// Kinds of simulators that have what this one has no term for.
    richer: &'static [&'static str],
    /// Longest drive: slow ones get short bags.
    most_s: f64,
}

pub(crate) const AROUND: &[&str] =
    &["steering_delay", "steering_gain", "steering_offset", "v_y_lever_arm", "gyro_scale"];

/// Those that the maker drives, in turn; the reference car is one more.
const SIMULATORS: [PairSimulator; 5] = [
    PairSimulator {
        name: "slipx",
        own: &[
            ("izz", 1.5),
            ("tyre_front.mu_y0", 0.7),
            ("tyre_rear.mu_y0", 1.3),
            ("lf", 0.85),
            ("steer_bandwidth", 0.6),
        ],
        around: AROUND,
        richer: &[],
        most_s: 24.0,
    },
    PairSimulator {
        name: "commonroad_st",
        own: &[("tire.p_ky1", 0.7), ("I_z", 1.5), ("a", 0.88), ("m", 1.3)],
        around: AROUND,
        richer: &["commonroad_std", "commonroad_mb"],
        most_s: f64::INFINITY,
    },
    PairSimulator {
        name: "commonroad_std",
        own: &[("tire.p_dy1", 0.75), ("I_z", 1.5), ("tire.p_ky1", 0.7), ("a", 0.88)],
        around: AROUND,
        richer: &[],
        most_s: 24.0,
    },
    PairSimulator {
        name: "commonroad_mb",
        own: &[("tire.p_dy1", 0.75), ("tire.p_ky1", 0.7), ("m", 1.3), ("I_z", 1.5)],
        around: AROUND,
        richer: &[],
        most_s: 20.0,
    },
    PairSimulator {
        name: "simple_planning",
        own: &[
            ("steer_time_delay", 0.5),
            ("steer_time_constant", 1.8),
            ("steer_rate_lim", 0.05),
            ("debug_steer_scaling_factor", 0.85),
            ("wheel_base", 1.1),
        ],
        around: &["gyro_scale"],
        richer: &["commonroad_st"],
        most_s: f64::INFINITY,
    },
];
/// How many simulators there are.
pub(crate) const COUNT: usize = SIMULATORS.len() + 1;
/// A simulator without a term for what another kind of car has, for those that have no richer kind of their own.
const BARE: (&str, &str) = ("slipx_bicycle", "slipx");

/// An effect around a simulator: the name of its size, and a size.
pub(crate) fn around(effect: &str, full_size: bool, random: &mut ChaCha8Rng) -> (&'static str, f64) {
    let (name, least, most): (_, f64, f64) = match effect {
        "steering_delay" => ("delay_s", 0.02, 0.08),
        "steering_gain" => ("gain", 0.03, 0.15),
        "steering_offset" => ("offset_rad", 0.004, 0.02),
        "v_y_lever_arm" if full_size => ("x_m", 0.1, 0.8),
        "v_y_lever_arm" => ("x_m", 0.03, 0.15),
        _ => ("scale", 0.02, 0.08),
    };
    let size = least * (most / least).powf(random.random_range(0.0..1.0));
    // A delay is a whole number of commands, and has one sign.
    let size = match name {
        "delay_s" => (100.0 * size).round() / 100.0,
        _ if random.random_bool(0.5) => -size,
        _ => size,
    };
    (name, size)
}

/// What the maker says.
#[derive(Deserialize)]
struct Made {
    noise: Vec<f64>,
    /// Of a car of another kind.
    excess: Option<f64>,
    changes: BTreeMap<String, MadeChange>,
}

#[derive(Deserialize)]
struct MadeChange {
    value: f64,
    before: f64,
    severity: f64,
    chi2_per_residual: f64,
}

/// A change as it is asked for: the effect's name in gap.json, and the maker's argument.
struct Asked {
    effect: String,
    argument: String,
}

/// Makes a pair in a folder.
pub(crate) fn pair(
    settings: &SimulatorPairs,
    case: String,
    planned: &Planned,
    duration_s: f64,
    folder: &Path,
    random: &mut ChaCha8Rng,
) -> Result<CaseLabel, WithheldError> {
    let Some(simulator) = SIMULATORS.get(planned.source) else {
        return reference_pairs::pair(case, planned, duration_s, folder, random);
    };
    for _ in 0..TRIES {
        let (name, car, most_s) = match planned.kind {
            Kind::OutOfLibrary => match simulator.richer.choose(random) {
                Some(richer) => (simulator.name, *richer, 20.0),
                None => (BARE.0, BARE.1, 24.0),
            },
            _ => (simulator.name, simulator.name, simulator.most_s),
        };
        let asked = asked(planned.kind, simulator, random);
        let seed: u32 = random.random();
        let Some(made) = run(settings, folder, name, car, &asked, seed, duration_s.min(most_s))? else {
            continue;
        };
        let hidden = made.excess.is_some_and(|excess| excess < LEAST_EXCESS);
        if hidden || made.changes.values().any(|c| c.severity < LEAST_SEVERITY) {
            continue;
        }
        let mut effects = Vec::new();
        for change in asked {
            let key = change.argument.split('=').next().unwrap_or_default();
            if let Some(made) = made.changes.get(key) {
                effects.push(sealed(&change.effect, key, made));
            }
        }
        let path = folder.join(files::SIMULATOR);
        let text = fs::read_to_string(&path).map_err(WithheldError::io(&path))?;
        let python = from_anywhere(&settings.python);
        let more = format!("python: '{}'\nprocesses: 1\ntime_limit_s: 600\n", python.display());
        fs::write(&path, text + &more).map_err(WithheldError::io(&path))?;
        let circumstances = [
            ("simulator", Value::from(name)),
            ("car", car.into()),
            ("seed", seed.into()),
            ("noise", made.noise.into()),
            ("excess", made.excess.into()),
        ];
        return Ok(CaseLabel {
            case,
            family: Family::Simulator,
            compared: false,
            kind: planned.kind,
            effects,
            without: Vec::new(),
            race_pace: true,
            contained: Vec::new(),
            circumstances: circumstances.map(|(k, v)| (k.to_owned(), v)).into(),
        });
    }
    Err(WithheldError::NothingShows {
        simulator: simulator.name.to_owned(),
        tries: TRIES,
        severity: LEAST_SEVERITY,
    })
}

/// What is to be changed.
fn asked(kind: Kind, simulator: &PairSimulator, random: &mut ChaCha8Rng) -> Vec<Asked> {
    let count = match kind {
        Kind::Single => 1,
        Kind::Pair => 2,
        _ => 0,
    };
    // Own parameters and effects around them are two halves.
    let mut out: Vec<Asked> = Vec::new();
    while out.len() < count {
        let amount: f64 = random.random_range(SMALLEST.ln()..0.0_f64).exp();
        let change = if random.random_bool(0.6) {
            let Some((name, share)) = simulator.own.choose(random) else { break };
            Asked {
                effect: format!("simulator.{name}"),
                argument: format!("{name}=x{:?}", share.powf(amount)),
            }
        } else {
            let Some(effect) = simulator.around.choose(random) else { break };
            let (name, size) = around(effect, simulator.name != "slipx", random);
            Asked { effect: (*effect).to_owned(), argument: format!("{name}={size:?}") }
        };
        if out.iter().all(|other| other.effect != change.effect) {
            out.push(change);
        }
    }
    out
}

fn run(
    settings: &SimulatorPairs,
    folder: &Path,
    name: &str,
    car: &str,
    asked: &[Asked],
    seed: u32,
    duration_s: f64,
) -> Result<Option<Made>, WithheldError> {
    let mut command = Command::new(&settings.python);
    command.arg(&settings.maker).arg(folder).arg(name).args(asked.iter().map(|a| &a.argument));
    command.args(["--seed", &seed.to_string(), "--duration", &duration_s.to_string(), "--car", car]);
    command.env("PYTHONDONTWRITEBYTECODE", "1").env("OMP_NUM_THREADS", "1");
    let fail = |said: String| WithheldError::Maker { command: format!("{}", settings.maker.display()), said };
    let output = command.output().map_err(|e| fail(e.to_string()))?;
    if output.status.code() == Some(NO_DRIVE) {
        return Ok(None);
    }
    if !output.status.success() {
        return Err(fail(String::from_utf8_lossy(&output.stderr).into_owned()));
    }
    serde_json::from_slice(&output.stdout).map(Some).map_err(|e| fail(e.to_string()))
}

fn sealed(effect: &str, key: &str, made: &MadeChange) -> SealedEffect {
    let parameters = BTreeMap::from([(key.to_owned(), made.value)]);
    SealedEffect {
        name: effect.to_owned(),
        library_parameters: parameters.clone(),
        parameters,
        oracle: (made.value != made.before).then_some(OracleFit {
            severity: made.severity,
            size_ratio: 1.0,
            chi2_per_residual: made.chi2_per_residual,
            excess_without: None,
        }),
    }
}

/// A program as it can be started from any folder: the simulator runs in that of its case. A bare name is one of the search path's.
fn from_anywhere(program: &Path) -> PathBuf {
    if program.components().count() < 2 {
        return program.to_owned();
    }
    std::path::absolute(program).unwrap_or_else(|_| program.to_owned())
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng as _;

    use super::*;

    #[test]
    fn changes_are_drawn_within_what_a_simulator_has() {
        let random = &mut ChaCha8Rng::seed_from_u64(1);
        for simulator in &SIMULATORS {
            assert!(asked(Kind::None, simulator, random).is_empty());
            for _ in 0..50 {
                let two = asked(Kind::Pair, simulator, random);
                assert!(two.len() == 2 && two[0].effect != two[1].effect);
                for change in two {
                    let own = change.effect.strip_prefix("simulator.");
                    let known = own.map_or(simulator.around.contains(&change.effect.as_str()), |name| {
                        simulator.own.iter().any(|(o, _)| *o == name)
                    });
                    assert!(known, "{}: {}", simulator.name, change.effect);
                }
            }
        }
    }

    /// A maker that finds that nothing shows at its first call, and keeps no car on the track at its second.
    const MAKER: &str = r#"
folder=$1
echo "adapter: $2" > $folder/simulator.yaml
touch $folder/bag.mcap $folder/heldout.mcap
calls=$(cat $folder/../calls 2>/dev/null || echo 0)
echo $((calls + 1)) > $folder/../calls
[ $calls = 1 ] && exit 3
severity=$([ $calls = 0 ] && echo 0.5 || echo 7.0)
echo "{\"noise\": [0.1], \"changes\": {\"${3%%=*}\": {\"value\": 2.0, \"before\": 1.0, \"severity\": $severity, \"chi2_per_residual\": 3.0}}}"
"#;

    #[test]
    fn a_python_beside_the_maker_is_found_from_the_case_s_folder() {
        assert_eq!(from_anywhere(Path::new("python3")), Path::new("python3"));
        let python = from_anywhere(Path::new(".venv/bin/python"));
        assert!(python.is_absolute() && python.ends_with(".venv/bin/python"), "{}", python.display());
    }

    #[test]
    fn a_change_that_does_not_show_is_drawn_anew_and_the_folder_does_not_tell_it() {
        let folder = tempfile::tempdir().unwrap();
        let maker = folder.path().join("maker.sh");
        fs::write(&maker, MAKER).unwrap();
        let settings = SimulatorPairs { maker, python: "/bin/sh".into(), cases: 1 };
        let planned =
            Planned { family: Family::Simulator, kind: Kind::Single, effects: Vec::new(), source: 1 };
        let case = folder.path().join("case");
        fs::create_dir(&case).unwrap();
        let random = &mut ChaCha8Rng::seed_from_u64(5);
        let label = pair(&settings, "case".to_owned(), &planned, 20.0, &case, random).unwrap();
        assert_eq!(fs::read_to_string(folder.path().join("calls")).unwrap().trim(), "3");
        let effect = &label.effects[0];
        assert_eq!((effect.oracle.unwrap().severity, label.kind), (7.0, Kind::Single));
        let key = effect.parameters.keys().next().unwrap();
        for file in fs::read_dir(&case).unwrap() {
            let text = fs::read_to_string(file.unwrap().path()).unwrap();
            assert!(!text.contains(key.as_str()), "{text}");
        }
        let failing = SimulatorPairs { python: "/bin/false".into(), ..settings };
        let error = pair(&failing, "case".to_owned(), &planned, 20.0, &case, random).unwrap_err();
        assert!(matches!(error, WithheldError::Maker { .. }), "{error}");
    }

    #[test]
    fn the_reference_car_as_a_simulator_is_told_without_its_changes() {
        let settings = SimulatorPairs { maker: "none".into(), python: "none".into(), cases: 1 };
        let planned =
            Planned { family: Family::Simulator, kind: Kind::Pair, effects: Vec::new(), source: COUNT - 1 };
        let folder = tempfile::tempdir().unwrap();
        let made = |seed: u64| {
            let random = &mut ChaCha8Rng::seed_from_u64(seed);
            pair(&settings, "case".to_owned(), &planned, 10.0, folder.path(), random).unwrap()
        };
        let label = made(1);
        assert_eq!(label.effects.len(), 2);
        assert!(label.effects.iter().all(|e| e.oracle.unwrap().severity >= LEAST_SEVERITY));
        let figures = fs::read_to_string(folder.path().join("parameters.yaml")).unwrap();
        for effect in &label.effects {
            let (key, value) = effect.parameters.iter().next().unwrap();
            assert!(!figures.contains(&format!("{key}: {value:?} ")), "{figures}");
        }
        assert_eq!(made(1), label);
        assert_ne!(made(2), label);
    }
}
