"""Honest dry roads in hard light, and flat noise, as files: what the gates should let through, and what they should not.

    python light.py PHOTOGRAPHS --split test --out DIR
    cargo run --release -p gripsight_friction --example read_pictures DIR > READINGS.csv
    python evaluate.py gates READINGS.csv --out FILE.csv

Every held-out photograph of asphalt, concrete and concrete plates once untouched and once in each light; nothing here is shown in training.
Light is multiplied or added in linear intensity, then the camera exposes anew and clips, as a camera does.
"""

import argparse
from pathlib import Path

import cv2
import numpy as np

from noise import Bank
from textures import LINEAR, load_photographs

SURFACES = ("asphalt", "concrete", "concrete_plates")
SEED = {"val": 301, "test": 302}
SIZE = 448  # twice the network's input: a camera is finer than what the network sees
NOISE_PICTURES = 60


def exposed(linear, mean):
    """Linear RGB to uint8 with the mean at `mean` of full scale."""
    linear = linear * (mean / max(float(linear.mean()), 1e-6))
    return (255 * np.clip(linear, 0, 1) ** (1 / 2.2)).astype(np.uint8)


def axes(size):
    y, x = np.mgrid[0:1:size * 1j, 0:1:size * 1j].astype(np.float32)
    return x, y


def tree_shadows(rng, bank, linear):
    """Leaves: patches of shade with edges as soft as the sun is wide; the sky alone lights them, a sixth to a third of the sun and bluer."""
    size = linear.shape[0]
    leaves = bank.sample(rng, 3.0, size, rng.uniform(2, 5)) + 0.7 * bank.sample(rng, 1.0, size, rng.uniform(3, 8))
    shade = np.clip(0.5 + (leaves - rng.uniform(-0.4, 0.6)) / rng.uniform(0.2, 1.0), 0, 1)
    shade = cv2.GaussianBlur(shade, (0, 0), size / 448 * rng.uniform(2, 8))[:, :, None]
    sky = rng.uniform(0.16, 0.33) * np.array([0.9, 1.0, 1.2], np.float32)
    return exposed(linear * (1 - shade * (1 - sky)), rng.uniform(0.12, 0.25))


def building_shadow(rng, bank, linear):
    """The straight edge of a wall's shadow across the road."""
    x, y = axes(linear.shape[0])
    angle = rng.uniform(0, 2 * np.pi)
    along = (x - 0.5) * np.float32(np.cos(angle)) + (y - 0.5) * np.float32(np.sin(angle))
    shade = np.clip(0.5 + (along - rng.uniform(-0.25, 0.25)) / rng.uniform(0.005, 0.05), 0, 1)[:, :, None]
    return exposed(linear * (1 - shade * rng.uniform(0.67, 0.84)), rng.uniform(0.12, 0.25))


def low_sun(rng, bank, linear):
    """The sun ahead and low: texture throws long shadows (contrast along the road grows), and the far road shines."""
    x, y = axes(linear.shape[0])
    mean = cv2.GaussianBlur(linear, (0, 0), 6)
    rough = mean + rng.uniform(1.3, 2.2) * (linear - mean)
    shine = np.exp(-((x - rng.uniform(0.2, 0.8)) / rng.uniform(0.15, 0.4)) ** 2) * (1 - y) ** rng.uniform(1, 3)
    warm = np.array([1.15, 1.0, 0.8], np.float32)
    return exposed(np.clip(rough, 0.003, None) * warm + rng.uniform(0.05, 0.4) * mean.mean() * 4 * shine[:, :, None], rng.uniform(0.15, 0.3))


def glare(rng, bank, linear):
    """Stray light in the lens: a bright veil about a place at the edge, and less contrast everywhere."""
    x, y = axes(linear.shape[0])
    place = np.hypot(x - rng.uniform(0, 1), y + rng.uniform(0.0, 0.3))
    veil = rng.uniform(0.1, 0.5) * np.exp(-place / rng.uniform(0.2, 0.5)) + rng.uniform(0.0, 0.06)
    shown = linear * (rng.uniform(0.12, 0.2) / linear.mean()) + veil[:, :, None]
    return (255 * np.clip(shown, 0, 1) ** (1 / 2.2)).astype(np.uint8)


LIGHTS = (tree_shadows, building_shadow, low_sun, glare)


def flat_noise(rng):
    """A sensor's noise over an even grey, white or smoothed as a camera's own filter does, in grey or in colour."""
    shape = (SIZE, SIZE, 3 if rng.random() < 0.5 else 1)
    noise = rng.standard_normal(shape, np.float32) * rng.uniform(2, 25)
    if rng.random() < 0.5:
        noise = cv2.GaussianBlur(noise, (0, 0), rng.uniform(0.4, 1.2)).reshape(SIZE, SIZE, -1)
    return np.clip(rng.uniform(50, 200) + np.broadcast_to(noise, (SIZE, SIZE, 3)), 0, 255).astype(np.uint8)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("photographs")
    parser.add_argument("--split", default="test", choices=("val", "test"))
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    bank = Bank((SEED[args.split], 1), per_beta=8)

    def save(family, name, picture):
        (args.out / family).mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(args.out / family / f"{name}.png"), picture[:, :, ::-1])

    for surface, pictures in load_photographs(args.photographs, args.split, SURFACES).items():
        for k, picture in enumerate(pictures):
            side = min(picture.shape[:2])
            square = cv2.resize(picture[:side, :side], (SIZE, SIZE), interpolation=cv2.INTER_AREA)
            save("untouched", f"{surface}_{k:03}", square)
            for number, light in enumerate(LIGHTS):
                rng = np.random.default_rng((SEED[args.split], number, k, SURFACES.index(surface)))
                save(light.__name__, f"{surface}_{k:03}", light(rng, bank, LINEAR[square]))
    for k in range(NOISE_PICTURES):
        save("flat_noise", f"{k:03}", flat_noise(np.random.default_rng((SEED[args.split], 99, k))))


if __name__ == "__main__":
    main()
