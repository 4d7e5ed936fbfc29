"""The camera prior on photographs of real roads that nothing was trained on: the network alone, and after some labelled pictures.

    real_roads.py PICTURES [--bin gripsight] [--draws N] [--table real_roads_fresh.csv] > real_roads_runs.csv

PICTURES holds the folders of the table (file, state by eye, start of the SHA-256): google_bing_yahoo_flickr/250x250 of
github.com/kagan94/road_image_datasets. Development was done on real_roads.csv; the pictures of real_roads_fresh.csv were labelled before, and
read once. They are web pictures without a licence: read here, trained on nowhere, not part of this project. Each is of
another place, camera and season, which is harder than one track. real_roads_other.csv is another collector's: image of
github.com/611711Dark/RoadSurfaceRecognition_CNN_with_Dataset, no licence stated either: frames of one car's camera on dry roads (they are of
the RTK set), and web pictures of gravel, mud and snow; labelled before, and read once. A draw takes N pictures of each state at random (its seed), learns from them with
`gripsight friction calibrate`, and reads all others with `gripsight friction --calibration`.
"""

import argparse
import csv
import hashlib
import json
import math
import random
import subprocess
import sys
import tempfile
from pathlib import Path

# Of gravel and mud nobody measured what these have: the middle of what accident reconstruction takes for loose gravel and dry earth, and for mud.
FRICTION = {"dry": 0.85, "wet": 0.60, "snow": 0.25, "gravel": 0.60, "mud": 0.40}


def readings(gripsight, files, more=()):
    command = [gripsight, "friction", "--json", *more, *map(str, files)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def score(name, draw, states, read):
    """Root mean square error and the rest, each state counted alike, over the pictures that are not refused."""
    errors = {state: [] for state in states}
    confident = within = usable = 0
    for state, reading in zip(states, read, strict=True):
        if not reading["valid"]:
            continue
        usable += 1
        error = reading["mu_hat"] - FRICTION[state]
        errors[state].append(error * error)
        within += abs(error) < reading["sigma"]
        confident += abs(error) > 0.3 and reading["sigma"] < 0.15
    squares = [sum(e) / len(e) for e in errors.values() if e]
    rmse = math.sqrt(sum(squares) / len(squares))
    return [name, draw, len(read), usable, f"{rmse:.4f}", f"{confident / usable:.4f}", f"{within / usable:.4f}"]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pictures", type=Path)
    parser.add_argument("--bin", default="target/release/gripsight")
    parser.add_argument("--draws", type=int, default=10)
    parser.add_argument("--counts", type=int, nargs="*", default=[5, 10, 20])
    parser.add_argument("--table", default="real_roads.csv")
    args = parser.parse_args()
    with open(Path(__file__).with_name(args.table), newline="", encoding="utf-8") as table:
        rows = list(csv.DictReader(table))
    for row in rows:
        digest = hashlib.sha256((args.pictures / row["file"]).read_bytes()).hexdigest()
        if not digest.startswith(row["sha256"]):
            sys.exit(f"{row['file']} is another picture than the one labelled")
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["read by", "draw", "pictures", "usable", "balanced rmse", "confidently wrong", "within sigma"])
    files = [args.pictures / row["file"] for row in rows]
    states = [row["state"] for row in rows]
    friction = {state: mu for state, mu in FRICTION.items() if state in states}
    middle = sum(friction.values()) / len(friction)
    constant = [{"valid": True, "mu_hat": middle, "sigma": 0.25}] * len(rows)
    out.writerow(score("constant", 0, states, constant))
    read = readings(args.bin, files)
    out.writerow(score("network", 0, states, read))
    for state in friction:
        own = [reading for reading, x in zip(read, states, strict=True) if x == state]
        out.writerow(score(f"network: {state}", 0, [state] * len(own), own))
    for count in args.counts:
        for draw in range(args.draws):
            rng = random.Random(1000 * count + draw)
            taken = {i for s in friction for i in rng.sample([i for i, x in enumerate(states) if x == s], count)}
            with tempfile.TemporaryDirectory() as folder:
                labels = []
                for state, mu in friction.items():
                    own = Path(folder) / state
                    own.mkdir()
                    labels += ["--label", f"{state}={own}:{mu}"]
                    for i in taken:
                        if states[i] == state:
                            (own / f"{i}{files[i].suffix}").symlink_to(files[i].resolve())
                learned = f"{folder}/track.json"
                command = [args.bin, "friction", "calibrate", *labels, "--out", learned]
                subprocess.run(command, check=True, capture_output=True)
                rest = [i for i in range(len(rows)) if i not in taken]
                read = readings(args.bin, [files[i] for i in rest], ["--calibration", learned])
                out.writerow(score(f"{count} a state", draw, [states[i] for i in rest], read))
                sys.stdout.flush()


if __name__ == "__main__":
    main()
