"""Tables are made from the files of filled cells."""

from __future__ import annotations

import json
from pathlib import Path

import cells
import numpy as np
import pytest
from cells import packed
from printing import NOT_RUN, Row, Table, provenance, row, write

from layoutrl import InputError


def test_a_row_joins_seeds_and_one_that_is_missing_is_none(tmp_path):
    for seed, ious in enumerate(([0.5, 1.0, 0.75], [0.8, 1.0, 0.75])):
        numbers = {
            "iou": packed(np.round(np.array(ious) * 65535), cells.IOU),
            "group": packed([0, 1, 2], cells.INDEX),
            "overlap": 0.1 * seed,
        }
        config = {"protocol": "unseen", "seed": seed, "fold": 0, "room": {"type": "study"}, "data": {"seed": 0}}
        cell = {"rows": {"agent": numbers}, "config": config, "ceiling": 0.9}
        (tmp_path / f"study-own-geometric-seed{seed}.json").write_text(json.dumps(cell))
    found = row(tmp_path, "study-own-geometric")
    assert found
    assert found.mean == pytest.approx(0.8, abs=1e-4)
    assert found.text() == f"0.800 ± {np.std([0.5, 1.0, 0.75, 0.8, 1.0, 0.75]):.3f}"
    assert found.error_over_seeds() == "0.0500"  # of 0.75 and 0.85
    assert found.number("overlap") == pytest.approx(0.05)
    low, high = map(float, found.interval().split(" to "))
    assert 0.6 <= low < 0.8 < high <= 1
    assert found.p_value(found) == "1.000"
    assert found.ceiling() == "0.900"
    assert row(tmp_path, "study-own-paper") is None
    assert row(tmp_path, "study-own-geometric", "hand rule") is None
    cell["config"] |= {"data": {"seed": 1}}
    (tmp_path / "study-own-regressor-seed0.json").write_text(json.dumps(cell))
    other = row(tmp_path, "study-own-regressor")
    assert other
    with pytest.raises(InputError, match=r"regressor-seed0: cells of different data\.seed cannot be compared"):
        found.p_value(other)
    cell["config"] |= {"seed": 2, "fold": 3, "data": {"seed": 0}}
    (tmp_path / "study-own-geometric-seed2.json").write_text(json.dumps(cell))
    with pytest.raises(InputError, match="cells of different fold"):
        row(tmp_path, "study-own-geometric")


def test_a_training_that_cells_share_is_counted_once():
    def cell(column, seed, seconds):
        machine = {"gpu": "G", "layoutrl": "1"}
        config = {"column": column, "seed": seed}
        return {"config": config, "training_seconds": seconds, "date": "2026-01-01", "machine": machine}

    shared = [cell("geometric", 0, 60.5), cell("geometric", 0, 60.5)]  # of two label sets
    others = [cell("geometric", 1, 60.5), cell("regressor", 0, 60.5), cell("geometric", 0, 58.0)]
    cells = {Path(str(k)): found for k, found in enumerate(shared + others)}
    rows = [Row(np.ones((5, 1)), np.zeros(1), [], cells), None]
    assert provenance(rows) == "5 cells, 4 minutes of training; 2026-01-01; G; layoutrl 1"


def test_tables_are_written_in_three_formats(tmp_path):
    table = Table("Means", ("", "IoU >= 0.9"), [("living_room", "0.9 ± 0.1, 5%"), ("study", NOT_RUN)])
    write([table], tmp_path / "out" / "table")
    assert (tmp_path / "out" / "table.md").read_text().splitlines()[2:] == [
        "|  | IoU >= 0.9 |", "| --- | --- |", "| living_room | 0.9 ± 0.1, 5% |", "| study | not run |"
    ]  # fmt: skip
    assert (tmp_path / "out" / "table.csv").read_text().splitlines()[2] == 'living_room,"0.9 ± 0.1, 5%"'
    tex = (tmp_path / "out" / "table.tex").read_text()
    assert r"living\_room & 0.9 $\pm$ 0.1, 5\% \\" in tex
    assert tex.count(r"\begin") == tex.count(r"\end") == 2
