"""Dry road textures: photographs, split by file, and procedural ones."""

import hashlib
import json
from pathlib import Path

import cv2
import numpy as np

# Folders of photographs that serve as dry roads, with the share of the renders that each gets.
ROADS = {"asphalt": 0.34, "concrete": 0.2, "concrete_plates": 0.16, "compacted": 0.1, "gravel": 0.1, "cobblestone": 0.1}
# Folders of photographs that no racing car should meet: the first are shown in training as outliers, the others never.
OUTLIERS = ("grass", "ground")
UNSEEN_OUTLIERS = ("sett", "paving_stones")
SPLITS = ("train", "val", "test")
SPLIT_FILE = Path(__file__).with_name("split.json")


def split_of(name):
    """The split of a photograph, from its file's name alone: 70 % train, 10 % val, 20 % test."""
    x = int(hashlib.sha256(name.encode()).hexdigest()[:8], 16) % 100
    return "train" if x < 70 else "val" if x < 80 else "test"


def write_split(root):
    """Records which photograph belongs to which split."""
    table = {}
    for folder in sorted({*ROADS, *OUTLIERS, *UNSEEN_OUTLIERS}):
        names = sorted(p.name for p in (Path(root) / folder).glob("*.jpg"))
        table[folder] = {s: [n for n in names if split_of(n) == s] for s in SPLITS}
    SPLIT_FILE.write_text(json.dumps(table, indent=0) + "\n")


def load_photographs(root, split, folders):
    """{folder: [RGB uint8 pictures]} of one split, as recorded in split.json."""
    table = json.loads(SPLIT_FILE.read_text())
    out = {}
    for folder in folders:
        names = table[folder][split]
        out[folder] = [cv2.cvtColor(cv2.imread(str(Path(root) / folder / n)), cv2.COLOR_BGR2RGB) for n in names]
    return out


LINEAR = (np.arange(256, dtype=np.float32) / 255.0) ** 2.2


def photograph(rng, picture, size, tilt):
    """Linear RGB (size, size, 3) cut from a photograph: random place, zoom 0.7..4 (at 224 pixels), turn and mirror."""
    h, w = picture.shape[:2]
    zoom = np.exp(rng.uniform(np.log(0.8), np.log(4.0)))
    zoom = min(zoom, 2.4 * 224.0 / min(h, w))
    angle = rng.uniform(-0.12, 0.12)
    reach = 0.5 * size / zoom
    cx = rng.uniform(min(reach, w / 2), max(w - reach, w / 2))
    cy = rng.uniform(min(reach, h / 2), max(h - reach, h / 2))
    to_centre = np.array([[1, 0, -size / 2], [0, 1, -size / 2], [0, 0, 1]], np.float64)
    flip = rng.choice([-1.0, 1.0])
    tilted = np.array([[flip / zoom, 0, 0], [0, 1 / (zoom * rng.uniform(0.6, 1.4)), 0], [0, tilt / size, 1]])
    c, s = np.cos(angle), np.sin(angle)
    place = np.array([[c, -s, cx], [s, c, cy], [0, 0, 1]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    warped = cv2.warpPerspective(picture, place @ tilted @ to_centre, (size, size), flags=flags,
                                 borderMode=cv2.BORDER_REFLECT_101)
    return LINEAR[warped]


def procedural(rng, bank, size, tilt):
    """Linear RGB of a made road: binder and stones, mottle, cracks or joints. The recipe that reference_car repeats.

    grey = a (1 + k1 n0 + k2 n1 + k3 n3), a 0.05..0.4 albedo, k1 0.05..0.35 grain (white field, zoom 1..3), k2 0..0.2
    stones (1/f field, zoom 1..4), k3 0.03..0.2 mottle (1/f^3 field, zoom 1..6); each colour channel x 0.94..1.06.
    """
    a = np.exp(rng.uniform(np.log(0.05), np.log(0.4)))
    grey = np.ones((size, size), np.float32)
    grey += rng.uniform(0.05, 0.35) * bank.sample(rng, 0.0, size, rng.uniform(1, 3), tilt)
    grey += rng.uniform(0.0, 0.2) * bank.sample(rng, 1.0, size, rng.uniform(1, 4), tilt)
    grey += rng.uniform(0.03, 0.2) * bank.sample(rng, 3.0, size, rng.uniform(1, 6), tilt)
    if rng.random() < 0.3:  # cracks: the thin zero line of a rough field
        line = np.abs(bank.sample(rng, 2.0, size, rng.uniform(1.5, 5), tilt))
        grey *= 1.0 - rng.uniform(0.2, 0.7) * np.clip(1.0 - line / rng.uniform(0.03, 0.1), 0, 1)
    if rng.random() < 0.2:  # joints of plates
        x = np.arange(size, dtype=np.float32)
        period, width = rng.uniform(40, 160), rng.uniform(1, 3)
        joint = (np.abs((x + rng.uniform(0, period)) % period) < width).astype(np.float32)
        grey *= 1.0 - rng.uniform(0.2, 0.6) * (joint[:, None] if rng.random() < 0.5 else joint[None, :])
    tint = rng.uniform(0.94, 1.06, 3).astype(np.float32)
    return np.clip(a * grey, 0.005, 1.0)[:, :, None] * tint
