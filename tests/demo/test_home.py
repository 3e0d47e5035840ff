"""Rooms become homes of Sweet Home 3D that are read as the same rooms, and homes are written back whole."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import pytest

from layoutrl import InputError
from layoutrl.demo.home import NAME, new_home, written_back
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.formats import opened
from layoutrl.rooms.room import MAIN_ITEM, Room

ROOMS = [room for room_type in MAIN_ITEM for room in design_rooms(room_type, "test", 3, 2).rooms]


def read(folder: Path, content: bytes) -> Room:
    path = folder / NAME
    path.write_bytes(content)
    collection = opened(path).collection
    assert collection.left_out == []
    (room,) = collection.rooms
    return room


def moved(room: Room, by: float) -> Room:
    first, *others = room.furniture
    assert first.center is not None
    x, y = first.center
    return replace(room, furniture=(replace(first, center=(x, y + by)), *others))


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.id)
def test_a_new_home_is_read_as_the_room(tmp_path, room):
    home = read(tmp_path, new_home(room))
    assert home.room_type == room.room_type
    assert home.indoor.symmetric_difference(room.indoor).area < 1e-3
    assert home.envelope.symmetric_difference(room.envelope).area < 1e-3
    assert [opening.kind for opening in home.openings] == [opening.kind for opening in room.openings]
    for item, its in zip(home.furniture, room.furniture, strict=True):
        assert (item.category, item.form, item.rotation) == (its.category, its.form, pytest.approx(its.rotation))
        assert item.footprint.symmetric_difference(its.footprint).area < 1e-3


def test_columns_come_back_and_a_hole_that_is_no_column_is_refused(tmp_path):
    room = next(room for room in ROOMS if room.indoor.contains(room.indoor.centroid.buffer(0.5)))
    (x, y), bare = room.indoor.centroid.coords[0], replace(room, furniture=(), target=None)
    item = replace(room.furniture[0], center=room.furniture[0].center)
    column = ((x, y), (x, y + 0.3), (x + 0.4, y + 0.3), (x + 0.4, y))
    held = replace(bare, holes=(column,), furniture=(item,))
    home = read(tmp_path, new_home(held))
    assert home.indoor.symmetric_difference(held.indoor).area < 1e-3
    with pytest.raises(InputError, match="a hole that is no rectangle"):
        new_home(replace(bare, holes=(column[:3],)))


def test_what_is_not_placed_is_left_out_of_a_new_home(tmp_path):
    room = ROOMS[0]
    first, *others = room.furniture
    home = read(tmp_path, new_home(replace(room, furniture=(replace(first, center=None), *others))))
    assert [item.category for item in home.furniture] == [item.category for item in others]


def test_a_home_is_written_back_whole_with_what_moved(tmp_path):
    content = BytesIO(new_home(ROOMS[0]))
    with zipfile.ZipFile(content, "a") as archive:
        archive.writestr("picture.png", b"of the user's")
    home = read(tmp_path, content.getvalue())
    back = written_back(moved(home, 0.05), content.getvalue())
    assert read(tmp_path, back).furniture == moved(home, 0.05).furniture
    with zipfile.ZipFile(BytesIO(back)) as archive:
        assert archive.read("picture.png") == b"of the user's"


def test_other_furniture_than_the_homes_is_refused(tmp_path):
    content = new_home(ROOMS[0])
    home = read(tmp_path, content)
    for other in (replace(home, id="another"), replace(home, furniture=home.furniture[1:])):
        with pytest.raises(InputError, match="expected the furniture that was read from it"):
            written_back(other, content)


def test_a_home_that_cannot_be_read_is_said_without_a_place_of_the_servers():
    with pytest.raises(InputError, match=r"file\.sh3d") as said:
        written_back(ROOMS[0], b"PK\x03\x04nonsense")
    assert "/" not in str(said.value)


def test_what_a_home_does_not_let_move_stays(tmp_path):
    content = BytesIO()
    with zipfile.ZipFile(BytesIO(new_home(ROOMS[0]))) as archive:
        xml = archive.read("Home.xml").replace(b'id="piece0"', b'id="piece0" movable="false"')
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("Home.xml", xml)
    home = read(tmp_path, content.getvalue())
    assert written_back(home, content.getvalue())
    with pytest.raises(InputError, match=r"expected the \w+ where it was"):
        written_back(moved(home, 0.05), content.getvalue())
