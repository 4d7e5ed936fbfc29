//! Every number that the graded answer rests on.
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

/// Share of the error on data held out, noise included, that is left without an effect and that it must close to be stated.
pub(crate) const LEAST_CLOSED: f64 = 0.01;

/// Probability from which an effect is stated as a cause: more likely than not.
pub(crate) const LIKELY: f64 = 0.5;

/// Share of what free terms explain, as far as it looks like an effect, that the effect must explain: free terms do only roughly what an
/// unmodelled cause does, and the rest may be blamed on whatever looks like it. Set on the development cases of seeds 4 and 771.
pub(crate) const LEAST_BESIDE: f64 = 0.3;
