"""Tests of warm_start.py, and that the page holds what it makes of the rows."""

from pathlib import Path

import numpy as np
import warm_start

HERE = Path(__file__).parent


def test_turns_are_counted_to_the_end_and_to_staying_close_to_it():
    turns = [{"turn": str(k), "to_the_end": str(a)} for k, a in enumerate([0.4, 0.04, 0.06, 0.0])]
    assert warm_start.ended(turns) == 3
    assert [warm_start.close(turns, t) for t in (0.01, 0.05, 0.1, 0.5)] == [3, 3, 1, 0]


def test_the_true_stiffness_is_the_slope_at_the_origin():
    slip = np.linspace(-0.15, 0.15, 301)
    assert abs(warm_start.stiffness(slip, 20.0 * np.sin(1.4 * np.arctan(8.0 * slip))) - 20.0 * 1.4 * 8.0) < 4.0


def test_the_page_holds_the_tables_of_the_rows(capsys):
    warm_start.table(HERE / "warm_start.csv")
    page = (HERE / "demo.md").read_text(encoding="utf-8").splitlines()
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith(("| 0.", "| the", "| one", "| of", "| until"))]
    assert len(rows) == 12 + 8 + 3 and not [row for row in rows if row not in page]
    assert (HERE / "warm_start.svg").read_text(encoding="utf-8") == warm_start.drawing(warm_start.read(HERE / "warm_start.csv"))
