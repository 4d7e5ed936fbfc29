"""What ImageNet's classes that live in snow tell of real roads, and what their odds are to be multiplied by (SNOW_ODDS in nodes/lib/friction/src/embedding.rs).

    snow_odds.py PICTURES [--photographs DIR] > snow_odds.csv

PICTURES as for real_roads.py; development pictures alone (real_roads.csv), of which the lower 65 % are seen. Where snow is not seen the road is taken for
0.75, so that the error is that of the snow alone. --photographs: DIR as for the training (train.py); then also how many of 400 held-out renders
(data.py, split test, seed 5) are taken for snow with more than one half. Needs the training's requirements.
"""

import argparse
import csv
import math
import sys
from pathlib import Path

import numpy as np
import onnxruntime
from PIL import Image

HERE = Path(__file__).resolve()
CAMERA = HERE.parents[3] / "nodes/camera_prior"
SIDE, MEAN, STD = 192, np.float32([0.485, 0.456, 0.406]), np.float32([0.229, 0.224, 0.225])
FRICTION, ELSE = {"dry": 0.85, "wet": 0.60, "snow": 0.25}, 0.75
ODDS = (1, 2, 4, 8, 16, 32, 83)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pictures", type=Path)
    parser.add_argument("--photographs")
    args = parser.parse_args()
    session = onnxruntime.InferenceSession(str(CAMERA / "model/embedding_efficientnet_lite0.onnx"))

    def share(picture):
        pixels = np.asarray(picture.resize((SIDE, SIDE), Image.BILINEAR), np.float32)
        tensor = ((pixels / 255 - MEAN) / STD).transpose(2, 0, 1)[None]
        return math.exp(session.run(["snow"], {"picture": tensor})[0][0, 0])

    def probability(odds, seen):
        return odds * seen / (odds * seen + 1 - seen)

    seen = {state: [] for state in FRICTION}
    with open(HERE.with_name("real_roads.csv"), newline="", encoding="utf-8") as table:
        for row in csv.DictReader(table):
            picture = Image.open(args.pictures / row["file"]).convert("RGB")
            lower = picture.crop((0, int(0.35 * picture.height), picture.width, picture.height))
            seen[row["state"]].append(share(lower))
    ranks = [(s > o) + 0.5 * (s == o) for s in seen["snow"] for o in seen["dry"] + seen["wet"]]
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["odds times", "balanced rmse", "area under the curve of snow"])
    for odds in ODDS:
        squares = []
        for state, mu in FRICTION.items():
            p = [probability(odds, s) for s in seen[state]]
            squares.append(np.mean([(q * FRICTION["snow"] + (1 - q) * ELSE - mu) ** 2 for q in p]))
        out.writerow([odds, f"{math.sqrt(np.mean(squares)):.4f}", f"{np.mean(ranks):.4f}"])
    if args.photographs:
        sys.path.insert(0, str(CAMERA / "training"))
        from data import Renders

        renders = Renders(args.photographs, "test", 224, 400, 5, outliers=False, plain_share=0.3)
        taken = {True: [], False: []}
        for i in range(len(renders)):
            picture, fractions, _, _ = renders.picture(i)
            taken[bool(np.argmax(fractions) == 3)].append(probability(8, share(Image.fromarray(picture))) > 0.5)
        for snow, name in ((False, "renders without snow"), (True, "renders of snow")):
            print(f"{name}: {sum(taken[snow])} of {len(taken[snow])} taken for snow", file=sys.stderr)


if __name__ == "__main__":
    main()
