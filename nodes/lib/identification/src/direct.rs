//! The direct fit: signal corrections and tires together, by shooting. It is the start of the robust method, the baseline that the
//! residual loop has to beat, and the source of all intervals.
//!
//! 1. Delay, offsets and stiffnesses on the windows of low lateral acceleration, from several steering delays: what the tires do at the limit,
//!    which no simple model gets right, stays out of them.
//! 2. All parameters on all windows. Gain and lever arm are freed only where that is worth it: at nearly one speed they are the stiffnesses in
//!    disguise.
//! 3. Beside that, and never in its place: where the peak is not reached the last fit is repeated with the friction prior as a soft bound on D. Unless the
//!    data contradict it, the curves are fitted once more to the D that prior, curve and force shown make believe.
//!
//! Which is identifiable from what: the yaw rate's bias from the heading alone (fixed then); delay from transients; offset and bias of v_y from driving
//! straight; gain (against K_f) and lever arm (against K_r) from a range of speeds, and from nothing else. Every one has a prior.

mod change;
mod errors;
mod peak;
mod prior;
mod signals;
mod weights;

use gripsight_model::{Rollout, Window};
use gripsight_vehicle::{GRAVITY_MPS2, MagicFormula, PacejkaParameters, SingleTrack, VehicleParameters};
use nalgebra::DMatrix;

use crate::data::{Data, Part, quantile};
use crate::extract::extract;
use crate::rollout::{
    NAMES, Nuisance, PARAMETERS, SIGNALS, SLIP_SHARE, TireRollout, V_X_SCALE, YAW_RATE_SCALE, corrections_of,
    nuisance_of, tires_of,
};
use crate::sweep::Point;
use crate::tires::{C_PRIOR, E_PRIOR, parameters};
use crate::{FrictionPrior, IdentificationError, PerAxle, Range, SignalCorrections};
use gripsight_estimation::shooting::{Fit, Parameter, Prior, Problem, StopReason, TOLERANCE, fit};

pub use change::GripChange;
pub(crate) use peak::{PeakEvidence, force_error};

use change::change_within;
use peak::evidence;
use prior::{believed, contradicts, with_believed, with_prior};
use signals::signal_parameters;
use weights::{Weights, weights};

/// How long a car takes at most to move by a force: slips so near to the end of what a fit follows have not shown theirs.
const ANSWERED_S: f64 = 0.2;
/// Steering delays that step 1 starts from, s.
const DELAY_STARTS_S: [f64; 4] = [0.01, 0.06, 0.14, 0.3];
/// Robustness of the window loss, in noises.
const ROBUST_K: f64 = 3.0;
/// Correlation length of residuals, in samples, before it is known.
const FIRST_CORRELATION: f64 = 10.0;
/// Step 1 looks at windows below this share of the largest lateral acceleration, and needs so many of them.
const LOW_SHARE: f64 = 0.5;
const LOW_WINDOWS: usize = 12;

/// Result of the direct fit.
#[derive(Debug, Clone)]
pub(crate) struct Direct {
    pub(crate) tires: PacejkaParameters,
    pub(crate) corrections: SignalCorrections,
    /// The last fit.
    pub(crate) fit: Fit,
    /// Covariance of its parameters; `None` where nothing is known.
    covariance: Option<DMatrix<f64>>,
    /// The tires of the fit itself, beside all that it allowed for.
    pub(crate) fitted: PacejkaParameters,
    /// What the fit allowed for beside the tires.
    pub(crate) allowed: Nuisance,
    /// The same as rollouts with [`Self::tires`] need it: what combined slip takes is in the tires already.
    pub(crate) nuisance: Nuisance,
    /// What freeing gain and lever arm would change of every parameter, where that was not worth it and they stayed at their nominal values.
    pub(crate) shift: [f64; PARAMETERS],
    /// Standard errors of the signal corrections.
    pub(crate) signal_errors: [Option<f64>; 6],
    /// What was held likely of them before the data were looked at.
    pub(crate) signal_priors: [Prior; 6],
    /// Stiffnesses and corrections that ended on a bound: (name, value).
    pub(crate) signals_on_bound: Vec<(&'static str, f64)>,
    /// Scatter of v_y and yaw rate about the rollouts.
    pub(crate) scatter: [f64; 2],
    pub(crate) slips: PerAxle<Slips>,
    pub(crate) peak: PerAxle<PeakEvidence>,
    /// The tires with the friction prior, where it has a say and the data do not contradict it.
    pub(crate) with_prior: Option<WithPrior>,
    /// A floor that changed under way.
    pub(crate) grip_change: Option<GripChange>,
}

/// Tires that rest on a friction prior where the peak was not reached.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WithPrior {
    pub(crate) tires: PacejkaParameters,
    /// Standard deviation of D; `None` where it rests on no prior.
    pub(crate) d_sigma: PerAxle<Option<f64>>,
}

/// Slip angles visited, from the fitted trajectories (free of sensor noise).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Slips {
    /// All of them.
    pub(crate) samples_rad: Vec<f64>,
    /// 0.5th to 99.5th percentile.
    pub(crate) range_rad: Range,
}

impl Slips {
    /// The largest slip driven.
    pub(crate) fn furthest_rad(&self) -> f64 {
        self.range_rad.low.abs().max(self.range_rad.high.abs())
    }
}

pub(crate) fn direct(
    data: &Data,
    vehicle: &VehicleParameters,
    prior: Option<FrictionPrior>,
    warm: Option<(&PacejkaParameters, &SignalCorrections)>,
) -> Result<Direct, IdentificationError> {
    let fitter = Fitter { model: TireRollout::new(vehicle, data), data, training: data.part(Part::Training) };
    let mut lateral: Vec<f64> = data.samples(|s, k| (s.v_x_mps[k] * s.yaw_rate_radps[k]).abs()).collect();
    let limit_mps2 = quantile(&mut lateral, 0.98).unwrap_or(0.0);
    let grip = (1.2 * limit_mps2 / GRAVITY_MPS2).clamp(0.1, 3.0);

    let first = MagicFormula::from_stiffness(FIRST_STIFFNESS, C_PRIOR.mean, grip, 0.0);
    let tires = warm.map_or(PacejkaParameters { front: first, rear: first }, |(tires, _)| *tires);
    let mut all: Vec<Parameter> = [tires.front, tires.rear].iter().flat_map(parameters).collect();
    all.extend(signal_parameters(data, vehicle));
    let signal_priors =
        std::array::from_fn(|j| all[SIGNALS + j].prior.unwrap_or(Prior { mean: 0.0, sigma: 1.0 }));
    let delays_s = warm.map_or(DELAY_STARTS_S.to_vec(), |(_, c)| vec![c.steering_delay_s]);

    let (start, weights) = fitter.first(&all, &delays_s, LOW_SHARE * limit_mps2)?;
    restart(&mut all, &start.parameters);
    let (all, found, weights, shift) = fitter.refine(&all, weights);

    let (slips, points) = fitter.visited(&found, &weights);
    let mut peak =
        PerAxle { front: evidence(&found, 0, &slips.front), rear: evidence(&found, 4, &slips.rear) };
    let with_prior = match prior {
        Some(prior) => fitter.with_prior(&all, &found, &mut peak, prior, &weights)?,
        None => None,
    };
    if found.stop == StopReason::NotFinite || found.parameters.iter().any(|v| !v.is_finite()) {
        return Err(IdentificationError::NotFinite { what: "direct fit" });
    }
    // Gain and lever arm that were left at their nominal values may still be off by their priors: their uncertainty is everyone's.
    // So are the scales that nothing tells.
    // So is that of a correction on a bound: it is not known, only kept from going further.
    let mut open = all.clone();
    restart(&mut open, &found.parameters);
    for j in [GAIN, LEVER, V_X_SCALE, YAW_RATE_SCALE, SLIP_SHARE] {
        open[j].free = true;
    }
    if let Some(prior) = open[GAIN].prior.as_mut().filter(|_| !all[GAIN].free) {
        prior.sigma = prior.sigma.max(data.doubt.steering_gain / SPREAD);
    }
    for j in [0, 4].into_iter().chain(SIGNALS..PARAMETERS) {
        let parameter = &mut open[j];
        let width = parameter.high - parameter.low;
        (parameter.low, parameter.high) = (parameter.low - width, parameter.high + width);
    }
    let errors = fitter.solve(&open, (&fitter.training, None), &weights.sigma, (0, TOLERANCE));
    let covariance = errors::covariance(&errors, &open, &data.doubt);
    let grip_change = change_within(&fitter.model, data, &found.parameters, &weights.sigma);
    let allowed = nuisance_of(&found.parameters);
    let fitted = tires_of(&found.parameters);
    Ok(Direct {
        tires: PacejkaParameters {
            front: nearest(&points.front, &fitted.front, None)?,
            rear: nearest(&points.rear, &fitted.rear, None)?,
        },
        corrections: corrections_of(&found.parameters),
        nuisance: Nuisance { combined_slip: 0.0, ..allowed },
        fitted,
        allowed,
        shift,
        signal_errors: std::array::from_fn(|j| match standard_error(covariance.as_ref(), SIGNALS + j) {
            // The yaw rate's bias was known from the heading.
            None if j == 5 => Some(signal_priors[5].sigma),
            error => error,
        }),
        signal_priors,
        signals_on_bound: [0, 4]
            .into_iter()
            .chain(SIGNALS..SIGNALS + 6)
            .filter(|j| found.on_bound.contains(j))
            .map(|j| (NAMES[j], found.parameters[j]))
            .collect(),
        fit: errors,
        covariance,
        scatter: weights.scatter,
        slips,
        peak,
        with_prior,
        grip_change,
    })
}

/// Standard errors are this many times what the information says: set so that 90 % intervals cover on development draws (seeds 5000-5399).
const SPREAD: f64 = 1.6;

/// Covariance of some parameters; `None` where nothing is known of them.
fn covariance_of(fit: &Fit, parameters: &[usize]) -> Option<DMatrix<f64>> {
    fit.posterior_of(parameters).map(|c| c * SPREAD.powi(2))
}

fn standard_error(covariance: Option<&DMatrix<f64>>, parameter: usize) -> Option<f64> {
    covariance.map(|c| c[(parameter, parameter)].max(0.0).sqrt()).filter(|&e| e > 0.0)
}

impl Direct {
    /// Standard error of a parameter; `None` where it was not free or nothing is known of it.
    pub(crate) fn standard_error(&self, parameter: usize) -> Option<f64> {
        standard_error(self.covariance.as_ref(), parameter)
    }

    /// Covariance of an axle's (k, C, D, E); `None` where nothing is known.
    pub(crate) fn covariance_of_axle(&self, offset: usize) -> Option<DMatrix<f64>> {
        self.covariance.as_ref().map(|c| c.view((offset, offset), (4, 4)).into_owned())
    }
}

/// The nearest Magic Formula is fitted to about this many points.
const NEAREST_POINTS: usize = 600;
/// Place of the steering gain.
const GAIN: usize = SIGNALS + 1;
/// Place of the lever arm of v_y.
const LEVER: usize = SIGNALS + 3;
/// Freeing gain and lever arm has to lower the cost by this share, or they stay at their nominal values: a model that is too simple would use
/// them to mend what is not theirs, for up to 5 % on development drives without either.
const WORTH: f64 = 0.06;
/// Lever arms that its fit starts from, on either side, in wheelbases.
const LEVER_START: f64 = 0.2;
/// Windows at most that a fit looks for where to begin with: a long drive's others are taken in once it is near.
const SEARCH_WINDOWS: usize = 60;
/// Normalised stiffness that fits start from.
const FIRST_STIFFNESS: f64 = 8.0;

/// The search ends where a step lowers the cost by less than this share: what is searched for differs by [`WORTH`].
const SEARCH_TOLERANCE: f64 = 1e-4;

/// Whether the speeds driven part a lever arm from the stiffnesses. In a steady turn it adds l a_y/v^2 to the rear slip where the tires add a_y/(g k):
/// what it adds has to halve over the speeds.
pub(crate) fn speeds_part(data: &Data) -> bool {
    let mut speeds: Vec<f64> = data.samples(|s, k| s.v_x_mps[k]).collect();
    let [slow, fast] = [0.05, 0.95].map(|share| quantile(&mut speeds, share).unwrap_or(f64::NAN));
    fast > std::f64::consts::SQRT_2 * slow
}

/// Windows of a drive, evenly over it, of which there are not too many to search with.
fn thinned(windows: &[Window]) -> Vec<Window> {
    windows.iter().copied().step_by(thinning(windows)).collect()
}

/// Which of them: every so many.
fn thinning(windows: &[Window]) -> usize {
    windows.len().div_ceil(SEARCH_WINDOWS).max(1)
}

struct Fitter<'a> {
    model: TireRollout<'a>,
    data: &'a Data,
    training: Vec<Window>,
}

impl Fitter<'_> {
    /// From start states that an earlier fit found of the same windows, where there are such.
    fn solve(
        &self,
        all: &[Parameter],
        (windows, starts): (&[Window], Option<Vec<[f64; 2]>>),
        sigma: &[f64; 2],
        (iterations, tolerance): (usize, f64),
    ) -> Fit {
        let problem = Problem {
            model: &self.model,
            windows,
            sigma,
            parameters: all,
            robust_k: ROBUST_K,
            tolerance,
            max_iterations: iterations,
        };
        fit(&problem, starts)
    }

    /// Delay, offsets and stiffnesses on the windows of low lateral acceleration, from several delays; the shape of the tire curves, gain and lever
    /// arm are held.
    fn first(
        &self,
        all: &[Parameter],
        delays_s: &[f64],
        below_mps2: f64,
    ) -> Result<(Fit, Weights), IdentificationError> {
        let low = thinned(&low_windows(self.data, &self.training, below_mps2));
        let mut all = all.to_vec();
        for j in [1, 2, 3, 5, 6, 7, GAIN, LEVER] {
            all[j].free = false;
        }
        let sigma = self.data.noise.map(|s| FIRST_CORRELATION.sqrt() * s.max(1e-6));
        let scan = delays_s.iter().map(|&delay_s| {
            let mut all = all.clone();
            all[SIGNALS].start = delay_s;
            self.solve(&all, (&low, None), &sigma, (8, SEARCH_TOLERANCE))
        });
        let best = scan
            .min_by(|a, b| a.linearization.cost.total_cmp(&b.linearization.cost))
            .filter(|f| f.stop != StopReason::NotFinite)
            .ok_or(IdentificationError::NotFinite { what: "cost of the first fit" })?;
        let weights = weights(&self.model, &best, &low, &self.data.noise);
        Ok((best, weights))
    }

    /// All parameters on all windows, weighed by what they leave over; gain and lever arm freed where that is worth it. Where it is not: what it
    /// would change.
    fn refine(
        &self,
        all: &[Parameter],
        weights: Weights,
    ) -> (Vec<Parameter>, Fit, Weights, [f64; PARAMETERS]) {
        let mut all = all.to_vec();
        for j in [GAIN, LEVER] {
            all[j].free = false;
        }
        let few = thinned(&self.training);
        let search = |all: &[Parameter], starts, weights: &Weights| {
            self.solve(all, (&few, starts), &weights.sigma, (15, SEARCH_TOLERANCE))
        };
        let mut found = search(&all, None, &weights);
        let mut weights = self::weights(&self.model, &found, &few, &self.data.noise);
        restart(&mut all, &found.parameters);
        found = search(&all, Some(found.starts), &weights);
        // A lever arm that was taken for stiffness may have driven the tires to where no step leads back: start on either side, too.
        let mut freed = all.clone();
        restart(&mut freed, &found.parameters);
        for j in [GAIN, LEVER] {
            freed[j].free = true;
        }
        let mut best = search(&freed, Some(found.starts.clone()), &weights);
        for share in [-LEVER_START, LEVER_START] {
            for axle in [0, 4] {
                (freed[axle].start, freed[axle + 1].start) = (FIRST_STIFFNESS, C_PRIOR.mean);
                freed[axle + 3].start = E_PRIOR.mean;
            }
            freed[LEVER].start = share * self.model.vehicle.wheelbase_m();
            let other = search(&freed, Some(found.starts.clone()), &weights);
            if other.linearization.cost < best.linearization.cost {
                best = other;
            }
        }
        let mut shift = [0.0; PARAMETERS];
        if best.linearization.cost < (1.0 - WORTH) * found.linearization.cost && speeds_part(self.data) {
            (all, found) = (freed, best);
        } else {
            shift = std::array::from_fn(|j| best.parameters[j] - found.parameters[j]);
        }
        let mut starts: Vec<[f64; 2]> = self.training.iter().map(|w| self.model.start_guess(w)).collect();
        for (start, known) in starts.iter_mut().step_by(thinning(&self.training)).zip(&found.starts) {
            *start = *known;
        }
        for fitted in [&few, &self.training] {
            weights = self::weights(&self.model, &found, fitted, &self.data.noise);
            restart(&mut all, &found.parameters);
            found = self.solve(&all, (&self.training, Some(starts)), &weights.sigma, (15, TOLERANCE));
            starts = found.starts.clone();
        }
        (all, found, weights, shift)
    }

    /// The tires with the friction prior's say on D where the data do not show it; `None` where it has no say. Where the data contradict it,
    /// that is said of the peaks.
    fn with_prior(
        &self,
        all: &[Parameter],
        found: &Fit,
        peak: &mut PerAxle<PeakEvidence>,
        prior: FrictionPrior,
        weights: &Weights,
    ) -> Result<Option<WithPrior>, IdentificationError> {
        if ![peak.front, peak.rear].iter().any(|axle| axle.is_the_priors(prior)) {
            return Ok(None);
        }
        let better = |starts: [Vec<Parameter>; 2]| {
            let [held, likely] = starts.map(|all| {
                let begin = (&self.training[..], Some(found.starts.clone()));
                self.solve(&all, begin, &weights.sigma, (30, TOLERANCE))
            });
            if likely.linearization.cost < held.linearization.cost { likely } else { held }
        };
        let with_it = better(with_prior(all, found, peak, prior));
        if contradicts(prior, peak, found, &with_it) {
            peak.front.contradicts_prior = true;
            peak.rear.contradicts_prior = true;
            return Ok(None);
        }
        let with_it = better(with_believed(all, found, peak, prior));
        let (_, points) = self.visited(&with_it, weights);
        let tires = tires_of(&with_it.parameters);
        let axle = |points, tire: &MagicFormula, peak: &PeakEvidence| {
            // What was shown is a lower bound.
            let d = tire.d.max(peak.height);
            nearest(points, tire, peak.is_the_priors(prior).then_some((d, d)))
        };
        let d_sigma = |d: f64, peak: &PeakEvidence| {
            peak.is_the_priors(prior).then(|| believed(prior, d, peak.height).sigma)
        };
        let own = tires_of(&found.parameters);
        Ok(Some(WithPrior {
            tires: PacejkaParameters {
                front: axle(&points.front, &tires.front, &peak.front)?,
                rear: axle(&points.rear, &tires.rear, &peak.rear)?,
            },
            d_sigma: PerAxle {
                front: d_sigma(own.front.d, &peak.front),
                rear: d_sigma(own.rear.d, &peak.rear),
            },
        }))
    }

    /// Slip angles, and F_y/F_z at them, along the fitted trajectories, where windows show them and what follows answers to them.
    fn visited(&self, fit: &Fit, weights: &Weights) -> (PerAxle<Slips>, PerAxle<Vec<Point>>) {
        let mut points = PerAxle { front: Vec::new(), rear: Vec::new() };
        let car = SingleTrack::new(self.model.vehicle, &tires_of(&fit.parameters));
        let shown: Vec<bool> = self
            .training
            .iter()
            .zip(&fit.starts)
            .map(|(window, start)| weights.shows(&self.model, &fit.parameters, *start, window))
            .collect();
        let follows = |later: &Window, w: &Window| later.segment == w.segment && later.from == w.from + w.len;
        for (i, (window, start)) in
            self.training.iter().zip(&fit.starts).enumerate().filter(|(i, _)| shown[*i])
        {
            let followed =
                self.training.get(i + 1).is_some_and(|later| shown[i + 1] && follows(later, window));
            let unanswered = if followed { 0 } else { (ANSWERED_S / self.data.dt_s).round() as usize };
            let mut left = window.len.saturating_sub(unanswered);
            self.model.trajectory(&fit.parameters, *start, window, |at| {
                if left == 0 {
                    return;
                }
                left -= 1;
                let (front, rear) = car.slip_angles_rad(&at.state, &at.input);
                let forces = at.normalized_forces(&fit.parameters);
                points.front.push(Point { slip_rad: front, force: forces.0 });
                points.rear.push(Point { slip_rad: rear, force: forces.1 });
            });
        }
        let slips = |points: &[Point]| {
            let samples_rad: Vec<f64> = points.iter().map(|p| p.slip_rad).collect();
            let mut sorted = samples_rad.clone();
            let low = quantile(&mut sorted, 0.005).unwrap_or(f64::NAN);
            let high = quantile(&mut sorted, 0.995).unwrap_or(f64::NAN);
            Slips { samples_rad, range_rad: Range { low, high } }
        };
        (PerAxle { front: slips(&points.front), rear: slips(&points.rear) }, points)
    }
}

/// The Magic Formula nearest to the forces of the richer model, over the slips driven: what Phi_p is for, a model without relaxation and combined slip.
/// D lies within a range where the data do not show it.
fn nearest(
    points: &[Point],
    start: &MagicFormula,
    d_range: Option<(f64, f64)>,
) -> Result<MagicFormula, IdentificationError> {
    let every = points.len().div_ceil(NEAREST_POINTS).max(1);
    let thin: Vec<Point> = points.iter().copied().step_by(every).collect();
    Ok(extract(&thin, start, d_range, true)?.axle)
}

fn restart(all: &mut [Parameter], at: &[f64]) {
    all.iter_mut().zip(at).for_each(|(p, &v)| p.start = v);
}

/// Windows of low lateral acceleration; all where there are too few.
fn low_windows(data: &Data, windows: &[Window], below_mps2: f64) -> Vec<Window> {
    let low: Vec<Window> = windows
        .iter()
        .copied()
        .filter(|w| {
            let s = &data.segments[w.segment];
            (w.from..w.from + w.len).all(|k| (s.v_x_mps[k] * s.yaw_rate_radps[k]).abs() < below_mps2)
        })
        .collect();
    if low.len() < LOW_WINDOWS { windows.to_vec() } else { low }
}
