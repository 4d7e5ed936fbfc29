#!/usr/bin/env python3
"""Makes signals.md of signals_head.md and the rows that `examples/signals` wrote (signals_*.csv beside this file)."""

import csv
import math
from pathlib import Path

HERE = Path(__file__).parent
HARMFUL = 0.1
USABLE = ("accepted", "accepted_within")


def number(text):
    return float(text) if text not in ("", "NaN", None) else math.nan


def rows(name):
    path = HERE / name
    return list(csv.DictReader(path.open())) if path.exists() else []


def median(values):
    values = sorted(v for v in values if not math.isnan(v))
    return values[len(values) // 2] if values else math.nan


def groups(all_rows):
    out = {}
    for row in all_rows:
        out.setdefault(row["what"], []).append(row)
    return out


def off(row, axle):
    return number(row[f"k_{axle}"]) / number(row[f"k_true_{axle}"]) - 1


def covered(row, axle):
    return number(row[f"k_lo_{axle}"]) <= number(row[f"k_true_{axle}"]) <= number(row[f"k_hi_{axle}"])


def promised(row):
    return max(number(row["over_f"]), number(row["over_r"]))


def percent(value, signed=True):
    return "-" if math.isnan(value) else f"{100 * value:{'+' if signed else ''}.0f} %"


def without_v_y():
    lines = [
        "## Without a measured v_y",
        "",
        "v_y is 0 throughout. It is estimated from poses, inertial unit, yaw rate and v_x by a smoother that knows rigid-body motion and no tire.",
        "",
        "| recorded | drives | usable sets | stiffness off, median size front / rear | within its 90 % interval | largest force off, front / rear | understeer gradient, deg/g: true, off (median sizes); off by at most a tenth; within its 90 % interval | promised too much: harmful, most | v_y known to | delay found |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for what, group in groups(rows("signals_no_v_y.csv")).items():
        usable = [r for r in group if r["status"] in USABLE]
        size = lambda axle: percent(median(abs(off(r, axle)) for r in usable), False)
        force = lambda axle: percent(median(abs(number(r[f"d_{axle}"]) / number(r[f"d_true_{axle}"]) - 1) for r in usable), False)
        inside = sum(covered(r, axle) for r in usable for axle in "fr")
        over = [promised(r) for r in usable]
        true, found, low, high = ([number(r[f"understeer{end}"]) for r in usable] for end in ("_true", "", "_lo", "_hi"))
        gradient = f"{median(map(abs, true)):.2f}, {median(abs(f - t) for f, t in zip(found, true)):.2f}"
        near = sum(abs(f - t) <= 0.1 * abs(t) for f, t in zip(found, true))
        held = sum(l <= t <= h for l, t, h in zip(low, true, high))
        sigma, delay = median(number(r["v_y_sigma"]) for r in group), median(number(r["delay"]) for r in group)
        lines.append(
            f"| {what} | {len(group)} | {len(usable)} | {size('f')} / {size('r')} | {inside} of {2 * len(usable)} | {force('f')} / {force('r')} | {gradient}; {near} of {len(usable)}; {held} of {len(usable)} "
            f"| {sum(o > HARMFUL for o in over)}, {percent(max(over, default=math.nan))} "
            f"| {'measured' if math.isnan(sigma) else f'{sigma:.3f} m/s'} | {'-' if math.isnan(delay) else f'{delay:.3f} s'} |"
        )
    return lines


def lies():
    lines = [
        "",
        "## Lies",
        "",
        "Beside the signal that lies are recorded: poses (40 Hz, 2 cm, 0.5 degrees, 50 ms late) and an inertial unit; an inertial unit alone; nothing. \"Estimated\": the wrong channel was replaced by "
        "what the poses have. \"Refused by name\": nothing was fitted, and the reason names the signal and the line of a topics file that mends it. Where nothing is recorded beside it, what nothing "
        "checks is listed in `signals.unchecked[]` of every result.",
        "",
        "| lie | beside it | drives | refused by name | rejected by the fit | usable: replaced | usable: as recorded | stiffness off, median front / rear | promised too much: harmful, most |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for what, group in groups(rows("signals_lies.csv")).items():
        lie, beside = what.split("; beside it ")
        usable = [r for r in group if r["status"] in USABLE]
        named = [r for r in group if r["status"] == "rejected" and r["k_f"] == "NaN"]
        replaced = [r for r in usable if r["estimated"]]
        over = [promised(r) for r in usable]
        shift = lambda axle: percent(median(off(r, axle) for r in usable))
        lines.append(
            f"| {lie} | {beside} | {len(group)} | {len(named)} | {len(group) - len(usable) - len(named)} | {len(replaced)} | {len(usable) - len(replaced)} "
            f"| {shift('f')} / {shift('r')} | {sum(o > HARMFUL for o in over)}, {percent(max(over, default=math.nan))} |"
        )
    return lines


def bags():
    lines = [
        "",
        "## Recordings",
        "",
        "| recording | v_y | status | stiffness N/rad front | rear | estimated | first reason |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for r in rows("signals_bags.csv"):
        k = lambda a: "-" if math.isnan(number(r[f"k_{a}"])) else f"{number(r[f'k_{a}']):.4g} [{number(r[f'k_lo_{a}']):.4g}, {number(r[f'k_hi_{a}']):.4g}]"
        lines.append(f"| {r['run']} | {r['what']} | {r['status']} | {k('f')} | {k('r')} | {r['estimated'] or '-'} | {r['reason'].split(' | ')[0]} |")
    return lines


def honest():
    lines = [
        "",
        "## Tolerances of the cross checks",
        "",
        "What the checks give on honest drives (`signals_honest.csv`): how far the ratio lies from one, and how far its 90 % interval stays from one. A tolerance must lie above the second.",
        "",
        "| check | drives and localisations | told | ratio off: 50 % / 95 % / most | interval off: 95 % / most | speaks against honest signals |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    by_pair = {}
    for r in rows("signals_honest.csv"):
        by_pair.setdefault(r["pair"], []).append(r)
    at = lambda values, share: sorted(values)[min(len(values) - 1, int(share * len(values)))] if values else math.nan
    for pair, group in by_pair.items():
        told = [r for r in group if r["finding"] not in ("not_told", "same_source")]
        away = [abs(number(r["ratio"]) - 1) for r in told]
        apart = [max(0.0, number(r["low"]) - 1, 1 - number(r["high"])) for r in told]
        against = [r for r in told if r["finding"] != "agrees"]
        lines.append(
            f"| {pair} | {len(group)} | {len(told)} | {at(away, 0.5):.3f} / {at(away, 0.95):.3f} / {max(away, default=math.nan):.3f} "
            f"| {at(apart, 0.95):.3f} / {max(apart, default=math.nan):.3f} | {len(against)} |"
        )
    return lines


def main():
    parts = [(HERE / "signals_head.md").read_text().rstrip().splitlines(), [""], without_v_y(), lies(), bags(), honest()]
    (HERE / "signals.md").write_text("\n".join(line for part in parts for line in part) + "\n")


main()
