//! The telemetry as the diagnosis uses it: even stretches, the channels to be explained, and what goes into the model.

use gripsight_signals::{Segment, StateSequence, segments};

use crate::ModelError;
use crate::smooth::{local_quadratic, median, quantile};
use crate::station::{Laps, stations};

/// A signal that the model predicts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Channel {
    /// Lateral velocity of the odometry.
    LateralVelocity,
    /// Yaw rate of the odometry.
    YawRate,
    /// Specific force to the left of the inertial unit.
    LateralAcceleration,
    /// Yaw rate of the gyroscope, where it is not the odometry's.
    Gyro,
    /// Heading, less its mean over a window, where the yaw rate was not derived from it.
    Heading,
    /// Specific force forward, with a longitudinal command.
    LongitudinalAcceleration,
    /// Forward speed, less its mean over a window, with a longitudinal command.
    Speed,
    /// v_y less the integral of a_y - v_x r, less its mean: zero for any tire where the sensors and the road are as assumed. Fitted, not
    /// scored: it repeats what other channels hold, without the tires' errors.
    LateralKinematics,
}

impl Channel {
    /// Every channel.
    pub const ALL: [Self; 8] = [
        Self::LateralVelocity,
        Self::YawRate,
        Self::LateralAcceleration,
        Self::Gyro,
        Self::Heading,
        Self::LongitudinalAcceleration,
        Self::Speed,
        Self::LateralKinematics,
    ];

    /// Name with unit.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::LateralVelocity => "v_y_mps",
            Self::YawRate => "yaw_rate_radps",
            Self::LateralAcceleration => "a_y_mps2",
            Self::Gyro => "gyro_yaw_rate_radps",
            Self::Heading => "heading_rad",
            Self::LongitudinalAcceleration => "a_x_mps2",
            Self::Speed => "v_x_mps",
            Self::LateralKinematics => "v_y_kinematic_mps",
        }
    }

    /// Whether only its course over a window counts, not its level.
    pub fn without_mean(self) -> bool {
        matches!(self, Self::Heading | Self::Speed | Self::LateralKinematics)
    }

    /// Whether errors in it count where models are scored.
    pub fn scored(self) -> bool {
        self != Self::LateralKinematics
    }
}

/// An even stretch of the recording.
#[derive(Debug, Clone)]
pub struct Run {
    /// Time of its first sample since the recording's first.
    pub start_time_s: f64,
    /// Step between samples.
    pub dt_s: f64,
    /// Forward speed, smoothed.
    pub v_x_mps: Vec<f64>,
    /// Recorded steering angle, left positive.
    pub steering_rad: Vec<f64>,
    /// Commanded steering angle from each sample to the next, on average; empty where the steering is a measured angle.
    pub held_steering_rad: Vec<f64>,
    /// Longitudinal acceleration (specific force), smoothed; from speed and yaw rate where none is recorded.
    pub a_x_mps2: Vec<f64>,
    /// The same as it was recorded, where it was.
    pub recorded_a_x_mps2: Vec<f64>,
    /// Commanded longitudinal force over the nominal mass, from each sample to the next; without a command the acceleration.
    pub force_x_mps2: Vec<f64>,
    /// Distance along the lap over its length; 0 without a pose.
    pub lap_share: Vec<f64>,
    /// Heading of the pose; 0 without one.
    pub heading_rad: Vec<f64>,
    /// Where on the course, as an angle: of the distance along it, without a pose the heading.
    pub place_rad: Vec<f64>,
    /// Lateral velocity and yaw rate, smoothed: what slips were before a window starts.
    pub smooth: [Vec<f64>; 2],
    /// Measured signals by channel, in the order of [`Recording::channels`].
    pub measured: Vec<Vec<f64>>,
    /// Where the longitudinal command jumps: what the acceleration is there is not asked.
    pub jumps: Vec<bool>,
}

impl Run {
    /// Samples.
    #[must_use]
    pub fn len(&self) -> usize {
        self.v_x_mps.len()
    }

    /// Whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.v_x_mps.is_empty()
    }

    /// Whether the steering is a command, which stays what it is from its stamp to the next one's; else it is an angle that moves on between samples.
    #[must_use]
    pub fn steering_is_held(&self) -> bool {
        !self.held_steering_rad.is_empty()
    }

    /// The steering in even steps: of a held command its mean from each sample to the next, else the angle at each sample.
    #[must_use]
    pub fn steering_course_rad(&self) -> &[f64] {
        if self.steering_is_held() { &self.held_steering_rad } else { &self.steering_rad }
    }

    /// The command in force `ago_s` before sample `k`, of one that changes once in a step at most: where in a step it does, the step's mean tells.
    pub(crate) fn command_rad(&self, k: usize, ago_s: f64) -> f64 {
        /// How much later than it a command may come and still belong to a sample: stamps are rounded, fits are as exact as they are.
        const SLACK_S: f64 = 3e-4;
        let at = (k as f64 - (ago_s - SLACK_S) / self.dt_s).max(0.0);
        let (from, share) = (at as usize, at.fract());
        let last = self.len() - 1;
        let [before, after] = [from, from + 1].map(|i| self.steering_rad[i.min(last)]);
        let before_share = (after - self.held_steering_rad[from.min(last)]) / (after - before);
        // A sample's own command is known.
        if ago_s > 0.0 && share > before_share { after } else { before }
    }

    /// Puts an effect with parameters `own` between the recorded steering and what it stands for.
    pub fn steer(&mut self, effect: crate::EffectId, own: &[f64]) {
        effect.steer(own, &mut self.steering_rad, self.dt_s);
        effect.steer_held(own, &mut self.held_steering_rad, self.dt_s);
    }

    /// Time of sample `k` since the recording's first.
    #[must_use]
    pub fn time_s(&self, k: usize) -> f64 {
        self.start_time_s + k as f64 * self.dt_s
    }
}

/// A recording, ready to be diagnosed.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Its even stretches.
    pub runs: Vec<Run>,
    /// The channels that are explained.
    pub channels: Vec<Channel>,
    /// Standard deviation of each channel's noise; infinite where a channel is fitted and not scored.
    pub sigma: Vec<f64>,
    /// What residuals are divided by when fitting: noise, and a share of the signal's own size that no single-track model gets right.
    pub weights: Vec<f64>,
    /// Places on the course.
    pub laps: Laps,
    /// Whether a longitudinal command is recorded.
    pub has_command: bool,
    /// Where between the commands before a sample (0) and after it (1) the acceleration measured at the sample stands.
    pub force_ahead: f64,
    /// Whether the lateral acceleration was computed from v_y, v_x and r instead of measured.
    pub derived_a_y: bool,
    /// Time recorded.
    pub recorded_s: f64,
    /// Slowest speed that is used.
    pub least_speed_mps: f64,
    /// The kinematic identities on it.
    pub identities: Vec<crate::Identity>,
}

/// Time that a recording needs to tell anything.
pub const NEEDED_S: f64 = 8.0;
/// Length of the windows that are fitted, and over which channels that drift count.
pub const WINDOW_S: f64 = 0.5;
/// Stretches shorter than this are left out.
const SHORTEST_S: f64 = 1.5;
/// Speed and longitudinal acceleration are smoothed over this time to each side.
const SMOOTH_S: f64 = 0.06;

/// Share of a signal's size that a single-track model is not expected to get right.
const MODEL_SHARE: f64 = 0.02;

impl Recording {
    /// Prepares a recording.
    ///
    /// # Errors
    /// What is wrong with the telemetry; [`ModelError::TooCoarse`] below 15 Hz.
    pub fn new(sequence: &StateSequence) -> Result<Self, ModelError> {
        Self::beside(sequence, None)
    }

    /// Prepares a recording whose places are those of another one, where both are of one course.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn beside(sequence: &StateSequence, other: Option<&Self>) -> Result<Self, ModelError> {
        const LEAST_RATE_HZ: f64 = 15.0;
        let parts = segments(sequence, SHORTEST_S)?;
        let recorded_s = sequence.duration_s();
        let all_v: Vec<f64> = parts.iter().flat_map(|s| s.v_x_mps.iter().copied()).collect();
        let least_speed_mps = (0.25 * quantile(all_v, 0.9)).max(0.5);
        let Some(first) = parts.first() else {
            return Err(ModelError::TooLittle {
                usable_s: 0.0,
                recorded_s,
                needed_s: NEEDED_S,
                least_speed_mps,
            });
        };
        let dt_s = first.dt_s;
        if dt_s > 1.0 / LEAST_RATE_HZ {
            return Err(ModelError::TooCoarse { rate_hz: 1.0 / dt_s, needed_hz: LEAST_RATE_HZ });
        }
        let laps = stations(&parts, other.map(|o| &o.laps));
        let has_command = !first.command_acceleration_mps2.is_empty();
        let identities = crate::identities::check(&parts);
        let channels = channels(first, has_command, &identities);
        let mut runs: Vec<Run> =
            parts.iter().zip(&laps.share).map(|(s, share)| run(s, &laps, share, &channels)).collect();
        let mut sigma: Vec<f64> = (0..channels.len()).map(|c| crate::noise::sigma(&runs, c)).collect();
        if let Some(c) = channels.iter().position(|c| *c == Channel::Heading) {
            sigma[c] = sigma[c].max(crate::noise::heading_wander(&runs, c, 1));
        }
        let sigma: Vec<f64> = (0..channels.len())
            .map(|c| if channels[c].scored() { sigma[c] } else { f64::INFINITY })
            .collect();
        let weights: Vec<f64> = sigma
            .iter()
            .enumerate()
            .map(|(c, s)| s.hypot(MODEL_SHARE * crate::noise::spread(&runs, c, channels[c].without_mean())))
            .collect();
        let weights = with_kinematic_weight(&channels, weights, &runs, &sigma);
        let mut force_ahead = 0.0;
        if let Some(c) = channels.iter().position(|c| *c == Channel::LongitudinalAcceleration) {
            force_ahead = ahead(&runs, c);
            runs.iter_mut().for_each(|run| run.jumps = jumps(&run.force_x_mps2, sigma[c]));
        }
        let derived_a_y = identities.iter().any(|i| i.name == crate::identities::LATERAL && !i.informative);
        Ok(Self {
            runs,
            channels,
            sigma,
            weights,
            laps,
            has_command,
            force_ahead,
            derived_a_y,
            recorded_s,
            least_speed_mps,
            identities,
        })
    }

    /// The same without the channels that are not in `kept`.
    #[must_use]
    pub fn with_channels(&self, kept: &[Channel]) -> Self {
        let places: Vec<usize> =
            (0..self.channels.len()).filter(|c| kept.contains(&self.channels[*c])).collect();
        let only = |values: &[f64]| places.iter().map(|&c| values[c]).collect();
        let mut out = Self { sigma: only(&self.sigma), weights: only(&self.weights), ..self.clone() };
        out.channels = places.iter().map(|&c| self.channels[c]).collect();
        for (run, own) in out.runs.iter_mut().zip(&self.runs) {
            run.measured = places.iter().map(|&c| own.measured[c].clone()).collect();
        }
        out
    }

    /// Whether the steering is a command; see [`Run::steering_is_held`].
    #[must_use]
    pub fn steering_is_held(&self) -> bool {
        self.runs.iter().any(Run::steering_is_held)
    }

    /// Step between samples.
    #[must_use]
    pub fn dt_s(&self) -> f64 {
        self.runs.first().map_or(0.01, |r| r.dt_s)
    }

    /// Median speed of the samples that count.
    pub fn typical_speed_mps(&self) -> f64 {
        let fast =
            self.runs.iter().flat_map(|r| r.v_x_mps.iter().copied()).filter(|v| *v > self.least_speed_mps);
        median(fast.collect())
    }
}

/// Which channels there are, and say something of their own.
fn channels(segment: &Segment, has_command: bool, identities: &[crate::Identity]) -> Vec<Channel> {
    let independent = |name: &str| identities.iter().any(|i| i.name == name && i.informative);
    let has = |c: Channel| match c {
        Channel::LateralVelocity | Channel::YawRate => true,
        Channel::LateralAcceleration => !segment.a_y_mps2.is_empty(),
        Channel::Gyro => {
            !segment.gyro_yaw_rate_radps.is_empty()
                && differs(&segment.gyro_yaw_rate_radps, &segment.yaw_rate_radps)
        }
        Channel::Heading => !segment.yaw_rad.is_empty() && independent(crate::identities::HEADING),
        Channel::LongitudinalAcceleration => has_command && !segment.a_x_mps2.is_empty(),
        Channel::Speed => has_command,
        Channel::LateralKinematics => !segment.a_y_mps2.is_empty() && independent(crate::identities::LATERAL),
    };
    Channel::ALL.into_iter().filter(|&c| has(c)).collect()
}

/// Whether two recordings of one quantity are two measurements: they differ by more than a part of their own fastest changes.
fn differs(a: &[f64], b: &[f64]) -> bool {
    const SHARE: f64 = 0.3;
    let apart = median(a.iter().zip(b).map(|(x, y)| (x - y).abs()).collect());
    let fast = median(a.windows(3).map(|w| (w[2] - 2.0 * w[1] + w[0]).abs()).collect()) / 6_f64.sqrt();
    apart > SHARE * fast
}

/// How far ahead of the force at a sample an acceleration stands that is measured there, as a share of the way to the force at the next sample: its stamps,
/// and how it was interpolated, are not known. By least squares on what changes from sample to sample.
fn ahead(runs: &[Run], c: usize) -> f64 {
    let (mut product, mut square) = (0.0, 0.0);
    for run in runs {
        let mut last = run.force_x_mps2[0];
        let mut after = |k| {
            last = run.force_after_mps2(last, k, true);
            last
        };
        let force: Vec<f64> = (0..run.len()).map(&mut after).collect();
        for (force, measured) in force.windows(3).zip(run.measured[c][1..].windows(2)) {
            let (late, early) = (force[1] - force[0], force[2] - force[1]);
            product += (early - late) * (measured[1] - measured[0] - late);
            square += (early - late).powi(2);
        }
    }
    if square > 0.0 { (product / square).clamp(0.0, 1.0) } else { 0.0 }
}

/// Where a command jumps: measurements are interpolated, so that when it jumped is known to half a step, and half the jump would be noise. `sigma`: of
/// the acceleration. What a command does all the time is no jump.
fn jumps(force_x_mps2: &[f64], sigma: f64) -> Vec<bool> {
    const STANDARD_DEVIATIONS: f64 = 3.0;
    /// Median of the size of a normal deviate.
    const MEDIAN: f64 = 0.6745;
    let bends: Vec<f64> = force_x_mps2.windows(3).map(|f| (f[2] - 2.0 * f[1] + f[0]).abs()).collect();
    let usual = median(bends.clone()) / MEDIAN;
    let most = STANDARD_DEVIATIONS * sigma.max(usual);
    let mut out = vec![false; force_x_mps2.len()];
    // The bend of three steps, the second from sample k + 1 on: they touch samples k to k + 3.
    for (k, _) in bends.iter().enumerate().filter(|(_, bend)| **bend > most) {
        let last = (k + 3).min(out.len() - 1);
        out[k..=last].fill(true);
    }
    out
}

fn run(s: &Segment, laps: &Laps, lap_share: &[f64], channels: &[Channel]) -> Run {
    let half = (SMOOTH_S / s.dt_s).round().max(1.0) as usize;
    let (v_x_mps, v_x_rate) = local_quadratic(&s.v_x_mps, half, s.dt_s);
    let a_x_mps2 = if s.a_x_mps2.is_empty() {
        (0..s.len()).map(|k| v_x_rate[k] - s.v_y_mps[k] * s.yaw_rate_radps[k]).collect()
    } else {
        local_quadratic(&s.a_x_mps2, half, s.dt_s).0
    };
    let force_x_mps2 = if s.command_acceleration_mps2.is_empty() {
        a_x_mps2.clone()
    } else {
        s.command_acceleration_mps2.clone()
    };
    let measured = channels
        .iter()
        .map(|c| match c {
            Channel::LateralVelocity => s.v_y_mps.clone(),
            Channel::YawRate => s.yaw_rate_radps.clone(),
            Channel::LateralAcceleration => s.a_y_mps2.clone(),
            Channel::Gyro => s.gyro_yaw_rate_radps.clone(),
            Channel::Heading => s.yaw_rad.clone(),
            Channel::LongitudinalAcceleration => s.a_x_mps2.clone(),
            Channel::Speed => s.v_x_mps.clone(),
            Channel::LateralKinematics => kinematic(&v_x_mps, s),
        })
        .collect();
    let heading_rad = if s.yaw_rad.is_empty() { vec![0.0; s.len()] } else { s.yaw_rad.clone() };
    Run {
        start_time_s: s.start_time_s,
        dt_s: s.dt_s,
        v_x_mps,
        steering_rad: s.steering_rad.clone(),
        held_steering_rad: s.command_steering_rad.clone(),
        recorded_a_x_mps2: if s.a_x_mps2.is_empty() { a_x_mps2.clone() } else { s.a_x_mps2.clone() },
        a_x_mps2,
        force_x_mps2,
        lap_share: lap_share.to_vec(),
        place_rad: if laps.lap_m > 0.0 {
            lap_share.iter().map(|share| std::f64::consts::TAU * share).collect()
        } else {
            heading_rad.clone()
        },
        heading_rad,
        smooth: [&s.v_y_mps, &s.yaw_rate_radps].map(|c| local_quadratic(c, half, s.dt_s).0),
        measured,
        jumps: vec![false; s.len()],
    }
}

/// v_y less the integral of a_y - v_x r.
fn kinematic(v_x_mps: &[f64], s: &Segment) -> Vec<f64> {
    let rate = |k: usize| s.a_y_mps2[k] - v_x_mps[k] * s.yaw_rate_radps[k];
    let mut integral = 0.0;
    (0..s.len())
        .map(|k| {
            if k > 0 {
                integral += 0.5 * (rate(k) + rate(k - 1)) * s.dt_s;
            }
            s.v_y_mps[k] - integral
        })
        .collect()
}

/// The kinematic channel's weight from the noise of what it is made of, integrated over half a window.
fn with_kinematic_weight(
    channels: &[Channel],
    mut weights: Vec<f64>,
    runs: &[Run],
    sigma: &[f64],
) -> Vec<f64> {
    let of = |channel| channels.iter().position(|&c| c == channel).map_or(0.0, |c| sigma[c]);
    if let Some(place) = channels.iter().position(|&c| c == Channel::LateralKinematics) {
        let v_x = median(runs.iter().flat_map(|r| r.v_x_mps.iter().copied()).collect());
        let dt_s = runs.first().map_or(0.01, |r| r.dt_s);
        let walk = (dt_s * WINDOW_S / 4.0).sqrt();
        let rate = of(Channel::LateralAcceleration).hypot(v_x * of(Channel::YawRate));
        let noise = of(Channel::LateralVelocity).hypot(rate * walk);
        weights[place] = noise.hypot(MODEL_SHARE * crate::noise::spread(runs, 0, true));
    }
    weights
}
