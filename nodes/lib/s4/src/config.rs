//! Which network, and how large.

use crate::Error;
use serde::{Deserialize, Serialize};

/// Family of residual networks. All three share encoder, decoder, trainer and interface, so that
/// they differ in their memory only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Architecture {
    /// Diagonal state-space layers (S4D), the paper's network.
    S4,
    /// No memory: a multilayer perceptron, sample by sample.
    Mlp,
    /// Elman recurrence with tanh, trained through time.
    Rnn,
}

/// Shape of a residual network.
///
/// The paper leaves all of this open. The defaults: 16 channels, 16 states and one layer; initial steps of 0.1 to 1 sample,
/// that is decay times of 2 to 20 samples. At 100 Hz these are 20 to 200 ms, where tire relaxation, load transfer and
/// actuator lags lie; for another rate scale the steps with the sample time. The 0.001 to 0.1 of the S4D authors' example
/// is memory of seconds: on a simulated car it left 1.4 to 7 times the error (example `defaults`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NetworkConfig {
    /// Family of the network.
    pub architecture: Architecture,
    /// Number of input channels: 4 for `[v_x, v_y, w, d]`.
    pub inputs: usize,
    /// Number of output channels: 2 for `[dv_y, dw]`.
    pub outputs: usize,
    /// Width H of the hidden sequence.
    pub d_model: usize,
    /// State size N of each S4D channel, even: N/2 conjugate pairs. Only S4 reads it.
    pub d_state: usize,
    /// Number of hidden layers (S4D, dense or Elman).
    pub layers: usize,
    /// Smallest initial S4D step Delta, in samples: the longest memory, with a decay time of 2/Delta samples.
    pub step_min: f64,
    /// Largest initial S4D step Delta, in samples: the shortest memory.
    pub step_max: f64,
}

impl Default for NetworkConfig {
    fn default() -> Self {
        Self {
            architecture: Architecture::S4,
            inputs: 4,
            outputs: 2,
            d_model: 16,
            d_state: 16,
            layers: 1,
            step_min: 0.1,
            step_max: 1.0,
        }
    }
}

impl NetworkConfig {
    /// Refuses shapes that cannot be built.
    ///
    /// # Errors
    /// [`Error::Setting`] names the first field that is out of range.
    pub fn validate(&self) -> Result<(), Error> {
        let widths = [
            ("inputs", self.inputs),
            ("outputs", self.outputs),
            ("d_model", self.d_model),
            ("layers", self.layers),
        ];
        for (name, value) in widths {
            if !(1..=SIZE_MAX).contains(&value) {
                return Err(Error::Setting { name, value: value as f64, expected: "1 to 1024" });
            }
        }
        if !(2..=SIZE_MAX).contains(&self.d_state) || !self.d_state.is_multiple_of(2) {
            let value = self.d_state as f64;
            return Err(Error::Setting { name: "d_state", value, expected: "an even number from 2 to 1024" });
        }
        if !(self.step_min > 0.0 && self.step_min.is_finite()) {
            return Err(Error::Setting { name: "step_min", value: self.step_min, expected: "positive" });
        }
        if !(self.step_max >= self.step_min && self.step_max.is_finite()) {
            let value = self.step_max;
            return Err(Error::Setting { name: "step_max", value, expected: "at least step_min" });
        }
        Ok(())
    }
}

/// Bound on every width and count: a message or file that asks for more is corrupt.
const SIZE_MAX: usize = 1024;
