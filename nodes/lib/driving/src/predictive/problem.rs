//! One step's quadratic program.
//!
//! ```text
//! min   sum_k  q (e_k/E)^2 + q_c ((p_k + v_y,k/v_x,k)/C)^2 + ((c_k - c_{k-1})/(R dt))^2 + s_k + s_k^2
//! with  x_k = x_{k-1} + dt/2 (f_k + f_{k-1})                      the car, by the trapezoidal rule: stable however stiff the tires
//!       d_k = (1 - f) d_{k-1} + (f - g) c_{k-1} + g c_k           wheels d that follow a command c with a lag T: f = 1 - exp(-dt/T), g = 1 - f T/dt
//!       |c_k| <= c_max,  |c_k - c_{k-1}| <= rate dt               hard
//!       -right_k - S s_k <= e_k <= left_k + S s_k,  s_k >= 0      the track's edges: soft, so that there is always an answer
//!       |alpha_f,k| <= alpha_max + A s_k                          no more slip at the front wheels than has a use: soft, too
//! ```

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};

use super::model::{Linear, MOVES, Motion, STATES};

/// Unknowns of an instant: the motion, the command, how far outside.
const UNKNOWNS: usize = STATES + 2;
const COMMAND: usize = STATES;
const OUTSIDE: usize = STATES + 1;
/// Of the motion, what the front wheels' slip depends on.
const SLIPS: std::ops::Range<usize> = 2..STATES;
/// Inequalities of an instant.
const BOUNDS: usize = 9;
/// Accuracy: a hundred times finer than the servo's resolution.
const TOLERANCE: f64 = 1e-4;
const REFINED: f64 = 1e-8;
/// Iterations at most: twice what a hard corner takes.
const ITERATIONS: u32 = 30;

/// What errors weigh.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Scales {
    /// Offset E that weighs one.
    pub(crate) offset_m: f64,
    /// Direction of travel against the line C.
    pub(crate) course_rad: f64,
    /// Rate of the steering command R.
    pub(crate) rate_radps: f64,
    /// Distance S outside of the edge.
    pub(crate) outside_m: f64,
    /// Slip A beyond the largest that has a use, which weighs as much.
    pub(crate) slip_rad: f64,
    /// Weight of the last instant over the others.
    pub(crate) end: f64,
}

/// Limits that hold in any case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hard {
    pub(crate) angle_rad: f64,
    pub(crate) rate_radps: f64,
    /// Slip of the front wheels that has a use: not quite as hard.
    pub(crate) slip_rad: f64,
}

/// An instant of the horizon.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stage {
    pub(crate) linear: Linear,
    pub(crate) v_x_mps: f64,
    /// Room to the right and to the left of the line.
    pub(crate) room_m: [f64; 2],
}

/// A program of one step.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Problem<'a> {
    pub(crate) start: Motion,
    pub(crate) command_rad: f64,
    /// The first one is the start's.
    pub(crate) stages: &'a [Stage],
    pub(crate) step_s: f64,
    pub(crate) lag_s: f64,
    pub(crate) scales: Scales,
    pub(crate) hard: Hard,
}

/// The motion and the commands found, instant by instant, without the start.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Solution {
    pub(crate) motion: Vec<Motion>,
    pub(crate) commands_rad: Vec<f64>,
    pub(crate) iterations: u32,
}

/// A sparse matrix being written.
#[derive(Default)]
struct Entries {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
}

impl Entries {
    fn put(&mut self, row: usize, column: usize, value: f64) {
        self.rows.push(row);
        self.columns.push(column);
        self.values.push(value);
    }

    fn matrix(self, rows: usize, columns: usize) -> CscMatrix<f64> {
        CscMatrix::new_from_triplets(rows, columns, self.rows, self.columns, self.values)
    }
}

/// Solves programs of the same length one after the other; what does not change from one to the next is kept.
#[derive(Default)]
pub(crate) struct Solver {
    kept: Option<(usize, DefaultSolver<f64>)>,
}

// Nothing of a drive is in it.
impl Clone for Solver {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl std::fmt::Debug for Solver {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Solver").finish_non_exhaustive()
    }
}

impl Solver {
    /// `None`: no convergence, or figures that are not finite.
    pub(crate) fn solve(&mut self, problem: &Problem<'_>) -> Option<Solution> {
        let steps = problem.stages.len().checked_sub(1)?;
        let (p, q) = problem.cost();
        let (a, b) = problem.constraints();
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        if !(finite(&p.nzval) && finite(&q) && finite(&a.nzval) && finite(&b)) {
            return None;
        }
        let kept = self.kept.take().filter(|(length, _)| *length == steps);
        let mut solver = match kept {
            Some((_, mut solver)) => {
                solver.update_data(&p, &q, &a, &b).ok()?;
                solver
            }
            None => {
                let cones = [
                    SupportedConeT::ZeroConeT(STATES * steps),
                    SupportedConeT::NonnegativeConeT(BOUNDS * steps),
                ];
                DefaultSolver::new(&p, &q, &a, &b, &cones, settings()).ok()?
            }
        };
        solver.solve();
        let solution = &solver.solution;
        let found = matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved);
        let solution = (found && finite(&solution.x)).then(|| Solution {
            motion: solution.x.chunks_exact(UNKNOWNS).map(|x| std::array::from_fn(|lane| x[lane])).collect(),
            commands_rad: solution.x.chunks_exact(UNKNOWNS).map(|x| x[COMMAND]).collect(),
            iterations: solution.iterations,
        });
        // What failed may have left something behind.
        self.kept = solution.is_some().then_some((steps, solver));
        solution
    }
}

fn settings() -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        max_iter: ITERATIONS,
        tol_gap_abs: TOLERANCE,
        tol_gap_rel: TOLERANCE,
        tol_feas: TOLERANCE,
        // Data are exchanged from step to step: nothing may be left out of the first.
        presolve_enable: false,
        // The factors are as accurate as the tolerance needs; more refinement doubles the time.
        iterative_refinement_reltol: REFINED,
        iterative_refinement_abstol: REFINED,
        input_sparse_dropzeros: false,
        ..DefaultSettings::default()
    }
}

/// Place of an unknown of instant `k`, from 1.
fn at(k: usize, lane: usize) -> usize {
    (k - 1) * UNKNOWNS + lane
}

impl Problem<'_> {
    fn steps(&self) -> usize {
        self.stages.len() - 1
    }

    /// Half of the Hessian's double, upper triangle, and the gradient at zero.
    fn cost(&self) -> (CscMatrix<f64>, Vec<f64>) {
        let (steps, scales) = (self.steps(), &self.scales);
        let (mut p, mut q) = (Entries::default(), vec![0.0; steps * UNKNOWNS]);
        let turns = 2.0 / (scales.rate_radps * self.step_s).powi(2);
        for k in 1..=steps {
            let end = if k == steps { scales.end } else { 1.0 };
            let v_x = self.stages[k].v_x_mps;
            let course = 2.0 * end / scales.course_rad.powi(2);
            p.put(at(k, 0), at(k, 0), 2.0 * end / scales.offset_m.powi(2));
            p.put(at(k, 1), at(k, 1), course);
            p.put(at(k, 1), at(k, 2), course / v_x);
            p.put(at(k, 2), at(k, 2), course / (v_x * v_x));
            p.put(at(k, COMMAND), at(k, COMMAND), if k == steps { turns } else { 2.0 * turns });
            if k > 1 {
                p.put(at(k - 1, COMMAND), at(k, COMMAND), -turns);
            } else {
                q[at(k, COMMAND)] = -turns * self.command_rad;
            }
            p.put(at(k, OUTSIDE), at(k, OUTSIDE), 2.0);
            q[at(k, OUTSIDE)] = 1.0;
        }
        (p.matrix(q.len(), q.len()), q)
    }

    fn constraints(&self) -> (CscMatrix<f64>, Vec<f64>) {
        let steps = self.steps();
        let (mut a, mut b) = (Entries::default(), vec![0.0; (STATES + BOUNDS) * steps]);
        let half_s = 0.5 * self.step_s;
        let follows = if self.lag_s > 0.0 { 1.0 - (-self.step_s / self.lag_s).exp() } else { 1.0 };
        let with_it = 1.0 - follows * self.lag_s / self.step_s;
        for k in 1..=steps {
            let (before, here) = (&self.stages[k - 1].linear, &self.stages[k].linear);
            for row in 0..MOVES {
                let place = (k - 1) * STATES + row;
                b[place] = half_s * (before.rest[row] + here.rest[row]);
                for lane in 0..STATES {
                    let one = f64::from(u8::from(lane == row));
                    a.put(place, at(k, lane), one - half_s * here.jacobian[row][lane]);
                    let earlier = one + half_s * before.jacobian[row][lane];
                    if k > 1 {
                        a.put(place, at(k - 1, lane), -earlier);
                    } else {
                        b[place] += earlier * self.start[lane];
                    }
                }
            }
            let place = (k - 1) * STATES + MOVES;
            a.put(place, at(k, MOVES), 1.0);
            a.put(place, at(k, COMMAND), -with_it);
            if k > 1 {
                a.put(place, at(k - 1, MOVES), follows - 1.0);
                a.put(place, at(k - 1, COMMAND), with_it - follows);
            } else {
                b[place] = (1.0 - follows) * self.start[MOVES] + (follows - with_it) * self.command_rad;
            }
            self.bounds(k, STATES * steps + (k - 1) * BOUNDS, &mut a, &mut b);
        }
        (a.matrix(b.len(), steps * UNKNOWNS), b)
    }

    fn bounds(&self, k: usize, first: usize, a: &mut Entries, b: &mut [f64]) {
        let Hard { angle_rad, rate_radps, slip_rad } = self.hard;
        let linear = &self.stages[k].linear;
        for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let [turn, angle, edge, slip] = [0, 2, 4, 6].map(|row| first + row + side);
            a.put(turn, at(k, COMMAND), sign);
            b[turn] = rate_radps * self.step_s;
            if k > 1 {
                a.put(turn, at(k - 1, COMMAND), -sign);
            } else {
                b[turn] += sign * self.command_rad;
            }
            a.put(angle, at(k, COMMAND), sign);
            b[angle] = angle_rad;
            a.put(edge, at(k, 0), sign);
            a.put(edge, at(k, OUTSIDE), -self.scales.outside_m);
            b[edge] = self.stages[k].room_m[side];
            for lane in SLIPS {
                a.put(slip, at(k, lane), sign * linear.slip[lane]);
            }
            a.put(slip, at(k, OUTSIDE), -self.scales.slip_rad);
            b[slip] = slip_rad - sign * linear.slip_rest_rad;
        }
        a.put(first + 8, at(k, OUTSIDE), -1.0);
    }
}
