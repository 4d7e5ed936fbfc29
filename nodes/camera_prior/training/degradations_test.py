"""Bad pictures kept for the test: nothing here is shown in training or looked at before the test.

Signatures: see `degradations`.
"""

import cv2
import numpy as np

from degradations_tools import outlier_photo


def salt_and_pepper(rng, bank, road, photographs):
    hit = rng.random(road.shape[:2]) < rng.uniform(0.15, 0.6)
    out = road.copy()
    out[hit] = np.where(rng.random(int(hit.sum())) < 0.5, 0, 255)[:, None]
    return out


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


def grille(rng, bank, road, photographs):
    """A mesh in front of the lens, out of focus."""
    size, period = road.shape[0], rng.uniform(0.06, 0.15) * road.shape[0]
    y, x = np.mgrid[:size, :size].astype(np.float32)
    wire = np.minimum(np.abs((x + y) % period - period / 2), np.abs((x - y) % period - period / 2)) < period * rng.uniform(0.15, 0.25)
    alpha = cv2.GaussianBlur(wire.astype(np.float32), (0, 0), rng.uniform(0.5, 3))[:, :, None]
    return (road + alpha * (rng.uniform(5, 200) - road)).astype(np.uint8)


def cracked_lens(rng, bank, road, photographs):
    """Shards, each showing another place, with bright edges."""
    size, n = road.shape[0], int(rng.integers(12, 30))
    y, x = np.mgrid[:size, :size].astype(np.float32)
    seeds = rng.uniform(0, size, (n, 2)).astype(np.float32)
    away = np.hypot(y[:, :, None] - seeds[:, 0], x[:, :, None] - seeds[:, 1])
    near = np.sort(away, 2)
    shift = rng.uniform(-0.2, 0.2, (n, 2)).astype(np.float32)[away.argmin(2)] * size
    out = cv2.remap(road, x + shift[:, :, 1], y + shift[:, :, 0], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)
    out[near[:, :, 1] - near[:, :, 0] < 1.5] = 235
    return out


def night(rng, bank, road, photographs):
    """A spot of headlight on an otherwise black road, much noise."""
    size = road.shape[0]
    y, x = np.mgrid[:size, :size] / size
    spot = np.exp(-(((x - rng.uniform(0.3, 0.7)) / 0.25) ** 2 + ((y - rng.uniform(0.5, 0.9)) / 0.2) ** 2))[:, :, None]
    noise = rng.uniform(5, 14) * rng.standard_normal(road.shape)
    return np.clip(road * (0.02 + rng.uniform(0.5, 1.2) * spot) + noise, 0, 255).astype(np.uint8)


def dead_columns(rng, bank, road, photographs):
    """Columns of the sensor that are stuck at one value each."""
    out, size = road.copy(), road.shape[1]
    stuck = rng.random(size) < rng.uniform(0.2, 0.5)
    out[:, stuck] = rng.integers(0, 256, (int(stuck.sum()), 1))
    return out


def jelly(rng, bank, road, photographs):
    """A rolling shutter on a shaking mount: rows pushed far to and fro."""
    size = road.shape[0]
    y, x = np.mgrid[:size, :size].astype(np.float32)
    shift = rng.uniform(0.1, 0.3) * size * np.sin(y * 2 * np.pi / (rng.uniform(0.06, 0.25) * size) + rng.uniform(0, 6.3))
    return cv2.remap(road, x + shift.astype(np.float32), y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101)


def misregistered(rng, bank, road, photographs):
    """The three colours of three different moments."""
    reach = road.shape[0] // 4
    return np.dstack([np.roll(road[:, :, c], rng.integers(-reach, reach + 1, 2), (0, 1)) for c in range(3)])


def overlay(rng, bank, road, photographs):
    """A menu of the camera's own over the picture."""
    out, size = road.copy(), road.shape[0]
    top, left = (rng.uniform(0.02, 0.2, 2) * size).astype(int)
    out[top:int(0.85 * size), left:int(0.9 * size)] = (0.4 * out[top:int(0.85 * size), left:int(0.9 * size)]).astype(np.uint8)
    colour = tuple(int(v) for v in rng.integers(150, 256, 3))
    for k in range(int(rng.integers(5, 9))):
        text = "".join(chr(c) for c in rng.integers(65, 91, int(rng.integers(5, 14))))
        at = (left + size // 20, top + (k + 1) * size // 11)
        cv2.putText(out, text, at, cv2.FONT_HERSHEY_SIMPLEX, size / 400, colour, max(1, size // 112), cv2.LINE_AA)
    return out


FAMILIES = (salt_and_pepper, banding, test_pattern, broken_blocks, occlusion, swapped_channels, outlier_photo("sett"),
            outlier_photo("paving_stones"), grille, cracked_lens, night, dead_columns, jelly, misregistered, overlay)
