//! What no node may do, whatever happens inside it: outlive a signal, stand still unnoticed, take the machine's memory, keep silent
//! about an input that does not come.

use std::time::{Duration, Instant};

use gripsight_msgs::standard::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus};
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, available, cyclone, message, start_cyclone};
use gripsight_tests::process::{Process, node};

/// The promise.
const END: Duration = Duration::from_secs(2);

fn stubborn(domain: &Domain, fault: &str, more: &[&str]) -> Process {
    let fault = format!("fault:={fault}");
    let node = node(domain, "stubborn_node", &[&["-p", &fault], more].concat());
    node.wait_for_log("now", PATIENCE);
    node
}

#[test]
fn a_signal_ends_a_node_whose_loop_is_blocked() {
    for (fault, signal) in [("block", "TERM"), ("block", "INT"), ("compute", "INT"), ("none", "TERM")] {
        let domain = Domain::new();
        let mut node = stubborn(&domain, fault, &[]);
        std::thread::sleep(Duration::from_millis(200));
        let start = Instant::now();
        node.signal(signal);
        node.wait(2 * END);
        let took = start.elapsed();
        println!("{fault}, SIG{signal}: ended after {took:.2?}");
        assert!(took < END, "{fault}, SIG{signal}: {took:?}");
    }
}

#[test]
fn a_loop_that_stalls_is_told_and_so_is_its_recovery() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let domain = Domain::new();
    let listener = start_cyclone(
        &domain,
        &python,
        &["subscribe", "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", "--count", "20"],
    );
    let node = stubborn(&domain, "block", &["-p", "seconds:=4.0"]);
    node.wait_for_log("has not turned", PATIENCE);
    let is_told = (0..20).any(|_| {
        message::<DiagnosticArray>(&listener).status.iter().any(|status| {
            status.name == "stubborn_node: process"
                && status.level == DiagnosticStatus::ERROR
                && status.message.contains("has not turned")
        })
    });
    assert!(is_told);
    node.wait_for_log("turns again", PATIENCE);
}

#[test]
fn a_node_starts_anew_at_its_memory_limit() {
    let domain = Domain::new();
    let node = stubborn(&domain, "memory", &["-p", "memory_limit_mb:=200"]);
    for _ in 0..2 {
        node.wait_for_log("the limit is 200 MB (memory_limit_mb): starting anew", PATIENCE);
        node.wait_for_log("up as /stubborn_node", PATIENCE);
        let peak_mb = node.peak_memory_mb();
        assert!(peak_mb < 400.0, "{peak_mb} MB");
    }
}

#[test]
fn an_input_that_does_not_come_is_named_with_what_there_is() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let domain = Domain::new();
    let node = node(&domain, "stubborn_node", &["-p", "reliable_inputs:=true"]);
    let first = node.wait_for_log("nothing arrives on /odom", PATIENCE);
    assert!(first.contains("nav_msgs/msg/Odometry, reliable, volatile): nobody publishes there"), "{first}");
    let _elsewhere = start_cyclone(&domain, &python, &["publish", "/car/odom", "nav_msgs/msg/Odometry"]);
    let hint = node.wait_for_log("messages of this type are on /car/odom", PATIENCE);
    assert!(hint.contains("/odom"), "{hint}");
    let publish = ["publish", "/odom", "nav_msgs/msg/Odometry", "--qos"];
    let best_effort = start_cyclone(&domain, &python, &[&publish[..], &["sensor"]].concat());
    node.wait_for_log("it offers best effort, reliable is asked for", PATIENCE);
    drop(best_effort);
    let mut fitting = start_cyclone(&domain, &python, &[&publish[..], &["reliable"]].concat());
    fitting.feed("{}");
    node.wait_for_log("messages arrive on /odom", PATIENCE);
}
