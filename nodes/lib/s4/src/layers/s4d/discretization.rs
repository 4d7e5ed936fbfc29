//! From the continuous, diagonal state space to discrete time by zero-order hold, and the gradients back.
//!
//! `A = -exp(log_a_real) + i a_imag`, `Delta = exp(log_dt)`, `A_bar = exp(Delta A)`,
//! `C_bar = C (A_bar - 1)/A`.

use super::Parameters;
use num_complex::Complex64;

/// Discrete-time constants, shape `(H, N/2)` each.
#[derive(Default)]
pub(crate) struct Discretization {
    /// `A_bar`.
    pub(crate) a_bar: Vec<Complex64>,
    /// `C_bar`.
    pub(crate) c_bar: Vec<Complex64>,
}

/// One state's continuous constants, as the forward and the backward pass both need them.
struct State {
    dt: f64,
    a: Complex64,
    c: Complex64,
    a_bar: Complex64,
    /// `(A_bar - 1)/A`.
    hold: Complex64,
}

impl State {
    fn new(parameters: &Parameters, channel: usize, index: usize) -> Self {
        let dt = parameters.log_dt[channel].exp();
        let a = Complex64::new(-parameters.log_a_real[index].exp(), parameters.a_imag[index]);
        let c = Complex64::new(parameters.c[2 * index], parameters.c[2 * index + 1]);
        let a_bar = (a * dt).exp();
        Self { dt, a, c, a_bar, hold: (a_bar - 1.0) / a }
    }
}

impl Discretization {
    /// Discretises every state of every channel.
    pub(crate) fn compute(&mut self, parameters: &Parameters) {
        self.a_bar.clear();
        self.c_bar.clear();
        for (channel, index) in parameters.states() {
            let state = State::new(parameters, channel, index);
            self.a_bar.push(state.a_bar);
            self.c_bar.push(state.c * state.hold);
        }
    }
}

/// Gradients of the loss by what [`Discretization`] holds, as `dL/dRe + i dL/dIm`, shape `(H, N/2)`.
pub(crate) struct DiscreteGradient {
    /// By `Delta A`, through the powers of `A_bar` in the kernel.
    pub(crate) exponent: Vec<Complex64>,
    /// By `C_bar`.
    pub(crate) c_bar: Vec<Complex64>,
}

/// Carries discrete gradients to the parameters; `gradient` is laid out as the parameters are and
/// its `d` is left alone.
///
/// For a holomorphic `w = f(z)` the gradient in this convention is `g_z = g_w conj(f'(z))`.
pub(crate) fn backward(parameters: &Parameters, discrete: &DiscreteGradient, gradient: &mut [f64]) {
    let (channels, states) = (parameters.log_dt.len(), parameters.log_a_real.len());
    let (log_dt, rest) = gradient.split_at_mut(channels);
    let (log_a_real, rest) = rest.split_at_mut(states);
    let (a_imag, rest) = rest.split_at_mut(states);
    log_dt.fill(0.0);
    for (channel, index) in parameters.states() {
        let State { dt, a, c, a_bar, hold } = State::new(parameters, channel, index);
        let by_c_bar = discrete.c_bar[index];
        let by_c = by_c_bar * hold.conj();
        let by_exponent = discrete.exponent[index] + by_c_bar * (c / a * a_bar).conj();
        let by_a = by_exponent * dt - by_c_bar * (c * hold / a).conj();
        rest[2 * index] = by_c.re;
        rest[2 * index + 1] = by_c.im;
        log_a_real[index] = by_a.re * a.re;
        a_imag[index] = by_a.im;
        log_dt[channel] += (by_exponent * a.conj()).re * dt;
    }
}
