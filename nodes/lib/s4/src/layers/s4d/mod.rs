//! S4D: one diagonal linear state space per channel, with all parameters trained.
//!
//! Continuous: `dh/dt = A h + B u`, `y = C h + D u` with B = 1 (paper eq. `s4_cont`). Zero-order hold, the
//! integral folded into C (eq. `s4_zoh_c`); then two forms of one map:
//! the recurrence `h_k = A_bar h_(k-1) + u_k`, `y_k = 2 Re(C_bar h_k) + D u_k` (eq. `s4_rec`), and the convolution
//! `y = K * u + D u`, `K_k = 2 Re sum_n C_bar_n A_bar_n^k` (eq. `s4_conv`). States come in conjugate pairs of
//! which one is kept, hence `2 Re` over N/2 states.
//!
//! | parameter | shape | meaning | start |
//! | --- | --- | --- | --- |
//! | `log_dt` | `(H)` | log of the step Delta, in samples | log-uniform in the configured range |
//! | `log_a_real` | `(H, N/2)` | log of -Re A | log 1/2 (S4D-Lin) |
//! | `a_imag` | `(H, N/2)` | Im A | pi n (S4D-Lin) |
//! | `c` | `(H, N/2, 2)` | C, real and imaginary part | standard complex normal |
//! | `d` | `(H)` | D, the direct path | standard normal |
//!
//! Source: Gu, Gupta, Goel, Re, "On the Parameterization and Initialization of Diagonal State Space
//! Models" (arXiv 2206.11893), and the names of its reference `s4d.py`.

mod convolution;
mod discretization;
mod kernel;
#[cfg(test)]
mod tests;

use super::{Backward, BlockSpec, Layer, ParameterGroup, Pass, add_scaled, dot};
use crate::Error;
use convolution::Convolution;
use discretization::{DiscreteGradient, Discretization};
use num_complex::Complex64;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rayon::prelude::*;
use std::f64::consts::PI;

/// Views of one layer's weights; shapes in the module's table.
pub(crate) struct Parameters<'a> {
    log_dt: &'a [f64],
    log_a_real: &'a [f64],
    a_imag: &'a [f64],
    c: &'a [f64],
    d: &'a [f64],
}

impl Parameters<'_> {
    /// Channel and flat index of every state, in order.
    fn states(&self) -> impl Iterator<Item = (usize, usize)> + use<> {
        let pairs = self.log_a_real.len() / self.log_dt.len();
        (0..self.log_a_real.len()).map(move |index| (index / pairs, index))
    }
}

/// `channels` independent state spaces of `2 * pairs` states.
pub(crate) struct S4d {
    channels: usize,
    pairs: usize,
    log_step: [f64; 2],
    discrete: Discretization,
    convolution: Option<Convolution>,
}

impl S4d {
    /// `step` is the range of the initial Delta.
    pub(crate) fn new(channels: usize, states: usize, step: [f64; 2]) -> Self {
        Self {
            channels,
            pairs: states / 2,
            log_step: step.map(f64::ln),
            discrete: Discretization::default(),
            convolution: None,
        }
    }

    fn parameters<'a>(&self, weights: &'a [f64]) -> Parameters<'a> {
        let states = self.channels * self.pairs;
        let (log_dt, rest) = weights.split_at(self.channels);
        let (log_a_real, rest) = rest.split_at(states);
        let (a_imag, rest) = rest.split_at(states);
        let (c, d) = rest.split_at(2 * states);
        Parameters { log_dt, log_a_real, a_imag, c, d }
    }
}

impl Layer for S4d {
    fn inputs(&self) -> usize {
        self.channels
    }

    fn blocks(&self) -> Vec<BlockSpec> {
        let (channels, pairs) = (self.channels, self.pairs);
        vec![
            ("log_dt", vec![channels], ParameterGroup::StateSpace),
            ("log_a_real", vec![channels, pairs], ParameterGroup::StateSpace),
            ("a_imag", vec![channels, pairs], ParameterGroup::StateSpace),
            ("c", vec![channels, pairs, 2], ParameterGroup::Ordinary),
            ("d", vec![channels], ParameterGroup::Ordinary),
        ]
    }

    fn initialize(&self, rng: &mut ChaCha8Rng, weights: &mut [f64]) {
        let states = self.channels * self.pairs;
        let (log_dt, rest) = weights.split_at_mut(self.channels);
        let (log_a_real, rest) = rest.split_at_mut(states);
        let (a_imag, rest) = rest.split_at_mut(states);
        let (c, d) = rest.split_at_mut(2 * states);
        let [low, high] = self.log_step;
        log_dt.fill_with(|| low + (high - low) * rng.random::<f64>());
        log_a_real.fill(0.5_f64.ln());
        for (index, value) in a_imag.iter_mut().enumerate() {
            *value = PI * (index % self.pairs) as f64;
        }
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        c.fill_with(|| normal() * std::f64::consts::FRAC_1_SQRT_2);
        d.fill_with(normal);
    }

    fn forward(&mut self, pass: &Pass, weights: &[f64], x: &[f64], y: &mut [f64]) -> Result<(), Error> {
        let parameters = self.parameters(weights);
        self.discrete.compute(&parameters);
        let lags = pass.lengths.iter().copied().max().unwrap_or(0);
        let sequences = pass.lengths.len();
        let convolution = match self.convolution.take() {
            Some(convolution) if convolution.fits(lags, sequences) => convolution,
            _ => Convolution::new(self.channels, lags, sequences),
        };
        let convolution = self.convolution.insert(convolution);
        let (pairs, total, discrete) = (self.pairs, pass.total(), &self.discrete);
        let rows = convolution.rows.par_iter_mut().zip(y.par_chunks_exact_mut(total));
        rows.zip(x.par_chunks_exact(total)).enumerate().try_for_each(|(channel, ((row, y), x))| {
            let states = channel * pairs..(channel + 1) * pairs;
            let (a_bar, c_bar) = (&discrete.a_bar[states.clone()], &discrete.c_bar[states]);
            row.set_kernel(lags, |kernel| kernel::fill(kernel, a_bar, c_bar))?;
            row.apply(pass, x, y)?;
            add_scaled(y, parameters.d[channel], x);
            Ok(())
        })
    }

    fn backward(&mut self, pass: &Pass, signals: Backward) -> Result<(), Error> {
        let Backward { weights, x, dy, dx, gradient, .. } = signals;
        let parameters = self.parameters(weights);
        let total = pass.total();
        let lags = pass.lengths.iter().copied().max().unwrap_or(0);
        let Some(convolution) = &mut self.convolution else {
            return Err(Error::Empty { what: "forward pass before backward" });
        };
        let (states, direct) = gradient.split_at_mut(weights.len() - self.channels);
        let (pairs, discretization) = (self.pairs, &self.discrete);
        let rows = convolution.rows.par_iter_mut().zip(dy.par_chunks_exact(total));
        let rows = rows.zip(x.par_chunks_exact(total)).zip(dx.par_chunks_exact_mut(total)).zip(direct);
        let by_state: Vec<Vec<(Complex64, Complex64)>> = rows
            .enumerate()
            .map(|(channel, ((((row, dy), x), dx), by_d))| {
                row.backward(pass, dy, dx)?;
                add_scaled(dx, parameters.d[channel], dy);
                *by_d = dot(dy, x);
                let by_kernel = row.kernel_gradient(lags)?;
                let states = channel * pairs..(channel + 1) * pairs;
                let gradients = states.map(|index| {
                    kernel::backward(by_kernel, discretization.a_bar[index], discretization.c_bar[index])
                });
                Ok(gradients.collect())
            })
            .collect::<Result<_, Error>>()?;
        let (c_bar, exponent) = by_state.into_iter().flatten().unzip();
        let discrete = DiscreteGradient { exponent, c_bar };
        discretization::backward(&parameters, &discrete, states);
        Ok(())
    }

    /// Real and imaginary part of every state.
    fn state_len(&self) -> usize {
        2 * self.channels * self.pairs
    }

    fn prepare(&mut self, weights: &[f64]) {
        self.discrete.compute(&self.parameters(weights));
    }

    fn step(&self, weights: &[f64], state: &mut [f64], x: &[f64], y: &mut [f64]) {
        let direct = self.parameters(weights).d;
        let constants =
            self.discrete.a_bar.chunks_exact(self.pairs).zip(self.discrete.c_bar.chunks_exact(self.pairs));
        let states = state.chunks_exact_mut(2 * self.pairs).zip(constants);
        for (((y, &x), &d), (state, (a_bar, c_bar))) in y.iter_mut().zip(x).zip(direct).zip(states) {
            let mut sum = 0.0;
            for ((h, a_bar), c_bar) in state.as_chunks_mut::<2>().0.iter_mut().zip(a_bar).zip(c_bar) {
                let next = a_bar * Complex64::new(h[0], h[1]) + x;
                *h = [next.re, next.im];
                sum += c_bar.re * next.re - c_bar.im * next.im;
            }
            *y = 2.0 * sum + d * x;
        }
    }
}
