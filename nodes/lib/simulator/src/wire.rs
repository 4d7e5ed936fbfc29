//! Messages: eight bytes of length (little-endian), then a NumPy `.npz` archive whose array `header` is JSON (version, id, kind).

use std::io::{Cursor, Read, Write};

use ndarray::{Array1, Array2, Array3, ArrayView1, ArrayView3};
use ndarray_npy::{NpzWriter, ViewNpyExt};
use serde::{Deserialize, Serialize};
use zip::ZipArchive;

use crate::Description;

/// Version of the messages.
pub const VERSION: u32 = 1;
/// An answer longer than this is taken for garbage: a length that is none.
const MOST_BYTES: u64 = 1 << 32;

/// Passes through one stretch of driving. Arrays with one row are the same for every pass.
///
/// B passes, P parameters, K steps, U inputs, J placements, S states, M outputs wanted, C output channels.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// (B, P).
    pub parameters: Array2<f64>,
    /// (B or 1, K, U): held over each step.
    pub commands: Array3<f64>,
    /// (J): before which steps the car is put into a motion; the first forgets everything hidden.
    pub place_steps: Array1<i64>,
    /// (B or 1, J, S).
    pub motions: Array3<f64>,
    /// (B or 1, K + 1): forward speed imposed at every step.
    pub v_x_mps: Option<Array2<f64>>,
    /// (B or 1, K, S): added to the states after each step.
    pub kicks: Option<Array3<f64>>,
    /// (M): before which steps the outputs are wanted.
    pub output_steps: Array1<i64>,
}

impl Batch {
    /// How many passes.
    #[must_use]
    pub fn passes(&self) -> usize {
        self.parameters.nrows()
    }

    /// Some of its passes.
    #[must_use]
    pub fn rows(&self, from: usize, to: usize) -> Self {
        use ndarray::s;
        let of3 = |a: &Array3<f64>| {
            if a.shape()[0] > 1 { a.slice(s![from..to, .., ..]).to_owned() } else { a.clone() }
        };
        let of2 =
            |a: &Array2<f64>| if a.nrows() > 1 { a.slice(s![from..to, ..]).to_owned() } else { a.clone() };
        Self {
            parameters: self.parameters.slice(s![from..to, ..]).to_owned(),
            commands: of3(&self.commands),
            place_steps: self.place_steps.clone(),
            motions: of3(&self.motions),
            v_x_mps: self.v_x_mps.as_ref().map(of2),
            kicks: self.kicks.as_ref().map(of3),
            output_steps: self.output_steps.clone(),
        }
    }
}

/// The head of a request.
#[derive(Debug, Serialize)]
pub(crate) struct RequestHeader {
    pub(crate) version: u32,
    pub(crate) id: u64,
    pub(crate) kind: &'static str,
}

/// The head of an answer.
#[derive(Debug, Deserialize)]
pub(crate) struct AnswerHeader {
    pub(crate) version: u32,
    pub(crate) id: Option<u64>,
    pub(crate) kind: String,
    #[serde(default)]
    pub(crate) message: String,
    #[serde(default)]
    pub(crate) description: Option<serde_json::Value>,
}

/// An answer.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) header: AnswerHeader,
    pub(crate) outputs: Option<Array3<f64>>,
}

impl AnswerHeader {
    /// The description that it carries.
    pub(crate) fn description(self) -> Result<Description, String> {
        let value = self.description.ok_or("it holds no description")?;
        serde_json::from_value(value).map_err(|e| format!("its description: {e}"))
    }
}

/// Writes a request. The inner error says what cannot be put into an archive; there is none in practice.
pub(crate) fn write(
    to: &mut impl Write,
    header: &RequestHeader,
    batch: Option<&Batch>,
) -> std::io::Result<()> {
    let other = |e: &dyn std::fmt::Display| std::io::Error::other(e.to_string());
    let text = serde_json::to_vec(header)?;
    let mut body = Cursor::new(Vec::new());
    let mut archive = NpzWriter::new(&mut body);
    let fill = |archive: &mut NpzWriter<&mut Cursor<Vec<u8>>>| -> Result<(), ndarray_npy::WriteNpzError> {
        archive.add_array("header", &Array1::from_vec(text))?;
        if let Some(b) = batch {
            archive.add_array("parameters", &b.parameters)?;
            archive.add_array("commands", &b.commands)?;
            archive.add_array("place_steps", &b.place_steps)?;
            archive.add_array("motions", &b.motions)?;
            archive.add_array("output_steps", &b.output_steps)?;
            if let Some(v_x) = &b.v_x_mps {
                archive.add_array("v_x", v_x)?;
            }
            if let Some(kicks) = &b.kicks {
                archive.add_array("kicks", kicks)?;
            }
        }
        Ok(())
    };
    fill(&mut archive).map_err(|e| other(&e))?;
    archive.finish().map_err(|e| other(&e))?;
    let body = body.into_inner();
    to.write_all(&(body.len() as u64).to_le_bytes())?;
    to.write_all(&body)?;
    to.flush()
}

/// Reads an answer; the inner result says why it is none.
pub(crate) fn read(from: &mut impl Read) -> std::io::Result<Result<Answer, String>> {
    let mut length = [0; 8];
    from.read_exact(&mut length)?;
    let length = u64::from_le_bytes(length);
    if length > MOST_BYTES {
        return Ok(Err(format!(
            "it begins with a length of {length} bytes; each message is eight bytes of length and an .npz archive"
        )));
    }
    // Read as it comes: a length is not trusted with memory.
    let mut body = Vec::new();
    if from.take(length).read_to_end(&mut body)? as u64 != length {
        return Err(std::io::ErrorKind::UnexpectedEof.into());
    }
    Ok(parse(body))
}

fn parse(body: Vec<u8>) -> Result<Answer, String> {
    let mut archive = ZipArchive::new(Cursor::new(body)).map_err(|e| format!("no .npz archive: {e}"))?;
    let header = array(&mut archive, "header")
        .and_then(|bytes| bytes.ok_or_else(|| "there is none".to_owned()))
        .and_then(|bytes| Ok(ArrayView1::<u8>::view_npy(&bytes).map_err(|e| e.to_string())?.to_vec()))
        .map_err(|e| format!("its header (JSON as uint8): {e}"))?;
    let header = serde_json::from_slice(&header).map_err(|e| format!("its header: {e}"))?;
    let outputs = array(&mut archive, "outputs")
        .and_then(|bytes| {
            let Some(bytes) = bytes else { return Ok(None) };
            // A view, as the header of an array is not trusted with memory: what it declares has to be there.
            ArrayView3::<f64>::view_npy(&bytes).map(|a| Some(a.to_owned())).map_err(|e| e.to_string())
        })
        .map_err(|e| format!("its outputs (float64, passes x times x channels): {e}"))?;
    Ok(Answer { header, outputs })
}

/// The bytes of an array, if the archive has it: what is there, not what the archive says is there.
fn array(archive: &mut ZipArchive<Cursor<Vec<u8>>>, name: &str) -> Result<Option<Vec<u8>>, String> {
    let Some(index) = archive.index_for_name(&format!("{name}.npy")) else { return Ok(None) };
    let entry = archive.by_index(index).map_err(|e| e.to_string())?;
    let mut bytes = Vec::new();
    let length = entry.take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    if length as u64 > MOST_BYTES {
        return Err(format!("more than {MOST_BYTES} bytes"));
    }
    Ok(Some(bytes))
}

#[cfg(test)]
mod tests;
