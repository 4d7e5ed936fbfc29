"""python -m pytest test_training.py: the renderer, the split, RSCD's layout, the losses. Needs no photographs."""

import json

import numpy as np
import pytest
import torch
from PIL import Image

import degradations
import refit
import train
from data import Rscd, finer, plain, rscd_class, to_tensor
from export import averaged
from model import BASIS, build, flops, load_weights
from noise import Bank
from render import CLASSES, NEIGHBOURS, area_maps, render, sample_fractions
from textures import SPLIT_FILE, SPLITS, split_of

BANK = Bank(3, per_beta=4)


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
        mu = float(f @ BASIS.numpy())
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


def test_a_finer_camera_and_a_plain_photograph_come_in_the_network_s_size():
    photo, _ = render(np.random.default_rng(5), BANK, 120)
    for size in (64, 224):
        assert plain(np.random.default_rng(1), photo, size).shape == (size, size, 3)
        picture, f = finer(np.random.default_rng(1), BANK, size, photo)
        assert picture.shape == (size, size, 3) and abs(f.sum() - 1) < 1e-5


@pytest.fixture
def rscd(tmp_path):
    def save(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.random.default_rng(0).integers(0, 255, (24, 36, 3), np.uint8)).save(path)

    for label, count in {"dry_asphalt_smooth": 5, "wet_gravel": 2, "water_concrete_slight": 1, "fresh_snow": 1, "ice": 1}.items():
        for k in range(count):
            save(tmp_path / "train" / label / f"2022010112{k:04}-{label.replace('_', '-')}.jpg")
    save(tmp_path / "test_50k" / "202201011200-melted_snow.jpg")
    save(tmp_path / "test_50k" / "202201011201-wet-concrete-severe.jpg")
    return tmp_path


def test_rscd_is_read_from_folders_and_from_names(rscd):
    data = Rscd(rscd, "train", 32, train=True)
    assert sorted(c for _, c in data.files) == [0] * 5 + [1] * 2 + [2, 3, 4]
    picture, target, _ = data[0]
    assert picture.shape == (3, 32, 32) and target.sum() == 1
    # The sampler's weights give every class the same total.
    total = np.zeros(5)
    for (_, c), w in zip(data.files, data.weights):
        total[c] += w
    assert np.allclose(total, 1)
    assert [c for _, c in Rscd(rscd, "test_50k", 32, train=False).files] == [3, 1]


def test_all_27_labels_of_rscd_fold():
    labels = [f"{w}_{m}_{u}" for w in ("dry", "wet", "water") for m in ("asphalt", "concrete") for u in ("smooth", "slight", "severe")]
    labels += [f"{w}_{m}" for w in ("dry", "wet", "water") for m in ("gravel", "mud")] + ["fresh_snow", "melted_snow", "ice"]
    assert len(labels) == 27
    assert np.bincount([rscd_class(x) for x in labels]).tolist() == [8, 8, 8, 2, 1]
    with pytest.raises(ValueError, match="asphalt_dry"):
        rscd_class("asphalt_dry")


def test_the_loss_is_least_where_p_equals_the_area_fractions():
    f = torch.tensor([[0.3, 0.5, 0.0, 0.2, 0.0]])
    z = torch.zeros(1, 5, requires_grad=True)
    for _ in range(3000):
        (grad,) = torch.autograd.grad(train.losses(z, f).sum(), z)
        z = (z - grad).detach().requires_grad_()
    assert torch.allclose(torch.softmax(z, 1), f, atol=2e-3)


def test_the_papers_rate_falls_tenfold_every_15_epochs():
    assert [train.rate_at("paper", e / 40, 40) for e in (0, 14, 16, 31)] == pytest.approx([1, 1, 0.1, 0.01])


def test_weights_of_another_head_load_but_for_the_head(tmp_path):
    import torchvision

    torch.save(torchvision.models.mobilenet_v3_small(num_classes=7).state_dict(), tmp_path / "w.pt")
    left = load_weights(build("mobilenet_v3_small"), tmp_path / "w.pt")
    assert left == ["classifier.3.bias", "classifier.3.weight"]


def test_weights_are_averaged_by_their_shares(tmp_path):
    for name, value in (("a", 1.0), ("b", 3.0)):
        torch.save({"w": torch.tensor([value]), "count": torch.tensor(int(value))}, tmp_path / name)
    mean = averaged([tmp_path / "a", tmp_path / "b"], [0.25, 0.75])
    assert mean["w"].item() == 2.5 and mean["count"].item() == 3
    with pytest.raises(ValueError, match="add up to 1"):
        averaged([tmp_path / "a"], [0.5])


def test_the_papers_counts_are_torchvisions_with_five_classes():
    for name, parameters, gflop in (("mobilenet_v3_small", 1.52, 0.12), ("resnet18", 11.18, 3.65), ("efficientnet_b0", 4.01, 0.83)):
        net = build(name)
        assert sum(w.numel() for w in net.parameters()) / 1e6 == pytest.approx(parameters, abs=0.01)
        assert flops(net) / 1e9 == pytest.approx(gflop, rel=0.1)


def test_a_refit_s_halves_are_the_whole_network_and_its_cache_is_found_again(tmp_path):
    class Made:
        def picture(self, i):
            return (*render(np.random.default_rng(i), BANK, 64), i % 2, "made")

    net = build("mobilenet_v3_small").eval()
    front, tail = refit.halves(net)
    x, target, road = refit.answers(front, Made(), 6, "made", tmp_path, chunk=3)
    pictures = torch.stack([to_tensor(Made().picture(i)[0]) for i in range(6)])
    with torch.no_grad():
        assert torch.allclose(tail(x.float()), net(pictures), atol=0.02)
    assert road.tolist() == [True, False] * 3 and np.allclose(target.sum(1), 1)
    again = refit.answers(None, None, 6, "made", tmp_path, chunk=3)
    assert all((a == b).all() for a, b in zip(again, (x, target, road)))
