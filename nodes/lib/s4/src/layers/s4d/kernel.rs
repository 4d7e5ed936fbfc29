//! The convolution kernel `K_k = 2 Re sum_n C_bar_n A_bar_n^k` and its gradients.
//!
//! With `k = b S + j`, `A_bar^k = A_bar^(b S) A_bar^j`: S + L/S powers a state instead of L, and the
//! inner loop is a sum of real rows, `K[b, j] += Re(2 C_bar A_bar^(b S)) Re(A_bar^j) - Im(..) Im(..)`.

use num_complex::Complex64;

/// Powers in a block, S: near the square root of the usual lengths.
const BLOCK: usize = 32;

/// `A_bar^j` for `j` in `0..BLOCK`, real and imaginary parts apart, and `A_bar^BLOCK`.
fn powers(a_bar: Complex64) -> ([f64; BLOCK], [f64; BLOCK], Complex64) {
    let (mut re, mut im) = ([0.0; BLOCK], [0.0; BLOCK]);
    let mut power = Complex64::new(1.0, 0.0);
    for (re, im) in re.iter_mut().zip(&mut im) {
        (*re, *im) = (power.re, power.im);
        power *= a_bar;
    }
    (re, im, power)
}

/// Overwrites `kernel` with the kernel of one channel; its length is the number of lags.
pub(crate) fn fill(kernel: &mut [f64], a_bar: &[Complex64], c_bar: &[Complex64]) {
    kernel.fill(0.0);
    for (&a_bar, &c_bar) in a_bar.iter().zip(c_bar) {
        let (re, im, stride) = powers(a_bar);
        let mut factor = 2.0 * c_bar;
        for block in kernel.chunks_mut(BLOCK) {
            for ((value, re), im) in block.iter_mut().zip(&re).zip(&im) {
                *value += factor.re * re - factor.im * im;
            }
            factor *= stride;
        }
    }
}

/// Gradients of one state from `by_kernel = dL/dK`: by `C_bar`, and by the exponent `Delta A`.
///
/// With `M0 = sum_k dK_k A_bar^k` and `M1 = sum_k k dK_k A_bar^k` they are `2 conj(M0)` and
/// `2 conj(C_bar M1)`. Both sums run over blocks first, then within the block.
pub(crate) fn backward(by_kernel: &[f64], a_bar: Complex64, c_bar: Complex64) -> (Complex64, Complex64) {
    let (re, im, stride) = powers(a_bar);
    let [mut sum_re, mut sum_im, mut late_re, mut late_im] = [[0.0; BLOCK]; 4];
    let mut factor = Complex64::new(1.0, 0.0);
    for (number, block) in by_kernel.chunks(BLOCK).enumerate() {
        let late = factor * (number * BLOCK) as f64;
        for (j, &value) in block.iter().enumerate() {
            sum_re[j] += factor.re * value;
            sum_im[j] += factor.im * value;
            late_re[j] += late.re * value;
            late_im[j] += late.im * value;
        }
        factor *= stride;
    }
    let (mut moment_0, mut moment_1) = (Complex64::default(), Complex64::default());
    for j in 0..BLOCK {
        let power = Complex64::new(re[j], im[j]);
        let sum = Complex64::new(sum_re[j], sum_im[j]);
        moment_0 += power * sum;
        moment_1 += power * (sum * j as f64 + Complex64::new(late_re[j], late_im[j]));
    }
    (2.0 * moment_0.conj(), 2.0 * (c_bar * moment_1).conj())
}
