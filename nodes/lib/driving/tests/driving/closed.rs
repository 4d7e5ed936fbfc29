//! The driver on a single-track car: what it does with sets, warnings, delays and less grip than planned.

use gripsight_driving::{
    Actuator, CarState, DriveCommand, Driver, Drivetrain, Longitudinal, Named, Settings, TireSet, Track,
    Trust,
};
use gripsight_vehicle::{Input, MagicFormula, PacejkaParameters, SingleTrack, State, VehicleParameters};

pub(super) const DRIVETRAIN: Drivetrain = Drivetrain {
    drive_mps2: 6.0,
    brake_mps2: 8.0,
    power_w_per_kg: 60.0,
    top_speed_mps: 8.0,
    told: Longitudinal::UNKNOWN,
};

/// A bean of about 60 m.
fn track() -> Track {
    let row = |k: i32| {
        let p = f64::from(k) * std::f64::consts::TAU / 120.0;
        let radius = 9.0 * (1.0 + 0.25 * (2.0 * p).cos() + 0.08 * (3.0 * p).sin());
        [radius * p.cos(), radius * p.sin(), 0.4, 0.4]
    };
    Track::from_points(&(0..120).map(row).collect::<Vec<_>>()).unwrap()
}

pub(super) fn tires(grip: f64) -> PacejkaParameters {
    let axle = |k: f64| MagicFormula::from_stiffness(k, 1.5, grip, 0.0);
    PacejkaParameters { front: axle(9.0), rear: axle(10.5) }
}

pub(super) fn set(grip: f64, trust: Trust) -> TireSet {
    TireSet { trust, ..TireSet::assumed(tires(grip)) }
}

pub(super) fn rear_driven() -> VehicleParameters {
    VehicleParameters {
        drive_front_share: Some(0.0),
        brake_front_share: Some(0.6),
        ..VehicleParameters::f1tenth()
    }
}

fn driver(start: TireSet) -> Driver {
    with(start, Settings::default())
}

pub(super) fn with(start: TireSet, settings: Settings) -> Driver {
    Driver::new(rear_driven(), DRIVETRAIN, track(), start, settings).unwrap()
}

/// A car that goes along the line.
pub(super) fn on_the_line(driver: &Driver, station_m: f64, v_x_mps: f64) -> CarState {
    let at = driver.track().at(station_m);
    CarState {
        stamp_s: 0.0,
        x_m: at.x_m,
        y_m: at.y_m,
        heading_rad: at.heading_rad,
        v_x_mps,
        v_y_mps: 0.0,
        yaw_rate_radps: 0.0,
    }
}

/// Drives `duration_s` on tires of a grip, the steering late by `delay_s`; the largest distance to the line after 3 s.
pub(super) fn drive(driver: &mut Driver, grip: impl Fn(f64) -> f64, delay_s: f64, duration_s: f64) -> f64 {
    drive_with(driver, grip, &Named { steering_delay_s: Some(delay_s), ..Named::default() }, duration_s)
}

/// The same on a car with some effects.
pub(super) fn drive_with(
    driver: &mut Driver,
    grip: impl Fn(f64) -> f64,
    effects: &Named,
    duration_s: f64,
) -> f64 {
    const DT_S: f64 = 0.01;
    let delay_s = effects.steering_delay_s.unwrap_or(0.0);
    let follows = 1.0 - (-DT_S / effects.steering_lag_s.unwrap_or(0.0).max(1e-9)).exp();
    let arm_m = effects.v_y_lever_arm_m.unwrap_or(0.0);
    let mut wheels_rad = 0.0;
    let vehicle = rear_driven();
    let mut car = on_the_line(driver, 0.0, 2.0);
    let late = (delay_s / DT_S).round() as usize;
    let mut commands = vec![DriveCommand::default(); late];
    let mut worst_m = 0.0_f64;
    for step in 0..(duration_s / DT_S) as usize {
        let measured = CarState { v_y_mps: car.v_y_mps + arm_m * car.yaw_rate_radps, ..car };
        commands.push(driver.command(&measured, car.stamp_s));
        wheels_rad += follows * (commands[step].steering_rad - wheels_rad);
        let (steering, a_x) = (wheels_rad, commands[step + late].acceleration_mps2);
        let model = SingleTrack::new(&vehicle, &tires(grip(car.stamp_s)));
        let input = Input { v_x_mps: car.v_x_mps, steering_rad: steering };
        let from = State { v_y_mps: car.v_y_mps, yaw_rate_radps: car.yaw_rate_radps };
        let to = model.step(from, &input, &input, DT_S, 0.002);
        let (sin, cos) = (car.heading_rad + 0.5 * DT_S * to.yaw_rate_radps).sin_cos();
        let scrub = model.lateral_forces_n(&from, &input).0 * steering.sin() / vehicle.mass_kg;
        car.x_m += DT_S * (car.v_x_mps * cos - to.v_y_mps * sin);
        car.y_m += DT_S * (car.v_x_mps * sin + to.v_y_mps * cos);
        car.heading_rad += DT_S * to.yaw_rate_radps;
        car.v_x_mps = (car.v_x_mps + DT_S * (a_x - scrub + to.v_y_mps * to.yaw_rate_radps)).max(0.5);
        (car.v_y_mps, car.yaw_rate_radps) = (to.v_y_mps, to.yaw_rate_radps);
        car.stamp_s += DT_S;
        if car.stamp_s > 3.0 {
            worst_m = worst_m.max(driver.place().unwrap().offset_m.abs());
        }
    }
    worst_m
}

#[test]
fn pursuit_holds_the_line_on_the_right_tires() {
    let mut driver = driver(set(0.8, Trust::Accepted));
    let worst_m = drive(&mut driver, |_| 0.8, 0.0, 25.0);
    assert!(worst_m < 0.25, "{worst_m}");
    assert!(!driver.held_back());
}

#[test]
fn pursuit_holds_the_line_on_the_start_s_tires_where_there_is_more_grip() {
    let worst_m = drive(&mut driver(TireSet::start()), |_| 0.8, 0.0, 25.0);
    assert!(worst_m < 0.3, "{worst_m}");
}

#[test]
fn a_known_delay_is_made_up_for() {
    const DELAY_S: f64 = 0.15;
    let told = |delay_s: f64| TireSet {
        actuator: Actuator { delay_s, ..Actuator::default() },
        ..set(0.7, Trust::Accepted)
    };
    let with = drive(&mut driver(told(DELAY_S)), |_| 0.8, DELAY_S, 25.0);
    let without = drive(&mut driver(told(0.0)), |_| 0.8, DELAY_S, 25.0);
    assert!(with < 0.25 && with < 0.6 * without, "{with} m with the delay known, {without} m without");
}

#[test]
fn the_effect_that_is_there_is_taken_and_makes_the_car_keep_its_line() {
    let delay = Named { steering_delay_s: Some(0.15), ..Named::default() };
    let lag = Named { steering_lag_s: Some(0.2), ..Named::default() };
    let arm = Named { v_y_lever_arm_m: Some(0.3), ..Named::default() };
    for effect in [delay, lag, arm] {
        let mut driver = driver(set(0.7, Trust::Accepted));
        assert_eq!(driver.take_named(effect), None, "nothing was driven yet");
        let before_m = drive_with(&mut driver, |_| 0.8, &effect, 25.0);
        let trial = driver.take_named(effect).unwrap();
        assert!(trial.taken && trial.ratio < 0.7, "{trial:?}");
        assert_eq!(*driver.named(), effect);
        let after_m = drive_with(&mut driver, |_| 0.8, &effect, 25.0);
        assert!(after_m < 0.8 * before_m, "{effect:?}: {after_m} m after {before_m} m");
    }
}

#[test]
fn wheels_that_nobody_has_steered_yet_are_not_taken_for_a_road_without_grip() {
    let mut driver = driver(set(0.7, Trust::Accepted));
    driver.tell(Named { steering_lag_s: Some(0.2), ..Named::default() });
    // In a corner at the start, where the wheels stand straight and take their time.
    let start = on_the_line(&driver, 0.0, 4.5);
    let (sin, cos) = start.heading_rad.sin_cos();
    let goes_on = |stamp_s: f64| {
        let way_m = start.v_x_mps * stamp_s;
        CarState { stamp_s, x_m: start.x_m + cos * way_m, y_m: start.y_m + sin * way_m, ..start }
    };
    let asked = (0..75).map(|k| driver.command(&goes_on(0.01 * f64::from(k)), 0.01 * f64::from(k)));
    let most_rad = asked.map(|command| command.steering_rad.abs()).fold(0.0, f64::max);
    assert!(most_rad > 0.2 && !driver.held_back(), "{most_rad} rad asked, grip {}", driver.grip());
}

#[test]
fn an_axle_named_with_less_grip_lowers_what_was_shown_by_as_much() {
    // The rear axle's peak was not reached: its formula says more than the car turned with.
    let shown = TireSet {
        tires: PacejkaParameters { rear: tires(1.0).rear, ..tires(0.8) },
        valid_slip_rad: [0.06, f64::INFINITY],
        ..set(0.8, Trust::Accepted)
    };
    let mut driver = driver(shown);
    let before = driver.grip();
    driver.tell(Named { grip: Some([0.99, 0.85]), ..Named::default() });
    approx::assert_relative_eq!(driver.grip(), 0.85 * before, max_relative = 1e-3);
}

#[test]
fn who_is_told_to_use_less_of_the_grip_does_so_however_far_the_peak_is_known() {
    let mut careful = with(TireSet::start(), Settings { share: 0.7, ..Settings::default() });
    careful.take(TireSet { likely_peaks: Some([0.8; 2]), ..set(0.8, Trust::Accepted) }).unwrap();
    drive(&mut careful, |_| 0.8, 0.0, 40.0);
    assert!(careful.grip() <= 0.7 * 0.8 * 1.001, "{}", careful.grip());
}

#[test]
fn an_effect_that_is_not_there_is_refused_with_its_figures() {
    let mut driver = driver(set(0.8, Trust::Accepted));
    drive(&mut driver, |_| 0.8, 0.0, 25.0);
    let none = Named::default();
    for wrong in [
        Named { steering_delay_s: Some(0.05), ..none },
        Named { steering_lag_s: Some(0.05), ..none },
        Named { steering_gain: Some(1.1), ..none },
        Named { v_y_lever_arm_m: Some(-0.1), ..none },
        Named { v_y_bias_mps: Some(0.1), ..none },
        Named { yaw_rate_scale: Some(0.95), ..none },
        Named { grip: Some([1.0, 0.85]), ..none },
    ] {
        let trial = driver.take_named(wrong).unwrap();
        assert!(!trial.taken && trial.ratio > 1.0 && trial.driven_s > 5.0, "{wrong:?}: {trial:?}");
        assert_eq!(*driver.named(), none);
    }
    let nonsense = Named { steering_delay_s: Some(f64::NAN), ..none };
    assert_eq!(driver.take_named(nonsense), None);
}

#[test]
fn what_a_late_steering_predicts_better_is_refused() {
    let late = Named { steering_delay_s: Some(0.06), ..Named::default() };
    let mut driver = with(set(0.7, Trust::Accepted), Settings { share: 0.7, ..Settings::default() });
    drive_with(&mut driver, |_| 0.8, &late, 25.0);
    let wrong = Named { yaw_rate_scale: Some(1.07), v_y_lever_arm_m: Some(0.02), ..Named::default() };
    let trial = driver.take_named(wrong).unwrap();
    assert!(!trial.taken && trial.ratio < 0.95 && trial.later_s == Some(0.06), "{trial:?}");
    assert!(driver.take_named(late).unwrap().taken);
}

#[test]
fn a_drive_train_that_gives_less_is_asked_for_more() {
    let told = Longitudinal {
        gain: Some(0.8),
        rolling_resistance_mps2: Some(0.3),
        drag_1pm: Some(0.01),
        ..Longitudinal::UNKNOWN
    };
    // On the line, as fast as planned: braking for a corner, then gaining speed out of one.
    let asked = |told: Option<Longitudinal>, gains: bool| {
        let mut driver = driver(set(0.8, Trust::Accepted));
        told.into_iter().for_each(|told| driver.take_longitudinal(told));
        let slope = |s: &f64| driver.profile().at(*s).1;
        let mut places = (0..600).map(|k| f64::from(k) * 0.1);
        let gentle = if gains { 0.1..1.5 } else { -1.5..-0.5 };
        let station_m = places.find(|s| gentle.contains(&slope(s))).unwrap();
        let v_x_mps = driver.profile().at(station_m).0;
        let car = on_the_line(&driver, station_m, v_x_mps);
        (driver.command(&car, 0.0).acceleration_mps2, v_x_mps)
    };
    for gains in [false, true] {
        let (alone, v) = asked(None, gains);
        let expected = (alone + 0.3 + 0.01 * v * v) / 0.8;
        approx::assert_relative_eq!(asked(Some(told.clone()), gains).0, expected, max_relative = 1e-9);
    }
}

#[test]
fn less_grip_than_planned_is_noticed() {
    let mut driver = driver(set(0.9, Trust::Accepted));
    drive(&mut driver, |time_s| if time_s < 6.0 { 0.9 } else { 0.6 }, 0.0, 20.0);
    assert!(driver.held_back());
    assert!((0.4..0.65).contains(&driver.grip()), "{}", driver.grip());
}

#[test]
fn a_car_that_swings_out_is_steered_along_its_travel_and_rolls() {
    const GRIP: f64 = 0.8;
    const SPEED_MPS: f64 = 6.0;
    let vehicle = rear_driven();
    // Rear slip beyond any peak; v_x times the yaw rate over what the tires can turn.
    let asked = |side: f64, turning: f64| {
        let mut driver = driver(set(GRIP, Trust::Accepted));
        let yaw_rate_radps = side * turning * GRIP * 9.81 / SPEED_MPS;
        let v_y_mps = vehicle.l_r_m * yaw_rate_radps - side * SPEED_MPS * 0.6_f64.tan();
        let car = CarState { yaw_rate_radps, v_y_mps, ..on_the_line(&driver, 0.0, SPEED_MPS) };
        let travel_rad = (v_y_mps + vehicle.l_f_m * yaw_rate_radps).atan2(SPEED_MPS);
        (driver.command(&car, 0.0), travel_rad)
    };
    for side in [1.0, -1.0] {
        let (swinging, travel_rad) = asked(side, 1.6);
        assert!(side * travel_rad < 0.0);
        let lock = vehicle.max_steering_rad;
        assert!(side * swinging.steering_rad <= side * travel_rad.clamp(-lock, lock) + 1e-9, "{swinging:?}");
        assert!(swinging.acceleration_mps2.abs() < 1e-9, "{swinging:?}");
        let (steady, _) = asked(side, 0.9);
        assert!(steady.acceleration_mps2.abs() > 0.5, "{steady:?}");
    }
}

#[test]
fn a_car_that_pushes_over_its_front_wheels_slows_down_before_it_is_wide() {
    // In the tightest corner, on the line and at the planned speed, turning with a share of what the line asks for.
    let asked = |share: f64, slip_rad: f64| {
        const OUTWARD_RAD: f64 = 0.4;
        let mut driver = driver(set(0.8, Trust::Accepted));
        let curvature = |s: f64| driver.track().at(s).curvature_1pm;
        let stations = (0..600).map(|k| f64::from(k) * 0.1);
        let station_m = stations.max_by(|a, b| curvature(*a).abs().total_cmp(&curvature(*b).abs())).unwrap();
        let (v_x_mps, k) = (driver.profile().at(station_m).0, curvature(station_m));
        let line = on_the_line(&driver, station_m, v_x_mps);
        let yaw_rate_radps = share * v_x_mps * k;
        let v_y_mps = rear_driven().l_r_m * yaw_rate_radps - v_x_mps * slip_rad * k.signum();
        let heading_rad = line.heading_rad - OUTWARD_RAD * k.signum();
        (driver.command(&CarState { yaw_rate_radps, v_y_mps, heading_rad, ..line }, 0.0), v_x_mps)
    };
    let (pushes, v_x_mps) = asked(0.81, 0.2);
    approx::assert_relative_eq!(pushes.speed_mps, 0.9 * v_x_mps, max_relative = 1e-6);
    assert!(pushes.acceleration_mps2 < -0.5, "{pushes:?}");
    // Wheels that do not slip yet have grip left.
    let (turns_in, v_x_mps) = asked(0.81, -0.1);
    approx::assert_relative_eq!(turns_in.speed_mps, v_x_mps, max_relative = 1e-6);
    let (steady, v_x_mps) = asked(1.0, 0.2);
    approx::assert_relative_eq!(steady.speed_mps, v_x_mps, max_relative = 1e-6);
}

#[test]
fn an_assumed_grip_is_no_promise() {
    let start = Settings::default().share * 0.51;
    let mut careful = driver(TireSet::start());
    approx::assert_relative_eq!(careful.grip(), 0.5 * start, max_relative = 1e-2);
    drive(&mut careful, |_| 0.8, 0.0, 60.0);
    approx::assert_relative_eq!(careful.grip(), start, max_relative = 2e-2);
    // Roads that give less are noticed before the assumed grip is driven with, and without going wide: the plan went no further than a step beyond what
    // the car had turned with. (A fifth at a time it left the track by up to 2 m.)
    let mut worst_m = Vec::new();
    for k in 0..15 {
        let road = 0.30 + 0.01 * f64::from(k);
        let mut slippery = driver(TireSet::start());
        worst_m.push(drive(&mut slippery, |_| road, 0.0, 25.0));
        assert!(slippery.grip() < 1.1 * road, "{road}: grip {}", slippery.grip());
    }
    assert!(worst_m.iter().all(|worst_m| *worst_m < 0.4), "{worst_m:?}");
}

#[test]
fn sets_are_taken_for_what_they_are_good_for() {
    let settings = Settings::default();
    let start = settings.share * 0.51;

    // The peak is known: its share.
    let mut known = driver(TireSet::start());
    known.take(set(0.8, Trust::Accepted)).unwrap();
    approx::assert_relative_eq!(known.grip(), settings.share * 0.8, max_relative = 1e-2);

    // A peak that is found lower later holds against a plan that was driven without a slide.
    drive(&mut known, |_| 0.8, 0.0, 60.0);
    known.take(TireSet { likely_peaks: Some([0.7; 2]), ..set(0.7, Trust::Accepted) }).unwrap();
    assert!(known.grip() <= settings.share * 0.7 * 1.001, "{}", known.grip());

    // It is not: a step beyond what was driven, but not beyond what is likely.
    let mut within = driver(TireSet::start());
    drive(&mut within, |_| 0.8, 0.0, 60.0);
    within.take(set(0.48, Trust::AcceptedWithin)).unwrap();
    approx::assert_relative_eq!(within.grip(), settings.step * start, max_relative = 1e-2);
    within.take(TireSet { likely_peaks: Some([0.55; 2]), ..set(0.48, Trust::AcceptedWithin) }).unwrap();
    // Nor at once: most of the way there.
    approx::assert_relative_eq!(within.grip(), start + 0.7 * (0.96 * 0.55 - start), max_relative = 1e-2);
    // What the car has done is no less for a set from a drive that showed little.
    within.take(set(0.25, Trust::AcceptedWithin)).unwrap();
    approx::assert_relative_eq!(within.grip(), 1.05 * start, max_relative = 1e-2);
    within.take(TireSet { likely_peaks: Some([0.3; 2]), ..set(0.25, Trust::AcceptedWithin) }).unwrap();
    approx::assert_relative_eq!(within.grip(), start, max_relative = 1e-2);

    // A peak that was reached is known as well as an accepted one's.
    within
        .take(TireSet {
            likely_peaks: Some([0.55; 2]),
            peak_reached: true,
            ..set(0.48, Trust::AcceptedWithin)
        })
        .unwrap();
    approx::assert_relative_eq!(within.grip(), settings.share * 0.55, max_relative = 1e-2);

    // A prior that promises more: a larger step and no more than that. One that promises less is no reason to slow down.
    for (prior, expected) in [(2.0, settings.prior_step * start), (0.3, settings.step * start)] {
        let mut driver = driver(TireSet::start());
        drive(&mut driver, |_| 0.8, 0.0, 60.0);
        driver.take(set(0.48, Trust::AcceptedWithin)).unwrap();
        driver.take(set(prior, Trust::Provisional)).unwrap();
        approx::assert_relative_eq!(driver.grip(), expected, max_relative = 1e-2);
    }
}

#[test]
fn a_set_that_promises_little_makes_nobody_slower_than_none() {
    let mut driver = driver(TireSet::start());
    drive(&mut driver, |_| 0.8, 0.0, 2.0);
    let little = TireSet { likely_peaks: Some([0.3; 2]), ..set(0.2, Trust::AcceptedWithin) };
    driver.take(little).unwrap();
    let before = driver.grip();
    drive(&mut driver, |_| 0.8, 0.0, 20.0);
    assert!(driver.grip() > 1.4 * before, "{before}, {}", driver.grip());
    // The same where the little was reached.
    driver.take(TireSet { peak_reached: true, ..little }).unwrap();
    let known = driver.grip();
    drive(&mut driver, |_| 0.8, 0.0, 3.0);
    assert_eq!(driver.grip(), known);
}

#[test]
fn a_warning_slows_at_once_and_a_known_peak_ends_it() {
    let mut driver = driver(set(0.8, Trust::Accepted));
    let before_s = driver.profile().lap_time_s();
    driver.warn(Some(0.6));
    assert!(driver.grip() < 0.5, "{}", driver.grip());
    assert!(driver.profile().lap_time_s() > 1.2 * before_s);
    // The same warning again is no news.
    let held = driver.grip();
    driver.warn(Some(0.6));
    assert_eq!(driver.grip(), held);
    driver.take(set(0.7, Trust::Accepted)).unwrap();
    approx::assert_relative_eq!(driver.grip(), 0.98 * 0.7, max_relative = 1e-2);
    driver.warn(None);
    assert!(driver.grip() < 0.55);
}

#[test]
fn who_is_asked_for_turn_ins_weaves_until_the_tires_are_known() {
    // Turns of the steering from one side to the other over 5 s at one place of the line.
    let sways = |driver: &mut Driver| {
        let angle = |k: i32| {
            let stamp_s = 0.02 * f64::from(k);
            let car = on_the_line(driver, 0.0, 3.0);
            let yaw_rate_radps = car.v_x_mps * driver.track().at(0.0).curvature_1pm;
            let car = CarState { stamp_s, yaw_rate_radps, ..car };
            driver.command(&car, stamp_s).steering_rad
        };
        let angles: Vec<f64> = (0..250).map(angle).collect();
        let [low, high] = [f64::min, f64::max].map(|of| angles.iter().copied().reduce(of).unwrap());
        high - low
    };
    let mut driver = driver(TireSet::start());
    let still = sways(&mut driver);
    driver.ask_for_turn_ins(true);
    let weaves = sways(&mut driver);
    assert!(weaves > 0.02 && weaves > 4.0 * still, "{still} rad, asked {weaves} rad");
    driver.ask_for_turn_ins(false);
    assert!(sways(&mut driver) < 2.0 * still + 1e-3);
    driver.ask_for_turn_ins(true);
    driver.take(set(0.6, Trust::AcceptedWithin)).unwrap();
    assert!(sways(&mut driver) < 2.0 * still + 1e-3);
}

#[test]
fn a_car_that_starts_does_not_steer_by_its_noise() {
    let mut driver = driver(TireSet::start());
    driver.ask_for_turn_ins(true);
    let mut asked = Vec::new();
    for k in 0..100 {
        let stamp_s = 0.01 * f64::from(k);
        let noise = if k % 2 == 0 { 0.02 } else { -0.02 };
        let car = on_the_line(&driver, 0.0, 0.01 * f64::from(k));
        asked.push(driver.command(&CarState { stamp_s, v_y_mps: noise, ..car }, stamp_s).steering_rad);
    }
    let most = asked.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max);
    assert!(most < 0.1, "the steering jumps by {most} rad");
}

#[test]
fn nonsense_changes_nothing() {
    let mut driver = driver(set(0.8, Trust::Accepted));
    let grip = driver.grip();
    assert!(driver.take(set(f64::NAN, Trust::Accepted)).is_err());
    assert_eq!(driver.grip(), grip);
    let lost = CarState {
        stamp_s: 0.0,
        x_m: f64::NAN,
        y_m: 0.0,
        heading_rad: 0.0,
        v_x_mps: 3.0,
        v_y_mps: 0.0,
        yaw_rate_radps: 0.0,
    };
    let command = driver.command(&lost, 0.0);
    assert!(command.acceleration_mps2 < 0.0 && command.speed_mps == 0.0);
}
