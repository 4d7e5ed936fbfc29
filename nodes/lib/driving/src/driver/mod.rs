//! The driver: takes tire sets as they come, plans what they allow, steers, and gives way when the road gives less.
//!
//! | what is known | grip planned with |
//! | --- | --- |
//! | nothing | half of the start's, and a step beyond what the car turned with, up to the start's |
//! | accepted: the peak is known | a share of the most likely peak, step by step from what the set promises |
//! | accepted within what was shown | a step beyond what was driven, so that the next drive shows more, and most of the way to the most likely peak; no less than was driven, nor than without a set |
//! | a prior's peak (provisional) | most of the way to that and to the peak that the data find most likely, in larger steps |
//! | the car slid, or the identifier warns | what the road gave, then half of the way back with each half lap, once a set has seen it or was not withdrawn |

mod caught;
mod grip;
mod settings;
mod speed;

use std::collections::VecDeque;

use gripsight_vehicle::VehicleParameters;

use self::caught::{CAUGHT, Caught};
use self::grip::CAREFUL;
pub use self::settings::Settings;
use crate::extended::Named;
use crate::governor::Governor;
use crate::plan::Plan;
use crate::predictive::{Predicting, Solves};
use crate::probation::{GivenBack, Probation};
use crate::profile::{Drivetrain, SpeedProfile};
use crate::progress::Progress;
use crate::pursuit::Pursuing;
use crate::state::{Asked, CarState, DriveCommand, settles_s};
use crate::steering::{Controller, Moment, Steering};
use crate::tires::{TireSet, Trust};
use crate::trial::{Memory, Model, Trial, trial};
use crate::weave::weave_mps2;
use crate::{Actuator, DrivingError, Longitudinal, Place, Track};

/// Longest delay that is made up for.
const LATEST_S: f64 = 0.5;
/// Oldest state that is made up for: beyond, the clocks differ.
const OLDEST_S: f64 = 0.2;
/// Share of the grip to go on with after a warning that names no figure.
const WARNED: f64 = 0.7;
/// Time of the last lap, over that planned, that is remembered to try models on.
const LAP_MARGIN: f64 = 1.1;

/// Drives a car around a track.
#[derive(Debug, Clone)]
pub struct Driver {
    vehicle: VehicleParameters,
    drivetrain: Drivetrain,
    track: Track,
    settings: Settings,
    start: TireSet,
    known: Option<TireSet>,
    prior: Option<TireSet>,
    /// Grip planned with over the last part of a lap that ended without a slide.
    driven: f64,
    /// Largest grip that the car turned with while nothing was known.
    turned: f64,
    /// Grip that the road gave where it was less than planned.
    caught: Option<Caught>,
    /// The same before the last model was taken.
    caught_before: Option<Caught>,
    /// Until when a slide is no news: a model was given back.
    trusted_until_s: f64,
    /// Whether identification wants turn-ins beside those of the line.
    turn_ins: bool,
    /// As identified.
    actuator: Actuator,
    /// What a diagnosis names, as far as the last lap agreed.
    named: Named,
    memory: Memory,
    probation: Probation,
    plan: Plan,
    governor: Governor,
    progress: Progress,
    pursuing: Pursuing,
    predicting: Option<Predicting>,
    place: Option<Place>,
    asked: VecDeque<Asked>,
}

impl Driver {
    /// A driver who knows the start's tires only.
    ///
    /// # Errors
    /// [`DrivingError::Tires`] where the start cannot be driven on.
    pub fn new(
        vehicle: VehicleParameters,
        drivetrain: Drivetrain,
        track: Track,
        start: TireSet,
        settings: Settings,
    ) -> Result<Self, DrivingError> {
        start.check()?;
        let careful = if start.trust == Trust::Assumed { CAREFUL } else { 1.0 };
        let first = careful * settings.share * start.grip();
        let plan = Plan::new(&vehicle, &drivetrain, &track, &start, first);
        let progress = Progress::new(track.length_m(), plan.grip);
        Ok(Self {
            actuator: start.actuator,
            named: Named::default(),
            memory: Memory::default(),
            probation: Probation::new(vehicle.wheelbase_m()),
            vehicle,
            drivetrain,
            track,
            settings,
            start,
            known: None,
            prior: None,
            driven: 0.0,
            turned: 0.0,
            caught: None,
            caught_before: None,
            trusted_until_s: f64::NEG_INFINITY,
            turn_ins: false,
            plan,
            governor: Governor::default(),
            progress,
            pursuing: Pursuing::new(settings.pursuit),
            predicting: (settings.controller == Controller::Predictive)
                .then(|| Predicting::new(settings.predictive)),
            place: None,
            asked: VecDeque::new(),
        })
    }

    /// Takes a set. A set of a prior stands beside the one known; any other takes its place.
    ///
    /// # Errors
    /// [`DrivingError::Tires`] for a set that cannot be driven on; the driver keeps what it has.
    pub fn take(&mut self, set: TireSet) -> Result<(), DrivingError> {
        set.check()?;
        if set.trust != Trust::Provisional {
            // It holds what was named of the grip of the set before.
            self.named.grip = None;
        }
        match set.trust {
            Trust::Provisional => self.prior = Some(set),
            Trust::Assumed => (self.start, self.known, self.turned) = (set, None, 0.0),
            Trust::Accepted | Trust::AcceptedWithin => {
                // A peak that is known needs no memory of slides.
                if set.trust == Trust::Accepted {
                    self.caught = None;
                }
                self.caught.iter_mut().for_each(Caught::judge);
                self.known = Some(set);
            }
        }
        self.actuator = set.actuator;
        self.renew();
        Ok(())
    }

    /// Tries the effects that a diagnosis names on the last lap, beside the model in use, and drives with them from now on where they predict it better.
    /// A name may be wrong: after a lap that is worse than the one before it is given back ([`Self::given_back`]). `None`: too little was driven, a
    /// figure is none that a car can have, or effects of these kinds were given back before.
    pub fn take_named(&mut self, named: Named) -> Option<Trial> {
        if !named.is_plausible() || self.probation.was_given_back(&named) {
            return None;
        }
        let set = self.base().tires;
        let model = |named: Named| Model {
            vehicle: &self.vehicle,
            tires: &set,
            named,
            actuator: named.actuator(&self.actuator),
        };
        let trial = trial(&self.memory, &model(self.named), &model(named))?;
        if trial.taken {
            self.probation.begin(self.memory.last_s(), self.named);
            // What the model before took for a slide may have been none.
            self.caught_before = self.caught.take();
            self.tell(named);
        }
        Some(trial)
    }

    /// The same without a trial: for who knows.
    pub fn tell(&mut self, named: Named) {
        self.named = named;
        self.renew();
    }

    /// What was taken and given back after a lap.
    #[must_use]
    pub fn given_back(&self) -> Option<&GivenBack> {
        self.probation.given_back.as_ref()
    }

    /// What is driven with of what was named.
    #[must_use]
    pub fn named(&self) -> &Named {
        &self.named
    }

    /// What identification tells of motor, brakes and resistances: planned and driven with from now on. What it does not tell stays as it was told before,
    /// else as stated.
    pub fn take_longitudinal(&mut self, told: Longitudinal) {
        self.drivetrain.told = told.beside(&self.drivetrain.told);
        self.renew();
    }

    /// Whether identification asks for turn-ins, which the line may not have: the pursuit then weaves within the track, as long as nobody has measured the
    /// tires and where the line leaves grip for it.
    pub fn ask_for_turn_ins(&mut self, wanted: bool) {
        self.turn_ins = wanted;
    }

    /// The set in use must not be used any more, or its grip has fallen. `share`: what the road gives of what the set promises, where it is known.
    pub fn warn(&mut self, share: Option<f64>) {
        let promised = self.known.as_ref().unwrap_or(&self.start).grip();
        let left = share.filter(|s| (0.05..1.0).contains(s)).unwrap_or(WARNED);
        self.catch(CAUGHT * left * promised, true);
    }

    /// Half laps driven: times to look whether there is something new to learn.
    #[must_use]
    pub fn halves(&self) -> usize {
        self.progress.halves()
    }

    /// Grip (acceleration over g) that is planned with.
    #[must_use]
    pub fn grip(&self) -> f64 {
        self.plan.grip
    }

    /// Deceleration that is planned with.
    #[must_use]
    pub fn brake_mps2(&self) -> f64 {
        self.plan.limits.brake_mps2
    }

    /// Whether the plan is held back by a slide or a warning.
    #[must_use]
    pub fn held_back(&self) -> bool {
        self.caught.is_some_and(|caught| caught.grip <= self.plan.grip + 1e-9)
    }

    /// What the set in use rests on.
    #[must_use]
    pub fn trust(&self) -> Trust {
        self.known.as_ref().unwrap_or(&self.start).trust
    }

    /// The speed profile of the plan.
    #[must_use]
    pub fn profile(&self) -> &SpeedProfile {
        &self.plan.profile
    }

    /// The track.
    #[must_use]
    pub fn track(&self) -> &Track {
        &self.track
    }

    /// How the predictive controller did so far; `None` where the pursuit was chosen.
    #[must_use]
    pub fn solves(&self) -> Option<&Solves> {
        self.predicting.as_ref().map(|controller| &controller.solves)
    }

    /// Where the car was at the last state.
    #[must_use]
    pub fn place(&self) -> Option<Place> {
        self.place
    }

    /// The next command, from a state in the order of stamps. It goes out at `now_s` of the same clock, a little after the state was
    /// measured. A state that is not finite gives the last steering and full braking.
    pub fn command(&mut self, state: &CarState, now_s: f64) -> DriveCommand {
        if !state.is_finite() {
            let steering_rad = self.asked.back().map_or(0.0, |a| self.actuated(a.angle_rad));
            return DriveCommand {
                steering_rad,
                speed_mps: 0.0,
                acceleration_mps2: -self.plan.limits.brake_mps2,
            };
        }
        let measured = *state;
        let state = &self.named.state(&measured);
        let place = self.track.place(state.x_m, state.y_m, self.place.map(|p| p.station_m));
        self.place = Some(place);
        // A clock that went back: what was asked then says nothing of what acts now.
        let age_s = (now_s - state.stamp_s).clamp(0.0, OLDEST_S);
        let from_s = state.stamp_s + age_s;
        if self.asked.back().is_some_and(|a| a.from_s > from_s) {
            self.asked.clear();
            self.governor.reset();
        }
        let halves = self.progress.halves();
        let driven = self.progress.pass(place, self.plan.grip);
        let ends = self.progress.halves() > halves && place.station_m < 0.25 * self.track.length_m();
        if let Some(before) = self.probation.pass(state.stamp_s, place.offset_m, ends, &self.named) {
            // What a wrong model took for a slide was none.
            self.caught = self.caught_before;
            self.tell(before);
        }
        if let Some(driven) = driven {
            self.driven = driven;
            let measured = self.known.or_else(|| Some(self.start).filter(|set| set.trust != Trust::Assumed));
            let promised = measured.map_or(0.0, |set| self.settings.share * self.named.planned(&set).grip());
            self.caught.iter_mut().for_each(|caught| caught.pass(promised));
            if self.caught.is_some() || self.is_assumed() {
                self.renew();
            }
        }
        self.watch(state);
        let Actuator { delay_s, lag_s, .. } = self.late();
        let moment = Moment {
            now: state,
            place,
            track: &self.track,
            plan: &self.plan,
            vehicle: &self.vehicle,
            asked: &self.asked,
            age_s,
            delay_s,
            lag_s,
            assumed: self.is_assumed(),
            weave_mps2: if self.is_assumed() && self.turn_ins {
                weave_mps2(state, place, &self.track, self.vehicle.wheelbase_m(), self.plan.grip)
            } else {
                0.0
            },
            speed_gain_1ps: self.settings.speed_gain_1ps,
        };
        let predicted = self.predicting.as_mut().and_then(|controller| controller.angle_rad(&moment).ok());
        let pursued = || self.pursuing.angle_rad(&moment).unwrap_or(0.0);
        let angle_rad = predicted.unwrap_or_else(pursued);
        let (speed_mps, acceleration_mps2) = self.longitudinal(state, place, angle_rad);
        let told = &self.plan.limits.told;
        let asked = Asked {
            from_s,
            angle_rad,
            acceleration_mps2: acceleration_mps2 - told.resistance_mps2(state.v_x_mps),
        };
        let acceleration_mps2 = acceleration_mps2 / told.gain();
        self.asked.push_back(asked);
        while self.asked.front().is_some_and(|a| a.from_s < state.stamp_s - settles_s(LATEST_S, LATEST_S)) {
            self.asked.pop_front();
        }
        let steering_rad = self.actuated(angle_rad);
        self.memory.push(measured, from_s, steering_rad, LAP_MARGIN * self.plan.profile.lap_time_s());
        DriveCommand { steering_rad, speed_mps, acceleration_mps2 }
    }

    /// The actuator, no later than is made up for.
    fn late(&self) -> Actuator {
        let actuator = self.named.actuator(&self.actuator);
        let delay_s = actuator.delay_s.min(LATEST_S);
        Actuator { delay_s, lag_s: actuator.lag_s.min(LATEST_S - delay_s), ..actuator }
    }

    fn actuated(&self, angle_rad: f64) -> f64 {
        let most = self.vehicle.max_steering_rad;
        let actuator = self.named.actuator(&self.actuator);
        ((angle_rad - actuator.offset_rad) / actuator.gain).clamp(-most, most)
    }
}
