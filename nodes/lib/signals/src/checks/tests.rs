//! A car that weaves, with everything recorded, and one signal that lies.

use super::*;

const N: usize = 4000;

/// 40 s at 100 Hz: speed and yaw rate wander, v_y lags behind a_y as a tire's does; poses by integration.
fn honest() -> StateSequence {
    let dt = 0.01;
    let mut s = StateSequence { time_s: (0..N).map(|k| k as f32 * 0.01).collect(), ..Default::default() };
    let (mut x, mut y, mut yaw) = (0.0_f64, 0.0_f64, 0.0_f64);
    let noise = |k: usize, n: f64| ((k as f64 * 12.9898 + n).sin() * 43_758.547).fract() * 0.01;
    let slip = |t: f64| 0.2 * (1.7 * t - 0.4).sin() * (0.13 * t).cos() + 0.15 * (0.9 * t).sin();
    for k in 0..N {
        let t = k as f64 * dt;
        let (v, r) = (5.0 + (0.4 * t).sin(), 1.2 * (1.7 * t).sin() * (0.13 * t).cos());
        let v_y = slip(t);
        let change = (slip(t + 1e-4) - slip(t - 1e-4)) / 2e-4;
        s.v_x_mps.push((v + noise(k, 1.0)) as f32);
        s.v_y_mps.push((v_y + noise(k, 2.0)) as f32);
        s.yaw_rate_radps.push((r + noise(k, 3.0)) as f32);
        s.gyro_yaw_rate_radps.push((r + noise(k, 4.0)) as f32);
        s.a_y_mps2.push((v * r + change + 5.0 * noise(k, 5.0)) as f32);
        s.a_x_mps2.push((0.4 * (0.4 * t).cos() - v_y * r + 5.0 * noise(k, 6.0)) as f32);
        s.steering_rad.push((0.06 * r) as f32);
        s.x_m.push((x + noise(k, 7.0)) as f32);
        s.y_m.push((y + noise(k, 8.0)) as f32);
        s.yaw_rad.push((yaw + noise(k, 9.0)) as f32);
        // The middle of the step: half a step of lag in the heading is as much sideways as a tenth of the slip.
        let middle = yaw + 0.5 * r * dt;
        x += (v * middle.cos() - v_y * middle.sin()) * dt;
        y += (v * middle.sin() + v_y * middle.cos()) * dt;
        yaw += r * dt;
    }
    s
}

fn with(change: impl Fn(&mut StateSequence)) -> Checks {
    let mut sequence = honest();
    change(&mut sequence);
    cross_check(&sequence).unwrap()
}

fn scaled(values: &mut [f32], by: f32) {
    values.iter_mut().for_each(|v| *v *= by);
}

#[test]
fn honest_signals_agree() {
    let all = with(|_| {});
    assert_eq!(all.checks.len(), 7);
    for check in &all.checks {
        assert!(!check.finding.disagrees(), "{check:?}");
    }
    assert_eq!(all.of(Pair::SpeedAndPose).unwrap().finding, Finding::Agrees);
    assert_eq!(all.unchecked.len(), 1, "{:?}", all.unchecked);
}

#[test]
fn scales_signs_and_units_are_named() {
    let speed = with(|s| scaled(&mut s.v_x_mps, 1.1));
    let Finding::Scale { factor } = speed.of(Pair::SpeedAndPose).unwrap().finding else {
        panic!("{speed:?}")
    };
    approx::assert_abs_diff_eq!(factor, 1.1, epsilon = 0.02);
    let kmh = with(|s| scaled(&mut s.v_x_mps, 3.6));
    assert_eq!(
        kmh.of(Pair::SpeedAndPose).unwrap().finding,
        Finding::Unit { signal: "v_x", probably: "km/h" }
    );
    let turned = with(|s| scaled(&mut s.yaw_rate_radps, -1.0));
    assert_eq!(turned.of(Pair::YawRateAndHeading).unwrap().finding, Finding::Sign);
    let degrees = with(|s| scaled(&mut s.gyro_yaw_rate_radps, 57.295_78));
    assert!(matches!(degrees.of(Pair::YawRateAndGyro).unwrap().finding, Finding::Unit { .. }));
    let g = with(|s| scaled(&mut s.a_y_mps2, 1.0 / 9.81));
    assert_eq!(
        g.of(Pair::LateralAccelerationAndMotion).unwrap().finding,
        Finding::Unit { signal: "a_y", probably: "g" }
    );
}

#[test]
fn a_dead_accelerometer_is_said_to_be_dead_and_does_not_speak_against_v_y() {
    let dead = with(|s| scaled(&mut s.a_y_mps2, 1e-4));
    let check = dead.of(Pair::LateralAccelerationAndMotion).unwrap();
    assert!(check.to_string().contains("a_y does not follow v_x times yaw rate"), "{check}");
    assert_eq!(dead.of(Pair::LateralSpeedAndAcceleration).unwrap().finding, Finding::NotTold);
    // Of another sensor, which is a tenth of it by chance and as a whole has nothing to do with it: in no unit.
    let other = with(|s| {
        let wave = |k: usize| 0.8 * (0.007 * k as f32).sin() + 0.6 * (0.0031 * k as f32).cos();
        (0..N).for_each(|k| s.a_y_mps2[k] = -0.1 * s.a_y_mps2[k] + wave(k));
    });
    let check = other.of(Pair::LateralAccelerationAndMotion).unwrap();
    assert!(!matches!(check.finding, Finding::Unit { .. }), "{check:?}");
}

#[test]
fn a_v_y_that_another_model_made_is_found_out() {
    // Tires 60 % too stiff inside an observer: the slip it gives is too small.
    let stiff = with(|s| scaled(&mut s.v_y_mps, 0.62));
    for pair in [Pair::LateralSpeedAndPose, Pair::LateralSpeedAndAcceleration] {
        let finding = stiff.of(pair).unwrap().finding;
        let Finding::NotMeasured { share } = finding else { panic!("{pair:?}: {finding:?}") };
        approx::assert_abs_diff_eq!(share, 0.62, epsilon = 0.08);
    }
}

#[test]
fn noise_of_single_samples_hides_no_v_y_that_another_model_made() {
    // A tenth of a metre a second, of a sideslip of 0.2: white, as an optical sensor's.
    let noisy = |share: f64| {
        let checks = with(|s| {
            for (k, v_y) in s.v_y_mps.iter_mut().enumerate() {
                let noise = 0.35 * ((k as f64 * 78.233).sin() * 43_758.547).fract();
                *v_y = (share * f64::from(*v_y) + noise) as f32;
            }
        });
        *checks.of(Pair::LateralSpeedAndAcceleration).unwrap()
    };
    let (honest, made) = (noisy(1.0), noisy(0.7));
    assert_eq!(honest.finding, Finding::Agrees, "{honest:?}");
    assert!(matches!(made.finding, Finding::NotMeasured { .. }), "{made:?}");
    assert!(honest.high - honest.low < 0.3, "{honest:?}");
}

#[test]
fn jumps_of_the_localisation_and_outliers_do_not_bend_the_slope() {
    let jumping = with(|s| {
        for (n, k) in [500, 1100, 1700, 2300, 2900].into_iter().enumerate() {
            s.yaw_rad[k..].iter_mut().for_each(|v| *v += if n % 2 == 0 { 0.4 } else { -0.3 });
            s.x_m[k..].iter_mut().for_each(|v| *v += 0.5);
        }
    });
    assert_eq!(jumping.of(Pair::YawRateAndHeading).unwrap().finding, Finding::Agrees);
    assert_eq!(jumping.of(Pair::SpeedAndPose).unwrap().finding, Finding::Agrees);
}

#[test]
fn what_nothing_recorded_checks_is_listed() {
    let bare = with(|s| {
        for channel in [
            &mut s.x_m,
            &mut s.y_m,
            &mut s.yaw_rad,
            &mut s.a_x_mps2,
            &mut s.a_y_mps2,
            &mut s.gyro_yaw_rate_radps,
        ] {
            channel.clear();
        }
    });
    let signals: Vec<&str> = bare.unchecked.iter().map(|u| u.signal).collect();
    assert_eq!(signals, ["yaw_rate_radps", "v_x_mps", "v_y_mps", "steering_rad"]);
}

#[test]
fn a_v_y_of_another_point_is_measured_all_the_same() {
    let ahead = with(|s| {
        for k in 0..N {
            s.v_y_mps[k] += 0.5 * s.yaw_rate_radps[k];
        }
    });
    for pair in [Pair::LateralSpeedAndPose, Pair::LateralSpeedAndAcceleration] {
        assert_eq!(ahead.of(pair).unwrap().finding, Finding::Agrees, "{ahead:?}");
    }
}

#[test]
fn a_body_that_rolls_does_not_speak_against_v_y() {
    let rolling = with(|s| scaled(&mut s.a_y_mps2, 1.06));
    let share = rolling.of(Pair::LateralSpeedAndAcceleration).unwrap();
    assert_eq!(share.finding, Finding::Agrees, "{share:?}");
    assert!(rolling.of(Pair::LateralAccelerationAndMotion).unwrap().finding.disagrees());
}

#[test]
fn a_banked_road_does_not_speak_against_v_y_where_the_steering_moves_both_alike() {
    let banked = |s: &mut StateSequence, steers: f32| {
        for k in 0..N {
            let t = k as f32 * 0.01;
            s.steering_rad[k] += steers * s.v_y_mps[k];
            s.a_y_mps2[k] += 0.1 * (2.9 * t + (0.3 * t).sin()).sin() + 0.1 * (4.1 * t).cos();
        }
    };
    let pair = Pair::LateralSpeedAndAcceleration;
    let told = with(|s| banked(s, 0.3));
    assert_eq!(told.of(pair).unwrap().finding, Finding::Agrees, "{told:?}");
    // Steering that moves nothing of its own tells nothing, and a v_y that is too small stays so.
    let untold = with(|s| banked(s, 0.0));
    assert!(untold.of(pair).unwrap().finding.disagrees(), "{untold:?}");
    let stiff = with(|s| {
        banked(s, 0.3);
        scaled(&mut s.v_y_mps, 0.62);
    });
    assert!(stiff.of(pair).unwrap().finding.disagrees(), "{stiff:?}");
}

#[test]
fn a_late_localisation_agrees() {
    let mut late = honest();
    late.pose_time_s = late.time_s.iter().step_by(3).map(|t| t + 0.06).collect();
    late.pose_x_m = late.x_m.drain(..).step_by(3).collect();
    late.pose_y_m = late.y_m.drain(..).step_by(3).collect();
    late.pose_yaw_rad = late.yaw_rad.drain(..).step_by(3).collect();
    let all = cross_check(&late).unwrap();
    for pair in [Pair::YawRateAndHeading, Pair::SpeedAndPose, Pair::LateralSpeedAndPose] {
        assert_eq!(all.of(pair).unwrap().finding, Finding::Agrees, "{all:?}");
    }
}

#[test]
fn a_pose_that_is_counted_together_from_the_speeds_checks_nothing() {
    let mut counted = honest();
    let (mut x, mut y) = (0.0_f64, 0.0_f64);
    for k in 0..N {
        (counted.x_m[k], counted.y_m[k]) = (x as f32, y as f32);
        let (v_x, v_y) = (f64::from(counted.v_x_mps[k]), f64::from(counted.v_y_mps[k]));
        let (sin, cos) = f64::from(counted.yaw_rad[k]).sin_cos();
        x += 0.01 * (v_x * cos - v_y * sin);
        y += 0.01 * (v_x * sin + v_y * cos);
    }
    let all = cross_check(&counted).unwrap();
    assert_eq!(all.of(Pair::SpeedAndPose).unwrap().finding, Finding::SameSource);
    assert!(all.unchecked.iter().any(|u| u.signal == "v_x_mps"));
}

#[test]
fn steering_in_degrees_and_turned_is_told_by_the_curves() {
    let of = |by: f32| {
        let mut sequence = honest();
        scaled(&mut sequence.steering_rad, by);
        steering_check(&sequence, 0.33).unwrap().unwrap().finding
    };
    assert_eq!(of(1.0), Finding::Agrees);
    assert_eq!(of(-1.0), Finding::Sign);
    assert_eq!(of(57.295_78), Finding::Unit { signal: "steering", probably: "deg" });
    // In degrees, a gentle drive never has an angle beyond what wheels turn in radians.
    let mut gentle = honest();
    scaled(&mut gentle.yaw_rate_radps, 0.15);
    scaled(&mut gentle.steering_rad, 0.15 * 57.295_78);
    assert!(gentle.steering_rad.iter().all(|d| d.abs() < 0.8));
    let check = steering_check(&gentle, 0.33).unwrap().unwrap();
    assert_eq!(check.finding, Finding::Unit { signal: "steering", probably: "deg" }, "{check:?}");
    // Ten times the angle of its curves, and never more than wheels turn: a car that is carried out of them.
    let check = steering_check(
        &StateSequence { steering_rad: honest().steering_rad.iter().map(|d| 11.0 * d).collect(), ..honest() },
        0.33,
    );
    let check = check.unwrap().unwrap();
    assert!(check.ratio > 9.6 && check.finding == Finding::NotTold, "{check:?}");
}

#[test]
fn a_v_y_that_goes_its_own_way_is_not_measured_whatever_its_share() {
    let wave = |per: f64| (0..300).map(|k| (per * f64::from(k)).sin()).collect::<Vec<_>>();
    let (known, turning, own) = (wave(0.31), wave(0.17), wave(0.53));
    let reported = |share: f64| known.iter().zip(&own).map(|(k, o)| k + share * o).collect::<Vec<_>>();
    let finding = |share| lateral_speed_check(&reported(share), &known, &turning, 0.01).finding;
    assert_eq!(finding(0.1), Finding::Agrees);
    assert!(matches!(finding(0.3), Finding::NotMeasured { .. }));
    // Where it is not known better than that, nothing is said against it.
    let unsure = lateral_speed_check(&reported(0.3), &known, &turning, 0.2).finding;
    assert!(!unsure.disagrees(), "{unsure:?}");
}
