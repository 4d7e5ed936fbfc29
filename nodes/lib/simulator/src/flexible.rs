//! What no parameter explains: disturbances of the states between steps, as smooth functions of the motion.
//!
//! ```text
//! d v_y/dt += sum_m c_m phi_m(t),    d r/dt += sum_m e_m phi_m(t)
//! ```
//!
//! The simulator itself carries each disturbance on through a window. Where neither v_y nor yaw rate is a state of it, the terms are
//! added to its outputs instead. Terms that belong to one mechanism are also fitted alone: what the simulator may have no term for.

use nalgebra::DVector;

use crate::SimulatorError;
use crate::fit::{Fitter, State};
use crate::linear::{Normal, window_squares};
use crate::model::{Kicks, Residuals};
use crate::{Channel, Drive};

/// A function of the motion, with the mechanism that works like it.
struct Term {
    mechanism: &'static str,
    of: fn(&Motion) -> f64,
}

/// What terms are made of.
struct Motion {
    v_x: f64,
    v_y: f64,
    yaw_rate: f64,
    steering: f64,
    a_x: f64,
    a_y: f64,
    jerk_y: f64,
    yaw_jerk: f64,
}

/// Derivatives at the front of d a/dt = v/sigma (a_steady - a): a relaxation length in both of its effects.
const TERMS: [Term; 10] = [
    Term { mechanism: "tire_relaxation", of: |m| m.jerk_y / m.v_x },
    Term { mechanism: "tire_relaxation", of: |m| m.yaw_jerk / m.v_x },
    Term { mechanism: "tire_curve", of: |m| m.steering },
    Term { mechanism: "tire_curve", of: |m| m.v_y / m.v_x },
    Term { mechanism: "tire_curve", of: |m| m.yaw_rate / m.v_x },
    Term { mechanism: "lateral_load_transfer", of: |m| m.a_y * m.a_y.abs() },
    Term { mechanism: "lateral_load_transfer", of: |m| m.a_y.powi(3) },
    Term { mechanism: "longitudinal_load_transfer", of: |m| m.a_x * m.a_y },
    Term { mechanism: "combined_slip", of: |m| m.a_x * m.a_x * m.a_y },
    Term { mechanism: "road_bank", of: |_| 1.0 },
];

/// What free terms leave.
#[derive(Debug, Clone)]
pub(crate) struct Flexible {
    /// Squares of every window with all the terms.
    pub(crate) all: Vec<f64>,
    /// The same with the terms of one mechanism alone, by mechanism.
    pub(crate) alone: Vec<(&'static str, Vec<f64>)>,
}

impl Fitter<'_> {
    /// Fits the free terms around a state, on the training windows.
    ///
    /// # Errors
    /// What the simulator says.
    pub(crate) fn flexible(&self, state: &State) -> Result<Flexible, SimulatorError> {
        let columns = self.columns(state)?;
        let projected: Vec<Residuals> =
            columns.iter().map(|(_, c)| state.starts.project(&self.layout, c).0).collect();
        let left = |picked: &dyn Fn(&str) -> bool| {
            let used: Vec<&Residuals> =
                columns.iter().zip(&projected).filter(|((m, _), _)| picked(m)).map(|(_, p)| p).collect();
            // A little damping: terms that are alike in this drive share what they explain.
            let step = Normal::new(&self.layout, &state.projected, &used).step(1e-4);
            let step = step.unwrap_or_else(|| DVector::zeros(used.len()));
            let mut r = state.projected.clone();
            for (column, size) in used.iter().zip(step.iter()) {
                r.iter_mut().zip(column.iter()).for_each(|(r, d)| *r += size * d);
            }
            window_squares(&self.layout, &r)
        };
        let mut mechanisms: Vec<&'static str> = TERMS.iter().map(|t| t.mechanism).collect();
        mechanisms.dedup();
        let alone = mechanisms.iter().map(|name| (*name, left(&|m| m == *name))).collect();
        Ok(Flexible { all: left(&|_| true), alone })
    }

    /// Derivatives of the residuals by each term, with its mechanism.
    fn columns(&self, state: &State) -> Result<Vec<(&'static str, Residuals)>, SimulatorError> {
        let drive = self.model.drive;
        let terms: Vec<Vec<Vec<f64>>> = TERMS.iter().map(|t| values(drive, t.of)).collect();
        let description = self.model.roll.description();
        let states: Vec<usize> =
            [Channel::VYMps, Channel::YawRateRadps].iter().filter_map(|&c| description.state(c)).collect();
        if states.is_empty() {
            return Ok(self.on_outputs(&terms));
        }
        /// Of a term of size one: small beside what tires do, large beside rounding.
        const SMALL: f64 = 0.1;
        let mut kicks: Vec<Kicks> = Vec::new();
        let mut mechanisms = Vec::new();
        for (term, values) in TERMS.iter().zip(&terms) {
            for &s in &states {
                let row = |v: &f64| {
                    let mut row = vec![0.0; description.states.len()];
                    row[s] = SMALL * v;
                    row
                };
                kicks.push(values.iter().map(|stretch| stretch.iter().map(row).collect()).collect());
                mechanisms.push(term.mechanism);
            }
        }
        let points = vec![state.point.clone(); kicks.len()];
        let results = self.model.kicked(&points, &kicks)?;
        let derivative = |r: Residuals| -> Residuals {
            let pairs = r.iter().zip(&state.residuals);
            pairs.map(|(a, b)| if a.is_finite() { (a - b) / SMALL } else { 0.0 }).collect()
        };
        Ok(mechanisms.into_iter().zip(results.into_iter().map(derivative)).collect())
    }

    fn on_outputs(&self, terms: &[Vec<Vec<f64>>]) -> Vec<(&'static str, Residuals)> {
        let drive = self.model.drive;
        let count = drive.channels.len();
        let mut out = Vec::new();
        for (term, values) in TERMS.iter().zip(terms) {
            for (channel, (_, sigma)) in drive.channels.iter().enumerate() {
                let mut column = Vec::new();
                for w in &drive.windows {
                    for value in &values[w.stretch][w.from..w.from + w.len] {
                        column.extend((0..count).map(|c| if c == channel { -value / sigma } else { 0.0 }));
                    }
                }
                out.push((term.mechanism, column));
            }
        }
        out
    }
}

/// A term at every sample of every stretch, its root mean square one.
fn values(drive: &Drive, of: fn(&Motion) -> f64) -> Vec<Vec<f64>> {
    let mut all: Vec<Vec<f64>> = drive
        .stretches
        .iter()
        .map(|s| {
            let dt_s = s.segment.dt_s;
            let (v_y, yaw_rate) = (smooth(&s.segment.v_y_mps), smooth(&s.segment.yaw_rate_radps));
            let (slip_rate, yaw_acceleration) = (derivative(&v_y, dt_s), derivative(&yaw_rate, dt_s));
            let a_y: Vec<f64> = (0..v_y.len()).map(|k| slip_rate[k] + s.v_x_mps[k] * yaw_rate[k]).collect();
            let (jerk_y, yaw_jerk) = (derivative(&a_y, dt_s), derivative(&yaw_acceleration, dt_s));
            (0..v_y.len())
                .map(|k| {
                    of(&Motion {
                        v_x: s.v_x_mps[k].max(1.0),
                        v_y: v_y[k],
                        yaw_rate: yaw_rate[k],
                        steering: s.segment.steering_rad[k],
                        a_x: s.a_x_mps2[k],
                        a_y: a_y[k],
                        jerk_y: jerk_y[k],
                        yaw_jerk: yaw_jerk[k],
                    })
                })
                .collect()
        })
        .collect();
    let (sum, count) = all.iter().flatten().fold((0.0, 0), |(s, n), v| (s + v * v, n + 1));
    let size = (sum / f64::from(count.max(1))).sqrt();
    if size > 0.0 {
        all.iter_mut().flatten().for_each(|v| *v /= size);
    }
    all
}

/// Mean over 50 ms at 100 Hz: terms are smooth, noise is not.
fn smooth(v: &[f64]) -> Vec<f64> {
    const HALF: usize = 3;
    (0..v.len())
        .map(|k| {
            let span = &v[k.saturating_sub(HALF)..(k + HALF + 1).min(v.len())];
            span.iter().sum::<f64>() / span.len() as f64
        })
        .collect()
}

fn derivative(v: &[f64], dt_s: f64) -> Vec<f64> {
    const REACH: usize = 2;
    let rate = |k: usize| {
        let (from, to) = (k.saturating_sub(REACH), (k + REACH).min(v.len() - 1));
        (v[to] - v[from]) / ((to - from).max(1) as f64 * dt_s)
    };
    smooth(&(0..v.len()).map(rate).collect::<Vec<_>>())
}
