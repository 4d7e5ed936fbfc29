//! The table of laps, and the summary of its rows.

use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use crate::referee::Lap;
use crate::run::{Case, Run, Variant};
use crate::store::{mean, median, parts};

/// Behind the true tires by no more than this: converged.
const CONVERGED: f64 = 0.03;

/// How far behind the true tires a lap is asked to be at most.
const ASKED: [(usize, f64); 2] = [(3, 0.06), (5, 0.03)];

/// A lap. A run without a whole lap has one row, lap 0.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(crate) car: String,
    pub(crate) track: String,
    pub(crate) mu: f64,
    pub(crate) seed: u64,
    pub(crate) variant: String,
    lap: usize,
    time_s: f64,
    error_m: f64,
    worst_m: f64,
    used: f64,
    exits: u32,
    planned_grip: f64,
    set: String,
    wreck: String,
    run_seconds: f64,
    /// From the first corner to the first set, and what the one in use promises over the true grip.
    #[serde(default)]
    first_set_s: Option<f64>,
    #[serde(default)]
    promised: Option<f64>,
    /// Windows identified in the run, and those in which the grip was said to have changed, which it has not.
    #[serde(default)]
    looks: u32,
    #[serde(default)]
    told_changed: u32,
}

impl Row {
    /// Whether it is of this run.
    pub(crate) fn is_of(&self, case: &Case, variant: Variant) -> bool {
        self.same_place(&case.car.name, &case.track, case.mu, case.seed) && self.variant == variant.name()
    }

    fn same_place(&self, car: &str, track: &str, mu: f64, seed: u64) -> bool {
        self.car == car && self.track == track && self.mu == mu && self.seed == seed
    }
}

/// The rows of a run.
pub(crate) fn rows(case: &Case, variant: Variant, run: &Run, seconds: f64) -> Vec<Row> {
    let row = |number: usize, lap: &Lap| Row {
        car: case.car.name.clone(),
        track: case.track.clone(),
        mu: case.mu,
        seed: case.seed,
        variant: variant.name().to_owned(),
        lap: number,
        time_s: parts(lap.time_s, 1e3),
        error_m: parts(lap.error_m, 1e4),
        worst_m: parts(lap.worst_m, 1e4),
        used: parts(lap.used, 1e4),
        exits: lap.exits,
        planned_grip: parts(lap.planned, 1e4),
        set: lap.trust.map_or(String::new(), |t| format!("{t:?}")),
        wreck: if number == run.laps.len() { run.wreck.unwrap_or("").to_owned() } else { String::new() },
        run_seconds: parts(seconds, 1e2),
        first_set_s: run.first_set_s.map(|s| parts(s, 1e2)),
        promised: lap.promised.map(|grip| parts(grip, 1e4)),
        looks: run.looks[0],
        told_changed: run.looks[1],
    };
    if run.laps.is_empty() {
        return vec![row(0, &Lap { time_s: f64::NAN, ..Lap::default() })];
    }
    run.laps.iter().enumerate().map(|(k, lap)| row(k + 1, lap)).collect()
}

/// The laps of one run.
struct Driven<'a>(Vec<&'a Row>);

impl Driven<'_> {
    fn lap(&self, lap: usize) -> Option<&Row> {
        self.0.iter().find(|r| r.lap == lap + 1).copied()
    }
}

/// Runs of a car and a variant, in the order driven.
fn runs<'a>(rows: &'a [Row], car: &str, variant: Variant) -> Vec<Driven<'a>> {
    let mut runs: Vec<Driven<'a>> = Vec::new();
    for row in rows.iter().filter(|r| r.car == car && r.variant == variant.name()) {
        match runs.iter_mut().find(|d| d.0[0].same_place(&row.car, &row.track, row.mu, row.seed)) {
            Some(run) => run.0.push(row),
            None => runs.push(Driven(vec![row])),
        }
    }
    runs
}

/// As a percentage; a dash where the true tires were not driven.
fn behind_percent(share: f64) -> String {
    if share.is_finite() { format!("{:+.1} %", 100.0 * share) } else { "-".to_owned() }
}

/// Lap times against the true tires' on the same track, road and seed, and how well the line was kept.
pub(crate) fn summary(rows: &[Row]) -> String {
    let laps = rows.iter().map(|r| r.lap).max().unwrap_or(0);
    let mut text = String::new();
    let mut cars: Vec<&str> = Vec::new();
    for row in rows {
        if !cars.contains(&row.car.as_str()) {
            cars.push(&row.car);
        }
    }
    for car in cars {
        let truth = runs(rows, car, Variant::True);
        let best = |d: &Driven<'_>, lap: usize| {
            let first = d.0[0];
            let same = |t: &&Driven<'_>| t.0[0].same_place(&first.car, &first.track, first.mu, first.seed);
            truth.iter().find(same).and_then(|t| t.lap(lap)).map_or(f64::NAN, |l| l.time_s)
        };
        let most = Variant::ALL.map(|variant| runs(rows, car, variant).len()).into_iter().max();
        let _ = writeln!(text, "## {car}: {} runs a variant\n", most.unwrap_or(0));
        let heads: String = (1..=laps).map(|n| format!(" lap {n} |")).collect();
        let _ = writeln!(
            text,
            "| variant |{heads} laps until within 3 % | within what is asked: 6 % in lap 3, 3 % in lap 5 | farthest behind there | error mean (m) | worst (m) | grip used, last lap | times off the track, first lap and later | wrecks |\n|---|{}---|---|---|---|---|---|---|---|",
            "---|".repeat(laps)
        );
        for variant in Variant::ALL {
            let driven = runs(rows, car, variant);
            if driven.is_empty() {
                continue;
            }
            let behind =
                |d: &Driven<'_>, lap: usize| d.lap(lap).map_or(f64::NAN, |l| l.time_s / best(d, lap) - 1.0);
            let cells: String = (0..laps)
                .map(|lap| {
                    if variant == Variant::True {
                        format!(
                            " {:.2} s |",
                            mean(driven.iter().filter_map(|d| d.lap(lap)).map(|l| l.time_s))
                        )
                    } else {
                        format!(
                            " {} |",
                            behind_percent(median(driven.iter().map(|d| behind(d, lap)).collect()))
                        )
                    }
                })
                .collect();
            let until = |d: &Driven<'_>| {
                (0..laps)
                    .find(|&lap| behind(d, lap) <= CONVERGED)
                    .map_or(laps as f64 + 1.0, |lap| lap as f64 + 1.0)
            };
            let all = || driven.iter().flat_map(|d| d.0.iter().filter(|r| r.lap > 0));
            let until = median(driven.iter().map(until).collect());
            let until = if until > laps as f64 { "never".to_owned() } else { format!("{until}") };
            let asked = ASKED.map(|(lap, most)| {
                let there: Vec<f64> = driven.iter().map(|d| behind(d, lap - 1)).collect();
                (
                    there.iter().filter(|&&far| far <= most).count(),
                    there.iter().copied().fold(f64::NEG_INFINITY, f64::max),
                )
            });
            let [within, farthest] = if variant == Variant::True {
                [String::new(), String::new()]
            } else {
                let [(third, far_third), (fifth, far_fifth)] = asked;
                [
                    format!("{third}, {fifth} of {}", driven.len()),
                    format!("{}, {}", behind_percent(far_third), behind_percent(far_fifth)),
                ]
            };
            let exits = |first: bool| all().filter(|r| (r.lap == 1) == first).map(|r| r.exits).sum::<u32>();
            let _ = writeln!(
                text,
                "| {} |{cells} {until} | {within} | {farthest} | {:.3} | {:.3} | {:.1} % | {} + {} | {} |",
                variant.name(),
                mean(all().map(|l| l.error_m)),
                all().map(|l| l.worst_m).fold(0.0, f64::max),
                100.0 * mean(driven.iter().filter_map(|d| d.lap(laps - 1)).map(|l| l.used)),
                exits(true),
                exits(false),
                driven.iter().filter(|d| d.0.iter().any(|r| !r.wreck.is_empty())).count(),
            );
        }
        text.push('\n');
        text.push_str(&growth(rows, car));
        text.push_str(&prices(rows, car, laps));
    }
    text
}

/// What a prior may cost of the last lap's time beside driving without one.
const PRICE: f64 = 0.02;

/// What a prior, right or wrong, costs in the last lap.
fn prices(rows: &[Row], car: &str, laps: usize) -> String {
    let mut text = String::new();
    let without = runs(rows, car, Variant::NoPrior);
    for variant in [Variant::Prior, Variant::LieHigh, Variant::LieLow] {
        let price = |d: &Driven<'_>| {
            let first = d.0[0];
            let same = |o: &&Driven<'_>| o.0[0].same_place(&first.car, &first.track, first.mu, first.seed);
            let other = without.iter().find(same)?;
            Some(d.lap(laps - 1)?.time_s / other.lap(laps - 1)?.time_s - 1.0)
        };
        let prices: Vec<f64> = runs(rows, car, variant).iter().filter_map(price).collect();
        if prices.is_empty() {
            continue;
        }
        let _ = writeln!(
            text,
            "{}: lap {laps} against `identified`: {} in the median, more than {:.0} % slower in {} of {} runs, {} at most.",
            variant.name(),
            behind_percent(median(prices.clone())),
            100.0 * PRICE,
            prices.iter().filter(|&&price| price > PRICE).count(),
            prices.len(),
            behind_percent(prices.iter().copied().fold(f64::NEG_INFINITY, f64::max)),
        );
    }
    text.push('\n');
    text
}

/// Time until a first safe set is asked to be there, s, and share of the grip that the set of the third lap is asked to promise.
const SOON_S: f64 = 10.0;
const GROWN: (usize, f64) = (3, 0.95);

/// How soon there was a set, and how far it grew.
fn growth(rows: &[Row], car: &str) -> String {
    let mut text = String::new();
    for variant in Variant::ALL {
        let driven = runs(rows, car, variant);
        let first: Vec<f64> = driven.iter().filter_map(|d| d.0[0].first_set_s).collect();
        if first.is_empty() {
            continue;
        }
        let soon = first.iter().filter(|&&s| s <= SOON_S).count();
        let grown: Vec<f64> =
            driven.iter().filter_map(|d| d.lap(GROWN.0 - 1)).map(|r| r.promised.unwrap_or(0.0)).collect();
        let enough = grown.iter().filter(|&&share| share >= GROWN.1).count();
        let sum = |of: fn(&Row) -> u32| driven.iter().map(|d| of(d.0[0])).sum::<u32>();
        let (looks, told) = (sum(|r| r.looks), sum(|r| r.told_changed));
        let _ = writeln!(
            text,
            "{}: a set {SOON_S} s after the first corner in {soon} of {} runs, {:.1} s in the median; at the end of lap {} it promises {:.0} % of the true grip in the median, {:.0} % or more in {enough} of {}. The grip was said to have changed, which it had not, in {told} of {looks} windows.",
            variant.name(),
            driven.len(),
            median(first),
            GROWN.0,
            100.0 * median(grown.clone()),
            100.0 * GROWN.1,
            grown.len(),
        );
    }
    text.push('\n');
    text
}
