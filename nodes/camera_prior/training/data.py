"""Data sets: endless renders by index, and RSCD's folders."""

from pathlib import Path

import numpy as np
import torch
from PIL import Image
from torch.utils.data import Dataset

import degradations
from noise import Bank
from render import CLASSES, render
from textures import OUTLIERS, ROADS, load_photographs

MEAN = np.array([0.485, 0.456, 0.406], np.float32)
STD = np.array([0.229, 0.224, 0.225], np.float32)
BANK_SEEDS = {"train": 11, "val": 12, "test": 13}  # of the random fields; a training run's own seed is joined to the first
OUTLIER_SHARE, PROCEDURAL_SHARE = 0.15, 0.2
# Untouched photographs, in the order of ROADS: half of them concrete, which is what looks most like snow.
PLAIN_SHARES = (0.2, 0.5, 0.1, 0.1, 0.05, 0.05)


def to_tensor(picture):
    """RGB uint8 (H, W, 3) to the network's float32 (3, H, W)."""
    return torch.from_numpy(((picture * np.float32(1 / 255) - MEAN) / STD).transpose(2, 0, 1).copy())


def plain(rng, photo, size):
    """A photograph as it is, for the class dry: most of it at the node's 224 pixels, mirrored, a little brighter or darker;
    a smaller `size` is a window of that.
    """
    h, w = photo.shape[:2]
    ch, cw = int(h * rng.uniform(0.7, 1.0)), int(w * rng.uniform(0.7, 1.0))
    y, x = rng.integers(h - ch + 1), rng.integers(w - cw + 1)
    side = max(size, 224)
    cut = Image.fromarray(photo[y:y + ch, x:x + cw]).resize((side, side), Image.BILINEAR)
    y, x = rng.integers(side - size + 1, size=2)
    out = np.asarray(cut, np.float32)[y:y + size, x:x + size] * np.exp(rng.normal(0, 0.15)) * np.exp(rng.normal(0, 0.03, 3))
    out = np.clip(out, 0, 255).astype(np.uint8)
    return out[:, ::-1] if rng.random() < 0.5 else out


def finer(rng, bank, size, photo):
    """A render by a camera of more pixels than the network takes, shrunk as the node shrinks it: most cameras are such."""
    picture, f = render(rng, bank, int(size * rng.uniform(1.05, 1.7)), photo)
    return np.asarray(Image.fromarray(picture).resize((size, size), Image.BILINEAR)), f


class Renders(Dataset):
    """Picture `i` of a split, made from (seed, i) alone. Items: (tensor, target (5,), kind) with kind 1 for outliers."""

    def __init__(self, root, split, size, count, seed, outliers=True, procedural_share=PROCEDURAL_SHARE, first=0,
                 plain_share=0.0, finer_share=0.0):
        self.size, self.count, self.seed, self.first = size, count, seed, first
        self.outliers, self.procedural_share, self.plain_share = outliers, procedural_share, plain_share
        self.finer_share = finer_share
        self.photographs = load_photographs(root, split, (*ROADS, *OUTLIERS))
        self.bank = Bank((BANK_SEEDS[split], seed) if split == "train" else BANK_SEEDS[split])
        self.folders, self.shares = list(ROADS), np.array(list(ROADS.values()))

    def __len__(self):
        return self.count

    def picture(self, i):
        """(RGB uint8, target, kind, material) of picture `i`."""
        rng = np.random.default_rng((self.seed, self.first + i))
        made = rng.random() < self.procedural_share
        untouched = not made and self.plain_share and rng.random() < self.plain_share
        shares = PLAIN_SHARES if untouched else self.shares
        folder = "procedural" if made else self.folders[rng.choice(len(self.folders), p=shares)]
        photo = None if made else self.photographs[folder][rng.integers(len(self.photographs[folder]))]
        if untouched:
            return plain(rng, photo, self.size), np.eye(5, dtype=np.float32)[0], 0, folder
        shrunk = self.finer_share and rng.random() < self.finer_share
        road, f = (finer if shrunk else render)(rng, self.bank, self.size, photo)
        if self.outliers and rng.random() < OUTLIER_SHARE:
            families = list(degradations.SEEN)
            family = families[rng.integers(len(families))]
            road = degradations.SEEN[family](rng, self.bank, road, self.photographs)
            return road, np.full(5, 0.2, np.float32), 1, family
        return road, f, 0, folder

    def __getitem__(self, i):
        picture, target, kind, _ = self.picture(i)
        return to_tensor(picture), torch.from_numpy(target), kind


# RSCD: `<stamp>-<friction>-<material>-<unevenness>.jpg`; three of its friction states carry no material.
RSCD_FOLD = {"dry": 0, "wet": 1, "water": 2, "snow": 3, "fresh_snow": 3, "melted_snow": 3, "ice": 4}


def rscd_class(label):
    """The class, 0..4, of an RSCD label: `dry_asphalt_smooth`, `dry-asphalt-smooth`, `water_mud`, `fresh_snow`, `ice`."""
    label = label.replace("-", "_")
    for name in sorted(RSCD_FOLD, key=len, reverse=True):
        if label == name or label.startswith(name + "_"):
            return RSCD_FOLD[name]
    raise ValueError(f"expected an RSCD label such as dry_asphalt_smooth or fresh_snow, got {label!r}")


def rscd_files(root, split):
    """[(path, class)] of one split folder of RSCD (`train`, `vali_20k`, `test_50k`), sorted by path.

    Training pictures lie in one folder per label; validation and test pictures lie flat and carry the label in their name.
    """
    base = Path(root) / split
    files = sorted(p for p in base.rglob("*") if p.suffix.lower() in (".jpg", ".jpeg", ".png"))
    if not files:
        raise FileNotFoundError(f"no pictures under {base}")
    out = []
    for path in files:
        label = path.parent.name if path.parent != base else path.stem.split("-", 1)[-1]
        out.append((path, rscd_class(label)))
    return out


class Rscd(Dataset):
    """RSCD folded to five classes; `weights` evens out the classes in a WeightedRandomSampler."""

    def __init__(self, root, split, size, train):
        from torchvision import transforms as t

        self.files = rscd_files(root, split)
        counts = np.bincount([c for _, c in self.files], minlength=len(CLASSES))
        self.weights = [1.0 / counts[c] for _, c in self.files]
        resize = t.Resize((size, size), antialias=True)
        extra = [t.RandomHorizontalFlip(), t.ColorJitter(0.2, 0.2, 0.2, 0.02), t.RandomRotation(4)] if train else []
        self.transform = t.Compose([resize, *extra])

    def __len__(self):
        return len(self.files)

    def __getitem__(self, i):
        path, label = self.files[i]
        picture = np.asarray(self.transform(Image.open(path).convert("RGB")))
        return to_tensor(picture), torch.nn.functional.one_hot(torch.tensor(label), len(CLASSES)).float(), 0
