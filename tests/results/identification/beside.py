#!/usr/bin/env python3
"""Times two programs beside each other: in turn on the same arguments, medians of wall and processor time and of their ratio.

    beside.py NEW OLD [--rounds 9] -- ARGUMENTS...

NEW and OLD are gripsight binaries; OUT among the arguments becomes a temporary folder of each:

    beside.py target/release/gripsight ../old/target/release/gripsight -- identify bags/demo_f1tenth.mcap --vehicle bags/demo_f1tenth.vehicle.yaml --out OUT
"""

import argparse
import resource
import statistics
import subprocess
import tempfile
import time


def run(program, arguments, out):
    """Wall and processor time of one run, s; what it prints is of no interest, its exit status is."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    command = [program, *(out if argument == "OUT" else argument for argument in arguments)]
    ended = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False)
    wall, after = time.monotonic() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    # 3: the result was refused, which takes as long.
    if ended.returncode not in (0, 3):
        raise SystemExit(f"{program} ended with {ended.returncode}: {ended.stderr[-500:]}")
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("new")
    parser.add_argument("old")
    parser.add_argument("--rounds", type=int, default=9)
    parser.add_argument("arguments", nargs="+")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rounds = [
            [run(program, args.arguments, f"{folder}/{k}") for k, program in enumerate((args.new, args.old))]
            for _ in range(args.rounds)
        ]
    for k, name in enumerate(("wall", "processor")):
        new, old = ([times[program][k] for times in rounds] for program in (0, 1))
        ratio = statistics.median(a / b for a, b in zip(new, old))
        print(f"{name}: {statistics.median(new):.2f} s, {statistics.median(old):.2f} s, ratio {ratio:.2f}")


if __name__ == "__main__":
    main()
