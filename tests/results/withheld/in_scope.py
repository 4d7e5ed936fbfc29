#!/usr/bin/env python3
"""A part of a large batch that says nearly all that the whole would: what a day of processor would be spent on is left out, not chosen by its answers.

    in_scope.py CASES LABELS OUT FIRST [--only KIND] [--without-track-width]

OUT receives, as links, the first FIRST cases of CASES, of whatever kind, and of the others of the reference car those that a rate is asked of: an effect at
twice its detection limit or more, at race pace. Cases of others' plants and of recordings are all in scope. The labels decide that, which `gripsight withheld
make` wrote: no verdict is read. `--only none`: the first FIRST cases without effect, and no others. `--without-track-width`: vehicle files without that line, for
a program from before it. OUT must be on the file system of CASES.
"""

import argparse
import json
import os
import shutil
from pathlib import Path

from paired import in_scope


def is_asked(case):
    severity = [(e.get("oracle") or {}).get("severity") for e in case["effects"]]
    row = {"severity": " ".join("" if s is None else f"{s}" for s in severity), "race_pace": case["race_pace"]}
    return case["family"] != "reference" or (case["kind"] != "none" and in_scope(row))


def without_track_width(file):
    lines = [line for line in file.read_text().splitlines(keepends=True) if "track_width_m" not in line]
    file.unlink()
    file.write_text("".join(lines))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("cases", type=Path)
    parser.add_argument("labels", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("first", type=int)
    parser.add_argument("--only", metavar="KIND")
    parser.add_argument("--without-track-width", action="store_true")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True)
    cases = json.loads(arguments.labels.read_text())["cases"]
    if arguments.only:
        taken = [case for case in cases if case["kind"] == arguments.only][: arguments.first]
    else:
        taken = [case for i, case in enumerate(cases) if i < arguments.first or is_asked(case)]
    for case in (case["case"] for case in taken):
        shutil.copytree(arguments.cases / case, arguments.out / case, copy_function=os.link)
        if arguments.without_track_width:
            without_track_width(arguments.out / case / "vehicle.yaml")
    for file in filter(Path.is_file, arguments.cases.iterdir()):
        shutil.copy(file, arguments.out)
    print(f"{len(taken)} cases")


if __name__ == "__main__":
    main()
