//! Which part of a picture shows road: stated, or found anew every few pictures.
//!
//! A picture that looks alike above and below is road all over. In any other the road is taken to be what lies before the car: its colour is that of
//! the middle of the lower half, its upper end (the horizon, a wall, the car ahead) and its lower end (the bonnet) are where that colour ends.

use std::collections::VecDeque;
use std::str::FromStr;

use crate::error::FrictionError;
use crate::picture::{Region, RgbPicture};

/// Cells into which a picture is divided to look at it.
const ROWS: usize = 36;
const COLUMNS: usize = 48;
/// Differences between the upper and the lower part, luma and two colours, above which a picture is not road all over; set on photographs so
/// that of whole frames 0.2 % are taken for road all over. What is taken for a whole frame and is none loses no more than its edges.
const PARTS_DIFFER: [f64; 3] = [30.0, 12.0, 12.0];
/// The same between rows of cells four apart.
const ROWS_DIFFER: [f64; 3] = [25.0, 9.0, 9.0];
/// A row belongs to the road where half of its cells lie within so many spreads of the road's luma and colours.
const ALIKE: [f64; 3] = [3.5, 2.5, 2.5];
/// The least spread of the road's luma and colours.
const LEAST_SPREAD: [f64; 3] = [18.0, 6.0, 6.0];
/// The horizon of a whole frame where the colour tells none.
const USUAL_HORIZON: f64 = 0.5;
/// Share of the way from the horizon that is too far away, and that over the rest.
const FAR: f64 = 0.3;
const FAR_OVER_NEAR: f64 = FAR / (1.0 - FAR);
/// Pictures of a stream between two looks, and looks of which the middle counts.
const PICTURES_A_LOOK: u32 = 10;
const LOOKS: usize = 5;

/// Which part of the pictures to read.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Look {
    /// Found in the pictures.
    #[default]
    Auto,
    /// Always this one.
    At(Region),
}

impl Look {
    /// What to embed beside a road found in `road`: its verges and what lies at its end, which tell of snow and rain as much as the road does. A part that
    /// was stated stays alone.
    pub(crate) fn around(&self, road: Region) -> Region {
        match self {
            Self::Auto => road.around(FAR_OVER_NEAR),
            Self::At(region) => *region,
        }
    }
}

impl FromStr for Look {
    type Err = FrictionError;

    /// `auto`, `full`, or left, top, right, bottom as shares of width and height: `0.2,0.5,0.8,0.9`.
    fn from_str(text: &str) -> Result<Self, FrictionError> {
        let unreadable = || FrictionError::UnreadableRegion { text: text.to_owned() };
        match text {
            "auto" => Ok(Self::Auto),
            "full" => Ok(Self::At(Region::WHOLE)),
            _ => {
                let edges: Result<Vec<f64>, _> = text.split(',').map(|edge| edge.trim().parse()).collect();
                match edges.map_err(|_| unreadable())?[..] {
                    [left, top, right, bottom] => Region::new(left, top, right, bottom).map(Self::At),
                    _ => Err(unreadable()),
                }
            }
        }
    }
}

/// Finds the road in a stream of pictures.
#[derive(Debug, Clone, Default)]
pub(crate) struct RoadFinder {
    found: VecDeque<Seen>,
    since: u32,
}

/// What a look found.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// Left, top, right, bottom of the road.
    edges: [f64; 4],
    /// The two opponent colours of the whole picture.
    colour: [f64; 2],
}

impl RoadFinder {
    /// Whether the next picture is to be looked at as a whole.
    pub(crate) fn wants_a_look(&self) -> bool {
        self.found.is_empty() || self.since >= PICTURES_A_LOOK
    }

    /// The region of the last looks, after one more picture; none before the first look.
    pub(crate) fn region(&mut self) -> Option<Region> {
        self.since += 1;
        let edge = |k: usize| {
            (!self.found.is_empty()).then(|| median(self.found.iter().map(|f| f.edges[k]).collect()))
        };
        Region::new(edge(0)?, edge(1)?, edge(2)?, edge(3)?).ok()
    }

    /// The colours of the scene by the last looks, levels of r - g and of (r + g)/2 - b.
    pub(crate) fn scene(&self) -> [f64; 2] {
        [0, 1].map(|k| median(self.found.iter().map(|f| f.colour[k]).collect()))
    }

    /// Looks at a whole picture.
    pub(crate) fn look(&mut self, picture: &RgbPicture) {
        if picture.width == 0 || picture.height == 0 {
            return;
        }
        let cells = cells(picture);
        let [_, red_green, yellow_blue] = mean(&cells, 0..ROWS, &(0..COLUMNS));
        self.found.push_back(Seen { edges: find(&cells), colour: [red_green, yellow_blue] });
        if self.found.len() > LOOKS {
            self.found.pop_front();
        }
        self.since = 0;
    }
}

/// Luma and two opponent colours of each cell, row by row.
fn cells(picture: &RgbPicture) -> Vec<[f64; 3]> {
    let (width, height) = (picture.width as usize, picture.height as usize);
    let mut cells = Vec::with_capacity(ROWS * COLUMNS);
    for row in 0..ROWS {
        for column in 0..COLUMNS {
            // Sixteen pixels of a cell are as good as all of them.
            let mut sum = [0.0; 3];
            for k in 0..16 {
                let y = ((row * 4 + k / 4) * height) / (ROWS * 4);
                let x = ((column * 4 + k % 4) * width) / (COLUMNS * 4);
                let at = (y.min(height - 1) * width + x.min(width - 1)) * 3;
                let [r, g, b] = [0, 1, 2].map(|c| f64::from(picture.data[at + c]) / 16.0);
                sum = [sum[0] + (r + g + b) / 3.0, sum[1] + r - g, sum[2] + (r + g) / 2.0 - b];
            }
            cells.push(sum);
        }
    }
    cells
}

/// Mean of the cells of some rows and columns.
fn mean(cells: &[[f64; 3]], rows: std::ops::Range<usize>, columns: &std::ops::Range<usize>) -> [f64; 3] {
    let count = (rows.len() * columns.len()) as f64;
    let mut sum = [0.0; 3];
    for row in rows {
        for cell in &cells[row * COLUMNS + columns.start..row * COLUMNS + columns.end] {
            sum = [0, 1, 2].map(|k| sum[k] + cell[k] / count);
        }
    }
    sum
}

fn beyond(a: [f64; 3], b: [f64; 3], limits: [f64; 3]) -> bool {
    (0..3).any(|k| (a[k] - b[k]).abs() > limits[k])
}

/// Left, top, right, bottom of the road.
fn find(cells: &[[f64; 3]]) -> [f64; 4] {
    const ALL: [f64; 4] = [0.0, 0.0, 1.0, 1.0];
    let (all, middle) = (0..COLUMNS, COLUMNS / 4..COLUMNS * 3 / 4);
    let parts = [0..ROWS * 2 / 5, ROWS * 3 / 5..ROWS].map(|rows| mean(cells, rows, &all));
    let rows: Vec<[f64; 3]> = (0..ROWS).map(|row| mean(cells, row..row + 1, &middle)).collect();
    if !beyond(parts[0], parts[1], PARTS_DIFFER) && !rows.windows(5).any(|w| beyond(w[0], w[4], ROWS_DIFFER))
    {
        return ALL;
    }
    // What lies before the car.
    let near = ROWS * 62 / 100..ROWS * 85 / 100;
    let mut sample: [Vec<f64>; 3] = Default::default();
    for row in near.clone() {
        for cell in &cells[row * COLUMNS + COLUMNS * 35 / 100..row * COLUMNS + COLUMNS * 65 / 100] {
            (0..3).for_each(|k| sample[k].push(cell[k]));
        }
    }
    let road = sample.each_ref().map(|values| median(values.clone()));
    let spread: [f64; 3] = std::array::from_fn(|k| {
        LEAST_SPREAD[k] + 1.5 * median(sample[k].iter().map(|v| (v - road[k]).abs()).collect())
    });
    let limits: [f64; 3] = std::array::from_fn(|k| ALIKE[k] * spread[k]);
    let is_road = |row: usize| {
        let row = &cells[row * COLUMNS + middle.start..row * COLUMNS + middle.end];
        2 * row.iter().filter(|cell| !beyond(**cell, road, limits)).count() >= row.len()
    };
    let mut top = near.start;
    while top > 0 && (is_road(top - 1) || (top > 1 && is_road(top - 2))) {
        top -= 1;
    }
    let mut bottom = near.end;
    while bottom < ROWS && is_road(bottom) {
        bottom += 1;
    }
    let share = |row: usize| row as f64 / ROWS as f64;
    let horizon = if share(top) < 0.25 { USUAL_HORIZON } else { share(top).min(0.6) };
    let depth = share(bottom) - horizon;
    // Far away a pixel shows metres of road, and beside it lies what is no road.
    [0.25, horizon + FAR * depth, 0.75, share(bottom) - 0.02]
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A road of grey 100 below `horizon`, sky above, a red bonnet below `bonnet`.
    fn frame(horizon: f64, bonnet: f64) -> RgbPicture {
        let (width, height) = (320u32, 240u32);
        let mut data = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let (share, grain) = (f64::from(y) / f64::from(height), ((x * 7 + y * 13) % 11) as u8);
                data.extend(match share {
                    s if s < horizon => [150, 180, 240],
                    s if s < bonnet => [95 + grain; 3],
                    _ => [190, 30, 30],
                });
            }
        }
        RgbPicture { width, height, data }
    }

    #[test]
    fn the_road_lies_between_horizon_and_bonnet() {
        for (horizon, bonnet) in [(0.4, 0.9), (0.55, 1.0), (0.3, 0.95)] {
            let [left, top, right, bottom] = find(&cells(&frame(horizon, bonnet)));
            assert!(top > horizon && top < horizon + 0.25, "{horizon}: {top}");
            assert!(bottom <= bonnet + 0.01 && bottom > bonnet - 0.1, "{bonnet}: {bottom}");
            assert!(left > 0.1 && right < 0.9);
        }
        assert_eq!(find(&cells(&frame(0.0, 1.0))), [0.0, 0.0, 1.0, 1.0]);
    }

    #[test]
    fn one_odd_picture_does_not_move_the_region() {
        let mut finder = RoadFinder::default();
        assert!(finder.wants_a_look() && finder.region().is_none());
        (0..3).for_each(|_| finder.look(&frame(0.5, 0.9)));
        let before = finder.region().unwrap();
        finder.look(&frame(0.0, 1.0));
        assert_eq!(finder.region(), Some(before));
        // Half of it sky, of 165 - 240 in blue; the bonnet red.
        let [red_green, yellow_blue] = finder.scene();
        assert!(red_green > -10.0 && red_green < 10.0 && yellow_blue < -20.0, "{:?}", finder.scene());
        (0..10).for_each(|_| assert!(finder.region().is_some()));
        assert!(finder.wants_a_look());
    }

    #[test]
    fn a_region_is_auto_full_or_four_edges() {
        assert_eq!("auto".parse::<Look>().unwrap(), Look::Auto);
        assert_eq!("full".parse::<Look>().unwrap(), Look::At(Region::WHOLE));
        let drawn = Look::At(Region::new(0.2, 0.5, 0.8, 0.9).unwrap());
        assert_eq!("0.2, 0.5,0.8,0.9".parse::<Look>().unwrap(), drawn);
        for wrong in ["", "half", "0.2,0.5,0.8", "0.8,0.5,0.2,0.9", "0,0,1,1.5"] {
            assert!(wrong.parse::<Look>().is_err(), "{wrong}");
        }
    }
}
