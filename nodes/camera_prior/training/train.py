"""Trains a backbone to read the area fractions of five road states.

    python train.py --photographs DIR --backbone mobilenet_v3_small --stages 112x4500,224x450 --out OUT
    python train.py --photographs DIR --backbone mobilenet_v3_small,resnet18 --device cuda --workers 15 --out OUT   both on the same pictures
    python train.py --rscd DIR --recipe paper --epochs 40 --out OUT            the paper's recipe on the paper's data

A stage `112x4500` is 4500 steps on pictures of 112 pixels: windows of the 224 pixel picture, at the same scale.
OUT receives last.pt (moving average of the weights), log.csv, curves.png and run.json; of several backbones each its own folder.
"""

import argparse
import copy
import csv
import json
import math
import os
import time
from pathlib import Path

import cv2
import numpy as np
import torch
import torchvision
from torch.utils.data import DataLoader, WeightedRandomSampler

from data import Renders, Rscd
from model import BACKBONES, BASIS, build, load_weights


def losses(logits, target):
    """Soft-label cross-entropy: at its minimum p equals the area fractions, so that p . B regresses mu."""
    return -(target * torch.log_softmax(logits, 1)).sum(1)


def rate_at(recipe, progress, epochs):
    """The learning rate's factor at `progress` 0..1: the paper's steps (x 0.1 every 15 epochs) or warm-up and cosine."""
    if recipe == "paper":
        return 0.1 ** int(progress * epochs / 15)
    warm = 0.04
    if progress < warm:
        return progress / warm
    return 0.5 * (1 + math.cos(math.pi * (progress - warm) / (1 - warm)))


@torch.no_grad()
def validate(net, batches):
    """(loss, RMSE of mu, RMSE of the constant 'mean' predictor) on road pictures."""
    net.eval()
    device = next(net.parameters()).device
    loss, got, want = [], [], []
    for x, target, _ in batches:
        logits = net(x.to(device, memory_format=torch.channels_last)).cpu()
        loss.append(losses(logits, target))
        got.append(torch.softmax(logits, 1) @ BASIS)
        want.append(target @ BASIS)
    got, want = torch.cat(got), torch.cat(want)
    rmse = (got - want).pow(2).mean().sqrt().item()
    return torch.cat(loss).mean().item(), rmse, want.std(unbiased=False).item()


def curves(log, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = list(csv.DictReader(open(log)))
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6))
    pictures = [float(r["pictures"]) / 1e3 for r in rows]
    left.plot(pictures, [float(r["train_loss"]) for r in rows], "0.6", label="training")
    left.plot(pictures, [float(r["val_loss"]) for r in rows], "#1f77b4", label="validation")
    left.set(xlabel="pictures (thousand)", ylabel="cross-entropy (nat)")
    left.legend()
    right.plot(pictures, [float(r["val_rmse"]) for r in rows], "#1f77b4", label="network")
    right.plot(pictures, [float(r["val_constant"]) for r in rows], "k--", label="constant predictor")
    right.set(xlabel="pictures (thousand)", ylabel="RMSE of mu", ylim=(0, None))
    right.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def batches_of(args, stage, first):
    """The loader of one stage; `first` is the index of its first picture, so that no two stages share one."""
    size, steps = stage
    if args.rscd:
        data = Rscd(args.rscd, "train", size, train=True)
        generator = torch.Generator().manual_seed(args.seed + first)
        sampler = WeightedRandomSampler(data.weights, steps * args.batch, generator=generator)
        return DataLoader(data, args.batch, sampler=sampler, num_workers=args.workers, drop_last=True)
    data = Renders(args.photographs, "train", size, steps * args.batch, args.seed, first=first, plain_share=args.plain_share,
                   finer_share=args.finer_share)
    return DataLoader(data, args.batch, num_workers=args.workers, prefetch_factor=4 if args.workers else None, worker_init_fn=one_thread)


def one_thread(_worker):
    """Many workers that each ask for every core are slower than one thread each."""
    cv2.setNumThreads(1)


def validation_set(args):
    if args.rscd:
        return [b for b, _ in zip(DataLoader(Rscd(args.rscd, "vali_20k", 224, train=False), 50), range(8))]
    return list(DataLoader(Renders(args.photographs, "val", 224, args.val_pictures, seed=1, outliers=False), 50, num_workers=args.workers))


def arguments():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    source = p.add_mutually_exclusive_group(required=True)
    source.add_argument("--photographs", help="folder of dry road photographs, one sub-folder per surface")
    source.add_argument("--rscd", help="RSCD's root: train, vali_20k, test_50k")
    p.add_argument("--backbone", default=["mobilenet_v3_small"], type=lambda text: text.split(","),
                   help=f"one of {', '.join(BACKBONES)}, or several with commas between, trained on the same pictures")
    p.add_argument("--device", default="cpu", help="cpu or cuda: where the networks are; pictures are always made by --workers")
    p.add_argument("--recipe", default="short", choices=("short", "paper"),
                   help="short: AdamW, 2e-3, cosine. paper: SGD 0.9, decay 1e-4, 0.05 x 0.1 every 15 epochs, batch 256")
    p.add_argument("--stages", default="112x4500,224x450", help="SIZExSTEPS,...")
    p.add_argument("--epochs", type=int, default=40, help="what the paper's recipe counts as the whole run")
    p.add_argument("--batch", type=int, help="default: 64 (short), 256 (paper)")
    p.add_argument("--rate", type=float, help="default: 2e-3 (short), 0.05 (paper)")
    p.add_argument("--init-weights", help="a state_dict to start from; layers of another shape are left out and named")
    p.add_argument("--plain-share", type=float, default=0.0, help="share of the photographs shown as they are, as dry")
    p.add_argument("--finer-share", type=float, default=0.0, help="share of the renders taken by a camera of more pixels")
    p.add_argument("--minutes", type=float, help="end the run, and its rate's schedule, after so much time of the processor (on a GPU: of the clock), not after all steps")
    p.add_argument("--clip", type=float, help="largest norm of the gradient")
    p.add_argument("--bfloat16", action="store_true", help="forward and backward in bfloat16 where torch's autocast allows")
    p.add_argument("--seed", type=int, default=2024)
    p.add_argument("--workers", type=int, default=1)
    p.add_argument("--threads", type=int, default=1)
    p.add_argument("--val-pictures", type=int, default=400)
    p.add_argument("--evals", type=int, default=12)
    p.add_argument("--ema", type=float, default=0.997)
    p.add_argument("--out", required=True)
    args = p.parse_args()
    args.batch = args.batch or (256 if args.recipe == "paper" else 64)
    args.rate = args.rate or (0.05 if args.recipe == "paper" else 2e-3)
    if unknown := set(args.backbone) - set(BACKBONES):
        p.error(f"--backbone: expected some of {', '.join(BACKBONES)}, got {', '.join(sorted(unknown))}")
    if args.init_weights and len(args.backbone) > 1:
        p.error("--init-weights starts one backbone, not several")
    return args


class Learner:
    """A network, its optimiser and the moving average of its weights."""

    def __init__(self, args, backbone, out):
        self.args, self.out = args, out
        out.mkdir(parents=True, exist_ok=True)
        net = build(backbone)
        if args.init_weights:
            print("left out:", load_weights(net, args.init_weights) or "nothing")
        self.net = net.to(args.device, memory_format=torch.channels_last)
        self.average = copy.deepcopy(self.net)
        weights = list(self.net.parameters())
        if args.recipe == "paper":
            self.optimizer = torch.optim.SGD(weights, lr=args.rate, momentum=0.9, weight_decay=1e-4)
        else:
            groups = [{"params": [w for w in weights if w.ndim > 1], "weight_decay": 0.03},
                      {"params": [w for w in weights if w.ndim <= 1], "weight_decay": 0.0}]
            self.optimizer = torch.optim.AdamW(groups, lr=args.rate, fused=args.device != "cpu")
        # State dictionaries refer to the networks' own tensors: built once, as three networks' are dear beside a step.
        self.averaged = list(zip(self.average.state_dict().values(), self.net.state_dict().values()))
        self.running, self.rows = [], []

    def step(self, x, target, rate, keep):
        """One step at a learning rate; `keep` is the share of the moving average that stays."""
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        self.net.train()
        with torch.autocast(x.device.type, torch.bfloat16, enabled=self.args.bfloat16):
            logits = self.net(x)
        loss = losses(logits.float(), target).mean()
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        if self.args.clip:
            torch.nn.utils.clip_grad_norm_(self.net.parameters(), self.args.clip)
        self.optimizer.step()
        self.running.append(loss.detach())
        with torch.no_grad():
            for a, b in self.averaged:
                a.lerp_(b, 1 - keep) if a.is_floating_point() else a.copy_(b)

    def validate(self, validation, row):
        """Adds a row to log.csv and saves the average."""
        val_loss, rmse, constant = validate(self.average, validation)
        row = row | {"train_loss": torch.stack(self.running).mean().item(), "val_loss": val_loss, "val_rmse": rmse, "val_constant": constant}
        self.rows.append(row)
        self.running = []
        print(self.out.name, " ".join(f"{k} {v:.4g}" for k, v in row.items()), flush=True)
        with open(self.out / "log.csv", "w", newline="") as f:
            writer = csv.DictWriter(f, row)
            writer.writeheader()
            writer.writerows(self.rows)
        torch.save({k: v.cpu() for k, v in self.average.state_dict().items()}, self.out / "last.pt")


def main():
    args = arguments()
    out = Path(args.out)
    torch.set_num_threads(args.threads)
    torch.manual_seed(args.seed)
    np.random.seed(args.seed)
    folders = {b: out / b if len(args.backbone) > 1 else out for b in args.backbone}
    learners = [Learner(args, backbone, folder) for backbone, folder in folders.items()]
    stages = [tuple(int(n) for n in s.split("x")) for s in args.stages.split(",")]
    total = sum(steps for _, steps in stages)
    validation = validation_set(args)
    # Beside a GPU the thread's own time says little of how long a run takes.
    clock = time.process_time if args.device == "cpu" else time.time
    wall, cpu, start, step, progress = time.time(), time.process_time(), clock(), 0, 0.0
    for stage in stages:
        for x, target, _ in batches_of(args, stage, first=step * args.batch):
            if torch.rand(()) < 0.5:
                x = x.flip(3)
            x, target = x.to(args.device, memory_format=torch.channels_last), target.to(args.device)
            rate = args.rate * rate_at(args.recipe, progress, args.epochs)
            step += 1
            keep = min(args.ema, step / (step + 10))
            for learner in learners:
                learner.step(x, target, rate, keep)
            progress = min((clock() - start) / (60 * args.minutes), 1.0) if args.minutes else step / total
            if progress * args.evals >= len(learners[0].rows) + 1:
                row = {"step": step, "size": stage[0], "pictures": step * args.batch,
                       "cpu_s": time.process_time() - cpu, "wall_s": time.time() - wall}
                for learner in learners:
                    learner.validate(validation, row)
            if progress >= 1:
                break
    versions = {"torch": torch.__version__, "torchvision": torchvision.__version__, "numpy": np.__version__}
    kept = {k: v for k, v in vars(args).items() if k not in ("photographs", "rscd", "out", "init_weights")}
    run = {"arguments": kept, "data": "rscd" if args.rscd else "renders", "versions": versions, "steps": step,
           "pictures": step * args.batch, "wall_s": time.time() - wall, "train_thread_cpu_s": time.process_time() - cpu,
           "nice": os.nice(0)}
    if args.device != "cpu":
        run["device"] = torch.cuda.get_device_name()
    for backbone, folder in folders.items():
        curves(folder / "log.csv", folder / "curves.png")
        kept["backbone"] = backbone
        (folder / "run.json").write_text(json.dumps(run, indent=1) + "\n")


if __name__ == "__main__":
    main()
