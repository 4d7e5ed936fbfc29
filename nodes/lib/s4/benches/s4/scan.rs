//! The road not taken: an S4D layer trained by its recurrence, O(L H N), without FFT.
//!
//! Only here, to be timed against the library's FFT. Channels lie next to each other, so that every inner loop runs over
//! independent channels and the compiler can vectorise it. The gradient by `A_bar` uses the sensitivity
//! `s_k = A_bar s_(k-1) + h_(k-1)`, so that no state history is stored.

/// `[re, im]` of one number per channel.
type Complex = [Vec<f64>; 2];

fn zeros(channels: usize) -> Complex {
    [vec![0.0; channels], vec![0.0; channels]]
}

/// Discrete constants, one entry per state pair.
pub(crate) struct Layer {
    channels: usize,
    a_bar: Vec<Complex>,
    c_bar: Vec<Complex>,
}

/// `h = a h + u` for every channel; `u` is real.
fn advance(h: &mut Complex, a: &Complex, u: &[f64]) {
    let [h_re, h_im] = h;
    let [a_re, a_im] = a;
    for ((((h_re, h_im), a_re), a_im), u) in h_re.iter_mut().zip(h_im).zip(a_re).zip(a_im).zip(u) {
        (*h_re, *h_im) = (a_re * *h_re - a_im * *h_im + u, a_re * *h_im + a_im * *h_re);
    }
}

/// `sum += factor * z`, `factor` real.
fn accumulate(sum: &mut Complex, factor: &[f64], z: &Complex) {
    for (sum, z) in sum.iter_mut().zip(z) {
        for ((sum, z), factor) in sum.iter_mut().zip(z).zip(factor) {
            *sum += factor * z;
        }
    }
}

impl Layer {
    /// Some stable layer.
    pub(crate) fn new(channels: usize, pairs: usize) -> Self {
        let constant = |radius: f64, angle: f64| {
            [vec![radius * angle.cos(); channels], vec![radius * angle.sin(); channels]]
        };
        Self {
            channels,
            a_bar: (0..pairs).map(|n| constant(0.9, 0.3 * n as f64)).collect(),
            c_bar: (0..pairs).map(|n| constant(0.1, 0.5 * n as f64)).collect(),
        }
    }

    /// `x` and the result have shape `(L, H)`.
    pub(crate) fn forward(&self, x: &[f64]) -> Vec<f64> {
        let mut states = vec![zeros(self.channels); self.a_bar.len()];
        let mut y = vec![0.0; x.len()];
        for (x, y) in x.chunks_exact(self.channels).zip(y.chunks_exact_mut(self.channels)) {
            for ((h, a), c) in states.iter_mut().zip(&self.a_bar).zip(&self.c_bar) {
                advance(h, a, x);
                for ((((y, h_re), h_im), c_re), c_im) in
                    y.iter_mut().zip(&h[0]).zip(&h[1]).zip(&c[0]).zip(&c[1])
                {
                    *y += 2.0 * (c_re * h_re - c_im * h_im);
                }
            }
        }
        y
    }

    /// Gradients by `x`, `(L, H)`, and the sums behind those by `C_bar` and `A_bar`.
    pub(crate) fn backward(&self, x: &[f64], dy: &[f64]) -> (Vec<f64>, Vec<[Complex; 2]>) {
        let channels = self.channels;
        let mut dx = vec![0.0; x.len()];
        let mut sums = vec![[zeros(channels), zeros(channels)]; self.a_bar.len()];
        let mut states = vec![[zeros(channels), zeros(channels)]; self.a_bar.len()];
        for (x, dy) in x.chunks_exact(channels).zip(dy.chunks_exact(channels)) {
            for (([h, s], a), [sum_h, sum_s]) in states.iter_mut().zip(&self.a_bar).zip(&mut sums) {
                advance(s, a, &h[0]);
                for (s_im, h_im) in s[1].iter_mut().zip(&h[1]) {
                    *s_im += h_im;
                }
                advance(h, a, x);
                accumulate(sum_h, dy, h);
                accumulate(sum_s, dy, s);
            }
        }
        let mut adjoints = vec![zeros(channels); self.a_bar.len()];
        for (dx, dy) in dx.chunks_exact_mut(channels).zip(dy.chunks_exact(channels)).rev() {
            for ((g, a), c) in adjoints.iter_mut().zip(&self.a_bar).zip(&self.c_bar) {
                advance(g, a, dy);
                for ((((dx, g_re), g_im), c_re), c_im) in
                    dx.iter_mut().zip(&g[0]).zip(&g[1]).zip(&c[0]).zip(&c[1])
                {
                    *dx += 2.0 * (c_re * g_re - c_im * g_im);
                }
            }
        }
        (dx, sums)
    }
}
