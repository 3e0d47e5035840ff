from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ElementTree
import zipfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import escape

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shapely.geometry import Point, Polygon, box

from layoutrl import InputError
from layoutrl.rooms.categories import names_of
from layoutrl.rooms.documents import room_from_dict, room_to_dict
from layoutrl.rooms.formats import opened
from layoutrl.rooms.sources.sweethome3d import Home, read, read_home

# Homes as Sweet Home 3D writes them: centimetres, y down, radians clockwise.


def tag(name: str, inside: str = "", /, **attributes: Any) -> str:
    written = "".join(f" {key}='{value}'" for key, value in attributes.items())
    return f"<{name}{written}>{inside}</{name}>\n" if inside else f"<{name}{written}/>\n"


def room_tag(x0: float, y0: float, x1: float, y1: float, **attributes: Any) -> str:
    corners = ((x0, y0), (x1, y0), (x1, y1), (x0, y1))
    return tag("room", "".join(tag("point", x=x, y=y) for x, y in corners), **attributes)


def wall(x0: float, y0: float, x1: float, y1: float, thickness: float = 10.0, **attributes: Any) -> str:
    ends = {"id": f"wall-{x0}-{y0}-{x1}-{y1}", "xStart": x0, "yStart": y0, "xEnd": x1, "yEnd": y1}
    return tag("wall", **ends, thickness=thickness, wallAtStart="a", wallAtEnd="b", **attributes)


def piece(catalog: str, x: float, y: float, width: float, depth: float, **attributes: Any) -> str:
    common = {"catalogId": f"eTeks#{catalog}", "name": catalog, "x": x, "y": y, "width": width, "depth": depth}
    return tag(
        attributes.pop("tag", "pieceOfFurniture"), attributes.pop("inside", ""), **{**common, "height": 80} | attributes
    )


def door(x: float, y: float, depth: float = 10, **attributes: Any) -> str:
    return piece("door", x, y, 90, depth, **{"tag": "doorOrWindow", "id": "door"} | attributes)


# A bedroom of 4 m by 3 m and a bathroom of 2 m by 3 m on its right; walls of 10 cm, a door between the two.
WALLS = (
    wall(-5, -5, 615, -5) + wall(615, -5, 615, 305) + wall(615, 305, -5, 305) + wall(-5, 305, -5, -5)
    + wall(405, -5, 405, 305)
)  # fmt: skip
ROOMS = room_tag(0, 0, 400, 300, name="Bedroom") + room_tag(410, 0, 610, 300)
BED = piece("bed140x190", 100, 104, 158, 208, id="bed")
TOILET = piece("toiletUnit", 510, 40, 40, 80, id="toilet")
FLAT = BED + TOILET + door(405, 150, angle=math.pi / 2) + WALLS + ROOMS


def home_file(path: Path, body: str = FLAT, entries: dict[str, bytes] | None = None) -> Path:
    path.parent.mkdir(exist_ok=True)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("Home", b"binary, and not read")
        xml = f"<?xml version='1.0'?>\n<home version='5300' name='flat'>\n{body}</home>\n"
        archive.writestr("Home.xml", xml)
        for name, content in (entries or {"0": bytes(range(256)), "1/a.obj": b"v 0 0 0"}).items():
            archive.writestr(name, content)
    return path


def flat(tmp_path: Path, body: str = FLAT, **options: Any) -> Home:
    return read_home(home_file(tmp_path / "flat.sh3d", body), **options)


def xml_of(path: Path) -> list[ElementTree.Element]:
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        return list(ElementTree.fromstring(archive.read("Home.xml")).iter())


# Reading


def test_what_is_parked_goes_into_rooms_whose_type_is_told_first(tmp_path: Path) -> None:
    """An unnamed room that is taken for a bedroom has more floor free than the bedroom."""
    rooms = room_tag(0, 0, 400, 300) + room_tag(410, 0, 610, 300, name="Bedroom")
    parked = piece("bed140x190", 1000, 104, 120, 200, id="bed")
    home = flat(tmp_path, WALLS + rooms + parked, room_type="bedroom")
    assert {room.id: len(room.furniture) for room in home.rooms} == {"flat/room 1": 0, "flat/Bedroom": 1}
    home = flat(tmp_path, WALLS + room_tag(0, 0, 400, 300) + parked, room_type="bedroom")
    assert [len(room.furniture) for room in home.rooms] == [1]


def test_every_room_of_a_flat_is_a_room_with_its_walls_doors_and_pieces(tmp_path: Path) -> None:
    home = flat(tmp_path)
    bedroom, bathroom = home.rooms
    assert (bedroom.id, bedroom.room_type) == ("flat/Bedroom", "bedroom")
    assert (bathroom.id, bathroom.room_type) == ("flat/room 2", "bathroom")  # by what stands in it
    assert bedroom.group == bathroom.group == "flat"
    assert bedroom.indoor.equals(box(0, -3, 4, 0))
    assert bathroom.indoor.equals(box(4.1, -3, 6.1, 0))
    (bed,), (toilet,) = bedroom.furniture, bathroom.furniture
    assert (bed.category, bed.size, bed.rotation) == ("bed", (2.08, 1.58), 270)  # it faces down, its head at the wall
    assert bed.footprint.symmetric_difference(box(0.21, -2.08, 1.79, 0)).area < 1e-9
    assert (toilet.category, toilet.center) == ("toilet", (5.1, -0.4))
    for room in home.rooms:  # each has the door between the two, in the wall that both have
        assert [opening.kind for opening in room.openings] == ["door"]
        assert room.openings[0].shape.symmetric_difference(box(4, -1.95, 4.1, -1.05)).area < 1e-6
        outside = room.indoor.buffer(0.1, join_style="mitre").difference(room.indoor)
        walls = outside.difference(room.openings[0].shape)
        assert sum(Polygon(w).area for w in room.walls) == pytest.approx(walls.area, abs=1e-3)
        assert room.envelope.area == pytest.approx(room.indoor.buffer(0.1, join_style="mitre").area, abs=1e-3)


@pytest.mark.parametrize(
    ("angle", "rotation", "size"),
    [(0, 270, (0.1, 0.4)), (math.pi / 2, 180, (0.1, 0.4)), (math.pi, 90, (0.1, 0.4)), (math.pi / 6, 240, (0.1, 0.4))],
)
def test_a_piece_is_turned_clockwise_as_seen_and_faces_down_at_first(
    angle: float, rotation: float, size: tuple[float, float], tmp_path: Path
) -> None:
    shelf = piece("bookcase", 200, 150, 40, 10, angle=angle)
    (item,) = flat(tmp_path, shelf + WALLS + ROOMS).rooms[0].furniture
    assert (item.rotation, item.size) == (pytest.approx(rotation, abs=1e-3), size)
    corners = np.array([(-20, -5), (20, -5), (20, 5), (-20, 5)])
    turn = np.array(((math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle))))
    drawn = (corners @ turn.T + (200, 150)) / 100 * (1, -1)
    assert item.footprint.symmetric_difference(Polygon(drawn)).area < 1e-5


def test_the_part_of_a_door_in_the_wall_is_the_opening(tmp_path: Path) -> None:
    """The model of an open door is deeper than its wall: it says which part of it lies in the wall."""
    parts = {"depth": 68.0, "wallThickness": 10 / 68, "wallDistance": 2 / 68, "wallWidth": 80 / 90, "wallLeft": 10 / 90}
    for mirrored, y in (("false", -1.55), ("true", -1.45)):  # the frame is 5 cm off the middle, to either side
        opened_door = door(405 - 27, 150, angle=math.pi / 2, modelMirrored=mirrored, **parts)
        for room in flat(tmp_path, opened_door + BED + TOILET + WALLS + ROOMS).rooms:
            (opening,) = room.openings
            assert opening.shape.symmetric_difference(box(4, y - 0.4, 4.1, y + 0.4)).area < 1e-3


@pytest.mark.parametrize(("width", "depth"), [(40, 50), (20, 30)])  # as deep as its wall; or in the middle of it
def test_a_window_that_is_less_wide_than_its_wall_is_thick_is_no_wider(
    width: float, depth: float, tmp_path: Path
) -> None:
    walls = wall(-25, -25, 425, -25, 50) + wall(425, -25, 425, 325, 50) + wall(425, 325, -25, 325, 50)
    window = piece("window85x123", 200, -25, width, depth, tag="doorOrWindow", elevation=90)
    toilet = piece("toiletUnit", 60, 40, 40, 80) + room_tag(0, 0, 400, 300, name="WC")
    (room,) = flat(tmp_path, toilet + window + walls + wall(-25, 325, -25, -25, 50)).rooms
    (opening,) = room.openings
    assert opening.shape.bounds == pytest.approx((2 - width / 200, 0, 2 + width / 200, 0.5))


def test_windows_are_told_from_doors_by_their_names_and_by_how_high_they_lie(tmp_path: Path) -> None:
    openings = (
        piece("doubleWindow126x123", 100, -5, 126, 10, tag="doorOrWindow", elevation=94)
        + piece("serviceHatch", 300, -5, 60, 10, tag="doorOrWindow", elevation=110)
        + door(-5, 100, angle=math.pi / 2)
        + door(100, 305, visible="false")
    )
    (room, *_) = flat(tmp_path, openings + BED + WALLS + ROOMS).rooms
    assert [opening.kind for opening in room.openings] == ["door", "window", "window"]


@pytest.mark.parametrize(
    ("elevation", "height", "kind"), [(5, 200, "door"), (0, 180, "door"), (10, 200, "window"), (5, 150, "window")]
)
def test_a_window_that_one_can_walk_through_is_a_door(elevation: int, height: int, kind: str, tmp_path: Path) -> None:
    french = piece("doubleFrenchWindow", 200, -5, 126, 10, tag="doorOrWindow", elevation=elevation, height=height)
    (room, *_) = flat(tmp_path, french + BED + WALLS + ROOMS).rooms
    assert [opening.kind for opening in room.openings] == [kind]


def test_doors_of_a_group_that_is_not_visible_are_not_there(tmp_path: Path) -> None:
    inner = piece("none", 100, -5, 90, 10, tag="furnitureGroup", inside=door(100, -5), name="Inner", visible="false")
    for visible, inside, doors in (("true", door(100, -5), 1), ("false", door(100, -5), 0), ("true", inner, 0)):
        group = piece("none", 100, -5, 90, 10, tag="furnitureGroup", inside=inside, name="Old", visible=visible)
        (room, *_) = flat(tmp_path, group + BED + WALLS + ROOMS).rooms
        assert len(room.openings) == doors


@pytest.mark.parametrize(
    ("heights", "rooms"), [({"height": 5}, 1), ({"height": 5, "heightAtEnd": 100}, 2), ({"height": 15}, 2), ({}, 2)]
)
def test_a_wall_as_low_as_a_threshold_parts_no_room(heights: dict[str, int], rooms: int, tmp_path: Path) -> None:
    low = wall(200, -5, 200, 305, **heights)
    home = flat(tmp_path, low + WALLS + room_tag(0, 0, 400, 300, name="Bedroom"))
    assert len(home.rooms) == rooms


def test_a_piece_that_says_that_it_is_a_door_is_one(tmp_path: Path) -> None:
    imported = piece("x", 100, -5, 90, 10, doorOrWindow="true", name="Imported")
    group = piece("none", 300, -5, 90, 10, tag="furnitureGroup", inside=imported.replace("'100'", "'300'"), name="Two")
    for body in (imported, group):
        (room, *_) = flat(tmp_path, body + BED + WALLS + ROOMS).rooms
        assert [opening.kind for opening in room.openings] == ["door"]
        assert [item.category for item in room.furniture] == ["bed"]


@pytest.mark.parametrize("name", ["Fenster", "Fenêtre", "ventana", "Doppia finestra", "Janela", "raam", "窗户"])
def test_a_window_is_one_in_every_language_of_furniture(name: str, tmp_path: Path) -> None:
    low = piece("imported", 100, -5, 126, 10, tag="doorOrWindow", elevation=30, name=name)
    (room, *_) = flat(tmp_path, low + door(-5, 100, angle=math.pi / 2) + BED + WALLS + ROOMS).rooms
    assert [opening.kind for opening in room.openings] == ["door", "window"]


def test_thresholds_and_slips_of_the_hand_are_no_part_of_a_floor(tmp_path: Path) -> None:
    corners = [
        (0, 0),
        (150, 1),
        (150, 0),
        (400, 0),
        (400, 105),
        (410, 105),
        (410, 195),
        (400, 195),
        (400, 302),
        (2, 300),
    ]
    traced = tag("room", "".join(tag("point", x=x, y=y) for x, y in corners), name="Bedroom")
    (room,) = flat(tmp_path, BED + WALLS + traced).rooms
    assert len(room.outline) == 4
    assert room.indoor.symmetric_difference(box(0, -3, 4, 0)).area < 0.06
    for (x0, y0), (x1, y1) in zip(room.outline, room.outline[1:], strict=False):
        assert x0 == x1 or y0 == y1


def test_a_floor_that_goes_on_behind_a_wall_is_two_rooms(tmp_path: Path) -> None:
    rooms = flat(tmp_path, WALLS + room_tag(0, 0, 610, 300, name="Bedroom")).rooms
    assert [(room.id, round(room.indoor.area, 3)) for room in rooms] == [("flat/Bedroom", 12), ("flat/Bedroom (2)", 6)]


@pytest.mark.parametrize("first", [True, False])
def test_of_rooms_in_each_other_one_with_a_name_then_the_smallest_holds_what_stands_there(
    first: bool, tmp_path: Path
) -> None:
    """A slab below both rooms, and the ceiling of a corner, which has no name."""
    more = room_tag(-10, -10, 620, 310) + room_tag(0, 0, 200, 220)
    rooms = flat(tmp_path, BED + TOILET + WALLS + (more + ROOMS if first else ROOMS + more)).rooms
    assert sorted((room.room_type, *(item.category for item in room.furniture)) for room in rooms) == [
        ("bathroom", "toilet"),
        ("bedroom", "bed"),
    ]


def test_levels_are_kept_apart(tmp_path: Path) -> None:
    levels = tag("level", id="l0", name="Ground") + tag("level", id="l1", name="Upper")
    floors = "".join(
        piece("bed", 100, 100, 150, 200, level=level) * number + room_tag(0, 0, 400, 300, name="Room", level=level)
        for level, number in (("l0", 1), ("l1", 2))
    )
    rooms = flat(tmp_path, levels + floors).rooms
    assert [(room.id, len(room.furniture)) for room in rooms] == [("flat/Ground/Room", 1), ("flat/Upper/Room", 2)]


def test_levels_of_one_elevation_are_layers_of_one_storey(tmp_path: Path) -> None:
    levels = "".join(
        tag("level", id=k, name=name, elevation=up)
        for k, name, up in (("a", "Ground", "0"), ("b", "Furniture", "0.0"), ("c", "Upper", "262.0"))
    )
    upper = piece("bed", 100, 100, 150, 200, level="c") + room_tag(0, 0, 400, 300, name="Room", level="c")
    body = piece("bed", 100, 104, 158, 208, level="b") + wall(-5, -5, 405, -5, level="b")
    body += room_tag(0, 0, 400, 300, name="Bedroom", level="a") + piece("desk", 900, 100, 100, 60, level="b", id="desk")
    home = flat(tmp_path, levels + upper + body)
    assert [room.id for room in home.rooms] == ["flat/Upper/Room", "flat/Ground/Bedroom"]
    bedroom = home.rooms[1]
    assert [(item.category, item.center) for item in bedroom.furniture] == [("bed", (1.0, -1.04)), ("desk", None)]
    desk = replace(bedroom.furniture[1], center=(3, -1.5), rotation=0)
    home.write([replace(bedroom, furniture=(bedroom.furniture[0], desk))], tmp_path / "out.sh3d")
    assert_only_moved(home.path, tmp_path / "out.sh3d", ["desk"])  # it stays on its layer


def test_rooms_and_levels_have_names_of_their_own_whatever_they_are_called(tmp_path: Path) -> None:
    bed = piece("bed", 150, 150, 140, 200)
    called = [room_tag(k * 500, 0, k * 500 + 400, 300, name=name) for k, name in enumerate(("A", "A", "A (2)"))]
    beds = [piece("bed", k * 500 + 150, 150, 140, 200) for k in range(3)]
    home = flat(tmp_path, "".join([*called, *beds]), move="")
    assert sorted(room.id for room in home.rooms) == ["flat/A", "flat/A (2)", "flat/A (2) (2)"]
    levels = "".join(tag("level", id=k, name="Floor", elevation=up, height=250) for k, up in (("a", 0), ("b", 262)))
    rooms = "".join(room_tag(0, 0, 400, 300, name="A", level=k) for k in "ab")
    pieces = bed.replace("/>", " level='a'/>") + bed.replace("/>", " level='b'/>")
    path = home_file(tmp_path / "flat (1).sh3d", levels + rooms + pieces)
    assert [room.id for room in read_home(path, move="").rooms] == ["flat (1)/Floor/A", "flat (1)/Floor (2)/A"]


@pytest.mark.parametrize("clockwise", [True, False])
def test_a_round_wall_bulges_to_its_side(clockwise: bool, tmp_path: Path) -> None:
    """As the program draws it, a wall of an extent above zero goes clockwise from its start to its end."""
    x0, x1, extent = (400, 0, math.pi) if clockwise else (0, 400, -math.pi)
    arc = tag("wall", id="w", xStart=x0, yStart=0, xEnd=x1, yEnd=0, thickness=10, arcExtent=extent)
    rooms = flat(tmp_path, arc + BED + room_tag(0, -10, 400, 300, name="Bedroom")).rooms
    assert len(rooms) == 2  # inside and outside half a circle of 2 m, below its ends
    for y, there in ((-1.9, True), (-2.0, False), (-2.1, True)):
        assert any(room.indoor.contains(Point(2, y)) for room in rooms) == there


def test_groups_carpets_and_what_hangs(tmp_path: Path) -> None:
    inside = piece("bed", 100, 100, 90, 200) + piece("texturableBox", 150, 100, 20, 20)
    group = piece("none", 110, 100, 110, 200, tag="furnitureGroup", inside=inside, catalogId="", name="Group")
    others = (
        piece("texturableBox", 200, 200, 100, 100, height=1)
        + piece("kitchenUpperCabinet", 200, 20, 60, 40, elevation=140)
        + piece("bookcase", 300, 200, 60, 40, visible="false")
        + piece("roundTable", 300, 200, 60, 60)
    )
    (room,) = flat(tmp_path, group + others + room_tag(0, 0, 400, 300)).rooms
    assert [(item.category, item.size, item.form) for item in room.furniture] == [
        ("bed", (2.0, 1.1), "rectangle"),
        ("table", (0.6, 0.6), "circle"),
    ]


@pytest.mark.parametrize(
    ("name", "attributes", "seen"),
    [
        ("Washbasin", {"elevation": 65, "height": 20}, True),
        ("Washbasin", {"elevation": 130, "height": 20}, False),
        ("Bookcase", {"elevation": 65, "height": 20}, False),
        ("Shower tray", {"height": 8}, True),
        ("Shower tray", {"elevation": 50, "height": 8}, False),
    ],
)
def test_what_hangs_in_a_bathroom_and_flat_trays_are_in_the_way(
    name: str, attributes: dict[str, int], seen: bool, tmp_path: Path
) -> None:
    bathroom = room_tag(0, 0, 400, 300, name="Bathroom")
    hung = piece("none", 200, 20, 60, 40, catalogId="", name=name, **attributes)
    (room,) = flat(tmp_path, bathroom + hung).rooms
    assert (len(room.furniture) == 1) == seen
    if name == "Washbasin":  # it stands on a cabinet
        cabinet = piece("box", 200, 20, 80, 40, height=65)
        (room,) = flat(tmp_path, bathroom + hung + cabinet).rooms
        assert [item.category for item in room.furniture] == ["box"]


def test_a_room_of_which_nothing_tells_the_type_is_left_out_or_is_what_the_user_says(tmp_path: Path) -> None:
    body = WALLS + room_tag(0, 0, 400, 300) + room_tag(410, 0, 610, 300, name="Corridor")
    home = flat(tmp_path, body)
    reasons = dict(home.collection.left_out)
    assert "expected a name or furniture that does, or room_type=<type>" in reasons["flat/room 1"]
    assert reasons["flat/Corridor"] == "nobody furnishes such a room"
    taken = flat(tmp_path, body, room_type="study")
    assert [room.room_type for room in taken.rooms] == ["study"]
    assert taken.collection.notes == ["flat/room 1: nothing tells its type; it is taken for a study"]


def test_options_of_one_home_are_named_where_one_is_read_alone(tmp_path: Path) -> None:
    path = home_file(tmp_path / "a.sh3d", WALLS + room_tag(0, 0, 400, 300) + piece("cooker", 900, 9, 60, 60))
    for read_from, named in ((path, True), (tmp_path, False)):
        said = str(opened(read_from).collection)
        assert "nothing tells its type" in said
        assert "the cooktop outside all rooms stays there" in said
        assert [option in said for option in ("room_type=<type>", "into=<id>")] == [named, named]


def test_a_hint_at_another_room_is_given_where_some_room_could_take_the_piece(tmp_path: Path) -> None:
    path = home_file(
        tmp_path / "a.sh3d", WALLS + room_tag(0, 0, 400, 300, name="Bathroom") + piece("sofa", 900, 9, 60, 60)
    )
    (note,) = opened(path).collection.notes
    assert note.startswith("the sofa outside all rooms stays there: ")
    assert "into=" not in note


def test_a_home_of_a_folder_in_which_no_room_is_drawn_is_named_once(tmp_path: Path) -> None:
    home_file(tmp_path / "a.sh3d", WALLS)
    notes = opened(tmp_path).collection.notes
    assert notes[0].startswith("a: no room is drawn; ")


def test_a_name_that_nobody_knows_stands_as_an_obstacle_and_is_said(tmp_path: Path) -> None:
    home = flat(tmp_path, BED + piece("sofaa", 300, 200, 60, 40) + ROOMS, move="all")
    assert home.rooms[0].furniture[1].category == "sofaa"
    assert home.rooms[0].furniture[1].center is not None  # what nobody knows is not moved
    (note,) = home.collection.notes
    assert "'sofaa' (1) is no known furniture and stands as an obstacle; nearest are sofa" in note


@pytest.mark.parametrize("catalog", ["texturableBox", "texturableCylinder", "texturableTriangle", "halfCylinder"])
@pytest.mark.parametrize(("called", "category"), [
    ("Wardrobe", "wardrobe"), ("My old wardrobe", "wardrobe"), ("Meuble TV blanc", "tv_unit"), ("Piano", "piano"),
])  # fmt: skip
def test_a_shape_is_what_its_user_calls_it(called: str, category: str, catalog: str, tmp_path: Path) -> None:
    shapes = piece(catalog, 300, 150, 50, 60, name=called) + piece(catalog, 200, 150, 50, 60, name="Boîte")
    home = flat(tmp_path, shapes + BED + WALLS + ROOMS, move="all")
    named, shape, _ = home.pieces["flat/Bedroom"]
    assert (named.item.category, named.known) == (category, called != "Piano")
    assert not shape.known
    assert home.collection.notes == []  # what a shape is called in another language is no name of a piece


def test_a_homes_folder_is_read_home_by_home(tmp_path: Path) -> None:
    home_file(tmp_path / "a.sh3d")
    home_file(tmp_path / "below" / "b.sh3d")
    (tmp_path / "c.sh3d").write_bytes(b"no ZIP")
    collection = read(tmp_path, names_of())
    assert {room.group for room in collection.rooms} == {"a", "below/b"}
    assert all(item.center is not None for room in collection.rooms for item in room.furniture)
    ((where, reason),) = collection.left_out
    assert where.endswith("c.sh3d")
    assert "which is a whole ZIP file" in reason


def test_what_is_drawn_through_a_wall_is_in_the_way_as_far_as_it_is_in_its_room(tmp_path: Path) -> None:
    dresser = piece("dresser", 357, 250, 110, 50, id="dresser")  # 2 cm of it are in the bathroom
    home = flat(tmp_path, FLAT + dresser, move="bed")
    bed, cut = home.rooms[0].furniture
    assert (cut.category, cut.size, cut.rotation) == ("obstacle", (0.5, 0.98), 270)
    assert cut.footprint.symmetric_difference(box(3.02, -2.75, 4, -2.25)).area < 1e-6
    assert home.stood[0][1].footprint.equals_exact(cut.footprint, 1e-6)
    assert home.collection.notes == [
        "flat/Bedroom: stays as an obstacle as far as it is indoors, since it reaches beyond the walls: dresser"
    ]
    placed = replace(home.rooms[0], furniture=(replace(bed, center=(1, -1.5), rotation=0), cut))
    home.write([placed], tmp_path / "out.sh3d")
    assert_only_moved(home.path, tmp_path / "out.sh3d", ["bed"])
    _, anew = flat(tmp_path, FLAT + dresser, move="dresser").rooms[0].furniture
    assert (anew.category, anew.size, anew.center) == ("dresser", (0.5, 1.1), None)


def test_what_is_drawn_through_a_wall_is_in_the_way_of_all_that_moves_where_nobody_places_it(tmp_path: Path) -> None:
    table = piece("table", 357, 250, 110, 50)
    stool = piece("bar stool", 100, 250, 40, 40)  # which nobody places in a bedroom either, but it is indoors
    bed, cut, other = flat(tmp_path, FLAT + table + stool, move="all").rooms[0].furniture
    assert cut.footprint.symmetric_difference(box(3.02, -2.75, 4, -2.25)).area < 1e-6
    assert (cut.category, bed.center, other.category, other.center) == ("obstacle", None, "stool", None)
    named = flat(tmp_path, FLAT + table, move="all,table").rooms[0].furniture[1]
    assert (named.category, named.size, named.center) == ("table", (0.5, 1.1), None)


# What is to be placed


@pytest.mark.parametrize("move", [None, "all", "bed, wardrobe"])
def test_a_home_of_a_folder_is_read_as_it_is_alone(move: str | None, tmp_path: Path) -> None:
    fixed = piece("wardrobe", 300, 270, 100, 54, movable="false")
    parked = piece("wardrobe", 900, 100, 100, 54) + piece("cooker", 900, 9, 60, 60)
    beyond = piece("dresser", 450, 270, 200, 40)  # it stands in the bathroom, through the wall
    alone = opened(home_file(tmp_path / "homes" / "a.sh3d", FLAT + fixed + parked + beyond), move=move)
    home_file(tmp_path / "homes" / "b.sh3d")
    folder = opened(tmp_path / "homes", move=move)
    assert folder.collection.rooms[:2] == alone.collection.rooms
    assert folder.stood[:2] == alone.stood
    assert folder.collection.homeless == alone.collection.homeless
    notes = [note.removesuffix(" (into=<id>)") for note in alone.collection.notes]  # which is of one home
    assert folder.collection.notes == [note if note.startswith("a/") else f"a: {note}" for note in notes]
    if move is None:
        assert [note[:20] for note in notes] == ["a/room 2: stays as a", "the cooktop outside ", "a/Bedroom: gets ward"]
    assert all(item.center for room in read(tmp_path / "homes", names_of()).rooms for item in room.furniture)


@pytest.mark.parametrize("apart", [0, 17, 19])
def test_where_no_room_is_drawn_what_walls_enclose_is_taken_for_rooms(apart: float, tmp_path: Path) -> None:
    """The flat without its rooms, with a column. A wall of the bedroom ends some centimetres before the next."""
    column = wall(290, 260, 310, 260, thickness=20)
    walls = WALLS.replace(wall(-5, 305, -5, -5), wall(-5, 305, -5, 5 + apart))
    drawn = flat(tmp_path, FLAT + column)
    home = flat(tmp_path, FLAT.replace(ROOMS, "").replace(WALLS, walls) + column)
    enclosed = drawn.rooms if apart < 18 else drawn.rooms[1:]
    assert [room.id for room in home.rooms] == ["flat/room 1", "flat/room 2"][: len(enclosed)]  # the largest first
    for room, traced in zip(home.rooms, enclosed, strict=True):
        assert (room.room_type, room.furniture) == (traced.room_type, traced.furniture)
        assert room.indoor.symmetric_difference(traced.indoor).area < 1e-6
        assert [opening.kind for opening in room.openings] == ["door"]
    said = [note for note in home.collection.notes if "no room is drawn; what walls enclose is taken for one" in note]
    assert len(said) == 1
    assert drawn.collection.notes == []


@pytest.mark.parametrize(("low", "high"), [(0, 300), (0, 79), (100, 300), (100, 181)])
def test_where_no_wall_parts_two_rooms_the_way_is_kept_free_as_a_door(low: float, high: float, tmp_path: Path) -> None:
    """A living room, and a kitchen on its right, a wall between them but from `low` to `high`; a slab below both."""
    stubs = "".join(wall(400, y0, 400, y1) for y0, y1 in ((0, low - 5), (high + 5, 300)) if y1 - y0 > 10)
    slab = room_tag(-10, -10, 620, 310)
    rooms = room_tag(0, 0, 400, 300, name="Living room") + room_tag(400, 0, 610, 300, name="Kitchen")
    outside = WALLS.replace(wall(405, -5, 405, 305), "")
    living_room, kitchen = flat(tmp_path, outside + stubs + slab + rooms).rooms
    for room in (living_room, kitchen):
        if high - low < 80:
            assert room.doors == ()
            continue
        (way,) = room.doors
        _, y0, _, y1 = way.shape.bounds
        assert (y0, y1) == pytest.approx((-high / 100 + 0.1, -low / 100 - 0.1), abs=0.003)  # beside the walls
        assert room.envelope.buffer(1e-6).covers(way.shape)


def test_a_home_of_walls_alone_is_furnished_and_written_back(tmp_path: Path) -> None:
    body = FLAT.replace(ROOMS, "") + piece("wardrobe", 900, 100, 100, 54, id="w")
    home = flat(tmp_path, body)
    bedroom = home.rooms[0]
    _, wardrobe = bedroom.furniture
    placed = replace(wardrobe, center=(3.5, -2.4), rotation=180.0)
    home.write([replace(bedroom, furniture=(bedroom.furniture[0], placed))], tmp_path / "new.sh3d")
    found = read_home(tmp_path / "new.sh3d").rooms[0]
    assert [(item.category, item.center) for item in found.furniture] == [
        ("bed", bedroom.furniture[0].center),
        ("wardrobe", (3.5, -2.4)),
    ]


def test_storeys_without_rooms_and_with_them_are_told_apart(tmp_path: Path) -> None:
    levels = tag("level", id="a", name="Ground", elevation=0) + tag("level", id="b", name="Attic", elevation=280)
    ring = ((700, 0, 1000, 0), (1000, 0, 1000, 300), (1000, 300, 700, 300), (700, 300, 700, 0))
    hut = "".join(wall(*ends, level="b") for ends in ring) + piece("bed140x190", 850, 150, 158, 208, id="c", level="b")
    shed = "".join(wall(*ends, level="a") for ends in ring) + room_tag(0, 0, 400, 300, name="Bedroom", level="a")
    home = flat(tmp_path, levels + shed + hut)
    assert [(room.id, len(room.furniture)) for room in home.rooms] == [
        ("flat/Ground/Bedroom", 0),  # beside it what walls enclose is none: somebody has drawn what is
        ("flat/Attic/room 1", 1),
    ]


@pytest.mark.parametrize("height", [0, 280])
def test_a_hidden_level_is_read_unless_it_is_another_plan_of_one_that_is_shown(height: int, tmp_path: Path) -> None:
    now = tag("level", id="a", name="Now", elevation=0)
    before = tag("level", id="b", name="Before", elevation=height, viewable="false")
    plans = (re.sub("<(room|wall|pieceOfFurniture|doorOrWindow)", rf"<\1 level='{k}'", FLAT) for k in "ab")
    home = flat(tmp_path, now + before + "".join(plans))
    storeys = ["flat/Now", "flat/Before"] if height else ["flat/Now"]
    assert sorted({room.id.rpartition("/")[0] for room in home.rooms}) == sorted(storeys)
    assert all(len(room.furniture) == 1 for room in home.rooms)
    said = "flat/Now: the level 'Before' of its elevation is hidden, and is not read"
    assert (said in home.collection.notes) == (height == 0)


def test_more_rooms_than_are_worked_out_soon_are_refused_though_none_is_drawn(tmp_path: Path) -> None:
    cells = "".join(wall(x, 0, x, 4000) + wall(0, x, 4000, x) for x in range(0, 4001, 200))
    with pytest.raises(InputError, match=r"room: expected at most 357 rooms beside 42 walls; got 400"):
        flat(tmp_path, cells)


def test_what_stands_outside_all_rooms_goes_to_rooms_that_know_it(tmp_path: Path) -> None:
    parked = (
        piece("wardrobe", 900, 100, 100, 54, id="w")
        + piece("toiletUnit", 900, 300, 40, 80)
        + piece("cooker", 900, 9, 60, 60)
    )
    home = flat(tmp_path, FLAT + parked)
    bedroom, bathroom = home.rooms
    assert [(i.category, i.center, i.rotation) for i in bedroom.furniture[1:]] == [("wardrobe", None, None)]
    assert [(i.category, i.center) for i in bathroom.furniture[1:]] == [("toilet", None)]
    assert any("the cooktop outside all rooms stays there" in note for note in home.collection.notes)
    _, bathroom = flat(tmp_path, FLAT + parked, into="flat/room 2").rooms
    assert len(bathroom.furniture) == 4
    assert flat(tmp_path, FLAT + parked, into="Room 2").rooms[1] == bathroom
    for unknown in ("kitchen", "Bedroom, Kicthen"):
        with pytest.raises(InputError, match="expected one of flat/Bedroom, flat/room 2"):
            flat(tmp_path, FLAT + parked, into=unknown)
    nothing = "no room is drawn in it, and walls enclose none"
    for body, why in ((BED, nothing), (room_tag(0, 0, 400, 300, name="Hall"), "nobody furnishes")):
        with pytest.raises(InputError, match=f"'kitchen' to furnish; none could be read: {why}"):
            flat(tmp_path, body, into="kitchen")


@pytest.mark.parametrize("move", [None, "all", "toilet, wardrobe"])
def test_what_stands_in_the_building_but_in_no_drawn_room_is_not_parked(move: str | None, tmp_path: Path) -> None:
    """A second bathroom without a room; a wardrobe in a niche of the bedroom, which it leaves by 10 cm."""
    second = piece("toiletUnit", 540, 40, 40, 80) + room_tag(700, 0, 900, 300, name="Bathroom")
    niche = piece("wardrobe", 200, 320, 100, 60) + wall(145, 305, 145, 360) + wall(255, 305, 255, 360)
    bedroom = room_tag(0, 0, 400, 300, name="Bedroom")
    home = flat(tmp_path, WALLS + wall(145, 360, 255, 360) + bedroom + second + niche, move=move)
    assert [[(item.category, item.center is None) for item in room.furniture] for room in home.rooms] == [
        [("obstacle", False)],
        [],
    ]
    assert home.rooms[0].furniture[0].footprint.bounds == pytest.approx((1.5, -3, 2.5, -2.9))
    said = (
        "stays where it is, at or within walls but in no drawn room: toilet, wardrobe (draw its room, or park it away"
    )
    assert any(note.startswith(said) for note in home.collection.notes)


def test_what_is_taken_from_outside_is_said(tmp_path: Path) -> None:
    bench, chair = piece("bench", 1100, 20, 150, 45), piece("chair", 1100, 300, 40, 40)
    body = FLAT + bench + chair + room_tag(700, 0, 850, 300, name="Dining room")
    said = "flat/Dining room: gets bench from outside all rooms; what is part of the base plan stays there"
    assert said in flat(tmp_path, body.replace(chair, "")).collection.notes
    assert said.replace("bench", "bench, chair") in flat(tmp_path, body, into="flat/Dining room").collection.notes


def test_of_a_part_of_the_base_plan_that_is_named_it_is_not_said_that_it_stays(tmp_path: Path) -> None:
    body = FLAT + piece("wardrobe", 900, 270, 100, 54, movable="false")
    home = flat(tmp_path, body, move="wardrobe")
    assert "flat/Bedroom: gets wardrobe from outside all rooms" in home.collection.notes


def test_what_stands_outside_goes_to_a_room_of_its_level_before_one_of_a_level_whose_name_begins_alike(
    tmp_path: Path,
) -> None:
    levels = tag("level", id="a", name="Level 1") + tag("level", id="b", name="Level 10")
    rooms = room_tag(0, 0, 400, 300, name="Bedroom", level="a") + room_tag(0, 0, 600, 500, name="Bedroom", level="b")
    one, ten = flat(tmp_path, levels + rooms + piece("wardrobe", 900, 100, 100, 54, level="a")).rooms
    assert (one.id, ten.id) == ("flat/Level 1/Bedroom", "flat/Level 10/Bedroom")
    assert ([item.category for item in one.furniture], ten.furniture) == (["wardrobe"], ())


def test_what_stands_outside_goes_where_it_is_usual_before_a_larger_room_that_may_have_it(tmp_path: Path) -> None:
    rooms = room_tag(0, 0, 800, 600, name="Kitchen") + room_tag(900, 0, 1200, 300, name="Bathroom")
    kitchen, bathroom = flat(tmp_path, rooms + piece("washingMachine", 1500, 100, 60, 60)).rooms
    assert (kitchen.furniture, [item.category for item in bathroom.furniture]) == ((), ["washing_machine"])


def test_two_alike_that_stand_outside_go_to_a_room_each(tmp_path: Path) -> None:
    rooms = room_tag(0, 0, 400, 300, name="Bedroom") + room_tag(500, 0, 800, 300, name="Bedroom 2")
    parked = piece("wardrobe", 1500, 100, 100, 54) + piece("wardrobe", 1500, 300, 100, 54)
    assert [len(room.furniture) for room in flat(tmp_path, rooms + parked).rooms] == [1, 1]


def test_the_floor_that_one_takes_is_not_there_for_the_next_that_stands_outside(tmp_path: Path) -> None:
    parked = piece("wardrobe", 1500, 100, 200, 100) + piece("dresser", 1500, 300, 200, 90)
    home = flat(tmp_path, room_tag(0, 0, 200, 150, name="Bedroom") + parked)  # of 3 square metres one takes 2
    assert [item.category for item in home.rooms[0].furniture] == ["wardrobe"]
    assert any("the dresser outside all rooms stays there" in note for note in home.collection.notes)


def test_what_stands_outside_stays_on_its_level_before_it_goes_where_it_is_usual(tmp_path: Path) -> None:
    levels = tag("level", id="a", name="Ground") + tag("level", id="b", name="Upper")
    rooms = room_tag(0, 0, 800, 600, name="Kitchen", level="a") + room_tag(0, 0, 400, 300, name="Bathroom", level="b")
    kitchen, bathroom = flat(tmp_path, levels + rooms + piece("washingMachine", 1500, 100, 60, 60, level="a")).rooms
    assert ([item.category for item in kitchen.furniture], bathroom.furniture) == (["washing_machine"], ())


def test_what_the_home_does_not_let_move_stays_outside_unless_it_is_named(tmp_path: Path) -> None:
    body = FLAT + piece("wardrobe", 900, 270, 100, 54, movable="false") + piece("chair", 900, 100, 40, 42)
    said = "the wardrobe outside all rooms stays there: the home does not let it move"
    both = ["chair", "wardrobe"]
    for move, parked, told in (
        (None, ["chair"], True),
        ("all", ["chair"], True),
        ("wardrobe", ["wardrobe"], False),
        ("all,wardrobe", both, False),
    ):
        home = flat(tmp_path, body, move=move)
        given = [
            item.category for room in home.rooms for item in room.furniture if item.category in ("wardrobe", "chair")
        ]
        assert sorted(given) == parked
        assert (said in home.collection.notes) == told


def test_what_is_marked_is_to_be_placed_and_nothing_else(tmp_path: Path) -> None:
    body = FLAT + piece("wardrobe", 300, 270, 100, 54, movable="false") + piece("chair", 900, 100, 40, 42)

    def placed_anew(move: str | None) -> list[str]:
        rooms = flat(tmp_path, body, move=move).rooms
        return sorted(item.category for room in rooms for item in room.furniture if item.center is None)

    assert placed_anew(None) == ["chair"]
    assert placed_anew("all") == ["bed", "chair", "toilet"]  # the wardrobe is part of the building
    assert placed_anew("bed, wardrobe") == ["bed", "wardrobe"]
    assert placed_anew("") == []


# Writing


def assert_only_moved(before: Path, after: Path, moved: Iterable[str], *more: str) -> None:
    """Nothing but x, y, angle and `more` of elements with these ids differs, and no other entry of the ZIP."""
    with zipfile.ZipFile(before) as one, zipfile.ZipFile(after) as other:
        assert one.namelist() == other.namelist()
        assert all(one.read(name) == other.read(name) for name in one.namelist() if name != "Home.xml")
    changed = set()
    for old, new in zip(xml_of(before), xml_of(after), strict=True):
        assert (old.tag, old.text, old.tail) == (new.tag, new.text, new.tail)
        differing = {key for key in {**old.attrib, **new.attrib} if old.get(key) != new.get(key)}
        assert differing <= {"x", "y", "angle", *more}
        if differing:
            changed.add(old.get("id"))
    assert changed == set(moved)


def test_a_chair_that_is_lifted_may_stand_under_a_table_and_what_stood_is_known(tmp_path: Path) -> None:
    table = piece("table", 200, 150, 120, 80, id="table")
    chairs = piece("chair", 200, 195, 40, 40, id="under") + piece("chair", 50, 270, 40, 40, id="aside")
    parked = piece("chair", 900, 900, 40, 40, id="parked")
    body = table + chairs + parked + piece("sofa", 100, 40, 180, 80) + WALLS + room_tag(0, 0, 400, 300, name="Salon")
    home = flat(tmp_path, body, move="chair")
    (room,) = home.rooms
    standing = [(item.category, item.center is not None, item.tucked) for item in room.furniture]
    lifted = ("chair", False, True)
    assert sorted(standing) == [lifted, lifted, lifted, ("sofa", True, False), ("table", True, False)]
    stood = {item.center: item.tucked for item in home.stood[0] if item.category == "chair"}
    assert stood == {(2.0, -1.95): True, (0.5, -2.7): False, (9.0, -9.0): False}
    (alone,) = flat(tmp_path, chairs + WALLS + ROOMS, move="chair").rooms
    assert not any(item.tucked for item in alone.furniture)


def test_a_home_of_the_online_edition_is_a_home_and_comes_back_as_one(tmp_path: Path) -> None:
    source = opened(home_file(tmp_path / "flat.sh3x"), move="bed")
    assert source.collection.rooms == opened(home_file(tmp_path / "flat.sh3d"), move="bed").collection.rooms
    (bed,), *_ = source.stood
    first, *others = source.collection.rooms
    layouts = [replace(first, furniture=(replace(bed, center=(1.2, -1.3)),)), *others]
    with pytest.raises(InputError, match=r"out: .*out\.sh3d is no \.sh3x file"):
        source.write(layouts, tmp_path / "out.sh3d")
    source.write(layouts, tmp_path / "out.sh3x")
    assert_only_moved(tmp_path / "flat.sh3x", tmp_path / "out.sh3x", ["bed"])


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("Table ronde", "circle"),
        ("runder Esstisch", "circle"),
        ("tableRound", "circle"),
        ("圆形餐桌", "circle"),
        ("surround table", "rectangle"),
        ("圆角方桌", "rectangle"),
    ],
)
def test_what_is_called_round_is_in_every_language(name: str, form: str, tmp_path: Path) -> None:
    body = piece("none", 200, 150, 80, 80, catalogId="", name=name) + WALLS + room_tag(0, 0, 400, 300, name="Dining")
    (room,) = flat(tmp_path, body).rooms
    assert [item.form for item in room.furniture] == [form]


def test_numbers_written_as_references_are_read_and_written_over(tmp_path: Path) -> None:
    home = flat(tmp_path, FLAT.replace("x='100'", "x='1&#48;0'"), move="bed")
    home.write(flat(tmp_path, FLAT.replace("x='100'", "x='1&#48;0'")).rooms, tmp_path / "same.sh3d")
    assert (tmp_path / "same.sh3d").read_bytes() == home.path.read_bytes()
    (bed,), *_ = home.stood
    moved = replace(bed, center=(bed.center[0] + 0.5, bed.center[1]))
    home.write([replace(home.rooms[0], furniture=(moved,))], tmp_path / "out.sh3d")
    assert_only_moved(home.path, tmp_path / "out.sh3d", ["bed"])


def test_a_home_in_which_nothing_moved_is_written_byte_for_byte(tmp_path: Path) -> None:
    read_whole = flat(tmp_path, move="")
    home = flat(tmp_path, move="all")
    home.write(read_whole.rooms, tmp_path / "same.sh3d")
    home.write(home.rooms, tmp_path / "none placed.sh3d")
    home.write([], tmp_path / "nothing.sh3d")
    for name in ("same", "none placed", "nothing"):
        assert (tmp_path / f"{name}.sh3d").read_bytes() == home.path.read_bytes()


@given(
    x=st.floats(1.2, 2.8),
    y=st.floats(-1.8, -1.2),
    rotation=st.floats(0, 360),
    was=st.floats(-7, 7),
    encoding=st.booleans(),
)
def test_what_was_placed_is_where_the_layout_has_it(
    tmp_path_factory: pytest.TempPathFactory, x: float, y: float, rotation: float, was: float, encoding: bool
) -> None:
    folder = tmp_path_factory.mktemp("home")
    name = "Lit: été" if encoding else "Lit"
    bed = piece("bed140x190", 100, 104, 140, 190, id="bed", angle=was, name=name, description="a > b")
    path = home_file(folder / "flat.sh3d", bed + FLAT.replace(BED, ""))
    home = read_home(path, move="bed")
    bedroom, bathroom = home.rooms
    (bed_item,) = bedroom.furniture
    layout = replace(bedroom, furniture=(replace(bed_item, center=(x, y), rotation=rotation),))
    home.write([layout, bathroom], folder / "out.sh3d")
    assert_only_moved(path, folder / "out.sh3d", ["bed"])
    (again,) = read_home(folder / "out.sh3d", move="").rooms[0].furniture
    assert again.footprint.symmetric_difference(layout.furniture[0].footprint).area < 1e-3
    assert abs((again.degrees - rotation + 180) % 360 - 180) < 1e-3


def test_an_angle_that_was_left_out_is_added_and_a_group_moves_as_one(tmp_path: Path) -> None:
    inside = piece("bed", 100, 100, 90, 200, id="a") + piece("texturableBox", 150, 100, 20, 20, id="b", angle=1)
    group = piece("none", 110, 100, 110, 200, tag="furnitureGroup", inside=inside, catalogId="", name="Group", id="g")
    home = flat(tmp_path, group + WALLS + ROOMS, move="bed")
    room = home.rooms[0]
    layout = replace(room, furniture=(replace(room.furniture[0], center=(2, -2), rotation=180),))
    home.write([layout], tmp_path / "out.sh3d")
    assert_only_moved(home.path, tmp_path / "out.sh3d", ["a", "b", "g"])
    found = {e.get("id"): [float(e.get(key, 0)) for key in ("x", "y", "angle")] for e in xml_of(tmp_path / "out.sh3d")}
    assert found["g"] == pytest.approx([200, 200, math.pi / 2])
    assert found["a"] == pytest.approx([200, 190, math.pi / 2], abs=1e-3)  # 10 left of the middle: now above it
    assert found["b"] == pytest.approx([200, 240, 1 + math.pi / 2], abs=1e-3)


def test_what_stands_on_a_piece_moves_with_it(tmp_path: Path) -> None:
    """A TV on its unit and a lamp on that, but no picture above, no radiator behind, and nothing on the next piece."""
    body = (
        piece("tvUnit", 100, 20, 100, 40, id="unit", height=50, dropOnTopElevation=0.8)
        + piece("flatTV", 130, 20, 60, 10, id="tv", elevation=40, height=60)
        + piece("lamp", 130, 20, 10, 10, id="lamp", elevation=100, height=20, tag="light")
        + piece("picture", 100, 20, 60, 10, id="picture", elevation=120)
        + piece("electricRadiator", 100, 20, 60, 10, id="radiator", elevation=20, height=20)
        + piece("flatTV", 100, 60, 60, 10, id="aside", elevation=40)
        + piece("flatTV", 80, 20, 10, 10, id="fixed", elevation=50, movable="false")
    )
    home = flat(tmp_path, body + WALLS + room_tag(0, 0, 400, 300, name="Salon"), move="tv_unit")
    room = home.rooms[0]
    placed = [i if i.center else replace(i, center=(2, -2), rotation=180) for i in room.furniture]
    home.write([replace(room, furniture=tuple(placed))], tmp_path / "out.sh3d")
    assert_only_moved(home.path, tmp_path / "out.sh3d", ["unit", "tv", "lamp"])
    found = {e.get("id"): [float(e.get(key, 0)) for key in ("x", "y", "angle")] for e in xml_of(tmp_path / "out.sh3d")}
    assert found["tv"] == found["lamp"] == pytest.approx([200, 230, math.pi / 2], abs=1e-3)


def test_a_cushion_moves_with_the_smallest_piece_that_it_begins_within(tmp_path: Path) -> None:
    """One in a sofa under a loft does, but no shelf or radiator behind it; that a cushion is unknown is not said."""
    body = (
        piece("loftBed", 150, 100, 290, 190, id="loft", height=200)
        + piece("sofa", 100, 50, 200, 90, id="sofa", height=85)
        + piece("cushion", 120, 50, 40, 15, id="cushion", elevation=45, height=40)
        + piece("shelf", 120, 15, 40, 20, id="shelf", elevation=60, height=40)
        + piece("electricRadiator", 60, 12, 60, 12, id="radiator", elevation=15, height=40)
        + piece("cushion", 120, 160, 40, 15, id="pillow", elevation=150, height=20)
    )
    home = flat(tmp_path, body + WALLS + room_tag(0, 0, 400, 300, name="Salon"), move="sofa")
    room = home.rooms[0]
    placed = [i if i.center else replace(i, center=(2, -2), rotation=180) for i in room.furniture]
    home.write([replace(room, furniture=tuple(placed))], tmp_path / "out.sh3d")
    assert_only_moved(home.path, tmp_path / "out.sh3d", ["sofa", "cushion"])
    found = {e.get("id"): [float(e.get(key, 0)) for key in ("x", "y", "angle")] for e in xml_of(tmp_path / "out.sh3d")}
    assert found["cushion"] == pytest.approx([200, 220, math.pi / 2], abs=1e-3)
    assert not [note for note in home.collection.notes if "ushion" in note]


@pytest.mark.parametrize("angle", [None, math.pi / 2])
def test_a_group_that_does_not_say_where_it_is_is_where_its_parts_are(angle: float | None, tmp_path: Path) -> None:
    inside = piece("bed", 100, 100, 90, 200, id="a", angle=angle or 0)
    table = piece("bedsideTable", 180, 100, 30, 40, id="b", angle=math.pi / 2)
    turned = {} if angle is None else {"angle": angle}
    deeper = tag("furnitureGroup", tag("furnitureGroup", inside + table, name="Inner", id="i"), id="g", **turned)
    home = flat(tmp_path, deeper + WALLS + ROOMS, move="bed")
    room = home.rooms[0]
    (bed,) = room.furniture
    x0, x1, y0, y1 = (0.55, 2.0, 0.0, 2.0) if angle is None else (0.0, 2.0, 0.55, 1.45)
    assert home.stood[0][0].footprint.bounds == pytest.approx((x0, -y1, x1, -y0))
    assert bed.category == "bed"
    layout = replace(room, furniture=(replace(bed, center=(2.0, -1.5), rotation=home.stood[0][0].rotation),))
    home.write([layout], tmp_path / "out.sh3d")
    assert_only_moved(home.path, tmp_path / "out.sh3d", ["a", "b", "g", "i"])
    found = {e.get("id"): [float(e.get(key, 0)) for key in ("x", "y")] for e in xml_of(tmp_path / "out.sh3d")}
    assert found["a"] == pytest.approx([300 - (x0 + x1) * 50, 250 - (y0 + y1) * 50])


def test_points_of_lines_are_not_those_of_rooms(tmp_path: Path) -> None:
    line = tag("polyline", tag("point", x=1, y=1) * 4000)
    assert len(flat(tmp_path, FLAT + line).rooms) == 2


UPSTAIRS = '<up> & "é"'
STOREYS = tag("level", id="down", name="Ground") + tag("level", id=escape(UPSTAIRS), name="Upper")
STOREYS += room_tag(0, 0, 400, 300, name="Bathroom", level="down")
STOREYS += room_tag(0, 0, 600, 300, name="Bedroom", level=escape(UPSTAIRS))


@pytest.mark.parametrize("level", [{"level": "down"}, {}])
@pytest.mark.parametrize("group", [True, False])
def test_what_goes_to_a_room_of_another_level_is_written_onto_that_level(
    group: bool, level: dict[str, str], tmp_path: Path
) -> None:
    bed = piece("bed", 900, 100, 140, 200, id="bed", elevation=0, **level)
    grouped = piece("none", 900, 100, 140, 200, tag="furnitureGroup", inside=bed, name="Group", id="g", **level)
    home = flat(tmp_path, STOREYS + (grouped if group else bed))
    below, above = home.rooms
    assert (below.furniture, [item.category for item in above.furniture]) == ((), ["bed"])
    layout = replace(above, furniture=(replace(above.furniture[0], center=(3, -1.5), rotation=0),))
    home.write([below, layout], tmp_path / "out.sh3d")
    assert_only_moved(home.path, tmp_path / "out.sh3d", ["bed", "g"] if group else ["bed"], "level")
    moved = [e for e in xml_of(tmp_path / "out.sh3d") if e.get("id") in ("bed", "g")]
    assert {e.get("level") for e in moved} == {UPSTAIRS}
    again, bedroom = read_home(tmp_path / "out.sh3d", move="").rooms
    assert again.furniture == ()
    (item,) = bedroom.furniture
    assert item.footprint.symmetric_difference(layout.furniture[0].footprint).area < 1e-3


def test_what_is_parked_below_a_room_of_another_level_did_not_stand_in_it(tmp_path: Path) -> None:
    home = flat(tmp_path, STOREYS + piece("bed", 500, 150, 140, 200, level="down"))
    assert [[item.center for item in items] for items in home.stood] == [[], [None]]


def test_a_home_is_never_overwritten(tmp_path: Path) -> None:
    home = flat(tmp_path, move="all")
    before = home.path.read_bytes()
    for out, problem in (
        (home.path, "is there already"),
        (tmp_path / "out.jsonl", "is no .sh3d file"),
        (tmp_path / "none" / "out.sh3d", "cannot be written"),
    ):
        with pytest.raises(InputError, match=problem):
            home.write(read_home(home.path, move="").rooms, out)
    assert home.path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["flat.sh3d"]


def test_a_home_is_opened_as_every_source_is(tmp_path: Path) -> None:
    path = home_file(tmp_path / "flat.sh3d")
    source = opened(path, move="bed")
    assert source.suffix == ".sh3d"
    assert [room.id for room in source.collection.rooms] == ["flat/Bedroom", "flat/room 2"]
    source.write(source.collection.rooms, tmp_path / "out.sh3d")
    assert (tmp_path / "out.sh3d").read_bytes() == path.read_bytes()


# Files that are no homes


@pytest.mark.parametrize(
    ("xml", "problem"),
    [
        ("<!DOCTYPE home [<!ENTITY a 'aaaa'>]><home>&a;</home>", "DOCTYPE: expected none"),
        ("<!DOCTYPE home SYSTEM 'file:///etc/passwd'><home/>", "DOCTYPE: expected none"),
        ("<home><room>", "line 1: expected whole XML; got no element found"),
        ("<house/>", "expected the element home first"),
        ("<?xml version='1.0' encoding='ISO-8859-1'?><home/>", "encoding: expected UTF-8; got ISO-8859-1"),
        ("<home><wall id='a' xStart='nan' yStart='0' xEnd='1' yEnd='1' thickness='1'/></home>", "expected a number"),
        ("<home><wall id='a' xStart='1e300' yStart='0' xEnd='1' yEnd='1' thickness='1'/></home>", "got '1e300'"),
        (
            "<home><pieceOfFurniture name='bed' x='1' width='4' depth='5'/></home>",
            "'bed': y: .* got nothing",
        ),
        ("<home>" + "<a>" * 200 + "</a>" * 200 + "</home>", "expected at most 100 elements in each other"),
        ("<home>" + "<wall/>" * 2000 + "</home>", "wall: expected at most 400 in a home"),
    ],
)
def test_a_file_that_is_no_home_is_answered_in_one_line(xml: str, problem: str, tmp_path: Path) -> None:
    path = tmp_path / "home.sh3d"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("Home.xml", xml)
    with pytest.raises(InputError, match=problem) as caught:
        read_home(path)
    assert re.fullmatch(rf"{re.escape(str(path))}: Home\.xml.*", str(caught.value))


def test_a_zip_that_is_no_home_is_answered(tmp_path: Path) -> None:
    path = tmp_path / "home.sh3d"
    with pytest.raises(InputError, match="cannot be read"):
        read_home(path)
    path.write_bytes(b"no ZIP")
    with pytest.raises(InputError, match="expected a home of Sweet Home 3D, which is a whole ZIP file"):
        read_home(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("Home", b"before 5.3")
    with pytest.raises(InputError, match="save it anew"):
        read_home(path)


def test_a_bomb_is_unpacked_no_further_than_a_home_goes(tmp_path: Path) -> None:
    path = tmp_path / "home.sh3d"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("Home.xml", b"<home>" + b" " * 50_000_000 + b"</home>")
    with pytest.raises(InputError, match="expected at most 8 MB; it unpacks to more"):
        read_home(path)


@pytest.mark.parametrize("packed", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_a_home_packed_in_a_way_that_unpacks_without_bounds_is_refused(packed: int, tmp_path: Path) -> None:
    path = tmp_path / "home.sh3d"
    with zipfile.ZipFile(path, "w", packed) as archive:
        archive.writestr("Home.xml", b"<home/>")
    with pytest.raises(InputError, match="expected it stored or deflated; save the home anew"):
        read_home(path)


def test_entries_are_copied_and_never_unpacked_to_where_they_lead(tmp_path: Path) -> None:
    evil = {"../evil": b"x", "/evil": b"y", "big": b"\0" * 1_000_000}
    home = read_home(home_file(tmp_path / "in" / "flat.sh3d", entries=evil), move="bed")
    (room, _) = home.rooms
    moved = replace(room, furniture=(replace(room.furniture[0], center=(2, -1.5), rotation=0),))
    home.write([moved], tmp_path / "in" / "out.sh3d")
    assert_only_moved(home.path, tmp_path / "in" / "out.sh3d", ["bed"])
    assert sorted(file.name for file in tmp_path.rglob("*") if file.is_file()) == ["flat.sh3d", "out.sh3d"]


def test_rooms_of_a_home_can_be_written_as_json(tmp_path: Path) -> None:
    for room in flat(tmp_path).rooms:
        assert room_from_dict(room_to_dict(room)) == room
