//! The learned residual as plain numbers: it survives a ROS message bit for bit.

use gripsight_s4::{Architecture, NetworkConfig, Normalization, ResidualNetwork};
use gripsight_vehicle::PacejkaParameters;
use serde::{Deserialize, Serialize};

use crate::{IdentificationError, PerAxle, Range, ResidualKind, RunKey};

/// Names of the inputs, in the order of the weights.
pub const INPUTS: [&str; 4] = ["v_x_mps", "v_y_mps", "yaw_rate_radps", "steering_rad"];
/// Names of the outputs: change of the state per time step `dt_s` that the nominal model does not give.
pub const OUTPUTS: [&str; 2] = ["v_y_mps", "yaw_rate_radps"];

/// A residual network with all that its use needs, tied to the candidate that it was trained against.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResidualModel {
    /// The candidate that this answers.
    pub key: RunKey,
    /// The tires that the residual is relative to.
    pub phi_p: PacejkaParameters,
    /// Family of the network.
    pub architecture: ResidualKind,
    /// Width; 0 without a network.
    pub d_model: usize,
    /// States per channel, S4 only.
    pub d_state: usize,
    /// Hidden layers.
    pub layers: usize,
    /// Time step that the outputs are for.
    pub dt_s: f64,
    /// Steps ahead over which a residual was taken before it was divided by their number.
    pub horizon: usize,
    /// Subtracted from the inputs, in their units.
    pub input_mean: Vec<f64>,
    /// The inputs are divided by this, in their units.
    pub input_scale: Vec<f64>,
    /// The outputs are multiplied by this, in their units.
    pub output_scale: Vec<f64>,
    /// All weights, in the architecture's order.
    pub weights: Vec<f64>,
    /// Slip angles trained on: beyond them the residual is an extrapolation.
    pub slip_range_rad: PerAxle<Range>,
    /// Forward speeds trained on.
    pub v_x_range_mps: Range,
    /// Epochs trained.
    pub epochs: usize,
    /// Samples trained on.
    pub samples: usize,
    /// Mean squared error of the normalised residual on the training part.
    pub training_loss: f64,
    /// The same on the validation part.
    pub validation_loss: f64,
}

impl ResidualModel {
    /// The network, ready to run; `None` for [`ResidualKind::None`].
    ///
    /// # Errors
    /// [`IdentificationError::Network`] where sizes and weights do not fit each other.
    pub fn network(&self) -> Result<Option<ResidualNetwork>, IdentificationError> {
        let Some(architecture) = self.architecture.architecture() else { return Ok(None) };
        let config = NetworkConfig {
            architecture,
            inputs: INPUTS.len(),
            outputs: OUTPUTS.len(),
            d_model: self.d_model,
            d_state: if architecture == Architecture::S4 {
                self.d_state
            } else {
                NetworkConfig::default().d_state
            },
            layers: self.layers,
            ..NetworkConfig::default()
        };
        let normalization = Normalization {
            input_mean: self.input_mean.clone(),
            input_scale: self.input_scale.clone(),
            output_scale: self.output_scale.clone(),
        };
        Ok(Some(ResidualNetwork::from_weights(config, normalization, self.weights.clone())?))
    }
}
