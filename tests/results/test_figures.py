"""README's figures are those of the tables: of each table that has rows, what README says of it is counted again."""

import csv
import math
import sys
from pathlib import Path

RESULTS = Path(__file__).parent
sys.path.insert(0, str(RESULTS / "withheld"))
import paired  # noqa: E402
README = (RESULTS.parents[1] / "README.md").read_text(encoding="utf-8")


def rows(path):
    with open(RESULTS / path, newline="", encoding="utf-8") as table:
        return list(csv.DictReader(table))


def said_of(page):
    """The lines of README's table that name a page of the results."""
    return "\n".join(line for line in README.splitlines() if line.startswith("| ") and f"](tests/results/{page})" in line)


def percent(part, whole):
    return f"{100 * part / whole:.1f} %"


def test_every_effect_at_two_sizes():
    drives = [r for car in ("f1tenth", "formula_student") for r in rows(f"gap/effects_{car}.csv") if r["effect"] != "none"]
    first = sum(r["answer"].startswith("named first") for r in drives)
    other = sum(r["answer"].startswith(("named later", "wrong name")) for r in drives)
    sizes = [r["answer"].endswith("inside") for r in drives if r["answer"].startswith("named")]
    said = said_of("gap/README.md")
    assert f"named first in {first} of {len(drives)} drives, another name first in {other}" in said
    assert f"{sum(sizes)} of the {len(sizes)} sizes named" in said


def test_a_recording_and_itself_with_an_effect():
    pairs = [r for r in rows("gap/recordings_compared.csv") if r["kind"] == "injected"]
    site, first = (sum(r[column] == "True" for r in pairs) for column in ("site", "first"))
    inside = [r["inside"] == "True" for r in pairs if r["named"] == "True"]
    said = said_of("gap/README.md")
    assert f"site right {site} of {len(pairs)}, named first {first}, no other name" in said
    assert all(r["others"] == "0" for r in pairs)
    assert f"{sum(inside)} of {len(inside)} sizes inside" in said


def test_the_blind_check():
    cases = rows("withheld/sealed.csv")
    said = said_of("withheld/README.md")
    without_cause = []
    for family in ("reference", "foreign"):
        of = [r for r in cases if r["family"] == family]
        single, pairs, none = ([r for r in of if r["kind"] == kind and paired.in_scope(r)] for kind in ("single", "pair", "none"))
        site = sum(r["site"] == "True" for r in single)
        first = sum(paired.first(r, "") for r in single)
        both = sum(paired.all_named(r, "") for r in pairs)
        assert f"site right {site} of {len(single)}, named first {first} of {len(single)}, both of a pair {both} of {len(pairs)}" in said
        inside, sizes = (sum(int(r[key]) for r in of) for key in ("sizes_inside", "sizes"))
        assert f"{inside} of {sizes} sizes inside" in said
        without_cause.append(f"{sum(paired.a_wrong_name(r, '') for r in none)} of {len(none)}")
    assert f"a name without any effect in {' and '.join(without_cause)}" in said


def test_what_sets_promise_over_seven_plants():
    driven = [r for r in rows("identification/plants_draws.csv") + rows("identification/plants_foreign.csv") if is_driven(r)]
    usable = [r for r in driven if r["status"].startswith("accepted")]
    axles = [(r, axle) for r in driven for axle in "fr"]
    peaks = [(r[f"reached_{a}"], r[f"said_{a}"]) for r, a in axles if "NaN" not in (r[f"reached_{a}"], r[f"said_{a}"])]
    known = [(r, a) for r, a in axles if r in usable and r[f"k_{a}"] != "NaN"]
    inside = sum(float(r[f"k_lo_{a}"]) <= float(r[f"k_true_{a}"]) <= float(r[f"k_hi_{a}"]) for r, a in known)
    harmful = [r for r in usable if max(float(r["over_f"]), float(r["over_r"])) > 0.1]
    said = said_of("identification/plants.md")
    assert f"{len(driven)} drives" in said
    assert f"{percent(len(usable), len(driven))} usable ({len(usable)}), none promises more" in said
    assert not harmful
    assert f"on {percent(sum(reached == told for reached, told in peaks), len(peaks))} of the axles" in said
    assert f"inside its interval on {percent(inside, len(known))}" in said


def is_driven(row):
    return row["status"] != "failed" and "s of data" not in row["reasons"]


def test_own_tires():
    axles = rows("identification/own_tires.csv")
    page = (RESULTS / "identification/README.md").read_text(encoding="utf-8")
    errors = [float(r["stiffness"]) / float(r["true"]) - 1 for r in axles]
    rms = math.sqrt(sum(e * e for e in errors) / len(errors))
    inside = sum(abs(float(r["stiffness"]) - float(r["true"])) < 1.645 * float(r["sigma"]) for r in axles)
    assert f"| all | {len(axles)} | {100 * sum(errors) / len(errors):+.1f} % | {100 * rms:.1f} % | " in page
    assert f"**{inside}, {100 * inside / len(axles):.0f} %**" in page
