#!/usr/bin/env python3
"""The chance that an effect found is the cause: fits the coefficients of nodes/lib/diagnosis/src/confidence.rs on development_claims.csv, and scores
every track with a fit on the others. Needs NumPy and scikit-learn.

    fit_chance.py
"""

import csv
from collections import defaultdict
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import log_loss, roc_auc_score

SIGNS = ["ln_share", "ln_drift", "twins", "untried_own_room_steps", "tire_shift", "along", "doubtful_beside"]
# From this share of what an effect explains another one beside it counts in full.
COUNTS = 0.1
# The chances that the doubt about others rests on are those of the same fit: it settles within a few rounds.
ROUNDS = 6


def signs(row):
    number = {name: float(row[name]) for name in row if name not in ("batch_track", "case", "kind", "effect")}
    steps = np.clip((number["left_in_its_room"] - 0.02) / 0.03, 0.0, 3.0)
    return [
        np.log(number["left"] / number["explained"] + 0.01),
        np.log(number["drift"] + 0.05),
        number["twins"],
        steps if number["untried"] else 0.0,
        min(number["tire_shift"], 4.0),
        number["along"],
    ]


def doubtful_beside(rows, alone):
    cases = defaultdict(list)
    for i, row in enumerate(rows):
        cases[row["batch_track"], row["case"]].append(i)
    explained = [float(row["explained"]) for row in rows]
    doubt = np.zeros(len(rows))
    for found in cases.values():
        for i in found:
            doubt[i] = sum((1 - alone[j]) * min(1.0, explained[j] / explained[i] / COUNTS) for j in found if j != i)
    return doubt


def fitted(rows, table, cause, which):
    """Coefficients, the constant and all chances of a fit to the rows of `which`."""
    doubt = np.zeros(len(rows))
    for _ in range(ROUNDS):
        full = np.column_stack([table, doubt])
        mean, scale = full[which].mean(0), full[which].std(0) + 1e-9
        model = LogisticRegression(C=1.0, max_iter=3000).fit((full[which] - mean) / scale, cause[which])
        per_sign = model.coef_[0] / scale
        constant = model.intercept_[0] - per_sign @ mean
        chance = lambda beside: 1 / (1 + np.exp(-(np.column_stack([table, beside]) @ per_sign + constant)))
        doubt = doubtful_beside(rows, chance(np.zeros(len(rows))))
    return per_sign, constant, chance(doubt)


def main():
    with open(Path(__file__).with_name("development_claims.csv"), newline="") as file:
        rows = list(csv.DictReader(file))
    table = np.array([signs(row) for row in rows])
    cause = np.array([row["cause"] == "1" for row in rows])
    track = np.array([row["batch_track"] for row in rows])
    chance = np.zeros(len(rows))
    for name in sorted(set(track)):
        here = track == name
        chance[here] = fitted(rows, table, cause, ~here)[2][here]
    per_sign, constant, _ = fitted(rows, table, cause, np.full(len(rows), True))
    print(f"{len(rows)} effects found, {cause.sum()} causes, {len(set(track))} tracks")
    for name, value in zip(SIGNS, per_sign):
        print(f"{name} {value:.2f}")
    nothing = constant + per_sign[0] * np.log(0.01) + per_sign[1] * np.log(0.05)
    print(f"constant {constant:.2f}, odds where nothing speaks against it {nothing:.2f}")
    print(f"by track: area under the curve {roc_auc_score(cause, chance):.3f}, log loss {log_loss(cause, chance):.3f}, "
          f"causes at even odds or more {(chance[cause] >= 0.5).sum()} of {cause.sum()}, "
          f"others {(chance[~cause] >= 0.5).sum()} of {(~cause).sum()}")


if __name__ == "__main__":
    main()
