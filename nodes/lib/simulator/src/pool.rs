//! Several processes of one simulator, side by side.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use ndarray::{Array3, Axis, concatenate};

use crate::child::Child;
use crate::wire::Batch;
use crate::{Description, SimulatorError, SimulatorFile, adapters};

/// Something that can be rolled out: a user's simulator, or one of the tests' own.
pub trait Roll: Sync {
    /// What it is.
    fn description(&self) -> &Description;

    /// Outputs (B, M, C) of a batch. Values that are not finite are the caller's to judge: a trial of absurd parameters may well give them.
    ///
    /// # Errors
    /// [`SimulatorError`].
    fn rollout(&self, batch: &Batch) -> Result<Array3<f64>, SimulatorError>;

    /// Passes so far.
    fn passes(&self) -> usize;

    /// Time spent in it so far.
    fn busy(&self) -> Duration;
}

/// A user's simulator, running.
#[derive(Debug)]
pub struct Simulator {
    description: Description,
    children: Vec<Mutex<Child>>,
    passes: AtomicUsize,
    busy: Mutex<Duration>,
    // Holds sockets and adapters; last, so that it goes after the processes.
    _scratch: tempfile::TempDir,
}

impl Simulator {
    /// Starts its processes, with its parameter file as the user has it.
    ///
    /// # Errors
    /// [`SimulatorError`].
    pub fn start(file: &SimulatorFile) -> Result<Self, SimulatorError> {
        Self::start_with(file, file.parameter_path().as_deref())
    }

    /// Starts its processes with another parameter file.
    ///
    /// # Errors
    /// [`SimulatorError`].
    pub fn start_with(file: &SimulatorFile, parameter_file: Option<&Path>) -> Result<Self, SimulatorError> {
        let scratch = tempfile::Builder::new()
            .prefix("gripsight")
            .tempdir()
            .map_err(SimulatorError::io(&std::env::temp_dir()))?;
        adapters::lay_out(scratch.path())?;
        let arguments = file.arguments(parameter_file, scratch.path());
        let limit = Duration::from_secs_f64(file.time_limit_s.min(1e6));
        let folder = file.working_folder();
        let mut children = Vec::with_capacity(file.processes);
        for number in 0..file.processes {
            children.push(Child::start(&arguments, &folder, scratch.path(), number, limit)?);
        }
        let mut description = children[0].describe()?;
        for p in &mut description.parameters {
            if let Some(bounds) = file.bounds.get(&p.name) {
                (p.low, p.high) = (bounds.low, bounds.high);
            }
        }
        let unknown = file
            .bounds
            .keys()
            .chain(&file.fixed)
            .find(|name| !description.parameters.iter().any(|p| p.name == **name));
        if let Some(name) = unknown {
            let known: Vec<&str> = description.parameters.iter().map(|p| p.name.as_str()).collect();
            return Err(SimulatorError::Description(format!(
                "the simulator's file speaks of a parameter {name}; it has {}",
                known.join(", ")
            )));
        }
        description.check()?;
        Ok(Self {
            description,
            children: children.into_iter().map(Mutex::new).collect(),
            passes: AtomicUsize::new(0),
            busy: Mutex::default(),
            _scratch: scratch,
        })
    }
}

impl Roll for Simulator {
    fn description(&self) -> &Description {
        &self.description
    }

    fn passes(&self) -> usize {
        self.passes.load(Ordering::Relaxed)
    }

    fn busy(&self) -> Duration {
        *self.busy.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn rollout(&self, batch: &Batch) -> Result<Array3<f64>, SimulatorError> {
        let start = Instant::now();
        let passes = batch.passes();
        self.passes.fetch_add(passes, Ordering::Relaxed);
        let channels = self.description.outputs.len();
        let each = passes.div_ceil(self.children.len()).max(1);
        let parts: Vec<Result<Array3<f64>, SimulatorError>> = std::thread::scope(|scope| {
            let started: Vec<_> = self
                .children
                .iter()
                .enumerate()
                .take(passes.div_ceil(each))
                .map(|(place, child)| {
                    let part = batch.rows(place * each, ((place + 1) * each).min(passes));
                    scope.spawn(move || {
                        child.lock().unwrap_or_else(PoisonError::into_inner).rollout(&part, channels)
                    })
                })
                .collect();
            // A thread of ours that panics is passed on as the panic that it is.
            started.into_iter().map(|t| t.join().unwrap_or_else(|e| std::panic::resume_unwind(e))).collect()
        });
        *self.busy.lock().unwrap_or_else(PoisonError::into_inner) += start.elapsed();
        let parts = parts.into_iter().collect::<Result<Vec<_>, _>>()?;
        let views: Vec<_> = parts.iter().map(|part| part.view()).collect();
        concatenate(Axis(0), &views)
            .map_err(|e| SimulatorError::Answer { when: "in a rollout", why: e.to_string() })
    }
}
