//! What can go wrong.

use std::path::PathBuf;

/// Errors of this crate.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrictionError {
    /// The encoding's name is not one of `rgb8 bgr8 rgba8 bgra8 mono8 mono16 yuv422 yuv422_yuy2 bayer_*`.
    #[error("picture encoding {encoding:?} is not supported")]
    UnknownEncoding {
        /// The name as received.
        encoding: String,
    },
    /// Width, height, step and the number of bytes do not fit together.
    #[error(
        "a {width}x{height} picture of {bytes_per_pixel} bytes a pixel needs step >= {least_step} and {height} x step bytes, \
         got step {step} and {bytes} bytes"
    )]
    BadLayout {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Bytes of one pixel.
        bytes_per_pixel: u32,
        /// The smallest step that holds a row.
        least_step: u64,
        /// The step as received, bytes.
        step: u32,
        /// Bytes received.
        bytes: usize,
    },
    /// A picture without pixels, or larger than [`crate::decode`] accepts.
    #[error("picture of {width}x{height} pixels: expected 1 to {most} a side")]
    BadSize {
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// The largest side accepted.
        most: u32,
    },
    /// The compressed data ends early.
    #[error("compressed picture is cut off after {bytes} bytes")]
    Truncated {
        /// Bytes received.
        bytes: usize,
    },
    /// The compressed data is neither JPEG nor PNG, or is damaged.
    #[error("compressed picture cannot be decoded: {message}")]
    Undecodable {
        /// What the decoder says.
        message: String,
    },
    /// The region of interest is not a part of the picture.
    #[error(
        "region of interest {left}..{right} x {top}..{bottom}: expected 0 <= left < right <= 1, 0 <= top < bottom <= 1"
    )]
    BadRegion {
        /// Left edge as a share of the width.
        left: f64,
        /// Top edge as a share of the height.
        top: f64,
        /// Right edge as a share of the width.
        right: f64,
        /// Bottom edge as a share of the height.
        bottom: f64,
    },
    /// A region's text is neither a word nor four edges.
    #[error(
        "region {text:?}: expected auto, full, or left,top,right,bottom as shares of width and height, such as 0.2,0.5,0.8,0.9"
    )]
    UnreadableRegion {
        /// The text.
        text: String,
    },
    /// The crop could not be resized.
    #[error("resizing the region of interest failed: {message}")]
    Resize {
        /// What the resizer says.
        message: String,
    },
    /// The friction basis is not usable.
    #[error("friction basis: {message}")]
    BadBasis {
        /// What is wrong.
        message: String,
    },
    /// A calibration cannot be learned, or its file is not usable.
    #[error("friction calibration: {message}")]
    BadCalibration {
        /// What is wrong.
        message: String,
    },
    /// A file could not be read.
    #[error("cannot read {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// A file could not be written.
    #[error("cannot write {path}")]
    Write {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// No ONNX Runtime library in any of the places looked at.
    #[error("no {name} in {}", list(.searched))]
    NotFound {
        /// What was looked for.
        name: &'static str,
        /// The places, in order.
        searched: Vec<PathBuf>,
    },
    /// The ONNX Runtime library is there and cannot be used.
    #[error("ONNX Runtime library {path}: {message}")]
    Library {
        /// The library.
        path: PathBuf,
        /// What the loader says.
        message: String,
    },
    /// The model file cannot be used.
    #[error("model {path}: {message}")]
    Model {
        /// The model.
        path: PathBuf,
        /// What is wrong with it.
        message: String,
    },
    /// The network failed on a picture.
    #[error("inference failed: {message}")]
    Inference {
        /// What the engine says.
        message: String,
    },
}

fn list(paths: &[PathBuf]) -> String {
    paths.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ")
}
