"""Everything that the model card says, on held-out photographs.

    python evaluate.py table PHOTOGRAPHS --models a.onnx b.onnx --out DIR      Table I, predictions, reliability
    python evaluate.py pictures PHOTOGRAPHS --split test --out DIR             honest and bad pictures as files
    python evaluate.py gates READINGS.csv --out FILE.csv                       rates, from the Rust pipeline's readings; those of light.py, too

The pictures are read by the program itself: `cargo run --example read_pictures DIR > READINGS.csv`.
"""

import argparse
import csv
import json
import time
from pathlib import Path

import cv2
import numpy as np
import onnxruntime
import torch

import degradations
from data import BANK_SEEDS, Renders, to_tensor
from model import BASIS, SIGMAS, build, flops
from noise import Bank
from textures import OUTLIERS, ROADS, SPLIT_FILE, UNSEEN_OUTLIERS, load_photographs

TEST_SEED, PICTURE_SEED = {"val": 101, "test": 102}, {"val": 201, "test": 202}


def session(path):
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])


def softmax(z):
    e = np.exp(z - z.max(-1, keepdims=True))
    return e / e.sum(-1, keepdims=True)


def predict(run, tensors):
    return np.concatenate([softmax(run.run(None, {"picture": x[None].numpy()})[0]) for x in tensors])


def mixture(p):
    """mu and sigma of distributions p (N, 5)."""
    b, s = BASIS.numpy(), SIGMAS.numpy()
    mu = p @ b
    return mu, np.sqrt(np.maximum(p @ (s**2 + b**2) - mu**2, 0))


def latency(run, repeats=400):
    """One inference on one thread, milliseconds: p50 and p99 of the time it takes, and the median of the CPU's share of it."""
    x = {"picture": np.random.default_rng(0).standard_normal((1, 3, 224, 224), np.float32)}
    for _ in range(20):
        run.run(None, x)
    t = []
    for _ in range(repeats):
        start = np.array([time.perf_counter(), time.process_time()])
        run.run(None, x)
        t.append(1e3 * (np.array([time.perf_counter(), time.process_time()]) - start))
    wall, cpu = np.transpose(t)
    return float(np.percentile(wall, 50)), float(np.percentile(wall, 99)), float(np.median(cpu))


def raw_dry(run, photographs):
    """Per surface: share of the untouched held-out photographs that read mu > 0.7, and their number."""
    out = {}
    for folder, pictures in photographs.items():
        whole = [to_tensor(antialiased(p)) for p in pictures]
        mu = predict(run, whole) @ BASIS.numpy()
        out[folder] = {"share_above_0.7": float((mu > 0.7).mean()), "photographs": len(mu), "mean_mu": float(mu.mean())}
    return out


def antialiased(picture):
    """The antialiased bilinear resize of PIL, which the Rust pipeline's equals."""
    from PIL import Image

    return np.asarray(Image.fromarray(picture).resize((224, 224), Image.BILINEAR))


def reliability(mu, sigma, target, rng):
    """Sigma against what happens: the friction of a contact patch drawn from the picture's true states and their spreads."""
    b, s = BASIS.numpy(), SIGMAS.numpy()
    states = np.array([rng.choice(5, p=t / t.sum()) for t in target.astype(np.float64)])
    patch = b[states] + s[states] * rng.standard_normal(len(states))
    rows = []
    for low in np.arange(0.05, 0.35, 0.05):
        inside = (sigma >= low) & (sigma < low + 0.05)
        if inside.sum() >= 20:
            rows.append({"sigma_low": round(float(low), 2), "pictures": int(inside.sum()), "mean_sigma": float(sigma[inside].mean()),
                         "rms_patch_error": float(np.sqrt(np.mean((patch - mu)[inside] ** 2))),
                         "rms_mean_error": float(np.sqrt(np.mean((target @ b - mu)[inside] ** 2)))})
    z = np.abs(patch - mu) / sigma
    return rows, {"patch_within_1_sigma": float((z < 1).mean()), "patch_within_1.645_sigma": float((z < 1.645).mean())}


def plot_reliability(rows, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axis = plt.subplots(figsize=(4.4, 4))
    x = [r["mean_sigma"] for r in rows]
    axis.plot([0, 0.35], [0, 0.35], "k--", label="calibrated")
    axis.plot(x, [r["rms_patch_error"] for r in rows], "o-", color="#1f77b4", label="error to a contact patch")
    axis.plot(x, [r["rms_mean_error"] for r in rows], "o-", color="0.6", label="error to the picture's mean")
    axis.set(xlabel="sigma", ylabel="rms error of mu", xlim=(0, 0.35), ylim=(0, 0.35))
    axis.legend()
    figure.tight_layout()
    figure.savefig(path, dpi=110)


def table(args):
    out = Path(args.out)
    out.mkdir(parents=True, exist_ok=True)
    data = Renders(args.photographs, args.split, 224, args.count, TEST_SEED[args.split], outliers=False, procedural_share=0.0)
    items = [data.picture(i) for i in range(args.count)]
    tensors = [to_tensor(p) for p, *_ in items]
    target = np.stack([f for _, f, *_ in items])
    material = np.array([m for *_, m in items])
    truth = target @ BASIS.numpy()
    photographs = load_photographs(args.photographs, args.split, list(ROADS))
    result = {"split": args.split, "pictures": args.count, "constant_predictor_rmse": float(truth.std()), "backbones": {}}
    columns = {"material": material, "mu_true": truth.round(4)}
    for path in args.models:
        name = Path(path).stem.removeprefix("road_")
        run = session(path)
        p = predict(run, tensors)
        mu, sigma = mixture(p)
        net = build(name)
        p50, p99, cpu = latency(run)
        pure = target.max(1) > 0.99
        rmse = lambda keep: float(np.sqrt(np.mean((mu - truth)[keep] ** 2)))  # noqa: E731
        rows, coverage = reliability(mu, sigma, target, np.random.default_rng(7))
        result["backbones"][name] = {
            "parameters_million": sum(w.numel() for w in net.parameters()) / 1e6, "gflop": flops(net) / 1e9,
            "rmse": rmse(slice(None)), "rmse_pure": rmse(pure), "rmse_mixtures": rmse(~pure),
            "rmse_by_material": {m: rmse(material == m) for m in sorted(set(material))},
            "accuracy_pure": float((p.argmax(1) == target.argmax(1))[pure].mean()),
            "confusion_pure": [[int(((target.argmax(1) == i) & (p.argmax(1) == j) & pure).sum()) for j in range(5)] for i in range(5)],
            "latency_ms_p50": p50, "latency_ms_p99": p99, "latency_ms_cpu": cpu, "raw_dry": raw_dry(run, photographs),
            "reliability": rows, "coverage": coverage}
        columns[f"mu_{name}"], columns[f"sigma_{name}"] = mu.round(4), sigma.round(4)
        if name == "mobilenet_v3_small":
            plot_reliability(rows, out / "reliability.png")
    (out / f"table_{args.split}.json").write_text(json.dumps(result, indent=1) + "\n")
    with open(out / f"predictions_{args.split}.csv", "w", newline="") as f:
        writer = csv.writer(f)
        writer.writerow(columns)
        writer.writerows(zip(*columns.values()))
    for name, r in result["backbones"].items():
        print(f"{name}: {r['parameters_million']:.2f} M, {r['gflop']:.2f} GFLOP, RMSE {r['rmse']:.3f} "
              f"(constant {result['constant_predictor_rmse']:.3f}; pure {r['rmse_pure']:.3f}, mixtures {r['rmse_mixtures']:.3f}), "
              f"{r['latency_ms_p50']:.2f} / {r['latency_ms_p99']:.2f} ms, CPU {r['latency_ms_cpu']:.2f} ms")
        print("   raw dry:", {k: round(v["share_above_0.7"], 3) for k, v in r["raw_dry"].items()}, r["coverage"])


def pictures(args):
    """Files by family: `honest_render`, `raw_<surface>` (untouched), `seen_<family>`, `unseen_<family>`."""
    out = Path(args.out)
    names = json.loads(SPLIT_FILE.read_text())
    photographs = load_photographs(args.photographs, args.split, (*ROADS, *OUTLIERS, *UNSEEN_OUTLIERS))
    for folder in ROADS:
        (out / f"raw_{folder}").mkdir(parents=True, exist_ok=True)
        for name in names[folder][args.split]:
            (out / f"raw_{folder}" / name).write_bytes((Path(args.photographs) / folder / name).read_bytes())
    bank = Bank(BANK_SEEDS[args.split])
    data = Renders(args.photographs, args.split, 224, 10**6, PICTURE_SEED[args.split], outliers=False, procedural_share=0.0)
    groups = {"seen": degradations.SEEN}
    if args.split == "test":  # the families kept for the test are not looked at before it
        groups["unseen"] = degradations.UNSEEN
    index = 0

    def save(family, picture, k):
        (out / family).mkdir(parents=True, exist_ok=True)
        cv2.imwrite(str(out / family / f"{k:03}.png"), picture[:, :, ::-1])

    for k in range(4 * args.count):
        save("honest_render", data.picture(index)[0], k)
        index += 1
    for group, families in groups.items():
        for name, family in families.items():
            for k in range(args.count):
                road = data.picture(index)[0]
                index += 1
                save(f"{group}_{name}", family(np.random.default_rng((PICTURE_SEED[args.split], index)), bank, road, photographs), k)
    (out / "unseen_truncated_jpeg").mkdir(exist_ok=True)
    for k in range(args.count):
        data_bytes = cv2.imencode(".jpg", data.picture(index)[0][:, :, ::-1])[1].tobytes()
        index += 1
        (out / "unseen_truncated_jpeg" / f"{k:03}.jpg").write_bytes(data_bytes[: int(len(data_bytes) * (0.2 + 0.75 * k / args.count))])


def gates(args):
    families = {}
    for row in csv.DictReader(open(args.readings)):
        families.setdefault(row["family"], []).append(row)
    table_rows = []
    for family, rows in sorted(families.items()):
        read = [r for r in rows if r["reason"] == ""]
        mean = lambda key: round(float(np.mean([float(r[key]) for r in read])), 3) if read else ""  # noqa: E731
        reasons = {}
        for r in rows:
            if r["reason"]:
                reasons[r["reason"]] = reasons.get(r["reason"], 0) + 1
        table_rows.append({"family": family, "pictures": len(rows), "refused": round(1 - len(read) / len(rows), 3),
                           "mu_of_the_rest": mean("mu"), "sigma_of_the_rest": mean("sigma"),
                           "rest_below_0.7": round(float(np.mean([float(r["mu"]) < 0.7 for r in read])), 3) if read else "",
                           "reasons": " ".join(f"{k}:{v}" for k, v in sorted(reasons.items()))})
    with open(args.out, "w", newline="") as f:
        writer = csv.DictWriter(f, table_rows[0])
        writer.writeheader()
        writer.writerows(table_rows)
    for r in table_rows:
        print(" ".join(str(v) for v in r.values()))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True)
    for name, function in (("table", table), ("pictures", pictures)):
        command = commands.add_parser(name)
        command.set_defaults(run=function)
        command.add_argument("photographs")
        command.add_argument("--split", default="test", choices=("val", "test"))
        command.add_argument("--out", required=True)
        command.add_argument("--count", type=int, default=2000 if name == "table" else 60)
        if name == "table":
            command.add_argument("--models", nargs="+", required=True)
    command = commands.add_parser("gates")
    command.set_defaults(run=gates)
    command.add_argument("readings")
    command.add_argument("--out", required=True)
    args = parser.parse_args()
    torch.set_num_threads(1)
    args.run(args)


if __name__ == "__main__":
    main()
