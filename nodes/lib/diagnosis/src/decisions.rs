//! Every number that the answer rests on.
//!
//! `usual_flexible` is what 15 development drives of the reference car in which nothing is the matter (`withheld make --cases 60 --seed 4 --pool
//! development`) ask for at most; the others are statements about cars, not about a generator.

use gripsight_model::Site;

/// Share of a size that matters that any car may have of an effect, as a standard deviation.
pub(crate) const USUAL_SHARE: f64 = 0.05;

/// Standard deviation of the size of an effect that matters, in sizes that matter.
pub(crate) const WIDE: f64 = 2.0;

/// Probability that a given effect matters, and that something else at a site does, before the data are looked at: one or two of thirty.
pub(crate) const PRIOR: f64 = 0.05;

/// Standard deviation of flexible terms where something is missing in the model.
pub(crate) const FLEXIBLE_WIDE: f64 = 1.5;

/// Probability below which an effect is not listed.
pub(crate) const LISTED: f64 = 0.02;

/// Standard deviation of a site's flexible terms in drives in which nothing is the matter: of its first, second, … term, the last for the rest.
pub(crate) fn usual_flexible(site: Site, term: usize) -> f64 {
    let levels: &[f64] = match site {
        Site::Steering | Site::Vy => &[0.06],
        Site::YawRate => &[0.03],
        Site::Imu => &[0.06, 0.06, 0.06, 0.06, 0.06, 0.06, 0.06, 0.1],
        Site::FrontAxle | Site::RearAxle | Site::LoadsAndBody | Site::Vx => &[0.1],
        // The response to the command, what holds the car back, what depends on either squared, the differential.
        Site::DriveTrain => &[0.2, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1, 0.3, 0.3, 0.1],
        Site::RoadAndWind => &[0.05],
    };
    levels.get(term).or(levels.last()).copied().unwrap_or(FLEXIBLE_WIDE)
}

/// Share of the error on data held out, noise included, that is left without free terms and that they must close to be needed.
pub(crate) const LEAST_CLOSED: f64 = 0.025;

/// Mean squared error over noise, the lower end of its interval, above which something is missing in the model: what even all free terms leave counts as
/// noise, and hides there. Of 102 development drives without effect (`withheld make --pool development`, seeds 11, 12, 31, 77) other tires leave 3.9 at most,
/// 2.8 where the noise can be told.
pub(crate) const SOUND_ERROR: f64 = 4.0;

/// Squared error that a model leaves of a later drive, fitted to it, over that of the earlier drive which it was found in, above which something differs although no
/// change stands out. Of 23 pairs of drives with nothing changed (12 of the reference car, 11 of two stretches of one recording: `tests/results/withheld/out_of_reach.csv`) 22
/// have 0.8 to 3.0, and one 42, an oval's other corner; a lag, a lever arm and a low pass that were not seen in recordings have 36, 12 and 6.
pub(crate) const OUT_OF_REACH: f64 = 4.0;

/// Probability at most that is stated of effects and free terms that held-out data do not need.
pub(crate) const NEEDLESS: f64 = 0.05;

/// Probability from which free terms are needed, and a change between two drives is stated: more likely than not.
pub(crate) const LIKELY: f64 = 0.5;

/// Errors of the model that all blocks share and no scatter shows, as shares of a size and of a size that matters, one standard deviation: with it 9 of
/// 10 sizes of development cases lie in their intervals.
pub(crate) const SHARED_ERROR: f64 = 0.04;

/// Chance that an effect which is left in the model is a cause: coefficients of the logarithm of the odds. A constant, then the logarithm of its size over the
/// half width of its interval, over [`CHANCE_UNIT`]. `tests/results/withheld/fit_chance.py` fits them on development cases of seeds 11, 12 (reference car) and 771
/// (foreign plants), but for those beside which something that does nearly the same is left out of the library ([`unasked`]). The share that held-out data need an
/// effect for told nothing on top.
const CHANCE: [f64; 2] = [0.03, 4.33];

/// Chance of an effect whose size is as sure as can be: a cause that the library does not have may look like it. Fitted along with [`CHANCE`].
const MOST_SURE: f64 = 0.955;

/// Unit of the sign that [`CHANCE`] is counted in, and what tells no less than less.
const CHANCE_UNIT: f64 = 2.5;
const CHANCE_LEAST: f64 = 0.1;

/// Chance that an effect in the model is a cause, and that a difference between two drives is a change, whose size is so many half widths of its 90 % interval
/// away from nothing.
pub(crate) fn chance(size_over_half_width: f64) -> f64 {
    let [constant, by_size] = CHANCE;
    let size = size_over_half_width.max(CHANCE_LEAST);
    let log_odds = constant + by_size * (size / CHANCE_UNIT).ln();
    MOST_SURE / (1.0 + (-log_odds).exp())
}

/// Share of an effect that stays unexplained where another one, which does nearly the same and is not among the candidates, is the cause: the lower end of its
/// 90 % interval by `fit_chance.py` on the cases above, as a wrong name is worse than none. So an effect that leaves less of what the free terms of its site
/// explain is taken for the cause.
pub(crate) const RIVAL_LEAVES: f64 = 0.105;

/// Standard deviations in half the width of a 90 % interval.
const HALF_WIDTH: f64 = 1.645;

/// How likely the data are where another effect, which does nearly the same and nobody asked for, is the cause, over how likely they are where the effect is: it
/// would leave [`RIVAL_LEAVES`] of what the effect explains, and `over_unexplained` says what is left that looks like it. At most 1: free terms tell only roughly.
pub(crate) fn unasked(size_over_half_width: f64, over_unexplained: f64) -> f64 {
    let size = HALF_WIDTH * size_over_half_width;
    let log_ratio = -0.5 * size * size * RIVAL_LEAVES * (RIVAL_LEAVES - 2.0 / over_unexplained);
    log_ratio.min(0.0).exp()
}

/// Chance from which the verdict names an effect: twice as likely a cause as not. On the cases above 135 of 164 causes, and 13 others.
pub(crate) const NAMED: f64 = 2.0 / 3.0;

/// Share of what free terms explain, as far as it looks like an effect, that the effect must explain to be named: free terms do only roughly what an
/// unmodelled cause does, and the rest may be blamed on whatever looks like it.
pub(crate) const LEAST_OVER_UNEXPLAINED: f64 = 0.5;
