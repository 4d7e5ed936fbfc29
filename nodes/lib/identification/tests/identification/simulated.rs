//! The reference car: another model, and known truth.

use gripsight_identification::{
    Candidate, Config, FrictionPrior, Identification, IdentificationError, Method, Monitor, Next, PerAxle,
    Range, ResidualKind, RunKey, SignalCorrections, Started, Status, identify, train_residual,
};
use gripsight_reference_car::{EffectSetting, Recording};
use gripsight_signals::StateSequence;
use gripsight_vehicle::{MagicFormula, PacejkaParameters, VehicleParameters};

use crate::support::{drive, scenario, with_background};

fn quick() -> Config {
    Config { residual: ResidualKind::None, ..Config::default() }
}

/// Root mean square error of F_y/F_z of both axles against the plant's own forces.
fn errors(tires: &PacejkaParameters, recording: &Recording, vehicle: &VehicleParameters) -> PerAxle<f64> {
    let mut sum = PerAxle { front: 0.0, rear: 0.0 };
    for t in &recording.truth {
        let m = &t.motion;
        let v_x = m.v_x_mps.max(0.5);
        let front = m.steering_rad - ((m.v_y_mps + vehicle.l_f_m * m.yaw_rate_radps) / v_x).atan();
        let rear = -((m.v_y_mps - vehicle.l_r_m * m.yaw_rate_radps) / v_x).atan();
        let (f, r) = (t.front_axle_n(), t.rear_axle_n());
        sum.front += (tires.front.normalized_force(front) - f[1] / f[2]).powi(2);
        sum.rear += (tires.rear.normalized_force(rear) - r[1] / r[2]).powi(2);
    }
    sum.map(|s| (s / recording.truth.len() as f64).sqrt())
}

#[test]
fn finds_the_forces_of_a_car_with_all_the_background_effects() {
    let (recording, sequence, vehicle) = drive(with_background(scenario("f1tenth", "club", 0.9, 0.9, 3)));
    let outcome = identify(&sequence, &vehicle, None, None, &quick(), &mut |_| {}).unwrap();
    let error = errors(&outcome.found, &recording, &vehicle);
    // The paper's S4 has 0.051 and 0.033.
    assert!(error.front < 0.051 && error.rear < 0.051, "{error:?} {:?}", outcome.reasons);
}

#[test]
fn finds_delay_and_lever_arm_that_were_put_in() {
    let car = scenario("f1tenth", "esses", 0.9, 0.85, 4)
        .effect(EffectSetting::parse("steering_delay=0.06").unwrap())
        .effect(EffectSetting::parse("v_y_lever_arm=-0.1").unwrap());
    let plain = scenario("f1tenth", "esses", 0.9, 0.85, 4);
    let found = |scenario| {
        let (_, sequence, vehicle) = drive(scenario);
        identify(&sequence, &vehicle, None, None, &quick(), &mut |_| {}).unwrap().signals
    };
    let (with, without) = (found(car), found(plain));
    assert!((with.steering_delay_s - without.steering_delay_s - 0.06).abs() < 0.01, "{with:?} {without:?}");
    assert!((with.v_y_lever_arm_m - without.v_y_lever_arm_m + 0.1).abs() < 0.03, "{with:?} {without:?}");
}

/// A clock at half its pace: everything agrees with everything, and the tires give four times the force.
#[test]
fn forces_that_no_tire_gives_are_refused() {
    let (_, sequence, vehicle) = drive(scenario("f1tenth", "club", 0.9, 0.9, 5).duration(20.0));
    let mut fast = sequence.clone();
    for (channel, values) in fast.table_mut() {
        let factor = match channel.unit {
            "s" => 0.5,
            "m/s" | "rad/s" => 2.0,
            "m/s^2" => 4.0,
            _ => 1.0,
        };
        values.iter_mut().for_each(|v| *v *= factor);
    }
    let [right, wrong] =
        [&sequence, &fast].map(|s| identify(s, &vehicle, None, None, &quick(), &mut |_| {}).unwrap());
    assert!(right.accepted, "{:?}", right.reasons);
    assert!(
        !wrong.accepted && wrong.reasons.iter().any(|r| r.contains("static load")),
        "{:?}",
        wrong.reasons
    );
}

#[test]
fn a_mirrored_drive_gives_the_same_tires() {
    let (_, sequence, vehicle) = drive(scenario("f1tenth", "club", 0.9, 0.85, 5).duration(20.0));
    let flip = |v: &Vec<f32>| v.iter().map(|x| -x).collect::<Vec<_>>();
    let mirrored = StateSequence {
        v_y_mps: flip(&sequence.v_y_mps),
        yaw_rate_radps: flip(&sequence.yaw_rate_radps),
        steering_rad: flip(&sequence.steering_rad),
        y_m: flip(&sequence.y_m),
        yaw_rad: flip(&sequence.yaw_rad),
        a_y_mps2: flip(&sequence.a_y_mps2),
        gyro_yaw_rate_radps: flip(&sequence.gyro_yaw_rate_radps),
        ..sequence.clone()
    };
    let [a, b] = [&sequence, &mirrored]
        .map(|s| identify(s, &vehicle, None, None, &quick(), &mut |_| {}).unwrap().phi_p.to_array());
    for (a, b) in a.iter().zip(b) {
        approx::assert_relative_eq!(*a, b, max_relative = 1e-3, epsilon = 1e-3);
    }
}

#[test]
fn the_end_does_not_depend_on_the_start() {
    let (_, sequence, vehicle) = drive(scenario("f1tenth", "club", 0.9, 0.9, 6));
    let shapes = [(6.0, 1.4, 0.0), (12.0, 1.1, -1.0), (3.0, 1.9, 0.5)];
    let ends: Vec<_> = [0.3, 0.51, 0.8, 1.2]
        .iter()
        .zip(shapes.iter().cycle())
        .map(|(&mu, &(k, c, e))| {
            let axle = MagicFormula::from_stiffness(k, c, mu, e);
            let config = Config { initial: PacejkaParameters { front: axle, rear: axle }, ..quick() };
            identify(&sequence, &vehicle, None, None, &config, &mut |_| {}).unwrap()
        })
        .collect();
    for end in &ends[1..] {
        for (a, b) in [
            (
                end.cornering_stiffness_n_per_rad.front.value,
                ends[0].cornering_stiffness_n_per_rad.front.value,
            ),
            (end.cornering_stiffness_n_per_rad.rear.value, ends[0].cornering_stiffness_n_per_rad.rear.value),
        ] {
            approx::assert_relative_eq!(a, b, max_relative = 0.02);
        }
    }
}

#[test]
fn the_state_machine_is_the_whole_run_and_refuses_foreign_models() {
    let (_, sequence, vehicle) = drive(scenario("f1tenth", "club", 0.9, 0.9, 7).duration(15.0));
    let config = Config { epochs: Some(5), seed: 3, ..Config::default() };
    let whole = identify(&sequence, &vehicle, None, None, &config, &mut |_| {}).unwrap();
    let Started::Running(mut run) = Identification::start(&sequence, &vehicle, None, None, &config).unwrap()
    else {
        panic!("refused");
    };
    let outcome = loop {
        let candidate = run.candidate().unwrap().clone();
        let mut go_on = |_| std::ops::ControlFlow::Continue(());
        let model = train_residual(&sequence, &vehicle, &candidate, &config, &mut go_on).unwrap();
        let mut foreign = model.clone();
        foreign.key.iteration += 1;
        assert!(matches!(run.sweep(&foreign), Err(IdentificationError::WrongModel { .. })));
        let swept = run.sweep(&model).unwrap();
        match run.advance(&swept).unwrap() {
            Next::Candidate(next) => {
                assert_eq!(next.key.iteration, candidate.key.iteration + 1);
                assert!(matches!(run.advance(&swept), Err(IdentificationError::WrongModel { .. })));
            }
            Next::Done(outcome) => {
                assert!(matches!(run.sweep(&model), Err(IdentificationError::Ended)));
                assert!(matches!(run.advance(&swept), Err(IdentificationError::Ended)));
                break *outcome;
            }
        }
    };
    assert_eq!(serde_json::to_string(&whole).unwrap(), serde_json::to_string(&outcome).unwrap());
}

#[test]
fn the_papers_method_runs_with_every_residual() {
    let (_, sequence, vehicle) = drive(scenario("f1tenth", "club", 0.9, 0.9, 8).duration(15.0));
    let prior = Some(FrictionPrior { mu: 0.8, sigma: 0.1 });
    for residual in [ResidualKind::S4, ResidualKind::Mlp, ResidualKind::Rnn, ResidualKind::None] {
        let config = Config {
            method: Method::Paper,
            residual,
            epochs: Some(5),
            max_iterations: 2,
            ..Config::default()
        };
        let outcome = identify(&sequence, &vehicle, prior, None, &config, &mut |_| {}).unwrap();
        assert!(outcome.phi_p.is_finite() && outcome.iterations >= 1, "{residual:?}");
    }
}

#[test]
fn the_papers_network_learns_a_drive_to_one_side_for_both() {
    let hull = |track: &str, method: Method| {
        let (_, sequence, vehicle) = drive(scenario("f1tenth", track, 0.9, 0.8, 12).duration(15.0));
        let config = Config { method, epochs: Some(2), ..Config::default() };
        let candidate = Candidate {
            key: RunKey::first(&sequence, &vehicle, &config),
            phi_p: config.initial,
            corrections: SignalCorrections::NONE,
            mean_speed_mps: 3.0,
        };
        let mut go_on = |_| std::ops::ControlFlow::Continue(());
        train_residual(&sequence, &vehicle, &candidate, &config, &mut go_on).unwrap().slip_range_rad.front
    };
    let both_sides = |slips: Range| -slips.low == slips.high;
    assert!(both_sides(hull("steady_circle", Method::Paper)));
    assert!(!both_sides(hull("steady_circle", Method::Robust)));
    assert!(!both_sides(hull("club", Method::Paper)));
}

#[test]
fn a_prior_has_no_say_where_the_peaks_are_reached() {
    let (_, sequence, vehicle) =
        drive(with_background(scenario("formula_student", "bean", 0.8, 0.95, 18)).duration(20.0));
    let ends = [None, Some(0.5), Some(1.1)].map(|mu| {
        let prior = mu.map(|mu| FrictionPrior { mu, sigma: 0.1 });
        let outcome = identify(&sequence, &vehicle, prior, None, &quick(), &mut |_| {}).unwrap();
        assert!(outcome.peak_friction.front.reached && outcome.peak_friction.rear.reached);
        outcome.least_squares
    });
    assert_eq!(ends[0], ends[1]);
    assert_eq!(ends[0], ends[2]);
}

#[test]
fn a_fit_that_is_refused_has_no_peak_by_a_prior_either() {
    let prior = Some(FrictionPrior { mu: 0.65, sigma: 0.1 });
    let mut refused = 0;
    for seed in 0..6 {
        let (_, sequence, vehicle) =
            drive(scenario("passenger_car", "summit", 0.65, 0.4, seed).duration(9.0));
        let outcome = identify(&sequence, &vehicle, prior, None, &quick(), &mut |_| {}).unwrap();
        if outcome.status == Status::Rejected {
            refused += 1;
            assert!(outcome.provisional.is_none(), "{:?}", outcome.reasons);
        }
    }
    assert!(refused > 0);
}

#[test]
fn telemetry_that_cannot_tell_is_refused_with_a_figure() {
    let (_, sequence, vehicle) = drive(scenario("f1tenth", "club", 0.9, 0.9, 9).duration(15.0));
    let cut = |n: usize| StateSequence {
        time_s: sequence.time_s[..n].to_vec(),
        v_x_mps: sequence.v_x_mps[..n].to_vec(),
        v_y_mps: sequence.v_y_mps[..n].to_vec(),
        yaw_rate_radps: sequence.yaw_rate_radps[..n].to_vec(),
        steering_rad: sequence.steering_rad[..n].to_vec(),
        ..StateSequence::default()
    };
    let n = sequence.len();
    let small = |v: &Vec<f32>, by: f32| v.iter().map(|x| x * by).collect::<Vec<_>>();
    let cases = [
        ("too short", cut(200)),
        ("standing", StateSequence { v_x_mps: small(&sequence.v_x_mps, 0.01), ..cut(n) }),
        ("straight", StateSequence { steering_rad: small(&sequence.steering_rad, 1e-3), ..cut(n) }),
        ("no v_y", StateSequence { v_y_mps: vec![0.0; n], ..cut(n) }),
        ("v_y stuck", StateSequence { v_y_mps: vec![0.3; n], ..cut(n) }),
    ];
    for (name, sequence) in cases {
        let outcome = identify(&sequence, &vehicle, None, None, &quick(), &mut |_| {}).unwrap();
        assert!(!outcome.accepted && !outcome.reasons.is_empty(), "{name}");
        assert!(outcome.phi_p.is_finite(), "{name}");
    }
}

#[test]
fn a_signal_that_is_turned_or_in_another_unit_is_refused_with_the_line_that_mends_it() {
    let (_, honest, vehicle) = drive(scenario("f1tenth", "club", 0.9, 0.9, 9).duration(20.0));
    let scaled = |v: &mut Vec<f32>, by: f32| v.iter_mut().for_each(|x| *x *= by);
    type Lie<'a> = (&'a str, Box<dyn Fn(&mut StateSequence)>);
    let lies: [Lie<'_>; 5] = [
        (
            "`steering` or `yaw_rate: {topic: ..., field: ..., sign: -1}`",
            Box::new(move |s| scaled(&mut s.steering_rad, -1.0)),
        ),
        (
            "`steering: {topic: ..., field: ..., unit: deg}`",
            Box::new(move |s| scaled(&mut s.steering_rad, 57.3)),
        ),
        ("`v_x: {topic: ..., field: ..., unit: km/h}`", Box::new(move |s| scaled(&mut s.v_x_mps, 3.6))),
        (
            "`yaw_rate: {topic: ..., field: ..., sign: -1}`",
            Box::new(move |s| scaled(&mut s.yaw_rate_radps, -1.0)),
        ),
        ("`v_y: {topic: ..., field: ..., sign: -1}`", Box::new(move |s| scaled(&mut s.v_y_mps, -1.0))),
    ];
    for (line, lie) in lies {
        let mut sequence = honest.clone();
        lie(&mut sequence);
        let outcome = identify(&sequence, &vehicle, None, None, &quick(), &mut |_| {}).unwrap();
        assert!(
            !outcome.accepted && outcome.reasons.iter().any(|r| r.contains(line)),
            "{line}: {:?}",
            outcome.reasons
        );
    }
    // Where nothing is recorded beside v_y, the tires that would be needed to follow it tell.
    let mut bare = honest.clone();
    (bare.a_x_mps2, bare.a_y_mps2, bare.gyro_yaw_rate_radps) = Default::default();
    (bare.x_m, bare.y_m, bare.yaw_rad) = Default::default();
    for (turned, sign) in [(false, 1.0), (true, -1.0)] {
        let mut sequence = bare.clone();
        scaled(&mut sequence.v_y_mps, sign);
        let outcome = identify(&sequence, &vehicle, None, None, &quick(), &mut |_| {}).unwrap();
        let said = outcome.reasons.iter().any(|r| r.contains("v_y has the wrong sign"));
        assert_eq!(said, turned, "{:?}", outcome.reasons);
        assert!(!(turned && outcome.accepted));
    }
    // A unit that nothing is fitted to is not worth a refusal.
    let mut imu = honest.clone();
    scaled(&mut imu.a_y_mps2, 1.0 / 9.81);
    scaled(&mut imu.gyro_yaw_rate_radps, 57.3);
    let outcome = identify(&imu, &vehicle, None, None, &quick(), &mut |_| {}).unwrap();
    assert!(outcome.accepted, "{:?}", outcome.reasons);
}

#[test]
fn commands_in_another_unit_for_a_moment_show_no_slips() {
    let (_, honest, vehicle) = drive(scenario("formula_student", "harbor", 1.1, 0.85, 23).duration(20.0));
    let driven = |s: &StateSequence| {
        let outcome = identify(s, &vehicle, None, None, &quick(), &mut |_| {}).unwrap();
        outcome.valid_within.slip_rad.front
    };
    let honestly = driven(&honest);
    // The first 8 s and all of it; the burst at the end of a window, in the middle of the drive, and for whole windows.
    for (until_s, from, len) in [(8.0, 775, 21), (20.0, 775, 21), (20.0, 1210, 130), (20.0, 300, 450)] {
        let mut s = honest.between(0.0, until_s).unwrap();
        s.steering_rad[from..from + len].iter_mut().for_each(|x| *x *= 57.3);
        let lying = driven(&s);
        // A rejected set is valid nowhere.
        assert!(
            lying.is_nan() || lying < 1.2 * honestly,
            "{until_s} s, {from} {len}: {lying} rad, driven {honestly}"
        );
    }
}

/// Poses of a localisation of its own at 40 Hz, 2 cm and half a degree, 50 ms late, in place of the odometry's.
fn localised(sequence: &StateSequence) -> StateSequence {
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(1);
    let mut noise = |sigma: f64| Normal::new(0.0, sigma).map_or(0.0, |n| n.sample(&mut random)) as f32;
    let mut s = sequence.clone();
    let [x, y, yaw] = [&mut s.x_m, &mut s.y_m, &mut s.yaw_rad].map(std::mem::take);
    for k in (0..s.len()).step_by(2) {
        s.pose_time_s.push(s.time_s[k] + 0.05);
        s.pose_x_m.push(x[k] + noise(0.02));
        s.pose_y_m.push(y[k] + noise(0.02));
        s.pose_yaw_rad.push(yaw[k] + noise(0.0087));
    }
    s
}

#[test]
fn tires_are_found_without_a_v_y_that_is_measured() {
    let (recording, sequence, vehicle) = drive(with_background(scenario("f1tenth", "club", 0.9, 0.9, 3)));
    let measured = identify(&sequence, &vehicle, None, None, &quick(), &mut |_| {}).unwrap();
    let mut without = localised(&sequence);
    without.v_y_mps.fill(0.0);
    let outcome = identify(&without, &vehicle, None, None, &quick(), &mut |_| {}).unwrap();
    let estimated = outcome.recorded.estimated.clone().unwrap();
    assert!((estimated.pose_delay_s.unwrap().value - 0.05).abs() < 0.01, "{estimated:?}");
    assert!(outcome.reasons.iter().any(|r| r.contains("was estimated from poses")), "{:?}", outcome.reasons);
    assert!(outcome.accepted, "{:?}", outcome.reasons);
    let error = errors(&outcome.found, &recording, &vehicle);
    assert!(error.front < 0.06 && error.rear < 0.06, "{error:?}");
    let k = |o: &gripsight_identification::Outcome| o.cornering_stiffness_n_per_rad;
    approx::assert_relative_eq!(k(&outcome).front.value, k(&measured).front.value, max_relative = 0.15);
    approx::assert_relative_eq!(k(&outcome).rear.value, k(&measured).rear.value, max_relative = 0.15);
    // The same car seen by what another model made of it: replaced, and said.
    let mut lying = localised(&sequence);
    lying.v_y_mps.iter_mut().zip(&sequence.yaw_rate_radps).for_each(|(v, r)| *v = 0.5 * *v + 0.03 * r);
    let outcome = identify(&lying, &vehicle, None, None, &quick(), &mut |_| {}).unwrap();
    assert_eq!(outcome.recorded.estimated.unwrap().channels[0].channel, "v_y_mps");
}

#[test]
fn broken_telemetry_is_an_error() {
    let (_, sequence, vehicle) = drive(scenario("f1tenth", "club", 0.9, 0.9, 9).duration(12.0));
    let mut nan = sequence.clone();
    nan.v_y_mps[100] = f32::NAN;
    let stuck = sequence.v_y_mps[300];
    let mut stuck_for_a_second = sequence.clone();
    stuck_for_a_second.v_y_mps[300..400].fill(stuck);
    let mut backwards = sequence.clone();
    backwards.time_s[50] = backwards.time_s[48];
    let start = |s: &StateSequence| Identification::start(s, &vehicle, None, None, &quick()).unwrap_err();
    assert!(matches!(start(&nan), IdentificationError::Signal(_)));
    assert!(matches!(start(&backwards), IdentificationError::Signal(_)));
    assert!(Identification::start(&stuck_for_a_second, &vehicle, None, None, &quick()).is_ok());
}

#[test]
fn the_monitor_notices_a_loss_of_grip_and_nothing_else() {
    let at = |mu: f64, seed: u64| with_background(scenario("race_car", "clover", mu, 1.0, seed));
    let (_, sequence, vehicle) = drive(at(0.7, 23));
    let outcome = identify(&sequence, &vehicle, None, None, &quick(), &mut |_| {}).unwrap();
    let set = outcome.accepted_set().unwrap_or_else(|| panic!("{:?}", outcome.reasons));
    let monitor = Monitor::new(&vehicle, &set).unwrap();
    let (_, same, _) = drive(at(0.7, 25).duration(15.0));
    let quiet = monitor.look(&same).unwrap();
    assert!(!quiet.changed, "{quiet:?}");
    let (_, slippery, _) = drive(at(0.5, 25).duration(15.0));
    let notice = monitor.look(&slippery).unwrap();
    assert!(notice.changed && quiet.notice(&set).is_none(), "{notice:?}");
    assert!(notice.notice(&set).unwrap().starts_with("the grip has changed: D 0."));
    assert!(notice.peak_factor.front.value < 0.9 * set.phi_p.front.d, "{notice:?}");
    // Warm-started, the next run follows.
    let (_, longer, _) = drive(at(0.5, 27));
    let next = identify(&longer, &vehicle, None, Some(&set), &quick(), &mut |_| {}).unwrap();
    assert!(next.phi_p.front.d < 0.85 * set.phi_p.front.d, "{:?}", next.phi_p);
}
