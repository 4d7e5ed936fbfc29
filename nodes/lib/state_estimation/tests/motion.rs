//! A car whose motion is known, seen through a localisation that is noisy, late and jumps, an inertial unit and a speed.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

use gripsight_signals::{StateSequence, is_dead_reckoning};
use gripsight_state_estimation::{Smoothed, StateError, filled, smooth};
use rand::SeedableRng as _;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution as _, Normal};

/// What is recorded, and how badly.
#[derive(Clone, Copy)]
struct Recorded {
    position_m: f64,
    heading_rad: f64,
    delay_s: f64,
    imu: bool,
    speed: bool,
    jump: bool,
    /// What it is off by for tenths of a second, over its white noise.
    wander: f64,
    v_mps: f64,
    length_s: f64,
}

const LOCALISED: Recorded = Recorded {
    position_m: 0.03,
    heading_rad: 0.0175,
    delay_s: 0.05,
    imu: true,
    speed: true,
    jump: true,
    wander: 0.0,
    v_mps: 5.0,
    length_s: 40.0,
};

const WANDERS_S: f64 = 0.4;

fn slip_mps(t: f64) -> f64 {
    0.25 * (1.7 * t - 0.4).sin() * (0.13 * t).cos()
}

/// The drive, and the true v_y at its samples.
fn drive(r: Recorded, seed: u64) -> (StateSequence, Vec<f64>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut noise = |sigma: f64| Normal::new(0.0, sigma).unwrap().sample(&mut random);
    let mut s = StateSequence::default();
    let mut truth = Vec::new();
    let (mut x, mut y, mut yaw) = (0.0_f64, 0.0_f64, 0.3_f64);
    let dt = 1e-3;
    let (yaw_rate, speed) =
        (|t: f64| 6.0 / r.v_mps * (1.7 * t).sin() * (0.13 * t).cos(), |t: f64| r.v_mps + (0.4 * t).sin());
    let mut off = [0.0; 3];
    for k in 0..(r.length_s / dt) as usize {
        let t = k as f64 * dt;
        let (v, w, v_y) = (speed(t), yaw_rate(t), slip_mps(t));
        if k % 10 == 0 {
            s.time_s.push(t as f32);
            truth.push(v_y);
            s.v_x_mps.push(if r.speed { (v + noise(0.02)) as f32 } else { 0.0 });
            s.v_y_mps.push(0.0);
            s.yaw_rate_radps.push(if r.imu { (w + 0.01 + noise(0.01)) as f32 } else { 0.0 });
            s.steering_rad.push(0.0);
            if r.imu {
                let change = (slip_mps(t + 1e-4) - slip_mps(t - 1e-4)) / 2e-4;
                let turn = (yaw_rate(t + 1e-4) - yaw_rate(t - 1e-4)) / 2e-4;
                let along = (speed(t + 1e-4) - speed(t - 1e-4)) / 2e-4;
                s.a_y_mps2.push((v * w + change + 0.1 * turn + 0.15 + noise(0.2)) as f32);
                s.a_x_mps2.push((along - v_y * w - 0.1 * w * w - 0.1 + noise(0.2)) as f32);
                s.gyro_yaw_rate_radps.push((w + 0.01 + noise(0.01)) as f32);
            }
        }
        if k % 25 == 0 && r.position_m > 0.0 {
            // A new map: shifted, and turned with all that is in it.
            let (shift, turn) = if r.jump && t > 22.0 { ([0.3, -0.2], 0.05_f64) } else { ([0.0; 2], 0.0) };
            let (sin, cos) = turn.sin_cos();
            let map = [cos * x - sin * y + shift[0], sin * x + cos * y + shift[1]];
            let kept = f64::exp(-0.025 / WANDERS_S);
            for (off, sigma) in off.iter_mut().zip([r.position_m, r.position_m, r.heading_rad]) {
                *off = kept * *off + noise(r.wander * sigma * (1.0 - kept * kept).sqrt());
            }
            s.pose_time_s.push((t + r.delay_s) as f32);
            s.pose_x_m.push((map[0] + off[0] + noise(r.position_m)) as f32);
            s.pose_y_m.push((map[1] + off[1] + noise(r.position_m)) as f32);
            s.pose_yaw_rad.push((yaw + turn + off[2] + noise(r.heading_rad)) as f32);
        }
        x += (v * yaw.cos() - v_y * yaw.sin()) * dt;
        y += (v * yaw.sin() + v_y * yaw.cos()) * dt;
        yaw += w * dt;
    }
    (s, truth)
}

/// Root mean square error of v_y, and the share of its errors within 90 % of their own distribution.
fn judged(smoothed: &Smoothed, truth: &[f64]) -> (f64, f64) {
    let errors: Vec<f64> = smoothed.motion.iter().zip(truth).map(|(m, t)| m.v_y_mps - t).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let inside = smoothed.motion.iter().zip(&errors).filter(|(m, e)| e.abs() < 1.645 * m.v_y_sigma_mps());
    (rms, inside.count() as f64 / errors.len() as f64)
}

#[test]
fn v_y_comes_from_a_localisation_that_is_late_and_jumps() {
    for seed in 0..3 {
        let (sequence, truth) = drive(LOCALISED, seed);
        let smoothed = smooth(&sequence).unwrap();
        let (rms, inside) = judged(&smoothed, &truth);
        let (delay_s, sigma_s) = smoothed.pose_delay_s.unwrap();
        println!(
            "{seed}: rms {rms:.4} inside {inside:.3} {:?}",
            (
                delay_s,
                sigma_s,
                &smoothed.jumps_s,
                smoothed.left_out,
                smoothed.yaw_rate_bias_radps,
                smoothed.imu_arm_m,
                smoothed.v_x_scale
            )
        );
        assert!((delay_s - 0.05).abs() < 0.01, "{delay_s}");
        assert!(rms < 0.03, "{rms}");
        assert!(inside > 0.75, "{inside}");
        assert!(smoothed.jumps_s.iter().any(|t| (t - 22.0).abs() < 0.3), "{:?}", smoothed.jumps_s);
        assert!((smoothed.yaw_rate_bias_radps.0 - 0.01).abs() < 0.004);
    }
}

#[test]
fn less_is_known_where_less_is_recorded_and_it_says_so() {
    let of = |r: Recorded| {
        let (sequence, truth) = drive(r, 7);
        let smoothed = smooth(&sequence).unwrap();
        let mean = smoothed.motion.iter().map(gripsight_state_estimation::Motion::v_y_sigma_mps).sum::<f64>()
            / truth.len() as f64;
        let (rms, inside) = judged(&smoothed, &truth);
        println!("rms {rms:.4} sigma {mean:.4} inside {inside:.3}");
        (rms, mean, inside)
    };
    let still = Recorded { jump: false, delay_s: 0.0, ..LOCALISED };
    let everything = of(still);
    let poses = of(Recorded { imu: false, speed: false, ..still });
    let no_pose = of(Recorded { position_m: 0.0, ..still });
    assert!(everything.1 < poses.1 && poses.1 < no_pose.1, "{everything:?} {poses:?} {no_pose:?}");
    assert!(everything.0 < 0.03 && poses.0 < 0.1, "{everything:?} {poses:?}");
    assert!([everything, poses, no_pose].iter().all(|j| j.2 > 0.75), "{everything:?} {poses:?} {no_pose:?}");
}

#[test]
fn wheel_odometry_is_no_localisation() {
    let (mut sequence, _) = drive(Recorded { position_m: 0.0, ..LOCALISED }, 1);
    let (mut x, mut y, mut yaw) = (0.0, 0.0, 0.0);
    for k in 0..sequence.len() {
        sequence.x_m.push(x as f32);
        sequence.y_m.push(y as f32);
        sequence.yaw_rad.push(yaw as f32);
        let v = f64::from(sequence.v_x_mps[k]);
        x += v * f64::cos(yaw) * 0.01;
        y += v * f64::sin(yaw) * 0.01;
        yaw += f64::from(sequence.yaw_rate_radps[k]) * 0.01;
    }
    assert!(is_dead_reckoning(&sequence));
    assert!(!smooth(&sequence).unwrap().poses_used);
    let (localised, truth) = drive(LOCALISED, 1);
    assert!(!is_dead_reckoning(&localised));
    let full = filled(&localised, &smooth(&localised).unwrap());
    full.check().unwrap();
    assert!(full.has_v_y() && full.len() == truth.len());
}

#[test]
fn nothing_measured_is_said() {
    let silent = Recorded { position_m: 0.0, imu: false, speed: false, ..LOCALISED };
    assert_eq!(smooth(&drive(silent, 1).0), Err(StateError::NothingMeasured));
}

/// A differentiated and smoothed acceleration has no noise from sample to sample, and is wrong for tenths of a second: it must not outvote exact poses.
#[test]
fn an_acceleration_that_is_smooth_and_wrong_is_not_believed() {
    let exact = Recorded { position_m: 5e-4, heading_rad: 5e-4, delay_s: 0.0, jump: false, ..LOCALISED };
    let (mut s, truth) = drive(exact, 5);
    for (k, a_y) in s.a_y_mps2.iter_mut().enumerate() {
        let t = 0.01 * k as f32;
        *a_y = (1.1 * 5.0) * (1.2 * (1.7 * t).sin() * (0.13 * t).cos()) + 0.8 * (9.0 * t).sin();
    }
    let smoothed = smooth(&s).unwrap();
    let errors: Vec<f64> = smoothed.motion.iter().zip(&truth).map(|(m, v)| (m.v_y_mps - v).abs()).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    assert!(rms < 0.03, "v_y off by {rms:.3} m/s");
    assert!(smoothed.jumps_s.is_empty(), "{:?}", smoothed.jumps_s);
}

/// Poses of another car: what a filter that begins anew at each of them makes of the motion is none.
#[test]
fn poses_that_contradict_the_speeds_throughout_give_no_motion() {
    let (mut sequence, _) = drive(Recorded { jump: false, delay_s: 0.0, ..LOCALISED }, 4);
    assert!(smooth(&sequence).is_ok());
    for places in [&mut sequence.pose_x_m, &mut sequence.pose_y_m, &mut sequence.x_m, &mut sequence.y_m] {
        places.iter_mut().for_each(|place| *place *= 6.0);
    }
    let error = smooth(&sequence).unwrap_err();
    assert!(matches!(error, StateError::Contradicted { .. }), "{error}");
}

/// A localisation that is off by twice its white noise for tenths of a second: followed to its white noise, it would make a v_y of its own, and be taken for jumping.
#[test]
fn a_localisation_that_wanders_is_not_believed_to_its_white_noise() {
    for (length_s, v_mps) in [(12.0, 40.0), (40.0, 40.0), (40.0, 5.0)] {
        let wanders = Recorded {
            position_m: 0.009,
            heading_rad: 1e-3,
            delay_s: 0.0,
            jump: false,
            wander: 2.0,
            v_mps,
            length_s,
            ..LOCALISED
        };
        for seed in 0..3 {
            let (sequence, truth) = drive(wanders, seed);
            let smoothed = smooth(&sequence).unwrap();
            let (rms, inside) = judged(&smoothed, &truth);
            println!("{length_s} s at {v_mps} m/s: rms {rms:.4} inside {inside:.3} {:?}", smoothed.jumps_s);
            // By chance it seems to jump once.
            assert!(smoothed.jumps_s.len() < 2, "{:?}", smoothed.jumps_s);
            assert!(inside > 0.75, "{length_s} s at {v_mps} m/s: {inside}");
        }
    }
}
