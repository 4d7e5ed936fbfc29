//! Colour filter arrays: each pixel takes the colours of the 2 x 2 cell that it begins.
//!
//! The region of interest is shrunk to 224 pixels afterwards, so a finer interpolation would not be seen.

use std::ops::Range;

/// Appends the RGB pixels `columns` of `line`. `mate` is the next row (the one before, at the lower edge), `cell` the colours
/// (0 red, 1 green, 2 blue) of the picture's first 2 x 2 pixels, `odd` whether `line` is an odd row, and `wide` the place of
/// the high byte where pixels have two.
pub(crate) fn row(
    out: &mut Vec<u8>,
    line: &[u8],
    mate: &[u8],
    columns: Range<usize>,
    cell: [u8; 4],
    odd: bool,
    wide: Option<usize>,
) {
    let width = if wide.is_some() { line.len() / 2 } else { line.len() };
    let value = |row: &[u8], c: usize| match wide {
        Some(high) => row[2 * c + high],
        None => row[c],
    };
    let rows = if odd { [(line, 2), (mate, 0)] } else { [(line, 0), (mate, 2)] };
    for c in columns {
        let next = if c + 1 < width { c + 1 } else { c.saturating_sub(1) };
        let (mut sum, mut count) = ([0u16; 3], [0u16; 3]);
        for (pixels, first) in rows {
            for x in [c, next] {
                let colour = usize::from(cell[first + x % 2]);
                sum[colour] += u16::from(value(pixels, x));
                count[colour] += 1;
            }
        }
        out.extend([0, 1, 2].map(|k| (sum[k] / count[k].max(1)) as u8));
    }
}
