use super::*;
use crate::test_car::TestCar;
use crate::{Channel, Drive, Model, Roll as _, SimulatorFile, candidates};

/// Effect, size and interval.
type Named = (String, f64, f64, f64);

fn found(changed: &[(usize, f64)], seed: u64) -> (Vec<Named>, usize, f64) {
    found_in(&TestCar::new(), changed, seed)
}

fn found_in(car: &TestCar, changed: &[(usize, f64)], seed: u64) -> (Vec<Named>, usize, f64) {
    let (sequence, commands) = car.recorded(changed, 40.0, seed);
    let file = SimulatorFile::parse("command: [none]", std::env::temp_dir().as_path()).unwrap();
    let drive = Drive::new(&sequence, commands, &[Channel::VYMps, Channel::YawRateRadps]).unwrap();
    let list = candidates(car.description(), &file, &drive.channels, true, &[]);
    let model = Model::new(car, &file, &drive, &list, true);
    let fitter = Fitter::new(&model);
    let found = fitter.search(&mut |_| ()).unwrap();
    let sizes = found.fit.as_ref().map(|f| f.sizes.clone()).unwrap_or_default();
    let named = sizes.iter().map(|s| (list[s.candidate].name.clone(), s.value, s.low, s.high)).collect();
    let left = found.state().held_out(&fitter.layout);
    (named, car.passes(), left)
}
#[test]
fn one_change_is_found_with_its_size() {
    for (name, place, value) in [
        ("simulator.c_front", 0, 48.0),
        ("simulator.grip", 2, 7.0),
        ("simulator.inertia", 3, 13.0),
        ("simulator.delay_steps", 4, 8.0),
        ("simulator.rate", 5, 0.4),
    ] {
        for seed in 1..=2 {
            let (named, passes, left) = found(&[(place, value)], seed);
            assert_eq!(named.len(), 1, "{name} {seed}: {named:?}");
            assert_eq!(named[0].0, name);
            // A count is a whole one, on the way and at the end.
            let accuracy = if name == "simulator.delay_steps" { 1e-9 } else { 0.03 * value };
            assert!((named[0].1 - value).abs() < accuracy && left.is_finite(), "{named:?} {left}");
            assert!(passes < 300, "{passes}");
        }
    }
}

#[test]
fn a_ratio_is_told_from_the_tires_that_imitate_it() {
    for (gain, c_front) in [(0.5, 60.0), (0.5, 48.0), (0.62, 48.0)] {
        let mut car = TestCar::new();
        car.steering_gain = gain;
        let (named, passes, _) = found_in(&car, &[(0, c_front)], 3);
        let of = |name: &str| named.iter().find(|n| n.0 == name).map(|n| n.1);
        let ratio = of("steering_gain").unwrap_or_else(|| panic!("{gain} {c_front}: {named:?}"));
        assert!((ratio + 1.0 - gain).abs() < 0.01, "{gain} {c_front}: {named:?}");
        let changed = (c_front - 60.0).abs() > 1e-9;
        assert_eq!(named.len(), 1 + usize::from(changed), "{gain} {c_front}: {named:?}");
        assert!(!changed || of("simulator.c_front").is_some_and(|c| (c - c_front).abs() < 1.0), "{named:?}");
        assert!(passes < 300, "{passes}");
    }
}

#[test]
fn a_grip_that_shows_only_where_it_is_reached_is_found() {
    for (grip, seed) in [(4.0, 1), (5.0, 2), (6.0, 3)] {
        let mut car = TestCar::new();
        car.clips = true;
        let (named, passes, _) = found_in(&car, &[(2, grip)], seed);
        assert_eq!(named.len(), 1, "{grip} {seed}: {named:?}");
        assert!(named[0].0 == "simulator.grip" && (named[0].1 - grip).abs() < 0.01 * grip, "{named:?}");
        assert!(passes < 300, "{passes}");
    }
}

#[test]
fn derivatives_that_are_known_are_not_asked_for_again() {
    let car = TestCar::new();
    let (sequence, commands) = car.recorded(&[(0, 48.0)], 20.0, 5);
    let file = SimulatorFile::parse("command: [none]", std::env::temp_dir().as_path()).unwrap();
    let drive = Drive::new(&sequence, commands, &[Channel::VYMps, Channel::YawRateRadps]).unwrap();
    let list = candidates(car.description(), &file, &drive.channels, true, &[]);
    let model = Model::new(&car, &file, &drive, &list, true);
    let fitter = Fitter::new(&model);
    let mut found = Found::new(fitter.at(model.null()).unwrap());
    fitter.derivatives(&mut found, &[0, 1]).unwrap();
    let (before, known) = (car.passes(), found.columns.clone());
    let state = fitter.derivatives(&mut found, &[1, 0]).unwrap();
    assert_eq!((car.passes(), &found.columns), (before, &known));
    fitter.derivatives(&mut found, &[0, 2]).unwrap();
    assert_eq!(car.passes(), before + 1);
    // The same as all at once.
    let all = fitter.around(state.point, Some(state.residuals), &[0, 1, 2]).unwrap().1;
    assert_eq!(all, found.columns[..3]);
    // Elsewhere nothing is known.
    found.null.point.values[0] *= 0.9;
    let passes = car.passes();
    fitter.derivatives(&mut found, &[0]).unwrap();
    assert!(car.passes() > passes && found.columns[0] != known[0]);
}

#[test]
fn no_change_is_none() {
    for seed in 1..=6 {
        let (named, _, _) = found(&[], seed);
        assert!(named.is_empty(), "{named:?}");
    }
}

#[test]
fn two_changes_are_both_found() {
    let (named, passes, _) = found(&[(0, 48.0), (4, 6.0)], 3);
    let names: Vec<&str> = named.iter().map(|n| n.0.as_str()).collect();
    assert!(names.contains(&"simulator.c_front") && names.contains(&"simulator.delay_steps"), "{names:?}");
    assert!(passes < 300, "{passes}");
}

#[test]
fn a_fit_that_is_stopped_on_its_way_says_so_and_goes_on() {
    let car = TestCar::new();
    let (sequence, commands) = car.recorded(&[(2, 6.0)], 40.0, 4);
    let file = SimulatorFile::parse("command: [none]", std::env::temp_dir().as_path()).unwrap();
    let drive = Drive::new(&sequence, commands, &[Channel::VYMps, Channel::YawRateRadps]).unwrap();
    let list = candidates(car.description(), &file, &drive.channels, true, &[]);
    let grip = list.iter().position(|c| c.name == "simulator.grip").unwrap();
    let model = Model::new(&car, &file, &drive, &list, true);
    let fitter = Fitter::new(&model);
    let (state, columns) = fitter.around(model.null(), None, &[grip]).unwrap();
    let stopped = fitter.fit(&state, &[grip], columns, 1).unwrap();
    assert!(!stopped.is_settled);
    let on = fitter.fit(&stopped.state, &[grip], stopped.columns.clone(), STEPS).unwrap();
    assert!(on.is_settled && (on.sizes[0].value - 6.0).abs() < 0.1, "{:?}", on.sizes);
    assert!(on.state.training(&fitter.layout) < stopped.state.training(&fitter.layout));
}

#[test]
fn held_out_windows_that_lose_count_against_a_name_and_a_clear_loss_forbids_it() {
    assert!(stands(1.0, 5.0) && stands(1.0, -0.5) && stands(1000.0, -5.0));
    assert!(!stands(-1.0, 50.0) && !stands(1.0, -1.5) && !stands(1000.0, -7.0));
}
