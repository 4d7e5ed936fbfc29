"""The three backbones with five outputs, and the friction basis."""

import re
from pathlib import Path

import torch
import torchvision
from torch import nn

from render import CLASSES

BACKBONES = ("mobilenet_v3_small", "resnet18", "efficientnet_b0")
BASIS_FILE = Path(__file__).parents[3] / "params" / "friction_basis.yaml"


def read_basis(path=BASIS_FILE):
    """(mu (5,), sigma (5,)) in the order of CLASSES, out of the node's own parameter file."""
    text = Path(path).read_text()
    value = {m[0]: (float(m[1]), float(m[2])) for m in re.findall(
        r"name: (\w+)\s*\n\s*mu: ([\d.]+)\s*\n\s*sigma: ([\d.]+)", text)}
    return torch.tensor([value[c][0] for c in CLASSES]), torch.tensor([value[c][1] for c in CLASSES])


BASIS, SIGMAS = read_basis()


def build(backbone):
    """A torchvision network with five classes. Short runs want two things otherwise than torchvision has them: BatchNorm's momentum is 0.1
    (0.01 is too slow), and EfficientNet drops no layers at random, which is for runs that overfit.
    """
    own = {"stochastic_depth_prob": 0.0} if backbone.startswith("efficientnet") else {}
    net = getattr(torchvision.models, backbone)(weights=None, num_classes=len(CLASSES), **own)
    for layer in net.modules():
        if isinstance(layer, nn.BatchNorm2d):
            layer.momentum = 0.1
        if isinstance(layer, nn.Dropout):
            layer.inplace = False
    return net


def load_weights(net, path):
    """Loads what fits of a state_dict (ImageNet's weights have 1000 classes, say); returns the names left out."""
    state = torch.load(path, map_location="cpu", weights_only=True)
    own = net.state_dict()
    fits = {k: v for k, v in state.items() if k in own and own[k].shape == v.shape}
    net.load_state_dict(fits, strict=False)
    return sorted(set(own) - set(fits))


def flops(net, size=224):
    """Multiply-adds counted twice over convolutions and linear layers, of one picture."""
    total = 0

    def count(layer, inputs, output):
        nonlocal total
        if isinstance(layer, nn.Conv2d):
            total += 2 * output.numel() * layer.in_channels // layer.groups * layer.kernel_size[0] * layer.kernel_size[1]
        elif isinstance(layer, nn.Linear):
            total += 2 * output.numel() * layer.in_features

    hooks = [m.register_forward_hook(count) for m in net.modules()]
    with torch.no_grad():
        net.eval()(torch.zeros(1, 3, size, size))
    for hook in hooks:
        hook.remove()
    return total
