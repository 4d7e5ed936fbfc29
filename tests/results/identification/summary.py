#!/usr/bin/env python3
"""Makes accuracy.md, residuals.md and paper.md of their heads (*_head.md) and of what the examples `accuracy`, `residuals` and `paper` wrote."""

import csv
import statistics
from math import sqrt
from pathlib import Path

HERE = Path(__file__).parent
# Medians within this share of the best are a tie.
TIE = 0.05
# A stiffness further off than this is wrong.
WRONG = 0.25
# What the reference car's tires give at no slip and static load, over that load, front and rear (nodes/lib/reference_car/src/cars.rs).
TIRES = {"f1tenth": (8.6, 10.2), "formula_student": (15.5, 17.5), "race_car": (18.0, 21.0), "passenger_car": (13.5, 17.0)}


def rows(name):
    with open(HERE / name, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def number(row, key):
    return float(row[key])


def refused(row):
    return int(row["iterations"]) == 0


def ratio(row, axle, kind=""):
    return number(row, f"{kind}rmse_{axle}") / number(row, f"{kind}floor_{axle}")


def covered(row, name, truth=None):
    return number(row, f"{name}_lo") <= number(row, truth or f"{name}_true") <= number(row, f"{name}_hi")


def rate(hits, n):
    """A rate with its 90 % Wilson interval."""
    if n == 0:
        return "none"
    z, p = 1.645, hits / n
    middle = (p + z * z / 2 / n) / (1 + z * z / n)
    half = z / (1 + z * z / n) * sqrt(p * (1 - p) / n + z * z / 4 / n / n)
    return f"{100 * p:.1f} % ({hits} of {n}; {100 * (middle - half):.1f}-{100 * (middle + half):.1f})"


def plants(out):
    bags = rows("accuracy_bags.csv")
    # Those of the draw are numbered: bmw_01; the others named after their friction.
    drawn = lambda r: r["run"][-3] == "_"
    groups = [
        ("Reference car, test", rows("accuracy_reference.csv")),
        ("slipx, test", [r for r in bags if drawn(r) and r["run"].startswith("slipx")]),
        ("CommonRoad, test", [r for r in bags if drawn(r) and not r["run"].startswith("slipx")]),
        ("Development (looked at while revising)", [r for r in bags if not drawn(r)]),
    ]
    for title, group in groups:
        balanced = "balanced_rmse_f" in group[0]
        out.append(f"\n### {title}\n")
        more = " loads balanced, front | rear |" if balanced else ""
        out.append(f"| run | RMSE front | rear | ratio to the floor, front | rear |{more} peak reached, front | rear | iterations | accepted |")
        out.append("| --- |" + " --- |" * (10 if balanced else 8))
        used = [r for r in group if not refused(r)]
        for r in used:
            yes = lambda key: "yes" if float(r[key]) else "no"
            out.append(
                f"| {r['run']} | {number(r, 'rmse_f'):.4f} | {number(r, 'rmse_r'):.4f} | {ratio(r, 'f'):.2f} | {ratio(r, 'r'):.2f} | "
                + (f"{ratio(r, 'f', 'balanced_'):.2f} | {ratio(r, 'r', 'balanced_'):.2f} | " if balanced else "")
                + f"{yes('df_reached')} | {yes('dr_reached')} | {r['iterations']} | {yes('accepted')} |"
            )
        for axle, name in (("f", "front"), ("r", "rear")):
            text = f"\nMedian ratio {name}: {statistics.median(ratio(r, axle) for r in used):.2f}"
            if balanced:
                text += f"; loads balanced: {statistics.median(ratio(r, axle, 'balanced_') for r in used):.2f}"
            out.append(text)
    both = [r for title, group in groups[:3] for r in group if not refused(r)]
    for axle, name in (("f", "front"), ("r", "rear")):
        out.append(f"\nAll {len(both)} test drives, {name}: median {statistics.median(ratio(r, axle) for r in both):.2f}")
        for r in group:
            if refused(r):
                out.append(f"\nRefused: {r['run']}: {r['reasons']}")


def draws(out):
    every = rows("accuracy_draws.csv")
    used = [r for r in every if not refused(r)]
    out.append(f"\n{len(every)} drives of 15 s, {len(every) - len(used)} refused (spun or stood too early).\n")
    out.append("| 90 % interval of | covers the truth | median half-width | median error |")
    out.append("| --- | --- | --- | --- |")
    for name, text in (("kf", "stiffness front"), ("kr", "stiffness rear")):
        half = statistics.median((number(r, name + "_hi") - number(r, name + "_lo")) / 2 / number(r, name + "_true") for r in used)
        off = statistics.median(abs(number(r, name) / number(r, name + "_true") - 1) for r in used)
        hits = sum(covered(r, name) for r in used)
        out.append(f"| {text} | {rate(hits, len(used))} | {100 * half:.1f} % | {100 * off:.1f} % |")
    both = sum(covered(r, k) for r in used for k in ("kf", "kr"))
    out.append(f"| both stiffnesses | {rate(both, 2 * len(used))} | | |")
    peaks = [(r, a) for r in used for a in "fr" if float(r[f"d{a}_reached"])]
    hits = sum(covered(r, f"d{a}", f"d{a}_floor") for r, a in peaks)
    if peaks:
        half = statistics.median((number(r, f"d{a}_hi") - number(r, f"d{a}_lo")) / 2 / number(r, f"d{a}_floor") for r, a in peaks)
        off = [abs(number(r, f"d{a}") / number(r, f"d{a}_floor") - 1) for r, a in peaks]
        out.append(f"| peak friction, where reached | {rate(hits, len(peaks))} | {100 * half:.1f} % | {100 * statistics.median(off):.1f} % |")
    signals = (("delay", "s"), ("gain", ""), ("offset", "rad"), ("lever", "m"), ("vybias", "m/s"), ("gyro", "rad/s"))
    for name, unit in signals:
        hits = sum(covered(r, name) for r in used)
        half = statistics.median((number(r, name + "_hi") - number(r, name + "_lo")) / 2 for r in used)
        off = statistics.median(abs(number(r, name) - number(r, name + "_true")) for r in used)
        out.append(f"| {name} | {rate(hits, len(used))} | {half:.4f} {unit} | {off:.4f} {unit} |")
    out.append("\nClaims of a peak:\n")
    for a, name in (("f", "front"), ("r", "rear")):
        claims = [r for r in used if float(r[f"d{a}_reached"])]
        far = sum(abs(number(r, f"d{a}") / number(r, f"d{a}_floor") - 1) > 0.1 for r in claims)
        full = [r for r in used if number(r, f"d{a}_true") > 0.97 * number(r, f"d{a}_floor")]
        found = sum(bool(float(r[f"d{a}_reached"])) for r in full)
        out.append(f"- {name}: {len(claims)} claimed, {far} of them with D off by more than 10 %; of {len(full)} drives that really saturate, {found} claimed")
    for axle, name in (("f", "front"), ("r", "rear")):
        out.append(f"- median ratio to the floor {name}: {statistics.median(ratio(r, axle) for r in used):.2f}; accepted runs: {statistics.median(ratio(r, axle) for r in used if int(r['accepted'])):.2f}")
    accepted = [r for r in used if int(r["accepted"])]
    apart = [max(abs(number(r, k) / number(r, k + "_true") - 1) for k in ("kf", "kr")) for r in accepted]
    out.append(f"- largest error of an accepted stiffness: {100 * max(apart):.0f} %; 95th percentile {100 * sorted(apart)[len(apart) * 95 // 100]:.0f} %")
    out.append(f"- accepted: {len(accepted)} of {len(used)}; with a stiffness off by more than 25 %: {sum(bool(wrong(r)) for r in accepted)}")


def off(row, axle, truth):
    """Error of a stiffness, as a share: of the floor's, or of the tires' own."""
    true = number(row, f"k{axle}_true") if truth == "floor" else TIRES[row["run"].split()[0]]["fr".index(axle)]
    return number(row, "k" + axle) / true - 1


def wrong(row, *truths):
    return [a for a in "fr" if all(abs(off(row, a, truth)) > WRONG for truth in truths or ("floor",))]


def two_truths(out):
    """The floor's B C D against the tires' own stiffness."""
    sets = (("9000-9599", rows("accuracy_draws.csv")), ("9750-9826, 9875-9951", rows("accuracy_draws_fresh.csv")))
    out.append("\n| draws | accepted | off by more than 25 % from the floor's | from the tires' own | from both |")
    out.append("| --- | --- | --- | --- | --- |")
    for name, every in sets:
        accepted = [r for r in every if not refused(r) and int(r["accepted"])]
        count = lambda *truths: sum(bool(wrong(r, *truths)) for r in accepted)
        out.append(f"| {name} ({len(every)}) | {len(accepted)} | {count('floor')} | {count('tires')} | {count('floor', 'tires')} |")
    out.append("\n| accepted and wrong by the floor | axle | found, over load | the floor's | the tires' own |")
    out.append("| --- | --- | --- | --- | --- |")
    for _, every in sets:
        for r in every:
            for a in wrong(r) if not refused(r) and int(r["accepted"]) else ():
                own = TIRES[r["run"].split()[0]]["fr".index(a)]
                out.append(f"| {r['run']} | {'front' if a == 'f' else 'rear'} | {number(r, 'k' + a):.1f} | {number(r, f'k{a}_true'):.1f} | {own} |")


def priors(out):
    out.append("\n| prior | sigma | used | accepted | with D at the prior | D off by more than 25 % | stiffness off by more than 25 % | refused as contradicting |")
    out.append("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for off, text, sigma in (("0", "the road's mu", "0.1"), ("0", "the road's mu", "0.2"), ("0.4", "0.4 above it", "0.1"), ("0.4", "0.4 above it", "0.2")):
        used = [r for r in rows(f"accuracy_prior_{off}_{sigma}.csv") if not refused(r)]
        accepted = [r for r in used if int(r["accepted"])]
        held = sum("the prior's" in r["reasons"] for r in accepted)
        against = sum("contradicts" in r["reasons"] for r in used)
        worst = lambda r, of, truth: max(abs(number(r, of + a) / number(r, f"{of}{a}_{truth}") - 1) for a in "fr")
        out.append(
            f"| {text} | {sigma} | {len(used)} | {len(accepted)} | {held} | "
            f"{sum(worst(r, 'd', 'floor') > WRONG for r in accepted)} | {sum(bool(wrong(r)) for r in accepted)} | "
            f"{against} |"
        )


def spread(values, digits=3):
    return f"{statistics.median(values):.{digits}f} ({min(values):.{digits}f}-{max(values):.{digits}f})"


def residuals(out):
    every = rows("residuals.csv")
    methods = list(dict.fromkeys((r["prior"], r["method"]) for r in every))
    group = {m: [r for r in every if (r["prior"], r["method"]) == m] for m in methods}
    of = lambda m, key: [number(r, key) for r in group[m]]
    floor = [spread([number(r, k) for r in every], 4) for k in ("floor_front", "floor_rear")]
    out.append(f"\nFloor: {floor[0]} front, {floor[1]} rear.\n")
    out.append("| prior | method | RMSE front | rear | rollout v_y, mm/s | yaw rate, mrad/s | turns | accepted | s |")
    out.append("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    figures = ("rmse_front", "rmse_rear", "rollout_v_y_mps", "rollout_yaw_rate_radps")
    for prior in dict.fromkeys(p for p, _ in methods):
        best = {k: min(statistics.median(of(m, k)) for m in methods if m[0] == prior) for k in figures}
        for m in (m for m in methods if m[0] == prior):
            cells = []
            for k in figures:
                text = spread(of(m, k), 4) if k.startswith("rmse") else spread([1e3 * v for v in of(m, k)], 1)
                tie = statistics.median(of(m, k)) <= (1 + TIE) * best[k]
                cells.append(f"**{text}**" if tie else text)
            accepted = sum(r["accepted"] == "true" for r in group[m])
            out.append(
                f"| {prior} | {m[1]} | " + " | ".join(cells) + f" | {', '.join(r['turns'] for r in group[m])} | {accepted} of {len(group[m])} | "
                f"{statistics.median(of(m, 'seconds')):.2f} |"
            )
    out.append("\n![RMSE of every method and drive](residuals.svg)")


def paper(out):
    reference, foreign = rows("paper.csv"), rows("paper_foreign.csv")
    slipx = [r for r in foreign if r["run"].startswith("slipx")]
    commonroad = [r for r in foreign if not r["run"].startswith("slipx")]
    for every, plant in ((reference, "Reference car"), (slipx, "slipx"), (commonroad, "CommonRoad")):
        for data, title in (("first", "triggered in the first acceleration: the first 9 s"), ("whole", "the whole drive")):
            out.append(f"\n## {plant}, {title}\n")
            out.append("| network | prior | RMSE front, median (range) | rear | turns | settled | s, median |")
            out.append("| --- | --- | --- | --- | --- | --- | --- |")
            for prior in ("none", "road"):
                for network in ("mlp", "rnn", "s4"):
                    group = [r for r in every if (r["data"], r["prior"], r["network"]) == (data, prior, network)]
                    turns = ", ".join(r["turns"] for r in group)
                    settled = sum(r["converged"] == "true" for r in group)
                    figures = [spread([number(r, k) for r in group]) for k in ("rmse_front", "rmse_rear")]
                    seconds = statistics.median(number(r, "seconds") for r in group)
                    out.append(f"| {network} | {prior} | {figures[0]} | {figures[1]} | {turns} | {settled} of {len(group)} | {seconds:.1f} |")
        floors = [spread([number(r, k) for r in every]) for k in ("floor_front", "floor_rear")]
        out.append(f"\nFloor: {floors[0]} front, {floors[1]} rear.")
    out.append("\n![RMSE of every network and drive on the reference car](paper.svg)")
    out.append("\n![The same on the foreign plants](paper_foreign.svg)")


def robustness(out):
    every = rows("accuracy_robustness.csv")
    cars = list(dict.fromkeys(r["run"].split(":")[0] for r in every))
    kinds = [k for k in dict.fromkeys(r["run"].split(": ")[1] for r in every) if not k.startswith(("start", "prior"))]
    out.append("\nRatio of the RMSE to the floor, front/rear; ! = not accepted, refused = no fit.\n")
    out.append("| recording | " + " | ".join(cars) + " |")
    out.append("| --- |" + " --- |" * len(cars))
    at = {tuple(r["run"].split(": ")): r for r in every}
    for kind in kinds:
        cells = []
        for car in cars:
            r = at[car, kind]
            cells.append("refused" if refused(r) else f"{ratio(r, 'f'):.2f}/{ratio(r, 'r'):.2f}" + ("" if int(r["accepted"]) else " !"))
        out.append(f"| {kind} | " + " | ".join(cells) + " |")
    out.append("\nLargest change of the end point, on axles whose peak was reached, against the prior that is right (prior off by 0.3) and among 12 starts (mu0 0.3, 0.51, 0.8, 1.2, three shapes each):\n")
    out.append("| car | K, priors | D, priors | K, starts | D, starts |")
    out.append("| --- | --- | --- | --- | --- |")
    for car in cars:
        cells = []
        for kind in ("prior", "start"):
            group = [r for r in every if r["run"].startswith(f"{car}: {kind}") and not refused(r)]
            base = next((r for r in group if r["run"].endswith("off by 0")), group[0])
            for names in (("kf", "kr"), ("df", "dr")):
                change = [
                    abs(number(r, n) / number(base, n) - 1)
                    for r in group
                    for n in names
                    if float(r["d" + n[1] + "_reached"]) and float(base["d" + n[1] + "_reached"])
                ]
                cells.append(f"{100 * max(change):.1f} %" if change else "not reached")
        out.append(f"| {car} | " + " | ".join(cells) + " |")


def write(name, parts):
    """The head of a page, and its tables."""
    out = [(HERE / f"{name}_head.md").read_text(encoding="utf-8").rstrip()]
    for title, part in parts:
        if title:
            out.append(f"\n## {title}")
        part(out)
    (HERE / f"{name}.md").write_text("\n".join(out) + "\n", encoding="utf-8")


def main():
    write(
        "accuracy",
        [
            ("Plants", plants),
            ("Intervals and claims of a peak", draws),
            ("The floor's stiffness and the tires' own", two_truths),
            ("Draws with a friction prior", priors),
            ("Robustness", robustness),
        ],
    )
    write("residuals", [("", residuals)])
    write("paper", [("", paper)])


if __name__ == "__main__":
    main()
