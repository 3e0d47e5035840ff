"""The reader of the rooms that the paper's authors published."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
import shapely
from shapely.geometry import Polygon, box

from layoutrl.rooms.collection import Collection
from layoutrl.rooms.room import SYMMETRIES
from layoutrl.rooms.sources.designer_rooms import read, rectangles, runs, same_room
from tests.builders import opening, rectangular_room

REAL = Path(__file__).parents[4] / "shared" / "data" / "designer_rooms"
real_data = pytest.mark.skipif(not REAL.is_dir(), reason=f"the designers' rooms are not in {REAL}")

Layout = dict[str, Any]


def corners(x0: float, y0: float, x1: float, y1: float) -> list[dict[str, float]]:
    return [{"x": x, "y": y} for x, y in ((x0, y0), (x0, y1), (x1, y1), (x1, y0))]


def diagonals(x0: float, y0: float, x1: float, y1: float) -> list[dict[str, float]]:
    return [{"x": x, "y": y} for x, y in ((x0, y0), (x1, y1), (x0, y1), (x1, y0))]


def zone(number: int, x: float, y: float, dx: float, dy: float, rot: int) -> Layout:
    return {"id": number, "center": {"x": x, "y": y}, "bound": {"dx": dx, "dy": dy}, "rot": rot}


def tatami(mirror: bool = False, door_at: float = 0) -> Layout:
    """2.8 x 3.2 m: door south, window west, platform along the east wall; walls no longer than the room."""
    side = -1 if mirror else 1

    def place(x0: float, y0: float, x1: float, y1: float) -> list[dict[str, float]]:
        return corners(side * x0, y0, side * x1, y1)

    return {
        "walls": [
            {"wallPoints": place(*wall)}
            for wall in ((0, -200, 2800, 0), (2800, 0, 3000, 3200), (0, 3200, 2800, 3400), (-200, 0, 0, 3200))
        ],
        "doors": [{"points": place(100 + door_at, -250, 1000 + door_at, 50)}],
        "windows": [{"points": place(-300, 1000, 0, 2200)}],
        "functionZones_layout": [
            zone(1, side * 2000, 1600, 1600, 3200, 0 if mirror else 180),
            zone(2, side * 2000, 2900, 1600, 600, 270),
            zone(3, side * 600, 2900, 1200, 600, 270),
            zone(4, side * 600, 2300, 450, 450, 90),
        ],
    }


def bedroom() -> Layout:
    """4 x 4.2 m less an alcove: walls as diagonals, one wall end 5 cm short, an L-shaped wardrobe."""
    walls = (
        (-200, -200, 3000, 0),  # south
        (3000, -200, 3200, 1000),
        (3000, 1000, 4000, 1200),
        (4000, 1000, 4200, 4200),  # east
        (-200, 4200, 4200, 4300),  # north, 0.1 m
        (-200, -200, 0, 4150),  # west, ends 5 cm below the north wall
    )
    return {
        "walls": [{"points": diagonals(*wall), "thickness": 200} for wall in walls],
        "doors": [{"points": corners(2950, 50, 3250, 950)}],
        "windows": [{"points": corners(800, 4100, 2600, 4400)}],
        "functionZones_layout": [
            zone(1, 1050, 2500, 2100, 1500, 0),
            zone(3, 250, 3500, 500, 500, 0),
            zone(4, 3800, 2500, 400, 1500, 180),
            {
                "id": 9,
                "rot": -10000,
                "points": [[0, 0], [1800, 0], [1800, 600], [600, 600], [600, 1500], [0, 1500]],
            },
        ],
    }


def write(root: Path, path: str, *layouts: Layout) -> None:
    (root / path).parent.mkdir(parents=True, exist_ok=True)
    (root / path).write_text("\n".join(json.dumps(layout) for layout in layouts), encoding="utf-8")


def read_one(root: Path, layout: Layout) -> Collection:
    write(root, "bedroom/L-shape/room.json_layout0.json", layout)
    return read(root, "bedroom")


def test_tatami_room_in_metres(tmp_path: Path) -> None:
    write(tmp_path, "tatami/13_layout.json", tatami())
    (room,) = read(tmp_path, "tatami").rooms
    assert (room.id, room.group, room.room_type) == ("tatami/13#0", "tatami/13", "tatami")
    assert room.indoor.equals(box(0, 0, 2.8, 3.2))
    assert shapely.is_ccw(room.indoor.exterior)
    assert [item.category for item in room.furniture] == ["platform", "wardrobe", "desk", "stool"]
    assert room.moving.footprint.equals(box(1.2, 0, 2.8, 3.2))


def test_bound_is_in_room_axes(tmp_path: Path) -> None:
    write(tmp_path, "tatami/13_layout.json", tatami())
    (room,) = read(tmp_path, "tatami").rooms
    desk = room.furniture[2]
    assert (desk.size, desk.rotation) == ((0.6, 1.2), 270)  # 0.6 deep along its facing, which is down
    assert desk.footprint.bounds == pytest.approx((0, 2.6, 1.2, 3.2))


def test_walls_meet_at_corners_and_are_cut_by_openings(tmp_path: Path) -> None:
    write(tmp_path, "tatami/13_layout.json", tatami())
    (room,) = read(tmp_path, "tatami").rooms
    band = box(-0.2, -0.2, 3.0, 3.4).difference(room.indoor)
    assert len(room.walls) == 6  # four, two of them cut in two
    assert room.doors[0].shape.equals(box(0.1, -0.2, 1.0, 0))  # drawn 0.3 m thick
    assert room.windows[0].shape.equals(box(-0.2, 1.0, 0, 2.2))
    assert sum(w.area for w in room.wall_shapes) + 0.18 + 0.24 == pytest.approx(band.area)
    assert shapely.union_all([*room.wall_shapes, *(o.shape for o in room.openings)]).equals(band)
    assert room.envelope.symmetric_difference(box(-0.2, -0.2, 3.0, 3.4)).area < 1e-6


def test_bedroom_with_diagonal_walls_and_an_alcove(tmp_path: Path) -> None:
    write(tmp_path, "bedroom/one-line/ 140  主卧 .json_layout2.json", bedroom())
    (room,) = read(tmp_path, "bedroom").rooms
    assert (room.id, room.group) == ("bedroom/one-line/ 140  主卧 #2", "bedroom/140 主卧")
    alcove = box(3.0, 0, 4.0, 1.2)
    assert room.indoor.equals(box(0, 0, 4, 4.2).difference(alcove))
    assert room.doors[0].shape.equals(box(3.0, 0.05, 3.2, 0.95))
    assert room.windows[0].shape.equals(box(0.8, 4.2, 2.6, 4.3))  # the north wall is 0.1 m thick
    for k, wall in enumerate(room.wall_shapes):
        assert all(wall.intersection(other).area < 1e-9 for other in room.wall_shapes[:k])
    assert Counter(i.category for i in room.furniture) == {"bed": 1, "nightstand": 1, "tv_unit": 1, "wardrobe": 2}
    assert room.target == 0


def test_wardrobe_runs_face_the_hollow_between_them() -> None:
    letter_u = Polygon([(0, 0), (2, 0), (2, 2.1), (0, 2.1), (0, 1.5), (1.4, 1.5), (1.4, 0.6), (0, 0.6)])
    items = runs(letter_u, "wardrobe")
    assert shapely.union_all([i.footprint for i in items]).symmetric_difference(letter_u).area == pytest.approx(0)
    assert sorted(i.rotation for i in items) == [90, 180, 270]
    assert all(i.size[0] == pytest.approx(0.6) for i in items)


@pytest.mark.parametrize(
    ("least", "points"),
    [
        (1, [(0, 0), (3, 0), (3, 2), (0, 2)]),
        (2, [(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (0, 2)]),  # L
        (2, [(0, 0), (3, 0), (3, 1), (2, 1), (2, 2), (1, 2), (1, 1), (0, 1)]),  # T: one cut through both corners
        (3, [(0, 0), (3, 0), (3, 2), (2, 2), (2, 1), (1, 1), (1, 3), (0, 3)]),  # U
        (3, [(0, 0), (3, 0), (3, 1), (2, 1), (2, 2), (1, 2), (1, 3), (0, 3)]),  # steps
    ],
)
def test_least_number_of_rectangles(least: int, points: list[tuple[float, float]]) -> None:
    for ring in (points, points[::-1], [(y, x) for x, y in points], [(x - 9, y - 9) for x, y in points]):
        shape = shapely.geometry.polygon.orient(Polygon(ring))
        parts = rectangles(shape)
        assert len(parts) == least
        assert sum(part.area for part in parts) == pytest.approx(shape.area)
        assert all(part.area == pytest.approx(part.envelope.area) for part in parts)


def test_several_layouts_a_file_and_duplicates(tmp_path: Path) -> None:
    moved = bedroom()
    moved["functionZones_layout"][0]["center"]["y"] = 2600
    write(tmp_path, "bedroom/L-shape/room.json_layout0.json", bedroom(), bedroom(), moved)
    write(tmp_path, "bedroom/one-line/room.json_layout0.json", bedroom())
    collection = read(tmp_path, "bedroom")
    assert [r.id for r in collection.rooms] == ["bedroom/L-shape/room#0", "bedroom/L-shape/room#0.2"]
    duplicate = "it is an exact duplicate of a layout already read"
    assert collection.left_out == [("bedroom/L-shape/room#0.1", duplicate), ("bedroom/one-line/room#0", duplicate)]


def without_a_wall(layout: Layout) -> None:
    del layout["walls"][1]


def without_doors(layout: Layout) -> None:
    del layout["doors"]


def bed_outside(layout: Layout) -> None:
    layout["functionZones_layout"][0]["center"]["x"] = 500


def nan_bed(layout: Layout) -> None:
    layout["functionZones_layout"][0]["center"]["x"] = float("nan")


def null_bed(layout: Layout) -> None:
    layout["functionZones_layout"][0] = None


def unknown_item(layout: Layout) -> None:
    layout["functionZones_layout"][1]["id"] = 99


def oblique_item(layout: Layout) -> None:
    layout["functionZones_layout"][1]["rot"] = 45


def oblique_wardrobe(layout: Layout) -> None:
    layout["functionZones_layout"][3]["points"] = [[0, 0], [1800, 0], [0, 600]]


def oblong_wardrobe(layout: Layout) -> None:
    layout["functionZones_layout"][3]["points"] = [[0, 0], [1800, 0], [1800, 600], [0, 600]]


def empty_item(layout: Layout) -> None:
    layout["functionZones_layout"][1]["bound"]["dx"] = 0


def no_furniture(layout: Layout) -> None:
    layout["functionZones_layout"] = []


def door_off_the_walls(layout: Layout) -> None:
    layout["doors"][0]["points"] = corners(1000, 1000, 1900, 1200)


@pytest.mark.parametrize(
    ("spoil", "reason"),
    [
        (without_a_wall, "its walls do not close"),
        (without_doors, "a field is missing or is not of the expected kind"),
        (null_bed, "a field is missing or is not of the expected kind"),
        (nan_bed, "a coordinate is not a number, or is kilometres away"),
        (bed_outside, "its bed is not inside the room"),
        (unknown_item, "an item's id has no known meaning"),
        (oblique_item, "an item is not turned by quarters of a circle"),
        (oblique_wardrobe, "an item's polygon is not made of axis-parallel edges"),
        (
            oblong_wardrobe,
            "an item's polygon is a rectangle: it does not tell which way the item faces",
        ),
        (empty_item, "an item has no area"),
        (no_furniture, "it has no furniture"),
        (door_off_the_walls, "a door or window lies in no wall"),
    ],
)
def test_a_bad_layout_is_left_out_with_its_reason(tmp_path: Path, spoil: Any, reason: str) -> None:
    layout = bedroom()
    spoil(layout)
    write(tmp_path, "bedroom/L-shape/bad.json_layout0.json", layout)
    collection = read_one(tmp_path, bedroom())
    assert collection.left_out == [("bedroom/L-shape/bad#0", reason)]
    assert [r.id for r in collection.rooms] == ["bedroom/L-shape/room#0"]


def test_a_folder_named_like_a_file_does_not_stop_the_others(tmp_path: Path) -> None:
    (tmp_path / "bedroom" / "L-shape" / "bad.json_layout0.json").mkdir(parents=True)
    collection = read_one(tmp_path, bedroom())
    assert collection.left_out == [("bedroom/L-shape/bad#0", "the file cannot be read as JSON")]
    assert len(collection.rooms) == 1


@pytest.mark.parametrize("text", ["", "{", '{"walls": [}', "\x00"])
def test_a_malformed_file_does_not_stop_the_folder(tmp_path: Path, text: str) -> None:
    write(tmp_path, "bedroom/L-shape/bad.json_layout0.json")
    (tmp_path / "bedroom/L-shape/bad.json_layout0.json").write_text(text, encoding="utf-8")
    collection = read_one(tmp_path, bedroom())
    assert collection.left_out == [("bedroom/L-shape/bad#0", "the file cannot be read as JSON")]
    assert len(collection.rooms) == 1


def test_what_stands_before_a_broken_end_is_kept(tmp_path: Path) -> None:
    write(tmp_path, "tatami/13_layout.json", tatami())
    with (tmp_path / "tatami/13_layout.json").open("a") as file:
        file.write('{"walls": ')
    collection = read(tmp_path, "tatami")
    assert [r.id for r in collection.rooms] == ["tatami/13#0"]
    assert collection.left_out == [("tatami/13#0.1", "the file cannot be read as JSON")]


def test_no_target_where_two_beds_stand(tmp_path: Path) -> None:
    layout = bedroom()
    layout["functionZones_layout"].append(zone(1, 1050, 700, 1200, 600, 0))
    (room,) = read_one(tmp_path, layout).rooms
    assert room.target is None


def test_one_room_under_two_names_is_one_group(tmp_path: Path) -> None:
    write(tmp_path, "tatami/1_layout.json", tatami())
    write(tmp_path, "tatami/2_layout.json", tatami(door_at=100))
    write(tmp_path, "tatami/3_layout.json", tatami(mirror=True))
    write(tmp_path, "tatami/4_layout.json", tatami(mirror=True, door_at=95))
    groups = [room.group for room in read(tmp_path, "tatami").rooms]
    assert groups == ["tatami/1", "tatami/2", "tatami/1", "tatami/2"]


@pytest.mark.parametrize(("quarters", "mirror"), SYMMETRIES)
def test_a_room_is_the_same_turned_and_mirrored_and_none_that_is_wider(quarters: int, mirror: bool) -> None:
    room = rectangular_room(4, 3, openings=(opening("door", 0.5, -0.2, 1.4, 0), opening("window", 4, 1, 4.2, 2.5)))
    turned = room.turned(quarters, mirror)
    assert same_room(room, turned)
    assert not same_room(rectangular_room(4.05, 2.963, openings=room.openings), turned)


def test_groups_join_through_a_room_of_two_shapes(tmp_path: Path) -> None:
    write(tmp_path, "tatami/1_layout.json", tatami())
    write(tmp_path, "tatami/2_layout.json", tatami(door_at=100))
    write(tmp_path, "tatami/3_layout.json", tatami(mirror=True), tatami(mirror=True, door_at=100))
    assert {room.group for room in read(tmp_path, "tatami").rooms} == {"tatami/1"}


def test_other_room_types_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"room: expected bedroom or tatami .* got kitchen"):
        read(tmp_path, "kitchen")


def test_a_root_without_files_says_how_to_mend_it(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"no tatami layouts in .*tatami/\*\.json.*data\.root="):
        read(tmp_path / "missing", "tatami")


@real_data
@pytest.mark.parametrize(
    ("room_type", "layouts", "groups", "area"),
    [("bedroom", (150, 217), (25, 41), (9.9, 26.7)), ("tatami", (70, 161), (40, 85), (6.7, 12.0))],
)
def test_published_rooms(
    room_type: str, layouts: tuple[int, int], groups: tuple[int, int], area: tuple[float, float]
) -> None:
    collection = read(REAL, room_type)
    rooms = collection.rooms
    assert layouts[0] <= len(rooms) <= layouts[1]
    assert groups[0] <= len({r.group for r in rooms}) <= groups[1]
    assert len({r.id for r in rooms}) == len(rooms)
    assert len({reason for _, reason in collection.left_out}) <= 3
    again = read(REAL, room_type)
    assert (again.rooms, again.left_out) == (rooms, collection.left_out)
    for room in rooms:
        assert area[0] <= room.indoor.area <= area[1]
        assert room.indoor.is_valid
        assert shapely.is_ccw(room.indoor.exterior)
        assert min(len(room.doors), len(room.windows)) > 0
        assert room.target is not None
        assert all(item.footprint.difference(room.indoor).area < 1e-6 for item in room.furniture)
        parts = [*room.wall_shapes, *(o.shape for o in room.openings), room.indoor]
        assert sum(part.area for part in parts) == pytest.approx(shapely.union_all(parts).area, abs=1e-6)


@real_data
def test_every_published_platform_touches_three_walls() -> None:
    for room in read(REAL, "tatami").rooms:
        x0, y0, x1, y1 = room.moving.footprint.bounds
        left, bottom, right, top = room.indoor.bounds
        assert sum(abs(d) < 0.001 for d in (x0 - left, y0 - bottom, x1 - right, y1 - top)) == 3
        assert [i.category for i in room.furniture] == ["platform", "wardrobe", "desk", "stool"]


@real_data
def test_published_beds_stand_with_the_head_at_a_wall_beside_the_window() -> None:
    for room in read(REAL, "bedroom").rooms:
        bed = room.moving
        across = bed.rotation % 180 == 0  # the bed lies along x: its head touches a wall along y
        x0, y0, x1, y1 = bed.footprint.bounds
        x, y = (x0 + x1) / 2, (y0 + y1) / 2
        head = {0.0: (x0, y), 90.0: (x, y0), 180.0: (x1, y), 270.0: (x, y1)}[bed.rotation]
        assert room.indoor.boundary.distance(shapely.Point(head)) < 0.001
        if len(room.outline) == 4:
            left, bottom, right, top = room.windows[0].shape.bounds
            assert (right - left > top - bottom) == across
