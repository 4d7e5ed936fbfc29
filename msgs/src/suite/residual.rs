//! The learned residual model and the live residual.

use serde::{Deserialize, Serialize};

use crate::standard::std_msgs::Header;
use crate::{Handshake, MagicFormula, Message, Range};

/// The learned residual model: what the single-track model with the candidate's tires leaves over.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ResidualModel {
    /// Stamp of the last sample of the sequence trained on.
    pub header: Header,
    /// The candidate that this answers.
    pub handshake: Handshake,
    /// Front tires that the residual is relative to.
    pub front: MagicFormula,
    /// Rear tires that the residual is relative to.
    pub rear: MagicFormula,
    /// One of s4, mlp, rnn or none.
    pub architecture: String,
    /// Channels (s4), width of the hidden layers (mlp, rnn).
    pub d_model: u32,
    /// Complex states per channel (s4), 0 otherwise.
    pub d_state: u32,
    /// Layers.
    pub layers: u32,
    /// Time step that the model is trained for (s).
    pub dt_s: f64,
    /// Steps ahead over which a residual was taken.
    pub horizon: u32,
    /// Names of the inputs, in the order of the weights.
    pub inputs: Vec<String>,
    /// Subtracted from the inputs (unit of each input).
    pub input_mean: Vec<f64>,
    /// The inputs are divided by this (unit of each input).
    pub input_scale: Vec<f64>,
    /// Names of the outputs, in the order of the weights.
    pub outputs: Vec<String>,
    /// The outputs are multiplied by this (unit of each output).
    pub output_scale: Vec<f64>,
    /// All weights, in the architecture's order.
    pub weights: Vec<f64>,
    /// Front slip angles trained on (rad).
    pub front_slip_rad: Range,
    /// Rear slip angles trained on (rad).
    pub rear_slip_rad: Range,
    /// Forward speeds trained on (m/s).
    pub v_x_mps: Range,
    /// Epochs trained.
    pub epochs: u32,
    /// Samples trained on.
    pub samples: u32,
    /// Mean squared error of the normalised residual, training part.
    pub training_loss: f64,
    /// The same on the part held back.
    pub validation_loss: f64,
    /// Time that the training took (s).
    pub training_time_s: f64,
}

impl Message for ResidualModel {
    const TYPE: &'static str = "gripsight_msgs/msg/ResidualModel";
}

/// The residual of one sample, live: what happened less what the corrected model said would happen.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Residual {
    /// Stamp of the sample predicted.
    pub header: Header,
    /// The model in use.
    pub handshake: Handshake,
    /// Time from the sample that the prediction starts from (s).
    pub dt_s: f64,
    /// Measured less single-track model, lateral speed (m/s).
    pub v_y_nominal_mps: f64,
    /// Measured less single-track model, yaw rate (rad/s).
    pub yaw_rate_nominal_radps: f64,
    /// Measured less corrected model, lateral speed (m/s).
    pub v_y_corrected_mps: f64,
    /// Measured less corrected model, yaw rate (rad/s).
    pub yaw_rate_corrected_radps: f64,
    /// Slip angle of the front axle (rad).
    pub front_slip_rad: f64,
    /// Slip angle of the rear axle (rad).
    pub rear_slip_rad: f64,
    /// True when a slip angle lies outside those trained on.
    pub extrapolated: bool,
}

impl Message for Residual {
    const TYPE: &'static str = "gripsight_msgs/msg/Residual";
}
