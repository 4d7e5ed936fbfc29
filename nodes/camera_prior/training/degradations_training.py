"""Bad pictures shown in training. No family resembles one of `degradations_test` in kind.

Signatures: see `degradations`.
"""

import cv2
import numpy as np

from degradations_tools import finish, flat, outlier_photo


def black(rng, bank, road, photographs):
    return finish(rng, flat(road, rng.uniform(0, 14)))


def white(rng, bank, road, photographs):
    return finish(rng, flat(road, rng.uniform(240, 255)))


def flat_colour(rng, bank, road, photographs):
    return finish(rng, flat(road, rng.uniform(0, 255, 3)))


def gradient(rng, bank, road, photographs):
    t = np.linspace(0, 1, road.shape[0], dtype=np.float32)
    t = t[:, None, None] if rng.random() < 0.5 else t[None, :, None]
    a, b = rng.uniform(0, 255, (2, 3)).astype(np.float32)
    return finish(rng, a + (b - a) * t * np.ones(road.shape, np.float32))


def noise(rng, bank, road, photographs):
    channels = 3 if rng.random() < 0.5 else 1
    n = rng.standard_normal((*road.shape[:2], channels), np.float32)
    return finish(rng, rng.uniform(60, 190) + rng.uniform(30, 120) * n * np.ones(3, np.float32))


def noisy_road(rng, bank, road, photographs):
    return finish(rng, road + rng.uniform(45, 110) * rng.standard_normal(road.shape, np.float32))


def blur(rng, bank, road, photographs):
    return finish(rng, cv2.GaussianBlur(road, (0, 0), rng.uniform(9, 25)).astype(np.float32))


def over_exposed(rng, bank, road, photographs):
    level = np.percentile(road, rng.uniform(3, 20))
    return finish(rng, road.astype(np.float32) * (255.0 / max(level, 4.0)))


def lens_dirt(rng, bank, road, photographs):
    size = road.shape[0]
    field = bank.sample(rng, 3.0, size, rng.uniform(0.8, 2.5))
    cover = rng.uniform(0.55, 0.95)
    alpha = np.clip(0.5 + (field - np.quantile(field, 1.0 - cover)) / rng.uniform(0.1, 0.6), 0, 1)[:, :, None]
    mud = rng.uniform(5, 60) * np.array([1.1, 1.0, 0.85], np.float32)
    return finish(rng, road * (1.0 - alpha) + alpha * mud)


def fog(rng, bank, road, photographs):
    """A veil that leaves next to no contrast."""
    size = road.shape[0]
    veil = rng.uniform(110, 235) * np.exp(rng.normal(0, 0.04, 3))
    left = rng.uniform(0.02, 0.12) * np.clip(1 + 0.5 * bank.sample(rng, 3.0, size, rng.uniform(0.8, 2)), 0, 2)[:, :, None]
    return finish(rng, veil + left * (road.astype(np.float32) - veil))


def flare(rng, bank, road, photographs):
    """The sun in the lens: a bright glow over most of the picture, with ghosts."""
    size = road.shape[0]
    out, (y, x) = road.astype(np.float32), np.mgrid[:size, :size] / size
    centre = rng.uniform(0.1, 0.9, 2)
    out += 900 * np.exp(-np.hypot(y - centre[0], x - centre[1]) / rng.uniform(0.2, 0.45))[:, :, None]
    for k in np.linspace(0.3, 1.5, int(rng.integers(2, 6))):
        at, radius = centre + k * (0.5 - centre) * 1.6, rng.uniform(0.03, 0.12)
        out += rng.uniform(20, 90, 3) * (np.hypot(y - at[0], x - at[1]) < radius)[:, :, None]
    return finish(rng, out)


def scratches(rng, bank, road, photographs):
    """Hairs and scratches on the lens."""
    size, out = road.shape[0], road.copy()
    shade = int(rng.integers(0, 60)) if rng.random() < 0.5 else int(rng.integers(190, 256))
    for _ in range(int(rng.integers(25, 70))):
        start, bend = rng.uniform(0, size, 2), rng.normal(0, 0.25 * size, (2, 2)).cumsum(0)
        line = np.vstack([start, start + bend]).astype(np.int32)
        cv2.polylines(out, [line], False, (shade,) * 3, int(rng.integers(1, max(2, size // 50) + 1)), cv2.LINE_AA)
    return finish(rng, cv2.GaussianBlur(out, (0, 0), rng.uniform(0.5, 2)))


def radial_blur(rng, bank, road, photographs):
    """A spin or a zoom during the exposure."""
    size = road.shape[0]
    centre, total = tuple(rng.uniform(0.2, 0.8, 2) * size), np.zeros(road.shape, np.float32)
    spin = rng.random() < 0.5
    reach, n = rng.uniform(10, 40) if spin else rng.uniform(0.25, 0.8), 24
    for t in np.linspace(-0.5, 0.5, n):
        turn = cv2.getRotationMatrix2D(centre, reach * t if spin else 0.0, 1.0 if spin else 1.0 + reach * t)
        total += cv2.warpAffine(road, turn, (size, size), borderMode=cv2.BORDER_REFLECT_101)
    return finish(rng, total / n)


def frosted(rng, bank, road, photographs):
    """Rough glass: every pixel from a random place near by."""
    size, reach = road.shape[0], rng.uniform(0.04, 0.12) * road.shape[0]
    y, x = np.mgrid[:size, :size].astype(np.float32)
    grain = rng.uniform(1, 6)
    shift = [bank.sample(rng, 0.0, size, grain) * reach for _ in range(2)]
    return finish(rng, cv2.remap(road, x + shift[0], y + shift[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT_101))


def condensation(rng, bank, road, photographs):
    """A fogged lens: blotches without detail, the rest hazy."""
    size = road.shape[0]
    soft = cv2.GaussianBlur(road, (0, 0), size * rng.uniform(0.05, 0.12)).astype(np.float32)
    field = bank.sample(rng, 3.0, size, rng.uniform(0.7, 2))
    alpha = np.clip(rng.uniform(0.7, 1.1) + rng.uniform(0.2, 0.6) * field, 0.3, 1)[:, :, None]
    return finish(rng, road + alpha * (0.8 * soft + rng.uniform(20, 60) - road))


def mosaic(rng, bank, road, photographs):
    """A few coarse pixels."""
    size, n = road.shape[0], int(rng.integers(5, 20))
    return finish(rng, cv2.resize(cv2.resize(road, (n, n), interpolation=cv2.INTER_AREA), (size, size),
                                  interpolation=cv2.INTER_NEAREST))


def posterised(rng, bank, road, photographs):
    """Two or three levels a channel."""
    levels = int(rng.integers(2, 4))
    low, high = np.percentile(road, (2, 98))
    share = np.clip((road - low) / max(high - low, 1.0), 0, 1)
    return finish(rng, np.round(share * (levels - 1)).astype(np.float32) * (255.0 / (levels - 1)))


def negative(rng, bank, road, photographs):
    """An inverted tone curve, or one that turns back halfway."""
    if rng.random() < 0.5:
        return finish(rng, 255.0 - np.clip(road.astype(np.float32) * rng.uniform(1.0, 1.6), 0, 255))
    return finish(rng, 255.0 * np.abs(np.sin(road.astype(np.float32) * rng.uniform(0.03, 0.08))))


def torn(rng, bank, road, photographs):
    """Parts of several pictures side by side or under one another."""
    size, out = road.shape[0], road.copy()
    edges = np.sort(rng.integers(0, size, int(rng.integers(2, 5))))
    for a, b in zip(edges, [*edges[1:], size]):
        other = outlier_photo(rng.choice(sorted(photographs)))(rng, bank, road, photographs)
        out[a:b] = np.roll(other, int(rng.integers(size)), 1)[a:b] * rng.uniform(0.4, 1.0)
    return finish(rng, out if rng.random() < 0.5 else out.transpose(1, 0, 2))


def scrambled(rng, bank, road, photographs):
    """The picture's tiles, shuffled and turned."""
    size, n = road.shape[0], int(rng.integers(3, 9))
    tile = size // n
    tiles = [road[r * tile:(r + 1) * tile, c * tile:(c + 1) * tile] for r in range(n) for c in range(n)]
    order = rng.permutation(n * n)
    rows = [np.hstack([np.rot90(tiles[k], int(rng.integers(4))) for k in order[r * n:(r + 1) * n]]) for r in range(n)]
    return finish(rng, cv2.resize(np.vstack(rows), (size, size)))


def false_colour(rng, bank, road, photographs):
    """One channel lost or far too strong, or grey shown in a palette. The plain swap of red and blue is not among these."""
    kind, out = rng.random(), road.astype(np.float32)
    if kind < 0.4:
        out[:, :, rng.integers(3)] *= rng.uniform(0.0, 0.25)
    elif kind < 0.7:
        out[:, :, rng.integers(3)] = np.clip(255.0 - out[:, :, rng.integers(3)], 0, 255)
    else:
        palettes = (cv2.COLORMAP_JET, cv2.COLORMAP_HOT, cv2.COLORMAP_HSV, cv2.COLORMAP_VIRIDIS, cv2.COLORMAP_COOL)
        grey = cv2.normalize(cv2.cvtColor(road, cv2.COLOR_RGB2GRAY), None, 0, 255, cv2.NORM_MINMAX)
        out = cv2.applyColorMap(grey, palettes[rng.integers(len(palettes))])[:, :, ::-1].astype(np.float32)
    return finish(rng, out)


def bodywork(rng, bank, road, photographs):
    """The car's own bodywork or a hand: one smooth colour, shaded, with highlights."""
    size = road.shape[0]
    shape = bank.sample(rng, 3.0, size, rng.uniform(3, 8))
    shade = np.clip(0.6 + 0.25 * shape, 0.05, 1.5)[:, :, None] * rng.uniform(20, 230, 3)
    gloss = np.clip(bank.sample(rng, 3.0, size, rng.uniform(2, 6)) - rng.uniform(0.8, 1.6), 0, 1)[:, :, None]
    return finish(rng, shade + 220 * gloss)


def sky(rng, bank, road, photographs):
    """A camera that points upwards: clouds over blue or grey, perhaps a horizon."""
    size = road.shape[0]
    cloud = np.clip(0.4 + rng.uniform(0.3, 0.6) * bank.sample(rng, 3.0, size, rng.uniform(1, 4), 0.0, 0.5), 0, 1)[:, :, None]
    blue = np.array([rng.uniform(60, 150), rng.uniform(110, 180), rng.uniform(170, 250)])
    out = blue + cloud * (rng.uniform(190, 255) - blue)
    if rng.random() < 0.4:
        line = int(size * rng.uniform(0.5, 0.9))
        ridge = (line + 0.04 * size * bank.sample(rng, 2.0, size, 2.0)[0]).astype(int)
        out[np.arange(size)[:, None] > ridge[None, :]] = rng.uniform(10, 90, 3)
    return finish(rng, out)


def wall(rng, bank, road, photographs):
    """A building: courses of painted or coloured panels with dark joints, any hue, upright."""
    size, (h, w) = road.shape[0], rng.uniform(0.06, 0.3, 2) * road.shape[0]
    y, x = np.mgrid[:size, :size].astype(np.float32)
    row = (y / h).astype(int)
    across = x / w + 0.5 * (row % 2) * (rng.random() < 0.5)
    tone = rng.uniform(0.7, 1.3, 4096)[(row * 131 + across.astype(int) * 17) % 4096]
    hue = cv2.cvtColor(np.uint8([[[rng.integers(180), rng.integers(90, 255), rng.integers(80, 230)]]]), cv2.COLOR_HSV2RGB)[0, 0]
    joint = (y % h < rng.uniform(1, 4)) | (across % 1 * w < rng.uniform(1, 4))
    grain = 1.0 + 0.1 * bank.sample(rng, 1.0, size, rng.uniform(1, 3))
    return finish(rng, np.where(joint[:, :, None], rng.uniform(10, 220), hue * (tone * grain)[:, :, None]))


def planks(rng, bank, road, photographs):
    """Wood: long brown grain and gaps between the boards."""
    size, width = road.shape[0], rng.uniform(0.08, 0.4) * road.shape[0]
    y = np.arange(size, dtype=np.float32)[None, :] * np.ones((size, 1), np.float32)
    grain = bank.sample(rng, 1.0, size, rng.uniform(1, 2), 0.0, rng.uniform(12, 30))
    tone = rng.uniform(0.8, 1.2, 64)[(y / width).astype(int) % 64] * (1.0 + rng.uniform(0.1, 0.3) * grain)
    out = rng.uniform(70, 190) * np.array([1.0, rng.uniform(0.6, 0.8), rng.uniform(0.3, 0.55)]) * tone[:, :, None]
    out *= np.where(y % width < rng.uniform(1, 4), 0.3, 1.0)[:, :, None]
    return finish(rng, out if rng.random() < 0.5 else out.transpose(1, 0, 2))


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


def combed(rng, bank, road, photographs):
    """Interlaced halves that do not belong together."""
    out = road.copy()
    out[1::2] = np.roll(road[::-1], int(rng.integers(10, road.shape[1] // 2)), 1)[1::2]
    return out


def rain_streaks(rng, bank, road, photographs):
    """Water running down the lens: long bent strips of the blurred picture."""
    size = road.shape[0]
    wander = bank.sample(rng, 3.0, size, 3.0, 0.0, 4.0)
    x = np.arange(size, dtype=np.float32)[None, :] + 8 * wander
    strip = np.clip(2 * np.sin(x * 2 * np.pi / rng.uniform(0.08, 0.2) / size) + rng.uniform(0, 1), 0, 1)[:, :, None]
    soft = cv2.GaussianBlur(road, (0, 0), size / 25).astype(np.float32)[:, ::-1]
    return np.clip(road + strip * (soft * rng.uniform(0.9, 1.3) - road), 0, 255).astype(np.uint8)


FAMILIES = (black, white, flat_colour, gradient, noise, noisy_road, blur, over_exposed, lens_dirt, outlier_photo("grass"),
            outlier_photo("ground"), fog, flare, scratches, radial_blur, frosted, condensation, mosaic, posterised, negative, torn,
            scrambled, false_colour, bodywork, sky, wall, planks, motion_smear, droplets, combed, rain_streaks)
