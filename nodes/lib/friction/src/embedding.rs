//! What a network trained on photographs sees in a road: many numbers, whose meaning nobody named, beside the few of [`crate::appearance`]; and snow, which
//! the camera network knows from renders alone.

use std::path::Path;

use ort::session::Session;
use ort::value::TensorRef;

use crate::error::FrictionError;
use crate::network::session;

/// Width and height of its input, pixels.
pub const EMBEDDING_SIDE: u32 = 192;
/// So many numbers.
pub const EMBEDDED: usize = 192;
/// Differences of these numbers that mean nothing: a fifth of their spread over roads.
pub(crate) const LEAST_EMBEDDED_SCALE: f64 = 0.5;

/// What is seen in a picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Embedding {
    /// [`EMBEDDED`] numbers.
    pub numbers: Vec<f64>,
    /// Probability that it shows snow, where snow is no rarer than other roads.
    pub snow: f64,
}

/// Something that embeds pictures.
pub trait Embedder: Send {
    /// Embeds a picture: `tensor` holds three planes of [`EMBEDDING_SIDE`]^2 values, normalised as for [`crate::Network`].
    ///
    /// # Errors
    /// [`FrictionError::Inference`].
    fn embed(&mut self, tensor: &[f32]) -> Result<Embedding, FrictionError>;
}

/// What the odds of ImageNet's six classes that live in snow (alp, ski, snowmobile, snowplow, dog sled, bobsled) are multiplied by: they are six of a thousand
/// there, and a road in snow is often taken for a car. Chosen on the development pictures of `tests/results/camera_prior/real_roads.csv` by
/// `snow_odds.py` there.
const SNOW_ODDS: f64 = 8.0;

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
        Ok(Self { session: session(library, model, EMBEDDING_SIDE, 2..=2, EMBEDDED as i64)? })
    }
}

impl Embedder for OnnxEmbedder {
    fn embed(&mut self, tensor: &[f32]) -> Result<Embedding, FrictionError> {
        let failed = |e: ort::Error| FrictionError::Inference { message: e.to_string() };
        let side = EMBEDDING_SIDE as usize;
        let input = TensorRef::from_array_view(([1, 3, side, side], tensor)).map_err(failed)?;
        let outputs = self.session.run(ort::inputs![input]).map_err(failed)?;
        let (_, numbers) = outputs[0].try_extract_tensor::<f32>().map_err(failed)?;
        let (_, snow) = outputs[1].try_extract_tensor::<f32>().map_err(failed)?;
        if numbers.len() != EMBEDDED || snow.len() != 1 || !numbers.iter().chain(snow).all(|x| x.is_finite())
        {
            let message = format!(
                "expected {EMBEDDED} finite numbers and one, got {} and {}",
                numbers.len(),
                snow.len()
            );
            return Err(FrictionError::Inference { message });
        }
        let share = f64::from(snow[0]).exp().min(1.0);
        Ok(Embedding {
            numbers: numbers.iter().map(|x| f64::from(*x)).collect(),
            snow: SNOW_ODDS * share / (SNOW_ODDS * share + 1.0 - share),
        })
    }
}
