//! Beside a real ROS 2: its own tools look at a node and start the suite. These run where a ROS 2 is sourced, and say so where not.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use gripsight_msgs::type_hash;
use gripsight_tests::domain::Domain;

use super::runtime::source;

/// True where `ros2` can be called. Says so when a test is skipped.
fn is_sourced() -> bool {
    let works = Command::new("ros2").arg("--help").output().is_ok_and(|output| output.status.success());
    if !works {
        eprintln!("SKIPPED, no ROS 2 is sourced: there is no `ros2`");
    }
    works
}

/// What `ros2` with these words says, of what the domain holds now and no daemon remembers.
fn ros2(domain: &Domain, words: &[&str]) -> Output {
    Command::new("ros2").args(words).envs(domain.environment()).output().unwrap()
}

fn in_tree(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

#[test]
fn its_tools_know_types_and_parameters_of_a_node_and_warn_of_nothing() {
    if !is_sourced() {
        return;
    }
    let domain = Domain::new();
    let _node = source(&domain, &["-p", "samples:=20"]);
    let says = |words: &[&str]| {
        let output = ros2(&domain, &[words, &["--no-daemon", "--spin-time", "5"]].concat());
        let text = |bytes| String::from_utf8(bytes).unwrap();
        let (said, errors) = (text(output.stdout), text(output.stderr));
        assert!(output.status.success() && !errors.contains("WARN"), "{words:?}: {said}{errors}");
        said
    };
    let topics = says(&["topic", "list", "-t"]);
    assert!(topics.contains("/result_source/pacejka [gripsight_msgs/msg/PacejkaParams]"), "{topics}");
    let topic = says(&["topic", "info", "-v", "/result_source/pacejka"]);
    let hash = type_hash("gripsight_msgs/msg/PacejkaParams").unwrap();
    assert!(topic.contains(&format!("Topic type hash: {hash}")), "{topic}");
    let node = says(&["node", "info", "/result_source"]);
    assert!(node.contains("/result_source/get_parameters: rcl_interfaces/srv/GetParameters"), "{node}");

    assert_eq!(says(&["param", "get", "/result_source", "samples"]), "Integer value is: 20\n");
    assert_eq!(says(&["param", "set", "/result_source", "samples", "30"]), "Set parameter successful\n");
    let dumped = says(&["param", "dump", "/result_source"]);
    assert!(dumped.contains("samples: 30"), "{dumped}");
    let file = std::env::temp_dir().join(format!("gripsight_dump_{}.yaml", std::process::id()));
    std::fs::write(&file, dumped).unwrap();
    let loaded = says(&["param", "load", "/result_source", file.to_str().unwrap()]);
    assert!(loaded.contains("Set parameter samples successful") && !loaded.contains("failed"), "{loaded}");
    std::fs::remove_file(&file).unwrap();
}

#[test]
fn launch_refuses_what_is_not_there_before_anything_runs() {
    if !is_sourced() {
        return;
    }
    let domain = Domain::new();
    let launch = in_tree("launch_scripts/gripsight.launch.py");
    let vehicle = format!("vehicle:={}", in_tree("params/vehicles/f1tenth.yaml").display());
    for (arguments, reason) in [
        (vec!["vehicle:=/nowhere/car.yaml"], "vehicle:=/nowhere/car.yaml: no such file"),
        (vec![&vehicle, "stack:=none"], "no stack 'none'"),
        (vec![&vehicle, "bag:=/nowhere"], "bag:=/nowhere: no such bag"),
        (vec![&vehicle, "gap:=yes"], "Valid options are: ['true', 'false'"),
    ] {
        let output = ros2(&domain, &[&["launch", launch.to_str().unwrap()], &arguments[..]].concat());
        let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert!(!output.status.success() && said.contains(reason), "{said}");
        assert!(!said.contains("process started"), "{said}");
    }
}
