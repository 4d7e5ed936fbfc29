"""Golden vectors for the S4D layer and the S4 network, written from the formulas in NumPy.

    python3 make_golden.py > golden.json

Nothing here calls an FFT or shares code with the crate: the kernel is summed state by state, the convolution is
the plain double sum, and the recurrence is a loop in complex arithmetic. The two must agree before anything is written.
"""

import json
import platform
import sys

import numpy as np


def discretize(log_dt, log_a_real, a_imag, c):
    """Zero-order hold: A_bar = exp(Delta A), C_bar = C (A_bar - 1) / A."""
    a = -np.exp(log_a_real) + 1j * a_imag
    a_bar = np.exp(np.exp(log_dt)[:, None] * a)
    return a_bar, c * (a_bar - 1.0) / a


def s4d_convolution(p, u):
    """y = K * u + D u with K_k = 2 Re sum_n C_bar_n A_bar_n^k; u has shape (H, L)."""
    a_bar, c_bar = discretize(p["log_dt"], p["log_a_real"], p["a_imag"], p["c"])
    length = u.shape[1]
    lags = np.arange(length)
    kernel = 2.0 * np.einsum("hn,hnk->hk", c_bar, a_bar[:, :, None] ** lags).real
    y = np.stack([np.convolve(k, row)[:length] for k, row in zip(kernel, u)])
    return kernel, y + p["d"][:, None] * u


def s4d_recurrence(p, u):
    """h_k = A_bar h_{k-1} + u_k, y_k = 2 Re(C_bar h_k) + D u_k."""
    a_bar, c_bar = discretize(p["log_dt"], p["log_a_real"], p["a_imag"], p["c"])
    h = np.zeros_like(a_bar)
    y = np.zeros_like(u)
    for k in range(u.shape[1]):
        h = a_bar * h + u[:, k, None]
        y[:, k] = 2.0 * (c_bar * h).sum(axis=1).real + p["d"] * u[:, k]
    return y


def gelu(x):
    return 0.5 * x * (1.0 + np.tanh(np.sqrt(2.0 / np.pi) * (x + 0.044715 * x**3)))


def flat(*arrays):
    return np.concatenate([np.asarray(a, dtype=float).ravel() for a in arrays]).tolist()


def flat_s4d(p):
    c = np.stack([p["c"].real, p["c"].imag], axis=-1)
    return flat(p["log_dt"], p["log_a_real"], p["a_imag"], c, p["d"])


def main():
    rng = np.random.default_rng(20260401)
    inputs, outputs, width, pairs, length = 4, 2, 3, 4, 50
    p = {
        "log_dt": np.log(rng.uniform(0.01, 0.3, width)),
        "log_a_real": np.log(0.5) + 0.3 * rng.standard_normal((width, pairs)),
        "a_imag": np.pi * np.arange(pairs) + 0.3 * rng.standard_normal((width, pairs)),
        "c": rng.standard_normal((width, pairs)) + 1j * rng.standard_normal((width, pairs)),
        "d": rng.standard_normal(width),
    }
    encoder, encoder_bias = rng.standard_normal((width, inputs)), rng.standard_normal(width)
    decoder, decoder_bias = rng.standard_normal((outputs, width)), rng.standard_normal(outputs)
    mean, scale = rng.standard_normal(inputs), rng.uniform(0.5, 2.0, inputs)
    output_scale = rng.uniform(0.5, 2.0, outputs)
    u = rng.standard_normal((inputs, length))

    x = encoder @ ((u - mean[:, None]) / scale[:, None]) + encoder_bias[:, None]
    kernel, y = s4d_convolution(p, x)
    np.testing.assert_allclose(y, s4d_recurrence(p, x), rtol=1e-10, atol=1e-10)
    result = (decoder @ gelu(y) + decoder_bias[:, None]) * output_scale[:, None]

    json.dump(
        {
            "generator": "make_golden.py",
            "python": platform.python_version(),
            "numpy": np.__version__,
            "width": width,
            "pairs": pairs,
            "s4d_weights": flat_s4d(p),
            "kernel": flat(kernel),
            "s4d_input": flat(x),
            "s4d_output": flat(y),
            "network_weights": flat(encoder, encoder_bias) + flat_s4d(p) + flat(decoder, decoder_bias),
            "input_mean": mean.tolist(),
            "input_scale": scale.tolist(),
            "output_scale": output_scale.tolist(),
            "inputs": flat(u),
            "outputs": flat(result),
        },
        sys.stdout,
        indent=1,
    )
    print()


if __name__ == "__main__":
    main()
