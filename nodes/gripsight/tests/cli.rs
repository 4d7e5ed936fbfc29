//! The contract that scripts depend on: help, exit codes, files, errors.

// Helpers outside of #[test] functions panic like tests do.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use serde_json::Value;

fn gripsight(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_gripsight"))
        .args(arguments)
        .env("COLUMNS", "100")
        .env_remove("RUST_LOG")
        .output()
        .unwrap()
}

fn code(output: &Output) -> i32 {
    output.status.code().unwrap()
}

fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// The error alone: what stands between `error: ` and the end, without the log.
fn error_of(arguments: &[&str]) -> String {
    let output = gripsight(arguments);
    let text = stderr(&output);
    assert_eq!(code(&output), 1, "{text}");
    assert!(output.stdout.is_empty());
    assert!(!text.contains("panicked"), "{text}");
    text[text.find("error: ").unwrap()..].to_owned()
}

/// A folder with a short simulated drive.
struct Drive {
    folder: tempfile::TempDir,
}

impl Drive {
    fn shared() -> &'static Self {
        static DRIVE: OnceLock<Drive> = OnceLock::new();
        DRIVE.get_or_init(|| {
            let folder = tempfile::tempdir().unwrap();
            let bag = folder.path().join("laps.mcap");
            let output = gripsight(&["simulate", "--duration", "12", "--out", bag.to_str().unwrap()]);
            assert_eq!(code(&output), 0, "{}", stderr(&output));
            Self { folder }
        })
    }

    fn file(&self, name: &str) -> String {
        self.folder.path().join(name).to_str().unwrap().to_owned()
    }

    /// Identifies from the drive into a folder of the given name.
    fn identify(&self, out: &str, more: &[&str]) -> (Output, PathBuf) {
        let folder = self.folder.path().join(out);
        let (bag, vehicle) = (self.file("laps.mcap"), self.file("laps.vehicle.yaml"));
        let mut arguments = vec!["identify", &bag, "--vehicle", &vehicle, "--out", folder.to_str().unwrap()];
        arguments.extend(more);
        (gripsight(&arguments), folder)
    }
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn help_says_what_each_command_does() {
    for command in ["identify", "friction"] {
        let output = gripsight(&[command, "--help"]);
        assert_eq!(code(&output), 0);
        insta::assert_snapshot!(format!("help_{command}"), String::from_utf8(output.stdout).unwrap());
    }
    assert_eq!(code(&gripsight(&["--version"])), 0);
}

#[test]
fn wrong_usage_exits_with_2() {
    for arguments in [
        &[] as &[&str],
        &["identify"],
        &["identify", "a.mcap"],
        &["identify", "a.mcap", "--out", "x", "--prior-mu", "-1"],
        &["identify", "a.mcap", "--out", "x", "--prior-mu", "nan"],
        &["identify", "a.mcap", "--out", "x", "--prior-mu", "1", "--camera"],
        &["identify", "a.mcap", "--out", "x", "--method", "magic"],
        &["identify", "a.mcap", "--out", "x", "--seed", "-1"],
        &["friction"],
        &["frobnicate"],
    ] {
        let output = gripsight(arguments);
        assert_eq!(code(&output), 2, "{arguments:?}: {}", stderr(&output));
    }
}

#[test]
fn every_file_is_written_and_the_exit_code_says_whether_to_use_them() {
    for (out, more) in [("plain", &["--residual", "none"] as &[&str]), ("prior", &["--prior-mu", "0.9"])] {
        let (output, folder) = Drive::shared().identify(out, more);
        let result = json(&folder.join("identification.json"));
        let accepted = result["accepted"].as_bool().unwrap();
        assert_eq!(accepted, ["accepted", "accepted_within"].contains(&result["status"].as_str().unwrap()));
        for limit in ["slip_rad", "force_n"] {
            assert_eq!(result["valid_within"][limit]["front"].is_f64(), accepted, "{limit}");
        }
        assert_eq!(code(&output), if accepted { 0 } else { 3 }, "{}", stderr(&output));
        let tire_files = if accepted {
            ["pacejka.yaml", "f1tenth_pacejka.txt", "f1tenth_lookup_table.csv"]
        } else {
            ["pacejka.rejected.yaml", "f1tenth_pacejka.rejected.txt", "f1tenth_lookup_table.rejected.csv"]
        };
        let mut expected = vec!["identification.json", "posterior.json", "report.html", "timing.json"];
        expected.extend(tire_files);
        // A prior with a say adds a set of its own.
        let provisional = [
            "pacejka.provisional.yaml",
            "f1tenth_pacejka.provisional.txt",
            "f1tenth_lookup_table.provisional.csv",
        ];
        expected.extend(provisional.iter().filter(|_| result["provisional"].is_object()));
        expected.sort_unstable();
        let mut found: Vec<_> =
            fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        found.sort_unstable();
        assert_eq!(found, expected);
        for axle in ["front", "rear"] {
            for letter in ["b", "c", "d", "e"] {
                assert!(result["phi_p"][axle][letter].is_f64(), "{axle} {letter}");
            }
            for end in ["value", "low", "high"] {
                assert!(result["cornering_stiffness_n_per_rad"][axle].get(end).is_some());
                assert!(result["peak_friction"][axle].get(end).is_some());
            }
            assert!(result["peak_friction"][axle]["reached"].is_boolean());
            assert!(result["peak_friction"][axle]["from_prior"].is_boolean());
            assert!(result["slip_range_rad"][axle]["high"].is_f64());
        }
        for name in ["steering_delay_s", "v_y_lever_arm_m", "steering_gain", "v_y_bias_mps"] {
            assert!(result["signals"][name].is_f64(), "{name}");
        }
        for (kind, when) in
            [("one_step", "before"), ("one_step", "after"), ("rollout", "before"), ("rollout", "after")]
        {
            assert!(result["rmse"][kind][when].is_f64(), "{kind} {when}");
        }
        assert!(
            result["iterations"].is_u64() && result["converged"].is_boolean() && result["reasons"].is_array()
        );
        let timing = json(&folder.join("timing.json"));
        let parts: f64 = timing.as_object().unwrap().values().map(|v| v.as_f64().unwrap()).sum();
        let total = timing["total_s"].as_f64().unwrap();
        assert!(parts - total <= total && parts - total > 0.9 * total, "{timing}");
        let stdout = String::from_utf8(output.stdout).unwrap();
        assert!(stdout.starts_with(if accepted { "f1tenth: accepted" } else { "f1tenth: not accepted" }));
        assert!(stdout.lines().count() < 50);
        assert!(stdout.contains("\ndata  ") && stdout.contains("nothing recorded checks: "), "{stdout}");
    }
}

#[test]
fn a_reader_that_closes_the_pipe_ends_nothing() {
    let drive = Drive::shared();
    let out = drive.folder.path().join("piped.mcap");
    let mut child = Command::new(env!("CARGO_BIN_EXE_gripsight"))
        .args(["simulate", "--duration", "10", "--out", out.to_str().unwrap()])
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(out.is_file());
}

#[test]
fn a_set_holds_on_its_own_drive_and_a_set_that_promises_more_does_not() {
    let drive = Drive::shared();
    let (output, folder) = drive.identify("to_verify", &["--residual", "none"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let (bag, vehicle) = (drive.file("laps.mcap"), drive.file("laps.vehicle.yaml"));
    let verify = |set: &Path| gripsight(&["verify", set.to_str().unwrap(), &bag, "--vehicle", &vehicle]);
    for name in ["pacejka.yaml", "f1tenth_pacejka.txt", "identification.json"] {
        let output = verify(&folder.join(name));
        let stdout = String::from_utf8(output.stdout.clone()).unwrap();
        assert_eq!(code(&output), 0, "{name}: {stdout} {}", stderr(&output));
        assert!(
            stdout.contains("may be used") && stdout.contains("force error over these slips"),
            "{stdout}"
        );
    }
    let text = fs::read_to_string(folder.join("pacejka.yaml")).unwrap();
    let grippy = PathBuf::from(drive.file("grippy.yaml"));
    fs::write(&grippy, text.replace("friction_coeff: 1.0", "friction_coeff: 1.5")).unwrap();
    let output = verify(&grippy);
    let stdout = String::from_utf8(output.stdout.clone()).unwrap();
    assert_eq!(code(&output), 3, "{stdout}");
    assert!(stdout.contains("must not be used") && stdout.contains("too much"), "{stdout}");
    assert_eq!(code(&verify(Path::new("/nowhere.yaml"))), 1);
}

#[test]
fn bags_of_one_car_are_identified_together() {
    let drive = Drive::shared();
    let bag = drive.file("laps.mcap");
    let (output, folder) = drive.identify("together", &["--residual", "none", &bag]);
    let result = json(&folder.join("identification.json"));
    assert_eq!(code(&output), 0, "{} {}", stderr(&output), result["reasons"]);
    // The same drive twice: nothing disagrees, and intervals are no wider.
    assert!(!result["reasons"].to_string().contains("disagrees"), "{}", result["reasons"]);
    let (_, alone) = drive.identify("one_of_them", &["--residual", "none"]);
    let width = |folder: &Path| {
        let k = &json(&folder.join("identification.json"))["cornering_stiffness_n_per_rad"]["rear"];
        k["high"].as_f64().unwrap() - k["low"].as_f64().unwrap()
    };
    assert!(width(&folder) < width(&alone));
    assert!(stderr(&drive.identify("no", &["--window", "5", &bag]).0).contains("are for one bag"));
}

#[test]
fn the_same_bag_gives_the_same_bytes() {
    let (_, first) = Drive::shared().identify("once", &["--seed", "3"]);
    let (_, second) = Drive::shared().identify("again", &["--seed", "3"]);
    let mut compared = 0;
    for entry in fs::read_dir(&first).unwrap() {
        let name = entry.unwrap().file_name();
        if name != "timing.json" {
            assert!(
                fs::read(first.join(&name)).unwrap() == fs::read(second.join(&name)).unwrap(),
                "{name:?}"
            );
            compared += 1;
        }
    }
    assert_eq!(compared, 6);
}

#[test]
fn the_truth_is_drawn_where_it_is_given() {
    let truth = Drive::shared().file("laps.truth.csv");
    let (_, folder) = Drive::shared().identify("truth", &["--residual", "none", "--truth", &truth]);
    assert!(fs::read_to_string(folder.join("report.html")).unwrap().contains("truth</span>"));
    let wrong = Drive::shared().file("laps.vehicle.yaml");
    let (output, _) = Drive::shared().identify("wrong_truth", &["--residual", "none", "--truth", &wrong]);
    assert!(stderr(&output).contains("cannot use the truth"));
}

#[test]
fn a_run_starts_from_an_accepted_one_of_the_same_car_only() {
    let (output, first) = Drive::shared().identify("earlier", &["--prior-mu", "0.9"]);
    let file = first.join("identification.json");
    let more = ["--residual", "none", "--previous", file.to_str().unwrap()];
    let (later, _) = Drive::shared().identify("later", &more);
    match code(&output) {
        0 => assert!([0, 3].contains(&code(&later)), "{}", stderr(&later)),
        _ => assert!(stderr(&later).contains("not accepted"), "{}", stderr(&later)),
    }
    let text = fs::read_to_string(&file).unwrap().replace("\"vehicle_hash\": \"", "\"vehicle_hash\": \"f00");
    let other = Drive::shared().file("other_car.json");
    fs::write(&other, text).unwrap();
    let (refused, _) = Drive::shared().identify("refused", &["--previous", &other]);
    assert_eq!(code(&refused), 1, "{}", stderr(&refused));
}

#[test]
fn hostile_inputs_are_named_in_one_line_each() {
    let drive = Drive::shared();
    let folder = drive.folder.path();
    let (bag, out) = (drive.file("laps.mcap"), drive.file("hostile"));
    let write = |name: &str, bytes: &[u8]| {
        fs::write(folder.join(name), bytes).unwrap();
        drive.file(name)
    };
    let empty = folder.join("empty_folder");
    fs::create_dir_all(&empty).unwrap();
    let identify = |bag: &str, more: &[&str]| {
        let mut arguments = vec!["identify", bag, "--out", &out];
        arguments.extend(more);
        error_of(&arguments)
    };
    let missing = identify("/nowhere/laps.mcap", &[]);
    assert!(missing.contains("/nowhere/laps.mcap"), "{missing}");
    let folder_error = identify(empty.to_str().unwrap(), &[]);
    assert!(folder_error.contains("empty_folder"), "{folder_error}");
    for (name, bytes) in
        [("text.mcap", b"hello, world" as &[u8]), ("nothing.mcap", b""), ("magic.mcap", b"\x89MCAP0\r\n")]
    {
        let error = identify(&write(name, bytes), &[]);
        assert!(error.contains(name), "{error}");
        assert!(error.lines().count() <= 3, "{error}");
    }
    let bad_yaml = write("bad.yaml", b"][");
    let error = identify(&bag, &["--vehicle", &bad_yaml]);
    assert!(error.contains("bad.yaml"), "{error}");
    let no_mass = write("no_mass.yaml", b"/**:\n  ros__parameters:\n    vehicle:\n      l_f_m: 0.1\n");
    assert!(identify(&bag, &["--vehicle", &no_mass]).contains("mass_kg"));
    assert!(identify(&bag, &["--vehicle", "/nowhere.yaml"]).contains("/nowhere.yaml"));
    let topics = write("topics.yaml", b"odom: /not/there\n");
    let error = identify(&bag, &["--topics", &topics]);
    assert!(error.contains("/not/there"), "{error}");
    assert!(identify(&bag, &["--previous", &bad_yaml]).contains("bad.yaml"));
    assert!(identify(&bag, &["--sequence", "12"]).contains("no state sequence 12"));
    // A prior that is not there ends nothing.
    let without_prior = gripsight(&["identify", &bag, "--out", &out, "--camera"]);
    assert_eq!(code(&without_prior), code(&gripsight(&["identify", &bag, "--out", &out])));
    assert!(stderr(&without_prior).contains("no friction prior"), "{}", stderr(&without_prior));
    let not_a_folder = write("file", b"");
    let error = error_of(&["identify", &bag, "--out", &format!("{not_a_folder}/x")]);
    assert!(error.contains("cannot make"), "{error}");
    assert!(error_of(&["friction", "/nowhere.png"]).contains("/nowhere.png"));
}
