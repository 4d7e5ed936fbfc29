#!/usr/bin/env python3
"""What the camera learns from the car's own tires: floors never seen, some of which lie, over four drives each.

    tests/results/camera_prior/learning.py OUT [--bin gripsight] [--drives N]

Every floor is driven by the reference car with pictures of it (`gripsight simulate --camera`), identified (`identify`, without a network in the loop:
the prior is what is looked at), taught (`friction calibrate --results`, all drives so far), and read before the next drive (`friction`), with
what was taught and without. At last one track of all floors: what their first drives taught together, read on the last drives; and what the
others taught, on a floor that was left out. Then the paper's loop runs on the last drive of each floor from three starts: none (mu0), what the network
reads, and what the drives before taught. The truth is the peak force over the load of the car's axles in a slow steering ramp on that floor. OUT keeps
bags and results and is gone on with; learning.csv beside this file receives a row a drive, turns.csv a row a run of the loop.
"""

import argparse
import csv
import json
import statistics
import subprocess
import sys
from pathlib import Path

# Name, friction, friction that it looks like, road (seed of its looks), track or manoeuvre, pace: at the limit, as a driver does who wants to know it. Where
# the road holds more than the car can ask of it on a track it is a slow steering ramp on an open space.
FLOORS = [
    ("asphalt", 0.90, 0.90, 9101, "ramp_steer", 1.00),
    ("damp asphalt", 0.60, 0.60, 9102, "clover", 1.15),
    ("standing water", 0.45, 0.45, 9103, "bean", 1.10),
    ("dark wet asphalt that grips", 0.85, 0.50, 9104, "ramp_steer", 1.00),
    ("ice that looks dry", 0.40, 0.85, 9105, "bean", 1.10),
    ("snow that looks like wet asphalt", 0.30, 0.60, 9106, "esses", 1.10),
]
SECONDS = 25
# What the paper's loop starts from where nothing is known.
MU0 = 0.51


class Floor:
    def __init__(self, args, floor):
        self.bin, self.folder = args.bin, args.out / str(floor[3])
        self.name, self.mu, self.looks, self.road, self.track, self.pace = floor
        self.folder.mkdir(parents=True, exist_ok=True)

    def run(self, *command, may=(0,)):
        done = subprocess.run([self.bin, *map(str, command)], capture_output=True, text=True)
        if done.returncode not in may:
            sys.exit(f"{' '.join(map(str, command))}: {done.stderr}")
        return done.stdout

    def simulate(self, name, *more):
        bag = self.folder / f"{name}.mcap"
        if not bag.exists():
            unfinished = self.folder / f"unfinished_{name}.mcap"
            self.run("simulate", "--realistic", "--mu", self.mu, "--duration", SECONDS, "--out", unfinished, *more)
            for ending in ("vehicle.yaml", "truth.csv", "mcap"):
                unfinished.with_suffix(f".{ending}").rename(bag.with_suffix(f".{ending}"))
        return bag

    def truth(self):
        bag = self.simulate("ramp", "--track", "ramp_steer")
        peaks = [0.0, 0.0]
        with bag.with_suffix(".truth.csv").open() as file:
            for row in csv.DictReader(file):
                for k, axle in enumerate(("front", "rear")):
                    force = abs(float(row[f"f_y_{axle}_n"])) / float(row[f"f_z_{axle}_n"])
                    peaks[k] = max(peaks[k], force)
        # The rear axle of an understeering car does not come to its peak.
        return peaks[0]

    def read(self, bag, *more):
        said = json.loads(self.run("friction", "--json", bag, *more))
        used = [r for r in said if r["valid"]]
        if not used:
            return [float("nan")] * 3
        new = sum(bool(r["new_floor"]) for r in used) / len(used)
        return [statistics.mean(r["mu_hat"] for r in used), statistics.mean(r["sigma"] for r in used), new]

    def drives(self, count):
        truth, taught, file = self.truth(), [], self.folder / "track.json"
        self.lessons = []
        for k in range(count):
            pace = ("--track", self.track, "--pace", self.pace, "--seed", 100 * self.road + k)
            bag = self.simulate(
                f"drive{k}", "--camera", 4, "--looks-like", self.looks, "--road", self.road, *pace
            )
            out = self.folder / f"result{k}"
            if not (out / "timing.json").exists():
                vehicle = bag.with_suffix(".vehicle.yaml")
                self.run("identify", bag, "--vehicle", vehicle, "--residual", "none", "--out", out, may=(0, 3))
            alone = self.read(bag)
            learned = self.read(bag, "--calibration", file) if taught else alone
            found = json.loads((out / "identification.json").read_text())
            peaks = [found["peak_friction"][a] for a in ("front", "rear")]
            reached = [p for p in peaks if p["reached"] and found["accepted"]]
            yield [self.name, k + 1, self.mu, self.looks, truth, *alone[:2], *learned, found["status"], len(reached)] + [
                statistics.mean(p["value"] for p in reached) if reached else float("nan")
            ]
            if reached:
                taught.append(("--results", f"{out}={bag}"))
                results = [word for pair in taught for word in pair]
                self.run("friction", "calibrate", *results, "--out", file)
                self.lessons = results if k < count - 1 else self.lessons

    def last(self, name, floors, file):
        """The last drive, read with what some floors taught."""
        self.run("friction", "calibrate", *[word for f in floors for word in f.lessons], "--out", file)
        bag = max(self.folder.glob("drive*.mcap"))
        said = self.read(bag, "--calibration", file)
        return [self.name, name, self.mu, self.looks, self.truth(), *self.read(bag)[:2], *said, "", "", ""]

    def turns(self):
        """The paper's loop on the last drive: turns taken, and what they end at, from each start."""
        file = self.folder / "before_last.json"
        self.run("friction", "calibrate", *self.lessons, "--out", file)
        bag = max(self.folder.glob("drive*.mcap"))
        starts = {"mu0": None, "network": self.read(bag)[:2], "taught": self.read(bag, "--calibration", file)[:2]}
        for name, start in starts.items():
            out = self.folder / f"turns_{name}"
            if not (out / "timing.json").exists():
                prior = ["--prior-mu", start[0], "--prior-sigma", start[1]] if start else []
                vehicle = bag.with_suffix(".vehicle.yaml")
                self.run("identify", bag, "--vehicle", vehicle, "--method", "paper", *prior, "--out", out, may=(0, 3))
            found = json.loads((out / "identification.json").read_text())
            d = [found["found"][axle]["d"] for axle in ("front", "rear")]
            yield [self.name, name, start[0] if start else MU0, self.truth(), found["iterations"], found["converged"], *d]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--bin", default="target/release/gripsight")
    parser.add_argument("--drives", type=int, default=4)
    args = parser.parse_args()
    head = ["floor", "drive", "mu", "looks like", "D", "network", "network sigma", "start", "start sigma", "new floor"]
    head += ["status", "axles at their peak", "D found"]
    with Path(__file__).with_name("learning.csv").open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(head)

        def say(row):
            rows.writerow([f"{x:.4f}" if isinstance(x, float) else x for x in row])
            file.flush()
            print(row[0], row[1], f"D {row[4]:.2f}, network {row[5]:.2f}, start {row[7]:.2f} +- {row[8]:.2f}", row[9:])

        floors = [Floor(args, floor) for floor in FLOORS]
        for floor in floors:
            for row in floor.drives(args.drives):
                say(row)
        for floor in floors:
            say(floor.last("all floors", floors, args.out / "all.json"))
        for floor in floors:
            others = [f for f in floors if f is not floor]
            say(floor.last("other floors", others, args.out / "others.json"))
    with Path(__file__).with_name("turns.csv").open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["floor", "start", "mu_hat", "D", "turns", "converged", "D front", "D rear"])
        for floor in floors:
            for row in floor.turns():
                rows.writerow([f"{x:.4f}" if isinstance(x, float) else x for x in row])
                file.flush()
                print(*row)


if __name__ == "__main__":
    main()
