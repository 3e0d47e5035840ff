"""What no table shows is refused before anything is read."""

from __future__ import annotations

import pytest

from layoutrl import InputError
from tests.experiments.builders import configured


def test_cells_of_files_that_no_table_shows_are_refused(tmp_path):
    with pytest.raises(InputError, match="tables are of designer, floorplans, designer_rooms; got json"):
        configured(tmp_path, "data=json", "data.root=x.jsonl", "column=rules")


@pytest.mark.parametrize("column", ["planit", "rooms_planit", "annealer", "search_long", "rooms_pointer"])
def test_a_column_is_refused_with_a_budget_that_it_does_not_have_before_rooms_are_read(tmp_path, column):
    with pytest.raises(InputError, match=rf"^budget\.name of column={column}: expected one of smoke, .*; got scene$"):
        configured(tmp_path, "budget=scene", f"column={column}")


def test_what_learns_from_designed_rooms_is_scored_in_real_ones(tmp_path):
    for column in ("geometric", "rooms_agent"):
        with pytest.raises(InputError, match=r"^trained_on of designed rooms: expected one of own; got both$"):
            configured(tmp_path, f"column={column}", "trained_on=both")
