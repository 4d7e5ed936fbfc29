#!/usr/bin/env python3
"""What posterior.json is worth: the stiffness of the car's own tires beside that of the plant's, and how often its interval holds it.

    own_tires.py GRIPSIGHT OUT [--seed 601] [--drives 8] > own_tires.csv

Drives of 40 s of the reference car, every background effect on (`gripsight simulate --realistic`): its four cars, each on three tracks in turn at four paces;
then `gripsight identify`. True stiffness: least squares of an axle's true force over its load on the mean of its two wheels' true slips, 0.003 to 0.02 rad. What is
left of OUT from a run that was broken off is used. The rates go to standard error.
"""

import argparse
import csv
import json
import math
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

CARS = ("f1tenth", "formula_student", "race_car", "passenger_car")
TRACKS = ("club", "plateau", "marsh")
PACES = (0.7, 0.8, 0.88, 0.94)
AXLES = {"front": ("fl", "fr"), "rear": ("rl", "rr")}
SMALL_SLIP_RAD = (0.003, 0.02)
HALF_WIDTH_90 = 1.645


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("gripsight", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, default=601)
    parser.add_argument("--drives", type=int, default=8)
    args = parser.parse_args()
    asked = [(car, args.seed + k) for car in CARS for k in range(args.drives)]
    with ThreadPoolExecutor(2) as pool:
        drives = pool.map(lambda drive: rows_of(args, *drive), ((n, *drive) for n, drive in enumerate(asked, 1)))
        rows = [row for drive in drives for row in drive]
    out = csv.DictWriter(sys.stdout, rows[0].keys(), lineterminator="\n")
    out.writeheader()
    out.writerows(rows)
    for car in (*CARS, ""):
        told = [row for row in rows if row["car"].startswith(car)]
        errors = [row["stiffness"] / row["true"] - 1 for row in told]
        inside = sum(abs(row["stiffness"] - row["true"]) < HALF_WIDTH_90 * row["sigma"] for row in told)
        rms = math.sqrt(sum(e * e for e in errors) / len(errors))
        print(
            f"{car or 'all'}: {len(told)} axles, mean {sum(errors) / len(errors):+.3f}, rms {rms:.3f}, most {max(map(abs, errors)):.3f}, "
            f"in the 90 % interval {inside}",
            file=sys.stderr,
        )


def rows_of(args, number, car, seed):
    folder = args.out / f"{car}_{seed}"
    folder.mkdir(parents=True, exist_ok=True)
    bag, vehicle, found = folder / "drive.mcap", folder / "drive.vehicle.yaml", folder / "identified"
    track, pace = TRACKS[number % len(TRACKS)], PACES[number % len(PACES)]
    if not bag.exists():
        options = ["--car", car, "--realistic", "--track", track, "--pace", pace, "--duration", 40, "--seed", seed]
        run(args.gripsight, "simulate", *options, "--out", bag)
    if not (found / "posterior.json").exists():
        run(args.gripsight, "identify", bag, "--vehicle", vehicle, "--out", found)
    told = found / "posterior.json"
    if not told.exists():
        print(f"{folder}: no posterior", file=sys.stderr)
        return []
    posterior = json.loads(told.read_text(encoding="utf-8"))
    names = [p["name"] for p in posterior["parameters"]]
    rows = []
    for axle, true in true_stiffness(folder / "drive.truth.csv").items():
        i = names.index(f"{axle}.stiffness")
        mean, sigma = posterior["parameters"][i]["mean"], math.sqrt(posterior["covariance"][i][i])
        drive = {"car": car, "seed": seed, "track": track, "pace": pace, "status": posterior["status"], "axle": axle}
        rows.append(drive | {"true": round(true, 3), "stiffness": round(mean, 3), "sigma": round(sigma, 3)})
    return rows


def run(*command):
    # What a drive ends by (a spin, a refused set) is told by the files that it leaves.
    subprocess.run([str(c) for c in command], check=False, capture_output=True, timeout=300)


def true_stiffness(path):
    sums = {axle: [0.0, 0.0] for axle in AXLES}
    with open(path, newline="", encoding="utf-8") as table:
        for row in csv.DictReader(table):
            for axle, (left, right) in AXLES.items():
                slip = sum(float(row[f"slip_angle_{wheel}_rad"]) for wheel in (left, right)) / 2
                if SMALL_SLIP_RAD[0] < abs(slip) < SMALL_SLIP_RAD[1]:
                    sums[axle][0] += float(row[f"f_y_{axle}_n"]) / float(row[f"f_z_{axle}_n"]) * slip
                    sums[axle][1] += slip * slip
    return {axle: product / square for axle, (product, square) in sums.items()}


if __name__ == "__main__":
    main()
