//! Messages whose every field has a value of its own.

use gripsight_msgs::standard::builtin_interfaces::Time;
use gripsight_msgs::standard::sensor_msgs::CompressedImage;
use gripsight_msgs::standard::std_msgs::Header;
use gripsight_msgs::{
    Handshake, Interval, Longitudinal, LongitudinalLimit, MagicFormula, PacejkaParams, PeakFriction, Range,
    SignalCorrections, StateSequence,
};

/// A parameter set; no two of its numbers are equal, and none is a short decimal.
pub fn pacejka(seed: u64) -> PacejkaParams {
    let mut count = 0_u32;
    let mut next = || {
        count += 1;
        (f64::from(count) + 0.1 * seed as f64).sqrt() * if count.is_multiple_of(3) { -1.0 } else { 1.0 }
    };
    let mut formula = || MagicFormula { b: next(), c: next(), d: next(), e: next() };
    let (front, rear) = (formula(), formula());
    let mut interval = || Interval { value: next(), low: next(), high: next() };
    let stiffness = [interval(), interval()];
    let peaks = [interval(), interval()];
    let mut range = || Range { low: next(), high: next() };
    let slip = [range(), range()];
    let limits_mps = [range(), range()];
    let mut interval = || Interval { value: next(), low: next(), high: next() };
    let longitudinal = Longitudinal {
        gain: interval(),
        delay_s: interval(),
        lag_s: interval(),
        rolling_resistance_mps2: interval(),
        drag_1pm: interval(),
        limits: limits_mps
            .map(|v_x_mps| LongitudinalLimit {
                v_x_mps,
                a_max_mps2: next(),
                a_max_reached: v_x_mps == limits_mps[0],
                a_min_mps2: next(),
                a_min_reached: v_x_mps == limits_mps[1],
            })
            .to_vec(),
    };
    PacejkaParams {
        header: header(),
        handshake: handshake(seed),
        status: PacejkaParams::ACCEPTED,
        reason: "peak of the rear axle from the prior".into(),
        front,
        rear,
        front_load_n: next(),
        rear_load_n: next(),
        front_cornering_stiffness_n_per_rad: stiffness[0],
        rear_cornering_stiffness_n_per_rad: stiffness[1],
        front_peak: PeakFriction { friction: peaks[0], reached: true, from_prior: false },
        rear_peak: PeakFriction { friction: peaks[1], reached: false, from_prior: true },
        front_slip_rad: slip[0],
        rear_slip_rad: slip[1],
        front_valid_slip_rad: next(),
        rear_valid_slip_rad: next(),
        front_valid_force_n: next(),
        rear_valid_force_n: next(),
        signals: SignalCorrections {
            steering_delay_s: next(),
            steering_gain: next(),
            steering_offset_rad: next(),
            v_y_lever_arm_m: next(),
            v_y_bias_mps: next(),
            yaw_rate_bias_radps: next(),
        },
        v_x_mean_mps: next(),
        longitudinal,
    }
}

/// A sequence of `samples` samples in its five obligatory channels.
pub fn sequence(samples: usize) -> StateSequence {
    let channel = |scale: f32| (0..samples).map(|index| scale * index as f32).collect();
    StateSequence {
        header: header(),
        handshake: handshake(1),
        chunk: 0,
        chunks: 1,
        time_s: channel(0.01),
        v_x_mps: channel(1.5),
        v_y_mps: channel(-0.25),
        yaw_rate_radps: channel(0.125),
        steering_rad: channel(-0.0625),
        ..StateSequence::default()
    }
}

/// A picture of `length` bytes; nothing aligns its end.
pub fn picture(length: usize) -> CompressedImage {
    let data = (0..length).map(|index| (index % 251) as u8).collect();
    CompressedImage { header: header(), format: "jpeg".into(), data }
}

fn header() -> Header {
    Header { stamp: Time { sec: 1_700_000_000, nanosec: 123_456_789 }, frame_id: "base_link".into() }
}

fn handshake(seed: u64) -> Handshake {
    Handshake {
        run_id: "run-42".into(),
        sequence_id: 3,
        iteration: 5,
        vehicle_hash: "c0ffee".into(),
        seed: seed + (1 << 53),
    }
}
