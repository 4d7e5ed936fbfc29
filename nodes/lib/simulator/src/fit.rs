//! A point of a simulator's parameters and starts, its derivatives, which are rollouts, and what the sizes there are worth.

use nalgebra::DVector;

use crate::SimulatorError;
use crate::linear::{Layout, Normal, Starts, student, window_costs};
use crate::model::{Model, Point, Residuals};

/// A point, with what the simulator says there.
#[derive(Debug, Clone)]
pub(crate) struct State {
    pub(crate) point: Point,
    pub(crate) residuals: Residuals,
    pub(crate) starts: Starts,
    pub(crate) projected: Residuals,
    shifts: Vec<DVector<f64>>,
    pub(crate) costs: Vec<f64>,
}

/// A fit of some candidates.
#[derive(Debug, Clone)]
pub(crate) struct Fitted {
    pub(crate) state: State,
    /// The candidates fitted, with 90 % interval and the square of size over standard error; in their order.
    pub(crate) sizes: Vec<Size>,
    /// Derivatives by them.
    pub(crate) columns: Vec<Residuals>,
    /// Whether it ended where nothing more is gained, and not at its last step.
    pub(crate) is_settled: bool,
}

impl Fitted {
    /// By how much the candidate fitted last is there beyond chance: its size over its standard error, squared, less what that must exceed.
    pub(crate) fn last_margin(&self) -> f64 {
        self.sizes.last().map_or(f64::NEG_INFINITY, Size::margin)
    }

    /// The same of the least evident one.
    pub(crate) fn least_margin(&self) -> f64 {
        self.sizes.iter().map(Size::margin).fold(f64::INFINITY, f64::min)
    }

    /// The candidates, in their order.
    pub(crate) fn members(&self) -> Vec<usize> {
        self.sizes.iter().map(|s| s.candidate).collect()
    }

    /// Whether these are the candidates, in whatever order.
    pub(crate) fn has_same_members(&self, others: &[usize]) -> bool {
        self.sizes.len() == others.len() && self.sizes.iter().all(|s| others.contains(&s.candidate))
    }

    /// The same fit, its clearest candidate first.
    pub(crate) fn largest_first(mut self) -> Self {
        let mut both: Vec<(Size, Residuals)> = self.sizes.into_iter().zip(self.columns).collect();
        both.sort_by(|a, b| b.0.wald.total_cmp(&a.0.wald));
        (self.sizes, self.columns) = both.into_iter().unzip();
        self
    }

    /// The place of the least evident of those that are not evident.
    pub(crate) fn least_evident(&self) -> Option<usize> {
        let share = |s: &Size| s.wald / s.needed;
        let places = (0..self.sizes.len()).filter(|&k| share(&self.sizes[k]) <= 1.0);
        places.min_by(|&a, &b| share(&self.sizes[a]).total_cmp(&share(&self.sizes[b])))
    }
}

/// A fitted size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Size {
    pub(crate) candidate: usize,
    pub(crate) value: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Square of the distance from the null over the standard error.
    pub(crate) wald: f64,
    /// What that must exceed.
    pub(crate) needed: f64,
}

impl Size {
    fn margin(&self) -> f64 {
        self.wald - self.needed
    }
}

/// Chance, at each side, that a recording of a car that is as the simulator gets anything named.
const FALSE: f64 = 0.01;

/// What the largest of some sizes over their standard errors, squared, exceeds by chance (Bonferroni). The errors are themselves estimated.
pub(crate) fn needed(candidates: usize, freedom: f64) -> f64 {
    student(FALSE / candidates.max(1) as f64, freedom).powi(2)
}

impl State {
    fn new(layout: &Layout, point: Point, residuals: Residuals, starts: Starts) -> Self {
        let (projected, shifts) = starts.project(layout, &residuals);
        let costs = window_costs(layout, &projected);
        Self { point, residuals, starts, projected, shifts, costs }
    }

    /// Cost of the training windows.
    pub(crate) fn training(&self, layout: &Layout) -> f64 {
        layout.training().map(|w| self.costs[w]).sum()
    }

    /// Cost of the windows that are only scored.
    pub(crate) fn held_out(&self, layout: &Layout) -> f64 {
        (0..self.costs.len()).filter(|&w| layout.held_out[w]).map(|w| self.costs[w]).sum()
    }

    /// How far residuals move by what moved between another state and this one, as far as derivatives there reach.
    pub(crate) fn predicted(
        &self,
        from: &Self,
        layout: &Layout,
        active: &[usize],
        columns: &[Residuals],
    ) -> Residuals {
        let shifts: Vec<DVector<f64>> = self
            .point
            .starts
            .iter()
            .zip(&from.point.starts)
            .map(|(to, at)| DVector::from_iterator(to.len(), to.iter().zip(at).map(|(to, at)| to - at)))
            .collect();
        let mut out = from.starts.moved_by(layout, &shifts);
        for (&c, column) in active.iter().zip(columns) {
            let change = self.point.values[c] - from.point.values[c];
            out.iter_mut().zip(column).for_each(|(m, d)| *m += change * d);
        }
        out
    }

    /// Another point, with the starts as the derivatives say that they follow; `moved`: how far residuals move that way.
    fn moved(&self, layout: &Layout, values: Vec<f64>, moved: &Residuals) -> Point {
        let (_, extra) = self.starts.project(layout, moved);
        let shift = |x: &Vec<f64>, a: &DVector<f64>, b: &DVector<f64>| {
            x.iter().zip(a.iter().zip(b.iter())).map(|(x, (a, b))| x + a + b).collect()
        };
        let starts = self.point.starts.iter().zip(self.shifts.iter().zip(&extra));
        Point { values, starts: starts.map(|(x, (a, b))| shift(x, a, b)).collect() }
    }
}

/// The problem: a model, and where its windows lie.
pub(crate) struct Fitter<'a> {
    pub(crate) model: &'a Model<'a>,
    pub(crate) layout: Layout,
    /// Passes when it began.
    begun: usize,
}

impl<'a> Fitter<'a> {
    pub(crate) fn new(model: &'a Model<'a>) -> Self {
        let mut at = 0;
        let windows = model.drive.windows.iter().map(|w| {
            let len = model.window_len(w);
            at += len;
            (at - len, len)
        });
        let layout = Layout {
            windows: windows.collect(),
            held_out: model.drive.windows.iter().map(|w| w.held_out).collect(),
            block: model.drive.windows.iter().map(|w| w.block).collect(),
        };
        Self { model, layout, begun: model.roll.passes() }
    }

    /// Rollouts of the recording so far.
    pub(crate) fn rollouts(&self) -> f64 {
        let stretches = self.model.drive.stretches.len().max(1);
        (self.model.roll.passes() - self.begun) as f64 / stretches as f64
    }

    /// The simulator at a point, its starts fitted.
    pub(crate) fn at(&self, point: Point) -> Result<State, SimulatorError> {
        let first = self.around(point, None, &[])?.0;
        let values = first.point.values.clone();
        let there = self.trials(&first, &[], &[values])?.into_iter().next();
        Ok(there.filter(|s| s.residuals.iter().all(|r| r.is_finite())).unwrap_or(first))
    }

    /// The derivatives by the starts and by some candidates, projected, at a point; the residuals there where they are known.
    pub(crate) fn around(
        &self,
        point: Point,
        known: Option<Residuals>,
        candidates: &[usize],
    ) -> Result<(State, Vec<Residuals>), SimulatorError> {
        let model = self.model;
        let mut points = Vec::new();
        if known.is_none() {
            points.push(point.clone());
        }
        let ahead = points.len();
        for (f, (_, _, small)) in model.free.iter().enumerate() {
            let mut other = point.clone();
            other.starts.iter_mut().for_each(|x| x[f] += small);
            points.push(other);
        }
        let (steps, nudged) = self.nudged(&point, candidates);
        points.extend(nudged);
        let mut results = model.residuals(&points)?;
        let base = known.unwrap_or_else(|| results[0].clone());
        if let Some(at) = base.iter().position(|r| !r.is_finite()) {
            return Err(self.not_finite(at));
        }
        let rest = results.split_off(ahead);
        let count = model.free.len();
        let by_start: Vec<Residuals> =
            rest[..count].iter().zip(&model.free).map(|(r, (_, _, small))| slope(&base, r, *small)).collect();
        let starts = Starts::new(&self.layout, &by_start);
        let columns = rest[count..].iter().zip(&steps).map(|(r, step)| slope(&base, r, *step)).collect();
        Ok((State::new(&self.layout, point, base, starts), columns))
    }

    /// The derivatives by some candidates at a state.
    pub(crate) fn columns_of(
        &self,
        state: &State,
        candidates: &[usize],
    ) -> Result<Vec<Residuals>, SimulatorError> {
        let (steps, nudged) = self.nudged(&state.point, candidates);
        let results = self.model.residuals(&nudged)?;
        Ok(results.iter().zip(&steps).map(|(r, step)| slope(&state.residuals, r, *step)).collect())
    }

    /// By candidate: the small change that a derivative is taken over, and the point there.
    fn nudged(&self, point: &Point, candidates: &[usize]) -> (Vec<f64>, Vec<Point>) {
        let nudge = |&c: &usize| {
            let (step, mut other) = (self.step(c, point.values[c]), point.clone());
            other.values[c] += step;
            (step, other)
        };
        candidates.iter().map(nudge).unzip()
    }

    /// The small change that a derivative is taken over: away from a bound.
    fn step(&self, candidate: usize, value: f64) -> f64 {
        let c = &self.model.candidates[candidate];
        let step = c.step.min(0.5 * (c.high - c.low));
        if value + step > c.high { -step } else { step }
    }

    fn not_finite(&self, at: usize) -> SimulatorError {
        let w = self.layout.windows.iter().position(|(from, len)| (*from..from + len).contains(&at));
        let drive = self.model.drive;
        let window = drive.windows[w.unwrap_or(0)];
        let channels = drive.channels.len();
        let (from, _) = self.layout.windows[w.unwrap_or(0)];
        let sample = window.from + (at - from) / channels;
        SimulatorError::Answer {
            when: "in a rollout with its own parameters",
            why: format!(
                "{} is not finite at {:.2} s of the recording",
                drive.channels[(at - from) % channels].0.name(),
                drive.stretches[window.stretch].segment.time_s(sample)
            ),
        }
    }

    /// Evaluates values of candidates around a state, starts following the derivatives (`columns`, of the candidates given).
    pub(crate) fn trials(
        &self,
        state: &State,
        columns: &[(usize, &Residuals)],
        values: &[Vec<f64>],
    ) -> Result<Vec<State>, SimulatorError> {
        let points: Vec<Point> = values
            .iter()
            .map(|values| {
                let mut moved = vec![0.0; state.residuals.len()];
                for (c, column) in columns {
                    let change = values[*c] - state.point.values[*c];
                    if change != 0.0 {
                        moved.iter_mut().zip(column.iter()).for_each(|(m, d)| *m += change * d);
                    }
                }
                state.moved(&self.layout, values.clone(), &moved)
            })
            .collect();
        self.states(state, points)
    }

    /// Evaluates values of candidates around a state, its starts as they are.
    pub(crate) fn still(&self, state: &State, values: &[Vec<f64>]) -> Result<Vec<State>, SimulatorError> {
        let starts = &state.point.starts;
        self.states(
            state,
            values.iter().map(|v| Point { values: v.clone(), starts: starts.clone() }).collect(),
        )
    }

    fn states(&self, near: &State, points: Vec<Point>) -> Result<Vec<State>, SimulatorError> {
        let results = self.model.residuals(&points)?;
        Ok(points
            .into_iter()
            .zip(results)
            .map(|(point, r)| State::new(&self.layout, point, r, near.starts.clone()))
            .collect())
    }

    /// A value that a candidate can have; of a count a whole number.
    pub(crate) fn within(&self, candidate: usize, value: f64) -> f64 {
        let c = &self.model.candidates[candidate];
        if c.integer { value.round() } else { value }.clamp(c.low, c.high)
    }

    pub(crate) fn sizes(&self, state: &State, active: &[usize], columns: &[Residuals]) -> Vec<Size> {
        let projected: Vec<Residuals> =
            columns.iter().map(|c| state.starts.project(&self.layout, c).0).collect();
        let normal = Normal::new(&self.layout, &state.projected, &projected.iter().collect::<Vec<_>>());
        let known = normal.known();
        let candidates = self.model.candidates.len();
        let size = |(place, &c): (usize, &usize)| {
            let value = state.point.values[c];
            let null = self.model.candidates[c].null;
            let (error, freedom) = known.as_ref().map_or((f64::INFINITY, 1.0), |k| {
                (k.covariance[(place, place)].max(0.0).sqrt(), k.freedom[place])
            });
            let reach = student(0.05, freedom) * error;
            let wald = if error > 0.0 { ((value - null) / error).powi(2) } else { 0.0 };
            let needed = needed(candidates, freedom);
            Size { candidate: c, value, low: value - reach, high: value + reach, wald, needed }
        };
        active.iter().enumerate().map(size).collect()
    }
}

fn slope(at: &Residuals, beside: &Residuals, step: f64) -> Residuals {
    beside.iter().zip(at).map(|(b, a)| if b.is_finite() { (b - a) / step } else { 0.0 }).collect()
}
