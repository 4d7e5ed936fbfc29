"""Road pictures whose friction is known: a dry texture with wetness, standing water, snow and ice laid over it.

Each class covers an exactly known share f of the picture (the mean of its alpha map; the maps add up to one), and the true
friction is mu* = B . f. Everything follows from one seed.

    python render.py --surface wet --fraction 0.6 --seed 7 --out x.jpg [--photo dry.jpg] [--size 224]
"""

import argparse
import json

import cv2
import numpy as np

from noise import Bank
from textures import photograph, procedural

CLASSES = ("dry", "wet", "water", "snow", "ice")
DRY, WET, WATER, SNOW, ICE = range(5)
# Which classes lie beside each other on a road, for mixtures of two.
NEIGHBOURS = ((DRY, WET), (DRY, WET), (WET, WATER), (DRY, WATER), (DRY, SNOW), (WET, SNOW), (SNOW, ICE), (DRY, ICE),
              (WET, ICE), (WATER, SNOW))
LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)

cv2.setNumThreads(1)


def sample_fractions(rng):
    """Requested area fractions (5,): one class 45 %, two 43 %, three 12 % of the time."""
    f = np.zeros(5)
    kind = rng.random()
    if kind < 0.45:
        f[rng.integers(5)] = 1.0
    elif kind < 0.88:
        a, b = NEIGHBOURS[rng.integers(len(NEIGHBOURS))]
        f[a] = rng.uniform(0.05, 0.95)
        f[b] = 1.0 - f[a]
    else:
        f[rng.choice(5, 3, replace=False)] = rng.dirichlet(np.ones(3))
    return f


def area_maps(rng, bank, size, tilt, f):
    """Alpha maps {class: (size, size)} that add up to one, each class covering about f[class]; the rest is the first class."""
    present = [c for c in range(5) if f[c] > 1e-3]
    maps, rest, left = {}, np.ones((size, size), np.float32), 1.0
    for c in reversed(present[1:]):  # the uppermost layer first: ice, snow, water, wet
        field = bank.sample(rng, 3.0 if rng.random() < 0.6 else 2.0, size, rng.uniform(0.5, 2.5), tilt, rng.uniform(1, 4))
        if rng.random() < 0.25:  # wheel tracks or a dry line: structure along the direction of travel
            x = np.linspace(-1, 1, size, dtype=np.float32)[None, :] + 0.02 * field
            field = 0.6 * field + rng.choice([-2.0, 2.0]) * np.cos(x * rng.uniform(2, 7) + rng.uniform(0, 6.3))
        share = min(f[c] / left, 1.0)
        flat = np.sort(field[::3, ::3], axis=None)
        threshold = flat[min(int((1.0 - share) * flat.size), flat.size - 1)]
        soft = rng.uniform(0.03, 0.25)
        alpha = np.clip(0.5 + (field - threshold) / (2.0 * soft), 0.0, 1.0) * rest
        maps[c], rest, left = alpha, rest - alpha, max(left - f[c], 1e-6)
    maps[present[0]] = rest
    return maps


def sky_reflection(rng, bank, size):
    """What a wet plane mirrors: a bright gradient with soft vertical shapes, linear RGB."""
    level = rng.uniform(0.35, 1.0)
    top, bottom = rng.uniform(0.3, 1.0, 2)
    grey = np.linspace(top, bottom, size, dtype=np.float32)[:, None]
    grey = grey + rng.uniform(0.05, 0.35) * bank.sample(rng, 3.0, size, rng.uniform(0.5, 2), 0.0, rng.uniform(2, 6))
    blue = rng.uniform(0.0, 0.35)
    tint = np.array([1.0 - 0.5 * blue, 1.0 - 0.1 * blue, 1.0 + 0.5 * blue], np.float32)
    return np.clip(level * grey, 0.02, 1.5)[:, :, None] * tint


def wet(rng, bank, base, sky, tilt):
    """A film of water: darker, more saturated, a faint patchy sheen."""
    size = base.shape[0]
    luma = (base @ LUMA)[:, :, None]
    dark = rng.uniform(0.3, 0.62) * np.maximum(luma + rng.uniform(1.0, 1.3) * (base - luma), 0.0)
    patches = np.clip(0.6 + 0.5 * bank.sample(rng, 2.0, size, rng.uniform(0.7, 3), tilt, 2.0), 0, 1.5)
    sheen = rng.uniform(0.04, 0.14) * patches[:, :, None] * sky
    glints = bank.sample(rng, 0.0, size, rng.uniform(1, 2), tilt) > rng.uniform(2.0, 3.0)
    return dark + sheen + rng.uniform(0.0, 0.5) * glints[:, :, None] * sky


def water(rng, bank, base, sky, tilt):
    """Standing water: the texture drowned, the sky mirrored, ripples."""
    size = base.shape[0]
    drowned = cv2.GaussianBlur(base, (0, 0), rng.uniform(1.5, 4.0)) * rng.uniform(0.15, 0.45)
    mirror = rng.uniform(0.25, 0.7)
    ripple = 1.0 + rng.uniform(0.0, 0.15) * bank.sample(rng, 2.0, size, rng.uniform(0.4, 1.5), tilt, 0.5)
    return drowned + mirror * ripple[:, :, None] * cv2.GaussianBlur(sky, (0, 0), rng.uniform(1, 4))


def snow(rng, bank, base, sky, tilt):
    """Snow: bright, bluish in its shades, lumpy relief lit from one side, sometimes dirty."""
    size = base.shape[0]
    height = (bank.sample(rng, 2.0, size, rng.uniform(0.8, 3), tilt)
              + rng.uniform(0.2, 1.0) * bank.sample(rng, 1.0, size, rng.uniform(1, 3), tilt))
    slope = cv2.Sobel(height, cv2.CV_32F, 1, 0, ksize=3) * rng.choice([-1, 1]) + cv2.Sobel(height, cv2.CV_32F, 0, 1, ksize=3)
    relief = 1.0 + rng.uniform(0.015, 0.06) * np.clip(slope, -6, 6)
    cool = rng.uniform(0.0, 0.08)
    white = rng.uniform(0.62, 0.92) * np.array([1 - cool, 1.0, 1 + cool], np.float32)
    out = np.clip(relief, 0.3, 1.4)[:, :, None] * white
    if rng.random() < 0.4:
        dirt = rng.uniform(0.1, 0.5) * np.clip(bank.sample(rng, 2.0, size, rng.uniform(0.8, 3), tilt), 0, 1.5)
        brown = rng.uniform(0.1, 0.3) * np.array([1.1, 1.0, 0.88], np.float32)
        out = out + np.clip(dirt, 0, 0.7)[:, :, None] * (brown - out)
    return out


def ice(rng, bank, base, sky, tilt):
    """Ice: the texture seen through a bluish milky pane, white cracks and air, hard glare."""
    size = base.shape[0]
    milk = np.clip(rng.uniform(0.25, 0.6) + rng.uniform(0.05, 0.2) * bank.sample(rng, 3.0, size, rng.uniform(0.8, 3), tilt), 0.1, 0.9)
    blue = rng.uniform(0.06, 0.2)
    pane = rng.uniform(0.28, 0.6) * np.array([1 - blue, 1.0, 1 + blue], np.float32)
    seen = cv2.GaussianBlur(base, (0, 0), rng.uniform(0.8, 2.5)) * rng.uniform(0.4, 0.8)
    out = seen + milk[:, :, None] * (pane - seen)
    crack = np.abs(bank.sample(rng, 2.0, size, rng.uniform(1, 4), tilt))
    out = out + rng.uniform(0.1, 0.45) * np.clip(1.0 - crack / rng.uniform(0.03, 0.12), 0, 1)[:, :, None]
    glare = np.clip(bank.sample(rng, 3.0, size, rng.uniform(0.8, 2), tilt, 2.0) - rng.uniform(0.7, 1.8), 0, 1)
    return out + rng.uniform(0.1, 0.6) * glare[:, :, None] * sky


OVERLAYS = {WET: wet, WATER: water, SNOW: snow, ICE: ice}


def paint(rng, size, tilt):
    """Road marking: alpha (size, size) of one stripe, and its colour."""
    y = np.linspace(-0.5, 0.5, size, dtype=np.float32)[:, None]
    x = np.linspace(-0.5, 0.5, size, dtype=np.float32)[None, :] / (1.0 + tilt * y)
    at, lean, width = rng.uniform(-0.6, 0.6), rng.uniform(-0.5, 0.5), rng.uniform(0.03, 0.1)
    stripe = (np.abs(x - at - lean * y) < width).astype(np.float32)
    colour = np.array([0.75, 0.75, 0.72] if rng.random() < 0.75 else [0.7, 0.5, 0.08], np.float32)
    return stripe * rng.uniform(0.5, 1.0), colour * rng.uniform(0.6, 1.1)


def shadow(rng, bank, size):
    """Light on the road: a gradient, and sometimes the shadow of a wall or of leaves."""
    y, x = np.mgrid[-0.5:0.5:size * 1j, -0.5:0.5:size * 1j].astype(np.float32)
    angle = rng.uniform(0, 2 * np.pi)
    along = x * np.float32(np.cos(angle)) + y * np.float32(np.sin(angle))
    light = 1.0 + rng.uniform(0, 0.4) * along
    if rng.random() < 0.3:
        edge = along - rng.uniform(-0.4, 0.4)
        if rng.random() < 0.5:
            edge = edge + 0.15 * bank.sample(rng, 2.0, size, rng.uniform(1, 3))
        light = light * (1.0 - rng.uniform(0.25, 0.7) * np.clip(0.5 + edge / rng.uniform(0.02, 0.2), 0, 1))
    return light


def camera(rng, linear):
    """Exposure, white balance, motion and defocus, tone curve, noise, JPEG: linear RGB to uint8."""
    size = linear.shape[0]
    mean = max(float((linear @ LUMA).mean()), 1e-3)
    # An automatic exposure evens scenes out, but not wholly: a bright scene stays a bright picture.
    gain = np.exp(rng.uniform(np.log(0.12), np.log(0.4))) * (mean / 0.2) ** rng.uniform(0.0, 0.5) / mean
    balance = np.exp(rng.normal(0, 0.05, 3)).astype(np.float32)
    out = linear * (min(gain, 6.0) * balance)
    if rng.random() < 0.4:  # motion: along the direction of travel
        n = int(rng.uniform(2, 9) * size / 224) | 1
        kernel = np.full((n, 1), 1.0 / n, np.float32)
        out = cv2.filter2D(out, -1, kernel)
    if rng.random() < 0.4:
        out = cv2.GaussianBlur(out, (0, 0), rng.uniform(0.3, 1.6))
    out = np.clip(out, 0.0, 1.0)
    out = np.power(out, np.float32(1.0 / rng.uniform(1.9, 2.5))) * np.float32(255.0)
    if rng.random() < 0.8:
        noise = rng.standard_normal((size, size, 3 if rng.random() < 0.5 else 1), np.float32)
        out = out + rng.uniform(0.5, 7.0) * noise
    out = np.clip(out, 0, 255).astype(np.uint8)
    if rng.random() < 0.6:
        ok, data = cv2.imencode(".jpg", out, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(35, 96))])
        out = cv2.imdecode(data, cv2.IMREAD_COLOR)
    return out


def to_srgb(linear):
    """Linear RGB to uint8 with the plain tone curve."""
    return (np.clip(linear, 0.0, 1.0) ** np.float32(1.0 / 2.2) * np.float32(255.0) + np.float32(0.5)).astype(np.uint8)


def render(rng, bank, size, photo=None, f=None, with_camera=True):
    """(RGB uint8 (size, size, 3), area fractions (5,) float32). `photo`: a dry photograph, or None for a made texture."""
    f = sample_fractions(rng) if f is None else f
    tilt = rng.uniform(0.0, 1.2)
    if photo is None:
        base = procedural(rng, bank, size, tilt)
    elif rng.random() < 0.3:  # as photographed
        base, with_camera = photograph(rng, photo, size, 0.0), with_camera and rng.random() < 0.5
    else:
        base = photograph(rng, photo, size, 0.5 * tilt)
        # Photographs come with any exposure; it says nothing about the road. Bring it to an albedo.
        albedo = np.exp(rng.uniform(np.log(0.06), np.log(0.45)))
        base = base * np.float32(min(albedo / max(float((base @ LUMA).mean()), 1e-3), 8.0))
        if rng.random() < 0.5:
            base = base * (1.0 + rng.uniform(0.03, 0.2) * bank.sample(rng, 0.0, size, rng.uniform(1, 2.5), tilt))[:, :, None]
        base = np.clip(base, 0.003, 1.2)
    if rng.random() < 0.15:
        alpha, colour = paint(rng, size, tilt)
        base = base + alpha[:, :, None] * (colour - base)
    maps = area_maps(rng, bank, size, tilt, f)
    sky = sky_reflection(rng, bank, size) if any(c in maps for c in (WET, WATER, ICE)) else None
    out = np.zeros_like(base)
    for c, alpha in maps.items():
        layer = base if c == DRY else OVERLAYS[c](rng, bank, base, sky, tilt)
        out += alpha[:, :, None] * layer
    out *= shadow(rng, bank, size)[:, :, None]
    fractions = np.array([maps[c].mean() if c in maps else 0.0 for c in range(5)], np.float32)
    picture = camera(rng, out) if with_camera else to_srgb(out)
    return picture, fractions / fractions.sum()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--surface", choices=CLASSES, required=True)
    parser.add_argument("--fraction", type=float, default=1.0, help="share of the picture that it covers; the rest is dry")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--size", type=int, default=224)
    parser.add_argument("--photo", help="a dry photograph as the base; without it a made texture")
    parser.add_argument("--out", required=True)
    args = parser.parse_args()
    f = np.zeros(5)
    f[DRY] = 1.0 - args.fraction
    f[CLASSES.index(args.surface)] += args.fraction
    photo = cv2.cvtColor(cv2.imread(args.photo), cv2.COLOR_BGR2RGB) if args.photo else None
    picture, fractions = render(np.random.default_rng(args.seed), Bank(args.seed, per_beta=4), args.size, photo, f)
    cv2.imwrite(args.out, cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    print(json.dumps({"fractions": dict(zip(CLASSES, fractions.tolist()))}))


if __name__ == "__main__":
    main()
