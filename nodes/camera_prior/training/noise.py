"""Tileable random fields: the one source of structure of every rendered layer.

A `Bank` holds fields with a 1/f^(beta/2) amplitude spectrum, zero mean and unit variance. A layer is a field seen through
the picture's homography, so that puddles, snow and grain lie on the same road plane.
"""

import cv2
import numpy as np

SIZE = 256
BETAS = (0.0, 1.0, 2.0, 3.0)


def fractal_field(rng, beta, size=SIZE):
    """One tileable field (size, size) float32, spectrum density 1/f^beta, zero mean, unit variance."""
    fy = np.fft.fftfreq(size)[:, None]
    fx = np.fft.rfftfreq(size)[None, :]
    f = np.hypot(fy, fx)
    f[0, 0] = 1.0
    amplitude = f ** (-0.5 * beta)
    amplitude[0, 0] = 0.0
    phase = np.exp(2j * np.pi * rng.random(amplitude.shape))
    field = np.fft.irfft2(amplitude * phase, s=(size, size))
    return (field / field.std()).astype(np.float32)


class Bank:
    """Fields for every beta of `BETAS`; `seed` separates the banks of training, validation and test."""

    def __init__(self, seed, per_beta=24):
        rng = np.random.default_rng(seed)
        # Padded by one period, so that a window may start anywhere without wrapping in the warp.
        self.fields = {b: [np.tile(fractal_field(rng, b), (2, 2)) for _ in range(per_beta)] for b in BETAS}

    def sample(self, rng, beta, size, zoom, tilt=0.0, stretch=1.0):
        """A (size, size) view of a random field of that beta.

        zoom: picture pixels per field pixel. tilt: perspective, 0 flat, 1 strong. stretch: how much longer than wide.
        """
        bank = self.fields[beta]
        field = bank[rng.integers(len(bank))]
        h = plane_to_field(size, zoom, tilt, rng.uniform(0, SIZE, 2), rng.uniform(-0.6, 0.6), stretch)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return cv2.warpPerspective(field, h, (size, size), flags=flags, borderMode=cv2.BORDER_REFLECT_101)


def plane_to_field(size, zoom, tilt, centre, angle, stretch=1.0):
    """Homography from picture pixels to field pixels: centred, tilted about the horizontal axis, rotated, shifted."""
    to_centre = np.array([[1, 0, -size / 2], [0, 1, -size / 2], [0, 0, 1]], np.float64)
    tilted = np.array([[1 / zoom, 0, 0], [0, 1 / (zoom * stretch), 0], [0, tilt / size, 1]], np.float64)
    c, s = np.cos(angle), np.sin(angle)
    place = np.array([[c, -s, centre[0] + SIZE / 2], [s, c, centre[1] + SIZE / 2], [0, 0, 1]], np.float64)
    return place @ tilted @ to_centre
