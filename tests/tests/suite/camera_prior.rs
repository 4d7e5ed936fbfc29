//! The camera prior on topics: what a peer hears from it, and what its pictures do.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use gripsight_msgs::standard::diagnostic_msgs::{DiagnosticArray, DiagnosticStatus};
use gripsight_msgs::standard::sensor_msgs::CompressedImage;
use gripsight_msgs::{FrictionPrior, Interval, Message, PacejkaParams, PeakFriction};
use gripsight_tests::domain::Domain;
use gripsight_tests::peers::{PATIENCE, available, cyclone, message, start_cyclone};
use gripsight_tests::process::{Process, node};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use serde_json::json;

const FRICTION: &str = "/camera_prior/friction";

fn listen(domain: &Domain, python: &Path, topic: &str, kind: &str, qos: &str) -> Process {
    start_cyclone(domain, python, &["subscribe", topic, kind, "--qos", qos, "--count", "1000"])
}

/// The first prior that `wanted` holds of. Others come before it: once a second there is one without a picture.
fn prior(peer: &Process, wanted: impl Fn(&FrictionPrior) -> bool) -> FrictionPrior {
    (0..30).map(|_| message::<FrictionPrior>(peer)).find(wanted).unwrap()
}

fn in_tree(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path)
}

/// Where engine and network are. None, said plainly, where the library was not fetched.
fn engine() -> Option<[String; 2]> {
    let library = in_tree(".deps/onnxruntime/libonnxruntime.so");
    if !library.exists() {
        eprintln!("SKIPPED: no ONNX Runtime; run launch_scripts/fetch_onnxruntime.sh");
        return None;
    }
    let model = in_tree("nodes/camera_prior/model/road_mobilenet_v3_small.onnx");
    Some([format!("onnxruntime_library:={}", library.display()), format!("model:={}", model.display())])
}

#[test]
fn a_configured_prior_reaches_a_late_peer() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let domain = Domain::new();
    // As launch_scripts/run_suite.sh starts it.
    let _node = node(&domain, "camera_prior", &["-p", "input:=none", "-p", "configured_mu:=0.72"]);
    let early = listen(&domain, &python, FRICTION, FrictionPrior::TYPE, "latched");
    let told: FrictionPrior = message(&early);
    let late = listen(&domain, &python, FRICTION, FrictionPrior::TYPE, "latched");
    for told in [told, message(&late)] {
        assert!(told.valid, "{told:?}");
        assert_eq!((told.source, told.mu, told.reason.as_str()), (FrictionPrior::CONFIGURED, 0.72, ""));
        assert!(told.sigma > 0.0 && told.pictures == 0, "{told:?}");
    }
}

/// A road picture as a JPEG.
fn road(file: &str) -> Vec<u8> {
    let picture = image::open(in_tree("nodes/lib/friction/tests/golden").join(file)).unwrap().to_rgb8();
    let mut jpeg = Cursor::new(vec![]);
    picture.write_to(&mut jpeg, image::ImageFormat::Jpeg).unwrap();
    jpeg.into_inner()
}

/// A picture message as a JSON line, stamped `later_s` from now.
fn line(data: &[u8], later_s: u64) -> String {
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    let stamp = json!({"sec": now.as_secs() + later_s, "nanosec": now.subsec_nanos()});
    let header = json!({"stamp": stamp, "frame_id": "camera"});
    json!({"header": header, "format": "jpeg", "data": data}).to_string() + "\n"
}

#[test]
fn a_peer_s_pictures_are_read_and_broken_ones_refused() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let Some([library, model]) = engine() else { return };
    let domain = Domain::new();
    let listener = listen(&domain, &python, FRICTION, FrictionPrior::TYPE, "reliable");
    let onlooker =
        listen(&domain, &python, "/camera_prior/region/compressed", CompressedImage::TYPE, "reliable");
    // The peer starts to send once it has found the node, so its stamps may be old, and the second is ahead by one.
    let age = ["-p", "most_age_s:=60.0", "-p", "most_ahead_s:=5.0"];
    let files = ["-p", &library, "-p", &model];
    let region = ["-p", "publish_region:=true", "-p", "region:=0.1,0.3,0.9,0.95"];
    let _node = node(&domain, "camera_prior", &[&age[..], &files, &region].concat());
    let topic = ["publish", "/image/compressed", CompressedImage::TYPE, "--qos", "sensor", "--period", "1"];
    let mut peer = start_cyclone(&domain, &python, &topic);
    let jpeg = road("road.png");
    peer.feed(&(line(&jpeg, 0) + &line(&jpeg[..jpeg.len() / 2], 1)));

    let read = prior(&listener, |p| p.reason != "no_picture");
    assert!(read.valid, "{read:?}");
    assert_eq!(
        (read.source, read.pictures, read.header.frame_id.as_str()),
        (FrictionPrior::CAMERA, 1, "camera")
    );
    let expected: f64 = read.probability.iter().zip(&read.class_mu).map(|(p, mu)| p * mu).sum();
    assert!((read.mu - expected).abs() < 1e-9 && read.sigma > 0.0, "{read:?}");

    // What the network saw: the region, at its own size.
    let seen: CompressedImage = message(&onlooker);
    let picture = image::load_from_memory(&seen.data).unwrap();
    assert_eq!((picture.width(), picture.height(), seen.header.frame_id.as_str()), (224, 224, "camera"));

    let refused = prior(&listener, |p| p.reason != "no_picture");
    assert!(!refused.valid, "{refused:?}");
    assert_eq!((refused.reason.as_str(), refused.source), ("undecodable", FrictionPrior::CAMERA));
    assert!(refused.sigma > read.sigma, "{refused:?}");
    assert!(peer.wait(PATIENCE).success());
}

#[test]
fn without_its_model_the_node_runs_on_and_says_so() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let domain = Domain::new();
    let listener = listen(&domain, &python, FRICTION, FrictionPrior::TYPE, "reliable");
    let diagnostics = listen(&domain, &python, "/diagnostics", DiagnosticArray::TYPE, "reliable");
    let library = engine().map_or_else(|| "onnxruntime_library:=none.so".to_owned(), |[library, _]| library);
    let arguments = ["-p", &library, "-p", "model:=none.onnx", "-p", "configured_mu:=0.72"];
    let _node = node(&domain, "camera_prior", &arguments);
    let status: DiagnosticStatus = (0..30)
        .flat_map(|_| message::<DiagnosticArray>(&diagnostics).status)
        .find(|status| status.name == "camera_prior: camera")
        .unwrap();
    assert_eq!(status.level, DiagnosticStatus::ERROR, "{status:?}");
    assert!(status.message.contains("none."), "{status:?}");
    for _ in 0..3 {
        let told: FrictionPrior = message(&listener);
        assert_eq!((told.valid, told.source, told.mu), (true, FrictionPrior::CONFIGURED, 0.72));
    }
}

/// A picture that takes long to read: 8000 x 8000 black pixels in some tens of kilobytes.
fn slow() -> Vec<u8> {
    let mut png = vec![];
    let encoder = PngEncoder::new_with_quality(&mut png, CompressionType::Default, FilterType::NoFilter);
    image::GrayImage::new(8000, 8000).write_with_encoder(encoder).unwrap();
    assert!(png.len() < 100_000, "{} bytes may not pass the socket", png.len());
    png
}

#[test]
fn after_a_slow_picture_the_newest_is_read_and_those_that_waited_are_not() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let Some([library, model]) = engine() else { return };
    let domain = Domain::new();
    let listener = listen(&domain, &python, FRICTION, FrictionPrior::TYPE, "reliable");
    let diagnostics = listen(&domain, &python, "/diagnostics", DiagnosticArray::TYPE, "reliable");
    // Each picture is read: the slow one comes between the camera's.
    let each = ["-p", &library, "-p", &model, "-p", "least_interval_s:=0.0"];
    let _node = node(&domain, "camera_prior", &each);
    let topic = ["publish", "/image/compressed", CompressedImage::TYPE, "--qos", "sensor", "--stamp"];
    let publish = |more: &[&str]| start_cyclone(&domain, &python, &[&topic[..], more].concat());
    let mut camera = publish(&["--period", "0.02", "--times", "2000"]);
    camera.feed(&line(&road("input.png"), 0));
    prior(&listener, |p| p.valid && p.source == FrictionPrior::CAMERA);
    // More than once: at best effort a large picture may be lost on the way.
    let mut other = publish(&["--period", "2", "--times", "20"]);
    other.feed(&line(&slow(), 0));

    let stamp_s =
        |p: &FrictionPrior| f64::from(p.header.stamp.sec) + f64::from(p.header.stamp.nanosec) * 1e-9;
    let mut priors = std::iter::repeat_with(|| message::<FrictionPrior>(&listener));
    let slow = priors.by_ref().find(|p| p.reason == "dark").unwrap();
    let next = priors.next().unwrap();
    let number = |key: &str, enough: f64| {
        let values = std::iter::repeat_with(|| message::<DiagnosticArray>(&diagnostics))
            .flat_map(|array| array.status)
            .flat_map(|status| status.values);
        let mut numbers = values.filter(|v| v.key == key).map(|v| v.value.parse::<f64>().unwrap());
        numbers.find(|number| *number >= enough).unwrap()
    };
    let took_s = number("longest time for a picture [ms]", 100.0) * 1e-3;
    let ahead_s = stamp_s(&next) - stamp_s(&slow);
    assert!(
        next.valid && ahead_s > 0.5 * took_s,
        "reading took {took_s} s; then one {ahead_s} s newer: {next:?}"
    );
    // There was a queue to be dropped.
    assert!(number("pictures dropped for newer ones", 1.0) >= 1.0);
}

#[test]
fn the_tires_teach_the_camera_and_it_can_be_told_to_forget() {
    let Ok(python) = cyclone() else {
        available(&[cyclone()]);
        return;
    };
    let Some([library, model]) = engine() else { return };
    let domain = Domain::new();
    let listener = listen(&domain, &python, FRICTION, FrictionPrior::TYPE, "reliable");
    let tracks = tempfile::tempdir().unwrap();
    let folder = format!("track_folder:={}", tracks.path().display());
    let files = ["-p", &library, "-p", &model, "-p", "region:=full"];
    let track = ["-p", "track:=lab", "-p", &folder];
    let _node = node(&domain, "camera_prior", &[&files[..], &track].concat());
    let topic = ["publish", "/image/compressed", CompressedImage::TYPE, "--qos", "sensor", "--stamp"];
    let pace = ["--period", "0.1", "--times", "2000"];
    let mut camera = start_cyclone(&domain, &python, &[&topic[..], &pace].concat());
    camera.feed(&line(&road("road.png"), 0));
    let before = prior(&listener, |p| p.valid && p.source == FrictionPrior::CAMERA);
    assert!(before.calibration.is_empty() && before.sigma > 0.25, "{before:?}");
    // Pictures of two seconds, then a set of tires whose peak was reached at 0.35: a road of 0.4.
    (0..20).for_each(|_| drop(message::<FrictionPrior>(&listener)));
    let friction = Interval { value: 0.35, low: 0.33, high: 0.37 };
    let peak = PeakFriction { friction, reached: true, from_prior: false };
    let mut set = PacejkaParams {
        status: PacejkaParams::ACCEPTED,
        front_peak: peak,
        rear_peak: peak,
        ..PacejkaParams::default()
    };
    let now = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    set.header.stamp.sec = now.as_secs() as i32 + 10;
    set.handshake.run_id = "a run".to_owned();
    let topic = ["publish", "/pacejka", PacejkaParams::TYPE, "--qos", "latched"];
    let mut identifier = start_cyclone(&domain, &python, &topic);
    identifier.feed(&(serde_json::to_string(&set).unwrap() + "\n"));
    let taught = (0..100).map(|_| message::<FrictionPrior>(&listener)).find(|p| !p.calibration.is_empty());
    let settled = (0..15).map(|_| message::<FrictionPrior>(&listener)).reduce(|_, next| next).unwrap();
    assert!(taught.is_some() && (settled.mu - 0.4).abs() < 0.05 && settled.sigma < 0.15, "{settled:?}");
    assert!(!settled.new_floor && tracks.path().join("lab.json").is_file());

    let request = r#"{"structure_needs_at_least_one_member": 0}"#;
    let call = ["call", "/camera_prior/forget", "std_srvs/srv/Trigger", request];
    let reply: serde_json::Value = message(&start_cyclone(&domain, &python, &call));
    assert_eq!(reply["success"], true, "{reply}");
    let forgotten = (0..100).map(|_| message::<FrictionPrior>(&listener)).find(|p| p.calibration.is_empty());
    assert!(forgotten.is_some() && !tracks.path().join("lab.json").exists());
}
