"""Tests of RSCD's layout, losses, weights and networks; they need torch, and no photographs."""

import numpy as np
import pytest
import torch
from PIL import Image

import refit
import train
from data import Rscd, finer, plain, rscd_class, to_tensor
from export import averaged
from familiar import LAYERS, Familiar
from model import build, flops, load_weights
from noise import Bank
from render import render

BANK = Bank(3, per_beta=4)


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


@pytest.mark.parametrize("backbone", LAYERS)
def test_the_distance_is_small_for_pictures_like_those_of_the_fit_and_large_for_others(backbone):
    roads = torch.stack([to_tensor(render(np.random.default_rng(i), BANK, 64)[0]) for i in range(120)])
    net = build(backbone).eval()
    familiar = Familiar(net, LAYERS[backbone]).fit([roads[:50], roads[50:]])
    with torch.no_grad():
        logits, like = familiar(roads)
        lines = roads.clone()
        lines[:, :, ::2] += 4.0
        assert torch.equal(logits, net(roads))
        assert 0.3 < like.mean() < 1.0
        assert familiar(lines)[1].min() > like.max()
