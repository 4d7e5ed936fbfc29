//! The network: a tensor in, one logit per road state out, and how unlike its training pictures the picture is.

use std::ops::RangeInclusive;
use std::path::Path;
use std::sync::Mutex;

use ort::environment::Environment;
use ort::session::Session;
use ort::session::builder::GraphOptimizationLevel;
use ort::value::{Outlet, TensorElementType, TensorRef, ValueType};

use crate::error::FrictionError;
use crate::files::within;
use crate::tensor::INPUT_SIDE;

/// No model of a road's picture is larger (bytes).
const MOST_BYTES: u64 = 512 << 20;
/// No model tells more road states, or more of how unlike its training a picture is.
const MOST_OUTPUTS: i64 = 64;

/// What a network says of one picture.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Answer {
    /// One for each road state.
    pub logits: Vec<f32>,
    /// Mahalanobis distance of what an early layer makes of the picture from honest pictures, over the root of the number of channels compared: at
    /// most about one for a usual picture. None from a model that does not tell.
    pub unfamiliarity: Option<f32>,
}

/// Something that runs the model.
pub trait Network: Send {
    /// Reads one picture: `tensor` holds three planes of [`INPUT_SIDE`]^2 values.
    ///
    /// # Errors
    /// [`FrictionError::Inference`].
    fn read(&mut self, tensor: &[f32]) -> Result<Answer, FrictionError>;
}

/// ONNX Runtime, loaded at run time, on one thread that does not spin.
#[derive(Debug)]
pub struct OnnxRuntime {
    session: Session,
}

impl OnnxRuntime {
    /// Loads the library (once per process: a later call with another path keeps the first) and the model.
    ///
    /// # Errors
    /// [`FrictionError::Library`] or [`FrictionError::Model`].
    pub fn load(library: &Path, model: &Path) -> Result<Self, FrictionError> {
        Ok(Self { session: session(library, model, INPUT_SIDE, 1..=2, MOST_OUTPUTS)? })
    }
}

/// Loads the library and a model of one square picture with so many outputs of so many numbers at most.
pub(crate) fn session(
    library: &Path,
    model: &Path,
    side: u32,
    outputs: RangeInclusive<usize>,
    most: i64,
) -> Result<Session, FrictionError> {
    let environment = environment(library)
        .map_err(|message| FrictionError::Library { path: library.to_path_buf(), message })?;
    open(&environment, model, side, outputs, most)
        .map_err(|message| FrictionError::Model { path: model.to_path_buf(), message })
}

/// ONNX Runtime allows one environment per process, so it is kept.
fn environment(library: &Path) -> Result<Environment, String> {
    static KEPT: Mutex<Option<Environment>> = Mutex::new(None);
    let mut kept = KEPT.lock().map_err(|e| e.to_string())?;
    if let Some(environment) = &*kept {
        return Ok(environment.clone());
    }
    // `ort::init` panics where the library is missing; `init_from` tells.
    let builder = ort::init_from(library).map_err(|e| e.to_string())?;
    let environment = builder.with_telemetry(false).build().map_err(|e| e.to_string())?;
    Ok(kept.insert(environment).clone())
}

fn open(
    environment: &Environment,
    model: &Path,
    side: u32,
    expected: RangeInclusive<usize>,
    most: i64,
) -> Result<Session, String> {
    let text = |e: ort::Error<ort::session::builder::SessionBuilder>| e.to_string();
    let mut builder = Session::builder(environment)
        .map_err(|e| e.to_string())?
        .with_optimization_level(GraphOptimizationLevel::All)
        .map_err(text)?
        .with_intra_threads(1)
        .map_err(text)?
        .with_intra_op_spinning(false)
        .map_err(text)?;
    let length = std::fs::metadata(model).map_err(|e| e.to_string())?.len();
    within(length, MOST_BYTES).map_err(|e| e.to_string())?;
    let session = builder.commit_from_file(model).map_err(|e| e.to_string())?;
    let (inputs, outputs) = (session.inputs(), session.outputs());
    if inputs.len() != 1 || !expected.contains(&outputs.len()) {
        return Err(format!(
            "expected 1 input and {} to {} outputs, got {} and {}",
            expected.start(),
            expected.end(),
            inputs.len(),
            outputs.len()
        ));
    }
    let side = i64::from(side);
    takes(&inputs[0], &[1, 3, side, side])?;
    outputs.iter().try_for_each(|output| gives_few(output, most))?;
    Ok(session)
}

/// Refuses an input of another shape; a size that is left open (-1) is any.
fn takes(input: &Outlet, expected: &[i64]) -> Result<(), String> {
    let shape = floats(input)?;
    let fits = shape.len() == expected.len()
        && shape.iter().zip(expected).all(|(got, expected)| *got == -1 || got == expected);
    if fits {
        Ok(())
    } else {
        Err(format!("input {:.40?}: expected {expected:?}, got {shape:?}", input.name()))
    }
}

/// Refuses an output that is large by itself.
fn gives_few(output: &Outlet, most: i64) -> Result<(), String> {
    let shape = floats(output)?;
    let few = shape.iter().try_fold(1_i64, |all, size| all.checked_mul((*size).max(1)));
    match few {
        Some(count) if count <= most => Ok(()),
        _ => Err(format!("output {:.40?}: at most {most} numbers, got {shape:?}", output.name())),
    }
}

fn floats(outlet: &Outlet) -> Result<&[i64], String> {
    match outlet.dtype() {
        ValueType::Tensor { ty: TensorElementType::Float32, shape, .. } => Ok(shape),
        other => Err(format!("{:.40?}: expected a tensor of float32, got {other:.80}", outlet.name())),
    }
}

impl Network for OnnxRuntime {
    fn read(&mut self, tensor: &[f32]) -> Result<Answer, FrictionError> {
        let failed = |e: ort::Error| FrictionError::Inference { message: e.to_string() };
        let side = INPUT_SIDE as usize;
        let input = TensorRef::from_array_view(([1, 3, side, side], tensor)).map_err(failed)?;
        let outputs = self.session.run(ort::inputs![input]).map_err(failed)?;
        let (_, logits) = outputs[0].try_extract_tensor::<f32>().map_err(failed)?;
        if logits.len() as i64 > MOST_OUTPUTS {
            let message = format!("expected at most {MOST_OUTPUTS} logits, got {}", logits.len());
            return Err(FrictionError::Inference { message });
        }
        let unfamiliarity = match outputs.len() {
            1 => None,
            _ => outputs[1].try_extract_tensor::<f32>().map_err(failed)?.1.first().copied(),
        };
        Ok(Answer { logits: logits.to_vec(), unfamiliarity })
    }
}
