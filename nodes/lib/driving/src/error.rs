//! What can be wrong with a track or a car that is to be driven.

/// A track that cannot be driven, or a set that cannot be driven on.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DrivingError {
    /// A row of the track file that is not four numbers.
    #[error("track row {row}: expected x_m, y_m, right width in m, left width in m, got {got:?}")]
    Row {
        /// Row of the file, from 1.
        row: u64,
        /// What stands there.
        got: String,
    },
    /// The track file is no table.
    #[error("cannot read the track")]
    Csv(#[from] csv::Error),
    /// A width that is not above zero, or a position that is not finite.
    #[error(
        "track point {point}: positions must be finite and widths above zero, got x {x_m}, y {y_m}, right {right_m}, left {left_m}"
    )]
    Point {
        /// Point, from 1.
        point: usize,
        /// Position.
        x_m: f64,
        /// Position.
        y_m: f64,
        /// Width to the right.
        right_m: f64,
        /// Width to the left.
        left_m: f64,
    },
    /// A lap of fewer points than a curve needs.
    #[error("the track has {got} different points; a closed lap needs at least {needed}")]
    TooShort {
        /// Points given, without repeats of the one before.
        got: usize,
        /// Points needed.
        needed: usize,
    },
    /// Tires that give no force to drive with.
    #[error("the tires give no usable grip: {0}")]
    Tires(String),
}
