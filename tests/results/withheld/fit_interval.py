#!/usr/bin/env python3
"""The width of a size's interval: picks the constants of nodes/lib/diagnosis/src/sizes.rs on development_sizes.csv, and scores every track with those
picked on the others. Needs Python alone.

    fit_interval.py
"""

import csv
from itertools import product
from math import exp, hypot, log
from pathlib import Path

NINETY = 1.645
# Factor on the standard error, share of the size, share of a size that matters, factor on the drift.
GRID = list(product((1.0, 1.5, 2.0), (0.03, 0.04, 0.06, 0.08), (0.0, 0.02, 0.04, 0.06), (0.0, 0.5, 1.0)))
IN_USE = (1.5, 0.04, 0.04, 1.0)
FORMER = (2.0, 0.08, 0.0, 0.0)
PARTS = {
    "small": lambda row: row["size"] < 0.5 * row["unit"],
    "large": lambda row: row["size"] >= row["unit"],
    "told well": lambda row: row["error"] < 0.01 * row["size"],
    "told badly": lambda row: row["error"] >= 0.03 * row["size"],
    "drifting": lambda row: row["drift"] > 0.1,
    "of pairs": lambda row: row["kind"] == "pair",
}


def half(rule, row):
    error, share, unit, drift = rule
    return NINETY * hypot(error * row["error"], share * row["size"], unit * row["unit"], drift * row["drift"] * row["size"])


def coverage(rule, rows):
    return sum(row["distance"] <= half(rule, row) for row in rows) / len(rows)


def width(rule, rows):
    """Median-like half width over size."""
    return exp(sum(log(half(rule, row) / row["size"]) for row in rows) / len(rows))


def pick(rows):
    """Of the rules that cover nine of ten, the one that covers all parts most alike, and then the narrowest."""
    parts = [[row for row in rows if part(row)] for part in PARTS.values()]
    def uneven(rule):
        return sum((coverage(rule, part) - 0.9) ** 2 for part in parts if part) + 0.02 * log(width(rule, rows))
    return min((rule for rule in GRID if 0.89 <= coverage(rule, rows) <= 0.93), key=uneven, default=IN_USE)


def main():
    with open(Path(__file__).with_name("development_sizes.csv"), newline="") as file:
        rows = [{k: v if k in ("batch_track", "kind", "effect", "parameter") else float(v) for k, v in row.items()} for row in csv.DictReader(file)]
    for name, rule in (("in use", IN_USE), ("before", FORMER), ("picked on all", pick(rows))):
        parts = ", ".join(f"{part} {100 * coverage(rule, own):.0f} %" for part, inside in PARTS.items() if (own := [r for r in rows if inside(r)]))
        print(f"{name} {rule}: {100 * coverage(rule, rows):.1f} % of {len(rows)}, half width {100 * width(rule, rows):.0f} % of the size; {parts}")
    held = 0
    for track in sorted({row["batch_track"] for row in rows}):
        here = [row for row in rows if row["batch_track"] == track]
        rule = pick([row for row in rows if row["batch_track"] != track])
        held += coverage(rule, here) * len(here)
        print(f"{track}: {100 * coverage(rule, here):.0f} % of {len(here)} with {rule}")
    print(f"by track: {100 * held / len(rows):.1f} %")


if __name__ == "__main__":
    main()
