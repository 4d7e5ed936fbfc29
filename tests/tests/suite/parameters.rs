//! Parameters from files, over services and on `/parameter_events`, with peers of both makes.

use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, available, cyclone, fast_dds, message, start_cyclone};
use gripsight_tests::process::{Process, node};
use serde_json::{Value, json};

use super::runtime::source;

#[test]
fn parameters_come_from_files_and_answer_to_services() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let python = cyclone.unwrap();
    let domain = Domain::new();
    let file = std::env::temp_dir().join(format!("gripsight_parameters_{}.yaml", std::process::id()));
    std::fs::write(&file, "/**:\n  ros__parameters:\n    samples: 20\n    vehicle: {name: rc10}\n").unwrap();
    // The service mapping follows the peer, whatever the node is told of its RMW.
    let mut command = std::process::Command::new(gripsight_tests::process::program("result_source"));
    command.args(["--ros-args", "--params-file", file.to_str().unwrap(), "-p", "seed:=3"]);
    let node = Process::start(&domain, command);
    node.wait_for_log("rc10 publishes as /result_source", PATIENCE);

    let call = |service: &str, type_name: &str, request: Value| {
        let type_name = format!("rcl_interfaces/srv/{type_name}");
        let service = format!("/result_source/{service}");
        let request = request.to_string();
        message::<Value>(&start_cyclone(&domain, &python, &["call", &service, &type_name, &request]))
    };
    let listed = call("list_parameters", "ListParameters", json!({}));
    assert_eq!(
        listed["result"]["names"],
        json!(["memory_limit_mb", "reliable_inputs", "samples", "seed", "use_sim_time", "vehicle.name"])
    );
    let set = |value: Value| json!({"parameters": [{"name": "samples", "value": value}]});
    let results = call("set_parameters", "SetParameters", set(json!({"type": 2, "integer_value": 30})));
    assert_eq!(results["results"], json!([{"successful": true, "reason": ""}]));
    let refused = call("set_parameters", "SetParameters", set(json!({"type": 2, "integer_value": 0})));
    assert!(refused["results"][0]["reason"].as_str().unwrap().contains("expected 1 to 100000, got 0"));
    let got = call("get_parameters", "GetParameters", json!({"names": ["samples", "seed", "none"]}));
    let values = got["values"].as_array().unwrap();
    let integers: Vec<_> =
        values.iter().map(|value| (value["type"].clone(), value["integer_value"].clone())).collect();
    assert_eq!(integers, [(json!(2), json!(30)), (json!(2), json!(3)), (json!(0), json!(0))]);
    let described = call("describe_parameters", "DescribeParameters", json!({"names": ["samples"]}));
    assert_eq!(described["descriptors"][0]["description"], "Samples per sequence");
    assert_eq!(described["descriptors"][0]["integer_range"][0]["to_value"], 100_000);
    let typed = call("get_parameter_types", "GetParameterTypes", json!({"names": ["vehicle.name"]}));
    assert_eq!(typed["types"], json!([4]));
    let atomic = json!({"parameters": [
        {"name": "samples", "value": {"type": 2, "integer_value": 40}},
        {"name": "vehicle.name", "value": {"type": 4, "string_value": "other"}},
    ]});
    let result = call("set_parameters_atomically", "SetParametersAtomically", atomic);
    assert!(result["result"]["reason"].as_str().unwrap().contains("read-only"));
    let unchanged = call("get_parameters", "GetParameters", json!({"names": ["samples"]}));
    assert_eq!(unchanged["values"][0]["integer_value"], 30);
    std::fs::remove_file(&file).unwrap();
}

/// The other mapping of services to DDS, that of rmw_fastrtps.
#[test]
fn fast_dds_asks_for_a_parameter() {
    let fast_dds = fast_dds();
    if !available(std::slice::from_ref(&fast_dds)) {
        return;
    }
    let domain = Domain::new();
    let _node = source(&domain, &["-p", "seed:=12"]);
    let mut command = std::process::Command::new(fast_dds.unwrap());
    command.args(["get", "/result_source", "seed", "20"]);
    // One value, of type 2 (integer): 12.
    assert_eq!(Process::start(&domain, command).line(PATIENCE), "1 2 12");
}

#[test]
fn a_change_is_told_with_the_parameter_s_own_type() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let domain = Domain::new();
    let events = start_cyclone(
        &domain,
        &python,
        &["subscribe", "/parameter_events", "rcl_interfaces/msg/ParameterEvent", "--count", "100"],
    );
    let mut command = std::process::Command::new(gripsight_tests::process::program("stubborn_node"));
    command.env("RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp");
    let node = Process::start(&domain, command);
    node.wait_for_log("up as /stubborn_node", PATIENCE);
    let value = json!({"type": 2, "integer_value": 3});
    let request = json!({"parameters": [{"name": "seconds", "value": value}]}).to_string();
    let service = ["call", "/stubborn_node/set_parameters", "rcl_interfaces/srv/SetParameters", &request];
    let answer = message::<Value>(&start_cyclone(&domain, &python, &service));
    assert_eq!(answer["results"][0]["successful"], true);
    let changed = (0..100).find_map(|_| {
        let event: Value = message(&events);
        event["changed_parameters"].as_array().and_then(|changed| changed.first().cloned())
    });
    let changed = changed.unwrap();
    assert_eq!((&changed["name"], &changed["value"]["type"]), (&json!("seconds"), &json!(3)));
    assert_eq!(changed["value"]["double_value"], 3.0);
}

/// As ROS 2 has it. A recorder that meets a writer which keeps events for those who join later asks all others for as much, and hears nothing of them.
#[test]
fn events_are_offered_to_those_who_are_there() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let domain = Domain::new();
    let arguments = ["quality", "/parameter_events", "rcl_interfaces/msg/ParameterEvent", "--timeout", "25"];
    let mut peer = start_cyclone(&domain, &python, &arguments);
    let _node = source(&domain, &[]);
    assert_eq!(message::<Value>(&peer), json!([["Reliability.Reliable", "Durability.Volatile"]]));
    assert!(peer.wait(PATIENCE).success());
}

#[test]
fn a_name_that_the_node_does_not_have_is_found_in_its_file() {
    let domain = Domain::new();
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.display().to_string()
    };
    let own = file("own.yaml", "/**/result_source:\n  ros__parameters:\n    seed: 3\n    smaples: 20\n");
    let mut refused = node(&domain, "result_source", &["--params-file", &own]);
    let line = refused.wait_for_log("smaples", PATIENCE);
    assert!(line.contains("own.yaml, line 4: this node has no such parameter"), "{line}");
    assert!(!refused.wait(PATIENCE).success());
    let shared = file("shared.yaml", "/**:\n  ros__parameters:\n    smaples: 20\n    other: {rate: 1}\n");
    let warned = node(&domain, "result_source", &["--params-file", &shared]);
    let line = warned.wait_for_log("none of this node's", PATIENCE);
    assert!(line.contains("smaples") && line.contains("shared.yaml, line 3"), "{line}");
}

#[test]
fn a_wrong_parameter_stops_the_start() {
    let domain = Domain::new();
    let mut node = node(&domain, "result_source", &["-p", "samples:=0"]);
    node.wait_for_log("expected 1 to 100000, got 0", PATIENCE);
    assert!(!node.wait(PATIENCE).success());
}
