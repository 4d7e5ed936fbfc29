#![no_main]
//! Files that a user writes: a car's, a topics file, a friction basis.

use std::path::PathBuf;
use std::sync::OnceLock;

use gripsight_bag::TopicMap;
use gripsight_friction::Basis;
use gripsight_vehicle::VehicleParameters;

fn path() -> &'static PathBuf {
    static PATH: OnceLock<PathBuf> = OnceLock::new();
    PATH.get_or_init(|| tempfile::tempdir().unwrap().keep().join("file.yaml"))
}

libfuzzer_sys::fuzz_target!(|text: &str| {
    drop(VehicleParameters::from_ros_yaml(text));
    std::fs::write(path(), text).unwrap();
    drop(TopicMap::read(path()));
    if let Ok(basis) = Basis::read_file(path()) {
        let classes = basis.classes.len();
        let prior = basis.prior(&vec![1.0 / classes as f64; classes]);
        assert!(prior.mu.is_finite() && prior.sigma > 0.0, "{prior:?}");
    }
});
