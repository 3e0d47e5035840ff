"""Tables are made from the files of filled cells."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pages
import pytest
from kept import RESULTS
from packing import INDEX, packed, packed_iou
from printing import (
    FIELDS,
    MEASURED,
    NOT_RUN,
    Estimate,
    Row,
    compared,
    listed,
    provenance,
    provenance_line,
    row,
    show,
    write,
)

from layoutrl import InputError
from tests.commands import fresh

KEPT = RESULTS / "default"
NAMES = {"room", "item", "labels", "trained", "trained_on", "told", "method"}  # all other columns are numbers


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All tables, made again from the cells that are kept."""
    folder = tmp_path_factory.mktemp("printed")
    for name, tables in pages.kept().items():
        write(tables, folder / name)
    return folder


def test_the_tables_that_are_kept_are_those_of_the_cells_that_are_kept(printed: Path) -> None:
    kept = {path.name: path.read_text(encoding="utf-8") for path in KEPT.iterdir() if path.is_file()}
    assert kept == {path.name: path.read_text(encoding="utf-8") for path in printed.iterdir()}


def test_a_csv_is_a_header_and_rows_of_its_length_with_one_number_a_column(printed: Path) -> None:
    for path in printed.glob("*.csv"):
        with path.open(newline="", encoding="utf-8") as file:
            header, *rows = csv.reader(file)
        assert {*header} <= {*FIELDS}
        assert {*header} >= {*MEASURED} or path.name == "planit-training.csv"
        assert rows
        assert {len(line) for line in rows} == {len(header)}
        for line in rows:
            for name, value in zip(header, line, strict=True):
                assert name in NAMES or value == "" or np.isfinite(float(value)), (path, name, value)
        about = json.loads(path.with_suffix(".json").read_text())
        assert list(about["columns"]) == header
        assert about["cells"]
        assert all((RESULTS / cell).is_file() for cell in about["cells"])


def test_the_pages_tables_have_eight_columns_at_most(printed: Path) -> None:
    lines = [line for path in printed.glob("*.md") for line in path.read_text().splitlines() if line.startswith("|")]
    assert max(line.count("|") - 1 for line in lines) <= 8


def test_a_row_joins_seeds_and_one_that_is_missing_is_none(tmp_path):
    for seed, ious in enumerate(([0.5, 1.0, 0.75], [0.8, 1.0, 0.75])):
        numbers = {
            "iou": packed_iou(np.array(ious)),
            "group": packed([0, 1, 2], INDEX),
            "overlap": 0.1 * seed,
        }
        config = {"protocol": "unseen", "seed": seed, "fold": 0, "room": {"type": "study"}, "data": {"seed": 0}}
        cell = {"rows": {"agent": numbers}, "config": config, "ceiling": 0.9}
        (tmp_path / f"study-own-geometric-seed{seed}.json").write_text(json.dumps(cell))
    found = row(tmp_path, "study-own-geometric")
    assert found
    assert found.mean == pytest.approx(0.8, abs=1e-4)
    spread = np.std([0.5, 1.0, 0.75, 0.8, 1.0, 0.75])
    assert found.estimate().text() == f"0.800 ± {spread:.3f}"
    expected = {"mean_iou": 0.8, "sd": spread, "n": 3, "seeds": 2, "p_agent": 0.5}
    assert found.estimate(p_agent=0.5).numbers == pytest.approx(expected, abs=1e-4)
    assert found.error_over_seeds() == pytest.approx(0.05, abs=1e-4)  # of 0.75 and 0.85
    assert found.number("overlap") == pytest.approx(0.05)
    low, high = found.interval.values()
    assert 0.6 <= low < 0.8 < high <= 1
    assert found.interval_text() == f"{low:.3f} to {high:.3f}"
    assert found.p_value(found) == 1
    assert found.ceiling().text() == "0.900"
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
    cells = {Path(f"default/real/{k}.json"): found for k, found in enumerate(shared + others)}
    found = provenance([Row(np.ones((5, 1)), np.zeros(1), [], cells)])
    assert provenance_line(found) == "5 cells, 4 minutes of training; 2026-01-01; G; layoutrl 1"
    assert found["cells"][0] == "default/real/0.json"
    del shared[0]["training_seconds"]
    found = provenance([Row(np.ones((1, 1)), np.zeros(1), [], {Path("default/real/0.json"): shared[0]})])
    assert provenance_line(found) == "1 cells; 2026-01-01; G; layoutrl 1"  # not 0 minutes: nobody knows


def test_tables_are_written_in_three_formats(tmp_path, capsys):
    measured = Estimate({"mean_iou": 0.9, "sd": 0.1, "n": 1000, "seeds": 3})
    whole = Estimate({"mean_iou": 0.25, "standard_error": 0.05, "seeds": 1})
    lines = [(["living_room"], [measured, "5%"]), (["study"], [None, whole])]
    table = compared("means", "Means & more", ["room"], ["agent", "IoU >= 0.9"], lines)
    write([table], tmp_path / "out" / "table")
    assert (tmp_path / "out" / "table.md").read_text().splitlines()[2:6] == [
        "|  | agent | IoU >= 0.9 |", "| --- | --- | --- |", "| living room | 0.900 ± 0.100 | 5% |",
        "| study | not run | 0.250 (0.050) |",
    ]  # fmt: skip
    assert (tmp_path / "out" / "means.csv").read_text().splitlines() == [
        "room,method,mean_iou,sd,standard_error,n,seeds", "living_room,agent,0.9,0.1,,1000,3", "study,agent,,,,,",
        "study,IoU >= 0.9,0.25,,0.05,,1",
    ]  # fmt: skip
    assert json.loads((tmp_path / "out" / "means.json").read_text())["title"] == "Means & more"
    tex = (tmp_path / "out" / "table.tex").read_text()
    assert r"living room & 0.900 $\pm$ 0.100 & 5\% \\" in tex
    assert tex.count(r"\begin") == tex.count(r"\end") == 2
    capsys.readouterr()
    show([table, compared("none", "Nothing", ["room"], ["agent"], [])])
    assert NOT_RUN in (out := capsys.readouterr().out)
    assert "Nothing" not in out


def test_a_list_has_a_line_for_each_record_and_a_dash_for_what_is_missing(tmp_path):
    columns = {"": "{room}", "mean ± sd": "{mean_iou:.2f} ± {sd:.2f}", "p": "{p_pointer!p}", "share": "{share_090:.0%}"}
    records = [
        {"room": "living_room", "mean_iou": 0.5, "sd": None, "p_pointer": 0.0004, "share_090": 0.25},
        {"room": "study", "mean_iou": None, "sd": None, "p_pointer": None, "share_090": 1 / 3},
    ]
    table = listed("list", "List", columns, records, [])
    assert table.lines == [["living room", "0.50 ± -", "< 0.001", "25%"], ["study", "-", "-", "33%"]]
    write([table, listed("empty", "None", columns, [], [])], tmp_path / "table")
    assert (tmp_path / "list.csv").read_text().splitlines() == [
        "room,mean_iou,sd,p_pointer,share_090", "living_room,0.5,,0.0004,0.25", "study,,,,0.333333"
    ]  # fmt: skip
    assert (tmp_path / "empty.csv").read_text() == "room,mean_iou,sd,p_pointer,share_090\n"


def test_tables_are_printed_without_torch() -> None:
    done = fresh("-c", "import sys, printing; print('torch' in sys.modules)", cwd=Path(pages.__file__).parent)
    assert done.stdout == "False\n", done.stderr
