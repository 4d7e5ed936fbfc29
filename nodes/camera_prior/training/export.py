"""Trained weights to ONNX, and the golden files that tie the Rust pipeline to this one.

    python export.py --weights OUT/last.pt --backbone mobilenet_v3_small --out ../model/road_mobilenet_v3_small.onnx
    python export.py --weights A.pt B.pt --shares 0.2 0.8 ...                      the average of two
    python export.py ... --photographs DIR                                         with the distance from familiar pictures
    python export.py ... --golden ../../lib/friction/tests/golden
"""

import argparse
import json
import warnings
from pathlib import Path

import cv2
import numpy as np
import torch
from PIL import Image

from data import to_tensor
from familiar import LAYERS, Familiar, honest
from model import build
from noise import Bank
from render import render

GOLDEN_SEED, GOLDEN_SIZE, GOLDEN_CROP = 20, 400, (40, 120, 360, 380)


def golden(net, folder):
    """A made picture (road.png), its region of interest as PIL resizes it (input.png), tensor samples, logits and distance."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    f = np.array([0.45, 0.0, 0.0, 0.55, 0.0])
    picture, fractions = render(np.random.default_rng(GOLDEN_SEED), Bank(GOLDEN_SEED, per_beta=4), GOLDEN_SIZE, None, f)
    resized = np.asarray(Image.fromarray(picture).crop(GOLDEN_CROP).resize((224, 224), Image.BILINEAR))
    cv2.imwrite(str(folder / "road.png"), picture[:, :, ::-1])
    cv2.imwrite(str(folder / "input.png"), resized[:, :, ::-1])
    tensor = to_tensor(resized)
    with torch.no_grad():
        logits, distance = net(tensor[None])
    at = list(range(0, tensor.numel(), 1511))
    (folder / "golden.json").write_text(json.dumps({
        "generator": f"training/export.py, torch {torch.__version__}, numpy {np.__version__}, PIL {Image.__version__}",
        "size": GOLDEN_SIZE, "crop": GOLDEN_CROP, "fractions": fractions.tolist(), "tensor_at": at,
        "tensor": tensor.flatten()[at].tolist(), "logits": logits[0].tolist(), "unfamiliarity": distance.item()}, indent=1) + "\n")


def averaged(paths, shares):
    """The weighted mean of state_dicts; whole numbers (BatchNorm's counters) are the last one's."""
    if len(paths) != len(shares) or abs(sum(shares) - 1) > 1e-6:
        raise ValueError(f"expected {len(paths)} shares that add up to 1, got {shares}")
    states = [torch.load(p, map_location="cpu", weights_only=True) for p in paths]
    return {k: sum(c * s[k] for c, s in zip(shares, states)) if v.is_floating_point() else v for k, v in states[-1].items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--weights", required=True, nargs="+", help="one file, or several of one lineage to be averaged")
    parser.add_argument("--shares", type=float, nargs="+", default=[1.0], help="of the files in that average")
    parser.add_argument("--backbone", default="mobilenet_v3_small")
    parser.add_argument("--out", required=True)
    parser.add_argument("--photographs", help="the network then also says how far a picture is from its training pictures")
    parser.add_argument("--golden", help="folder for the golden picture, tensor, logits and distance; needs --photographs")
    args = parser.parse_args()
    if args.golden and not args.photographs:
        parser.error("--golden needs --photographs")
    net = build(args.backbone)
    net.load_state_dict(averaged(args.weights, args.shares))
    net.eval()
    outputs = ["logits"]
    if args.photographs:
        net = Familiar(net, LAYERS[args.backbone]).fit(honest(args.photographs))
        outputs.append("unfamiliarity")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.onnx.export(net, torch.zeros(1, 3, 224, 224), args.out, dynamo=False, opset_version=17,
                          input_names=["picture"], output_names=outputs)
    if args.golden:
        golden(net, args.golden)


if __name__ == "__main__":
    main()
