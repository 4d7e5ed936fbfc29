//! Cutting a recording into windows, blocks of windows, and folds of blocks.

use gripsight_model::{Recording, WINDOW_S, Window};

/// Length of the rollouts that are scored on held-out data.
pub const HORIZON_S: f64 = 1.0;
/// Length of a block: what is held out goes in blocks, and intervals resample blocks.
const BLOCK_S: f64 = 4.0;
/// Every so many blocks one is held out.
const HELD_OUT_EVERY: usize = 4;
/// Time at the start of a stretch that only feeds the filters.
const SKIP_S: f64 = 0.3;

/// Windows of one kind.
#[derive(Debug, Clone, Default)]
pub struct Windows {
    /// One after the other.
    pub windows: Vec<Window>,
    /// The block of each window.
    pub block: Vec<usize>,
}

impl Windows {
    /// At most about so many windows, in whole blocks spread over the recording.
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        let every = self.windows.len().div_ceil(most.max(1)).max(1);
        let mut numbers = self.block.clone();
        numbers.dedup();
        let kept = |block: &usize| numbers.iter().position(|b| b == block).is_some_and(|i| i % every == 0);
        let (windows, block) =
            self.windows.iter().zip(&self.block).filter(|(_, b)| kept(b)).map(|(w, b)| (*w, *b)).unzip();
        Self { windows, block }
    }

    /// Some of them, by place.
    #[must_use]
    pub fn picked(&self, places: &[usize]) -> Self {
        let windows = places.iter().map(|&k| self.windows[k]).collect();
        Self { windows, block: places.iter().map(|&k| self.block[k]).collect() }
    }

    /// Those of some blocks.
    #[must_use]
    pub fn of_blocks(&self, wanted: impl Fn(usize) -> bool) -> Self {
        let kept = self.windows.iter().zip(&self.block).filter(|(_, b)| wanted(**b));
        let (windows, block) = kept.map(|(w, b)| (*w, *b)).unzip();
        Self { windows, block }
    }

    /// Time covered.
    #[must_use]
    pub fn duration_s(&self, dt_s: f64) -> f64 {
        self.windows.iter().map(|w| w.len).sum::<usize>() as f64 * dt_s
    }
}

/// Windows to fit and windows to score.
#[derive(Debug, Clone, Default)]
pub struct Split {
    /// What is fitted.
    pub training: Windows,
    /// What is scored.
    pub held_out: Windows,
}

/// Cuts a recording. With `hold_out`, every fourth block is kept for scoring; without, everything is in `training`.
#[must_use]
pub fn split(recording: &Recording, hold_out: bool) -> Split {
    let mut split = Split::default();
    let dt_s = recording.dt_s();
    let samples = |t_s: f64| (t_s / dt_s).round().max(4.0) as usize;
    let (short, long, block) = (samples(WINDOW_S), samples(HORIZON_S), samples(BLOCK_S));
    let mut number = 0;
    for (segment, run) in recording.runs.iter().enumerate() {
        let mut from = samples(SKIP_S).min(run.len());
        while from + short <= run.len() {
            let to = (from + block).min(run.len());
            let held = hold_out && number % HELD_OUT_EVERY == HELD_OUT_EVERY - 2;
            let (target, len) = if held { (&mut split.held_out, long) } else { (&mut split.training, short) };
            let mut at = from;
            while at + len <= to {
                let slow = run.v_x_mps[at..at + len].iter().any(|v| *v < recording.least_speed_mps);
                if !slow {
                    target.windows.push(Window { segment, from: at, len });
                    target.block.push(number);
                }
                at += len;
            }
            number += 1;
            from = to;
        }
    }
    split
}

/// Windows of another length over the same stretches of time, for errors against the horizon.
#[must_use]
pub fn of_length(recording: &Recording, like: &Windows, length_s: f64) -> Windows {
    let len = (length_s / recording.dt_s()).round().max(2.0) as usize;
    let mut out = Windows::default();
    let mut k = 0;
    while k < like.windows.len() {
        // A stretch of windows that follow each other within one block.
        let first = like.windows[k];
        let mut end = first.from + first.len;
        let mut next = k + 1;
        while next < like.windows.len()
            && like.block[next] == like.block[k]
            && like.windows[next].segment == first.segment
            && like.windows[next].from == end
        {
            end += like.windows[next].len;
            next += 1;
        }
        let mut at = first.from;
        while at + len <= end {
            out.windows.push(Window { segment: first.segment, from: at, len });
            out.block.push(like.block[k]);
            at += len;
        }
        k = next;
    }
    out
}
