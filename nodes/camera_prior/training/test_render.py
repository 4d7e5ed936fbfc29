"""Tests of the road renderer, the split and the bad pictures; they need neither torch nor photographs."""

import json

import numpy as np
import pytest

import degradations
from noise import Bank
from render import CLASSES, NEIGHBOURS, area_maps, render, sample_fractions
from textures import SPLIT_FILE, SPLITS, split_of

BANK = Bank(3, per_beta=4)
# The friction basis, from dry to ice.
BASIS = np.array([0.85, 0.60, 0.42, 0.25, 0.10])


def test_a_picture_follows_from_its_seed():
    first, f = render(np.random.default_rng(5), BANK, 64)
    again, g = render(np.random.default_rng(5), BANK, 64)
    other, _ = render(np.random.default_rng(6), BANK, 64)
    assert (first == again).all() and (f == g).all() and (first != other).any()


def test_area_maps_share_out_the_picture_and_hit_the_wanted_fractions():
    rng = np.random.default_rng(1)
    for _ in range(60):
        want = sample_fractions(rng)
        maps = area_maps(rng, BANK, 96, rng.uniform(0, 1.2), want)
        total = sum(maps.values())
        assert np.allclose(total, 1.0, atol=1e-5)
        got = np.array([maps[c].mean() if c in maps else 0.0 for c in range(5)])
        assert np.abs(got - want).max() < 0.12, (want, got)


def test_reported_fractions_are_those_of_the_alpha_maps_and_mu_is_their_mean():
    for a, b in NEIGHBOURS:
        want = np.zeros(5)
        want[a], want[b] = 0.3, 0.7
        _, f = render(np.random.default_rng(a * 5 + b), BANK, 96, None, want)
        assert abs(f.sum() - 1) < 1e-5 and set(np.flatnonzero(f)) <= {a, b}
        mu = float(f @ BASIS)
        assert min(BASIS[a], BASIS[b]) <= mu + 1e-5 and mu <= max(BASIS[a], BASIS[b]) + 1e-5


def test_snow_is_brighter_than_wet_asphalt_before_the_camera():
    def level(c):
        f = np.eye(5)[CLASSES.index(c)]
        return np.mean([render(np.random.default_rng(k), BANK, 48, None, f, with_camera=False)[0].mean() for k in range(20)])

    assert level("snow") > level("wet") + 60


def test_the_split_is_by_file_and_disjoint():
    for folder, parts in json.loads(SPLIT_FILE.read_text()).items():
        names = [n for s in SPLITS for n in parts[s]]
        assert len(names) == len(set(names)) and all(parts[s] for s in SPLITS), folder
        assert all(split_of(n) == s for s in SPLITS for n in parts[s])


def test_no_degradation_of_the_test_is_trained_on():
    assert not set(degradations.SEEN) & set(degradations.UNSEEN)


@pytest.mark.parametrize("family", [*degradations.SEEN.values(), *degradations.UNSEEN.values()], ids=lambda f: f.__name__)
def test_every_degradation_gives_a_picture_that_follows_from_its_seed(family):
    road, _ = render(np.random.default_rng(5), BANK, 64)
    photographs = {name: [road] for name in ("asphalt", "grass", "ground", "sett", "paving_stones")}
    first, again = (family(np.random.default_rng(8), BANK, road, photographs) for _ in range(2))
    assert first.shape == road.shape and first.dtype == np.uint8 and (first == again).all()
    assert (first != road).any()
