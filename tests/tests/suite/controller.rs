//! A controller that takes sets as parameters: a peer's, and a node of the suite's own make.

use std::path::Path;

use gripsight_msgs::PacejkaParams;
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, message, parsed, start_cyclone};
use gripsight_tests::process::Process;
use serde_json::{Value, json};

/// What an identifier is started with to tell the peer's controller.
pub(crate) const OF_PEER: [&str; 4] =
    ["-p", "controller_node:=/mpc", "-p", "controller_parameters:=[mu=grip, tire.bf=front.b]"];
/// The same for one of the suite's nodes, which has a number to set.
pub(crate) const OF_OWN: [&str; 4] =
    ["-p", "controller_node:=/stubborn_node", "-p", "controller_parameters:=[seconds=grip]"];

/// A controller on CycloneDDS that takes one request.
pub(crate) fn peer(domain: &Domain, python: &Path) -> Process {
    let taken = json!({"successful": true, "reason": ""});
    let reply = json!({"results": [taken, taken]}).to_string();
    let kind = "rcl_interfaces/srv/SetParameters";
    start_cyclone(domain, python, &["serve", "/mpc/set_parameters", kind, &reply, "--timeout", "120"])
}

/// Grip that a set promises: the weaker axle's.
fn promised(set: &PacejkaParams) -> f64 {
    let axle = |force_n: f64, load_n: f64, d: f64| (force_n / load_n).min(d);
    let front = axle(set.front_valid_force_n, set.front_load_n, set.front.d);
    front.min(axle(set.rear_valid_force_n, set.rear_load_n, set.rear.d))
}

/// The identifier must have told the peer this set, and have had its answer.
pub(crate) fn assert_told(peer: &Process, identifier: &Process, set: &PacejkaParams) {
    identifier.wait_for_log("the controller has sequence", PATIENCE);
    let request: Value = parsed(&peer.line(PATIENCE));
    let told = |at: usize| {
        let parameter = &request["parameters"][at];
        assert_eq!(parameter["value"]["type"], 3, "{parameter}");
        (parameter["name"].as_str().unwrap().to_owned(), parameter["value"]["double_value"].as_f64().unwrap())
    };
    let expected = [("mu".to_owned(), promised(set)), ("tire.bf".to_owned(), set.front.b)];
    assert_eq!([told(0), told(1)], expected);
}

/// The suite's node must have the set's grip as its parameter.
pub(crate) fn assert_set(domain: &Domain, python: &Path, identifier: &Process, set: &PacejkaParams) {
    identifier.wait_for_log("the controller has sequence", PATIENCE);
    let get = ["call", "/stubborn_node/get_parameters", "rcl_interfaces/srv/GetParameters"];
    let request = json!({"names": ["seconds"]}).to_string();
    let answer: Value = message(&start_cyclone(domain, python, &[&get[..], &[&request]].concat()));
    assert_eq!(answer["values"][0]["double_value"].as_f64(), Some(promised(set)), "{answer}");
}
