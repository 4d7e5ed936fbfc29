"""The loop closed live: laps over topics at real time, beside the same laps in process.

    closed_loop_live.py OUT [--cars f1tenth,passenger_car] [--variants none,identified,...] [--track club] [--mu 0.9] [--laps 5] [--bin FOLDER]

A run starts sim_car on a road that the suite does not know, and beside it what run_suite.sh starts with --drive; `none` has the driver alone, on the
start's tires for ever. Priors are told (camera_prior's configured_mu): the road's own, and 0.3 beside it. Lap times are the driver's own, by odometry.
Processor and memory come from /proc, each second. The same car, road and variant are then driven in process (launch_scripts/closed_loop.sh).

Writes OUT/laps.csv, OUT/nodes.csv and OUT/README.md; a run that OUT holds is not driven again. Exit code 1: a node ended, or the laps did not.
"""

import argparse
import csv
import os
import pathlib
import re
import signal
import statistics
import subprocess
import sys
import time

import yaml
from soak import processes, stop

ROOT = pathlib.Path(__file__).resolve().parents[2]
# What a prior is off by; None: no prior, and "none" has no suite at all.
VARIANTS = {"none": None, "identified": None, "with_prior": 0.0, "prior_too_high": 0.3, "prior_too_low": -0.3}
REMAPS = {"odom": "/car_state/odom", "imu": "/imu/data", "wheels": "/wheel_speeds", "drive": "/drive"}
LAP = re.compile(r"lap (\d+): ([\d.]+) s, to the line ([\d.]+) m, at most ([\d.]+) m, (\d+) times off the track, grip planned ([\d.]+), ([^,]*), state (\d+) ms")
READY_S = 20.0
# No car here takes so long for a lap.
LONGEST_LAP_S = 150.0


def parameters(folder):
    """The suite's, with sets that rest on a prior."""
    suite = yaml.safe_load((ROOT / "params/suite.yaml").read_text())
    suite["/**/identifier"]["ros__parameters"]["publish_provisional"] = True
    suite["/**/driver"]["ros__parameters"]["take_provisional"] = True
    path = folder / "suite.yaml"
    path.write_text(yaml.safe_dump(suite))
    return path


def drive(args, car, variant):
    """Laps as the driver said, and what each node used."""
    folder = args.out / f"{car}_{variant}"
    files = folder / "car"
    files.mkdir(parents=True, exist_ok=True)
    for stale in files.iterdir():
        stale.unlink()
    remaps = [word for name, topic in REMAPS.items() for word in ("-r", f"{name}:={topic}")]
    given = {"car": car, "track": args.track, "mu": args.mu, "seed": 1, "write_folder": files}
    started, used, text = [], {}, ""
    with (folder / "log.txt").open("w") as log:
        begin = lambda words: started.append(subprocess.Popen([str(word) for word in words], stdout=log, stderr=log))
        try:
            begin([args.bin / "sim_car", "--ros-args", *(word for name, value in given.items() for word in ("-p", f"{name}:={value}")), *remaps])
            until = time.monotonic() + READY_S
            while not all((files / name).is_file() for name in ("vehicle.yaml", "driver.yaml")):
                if time.monotonic() > until:
                    raise SystemExit(f"sim_car wrote no files within {READY_S:.0f} s: see {folder / 'log.txt'}")
                time.sleep(0.1)
            if variant == "none":
                begin([args.bin / "driver", "--ros-args", "--params-file", files / "vehicle.yaml", "--params-file", files / "driver.yaml", *remaps])
            else:
                prior = VARIANTS[variant]
                told = [] if prior is None else ["--prior-mu", round(args.mu + prior, 3), "--params", parameters(folder)]
                begin([ROOT / "launch_scripts/run_suite.sh", "--vehicle", files / "vehicle.yaml", "--drive", files / "driver.yaml", "--bin", args.bin, *told])
            until = time.monotonic() + READY_S + LONGEST_LAP_S * args.laps
            while len(LAP.findall(text)) < args.laps:
                if any(process.poll() is not None for process in started) or time.monotonic() > until:
                    print(f"{car}, {variant}: ended after {len(LAP.findall(text))} laps: see {folder / 'log.txt'}", file=sys.stderr)
                    break
                for name, now in processes().items():
                    used.setdefault(name, []).append((time.monotonic(), now["processor_s"], now["resident_mb"]))
                time.sleep(1.0)
                text = (folder / "log.txt").read_text()
        finally:
            stop(started)
    laps = [
        {"car": car, "variant": variant, "lap": int(n), "time_s": float(t), "error_m": float(mean), "worst_m": float(worst), "exits": int(exits), "grip": float(grip), "rests_on": on, "state_ms": int(age)}
        for n, t, mean, worst, exits, grip, on, age in LAP.findall(text)[: args.laps]
    ]
    # A node of the run before may still be ending when this one's begins: its time goes back then.
    share = lambda seen: sum(max(0.0, b[1] - a[1]) for a, b in zip(seen, seen[1:])) / max(seen[-1][0] - seen[0][0], 1e-3)
    nodes = [
        {"car": car, "variant": variant, "node": name, "processor": round(share(seen), 4), "most_mb": round(max(row[2] for row in seen), 1)}
        for name, seen in used.items()
    ]
    return laps, nodes


def in_process(args):
    """The same laps in process: (car, variant, lap) to time and exits."""
    out = args.out / "in_process"
    variants = [*args.variants, "true_tires"]
    command = [ROOT / "launch_scripts/closed_loop.sh", out, "--cars", ",".join(args.cars), "--tracks", args.track, "--frictions", args.mu, "--seeds", 2,
               "--variants", ",".join(variants), "--laps", args.laps]
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    found = {}
    with (out / "laps.csv").open() as file:
        for row in csv.DictReader(file):
            found.setdefault((row["car"], row["variant"], int(row["lap"])), []).append((float(row["time_s"]), int(row["exits"])))
    return found


def write(path, rows):
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def read(path):
    if not path.is_file():
        return []
    with path.open() as file:
        return list(csv.DictReader(file))


def table(args, laps, nodes, beside):
    heads = " | ".join(f"lap {lap}" for lap in range(1, args.laps + 1))
    lines = [f"`{args.track}`, mu = {args.mu}. Lap times in s: live / in process, there the mean of two seeds (seed 1 is driven the other way round).", "",
             f"| car | variant | {heads} | to the line, last lap, mean, most (m) | times off the track, live, in process | state old (ms) |",
             "|---" * (args.laps + 5) + "|"]
    for car in args.cars:
        for variant in [*args.variants, "true_tires"]:
            own = [row for row in laps if (row["car"], row["variant"]) == (car, variant)]
            cells, off = [], 0
            for lap in range(1, args.laps + 1):
                live = next((f"{float(row['time_s']):.2f}" for row in own if int(row["lap"]) == lap), "-")
                runs = beside.get((car, variant, lap), [])
                off += sum(exits for _, exits in runs)
                cells.append(f"{live} / {statistics.mean(t for t, _ in runs):.2f}" if runs else live)
            last = own[-1] if own else None
            near = f"{float(last['error_m']):.3f}, {float(last['worst_m']):.3f}" if last else "-"
            exits = sum(int(row["exits"]) for row in own) if own else "-"
            age = f"{statistics.median(int(row['state_ms']) for row in own):.0f}" if own else "-"
            lines.append(f"| {car} | `{variant}` | {' | '.join(cells)} | {near} | {exits}, {off} of {len(beside.get((car, variant, 1), []))} runs | {age} |")
    names = sorted({row["node"] for row in nodes}, key=lambda name: -max(float(row["processor"]) for row in nodes if row["node"] == name))
    lines += ["", "Processor (share of one) and memory (most, MB):", "", f"| car | variant | {' | '.join(names)} |", "|---" * (len(names) + 2) + "|"]
    for car in args.cars:
        for variant in args.variants:
            own = {row["node"]: row for row in nodes if (row["car"], row["variant"]) == (car, variant)}
            cell = lambda name: f"{100 * float(own[name]['processor']):.1f} %, {float(own[name]['most_mb']):.0f}" if name in own else "-"
            lines.append(f"| {car} | `{variant}` | {' | '.join(map(cell, names))} |")
    return "\n".join(lines) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    listed = lambda text: text.split(",")
    parser.add_argument("--cars", type=listed, default=["f1tenth", "passenger_car"])
    parser.add_argument("--variants", type=listed, default=list(VARIANTS))
    parser.add_argument("--track", default="club")
    parser.add_argument("--mu", type=float, default=0.9)
    parser.add_argument("--laps", type=int, default=5)
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "target/release")
    args = parser.parse_args()
    unknown = set(args.variants) - set(VARIANTS)
    if unknown:
        parser.error(f"no such variant: {', '.join(sorted(unknown))}; known: {', '.join(VARIANTS)}")
    args.out.mkdir(parents=True, exist_ok=True)
    laps, nodes = read(args.out / "laps.csv"), read(args.out / "nodes.csv")
    short = False
    # What was started is stopped, however this ends.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    for car in args.cars:
        for variant in args.variants:
            if any((row["car"], row["variant"]) == (car, variant) for row in laps):
                continue
            driven, used = drive(args, car, variant)
            short |= len(driven) < args.laps
            laps, nodes = laps + driven, nodes + used
            if laps:
                write(args.out / "laps.csv", laps)
            if nodes:
                write(args.out / "nodes.csv", nodes)
            print(f"{car}, {variant}: {' '.join(str(lap['time_s']) for lap in driven)} s", flush=True)
    text = table(args, laps, nodes, in_process(args))
    (args.out / "README.md").write_text(text)
    print(text)
    if short:
        raise SystemExit("not all laps were driven")


if __name__ == "__main__":
    main()
