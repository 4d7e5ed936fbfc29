//! "Your simulator in ten minutes", as its page says, and what is said of a file that is wrong.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

fn gripsight(folder: &Path, arguments: &str) -> (i32, String, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_gripsight"))
        .current_dir(folder)
        .args(arguments.split_whitespace())
        .env_remove("RUST_LOG")
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// The code of a page, block by block.
fn blocks(page: &str) -> Vec<String> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../lib/simulator/pages").join(page);
    let text = fs::read_to_string(path).unwrap();
    let parts = text.split("```").skip(1).step_by(2);
    parts.map(|b| b.split_once('\n').unwrap().1.to_owned()).collect()
}

/// The commands in a line of text, each alternative of `a|b` by itself.
fn commands(page: &Path) -> Vec<String> {
    let text = fs::read_to_string(page).unwrap();
    let outside = text.split("```").step_by(2);
    let inline = outside.flat_map(|t| t.split('`').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>());
    let of = inline.filter_map(|c| {
        Some(c.strip_prefix("gripsight ")?.split_whitespace().map(str::to_owned).collect::<Vec<_>>())
    });
    of.flat_map(|words| {
        let ways: Vec<String> = words
            .iter()
            .find(|w| w.contains('|'))
            .map_or_else(|| vec![String::new()], |w| w.split('|').map(str::to_owned).collect());
        let line = |way: &String| {
            let chosen = words.iter().map(|w| if w.contains('|') { way } else { w });
            chosen.cloned().collect::<Vec<_>>().join(" ")
        };
        ways.iter().map(line).collect::<Vec<_>>()
    })
    .collect()
}

fn python() -> String {
    let venv = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../.venv/bin/python");
    if venv.exists() { venv.display().to_string() } else { "python3".to_owned() }
}

#[test]
fn a_simulator_of_ones_own_is_diagnosed_as_the_page_says() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let page = blocks("own.md");
    fs::write(folder.join("my_car.py"), &page[0]).unwrap();
    fs::write(folder.join("my_car.yaml"), "# weighed in May\nstiffness: 70.0   # guessed\n").unwrap();
    fs::write(folder.join("simulator.yaml"), page[1].replace("[python3,", &format!("['{}',", python())))
        .unwrap();
    let (code, _, error) =
        gripsight(folder, "simulate --duration 20 --seed 5 --effect steering_delay=0.06 --out run.mcap");
    assert_eq!(code, 0, "{error}");
    // Of an earlier run, which must not be taken for this one's.
    fs::create_dir(folder.join("result")).unwrap();
    fs::write(folder.join("result/simulator.patch"), "old").unwrap();
    let (code, said, error) = gripsight(folder, "diagnose run.mcap --simulator simulator.yaml --out result");
    assert_eq!(code, 0, "{error}");
    let gap: Value =
        serde_json::from_str(&fs::read_to_string(folder.join("result/gap.json")).unwrap()).unwrap();
    assert!(gap["tires"].is_null() && said.starts_with("verdict"), "{said}");
    let (nominal, after) = (&gap["gap"]["nominal"]["value"], &gap["gap"]["after"]["value"]);
    assert!(after.as_f64().unwrap() < 0.5 * nominal.as_f64().unwrap(), "{said}");
    assert!(gap["simulator"]["rollouts"].as_f64().unwrap() <= 300.0, "{said}");
    assert!(fs::read_to_string(folder.join("result/report.html")).unwrap().contains("Car and simulator"));
    // Where the parameter is named, the patch applies, changes its value alone, and was verified.
    if let Ok(patch) = fs::read_to_string(folder.join("result/simulator.patch")) {
        assert!(
            patch.contains("-stiffness: 70.0   # guessed") && patch.contains("   # guessed\n"),
            "{patch}"
        );
        assert!(gap["patch"]["verified"].as_f64().unwrap() < nominal.as_f64().unwrap());
        assert!(said.contains("patch -p1 <"), "{said}");
    } else {
        assert!(!said.contains("patch -p1 <"), "{said}");
    }
}

#[test]
fn the_commands_of_every_page_are_understood() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../lib/simulator/pages");
    let mut seen = 0;
    for entry in fs::read_dir(folder).unwrap() {
        for command in commands(&entry.unwrap().path()) {
            let (code, _, error) = gripsight(&std::env::temp_dir(), &format!("{command} --help"));
            assert_eq!(code, 0, "{command}: {error}");
            seen += 1;
        }
    }
    assert!(seen >= 10, "{seen}");
}

#[test]
fn what_is_wrong_with_a_simulator_is_said_with_the_way_on() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    assert_eq!(gripsight(folder, "simulate --duration 2 --seed 5 --out run.mcap").0, 0);
    fs::write(folder.join("nothing.yaml"), "processes: 2\n").unwrap();
    fs::write(folder.join("dies.yaml"), "command: [sh, -c, 'echo no licence; exit 3']\n").unwrap();
    for (arguments, code, why) in [
        ("diagnose run.mcap --simulator none.yaml --out out", 1, "none.yaml"),
        ("diagnose run.mcap --simulator nothing.yaml --out out", 1, "either `adapter` or `command`"),
        ("diagnose run.mcap --simulator dies.yaml --out out", 1, "no licence"),
        ("diagnose run.mcap --simulator dies.yaml --pacejka a --out out", 2, "cannot be used with"),
    ] {
        let (got, _, error) = gripsight(folder, arguments);
        assert!(got == code && error.contains(why), "{arguments}: {got} {error}");
    }
}
