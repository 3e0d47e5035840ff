"""Training and held-out rooms of the designer, some of the former disturbed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from layoutrl import InputError
from layoutrl.rooms.faults import faults_of_all
from layoutrl.rooms.sources.parts import Data, read_parts, whole_parts


def test_a_share_of_the_training_rooms_is_disturbed_and_no_held_out_room(tmp_path: Path) -> None:
    data = Data("designer", str(tmp_path), train_rooms=30, test_rooms=5)
    training, held_out = whole_parts("study", data, 0)
    some, same = whole_parts("study", replace(data, disturbed=0.5), 0)
    everyone, _ = whole_parts("study", replace(data, disturbed=1.0), 0)
    assert same == held_out
    changed = [k for k, room in enumerate(some) if room != training[k]]
    assert 8 <= len(changed) <= 22
    assert sum(a != b for a, b in zip(everyone, training, strict=True)) >= 28
    assert [room.furniture for room in some] == [room.furniture for room in training]
    assert not any(faults_of_all(some))


def test_which_rooms_are_disturbed_and_how_hangs_on_seed_and_index_alone(tmp_path: Path) -> None:
    data = Data("designer", str(tmp_path), train_rooms=12, test_rooms=1, disturbed=0.5)
    training, _ = whole_parts("study", data, 0)
    assert whole_parts("study", replace(data, train_rooms=6), 0)[0] == training[:6]


@pytest.mark.parametrize("source", ["desinger", None])
def test_a_source_that_there_is_not_is_answered_with_those_that_there_are(source: str | None, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=rf"^data.source: expected one of designer, floorplans, .*; got {source}$"):
        Data(source, str(tmp_path)).read("bedroom")


def test_where_no_room_could_be_read_the_data_are_named_and_no_item(tmp_path: Path) -> None:
    (tmp_path / "rooms.json").write_text(json.dumps({"id": "b"}))
    with pytest.raises(InputError, match=r"data: .* has no bedroom that can be used"):
        read_parts("bedroom", "main", Data(source="json", root=str(tmp_path / "rooms.json")), 0)
