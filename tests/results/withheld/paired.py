#!/usr/bin/env python3
"""Two programs on the same cases: what each names, case by case, and their rates side by side with Wilson intervals and McNemar's exact test.

    paired.py OUT.csv LABELS VERDICTS OTHER [LABELS VERDICTS OTHER ...]      OTHER may be "-": one program alone

LABELS of `gripsight withheld make`, VERDICTS and OTHER of `gripsight withheld diagnose` by the one program and the other. A program from before `track_width_m`
reads vehicle files without that line only; a batch copied without it keeps its labels. Cases that either has no verdict of are left out, and counted.

In scope: race pace, every effect at twice its detection limit or more (others' plants: all). A foreign plant's own effects are no false names, and no first ones.
"""

import csv
import json
import math
import sys
from pathlib import Path

HEAD = ["batch", "case", "family", "car", "kind", "effects", "severity", "race_pace", "left_out", "contained", "verdict", "names", "sizes_inside", "sizes"]
HEAD += ["verdict_other", "names_other", "sizes_inside_other", "sizes_other", "site"]
SCOPE = 2.0
LIKELY = 0.5
Z = 1.96


def said(path, effects):
    """Verdict, names in the order of what they close, and of those put in: how many sizes inside their intervals, of how many."""
    gap = json.loads(path.read_text())
    accepted = [e for e in gap["effects"] if e["accepted"]]
    inside = total = 0
    for effect in effects:
        found = next((e for e in accepted if e["name"] == effect["name"]), None)
        for name, true in (effect.get("library_parameters") or {}).items() if found else ():
            stated = found["parameters"].get(name)
            if stated and stated.get("low") is not None and math.isfinite(stated["low"]) and true != 0.0:
                total += 1
                inside += stated["low"] <= true <= stated["high"]
    return gap["verdict"], [e["name"] for e in accepted], inside, total


def sites(path):
    """The sites that are likelier than not, and where which mechanism is listed."""
    listed = json.loads(path.read_text()).get("sites", [])
    likely = {s["name"] for s in listed if (s["probability"] or 0.0) >= LIKELY}
    return likely, [(m["name"], s["name"]) for s in listed for m in s["mechanisms"]]


def with_sites(rows, blamed, listed):
    """Of each row whether a site of its first effect is likelier than not; the sites of an effect are those at which any verdict lists it."""
    for row, likely in zip(rows, blamed, strict=True):
        first = row["effects"].split()[:1]
        of_first = {site for name, site in listed if [name] == first}
        row["site"] = bool(likely & of_first) if of_first else ""


def collected(batches):
    rows, missing = [], 0
    blamed, listed = [], set()
    for labels, *verdicts in batches:
        for case in json.loads(Path(labels).read_text())["cases"]:
            paths = [Path(v) / case["case"] / "gap.json" if v != "-" else None for v in verdicts]
            if not all(p is None or p.exists() for p in paths):
                missing += 1
                continue
            effects = case["effects"]
            severity = [(e.get("oracle") or {}).get("severity") for e in effects]
            row = [Path(labels).stem, case["case"], case["family"], case["circumstances"].get("car", ""), case["kind"]]
            row += [" ".join(e["name"] for e in effects), " ".join("" if s is None else f"{s:.1f}" for s in severity)]
            row += [case["race_pace"], " ".join(case["without"]), " ".join(case["contained"])]
            for path in paths:
                verdict, names, inside, total = said(path, effects) if path else ("", [], 0, 0)
                row += [verdict, " ".join(names), inside, total]
            rows.append(dict(zip(HEAD, [*row, ""], strict=True)))
            likely, at = sites(paths[0])
            blamed.append(likely)
            listed.update(at)
    with_sites(rows, blamed, listed)
    return rows, missing


def wilson(k, n):
    if n == 0:
        return "-"
    p = k / n
    middle = (p + Z * Z / (2 * n)) / (1 + Z * Z / n)
    half = Z * math.sqrt(p * (1 - p) / n + Z * Z / (4 * n * n)) / (1 + Z * Z / n)
    return f"{k} of {n}, {100 * p:.0f} % [{max(0.0, 100 * (middle - half)):.0f}, {100 * (middle + half):.0f}]"


def mcnemar(pairs):
    """Two-sided exact p of the cases in which only one of both is right."""
    one, other = sum(a and not b for a, b in pairs), sum(b and not a for a, b in pairs)
    n = one + other
    tail = sum(math.comb(n, k) for k in range(min(one, other) + 1)) / 2**n
    return f"{one} / {other}, p = {min(1.0, 2 * tail):.2f}"


def line(what, rows, right):
    pairs = [(right(r, ""), right(r, "_other")) for r in rows]
    rates = [wilson(sum(p[i] for p in pairs), len(pairs)) for i in (0, 1)]
    if any(r["verdict_other"] for r in rows):
        print(f"| {what} | {rates[0]} | {rates[1]} | {mcnemar(pairs)} |")
    else:
        print(f"| {what} | {rates[0]} | - | - |")


def names(row, which):
    return row["names" + which].split()


def first(row, which):
    """Whether the first name is the effect put in; a plant's own effects, which may be larger, do not count."""
    put_in = row["effects"].split()
    told = [n for n in names(row, which) if n in put_in or n not in row["contained"].split()]
    return bool(told) and told[0] in put_in


def all_named(row, which):
    return set(row["effects"].split()) <= set(names(row, which))


def a_wrong_name(row, which):
    return bool(set(names(row, which)) - set(row["effects"].split()) - set(row["contained"].split()))


def none_of_these(row, which):
    return row["verdict" + which] == "none_of_these"


def in_scope(row):
    severity = [float(s) for s in row["severity"].split()]
    return not severity or (str(row["race_pace"]) == "True" and min(severity) >= SCOPE)


def report(rows, family):
    of = [r for r in rows if r["family"] == family]
    of_kind = lambda *kinds: [r for r in of if r["kind"] in kinds and in_scope(r)]
    print(f"\n{family}: {len(of)} cases\n\n| | the one | the other | only one right, only the other; McNemar |\n| --- | --- | --- | --- |")
    told = [r["site"] for r in of_kind("single") if r["site"] != ""]
    print(f"| one effect: its site blamed | {wilson(sum(told), len(told))} | | |")
    line("one effect: named first", of_kind("single"), first)
    line("two effects: both named", of_kind("pair"), all_named)
    line("left out: `none_of_these`", of_kind("deleted"), none_of_these)
    line("not in the library: `none_of_these`", of_kind("out_of_library"), none_of_these)
    line("a name for what is not there: all cases", of, a_wrong_name)
    line("of these without effect", [r for r in of if r["kind"] == "none"], a_wrong_name)
    plant = lambda row: row["car"].rpartition("_")[0]
    for name in sorted({plant(r) for r in of}) if family == "foreign" else ():
        line(f"{name}: one effect, named first", [r for r in of_kind("single") if plant(r) == name], first)
        line(f"{name}: a name for what is not there", [r for r in of if plant(r) == name], a_wrong_name)
    for which, who in (("", "the one"), ("_other", "the other")):
        inside, total = (sum(int(r[k + which]) for r in of) for k in ("sizes_inside", "sizes"))
        print(f"\nsizes inside, {who}: {wilson(inside, total)}")


def main():
    out, *rest = sys.argv[1:]
    if not rest or len(rest) % 3:
        sys.exit(__doc__)
    rows, missing = collected([rest[i : i + 3] for i in range(0, len(rest), 3)])
    with open(out, "w", newline="") as file:
        writer = csv.DictWriter(file, HEAD, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    print(f"{len(rows)} cases, {missing} without all verdicts")
    for family in sorted({r["family"] for r in rows}):
        report(rows, family)


if __name__ == "__main__":
    main()
