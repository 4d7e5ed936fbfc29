//! Grip to plan with: what sets promise, what was driven, and what the road gave.

use super::caught::{CAUGHT, Caught};
use super::{Driver, Settings};
use crate::Actuator;
use crate::plan::Plan;
use crate::state::{CarState, settles_s, wheels_rad};
use crate::tires::{TireSet, Trust};

/// Share of the most likely peak to explore up to, where the set promises less.
const LIKELY: f64 = 0.96;
/// Share of the way from what was driven to where one would explore to that is gone at once: how far a peak that was not reached is off grows with how far
/// off it was seen from. On `club`, `esses`, `clover` and `harbor` the 1:10 car is as fast as with 1 or
/// faster, and less often far behind.
const AT_ONCE: f64 = 0.7;
/// Grip planned over what half a lap was driven with without a slide, however little a set promises: from a drive that showed little the promise may be
/// below what the car has done, and a plan held there would show no more.
const PROVEN: f64 = 1.05;
/// Share of an assumed grip to begin with: what nobody measured is no promise.
pub(super) const CAREFUL: f64 = 0.5;
/// Grip planned over what the car turned with, up to an assumed grip.
const ASSURED: f64 = 1.2;
/// The same while nobody has measured the tires: that the road gives less is found by a slide then, and the car goes as wide as the step was large. On eight
/// development tracks at mu = 0.4 the 1:10 car left the track in 8 of 80 drives with a fifth, in none with a tenth.
const UNMEASURED: f64 = 1.1;
/// Share of the planned grip up to which the plan may grow: not in the middle of a corner.
const GENTLE: f64 = 0.7;
/// Time in which a car settles after a model was given back.
const SETTLES_S: f64 = 2.0;

impl Driver {
    pub(super) fn watch(&mut self, state: &CarState) {
        let Actuator { delay_s, lag_s, .. } = self.late();
        // Where the wheels were before the first command, nobody knows.
        let from_s = state.stamp_s - settles_s(delay_s, lag_s);
        let seen = self.asked.front().is_some_and(|a| a.from_s <= from_s + 1e-9);
        let acting = wheels_rad(&self.asked, state.stamp_s, delay_s, lag_s).filter(|_| seen);
        let Some(acting) = acting else { return };
        if state.v_x_mps < 1.0 {
            self.governor.reset();
            return;
        }
        let assumed = self.is_assumed();
        let explores = assumed || self.explores();
        let Some(look) = self.governor.look(state, acting, &self.vehicle, &self.plan.tires, assumed) else {
            return;
        };
        if look.given.is_some()
            && let Some(before) = self.probation.slides(&self.named)
        {
            self.trusted_until_s = state.stamp_s + SETTLES_S;
            self.caught = self.caught_before;
            self.tell(before);
        } else if look.given.is_some() && state.stamp_s < self.trusted_until_s {
            // The end of what the model brought about.
        } else if let Some(given) = look.given {
            self.catch(CAUGHT * given, false);
        } else if explores {
            self.turned = self.turned.max(look.turned);
            if look.turned < GENTLE * self.plan.grip && self.allowed() > 1.02 * self.plan.grip {
                self.renew();
            }
        }
    }

    /// Whether nobody measured the tires planned with.
    pub(super) fn is_assumed(&self) -> bool {
        self.start.trust == Trust::Assumed && self.known.is_none() && self.prior.is_none()
    }

    /// Whether nobody has found the peak: a set that promises no more than was shown says nothing against what nobody measured.
    fn explores(&self) -> bool {
        self.trust() == Trust::AcceptedWithin && !self.known.is_some_and(|set| set.peak_reached)
    }

    /// The car slid (`warned`: or somebody says so), and the road gives so much.
    pub(super) fn catch(&mut self, grip: f64, warned: bool) {
        self.turned = self.turned.min(grip);
        self.caught = Some(Caught::new(grip, self.plan.grip, warned).after(self.caught));
        self.renew();
    }

    /// Grip to plan with.
    pub(super) fn allowed(&self) -> f64 {
        let Settings { share, step, prior_step, beyond, .. } = self.settings;
        // Who is told to use less of a known grip uses less of a likely one.
        let of_likely = LIKELY.min(share);
        let base = self.named.planned(self.known.as_ref().unwrap_or(&self.start));
        let shown = base.grip();
        let careful = (UNMEASURED * self.turned).max(CAREFUL * share * shown).min(share * shown);
        let driven = self.driven.max(if base.trust == Trust::Assumed { careful } else { share * shown });
        let driven = driven.max(self.turned.min(share * self.start.grip()));
        let likely_peak = base.likely_peaks.map(|[front, rear]| front.min(rear));
        let likely = likely_peak.unwrap_or(f64::INFINITY);
        // As without a set, in the middle of the lap; in smaller steps beyond what is likely.
        let assured = (ASSURED * self.turned).min(share * self.start.grip());
        let assured =
            if self.explores() { assured.min((of_likely * likely).max(step * self.turned)) } else { 0.0 };
        let proven = PROVEN.min(step) * self.driven;
        let most = (beyond * shown).max(proven);
        let bold = (step * driven).min(most);
        let toward = |peak: f64| driven + AT_ONCE * (of_likely * peak - driven).max(0.0);
        let alone = match base.trust {
            Trust::Assumed => careful.max(self.driven).min(share * shown),
            Trust::Accepted => {
                let peak = of_likely * likely_peak.unwrap_or(shown);
                // What was planned with is no proof against a peak that was found since: a car is wide for long before it slides.
                bold.min(peak.max(self.driven.min(share * likely))).max(share * shown)
            }
            Trust::AcceptedWithin if base.peak_reached => bold.min(share * likely).max(share * shown),
            Trust::AcceptedWithin => bold.min(toward(likely).max(self.driven)).max(share * shown),
            Trust::Provisional => share * shown,
        };
        let grip = match &self.prior {
            _ if base.trust == Trust::Accepted => alone,
            // A prior below what was driven and a step is no reason to drive slower, unless nothing was shown.
            Some(prior) if base.trust == Trust::Assumed => (share * prior.grip()).min(prior_step * driven),
            Some(prior) => toward(prior.grip().min(likely)).max(alone).min(prior_step * driven).min(most),
            None => alone,
        };
        let grip = grip.max(assured);
        self.caught.map_or(grip, |caught| grip.min(caught.grip))
    }

    /// The set that steering rests on.
    pub(super) fn base(&self) -> &TireSet {
        self.known.as_ref().or(self.prior.as_ref()).unwrap_or(&self.start)
    }

    pub(super) fn renew(&mut self) {
        let set = self.named.planned(self.base());
        self.plan = Plan::new(&self.vehicle, &self.drivetrain, &self.track, &set, self.allowed());
        self.progress.planned(self.plan.grip);
        self.governor.reset();
    }
}
