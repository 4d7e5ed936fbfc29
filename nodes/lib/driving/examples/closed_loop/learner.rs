//! What the identifier does, in process: telemetry in, tire sets and warnings to the driver.

use std::collections::VecDeque;

use anyhow::Result;
use gripsight_driving::{Actuator, Driver, Longitudinal, ReachedAt, TireSet, Trust};
use gripsight_identification::{
    AcceptedSet, Config, FrictionPrior, Given, GripLook, GripWatch, Outcome, ResidualKind, Status, Told,
    identify,
};
use gripsight_reference_car::SensorSample;
use gripsight_signals::{AlignConfig, Aligner, StateSequence, TelemetrySample};
use gripsight_vehicle::{GRAVITY_MPS2, PacejkaParameters, VehicleParameters};

/// Longest telemetry to identify from, and shortest.
const WINDOW_S: (f64, f64) = (30.0, 8.0);
/// A window that grows is looked at again when it is so much longer, as `telemetry` gives it out (`first_s` of `params/suite.yaml`).
const GROWTH: f64 = 1.25;

/// How the reason begins that tells of another road.
const CHANGED: &str = "the grip has changed";

/// A grip that stays fallen is said again after so long.
const EVERY_NS: i64 = 1_000_000_000;

/// What the identifier does, in process.
pub(crate) struct Learner {
    vehicle: VehicleParameters,
    prior: Option<FrictionPrior>,
    aligner: Aligner,
    recent: VecDeque<TelemetrySample>,
    in_use: Option<AcceptedSet>,
    watch: Option<GripWatch>,
    /// Stamp at which the set in use was last said to give less than it promises; `None` while it is in force.
    withdrawn_ns: Option<i64>,
    config: Config,
    /// Length from which a window that grows is looked at next.
    due_s: f64,
    /// Lateral acceleration over g that the set in use promises.
    pub(crate) promised: Option<f64>,
    /// Windows identified, and those in which the grip was said to have changed.
    pub(crate) looks: u32,
    pub(crate) told_changed: u32,
}

impl Learner {
    pub(crate) fn new(vehicle: VehicleParameters, prior: Option<FrictionPrior>) -> Self {
        Self {
            vehicle,
            prior,
            aligner: Aligner::new(AlignConfig::default()),
            recent: VecDeque::new(),
            in_use: None,
            watch: None,
            withdrawn_ns: None,
            config: config(),
            due_s: WINDOW_S.1,
            promised: None,
            looks: 0,
            told_changed: 0,
        }
    }

    /// The prior sees another floor.
    pub(crate) fn look_again(&mut self, prior: Option<FrictionPrior>) {
        self.prior = prior;
    }

    pub(crate) fn push(&mut self, sample: &SensorSample, driver: &mut Driver) -> Result<()> {
        self.aligner.push(sample.measurement(1_000_000_000))?;
        while let Some(aligned) = self.aligner.poll() {
            let look = self.watch.as_mut().and_then(|watch| watch.push(&aligned));
            let again = |look: &GripLook| self.withdrawn_ns.is_none_or(|at| look.stamp_ns >= at + EVERY_NS);
            if let Some(look) = look.filter(|look| look.fallen && again(look)) {
                driver.warn(Some(look.share));
                self.withdrawn_ns = Some(look.stamp_ns);
            }
            self.recent.push_back(aligned);
            while self.span_s() > WINDOW_S.0 {
                self.recent.pop_front();
            }
        }
        Ok(())
    }

    fn span_s(&self) -> f64 {
        let ends = self.recent.front().zip(self.recent.back());
        ends.map_or(0.0, |(a, b)| (b.odometry.stamp_ns - a.odometry.stamp_ns) as f64 * 1e-9)
    }

    /// Whether a window that grows is due to be looked at.
    pub(crate) fn is_due(&mut self) -> bool {
        let due = self.due_s < WINDOW_S.0 && self.span_s() >= self.due_s;
        if due {
            self.due_s *= GROWTH;
        }
        due
    }

    pub(crate) fn identify(&mut self, driver: &mut Driver, verbose: bool) -> Result<()> {
        if self.span_s() < WINDOW_S.1 {
            return Ok(());
        }
        let samples: Vec<TelemetrySample> = self.recent.iter().cloned().collect();
        let sequence = StateSequence::from_samples(&samples)?;
        let outcome =
            identify(&sequence, &self.vehicle, self.prior, self.in_use.as_ref(), &self.config, &mut |_| {});
        let outcome = match outcome {
            Ok(outcome) => outcome,
            Err(error) => {
                if verbose {
                    eprintln!("  no set: {error}");
                }
                return Ok(());
            }
        };
        self.looks += 1;
        self.told_changed += u32::from(outcome.reasons.iter().any(|reason| reason.starts_with(CHANGED)));
        if verbose {
            eprintln!(
                "  {}: D {:.3} {:.3} found {:.3} {:.3} reached {} {} delay {:.3} {} {}",
                outcome.status.name(),
                outcome.phi_p.front.d,
                outcome.phi_p.rear.d,
                outcome.found.front.d,
                outcome.found.rear.d,
                outcome.peak_friction.front.reached,
                outcome.peak_friction.rear.reached,
                outcome.signals.steering_delay_s,
                outcome
                    .provisional
                    .map_or(String::new(), |p| format!("prior {:.3} {:.3}", p.phi_p.front.d, p.phi_p.rear.d)),
                outcome.reasons.join("; "),
            );
        }
        // As the identifier does: one that was withdrawn stands in nobody's way.
        if outcome.replaces(self.in_use.as_ref().filter(|_| self.withdrawn_ns.is_none())) {
            let trust =
                if outcome.status == Status::Accepted { Trust::Accepted } else { Trust::AcceptedWithin };
            self.promised = take(driver, &outcome, &outcome.phi_p, trust, verbose);
            (self.in_use, self.withdrawn_ns) = (outcome.accepted_set(), None);
            self.watch = self.in_use.as_ref().map(|set| GripWatch::new(&self.vehicle, set)).transpose()?;
        }
        driver.take_longitudinal(told(&outcome.longitudinal));
        driver.ask_for_turn_ins(outcome.drive_next.iter().any(|next| next.manoeuvre.is_turning_in()));
        if let Some(set) = &outcome.provisional {
            take(driver, &outcome, &set.phi_p, Trust::Provisional, verbose);
        }
        Ok(())
    }
}

/// Identifies from telemetry alone, without anything of before, and hands the set to the driver; whether it was taken.
pub(crate) fn take_identified(
    driver: &mut Driver,
    vehicle: &VehicleParameters,
    sequence: &StateSequence,
    verbose: bool,
) -> bool {
    let Ok(outcome) = identify(sequence, vehicle, None, None, &config(), &mut |_| {}) else { return false };
    let trust = match outcome.status {
        Status::Accepted => Trust::Accepted,
        Status::AcceptedWithin => Trust::AcceptedWithin,
        _ => return false,
    };
    take(driver, &outcome, &outcome.phi_p, trust, verbose).is_some()
}

/// The robust method without the residual network, as in every window here.
fn config() -> Config {
    Config { residual: ResidualKind::None, ..Config::default() }
}

/// What the message says of the drive train.
fn told(found: &gripsight_identification::Longitudinal) -> Longitudinal {
    let value = |told: &Told| told.known().map(|e| e.value);
    let reached = |given: Option<Given>| given.filter(|g| g.reached).map(|g| g.value.abs());
    Longitudinal {
        gain: value(&found.gain),
        delay_s: value(&found.delay_s),
        lag_s: value(&found.lag_s),
        rolling_resistance_mps2: value(&found.rolling_resistance_mps2),
        drag_1pm: value(&found.drag_1pm),
        reached: found
            .limits
            .iter()
            .map(|at| ReachedAt {
                v_x_mps: [at.v_x_mps.low, at.v_x_mps.high],
                forward_mps2: reached(at.a_max_mps2),
                backward_mps2: reached(at.a_min_mps2),
            })
            .collect(),
    }
}

/// Hands a set to the driver, as a message would; the grip that it promises, where it was taken.
fn take(
    driver: &mut Driver,
    outcome: &Outcome,
    tires: &PacejkaParameters,
    trust: Trust,
    verbose: bool,
) -> Option<f64> {
    let slip = &outcome.valid_within.slip_rad;
    let signals = &outcome.signals;
    let (front, rear) = (&outcome.peak_friction.front, &outcome.peak_friction.rear);
    let set = TireSet {
        tires: *tires,
        trust,
        valid_slip_rad: if trust == Trust::Provisional {
            [f64::INFINITY; 2]
        } else {
            [slip.front, slip.rear]
        },
        likely_peaks: Some([front.value, rear.value]),
        peak_reached: TireSet::limit_reached([front.value, rear.value], [front.reached, rear.reached]),
        actuator: Actuator {
            delay_s: signals.steering_delay_s.max(0.0),
            gain: signals.steering_gain,
            offset_rad: signals.steering_offset_rad,
            ..Actuator::default()
        },
    };
    match driver.take(set) {
        Ok(()) => Some(set.grip()),
        Err(error) => {
            if verbose {
                eprintln!("  not taken: {error}; {} m/s2", GRAVITY_MPS2 * set.grip());
            }
            None
        }
    }
}
