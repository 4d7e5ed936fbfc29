#!/usr/bin/env python3
"""What the recordings of launch_scripts/demo_camera.sh show.

    warm_start.py rows FOLDER               CSV: one row for each recording and turn of the outer loop
    warm_start.py table CSV [PICTURE.svg]   table in Markdown, and the way to the end curve as a picture
"""

import csv
import statistics
import sys
from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

PROPOSED = 1
CAMERA = 2
WITHIN = (0.02, 0.03, 0.05, 0.1, 0.15, 0.2, 0.3)


def force(tire, slip):
    return tire.d * np.sin(tire.c * np.arctan(tire.b * slip - tire.e * (tire.b * slip - np.arctan(tire.b * slip))))


def truth(path, vehicle):
    """True slips of the single-track car, F_y and F_y/F_z of each axle."""
    with open(path, encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if float(row["v_x_mps"]) > 1.0]
    get = lambda name: np.array([float(row[name]) for row in rows])
    v_x, v_y, yaw_rate = get("v_x_mps"), get("v_y_mps"), get("yaw_rate_radps")
    slips = [get("steering_front_rad") - np.arctan((v_y + vehicle["l_f_m"] * yaw_rate) / v_x), -np.arctan((v_y - vehicle["l_r_m"] * yaw_rate) / v_x)]
    return [(slip, get(f"f_y_{axle}_n"), get(f"f_z_{axle}_n")) for slip, axle in zip(slips, ("front", "rear"))]


def stiffness(slip, lateral):
    """Slope of the true force at the origin, N/rad: a line and a cube over the small slips."""
    small = np.abs(slip) < 0.05
    return np.linalg.lstsq(np.stack([slip[small], slip[small] ** 3], 1), lateral[small], rcond=None)[0][0]


def number(path, key):
    lines = (line.split(":") for line in path.read_text(encoding="utf-8").splitlines())
    return next(float(line[1]) for line in lines if line[0].strip() == key)


def turns_of(recording):
    """Tires by turn (0 is the start), how far each turn moved the curves, the run's end, and the prior that it began with."""
    tires, change, end, prior = {}, {}, None, None
    with open(recording, "rb") as file:
        for _, channel, _, m in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages():
            if channel.topic == "/camera_prior/friction" and not tires and m.valid and m.source == CAMERA:
                prior = (m.mu, m.sigma)
            if channel.topic == "/identifier/progress" and m.handshake.iteration:
                change[m.handshake.iteration] = m.change
            if channel.topic == "/identifier/candidate":
                tires[m.handshake.iteration] = m
                end = m if m.status != PROPOSED else end
    return [(tires[k], change.get(k)) for k in sorted(tires)], end, prior


def rows(folder):
    out = csv.writer(sys.stdout, lineterminator="\n")
    axles = ("front", "rear")
    out.writerow(
        ["mu", "seed", "camera", "prior_mu", "prior_sigma", "turns", "turn", "change", "to_the_end"]
        + [f"{name}_{axle}" for axle in axles for name in ("d", "stiffness_n_per_rad", "true_stiffness_n_per_rad", "rmse")]
    )
    for recording in sorted(Path(folder).glob("mu*.with*.mcap")):
        drive, camera, _ = recording.name.rsplit(".", 2)
        mu, seed = drive.removeprefix("mu").split("_seed")
        tires, end, prior = turns_of(recording)
        if camera == "with" and not prior:
            sys.exit(f"{recording}: no prior from the camera's pictures before the run began")
        yaml = Path(folder) / f"{drive}.vehicle.yaml"
        true = truth(Path(folder) / f"{drive}.truth.csv", {key: number(yaml, key) for key in ("l_f_m", "l_r_m")})
        seen = [np.linspace(s.low, s.high, 101) for s in (end.front_slip_rad, end.rear_slip_rad)]
        for turn, (m, change) in enumerate(tires):
            away = [np.abs(force(getattr(m, a), s) - force(getattr(end, a), s)).max() / np.abs(force(getattr(end, a), s)).max() for a, s in zip(axles, seen)]
            row = [mu, seed, camera, *([f"{v:.3f}" for v in prior] if prior else ["", ""]), len(tires) - 1, turn, "" if change is None else f"{change:.4f}", f"{max(away):.4f}"]
            for axle, load, (slip, lateral, vertical) in zip(axles, (m.front_load_n, m.rear_load_n), true):
                tire = getattr(m, axle)
                rmse = np.sqrt(np.mean((force(tire, slip) - lateral / vertical) ** 2))
                row += [f"{tire.d:.3f}", f"{tire.b * tire.c * tire.d * load:.1f}", f"{stiffness(slip, lateral):.1f}", f"{rmse:.4f}"]
            out.writerow(row)


def read(path):
    """Runs by (mu, seed), without and with: their rows in the order of the turns."""
    runs = {}
    with open(path, encoding="utf-8") as file:
        for row in csv.DictReader(file):
            runs.setdefault((row["mu"], row["seed"]), {}).setdefault(row["camera"], []).append(row)
    return dict(sorted(runs.items(), key=lambda run: (-float(run[0][0]), run[0][1])))


def ended(run):
    """The turns that the run took."""
    return int(run[-1]["turn"])


def close(run, tolerance):
    """The turn after which no later one is further from the end than this."""
    return max((int(row["turn"]) + 1 for row in run if float(row["to_the_end"]) > tolerance), default=0)


def counted(runs, title, counts):
    """Mean turns on each road and all, and on how many drives they are fewer, as many and more with the camera; a row for each way to count."""
    mus = [*dict.fromkeys(mu for mu, _ in runs), "all"]
    print(f"\n| {title} | " + " | ".join(f"{mu}, without | with" for mu in mus) + " | fewer, as many, more with |")
    print("| --- " * (2 * len(mus) + 2) + "|")
    for name, turns_of_run in counts.items():
        turns = {mu: [[turns_of_run(pair[c]) for c in ("without", "with")] for (m, _), pair in runs.items() if mu in (m, "all")] for mu in mus}
        means = [f"{statistics.mean(t[k] for t in turns[mu]):.2f}" for mu in mus for k in (0, 1)]
        signs = [str(sum((b > a) - (b < a) == sign for a, b in turns["all"])) for sign in (-1, 0, 1)]
        print(f"| {name} | {' | '.join(means)} | {', '.join(signs)} |")


def table(path, picture=None):
    runs = read(path)
    both = lambda cells: " | ".join(map(str, cells))
    print("| mu | seed | prior | start off by, without | with | first turn's change, without | with | turns, without | with | stiffness over the truth, front / rear, without | with | RMSE of F_y/F_z, without | with |")
    print("| --- " * 13 + "|")
    for (mu, seed), pair in runs.items():
        pair = [pair["without"], pair["with"]]
        ratio = lambda run: " / ".join(f"{float(run[-1][f'stiffness_n_per_rad_{a}']) / float(run[-1][f'true_stiffness_n_per_rad_{a}']):.2f}" for a in ("front", "rear"))
        cells = [mu, seed, f"{pair[1][0]['prior_mu']} +- {pair[1][0]['prior_sigma']}"]
        cells += [f"{float(run[0]['to_the_end']):.0%}" for run in pair] + [f"{float(run[1]['change']):.0%}" for run in pair]
        cells += [ended(run) for run in pair]
        cells += [ratio(run) for run in pair] + [f"{run[-1]['rmse_front']} / {run[-1]['rmse_rear']}" for run in pair]
        print(f"| {both(cells)} |")
    counted(runs, "turns", {"of the run": ended} | {f"until within {w:.0%} of its end": lambda run, w=w: close(run, w) for w in WITHIN})
    print("\n| after | furthest from the end's curves, median without | with | RMSE of F_y/F_z front / rear, median without | with |")
    print("| --- " * 5 + "|")
    for name, turn in (("the start", 0), ("one turn", 1), ("the last turn", -1)):
        median = lambda key, k: statistics.median(float(pair[("without", "with")[k]][turn][key]) for pair in runs.values())
        away = [f"{median('to_the_end', k):.0%}" for k in (0, 1)]
        rmse = [f"{median('rmse_front', k):.3f} / {median('rmse_rear', k):.3f}" for k in (0, 1)]
        print(f"| {name} | {both(away)} | {both(rmse)} |")
    if picture:
        Path(picture).write_text(drawing(runs), encoding="utf-8")


def drawing(runs):
    """Distance from the end curve against the turn, a panel for each road; grey without, blue with the camera."""
    mus = list(dict.fromkeys(mu for mu, _ in runs))
    wide, high, top = 260, 220, 0.6
    x = lambda panel, turn: 50 + panel * (wide + 40) + turn / 8 * wide
    y = lambda away: 40 + high * (1 - min(away, top) / top)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{60 + len(mus) * (wide + 40)}" height="{high + 100}" font-family="sans-serif" font-size="12">', '<rect width="100%" height="100%" fill="white"/>']
    text = lambda px, py, words, anchor="middle": out.append(f'<text x="{px:.0f}" y="{py:.0f}" text-anchor="{anchor}">{words}</text>')
    for panel, mu in enumerate(mus):
        text(x(panel, 4), 25, f"road's friction {mu}")
        for away in (0.0, 0.05, 0.2, 0.4, 0.6):
            out.append(f'<line x1="{x(panel, 0)}" x2="{x(panel, 8)}" y1="{y(away):.1f}" y2="{y(away):.1f}" stroke="#ddd"/>')
            text(x(panel, 0) - 5, y(away) + 4, f"{away:.0%}", "end")
        for turn in range(9):
            text(x(panel, turn), high + 56, turn)
        text(x(panel, 4), high + 74, "turn of the outer loop")
        for (m, _), pair in runs.items():
            for camera, colour in (("without", "#888"), ("with", "#1f77b4")):
                if m == mu:
                    points = [(x(panel, k), y(float(row["to_the_end"]))) for k, row in enumerate(pair[camera])]
                    out.append(f'<polyline points="{" ".join(f"{a:.1f},{b:.1f}" for a, b in points)}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
                    out.append(f'<circle cx="{points[-1][0]:.1f}" cy="{points[-1][1]:.1f}" r="3" fill="{colour}"/>')
    text(50, high + 94, "Largest distance of the tire curves from those at the run's end, share of their peak. Grey: from mu0 = 0.51. Blue: from the camera's prior.", "start")
    return "\n".join(out + ["</svg>", ""])


if __name__ == "__main__":
    rows(sys.argv[2]) if sys.argv[1] == "rows" else table(*sys.argv[2:])
