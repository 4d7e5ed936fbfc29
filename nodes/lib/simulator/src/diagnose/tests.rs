use super::*;
use crate::test_car::TestCar;

fn diagnosed(car: &TestCar, changed: &[(usize, f64)], file: &str, seed: u64) -> SimulatorDiagnosis {
    let simulator = TestCar::new();
    let (sequence, commands) = car.recorded(changed, 40.0, seed);
    let file = SimulatorFile::parse(file, std::env::temp_dir().as_path()).unwrap();
    let question = Question { file: &file, sequence: &sequence, commands, without: &[] };
    diagnose(&simulator, &question, &mut |_| ()).unwrap()
}

/// The one size of a named effect.
fn size(d: &SimulatorDiagnosis, name: &str) -> Sized {
    let named = d.effects.iter().find(|e| e.accepted && e.name == name);
    let names: Vec<&str> = d.effects.iter().filter(|e| e.accepted).map(|e| e.name.as_str()).collect();
    named
        .unwrap_or_else(|| panic!("{name} is not among {names:?}"))
        .parameters
        .values()
        .next()
        .unwrap()
        .clone()
}

/// A team whose gain is 0.5 on the car and 1.0 in the simulator, on a car that understeers more, too.
#[test]
fn a_halved_gain_and_softer_front_tires_are_told_apart_in_one_go() {
    let mut car = TestCar::new();
    car.steering_gain = 0.5;
    for (seed, file, unit) in [
        (1, "command: [none]", None),
        (2, "command: [none]\nunit_ratios: {half steps: 0.5}", Some("half steps")),
    ] {
        let d = diagnosed(&car, &[(0, 46.0)], file, seed);
        let (gain, front) = (size(&d, "steering_gain"), size(&d, "simulator.c_front"));
        assert_eq!(d.verdict, Verdict::Effects);
        assert!((gain.value + 0.5).abs() < 0.01 && (front.value - 46.0).abs() < 1.0, "{gain:?} {front:?}");
        // The figures that decide: each one's size over its standard error is far beyond what a name needs.
        let decided = d
            .reasons
            .iter()
            .filter(|r| matches!(r, Reason::Taken { wald, needed, .. } if *wald > 5.0 * needed));
        assert_eq!(decided.count(), 2, "{:?}", d.reasons);
        // A gain of a half is no unit error unless somebody says that it is one.
        let told = d.effects.iter().find_map(|e| e.unit_error.as_ref()).map(|u| u.name.as_str());
        assert_eq!(told, unit);
    }
}

#[test]
fn what_no_parameter_imitates_is_called_missing_structure() {
    let mut car = TestCar::new();
    car.relaxation_m = 0.05;
    for seed in [1, 3] {
        let d = diagnosed(&car, &[], "command: [none]", seed);
        assert_eq!(d.verdict, Verdict::MissingStructure, "{:?}", d.reasons);
        assert!(d.missing.iter().any(|m| m.name == "tire_relaxation"), "{:?}", d.missing);
    }
}

/// With tires this slow the car turns round once: a few blocks hold the whole gap.
#[test]
fn a_gap_that_few_blocks_hold_is_no_agreement() {
    let mut car = TestCar::new();
    car.relaxation_m = 0.2;
    let d = diagnosed(&car, &[], "command: [none]", 1);
    assert!(d.gap.nominal.value > 5.0 && d.gap.nominal.low < NO_GAP, "{:?}", d.gap.nominal);
    assert_ne!(d.verdict, Verdict::NoGap);
}
