#!/usr/bin/env python3
"""Diagnoses the drives of plants that this project did not write, and tables what they contain beside what is found.

    diagnose_foreign.py BAGS GRIPSIGHT OUT

BAGS: what make_foreign_bags.py wrote; GRIPSIGHT: the program. Writes OUT/foreign.csv and OUT/foreign.md, a row for every
drive and ranked effect, in the order of the diagnosis.
"""

import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path

HEAD = ["drive", "verdict", "nominal", "retuned", "after", "ceiling", "s4_residual", "rank", "effect", "contained",
        "named", "confidence", "closes", "parameter", "size", "low", "high"]


def number(value, digits=3):
    return "" if value is None else f"{value:.{digits}g}"


def diagnosed(gripsight, folder):
    with tempfile.TemporaryDirectory() as out:
        command = [gripsight, "diagnose", folder / f"{folder.name}.mcap", "--vehicle", folder / "vehicle.yaml", "--out", out]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode not in (0, 3):
            sys.exit(f"{folder.name}: {done.stderr}")
        return json.loads((Path(out) / "gap.json").read_text())


def rows(folder, gap):
    contained = json.loads((folder / "about.json").read_text())["contained"]
    steps = [number(gap["gap"][k]["value"]) for k in ("nominal", "retuned", "after", "unstructured_ceiling", "s4_residual")]
    for rank, effect in enumerate(gap["effects"][:5], 1):
        name, size = next(iter(effect["parameters"].items()))
        yield [folder.name, gap["verdict"], *steps, rank, effect["name"], "yes" if effect["name"] in contained else "no",
               "yes" if effect["accepted"] else "no", number(effect["confidence"], 2),
               number(effect["gap_closed_fraction"]["value"], 2), name, *(number(size[k]) for k in ("value", "low", "high"))]
    if not gap["effects"]:
        yield [folder.name, gap["verdict"], *steps, *[""] * 10]


def main():
    bags, gripsight, out = Path(sys.argv[1]), sys.argv[2], Path(sys.argv[3])
    table = []
    for folder in sorted(p for p in bags.iterdir() if (p / "about.json").exists()):
        table += rows(folder, diagnosed(gripsight, folder))
        print(*table[-1], flush=True)
    out.mkdir(parents=True, exist_ok=True)
    with (out / "foreign.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([HEAD, *table])
    lines = ["# What is found on plants that others wrote", "",
             "Contained: by the plant's equations (`contained` in tests/plants/make_foreign_bags.py). Figures and role: README.md.", ""]
    lines += ["| " + " | ".join(map(str, row)) + " |" for row in [HEAD, ["---"] * len(HEAD), *table]]
    (out / "foreign.md").write_text("\n".join(lines) + "\n")


main()
