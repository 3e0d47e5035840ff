"""The README's figures."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from diagrams import LOOKS, results
from kept import RESULTS
from matplotlib import style
from table1 import CEILING, PAPER, main_table, measured

from layoutrl.figures import STYLE, save

PROJECT = Path(__file__).resolve().parents[2]


def drawn(svg: Path) -> tuple[list[str], list[float]]:
    """What is drawn, with its numbers apart: their last digits are the machine's. What made it is left out."""
    text = re.sub(r"<metadata>.*?</metadata>", "", svg.read_text(), flags=re.DOTALL)
    number = r"-?\d+\.\d+(?![^<>]*</text>)"  # what is written stays
    return re.split(number, text), [float(found) for found in re.findall(number, text)]


def test_the_figure_of_results_is_drawn_from_the_cells_that_are_kept(tmp_path: Path) -> None:
    table = main_table({room: measured(RESULTS / "default" / "table1", room) for room in PAPER})
    assert {record["method"] for record in table.records} == {*LOOKS, CEILING}
    with style.context(STYLE):
        _, svg = save(results(table), tmp_path / "results")
    kept = PROJECT / "docs" / "figures" / "results.svg"
    assert kept.stat().st_size < 200_000
    (shapes, numbers), (kept_shapes, kept_numbers) = drawn(svg), drawn(kept)
    assert shapes == kept_shapes
    assert numbers == pytest.approx(kept_numbers, abs=0.5)
