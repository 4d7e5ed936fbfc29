//! The page of a track's calibration: pictures beside what is said of them.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use maud::{Markup, html};

use crate::page::{Sheet, Tone, document, section, table};
use crate::text::fixed;

/// Error below which what is known of a floor is of use.
const USEFUL_ERROR: f64 = 0.15;

/// One picture that a calibration rests on.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationPicture {
    /// The floor or drive that it comes from.
    pub source: String,
    /// The region that was read, as a JPEG file.
    pub jpeg: Vec<u8>,
    /// The friction stated or identified there.
    pub label: f64,
    /// What the calibration says.
    pub mu: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// What the network says, where it is believed.
    pub network_mu: Option<f64>,
}

/// What the page shows.
#[derive(Debug, Clone, Copy)]
pub struct CalibrationInput<'a> {
    /// The track's name.
    pub track: &'a str,
    /// The calibration's hash.
    pub hash: &'a str,
    /// Version of the tool.
    pub tool_version: &'a str,
    /// The exact command.
    pub command: &'a str,
    /// Root mean square error on parts left out.
    pub known_error: f64,
    /// The network's.
    pub network_error: f64,
    /// The error where a whole floor or drive is left out; none with one alone.
    pub new_source_error: Option<f64>,
    /// Share of left-out pictures within one sigma.
    pub within_sigma: f64,
    /// Pictures that it rests on.
    pub count: usize,
    /// Some of them, source by source.
    pub pictures: &'a [CalibrationPicture],
}

/// The page, as one HTML file.
#[must_use]
pub fn calibration_page(input: &CalibrationInput<'_>) -> String {
    let mut sources: Vec<&str> = input.pictures.iter().map(|p| p.source.as_str()).collect();
    sources.dedup();
    let useful = input.known_error < USEFUL_ERROR.min(input.network_error);
    let verdict = if useful {
        format!("Known floors are read with an error of {}.", fixed(input.known_error, 2))
    } else {
        format!(
            "These pictures hardly tell their floors apart: error {} on what was left out. More pictures, or a better region, are needed.",
            fixed(input.known_error, 2)
        )
    };
    let rows = [
        ["pictures left out part by part".to_owned(), fixed(input.known_error, 3)],
        [
            "whole floors or drives left out".to_owned(),
            input.new_source_error.map_or("one only".into(), |e| fixed(e, 3)),
        ],
        ["the network, here and on roads elsewhere".to_owned(), fixed(input.network_error, 3)],
        [
            "left-out pictures within one sigma (68 % expected)".to_owned(),
            crate::text::percent(input.within_sigma),
        ],
    ];
    let body = html! {
        (section("Error of the friction", true, &html! {
            (table(["Read", "Error"], &rows))
            p { "A floor unlike all of these is said to be new; the network's reading then stands for it, as wide as its error." }
        }))
        @for source in sources { (section(source, true, &seen(input.pictures, source))) }
    };
    let (pictures, floors) = (input.count.to_string(), input.pictures.len().to_string());
    let facts = [
        ("Track", input.track),
        ("Pictures", pictures.as_str()),
        ("Shown", &floors),
        ("Hash", input.hash),
        ("Tool", input.tool_version),
    ];
    let tone = if useful { Tone::Good } else { Tone::Caution };
    let sheet = Sheet {
        title: "Friction calibration",
        subject: input.track,
        tone,
        verdict: &verdict,
        facts: &facts,
        command: input.command,
    };
    document(&sheet, &body)
}

fn seen(pictures: &[CalibrationPicture], source: &str) -> Markup {
    html! {
        div.seen {
            @for p in pictures.iter().filter(|p| p.source == source) {
                div {
                    img src=(format!("data:image/jpeg;base64,{}", STANDARD.encode(&p.jpeg))) alt=(p.source);
                    div { "road " (fixed(p.label, 2)) }
                    div.missed[(p.mu - p.label).abs() > 2.0 * p.sigma] { "read " (fixed(p.mu, 2)) " ± " (fixed(p.sigma, 2)) }
                    div { "network " (p.network_mu.map_or("in doubt".to_owned(), |mu| fixed(mu, 2))) }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_picture_stands_beside_what_is_said_of_it() {
        let picture = |source: &str, mu: f64| CalibrationPicture {
            source: source.to_owned(),
            jpeg: vec![0xff, 0xd8, 0xff],
            label: 0.55,
            mu,
            sigma: 0.04,
            network_mu: None,
        };
        let pictures = [picture("tiles", 0.56), picture("carpet", 0.9)];
        let input = CalibrationInput {
            track: "lab",
            hash: "0123",
            tool_version: "1",
            command: "gripsight friction calibrate",
            known_error: 0.05,
            network_error: 0.27,
            new_source_error: None,
            within_sigma: 0.7,
            count: 20,
            pictures: &pictures,
        };
        let page = calibration_page(&input);
        for part in [
            "data:image/jpeg;base64,/9j/",
            "tiles",
            "read 0.56 ± 0.04",
            "class=\"missed\"",
            "in doubt",
            "h1 class=\"good\"",
        ] {
            assert!(page.contains(part), "{part}");
        }
        assert!(calibration_page(&CalibrationInput { known_error: 0.2, ..input }).contains("hardly"));
    }
}
