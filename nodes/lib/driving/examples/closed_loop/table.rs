//! The tables of what was driven.

use std::fmt::Write as _;

use crate::Driven;
use crate::run::{Lap, Variant};

/// Behind the true tires by no more than this: converged.
const CONVERGED: f64 = 0.03;

/// A row a lap.
pub(crate) fn laps_csv(driven: &[Driven]) -> String {
    let mut text = String::from(
        "car,track,mu,seed,variant,lap,time_s,error_m,worst_m,used,exits,planned_grip,set,wreck,run_seconds\n",
    );
    for d in driven {
        let case = &d.case;
        let end = |lap: usize| if lap == d.run.laps.len() { d.run.wreck.unwrap_or("") } else { "" };
        let mut row = |number: usize, lap: &Lap| {
            let _ = writeln!(
                text,
                "{},{},{},{},{},{number},{:.3},{:.4},{:.4},{:.4},{},{:.4},{},{},{:.2}",
                case.car.name,
                case.track,
                case.mu,
                case.seed,
                d.variant.name(),
                lap.time_s,
                lap.error_m,
                lap.worst_m,
                lap.used,
                lap.exits,
                lap.planned,
                lap.trust.map_or(String::new(), |t| format!("{t:?}")),
                end(number),
                d.seconds,
            );
        };
        d.run.laps.iter().enumerate().for_each(|(k, lap)| row(k + 1, lap));
        if d.run.laps.is_empty() {
            row(0, &Lap { time_s: f64::NAN, ..Lap::default() });
        }
    }
    text
}

fn median(mut values: Vec<f64>) -> f64 {
    values.retain(|v| v.is_finite());
    values.sort_by(f64::total_cmp);
    if values.is_empty() {
        f64::NAN
    } else {
        0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2])
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    if count > 0.0 { sum / count } else { f64::NAN }
}

/// Lap times against the true tires' on the same track, road and seed, and how well the line was kept.
pub(crate) fn summary(driven: &[Driven]) -> String {
    let laps = driven.iter().map(|d| d.case.laps).max().unwrap_or(0);
    let mut text = String::new();
    let mut cars: Vec<&str> = driven.iter().map(|d| d.case.car.name.as_str()).collect();
    cars.dedup();
    for car in cars {
        let of =
            |variant: Variant| driven.iter().filter(move |d| d.case.car.name == car && d.variant == variant);
        let best = |d: &Driven, lap: usize| {
            let same = |other: &&Driven| {
                other.case.track == d.case.track
                    && other.case.mu == d.case.mu
                    && other.case.seed == d.case.seed
            };
            of(Variant::True).find(same).and_then(|t| t.run.laps.get(lap)).map_or(f64::NAN, |l| l.time_s)
        };
        let _ = writeln!(text, "## {car}: {} runs a variant\n", of(Variant::True).count());
        let heads: String = (1..=laps).map(|n| format!(" lap {n} |")).collect();
        let _ = writeln!(
            text,
            "| variant |{heads} laps until within 3 % | error mean (m) | worst (m) | grip used, last lap | times off the track | wrecks |\n|---|{}---|---|---|---|---|---|",
            "---|".repeat(laps)
        );
        for variant in Variant::ALL.into_iter().filter(|v| of(*v).next().is_some()) {
            let behind = |d: &Driven, lap: usize| {
                d.run.laps.get(lap).map_or(f64::NAN, |l| l.time_s / best(d, lap) - 1.0)
            };
            let cells: String = (0..laps)
                .map(|lap| {
                    if variant == Variant::True {
                        let times = of(variant).filter_map(|d| d.run.laps.get(lap)).map(|l| l.time_s);
                        format!(" {:.2} s |", mean(times))
                    } else {
                        format!(" {:+.1} % |", 100.0 * median(of(variant).map(|d| behind(d, lap)).collect()))
                    }
                })
                .collect();
            let until = |d: &Driven| {
                (0..laps)
                    .find(|&lap| behind(d, lap) <= CONVERGED)
                    .map_or(laps as f64 + 1.0, |lap| lap as f64 + 1.0)
            };
            let all = || of(variant).flat_map(|d| &d.run.laps);
            let until = median(of(variant).map(until).collect());
            let until = if until > laps as f64 { "never".to_owned() } else { format!("{until}") };
            let _ = writeln!(
                text,
                "| {} |{cells} {until} | {:.3} | {:.3} | {:.1} % | {} | {} |",
                variant.name(),
                mean(all().map(|l| l.error_m)),
                all().map(|l| l.worst_m).fold(0.0, f64::max),
                100.0 * mean(of(variant).filter_map(|d| d.run.laps.get(laps - 1)).map(|l| l.used)),
                all().map(|l| l.exits).sum::<u32>(),
                of(variant).filter(|d| d.run.wreck.is_some()).count(),
            );
        }
        text.push('\n');
    }
    text
}
