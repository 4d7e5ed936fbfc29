//! Type hashes against values that two independent implementations (rosidl and `rosbags`) agree on.

use std::collections::BTreeSet;

use gripsight_msgs::{Error, type_hash, type_hash_of, type_names};

#[test]
fn known_hashes() {
    for (type_name, digest) in [
        ("std_msgs/msg/Header", "f49fb3ae2cf070f793645ff749683ac6b06203e41c891e17701b1cb597ce6a01"),
        ("sensor_msgs/msg/Image", "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"),
        (
            "diagnostic_msgs/msg/DiagnosticArray",
            "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
        ),
    ] {
        assert_eq!(type_hash(type_name).unwrap(), format!("RIHS01_{digest}"), "{type_name}");
    }
    let string = type_hash_of("std_msgs/msg/String", |_| Some("string data # text")).unwrap();
    assert_eq!(string, "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18");
}

/// Against an implementation that was written elsewhere; the file says which.
#[test]
fn golden_hashes() {
    let ours: Vec<String> = type_names().map(|name| format!("{name} {}", type_hash(name).unwrap())).collect();
    let golden = include_str!("golden_hashes.txt").lines().filter(|line| !line.starts_with('#'));
    assert_eq!(ours.iter().map(String::as_str).collect::<BTreeSet<_>>(), golden.collect());
}

#[test]
fn an_unknown_type_is_named() {
    assert!(matches!(type_hash("a_msgs/msg/B"), Err(Error::UnknownType(name)) if name == "a_msgs/msg/B"));
}
