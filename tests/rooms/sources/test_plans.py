"""What a file beside floor plans says of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from layoutrl import InputError
from layoutrl.rooms.sources.plans import near_copies


@pytest.mark.parametrize("line", ["a b 0.9", "a\tb", "a\tb\t0.9\tc"])
def test_a_line_of_near_copies_that_is_none_is_named(line: str, tmp_path: Path) -> None:
    file = tmp_path / "near_duplicates.tsv"
    file.write_text(f"plan_a\tplan_b\twall_cosine\na\tb\t0.9\n\n{line}\n")
    with pytest.raises(InputError, match=r"near_duplicates\.tsv: expected plan_a, plan_b and wall_cosine"):
        near_copies(file)
    file.write_text("plan_a\tplan_b\twall_cosine\na\tb\t0.9\n\n")
    assert near_copies(file) == {"a": "a", "b": "a"}
    file.write_bytes(b"plan_a\tplan_b\twall_cosine\na\tb\t0.9\n\xff\n")
    with pytest.raises(InputError, match=r"near_duplicates\.tsv: expected plan_a"):
        near_copies(file)
