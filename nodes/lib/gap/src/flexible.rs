//! Flexible terms: what additive functions of state and input could explain at best. The ceiling for every named effect.
//!
//! On the accelerations of v_y and r: hat functions of the slip angle of each axle, and products of the slips with speed, longitudinal
//! acceleration and lateral acceleration. On the signals: constants, and each channel's own course (derivatives, yaw rate).
//! All are linear in their parameters, so that one or two Gauss-Newton steps find them; a ridge keeps them small.

use gripsight_vehicle::Real;

use crate::recording::{Channel, Recording};
use crate::terms::{Moment, Outputs};

/// Terms on the accelerations, per acceleration.
const FORCE_TERMS: usize = 14;
/// Terms on each channel.
const SENSOR_TERMS: usize = 4;

/// Scales that make the terms' parameters numbers around one.
#[derive(Debug, Clone)]
pub(crate) struct Flexible {
    slip_rad: f64,
    speed_mps: f64,
    a_x_mps2: f64,
    a_y_mps2: f64,
    yaw_acceleration: f64,
    /// The channels of the recording that was fitted, with their sizes; another recording may have others.
    channels: Vec<(Channel, f64)>,
}

impl Flexible {
    /// Scales taken from a recording; `slip_rad` is a large slip angle of the fitted model on it.
    pub(crate) fn new(recording: &Recording, slip_rad: f64, wheelbase_m: f64) -> Self {
        let spread = |values: &mut dyn Iterator<Item = f64>| {
            let (mut n, mut square) = (0.0, 0.0);
            for v in values {
                n += 1.0;
                square += v * v;
            }
            if n > 0.0 { (square / f64::max(n, 1.0)).sqrt().max(1e-6) } else { 1.0 }
        };
        let runs = &recording.runs;
        let speed_mps = recording.typical_speed_mps().max(0.5);
        let yaw = spread(&mut runs.iter().flat_map(|r| r.measured[1].iter().copied()));
        Self {
            slip_rad: slip_rad.max(0.005),
            speed_mps,
            a_x_mps2: spread(&mut runs.iter().flat_map(|r| r.a_x_mps2.iter().copied())),
            a_y_mps2: (yaw * speed_mps).max(0.5),
            yaw_acceleration: (yaw * speed_mps / wheelbase_m).max(0.5),
            channels: (recording.channels.iter().enumerate())
                .map(|(c, channel)| {
                    (*channel, spread(&mut runs.iter().flat_map(|r| r.measured[c].iter().copied())))
                })
                .collect(),
        }
    }

    /// How many parameters there are.
    pub(crate) fn parameters(&self) -> usize {
        2 * FORCE_TERMS + SENSOR_TERMS * self.channels.len()
    }

    /// Additional lateral and yaw acceleration.
    pub(crate) fn motion<T: Real>(
        &self,
        p: &[T],
        at: &Moment<T>,
        v_y: T,
        slip_rad: [T; 2],
        steering_rad: T,
    ) -> (T, T) {
        let mut terms: [T; FORCE_TERMS] = [T::from(0.0); FORCE_TERMS];
        terms[0] = T::from(1.0);
        let a_x = at.a_x_mps2 / self.a_x_mps2;
        let fast = at.v_x_mps / self.speed_mps - 1.0;
        for (i, slip) in slip_rad.iter().enumerate() {
            let s = (*slip / self.slip_rad).tanh();
            let from = 1 + 5 * i;
            terms[from] = s;
            terms[from + 1] = s * s * s;
            terms[from + 2] = s * s;
            terms[from + 3] = s * fast;
            terms[from + 4] = s * a_x;
        }
        terms[11] = at.yaw_rate_radps * at.v_x_mps / self.a_y_mps2;
        terms[12] = v_y / self.speed_mps;
        terms[13] = steering_rad / self.slip_rad;
        let sum = |own: &[T]| terms.iter().zip(own).fold(T::from(0.0), |s, (t, c)| s + *t * *c);
        (
            sum(&p[..FORCE_TERMS]) * (0.1 * self.a_y_mps2),
            sum(&p[FORCE_TERMS..2 * FORCE_TERMS]) * (0.1 * self.yaw_acceleration),
        )
    }

    /// Additions to the signals: a constant, the yaw rate, the signal's own slope, the yaw acceleration.
    pub(crate) fn sense<T: Real>(&self, p: &[T], out: &mut Outputs<T>) {
        let n = out.v_y_mps.len();
        let dt_s = out.dt_s;
        let rate: Vec<T> = out.yaw_rate_radps.clone();
        let acceleration = out.yaw_acceleration_radps2.clone();
        for (c, (channel, size)) in self.channels.iter().enumerate() {
            let own = &p[2 * FORCE_TERMS + SENSOR_TERMS * c..][..SENSOR_TERMS];
            let series: &mut Vec<T> = match channel {
                Channel::LateralVelocity => &mut out.v_y_mps,
                Channel::LateralAcceleration => &mut out.a_y_mps2,
                Channel::Heading => &mut out.heading_rad,
                Channel::LongitudinalAcceleration => &mut out.a_x_mps2,
                Channel::Speed => &mut out.v_x_mps,
                // Both share one series; the odometry's terms serve for both.
                Channel::YawRate => &mut out.yaw_rate_radps,
                Channel::Gyro | Channel::LateralKinematics => continue,
            };
            let before = series.clone();
            for k in 0..n {
                let (a, b) = (k.saturating_sub(1), (k + 1).min(n - 1));
                let slope = (before[b] - before[a]) / ((b - a).max(1) as f64 * dt_s);
                let turn = rate[k] * (self.speed_mps / self.a_y_mps2);
                let twist = acceleration[k] / self.yaw_acceleration;
                let more = own[0] + own[1] * turn + own[3] * twist;
                series[k] += more * (0.1 * *size) + own[2] * slope * 0.05;
            }
        }
    }
}
