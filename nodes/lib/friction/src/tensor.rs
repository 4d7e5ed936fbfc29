//! Pixels to the network's input.
//!
//! The resize is fast_image_resize's convolution with a bilinear kernel, which equals the antialiased resize of torchvision
//! and PIL within one level of 255; training uses those. The crop comes before the resize.

use fast_image_resize::images::{TypedImage, TypedImageRef};
use fast_image_resize::pixels::U8x3;
use fast_image_resize::{FilterType, ResizeAlg, ResizeOptions, Resizer};

use crate::error::FrictionError;
use crate::picture::RgbPicture;

/// Width and height of the network's input, pixels.
pub const INPUT_SIDE: u32 = 224;

/// Mean and standard deviation of ImageNet's red, green, blue, on the scale 0 to 1.
const MEAN: [f32; 3] = [0.485, 0.456, 0.406];
const STD: [f32; 3] = [0.229, 0.224, 0.225];

/// Resizes crops; holds the resizer's buffers.
#[derive(Debug)]
pub struct Preprocessor {
    resizer: Resizer,
    options: ResizeOptions,
}

impl Default for Preprocessor {
    fn default() -> Self {
        let options = ResizeOptions::new().resize_alg(ResizeAlg::Convolution(FilterType::Bilinear));
        Self { resizer: Resizer::new(), options }
    }
}

impl Preprocessor {
    /// The crop at [`INPUT_SIDE`] x [`INPUT_SIDE`] pixels, its sides stretched to fit.
    ///
    /// # Errors
    /// [`FrictionError::Resize`] where the picture's size does not match its data.
    pub fn resize(&mut self, picture: &RgbPicture) -> Result<RgbPicture, FrictionError> {
        self.resize_to(picture, INPUT_SIDE)
    }

    /// The same at another size.
    ///
    /// # Errors
    /// As [`Self::resize`].
    pub fn resize_to(&mut self, picture: &RgbPicture, side: u32) -> Result<RgbPicture, FrictionError> {
        let failed = |message: String| FrictionError::Resize { message };
        // Typed: code for one kind of pixel is compiled, not for all that there are (minutes of it).
        let source = TypedImageRef::<U8x3>::from_buffer(picture.width, picture.height, &picture.data)
            .map_err(|e| failed(e.to_string()))?;
        let mut data = vec![0; (side * side * 3) as usize];
        let mut target =
            TypedImage::<U8x3>::from_buffer(side, side, &mut data).map_err(|e| failed(e.to_string()))?;
        self.resizer.resize_typed(&source, &mut target, &self.options).map_err(|e| failed(e.to_string()))?;
        Ok(RgbPicture { width: side, height: side, data })
    }
}

/// Channels first, (x / 255 - mean) / std: three planes of `width * height` values.
#[must_use]
pub fn normalise(picture: &RgbPicture) -> Vec<f32> {
    let (pixels, _) = picture.data.as_chunks::<3>();
    let mut out = Vec::with_capacity(pixels.len() * 3);
    for k in 0..3 {
        let (scale, shift) = (1.0 / (255.0 * STD[k]), -MEAN[k] / STD[k]);
        out.extend(pixels.iter().map(|p| f32::from(p[k]) * scale + shift));
    }
    out
}
