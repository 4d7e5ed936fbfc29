//! The friction basis B: what each road state is worth, with its spread.

use std::ops::RangeInclusive;
use std::path::Path;

use serde::Deserialize;

use crate::error::FrictionError;
use crate::files::read_text;

/// The basis file of the suite, compiled in so that no installation is needed to read a picture.
const DEFAULT: &str = include_str!("../../../../params/friction_basis.yaml");

/// How many road states, and what each may be worth.
const CLASSES: RangeInclusive<usize> = 2..=64;
const FRICTIONS: RangeInclusive<f64> = 0.01..=3.0;
const SIGMAS: RangeInclusive<f64> = 0.001..=3.0;

/// A friction coefficient and its standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Prior {
    /// Expected peak friction coefficient, dimensionless.
    pub mu: f64,
    /// Standard deviation of `mu`.
    pub sigma: f64,
}

/// One road state.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionClass {
    /// Its name: dry, wet, water, snow, ice.
    pub name: String,
    /// Nominal peak friction coefficient.
    pub mu: f64,
    /// Spread of that coefficient over roads, tires and temperatures, one standard deviation.
    pub sigma: f64,
}

/// The road states in the order of the network's outputs, and what to say when nothing is known.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Basis {
    /// The states.
    pub classes: Vec<FrictionClass>,
    /// Published where a picture cannot be used.
    pub uninformative: Prior,
}

impl Basis {
    /// Reads a basis from YAML, as in `params/friction_basis.yaml`.
    ///
    /// # Errors
    /// [`FrictionError::BadBasis`] where the text does not parse, has not 2 to 64 classes, or a value is no friction (0.01 to 3) or no spread of one
    /// (0.001 to 3).
    pub fn from_yaml(text: &str) -> Result<Self, FrictionError> {
        let basis: Self =
            serde_saphyr::from_str(text).map_err(|e| FrictionError::BadBasis { message: e.to_string() })?;
        let bad = |message: String| Err(FrictionError::BadBasis { message });
        if !CLASSES.contains(&basis.classes.len()) {
            return bad(format!("expected {CLASSES:?} classes, got {}", basis.classes.len()));
        }
        let pairs = basis.classes.iter().map(|c| (c.name.as_str(), c.mu, c.sigma));
        let last = ("uninformative", basis.uninformative.mu, basis.uninformative.sigma);
        for (name, mu, sigma) in pairs.chain([last]) {
            if !(FRICTIONS.contains(&mu) && SIGMAS.contains(&sigma)) {
                return bad(format!(
                    "{name}: expected mu of {FRICTIONS:?} and sigma of {SIGMAS:?}, got {mu} and {sigma}"
                ));
            }
        }
        Ok(basis)
    }

    /// Reads a file.
    ///
    /// # Errors
    /// [`FrictionError::Read`], or as [`Basis::from_yaml`], with the file's name.
    pub fn read_file(path: &Path) -> Result<Self, FrictionError> {
        Self::from_yaml(&read_text(path)?).map_err(|error| match error {
            FrictionError::BadBasis { message } => {
                FrictionError::BadBasis { message: format!("{}: {message}", path.display()) }
            }
            other => other,
        })
    }

    /// The basis that is compiled in: `params/friction_basis.yaml` of this version.
    ///
    /// # Errors
    /// None for the file as released; the signature is [`Basis::from_yaml`]'s.
    pub fn builtin() -> Result<Self, FrictionError> {
        Self::from_yaml(DEFAULT)
    }

    /// mu = p . B and the standard deviation of the mixture, for `p` in the order of the classes.
    #[must_use]
    pub fn prior(&self, p: &[f64]) -> Prior {
        let pairs = || p.iter().zip(&self.classes);
        let mu: f64 = pairs().map(|(p, c)| p * c.mu).sum();
        let second: f64 = pairs().map(|(p, c)| p * (c.sigma * c.sigma + c.mu * c.mu)).sum();
        Prior { mu, sigma: (second - mu * mu).max(0.0).sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    #[test]
    fn the_released_basis_is_ordered_from_dry_to_ice() {
        let basis = Basis::builtin().unwrap();
        let names: Vec<_> = basis.classes.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["dry", "wet", "water", "snow", "ice"]);
        assert!(basis.classes.windows(2).all(|w| w[0].mu > w[1].mu));
    }

    #[test]
    fn one_class_gives_its_own_value_and_spread() {
        let basis = Basis::builtin().unwrap();
        let got = basis.prior(&[0.0, 1.0, 0.0, 0.0, 0.0]);
        assert_relative_eq!(got.mu, 0.60, epsilon = 1e-12);
        assert_relative_eq!(got.sigma, 0.10, epsilon = 1e-9);
    }

    proptest! {
        /// The variance of a mixture is the mean of the variances plus the variance of the means: never below the former.
        #[test]
        fn a_mixture_is_at_least_as_wide_as_its_parts(w in prop::collection::vec(0.01f64..1.0, 5)) {
            let basis = Basis::builtin().unwrap();
            let total: f64 = w.iter().sum();
            let p: Vec<f64> = w.iter().map(|x| x / total).collect();
            let got = basis.prior(&p);
            let within: f64 = p.iter().zip(&basis.classes).map(|(p, c)| p * c.sigma * c.sigma).sum();
            let between: f64 = p.iter().zip(&basis.classes).map(|(p, c)| p * (c.mu - got.mu).powi(2)).sum();
            prop_assert!((got.sigma.powi(2) - within - between).abs() < 1e-12);
            prop_assert!(got.mu > 0.10 - 1e-12 && got.mu < 0.85 + 1e-12);
        }
    }

    #[test]
    fn nonsense_is_refused() {
        assert!(Basis::from_yaml("classes: []\nuninformative: {mu: 0.5, sigma: 0.3}").is_err());
        let zero = DEFAULT.replace("mu: 0.10", "mu: 0.0");
        let text = Basis::from_yaml(&zero).unwrap_err().to_string();
        assert!(text.contains("ice"), "{text}");
    }
}
