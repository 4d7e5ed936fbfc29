//! What is left, room by room: how much the flexible terms of each place in which a cause can sit would still explain, on windows that they
//! were not fitted to.

use gripsight_estimation::Windows;
use gripsight_estimation::shooting;
use gripsight_estimation::shooting::{Linearization, Parameter};
use gripsight_model::{EffectId, Flexible, Room, quantile};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::engine::{Engine, FLEXIBLE_RIDGE};
use crate::search::without;
use crate::state::State;

/// The engine with the channels counted by their noise.
pub(crate) fn by_noise<'a>(engine: &Engine<'a>) -> Engine<'a> {
    Engine { sigma: engine.recording.weights.clone(), ..engine.clone() }
}

/// How much lower the cost per residual is for each effect of a state, beside the others.
pub(crate) fn explained(engine: &Engine<'_>, state: &State, windows: &Windows) -> Vec<f64> {
    let engine = &by_noise(engine);
    let with = engine.cost(state, windows);
    let less = |effect: &EffectId| engine.cost(&without(engine, state, *effect, windows), windows) - with;
    state.named.iter().map(less).collect()
}

/// What a model leaves.
#[derive(Debug, Clone, Default)]
pub(crate) struct Left {
    /// Weighted cost per residual.
    pub(crate) cost: f64,
    /// For each room the drop of the cost per residual that one linear step of its terms promises, on windows that it was not fitted to.
    pub(crate) gains: Vec<(Room, f64)>,
}

/// Windows that follow each other and stay in one fold.
const TOGETHER: usize = 2;
/// How tightly the terms are held, as factors on their priors' weight: the one that does best on the other windows counts.
const HOLDS: [f64; 4] = [1.0, 30.0, 1e3, 3e4];
/// Ridge that keeps terms that the data do not show from moving.
const LEAST_INFORMATION: f64 = 1e-6;

/// What free terms of a room explain in drives in which nothing is the matter, as a drop of the cost per residual: five of a hundred reach
/// more. Fixed on development cases, 2026-11-21.
fn usual(room: Room) -> f64 {
    match room {
        Room::Steering => 0.055,
        Room::Sensors => 0.045,
        Room::Forces => 0.065,
        Room::Drive => 0.12,
        Room::Outside => 0.02,
    }
}
/// So many times that, and something is the matter.
const TELLING: f64 = 1.6;
/// Weighted cost per residual that no drive reaches in which nothing is the matter.
const TELLING_COST: f64 = 1.5;
/// What the terms of the longitudinal forces explain in any drive: how the wheels are spun up and slip.
const OF_ANY_DRIVE: f64 = 0.06;
/// Share of the windows that the model follows best: what a car does beyond its grip, no term of a room follows, and no effect.
const CALM: f64 = 0.85;

impl Left {
    /// What a state leaves where the channels count by their noise, its own parameters moving along.
    pub(crate) fn by(engine: &Engine<'_>, state: &State, windows: &Windows, slip_rad: f64) -> Self {
        let engine = &by_noise(engine);
        let gain = |room| {
            let flexible = Flexible::new(engine.recording, slip_rad, engine.vehicle.wheelbase_m(), &[room]);
            (room, gain(engine, state, windows, &flexible))
        };
        Self { cost: engine.cost(state, windows), gains: Room::ALL.into_par_iter().map(gain).collect() }
    }

    /// The same on the calm part of the windows.
    pub(crate) fn where_calm(engine: &Engine<'_>, state: &State, windows: &Windows, slip_rad: f64) -> Self {
        let now =
            by_noise(engine).fit(&state.named, &state.parameters, Some(state.starts.clone()), windows, 0);
        let most = quantile(now.window_costs.clone(), CALM);
        let kept: Vec<usize> = (0..windows.windows.len()).filter(|&k| now.window_costs[k] <= most).collect();
        let calm = windows.picked(&kept);
        let state = State { starts: kept.iter().map(|&k| state.starts[k]).collect(), ..state.clone() };
        let left = Self::by(engine, &state, &calm, slip_rad);
        Self { cost: now.cost / now.residuals, ..left }
    }

    /// The most that a room explains, but for what it explains in any drive.
    pub(crate) fn most(&self) -> f64 {
        let any = |room: Room| if room == Room::Drive { OF_ANY_DRIVE } else { 0.0 };
        self.gains.iter().map(|(room, gain)| gain - any(*room)).fold(0.0, f64::max)
    }

    /// What one room explains.
    pub(crate) fn of(&self, room: Room) -> f64 {
        self.gains.iter().find(|(r, _)| *r == room).map_or(0.0, |(_, gain)| *gain)
    }

    /// The room that explains most, where that is telling beside what it explains in the drive before.
    pub(crate) fn telling(&self, before: &Self) -> Option<(Room, f64)> {
        let least = |room: Room| TELLING * (usual(room) + before.of(room).max(0.0));
        let telling = self.gains.iter().filter(|(room, gain)| *gain > least(*room));
        telling.max_by(|a, b| a.1.total_cmp(&b.1)).copied()
    }

    /// Whether there is something to be explained beside what was there in the drive before.
    pub(crate) fn tells(&self, before: &Self) -> bool {
        self.cost > TELLING_COST * before.cost.max(1.0) || self.telling(before).is_some()
    }
}

fn gain(engine: &Engine<'_>, state: &State, windows: &Windows, flexible: &Flexible) -> f64 {
    let half = |odd: usize| {
        let (mut part, mut starts) = (Windows::default(), Vec::new());
        for k in (0..windows.windows.len()).filter(|k| k / TOGETHER % 2 == odd) {
            part.windows.push(windows.windows[k]);
            part.block.push(windows.block[k]);
            starts.push(state.starts[k]);
        }
        let (linearization, parameters) = linearize(engine, state, flexible, &part, &starts);
        Half::new(&linearization, &parameters)
    };
    let (a, b) = (half(0), half(1));
    let pinned = |j: &usize| state.is_held(*j);
    let moving: Vec<usize> =
        a.places.iter().enumerate().filter(|(_, j)| !pinned(j)).map(|(row, _)| row).collect();
    let is_own = |row: usize| a.places[row] < state.parameters.len();
    let own: Vec<usize> = moving.iter().copied().filter(|&row| is_own(row)).collect();
    let drop = |rows: &[usize], hold: f64| {
        let hold = |row: usize| if is_own(row) { 1.0 } else { hold };
        predicted(&a, &b, rows, &hold) + predicted(&b, &a, rows, &hold)
    };
    let most = HOLDS.into_iter().map(|hold| drop(&moving, hold)).fold(f64::NEG_INFINITY, f64::max);
    (most - drop(&own, 1.0)) / (a.residuals + b.residuals).max(1.0)
}

/// One Jacobian of all parameters of a state and of flexible terms at nothing.
fn linearize(
    engine: &Engine<'_>,
    state: &State,
    flexible: &Flexible,
    windows: &Windows,
    starts: &[[f64; 2]],
) -> (Linearization, Vec<Parameter>) {
    let model = engine.model(&state.effects, Some(flexible));
    let mut values = state.parameters.clone();
    values.extend(std::iter::repeat_n(0.0, flexible.parameters()));
    let parameters = engine.parameters(&state.named, &state.effects, &values, FLEXIBLE_RIDGE);
    let problem = engine.problem(&model, &windows.windows, &parameters, 0);
    (shooting::linearize(&problem, &values, starts), parameters)
}

/// The problem around a state on half of the windows.
struct Half {
    /// Which parameter each row belongs to.
    places: Vec<usize>,
    /// Of the windows alone.
    information: DMatrix<f64>,
    gradient: DVector<f64>,
    /// Of the priors.
    trust: DVector<f64>,
    pull: DVector<f64>,
    residuals: f64,
}

impl Half {
    fn new(all: &Linearization, parameters: &[Parameter]) -> Self {
        let places: Vec<usize> = (0..parameters.len()).filter(|&j| parameters[j].free).collect();
        let n = places.len();
        let prior = |row: usize| {
            let p = &parameters[places[row]];
            p.prior.map_or((0.0, 0.0), |prior| {
                let trust = prior.sigma.powi(-2);
                (trust, (p.start - prior.mean) * trust)
            })
        };
        let trust = DVector::from_fn(n, |row, _| prior(row).0);
        let pull = DVector::from_fn(n, |row, _| prior(row).1);
        Self {
            information: &all.information - DMatrix::from_diagonal(&trust),
            gradient: &all.gradient - &pull,
            places,
            trust,
            pull,
            residuals: all.residuals as f64,
        }
    }
}

/// What a step fitted to one half takes off the cost of the other, to second order.
fn predicted(from: &Half, on: &Half, rows: &[usize], hold: &dyn Fn(usize) -> f64) -> f64 {
    let n = rows.len();
    let pick = |m: &DMatrix<f64>| DMatrix::from_fn(n, n, |i, j| m[(rows[i], rows[j])]);
    let pick_vector = |v: &DVector<f64>| DVector::from_fn(n, |i, _| v[rows[i]]);
    let trust = DVector::from_fn(n, |i, _| LEAST_INFORMATION + from.trust[rows[i]] * hold(rows[i]));
    let information = pick(&from.information) + DMatrix::from_diagonal(&trust);
    let gradient = pick_vector(&from.gradient) + pick_vector(&from.pull);
    let Some(step) = information.cholesky().map(|c| c.solve(&-gradient)) else { return 0.0 };
    let (information, gradient) = (pick(&on.information), pick_vector(&on.gradient));
    -(2.0 * gradient.dot(&step) + (&information * &step).dot(&step))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{drive, tires};
    use crate::trust::TireTrust;
    use gripsight_estimation::split;
    use gripsight_vehicle::VehicleParameters;

    #[test]
    fn a_room_tells_its_own_cause_until_the_effect_is_there() {
        const LARGE_SLIP_RAD: f64 = 0.1;
        let vehicle = VehicleParameters::f1tenth();
        let left = |lag_s: f64, named: &[EffectId]| {
            let recording = drive(&vehicle, lag_s);
            let windows = split(&recording, false).training;
            let engine = Engine::new(&recording, &vehicle, tires(), TireTrust::file());
            let null = engine.fit(&[], &engine.blank(), None, &windows, 15);
            let mut values = engine.carry(&null, named);
            if let [EffectId::SteeringLag] = named {
                let tau = values.len() - 2;
                values[tau] = 0.03;
            }
            let state = engine.fit(named, &values, Some(null.starts), &windows, 15);
            Left::where_calm(&engine, &state, &windows, LARGE_SLIP_RAD)
        };
        let nothing = Left::default();
        let well = left(0.0, &[]);
        assert!(!well.tells(&nothing), "{well:?}");
        let late = left(0.06, &[]);
        assert!(
            late.tells(&nothing) && late.telling(&nothing).is_some_and(|(room, _)| room == Room::Steering),
            "{late:?}"
        );
        // What was there before is nothing new.
        assert!(!late.tells(&late));
        let named = left(0.06, &[EffectId::SteeringLag]);
        assert!(!named.tells(&nothing) && named.most() < 0.02 * late.most(), "{named:?} {late:?}");
        // A stand-in leaves the room more to explain.
        let stand_in = left(0.06, &[EffectId::TireRelaxation]);
        assert!(stand_in.most() > 5.0 * named.most().max(0.01), "{stand_in:?}");
    }
}
