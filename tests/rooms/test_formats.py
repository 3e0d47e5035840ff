from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.rooms.files import read_rooms, write_rooms
from layoutrl.rooms.formats import opened
from layoutrl.rooms.room import Room
from tests.builders import rectangular_room, rooms


@given(st.lists(rooms(), min_size=1, max_size=3, unique_by=lambda room: room.id))
def test_rooms_of_json_are_written_back_as_they_were(
    tmp_path_factory: pytest.TempPathFactory, written: list[Room]
) -> None:
    folder = tmp_path_factory.mktemp("rooms")
    write_rooms(folder / "rooms.jsonl", written)
    source = opened(folder / "rooms.jsonl")
    source.write(source.collection.rooms, folder / f"out{source.suffix}")
    assert (folder / "out.jsonl").read_bytes() == (folder / "rooms.jsonl").read_bytes()


@given(rooms())
def test_what_is_to_move_has_no_pose(tmp_path_factory: pytest.TempPathFactory, room: Room) -> None:
    path = tmp_path_factory.mktemp("rooms") / "rooms.jsonl"
    write_rooms(path, [room])
    category = room.furniture[-1].category
    for move in (category, f"door, {category}", "all"):
        (asked,) = opened(path, move=move).collection.rooms
        for item, before in zip(asked.furniture, room.furniture, strict=True):
            taken = move == "all" or before.category == category
            assert (item.center, item.rotation) == ((None, None) if taken else (before.center, before.rotation))
            assert (item.category, item.size, item.form) == (before.category, before.size, before.form)


def test_files_of_other_formats_in_a_folder_are_said(tmp_path: Path) -> None:
    write_rooms(tmp_path / "a.jsonl", [rectangular_room()])
    write_rooms(tmp_path / "b.json", [rectangular_room(id="other")])
    assert opened(tmp_path).collection.notes == []
    for name in ("c.sh3d", "d.jsonl.gz", "plan.pdf"):
        (tmp_path / name).write_bytes(b"")
    source = opened(tmp_path)
    assert len(source.collection.rooms) == 2
    said = f"2 files of other formats are not read, such as {tmp_path / 'c.sh3d'}; expected one format in a folder"
    assert source.collection.notes == [said]
    (tmp_path / "c.sh3d").unlink()
    assert opened(tmp_path).collection.notes[0].startswith("1 file of other formats is not read, such as ")
    assert opened(tmp_path / "a.jsonl").collection.notes == []


def test_no_file_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "rooms.jsonl"
    write_rooms(path, [rectangular_room()])
    source = opened(path)
    for out, problem in (
        (path, "is there already"),
        (tmp_path / "rooms.sh3d", "is no .jsonl file"),
        (tmp_path / "none" / "rooms.jsonl", "cannot be written"),
    ):
        with pytest.raises(InputError, match=problem):
            source.write(source.collection.rooms, out)
    assert len(read_rooms(path).rooms) == 1
