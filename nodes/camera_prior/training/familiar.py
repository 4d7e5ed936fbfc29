"""How far a picture is from those that the network was fitted to, told by the network's own early layers.

The last layers have learned to see road in everything; an early one still sees what the picture is made of. Its channels' means and
standard deviations over the picture are held against those of honest pictures: the Mahalanobis distance, over the root of their number,
which makes it one at most for a usual picture. The network that is exported says it beside the logits.
"""

import numpy as np
import torch
from PIL import Image
from torch import nn

from data import Renders, to_tensor
from textures import ROADS, load_photographs

# Chosen on validation renders and on families of bad pictures made for the choice.
LAYERS = {"mobilenet_v3_small": "features.3", "resnet18": "layer1", "efficientnet_b0": "features.3"}
SHRINK = 0.05  # of the correlations, towards none
RENDERED, CUT, SEED = 5200, 1500, 3001


def summary(answer):
    """(N, C, H, W) to (N, 2 C): means and standard deviations over the picture."""
    mean = answer.mean((2, 3), keepdim=True)
    spread = (answer - mean).pow(2).mean((2, 3)).sqrt()
    return torch.cat([mean.flatten(1), spread], 1)


class Familiar(nn.Module):
    """A network that answers (logits, distance)."""

    def __init__(self, net, layer):
        super().__init__()
        self.net, self.seen = net, None
        self.eval()
        net.get_submodule(layer).register_forward_hook(lambda module, inputs, output: setattr(self, "seen", summary(output)))

    @torch.no_grad()
    def fit(self, batches):
        """Honest pictures, (N, 3, H, W) each."""
        seen = []
        for x in batches:
            self.net(x)
            seen.append(self.seen.double())
        seen = torch.cat(seen)
        scale = seen.std(0).clamp_min(1e-6)
        correlation = torch.corrcoef(seen.T).nan_to_num(0.0).fill_diagonal_(1.0)
        correlation = (1 - SHRINK) * correlation + SHRINK * torch.eye(len(scale))
        whiten = torch.linalg.cholesky(torch.linalg.inv(correlation)) / scale[:, None]
        self.register_buffer("mean", seen.mean(0).float())
        self.register_buffer("whiten", whiten.float())
        return self

    def forward(self, x):
        logits = self.net(x)
        return logits, ((self.seen - self.mean) @ self.whiten).pow(2).mean(1).sqrt()


def honest(photographs, chunk=50):
    """Batches of the training split: renders, made textures among them, and untouched photographs, cut and whole."""
    roads = dict(outliers=False, seed=SEED)
    sets = (Renders(photographs, "train", 224, RENDERED, plain_share=0.1, finer_share=0.25, **roads),
            Renders(photographs, "train", 224, CUT, plain_share=1.0, procedural_share=0.0, first=RENDERED, **roads))
    whole = [p for folder in load_photographs(photographs, "train", ROADS).values() for p in folder]
    pictures = [(data.picture, i) for data in sets for i in range(len(data))]
    pictures += [(lambda i: (np.asarray(Image.fromarray(whole[i]).resize((224, 224), Image.BILINEAR)),), i) for i in range(len(whole))]
    for first in range(0, len(pictures), chunk):
        yield torch.stack([to_tensor(picture(i)[0]) for picture, i in pictures[first:first + chunk]])
