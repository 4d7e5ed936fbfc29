#!/usr/bin/env python3
"""The chance that an effect found is the cause: fits the coefficients of nodes/lib/gap/src/confidence.rs on development_claims.csv, and scores
every track with a fit on the others. Needs NumPy and scikit-learn.

    fit_chance.py
"""

import csv
from pathlib import Path

import numpy as np
from sklearn.linear_model import LogisticRegression
from sklearn.metrics import roc_auc_score

SIGNS = ["ln_share", "drift_term", "own_room_steps", "large", "twins", "untried_own_room_steps"]


def main():
    with open(Path(__file__).with_name("development_claims.csv"), newline="") as file:
        rows = list(csv.DictReader(file))
    signs = np.array([[float(row[name]) for name in SIGNS] for row in rows])
    cause = np.array([row["cause"] == "1" for row in rows])
    track = np.array([row["batch_track"] for row in rows])
    mean, scale = signs.mean(0), signs.std(0)
    scaled = (signs - mean) / scale

    def fitted(which):
        return LogisticRegression(C=1.0, max_iter=2000).fit(scaled[which], cause[which])

    chance = np.zeros(len(rows))
    for name in sorted(set(track)):
        here = track == name
        chance[here] = fitted(~here).predict_proba(scaled[here])[:, 1]
    model = fitted(np.full(len(rows), True))
    per_sign = model.coef_[0] / scale
    print(f"{len(rows)} effects found, {cause.sum()} causes, {len(set(track))} tracks")
    print(f"odds {model.intercept_[0] - per_sign @ mean:.2f}")
    for name, value in zip(SIGNS, per_sign):
        print(f"{name} {value:.2f}")
    print(f"by track: area under the curve {roc_auc_score(cause, chance):.3f}, causes at even odds or more "
          f"{(chance[cause] >= 0.5).sum()} of {cause.sum()}, others {(chance[~cause] >= 0.5).sum()} of {(~cause).sum()}")


if __name__ == "__main__":
    main()
