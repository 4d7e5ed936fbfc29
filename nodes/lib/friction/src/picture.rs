//! Pictures as they arrive, and as the network wants them.

use crate::error::FrictionError;

/// How the bytes of a raw picture are to be read: the names of `sensor_msgs/image_encodings.hpp`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Encoding {
    Rgb8,
    Bgr8,
    Rgba8,
    Bgra8,
    Mono8,
    Mono16,
    /// `yuv422`, `yuv422_uyvy`: U Y V Y.
    Uyvy,
    /// `yuv422_yuy2`: Y U Y V.
    Yuyv,
    /// `bayer_<pattern>8` and `bayer_<pattern>16`; the pattern names the first two pixels of the first two rows.
    Bayer {
        /// Colour (0 red, 1 green, 2 blue) of the 2 x 2 cell, row by row.
        cell: [u8; 4],
        /// Two bytes a pixel.
        wide: bool,
    },
}

impl Encoding {
    /// Reads an encoding's name.
    ///
    /// # Errors
    /// [`FrictionError::UnknownEncoding`].
    pub fn parse(name: &str) -> Result<Self, FrictionError> {
        let bayer = |pattern: &str| match pattern {
            "rggb" => Some([0, 1, 1, 2]),
            "bggr" => Some([2, 1, 1, 0]),
            "gbrg" => Some([1, 2, 0, 1]),
            "grbg" => Some([1, 0, 2, 1]),
            _ => None,
        };
        let found = match name {
            "rgb8" | "8UC3_rgb" => Some(Self::Rgb8),
            "bgr8" | "8UC3" => Some(Self::Bgr8),
            "rgba8" => Some(Self::Rgba8),
            "bgra8" | "8UC4" => Some(Self::Bgra8),
            "mono8" | "8UC1" => Some(Self::Mono8),
            "mono16" | "16UC1" => Some(Self::Mono16),
            "yuv422" | "yuv422_uyvy" | "uyvy" => Some(Self::Uyvy),
            "yuv422_yuy2" | "yuyv" => Some(Self::Yuyv),
            _ => name.strip_prefix("bayer_").and_then(|rest| {
                let (pattern, wide) = match rest.strip_suffix("16") {
                    Some(pattern) => (pattern, true),
                    None => (rest.strip_suffix('8')?, false),
                };
                Some(Self::Bayer { cell: bayer(pattern)?, wide })
            }),
        };
        found.ok_or_else(|| FrictionError::UnknownEncoding { encoding: name.to_owned() })
    }

    /// Bytes of one pixel (the mean, for the 4:2:2 formats).
    #[must_use]
    pub fn bytes_per_pixel(self) -> u32 {
        match self {
            Self::Mono8 | Self::Bayer { wide: false, .. } => 1,
            Self::Mono16 | Self::Uyvy | Self::Yuyv | Self::Bayer { wide: true, .. } => 2,
            Self::Rgb8 | Self::Bgr8 => 3,
            Self::Rgba8 | Self::Bgra8 => 4,
        }
    }
}

/// A raw picture as `sensor_msgs/Image` carries it.
#[derive(Debug, Clone, Copy)]
pub struct RawPicture<'a> {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Bytes from one row to the next; may exceed the width's bytes.
    pub step: u32,
    /// The encoding's name.
    pub encoding: &'a str,
    /// Whether 16 bit values have their high byte first.
    pub big_endian: bool,
    /// The pixels.
    pub data: &'a [u8],
}

/// The two kinds of picture message.
#[derive(Debug, Clone, Copy)]
pub enum FrameData<'a> {
    /// `sensor_msgs/Image`.
    Raw(RawPicture<'a>),
    /// The bytes of `sensor_msgs/CompressedImage`: a JPEG or PNG file. Its `format` text is not needed.
    Compressed(&'a [u8]),
}

/// A picture with the time at which it was taken.
#[derive(Debug, Clone, Copy)]
pub struct Frame<'a> {
    /// The header's stamp, nanoseconds.
    pub stamp_ns: i64,
    /// The picture.
    pub data: FrameData<'a>,
}

/// The part of the picture that shows road, as shares of width and height; (0, 0) is the upper left corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Region {
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
}

impl Region {
    /// The whole picture.
    pub const WHOLE: Self = Self { left: 0.0, top: 0.0, right: 1.0, bottom: 1.0 };

    /// A region by its edges.
    ///
    /// # Errors
    /// [`FrictionError::BadRegion`] unless `0 <= left < right <= 1` and `0 <= top < bottom <= 1`.
    pub fn new(left: f64, top: f64, right: f64, bottom: f64) -> Result<Self, FrictionError> {
        let span = |low: f64, high: f64| (0.0..1.0).contains(&low) && low < high && high <= 1.0;
        if span(left, right) && span(top, bottom) {
            Ok(Self { left, top, right, bottom })
        } else {
            Err(FrictionError::BadRegion { left, top, right, bottom })
        }
    }

    /// The whole width, and upwards by `up` of its height more.
    pub(crate) fn around(&self, up: f64) -> Self {
        Self { left: 0.0, top: (self.top - up * (self.bottom - self.top)).max(0.0), right: 1.0, ..*self }
    }

    /// (left, top, width, height) in whole pixels of a `width` x `height` picture; at least one pixel.
    #[must_use]
    pub fn pixels(&self, width: u32, height: u32) -> (u32, u32, u32, u32) {
        let span = |low: f64, high: f64, size: u32| {
            let first = ((low * f64::from(size)).round() as u32).min(size.saturating_sub(1));
            let end = ((high * f64::from(size)).round() as u32).clamp(first + 1, size.max(first + 1));
            (first, end - first)
        };
        let (x, w) = span(self.left, self.right, width);
        let (y, h) = span(self.top, self.bottom, height);
        (x, y, w, h)
    }
}

/// Red, green, blue, 8 bit each, rows packed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RgbPicture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `width * height * 3` bytes.
    pub data: Vec<u8>,
}

impl RgbPicture {
    /// The part of the picture that lies in `region`.
    #[must_use]
    pub fn crop(self, region: &Region) -> Self {
        let (x, y, w, h) = region.pixels(self.width, self.height);
        if (w, h) == (self.width, self.height) {
            return self;
        }
        let mut data = Vec::with_capacity((w * h * 3) as usize);
        for row in self.data.chunks_exact(self.width as usize * 3).skip(y as usize).take(h as usize) {
            data.extend_from_slice(&row[x as usize * 3..(x + w) as usize * 3]);
        }
        Self { width: w, height: h, data }
    }
}
