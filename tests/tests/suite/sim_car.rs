//! The live car: commands of a peer in, sensors and pictures out.

use gripsight_msgs::standard::rosgraph_msgs::Clock;
use gripsight_msgs::standard::sensor_msgs::CompressedImage;
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, available, cyclone, message, start_cyclone};
use gripsight_tests::process::node;
use serde_json::{Value, json};

const DRIVE: &str = "ackermann_msgs/msg/AckermannDriveStamped";

#[test]
fn the_car_follows_commands_from_the_topic() {
    let cyclone = cyclone();
    if !available(std::slice::from_ref(&cyclone)) {
        return;
    }
    let python = cyclone.unwrap();
    let domain = Domain::new();
    let listen = |topic: &str, kind: &str, count: &str| {
        let arguments = ["subscribe", topic, kind, "--qos", "reliable", "--count", count];
        start_cyclone(&domain, &python, &arguments)
    };
    let odometry = listen("/odom", "nav_msgs/msg/Odometry", "400");
    let clock = listen("/clock", "rosgraph_msgs/msg/Clock", "200");
    let pictures = listen("/image/compressed", "sensor_msgs/msg/CompressedImage", "3");
    let mut driver = start_cyclone(
        &domain,
        &python,
        &["publish", "/drive", DRIVE, "--qos", "reliable", "--period", "0.05"],
    );
    let car = node(
        &domain,
        "sim_car",
        &["-p", "publish_clock:=true", "-p", "camera_rate_hz:=2.0", "-p", "noise:=0.0"],
    );
    car.wait_for_log("f1tenth on its track", PATIENCE);
    // Eight seconds of a left turn at 2 m/s.
    let command = json!({"drive": {"speed": 2.0, "steering_angle": 0.2}});
    driver.feed(&format!("{command}\n").repeat(160));

    let reports: Vec<Value> = (0..400).map(|_| message(&odometry)).collect();
    let number = |report: &Value, path: &str| report.pointer(path).and_then(Value::as_f64).unwrap();
    let stamp_s =
        |report: &Value| number(report, "/header/stamp/sec") + 1e-9 * number(report, "/header/stamp/nanosec");
    for pair in reports.windows(2) {
        let step_s = stamp_s(&pair[1]) - stamp_s(&pair[0]);
        assert!((step_s - 0.01).abs() < 1e-4, "a step of {step_s} s");
    }
    let turning: Vec<&Value> =
        reports.iter().filter(|report| number(report, "/twist/twist/angular/z") > 0.5).collect();
    assert!(turning.len() > 50, "{} of 400 reports turn left", turning.len());
    let (first, last) = (turning[0], turning[turning.len() - 1]);
    let speed_mps = number(last, "/twist/twist/linear/x");
    assert!((1.5..2.5).contains(&speed_mps), "{speed_mps} m/s");
    let way_m = |path: &str| number(last, path) - number(first, path);
    assert!(way_m("/pose/pose/position/x").hypot(way_m("/pose/pose/position/y")) > 0.3);

    let times: Vec<Clock> = (0..200).map(|_| message(&clock)).collect();
    let order = |c: &Clock| (c.clock.sec, c.clock.nanosec);
    assert!(times.windows(2).all(|pair| order(&pair[0]) <= order(&pair[1])));
    assert!(order(&times[0]) < order(&times[199]));

    let files: Vec<CompressedImage> = (0..3).map(|_| message(&pictures)).collect();
    for picture in &files {
        assert_eq!(picture.format, "jpeg");
        assert!(picture.data.starts_with(&[0xff, 0xd8]) && picture.data.ends_with(&[0xff, 0xd9]));
    }
    assert_ne!(files[0].header.stamp, files[2].header.stamp);
}
