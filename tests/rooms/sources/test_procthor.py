from __future__ import annotations

import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from shapely.geometry import box

from layoutrl import InputError
from layoutrl.rooms.categories import names_of
from layoutrl.rooms.formats import LOOK, opened
from layoutrl.rooms.sources.parts import Data
from layoutrl.rooms.sources.procthor import LARGEST_LINE, read

SIZES = {"Bed_1": ("Bed", 1.5, 0.9, 2.0), "Chair_1": ("Chair", 0.5, 0.9, 0.5), "TV_1": ("Television", 1.0, 0.6, 0.2)}


def ring(*corners: tuple[float, float]) -> list[dict[str, float]]:
    return [{"x": x, "y": 0, "z": z} for x, z in corners]


def wall(name: str, *ends: tuple[float, float]) -> dict[str, Any]:
    return {"id": name, "polygon": ring(*ends) + ring(*ends)}


def hole(wall0: str, first: float, last: float) -> dict[str, Any]:
    return {"wall0": wall0, "holePolygon": [{"x": first, "y": 0, "z": 0}, {"x": last, "y": 2, "z": 0}]}


def thing(asset: str, x: float, y: float, z: float, degrees: float) -> dict[str, Any]:
    return {"assetId": asset, "position": {"x": x, "y": y, "z": z}, "rotation": {"x": 0, "y": degrees, "z": 0}}


def house(**changes: Any) -> dict[str, Any]:
    """A bedroom of 4 m by 3 m, and a kitchen of 2 m by 3 m on its right."""
    return {
        "rooms": [
            {"id": "room|2", "roomType": "Bedroom", "floorPolygon": ring((0, 3), (4, 3), (4, 0), (0, 0))},
            {"id": "room|3", "roomType": "Kitchen", "floorPolygon": ring((4, 0), (6, 0), (6, 3), (4, 3))},
        ],
        "walls": [wall("between", (4, 3), (4, 0)), wall("south", (0, 0), (4, 0))],
        "doors": [hole("between", 0.5, 1.5)],
        "windows": [hole("south", 1.0, 2.5)],
        "objects": [
            thing("Bed_1", 1.0, 0.45, 1.5, 90),
            thing("Chair_1", 5.0, 0.45, 2.0, 30),
            thing("TV_1", 2.0, 1.5, 1.0, 0),
        ],
    } | changes


def write(folder: Path, *houses: Any, name: str = "train.jsonl", packed: bool = False) -> Path:
    database: dict[str, list[Any]] = {}
    for asset, (kind, x, y, z) in SIZES.items():
        database.setdefault(kind, []).append({"assetId": asset, "boundingBox": {"x": x, "y": y, "z": z}})
    (folder / "asset-database.json").write_text(json.dumps(database))
    lines = "\n".join(one if isinstance(one, str) else json.dumps(one) for one in houses).encode()
    (folder / name).write_bytes(gzip.compress(lines) if packed else lines)
    return folder / name


def test_rooms_of_different_files_have_different_names(tmp_path: Path) -> None:
    for folder in ("v1.0", "v1.1"):
        (tmp_path / folder).mkdir()
        for name in ("train.a.jsonl", "train.b.jsonl"):
            write(tmp_path, house()).replace(tmp_path / folder / name)
    groups = {room.group for room in read(tmp_path, names_of()).rooms}
    assert groups == {f"v1.{k}/train.{name}/1" for k in (0, 1) for name in "ab"}


@pytest.mark.parametrize("packed", ["", ".gz", ".GZ"])
def test_every_room_of_a_house_is_a_room(packed: str, tmp_path: Path) -> None:
    write(tmp_path, house(), name=f"train.jsonl{packed}", packed=bool(packed))
    bedroom, kitchen = read(tmp_path, names_of()).rooms
    assert (bedroom.id, bedroom.room_type, bedroom.group) == ("train/1/Bedroom 2", "bedroom", "train/1")
    assert (kitchen.id, kitchen.room_type, kitchen.group) == ("train/1/Kitchen 3", "kitchen", "train/1")
    assert bedroom.indoor.equals(box(0, 0, 4, 3))
    (bed,), (chair,) = bedroom.furniture, kitchen.furniture  # what hangs is left out
    assert (bed.category, bed.size, bed.center, bed.rotation) == ("bed", (2.0, 1.5), (1.0, 1.5), 0)
    assert bed.footprint.equals(box(0, 0.75, 2, 2.25))
    assert chair.rotation == 60  # clockwise from above, from facing up
    door, window = bedroom.openings
    assert (door.kind, window.kind) == ("door", "window")
    assert door.shape.symmetric_difference(box(4, 1.5, 4.2, 2.5)).area < 1e-6  # from the wall's first end, downwards
    assert window.shape.symmetric_difference(box(1, -0.2, 2.5, 0)).area < 1e-6
    (door,) = kitchen.openings
    assert door.shape.symmetric_difference(box(3.8, 1.5, 4, 2.5)).area < 1e-6


@pytest.mark.parametrize("indent", [None, 4])
def test_a_json_file_is_one_house_or_a_list_of_them_over_any_lines(indent: int | None, tmp_path: Path) -> None:
    write(tmp_path, house())
    lines = opened(tmp_path / "train.jsonl").collection.rooms
    (path := tmp_path / "train.json").write_text(json.dumps(house(), indent=indent, sort_keys=True))
    assert opened(path).collection.rooms == lines
    path.write_text(json.dumps([house(), "no house", house()], indent=indent))
    collection = opened(path).collection
    assert collection.rooms[:2] == lines
    assert [room.id for room in collection.rooms[2:]] == ["train/3/Bedroom 2", "train/3/Kitchen 3"]
    assert [where for where, _ in collection.left_out] == ["train/2"]
    path.write_text(path.read_text()[:-2])
    ((where, why),) = opened(path).collection.left_out  # once, however many lines it has
    assert where == str(path)
    assert "expected whole JSON" in why
    path.write_text(json.dumps(house()) + "\n" + json.dumps(house()))
    assert [room.id for room in opened(path).collection.rooms[2:]] == ["train/2/Bedroom 2", "train/2/Kitchen 3"]


def test_a_house_is_told_by_its_objects_however_many_come_before_its_rooms(tmp_path: Path) -> None:
    many = [thing(f"unknown {k}", 1.0, 0.5, 1.0, 0) for k in range(10_000)]
    write(tmp_path, house())
    (path := tmp_path / "train.json").write_text(json.dumps(house(objects=many), indent=4, sort_keys=True))
    assert path.read_bytes().index(b"floorPolygon") > LOOK
    assert len(opened(path).collection.rooms) == 2


@pytest.mark.parametrize("order", ["ABba", "baAB", "AabB", "aABb", "AMBba", "bacMABA", "ABA", "BMbaA"])
def test_a_walls_foot_is_its_lowest_corners_in_any_order_of_them(order: str, tmp_path: Path) -> None:
    """From the first of them, which the names of corners have in capital letters, openings are measured."""
    write(tmp_path, house())
    before = [room.openings for room in read(tmp_path, names_of()).rooms]
    assert [len(openings) for openings in before] == [2, 1]
    document = house()
    for drawn in document["walls"]:
        first, last = drawn["polygon"][:2]
        if order.index("B") < order.index("A"):
            first, last = last, first
        middle = {axis: (first[axis] + last[axis]) / 2 for axis in "xyz"}
        low = {"A": first, "B": last, "M": middle | {"y": 1e-4}}
        corners = low | {"a": first | {"y": 2.5}, "b": last | {"y": 2.4}, "c": middle | {"y": 3.0}}
        drawn["polygon"] = [corners[name] for name in order]
    write(tmp_path, document)
    assert [room.openings for room in read(tmp_path, names_of()).rooms] == before


def test_houses_of_before_schema_1_have_boxes_of_openings(tmp_path: Path) -> None:
    def boxed(opening: dict[str, Any]) -> dict[str, Any]:
        first, last = opening["holePolygon"]
        return {"wall0": opening["wall0"], "boundingBox": {"min": first, "max": last}}

    now = house()
    then = now | {kind: [boxed(opening) for opening in now[kind]] for kind in ("doors", "windows")}
    write(tmp_path, now, then)
    rooms = read(tmp_path, names_of()).rooms
    assert [room.openings for room in rooms[:2]] == [room.openings for room in rooms[2:]]
    assert rooms[0].openings


def test_a_hole_that_is_narrower_than_a_wall_is_thick_is_no_door(tmp_path: Path) -> None:
    write(tmp_path, house(doors=[hole("between", 0.5, 0.65)]))
    assert [opening.kind for room in read(tmp_path, names_of()).rooms for opening in room.openings] == ["window"]


@pytest.mark.parametrize(("height", "categories"), [(0.09, ["chair"]), (0.11, ["bed", "chair"])])
def test_what_is_as_flat_as_a_carpet_is_no_furniture(
    height: float, categories: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(SIZES, "Bed_1", ("Bed", 1.5, height, 2.0))
    write(tmp_path, house(objects=[thing("Bed_1", 1.0, 0.05, 1.5, 90), thing("Chair_1", 5.0, 0.45, 2.0, 30)]))
    assert [item.category for room in read(tmp_path, names_of()).rooms for item in room.furniture] == categories


def test_rooms_of_one_type_are_read_as_of_every_source(tmp_path: Path) -> None:
    write(tmp_path, house(), "no house", house())
    collection = Data("procthor", str(tmp_path)).read("kitchen")
    assert [room.id for room in collection.rooms] == ["train/1/Kitchen 3", "train/3/Kitchen 3"]
    assert ("train/2", "text: expected whole JSON; Expecting value") in collection.left_out


def test_houses_are_opened_and_layouts_are_written_as_rooms(tmp_path: Path) -> None:
    source = opened(write(tmp_path, house()), move="bed")
    assert [item.center is None for room in source.collection.rooms for item in room.furniture] == [True, False]
    source.write(source.collection.rooms, tmp_path / "out.jsonl")
    assert opened(tmp_path / "out.jsonl", move="bed").collection.rooms == source.collection.rooms


def test_a_counter_round_a_corner_is_not_moved_as_the_box_that_it_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(SIZES, "Countertop_L_6x6", ("CounterTop", 1.8, 0.9, 1.8))
    monkeypatch.setitem(SIZES, "Countertop_I_6x2", ("CounterTop", 1.8, 0.9, 0.6))
    counters = [thing("Countertop_L_6x6", 5, 0.45, 2, 0), thing("Countertop_I_6x2", 5, 0.45, 0.5, 0)]
    write(tmp_path, house(objects=counters))
    _, kitchen = read(tmp_path, names_of()).rooms
    assert [item.category for item in kitchen.furniture] == ["corner_counter", "counter"]


def test_what_no_size_is_known_of_is_left_out_and_said_once_a_house(tmp_path: Path) -> None:
    unknown = [thing(asset, 2.0, 0.45, 2.0, 0) for asset in ("Sofa_9", "Desk_9", "Sofa_9")]
    decor = [thing("Painting_9", 2.0, 0.45, 2.0, 0), thing("Frame_9", 2.0, 0.45, 2.0, 0) | {"id": "Painting|2|1"}]
    write(tmp_path, house(objects=house()["objects"] + unknown + decor), house())
    collection = read(tmp_path, names_of())
    assert [item.category for room in collection.rooms for item in room.furniture] == ["bed", "chair"] * 2
    said = "pieces of unknown size are left out (3), and others may be placed there: Sofa_9 (2), Desk_9 (1)"
    assert collection.notes == [f"train/1: {said}"]


def test_a_room_of_which_nothing_tells_the_type_is_left_out_without_advice_that_is_of_homes(tmp_path: Path) -> None:
    document = house(objects=[])
    document["rooms"][0]["roomType"] = "Nook"
    write(tmp_path, document)
    reason = "nothing tells its type; expected a name or furniture that does"
    assert read(tmp_path, names_of()).left_out == [("train/1/Nook 2", reason)]


def change(*path: Any, to: Any) -> Callable[[dict[str, Any]], None]:
    def changed(document: Any) -> None:
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = to

    return changed


@pytest.mark.parametrize(
    ("broken", "reason"),
    [
        (change("objects", to=None), "a field is missing or is not of the expected kind"),
        (change("rooms", 0, "floorPolygon", 0, "x", to=float("nan")), "expected a finite one of at most 1000"),
        (change("rooms", 0, "floorPolygon", 0, "x", to=10**400), "got a huge integer"),
        (change("rooms", 0, "floorPolygon", to=[]), "expected three corners or more; got 0"),
        (change("doors", 0, "wall0", to="none"), "a field is missing"),
    ],
)
def test_a_broken_house_is_left_out_in_one_line_and_the_others_are_kept(
    broken: Callable[[dict[str, Any]], None], reason: str, tmp_path: Path
) -> None:
    document = house()
    broken(document)
    write(tmp_path, document, house())
    collection = read(tmp_path, names_of())
    assert [room.id for room in collection.rooms][-2:] == ["train/2/Bedroom 2", "train/2/Kitchen 3"]
    (left_out,) = collection.left_out
    assert reason in left_out[1]
    assert "\n" not in left_out[1]


@pytest.mark.parametrize(
    ("broken", "called"),
    [
        (change("objects", 0, to=None), "without a name"),
        (change("objects", 0, to={}), "without a name"),
        (change("objects", 0, "assetId", to=[]), "Bed|2|1"),
        (change("objects", 0, "position", to=None), "Bed_1"),
        (change("objects", 0, "position", "x", to=1e300), "Bed_1"),
        (change("objects", 0, "rotation", to={}), "Bed_1"),
        (change("objects", 0, "rotation", "y", to="90"), "Bed_1"),
    ],
)
def test_an_object_with_an_odd_field_costs_itself_alone_and_is_named(
    broken: Callable[[dict[str, Any]], None], called: str, tmp_path: Path
) -> None:
    document = house()
    document["objects"][0]["id"] = "Bed|2|1"
    broken(document)
    write(tmp_path, document)
    collection = read(tmp_path, names_of())
    assert [item.category for room in collection.rooms for item in room.furniture] == ["chair"]
    assert not collection.left_out
    said = "pieces with a missing or odd field are left out (1), and others may be placed there"
    (note,) = collection.notes
    assert note.partition(" (the first: ")[0] == f"train/1: {said}: {called} (1)"


def test_a_bomb_and_a_file_that_breaks_off_are_left_out(tmp_path: Path) -> None:
    path = write(tmp_path, house(), name="train.jsonl.gz", packed=True)
    whole = path.read_bytes()
    path.write_bytes(whole[:-20])
    assert "cannot be read to its end" in read(tmp_path, names_of()).left_out[0][1]
    path.write_bytes(whole[:10] + b"\xff" * 4 + whole[14:])  # no deflated text begins so
    assert "cannot be read to its end" in read(tmp_path, names_of()).left_out[0][1]
    path.write_bytes(gzip.compress(b" " * (LARGEST_LINE + 10)))
    assert "larger than any house" in read(tmp_path, names_of()).left_out[0][1]
    path.write_bytes(gzip.compress((b" " * (LARGEST_LINE // 4) + b"\n") * 8))  # of which no line is too long
    assert "larger than any house" in read(tmp_path, names_of()).left_out[0][1]


def test_a_folder_without_houses_or_without_sizes_is_answered(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected \.json, \.jsonl or \.jsonl\.gz files"):
        read(tmp_path, names_of())
    write(tmp_path, house())
    (tmp_path / "asset-database.json").unlink()
    with pytest.raises(InputError, match="expected the sizes of what stands in the houses there"):
        read(tmp_path, names_of())
