//! The node that harms messages, between two peers: what it says it does arrives.

use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, available, cyclone, parsed, start_cyclone};
use gripsight_tests::process::node;
use serde_json::{Value, json};

const ODOMETRY: &str = "nav_msgs/msg/Odometry";

/// Five seconds of odometry, twenty messages a second: nothing is lost before the fault, every third and nothing else comes while it is at work,
/// not a number is what comes after.
#[test]
fn faults_happen_when_and_where_they_are_planned() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let python = cyclone.unwrap();
    let domain = Domain::new();
    let sink = start_cyclone(
        &domain,
        &python,
        &["subscribe", "/odom", ODOMETRY, "--qos", "reliable", "--count", "1000", "--timeout", "60"],
    );
    let faults = r#"faults:=["rate odom 1 1.5 3", "nan odom 3 1 1", "drop drive 0 5 1"]"#;
    let injector = node(&domain, "fault_injector", &["-p", faults, "-p", "reliable_inputs:=true"]);
    injector.wait_for_log("3 faults planned", PATIENCE);
    let mut source = start_cyclone(
        &domain,
        &python,
        &["publish", "/in/odom", ODOMETRY, "--qos", "reliable", "--period", "0.01"],
    );
    let messages = (0..100_u32).map(|index| {
        let stamp = json!({"sec": 1000 + index / 20, "nanosec": index % 20 * 50_000_000});
        json!({"header": {"stamp": stamp}, "twist": {"twist": {"linear": {"x": index}}}}).to_string() + "\n"
    });
    source.feed(&messages.collect::<String>());

    // 30 of the 100 fall within the fault of the rate, of which ten come.
    // What is no number is none in JSON either.
    let speed = |line: &str| {
        parsed::<Value>(line).pointer("/twist/twist/linear/x").and_then(Value::as_f64).unwrap_or(f64::NAN)
    };
    let speeds: Vec<f64> = (0..80).map(|_| speed(&sink.line(PATIENCE))).collect();
    let whole = |range: std::ops::Range<u32>| range.map(f64::from).collect::<Vec<f64>>();
    assert_eq!(speeds[..20], whole(0..20));
    assert!(speeds[20..30].windows(2).all(|pair| pair[1] - pair[0] == 3.0), "{:?}", &speeds[20..30]);
    assert_eq!(speeds[30..40], whole(50..60));
    assert!(speeds[40..60].iter().all(|speed| speed.is_nan()), "{:?}", &speeds[40..60]);
    assert_eq!(speeds[60..], whole(80..100));
    injector.wait_for_log("fault 3 of 3: nan odom", PATIENCE);
}

/// More messages than a writer keeps for a reader that takes none (8192), with one that stands still beside one that does not: the last arrives.
#[test]
fn a_subscriber_that_stands_still_costs_the_others_no_message() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let python = cyclone.unwrap();
    let domain = Domain::new();
    let subscribe =
        ["subscribe", "/odom", ODOMETRY, "--qos", "reliable", "--count", "12000", "--timeout", "60"];
    let sink = start_cyclone(&domain, &python, &subscribe);
    let behind = [
        "-p",
        "reliable_inputs:=true",
        "-r",
        "__node:=behind",
        "-r",
        "/in/odom:=/odom",
        "-r",
        "/odom:=/behind/odom",
    ];
    let listener = node(&domain, "fault_injector", &behind);
    listener.wait_for_log("started", PATIENCE);
    let injector = node(&domain, "fault_injector", &["-p", "reliable_inputs:=true"]);
    injector.wait_for_log("started", PATIENCE);
    let publish = ["publish", "/in/odom", ODOMETRY, "--qos", "reliable", "--period", "0.0003"];
    let mut source = start_cyclone(&domain, &python, &publish);
    let message = |index: u32| {
        let stamp = json!({"sec": 1000 + index / 200, "nanosec": index % 200 * 5_000_000});
        json!({"header": {"stamp": stamp}, "twist": {"twist": {"linear": {"x": index}}}}).to_string() + "\n"
    };
    let feeding = std::thread::spawn(move || {
        source.feed(&(0..12_000).map(message).collect::<String>());
        source
    });
    for index in 0..12_000 {
        let heard = sink.line(PATIENCE);
        // By then all have found each other.
        if index == 2000 {
            listener.signal("STOP");
        }
        let speed = parsed::<Value>(&heard).pointer("/twist/twist/linear/x").and_then(Value::as_f64);
        assert_eq!(speed, Some(f64::from(index)));
    }
    feeding.join().unwrap();
}
