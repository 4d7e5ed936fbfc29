//! Effects that the controller's model does not have: what a diagnosis, a name told and a wrong name are worth to who drives.

use std::collections::VecDeque;
use std::fmt::Write as _;
use std::time::Instant;

use anyhow::{Result, bail};
use gripsight_diagnosis::{Diagnosis, Earlier, Request, Verdict, diagnose};
use gripsight_driving::{Named, Trial};
use gripsight_identification::Usable;
use gripsight_reference_car::{CarParameters, EffectSetting, SensorSample};
use gripsight_signals::{AlignConfig, Aligner, StateSequence, TelemetrySample};
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};
use serde::{Deserialize, Serialize};

use crate::drive::Loop;
use crate::learner::take_identified;
use crate::run::Case;
use crate::store::{Store, mean, parts};
use crate::{Arguments, plant};

/// Telemetry to diagnose from.
const WINDOW_S: f64 = 30.0;
/// Laps before the first diagnosis or name, and from which laps count: the last name was given a lap before.
const FIRST: usize = 2;
const COUNT: usize = 4;
/// Share of the grip to drive with: at the limit a late steering ends in the first corner, and so does a rear axle with 85 % of its grip.
const PACE: f64 = 0.75;

/// What is wrong with the car, at a size of its class.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wrong {
    Delay,
    Lag,
    Shifted,
    Worn,
}

impl Wrong {
    const ALL: [Self; 4] = [Self::Delay, Self::Lag, Self::Shifted, Self::Worn];

    fn name(self) -> &'static str {
        match self {
            Self::Delay => "steering_delay",
            Self::Lag => "steering_lag",
            Self::Shifted => "v_y_lever_arm",
            Self::Worn => "worn_rear_axle",
        }
    }

    fn settings(self, small: bool) -> Vec<(&'static str, f64)> {
        match self {
            Self::Delay => vec![("steering_delay", 0.08)],
            Self::Lag => vec![("steering_lag", 0.12)],
            Self::Shifted => vec![("v_y_lever_arm", if small { 0.15 } else { 1.2 })],
            Self::Worn => vec![("grip_scale", -0.08), ("grip_balance", 0.08)],
        }
    }

    /// What a controller is told of it.
    fn named(self, small: bool) -> Named {
        let mut named = Named::default();
        for (name, value) in self.settings(small) {
            named.take_in(name, |_| Some(value));
        }
        named
    }

    /// Another one, for a diagnosis that is wrong on purpose.
    fn another(self) -> Self {
        match self {
            Self::Delay => Self::Shifted,
            Self::Lag => Self::Worn,
            Self::Shifted => Self::Delay,
            Self::Worn => Self::Lag,
        }
    }
}

/// What the driver knows of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Knows {
    /// Nothing.
    Without,
    /// What is diagnosed after each lap, where the last lap agrees.
    Diagnosed,
    /// A wrong name after each lap, where the last lap agrees.
    WrongName,
    /// The wrong name, believed.
    WrongBelieved,
    /// What it is, from the start.
    Told,
}

impl Knows {
    const ALL: [Self; 5] = [Self::Without, Self::Diagnosed, Self::WrongName, Self::WrongBelieved, Self::Told];

    fn name(self) -> &'static str {
        match self {
            Self::Without => "without",
            Self::Diagnosed => "diagnosed",
            Self::WrongName => "wrong_name",
            Self::WrongBelieved => "wrong_believed",
            Self::Told => "told",
        }
    }
}

/// A lap. A run without a whole lap has one row, lap 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Row {
    car: String,
    track: String,
    mu: f64,
    seed: u64,
    effect: String,
    knows: String,
    lap: usize,
    time_s: f64,
    error_m: f64,
    worst_m: f64,
    exits: u32,
    /// What was named at its end, and what the trial on the lap said.
    named: String,
    ratio: Option<f64>,
    taken: bool,
    wreck: String,
    run_seconds: f64,
}

/// Drives what was asked for and is not in effects.csv yet; the summary.
pub(crate) fn experiment(arguments: &Arguments) -> Result<String> {
    arguments.check(&Knows::ALL.map(Knows::name))?;
    let store = Store::<Row>::open(&arguments.out.join("effects.csv"))?;
    let mut work = Vec::new();
    for car in &arguments.cars {
        let car = CarParameters::by_name(car)?;
        for &mu in &arguments.frictions {
            let tires = plant::projection(&car, mu)?;
            for seed in arguments.seeds() {
                for track in &arguments.tracks {
                    let case = Case {
                        car: car.clone(),
                        track: track.clone(),
                        mu,
                        seed,
                        laps: COUNT + 2,
                        tires,
                        controller: arguments.controller,
                    };
                    for wrong in Wrong::ALL {
                        work.extend(Knows::ALL.map(|knows| (case.clone(), wrong, knows)));
                    }
                }
            }
        }
    }
    work.retain(|(case, wrong, knows)| {
        arguments.asks_for(knows.name())
            && !store.rows.iter().any(|r| {
                (r.car.as_str(), r.track.as_str(), r.mu, r.seed)
                    == (&case.car.name, &case.track, case.mu, case.seed)
                    && (r.effect.as_str(), r.knows.as_str()) == (wrong.name(), knows.name())
            })
    });
    let rows = store.fill(work, arguments.verbose, |(case, wrong, knows)| {
        drive(&case, wrong, knows, arguments.verbose)
    })?;
    Ok(summary(&rows))
}

/// Telemetry of the last laps.
pub(crate) struct Recent {
    aligner: Aligner,
    samples: VecDeque<TelemetrySample>,
}

impl Default for Recent {
    fn default() -> Self {
        Self { aligner: Aligner::new(AlignConfig::default()), samples: VecDeque::new() }
    }
}

impl Recent {
    pub(crate) fn push(&mut self, sample: &SensorSample) -> Result<()> {
        self.aligner.push(sample.measurement(1_000_000_000))?;
        while let Some(aligned) = self.aligner.poll() {
            let from_ns = aligned.odometry.stamp_ns - (WINDOW_S * 1e9) as i64;
            self.samples.push_back(aligned);
            while self.samples.front().is_some_and(|first| first.odometry.stamp_ns < from_ns) {
                self.samples.pop_front();
            }
        }
        Ok(())
    }

    fn sequence(&self) -> Result<StateSequence> {
        let samples: Vec<TelemetrySample> = self.samples.iter().cloned().collect();
        Ok(StateSequence::from_samples(&samples)?)
    }

    /// What later telemetry is compared with.
    fn as_earlier(&self, vehicle: &VehicleParameters) -> Result<Earlier> {
        let usable = Usable::measured_or_estimated(&self.sequence()?, vehicle)?;
        Ok(Earlier::diagnosed(&Request::new(&usable.sequence, vehicle), &mut |_| {})?)
    }

    /// What a diagnosis from the tires in use names; where none of it is of use, what one says has changed since a drive before.
    fn diagnose(
        &self,
        vehicle: &VehicleParameters,
        tires: PacejkaParameters,
        earlier: &Earlier,
    ) -> Result<Found> {
        let usable = Usable::measured_or_estimated(&self.sequence()?, vehicle)?;
        let request = Request::new(&usable.sequence, vehicle);
        let alone = Found::of(&diagnose(&Request { tires: Some(tires), ..request.clone() }, &mut |_| {})?);
        if alone.named != Named::default() {
            return Ok(alone);
        }
        let since = Found::of(&diagnose(&Request { earlier: Some(earlier), ..request }, &mut |_| {})?);
        Ok(Found { words: format!("{}; since before: {}", alone.words, since.words), ..since })
    }
}

/// What a diagnosis says, as far as a controller has a use for it.
#[derive(Debug)]
struct Found {
    named: Named,
    /// Whether the tires are others, and nothing else is: then a set is in use that is of them no more.
    other_tires: bool,
    words: String,
}

impl Found {
    fn of(diagnosis: &Diagnosis) -> Self {
        let (mut named, mut words) = (Named::default(), vec![diagnosis.verdict.name().to_owned()]);
        for effect in diagnosis.effects.iter().filter(|e| e.accepted) {
            let value = |name: &str| effect.parameters.get(name).map(|p| p.value);
            let used = named.take_in(effect.name, value);
            let sizes = effect.parameters.iter().map(|(name, p)| format!(" {name} {:.3}", p.value));
            let sizes = sizes.collect::<String>();
            words.push(format!("{}{sizes}{}", effect.name, if used { "" } else { " (no use)" }));
        }
        for (change, slip_rad) in diagnosis.changes.iter().filter_map(|c| Some((c, c.at_slip_rad?))) {
            let d = &change.difference;
            words.push(format!(
                "{} {:.3} of {:.3} at {slip_rad:.3} rad",
                change.site,
                d.value,
                d.before.unwrap_or(f64::NAN)
            ));
        }
        let other_tires = diagnosis.verdict == Verdict::TireRetuneOnly && !diagnosis.changes.is_empty();
        Self { named, other_tires, words: words.join(" ") }
    }
}

/// A drive before the car had the effect, at the same pace.
fn before(case: &Case) -> Result<Earlier> {
    let case = Case { seed: case.seed + 1000, ..case.clone() };
    let mut run = Loop::paced(&case, case.tires, &[], PACE, false)?;
    run.recent = Some(Recent::default());
    while run.sim.time_s() < WINDOW_S {
        if let Some(reason) = run.look()? {
            bail!("the drive before the effect ended: {reason}");
        }
    }
    let recent = run.recent.take().unwrap_or_default();
    recent.as_earlier(&run.vehicle)
}

/// What was said at the end of a lap, and what became of it.
#[derive(Debug, Clone, Default)]
struct Said {
    words: String,
    trial: Option<Trial>,
    /// Whether the driver drives with it from now on.
    taken: bool,
}

fn drive(case: &Case, wrong: Wrong, knows: Knows, verbose: bool) -> Result<Vec<Row>> {
    let begin = Instant::now();
    let earlier = if knows == Knows::Diagnosed { Some(before(case)?) } else { None };
    let small = case.car.name == "f1tenth";
    let settings = wrong.settings(small).into_iter().map(|(name, value)| EffectSetting::new(name, &[value]));
    let settings = settings.collect::<Result<Vec<_>, _>>()?;
    let mut run = Loop::paced(case, case.tires, &settings, PACE, verbose)?;
    run.recent = Some(Recent::default());
    match knows {
        Knows::Told => run.driver.tell(wrong.named(small)),
        Knows::WrongBelieved => run.driver.tell(wrong.another().named(small)),
        _ => {}
    }
    let longest_s = 6.0 * case.laps as f64 * run.referee.fastest_lap_s();
    let (mut wreck, mut said) = (None, Vec::new());
    while wreck.is_none() && run.referee.laps.len() < case.laps {
        wreck = run.look()?;
        if run.sim.time_s() > longest_s {
            wreck = wreck.or(Some("too slow"));
        }
        while said.len() < run.referee.laps.len() {
            let mut line = Said::default();
            if said.len() + 1 >= FIRST {
                let named = match (knows, &run.recent, &earlier) {
                    (Knows::Diagnosed, Some(recent), Some(earlier)) => {
                        match recent.diagnose(&run.vehicle, case.tires.tires, earlier) {
                            Ok(found) => {
                                line.words = found.words;
                                if found.other_tires {
                                    let sequence = recent.sequence()?;
                                    line.taken =
                                        take_identified(&mut run.driver, &run.vehicle, &sequence, verbose);
                                }
                                Some(found.named)
                            }
                            Err(error) => {
                                line.words = format!("{error:#}");
                                None
                            }
                        }
                    }
                    (Knows::WrongName, ..) => {
                        line.words = wrong.another().name().to_owned();
                        Some(wrong.another().named(small))
                    }
                    _ => None,
                };
                let new = named.filter(|named| named != run.driver.named());
                line.trial = new.and_then(|named| run.driver.take_named(named));
                line.taken |= line.trial.is_some_and(|trial| trial.taken);
            }
            if verbose {
                eprintln!("{} {} lap {}: {line:?}", wrong.name(), knows.name(), said.len() + 1);
            }
            said.push(line);
        }
    }
    let run_seconds = parts(begin.elapsed().as_secs_f64(), 1e2);
    let laps = &run.referee.laps;
    let row = |number: usize| {
        let lap = laps.get(number.wrapping_sub(1)).copied().unwrap_or_default();
        let Said { words: named, trial, taken } =
            said.get(number.wrapping_sub(1)).cloned().unwrap_or_default();
        Row {
            car: case.car.name.clone(),
            track: case.track.clone(),
            mu: case.mu,
            seed: case.seed,
            effect: wrong.name().to_owned(),
            knows: knows.name().to_owned(),
            lap: number,
            time_s: parts(lap.time_s, 1e3),
            error_m: parts(lap.error_m, 1e4),
            worst_m: parts(lap.worst_m, 1e4),
            exits: lap.exits,
            named,
            ratio: trial.map(|t| parts(t.ratio, 1e3)),
            taken,
            wreck: if number == laps.len() { wreck.unwrap_or("").to_owned() } else { String::new() },
            run_seconds,
        }
    };
    Ok(if laps.is_empty() { vec![row(0)] } else { (1..=laps.len()).map(row).collect() })
}

/// A table for each car.
fn summary(rows: &[Row]) -> String {
    let mut text = String::new();
    let mut cars: Vec<&str> = rows.iter().map(|r| r.car.as_str()).collect();
    cars.dedup();
    cars.sort_unstable();
    cars.dedup();
    for car in cars {
        let _ = writeln!(
            text,
            "## {car}\n\n| effect | driver | runs | error mean (m), laps {COUNT} on | worst (m) | lap (s) | exits, all laps | wrecks | names tried | taken |\n|---|---|---|---|---|---|---|---|---|---|"
        );
        for wrong in Wrong::ALL {
            for knows in Knows::ALL {
                let all = || {
                    rows.iter()
                        .filter(move |r| r.car == car && r.effect == wrong.name() && r.knows == knows.name())
                };
                let runs = all().filter(|r| r.lap <= 1).count();
                if runs == 0 {
                    continue;
                }
                let late = || all().filter(|r| r.lap >= COUNT);
                let _ = writeln!(
                    text,
                    "| {} | {} | {runs} | {} | {} | {} | {} | {} | {} | {} |",
                    wrong.name(),
                    knows.name(),
                    cell(mean(late().map(|r| r.error_m)), 3),
                    cell(late().map(|r| r.worst_m).fold(f64::NAN, f64::max), 3),
                    cell(mean(late().map(|r| r.time_s)), 2),
                    all().map(|r| r.exits).sum::<u32>(),
                    all().filter(|r| !r.wreck.is_empty() || r.lap == 0).count(),
                    all().filter(|r| r.ratio.is_some()).count(),
                    all().filter(|r| r.taken).count(),
                );
            }
        }
        text.push('\n');
    }
    text
}

/// A figure of the laps counted; a dash where no run came to them.
fn cell(value: f64, digits: usize) -> String {
    if value.is_finite() { format!("{value:.digits$}") } else { "-".to_owned() }
}
