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
    channels: usize,
    size: usize,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
    /// Kernel spectra, `(H, bins)`.
    kernels: Vec<Complex64>,
    /// Input spectra, `(sequences, H, bins)`.
    inputs: Vec<Complex64>,
    /// Gradient of the kernel spectra, `(H, bins)`.
    kernel_gradients: Vec<Complex64>,
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
        let (forward, inverse) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size));
        let bins = size / 2 + 1;
        let zero = Complex64::default();
        Self {
            channels,
            size,
            kernels: vec![zero; channels * bins],
            inputs: vec![zero; sequences * channels * bins],
            kernel_gradients: vec![zero; channels * bins],
            time: vec![0.0; size],
            spectrum: vec![zero; bins],
            scratch: vec![zero; forward.get_scratch_len().max(inverse.get_scratch_len())],
            forward,
            inverse,
        }
    }

    /// Whether the plan fits a set.
    pub(crate) fn fits(&self, length: usize, sequences: usize) -> bool {
        self.size == padded_size(length) && self.inputs.len() == sequences * self.channels * self.bins()
    }

    fn bins(&self) -> usize {
        self.size / 2 + 1
    }

    /// Sets the kernel of a channel, written by `fill` into a row of `lags` values.
    pub(crate) fn set_kernel(
        &mut self,
        channel: usize,
        lags: usize,
        fill: impl FnOnce(&mut [f64]),
    ) -> Result<(), Error> {
        fill(&mut self.time[..lags]);
        self.time[lags..].fill(0.0);
        let bins = self.bins();
        let spectrum = &mut self.kernels[channel * bins..][..bins];
        transform(&*self.forward, &mut self.time, spectrum, &mut self.scratch)
    }

    /// `y = K * x` for every channel and sequence.
    pub(crate) fn apply(&mut self, pass: &Pass, x: &[f64], y: &mut [f64]) -> Result<(), Error> {
        let (total, bins) = (pass.total(), self.bins());
        for (sequence, (start, length)) in pass.segments().enumerate() {
            for channel in 0..self.channels {
                let at = channel * total + start;
                let input = &mut self.inputs[(sequence * self.channels + channel) * bins..][..bins];
                pad(&mut self.time, &x[at..][..length]);
                transform(&*self.forward, &mut self.time, input, &mut self.scratch)?;
                let kernel = &self.kernels[channel * bins..][..bins];
                for ((product, kernel), input) in self.spectrum.iter_mut().zip(kernel).zip(&*input) {
                    *product = kernel * input;
                }
                self.back_to_time()?;
                y[at..][..length].copy_from_slice(&self.time[..length]);
            }
        }
        Ok(())
    }

    /// Gradient by the input into `dx`; that by the kernels is kept for [`Self::kernel_gradient`].
    pub(crate) fn backward(&mut self, pass: &Pass, dy: &[f64], dx: &mut [f64]) -> Result<(), Error> {
        let (total, bins) = (pass.total(), self.bins());
        self.kernel_gradients.fill(Complex64::default());
        for (sequence, (start, length)) in pass.segments().enumerate() {
            for channel in 0..self.channels {
                let at = channel * total + start;
                pad(&mut self.time, &dy[at..][..length]);
                transform(&*self.forward, &mut self.time, &mut self.spectrum, &mut self.scratch)?;
                let input = &self.inputs[(sequence * self.channels + channel) * bins..][..bins];
                let kernel = &self.kernels[channel * bins..][..bins];
                let gradient = &mut self.kernel_gradients[channel * bins..][..bins];
                let factors = kernel.iter().zip(input).zip(gradient);
                for (value, ((kernel, input), gradient)) in self.spectrum.iter_mut().zip(factors) {
                    *gradient += input.conj() * *value;
                    *value *= kernel.conj();
                }
                self.back_to_time()?;
                dx[at..][..length].copy_from_slice(&self.time[..length]);
            }
        }
        Ok(())
    }

    /// Gradient of the loss by the first `lags` kernel values of a channel.
    pub(crate) fn kernel_gradient(&mut self, channel: usize, lags: usize) -> Result<&[f64], Error> {
        let bins = self.bins();
        self.spectrum.copy_from_slice(&self.kernel_gradients[channel * bins..][..bins]);
        self.back_to_time()?;
        Ok(&self.time[..lags])
    }

    /// `time` = inverse transform of `spectrum`, scaled.
    fn back_to_time(&mut self) -> Result<(), Error> {
        // Products of real signals' spectra are real at both ends; NaN would be refused there.
        let last = self.spectrum.len() - 1;
        self.spectrum[0].im = 0.0;
        self.spectrum[last].im = 0.0;
        self.inverse
            .process_with_scratch(&mut self.spectrum, &mut self.time, &mut self.scratch)
            .map_err(|error| Error::Fft { size: self.size, reason: error.to_string() })?;
        let scale = 1.0 / self.size as f64;
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
