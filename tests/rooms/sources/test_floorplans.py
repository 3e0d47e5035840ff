"""The reader of the floor plans: small plans written here, and the real ones where they are."""

from __future__ import annotations

import shutil
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.rooms.collection import Collection
from layoutrl.rooms.room import TOLERANCE, Item, Room
from layoutrl.rooms.sources.floorplans import MAIN_ITEM, _snapped, read
from layoutrl.rooms.sources.plans import HALF_WALL

SHARE = 5  # of so many plans one is read; with -m slow, all
REAL = Path(__file__).parents[4] / "shared" / "data" / "floorplans"
real_data = pytest.mark.skipif(not REAL.is_dir(), reason=f"the floor plans are not in {REAL}")

METRES_PER_PIXEL = 0.02  # of the plan below: its squares and its inner door are drawn to it
HALF = HALF_WALL * 220  # pixels: the plan below is 300 wide and 140 high

# A washing room (x 0 to 150, y 0 to 100) left of a kitchen (x 150 to 300), a balcony below the kitchen.
WALLS = """
0 0 150 0 wall 1 1
300 0 150 0 wall 1 1
0 100 0 0 wall 1 1
150 0 150 100 wall 1 1
300 0 300 100 wall 1 1
0 100 150 100 wall 1 1
150 100 300 100 wall 1 1
150 100 150 140 wall 2 1
300 100 300 140 wall 2 1
150 140 300 140 wall 2 1
"""
OPENINGS = """
150 30 150 64 door 1 1
40 0 80 0 door 10 1
200 100 280 100 door 3 1
300 20 300 57 door 1 1
270 18 298 60 entrance 1 1
"""
LABELS = """
60 45 90 55 washing_room 1 1
210 45 240 55 kitchen 1 1
210 110 240 130 balcony 1 1
5 5 9 9 point 3 1
"""
SQUARES = """
155 5 187 37 washing_basin 2 1
187 5 219 37 washing_basin 2 1
219 5 251 37 washing_basin 2 1
"""
PLAN = WALLS + OPENINGS + LABELS + SQUARES
UNIT_SQUARE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


def tabs(text: str) -> str:
    """Rows as the files hold them: between tabs, most with one at the end."""
    rows = ["\t".join(line.split()) for line in text.strip().splitlines()]
    return "".join(row + ("\t\n" if k % 5 else "\n") for k, row in enumerate(rows))


def write(root: Path, plans: dict[str, str], copies: str = "") -> Path:
    for plan_id, text in plans.items():
        file = root / "data" / "floorplan_representation" / f"{plan_id}.txt"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    (root / "near_duplicates.tsv").write_text("plan_a\tplan_b\twall_cosine\n" + copies)
    return root


def read_plan(root: Path, text: str, room_type: str = "bathroom", labels: str = "snapped") -> Collection:
    return read(write(root, {"aa/bb/cc/0001": tabs(text)}), room_type, labels)  # type: ignore[arg-type]


def icon(category: str, left: float, bottom: float, width: float, height: float, style: int = 1, back: int = 1) -> str:
    """A row that puts an icon into the washing room: metres from its inner left and lower walls."""
    x, y = HALF + left / METRES_PER_PIXEL, 100 - HALF - bottom / METRES_PER_PIXEL
    x1, y1 = x + width / METRES_PER_PIXEL, y - height / METRES_PER_PIXEL
    return f"{x} {y1} {x1} {y} {category} {style} {back}\n"


def the_room(root: Path, text: str, room_type: str = "bathroom", labels: str = "snapped") -> Room:
    collection = read_plan(root, text, room_type, labels)
    assert len(collection.rooms) == 1, collection.left_out
    return collection.rooms[0]


def only(room: Room, category: str) -> Item:
    (item,) = (item for item in room.furniture if item.category == category)
    return item


def test_a_face_becomes_a_room_in_metres(tmp_path: Path) -> None:
    room = the_room(tmp_path, PLAN + icon("washing_basin", 0, 0, 0.5, 0.6, back=2))
    width, height = ((pixels - 2 * HALF) * METRES_PER_PIXEL for pixels in (150, 100))
    assert room.id == "aa/bb/cc/0001#washing_room-1"
    assert (room.room_type, room.group, room.target) == ("bathroom", "aa/bb/cc/0001", None)
    assert room.indoor.equals_exact(shapely.box(0, 0, width, height), 1e-4, normalize=True)
    assert shapely.is_ccw(room.indoor.exterior)
    band = 2 * HALF * METRES_PER_PIXEL
    expected = shapely.box(-band, -band, width + band, height + band)
    assert room.envelope.boundary.hausdorff_distance(expected.boundary) < 1e-3


def test_openings_are_doors_or_windows_by_what_lies_behind_them(tmp_path: Path) -> None:
    washing_room = the_room(tmp_path, PLAN + icon("washing_basin", 0, 0, 0.5, 0.6))
    (door,), (window,) = washing_room.doors, washing_room.windows
    band = 2 * HALF * METRES_PER_PIXEL
    right, top = (150 - 2 * HALF) * METRES_PER_PIXEL, (100 - 2 * HALF) * METRES_PER_PIXEL
    low, high = ((100 - HALF - y) * METRES_PER_PIXEL for y in (64, 30))  # y is up in the room, down in the file
    assert door.shape.equals_exact(shapely.box(right, low, right + band, high), 1e-3, normalize=True)
    start, stop = ((x - HALF) * METRES_PER_PIXEL for x in (40, 80))
    assert window.shape.equals_exact(shapely.box(start, top, stop, top + band), 1e-3, normalize=True)

    kitchen = the_room(tmp_path, PLAN, "kitchen")
    assert not kitchen.windows
    sides = Counter((round(d.shape.centroid.x, 1), round(d.shape.centroid.y, 1)) for d in kitchen.doors)
    assert sides == {(-0.0, 1.0): 1, (1.8, -0.0): 1, (3.0, 1.2): 1}  # inner door, balcony's glass door, entrance

    without_entrance = PLAN.replace("270 18 298 60 entrance 1 1", "")
    assert len(the_room(tmp_path, without_entrance, "kitchen").windows) == 1


def test_an_opening_is_clipped_to_the_wall_of_its_face_and_taken_once(tmp_path: Path) -> None:
    wide = PLAN.replace("40 0 80 0 door 10 1", "100 0 200 0 door 10 1\n101 0 199 0 door 10 1")
    room = the_room(tmp_path, wide + icon("washing_basin", 0, 0, 0.5, 0.6))
    (window,) = room.windows
    assert window.shape.bounds[2] == pytest.approx((150 - 2 * HALF) * METRES_PER_PIXEL, abs=1e-3)


def test_crooked_walls_that_miss_each_other_are_mended(tmp_path: Path) -> None:
    crooked = PLAN.replace("0 0 150 0 wall", "2 1 147 -1 wall").replace("0 100 150 100 wall", "-3 102 146 100 wall")
    crooked = crooked.replace("300 0 150 0 wall", "298 2 152 0 wall")
    assert len(the_room(tmp_path, crooked + icon("washing_basin", 0.2, 0.2, 0.5, 0.6)).outline) == 4


@pytest.mark.parametrize("oblique", ["90 100 150 60 wall 1 1", "150 60 90 100 wall 1 1"])
def test_the_corners_of_an_oblique_wall_are_not_sorted(tmp_path: Path, oblique: str) -> None:
    walls = "0 0 150 0 wall 1 1\n0 0 0 100 wall 1 1\n150 0 150 60 wall 1 1\n0 100 90 100 wall 1 1\n"
    labels = "60 45 70 55 washing_room 1 1\n5 5 30 30 washing_basin 1 2\n"
    room = the_room(tmp_path, walls + oblique + "\n" + labels)
    assert len(room.outline) == 5
    x, y = (max(c[axis] for c in room.outline) for axis in (0, 1))
    assert not room.indoor.covers(shapely.Point(x - 0.1, 0.1))
    assert room.indoor.covers(shapely.Point(0.1, y - 0.1))


def test_pillars_are_part_of_the_wall(tmp_path: Path) -> None:
    basin = icon("washing_basin", 0, 0, 0.5, 0.6)
    corner = the_room(tmp_path, PLAN + basin + icon("special", 2.5, 1.5, 0.6, 0.6, style=3))
    assert len(corner.outline) == 6
    assert not corner.holes
    free = the_room(tmp_path, PLAN + basin + icon("special", 1, 1, 0.3, 0.3, style=3))
    assert len(free.outline) == 4
    assert shapely.Polygon(free.holes[0]).area == pytest.approx(0.09, abs=1e-3)
    sliver = the_room(tmp_path, PLAN + basin + icon("special", 0.05, 1.4, 0.3, 0.6, style=3))
    assert len(sliver.outline) == 6  # no gap of 5 cm stays between pillar and wall


def test_a_doubled_icon_is_taken_once(tmp_path: Path) -> None:
    twins = icon("washing_basin", 0, 0, 0.5, 0.6) + icon("washing_basin", 0.05, 0.02, 0.5, 0.6)
    assert len(the_room(tmp_path, PLAN + twins).furniture) == 1
    neighbours = icon("washing_basin", 0, 0, 0.5, 0.6) + icon("washing_basin", 0.5, 0, 0.5, 0.6)
    assert len(the_room(tmp_path, PLAN + neighbours).furniture) == 2


def test_the_style_and_the_room_tell_what_a_washing_basin_is(tmp_path: Path) -> None:
    icons = "".join(icon("washing_basin", 0.7 * style - 0.7, 0, 0.6, 0.6, style) for style in (1, 2, 3, 4))
    names = Counter(item.category for item in the_room(tmp_path, PLAN + icons).furniture)
    assert names == {"vanity": 1, "washing_machine": 3}
    assert {item.category for item in the_room(tmp_path, PLAN, "kitchen").furniture} == {"fridge"}


@pytest.mark.parametrize(("back", "rotation"), [(1, 90), (2, 0), (3, 270), (4, 180)])
def test_an_item_faces_away_from_its_back(tmp_path: Path, back: int, rotation: int) -> None:
    width, height = (0.4, 0.7) if back in (1, 3) else (0.7, 0.4)
    toilet = only(the_room(tmp_path, PLAN + icon("toilet", 1, 0.7, width, height, back=back)), "toilet")
    assert toilet.rotation == rotation
    assert toilet.size == pytest.approx((0.7, 0.4))
    low_x, low_y, high_x, high_y = toilet.footprint.bounds
    assert (high_x - low_x, high_y - low_y) == pytest.approx((width, height))


def test_a_missing_d2_is_one(tmp_path: Path) -> None:
    row = icon("toilet", 1, 0.7, 0.4, 0.7).rsplit(maxsplit=1)[0]
    assert only(the_room(tmp_path, PLAN + row), "toilet").rotation == 90


def test_the_back_of_a_counter_is_the_long_side_at_the_wall(tmp_path: Path) -> None:
    # The drawing says bottom, but the counter hangs under the upper wall.
    counter = "190 3 270 32 cooking_counter 1 1\n"
    kitchen = the_room(tmp_path, PLAN.replace(SQUARES, "") + counter, "kitchen")
    assert kitchen.moving.category == "counter"
    assert kitchen.moving.rotation == 270
    assert kitchen.moving.size[0] < kitchen.moving.size[1]


# The rule of labels=snapped, in a room of one square metre: what is drawn, where it goes.
@pytest.mark.parametrize(
    ("toilet", "drawn", "expected"),
    [
        pytest.param(False, (0.1, 0.05, 0.6, 0.5), (0, 0, 0.5, 0.45), id="flush with the nearer walls"),
        pytest.param(False, (-0.1, 0.4, 0.4, 1.05), (0, 0.35, 0.5, 1), id="out of the wall"),
        pytest.param(False, (0.1, 0.3, 0.95, 0.6), (0, 0.3, 1, 0.6), id="stretched between two walls"),
        pytest.param(False, (0.13, 0.3, 0.95, 0.6), (0.18, 0.3, 1, 0.6), id="one gap is too wide to stretch"),
        pytest.param(False, (0.13, 0.2, 0.6, 0.6), (0.13, 0.2, 0.6, 0.6), id="free"),
        pytest.param(True, (0.34, 0.1, 0.74, 0.8), (0.3, 0, 0.7, 0.7), id="toilet: back flush, centred across"),
        pytest.param(True, (0.4, 0.13, 0.8, 0.8), (0.4, 0.13, 0.8, 0.8), id="toilet: free"),
        pytest.param(True, (0.03, 0.1, 0.43, 0.8), (0, 0, 0.4, 0.7), id="toilet: beside a wall"),
        pytest.param(True, (0.05, 0.1, 0.45, 0.8), (0.05, 0, 0.45, 0.7), id="toilet: 5 cm is a gap"),
        pytest.param(True, (0.1, 0.03, 0.8, 0.43), (0, 0, 0.7, 0.4), id="toilet: lies along x"),
        pytest.param(True, (0.05, 0.1, 0.91, 0.5), (0, 0.1, 0.86, 0.5), id="toilet: never stretched"),
    ],
)
def test_the_snapping_rule(toilet: bool, drawn: tuple[float, ...], expected: tuple[float, ...]) -> None:
    assert _snapped(drawn, toilet, (UNIT_SQUARE,)) == pytest.approx(expected)  # type: ignore[arg-type]


def test_snapping_sees_only_walls_that_face_the_item() -> None:
    # An L: the recess wall x = 0.6 faces what lies above y = 0.5.
    room = ((0.0, 0.0), (1.0, 0.0), (1.0, 0.5), (0.6, 0.5), (0.6, 1.0), (0.0, 1.0))
    assert _snapped((0.2, 0.6, 0.55, 0.8), False, (room,)) == pytest.approx((0.25, 0.6, 0.6, 0.8))
    assert _snapped((0.2, 0.2, 0.55, 0.3), False, (room,)) == pytest.approx((0.2, 0.2, 0.55, 0.3))
    hole = ((0.4, 0.4), (0.4, 0.6), (0.6, 0.6), (0.6, 0.4))
    assert _snapped((0.65, 0.4, 0.8, 0.6), False, (UNIT_SQUARE, hole)) == pytest.approx((0.6, 0.4, 0.75, 0.6))


@given(x=st.floats(-0.05, 0.8), y=st.floats(-0.05, 0.8), width=st.floats(0.2, 1), height=st.floats(0.2, 1), toilet=...)
def test_snapping_moves_no_side_further_than_the_slack(
    x: float, y: float, width: float, height: float, toilet: bool
) -> None:
    drawn = (x, y, x + width, y + height)
    moved = _snapped(drawn, toilet, (UNIT_SQUARE,))
    assert all(abs(a - b) <= 0.12 + 1e-9 for a, b in zip(drawn, moved, strict=True))


def test_raw_keeps_what_is_drawn_and_snapped_moves_it(tmp_path: Path) -> None:
    plan = PLAN + icon("bathtub", 0.05, 0.08, 0.7, 1.76, back=2)
    raw, snapped = (the_room(tmp_path, plan, labels=labels) for labels in ("raw", "snapped"))
    assert raw.target == snapped.target == 0
    assert raw.moving.footprint.bounds == pytest.approx((0.05, 0.08, 0.75, 1.84), abs=1e-4)
    assert snapped.moving.footprint.bounds[:2] == (0, 0)
    assert snapped.moving.size == pytest.approx((0.7, (100 - 2 * HALF) * METRES_PER_PIXEL), abs=2e-4)  # stretched
    assert raw.outline == snapped.outline
    assert raw.openings == snapped.openings


def test_two_main_items_are_no_target(tmp_path: Path) -> None:
    tubs = icon("bathtub", 0, 0, 0.7, 1.25) + icon("bathtub", 1, 0, 0.7, 1.25)
    assert the_room(tmp_path, PLAN + tubs).target is None


def test_without_anything_of_known_size_a_pixel_is_22_millimetres(tmp_path: Path) -> None:
    room = the_room(tmp_path, WALLS + LABELS + "50 50 80 80 washing_basin 1 1")
    assert max(x for x, _ in room.outline) == pytest.approx((150 - 2 * HALF) * 0.022, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (PLAN, "no furniture is drawn in it"),
        (PLAN + "20 20 40 40 corridor 1 1", "open plan: several kinds of room share the face"),
        (PLAN.replace("0 100 0 0 wall 1 1", ""), "its label lies in no closed face"),
        (LABELS, "its label lies in no closed face"),
        (PLAN + icon("washing_basin", -0.3, 0, 0.8, 0.6), "its furniture reaches beyond the outer walls"),
    ],
)
def test_a_room_that_cannot_be_used_is_named_with_the_reason(tmp_path: Path, text: str, reason: str) -> None:
    collection = read_plan(tmp_path, text)
    assert not collection.rooms
    assert collection.left_out == [("aa/bb/cc/0001#washing_room-1", reason)]


@pytest.mark.parametrize(
    ("row", "problem"),
    [
        ("1 2 3 4 wall", "with tabs between"),
        ("1 2 3 4 wall 1 1 1", "with tabs between"),
        ("1 2 3 four wall 1 1", "expected numbers"),
        ("1 2 3 nan wall 1 1", "finite"),
        ("1 2 3 4 wall one 1", "expected numbers"),
        ("1 2 3 4 toilet 1 5", "d2 from 1 to 4"),
        ("1 2 3 4 wal 1 1", "category is unknown"),
    ],
)
def test_a_bad_row_costs_its_plan_and_no_other(tmp_path: Path, row: str, problem: str) -> None:
    good = PLAN + icon("washing_basin", 0, 0, 0.5, 0.6)
    root = write(tmp_path, {"aa/bb/cc/0001": tabs(good), "aa/bb/cc/0002": tabs(good + row)})
    collection = read(root, "bathroom")
    assert [room.id for room in collection.rooms] == ["aa/bb/cc/0001#washing_room-1"]
    ((where, reason),) = collection.left_out
    assert where.endswith(f"0002.txt:{len(tabs(good).splitlines()) + 1}")
    assert reason.startswith("the plan has a bad row")
    assert problem in reason


def test_chains_of_near_copies_share_a_group(tmp_path: Path) -> None:
    text = tabs(PLAN + icon("washing_basin", 0, 0, 0.5, 0.6))
    plans = {f"aa/bb/cc/000{k}": text for k in range(1, 6)}
    copies = "aa/bb/cc/0005\taa/bb/cc/0003\t0.9\naa/bb/cc/0005\taa/bb/cc/0002\t0.86\n"
    rooms = read(write(tmp_path, plans, copies), "bathroom").rooms
    assert [room.group[-1] for room in rooms] == ["1", "2", "2", "4", "2"]


def test_what_the_user_got_wrong_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no floor plans: expected .* data\.root"):
        read(tmp_path / "nowhere", "bathroom")
    root = write(tmp_path, {"aa/bb/cc/0001": tabs(PLAN)})
    with pytest.raises(InputError, match=r"room: expected bathroom or kitchen .* got bedroom"):
        read(root, "bedroom")
    with pytest.raises(InputError, match=r"data\.labels: expected snapped or raw; got straight"):
        read(root, "bathroom", "straight")  # type: ignore[arg-type]
    (root / "near_duplicates.tsv").unlink()
    with pytest.raises(InputError, match="no list of near copies"):
        read(root, "bathroom")


# The real plans ------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module", params=[SHARE, pytest.param(1, marks=pytest.mark.slow)], ids="one of {}".format)
def share(request: pytest.FixtureRequest) -> int:
    """Of so many plans one is read."""
    return request.param


@pytest.fixture(scope="module")
def plans(share: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return some_of_the_plans(tmp_path_factory.mktemp("plans"), share)


def some_of_the_plans(folder: Path, share: int) -> Path:
    shutil.copy(REAL / "near_duplicates.tsv", folder)
    for file in sorted((REAL / "data" / "floorplan_representation").rglob("*.txt"))[::share]:
        copy = folder / file.relative_to(REAL)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(file, copy)
    return folder


@pytest.fixture(scope="module")
def bathrooms(plans: Path) -> Collection:
    return read(plans, "bathroom")


@pytest.fixture(scope="module")
def kitchens(plans: Path) -> Collection:
    return read(plans, "kitchen")


@pytest.fixture(scope="module")
def real_rooms(bathrooms: Collection, kitchens: Collection) -> list[Room]:
    return bathrooms.rooms + kitchens.rooms


@real_data
def test_real_rooms_are_valid(real_rooms: list[Room]) -> None:
    assert len({room.id for room in real_rooms}) == len(real_rooms)
    for room in real_rooms:
        assert room.indoor.is_valid, room.id
        assert shapely.is_ccw(shapely.LinearRing(room.outline)), room.id
        assert room.indoor.bounds[:2] == pytest.approx((0, 0)), room.id
        reach = room.envelope.buffer(TOLERANCE)
        assert all(reach.covers(item.footprint) for item in room.furniture), room.id
        for opening in room.openings:
            assert opening.shape.is_valid, room.id
            assert opening.shape.intersection(room.indoor).area < 1e-3, room.id
        if room.target is not None:
            assert room.moving.category == MAIN_ITEM[room.room_type]


@real_data
def test_real_rooms_number_as_in_the_format_notes(bathrooms: Collection, kitchens: Collection, share: int) -> None:
    def having_one(collection: Collection, kind: str, category: str) -> int:
        rooms = [room for room in collection.rooms if f"#{kind}-" in room.id]
        return sum(sum(item.category == category for item in room.furniture) == 1 for room in rooms)

    for collection, kind, category, low, high in (
        (bathrooms, "bathroom", "bathtub", 950, 1000),
        (bathrooms, "restroom", "toilet", 830, 870),
        (bathrooms, "washing_room", "vanity", 470, 510),
        (kitchens, "kitchen", "counter", 450, 480),
    ):
        off = 3 * np.sqrt(low / share) if share > 1 else 0  # by chance
        assert low / share - off <= having_one(collection, kind, category) <= high / share + off, category


@real_data
def test_real_rooms_are_shaped_and_sized_as_in_the_format_notes(bathrooms: Collection, kitchens: Collection) -> None:
    wet = [room for room in bathrooms.rooms if "#washing_room" not in room.id]
    assert sum(len(room.outline) == 4 for room in wet) / len(wet) == pytest.approx(0.97, abs=0.01)
    assert sum(len(room.outline) == 4 for room in kitchens.rooms) / len(kitchens.rooms) == pytest.approx(0.3, abs=0.05)

    def median_sides(kind: str) -> list[float]:
        boxes = [room.indoor.bounds for room in bathrooms.rooms if f"#{kind}-" in room.id]
        sides = [sorted((x1 - x0, y1 - y0)) for x0, y0, x1, y1 in boxes]
        return [sorted(side[k] for side in sides)[len(sides) // 2] for k in (0, 1)]

    assert median_sides("restroom") == pytest.approx([0.80, 1.32], abs=0.02)
    assert median_sides("bathroom") == pytest.approx([1.28, 1.73], abs=0.02)


@real_data
def test_both_label_sets_hold_the_same_rooms_and_reading_again_gives_the_same(
    plans: Path, kitchens: Collection
) -> None:
    again, raw = read(plans, "kitchen"), read(plans, "kitchen", "raw")
    assert again == kitchens
    assert [room.id for room in raw.rooms] == [room.id for room in kitchens.rooms]
    assert raw.left_out == kitchens.left_out


def test_a_folder_named_like_a_plan_costs_no_other(tmp_path: Path) -> None:
    root = write(tmp_path, {"aa/bb/cc/0001": tabs(PLAN + icon("washing_basin", 0, 0, 0.5, 0.6))})
    (root / "data" / "floorplan_representation" / "aa" / "bb" / "cc" / "0002.txt").mkdir()
    collection = read(root, "bathroom")
    assert len(collection.rooms) == 1
    assert "cannot be read" in collection.left_out[0][1]
