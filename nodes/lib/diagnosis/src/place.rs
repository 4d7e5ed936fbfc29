//! Where the gap lies: squared errors of rollouts, sorted into bins of what the car was doing.

use crate::engine::Engine;
use crate::outcome::{Place, Where};
use crate::state::Nominal;
use gripsight_estimation::{Score, Windows};
use gripsight_model::{Channel, Rollout, quantile};

/// A sample's circumstances and its squared errors.
struct Sample {
    values: [f64; 7],
    /// Squared error over variance by channel.
    squares: Vec<f64>,
    /// Squared error of the lateral velocity of the front and the rear axle over its variance.
    axles: [f64; 2],
}

const BINS: usize = 6;

/// Sorts the errors of a model on windows.
pub(crate) fn places(engine: &Engine<'_>, nominal: &Nominal, windows: &Windows, score: &Score) -> Where {
    let recording = engine.recording;
    let scored: Vec<usize> =
        (0..recording.channels.len()).filter(|&c| recording.channels[c].scored()).collect();
    let samples = samples(engine, nominal, windows, score, &scored);
    let total: f64 = samples.iter().flat_map(|s| s.squares.iter()).sum::<f64>().max(1e-12);
    let mut out = Where::default();
    let n = samples.len().max(1) as f64;
    for (i, &c) in scored.iter().enumerate() {
        let sum: f64 = samples.iter().map(|s| s.squares[i]).sum();
        out.channel.push(Place {
            low: 0.0,
            high: 0.0,
            unit: "1",
            channel: recording.channels[c].name(),
            chi2_per_dof: sum / n,
            share: sum / total,
        });
    }
    let both: f64 = samples.iter().map(|s| s.axles[0] + s.axles[1]).sum::<f64>().max(1e-12);
    for (axle, name) in ["front_axle", "rear_axle"].into_iter().enumerate() {
        let sum: f64 = samples.iter().map(|s| s.axles[axle]).sum();
        out.axle.push(Place {
            low: 0.0,
            high: 0.0,
            unit: "1",
            channel: name,
            chi2_per_dof: sum / n,
            share: sum / both,
        });
    }
    let binned = |k: usize, unit: &'static str| bins(&samples, k, unit, total, scored.len());
    out.speed = binned(0, "m/s");
    out.lateral_acceleration = binned(1, "m/s2");
    out.slip = binned(2, "rad");
    out.steering_rate = binned(3, "rad/s");
    out.longitudinal_acceleration = binned(4, "m/s2");
    if recording.laps.laps > 0.0 {
        out.track_position = binned(5, "m");
    }
    out.time = binned(6, "s");
    out.frequency = frequency(engine, nominal, windows, score);
    out
}

/// Mean squared error over speed and lateral acceleration.
pub(crate) fn heat(
    places: &Engine<'_>,
    nominal: &Nominal,
    windows: &Windows,
    score: &Score,
) -> Vec<[f64; 3]> {
    const CELLS: usize = 8;
    let recording = places.recording;
    let scored: Vec<usize> =
        (0..recording.channels.len()).filter(|&c| recording.channels[c].scored()).collect();
    let samples = samples(places, nominal, windows, score, &scored);
    let top = |k: usize| samples.iter().map(|s| s.values[k]).fold(1e-6, f64::max);
    let (v_top, a_top) = (top(0), top(1));
    let mut cells = vec![(0.0, 0usize); CELLS * CELLS];
    for s in &samples {
        let at = |v: f64, t: f64| ((v / t * CELLS as f64) as usize).min(CELLS - 1);
        let cell = &mut cells[at(s.values[0], v_top) * CELLS + at(s.values[1], a_top)];
        cell.0 += s.squares.iter().sum::<f64>() / scored.len().max(1) as f64;
        cell.1 += 1;
    }
    cells
        .iter()
        .enumerate()
        .filter(|(_, c)| c.1 > 0)
        .map(|(i, c)| {
            let middle = |k: usize, t: f64| (k as f64 + 0.5) / CELLS as f64 * t;
            [middle(i / CELLS, v_top), middle(i % CELLS, a_top), c.0 / c.1 as f64]
        })
        .collect()
}

fn samples(
    engine: &Engine<'_>,
    nominal: &Nominal,
    windows: &Windows,
    score: &Score,
    scored: &[usize],
) -> Vec<Sample> {
    let recording = engine.recording;
    let model = engine.model(&nominal.effects, None);
    let (l_f, l_r) = (engine.vehicle.l_f_m, engine.vehicle.l_r_m);
    let channels = recording.channels.len();
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    let mut out = Vec::new();
    for (window, start) in windows.windows.iter().zip(&score.starts) {
        let run = &recording.runs[window.segment];
        model.rollout(&nominal.parameters, *start, window, &mut predicted);
        model.measured(window, &mut measured);
        for k in 0..window.len {
            let at = window.from + k;
            let error = |c: usize| measured[k * channels + c] - predicted[k * channels + c];
            let (s_v, s_r) = (recording.sigma[0], recording.sigma[1]);
            let axle = |x: f64| (error(0) + x * error(1)).powi(2) / (s_v * s_v + x * x * s_r * s_r);
            let [front, rear] = engine.slip_rad(run, at);
            let next = (at + 1).min(run.len() - 1);
            out.push(Sample {
                values: [
                    run.v_x_mps[at],
                    (run.v_x_mps[at] * run.smooth[1][at]).abs(),
                    front.abs().max(rear.abs()),
                    ((run.steering_rad[next] - run.steering_rad[at]) / run.dt_s).abs(),
                    run.a_x_mps2[at],
                    run.lap_share[at] * recording.laps.lap_m,
                    run.time_s(at),
                ],
                // What is not asked counts as met.
                squares: scored
                    .iter()
                    .map(|&c| (error(c) / recording.sigma[c]).powi(2))
                    .map(|square| if square.is_nan() { 0.0 } else { square })
                    .collect(),
                axles: [axle(l_f), axle(-l_r)],
            });
        }
    }
    out
}

/// Bins with equally many samples.
fn bins(samples: &[Sample], k: usize, unit: &'static str, total: f64, channels: usize) -> Vec<Place> {
    let all: Vec<f64> = samples.iter().map(|s| s.values[k]).collect();
    let mut edges: Vec<f64> = (0..=BINS).map(|i| quantile(all.clone(), i as f64 / BINS as f64)).collect();
    edges.dedup_by(|a, b| (*a - *b).abs() < 1e-9);
    edges
        .windows(2)
        .enumerate()
        .map(|(i, e)| {
            let last = i + 2 == edges.len();
            let inside =
                |s: &&Sample| s.values[k] >= e[0] && (s.values[k] < e[1] || (last && s.values[k] <= e[1]));
            let (mut n, mut sum) = (0.0, 0.0);
            for s in samples.iter().filter(inside) {
                n += channels as f64;
                sum += s.squares.iter().sum::<f64>();
            }
            Place {
                low: e[0],
                high: e[1],
                unit,
                channel: "all",
                chi2_per_dof: sum / f64::max(n, 1.0),
                share: sum / total,
            }
        })
        .collect()
}

/// Power of the errors of v_y and yaw rate by frequency, over the power of white noise.
fn frequency(engine: &Engine<'_>, nominal: &Nominal, windows: &Windows, score: &Score) -> Vec<Place> {
    const EDGES_HZ: [f64; 6] = [0.0, 1.5, 3.5, 6.5, 12.5, 50.0];
    let recording = engine.recording;
    let model = engine.model(&nominal.effects, None);
    let channels = recording.channels.len();
    let dt_s = recording.dt_s();
    let (mut predicted, mut measured) = (Vec::new(), Vec::new());
    let mut power = [0.0; EDGES_HZ.len() - 1];
    let mut count = [0.0; EDGES_HZ.len() - 1];
    for (window, start) in windows.windows.iter().zip(&score.starts) {
        model.rollout(&nominal.parameters, *start, window, &mut predicted);
        model.measured(window, &mut measured);
        for c in [Channel::LateralVelocity, Channel::YawRate] {
            let Some(place) = recording.channels.iter().position(|&x| x == c) else { continue };
            let n = window.len;
            let error: Vec<f64> = (0..n)
                .map(|k| {
                    (measured[k * channels + place] - predicted[k * channels + place])
                        / recording.sigma[place]
                })
                .collect();
            for bin in 0..n / 2 {
                let f_hz = bin as f64 / (n as f64 * dt_s);
                let (mut re, mut im) = (0.0, 0.0);
                for (k, e) in error.iter().enumerate() {
                    let (sin, cos) = (std::f64::consts::TAU * (bin * k % n) as f64 / n as f64).sin_cos();
                    re += e * cos;
                    im += e * sin;
                }
                if let Some(band) = EDGES_HZ.windows(2).position(|w| f_hz >= w[0] && f_hz < w[1]) {
                    power[band] += (re * re + im * im) / n as f64;
                    count[band] += 1.0;
                }
            }
        }
    }
    let total: f64 = power.iter().sum::<f64>().max(1e-12);
    (0..power.len())
        .filter(|&b| count[b] > 0.0)
        .map(|b| Place {
            low: EDGES_HZ[b],
            high: EDGES_HZ[b + 1],
            unit: "Hz",
            channel: "v_y_mps, yaw_rate_radps",
            chi2_per_dof: power[b] / count[b],
            share: power[b] / total,
        })
        .collect()
}
