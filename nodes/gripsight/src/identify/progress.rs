//! What the user sees meanwhile, and how long each part took.

use std::time::Instant;

use gripsight_identification::{Config, Stage};
use indicatif::{ProgressBar, ProgressStyle};
use serde::Serialize;

/// Where the time went, s.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub(super) struct Timing {
    /// From start to end.
    pub(super) total_s: f64,
    /// Reading the bag.
    pub(super) reading_s: f64,
    /// Reading its pictures.
    pub(super) camera_s: f64,
    /// Correcting the signals and the direct fit.
    pub(super) preparing_s: f64,
    /// Training the residual networks.
    pub(super) training_s: f64,
    /// The virtual steering sweeps.
    pub(super) sweep_s: f64,
    /// The fits to them and the final judgement.
    pub(super) fit_s: f64,
    /// Fitting the car's own tires, for a diagnosis to start from.
    pub(super) posterior_s: f64,
    /// Writing the files, lookup table and report included.
    pub(super) writing_s: f64,
}

impl Timing {
    /// Adds a run's stages.
    pub(super) fn add(&mut self, other: &Self) {
        self.preparing_s += other.preparing_s;
        self.training_s += other.training_s;
        self.sweep_s += other.sweep_s;
        self.fit_s += other.fit_s;
    }
}

/// A bar on a terminal, lines in a log otherwise.
pub(super) struct Progress {
    bar: ProgressBar,
}

impl Progress {
    pub(super) fn new() -> Self {
        // indicatif draws on standard error, and nothing where that is not a terminal.
        let bar = ProgressBar::no_length();
        if let Ok(style) = ProgressStyle::with_template("{spinner} {msg} [{bar:30}] {elapsed}") {
            bar.set_style(style);
        }
        Self { bar }
    }

    /// The stages of one run.
    pub(super) fn run(&self, config: &Config) -> Stages<'_> {
        self.bar.set_length(config.epochs_at_most() as u64);
        Stages { bar: &self.bar, since: Instant::now(), stage: Stage::Preparing, timing: Timing::default() }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}

/// One run's way through its stages.
pub(super) struct Stages<'a> {
    bar: &'a ProgressBar,
    since: Instant,
    stage: Stage,
    timing: Timing,
}

impl Stages<'_> {
    /// Called as each stage, and each epoch of training, begins.
    pub(super) fn enter(&mut self, stage: Stage) {
        self.close();
        let text = match stage {
            Stage::Preparing => "correcting the signals, fitting directly".to_owned(),
            Stage::Training { iteration, epoch, loss, .. } => {
                self.bar.set_position(epoch as u64);
                let loss = if loss.is_finite() { format!(", loss {loss:.3}") } else { String::new() };
                format!("turn {iteration}: learning the residual{loss}")
            }
            Stage::Sweeping { iteration } => format!("turn {iteration}: steering sweep"),
            Stage::Fitting { iteration } => format!("turn {iteration}: fitting the tires"),
        };
        let begins = !matches!(stage, Stage::Training { epoch, .. } if epoch > 0);
        if begins && self.bar.is_hidden() {
            tracing::info!("{text}");
        }
        self.bar.set_message(text);
        self.stage = stage;
    }

    /// The times of all stages.
    pub(super) fn finish(mut self) -> Timing {
        self.close();
        self.timing
    }

    /// Books the time since the last call on the stage that it went into.
    fn close(&mut self) {
        let spent_s = self.since.elapsed().as_secs_f64();
        self.since = Instant::now();
        *match self.stage {
            Stage::Preparing => &mut self.timing.preparing_s,
            Stage::Training { .. } => &mut self.timing.training_s,
            Stage::Sweeping { .. } => &mut self.timing.sweep_s,
            Stage::Fitting { .. } => &mut self.timing.fit_s,
        } += spent_s;
    }
}
