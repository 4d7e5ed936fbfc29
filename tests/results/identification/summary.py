#!/usr/bin/env python3
"""Makes accuracy.md of accuracy_plants.csv, accuracy_draws.csv and accuracy_robustness.csv, which the example `accuracy` wrote."""

import csv
import statistics
from math import sqrt
from pathlib import Path

HERE = Path(__file__).parent


def rows(name):
    with open(HERE / name, encoding="utf-8") as file:
        return list(csv.DictReader(file))


def number(row, key):
    return float(row[key])


def refused(row):
    return int(row["iterations"]) == 0


def ratio(row, axle):
    return number(row, f"rmse_{axle}") / number(row, f"floor_{axle}")


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
    every = rows("accuracy_plants.csv")
    groups = [
        ("Reference car, test", lambda r: " seed " in r["run"]),
        ("slipx and CommonRoad, test", lambda r: r["run"].startswith("test_")),
        ("Development (looked at while revising)", lambda r: " seed " not in r["run"] and not r["run"].startswith("test_")),
    ]
    for title, inside in groups:
        out.append(f"\n### {title}\n")
        out.append("| run | RMSE front | rear | ratio to the floor, front | rear | peak reached, front | rear | iterations | accepted |")
        out.append("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
        group = [r for r in every if inside(r)]
        used = [r for r in group if not refused(r)]
        for r in used:
            yes = lambda key: "yes" if float(r[key]) else "no"
            out.append(
                f"| {r['run']} | {number(r, 'rmse_f'):.4f} | {number(r, 'rmse_r'):.4f} | {ratio(r, 'f'):.2f} | {ratio(r, 'r'):.2f} | "
                f"{yes('df_reached')} | {yes('dr_reached')} | {r['iterations']} | {yes('accepted')} |"
            )
        for axle, name in (("f", "front"), ("r", "rear")):
            out.append(f"\nMedian ratio {name}: {statistics.median(ratio(r, axle) for r in used):.2f}")
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
    wrong = sum(max(abs(number(r, k) / number(r, k + "_true") - 1) for k in ("kf", "kr")) > 0.25 for r in accepted)
    out.append(f"- accepted: {len(accepted)} of {len(used)}; with a stiffness off by more than 25 %: {wrong}")


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
    out.append("\nLargest change of the end point, where the peak was reached, against the prior that is right (prior off by 0.3) and among 12 starts (mu0 0.3, 0.51, 0.8, 1.2, three shapes each):\n")
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
                    if n[0] == "k" or (float(r[n + "_reached"]) and float(base[n + "_reached"]))
                ]
                cells.append(f"{100 * max(change):.1f} %" if change else "not reached")
        out.append(f"| {car} | " + " | ".join(cells) + " |")


def main():
    out = [(HERE / "accuracy_head.md").read_text(encoding="utf-8").rstrip(), "\n## Plants"]
    plants(out)
    out.append("\n## Intervals and claims of a peak")
    draws(out)
    out.append("\n## Robustness")
    robustness(out)
    (HERE / "accuracy.md").write_text("\n".join(out) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
