//! The same model on tract, which is pure Rust and needs no library.

use std::path::Path;
use std::sync::Arc;

use tract_onnx::prelude::*;

use crate::error::FrictionError;
use crate::network::{Answer, Network};
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
    fn read(&mut self, tensor: &[f32]) -> Result<Answer, FrictionError> {
        let side = INPUT_SIDE as usize;
        let run = || -> TractResult<Answer> {
            let input = Tensor::from_shape(&[1, 3, side, side], tensor)?;
            let outputs = self.model.run(tvec!(input.into()))?;
            let numbers = |output: &TValue| -> TractResult<Vec<f32>> {
                Ok(output.to_plain_array_view::<f32>()?.iter().copied().collect())
            };
            let unfamiliarity = outputs.get(1).map(numbers).transpose()?.and_then(|d| d.first().copied());
            Ok(Answer { logits: numbers(&outputs[0])?, unfamiliarity })
        };
        run().map_err(|e| FrictionError::Inference { message: e.to_string() })
    }
}
