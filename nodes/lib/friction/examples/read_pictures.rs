//! Reads every picture below a folder on its own and prints one CSV row each: the raw data of the gates' table.
//!
//! `cargo run --release --example read_pictures -- FOLDER [LIBRARY [MODEL]] > readings.csv`. The family is the folder's name.

use std::error::Error;
use std::path::{Path, PathBuf};

use gripsight_friction::{
    Basis, Frame, FrameData, FrictionEstimator, OnnxRuntime, Settings, find_library, find_model,
};

fn pictures(folder: &Path, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            pictures(&path, found)?;
        } else {
            found.push(path);
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let folder = arguments.next().ok_or("usage: read_pictures FOLDER [LIBRARY [MODEL]]")?;
    let (library, model) = (arguments.next(), arguments.next());
    let program = std::env::current_exe()?;
    let beside = program.parent().ok_or("the program has no folder")?;
    let library = find_library(library.as_deref(), beside)?;
    let network = OnnxRuntime::load(&library, &find_model(model.as_deref(), beside)?)?;
    let mut estimator =
        FrictionEstimator::new(Settings::default(), Basis::builtin()?, Some(Box::new(network)));
    let mut found = vec![];
    pictures(&folder, &mut found)?;
    found.sort();
    println!(
        "family,file,reason,mu,sigma,entropy,energy,mean,dark,saturated,noise,structure,p_dry,p_wet,p_water,p_snow,p_ice,unfamiliarity"
    );
    for path in found {
        let bytes = std::fs::read(&path)?;
        let e = estimator.read_single(&Frame { stamp_ns: 0, data: FrameData::Compressed(&bytes) });
        let text = |part: Option<&std::ffi::OsStr>| {
            part.map(|p| p.to_string_lossy().into_owned()).unwrap_or_default()
        };
        let family = text(path.parent().and_then(Path::file_name));
        let q = e.quality.unwrap_or_default();
        let p: Vec<String> = e.probability.iter().map(|p| format!("{p:.4}")).collect();
        println!(
            "{family},{},{},{:.4},{:.4},{:.4},{:.3},{:.1},{:.3},{:.3},{:.2},{:.3},{},{}",
            text(path.file_name()),
            e.reason.map_or("", |r| r.as_str()),
            e.mu,
            e.sigma,
            e.entropy,
            e.energy,
            q.mean,
            q.dark,
            q.saturated,
            q.noise,
            q.structure,
            p.join(","),
            e.unfamiliarity.map(|d| format!("{d:.3}")).unwrap_or_default()
        );
    }
    Ok(())
}
