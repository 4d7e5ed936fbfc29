//! The car's own tires as a drive knows them, with what goes along with them: posterior.json, and `TirePosterior` on topics.

use serde::{Deserialize, Serialize};

use crate::{OWN_TIRE_PARAMETERS, OwnTires, VehicleError};

/// Parameters of the tires, in the order of [`OwnTires::to_parameters`].
const TIRES: [&str; OWN_TIRE_PARAMETERS] =
    ["front.stiffness", "front.c", "front.d", "front.e", "rear.stiffness", "rear.c", "rear.d", "rear.e"];

/// A parameter of a [`TirePosterior`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PosteriorParameter {
    /// `front.stiffness` (B C D: cornering stiffness over load), `front.c`, `.d`, `.e` of the Magic Formula, the same of `rear`; `effect.parameter` of what every car has a little of.
    pub name: String,
    /// Unit; `1` for none, `1/rad` of the stiffness.
    pub unit: String,
    /// Mean.
    pub mean: f64,
}

impl PosteriorParameter {
    /// The parameters of both axles' tires, front first.
    #[must_use]
    pub fn of_tires(tires: &OwnTires) -> Vec<Self> {
        let unit = |i: usize| if i.is_multiple_of(4) { "1/rad" } else { "1" }.to_owned();
        let values = tires.to_parameters();
        TIRES
            .iter()
            .enumerate()
            .map(|(i, name)| Self { name: (*name).to_owned(), unit: unit(i), mean: values[i] })
            .collect()
    }
}

/// The tires of the car with its load transfer, combined slip and relaxation (not those of a bare single-track model, which take these on themselves),
/// fitted together with these, and how well a drive knows them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TirePosterior {
    /// Status of the identification that it was made beside: it says nothing of these tires' worth as a prior, their covariance does.
    pub status: String,
    /// Hash of the vehicle file, as in the identification's result.
    pub vehicle_hash: String,
    /// The parameters.
    pub parameters: Vec<PosteriorParameter>,
    /// Their covariance. Of a peak that the drive did not reach it is as wide as without any drive: what a fit says there is the formula's.
    pub covariance: Vec<Vec<f64>>,
    /// Hashes of the seconds of driving that it was fitted on: on these it is a place to start from, never a prior.
    pub data: Vec<String>,
}

impl TirePosterior {
    /// Itself, where it is whole: for what a file or a message says.
    ///
    /// # Errors
    /// [`VehicleError::Posterior`] says what is wrong.
    pub fn checked(self) -> Result<Self, VehicleError> {
        let wrong = |what: &str| Err(VehicleError::Posterior(what.to_owned()));
        let n = self.parameters.len();
        if self.covariance.len() != n || self.covariance.iter().any(|row| row.len() != n) {
            return wrong("the covariance does not have a row and a column for each parameter");
        }
        let means = self.parameters.iter().map(|p| p.mean);
        let finite = means.chain(self.covariance.iter().flatten().copied()).all(f64::is_finite);
        if !finite || (0..n).any(|i| self.covariance[i][i] < 0.0) {
            return wrong("a mean or a covariance is not a finite number");
        }
        self.tires()?;
        Ok(self)
    }

    /// Place of a parameter.
    ///
    /// # Errors
    /// [`VehicleError::Posterior`] where it is missing.
    pub fn place(&self, name: &str) -> Result<usize, VehicleError> {
        let found = self.parameters.iter().position(|p| p.name == name);
        found.ok_or_else(|| VehicleError::Posterior(format!("the parameter `{name}` is missing")))
    }

    /// Mean of a parameter.
    ///
    /// # Errors
    /// [`VehicleError::Posterior`] where it is missing.
    pub fn mean(&self, name: &str) -> Result<f64, VehicleError> {
        Ok(self.parameters[self.place(name)?].mean)
    }

    /// The tires at the mean.
    ///
    /// # Errors
    /// [`VehicleError::Posterior`] where a parameter is missing.
    pub fn tires(&self) -> Result<OwnTires, VehicleError> {
        let mut own = [0.0; OWN_TIRE_PARAMETERS];
        for (value, name) in own.iter_mut().zip(TIRES) {
            *value = self.mean(name)?;
        }
        Ok(OwnTires::from_parameters(&own))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_wrong_with_it_is_named() {
        let tires = OwnTires::from_parameters(&[8.0, 1.4, 0.9, -0.5, 9.0, 1.5, 1.0, 0.2]);
        let parameters = PosteriorParameter::of_tires(&tires);
        assert_eq!((parameters[4].name.as_str(), parameters[4].unit.as_str()), ("rear.stiffness", "1/rad"));
        let good = TirePosterior {
            status: "accepted".to_owned(),
            vehicle_hash: "0".to_owned(),
            covariance: vec![vec![0.0; parameters.len()]; parameters.len()],
            parameters,
            data: Vec::new(),
        };
        assert_eq!(good.tires().unwrap(), tires);
        assert_eq!(good.clone().checked().unwrap(), good);
        let broken = |change: &dyn Fn(&mut TirePosterior)| {
            let mut bad = good.clone();
            change(&mut bad);
            bad.checked().unwrap_err().to_string()
        };
        assert!(broken(&|p| p.parameters[3].name = "front.x".to_owned()).contains("`front.e` is missing"));
        assert!(broken(&|p| drop(p.covariance.pop())).contains("row and a column"));
        assert!(broken(&|p| p.covariance[2][2] = -1.0).contains("not a finite number"));
        assert!(broken(&|p| p.parameters[0].mean = f64::NAN).contains("not a finite number"));
    }
}
