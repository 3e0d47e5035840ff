from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from shapely.geometry import box

from layoutrl import InputError
from layoutrl.rooms.categories import names_of
from layoutrl.rooms.formats import opened
from layoutrl.rooms.sources.drawn import MOST_OPENINGS
from layoutrl.rooms.sources.front3d import read


def slab(uid: str, kind: str, x0: float, z0: float, x1: float, z1: float) -> dict[str, Any]:
    """A mesh of two triangles in the plane."""
    corners = [x0, 0, z0, x1, 0, z0, x1, 0, z1, x0, 0, z1]
    return {"uid": uid, "type": kind, "xyz": corners, "faces": [0, 1, 2, 0, 2, 3]}


def child(ref: str, x: float = 0, y: float = 0, z: float = 0, yaw: float = 0, scale: Any = (1, 1, 1)) -> dict[str, Any]:
    half = math.radians(yaw) / 2
    return {"ref": ref, "pos": [x, y, z], "rot": [0, math.sin(half), 0, math.cos(half)], "scale": list(scale)}


def house(**changes: Any) -> dict[str, Any]:
    """A bedroom from (0, 0) to (4, 3) in (x, z), in two levels of detail."""
    children = [child(uid) for uid in ("floor", "again", "door", "window")]
    placed = [
        child("bed", 1.0, 0, 1.5, yaw=90),
        child("lamp", 2.0, 1.8, 2.0),
        child("desk", 3.0, 0, 2.5, scale=(2, 1, -1)),
    ]
    return {
        "mesh": [
            slab("floor", "Floor", 0, 0, 4, 3),
            slab("again", "Floor", 0.001, 0.001, 3.999, 2.999),
            slab("door", "Door", 4, 1, 4.24, 1.9),
            slab("window", "BayWindow", 1, -0.24, 2, 0),
        ],
        "furniture": [
            {"uid": "bed", "title": "bed/king-size bed", "size": [1.5, 2.0, 0.9]},
            {"uid": "lamp", "title": "lighting/pendant light", "size": [1, 1, 1]},
            {"uid": "desk", "title": "", "category": "Desk", "bbox": [[0.5, 0.7, 0.6]]},
        ],
        "scene": {"room": [{"type": "MasterBedroom", "instanceid": "MasterBedroom-1", "children": children + placed}]},
    } | changes


def write(folder: Path, document: Any, name: str = "house-1.json") -> Path:
    (folder / name).write_text(json.dumps(document))
    return folder / name


def test_rooms_of_different_files_have_different_names(tmp_path: Path) -> None:
    for folder in ("train", "test"):
        (tmp_path / folder).mkdir()
        write(tmp_path / folder, house())
    assert {room.group for room in read(tmp_path, names_of()).rooms} == {"train/house-1", "test/house-1"}


def test_a_house_is_its_rooms(tmp_path: Path) -> None:
    write(tmp_path, house())
    (room,) = read(tmp_path, names_of()).rooms
    assert (room.id, room.room_type, room.group) == ("house-1/MasterBedroom-1", "bedroom", "house-1")
    assert room.indoor.symmetric_difference(box(0, -3, 4, 0)).area < 0.02
    bed, desk = room.furniture  # the lamp hangs
    assert (bed.category, bed.size, bed.center) == ("bed", (2.0, 1.5), (1.0, -1.5))
    assert bed.rotation == pytest.approx(0, abs=1e-6)  # along z at first, which is down here; turned to the right
    assert (desk.category, desk.size, desk.rotation) == ("desk", (0.6, 1.0), 270)
    door, window = room.openings
    assert (door.kind, window.kind) == ("door", "window")
    assert door.shape.symmetric_difference(box(4, -1.9, 4.2, -1)).area < 1e-3
    assert window.shape.symmetric_difference(box(1, 0, 2, 0.2)).area < 1e-3


def test_a_piece_that_is_tilted_is_turned_as_its_own_z_is(tmp_path: Path) -> None:
    document = house()
    turns = Rotation.from_quat(np.random.default_rng(0).normal(size=(20, 4)))
    for turn, (x, _, z) in zip(turns, turns.apply([0, 0, 1]), strict=True):
        document["scene"]["room"][0]["children"][4]["rot"] = turn.as_quat().tolist()
        write(tmp_path, document)
        (bed, *_) = read(tmp_path, names_of()).rooms[0].furniture
        assert bed.rotation == pytest.approx(math.degrees(math.atan2(-z, x)) % 360)


def test_the_box_of_a_piece_may_be_alone_or_in_a_list(tmp_path: Path) -> None:
    document = house()
    desks = []
    for box_of_desk in ([[0.5, 0.7, 0.6]], [0.5, 0.7, 0.6]):
        document["furniture"][2]["bbox"] = box_of_desk
        write(tmp_path, document)
        desks.append(read(tmp_path, names_of()).rooms[0].furniture[1])
    assert desks[0] == desks[1]


def test_what_the_data_set_says_is_not_valid_is_not_read(tmp_path: Path) -> None:
    document = house()
    document["furniture"][0]["valid"], document["furniture"][2]["valid"] = False, True
    write(tmp_path, document)
    (room,) = read(tmp_path, names_of()).rooms
    assert [item.category for item in room.furniture] == ["desk"]


def test_sizes_and_categories_are_looked_up_where_the_house_has_none(tmp_path: Path) -> None:
    pieces = [{"uid": "bed", "jid": "a"}, {"uid": "desk", "jid": "b"}, {"uid": "lamp", "jid": "none"}]
    pieces[1]["sourceCategoryId"] = "2dd2368f-a3eb-43c2-8a6b-d585cd19d9a6"
    write(tmp_path, house(furniture=pieces))
    (room,) = read(tmp_path, names_of()).rooms
    assert room.furniture == ()
    models = [
        {"model_id": "a", "category": "King-size Bed", "boundingBox": {"xLen": 150, "yLen": 200, "zLen": 90}},
        {"model_id": "b", "category": None, "boundingBox": {"xLen": 50, "yLen": 60, "zLen": 200}},
    ]
    write(tmp_path, models, "model_info.json")
    (room,) = read(tmp_path, names_of()).rooms
    assert [(item.category, item.size) for item in room.furniture] == [("bed", (2.0, 1.5)), ("wardrobe", (0.6, 1.0))]


def test_furniture_of_unknown_size_is_left_out_and_said_once_a_house_and_decor_is_not(tmp_path: Path) -> None:
    pieces = [{"uid": "bed", "title": "bed/king-size bed"}, {"uid": "desk"}, {"uid": "lamp", "title": "sofa"}]  # hangs
    pieces += [{"uid": "curtain", "title": "curtain"}, {"uid": "titled", "title": "door/single swing door"}]
    document = house(furniture=pieces)
    document["scene"]["room"][0]["children"] += [child("bed"), child("curtain"), child("titled")]
    write(tmp_path, document)
    collection = read(tmp_path, names_of())
    assert collection.rooms[0].furniture == ()
    said = "pieces of unknown size are left out (3), and others may be placed there"
    assert collection.notes == [f"house-1: {said}: bed/king-size bed (2), without a name (1)"]


def test_a_hole_down_to_the_floor_is_a_door_and_a_hatch_is_none(tmp_path: Path) -> None:
    document = house()
    document["mesh"] += [slab("hole", "Hole", -0.24, 1, 0, 2), slab("hatch", "Hole", 1, 3, 2, 3.24)]
    document["mesh"][-1]["xyz"][1::3] = [1.0] * 4
    document["scene"]["room"][0]["children"] += [child("hole"), child("hatch")]
    write(tmp_path, document)
    openings = read(tmp_path, names_of()).rooms[0].openings
    (passage,) = [o.shape for o in openings if o.kind == "door" and o.shape.centroid.x < 2]
    assert passage.symmetric_difference(box(-0.2, -2, 0, -1)).area < 1e-3
    (hatch,) = [o.shape for o in openings if o.kind == "window" and o.shape.centroid.y < -1]
    assert hatch.symmetric_difference(box(1, -3.2, 2, -3)).area < 1e-3


@pytest.mark.parametrize("scale", [1.25, -1.25])  # below zero it is mirrored
def test_doors_that_are_titled_alone_are_as_wide_as_most(scale: float, tmp_path: Path) -> None:
    document = house()
    document["mesh"] = document["mesh"][:2]
    document["furniture"].append({"uid": "titled", "title": "door/single swing door"})
    document["scene"]["room"][0]["children"].append(child("titled", 4.1, 0, 1.5, yaw=90, scale=(scale, 1, 1)))
    write(tmp_path, document)
    (opening,) = read(tmp_path, names_of()).rooms[0].openings
    assert opening.kind == "door"
    assert opening.shape.symmetric_difference(box(4, -2, 4.2, -1)).area < 1e-3


@pytest.mark.parametrize("panes", [1, MOST_OPENINGS])
def test_a_door_is_one_whatever_windows_are_drawn_before_it(panes: int, tmp_path: Path) -> None:
    """Of bay windows each pane is drawn; and some have a door among them."""
    document = house()
    drawn = [slab(f"pane {k}", "BayWindow", 4, 1, 4.24, 1.9) for k in range(panes)]
    document["mesh"] = [*document["mesh"][:2], *drawn, slab("door", "Door", 4, 1, 4.24, 1.9)]
    document["scene"]["room"][0]["children"][:0] = [child(mesh["uid"]) for mesh in drawn]
    write(tmp_path, document)
    (door,) = read(tmp_path, names_of()).rooms[0].openings
    assert door.kind == "door"
    document["mesh"] = document["mesh"][:2]
    document["furniture"] += [{"uid": "up", "title": "window/window"}, {"uid": "down", "title": "door/entry"}]
    document["scene"]["room"][0]["children"] += [child("up", 4.1, 0, 1.5, yaw=90), child("down", 4.1, 0, 1.5, yaw=90)]
    write(tmp_path, document)
    (door,) = read(tmp_path, names_of()).rooms[0].openings
    assert door.kind == "door"


def test_a_house_is_opened_by_its_content(tmp_path: Path) -> None:
    document = house()
    document["furniture"][0]["jid"] = "a"
    source = opened(write(tmp_path, document), move="all")
    assert [item.center for item in source.collection.rooms[0].furniture] == [None, None]
    assert source.suffix == ".jsonl"


def test_what_is_broken_is_left_out_in_one_line(tmp_path: Path) -> None:
    write(tmp_path, house(mesh=None), "a.json")
    (tmp_path / "b.json").write_text('{"mesh": [')
    (tmp_path / "d.json").write_bytes(b'{"uid":\xff}')
    document = house()
    document["mesh"][0]["faces"] = document["mesh"][1]["faces"] = [0, 1, 99]
    write(tmp_path, document, "c.json")
    collection = read(tmp_path, names_of())
    reasons = {Path(where).name: reason for where, reason in collection.left_out}
    assert reasons["a.json"] == "a field is missing or is not of the expected kind"
    assert reasons["b.json"].startswith("text: expected whole JSON")
    assert reasons["d.json"] == "text: expected UTF-8; invalid start byte at byte 7"
    assert reasons["MasterBedroom-1"] == "floor: expected triangles between its corners"
    assert not collection.rooms


@pytest.mark.parametrize(
    ("of_child", "of_piece", "called"),
    [
        ({"ref": None}, {}, "without a name"),
        ({"ref": []}, {}, "without a name"),
        ({"pos": None}, {}, "bed/king-size bed"),
        ({"pos": [0.0, math.nan, 0.0]}, {}, "bed/king-size bed"),
        ({"rot": [1, 0, 0]}, {}, "bed/king-size bed"),
        ({"scale": ["1", 1, 1]}, {}, "bed/king-size bed"),
        ({"scale": [900, 1, 1]}, {}, "bed/king-size bed"),
        ({}, {"uid": {}}, "bed/king-size bed"),
        ({}, {"size": [1, 2]}, "bed/king-size bed"),
        ({}, {"size": 1, "title": None, "category": "Bett"}, "Bett"),
    ],
)
def test_a_piece_with_an_odd_field_costs_itself_alone_and_is_named(
    of_child: dict[str, Any], of_piece: dict[str, Any], called: str, tmp_path: Path
) -> None:
    document = house()
    document["scene"]["room"][0]["children"][4] |= of_child
    document["furniture"][0] |= of_piece
    write(tmp_path, document)
    collection = read(tmp_path, names_of())
    assert not collection.left_out
    assert [item.category for item in collection.rooms[0].furniture] == ["desk"]
    said = "pieces with a missing or odd field are left out (1), and others may be placed there"
    (note,) = collection.notes
    assert note.partition(" (the first: ")[0] == f"house-1: {said}: {called} (1)"


def test_the_first_reason_that_is_known_for_an_odd_field_is_said(tmp_path: Path) -> None:
    document = house()
    bed, _, desk = document["scene"]["room"][0]["children"][4:]
    bed["pos"], desk["pos"][0] = None, math.nan
    write(tmp_path, document)
    (note,) = read(tmp_path, names_of()).notes
    reason = "a number: expected a finite one of at most 1000 (metres); got nan"
    assert note.endswith(f": bed/king-size bed (1), Desk (1) (the first: {reason})")


def test_broken_decor_and_what_is_placed_nowhere_are_not_counted(tmp_path: Path) -> None:
    document = house()
    document["scene"]["room"][0]["children"][5]["pos"] = [math.nan, 0, 0]  # of the lamp
    document["furniture"] += [{"title": "sofa"}, {"title": "table", "uid": []}, None, {"uid": "bed 2", "size": 3}]
    write(tmp_path, document)
    collection = read(tmp_path, names_of())
    assert (collection.notes, collection.left_out) == ([], [])
    document["scene"]["room"][0]["children"].append(child("lost"))
    write(tmp_path, document)
    (note,) = read(tmp_path, names_of()).notes
    assert note.endswith("left out (1), and others may be placed there: sofa (1)")


@pytest.mark.parametrize("broken", [None, {}, {"type": "Bedroom", "instanceid": "b", "children": None}])
def test_a_broken_room_costs_itself_alone(broken: Any, tmp_path: Path) -> None:
    document = house()
    document["scene"]["room"].append(broken)
    write(tmp_path, document)
    collection = read(tmp_path, names_of())
    assert [room.id for room in collection.rooms] == ["house-1/MasterBedroom-1"]
    assert collection.left_out == [("house-1/room 2", "a field is missing or is not of the expected kind")]
    document["scene"]["room"] = [broken]
    write(tmp_path, document)
    collection = read(tmp_path, names_of())
    assert [where for where, _ in collection.left_out] == ["house-1/room 1"]


def test_what_is_no_piece_at_all_and_a_titled_door_that_is_nowhere_are_named(tmp_path: Path) -> None:
    document = house()
    document["mesh"] = document["mesh"][:2]
    document["furniture"] += [None, {"title": "sofa"}, {"uid": "titled", "title": "door/single swing door"}]
    document["scene"]["room"][0]["children"] += [None, {"ref": "titled", "pos": [0, 0, 0]}, child("titled", 2, 0, 3.1)]
    document["scene"]["room"][0]["children"] += [child("lost"), child("lost too")]
    write(tmp_path, document)
    collection = read(tmp_path, names_of())
    assert [(opening.kind, opening.shape.area) for opening in collection.rooms[0].openings] == [
        ("door", pytest.approx(0.16, abs=0.01))
    ]
    said = "pieces with a missing or odd field are left out (4), and others may be placed there"
    named = "without a name (2), sofa (1), door/single swing door (1)"
    assert collection.notes == [f"house-1: {said}: {named}"]


def test_a_folder_without_houses_is_answered(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected \.json files of 3D-FRONT"):
        read(tmp_path, names_of())


def test_a_file_that_is_larger_than_any_house_is_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    size = write(tmp_path, house()).stat().st_size
    for limit, rooms in ((size, 1), (size - 1, 0)):
        monkeypatch.setattr("layoutrl.rooms.sources.front3d.LARGEST_FILE", limit)
        collection = read(tmp_path, names_of())
        assert (len(collection.rooms), len(collection.left_out)) == (rooms, 1 - rooms)
