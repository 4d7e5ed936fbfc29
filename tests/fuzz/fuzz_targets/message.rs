#![no_main]
//! A message's CDR; the first byte is the type.

use gripsight_bag::{from_cdr, to_cdr};
use gripsight_msgs as own;
use gripsight_msgs::standard::{ackermann_msgs, diagnostic_msgs, nav_msgs, rcl_interfaces, sensor_msgs};

/// What is taken is written as it was read.
macro_rules! read {
    ($kind:expr, $bytes:expr, $($number:literal => $type:ty),* $(,)?) => {
        match $kind {
            $($number => if let Ok(message) = from_cdr::<$type>($bytes) {
                let written = to_cdr(&message).unwrap();
                let again = from_cdr::<$type>(&written).unwrap();
                assert_eq!(to_cdr(&again).unwrap(), written);
            },)*
            _ => {}
        }
    };
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((kind, bytes)) = bytes.split_first() else { return };
    read!(kind % 14, bytes,
        0 => nav_msgs::Odometry,
        1 => ackermann_msgs::AckermannDriveStamped,
        2 => sensor_msgs::Imu,
        3 => sensor_msgs::JointState,
        4 => sensor_msgs::CompressedImage,
        5 => sensor_msgs::Image,
        6 => diagnostic_msgs::DiagnosticArray,
        7 => rcl_interfaces::ParameterEvent,
        8 => own::StateSequence,
        9 => own::PacejkaParams,
        10 => own::ResidualModel,
        11 => own::TirePosterior,
        12 => own::GapReport,
        13 => own::FrictionPrior,
    );
});
