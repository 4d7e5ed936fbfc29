//! What the drive train does with a command: gain, delay and lag, what holds the car back, and the accelerations that it gave at each speed.
//!
//! ```text
//! dv_x/dt - v_y w + F_yf sin d/m = k u(t) - r - c v_x^2,   T du/dt = a_cmd(t - tau) - u
//! F_yf/m = v_x w l_r/(L cos d)
//! ```
//!
//! | symbol | meaning | unit |
//! | --- | --- | --- |
//! | k | gain from the commanded acceleration to the car's | 1 |
//! | tau, T | delay and lag | s |
//! | r | rolling resistance over the mass | m/s^2 |
//! | c | drag over the mass | 1/m |
//!
//! Both sides are integrated over intervals, which needs no derivative of v_x. k, r and c are linear; tau and T are searched on a grid. The car gives
//! less than the line where tires or motor are at their limit: such intervals are left out of it, and tell the limit.
//! A figure that the drive does not tell is [`Told::Unknown`], and a controller falls back to what its own file states.

use gripsight_signals::StateSequence;
use gripsight_vehicle::VehicleParameters;
use nalgebra::{Matrix3, Vector3};
use serde::{Serialize, Serializer};

use crate::{Estimate, Range};

/// Length of an interval.
const INTERVAL_S: f64 = 0.2;
/// Step of the even grid that signals are read on.
const STEP_S: f64 = 0.01;
/// Longest pause between two samples to read across.
const GAP_S: f64 = 0.1;
/// Intervals in a cluster: their errors are correlated.
const CLUSTER: usize = 10;
/// Fewest intervals to fit to.
const FEWEST: usize = 50;
/// Speeds below which rolling cars are another matter.
const SLOW_MPS: f64 = 0.5;
/// Delays searched: up to this many steps of 10 ms.
const DELAYS: usize = 30;
/// Lags searched.
const LAGS_S: [f64; 9] = [0.0, 0.02, 0.05, 0.08, 0.12, 0.18, 0.26, 0.38, 0.55];
/// Widest 90 % interval (half) that still tells something: gain, delay and lag (s), rolling resistance and drag at the drive's speeds (m/s^2).
const TELLS: (f64, f64, f64) = (0.3, 0.1, 0.3);
/// Share of the intervals, those where least is asked for, to begin with.
const GENTLE: f64 = 0.4;
/// Parts of the speeds driven.
const PARTS: usize = 4;
/// Intervals at a limit from which it counts as reached.
const REACHED: usize = 3;

/// A figure, or that the drive does not tell it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Told {
    /// With its 90 % interval.
    Known(Estimate),
    /// The drive does not tell.
    Unknown,
}

impl Told {
    /// The figure, where it is known.
    #[must_use]
    pub fn known(&self) -> Option<&Estimate> {
        match self {
            Self::Known(estimate) => Some(estimate),
            Self::Unknown => None,
        }
    }

    fn within(low: f64, value: f64, high: f64, half: f64) -> Self {
        let tells = value.is_finite() && high - value <= half && value - low <= half;
        if tells { Self::Known(Estimate { value, low, high }) } else { Self::Unknown }
    }
}

impl Serialize for Told {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Known(estimate) => estimate.serialize(serializer),
            Self::Unknown => serializer.serialize_str("unknown"),
        }
    }
}

/// An acceleration that the car gave.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Given {
    /// m/s^2: the limit where it was reached, else the largest shown.
    pub value: f64,
    /// More was asked for and not given.
    pub reached: bool,
}

/// Accelerations at a range of speeds; `None` where none was asked for.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LimitsAt {
    /// Forward speeds.
    pub v_x_mps: Range,
    /// Forward.
    pub a_max_mps2: Option<Given>,
    /// Backward, negative.
    pub a_min_mps2: Option<Given>,
}

/// What a drive tells of the drive train.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Longitudinal {
    /// Acceleration over commanded acceleration.
    pub gain: Told,
    /// From a command to its effect, s.
    pub delay_s: Told,
    /// Time constant of what follows, s.
    pub lag_s: Told,
    /// Rolling resistance over the mass, m/s^2.
    pub rolling_resistance_mps2: Told,
    /// Drag over the mass, 1/m.
    pub drag_1pm: Told,
    /// Accelerations against speed.
    pub limits: Vec<LimitsAt>,
}

impl Default for Longitudinal {
    /// Nothing is known.
    fn default() -> Self {
        let [gain, delay_s, lag_s, rolling_resistance_mps2, drag_1pm] = [Told::Unknown; 5];
        Self { gain, delay_s, lag_s, rolling_resistance_mps2, drag_1pm, limits: Vec::new() }
    }
}

/// An interval of the drive.
struct Interval {
    from_s: f64,
    v_x_mps: f64,
    v_x_sq: f64,
    /// Speed gained over its length, with what turning costs put back.
    gained_mps2: f64,
    /// The same without.
    accelerated_mps2: f64,
}

/// A line through all intervals at one delay and lag.
struct Fit<'a> {
    /// Gain, rolling resistance, drag.
    x: Vector3<f64>,
    inverse: Matrix3<f64>,
    asked: &'a [f64],
    cost: f64,
}

/// What a sequence tells. Without commanded accelerations nothing.
#[must_use]
pub fn longitudinal(sequence: &StateSequence, vehicle: &VehicleParameters) -> Longitudinal {
    let intervals = intervals(sequence, vehicle);
    let Some(asked) = Asked::new(sequence).filter(|_| intervals.len() >= FEWEST) else {
        return Longitudinal::default();
    };
    let mut keep = asked.gentle(&intervals);
    let grid = grid(&intervals, &asked);
    let mut found = None;
    // Intervals at a limit are known once the line is, and the line without them: it begins where little is asked for.
    for _ in 0..3 {
        let fits = search(&intervals, &grid, &keep);
        let Some(best) = fits.iter().min_by(|a, b| a.1.cost.total_cmp(&b.1.cost)) else { break };
        let sigma = spread(&intervals, &best.1, &keep);
        for (k, interval) in intervals.iter().enumerate() {
            let line = line(&best.1, interval, k);
            let short = (line - interval.gained_mps2) * line.signum();
            keep[k] = short < (4.0 * sigma).max(0.15 * line.abs());
        }
        found = Some((fits, sigma));
    }
    let Some((fits, sigma)) = found else { return Longitudinal::default() };
    state(&intervals, &fits, &keep, sigma)
}

/// Figures from all fits that the data do not rule out.
fn state(intervals: &[Interval], fits: &[((f64, f64), Fit<'_>)], keep: &[bool], sigma: f64) -> Longitudinal {
    let Some((at, best)) = fits.iter().min_by(|a, b| a.1.cost.total_cmp(&b.1.cost)) else {
        return Longitudinal::default();
    };
    let errors = |fit: &Fit<'_>| clustered(intervals, fit, keep).map(|e| Estimate::Z90 * e);
    // Neighbours share the speed between them: half of the intervals count.
    let plausible = |fit: &Fit<'_>| fit.cost - best.cost < 2.0 * (Estimate::Z90 * sigma).powi(2);
    // Nor do they tell apart what is next to each other on the grid.
    let lag = |lag_s: f64| LAGS_S.iter().position(|l| *l == lag_s).unwrap_or(0);
    let next = |delay_s: f64, lag_s: f64| {
        (delay_s - at.0).abs() < 1.5 * STEP_S && lag(lag_s).abs_diff(lag(at.1)) <= 1
    };
    let mut low = [f64::INFINITY; 5];
    let mut high = [f64::NEG_INFINITY; 5];
    let mut take = |k: usize, value: f64, half: f64| {
        low[k] = low[k].min(value - half);
        high[k] = high[k].max(value + half);
    };
    for ((delay_s, lag_s), fit) in fits.iter().filter(|((t, l), fit)| plausible(fit) || next(*t, *l)) {
        let half = errors(fit);
        (0..3).for_each(|k| take(k, fit.x[k], half[k]));
        take(3, *delay_s, 0.5 * STEP_S);
        take(4, *lag_s, 0.5 * STEP_S);
    }
    // Nothing follows before it is asked to.
    low[3..].iter_mut().for_each(|low| *low = low.max(0.0));
    let v_sq = intervals.iter().map(|i| i.v_x_sq).sum::<f64>() / intervals.len() as f64;
    let told = |k: usize, value: f64, half: f64| Told::within(low[k], value, high[k], half);
    // Delay and lag of a command without effect mean nothing.
    let acts = low[0] > 0.0;
    let timed = |told: Told| if acts { told } else { Told::Unknown };
    Longitudinal {
        gain: told(0, best.x[0], TELLS.0),
        delay_s: timed(told(3, at.0, TELLS.1)),
        lag_s: timed(told(4, at.1, TELLS.1)),
        rolling_resistance_mps2: told(1, best.x[1], TELLS.2),
        drag_1pm: told(2, best.x[2], TELLS.2 / v_sq.max(1e-6)),
        limits: limits(intervals, best, keep),
    }
}

fn limits(intervals: &[Interval], fit: &Fit<'_>, keep: &[bool]) -> Vec<LimitsAt> {
    let speeds = || intervals.iter().map(|i| i.v_x_mps);
    let (low, high) = (speeds().fold(f64::INFINITY, f64::min), speeds().fold(f64::NEG_INFINITY, f64::max));
    let part = (high - low).max(1e-6) / PARTS as f64;
    let of = |from: f64, sign: f64| {
        let mine = || {
            intervals.iter().enumerate().filter(move |(k, i)| {
                i.v_x_mps >= from && i.v_x_mps <= from + part && sign * fit.x[0] * fit.asked[*k] > 0.0
            })
        };
        let mut short: Vec<f64> =
            mine().filter(|(k, _)| !keep[*k]).map(|(_, i)| sign * i.accelerated_mps2).collect();
        let shown = mine().map(|(_, i)| sign * i.accelerated_mps2).fold(f64::NEG_INFINITY, f64::max);
        if short.len() >= REACHED {
            short.sort_by(f64::total_cmp);
            return Some(Given { value: sign * short[short.len() / 2], reached: true });
        }
        (shown > 0.0).then_some(Given { value: sign * shown, reached: false })
    };
    (0..PARTS)
        .map(|k| {
            let from = low + k as f64 * part;
            LimitsAt {
                v_x_mps: Range { low: from, high: from + part },
                a_max_mps2: of(from, 1.0),
                a_min_mps2: of(from, -1.0),
            }
        })
        .collect()
}

fn line(fit: &Fit<'_>, interval: &Interval, k: usize) -> f64 {
    fit.x[0] * fit.asked[k] - fit.x[1] - fit.x[2] * interval.v_x_sq
}

fn spread(intervals: &[Interval], fit: &Fit<'_>, keep: &[bool]) -> f64 {
    let mut off: Vec<f64> = intervals
        .iter()
        .enumerate()
        .filter(|(k, _)| keep[*k])
        .map(|(k, i)| (i.gained_mps2 - line(fit, i, k)).abs())
        .collect();
    off.sort_by(f64::total_cmp);
    // The median of the absolute errors, as a standard deviation.
    1.4826 * off.get(off.len() / 2).copied().unwrap_or(f64::NAN)
}

/// Delay and lag (s), and what then acts in each interval.
type Acting = ((f64, f64), Vec<f64>);

/// What acts in each interval, at every delay and lag.
fn grid(intervals: &[Interval], asked: &Asked) -> Vec<Acting> {
    let mut grid = Vec::with_capacity(DELAYS * LAGS_S.len());
    for lag_s in LAGS_S {
        let sums = asked.lagged(lag_s);
        for delay in 0..DELAYS {
            let delay_s = delay as f64 * STEP_S;
            let acting = intervals.iter().map(|i| asked.mean(&sums, i.from_s - delay_s)).collect();
            grid.push(((delay_s, lag_s), acting));
        }
    }
    grid
}

/// A fit at every delay and lag.
fn search<'a>(intervals: &[Interval], grid: &'a [Acting], keep: &[bool]) -> Vec<((f64, f64), Fit<'a>)> {
    grid.iter().filter_map(|(at, acting)| Some((*at, fit(intervals, acting, keep)?))).collect()
}

fn fit<'a>(intervals: &[Interval], asked: &'a [f64], keep: &[bool]) -> Option<Fit<'a>> {
    let (mut square, mut right, mut cost) = (Matrix3::zeros(), Vector3::zeros(), 0.0);
    for ((interval, &u), _) in intervals.iter().zip(asked).zip(keep).filter(|(_, keep)| **keep) {
        let row = Vector3::new(u, -1.0, -interval.v_x_sq);
        square += row * row.transpose();
        right += row * interval.gained_mps2;
        cost += interval.gained_mps2.powi(2);
    }
    let inverse = square.try_inverse()?;
    let x = inverse * right;
    cost -= x.dot(&right);
    (x.iter().all(|v| v.is_finite())).then_some(Fit { x, inverse, asked, cost })
}

/// Standard errors, clusters of neighbours taken together.
fn clustered(intervals: &[Interval], fit: &Fit<'_>, keep: &[bool]) -> [f64; 3] {
    let mut meat = Matrix3::zeros();
    let places: Vec<usize> = (0..intervals.len()).filter(|&k| keep[k]).collect();
    for cluster in places.chunks(CLUSTER) {
        let score: Vector3<f64> = cluster
            .iter()
            .map(|&k| {
                let row = Vector3::new(fit.asked[k], -1.0, -intervals[k].v_x_sq);
                row * (intervals[k].gained_mps2 - line(fit, &intervals[k], k))
            })
            .sum();
        meat += score * score.transpose();
    }
    let covariance = fit.inverse * meat * fit.inverse;
    [0, 1, 2].map(|k| covariance[(k, k)].max(0.0).sqrt())
}

/// The drive, cut into intervals without pauses.
fn intervals(sequence: &StateSequence, vehicle: &VehicleParameters) -> Vec<Interval> {
    let time = |k: usize| f64::from(sequence.time_s[k]);
    let count = sequence.time_s.len();
    let share = vehicle.l_r_m / vehicle.wheelbase_m();
    let mut all = Vec::new();
    let mut from = 0;
    while from < count {
        let mut to = from;
        while to + 1 < count && time(to) - time(from) < INTERVAL_S && time(to + 1) - time(to) < GAP_S {
            to += 1;
        }
        let length_s = time(to) - time(from);
        if length_s < 0.9 * INTERVAL_S {
            from = to + 1;
            continue;
        }
        let mean = |of: &dyn Fn(usize) -> f64| (from..=to).map(of).sum::<f64>() / (to - from + 1) as f64;
        let v = |k: usize| f64::from(sequence.v_x_mps[k]);
        // What the ends' slope is by least squares: all samples count.
        let middle_s = mean(&time);
        let v_x_mps = mean(&v);
        let apart = (from..=to).map(|k| (time(k) - middle_s).powi(2)).sum::<f64>();
        let slope = (from..=to).map(|k| (time(k) - middle_s) * (v(k) - v_x_mps)).sum::<f64>() / apart;
        let turning = mean(&|k| {
            let w = f64::from(sequence.yaw_rate_radps[k]);
            share * v(k) * w * f64::from(sequence.steering_rad[k]).tan() - f64::from(sequence.v_y_mps[k]) * w
        });
        if v_x_mps > SLOW_MPS {
            all.push(Interval {
                from_s: time(from),
                v_x_mps,
                v_x_sq: mean(&|k| v(k) * v(k)),
                gained_mps2: slope + turning,
                accelerated_mps2: slope,
            });
        }
        from = to;
    }
    all
}

/// Commanded accelerations on an even grid.
struct Asked {
    start_s: f64,
    held: Vec<f64>,
}

impl Asked {
    fn new(sequence: &StateSequence) -> Option<Self> {
        let (times, values) = (&sequence.command_time_s, &sequence.command_acceleration_mps2);
        let (first, last) = (*times.first()?, *sequence.time_s.last()?);
        if values.len() != times.len() {
            return None;
        }
        let start_s = f64::from(first);
        let steps = ((f64::from(last) - start_s) / STEP_S).ceil().max(0.0) as usize + 1;
        let mut place = 0;
        let held = (0..steps).map(|k| {
            let now_s = start_s + k as f64 * STEP_S;
            while place + 1 < times.len() && f64::from(times[place + 1]) <= now_s + 1e-6 {
                place += 1;
            }
            f64::from(values[place])
        });
        Some(Self { start_s, held: held.collect() })
    }

    /// The intervals where least is asked for.
    fn gentle(&self, intervals: &[Interval]) -> Vec<bool> {
        let sums = self.lagged(0.0);
        let asked: Vec<f64> = intervals.iter().map(|i| self.mean(&sums, i.from_s).abs()).collect();
        let mut sorted = asked.clone();
        sorted.sort_by(f64::total_cmp);
        let most = sorted.get((GENTLE * sorted.len() as f64) as usize).copied().unwrap_or(f64::INFINITY);
        asked.iter().map(|&a| a <= most).collect()
    }

    /// Running sums after a lag of first order.
    fn lagged(&self, lag_s: f64) -> Vec<f64> {
        let follows = 1.0 - (-STEP_S / lag_s.max(1e-9)).exp();
        let (mut at, mut sum) = (self.held.first().copied().unwrap_or(0.0), 0.0);
        let step = |&asked: &f64| {
            at += follows * (asked - at);
            sum += at * STEP_S;
            sum
        };
        self.held.iter().map(step).collect()
    }

    /// Mean over an interval, weighted as the slope of a line weighs what drives it: most in the middle.
    fn mean(&self, sums: &[f64], from_s: f64) -> f64 {
        let last = sums.len() - 1;
        let at = |time_s: f64| {
            let place = ((time_s - self.start_s) / STEP_S - 1.0).clamp(0.0, last as f64);
            let k = (place.floor() as usize).min(last.saturating_sub(1));
            sums[k] + (place - k as f64) * (sums[(k + 1).min(last)] - sums[k])
        };
        const PIECES: usize = 5;
        let piece_s = INTERVAL_S / PIECES as f64;
        let weighted = |k: usize| {
            let middle = (k as f64 + 0.5) / PIECES as f64;
            let begin_s = from_s + k as f64 * piece_s;
            6.0 * middle * (1.0 - middle) * (at(begin_s + piece_s) - at(begin_s)) / piece_s
        };
        (0..PIECES).map(weighted).sum::<f64>() / PIECES as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GAIN: f64 = 0.9;
    const DELAY_S: f64 = 0.08;
    const LAG_S: f64 = 0.12;
    const ROLLING: f64 = 0.25;
    const DRAG: f64 = 0.01;
    /// Most that the tires give.
    const LIMIT: f64 = 4.0;

    /// A drive of 60 s at 100 Hz; `asked` gives the commanded acceleration by time and speed.
    fn drive(asked: impl Fn(f64, f64) -> f64, noise: f64) -> StateSequence {
        let mut sequence = StateSequence::default();
        let (mut v, mut u, mut seed) = (5.0_f64, 0.0, 1_u32);
        let mut commands: Vec<f64> = Vec::new();
        let late = (DELAY_S * 1000.0) as usize;
        for step in 0..60_000_usize {
            let time_s = step as f64 * 1e-3;
            if step % 10 == 0 {
                // A linear congruential generator: noise enough.
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let off = noise * (f64::from(seed) / f64::from(u32::MAX) - 0.5) * 12.0_f64.sqrt();
                let a = asked(time_s, v);
                sequence.time_s.push(time_s as f32);
                sequence.v_x_mps.push((v + off) as f32);
                sequence.command_time_s.push(time_s as f32);
                sequence.command_acceleration_mps2.push(a as f32);
                commands.push(a);
            }
            let acting = step.checked_sub(late).map_or(0.0, |s| commands[s / 10]);
            u += 1e-3 / LAG_S * (acting - u);
            v = (v + 1e-3 * ((GAIN * u).clamp(-LIMIT, LIMIT) - ROLLING - DRAG * v * v)).max(1.0);
        }
        let zeros = vec![0.0; sequence.time_s.len()];
        sequence.v_y_mps.clone_from(&zeros);
        sequence.yaw_rate_radps.clone_from(&zeros);
        sequence.steering_rad = zeros;
        sequence
    }

    /// Pulses both ways between 2 and 12 m/s.
    fn pulses(most: f64) -> impl Fn(f64, f64) -> f64 {
        move |time_s, v| {
            let up = (time_s * 0.9).sin() + 0.5 * (time_s * 2.3).sin() > 0.0;
            if v < 2.0 || (up && v < 12.0) { most * (0.6 + 0.4 * (time_s * 0.37).sin()) } else { -most * 0.7 }
        }
    }

    fn holds(told: Told, truth: f64, half: f64) {
        let Told::Known(e) = told else { panic!("unknown, but the truth is {truth}") };
        assert!(e.low - 1e-9 <= truth && truth <= e.high + 1e-9, "{truth} is outside of {e:?}");
        assert!(e.high - e.low < 2.0 * half, "{e:?} is wide");
    }

    #[test]
    fn the_truth_of_a_drive_is_inside_of_narrow_intervals() {
        let found = longitudinal(&drive(pulses(3.0), 0.01), &VehicleParameters::f1tenth());
        holds(found.gain, GAIN, 0.06);
        holds(found.delay_s, DELAY_S, 0.05);
        holds(found.lag_s, LAG_S, 0.08);
        holds(found.rolling_resistance_mps2, ROLLING, 0.2);
        holds(found.drag_1pm, DRAG, 0.006);
        assert!(found.limits.iter().all(|l| l.a_max_mps2.is_none_or(|a| !a.reached)), "{:?}", found.limits);
    }

    #[test]
    fn limits_are_reached_where_more_is_asked_for_than_given() {
        let found = longitudinal(&drive(pulses(7.0), 0.01), &VehicleParameters::f1tenth());
        let reached: Vec<Given> =
            found.limits.iter().filter_map(|l| l.a_max_mps2).filter(|a| a.reached).collect();
        assert!(!reached.is_empty(), "{:?}", found.limits);
        // The limit less what holds the car back.
        assert!(reached.iter().all(|a| (2.0..LIMIT).contains(&a.value)), "{reached:?}");
    }

    #[test]
    fn what_the_drive_does_not_tell_is_unknown() {
        let vehicle = VehicleParameters::f1tenth();
        let mut silent = drive(|_, _| 0.0, 0.01);
        let coasting = longitudinal(&silent, &vehicle);
        assert_eq!((coasting.gain, coasting.delay_s), (Told::Unknown, Told::Unknown));
        silent.command_acceleration_mps2.clear();
        assert_eq!(longitudinal(&silent, &vehicle), Longitudinal::default());
        // One speed held: rolling resistance and drag cannot be told apart.
        let steady = longitudinal(&drive(|_, v| 2.0 * (6.0 - v) + 0.6, 0.05), &vehicle);
        assert_eq!(steady.drag_1pm, Told::Unknown, "{steady:?}");
        assert_eq!(serde_json::to_value(&steady).unwrap()["drag_1pm"], "unknown");
    }
}
