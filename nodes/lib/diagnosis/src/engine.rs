//! One engine for everything that is fitted or scored: the extended model on windows with free starts.

use gripsight_estimation::shooting;
use gripsight_estimation::shooting::{Parameter, Problem, StopReason};
use gripsight_estimation::{Score, Windows};
use gripsight_model::{
    BASE, DrivenCar, EffectId, ExtendedModel, Flexible, ParameterSpec, Recording, Run, Window,
    effective_tires,
};
use gripsight_vehicle::{
    Input, OwnTires, PacejkaParameters, SingleTrack, State as Motion, VehicleParameters, handling,
};

use crate::state::{Nominal, State};
use crate::trust::TireTrust;

/// Windows whose mean square is beyond this many sigma count less and less.
pub(crate) const ROBUST_K: f64 = 3.0;

/// Relative change of the cost under which a fit has converged: a hundredth of the least drop that an effect must bring.
const TOLERANCE: f64 = 1e-5;

/// Standard deviation that parameters of flexible terms are expected to have.
pub(crate) const FLEXIBLE_RIDGE: f64 = 1.0;

/// Effects with their parameters, as they are fitted.
pub(crate) type Sized = Vec<(EffectId, Vec<f64>)>;

/// What all fits share.
#[derive(Debug, Clone)]
pub(crate) struct Engine<'a> {
    pub(crate) recording: &'a Recording,
    pub(crate) vehicle: &'a VehicleParameters,
    pub(crate) nominal: OwnTires,
    /// Effects that the nominal model has: held at their sizes until they are claimed.
    pub(crate) held: Sized,
    /// What the nominal model has of the background.
    pub(crate) usual: Sized,
    pub(crate) trust: TireTrust,
    /// Weights of the channels: what residuals are divided by when fitting.
    pub(crate) sigma: Vec<f64>,
    /// 0 for a 1:10 car, 1 for a full-size one: where between the two sizes of an effect this car lies.
    pub(crate) size_place: f64,
    pub(crate) substep_s: f64,
}

/// How long a substep may be: a share of the fastest time constant of the car, with which the midpoint rule is wrong by a hundredth of that constant (the
/// square of the share over six).
fn substep_s(vehicle: &VehicleParameters, tires: &OwnTires, v_x_mps: f64) -> f64 {
    const LONGEST_S: f64 = 0.01;
    const SHORTEST_S: f64 = 0.002;
    const SHARE: f64 = 0.25;
    let (k_f, k_r) = handling::cornering_stiffness_n_per_rad(vehicle, &tires.assumed_effective());
    let (l_f, l_r) = (vehicle.l_f_m, vehicle.l_r_m);
    let lateral = (k_f + k_r) / (vehicle.mass_kg * v_x_mps);
    let yaw = (k_f * l_f * l_f + k_r * l_r * l_r) / (vehicle.yaw_inertia_kgm2 * v_x_mps);
    (SHARE / lateral.max(yaw)).clamp(SHORTEST_S, LONGEST_S)
}

/// Values at which an effect is absent.
fn null_values(effect: EffectId) -> Vec<f64> {
    effect.spec().parameters.iter().map(|p| p.null).collect()
}

impl<'a> Engine<'a> {
    pub(crate) fn new(
        recording: &'a Recording,
        vehicle: &'a VehicleParameters,
        nominal: OwnTires,
        trust: TireTrust,
    ) -> Self {
        let v_x_mps = recording.typical_speed_mps().max(0.5);
        Self {
            recording,
            vehicle,
            nominal,
            held: Vec::new(),
            usual: Vec::new(),
            trust,
            sigma: recording.weights.clone(),
            size_place: ((vehicle.wheelbase_m() / 0.32).ln() / (3.0_f64 / 0.32).ln()).clamp(0.0, 1.0),
            substep_s: substep_s(vehicle, &nominal, v_x_mps),
        }
    }

    /// A size of the parameter that matters on this car.
    pub(crate) fn size(&self, spec: &ParameterSpec) -> f64 {
        spec.size[0] * (spec.size[1] / spec.size[0]).powf(self.size_place)
    }

    /// What is known of the hold: mean and standard deviation. A command is held until the next, and its stamp is known to what clocks differ by; an angle
    /// without such stamps may be one or move on between samples.
    pub(crate) fn hold_s(&self) -> [f64; 2] {
        let shares = if self.recording.steering_is_held() { [0.5, 0.1] } else { [0.25, 0.25] };
        shares.map(|share| share * self.recording.dt_s())
    }

    /// Tires and hold of the nominal model.
    pub(crate) fn nominal_base(&self) -> Vec<f64> {
        let mut p = self.nominal.to_parameters().to_vec();
        p.push(0.5 * self.recording.dt_s());
        p
    }

    /// The nominal model as it was handed over: its effects and all its parameters.
    pub(crate) fn nominal_model(&self) -> Nominal {
        let mut parameters = self.nominal_base();
        let given = || self.usual.iter().chain(&self.held);
        parameters.extend(given().flat_map(|(_, own)| own));
        Nominal { effects: given().map(|(e, _)| *e).collect(), parameters }
    }

    /// Slip angles of front and rear axle at a sample, of the motion as recorded; they ask for no tires.
    pub(crate) fn slip_rad(&self, run: &Run, k: usize) -> [f64; 2] {
        let car = SingleTrack::new(self.vehicle, &self.nominal.assumed_effective());
        let state = Motion { v_y_mps: run.smooth[0][k], yaw_rate_radps: run.smooth[1][k] };
        let input = Input { v_x_mps: run.v_x_mps[k], steering_rad: run.steering_rad[k] };
        let (front, rear) = car.slip_angles_rad(&state, &input);
        [front, rear]
    }

    /// Phi_p of a fitted model over the slips driven; not finite where the model does not get there.
    pub(crate) fn effective_tires(&self, state: &State, slip_rad: [f64; 2]) -> PacejkaParameters {
        let own = |e: &EffectId| state.of(*e).map(|own| (*e, own.to_vec()));
        let car = DrivenCar {
            vehicle: self.vehicle.clone(),
            tires: state.tires(),
            effects: state.effects.iter().filter_map(own).collect(),
            substep_s: self.substep_s,
            force_known: false,
            on_course: false,
        };
        effective_tires(&car, self.recording.typical_speed_mps(), slip_rad)
            .unwrap_or(PacejkaParameters::from_array([f64::NAN; 8]))
    }

    /// The parameters with which the nominal model has an effect, where it has it.
    pub(crate) fn given(&self, effect: EffectId) -> Option<&[f64]> {
        let given = self.held.iter().chain(&self.usual).find(|(e, _)| *e == effect);
        given.map(|(_, own)| own.as_slice())
    }

    /// The parameters that stand for the effect's absence among the claims: those of the nominal model where it has the effect, else its null.
    pub(crate) fn absent(&self, effect: EffectId) -> Vec<f64> {
        self.given(effect).map_or_else(|| null_values(effect), <[f64]>::to_vec)
    }

    pub(crate) fn holds(&self, effect: EffectId) -> bool {
        self.held.iter().any(|(e, _)| *e == effect)
    }

    /// The nominal model, with its background in place to be fitted.
    pub(crate) fn blank(&self) -> Vec<f64> {
        let mut p = self.nominal_base();
        p.extend(self.layout(&[]).into_iter().flat_map(|e| self.absent(e)));
        p
    }

    /// The effects of a model that claims `named`, in the order of its parameters.
    pub(crate) fn layout(&self, named: &[EffectId]) -> Vec<EffectId> {
        let background = EffectId::background().filter(|e| !self.holds(*e));
        let held = self.held.iter().map(|(e, _)| *e);
        let silent = background.chain(held).filter(|e| !named.contains(e));
        silent.chain(named.iter().copied()).collect()
    }

    /// The parameters of a state, for a model that claims `named`; what the state lacks is absent, and what is handed over and not claimed is as it
    /// was handed over.
    pub(crate) fn carry(&self, state: &State, named: &[EffectId]) -> Vec<f64> {
        let mut values = state.parameters[..BASE].to_vec();
        for effect in self.layout(named) {
            let is_fixed = self.holds(effect) && !named.contains(&effect);
            match state.of(effect).filter(|_| !is_fixed) {
                Some(own) => values.extend(own),
                None => values.extend(self.absent(effect)),
            }
        }
        values
    }

    pub(crate) fn model(&self, effects: &[EffectId], flexible: Option<&Flexible>) -> ExtendedModel<'a> {
        let mut model = ExtendedModel::new(self.recording, self.vehicle, effects, self.substep_s);
        model.flexible = flexible.cloned();
        model
    }

    pub(crate) fn problem<'p>(
        &'p self,
        model: &'p ExtendedModel<'a>,
        windows: &'p [Window],
        parameters: &'p [Parameter],
        max_iterations: usize,
    ) -> Problem<'p, ExtendedModel<'a>> {
        Problem {
            model,
            windows,
            sigma: &self.sigma,
            parameters,
            robust_k: ROBUST_K,
            tolerance: TOLERANCE,
            max_iterations,
        }
    }

    /// Fits the tires, the background and the effects claimed together; `values` in the order of [`Self::layout`].
    pub(crate) fn fit(
        &self,
        named: &[EffectId],
        values: &[f64],
        starts: Option<Vec<[f64; 2]>>,
        windows: &Windows,
        max_iterations: usize,
    ) -> State {
        let effects = self.layout(named);
        let model = self.model(&effects, None);
        let parameters = self.parameters(named, &effects, values, 1.0);
        let problem = self.problem(&model, &windows.windows, &parameters, max_iterations);
        let end = shooting::fit(&problem, starts);
        State {
            named: named.to_vec(),
            effects,
            parameters: end.parameters,
            starts: end.starts,
            cost: end.linearization.cost,
            finite: end.stop != StopReason::NotFinite,
        }
    }

    /// Fits flexible terms on top of a state, whose own parameters stay: an upper bound of what an additive term explains.
    pub(crate) fn fit_flexible(&self, state: &State, flexible: &Flexible, windows: &Windows) -> Vec<f64> {
        const STEPS: usize = 2;
        let model = self.model(&state.effects, Some(flexible));
        let mut values = state.parameters.clone();
        values.extend(std::iter::repeat_n(0.0, flexible.parameters()));
        let mut parameters = self.parameters(&state.named, &state.effects, &values, FLEXIBLE_RIDGE);
        let own = state.parameters.len();
        parameters[..own].iter_mut().for_each(|p| p.free = false);
        let problem = self.problem(&model, &windows.windows, &parameters, STEPS);
        shooting::fit(&problem, Some(state.starts.clone())).parameters
    }

    /// Best starts for fixed parameters, and the plain sum of squares of each window in units of the noise.
    pub(crate) fn score(
        &self,
        effects: &[EffectId],
        flexible: Option<&Flexible>,
        values: &[f64],
        windows: &Windows,
    ) -> Score {
        self.score_model(&self.model(effects, flexible), values, windows)
    }

    /// [`Self::score`] of a model at hand.
    pub(crate) fn score_model(&self, model: &ExtendedModel<'_>, values: &[f64], windows: &Windows) -> Score {
        let parameters: Vec<Parameter> = values
            .iter()
            .map(|&start| Parameter {
                start,
                low: f64::NEG_INFINITY,
                high: f64::INFINITY,
                free: false,
                prior: None,
            })
            .collect();
        let problem = Problem {
            model,
            windows: &windows.windows,
            sigma: &self.recording.sigma,
            parameters: &parameters,
            robust_k: f64::INFINITY,
            tolerance: TOLERANCE,
            max_iterations: 6,
        };
        let end = shooting::fit(&problem, None);
        Score { squares: end.linearization.window_costs, starts: end.starts }
    }
}
