//! Recorded cars: what can be said of them, and what cannot.

#![allow(clippy::unwrap_used)]

use gripsight_identification::{Config, FrictionPrior, Outcome, ResidualKind, identify};
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
    // The plateau of the car is 0.45 to 0.5 g; the front tires limit it.
    let front = outcome.phi_p.front.max_force_within(outcome.slip_range_rad.front.high);
    assert!((0.4..0.6).contains(&front), "front plateau {front}");
    let peak = &outcome.peak_friction.front;
    assert!((0.4..0.6).contains(&peak.value), "{peak:?}");
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
    assert!(!alone.accepted && !alone.peak_friction.front.reached && !alone.peak_friction.rear.reached);
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
    // A prior for the peak does not mend what a lag of 0.3 s does to the stiffnesses.
    assert!(!with_prior.accepted, "{:?}", with_prior.reasons);
    assert!(
        with_prior.reasons.iter().any(|r| r.contains("later than a steering")),
        "{:?}",
        with_prior.reasons
    );
    for (peak, d) in [
        (with_prior.peak_friction.front, with_prior.phi_p.front.d),
        (with_prior.peak_friction.rear, with_prior.phi_p.rear.d),
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
    assert!(!outcome.accepted, "{:?}", outcome.reasons);
    assert!(outcome.reasons.iter().any(|r| r.contains("contradicts")), "{:?}", outcome.reasons);
}

#[test]
fn no_part_of_the_indy_cars_laps_shows_a_peak() {
    let Some((sequence, vehicle)) = recorded("iac_putnam", 60.0) else { return };
    let outcome = run(&sequence, &vehicle, None, ResidualKind::None);
    assert!(!outcome.accepted && !outcome.peak_friction.front.reached && !outcome.peak_friction.rear.reached);
    for stiffness in [outcome.cornering_stiffness_n_per_rad.front, outcome.cornering_stiffness_n_per_rad.rear]
    {
        assert!(stiffness.low < stiffness.value && stiffness.value < stiffness.high, "{stiffness:?}");
    }
    assert!(outcome.signals.v_y_lever_arm_m < vehicle.l_f_m, "{:?}", outcome.signals);
}

#[test]
fn a_poor_v_y_is_named() {
    let Some((sequence, vehicle)) = recorded("f1tenth_ds5", f64::INFINITY) else { return };
    let outcome = run(&sequence, &vehicle, None, ResidualKind::None);
    assert!(!outcome.accepted);
    assert!(outcome.reasons.iter().any(|r| r.starts_with("v_y scatters by 0.1")), "{:?}", outcome.reasons);
    assert!(outcome.drive_next.iter().any(|d| d.contains("v_y")));
}

#[test]
fn a_prior_counts_within_its_sigma_of_what_the_drive_shows_and_not_far_from_it() {
    // The front tires stay just below their peak, D = 1.02.
    let (sequence, vehicle) = demo("demo_race_car");
    let with = |mu: f64| run(&sequence, &vehicle, Some(mu), ResidualKind::None);
    for mu in [0.95, 1.0, 1.1] {
        let outcome = with(mu);
        let front = outcome.peak_friction.front;
        assert!(outcome.accepted && front.from_prior, "{mu}: {:?}", outcome.reasons);
        assert!((front.value - 1.02).abs() < 0.1, "{mu}: {front:?}");
    }
    for mu in [0.7, 1.6] {
        let Outcome { accepted, reasons, .. } = with(mu);
        let front = &reasons[0];
        assert!(!accepted && front.starts_with("front peak") && front.contains("prior"), "{mu}: {reasons:?}");
    }
}
