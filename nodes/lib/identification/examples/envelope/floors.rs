//! What sets of a drive over two floors promise, each beside the floor that it is for. Drives of even seeds keep their pace where the floor changes; on those of
//! odd seeds the driver stops for a moment and goes on at a pace for the new floor. Or on one floor throughout, where he goes on at another pace.

use anyhow::Result;
use gripsight_identification::{Config, Outcome, PerAxle, ResidualKind, identify, identify_floors};
use gripsight_reference_car::Friction;
use gripsight_signals::{Joined, NS_PER_S};
use gripsight_vehicle::MagicFormula;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::support::{floor, reference, truth_of};
use crate::{cases, over};

/// When the floor changes, and how long the drive is.
const CHANGES_S: f64 = 25.0;
const DURATION_S: f64 = 50.0;
/// The second floor's friction over the first's, drawn.
const RATIO: (f64, f64) = (0.4, 2.0);
/// Shares of the grip of the slipperier floor that the driver plans to use, drawn.
const PACES: (f64, f64) = (0.5, 0.98);

/// True curves of the axles on a floor, and their peaks.
type Truth = [(MagicFormula, f64); 2];

/// The largest force over a floor's true curves that a set promises, over the peak; either axle.
fn most_over(outcome: &Outcome, truth: &Truth) -> f64 {
    let PerAxle { front, rear } = outcome.valid_within.slip_rad;
    let sets = [(outcome.phi_p.front, front), (outcome.phi_p.rear, rear)];
    let excess =
        sets.iter().zip(truth).map(|((set, within_rad), (curve, peak))| over(set, curve, *within_rad, *peak));
    excess.fold(f64::NEG_INFINITY, f64::max)
}

/// Prints a row a drive: both floors, when the change was seen, and of either side its set's status, D of its axles, and the most that it promises too much; then
/// the same of one set for the whole drive, on the slipperier floor. `changes`: the floor does, else the pace.
pub(crate) fn run(from: u64, to: u64, changes: bool) -> Result<()> {
    let side = |name: &str| format!("status_{name},d_front_{name},d_rear_{name},over_{name}");
    println!(
        "run,driver,mu,mu_after,pace,found_s,floors,{},{},{}",
        side("before"),
        side("after"),
        side("whole")
    );
    for seed in from..to {
        let mut random = ChaCha8Rng::seed_from_u64(seed ^ 0x00f1_0025);
        let ratio = RATIO.0 * (RATIO.1 / RATIO.0).powf(random.random_range(0.0..1.0));
        let ratio = if changes { ratio } else { 1.0 };
        let share = random.random_range(PACES.0..PACES.1);
        let share_after = if changes { share } else { random.random_range(PACES.0..PACES.1) };
        let mut case = cases::draw(seed, DURATION_S)?;
        let mu = case.scenario.friction.nominal();
        let mu_after = ratio * mu;
        let adapts = !changes || seed % 2 == 1;
        let driver = match (changes, adapts) {
            (false, _) => "another pace",
            (true, true) => "adapts",
            (true, false) => "keeps",
        };
        let on = |mu_there: f64, share: f64, seed: u64| {
            let mut scenario = case.scenario.clone().seed(seed).duration(DURATION_S / 2.0);
            scenario.friction = Friction::Uniform { mu: mu_there };
            scenario.driver.pace = share;
            let grip = [scenario.car.tire_front.grip, scenario.car.tire_rear.grip].map(|g| mu_there * g);
            let (recording, sequence, vehicle) = reference::drive(scenario);
            let truth = truth_of(&recording, &vehicle);
            anyhow::Ok(([(floor(&truth.front)?.0, grip[0]), (floor(&truth.rear)?.0, grip[1])], sequence))
        };
        let ((first, before), (second, after)) = (on(mu, share, seed)?, on(mu_after, share_after, seed + 1)?);
        let truths: [Truth; 2] = [first, second];
        case.scenario.friction = Friction::Changing { mu, mu_after, at_s: CHANGES_S, over_s: 0.2 };
        let pace = if adapts { share } else { share * ratio.min(1.0) };
        case.scenario.driver.pace = pace;
        let (_, mut sequence, vehicle) = reference::drive(case.scenario);
        if adapts {
            sequence = Joined::of(&[before, after])?.sequence;
        }
        let config = Config { residual: ResidualKind::None, ..Config::default() };
        let Ok(found) = identify_floors(&sequence, &vehicle, &|_| None, None, &config, &mut |_| {}) else {
            println!(
                "{},{driver},{mu:.3},{mu_after:.3},{pace:.3},,0,failed,,,,failed,,,,failed,,,",
                case.name
            );
            continue;
        };
        let whole = identify(&sequence, &vehicle, None, None, &config, &mut |_| {})?;
        let cells = |outcome: &Outcome, truth: &Truth| {
            let (front, rear) = (outcome.phi_p.front.d, outcome.phi_p.rear.d);
            let status = outcome.status.name();
            format!("{status},{front:.3},{rear:.3},{:.4}", most_over(outcome, truth))
        };
        let parts = &found.parts;
        // A part is for the floor that its middle is on; a whole drive is held against the slipperier; on one floor against what the faster half shows of it.
        let slipperier = usize::from(if changes { mu_after < mu } else { share_after > share });
        let of = |first: bool| {
            let part = if first { parts.first() } else { parts.last() };
            part.map_or(String::new(), |part| {
                let from_s = (part.sequence.start_stamp_ns - sequence.start_stamp_ns) as f64 / NS_PER_S;
                let middle_s = from_s + 0.5 * part.sequence.duration_s();
                let on =
                    if changes && parts.len() > 1 { usize::from(middle_s > CHANGES_S) } else { slipperier };
                cells(&part.outcome, &truths[on])
            })
        };
        let found_s = found.changes.first().map_or(f64::NAN, |c| c.at_s);
        println!(
            "{},{driver},{mu:.3},{mu_after:.3},{pace:.3},{found_s:.2},{},{},{},{}",
            case.name,
            parts.len(),
            of(true),
            of(false),
            cells(&whole, &truths[slipperier])
        );
    }
    Ok(())
}
