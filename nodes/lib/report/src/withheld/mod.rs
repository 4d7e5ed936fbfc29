//! The page of the blind check: targets beside what was reached, and where it was missed.

mod pictures;
mod tables;

use gripsight_withheld_score::Scores;
use maud::html;

use crate::ReportError;
use crate::page::{Sheet, Tone, document, figure, section};

/// What the page of a score shows.
#[derive(Debug, Clone, Copy)]
pub struct WithheldInput<'a> {
    /// The scores.
    pub scores: &'a Scores,
    /// Name of the batch.
    pub batch: &'a str,
    /// Hash that the labels were sealed with, which they matched.
    pub commitment: &'a str,
    /// Version that diagnosed.
    pub tool_version: &'a str,
    /// Hash of the program that diagnosed.
    pub executable_sha256: &'a str,
    /// Seed of the batch.
    pub seed: u64,
    /// The exact command.
    pub command: &'a str,
}

/// The page of a score, as one HTML file.
///
/// # Errors
/// [`ReportError::Drawing`].
pub fn withheld_page(input: &WithheldInput<'_>) -> Result<String, ReportError> {
    let scores = input.scores;
    let body = html! {
        @for family in &scores.families {
            (section(&format!("Targets: {}", tables::family(family.family)), true, &tables::lines(family)))
        }
        (section("Named over severity", false, &figure(&pictures::severity(scores), pictures::SEVERITY_REMARK)?))
        (section("Stated confidence", false, &figure(&pictures::confidence(scores), "95 % intervals; a perfect forecaster's points lie about the line.")?))
        (section("Stated size over true size", false, &figure(&pictures::sizes(scores), "Rightly named effects, in the order of their names.")?))
        (section("Shrinkage on the held-out bag", false, &figure(&pictures::shrinkage(scores), "A case a point; the oracle is the same engine, told the names.")?))
        (section("Effect by effect (reference car, one and two effects)", true, &tables::effects(scores)))
        @for family in &scores.families {
            (section(&format!("What was said of what was true: {}", tables::family(family.family)), true, &tables::confusion(family)))
        }
        (section("Missed, within the scope of the targets", true, &tables::misses(scores)))
        (section("Control on files alone", false, &tables::control(scores)))
        (section("Simpler methods, one effect", false, &tables::baselines(scores)))
    };
    let lines = || scores.families.iter().flat_map(|f| &f.lines);
    let (asked, met) =
        (lines().filter(|l| l.met.is_some()).count(), lines().filter(|l| l.met == Some(true)).count());
    let seed = input.seed.to_string();
    let tool = format!("gripsight {}", input.tool_version);
    let cases = scores.families.iter().map(|f| f.cases).sum::<usize>().to_string();
    let sheet = Sheet {
        title: "Blind check",
        subject: input.batch,
        tone: if asked == met { Tone::Good } else { Tone::Caution },
        verdict: &format!("{met} of {asked} targets are met."),
        facts: &[
            ("Cases", &cases),
            ("Seed", &seed),
            ("Tool", &tool),
            ("Labels, SHA-256", input.commitment),
            ("Program, SHA-256", input.executable_sha256),
            ("Targets fixed", &scores.targets.fixed),
        ],
        command: input.command,
    };
    Ok(document(&sheet, &body))
}
