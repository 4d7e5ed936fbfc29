//! Recorded cars: what can be said of them, and what cannot.

#![allow(clippy::unwrap_used)]

use gripsight_identification::{Config, FrictionPrior, Outcome, ResidualKind, Status, Usable, identify};
use gripsight_signals::StateSequence;
use gripsight_vehicle::VehicleParameters;

use crate::support::{demo, recorded};

fn run(
    sequence: &StateSequence,
    vehicle: &VehicleParameters,
    mu: Option<f64>,
    residual: ResidualKind,
) -> Outcome {
    let config = Config { residual, ..Config::default() };
    let prior = mu.map(|mu| FrictionPrior { mu, sigma: 0.1 });
    identify(sequence, vehicle, prior, None, &config, &mut |_| {}).unwrap()
}

#[test]
fn the_small_car_shows_its_plateau_and_gives_the_same_bytes_twice() {
    let Some((sequence, vehicle)) = recorded("rc10_mocap", 60.0) else { return };
    let outcome = run(&sequence, &vehicle, None, ResidualKind::S4);
    assert!(outcome.phi_p.is_finite());
    for name in &outcome.on_bound {
        assert!(
            outcome.reasons.iter().any(|r| r.contains(name)),
            "{name} is on a bound and no reason says so"
        );
    }
    // The plateau of the car is 0.45 to 0.5 g; the front tires limit it. The rear ones are driven to 14 degrees and still rise.
    assert_eq!(outcome.status, Status::AcceptedWithin, "{:?}", outcome.reasons);
    for axle in [outcome.phi_p.front, outcome.phi_p.rear] {
        // A minute promises the lower end of it.
        assert!((0.36..0.51).contains(&axle.d), "promised {axle:?}");
    }
    let peak = &outcome.peak_friction.front;
    assert!(peak.reached && (0.4..0.6).contains(&peak.value), "{peak:?}");
    // Motion capture sees a late command: 80 ms by its authors, servo and transport together.
    assert!((0.03..0.1).contains(&outcome.signals.steering_delay_s), "{:?}", outcome.signals);
    assert!(outcome.rmse.rollout.after < 0.6 * outcome.rmse.rollout.before);
    let again = run(&sequence, &vehicle, None, ResidualKind::S4);
    assert_eq!(serde_json::to_string(&outcome).unwrap(), serde_json::to_string(&again).unwrap());
}

#[test]
fn the_indy_car_has_stiffness_but_no_peak() {
    let Some((sequence, vehicle)) = recorded("iac_putnam", f64::INFINITY) else { return };
    let alone = run(&sequence, &vehicle, None, ResidualKind::None);
    // Usable for what was driven: half a g.
    assert_eq!(alone.status, Status::AcceptedWithin, "{:?}", alone.reasons);
    assert!(!alone.peak_friction.front.reached && !alone.peak_friction.rear.reached);
    assert!(alone.phi_p.front.d < 0.55 && alone.phi_p.rear.d < 0.55, "{:?}", alone.phi_p);
    assert!(alone.reasons.iter().any(|r| r.contains("peak not reached")), "{:?}", alone.reasons);
    for stiffness in [alone.cornering_stiffness_n_per_rad.front, alone.cornering_stiffness_n_per_rad.rear] {
        assert!(stiffness.low > 0.0 && stiffness.low < stiffness.value && stiffness.value < stiffness.high);
    }
    // What is known of the recording: v_y is that of a point half a metre ahead of the centre of gravity, 0.15 m/s too high.
    let signals = &alone.signal_intervals;
    assert!((signals.v_y_lever_arm_m.low..signals.v_y_lever_arm_m.high).contains(&0.5), "{signals:?}");
    assert!((signals.v_y_bias_mps.low..signals.v_y_bias_mps.high).contains(&0.15), "{signals:?}");
    assert!(alone.reasons.iter().any(|r| r.contains("later than a steering")), "{:?}", alone.reasons);
    let with_prior = run(&sequence, &vehicle, Some(1.0), ResidualKind::None);
    // A prior adds a set and changes nothing of what the data alone say.
    assert_eq!((alone.phi_p, alone.status), (with_prior.phi_p, with_prior.status));
    let provisional = with_prior.provisional.unwrap();
    for (peak, d) in [
        (provisional.peak_friction.front, provisional.phi_p.front.d),
        (provisional.peak_friction.rear, provisional.phi_p.rear.d),
    ] {
        assert!(peak.from_prior && !peak.reached);
        // A soft bound: D is the prior's within what lies between a road and an axle.
        assert_eq!(peak.value, d);
        assert!((d - 1.0).abs() < 0.1 && peak.low < 1.0 && 1.0 < peak.high, "{peak:?}");
    }
}

#[test]
fn a_prior_that_contradicts_the_small_cars_plateau_is_not_believed() {
    let Some((sequence, vehicle)) = recorded("rc10_mocap", 60.0) else { return };
    // The plateau is at 0.45 to 0.5.
    let outcome = run(&sequence, &vehicle, Some(1.0), ResidualKind::None);
    assert!(outcome.provisional.is_none(), "{:?}", outcome.provisional);
    assert!(outcome.reasons.iter().any(|r| r.contains("contradicts")), "{:?}", outcome.reasons);
    assert!(outcome.accepted && outcome.phi_p.front.d < 0.51, "{:?} {:?}", outcome.phi_p, outcome.reasons);
}

#[test]
fn no_part_of_the_indy_cars_laps_shows_a_peak() {
    let Some((sequence, vehicle)) = recorded("iac_putnam", 60.0) else { return };
    let outcome = run(&sequence, &vehicle, None, ResidualKind::None);
    assert!(!outcome.peak_friction.front.reached && !outcome.peak_friction.rear.reached);
    for stiffness in [outcome.cornering_stiffness_n_per_rad.front, outcome.cornering_stiffness_n_per_rad.rear]
    {
        assert!(stiffness.low < stiffness.value && stiffness.value < stiffness.high, "{stiffness:?}");
    }
    assert!(outcome.signals.v_y_lever_arm_m < vehicle.l_f_m, "{:?}", outcome.signals);
}

#[test]
fn a_v_y_that_was_made_of_the_poses_is_named_and_replaced() {
    let Some((sequence, vehicle)) = recorded("f1tenth_ds5", f64::INFINITY) else { return };
    let outcome = run(&sequence, &vehicle, None, ResidualKind::None);
    let estimated = outcome.recorded.estimated.as_ref().unwrap();
    let channels: Vec<_> = estimated.channels.iter().map(|c| c.channel).collect();
    // The recorded one scatters by 0.1 m/s.
    assert!(channels == ["v_y_mps"] && estimated.channels[0].sigma < 0.05, "{estimated:?}");
    // A tenth of it, if that.
    let said = |r: &String| {
        r.contains("its change is 0.0") && r.contains("times what the accelerations leave for it")
    };
    assert!(outcome.reasons.iter().any(said), "{:?}", outcome.reasons);
    // No more than the car turned with.
    let held = sequence.v_x_mps.iter().zip(&sequence.yaw_rate_radps).map(|(v, r)| (v * r).abs());
    let most_g = f64::from(held.fold(0.0, f32::max)) / 9.81;
    assert!(outcome.accepted && outcome.phi_p.front.d < most_g, "{:?} {most_g}", outcome.reasons);
}

#[test]
fn a_prior_makes_a_set_beside_the_one_that_the_drive_shows() {
    // The front tires stay just below their peak, D = 1.02.
    let (sequence, vehicle) = demo("demo_race_car");
    let with = |mu: Option<f64>| run(&sequence, &vehicle, mu, ResidualKind::None);
    let alone = with(None);
    assert!(alone.accepted && alone.provisional.is_none(), "{:?}", alone.reasons);
    for mu in [0.7, 0.95, 1.0, 1.1, 1.6] {
        let outcome = with(Some(mu));
        assert_eq!((outcome.phi_p, outcome.status), (alone.phi_p, alone.status), "{mu}");
        // What was shown is a lower bound.
        if let Some(set) = outcome.provisional {
            let shown = alone.found.front.max_force_within(outcome.slip_range_rad.front.high);
            assert!(set.phi_p.front.d > 0.97 * shown, "{mu}: {set:?}, shown {shown}");
        }
    }
}

/// Motion capture fails for tenths of a second here and there, and the accelerations are made of its poses.
#[test]
fn the_small_cars_poses_give_the_v_y_that_was_taken_away() {
    let Some((sequence, vehicle)) = recorded("rc10_mocap", f64::INFINITY) else { return };
    let mut without = sequence.clone();
    without.v_y_mps.fill(0.0);
    let usable = Usable::of(&without, &vehicle).unwrap();
    assert!(usable.recorded.objections.is_empty(), "{:?}", usable.recorded.objections);
    let mut errors: Vec<f64> = Vec::new();
    let mut at = 0;
    for (t, v_y) in usable.sequence.time_s.iter().zip(&usable.sequence.v_y_mps) {
        at += sequence.time_s[at..].partition_point(|s| s < t);
        errors.push(f64::from(v_y - sequence.v_y_mps[at]).abs());
    }
    errors.sort_unstable_by(f64::total_cmp);
    assert!(errors.len() as f64 > 0.95 * sequence.len() as f64);
    // Of slips of 27 degrees, at 1.7 m/s.
    let (usual, large) = (errors[errors.len() / 2], errors[errors.len() * 99 / 100]);
    assert!(usual < 0.01 && large < 0.05, "off by {usual:.4} usually, by {large:.4} one time in a hundred");
    // What poses and gyroscope agree on is hardly in doubt; the wheels' angle is.
    let doubt = usable.recorded.doubt;
    assert!(doubt.v_x_scale < 0.02 && doubt.yaw_rate_scale < 0.02, "{doubt:?}");
    assert!(doubt.steering_gain > 0.05, "{doubt:?}");
}
