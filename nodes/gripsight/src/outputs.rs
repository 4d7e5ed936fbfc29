//! Whether results can be written, asked before the work.

use std::fs;
use std::path::Path;

use anyhow::{Context, bail};
use gripsight_bag::refuse_overwriting;

/// Makes the folder of results, and refuses what would only fail after the work: a folder that nothing can be written to, a file in the place
/// of a folder or the other way round, and any file that is one of the bags read.
pub(crate) fn check(
    folder: &Path,
    names: &[&str],
    bag: Option<&Path>,
    inputs: &[&Path],
) -> anyhow::Result<()> {
    let files: Vec<_> = names.iter().map(|name| folder.join(name)).collect();
    for out in files.iter().map(AsRef::as_ref).chain(bag) {
        inputs.iter().try_for_each(|input| refuse_overwriting(input, out))?;
    }
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    for out in files.iter().map(AsRef::as_ref).chain(bag) {
        writable(out).with_context(|| format!("cannot write {}", out.display()))?;
    }
    Ok(())
}

fn writable(out: &Path) -> anyhow::Result<()> {
    if out.is_dir() {
        bail!("there is a folder of that name");
    }
    if out.exists() {
        fs::OpenOptions::new().append(true).open(out)?;
    }
    let folder = out.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    tempfile::tempfile_in(folder).with_context(|| format!("folder {}", folder.display()))?;
    Ok(())
}
