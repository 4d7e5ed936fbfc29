//! What a network trained on photographs sees in a road: many numbers, whose meaning nobody named, beside the few of [`crate::appearance`].

use std::path::Path;

use ort::session::Session;
use ort::value::TensorRef;

use crate::error::FrictionError;
use crate::network::session;

/// Width and height of its input, pixels.
pub const EMBEDDING_SIDE: u32 = 160;
/// So many numbers.
pub const EMBEDDED: usize = 192;
/// Differences of these numbers that mean nothing: a fifth of their spread over roads.
pub(crate) const LEAST_EMBEDDED_SCALE: f64 = 0.5;

/// Something that embeds pictures.
pub trait Embedder: Send {
    /// [`EMBEDDED`] numbers of a picture: `tensor` holds three planes of [`EMBEDDING_SIDE`]^2 values, normalised as for [`crate::Network`].
    ///
    /// # Errors
    /// [`FrictionError::Inference`].
    fn embed(&mut self, tensor: &[f32]) -> Result<Vec<f64>, FrictionError>;
}

/// The embedding model on ONNX Runtime.
#[derive(Debug)]
pub struct OnnxEmbedder {
    session: Session,
}

impl OnnxEmbedder {
    /// As [`crate::OnnxRuntime::load`].
    ///
    /// # Errors
    /// [`FrictionError::Library`] or [`FrictionError::Model`].
    pub fn load(library: &Path, model: &Path) -> Result<Self, FrictionError> {
        Ok(Self { session: session(library, model, EMBEDDING_SIDE, 1..=1, EMBEDDED as i64)? })
    }
}

impl Embedder for OnnxEmbedder {
    fn embed(&mut self, tensor: &[f32]) -> Result<Vec<f64>, FrictionError> {
        let failed = |e: ort::Error| FrictionError::Inference { message: e.to_string() };
        let side = EMBEDDING_SIDE as usize;
        let input = TensorRef::from_array_view(([1, 3, side, side], tensor)).map_err(failed)?;
        let outputs = self.session.run(ort::inputs![input]).map_err(failed)?;
        let (_, numbers) = outputs[0].try_extract_tensor::<f32>().map_err(failed)?;
        if numbers.len() != EMBEDDED || !numbers.iter().all(|x| x.is_finite()) {
            let message = format!("expected {EMBEDDED} finite numbers, got {}", numbers.len());
            return Err(FrictionError::Inference { message });
        }
        Ok(numbers.iter().map(|x| f64::from(*x)).collect())
    }
}
