//! The same model on tract, which is pure Rust and needs no library.

use std::path::Path;
use std::sync::Arc;

use tract_onnx::prelude::*;

use crate::error::FrictionError;
use crate::network::Network;
use crate::tensor::INPUT_SIDE;

/// A model that tract has optimised.
#[derive(Debug)]
pub struct Tract {
    model: Arc<TypedRunnableModel>,
}

impl Tract {
    /// Loads a model.
    ///
    /// # Errors
    /// [`FrictionError::Model`].
    pub fn load(model: &Path) -> Result<Self, FrictionError> {
        let side = INPUT_SIDE as usize;
        let load = || -> TractResult<_> {
            tract_onnx::onnx()
                .model_for_path(model)?
                .with_input_fact(0, f32::fact([1, 3, side, side]).into())?
                .into_optimized()?
                .into_runnable()
        };
        let failed =
            |e: TractError| FrictionError::Model { path: model.to_path_buf(), message: e.to_string() };
        Ok(Self { model: load().map_err(failed)? })
    }
}

impl Network for Tract {
    fn logits(&mut self, tensor: &[f32]) -> Result<Vec<f32>, FrictionError> {
        let side = INPUT_SIDE as usize;
        let run = || -> TractResult<Vec<f32>> {
            let input = Tensor::from_shape(&[1, 3, side, side], tensor)?;
            let outputs = self.model.run(tvec!(input.into()))?;
            let view = outputs[0].to_plain_array_view::<f32>()?;
            Ok(view.iter().copied().collect())
        };
        run().map_err(|e| FrictionError::Inference { message: e.to_string() })
    }
}
