#!/usr/bin/env python3
"""Makes envelope.md of envelope_head.md and the rows that `examples/envelope` wrote (envelope_*.csv beside this file)."""

import csv
import math
from pathlib import Path

HERE = Path(__file__).parent
HARMFUL = 0.1


def number(text):
    return float(text) if text not in ("", "NaN") else math.nan


def rows(name):
    path = HERE / name
    return list(csv.DictReader(path.open())) if path.exists() else []


def wilson(k, n):
    if n == 0:
        return "-"
    z, p = 1.96, k / n
    middle = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return f"{k} of {n}: {100 * p:.1f} % ({100 * max(0, middle - half):.1f}-{100 * (middle + half):.1f})"


def worst(row, name):
    return max(number(row[f"{name}_f"]), number(row[f"{name}_r"]))


def quantiles(values):
    values = sorted(v for v in values if not math.isnan(v))
    if not values:
        return "-"
    at = lambda share: values[min(len(values) - 1, int(share * len(values)))]
    return f"{100 * at(0.1):.0f} / {100 * at(0.5):.0f} / {100 * at(0.9):.0f} %"


def table(title, data):
    driven = [r for r in data if "s of data" not in r["reasons"] and r["status"] != "failed"]
    usable = [r for r in driven if r["status"].startswith("accepted")]
    known = [r for r in usable if not math.isnan(number(r["k_true_f"]))]
    over = [r for r in known if worst(r, "over") > HARMFUL]
    strict = [r for r in known if worst(r, "over_shown") > HARMFUL]
    found = [r for r in driven if not math.isnan(worst(r, "over_found")) and worst(r, "over_found") > HARMFUL]
    lines = [
        f"### {title}",
        "",
        "| what | |",
        "| --- | --- |",
        f"| drives that did not spin or stand early | {len(driven)} of {len(data)} |",
        f"| `accepted` or `accepted_within` | {wilson(len(usable), len(driven))} |",
        f"| of them `accepted` | {sum(r['status'] == 'accepted' for r in usable)} |",
        f"| promise more than 10 % of the true peak too much | {wilson(len(over), len(known))} |",
        f"| the same over the largest force that was driven | {wilson(len(strict), len(known))} |",
        f"| the most likely curve would have, over all drives | {wilson(len(found), len(driven))} |",
        f"| unstable at the speeds driven | {sum(number(r['unstable']) > 0 for r in usable)} |",
    ]
    for status in ("accepted", "accepted_within"):
        short = [number(r[f"short_{a}"]) for r in known if r["status"] == status for a in "fr"]
        lines.append(f"| promised less than driven, `{status}`: 10 / 50 / 90 % of the axles | {quantiles(short)} |")
    peaks = [(number(r[f"reached_{a}"]), number(r[f"said_{a}"])) for r in driven for a in "fr"]
    peaks = [p for p in peaks if not any(map(math.isnan, p))]
    lines += [
        f"| peak reached or not: decided right | {wilson(sum(a == b for a, b in peaks), len(peaks))} |",
        f"| said though not reached; not said though reached | {wilson(sum(a < b for a, b in peaks), sum(a == 0 for a, _ in peaks))}; "
        f"{wilson(sum(a > b for a, b in peaks), sum(a == 1 for a, _ in peaks))} |",
        "",
    ]
    return lines


def priors(title, data):
    usable = [r for r in data if r["status"].startswith("accepted")]
    over = [r for r in usable if worst(r, "over") > HARMFUL]
    lines = [f"### {title}", ""]
    lines += [
        f"{len(data)} drives. `accepted` or `accepted_within` sets that promise more than 10 % too much: {wilson(len(over), len(usable))}.",
        "",
        "| prior off by | provisional sets | with a D off by more than 25 % | axles whose D is the prior's: off by more than 25 % | rms of ln(D/true) | promise more than 10 % too much within the slips driven |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for low, high in [(-0.6, -0.3), (-0.3, -0.1), (-0.1, 0.1), (0.1, 0.3), (0.3, 0.6), (-0.6, 0.6)]:
        inside = [r for r in data if low <= number(r["prior"]) - number(r["mu"]) < high]
        sets = [
            [
                (number(r[f"d_prior_{a}"]) / number(r[f"peak_true_{a}"]), number(r[f"over_prior_{a}"]))
                for a in "fr"
                if not math.isnan(number(r[f"d_prior_{a}"]))
            ]
            for r in inside
        ]
        sets = [s for s in sets if s]
        axles = [axle for s in sets for axle in s]
        off = [abs(d - 1) > 0.25 for d, _ in axles]
        off_sets = sum(any(abs(d - 1) > 0.25 for d, _ in s) for s in sets)
        above = sum(o > HARMFUL for _, o in axles)
        rms = math.sqrt(sum(math.log(d) ** 2 for d, _ in axles) / len(axles)) if axles else math.nan
        name = "all" if high - low > 1 else f"{low} to {high}"
        lines.append(
            f"| {name} ({len(inside)} drives) | {len(sets)} | {wilson(off_sets, len(sets))} | {wilson(sum(off), len(axles))} | {rms:.2f} | {wilson(above, len(axles))} |"
        )
    return lines + [""]


def floors(data):
    driven = [r for r in data if r["status_whole"] != "failed"]
    usable = lambda r, side: r[f"status_{side}"].startswith("accepted")
    over = lambda r, side: usable(r, side) and number(r[f"over_{side}"]) > HARMFUL
    lines = [
        "### Two floors in one drive",
        "",
        "| driver | friction after over before | drives | cut in two | of these sets of before, after usable | promise more than 10 % too much: of before, of after | not cut: usable | promise more than 10 % of the slipperier floor's peak too much | in one piece: usable | too much |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    ranges = [(0.4, 0.6), (0.6, 0.8), (0.8, 1.25), (1.25, 1.6), (1.6, 2.1), (0.4, 2.1)]
    for driver in ("adapts", "keeps"):
        for low, high in ranges:
            inside = [r for r in driven if r["driver"] == driver and low <= number(r["mu_after"]) / number(r["mu"]) < high]
            cut = [r for r in inside if int(r["floors"]) > 1]
            one = [r for r in inside if int(r["floors"]) == 1]
            count = lambda test, rows: sum(test(r) for r in rows)
            cells = [
                driver,
                f"{low} to {high}" if high - low < 1.5 else "all",
                len(inside),
                len(cut),
                f"{count(lambda r: usable(r, 'before'), cut)}, {count(lambda r: usable(r, 'after'), cut)}",
                f"{count(lambda r: over(r, 'before'), cut)}, {count(lambda r: over(r, 'after'), cut)}",
                count(lambda r: usable(r, "after"), one),
                count(lambda r: over(r, "after"), one),
                count(lambda r: usable(r, "whole"), inside),
                count(lambda r: over(r, "whole"), inside),
            ]
            lines.append("| " + " | ".join(map(str, cells)) + " |")
    return lines + [""]


def bags(data):
    lines = ["### Recordings and plants of others, bag by bag", "", "| bag | status | D promised front/rear | slips driven, deg | peak said | promises too much at most | promises too little |", "| --- | --- | --- | --- | --- | --- | --- |"]
    for r in data:
        f = lambda name, digits=2, scale=1.0: "/".join(
            "-" if math.isnan(number(r[f"{name}_{a}"])) else f"{scale * number(r[f'{name}_{a}']):.{digits}f}" for a in "fr"
        )
        said = "/".join("yes" if number(r[f"said_{a}"]) > 0 else "no" for a in "fr")
        lines.append(
            f"| {r['run']} | {r['status']} | {f('d_set')} | {f('slip', 1, 180 / math.pi)} | {said} | {f('over_shown', 1, 100)} % | {f('short', 0, 100)} % |"
        )
    return lines + [""]


def main():
    text = (HERE / "envelope_head.md").read_text().splitlines() + [""]
    for title, name in [
        ("Reference car, development", "envelope_draws_development.csv"),
        ("Reference car, test", "envelope_draws.csv"),
        ("slipx and CommonRoad, test", "envelope_foreign.csv"),
    ]:
        data = rows(name)
        if data:
            text += table(title, data)
    data = rows("envelope_priors.csv")
    if data:
        text += priors("Wrong priors", data)
    data = rows("envelope_floors.csv")
    if data:
        text += floors(data)
    data = rows("envelope_bags.csv") + rows("envelope_foreign.csv")
    if data:
        text += bags(data)
    (HERE / "envelope.md").write_text("\n".join(text).rstrip() + "\n")


if __name__ == "__main__":
    main()
