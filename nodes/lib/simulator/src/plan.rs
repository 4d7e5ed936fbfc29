//! Which steps of a simulator matter over a stretch: where it is placed, where its outputs are wanted, and how these become samples.

use ndarray::Array3;

use crate::drive::{Stretch, Window};

/// Time between placements where no window begins: what is hidden stays near what it was in the car.
const PLACE_EVERY_S: f64 = 0.1;

/// Which steps matter in a stretch.
pub(crate) struct Plan {
    pub(crate) steps: usize,
    steps_per_sample: f64,
    /// Steps at which the car is placed, with the window that begins there.
    pub(crate) places: Vec<(usize, Option<usize>)>,
    /// Steps at which outputs are wanted.
    pub(crate) outputs: Vec<usize>,
    /// By window: the step that it begins at, and its first sample's place in time, in steps.
    begins: Vec<(usize, f64, usize)>,
}

impl Plan {
    pub(crate) fn new(stretch: &Stretch, windows: &[(usize, &Window)], step_s: f64) -> Self {
        let steps_per_sample = stretch.segment.dt_s / step_s;
        let last = windows.iter().map(|(_, w)| w.from + w.len).max().unwrap_or(0);
        let steps = (last as f64 * steps_per_sample).ceil() as usize;
        let begins: Vec<(usize, f64, usize)> = windows
            .iter()
            .map(|(_, w)| {
                let at = w.from as f64 * steps_per_sample;
                let end = ((w.from + w.len) as f64 * steps_per_sample).round() as usize;
                (at.round() as usize, at, end)
            })
            .collect();
        let every = (PLACE_EVERY_S / step_s).round().max(1.0) as usize;
        let mut places: Vec<(usize, Option<usize>)> =
            begins.iter().enumerate().map(|(w, (step, _, _))| (*step, Some(w))).collect();
        let inside = |k: usize| begins.iter().any(|(from, _, to)| (*from..*to).contains(&k));
        places.extend((0..steps).step_by(every).filter(|&k| !inside(k)).map(|k| (k, None)));
        places.sort_by_key(|(step, window)| (*step, window.is_none()));
        places.dedup_by_key(|(step, _)| *step);
        let mut outputs: Vec<usize> = Vec::new();
        for ((from, at, to), (_, w)) in begins.iter().zip(windows) {
            for i in 0..w.len {
                let step = (at + i as f64 * steps_per_sample).max(*from as f64);
                let low = (step + 1e-6).floor() as usize;
                outputs.push(low);
                // Beyond the window's end the car has been placed anew: the step before tells its slope.
                if step - low as f64 > 1e-6 {
                    outputs.push(if low + 1 < *to { low + 1 } else { low.saturating_sub(1) });
                }
            }
        }
        outputs.sort_unstable();
        outputs.dedup();
        Self { steps, steps_per_sample, places, outputs, begins }
    }

    /// A series of samples at every step from 0 to `steps`.
    pub(crate) fn at_steps(&self, values: &[f64], steps: usize) -> Vec<f64> {
        let last = values.len() - 1;
        (0..=steps)
            .map(|k| {
                let at = (k as f64 / self.steps_per_sample).min(last as f64);
                let low = (at.floor() as usize).min(last);
                let high = (low + 1).min(last);
                values[low] + (values[high] - values[low]) * (at - low as f64)
            })
            .collect()
    }

    /// An output at the samples of a window.
    pub(crate) fn window(
        &self,
        outputs: &Array3<f64>,
        b: usize,
        c: usize,
        number: usize,
        len: usize,
    ) -> Vec<f64> {
        let (from, at, to) = self.begins[number];
        let value = |step: usize| match self.outputs.binary_search(&step) {
            Ok(row) => outputs[[b, row, c]],
            Err(_) => f64::NAN,
        };
        (0..len)
            .map(|i| {
                let step = (at + i as f64 * self.steps_per_sample).max(from as f64);
                let low = (step + 1e-6).floor() as usize;
                let weight = step - low as f64;
                let here = value(low);
                if weight <= 1e-6 {
                    here
                } else if low + 1 < to {
                    here + (value(low + 1) - here) * weight
                } else {
                    here + (here - value(low.saturating_sub(1))) * weight
                }
            })
            .collect()
    }
}

/// A series seen late and through a low-pass. Before its window it is taken to have gone on as it begins.
pub(crate) fn late(y: &mut [f64], delay_s: f64, low_pass_s: f64, dt_s: f64) {
    if delay_s > 0.0 && y.len() > 1 {
        let before = y.to_vec();
        let slope = y[1] - y[0];
        for (k, v) in y.iter_mut().enumerate() {
            let at = k as f64 - delay_s / dt_s;
            let low = at.floor();
            let weight = at - low;
            let value = |i: f64| if i < 0.0 { before[0] + slope * i } else { before[i as usize] };
            *v = (1.0 - weight) * value(low) + weight * value((low + 1.0).min(k as f64));
        }
    }
    if low_pass_s > 0.0 && y.len() > 1 {
        let left = (-dt_s / low_pass_s).exp();
        // Of an input that goes straight from sample to sample, from a filter that follows its slope.
        let share = low_pass_s / dt_s * (1.0 - left);
        let mut now = y[0] - (y[1] - y[0]) / dt_s * low_pass_s;
        let mut last = y[0];
        let (first, rest) = y.split_at_mut(1);
        first[0] = now;
        for v in rest {
            let (input, slope) = (*v, *v - last);
            now = input + (now - last) * left - slope * share;
            last = input;
            *v = now;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_late_and_filtered_ramp_trails_by_delay_and_time_constant() {
        let ramp: Vec<f64> = (0..50).map(|k| 0.2 * f64::from(k)).collect();
        for (delay_s, low_pass_s) in [(0.033, 0.0), (0.0, 0.05), (0.02, 0.03)] {
            let mut y = ramp.clone();
            late(&mut y, delay_s, low_pass_s, 0.01);
            for (a, b) in y.iter().zip(&ramp) {
                approx::assert_abs_diff_eq!(*a, b - 20.0 * (delay_s + low_pass_s), epsilon = 1e-9);
            }
        }
    }
}
