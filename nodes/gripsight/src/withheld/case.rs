//! A case as the diagnosis gets it.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use gripsight_bag::TopicMap;
use gripsight_diagnosis::{Diagnosis, Earlier, GapError, Request, diagnose};
use gripsight_signals::StateSequence;
use gripsight_vehicle::{PacejkaParameters, VehicleParameters};
use gripsight_withheld_make::{COMMITMENT, files};
use gripsight_withheld_score::{Said, baselines};
use serde::Serialize;

use crate::diagnose;

/// What lies in a case's folder.
pub(super) struct Case {
    sequence: StateSequence,
    held_out: Option<StateSequence>,
    earlier: Option<StateSequence>,
    vehicle: VehicleParameters,
    tires: Option<PacejkaParameters>,
    without: Vec<String>,
}

impl Case {
    /// Reads a case's folder.
    pub(super) fn read(folder: &Path) -> anyhow::Result<Self> {
        let bag = |name: &str| -> anyhow::Result<StateSequence> {
            Ok(diagnose::read(&folder.join(name), &TopicMap::default())?.0)
        };
        let there = |name: &str| folder.join(name).exists().then(|| bag(name)).transpose();
        let tires = folder.join(files::TIRES);
        let without = folder.join(files::WITHOUT);
        let without =
            fs::read_to_string(&without).with_context(|| format!("cannot read {}", without.display()))?;
        Ok(Self {
            sequence: bag(files::BAG)?,
            held_out: there(files::HELD_OUT)?,
            earlier: there(files::EARLIER)?,
            vehicle: diagnose::vehicle(Some(&folder.join(files::VEHICLE)))?,
            tires: tires.exists().then(|| diagnose::tires(&tires)).transpose()?,
            without: without.lines().map(str::to_owned).collect(),
        })
    }

    /// Diagnoses it; `only` names the effects to consider, the whole library where there is none.
    pub(super) fn diagnose(&self, only: &[String]) -> Result<Diagnosis, GapError> {
        let request = Request {
            tires: self.tires,
            without: if only.is_empty() { &self.without } else { &[] },
            only,
            ..Request::new(&self.sequence, &self.vehicle)
        };
        let Some(earlier) = &self.earlier else {
            return diagnose(&Request { held_out: self.held_out.as_ref(), ..request }, &mut |_| {});
        };
        let earlier = Earlier::diagnosed(&Request { sequence: earlier, ..request.clone() }, &mut |_| {})?;
        diagnose(&Request { tires: None, earlier: Some(&earlier), ..request }, &mut |_| {})
    }
}

impl Case {
    /// What simpler methods name first; nothing where no tires were handed over.
    pub(super) fn baselines(&self) -> anyhow::Result<BTreeMap<String, String>> {
        match &self.tires {
            Some(tires) => Ok(baselines(&self.sequence, &self.vehicle, tires)?),
            None => Ok(BTreeMap::new()),
        }
    }
}

/// The names of all cases of a folder.
pub(super) fn cases(folder: &Path) -> anyhow::Result<Vec<String>> {
    if !folder.join(COMMITMENT).exists() {
        bail!(
            "{} holds no {COMMITMENT}: no batch, or one whose making was stopped; call `withheld make` again",
            folder.display()
        );
    }
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.path().is_dir() && name.starts_with("case_") {
            names.push(name);
        }
    }
    names.sort();
    if names.is_empty() {
        bail!("{} holds no case", folder.display());
    }
    Ok(names)
}

/// gap.json of a diagnosis, or what stands for it where there is none.
pub(super) fn gap_json(result: &Result<Diagnosis, GapError>) -> anyhow::Result<String> {
    #[derive(Serialize)]
    struct Failed {
        verdict: &'static str,
        reasons: [String; 1],
    }
    Ok(match result {
        Ok(diagnosis) => serde_json::to_string(diagnosis)?,
        Err(error) => serde_json::to_string(&Failed { verdict: "failed", reasons: [error.to_string()] })?,
    })
}

/// What a gap.json says.
pub(super) fn said(path: &Path) -> anyhow::Result<Said> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{} is no gap.json", path.display()))
}

/// Writes a file that is whole or not there at all.
pub(super) fn write_whole(path: &Path, text: &str) -> anyhow::Result<()> {
    let part: PathBuf = path.with_extension("part");
    fs::write(&part, text).with_context(|| format!("cannot write {}", part.display()))?;
    fs::rename(&part, path).with_context(|| format!("cannot write {}", path.display()))
}
