//! Learning: the function's shape and its sigma by what is left out.

use std::collections::BTreeMap;

use crate::appearance::APPEARANCE;
use crate::embedding::EMBEDDED;
use crate::error::FrictionError;

use super::process::{Kernel, Mixture, Pairs, Process};
use super::{Calibration, Errors, Example, NETWORK_ERROR, bad, is_known_length, scale_of, scaled};

/// Pictures from which on there is something to learn.
const LEAST_EXAMPLES: usize = 3;
/// Pictures that are kept at most.
const MOST_EXAMPLES: usize = 400;
/// The least spread of a label: nobody knows a floor's friction better.
const LEAST_SIGMA: f64 = 0.02;
/// So many sources count what is known of the network on roads elsewhere.
const ELSEWHERE: f64 = 3.0;
/// Share of the left-out pictures that look as near to an example as a known floor must, and the margin on it.
const NEAR_SHARE: f64 = 0.9;
const NEAR_MARGIN: f64 = 1.3;
/// Pictures of one place differ by this much, in scales.
const LEAST_NEW_DISTANCE: f64 = 0.6;

/// How much the shapes' shares, which come from these very parts, flatter sigma, over the root of the number of parts.
const CHOSEN: f64 = 0.9;
/// How much of what was left out counts in a shape's share: parts of a source are alike.
const COUNTED: f64 = 0.5;
/// Shapes with less than this share of the likeliest one's do not speak.
const LEAST_SHARE: f64 = 0.05;

const LENGTHS: [f64; 5] = [0.5, 0.7, 1.0, 1.4, 2.0];
const LINEAR: [f64; 2] = [0.0, 0.05];
const NOISES: [f64; 5] = [0.03, 0.06, 0.1, 0.15, 0.2];

impl Calibration {
    /// Learns from examples; of more than 400 every n-th counts, source by source. The same examples in the same order give the same bits.
    ///
    /// # Errors
    /// [`FrictionError::BadCalibration`] for fewer than three examples, or figures that are no friction or not finite.
    pub fn learn(track: &str, examples: &[Example]) -> Result<Self, FrictionError> {
        let examples = kept(examples);
        if examples.len() < LEAST_EXAMPLES {
            return Err(bad(format!(
                "{} usable pictures: at least {LEAST_EXAMPLES} are needed",
                examples.len()
            )));
        }
        let numbers = examples[0].appearance.len();
        for e in &examples {
            let fine = is_known_length(numbers) && e.appearance.iter().all(|x| x.is_finite());
            if !fine || !(0.01..=3.0).contains(&e.mu) || !(0.0..=1.0).contains(&e.sigma) {
                return Err(bad(format!(
                    "a picture of {}: expected {} finite numbers, or {} with the embedding, a friction of 0.01 to 3 and a sigma of 0 to 1, got {} numbers, {} and {}",
                    e.source,
                    APPEARANCE.len(),
                    APPEARANCE.len() + EMBEDDED,
                    e.appearance.len(),
                    e.mu,
                    e.sigma
                )));
            }
        }
        let (mean, scale) = scale_of(&examples);
        let inputs: Vec<Vec<f64>> = examples.iter().map(|e| scaled(&e.appearance, &mean, &scale)).collect();
        let weights = balanced(&examples);
        let parts = parts(&examples);
        let pairs = Pairs::of(&inputs);
        let mut scores = vec![];
        for kernel in kernels() {
            let left_out = process(kernel, &pairs, &examples)?.left_out(&parts);
            scores.push((surprise(&left_out, &weights), kernel));
        }
        let mut members = vec![];
        for (share, kernel) in shares(&scores, parts.len()) {
            members.push((share, process(kernel, &pairs, &examples)?));
        }
        let process = Mixture::new(inputs, members);
        let left_out = process.left_out(&parts);
        let (known, sigma_factor, within_sigma) = spread(&left_out, &weights, parts.len());
        let sources = grouped(&examples, |e| (e.source.clone(), 0));
        let new_source =
            (sources.len() > 1).then(|| spread(&process.left_out(&sources), &weights, sources.len()).0);
        let errors = Errors { known, network: network_error(&examples, &sources), new_source, within_sigma };
        let new_distance = new_distance(&pairs, examples.len(), &parts);
        Ok(Self {
            track: track.to_owned(),
            examples,
            errors,
            mean,
            scale,
            sigma_factor,
            new_distance,
            process,
        })
    }
}

/// The shapes that speak, and their shares: how likely each makes what was left out of it. One shape alone would be believed beyond what the examples say.
fn shares(scores: &[(f64, Kernel)], parts: usize) -> Vec<(f64, Kernel)> {
    let least = scores.iter().map(|(score, _)| *score).fold(f64::INFINITY, f64::min);
    let likely = |score: f64| (-COUNTED * parts as f64 * (score - least)).exp();
    let mut shares: Vec<(f64, Kernel)> =
        scores.iter().map(|(score, kernel)| (likely(*score), *kernel)).collect();
    shares.retain(|(share, _)| *share >= LEAST_SHARE);
    let sum: f64 = shares.iter().map(|(share, _)| share).sum();
    shares.iter_mut().for_each(|(share, _)| *share /= sum);
    shares
}

fn kernels() -> impl Iterator<Item = Kernel> {
    LENGTHS.into_iter().flat_map(|length| {
        LINEAR
            .into_iter()
            .flat_map(move |linear| NOISES.into_iter().map(move |noise| Kernel { length, linear, noise }))
    })
}

fn process(kernel: Kernel, pairs: &Pairs, examples: &[Example]) -> Result<Process, FrictionError> {
    let labels: Vec<f64> = examples.iter().map(|e| e.mu).collect();
    let sigmas: Vec<f64> = examples.iter().map(|e| e.sigma.max(LEAST_SIGMA)).collect();
    Process::new(kernel, pairs, &labels, &sigmas)
}

/// As the file has them, so that a calibration read back is the same to the bit; thinned where there are too many, and of the numbers that all of them have:
/// a track taught before there was an embedding goes on without it until those pictures are gone.
fn kept(examples: &[Example]) -> Vec<Example> {
    let rounded = |x: f64| (x * 1e4).round() / 1e4;
    let stride = examples.len().div_ceil(MOST_EXAMPLES).max(1);
    let common = examples.iter().map(|e| e.appearance.len()).min().unwrap_or(0);
    let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
    let mut kept = vec![];
    for e in examples {
        let count = seen.entry(&e.source).or_default();
        if count.is_multiple_of(stride) {
            kept.push(Example {
                appearance: e.appearance.iter().take(common).copied().map(rounded).collect(),
                mu: rounded(e.mu),
                sigma: rounded(e.sigma),
                network_mu: e.network_mu.map(rounded),
                ..e.clone()
            });
        }
        *count += 1;
    }
    kept
}

/// Places of the examples of each group.
fn grouped(examples: &[Example], group: impl Fn(&Example) -> (String, u32)) -> Vec<Vec<usize>> {
    let mut groups: BTreeMap<(String, u32), Vec<usize>> = BTreeMap::new();
    for (i, e) in examples.iter().enumerate() {
        groups.entry(group(e)).or_default().push(i);
    }
    groups.into_values().collect()
}

/// What is left out together. Where all is one part, every picture by itself.
fn parts(examples: &[Example]) -> Vec<Vec<usize>> {
    let parts = grouped(examples, |e| (e.source.clone(), e.part));
    if parts.len() > 1 { parts } else { (0..examples.len()).map(|i| vec![i]).collect() }
}

/// Weights of the examples, every source counted alike; they sum to one.
fn balanced(examples: &[Example]) -> Vec<f64> {
    let mut counts: BTreeMap<&str, f64> = BTreeMap::new();
    for e in examples {
        *counts.entry(&e.source).or_default() += 1.0;
    }
    let sources = counts.len() as f64;
    examples.iter().map(|e| 1.0 / (sources * counts[e.source.as_str()])).collect()
}

/// Mean of -ln p of what was left out, a constant apart.
fn surprise(left_out: &[(f64, f64)], weights: &[f64]) -> f64 {
    left_out.iter().zip(weights).map(|((e, v), w)| w * 0.5 * (v.ln() + e * e / v)).sum()
}

/// Root mean square of the errors, the factor on sigma that makes it as large as they are, and the share within one such sigma.
fn spread(left_out: &[(f64, f64)], weights: &[f64], parts: usize) -> (f64, f64, f64) {
    let mean = |f: &dyn Fn(f64, f64) -> f64| -> f64 {
        left_out.iter().zip(weights).map(|((e, v), w)| w * f(*e, *v)).sum()
    };
    // Few parts tell little of the spread: they count with two parts of twice the expected size.
    let squares = mean(&|e, v| e * e / v);
    let factor = ((squares * parts as f64 + 4.0) / (parts as f64 + 2.0)).sqrt().max(1.0);
    // The shares were chosen on these very parts: the fewer they are, the better they seem.
    let factor = factor * (1.0 + CHOSEN / (parts as f64).sqrt());
    let within = mean(&|e, v| if e.abs() < factor * v.sqrt() { 1.0 } else { 0.0 });
    (mean(&|e, _| e * e).sqrt(), factor, within)
}

/// The network's error, on these sources and elsewhere.
fn network_error(examples: &[Example], sources: &[Vec<usize>]) -> f64 {
    let mut squares = vec![];
    for source in sources {
        let errors: Vec<f64> = source
            .iter()
            .filter_map(|i| examples[*i].network_mu.map(|mu| (mu - examples[*i].mu).powi(2)))
            .collect();
        if !errors.is_empty() {
            squares.push(errors.iter().sum::<f64>() / errors.len() as f64);
        }
    }
    let elsewhere = ELSEWHERE * NETWORK_ERROR * NETWORK_ERROR;
    ((elsewhere + squares.iter().sum::<f64>()) / (ELSEWHERE + squares.len() as f64)).sqrt()
}

/// How far known floors look from each other: from each part to the nearest example of another.
fn new_distance(pairs: &Pairs, count: usize, parts: &[Vec<usize>]) -> f64 {
    let mut part_of = vec![0; count];
    for (k, part) in parts.iter().enumerate() {
        part.iter().for_each(|i| part_of[*i] = k);
    }
    let nearest = |i: usize| {
        let others = (0..count).filter(|j| part_of[*j] != part_of[i]);
        others.map(|j| pairs.distance2(i, j)).fold(f64::INFINITY, f64::min).sqrt()
    };
    let mut distances: Vec<f64> = (0..count).map(nearest).collect();
    distances.sort_by(f64::total_cmp);
    let at = ((distances.len() as f64 * NEAR_SHARE) as usize).min(distances.len().saturating_sub(1));
    (NEAR_MARGIN * distances.get(at).copied().unwrap_or(0.0)).max(LEAST_NEW_DISTANCE)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Pictures of a floor whose numbers lie around `centre`.
    pub(crate) fn floor(name: &str, mu: f64, centre: f64, count: usize, seed: u64) -> Vec<Example> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count)
            .map(|k| Example {
                appearance: crate::appearance::LEAST_SCALE
                    .iter()
                    .map(|s| s * (centre + 0.5 * rng.random_range(-1.0..1.0)))
                    .collect(),
                mu,
                sigma: 0.03,
                source: name.to_owned(),
                part: k as u32 / 2,
                network_mu: Some(0.8),
            })
            .collect()
    }

    #[test]
    fn known_floors_are_told_and_a_new_one_is_said_to_be_new() {
        let examples = [floor("carpet", 0.9, 0.0, 10, 1), floor("tiles", 0.4, 4.0, 10, 2)].concat();
        let calibration = Calibration::learn("lab", &examples).unwrap();
        for (mu, centre) in [(0.9, 0.0), (0.4, 4.0)] {
            for fresh in floor("fresh", mu, centre, 10, 7) {
                let got = calibration.read(&fresh.appearance);
                assert!((got.mu - mu).abs() < 0.1 && got.sigma < 0.15 && got.weight() > 0.9, "{mu}: {got:?}");
            }
        }
        let new = calibration.read(&floor("wood", 0.6, 20.0, 1, 3)[0].appearance);
        assert!(new.distance > 1.5 && new.weight() < 1e-12, "{new:?}");
        assert!(calibration.errors().known < 0.1 && calibration.errors().new_source.unwrap() > 0.15);
        // The network said 0.8 of both: its errors here, 0.1 and 0.4, and those elsewhere.
        let expected = ((3.0 * 0.20f64.powi(2) + 0.1f64.powi(2) + 0.4f64.powi(2)) / 5.0).sqrt();
        assert!((calibration.errors().network - expected).abs() < 1e-3);
    }

    #[test]
    fn floors_that_look_alike_and_grip_otherwise_make_it_doubt() {
        let examples = [floor("dry", 0.9, 0.0, 12, 1), floor("oily", 0.3, 0.0, 12, 2)].concat();
        let got =
            Calibration::learn("lab", &examples).unwrap().read(&floor("fresh", 0.6, 0.0, 1, 9)[0].appearance);
        assert!((got.mu - 0.6).abs() < 0.25 && got.sigma > 0.15, "{got:?}");
    }

    #[test]
    fn too_little_and_nonsense_are_refused() {
        let two = floor("carpet", 0.9, 0.0, 2, 1);
        assert!(Calibration::learn("lab", &two).unwrap_err().to_string().contains("2 usable pictures"));
        let mut wrong = floor("carpet", 0.9, 0.0, 5, 1);
        wrong[3].mu = 9.0;
        assert!(Calibration::learn("lab", &wrong).is_err());
    }

    #[test]
    fn a_track_taught_before_there_was_an_embedding_is_taught_on() {
        let before = [floor("carpet", 0.9, 0.0, 10, 1), floor("tiles", 0.4, 4.0, 10, 2)].concat();
        let mut more = floor("more tiles", 0.4, 4.0, 4, 5);
        more.iter_mut().for_each(|e| e.appearance.extend([1.0; EMBEDDED]));
        let taught = Calibration::learn("lab", &[more.clone(), before].concat()).unwrap();
        let got = taught.read(&more[0].appearance);
        assert!((got.mu - 0.4).abs() < 0.1 && got.weight() > 0.9, "{got:?}");
        // Whoever learned with the embedding cannot tell without.
        let with = Calibration::learn("lab", &more).unwrap();
        assert!(with.read(&more[0].appearance[..16]).weight() < 1e-12);
        let read_back = Calibration::from_json(&with.to_json().unwrap()).unwrap();
        assert_eq!(read_back.read(&more[1].appearance), with.read(&more[1].appearance));
    }

    #[test]
    fn many_pictures_are_thinned_source_by_source() {
        let examples = [floor("carpet", 0.9, 0.0, 900, 1), floor("tiles", 0.4, 4.0, 30, 2)].concat();
        let kept = kept(&examples);
        assert!(kept.len() <= 400 && kept.iter().filter(|e| e.source == "tiles").count() >= 10);
    }
}
