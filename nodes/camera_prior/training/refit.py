"""Fits the last blocks of trained weights anew, on pictures that are rendered once: an average of weights leaves them room.

    python refit.py --photographs DIR --weights A.pt B.pt --shares 0.5 0.5 --cache DIR --out OUT

The first blocks stay, BatchNorm's statistics too. What the first blocks answer to the pictures goes to the cache, from where a
run that was cut off goes on. To the cross-entropy comes the squared error of mu, which is what the table judges.
OUT receives last.pt (moving average of the weights), log.csv and run.json.
"""

import argparse
import copy
import csv
import json
import math
import time
from pathlib import Path

import numpy as np
import torch
from torch import nn

from data import Renders, to_tensor
from export import averaged
from model import BASIS, build
from train import losses

FROZEN = 9  # of the 13 parts of MobileNetV3-Small's features
CHUNK, VALIDATION, VALIDATION_SEED = 500, 1600, 101
MU_WEIGHT = 30.0


def halves(net):
    """The blocks that stay and those that are fitted, which share their layers with `net`."""
    return net.features[:FROZEN], nn.Sequential(net.features[FROZEN:], net.avgpool, nn.Flatten(), net.classifier)


@torch.no_grad()
def answers(front, data, count, name, cache, chunk=CHUNK):
    """What `front` answers to the first `count` pictures of `data`, their targets, and which of them are roads."""
    parts = []
    for first in range(0, count, chunk):
        file = cache / f"{name}_{first}.pt"
        if not file.exists():
            items = [data.picture(i) for i in range(first, min(first + chunk, count))]
            tensors = torch.stack([to_tensor(p) for p, *_ in items]).to(memory_format=torch.channels_last)
            answer = torch.cat([front(x) for x in tensors.split(50)]).to(torch.bfloat16)
            targets = torch.from_numpy(np.stack([f for _, f, *_ in items]))
            torch.save((answer, targets, torch.tensor([kind == 0 for *_, kind, _ in items])), file)
        parts.append(torch.load(file))
    return [torch.cat(part) for part in zip(*parts)]


@torch.no_grad()
def validate(tail, x, target):
    """(cross-entropy, RMSE of mu)."""
    logits = torch.cat([tail(part.float()) for part in x.split(200)])
    error = (torch.softmax(logits, 1) - target) @ BASIS
    return losses(logits, target).mean().item(), error.pow(2).mean().sqrt().item()


def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--photographs", required=True)
    p.add_argument("--weights", required=True, nargs="+")
    p.add_argument("--shares", type=float, nargs="+", default=[1.0])
    p.add_argument("--cache", required=True, type=Path, help="folder for these weights and these pictures alone")
    p.add_argument("--out", required=True, type=Path)
    p.add_argument("--pictures", type=int, default=14000)
    p.add_argument("--epochs", type=int, default=4)
    p.add_argument("--rate", type=float, default=5e-4)
    p.add_argument("--seed", type=int, default=2032)
    args = p.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    args.cache.mkdir(parents=True, exist_ok=True)
    torch.set_num_threads(1)
    net = build("mobilenet_v3_small").to(memory_format=torch.channels_last).eval()
    net.load_state_dict(averaged(args.weights, args.shares))
    front, tail = halves(net)
    shown = Renders(args.photographs, "train", 224, args.pictures, args.seed, procedural_share=0.1, plain_share=0.1, finer_share=0.25)
    held = Renders(args.photographs, "val", 224, VALIDATION, VALIDATION_SEED, outliers=False, procedural_share=0.0)
    held_x, held_target, _ = answers(front, held, VALIDATION, "val", args.cache)
    x, target, road = answers(front, shown, args.pictures, "train", args.cache)
    average, start = copy.deepcopy(tail), time.process_time()
    optimizer = torch.optim.AdamW(tail.parameters(), lr=args.rate, weight_decay=0.03)
    order, step, total = torch.Generator().manual_seed(args.seed), 0, args.epochs * math.ceil(args.pictures / 64)
    rows = [(0, *validate(average, held_x, held_target))]
    for epoch in range(1, args.epochs + 1):
        for batch in torch.randperm(args.pictures, generator=order).split(64):
            for group in optimizer.param_groups:
                group["lr"] = args.rate * min(1, step / 20) * 0.5 * (1 + math.cos(math.pi * step / total))
            logits = tail(x[batch].float())
            error = (torch.softmax(logits, 1) - target[batch]) @ BASIS
            loss = losses(logits, target[batch]).mean() + MU_WEIGHT * error[road[batch]].pow(2).mean()
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            optimizer.step()
            step += 1
            with torch.no_grad():
                for a, b in zip(average.parameters(), tail.parameters()):
                    a.lerp_(b, 0.02)
        rows.append((epoch, *validate(average, held_x, held_target)))
        print(*rows[-1], flush=True)
    for own, kept in zip(tail.parameters(), average.parameters()):
        own.data.copy_(kept)
    torch.save(net.state_dict(), args.out / "last.pt")
    with open(args.out / "log.csv", "w", newline="") as f:
        csv.writer(f).writerows([("epoch", "val_loss", "val_rmse"), *rows])
    kept = {k: v for k, v in vars(args).items() if k not in ("photographs", "weights", "cache", "out")}
    (args.out / "run.json").write_text(json.dumps({"arguments": kept, "fit_cpu_s": time.process_time() - start}, indent=1) + "\n")


if __name__ == "__main__":
    main()
