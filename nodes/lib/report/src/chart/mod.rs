//! Pictures over two axes.
//!
//! A [`Chart`] is a list of [`Layer`]s, drawn in order. Its legend stands beside it in the page's text, where it cannot cover the data.

mod axis;
mod draw;
mod geometry;

pub use axis::Axis;

use plotters::prelude::{IntoDrawingArea as _, SVGBackend, WHITE};

use crate::{ReportError, Role};

/// Points per unit of the page: the SVG writer rounds to whole units, so pictures are drawn large and scaled.
pub(crate) const SCALE: f64 = 4.0;

/// Something to draw.
#[derive(Debug, Clone, PartialEq)]
pub enum Layer {
    /// A curve through points; a NaN interrupts it.
    Line {
        /// Whose.
        role: Role,
        /// What the legend calls it; empty: not in the legend.
        name: String,
        /// (x, y).
        points: Vec<(f64, f64)>,
    },
    /// An area between two curves; a NaN interrupts it.
    Band {
        /// Whose.
        role: Role,
        /// What the legend calls it.
        name: String,
        /// (x, low, high).
        points: Vec<(f64, f64, f64)>,
    },
    /// Samples: each cell of a fine grid as dark as samples lie in it.
    Cloud {
        /// Whose.
        role: Role,
        /// What the legend calls it.
        name: String,
        /// (x, y).
        points: Vec<(f64, f64)>,
    },
    /// Values with intervals.
    ErrorBars {
        /// Whose.
        role: Role,
        /// What the legend calls it.
        name: String,
        /// (x, value, low, high).
        points: Vec<(f64, f64, f64, f64)>,
    },
    /// How often each range of x was visited, as a strip along the bottom.
    Density {
        /// What the legend calls it.
        name: String,
        /// (from, to, how often).
        bins: Vec<(f64, f64, f64)>,
    },
    /// A range of x that was not visited.
    Unvisited {
        /// What the legend calls it.
        name: String,
        /// Where it begins.
        from: f64,
        /// Where it ends.
        to: f64,
    },
    /// Coloured cells; the colour runs from white at 0 to the darkest at 1.
    Cells {
        /// (x from, x to, y from, y to, share of the scale).
        cells: Vec<(f64, f64, f64, f64, f64)>,
    },
    /// A value that holds everywhere: a level line.
    Level {
        /// Whose.
        role: Role,
        /// What the legend calls it.
        name: String,
        /// Where on the y axis.
        y: f64,
    },
}

/// A picture over two axes.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// Names the picture for those who cannot see it, and in errors.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// From back to front.
    pub layers: Vec<Layer>,
    /// Width in units of the page.
    pub width: u32,
    /// Height in units of the page.
    pub height: u32,
    /// Whether a unit is as long on either axis: maps and g-g diagrams.
    pub equal_scales: bool,
}

impl Chart {
    /// A picture half a page wide.
    #[must_use]
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self { title: title.into(), x, y, layers: Vec::new(), width: 460, height: 280, equal_scales: false }
    }

    /// With another size, in units of the page (its text is 960 wide).
    #[must_use]
    pub fn sized(self, width: u32, height: u32) -> Self {
        Self { width, height, ..self }
    }

    /// With a unit as long on either axis.
    #[must_use]
    pub fn with_equal_scales(self) -> Self {
        Self { equal_scales: true, ..self }
    }

    /// With one more layer in front.
    #[must_use]
    pub fn with(mut self, layer: Layer) -> Self {
        self.layers.push(layer);
        self
    }

    /// The picture as an SVG element.
    ///
    /// # Errors
    /// [`ReportError::Drawing`].
    pub fn svg(&self) -> Result<String, ReportError> {
        let mut svg = String::new();
        let size = ((f64::from(self.width) * SCALE) as u32, (f64::from(self.height) * SCALE) as u32);
        {
            let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
            let error = |why: String| ReportError::Drawing { chart: self.title.clone(), why };
            area.fill(&WHITE).map_err(|e| error(e.to_string()))?;
            draw::draw(self, &area).map_err(|e| error(e.to_string()))?;
            area.present().map_err(|e| error(e.to_string()))?;
        }
        let title = maud::html! { title { (self.title) } }.into_string();
        let open = format!("<svg width=\"{}\" height=\"{}\"", size.0, size.1);
        let scaled = format!("<svg role=\"img\" class=\"chart\" style=\"max-width:{}px\"", self.width);
        let svg = svg.replacen(&open, &scaled, 1);
        Ok(svg
            .find('>')
            .map_or_else(|| svg.clone(), |end| format!("{}{title}{}", &svg[..=end], &svg[end + 1..])))
    }

    /// The entries of the legend: name, role and what is drawn.
    pub(crate) fn legend(&self) -> impl Iterator<Item = (&str, Swatch)> {
        self.layers
            .iter()
            .filter_map(|layer| match layer {
                Layer::Line { role, name, .. } | Layer::Level { role, name, .. } => {
                    Some((name.as_str(), Swatch::Line(*role)))
                }
                Layer::Band { role, name, .. } => Some((name, Swatch::Band(*role))),
                Layer::Cloud { role, name, .. } => Some((name, Swatch::Dot(*role))),
                Layer::ErrorBars { role, name, .. } => Some((name, Swatch::Dot(*role))),
                Layer::Density { name, .. } => Some((name, Swatch::Density)),
                Layer::Unvisited { name, .. } => Some((name, Swatch::Hatch)),
                Layer::Cells { .. } => None,
            })
            .filter(|(name, _)| !name.is_empty())
    }
}

/// How the legend shows an entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Swatch {
    /// A line.
    Line(Role),
    /// An area.
    Band(Role),
    /// A dot.
    Dot(Role),
    /// The strip of visits.
    Density,
    /// The hatched range.
    Hatch,
}

/// Colour of the strip of visits.
pub(crate) const DENSITY: plotters::style::RGBColor = plotters::style::RGBColor(0xb9, 0xc4, 0xd3);
/// Colour of the hatching.
pub(crate) const HATCH: plotters::style::RGBColor = plotters::style::RGBColor(0xc4, 0xc4, 0xc4);
/// Colour of text and axes.
pub(crate) const INK: plotters::style::RGBColor = plotters::style::RGBColor(0x33, 0x33, 0x33);

/// Colour of a share of the heat scale: white, then ever darker red.
pub(crate) fn heat(share: f64) -> plotters::style::RGBColor {
    const STOPS: [(f64, [f64; 3]); 4] = [
        (0.0, [255.0, 255.0, 255.0]),
        (0.35, [253.0, 212.0, 180.0]),
        (0.7, [227.0, 90.0, 60.0]),
        (1.0, [103.0, 0.0, 13.0]),
    ];
    let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
    let above = STOPS.iter().position(|s| s.0 >= share).unwrap_or(3).max(1);
    let ((from, low), (to, high)) = (STOPS[above - 1], STOPS[above]);
    let t = (share - from) / (to - from);
    let mix = |k: usize| (low[k] + t * (high[k] - low[k])).round() as u8;
    plotters::style::RGBColor(mix(0), mix(1), mix(2))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart() -> Chart {
        Chart::new("force over slip", Axis::new("slip / °"), Axis::new("F_y/F_z"))
            .with(Layer::Unvisited { name: "not driven".into(), from: 8.0, to: 12.0 })
            .with(Layer::Density { name: "data".into(), bins: vec![(0.0, 1.0, 10.0), (1.0, 2.0, 3.0)] })
            .with(Layer::Line {
                role: Role::Identified,
                name: "identified".into(),
                points: vec![(0.0, 0.0), (4.0, f64::NAN), (8.0, 0.9), (12.0, 1e9)],
            })
            .with(Layer::Cloud { role: Role::Measured, name: "samples".into(), points: vec![(1.0, 0.1); 5] })
            .with(Layer::Level { role: Role::Truth, name: "truth".into(), y: 0.8 })
    }

    #[test]
    fn a_picture_is_well_formed_and_repeatable() {
        let svg = chart().svg().unwrap();
        assert_eq!(svg, chart().svg().unwrap());
        assert!(svg.starts_with("<svg role=\"img\"") && svg.trim_end().ends_with("</svg>"));
        assert!(svg.contains("<title>force over slip</title>"));
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn nothing_is_drawn_outside_the_frame() {
        let chart = Chart::new("x", Axis::new("x").with_range(0.0, 1.0), Axis::new("y").with_range(0.0, 1.0))
            .with(Layer::Line {
                role: Role::Measured,
                name: String::new(),
                points: vec![(-50.0, -50.0), (50.0, 50.0)],
            });
        let svg = chart.svg().unwrap();
        for number in svg.split(['"', ' ', ',']).filter_map(|t| t.parse::<f64>().ok()) {
            assert!((-1.0..=1840.0).contains(&number), "{number}");
        }
    }

    #[test]
    fn empty_and_degenerate_data_still_make_a_picture() {
        for points in [vec![], vec![(f64::NAN, f64::NAN)], vec![(2.0, 3.0)], vec![(1e300, -1e300)]] {
            let chart = Chart::new("x", Axis::new("x"), Axis::new("y"))
                .with(Layer::Line { role: Role::Measured, name: String::new(), points: points.clone() })
                .with(Layer::Cloud { role: Role::Measured, name: String::new(), points });
            assert!(chart.svg().unwrap().contains("</svg>"));
            assert!(chart.with_equal_scales().svg().is_ok());
        }
    }

    #[test]
    fn the_legend_names_what_has_a_name() {
        let chart = chart();
        let names: Vec<&str> = chart.legend().map(|(name, _)| name).collect();
        assert_eq!(names, ["not driven", "data", "identified", "samples", "truth"]);
    }

    #[test]
    fn the_heat_scale_darkens() {
        let light = |s: f64| {
            let c = heat(s);
            u32::from(c.0) + u32::from(c.1) + u32::from(c.2)
        };
        assert!((1..=20).all(|k| light(f64::from(k) / 20.0) < light(f64::from(k - 1) / 20.0)));
        assert_eq!(heat(f64::NAN), heat(0.0));
    }
}
