//! Tables that grow run by run, and what is said of their columns.

use std::fs::{File, OpenOptions};
use std::io::Write as _;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result};
use rayon::prelude::*;
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A CSV file of rows: what it holds already counts as driven, and each run is added when it ends.
pub(crate) struct Store<R> {
    file: File,
    pub(crate) rows: Vec<R>,
    empty: bool,
}

impl<R: Serialize + DeserializeOwned + Send> Store<R> {
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let context = || format!("file {}", path.display());
        let rows = if path.exists() {
            csv::Reader::from_path(path)?
                .deserialize()
                .collect::<Result<Vec<R>, _>>()
                .with_context(context)?
        } else {
            Vec::new()
        };
        let file = OpenOptions::new().create(true).append(true).open(path).with_context(context)?;
        Ok(Self { empty: file.metadata()?.len() == 0, file, rows })
    }

    /// Drives each of `work` and adds its rows, on all threads or, `alone`, one after the other.
    pub(crate) fn fill<W: Send>(
        self,
        work: Vec<W>,
        alone: bool,
        run: impl Fn(W) -> Result<Vec<R>> + Sync,
    ) -> Result<Vec<R>> {
        let (count, done, store) = (work.len(), AtomicUsize::new(0), Mutex::new(self));
        let one = |item: W| -> Result<()> {
            let rows = run(item)?;
            store.lock().unwrap_or_else(PoisonError::into_inner).add(rows)?;
            let number = done.fetch_add(1, Ordering::Relaxed) + 1;
            if number.is_multiple_of(10) || number == count {
                eprintln!("{number} of {count} runs");
            }
            Ok(())
        };
        if alone {
            work.into_iter().try_for_each(one)?;
        } else {
            work.into_par_iter().try_for_each(one)?;
        }
        Ok(store.into_inner().unwrap_or_else(PoisonError::into_inner).rows)
    }

    fn add(&mut self, rows: Vec<R>) -> Result<()> {
        let mut writer = csv::WriterBuilder::new().has_headers(self.empty).from_writer(Vec::new());
        for row in &rows {
            writer.serialize(row)?;
        }
        // One write a run: what ends in the middle leaves no half of one.
        self.file.write_all(&writer.into_inner()?)?;
        self.empty = false;
        self.rows.extend(rows);
        Ok(())
    }
}

/// Rounded to so many parts of one.
pub(crate) fn parts(value: f64, of_one: f64) -> f64 {
    (value * of_one).round() / of_one
}

pub(crate) fn median(values: Vec<f64>) -> f64 {
    quantile(values, 0.5)
}

/// Quantile of what is finite.
pub(crate) fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.retain(|v| v.is_finite());
    values.sort_by(f64::total_cmp);
    let Some(last) = values.len().checked_sub(1) else { return f64::NAN };
    let place = share * last as f64;
    0.5 * (values[place.floor() as usize] + values[place.ceil() as usize])
}

pub(crate) fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(s, n), v| (s + v, n + 1.0));
    if count > 0.0 { sum / count } else { f64::NAN }
}
