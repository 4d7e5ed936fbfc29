//! Effects injected into a bag.

use std::path::Path;

use gripsight_bag::effect::{EFFECTS, Effect, EffectKind};
use gripsight_bag::{Bag, BagError, RawMessage, Role, TopicMap, inject, read_sequences};
use gripsight_signals::StateSequence;
use tempfile::TempDir;

use crate::support::{WHOLE, telemetry_bag};

fn messages(path: &Path) -> Vec<RawMessage> {
    Bag::open(path).unwrap().messages().map(Result::unwrap).collect()
}

fn sequence(path: &Path) -> StateSequence {
    read_sequences(path, &TopicMap::default(), WHOLE).unwrap().0.remove(0)
}

#[test]
fn only_the_effects_stream_changes() {
    let folder = TempDir::new().unwrap();
    let path = telemetry_bag(&folder.path().join("bag.mcap"), 200);
    let out = folder.path().join("out.mcap");
    let recorded = messages(&path);
    for EffectKind { name, .. } in &EFFECTS {
        let effect: Effect = format!("{name}=0.02").parse().unwrap();
        let changed = inject(&path, &TopicMap::default(), &[effect], &out).unwrap();
        let topic = ["/odom", "/drive", "/imu", "/wheels"][effect.stream() as usize];
        let also = if name.starts_with("gyro") { "/imu" } else { topic };
        let mut different = 0;
        let injected = messages(&out);
        assert_eq!(injected.len(), recorded.len());
        assert!(injected.is_sorted_by_key(|m| m.log_time), "{name}");
        for wanted in ["/odom", "/drive", "/imu", "/wheels"] {
            let of = |all: &[RawMessage]| {
                all.iter().filter(|m| m.channel.topic == wanted).cloned().collect::<Vec<_>>()
            };
            for (a, b) in of(&recorded).iter().zip(&of(&injected)) {
                let same = a.data == b.data && a.log_time == b.log_time;
                assert!(same || [topic, also].contains(&wanted), "{name} changed {wanted}");
                assert_eq!((a.sequence, a.data.len()), (b.sequence, b.data.len()));
                different += u64::from(!same);
            }
        }
        assert_eq!(different, changed, "{name}");
        assert!(changed >= 150, "{name} changed {changed}");
    }
}

#[test]
fn an_injected_delay_moves_the_command_ahead_of_the_response() {
    let folder = TempDir::new().unwrap();
    let path = telemetry_bag(&folder.path().join("bag.mcap"), 300);
    let out = folder.path().join("out.mcap");
    inject(&path, &TopicMap::default(), &["steering_delay=0.05".parse().unwrap()], &out).unwrap();
    let (before, after) = (sequence(&path), sequence(&out));
    // u_rec(t) = u(t + 50 ms): five samples.
    for k in 0..290 {
        assert_eq!(after.steering_rad[k], before.steering_rad[k + 5]);
        assert_eq!(after.v_y_mps[k], before.v_y_mps[k]);
    }
}

#[test]
fn no_effect_gives_the_same_messages() {
    let folder = TempDir::new().unwrap();
    let path = telemetry_bag(&folder.path().join("bag.mcap"), 100);
    let out = folder.path().join("out.mcap");
    assert_eq!(inject(&path, &TopicMap::default(), &[], &out).unwrap(), 0);
    assert_eq!(messages(&path), messages(&out));
}

#[test]
fn an_effect_on_a_stream_that_is_not_there_is_refused() {
    let folder = TempDir::new().unwrap();
    let path = telemetry_bag(&folder.path().join("bag.mcap"), 10);
    let topics = TopicMap { imu: Some(String::new()), ..TopicMap::default() };
    let effect: Effect = "imu_tilt=0.02".parse().unwrap();
    assert_eq!(effect.stream(), Role::Imu);
    let error = inject(&path, &topics, &[effect], &folder.path().join("out.mcap")).unwrap_err();
    assert!(matches!(error, BagError::Effect { .. }), "{error}");
    assert!(inject(&path, &TopicMap::default(), &[], &path).is_err(), "a bag is not written over itself");
}
