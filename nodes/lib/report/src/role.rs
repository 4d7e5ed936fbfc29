//! Who is who in every picture.

use plotters::style::RGBColor;

/// What a line or an area stands for. Its colour is the same on every page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// What the car reported: black.
    Measured,
    /// The model in use before: grey.
    Nominal,
    /// What was believed beforehand: orange.
    Prior,
    /// What was found: blue.
    Identified,
    /// What a simulator knows: dashed black.
    Truth,
}

impl Role {
    /// Its colour.
    pub(crate) fn color(self) -> RGBColor {
        match self {
            Self::Measured | Self::Truth => RGBColor(0x11, 0x11, 0x11),
            Self::Nominal => RGBColor(0x8c, 0x8c, 0x8c),
            Self::Prior => RGBColor(0xe0, 0x7b, 0x00),
            Self::Identified => RGBColor(0x1f, 0x5f, 0xbf),
        }
    }

    /// Its colour as CSS writes it.
    pub(crate) fn css(self) -> String {
        let RGBColor(r, g, b) = self.color();
        format!("#{r:02x}{g:02x}{b:02x}")
    }

    /// Whether its lines are dashed.
    pub(crate) fn is_dashed(self) -> bool {
        self == Self::Truth
    }
}
