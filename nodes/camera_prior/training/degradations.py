"""Pictures that must not be believed. Each family maps (rng, bank, road, photographs) to an RGB uint8 picture.

`SEEN` families are shown in training with uniform targets; `UNSEEN` families exist for the test alone.
`road` is a rendered road picture (size, size, 3); `photographs` maps a folder's name to its pictures.
"""

import cv2
import numpy as np


def _finish(rng, picture):
    """To uint8, half of the time with a little sensor noise."""
    if rng.random() < 0.5:
        picture = picture + rng.uniform(0.5, 4.0) * rng.standard_normal(picture.shape, np.float32)
    return np.clip(picture, 0, 255).astype(np.uint8)


def _flat(road, colour):
    return np.full(road.shape, 0, np.float32) + np.asarray(colour, np.float32)


def black(rng, bank, road, photographs):
    return _finish(rng, _flat(road, rng.uniform(0, 14)))


def white(rng, bank, road, photographs):
    return _finish(rng, _flat(road, rng.uniform(240, 255)))


def flat_colour(rng, bank, road, photographs):
    return _finish(rng, _flat(road, rng.uniform(0, 255, 3)))


def gradient(rng, bank, road, photographs):
    t = np.linspace(0, 1, road.shape[0], dtype=np.float32)
    t = t[:, None, None] if rng.random() < 0.5 else t[None, :, None]
    a, b = rng.uniform(0, 255, (2, 3)).astype(np.float32)
    return _finish(rng, a + (b - a) * t * np.ones(road.shape, np.float32))


def noise(rng, bank, road, photographs):
    channels = 3 if rng.random() < 0.5 else 1
    n = rng.standard_normal((*road.shape[:2], channels), np.float32)
    return _finish(rng, rng.uniform(60, 190) + rng.uniform(30, 120) * n * np.ones(3, np.float32))


def noisy_road(rng, bank, road, photographs):
    return _finish(rng, road + rng.uniform(45, 110) * rng.standard_normal(road.shape, np.float32))


def blur(rng, bank, road, photographs):
    return _finish(rng, cv2.GaussianBlur(road, (0, 0), rng.uniform(9, 25)).astype(np.float32))


def over_exposed(rng, bank, road, photographs):
    level = np.percentile(road, rng.uniform(3, 20))
    return _finish(rng, road.astype(np.float32) * (255.0 / max(level, 4.0)))


def lens_dirt(rng, bank, road, photographs):
    size = road.shape[0]
    field = bank.sample(rng, 3.0, size, rng.uniform(0.8, 2.5))
    cover = rng.uniform(0.55, 0.95)
    alpha = np.clip(0.5 + (field - np.quantile(field, 1.0 - cover)) / rng.uniform(0.1, 0.6), 0, 1)[:, :, None]
    mud = rng.uniform(5, 60) * np.array([1.1, 1.0, 0.85], np.float32)
    return _finish(rng, road * (1.0 - alpha) + alpha * mud)


def _outlier_photo(folder):
    def family(rng, bank, road, photographs):
        pictures = photographs[folder]
        picture = pictures[rng.integers(len(pictures))]
        h, w = picture.shape[:2]
        side = int(min(h, w) * rng.uniform(0.6, 1.0))
        y, x = rng.integers(h - side + 1), rng.integers(w - side + 1)
        cut = picture[y:y + side, x:x + side]
        if rng.random() < 0.5:
            cut = cut[:, ::-1]
        cut = cv2.resize(cut, road.shape[1::-1], interpolation=cv2.INTER_LINEAR).astype(np.float32)
        return _finish(rng, cut * np.exp(rng.normal(0, 0.15)))

    family.__name__ = folder
    return family


def salt_and_pepper(rng, bank, road, photographs):
    hit = rng.random(road.shape[:2]) < rng.uniform(0.15, 0.6)
    out = road.copy()
    out[hit] = np.where(rng.random(int(hit.sum())) < 0.5, 0, 255)[:, None]
    return out


def motion_smear(rng, bank, road, photographs):
    n = int(road.shape[0] * rng.uniform(0.3, 0.7)) | 1
    kernel = np.full((n, 1), 1.0 / n, np.float32)
    return cv2.filter2D(road, -1, kernel if rng.random() < 0.5 else kernel.T)


def droplets(rng, bank, road, photographs):
    size = road.shape[0]
    out, y, x = road.astype(np.float32), *np.mgrid[:size, :size]
    soft = cv2.GaussianBlur(out, (0, 0), size / 28)
    for _ in range(int(rng.integers(25, 60))):
        cx, cy, r = rng.uniform(0, size), rng.uniform(0, size), rng.uniform(0.04, 0.13) * size
        inside = np.clip(1.5 * (1 - np.hypot(x - cx, y - cy) / r), 0, 1)[:, :, None]
        out = out * (1 - inside) + inside * (soft[::-1] * 1.15)
    return np.clip(out, 0, 255).astype(np.uint8)


def banding(rng, bank, road, photographs):
    rows = rng.normal(0, rng.uniform(40, 90), (road.shape[0], 1, 1))
    return np.clip(road + rows, 0, 255).astype(np.uint8)


def test_pattern(rng, bank, road, photographs):
    size, n = road.shape[0], int(rng.integers(4, 16))
    y, x = np.mgrid[:size, :size]
    if rng.random() < 0.5:
        return np.repeat(((((x * n // size) + (y * n // size)) % 2) * 255).astype(np.uint8)[:, :, None], 3, 2)
    bars = rng.integers(0, 2, (n, 3)).astype(np.uint8) * 255
    return bars[x * n // size]


def broken_blocks(rng, bank, road, photographs):
    out, b = road.copy(), max(road.shape[0] // 14, 4)
    start = rng.uniform(0.0, 0.3)
    for y in range(int(start * road.shape[0]) // b * b, road.shape[0], b):
        out[y:y + b] = np.roll(out[y:y + b], int(rng.integers(road.shape[1])), 1)
        out[y:y + b] = np.clip(out[y:y + b].astype(int) + rng.integers(-90, 90, 3), 0, 255)
    return out


def occlusion(rng, bank, road, photographs):
    out, size = road.copy(), road.shape[0]
    n = int(size * rng.uniform(0.6, 0.9))
    colour = rng.uniform(0, 90, 3).astype(np.uint8)
    out[(slice(None, n), slice(None)) if rng.random() < 0.5 else (slice(None), slice(None, n))] = colour
    return out


def swapped_channels(rng, bank, road, photographs):
    return np.ascontiguousarray(road[:, :, ::-1])


SEEN = {f.__name__: f for f in (black, white, flat_colour, gradient, noise, noisy_road, blur, over_exposed, lens_dirt,
                                _outlier_photo("grass"))}
UNSEEN = {f.__name__: f for f in (salt_and_pepper, motion_smear, droplets, banding, test_pattern, broken_blocks, occlusion,
                                  swapped_channels, _outlier_photo("ground"), _outlier_photo("sett"),
                                  _outlier_photo("paving_stones"))}
