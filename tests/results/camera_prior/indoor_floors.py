"""The camera prior on photographs of indoor floors: what carpets, tiles and wood are read as, and whether white floors are taken for snow.

    indoor_floors.py DATASET [--bin gripsight] > indoor_floors.csv

DATASET is the folder of that name in github.com/FieldRoboticsLab/Dataset-for-Indoor-Surface-Classification (Demirtas, Erdemir and Bayram 2024, doi 10.7717/peerj-cs.1730): floors of
over twenty buildings as indoor robots see them. It states no licence: read here, trained on nowhere, not part of this project. Needs OpenCV (`nodes/camera_prior/training/requirements.txt`).
A floor is white where its mean brightness is above 170 of 255 and its mean saturation below 40.
The table goes to standard output, the summary to standard error.
"""

import argparse
import csv
import json
import subprocess
import sys
from pathlib import Path

import cv2

KINDS = ("carpet", "tiles", "wood")


def is_white(file):
    hsv = cv2.cvtColor(cv2.imread(str(file), cv2.IMREAD_REDUCED_COLOR_8), cv2.COLOR_BGR2HSV)
    return hsv[..., 2].mean() > 170 and hsv[..., 1].mean() < 40


def summary(title, rows):
    read = [r for r in rows if r["reason"] == ""]
    mu = [r["mu"] for r in read]
    share = lambda hits: f"{100 * sum(hits) / len(read):.0f} %"  # noqa: E731
    refused = 100 * (1 - len(read) / len(rows))
    print(
        f"| {title} | {len(rows)} | {refused:.0f} % | {sum(mu) / len(mu):.2f} | {sum(r['sigma'] for r in read) / len(read):.2f} "
        f"| {share(m < 0.6 for m in mu)} | {share(m < 0.4 for m in mu)} | {share(r['p_snow'] > 0.5 for r in read)} |",
        file=sys.stderr,
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--bin", default="target/release/gripsight")
    args = parser.parse_args()
    rows = []
    for kind in KINDS:
        files = sorted(args.dataset.glob(f"*/{kind}/*.jpg"))
        said = subprocess.run([args.bin, "friction", "--json", *map(str, files)], check=True, capture_output=True, text=True)
        for file, reading in zip(files, json.loads(said.stdout), strict=True):
            row = {"file": file.relative_to(args.dataset).as_posix(), "kind": kind, "white": int(is_white(file)), "reason": reading["reason"] or ""}
            rows.append(row | {"mu": round(reading["mu_hat"], 3), "sigma": round(reading["sigma"], 3), "p_snow": round(reading["p"]["snow"], 3)})
    out = csv.DictWriter(sys.stdout, rows[0], lineterminator="\n")
    out.writeheader()
    out.writerows(rows)
    print("| floor | pictures | refused | mean mu of the rest | sigma | below 0.6 | below 0.4 | snow above one half |\n|---|---|---|---|---|---|---|---|", file=sys.stderr)
    for kind in KINDS:
        summary(kind, [r for r in rows if r["kind"] == kind])
    summary("white floors among them", [r for r in rows if r["white"]])


if __name__ == "__main__":
    main()
