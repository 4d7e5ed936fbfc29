#!/usr/bin/env python3
"""What fits find of each effect in cars that have none of it: whatever the model lacks may look like it. Finds the standard deviation, in sizes that
matter, with which 9 of 10 drives without the effect lie inside 90 % intervals around nothing; writes development_spread.csv. `spread` in the
effects' files (nodes/lib/model/src/effects) is the larger of an effect's parameters.

    fit_spread.py LABELS VERDICTS [LABELS VERDICTS ...]      LABELS of `gripsight withheld make`, VERDICTS of `gripsight withheld diagnose`

Beneath each: the mean of what is found, by car. A sign that a car always has is something that the model lacks.
Counted are drives whose cause the library has: where it lacks it, something must look like it.
"""

import csv
import json
import math
import statistics
import sys
from pathlib import Path

TABLE = Path(__file__).with_name("development_spread.csv")
HEAD = ["effect", "parameter", "drives", "standard_error", "spread"]
INSIDE = 0.9
NINETY = 1.645
# Drives from which a quantile tells something: effects whose derivative vanishes where they are absent have fewer.
LEAST_DRIVES = 20
# Errors of the model that all effects have, in sizes that matter: SHARED_ERROR of nodes/lib/diagnosis/src/decisions.rs.
SHARED = 0.04


def found(batches):
    """For each parameter: values where its effect is not, their standard errors, in sizes that matter, and the car."""
    out = {}
    for labels, verdicts in batches:
        for case in json.loads(Path(labels).read_text())["cases"]:
            path = Path(verdicts) / case["case"] / "gap.json"
            if case["kind"] in ("deleted", "out_of_library") or case["family"] == "recorded" or not path.exists():
                continue
            causes = {e["name"] for e in case["effects"]} | set(case["contained"])
            for limit in json.loads(path.read_text()).get("detection_limits", []):
                if limit["name"] in causes or limit["value"] is None or limit["standard_error"] is None:
                    continue
                null = 1.0 if limit["parameter"] == "ratio" else 0.0
                of = (limit["value"] - null, limit["standard_error"])
                car = str(case["circumstances"].get("car")).rstrip("_0123456789")
                found_here = [*(v / limit["matters"] for v in of), car]
                out.setdefault((limit["name"], limit["parameter"]), []).append(found_here)
    return out


def quantile(values, at):
    values = sorted(values)
    return values[min(len(values) - 1, int(at * len(values)))]


def spread(sizes):
    def outside(more):
        return quantile([abs(v) / math.hypot(s, SHARED, more) for v, s, _ in sizes], INSIDE) > NINETY

    low, high = 0.0, 8.0
    if not outside(low):
        return 0.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if outside(middle) else (low, middle)
    return high


def by_car(sizes):
    for car in sorted({car for *_, car in sizes}):
        values = [v for v, _, own in sizes if own == car]
        if len(values) > 1:
            error = statistics.stdev(values) / math.sqrt(len(values))
            yield f"{car} {statistics.mean(values):.2f} ± {error:.2f}"


def main():
    rows, means = [], []
    for (effect, parameter), sizes in sorted(found(zip(sys.argv[1::2], sys.argv[2::2])).items()):
        error = quantile([s for _, s, _ in sizes], 0.5)
        rows.append([effect, parameter, len(sizes), f"{error:.3f}", f"{spread(sizes) if len(sizes) >= LEAST_DRIVES else 0.0:.2f}"])
        means.append(", ".join(by_car(sizes)))
    with TABLE.open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([HEAD, *rows])
    for row, mean in zip(rows, means):
        print(f"{row[0]:28s}{row[1]:18s}{row[2]:5d} drives, standard error {row[3]}, spread {row[4]}")
        print(f"    mean by car: {mean}")


if __name__ == "__main__":
    main()
