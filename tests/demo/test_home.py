"""Rooms become homes of Sweet Home 3D that are read as the same rooms, and homes are written back whole."""

from __future__ import annotations

import zipfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from xml.etree.ElementTree import Element, fromstring

import pytest

from layoutrl import InputError
from layoutrl.demo.home import NAME, fixed, new_home, written_back
from layoutrl.demo.shell import with_opening, without_opening
from layoutrl.rooms.categories import names_of
from layoutrl.rooms.clearances import RUGS
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.formats import opened
from layoutrl.rooms.room import MAIN_ITEM, Item, Room
from layoutrl.rooms.sources.sweethome3d import read_home
from tests.rooms.sources.test_sweethome3d import FLAT, home_file, piece

ROOMS = [room for room_type in MAIN_ITEM for room in design_rooms(room_type, "test", 3, 2).rooms]


def read(folder: Path, content: bytes) -> Room:
    path = folder / NAME
    path.write_bytes(content)
    collection = opened(path).collection
    assert collection.left_out == []
    (room,) = collection.rooms
    return room


def document_of(content: bytes) -> Element:
    with zipfile.ZipFile(BytesIO(content)) as archive:
        return fromstring(archive.read("Home.xml"))


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


def test_what_is_locked_is_not_movable_in_a_new_home():
    room = ROOMS[0]
    locked = replace(room, furniture=tuple(replace(item, locked=k == 1) for k, item in enumerate(room.furniture)))
    pieces = document_of(new_home(locked)).findall("pieceOfFurniture")
    assert [piece.get("movable", "true") for piece in pieces] == [str(k != 1).lower() for k in range(len(pieces))]


@pytest.mark.parametrize("character", ["\x00", "\x1b", "\ufffe", "\ud800"])
def test_of_names_what_xml_cannot_hold_is_replaced_in_a_new_home(tmp_path, character):
    room = next(room for room in ROOMS if room.room_type == "bedroom")
    lamp = Item(f"lamp{character}<&>", (0.3, 0.3), room.indoor.centroid.coords[0], 0.0)
    content = new_home(replace(room, id=f"a{character}z <&> \u00fc", furniture=(*room.furniture, lamp)))
    home = document_of(content)
    assert home.get("name") == "a\ufffdz <&> \u00fc"
    assert "lamp\ufffd<&>" in {piece.get("name") for piece in home.iter("pieceOfFurniture")}
    assert read(tmp_path, content).outline


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


def test_what_is_not_placed_stands_beside_the_room_in_a_new_home(tmp_path):
    room = next(room for room in ROOMS if room.room_type == "living_room")
    ways = (None, 30.0, 90.0)
    turned = [replace(room.furniture[k], center=None, rotation=way) for k, way in enumerate(ways)]
    others = room.furniture[len(turned) :]
    home = read(tmp_path, new_home(replace(room, furniture=(*turned, *others))))
    assert [item.category for item in home.furniture[: len(others)]] == [item.category for item in others]
    waits = home.furniture[len(others) :]
    assert sorted(item.category for item in waits) == sorted(item.category for item in turned)
    assert not any(item.center for item in waits)
    (stood,) = opened(tmp_path / NAME).stood
    shapes = [item.footprint for item in stood[len(others) :]]
    assert min(shape.distance(room.envelope) for shape in shapes) > 0.2
    assert all(one.distance(other) > 0.2 for k, one in enumerate(shapes) for other in shapes[:k])


def test_furniture_of_a_new_home_is_as_high_as_it_is_usual():
    bare = replace(ROOMS[0], furniture=(), target=None)
    known = [*names_of().categories, *RUGS]
    document = document_of(new_home(replace(bare, furniture=tuple(Item(name, (0.5, 0.5)) for name in known))))
    high = {name: float(p.get("height", 0)) for name, p in zip(known, document.iter("pieceOfFurniture"), strict=True)}
    assert {high[name] for name in RUGS} == {1}
    assert all(35 <= height <= 210 for name, height in high.items() if name not in RUGS)
    order = ("coffee_table", "table", "counter", "fridge", "wardrobe")
    assert [high[name] for name in order] == sorted({high[name] for name in order})
    assert high["stool"] < high["chair"]


def test_a_home_is_written_back_whole_with_what_moved(tmp_path):
    content = BytesIO(new_home(ROOMS[0]))
    with zipfile.ZipFile(content, "a") as archive:
        archive.writestr("picture.png", b"of the user's")
    home = read(tmp_path, content.getvalue())
    back, left = written_back(moved(home, 0.05), content.getvalue())
    assert left == []
    assert read(tmp_path, back).furniture == moved(home, 0.05).furniture
    with zipfile.ZipFile(BytesIO(back)) as archive:
        assert archive.read("picture.png") == b"of the user's"


def test_other_furniture_than_the_homes_is_refused(tmp_path):
    content = new_home(ROOMS[0])
    home = read(tmp_path, content)
    first, *others = home.furniture
    rounded = replace(first, form="circle")
    for other in (
        replace(home, id="another"),
        replace(home, furniture=others),
        replace(home, furniture=(rounded, *others)),
    ):
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


def test_all_rooms_of_a_home_are_written_back_as_they_are_now(tmp_path):
    content = home_file(tmp_path / NAME).read_bytes()
    rooms = [moved(room, -0.3) for room in read_home(tmp_path / NAME).rooms]
    assert [room.id for room in rooms] == ["file/Bedroom", "file/room 2"]
    back, left = written_back(rooms[0], content, rooms[1:])
    assert left == []
    (tmp_path / NAME).write_bytes(back)
    assert read_home(tmp_path / NAME).rooms == rooms


def test_another_room_that_cannot_be_written_stays_as_the_home_has_it(tmp_path):
    content = home_file(tmp_path / NAME).read_bytes()
    bedroom, bathroom = read_home(tmp_path / NAME).rooms
    emptied = replace(bedroom, furniture=())
    back, left = written_back(moved(bathroom, -0.3), content, [emptied])
    assert left == [bedroom.id]
    (tmp_path / NAME).write_bytes(back)
    assert read_home(tmp_path / NAME).rooms == [bedroom, moved(bathroom, -0.3)]
    with pytest.raises(InputError, match=f"{bedroom.id!r} has other"):
        written_back(emptied, content, [bathroom])


def test_other_openings_or_another_outline_than_the_homes_are_refused(tmp_path):
    content = home_file(tmp_path / NAME).read_bytes()
    (room, _) = read_home(tmp_path / NAME).rooms
    (x0, y0), *corners = room.outline
    others = (
        with_opening(room, "window", (2.0, 0.0), 1.2),
        without_opening(room, 0),
        replace(room, outline=((x0 + 0.5, y0), *corners)),
    )
    for other in others:
        with pytest.raises(InputError, match=r"expected the walls, doors and windows .* other: save it as JSON"):
            written_back(other, content)
    assert written_back(room, content)


def test_what_is_fixed_outside_all_rooms_stays_there_and_the_rest_is_saved(tmp_path):
    """A wardrobe is to be placed; a desk that may not move is in no room, and what is odd stays where it is."""
    odd = piece("whatsit", 60, 250, 40, 40, id="odd") + piece("bookcase", 300, 15, 80, 30, id="shelf", movable="false")
    parked = piece("wardrobe", 900, 100, 100, 54, id="w") + piece("desk", 900, 300, 100, 54, id="d", movable="false")
    content = home_file(tmp_path / NAME, FLAT + odd + parked).read_bytes()
    home = read_home(tmp_path / NAME)
    (room, _) = home.rooms
    kinds = ["bed", "whatsit", "bookcase", "wardrobe"]
    assert [item.category for item in room.furniture] == kinds
    assert [k for k, item in enumerate(room.furniture) if item.center is None] == [3]
    assert fixed(home, room) == [1, 2]
    assert "the desk outside all rooms stays there: the home does not let it move" in home.collection.notes
    placed = replace(room.furniture[3], center=(3.5, -1.5), rotation=180.0)
    back, _ = written_back(replace(room, furniture=(*room.furniture[:3], placed)), content)
    (tmp_path / NAME).write_bytes(back)
    assert read_home(tmp_path / NAME).rooms[0].furniture[3].center == (3.5, -1.5)
    with zipfile.ZipFile(tmp_path / NAME) as archive:
        assert b"id='d' movable='false'" in archive.read("Home.xml")
        assert b"x='900' y='300'" in archive.read("Home.xml")
