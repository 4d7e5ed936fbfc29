//! Bad samples cost themselves, not the bag: what of a sequence is not to be used, and why.
//!
//! * A single sample of v_x, v_y or yaw rate that stands out ([`Spikes`]' rule) is left out; of an optional channel it is bridged by its neighbours. A command
//!   may hold for one sample, and stands out only where no wheel follows it.
//! * Samples of v_x, v_y, yaw rate or steering that a jump no car makes leads to, and another leads back from within two seconds, are left out: seconds in other
//!   units, a second source. At the ends of a sequence one such jump does.
//! * Steering beyond what wheels turn to is left out, with what jumps lead to it and back.
//! * A channel that repeats one value for over half a second while the car moves and then *jumps* was frozen: those samples are left out. One
//!   that goes on from where it stood was constant (a simulator's cruise) or within its sensor's dead band, and stays.
//! * A pose that jumps and stays is told; nothing is left out, since what uses poses uses their differences over short spans.
//!
//! Nothing is rescaled and nothing is invented: left out means a gap in the samples, as a lost message makes one. The result is a pure function of
//! the sequence, so that live and offline agree.

use serde::Serialize;

use crate::health::{MOVING_MPS, still_spans};
use crate::topic::spikes_at;
use crate::{DataHealth, SignalError, StateSequence};

/// Why samples are not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum BadKind {
    /// A single sample that stands out from both its neighbours.
    Outlier,
    /// Samples that no car's motion leads to and back from.
    Burst,
    /// A sensor that repeated itself, and then jumped.
    Frozen,
    /// A localisation that jumped, and stayed there.
    Jump,
}

/// Samples that are not used, or (a jump) not to be differenced across.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BadSpan {
    /// Which channel.
    pub channel: &'static str,
    /// Why.
    pub kind: BadKind,
    /// First sample, since the start of the sequence.
    pub from_s: f64,
    /// Last sample.
    pub to_s: f64,
    /// How far off, in the channel's unit.
    pub size: f64,
}

/// A sequence without its bad samples.
#[derive(Debug, Clone, PartialEq)]
pub struct Masked {
    /// What is left.
    pub sequence: StateSequence,
    /// What is not, in the order of channels and time.
    pub bad: Vec<BadSpan>,
}

/// A step of this many usual steps is a jump.
const JUMP_STEPS: f64 = 8.0;
/// No car's speeds (m/s2) and yaw rate (rad/s2) change faster.
const MOST_MPS2: f64 = 100.0;
const MOST_RADPS2: f64 = 500.0;
/// No road wheel turns faster (rad/s): the fastest servos take 0.05 s for 60 degrees, and linkages about halve it.
const MOST_RADPS: f64 = 12.0;
/// None turns further (rad).
const MOST_LOCK_RAD: f64 = std::f64::consts::FRAC_PI_3;
/// Longest burst (s).
const MOST_BURST_S: f64 = 2.0;
/// Where more than this share of the samples stand out, they are not single bad ones: none is left out.
const MOST_SHARE: f64 = 0.2;

/// Leaves bad samples out. A sequence without any comes back as it is.
///
/// # Errors
/// What [`StateSequence::check`] finds.
pub fn masked(sequence: &StateSequence) -> Result<Masked, SignalError> {
    sequence.check()?;
    let mut out = Masked { sequence: sequence.clone(), bad: Vec::new() };
    let time_s: Vec<f64> = sequence.time_s.iter().map(|&t| f64::from(t)).collect();
    let mut keep = vec![true; sequence.len()];
    let moving = [
        ("v_x_mps", &sequence.v_x_mps, MOST_MPS2),
        ("v_y_mps", &sequence.v_y_mps, MOST_MPS2),
        ("yaw_rate_radps", &sequence.yaw_rate_radps, MOST_RADPS2),
    ];
    for (name, values, most_rate) in moving {
        let values: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
        for (from, to, size) in bursts_at(&time_s, &values, most_rate, 2) {
            keep[from..=to].fill(false);
            let (from_s, to_s) = (time_s[from], time_s[to]);
            out.bad.push(BadSpan { channel: name, kind: BadKind::Burst, from_s, to_s, size });
        }
        for (k, size) in spikes_at(&values) {
            keep[k] = false;
            out.bad.push(BadSpan {
                channel: name,
                kind: BadKind::Outlier,
                from_s: time_s[k],
                to_s: time_s[k],
                size,
            });
        }
    }
    let left_out = keep.iter().filter(|k| !**k).count();
    if left_out as f64 > MOST_SHARE * sequence.len() as f64 {
        keep.fill(true);
        out.bad.clear();
    }
    // However many: no wheel follows them. A whole drive in another unit has no jumps that lead to it.
    let steering: Vec<f64> = sequence.steering_rad.iter().map(|&v| f64::from(v)).collect();
    let mut steered = beyond_lock(&time_s, &steering);
    let jumped = bursts_at(&time_s, &steering, MOST_RADPS, 1).into_iter();
    // A jump to what no wheel does comes from what one does.
    let beside = |b: &(usize, usize, f64)| steered.iter().any(|s| b.1 + 1 == s.0 || s.1 + 1 == b.0);
    let apart: Vec<_> = jumped.filter(|b| !beside(b)).collect();
    steered.extend(apart);
    for (from, to, size) in steered {
        keep[from..=to].fill(false);
        let (from_s, to_s) = (time_s[from], time_s[to]);
        out.bad.push(BadSpan { channel: "steering_rad", kind: BadKind::Burst, from_s, to_s, size });
    }
    for (name, values, _) in moving {
        let values: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
        let usual = usual_step(&values);
        for (from, to) in still_spans(&time_s, &values, |k| sequence.v_x_mps[k].abs() > MOVING_MPS) {
            let after = values.get(to + 1).map_or(0.0, |v| (v - values[to]).abs());
            if after > JUMP_STEPS * usual && values[from] != 0.0 {
                keep[from + 1..=to].fill(false);
                out.bad.push(BadSpan {
                    channel: name,
                    kind: BadKind::Frozen,
                    from_s: time_s[from],
                    to_s: time_s[to],
                    size: after,
                });
            }
        }
    }
    bridge(&mut out, &time_s);
    jumps(sequence, &mut out.bad);
    out.sequence.retain(|k| keep[k]);
    Ok(out)
}

/// Puts the mean of its neighbours where a single sample of an inertial unit or a wheel stands out.
fn bridge(out: &mut Masked, time_s: &[f64]) {
    let Masked { sequence, bad } = out;
    for (name, values) in [
        ("a_x_mps2", &mut sequence.a_x_mps2),
        ("a_y_mps2", &mut sequence.a_y_mps2),
        ("gyro_yaw_rate_radps", &mut sequence.gyro_yaw_rate_radps),
        ("measured_steering_rad", &mut sequence.measured_steering_rad),
        ("wheel_speed_fl_radps", &mut sequence.wheel_speed_fl_radps),
        ("wheel_speed_fr_radps", &mut sequence.wheel_speed_fr_radps),
        ("wheel_speed_rl_radps", &mut sequence.wheel_speed_rl_radps),
        ("wheel_speed_rr_radps", &mut sequence.wheel_speed_rr_radps),
    ] {
        let wide: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
        let found = spikes_at(&wide);
        if found.len() as f64 > MOST_SHARE * wide.len() as f64 {
            continue;
        }
        for (k, size) in found {
            values[k] = 0.5 * (values[k - 1] + values[k + 1]);
            bad.push(BadSpan {
                channel: name,
                kind: BadKind::Outlier,
                from_s: time_s[k],
                to_s: time_s[k],
                size,
            });
        }
    }
}

/// Jumps of the pose: a step from pose to pose that no speed explains.
fn jumps(sequence: &StateSequence, bad: &mut Vec<BadSpan>) {
    let poses = sequence.poses();
    let steps: Vec<f64> = (1..poses.time_s.len())
        .map(|k| (poses.x_m[k] - poses.x_m[k - 1]).hypot(poses.y_m[k] - poses.y_m[k - 1]))
        .collect();
    let usual = usual_step(&steps).max(quantile(&steps, 0.9));
    for (k, &step) in steps.iter().enumerate() {
        if step > JUMP_STEPS * usual.max(0.01) {
            let (from_s, to_s) = (poses.time_s[k], poses.time_s[k + 1]);
            bad.push(BadSpan { channel: "x_m", kind: BadKind::Jump, from_s, to_s, size: step });
        }
    }
}

/// First and last places of steering that wheels do not have, as far as jumps lead to it and back, and how far it goes. Where it crosses zero it is no better:
/// what lies between two such spans within [`MOST_BURST_S`] is of one. What no jump leads to is the unit of the whole drive.
fn beyond_lock(time_s: &[f64], steering_rad: &[f64]) -> Vec<(usize, usize, f64)> {
    let near = |from: usize, to: usize| time_s[to] - time_s[from] <= MOST_BURST_S;
    let least = JUMP_STEPS * usual_step(steering_rad);
    let jumped = |k: usize| {
        let most = MOST_RADPS * (time_s[k] - time_s[k - 1]);
        (steering_rad[k] - steering_rad[k - 1]).abs() > least.max(most)
    };
    let mut spans: Vec<(usize, usize, f64)> = Vec::new();
    for k in (0..steering_rad.len()).filter(|&k| steering_rad[k].abs() > MOST_LOCK_RAD) {
        match spans.last_mut().filter(|(_, to, _)| near(*to, k)) {
            Some((_, to, size)) => (*to, *size) = (k, size.max(steering_rad[k].abs())),
            None => spans.push((k, k, steering_rad[k].abs())),
        }
    }
    let burst = |(first, last, size): (usize, usize, f64)| {
        let from = (1..=first).filter(|&k| near(k, first) && jumped(k)).min();
        let to = (last + 1..steering_rad.len()).filter(|&k| near(last, k) && jumped(k)).max();
        (from.is_some() || to.is_some()).then(|| (from.unwrap_or(first), to.map_or(last, |k| k - 1), size))
    };
    spans.into_iter().filter_map(burst).collect()
}

/// First and last places of bursts of at least so many samples, and how high the jump is.
fn bursts_at(time_s: &[f64], values: &[f64], most_rate: f64, samples: usize) -> Vec<(usize, usize, f64)> {
    let least = JUMP_STEPS * usual_step(values);
    let step = |k: usize| values[k] - values[k - 1];
    let is_jump = |&k: &usize| step(k).abs() > least.max(most_rate * (time_s[k] - time_s[k - 1]));
    let jumps: Vec<usize> = (1..values.len()).filter(is_jump).collect();
    let is_short = |from: usize, to: usize| time_s[to] - time_s[from] <= MOST_BURST_S;
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(&k) = jumps.get(at) {
        // Back to where it came from, as far as a jump goes: that of a burst which changes within itself may be another's.
        let back = jumps[at + 1..].iter().position(|&j| {
            is_short(k, j - 1) && (values[j] - values[k - 1]).abs() < 0.25 * step(k).abs().max(step(j).abs())
        });
        match back {
            Some(back) => {
                let end = jumps[at + 1 + back];
                if end >= k + samples {
                    found.push((k, end - 1, step(k).abs()));
                }
                at += back + 1;
            }
            None if is_short(0, k - 1) && found.is_empty() => found.push((0, k - 1, step(k).abs())),
            None if is_short(k, values.len() - 1) => {
                found.push((k, values.len() - 1, step(k).abs()));
                break;
            }
            None => {}
        }
        at += 1;
    }
    found
}

/// What 90 % of the steps from sample to sample stay below.
fn usual_step(values: &[f64]) -> f64 {
    let steps: Vec<f64> = values.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|s| *s > 0.0).collect();
    quantile(&steps, 0.9)
}

fn quantile(values: &[f64], share: f64) -> f64 {
    let mut values = values.to_vec();
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    *values.select_nth_unstable_by((last as f64 * share).round() as usize, f64::total_cmp).1
}

impl Masked {
    /// The health of what is left.
    ///
    /// # Errors
    /// As [`DataHealth::of`].
    pub fn health(&self) -> Result<DataHealth, SignalError> {
        DataHealth::of(&self.sequence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drive() -> StateSequence {
        let time_s: Vec<f32> = (0..1000).map(|k| k as f32 * 0.01).collect();
        let wave = |f: f32| time_s.iter().map(|t| (f * t).sin()).collect::<Vec<_>>();
        StateSequence {
            v_x_mps: time_s.iter().map(|t| 5.0 + (0.3 * t).sin()).collect(),
            v_y_mps: wave(3.0),
            yaw_rate_radps: wave(2.0),
            steering_rad: wave(1.0),
            a_y_mps2: wave(4.0),
            time_s,
            ..Default::default()
        }
    }

    #[test]
    fn a_clean_sequence_comes_back_as_it_is() {
        assert_eq!(masked(&drive()).unwrap(), Masked { sequence: drive(), bad: Vec::new() });
    }

    #[test]
    fn what_froze_and_jumped_goes_and_what_was_constant_stays() {
        let mut frozen = drive();
        let stuck = frozen.v_y_mps[100];
        frozen.v_y_mps[100..190].fill(stuck);
        let out = masked(&frozen).unwrap();
        assert_eq!((out.sequence.len(), out.bad.len(), out.bad[0].kind), (911, 1, BadKind::Frozen));
        let mut cruise = drive();
        cruise.v_x_mps.fill(5.0);
        let band = |v: &f32| if v.abs() < 0.3 { 0.0 } else { v - 0.3 * v.signum() };
        cruise.yaw_rate_radps = cruise.yaw_rate_radps.iter().map(band).collect();
        for k in 400..500 {
            cruise.v_x_mps[k] = 5.0 + 0.01 * (k - 400) as f32;
        }
        cruise.v_x_mps[500..].fill(6.0);
        assert_eq!(masked(&cruise).unwrap().bad, Vec::new());
    }

    #[test]
    fn single_samples_cost_themselves() {
        let mut spiked = drive();
        spiked.yaw_rate_radps[300] += 9.0;
        spiked.a_y_mps2[500] = 80.0;
        let out = masked(&spiked).unwrap();
        assert_eq!(out.sequence.len(), 999);
        assert!((out.sequence.a_y_mps2[499] - (4.0_f32 * 5.0).sin()).abs() < 0.01);
        let kinds: Vec<_> = out.bad.iter().map(|b| (b.channel, b.kind)).collect();
        assert_eq!(kinds, [("yaw_rate_radps", BadKind::Outlier), ("a_y_mps2", BadKind::Outlier)]);
    }

    #[test]
    fn seconds_in_other_units_are_left_out_and_a_step_that_stays_is_not() {
        let mut harmed = drive();
        for k in 400..420 {
            harmed.v_x_mps[k] *= 3.6;
            harmed.yaw_rate_radps[k] *= 57.3;
        }
        let out = masked(&harmed).unwrap();
        assert_eq!(out.sequence.len(), 980);
        assert!(out.sequence.v_x_mps.iter().all(|v| *v < 7.0));
        assert!(out.bad.iter().all(|b| b.kind == BadKind::Burst && b.from_s > 3.9 && b.to_s < 4.3));
        // A window that begins, and one that ends, within such seconds.
        for (from, to) in [(410, 1000), (0, 410)] {
            let mut part = harmed.clone();
            part.retain(|k| (from..to).contains(&k));
            assert!(masked(&part).unwrap().sequence.v_x_mps.iter().all(|v| *v < 7.0), "{from} to {to}");
        }
        let mut stays = drive();
        stays.v_x_mps[500..].iter_mut().for_each(|v| *v += 5.0);
        assert_eq!(masked(&stays).unwrap(), Masked { sequence: stays, bad: Vec::new() });
    }

    #[test]
    fn seconds_of_steering_in_degrees_are_left_out_and_a_flick_to_full_lock_is_not() {
        let mut drive = drive();
        drive.steering_rad.iter_mut().for_each(|d| *d *= 0.4);
        // Through zero at 6.28 s, and never beyond any lock there; at the beginning, at the end, and for a third of the drive.
        for (from, to) in [(600, 640), (617, 629), (0, 60), (950, 1000), (100, 400)] {
            let mut harmed = drive.clone();
            harmed.steering_rad[from..to].iter_mut().for_each(|d| *d *= 57.3);
            let out = masked(&harmed).unwrap();
            let steered = out.sequence.steering_rad.iter().fold(0.0_f32, |most, d| most.max(d.abs()));
            let kept = 1000 - (to - from);
            assert!(steered < 0.45, "{from} {to}: {steered}");
            assert!(out.sequence.len().abs_diff(kept) <= 2, "{from} {to}: {}", out.sequence.len());
        }
        // All of it: that is no burst, and said of the whole drive.
        let mut degrees = drive.clone();
        degrees.steering_rad.iter_mut().for_each(|d| *d *= 57.3);
        assert!(masked(&degrees).unwrap().bad.is_empty());
        let mut flick = drive.clone();
        for (k, d) in flick.steering_rad[450..550].iter_mut().enumerate() {
            // To the other lock and back, a tenth of a radian a sample.
            *d += 0.1 * (k.min(99 - k) as f32).min(8.0);
        }
        assert!(masked(&flick).unwrap().bad.is_empty());
    }

    #[test]
    fn a_jump_of_the_localisation_is_told() {
        let mut posed = drive();
        posed.x_m = posed.time_s.iter().map(|t| 5.0 * t + if *t > 4.0 { 3.0 } else { 0.0 }).collect();
        posed.y_m = vec![0.0; 1000];
        posed.yaw_rad = vec![0.0; 1000];
        let out = masked(&posed).unwrap();
        assert_eq!((out.sequence.len(), out.bad.len(), out.bad[0].kind), (1000, 1, BadKind::Jump));
        assert!((out.bad[0].from_s - 4.0).abs() < 0.02);
    }
}
