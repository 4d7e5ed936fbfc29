//! Causal convolution of each channel with its kernel by FFT, and its two adjoints.
//!
//! `Y = K U` in the frequency domain, zero-padded to at least `2 L - 1` samples; with the gradient
//! `dY` of the output, `dU = conj(K) dY` and `dK = sum conj(U) dY` over the sequences.
//!
//! Training through the recurrence would do without transforms, at O(L H N). Timed beside this (`benches/s4`), one layer
//! of 16 channels and 16 states alone takes longer than the whole network's epoch takes with the FFT.

use crate::Error;
use crate::layers::Pass;
use num_complex::Complex64;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use std::sync::Arc;

/// Transforms and spectra for one set of sequences.
pub(crate) struct Convolution {
    plan: Plan,
    sequences: usize,
    /// One a channel: none knows of another, so that they can be worked on side by side.
    pub(crate) rows: Vec<Row>,
}

/// Both transforms of one size.
#[derive(Clone)]
pub(crate) struct Plan {
    size: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

/// Spectra of one channel, and room to work in.
pub(crate) struct Row {
    plan: Plan,
    kernel: Vec<Complex64>,
    /// Input spectra, `(sequences, bins)`.
    inputs: Vec<Complex64>,
    kernel_gradient: Vec<Complex64>,
    time: Vec<f64>,
    spectrum: Vec<Complex64>,
    scratch: Vec<Complex64>,
}

/// Smallest `2^n` or `3 * 2^n` that holds a linear convolution of `length` with `length` samples:
/// the sizes at which the FFT is fast.
fn padded_size(length: usize) -> usize {
    let needed = (2 * length).max(4);
    let power = needed.next_power_of_two();
    if power / 4 * 3 >= needed { power / 4 * 3 } else { power }
}

impl Convolution {
    /// Plans for sequences of at most `length` samples.
    pub(crate) fn new(channels: usize, length: usize, sequences: usize) -> Self {
        let size = padded_size(length);
        let mut planner = RealFftPlanner::new();
        let plan =
            Plan { size, forward: planner.plan_fft_forward(size), inverse: planner.plan_fft_inverse(size) };
        let rows = (0..channels).map(|_| Row::new(&plan, sequences)).collect();
        Self { plan, sequences, rows }
    }

    /// Whether the plan fits a set.
    pub(crate) fn fits(&self, length: usize, sequences: usize) -> bool {
        self.plan.size == padded_size(length) && self.sequences == sequences
    }
}

impl Plan {
    fn bins(&self) -> usize {
        self.size / 2 + 1
    }
}

impl Row {
    fn new(plan: &Plan, sequences: usize) -> Self {
        let (bins, zero) = (plan.bins(), Complex64::default());
        Self {
            kernel: vec![zero; bins],
            inputs: vec![zero; sequences * bins],
            kernel_gradient: vec![zero; bins],
            time: vec![0.0; plan.size],
            spectrum: vec![zero; bins],
            scratch: vec![zero; plan.forward.get_scratch_len().max(plan.inverse.get_scratch_len())],
            plan: plan.clone(),
        }
    }

    /// Sets the kernel, written by `fill` into `lags` values.
    pub(crate) fn set_kernel(&mut self, lags: usize, fill: impl FnOnce(&mut [f64])) -> Result<(), Error> {
        fill(&mut self.time[..lags]);
        self.time[lags..].fill(0.0);
        transform(&*self.plan.forward, &mut self.time, &mut self.kernel, &mut self.scratch)
    }

    /// `y = K * x` for every sequence.
    pub(crate) fn apply(&mut self, pass: &Pass, x: &[f64], y: &mut [f64]) -> Result<(), Error> {
        let bins = self.plan.bins();
        for (sequence, (start, length)) in pass.segments().enumerate() {
            let input = &mut self.inputs[sequence * bins..][..bins];
            pad(&mut self.time, &x[start..][..length]);
            transform(&*self.plan.forward, &mut self.time, input, &mut self.scratch)?;
            for ((product, kernel), input) in self.spectrum.iter_mut().zip(&self.kernel).zip(&*input) {
                *product = kernel * input;
            }
            self.back_to_time()?;
            y[start..][..length].copy_from_slice(&self.time[..length]);
        }
        Ok(())
    }

    /// Gradient by the input into `dx`; that by the kernel is kept for [`Self::kernel_gradient`].
    pub(crate) fn backward(&mut self, pass: &Pass, dy: &[f64], dx: &mut [f64]) -> Result<(), Error> {
        let bins = self.plan.bins();
        self.kernel_gradient.fill(Complex64::default());
        for (sequence, (start, length)) in pass.segments().enumerate() {
            pad(&mut self.time, &dy[start..][..length]);
            transform(&*self.plan.forward, &mut self.time, &mut self.spectrum, &mut self.scratch)?;
            let input = &self.inputs[sequence * bins..][..bins];
            let factors = self.kernel.iter().zip(input).zip(&mut self.kernel_gradient);
            for (value, ((kernel, input), gradient)) in self.spectrum.iter_mut().zip(factors) {
                *gradient += input.conj() * *value;
                *value *= kernel.conj();
            }
            self.back_to_time()?;
            dx[start..][..length].copy_from_slice(&self.time[..length]);
        }
        Ok(())
    }

    /// Gradient of the loss by the first `lags` kernel values.
    pub(crate) fn kernel_gradient(&mut self, lags: usize) -> Result<&[f64], Error> {
        self.spectrum.copy_from_slice(&self.kernel_gradient);
        self.back_to_time()?;
        Ok(&self.time[..lags])
    }

    /// `time` = inverse transform of `spectrum`, scaled.
    fn back_to_time(&mut self) -> Result<(), Error> {
        // Products of real signals' spectra are real at both ends; NaN would be refused there.
        let last = self.spectrum.len() - 1;
        self.spectrum[0].im = 0.0;
        self.spectrum[last].im = 0.0;
        let size = self.plan.size;
        self.plan
            .inverse
            .process_with_scratch(&mut self.spectrum, &mut self.time, &mut self.scratch)
            .map_err(|error| Error::Fft { size, reason: error.to_string() })?;
        let scale = 1.0 / size as f64;
        self.time.iter_mut().for_each(|value| *value *= scale);
        Ok(())
    }
}

/// Copies a row and fills the rest with zeros.
fn pad(time: &mut [f64], row: &[f64]) {
    let (head, tail) = time.split_at_mut(row.len());
    head.copy_from_slice(row);
    tail.fill(0.0);
}

/// Real-to-complex transform; destroys `time`.
fn transform(
    plan: &dyn RealToComplex<f64>,
    time: &mut [f64],
    spectrum: &mut [Complex64],
    scratch: &mut [Complex64],
) -> Result<(), Error> {
    plan.process_with_scratch(time, spectrum, scratch)
        .map_err(|error| Error::Fft { size: plan.len(), reason: error.to_string() })
}
