//! What a drive has shown of the tires, and the set that promises no more than that.
//!
//! ```text
//! F(a)      F_y/F_z of the curve found, with the half-width h(a) of its 90 % interval, over the slips driven, 0 < a <= a_max
//! shown     s(a) = F(a) - h(a);  F(a) - max(0, h(a) - TOLERANCE max F) where both peaks are known
//! cap       the smaller of both axles' max s and of the lateral acceleration that was measured, over g
//! set       the Magic Formula nearest below min(s(a), cap), with D = cap and a stiffness within its interval
//! ```
//!
//! In a steady turn both axles carry the same F_y/F_z = a_y/g: one cap for both, so that it invents no understeer and no oversteer. Where both
//! peaks are known each axle keeps its own, and curves known to the tolerance are handed on as they were found. The worse a curve is known, the lower
//! the promise. Slips that were touched only, in a jerk at the start or a moment's slide, leave the force there unknown: the set then ends where the force
//! is known to [`KNOWN_WITHIN`], if that holds half of the lateral acceleration driven. Where own bounds of either axle would make a car that is unstable in turns
//! in which the car found is not, both curves are those found, lowered by one share.

mod band;

use gripsight_signals::Segment;
use gripsight_vehicle::{GRAVITY_MPS2, MagicFormula, PacejkaParameters, VehicleParameters};
use serde::{Deserialize, Serialize};

use crate::data::{Data, quantile};
use crate::handling::understeer_rad;
use crate::nelder_mead::{NelderMeadConfig, minimize};
use crate::tires::{C_BOUNDS, C_PRIOR, E_BOUNDS, E_PRIOR};
use crate::{Estimate, Identification, IdentificationError, PerAxle};

pub(crate) use band::{Band, half_width};

/// A force, stiffness included, over the lower end of its interval at any slip of a set: a controller with the classical gain margin of 6 dB bears a
/// plant whose gain is off by this factor to either side.
pub(crate) const KNOWN_WITHIN: f64 = 2.0;
/// Where both peaks are known a promise may lie above the truth by this share of the largest force, in 95 of 100 cases: half of what is counted as a
/// promise too high.
const TOLERANCE: f64 = 0.05;
/// How much more a promise above what was shown counts than one below.
const ABOVE: f64 = 100.0;
/// Share of the promise up to which a turn must be stable: beyond, a little more force takes any slip.
const STEERED: f64 = 0.95;
/// How much the set may miss what was shown to keep stiffness and shape one width nearer to what was found or is likely: their ridge is flat.
const SHAPE_TRUST: f64 = 3e-3;
/// Lateral acceleration counts as shown when a car holds it this long,
const HELD_S: f64 = 0.2;
/// in this share of the time driven.
const HELD_SHARE: f64 = 0.005;

/// Slips and forces up to which a set is valid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ValidWithin {
    /// Largest slip angle, rad.
    pub slip_rad: PerAxle<f64>,
    /// Largest lateral force at the static load, N.
    pub force_n: PerAxle<f64>,
}

impl ValidWithin {
    /// Of a set that is valid nowhere.
    pub const NOWHERE: Self = Self {
        slip_rad: PerAxle { front: f64::NAN, rear: f64::NAN },
        force_n: PerAxle { front: f64::NAN, rear: f64::NAN },
    };
}

/// What was shown, and the set within it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Envelope {
    pub(crate) tires: PacejkaParameters,
    pub(crate) valid_within: ValidWithin,
    /// Largest force over the lower end of its interval within the slips driven.
    pub(crate) factor: PerAxle<f64>,
}

/// What is known of an axle.
struct Axle<'a> {
    found: &'a MagicFormula,
    band: &'a Band,
    /// Interval of the normalised stiffness, 1/rad.
    stiffness: (f64, f64),
}

impl Envelope {
    /// Around the tires that a run has found.
    pub(crate) fn of(
        run: &Identification,
        found: &PacejkaParameters,
        stiffness: &PerAxle<Estimate>,
    ) -> Result<Self, IdentificationError> {
        let reached = run.direct.peak.front.reached && run.direct.peak.rear.reached;
        let held = held_lateral_g(&run.data);
        let mut bands = PerAxle {
            front: Band::new(run, &found.front, &run.direct.tires.front, 0),
            rear: Band::new(run, &found.rear, &run.direct.tires.rear, 4),
        };
        if !reached && let Some(known) = known(&bands).filter(|known| KNOWN_WITHIN * promise(known) >= held) {
            bands = known;
        }
        let vehicle = &run.vehicle;
        let loads_n = PerAxle { front: vehicle.static_load_front_n(), rear: vehicle.static_load_rear_n() };
        let interval = |k: &Estimate, load_n: f64| (k.low / load_n, k.high / load_n);
        let front = Axle {
            found: &found.front,
            band: &bands.front,
            stiffness: interval(&stiffness.front, loads_n.front),
        };
        let rear = Axle {
            found: &found.rear,
            band: &bands.rear,
            stiffness: interval(&stiffness.rear, loads_n.rear),
        };
        let tolerance = if reached { TOLERANCE } else { 0.0 };
        let mut caps = [front.band.shown(tolerance), rear.band.shown(tolerance)].map(|shown| highest(&shown));
        if !reached {
            caps = [promise(&bands).min(held); 2];
        }
        let tires = PacejkaParameters {
            front: front.within(caps[0], tolerance)?,
            rear: rear.within(caps[1], tolerance)?,
        };
        let tires = stabilized(vehicle, tires, front.stiffness.0, run.top_speed_mps());
        let turns = Turns { wheelbase_m: vehicle.wheelbase_m(), v_x_mps: run.top_speed_mps() };
        let tires = balanced(&turns, tires, [&front, &rear], tolerance);
        let force_n =
            |axle: &MagicFormula, slip_rad: f64, load_n: f64| axle.max_force_within(slip_rad) * load_n;
        let slip_rad = PerAxle { front: bands.front.furthest_rad(), rear: bands.rear.furthest_rad() };
        Ok(Self {
            tires,
            valid_within: ValidWithin {
                slip_rad,
                force_n: PerAxle {
                    front: force_n(&tires.front, slip_rad.front, loads_n.front),
                    rear: force_n(&tires.rear, slip_rad.rear, loads_n.rear),
                },
            },
            factor: PerAxle { front: bands.front.factor(), rear: bands.rear.factor() },
        })
    }
}

impl Axle<'_> {
    /// The Magic Formula within what was shown, D at the cap. What is known to the tolerance, peak included, stays as it was found.
    fn within(&self, cap: f64, tolerance: f64) -> Result<MagicFormula, IdentificationError> {
        let shown = self.band.shown(tolerance);
        if shown == self.band.force && cap == highest(&shown) {
            return Ok(*self.found);
        }
        let target: Vec<f64> = shown.iter().map(|s| s.min(cap)).collect();
        let found = self.found.normalized_stiffness();
        let (low, high) = (self.stiffness.0.min(found).max(0.1 * found), self.stiffness.1.max(found));
        let axle = |x: &[f64]| MagicFormula::from_stiffness(x[0], x[1], cap, x[2]);
        let width = (high - low).max(1e-3 * found);
        let cost = |x: &[f64]| {
            let axle = axle(x);
            let misses = self.band.slip_rad.iter().zip(&target).map(|(&slip, target)| {
                let miss = (axle.normalized_force(slip) - target) / cap;
                miss * miss * if miss > 0.0 { ABOVE } else { 1.0 }
            });
            let shape = ((x[0] - found) / width).powi(2)
                + ((x[1] - C_PRIOR.mean) / C_PRIOR.sigma).powi(2)
                + ((x[2] - E_PRIOR.mean) / E_PRIOR.sigma).powi(2);
            misses.sum::<f64>() / target.len() as f64 + SHAPE_TRUST.powi(2) * shape
        };
        let bounds = [(low, high), C_BOUNDS, E_BOUNDS];
        let config =
            NelderMeadConfig { tolerance_x: 1e-4, tolerance_cost: 1e-9, ..NelderMeadConfig::default() };
        let mut best: Option<crate::nelder_mead::Minimum> = None;
        for (c, e) in [(self.found.c, self.found.e), (C_PRIOR.mean, E_PRIOR.mean), (C_BOUNDS.0, -3.0)] {
            let start = [found, c.clamp(C_BOUNDS.0, C_BOUNDS.1), e.clamp(E_BOUNDS.0, E_BOUNDS.1)];
            let ended = minimize(cost, &start, &bounds, &config)?;
            if best.as_ref().is_none_or(|b| ended.cost < b.cost) {
                best = Some(ended);
            }
        }
        Ok(best.map_or(*self.found, |b| axle(&b.x)))
    }
}

/// Both curves up to the slips from which they are known badly; `None` where one is nowhere known well.
fn known(bands: &PerAxle<Band>) -> Option<PerAxle<Band>> {
    Some(PerAxle { front: bands.front.known(KNOWN_WITHIN)?, rear: bands.rear.known(KNOWN_WITHIN)? })
}

/// The largest force over the load that both axles have certainly shown.
fn promise(bands: &PerAxle<Band>) -> f64 {
    highest(&bands.front.shown(0.0)).min(highest(&bands.rear.shown(0.0)))
}

/// A front axle as much softer, within its interval, as it takes to run straight at a speed: the end of the interval where nothing does.
fn stabilized(
    vehicle: &VehicleParameters,
    tires: PacejkaParameters,
    softest: f64,
    v_x_mps: f64,
) -> PacejkaParameters {
    const STEPS: u32 = 10;
    let (front, stiffness) = (tires.front, tires.front.normalized_stiffness());
    let softest = softest.min(stiffness).max(0.1 * stiffness);
    let softer = (0..=STEPS).map(|step| {
        let k = stiffness + (softest - stiffness) * f64::from(step) / f64::from(STEPS);
        PacejkaParameters {
            front: MagicFormula::from_stiffness(k, front.c, front.d, front.e),
            rear: tires.rear,
        }
    });
    let stable = |tires: &PacejkaParameters| {
        gripsight_vehicle::handling::straight_line_growth_rate_1ps(vehicle, tires, v_x_mps) <= 0.0
    };
    softer.into_iter().find(stable).unwrap_or(tires)
}

/// Steady turns at a speed.
struct Turns {
    wheelbase_m: f64,
    v_x_mps: f64,
}

impl Turns {
    /// Steering angle at which both axles carry `force` times their load; NaN where one never does.
    fn steering_rad(&self, tires: &PacejkaParameters, force: f64) -> f64 {
        let curvature_1pm = GRAVITY_MPS2 * force / (self.v_x_mps * self.v_x_mps);
        self.wheelbase_m * curvature_1pm + understeer_rad(tires, force)
    }

    /// The first of some rising forces to which a turn takes less angle than to the one before: the car is unstable there (Pacejka, Tire and Vehicle
    /// Dynamics, 3rd edition, 1.3.3).
    fn turns_over_at(&self, tires: &PacejkaParameters, forces: &[f64]) -> Option<f64> {
        let angles: Vec<f64> = forces.iter().map(|&force| self.steering_rad(tires, force)).collect();
        let place = angles.windows(2).position(|pair| pair[1] < pair[0])?;
        forces.get(place + 1).copied()
    }
}

/// The curves found, both lowered by one share to what was shown, where a set would be unstable in turns in which the car found is not: what is not certain
/// of the rear axle must not turn a car that understeers into one that oversteers, whose steering a controller would take back as the turn tightens.
/// The stiffnesses stay within their intervals, and keep their ratio.
fn balanced(
    turns: &Turns,
    set: PacejkaParameters,
    axles: [&Axle<'_>; 2],
    tolerance: f64,
) -> PacejkaParameters {
    const POINTS: usize = 19;
    let within = |axle: &Axle<'_>, tire: &MagicFormula| tire.max_force_within(axle.band.furthest_rad());
    let promise = within(axles[0], &set.front).min(within(axles[1], &set.rear));
    let forces: Vec<f64> = (1..=POINTS).map(|k| STEERED * promise * k as f64 / POINTS as f64).collect();
    let found = PacejkaParameters { front: *axles[0].found, rear: *axles[1].found };
    let at = |tires: &PacejkaParameters| turns.turns_over_at(tires, &forces).unwrap_or(f64::INFINITY);
    if at(&set) >= at(&found) {
        return set;
    }
    let share = axles.iter().flat_map(|axle| {
        axle.band.shown(tolerance).into_iter().zip(&axle.band.force).map(|(shown, force)| shown / force)
    });
    let share = share.fold(1.0, f64::min);
    let softer = axles.iter().map(|axle| axle.stiffness.0 / axle.found.normalized_stiffness());
    let softer = softer.fold(share, f64::max);
    let lowered = |tire: &MagicFormula| {
        MagicFormula::from_stiffness(softer * tire.normalized_stiffness(), tire.c, share * tire.d, tire.e)
    };
    let balanced = PacejkaParameters { front: lowered(&found.front), rear: lowered(&found.rear) };
    if at(&balanced) > at(&set) { balanced } else { set }
}

/// The lateral acceleration over g that the car held, from yaw rate and speeds alone: no tire has a say in it.
fn held_lateral_g(data: &Data) -> f64 {
    let held = ((HELD_S / data.dt_s).round() as usize).max(2);
    let mean = |s: &Segment, from: usize| {
        let turned: f64 =
            (from..from + held).map(|k| s.v_x_mps[k] * s.yaw_rate_radps[k]).sum::<f64>() / held as f64;
        let slid = (s.v_y_mps[from + held - 1] - s.v_y_mps[from]) / ((held - 1) as f64 * s.dt_s);
        (turned + slid).abs() / GRAVITY_MPS2
    };
    let step = (held / 4).max(1);
    let mut all: Vec<f64> = data
        .stretches
        .iter()
        .flat_map(|s| {
            let segment = &data.segments[s.segment];
            (s.from..(s.from + s.len + 1).saturating_sub(held))
                .step_by(step)
                .map(move |from| mean(segment, from))
        })
        .collect();
    quantile(&mut all, 1.0 - HELD_SHARE).unwrap_or(f64::NAN)
}

fn highest(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::NEG_INFINITY, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A car of 2.7 m at 25 m/s whose front tires bend first, as found; the rear force is known the worse the more it slips.
    fn car(rear_half_at_end: f64) -> (PacejkaParameters, PerAxle<Band>) {
        let found = PacejkaParameters {
            front: MagicFormula { b: 13.8, c: 1.34, d: 0.555, e: -2.03 },
            rear: MagicFormula { b: 18.7, c: 1.48, d: 0.596, e: -0.5 },
        };
        let band = |tire: &MagicFormula, furthest_rad: f64, half_at_end: f64| {
            let shares: Vec<f64> = (1..=50).map(|k| f64::from(k) / 50.0).collect();
            Band {
                slip_rad: shares.iter().map(|share| share * furthest_rad).collect(),
                force: shares.iter().map(|share| tire.normalized_force(share * furthest_rad)).collect(),
                half: shares.iter().map(|share| share * half_at_end).collect(),
            }
        };
        let bands = PerAxle {
            front: band(&found.front, 0.098, 0.02),
            rear: band(&found.rear, 0.069, rear_half_at_end),
        };
        (found, bands)
    }

    /// The set with bounds of its own on either axle, and what is handed on.
    fn sets(found: &PacejkaParameters, bands: &PerAxle<Band>) -> [PacejkaParameters; 2] {
        let axle = |found, band, k: f64| Axle { found, band, stiffness: (0.84 * k, 1.16 * k) };
        let front = axle(&found.front, &bands.front, found.front.normalized_stiffness());
        let rear = axle(&found.rear, &bands.rear, found.rear.normalized_stiffness());
        let own = |axle: &Axle<'_>| axle.within(highest(&axle.band.shown(TOLERANCE)), TOLERANCE).unwrap();
        let set = PacejkaParameters { front: own(&front), rear: own(&rear) };
        [set, balanced(&TURNS, set, [&front, &rear], TOLERANCE)]
    }

    const TURNS: Turns = Turns { wheelbase_m: 2.7, v_x_mps: 25.0 };

    #[test]
    fn what_is_not_certain_of_the_rear_axle_makes_no_car_that_oversteers() {
        let (found, bands) = car(0.2);
        let [own, handed_on] = sets(&found, &bands);
        let promise =
            |set: &PacejkaParameters| set.front.max_force_within(0.098).min(set.rear.max_force_within(0.069));
        let forces = |set: &PacejkaParameters| [0.5, 0.7, 0.8, 0.9, 0.95].map(|share| share * promise(set));
        // As a controller would steer it: less angle for the tighter turn.
        assert!(TURNS.turns_over_at(&own, &forces(&own)).is_some());
        assert_eq!(TURNS.turns_over_at(&found, &forces(&own)), None);
        assert_eq!(TURNS.turns_over_at(&handed_on, &forces(&handed_on)), None);
        // Little is lost of the promise, what was shown is hardly exceeded anywhere, and the stiffness stays in its interval.
        assert!((0.85..1.0).contains(&(promise(&handed_on) / promise(&own))));
        let ratio = |f: fn(&MagicFormula) -> f64| {
            [(handed_on.front, found.front), (handed_on.rear, found.rear)]
                .map(|(set, found)| f(&set) / f(&found))
        };
        let [front, rear] = ratio(MagicFormula::normalized_stiffness);
        assert!(front > 0.84 - 1e-9 && (front - rear).abs() < 1e-9, "{front} {rear}");
        let [front, rear] = ratio(|tire| tire.d);
        assert!((front - rear).abs() < 1e-9, "{front} {rear}");
        let shown = bands.rear.shown(TOLERANCE);
        assert!(
            bands
                .rear
                .slip_rad
                .iter()
                .zip(shown)
                .skip(10)
                .all(|(&slip, shown)| { handed_on.rear.normalized_force(slip) < shown + 0.02 })
        );
    }

    #[test]
    fn a_set_that_turns_as_the_car_found_does_keeps_its_own_bounds() {
        let (found, bands) = car(0.04);
        let [own, handed_on] = sets(&found, &bands);
        assert_eq!(own, handed_on);
        // A car that oversteers is handed on as one.
        let (found, bands) = car(0.2);
        let turned = PacejkaParameters { front: found.rear, rear: found.front };
        let swapped = PerAxle { front: bands.rear, rear: bands.front };
        let [own, handed_on] = sets(&turned, &swapped);
        assert_eq!(own, handed_on);
    }
}
