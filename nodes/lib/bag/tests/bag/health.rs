//! Each topic's messages have their own state.

use gripsight_bag::{BagWriter, TopicMap, encode, read_measurements};
use tempfile::TempDir;

use crate::support::{drive, imu, odometry, stamp_ns};

#[test]
fn rates_gaps_delays_and_spikes_are_told_topic_by_topic() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("bag.mcap");
    let mut writer = BagWriter::create(&path).unwrap();
    for k in 0..1000 {
        let mut sample = odometry(k);
        if [300, 600].contains(&k) {
            sample.v_y_mps += 3.0;
        }
        writer.write("/odom", stamp_ns(k) + 20_000_000, &encode::odometry(&sample)).unwrap();
        if k % 10 == 0 {
            writer.write("/drive", stamp_ns(k) - 5_000_000, &encode::drive(&drive(k))).unwrap();
        }
        if !(400..500).contains(&k) {
            writer.write("/imu", stamp_ns(k), &encode::imu(&imu(k))).unwrap();
        }
    }
    writer.finish().unwrap();

    let (_, report) = read_measurements(&path, &TopicMap::default()).unwrap();
    let [odom, drive, imu, wheels] = &report.topics[..] else { panic!("{report:?}") };
    let near = |a: f64, b: f64| (a - b).abs() < 1e-6 * b.abs().max(1.0);
    assert!(
        near(odom.pace.rate_hz, 100.0) && near(drive.pace.rate_hz, 10.0) && near(imu.pace.rate_hz, 100.0)
    );
    assert!(near(odom.delay_s.unwrap(), 0.02) && near(drive.delay_s.unwrap(), -0.005), "{report:?}");
    assert!(imu.pace.gaps == 1 && near(imu.pace.longest_step_s, 1.01) && near(imu.pace.lost_share, 0.1));
    assert!(odom.pace.gaps == 0 && odom.pace.jitter_s < 1e-9, "{odom:?}");
    let [spikes] = &odom.spikes[..] else { panic!("{odom:?}") };
    assert_eq!((spikes.channel, spikes.count), ("v_y_mps", 2));
    assert!((spikes.largest - 3.0).abs() < 0.01 && near(spikes.first_s, 3.0));
    assert!(drive.spikes.is_empty() && imu.spikes.is_empty());
    assert_eq!((&wheels.topic, wheels.messages, wheels.delay_s), (&None, 0, None));
}
