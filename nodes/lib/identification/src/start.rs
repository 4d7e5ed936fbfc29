//! What a run starts from.

use gripsight_vehicle::{MagicFormula, PacejkaParameters, VehicleParameters};

use crate::{AcceptedSet, Config, FrictionPrior, IdentificationError, Method, vehicle_hash};

/// Where a run starts: the previous set, or the configured tires with D from the friction prior where there is one. The paper's D_initial = mu_hat
/// leaves B, C and E as they are; the robust method keeps the stiffness, of which a friction prior says nothing.
pub(crate) fn initial_tires(
    prior: Option<FrictionPrior>,
    previous: Option<&AcceptedSet>,
    method: Method,
    configured: &PacejkaParameters,
) -> PacejkaParameters {
    if let Some(previous) = previous {
        return previous.phi_p;
    }
    let start = |axle: &MagicFormula| match (prior, method) {
        (None, _) => *axle,
        (Some(p), Method::Paper) => MagicFormula { d: p.mu, ..*axle },
        (Some(p), Method::Robust) => {
            MagicFormula::from_stiffness(axle.normalized_stiffness(), axle.c, p.mu, axle.e)
        }
    };
    PacejkaParameters { front: start(&configured.front), rear: start(&configured.rear) }
}

/// The paper's loop does not start softer than this share of the direct fit's stiffness. Where the tires to begin with give a quarter of the force, as
/// those of a 1:10 car do on a full-size one, the network has to supply the other three quarters, damping included, from a drive that is nearly
/// steady: the virtual test leaves what was driven, or ends at once (development drives of CommonRoad's cars).
const LEAST_STIFFNESS: f64 = 0.5;

/// Both axles as stiff as configured, or as that share of the mean of the direct fit's where it is more; the peak stays.
pub(crate) fn no_softer(configured: &PacejkaParameters, direct: &PacejkaParameters) -> PacejkaParameters {
    let mean = 0.5 * (direct.front.normalized_stiffness() + direct.rear.normalized_stiffness());
    let axle = |axle: &MagicFormula| {
        let stiffness = axle.normalized_stiffness().max(LEAST_STIFFNESS * mean);
        MagicFormula::from_stiffness(stiffness, axle.c, axle.d, axle.e)
    };
    PacejkaParameters { front: axle(&configured.front), rear: axle(&configured.rear) }
}

/// Whether a run can begin with this.
pub(crate) fn check(
    vehicle: &VehicleParameters,
    prior: Option<FrictionPrior>,
    previous: Option<&AcceptedSet>,
    config: &Config,
) -> Result<(), IdentificationError> {
    let setting = |name, got, must| Err(IdentificationError::Setting { name, got, must });
    if let Some(p) = prior {
        let (low, high) = crate::tires::D_BOUNDS;
        if !(low..=high).contains(&p.mu) {
            return setting("friction prior mu", p.mu, "between 0.05 and 3.5");
        }
        if !(p.sigma.is_finite() && p.sigma > 0.0) {
            return setting("friction prior sigma", p.sigma, "positive and finite");
        }
    }
    if let Some(previous) = previous.filter(|p| p.vehicle_hash != vehicle_hash(vehicle)) {
        let (expected, got) = (vehicle_hash(vehicle), previous.vehicle_hash.clone());
        return Err(IdentificationError::OtherCar { expected, got });
    }
    if !config.initial.is_finite() {
        return Err(IdentificationError::NotFinite { what: "initial tires" });
    }
    if config.max_iterations == 0 {
        return setting("max_iterations", 0.0, "at least 1");
    }
    if !(config.tolerance.is_finite() && config.tolerance > 0.0) {
        return setting("tolerance", config.tolerance, "positive and finite");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prior_sets_d_alone_in_the_paper_s_method_and_keeps_the_stiffness_in_the_robust_one() {
        let prior = Some(FrictionPrior { mu: 0.8, sigma: 0.1 });
        let of = |prior, method| initial_tires(prior, None, method, &Config::default().initial).front;
        let without = of(None, Method::Paper);
        assert_eq!(of(prior, Method::Paper), MagicFormula { d: 0.8, ..without });
        let robust = of(prior, Method::Robust);
        assert!((robust.normalized_stiffness() - without.normalized_stiffness()).abs() < 1e-12);
        assert_eq!((robust.c, robust.d, robust.e), (without.c, 0.8, without.e));
    }

    #[test]
    fn a_start_that_is_far_too_soft_is_stiffened_and_keeps_its_peak() {
        let configured = Config::default().initial;
        let stiff = MagicFormula::from_stiffness(24.0, 1.3, 0.9, 0.0);
        let started = no_softer(&configured, &PacejkaParameters { front: stiff, rear: stiff }).rear;
        assert!((started.normalized_stiffness() - 12.0).abs() < 1e-12);
        assert_eq!((started.c, started.d, started.e), (1.4, 0.51, 0.0));
        let soft = MagicFormula::from_stiffness(9.0, 1.3, 0.9, 0.0);
        let kept = no_softer(&configured, &PacejkaParameters { front: soft, rear: soft });
        assert!((kept.front.normalized_stiffness() - 6.0).abs() < 1e-12);
    }
}
