//! What the pages "your simulator in ten minutes" tell to write can be read.

use std::fs;
use std::path::PathBuf;

use gripsight_simulator::SimulatorFile;

#[test]
fn the_files_of_every_page_are_read() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("pages");
    let home = tempfile::tempdir().unwrap();
    let mut seen = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let page = fs::read_to_string(&path).unwrap();
        for block in page.split("```").skip(1).step_by(2) {
            let Some(text) = block.strip_prefix("yaml\n") else { continue };
            if ["adapter:", "command:"].iter().any(|key| text.contains(key)) {
                let named = text.lines().find_map(|l| l.trim().strip_prefix("parameter_file:"));
                if let Some(name) = named.and_then(|n| n.split_whitespace().next()) {
                    fs::write(home.path().join(name), "").unwrap();
                }
                let file = SimulatorFile::parse(text, home.path());
                assert!(file.is_ok(), "{}: {:?}", path.display(), file.err());
                seen += 1;
            }
        }
    }
    assert!(seen >= 8, "{seen}");
}
