//! With every effect off, the single-track model must fit the car almost perfectly; with one on, it must not.

use gripsight_reference_car::{
    CAR_NAMES, CarParameters, Course, DriverKind, EffectSetting, Scenario, SensorSettings, Simulation,
};

use crate::oracle;

fn drive(car: &CarParameters, kind: DriverKind, pace: f64, effect: Option<&str>) -> ([f64; 2], [f64; 2]) {
    let course = Course::Track { name: "esses".to_owned(), reversed: false };
    let mut scenario = Scenario::new(car.clone())
        .course(course)
        .driver(kind, pace)
        .dither(0.15 * 9.81 * car.wheelbase_m() / (0.45 * car.top_speed_mps).powi(2))
        .sensors(SensorSettings::exact())
        .duration(60.0);
    if let Some(text) = effect {
        scenario = scenario.effect(EffectSetting::parse(text).unwrap());
    }
    let recording = Simulation::new(scenario).unwrap().run(|_| {});
    assert!(recording.end.is_completed(), "{}", recording.end);
    let fitted = oracle::fit_car(car, &recording.truth);
    let rollout = oracle::rollout_error(car, &[fitted[0].0, fitted[1].0], &recording.truth);
    ([fitted[0].1, fitted[1].1], rollout)
}

#[test]
fn without_effects_the_single_track_model_fits() {
    for name in CAR_NAMES {
        let car = CarParameters::by_name(name).unwrap();
        for (kind, pace) in [(DriverKind::PurePursuit, 0.8), (DriverKind::Profile, 0.92)] {
            let (forces, rollout) = drive(&car, kind, pace, None);
            println!(
                "{name} {kind:?} {pace}: RMSE of F_y/F_z {:.5} {:.5}; 1 s rollout, error over signal: v_y {:.2} %, \
                 yaw rate {:.2} %",
                forces[0],
                forces[1],
                100.0 * rollout[0],
                100.0 * rollout[1]
            );
            assert!(forces.iter().all(|e| *e < 0.0005), "{name}: {forces:?}");
            assert!(rollout.iter().all(|e| *e < 0.03), "{name}: {rollout:?}");
        }
    }
}

#[test]
fn with_a_chassis_effect_it_does_not() {
    let car = CarParameters::by_name("formula_student").unwrap();
    let (_, without) = drive(&car, DriverKind::PurePursuit, 0.8, None);
    for effect in
        ["lateral_load_transfer", "tire_relaxation=0.3", "yaw_inertia_error", "differential_yaw_moment"]
    {
        let (_, with) = drive(&car, DriverKind::PurePursuit, 0.8, Some(effect));
        println!("{effect}: {with:?} against {without:?}");
        assert!(with[0] > 1.5 * without[0], "{effect} shows too little: {with:?} against {without:?}");
    }
}
