//! What a run starts from.

use gripsight_vehicle::{MagicFormula, PacejkaParameters, VehicleParameters};

use crate::{AcceptedSet, Config, FrictionPrior, IdentificationError, Method, vehicle_hash};

/// Where a run starts: the previous set, or the configured tires with D from the friction prior where there is one. The paper's D_initial = mu_hat
/// leaves B, C and E as they are; the robust method keeps the stiffness, of which a friction prior says nothing.
pub(crate) fn initial_tires(
    prior: Option<FrictionPrior>,
    previous: Option<&AcceptedSet>,
    config: &Config,
) -> PacejkaParameters {
    if let Some(previous) = previous {
        return previous.phi_p;
    }
    let start = |axle: &MagicFormula| match (prior, config.method) {
        (None, _) => *axle,
        (Some(p), Method::Paper) => MagicFormula { d: p.mu, ..*axle },
        (Some(p), Method::Robust) => {
            MagicFormula::from_stiffness(axle.normalized_stiffness(), axle.c, p.mu, axle.e)
        }
    };
    PacejkaParameters { front: start(&config.initial.front), rear: start(&config.initial.rear) }
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
        let of = |prior, method| initial_tires(prior, None, &Config { method, ..Config::default() }).front;
        let without = of(None, Method::Paper);
        assert_eq!(of(prior, Method::Paper), MagicFormula { d: 0.8, ..without });
        let robust = of(prior, Method::Robust);
        assert!((robust.normalized_stiffness() - without.normalized_stiffness()).abs() < 1e-12);
        assert_eq!((robust.c, robust.d, robust.e), (without.c, 0.8, without.e));
    }
}
