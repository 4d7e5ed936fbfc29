//! The generator's own fit of an effect: what a drive can show of it, before any diagnosis.
//!
//! Beside the car at work drive copies of it that are put onto its state every half second and get the same commands: one
//! without the effect, four with other tires, one without each part of the background and one without any, two with other start states.
//! What they report differs from the car's reports by the response `e` of the effect, `T` of the tires, `B` of the parts of the
//! background, `m` of all of it, `S` of the start states. With `S` projected out window by window and the responses whitened by the
//! sensors' noise, weighted least squares with the tires known to [`TIRE_TRUST`] and the background to `BACKGROUND_TRUST` gives
//!
//! ```text
//! [a, t, b] = N^-1 [e, T, B]' y,    N = [e, T, B]'[e, T, B] + diag(0, 1/trust^2)
//! standard error of a: noise (white and coloured) and the scatter of the background's contribution over windows
//! size ratio: 1 + a(m), the noise-free best fit over the mechanism's size; severity: 1/(5 standard errors)
//! ```
//!
//! For an effect that the diagnosis has to do without, copies with every other effect of the library drive along; the best of
//! them, its size and the tires fitted to `e`, leaves the excess that is sealed with the label.
//!
//! This is the fit of the candidate to the plant's response, linear about the true size, with the plant's own mechanism as
//! the candidate: the mechanisms' constants are the library's (the reference car's README names the four that need a word).

use gripsight_reference_car::{
    CarParameters, EffectSetting, Scenario, SensorSample, SensorSettings, Simulation, TireParameters,
};
use nalgebra::{DMatrix, DVector};

use crate::WithheldError;
use crate::drive::MARGIN_S;
use crate::label::OracleFit;

/// Standard deviation with which peak and stiffness of the tires are known.
pub const TIRE_TRUST: f64 = 0.03;
/// Standard deviation of every part of the background as a share of what the car has of it: nobody has measured it.
const BACKGROUND_TRUST: f64 = 1.0;

const WINDOW: usize = 50;
/// Reports come a hundred times a second.
const WINDOW_S: f64 = 0.5;
const SAMPLE_STEPS: u64 = 10;
/// Step of the tires' peak and stiffness, relative.
const TIRE_STEP: f64 = 0.02;
/// Steps of the start states.
const V_Y_STEP_MPS: f64 = 0.02;
const YAW_RATE_STEP_RADPS: f64 = 0.02;
/// Standard errors that make a detection.
const DETECTION: f64 = 5.0;
/// Lateral speed, yaw rate, forward speed less its mean, a_y - v_x r.
const CHANNELS: usize = 4;
const TIRES: usize = 4;
/// Variance of the mean of a coloured noise over windows as long as its correlation time, over that of independent ones.
const COLOURED_INFLATION: f64 = 2.2;

/// One report of odometry and inertial unit.
type Report = [f64; CHANNELS];

/// Fits every effect of `asked` on a drive of the scenario, which holds them and the background, and says what the best of the
/// `stand_ins` (other effects, of any size) would leave of the first.
///
/// # Errors
/// [`WithheldError::ReferenceCar`].
pub fn oracle_fits(
    scenario: &Scenario,
    asked: &[EffectSetting],
    stand_ins: &[EffectSetting],
) -> Result<Vec<OracleFit>, WithheldError> {
    let names: Vec<&str> = asked.iter().map(|e| e.name.as_str()).collect();
    let exact = |scenario: Scenario| {
        let camera_off = SensorSettings::exact();
        Simulation::new(scenario.sensors(camera_off))
    };
    let without = |left_out: &dyn Fn(&str) -> bool| {
        let mut copy = scenario.clone();
        copy.effects.retain(|e| !left_out(&e.name));
        copy
    };
    let bare = without(&|name| names.contains(&name));
    let mut copies = vec![exact(bare.clone())?, exact(bare.clone())?, exact(bare.clone())?];
    copies.push(exact(without(&|_| true))?);
    for change in TIRE_CHANGES {
        let mut copy = bare.clone();
        change(&mut copy.car);
        copies.push(exact(copy)?);
    }
    let parts: Vec<&str> = bare.effects.iter().map(|e| e.name.as_str()).collect();
    for part in &parts {
        copies.push(exact(without(&|name| names.contains(&name) || name == *part))?);
    }
    for name in &names {
        copies.push(exact(without(&|other| other == *name))?);
    }
    for stand_in in stand_ins {
        let mut copy = bare.clone();
        copy.effects.retain(|own| own.name != stand_in.name);
        copies.push(exact(copy.effect(stand_in.clone()))?);
    }
    let reports = drive_beside(exact(scenario.clone())?, copies);
    Ok(fits(scenario, &reports, asked.len(), parts.len()))
}

/// Sizes of changes of a car over their detection limits, and their squared responses over the noise per residual, as v_y and yaw rate show
/// them: `without` are the car with one of the changes left out. What start states or the other changes imitate does not count.
///
/// # Errors
/// [`WithheldError::ReferenceCar`].
pub(crate) fn change_severities(
    car: &Scenario,
    without: &[Scenario],
) -> Result<Vec<(f64, f64)>, WithheldError> {
    if without.is_empty() {
        return Ok(Vec::new());
    }
    let exact = |s: &Scenario| Simulation::new(s.clone().sensors(SensorSettings::exact()));
    let mut copies = vec![exact(car)?, exact(car)?, exact(car)?];
    for other in without {
        copies.push(exact(other)?);
    }
    let reports = drive_beside(exact(car)?, copies);
    let samples = reports.iter().map(Vec::len).min().unwrap_or(0);
    let [white, _] = noise(car, 0.0);
    let mut information = DMatrix::zeros(without.len(), without.len());
    let mut residuals = 0.0;
    for w in 1..samples / WINDOW {
        let window = SeenWindow::new(&reports, w, &white);
        let columns: Vec<DVector<f64>> =
            (4..reports.len()).map(|i| window.less_starts(&reports[0], &reports[i])).collect();
        let columns = DMatrix::from_columns(&columns);
        information += columns.tr_mul(&columns);
        residuals += (SEEN * WINDOW) as f64;
    }
    for i in 0..without.len() {
        information[(i, i)] += 1e-12;
    }
    let Some(inverse) = information.try_inverse() else { return Ok(vec![(0.0, 0.0); without.len()]) };
    let of = |i: usize| {
        let own = 1.0 / inverse[(i, i)];
        (own.max(0.0).sqrt() / DETECTION, own / residuals)
    };
    Ok((0..without.len()).map(of).collect())
}

/// What no start and none of the `others` (the simulator with another parameter or an effect around it) imitates of a car that has what its
/// simulator `given` lacks, as v_y and yaw rate show it: squared, over the noise, per residual.
///
/// # Errors
/// [`WithheldError::ReferenceCar`].
pub(crate) fn structure_excess(
    car: &Scenario,
    given: &Scenario,
    others: &[Scenario],
) -> Result<f64, WithheldError> {
    let exact = |s: &Scenario| Simulation::new(s.clone().sensors(SensorSettings::exact()));
    let mut copies = vec![exact(given)?, exact(given)?, exact(given)?];
    for other in others {
        copies.push(exact(other)?);
    }
    let reports = drive_beside(exact(car)?, copies);
    let samples = reports.iter().map(Vec::len).min().unwrap_or(0);
    let [white, _] = noise(car, 0.0);
    let mut information = DMatrix::zeros(others.len(), others.len());
    let (mut moment, mut whole, mut residuals) = (DVector::zeros(others.len()), 0.0, 0.0);
    for w in 1..samples / WINDOW {
        let window = SeenWindow::new(&reports, w, &white);
        let wanted = window.less_starts(&reports[0], &reports[1]);
        let columns: Vec<DVector<f64>> =
            (4..reports.len()).map(|i| window.less_starts(&reports[i], &reports[1])).collect();
        let columns = DMatrix::from_columns(&columns);
        information += columns.tr_mul(&columns);
        moment += columns.tr_mul(&wanted);
        whole += wanted.norm_squared();
        residuals += wanted.len() as f64;
    }
    // Figures may be alike in a drive.
    for i in 0..others.len() {
        information[(i, i)] *= 1.0 + 1e-6;
        information[(i, i)] += 1e-9;
    }
    let size = information.cholesky().map(|c| c.solve(&moment));
    let explained = size.map_or(0.0, |size| size.dot(&moment));
    Ok(if residuals > 0.0 { (whole - explained).max(0.0) / residuals } else { 0.0 })
}

/// A window as v_y and yaw rate show it.
struct SeenWindow<'a> {
    span: std::ops::Range<usize>,
    white: &'a [f64; CHANNELS],
    starts: [DVector<f64>; 2],
}

/// Channels that a simulator is compared in: v_y and yaw rate.
const SEEN: usize = 2;

impl<'a> SeenWindow<'a> {
    /// Of the reports of the car, then of its copies: as it is, started elsewhere twice, and others.
    fn new(reports: &[Vec<Report>], number: usize, white: &'a [f64; CHANNELS]) -> Self {
        let none = [DVector::zeros(0), DVector::zeros(0)];
        let mut window = Self { span: number * WINDOW..(number + 1) * WINDOW, white, starts: none };
        window.starts = orthonormal([2, 3].map(|i| window.column(&reports[i], &reports[1])));
        window
    }

    fn column(&self, a: &[Report], b: &[Report]) -> DVector<f64> {
        let (a, b) = (&a[self.span.clone()], &b[self.span.clone()]);
        whitened(a, b, 1.0, self.white).rows(0, SEEN * WINDOW).clone_owned()
    }

    fn less_starts(&self, a: &[Report], b: &[Report]) -> DVector<f64> {
        without_starts(self.column(a, b), &self.starts)
    }
}

const TIRE_CHANGES: [fn(&mut CarParameters); TIRES] = [
    |car| raise(&mut car.tire_front, true),
    |car| raise(&mut car.tire_front, false),
    |car| raise(&mut car.tire_rear, true),
    |car| raise(&mut car.tire_rear, false),
];

fn raise(tire: &mut TireParameters, peak: bool) {
    let value = if peak { &mut tire.grip } else { &mut tire.cornering_stiffness_per_rad };
    *value *= 1.0 + TIRE_STEP;
}

/// Drives a car and its copies; the first list is the car's, the second and third copy start with another state.
fn drive_beside(mut car: Simulation, mut copies: Vec<Simulation>) -> Vec<Vec<Report>> {
    let steps = (car.scenario().duration_s / car.scenario().step_s).round() as u64;
    let command_steps = (1.0 / (car.scenario().driver.rate_hz * car.scenario().step_s)).round() as u64;
    for step in 0..steps {
        if step.is_multiple_of(SAMPLE_STEPS * WINDOW as u64) {
            for (place, copy) in copies.iter_mut().enumerate() {
                copy.follow(&car);
                match place {
                    1 => copy.nudge(V_Y_STEP_MPS, 0.0),
                    2 => copy.nudge(0.0, YAW_RATE_STEP_RADPS),
                    _ => {}
                }
            }
        }
        let ended = car.drive().is_err();
        for copy in &mut copies {
            if step.is_multiple_of(command_steps) {
                copy.command(car.commanded());
            }
            if ended || copy.step().is_err() {
                // A short drive says less; it is no error.
                return collect(&mut car, &mut copies);
            }
        }
    }
    collect(&mut car, &mut copies)
}

fn collect(car: &mut Simulation, copies: &mut [Simulation]) -> Vec<Vec<Report>> {
    std::iter::once(car).chain(copies).map(|simulation| reports(&simulation.drain().0)).collect()
}

fn reports(samples: &[SensorSample]) -> Vec<Report> {
    let mut out: Vec<Report> = Vec::new();
    let mut odometry = None;
    for sample in samples {
        match sample {
            SensorSample::Odometry(o) => odometry = Some(*o),
            SensorSample::Imu(imu) => {
                if let Some(o) = odometry.take() {
                    out.push([
                        o.v_y_mps,
                        o.yaw_rate_radps,
                        o.v_x_mps,
                        imu.a_y_mps2 - o.v_x_mps * o.yaw_rate_radps,
                    ]);
                }
            }
            SensorSample::Drive(_) | SensorSample::Wheels(_) => {}
        }
    }
    out
}

/// White and coloured noise of every channel.
fn noise(scenario: &Scenario, mean_speed_mps: f64) -> [[f64; CHANNELS]; 2] {
    let s = &scenario.sensors;
    let kinematic = |a: f64, rate: f64| a.hypot(mean_speed_mps * rate);
    [
        [s.v_y.white, s.yaw_rate.white, s.v_x.white, kinematic(s.acceleration.white, s.yaw_rate.white)],
        [
            s.v_y.coloured,
            s.yaw_rate.coloured,
            // Without its mean, a slow noise is gone.
            0.0,
            kinematic(s.acceleration.coloured, s.yaw_rate.coloured),
        ],
    ]
}

/// A window's whitened responses, what start states imitate taken out: the effects, the tires, the parts of the background; all of the background; stand-ins.
struct Window {
    responses: DMatrix<f64>,
    background: DVector<f64>,
    stand_ins: Vec<DVector<f64>>,
}

fn fits(scenario: &Scenario, reports: &[Vec<Report>], effects: usize, parts: usize) -> Vec<OracleFit> {
    let samples = reports.iter().map(Vec::len).min().unwrap_or(0);
    let [car, bare, ..] = reports else { return Vec::new() };
    let mean_speed_mps = bare.iter().map(|r| r[2]).sum::<f64>() / samples.max(1) as f64;
    let [white, coloured] = noise(scenario, mean_speed_mps);
    // Of what is recorded alone: the first turn of the wheels, before the bag begins, shows nobody a slow servo.
    let duration_s = scenario.duration_s;
    let to = (((duration_s - MARGIN_S) / WINDOW_S) as usize).min(samples / WINDOW);
    let from = ((MARGIN_S / WINDOW_S).ceil() as usize).min(to);
    let windows: Vec<Window> = (from..to)
        .map(|w| {
            let column = |a: &[Report], b: &[Report], step: f64| {
                whitened(&a[w * WINDOW..(w + 1) * WINDOW], &b[w * WINDOW..(w + 1) * WINDOW], step, &white)
            };
            // In the order of `oracle_fits`: bare, two starts, no background, the tires, each part of the background and each effect left out.
            let starts = [2, 3].map(|i| column(&reports[i], bare, 1.0));
            let starts = orthonormal(starts);
            let tires = (5..5 + TIRES).map(|i| column(&reports[i], bare, TIRE_STEP));
            let parts_from = 5 + TIRES;
            let effects_from = parts_from + parts;
            let parts = (parts_from..effects_from).map(|i| column(bare, &reports[i], 1.0));
            let left_out = (effects_from..effects_from + effects).map(|i| column(car, &reports[i], 1.0));
            let stand_ins = reports.iter().skip(effects_from + effects);
            let stand_ins = stand_ins.map(|r| without_starts(column(r, bare, 1.0), &starts)).collect();
            let columns: Vec<DVector<f64>> =
                left_out.chain(tires).chain(parts).map(|c| without_starts(c, &starts)).collect();
            let background = without_starts(column(bare, &reports[4], 1.0), &starts);
            Window { responses: DMatrix::from_columns(&columns), background, stand_ins }
        })
        .collect();
    let trusts: Vec<f64> = [TIRE_TRUST; TIRES].into_iter().chain(vec![BACKGROUND_TRUST; parts]).collect();
    let mut fits: Vec<OracleFit> =
        (0..effects).map(|effect| fit(&windows, effect, &trusts, &white, &coloured)).collect();
    if let Some(first) = fits.first_mut() {
        first.excess_without = excess(&windows, effects, &trusts);
    }
    fits
}

/// The difference of two lists of reports, channel by channel, over step and noise.
fn whitened(a: &[Report], b: &[Report], step: f64, white: &[f64; CHANNELS]) -> DVector<f64> {
    let mut column = Vec::with_capacity(a.len() * CHANNELS);
    for (channel, noise) in white.iter().enumerate() {
        let difference: Vec<f64> = a.iter().zip(b).map(|(a, b)| (a[channel] - b[channel]) / step).collect();
        // The start of the forward speed is free, too.
        let mean = difference.iter().sum::<f64>() / difference.len() as f64;
        let taken_out = if channel == 2 { mean } else { 0.0 };
        column.extend(difference.iter().map(|d| (d - taken_out) / noise.max(1e-9)));
    }
    DVector::from_vec(column)
}

fn orthonormal([first, second]: [DVector<f64>; 2]) -> [DVector<f64>; 2] {
    let first = first.try_normalize(1e-12).unwrap_or_else(|| DVector::zeros(second.len()));
    let rest = &second - &first * first.dot(&second);
    let rest = rest.try_normalize(1e-12).unwrap_or_else(|| DVector::zeros(second.len()));
    [first, rest]
}

fn without_starts(mut column: DVector<f64>, starts: &[DVector<f64>; 2]) -> DVector<f64> {
    for start in starts {
        let share = start.dot(&column);
        column.axpy(-share, start, 1.0);
    }
    column
}

fn fit(
    windows: &[Window],
    effect: usize,
    trusts: &[f64],
    white: &[f64; CHANNELS],
    coloured: &[f64; CHANNELS],
) -> OracleFit {
    let nothing = OracleFit { severity: 0.0, size_ratio: 1.0, chi2_per_residual: 0.0, excess_without: None };
    let all = windows.first().map_or(0, |w| w.responses.ncols());
    let mut information = DMatrix::zeros(all, all);
    for (i, trust) in (all.saturating_sub(trusts.len())..all).zip(trusts) {
        information[(i, i)] = trust.powi(-2);
    }
    for window in windows {
        information += window.responses.tr_mul(&window.responses);
    }
    let Some(inverse) = information.clone().try_inverse() else { return nothing };
    let gains = inverse.column(effect).clone_owned();
    let mut from_background = Vec::with_capacity(windows.len());
    let mut coloured_variance = 0.0;
    for window in windows {
        let weights = &window.responses * &gains;
        from_background.push(weights.dot(&window.background));
        for channel in 0..CHANNELS {
            let sum: f64 = weights.rows(channel * WINDOW, WINDOW).sum();
            coloured_variance += (sum * coloured[channel] / white[channel].max(1e-9)).powi(2);
        }
    }
    let count = windows.len().max(1) as f64;
    let bias: f64 = from_background.iter().sum();
    let scatter: f64 = from_background.iter().map(|b| (b - bias / count).powi(2)).sum();
    let variance = inverse[(effect, effect)] + COLOURED_INFLATION * coloured_variance + scatter;
    let own = 1.0 / inverse[(effect, effect)];
    let residuals = count * (WINDOW * CHANNELS) as f64;
    if !(variance.is_finite() && variance > 0.0 && bias.is_finite()) {
        return nothing;
    }
    OracleFit {
        severity: 1.0 / (DETECTION * variance.sqrt()),
        size_ratio: 1.0 + bias,
        chi2_per_residual: own / residuals,
        excess_without: None,
    }
}

/// What the best stand-in, with other tires, leaves of the first effect's response: squared, over the noise, per residual.
fn excess(windows: &[Window], effects: usize, trusts: &[f64]) -> Option<f64> {
    let stand_ins = windows.first()?.stand_ins.len();
    let residuals = (windows.len() * WINDOW * CHANNELS) as f64;
    let left = (0..stand_ins).map(|s| {
        let columns = 1 + trusts.len();
        let mut information = DMatrix::zeros(columns, columns);
        for (i, trust) in (1..).zip(trusts) {
            information[(i, i)] = trust.powi(-2);
        }
        let (mut moment, mut whole) = (DVector::zeros(columns), 0.0);
        for window in windows {
            let response = window.responses.column(0);
            let mut beside = window.responses.columns(effects - 1, columns).clone_owned();
            beside.set_column(0, &window.stand_ins[s]);
            information += beside.tr_mul(&beside);
            moment += beside.tr_mul(&response);
            whole += response.norm_squared();
        }
        // Both columns may be nought: an effect that this drive does not excite at all.
        information[(0, 0)] += 1e-12;
        information.try_inverse().map_or(whole, |inverse| whole - moment.dot(&(&inverse * &moment)))
            / residuals
    });
    left.filter(|l| l.is_finite()).reduce(f64::min)
}
