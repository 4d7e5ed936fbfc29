//! A road whose friction changes while the car is watched.

use gripsight_identification::{
    Config, Floors, FrictionPrior, Monitor, PerAxle, ResidualKind, Status, identify, identify_floors,
};
use gripsight_reference_car::Friction;
use gripsight_signals::StateSequence;

use crate::support::{drive, scenario, with_background};

#[test]
fn after_a_change_of_grip_the_new_road_is_identified_and_accepted_though_its_peak_is_not_reached() {
    let config = Config { residual: ResidualKind::None, ..Config::default() };
    let on = |friction, seed| {
        drive(with_background(scenario("formula_student", "club", 0.7, 0.92, seed)).friction(friction))
    };
    let (_, sequence, vehicle) = on(Friction::Uniform { mu: 0.7 }, 41);
    let outcome = identify(&sequence, &vehicle, None, None, &config, &mut |_| {}).unwrap();
    let set = outcome.accepted_set().unwrap_or_else(|| panic!("{:?}", outcome.reasons));
    assert!(outcome.grip.is_none());
    // A peak measured anew stands in place of a higher one of before; what was only shown does not shrink in a slower lap.
    assert_eq!(outcome.status, Status::Accepted, "{:?}", outcome.reasons);
    let mut luckier = set.clone();
    (luckier.promised.front.d, luckier.promised.rear.d) =
        (1.05 * set.promised.front.d, 1.05 * set.promised.rear.d);
    assert!(outcome.replaces(Some(&luckier)));
    luckier.status = Status::AcceptedWithin;
    assert!(!outcome.replaces(Some(&luckier)));

    let (_, changing, _) = on(Friction::Changing { mu: 0.7, mu_after: 0.9, at_s: 14.0, over_s: 0.1 }, 43);
    let next = identify(&changing, &vehicle, None, Some(&set), &config, &mut |_| {}).unwrap();
    let grip = next.grip.clone().unwrap();
    let since_s = (grip.since_ns - changing.start_stamp_ns) as f64 * 1e-9;
    assert!(grip.changed && (since_s - 14.0).abs() < 2.0, "{since_s} s: {grip:?}");
    assert!(next.accepted && next.reasons[0].starts_with("the grip has changed"), "{:?}", next.reasons);
    // The new road's set promises what was shown on it; the old curves' shape says where its peak lies.
    assert!(next.replaces(Some(&set)));
    let provisional = next.provisional.unwrap_or_else(|| panic!("{:?}", next.reasons));
    let PerAxle { front, rear } = provisional.peak_friction;
    for (now, before) in [(front.value, set.phi_p.front.d), (rear.value, set.phi_p.rear.d)] {
        approx::assert_relative_eq!(now / before, 0.9 / 0.7, max_relative = 0.08);
    }

    let (_, same, _) = on(Friction::Uniform { mu: 0.7 }, 45);
    let again = identify(&same, &vehicle, None, Some(&set), &config, &mut |_| {}).unwrap();
    assert!(!again.grip.unwrap().changed && again.prior.is_none());
}

#[test]
fn two_floors_in_one_drive_are_not_averaged() {
    let config = Config { residual: ResidualKind::None, ..Config::default() };
    let on = |mu, friction, pace| {
        let drive_on = scenario("f1tenth", "esses", mu, pace, 2).friction(friction).duration(40.0);
        let (_, sequence, vehicle) = drive(with_background(drive_on));
        identify(&sequence, &vehicle, None, None, &config, &mut |_| {}).unwrap()
    };
    for (mu, mu_after, pace) in [(0.4, 0.85, 0.9), (0.6, 0.42, 0.63)] {
        let both = on(mu, Friction::Changing { mu, mu_after, at_s: 20.0, over_s: 1.0 }, pace);
        let reason = both.reasons.iter().find(|r| r.starts_with("the grip changed"));
        let reason = reason.unwrap_or_else(|| panic!("{:?}", both.reasons));
        let at_s: f64 = reason.split_whitespace().nth(3).unwrap().parse().unwrap();
        assert!(!both.accepted && (at_s - 20.0).abs() < 2.0, "{reason}");
        let one = on(mu, Friction::Uniform { mu }, pace);
        assert!(one.accepted, "{:?}", one.reasons);
    }
}

#[test]
fn each_floor_of_a_drive_is_identified_by_itself() {
    let config = Config { residual: ResidualKind::None, ..Config::default() };
    let on = |friction| {
        let drive_on = scenario("f1tenth", "esses", 0.4, 0.9, 2).friction(friction).duration(40.0);
        let (_, sequence, vehicle) = drive(with_background(drive_on));
        let prior = |part: &StateSequence| {
            let mu =
                if part.duration_s() < 30.0 && part.start_stamp_ns > 19_000_000_000 { 0.85 } else { 0.4 };
            Some(FrictionPrior { mu, sigma: 0.1 })
        };
        identify_floors(&sequence, &vehicle, &prior, None, &config, &mut |_| {}).unwrap()
    };
    let Floors { parts, changes } =
        on(Friction::Changing { mu: 0.4, mu_after: 0.85, at_s: 20.0, over_s: 1.0 });
    let [change] = changes[..] else { panic!("{changes:?}") };
    assert!((change.at_s - 20.0).abs() < 2.0, "{change}");
    let [before, after] = &parts[..] else { panic!("{} parts", parts.len()) };
    assert!(before.sequence.duration_s() < 20.5 && after.sequence.start_stamp_ns > 20_000_000_000);
    for (part, mu) in [(before, 0.4), (after, 0.85)] {
        let outcome = &part.outcome;
        assert!(outcome.accepted && outcome.grip_change.is_none(), "{:?}", outcome.reasons);
        assert_eq!(outcome.prior.map(|p| p.mu), Some(mu));
        assert!(outcome.phi_p.front.d < mu && outcome.phi_p.rear.d < 1.05 * mu, "{:?}", outcome.phi_p);
    }
    assert!(after.outcome.found.front.d > 1.2 * before.outcome.found.front.d);

    let same = on(Friction::Uniform { mu: 0.4 });
    assert!(same.changes.is_empty() && same.parts.len() == 1);
}

#[test]
fn a_car_that_is_driven_harder_has_not_changed_its_grip() {
    let config = Config { residual: ResidualKind::None, ..Config::default() };
    let mut watched = 0;
    for (car, track, mu, seed) in [
        ("passenger_car", "clover", 0.9, 5),
        ("formula_student", "club", 0.9, 5),
        ("race_car", "bean", 0.8, 7),
        ("f1tenth", "esses", 0.9, 7),
    ] {
        let on = |pace, duration_s, seed| {
            drive(with_background(scenario(car, track, mu, pace, seed)).duration(duration_s))
        };
        let (_, hard, vehicle) = on(0.9, 25.0, seed + 2);
        for pace in [0.3, 0.4] {
            let (_, gentle, _) = on(pace, 12.0, seed);
            let outcome = identify(&gentle, &vehicle, None, None, &config, &mut |_| {}).unwrap();
            let Some(set) = outcome.accepted_set() else { continue };
            let look = Monitor::new(&vehicle, &set).unwrap().look(&hard).unwrap();
            assert!(!look.changed, "{car} at {pace}: {:?}", look.notice(&set));
            watched += 1;
        }
    }
    assert!(watched >= 6, "{watched}");
}
