#!/usr/bin/env python3
"""The chance that an effect which is left in the model is a cause: fits the coefficients `CHANCE`, `MOST_SURE` and `RIVAL_LEAVES` of
nodes/lib/diagnosis/src/decisions.rs on development cases whose labels are open, scores every batch by a fit on the others, and writes
development_effects.csv. Needs NumPy.

    fit_chance.py LABELS VERDICTS [LABELS VERDICTS ...]      LABELS of `gripsight withheld make`, VERDICTS of `gripsight withheld diagnose`
    fit_chance.py                                            on development_effects.csv

Effects that are small beside what of the unexplained looks like them (`LEAST_OVER_UNEXPLAINED`) are in the table and not in the fit: the verdict
names none of them. A cause is an effect that was put in, or that the plant contains by its equations. Recorded cars' own effects nobody knows: they are left out.
"""

import csv
import json
import sys
from pathlib import Path

import numpy as np

TABLE = Path(__file__).with_name("development_effects.csv")
HEAD = ["batch", "case", "kind", "effect", "cause", "needed_fraction", "size_over_half_width", "over_unexplained", "untried"]
# Size over half width at which it counts nothing, and what is as good as nothing.
UNIT = 2.5
LEAST = 0.1
RIDGE = 0.1
# Standard deviations in half the width of a 90 % interval.
HALF_WIDTH = 1.645
# Chance from which the verdict names an effect.
NAMED = 2 / 3
LEAST_OVER_UNEXPLAINED = 0.5


def collected(batches):
    for labels, verdicts in batches:
        for case in json.loads(Path(labels).read_text())["cases"]:
            path = Path(verdicts) / case["case"] / "gap.json"
            if case["family"] == "recorded" or not path.exists():
                continue
            causes = {e["name"] for e in case["effects"]} | set(case["contained"])
            for effect in json.loads(path.read_text()).get("effects", []):
                if effect["needed_fraction"] is None:
                    continue
                over = effect["over_unexplained"]
                signs = [effect["needed_fraction"], effect["size_over_half_width"], 1e3 if over is None else over]
                name = Path(labels).stem
                untried = len(set(effect["confused_with"]) & set(case["without"]))
                yield [name, case["case"], case["kind"], effect["name"], int(effect["name"] in causes), *(f"{s:.4g}" for s in signs), untried]


def signs(rows):
    size = np.array([float(row[6]) for row in rows])
    return np.column_stack([np.ones(len(rows)), np.log(np.maximum(size, LEAST) / UNIT)])


def chances(x, model):
    most, weights = model
    return most / (1 + np.exp(-x @ weights))


def log_loss(chance, cause):
    return -np.mean(np.log(np.where(cause > 0, chance, 1 - chance)))


def fitted(x, cause):
    """The likeliest coefficients, and the chance of an effect whose size is as sure as can be: another cause, which the library does not have, may look like it."""

    def beneath(most):
        weights = np.zeros(x.shape[1])
        for _ in range(100):
            chance = chances(x, (most, weights))
            slope = chance * (1 - chance / most)
            spread = chance * (1 - chance)
            curvature = x.T @ (x * (slope**2 / spread)[:, None]) + RIDGE * np.eye(len(weights))
            weights = weights + np.linalg.solve(curvature, x.T @ (slope / spread * (cause - chance)) - RIDGE * weights)
        return most, weights

    models = [beneath(most) for most in np.arange(0.85, 0.9951, 0.005)]
    return min(models, key=lambda model: log_loss(chances(x, model), cause))


def told(name, chance, cause):
    named = chance >= NAMED
    print(f"{name}: {len(cause)} effects, {int(cause.sum())} causes; named {int((named & (cause > 0)).sum())}, "
          f"not causes {int((named & (cause == 0)).sum())}; log loss {log_loss(chance, cause):.3f}")
    for low, high in [(0, 0.2), (0.2, 0.5), (0.5, 0.8), (0.8, 0.95), (0.95, 1.01)]:
        inside = (chance >= low) & (chance < high)
        if inside.any():
            print(f"    {low:.2f} to {min(high, 1.0):.2f}: {int(inside.sum())}, of these causes {np.mean(cause[inside]):.2f}")


def rival_leaves(rows, model):
    """The share of an effect that a cause which is not among the candidates and does nearly the same leaves unexplained: the likeliest, and where its 90 %
    interval begins. An effect beside such a rival has its chance, shared with it as `unasked` in decisions.rs says."""
    rows = [row for row in rows if int(row[8]) > 0]
    alone = chances(signs(rows), model)
    cause = np.array([float(row[4]) for row in rows])
    size, unexplained, untried = (np.array([float(row[i]) for row in rows]) for i in (6, 7, 8))
    shares = np.arange(0.0, 0.5, 0.005)
    losses = []
    for share in shares:
        log_ratio = -0.5 * (HALF_WIDTH * size) ** 2 * share * (share - 2 / unexplained)
        chance = alone / (1 + untried * np.exp(np.minimum(log_ratio, 0)))
        losses.append(-np.sum(np.log(np.where(cause > 0, chance, 1 - chance))))
    losses = np.array(losses)
    within = shares[losses <= losses.min() + 0.5 * HALF_WIDTH**2]
    print(f"RIVAL_LEAVES: {within[0]:.3f} (likeliest {shares[losses.argmin()]:.3f}), {len(rows)} effects with such a rival, {int(cause.sum())} causes")


def main():
    if len(sys.argv) > 1:
        rows = list(collected(zip(sys.argv[1::2], sys.argv[2::2])))
        with TABLE.open("w", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([HEAD, *rows])
    all_rows = [row for row in list(csv.reader(TABLE.open()))[1:] if float(row[7]) >= LEAST_OVER_UNEXPLAINED]
    # A rival that is not among the candidates may be the cause: what it takes is fitted by itself.
    rows = [row for row in all_rows if int(row[8]) == 0]
    x, cause = signs(rows), np.array([float(row[4]) for row in rows])
    batch = np.array([row[0] for row in rows])
    for name in sorted(set(batch)):
        own = batch == name
        told(f"{name}, by a fit on the others", chances(x[own], fitted(x[~own], cause[~own])), cause[own])
    model = fitted(x, cause)
    told("all, by their own fit", chances(x, model), cause)
    rival_leaves(all_rows, model)
    print(f"MOST_SURE: {model[0]:.3f}\nCHANCE:", ", ".join(f"{w:.2f}" for w in model[1]))


if __name__ == "__main__":
    main()
