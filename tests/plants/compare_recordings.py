#!/usr/bin/env python3
"""What `gripsight diagnose A --later B` says of recordings, where what has changed is known.

    compare_recordings.py GRIPSIGHT OUT --bags FOLDER [--only KIND ...] [--recordings NAME ...]

Three kinds of pairs, of each recording in FOLDER (a folder with NAME.mcap and vehicle.yaml):

    itself      the recording with itself: nothing has changed
    blocks      its even blocks of 5 and of 10 s with its odd ones: nothing has changed
    injected    the recording with itself after `gripsight bag inject`: five effects at two sizes

OUT/pairs.csv gets a row a pair, standard output the rates. A pair that is done is not done again: the run can be stopped and resumed.
"""

import argparse
import csv
import json
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

LIKELY = 0.5
# What is put in: name of the effect and its parameter, sizes on a 1:10 car and on a full-size one.
INJECTED = [
    ("steering_delay", "delay_s", (0.03, 0.06), (0.05, 0.10)),
    ("steering_gain", "gain", (0.05, 0.10), (0.05, 0.10)),
    ("gyro_scale", "scale", (0.04, 0.08), (0.04, 0.08)),
    ("v_y_bias", "bias_mps", (0.05, 0.10), (0.10, 0.20)),
    ("v_y_lever_arm", "x_m", (0.05, 0.10), (0.30, 0.60)),
]
# What is put in over what a car has of its own: factors multiply, so the difference is the size times what the car has already.
FACTORS = {"steering_gain", "gyro_scale"}
# Which effects do the same to what is recorded (the report says so beside a name).
ALIKE = [{"steering_delay", "steering_lag"}]
SITES = {"steering_delay": "steering", "steering_gain": "steering", "gyro_scale": "yaw_rate", "v_y_bias": "v_y", "v_y_lever_arm": "v_y"}
FULL_SIZE_KG = 100.0


def split(bag, out, block_s):
    """Writes the even and the odd blocks of a bag, and returns the two files."""
    files = [out.with_name(f"{out.name}_{which}.mcap") for which in ("even", "odd")]
    with open(bag, "rb") as source:
        reader = make_reader(source)
        summary = reader.get_summary()
        start = summary.statistics.message_start_time
        writers = []
        for file in files:
            writer = Writer(str(file), compression=CompressionType.ZSTD)
            writer.start(profile="ros2")
            schemas = {i: writer.register_schema(s.name, s.encoding, s.data) for i, s in summary.schemas.items()}
            channels = {
                i: writer.register_channel(c.topic, c.message_encoding, schemas[c.schema_id], dict(c.metadata))
                for i, c in summary.channels.items()
            }
            writers.append((writer, channels))
        for _, channel, message in reader.iter_messages():
            writer, channels = writers[int((message.log_time - start) / 1e9 // block_s) % 2]
            writer.add_message(
                channels[channel.id], log_time=message.log_time, data=message.data,
                publish_time=message.publish_time, sequence=message.sequence,
            )
        for writer, _ in writers:
            writer.finish()
    return files


def pairs_of(gripsight, recording, out, kinds):
    """The pairs of a recording: kind, what was put in, its size, earlier and later bag."""
    bag = recording / f"{recording.name}.mcap"
    if "itself" in kinds:
        yield "itself", "", 0.0, bag, bag
    if "blocks" in kinds:
        for block_s in (5, 10):
            even, odd = split(bag, out / f"{recording.name}-{block_s}s", block_s)
            yield "blocks", f"{block_s} s", 0.0, even, odd
    if "injected" in kinds:
        mass = next(float(line.split()[-1]) for line in (recording / "vehicle.yaml").read_text().splitlines() if "mass_kg" in line)
        for effect, parameter, small, full in INJECTED:
            for size in full if mass > FULL_SIZE_KG else small:
                later = out / f"{recording.name}-{effect}-{size}.mcap"
                subprocess.run(
                    [gripsight, "bag", "inject", bag, "--effect", f"{effect}={parameter}:{size}", "--out", later],
                    check=True, stdout=subprocess.DEVNULL,
                )
                yield "injected", effect, size, bag, later


def changes(gap):
    """What has changed, the likeliest first."""
    likely = [c for c in gap["changes"] if c["probability"] >= LIKELY]
    return sorted(likely, key=lambda c: -c["probability"])


def judged(kind, effect, size, gap):
    """A row of the table."""
    named = changes(gap)
    row = {"verdict": gap["verdict"], "changes": "; ".join(f"{c['name']} at {c['site']} {c['probability']:.2f}" for c in named)}
    if kind != "injected":
        return row | {"right": not named}
    of_site = any(c["site"] == SITES[effect] for c in named)
    names = [c["name"] for c in named if c["name"] not in ("other", "tires")]
    alike = next((group for group in ALIKE if effect in group), {effect})
    own = next((c for c in gap["changes"] if c["name"] == effect and c["probability"] >= LIKELY), None)
    difference = own["difference"] if own else {}
    row |= {"site": of_site, "named": any(n in alike for n in names), "first": bool(names) and names[0] in alike}
    row |= {"others": sum(n not in alike for n in names)}
    if own:
        row |= {"size": difference["value"], "low": difference["low"], "high": difference["high"]}
        differs = size * (1.0 + (difference["before"] if effect in FACTORS else 0.0))
        row |= {"differs": differs, "inside": difference["low"] <= differs <= difference["high"]}
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("gripsight", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--bags", type=Path, required=True)
    parser.add_argument("--only", nargs="+", choices=("itself", "blocks", "injected"), default=["itself", "blocks", "injected"])
    parser.add_argument("--recordings", nargs="+")
    arguments = parser.parse_args()
    gripsight = arguments.gripsight.resolve()
    arguments.out.mkdir(parents=True, exist_ok=True)
    recordings = sorted(f.parent for f in arguments.bags.glob("*/vehicle.yaml"))
    rows = []
    for recording in recordings:
        if arguments.recordings and recording.name not in arguments.recordings:
            continue
        for kind, what, size, earlier, later in pairs_of(gripsight, recording, arguments.out, arguments.only):
            answer = arguments.out / f"{recording.name}-{kind}-{what.replace(' ', '')}-{size}"
            began = time.monotonic()
            if not (answer / "gap.json").exists():
                command = [gripsight, "diagnose", earlier, "--later", later, "--vehicle", recording / "vehicle.yaml", "--out", answer]
                done = subprocess.run(command, capture_output=True, text=True)
                if done.returncode not in (0, 3):
                    sys.exit(f"{recording.name}, {kind} {what}: {done.stderr}")
            gap = json.loads((answer / "gap.json").read_text())
            row = {"recording": recording.name, "kind": kind, "effect": what, "true_size": size} | judged(kind, what, size, gap)
            rows.append(row)
            print(f"{time.monotonic() - began:5.0f} s  {recording.name} {kind} {what} {size or ''}: {row['verdict']}: {row['changes']}", flush=True)
    columns = list(dict.fromkeys(key for row in rows for key in row))
    with open(arguments.out / "pairs.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, columns, restval="")
        writer.writeheader()
        writer.writerows(rows)
    rates = defaultdict(list)
    for row in rows:
        for key in ("right", "site", "named", "first", "inside"):
            if key in row:
                rates[row["kind"], key].append(row[key])
    for (kind, key), values in rates.items():
        print(f"{kind:9} {key:6} {sum(values)} of {len(values)}")
    of_others = [row["others"] for row in rows if "others" in row]
    if of_others:
        print(f"injected  other names {sum(of_others)} in {len(of_others)}")


if __name__ == "__main__":
    main()
