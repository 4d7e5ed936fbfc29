#!/usr/bin/env python3
"""Makes plants.md of plants_head.md and the rows that `tests/plants/campaign.sh` wrote (plants_*.csv beside this file)."""

import math
import re
from pathlib import Path

from envelope import HARMFUL, number, quantiles, rows, wilson, worst

HERE = Path(__file__).parent


def plant(row):
    return re.sub(r"_\d+$", "", row["run"].split()[0])


def grouped(data, key):
    out = {}
    for row in data:
        out.setdefault(key(row), []).append(row)
    return out


def inside(row, axle):
    return number(row[f"k_lo_{axle}"]) <= number(row[f"k_true_{axle}"]) <= number(row[f"k_hi_{axle}"])


def line(name, data):
    driven = [r for r in data if "s of data" not in r["reasons"] and r["status"] != "failed"]
    usable = [r for r in driven if r["status"].startswith("accepted")]
    over = [r for r in usable if worst(r, "over") > HARMFUL]
    peaks = [(number(r[f"reached_{a}"]), number(r[f"said_{a}"])) for r in driven for a in "fr"]
    peaks = [p for p in peaks if not any(map(math.isnan, p))]
    known = [(r, a) for r in usable for a in "fr" if not math.isnan(number(r[f"k_{a}"]))]
    most = max((worst(r, "over") for r in usable), default=math.nan)
    return (
        f"| {name} | {len(driven)} of {len(data)} | {wilson(len(usable), len(driven))} | {wilson(len(over), len(usable))} | {100 * most:+.0f} % "
        f"| {wilson(sum(a == b for a, b in peaks), len(peaks))} | {sum(a == 1 for a, _ in peaks)} "
        f"| {wilson(sum(inside(r, a) for r, a in known), len(known))} | {quantiles([number(r[f'short_{a}']) for r, a in known])} |"
    )


def with_v_y():
    data = rows("plants_draws.csv") + rows("plants_foreign.csv")
    lines = [
        "## With v_y",
        "",
        "| plant | drives that did not spin or stand early | `accepted` or `accepted_within` | promise more than 10 % of the peak too much | most "
        "| peak reached or not: decided right, axles | of them reached | stiffness inside its 90 % interval, axles | promised less than driven: 10 / 50 / 90 % of the axles |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    lines += [line(name, group) for name, group in grouped(data, plant).items()]
    return lines + [line("all", data), ""]


def without_v_y():
    lines = [
        "## Without v_y, on others' plants",
        "",
        "v_y is 0 throughout and is estimated from poses as in [signals.md](signals.md).",
        "",
        "| plant | recorded | usable sets | stiffness off, median size front / rear | inside its 90 % interval | understeer gradient, deg/g: true, off by (median sizes); inside its 90 % interval | promised too much: harmful, most |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    median = lambda values: sorted(values)[len(values) // 2] if values else math.nan
    for (name, what), group in grouped(rows("plants_no_v_y.csv"), lambda r: (plant(r), r["what"])).items():
        usable = [r for r in group if r["status"].startswith("accepted")]
        off = lambda a: 100 * median([abs(number(r[f"k_{a}"]) / number(r[f"k_true_{a}"]) - 1) for r in usable])
        over = [worst(r, "over") for r in usable]
        told = [r for r in usable if r["understeer_lo"] not in ("", "NaN")]
        size = lambda value: median([abs(value(r)) for r in usable])
        within = sum(number(r["understeer_lo"]) <= number(r["understeer_true"]) <= number(r["understeer_hi"]) for r in told)
        lines.append(
            f"| {name} | {what} | {len(usable)} of {len(group)} | {off('f'):.0f} % / {off('r'):.0f} % | {sum(inside(r, a) for r in usable for a in 'fr')} of {2 * len(usable)} "
            f"| {size(lambda r: number(r['understeer_true'])):.2f}, {size(lambda r: number(r['understeer']) - number(r['understeer_true'])):.2f}; {within} of {len(told)} "
            f"| {sum(o > HARMFUL for o in over)}, {100 * max(over, default=math.nan):+.0f} % |"
        )
    return lines


def main():
    text = (HERE / "plants_head.md").read_text().rstrip().splitlines() + [""] + with_v_y()
    if rows("plants_no_v_y.csv"):
        text += without_v_y()
    (HERE / "plants.md").write_text("\n".join(text).rstrip() + "\n")


if __name__ == "__main__":
    main()
