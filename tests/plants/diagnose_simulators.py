#!/usr/bin/env python3
"""Makes pairs of car and simulator from a table, diagnoses them, and writes what was said beside what was true.

    diagnose_simulators.py GRIPSIGHT OUT --table NAME [--checkout PATH] [--seeds N] [--duration S] [--smooth]

The tables are below. Pairs whose changes are drawn and sealed: `gripsight withheld make --simulators`. A pair that is done is not done again: the
run can be stopped and resumed. Packages: see make_simulator_pairs.py.
"""

import argparse
import csv
import itertools
import json
import math
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

MAKER = Path(__file__).resolve().parent / "make_simulator_pairs.py"

# What a drive without longitudinal forces cannot tell apart, by each simulator's own equations.
GROUPS = {
    "f1tenth_gym": [{"m", "I"}, {"steer_buffer_size", "delay_s"}],
    "slipx": [{"mass", "izz"}],
}
AROUND = {"delay_s": "steering_delay", "gain": "steering_gain", "offset_rad": "steering_offset", "x_m": "v_y_lever_arm", "scale": "gyro_scale"}
GYM = {"steer_buffer_size": 8, "C_Sf": 3.7744, "m": 3.47, "sv_max": 1.5}
TABLES = {
    "f1tenth_gym": [
        *(("f1tenth_gym", {name: value}) for name, value in GYM.items()),
        *(("f1tenth_gym", dict(two)) for two in itertools.combinations(GYM.items(), 2)),
    ],
    "gain": [("f1tenth_gym", {"gain": -0.5}), ("f1tenth_gym", {"gain": -0.5, "C_Sf": 3.7744})],
    "others": [
        ("slipx", {"tyre_front.mu_y0": 0.9}), ("slipx", {"izz": 0.065}), ("slipx", {"x_m": -0.16}), ("slipx", {}),
        ("commonroad_st", {"tire.p_ky1": -17.0}), ("commonroad_st", {"I_z": 2200.0}), ("commonroad_st", {"delay_s": 0.05}),
        ("commonroad_std", {"tire.p_dy1": 0.85}), ("simple_planning", {"steer_time_delay": 0.15}),
        ("simple_planning", {"steer_time_constant": 0.4}), ("simple_planning", {}),
    ],
}


def truth_name(name):
    return AROUND.get(name, f"simulator.{name}")


def alike(kind, a, b):
    bare = lambda n: n.removeprefix("simulator.")
    a, b = bare(a), bare(b)
    group = [set(map(lambda n: AROUND.get(n, n), g)) for g in GROUPS.get(kind, [])]
    return a == b or any(a in g and b in g for g in group)


def wilson(right, count):
    """A rate with its 90 % interval."""
    if not count:
        return "none"
    z, p = 1.645, right / count
    middle, half = p + z * z / (2 * count), z * math.sqrt(p * (1 - p) / count + z * z / (4 * count * count))
    low, high = ((middle + s * half) / (1 + z * z / count) for s in (-1, 1))
    return f"{right} of {count} ({100 * p:.0f} %, {100 * low:.0f} to {100 * high:.0f})"


def run(gripsight, folder, kind, changes, seed, arguments):
    """Makes and diagnoses one pair; the result as a row."""
    row = folder / "row.json"
    if row.exists():
        return json.loads(row.read_text())
    make = [sys.executable, str(MAKER), str(folder), kind, *(f"{k}={v}" for k, v in changes.items()), "--seed", str(seed),
            "--duration", str(arguments.duration), "--checkout", str(Path(arguments.checkout).resolve())]
    if arguments.smooth:
        make.append("--smooth")
    made = json.loads(subprocess.run(make, check=True, stdout=subprocess.PIPE).stdout)
    file = folder / "simulator.yaml"
    file.write_text(file.read_text() + f"python: '{sys.executable}'\ntime_limit_s: 600\n")
    start = time.time()
    said = subprocess.run([gripsight, "diagnose", str(folder / "bag.mcap"), "--simulator", str(file), "--out", str(folder / "result")],
                          capture_output=True, text=True)
    wall_s = time.time() - start
    if said.returncode not in (0, 3):
        print(said.stderr, file=sys.stderr)
        return dict(simulator=kind, truth="; ".join(changes), seed=seed, verdict="error")
    gap = json.loads((folder / "result/gap.json").read_text())
    timing = json.loads((folder / "result/timing.json").read_text())
    named = [e for e in gap["effects"] if e["accepted"]]
    right, inside, errors = [], [], []
    for name, value in changes.items():
        found = [e for e in named if alike(kind, e["name"], truth_name(name))
                 or any(alike(kind, c, truth_name(name)) for c in e["confused_with"])]
        right.append(bool(found))
        exact = [e for e in named if e["name"] == truth_name(name)]
        if exact:
            (p,) = exact[0]["parameters"].values()
            inside.append(p["low"] <= value <= p["high"])
            errors.append((p["value"] - value) / abs(value))
    out = dict(
        simulator=kind, truth="; ".join(f"{k}={v:.4g}" for k, v in changes.items()) or "unchanged",
        severity=min((c["severity"] for c in made["changes"].values()), default=math.nan), seed=seed, verdict=gap["verdict"], first_right=bool(named) and any(
            alike(kind, n, truth_name(t)) for t in changes for n in [named[0]["name"], *named[0]["confused_with"]]),
        named="; ".join(f"{e['name']}={next(iter(e['parameters'].values()))['value']:.4g}" for e in named),
        not_told_from="; ".join(n for e in named for n in e["confused_with"]),
        all_right=all(right) if changes else not named, extra=max(0, len(named) - len(changes)), inside=f"{sum(inside)}/{len(inside)}",
        size_error=max((abs(e) for e in errors), default=math.nan), nominal=gap["gap"]["nominal"]["value"], after=gap["gap"]["after"]["value"],
        patched=gap["patch"]["verified"], rollouts=gap["simulator"]["rollouts"], candidates=gap["simulator"]["candidates"], wall_s=wall_s,
        diagnosing_s=timing["diagnosing_s"], simulator_s=timing["simulator_s"])
    row.write_text(json.dumps(out))
    return out


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("gripsight")
    parser.add_argument("out", type=Path)
    parser.add_argument("--table", choices=TABLES, required=True)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--duration", type=float, default=40.0)
    parser.add_argument("--checkout", default="f1tenth_gym")
    parser.add_argument("--smooth", action="store_true")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    # Seed by seed: a run that is stopped has something of every row.
    cases = [(k, c, s) for s in range(1, arguments.seeds + 1) for k, c in TABLES[arguments.table]]
    rows = []
    for i, (kind, changes, seed) in enumerate(cases):
        row = run(arguments.gripsight, arguments.out / f"pair_{i:03}", kind, changes, seed, arguments)
        rows.append(row)
        print(*(f"{v:.3g}" if isinstance(v, float) else v for v in row.values()), sep=" | ", flush=True)
    keys = list(max(rows, key=len))
    with open(arguments.out / "pairs.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, keys)
        writer.writeheader()
        writer.writerows(rows)
    done = [r for r in rows if r["verdict"] != "error"]
    of = lambda truth: [r for r in done if r["truth"] == truth]
    changed = [r for r in done if r["truth"] != "unchanged"]
    inside = [tuple(map(int, r["inside"].split("/"))) for r in changed]
    patched = sorted(r["patched"] for r in changed if r["patched"] is not None)
    print("errors:", len(rows) - len(done))
    print("first name right:", wilson(sum(r["first_right"] for r in changed), len(changed)))
    print("all changes right:", wilson(sum(r["all_right"] for r in changed), len(changed)))
    print("false alarms:", wilson(sum(not r["all_right"] for r in of("unchanged")), len(of("unchanged"))))
    print("90 % intervals hold:", wilson(sum(a for a, _ in inside), sum(b for _, b in inside)))
    for kind in dict.fromkeys(r["simulator"] for r in done):
        of_it = [r for r in done if r["simulator"] == kind]
        rollouts, whole_s, simulator_s = (sum(r[k] for r in of_it) for k in ("rollouts", "diagnosing_s", "simulator_s"))
        print(f"{kind}: {max(r['rollouts'] for r in of_it):.0f} rollouts at most, {rollouts / simulator_s:.2f} of {arguments.duration:g} s a second; "
              f"{100 * simulator_s / whole_s:.0f} % of the time is the simulator's")
    print("patched, times the noise:", f"median {np.median(patched):.3g}, most {patched[-1]:.3g}, of {len(patched)}" if patched else "none")


if __name__ == "__main__":
    main()
