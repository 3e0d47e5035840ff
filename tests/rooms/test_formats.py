from __future__ import annotations

import gzip
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.rooms.brief import without_poses
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.files import read_rooms, write_rooms
from layoutrl.rooms.formats import format_of, opened, to_place
from layoutrl.rooms.room import Item, Room
from layoutrl.rooms.sources import read_homes
from tests.builders import rectangular_room, rooms
from tests.rooms.sources.test_front3d import house
from tests.rooms.sources.test_sweethome3d import FLAT, home_file, piece


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


@given(rooms())
def test_what_a_layout_does_not_place_is_written_where_it_stood(
    tmp_path_factory: pytest.TempPathFactory, room: Room
) -> None:
    folder = tmp_path_factory.mktemp("rooms")
    write_rooms(folder / "rooms.jsonl", [room])
    source = opened(folder / "rooms.jsonl", move="all")
    source.write(source.collection.rooms, folder / "same.jsonl")
    assert read_rooms(folder / "same.jsonl").rooms == [room]
    (asked,) = source.collection.rooms
    before, *others = room.furniture
    first = replace(asked.furniture[0], center=before.center, rotation=(before.degrees + 180) % 360)
    source.write([replace(asked, furniture=(first, *asked.furniture[1:]))], folder / "one.jsonl")
    assert read_rooms(folder / "one.jsonl").rooms[0].furniture == (first, *others)


def test_what_was_parked_outside_a_room_has_no_place_in_what_is_written(tmp_path: Path) -> None:
    home_file(tmp_path / "homes" / "a.sh3d", FLAT + piece("wardrobe", 900, 100, 100, 54))
    source = opened(tmp_path / "homes", move="all")
    source.write(source.collection.rooms, tmp_path / "out.jsonl")
    bed, wardrobe = read_rooms(tmp_path / "out.jsonl").rooms[0].furniture
    assert (bed.center, wardrobe.center) == (source.stood[0][0].center, None)


def test_what_is_locked_stays_whatever_is_to_move() -> None:
    bed, desk = Item("bed", (2.0, 1.6), (1.0, 1.5), locked=True), Item("desk", (0.6, 1.2), (3.6, 1.5), 180.0)
    for move in ("bed,desk", "all"):
        room = replace(rectangular_room(5, 3), furniture=(bed, desk))
        assert to_place(room, move).furniture == (bed, *without_poses([desk], {0}))


def test_what_has_no_center_keeps_the_rotation_that_is_asked_of_it() -> None:
    asked = Item("desk", (0.6, 1.2), None, 90.0)
    assert to_place(rectangular_room(4, 3, others=(asked,)), "all").furniture[-1] == asked


@pytest.mark.parametrize("option", ["into", "categories"])
def test_what_rooms_in_json_say_themselves_is_refused(option: str, tmp_path: Path) -> None:
    path = tmp_path / "rooms.jsonl"
    write_rooms(path, [rectangular_room()])
    with pytest.raises(InputError, match=rf"{option}: rooms of .*rooms\.jsonl say themselves .*expected no {option}="):
        opened(path, **{option: "bedroom"})
    with pytest.raises(InputError, match=r"categories: rooms of .* say themselves"):
        read_homes("json", path, path)


def test_a_path_may_be_a_text(tmp_path: Path) -> None:
    path = tmp_path / "rooms.jsonl"
    write_rooms(path, [rectangular_room()])
    for kind in (str, Path):
        assert opened(kind(path)).collection.rooms == read_rooms(kind(path)).rooms == [rectangular_room()]
        assert opened(kind(tmp_path)).collection.rooms == [rectangular_room()]


def test_lengths_of_rooms_in_json_are_in_the_unit_that_is_said(tmp_path: Path) -> None:
    path = tmp_path / "rooms.jsonl"
    room = {"id": "a", "room_type": "study", "outline": [[0, 0], [144, 0], [144, 120], [0, 120]], "windows": []}
    path.write_text(json.dumps(room | {"doors": [], "furniture": []}) + "\n")
    for unit, metres in (("auto", 1.44), ("cm", 1.44), ("in", 3.6576)):
        (read,) = opened(path, unit=unit).collection.rooms
        assert read.outline[1] == pytest.approx((metres, 0))
    with pytest.raises(InputError, match="unit: expected one of auto, m, cm, mm, in, ft; got inch"):
        opened(path, unit="inch")
    with pytest.raises(InputError, match=r"unit: .*says itself how long a metre is"):
        opened(home_file(tmp_path / "a.sh3d"), unit="cm")


@pytest.mark.parametrize("field", ["jid", "floorPolygon", "mesh", "scene"])
@pytest.mark.parametrize("lacks", [None, "room_type"])
def test_rooms_with_fields_of_other_formats_are_rooms_in_json(field: str, lacks: str | None, tmp_path: Path) -> None:
    """Fields of one's own are kept, whatever they are called; and what is missing is said by the reader of rooms."""
    document = {name: value for name, value in room_to_dict(rectangular_room()).items() if name != lacks}
    document["furniture"][0] |= {field: "3d-future-123"}
    path = tmp_path / "rooms.jsonl"
    path.write_text(json.dumps({"model of the house": {field: 1}} | document) + "\n")
    assert format_of(path) == "json"
    collection = opened(path).collection
    assert (len(collection.rooms), len(collection.left_out)) == ((1, 0) if lacks is None else (0, 1))


@pytest.mark.parametrize(
    ("document", "name"),
    [
        ({"furniture": [{"uid": "1/model", "jid": "a"}], "mesh": [], "extension": {"outline": []}}, "front3d"),
        ({"rooms": [{"floorPolygon": []}], "doors": [], "windows": []}, "procthor"),
        ({"bed": 1}, "json"),
    ],
)
def test_formats_are_told_by_their_fields(document: dict[str, Any], name: str, tmp_path: Path) -> None:
    (tmp_path / "house.json").write_text(json.dumps(document))
    assert format_of(tmp_path / "house.json") == name


def test_packed_rooms_are_answered_in_one_line(tmp_path: Path) -> None:
    path = tmp_path / "rooms.jsonl.gz"
    path.write_bytes(gzip.compress(json.dumps(room_to_dict(rectangular_room())).encode()))
    said = r"rooms\.jsonl\.gz: rooms in JSON cannot be read from a packed file; unpack it, as with gunzip -k rooms"
    with pytest.raises(InputError, match=said):
        opened(path)
    path.write_bytes(gzip.compress(b'{"furniture": [{"jid": "a"}], "mesh": []}'))
    with pytest.raises(InputError, match="a house of 3D-FRONT cannot be read from a packed file"):
        opened(path)
    for content in (
        b"",
        b"no packed file",
        gzip.compress(b'{"rooms": [{"floorPolygon": []}]}'),
        gzip.compress(b"?" * 99)[:20],
    ):
        path.write_bytes(content)
        assert format_of(path) == "procthor"


def test_a_source_takes_paths_as_text_and_a_move_that_is_text(tmp_path: Path) -> None:
    write_rooms(tmp_path / "a.jsonl", [rectangular_room()])
    source = opened(str(tmp_path / "a.jsonl"), move="all")
    source.write(source.collection.rooms, str(tmp_path / "b.jsonl"))
    assert (tmp_path / "b.jsonl").read_text()
    home = opened(str(home_file(tmp_path / "a.sh3d", FLAT)))
    home.write([], str(tmp_path / "b.sh3d"))
    assert (tmp_path / "b.sh3d").read_bytes() == (tmp_path / "a.sh3d").read_bytes()
    with pytest.raises(InputError, match=r"move: expected text, or None; got \['bed'\]"):
        opened(tmp_path / "a.jsonl", move=["bed"])


def test_a_layout_of_a_room_that_was_not_read_is_refused(tmp_path: Path) -> None:
    write_rooms(tmp_path / "a.jsonl", [room := rectangular_room(4, 3)])
    with pytest.raises(InputError, match=r"^layouts: expected those of rooms that were read; got one of 'another'"):
        opened(tmp_path / "a.jsonl").write([replace(room, id="another")], tmp_path / "b.jsonl")
    assert not (tmp_path / "b.jsonl").exists()


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


def test_an_archive_before_rooms_in_a_folder_is_no_file_of_houses(tmp_path: Path) -> None:
    write_rooms(tmp_path / "b.json", [rectangular_room()])
    (tmp_path / "a_backup.tar.gz").write_bytes(gzip.compress(b"?" * 99))
    source = opened(tmp_path)
    assert len(source.collection.rooms) == 1
    assert source.collection.notes == []


def test_rooms_of_which_nothing_tells_the_type_are_what_is_said_of_houses_and_folders_too(tmp_path: Path) -> None:
    bare = house(furniture=[{"uid": "lamp", "jid": "a"}])
    bare["scene"]["room"][0] |= {"type": "none", "children": bare["scene"]["room"][0]["children"][:4]}
    for name in ("house", "homes"):
        (tmp_path / name).mkdir()
    (tmp_path / "house" / "a.json").write_text(json.dumps(bare))
    home_file(tmp_path / "homes" / "a.sh3d", FLAT.replace("Bedroom", "Xyz").replace("bed140x190", "whatsit"))
    for path in (tmp_path / "house", tmp_path / "house" / "a.json", tmp_path / "homes"):
        read, taken = opened(path).collection, opened(path, room_type="study").collection
        assert "study" not in {room.room_type for room in read.rooms}
        assert taken.rooms[0].room_type == "study"
        assert f"{taken.rooms[0].id}: nothing tells its type; it is taken for a study" in taken.notes


@pytest.mark.parametrize(
    ("room_type", "said"), [("garage", "got 'garage'$"), ("office", "got 'office', which is a study here$")]
)
def test_a_room_type_that_is_none_is_refused_whatever_the_file(room_type: str, said: str, tmp_path: Path) -> None:
    write_rooms(tmp_path / "rooms.json", [rectangular_room()])
    for path in (tmp_path / "rooms.json", home_file(tmp_path / "flat.sh3d", FLAT)):
        with pytest.raises(InputError, match=f"^room_type: expected one of bathroom, .*; {said}"):
            opened(path, room_type=room_type)


@pytest.mark.parametrize("none", [{}, {"room_type": None}, {"room_type": ""}])
def test_a_room_in_json_without_a_type_is_what_its_id_or_furniture_tells_or_what_is_said(
    none: dict[str, Any], tmp_path: Path
) -> None:
    document = {k: value for k, value in room_to_dict(rectangular_room()).items() if k not in ("room_type", "target")}
    document |= none
    couch = {"category": "couch", "size": [0.9, 2.0]}
    rooms_ = {"x": [], "y": [couch], "Kitchen 2": [], "Corridor": []}
    path = tmp_path / "rooms.json"
    path.write_text(json.dumps([*(document | {"id": name, "furniture": held} for name, held in rooms_.items()), {}]))
    assert len(opened(path).collection.left_out) == 5
    collection = opened(path, room_type="study").collection
    assert {room.id: room.room_type for room in collection.rooms} == {
        "x": "study",
        "y": "living_room",
        "Kitchen 2": "kitchen",
    }
    assert collection.notes == ["x: nothing tells its type; it is taken for a study"]
    assert len(collection.left_out) == 2


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
