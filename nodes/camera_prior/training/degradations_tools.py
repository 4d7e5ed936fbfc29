"""What the families of bad pictures share."""

import cv2
import numpy as np


def finish(rng, picture):
    """To uint8, half of the time with a little sensor noise."""
    if rng.random() < 0.5:
        picture = picture + rng.uniform(0.5, 4.0) * rng.standard_normal(picture.shape, np.float32)
    return np.clip(picture, 0, 255).astype(np.uint8)


def flat(road, colour):
    return np.full(road.shape, 0, np.float32) + np.asarray(colour, np.float32)


def outlier_photo(folder):
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
        return finish(rng, cut * np.exp(rng.normal(0, 0.15)))

    family.__name__ = folder
    return family
