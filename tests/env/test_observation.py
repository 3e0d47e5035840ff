"""The observations show the state, whole and exactly, and never the designer's place of the moving item."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from shapely.affinity import rotate, translate

from layoutrl.env.observation import (
    BLOCK,
    COLUMNS,
    ITEM,
    GeometryObservation,
    ImageObservation,
    described,
    out_of_line,
    upright_box,
)
from layoutrl.env.render import View, picture
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.room import Item, Opening, Room
from tests.builders import random_room, rectangle, rectangular_room, room_of

SEEDS = st.integers(0, 2**32 - 1)
CATEGORIES = ["bed", "chair", "lamp"]
DEVICES = ["cpu", *(["cuda"] if torch.cuda.is_available() else [])]


def positions_in(room: Room, count: int, rng: np.random.Generator) -> np.ndarray:
    """Positions (count, 2) at which the room's item fits."""
    return Simulator([room], Moves(), Reward()).starts(np.zeros(count, dtype=int), rng)


def designed_at(room: Room, center: np.ndarray | None) -> Room:
    """The room as if its designer had put the moving item elsewhere, or nowhere yet."""
    furniture = list(room.furniture)
    furniture[room.target] = replace(room.moving, center=None if center is None else tuple(center.tolist()))
    return replace(room, furniture=tuple(furniture))


def with_moving(room: Room, form: str, rng: np.random.Generator) -> Room:
    """The room with another moving item: an upright or turned rectangle or a circle, as large as the room or less."""
    x0, y0, x1, y1 = room.envelope.bounds
    width, depth = rng.choice([0.05, 0.3, 1.0]) * rng.uniform(0.5, 1, 2) * min(x1 - x0, y1 - y0)
    angles = {"turned": [rng.uniform(0, 360), 45.0, 89.999, 180 + 1e-7], "upright": [0.0, 90.0, 180.0, 270.0]}
    item = (
        Item("bed", (width, width), form="circle")
        if form == "circle"
        else Item("bed", (width, depth), rotation=float(rng.choice(angles[form])))
    )
    furniture = list(room.furniture)
    furniture[room.target] = item
    return replace(room, furniture=tuple(furniture))


def observed(observation, positions: np.ndarray, room: int = 0) -> torch.Tensor:
    return observation(torch.full((len(positions),), room), torch.as_tensor(positions))


def rows(room: Room, position: tuple[float, float], categories: list[str] | None = None) -> list[dict[str, float]]:
    """The geometry observation of one pose, a dictionary a row."""
    categories = CATEGORIES if categories is None else categories
    table = observed(GeometryObservation([room], categories), np.array([position]))[0]
    return [dict(zip((*COLUMNS, *categories), row, strict=True)) for row in table.tolist()]


def small_room() -> Room:
    """A room from (0, 0) to (4, 3), named walls, door, window, a turned chair and a round lamp."""
    return rectangular_room(
        item=Item("bed", (2.0, 1.0), (1.5, 2.0)),
        others=(
            Item("chair", (1.0, 0.5), (3.0, 1.0), rotation=30),
            Item("lamp", (0.4, 0.4), (3.5, 2.5), form="circle"),
        ),
        openings=(Opening("door", rectangle(1, -0.2, 2, 0)), Opening("window", rectangle(2, 3, 3.5, 3.2))),
        walls=(
            rectangle(-0.2, -0.2, 1, 0),
            rectangle(2, -0.2, 4.2, 0),
            rectangle(4, 0, 4.2, 3.2),
            rectangle(3.5, 3, 4, 3.2),
            rectangle(0, 3, 2, 3.2),
            rectangle(-0.2, 0, 0, 3.2),
        ),
    )


@given(SEEDS)
@settings(max_examples=15)
def test_rooms_that_differ_only_in_the_designers_place_look_the_same(seed):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    categories = categories_of([room])
    elsewhere, *positions = positions_in(room, 4, rng)
    positions = np.array(positions)
    for other in (designed_at(room, elsewhere), designed_at(room, None)):
        assert other.moving.center != room.moving.center
        geometry = [GeometryObservation([r], categories) for r in (room, other)]
        assert torch.equal(*(observed(o, positions) for o in geometry))
        assert geometry[0].space == geometry[1].space
        assert torch.equal(*(observed(ImageObservation([r]), positions) for r in (room, other)))


@given(SEEDS, st.integers(0, 3), st.booleans())
@settings(max_examples=15)
def test_turned_copies_that_differ_only_in_the_designers_place_look_the_same(seed, quarters, mirror):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    categories = categories_of([room])
    pair = [room.turned(quarters, mirror), designed_at(room, positions_in(room, 1, rng)[0]).turned(quarters, mirror)]
    positions = positions_in(pair[0], 2, rng)
    assert pair[0].moving.center != pair[1].moving.center
    assert torch.equal(*(observed(GeometryObservation([r], categories), positions) for r in pair))
    assert torch.equal(*(observed(ImageObservation([r]), positions) for r in pair))


@pytest.mark.parametrize(
    "item",
    [
        Item("bed", (1.4, 0.6), (2, 1.5)),
        Item("bed", (1.4, 0.6), (2, 1.5), 33),
        Item("bed", (1, 1), (2, 1.5), 0, "circle"),
    ],
)
def test_a_pose_never_changes_the_table_that_later_observations_come_from(item):
    room = rectangular_room(item=item)
    for observation in (GeometryObservation([room], ["bed"]), ImageObservation([room])):
        before = observed(observation, np.array([[1.0, 1.0]])).clone()
        shown = observed(observation, np.array([[2.5, 1.75]]))
        assert not torch.equal(before, shown)
        shown.zero_()
        assert torch.equal(observed(observation, np.array([[1.0, 1.0]])), before)


@given(SEEDS)
@settings(max_examples=20)
def test_the_moving_row_carries_the_pose_and_nothing_else_changes_with_it(seed):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    positions = positions_in(room, 8, rng)
    x0, y0, x1, y1 = room.envelope.bounds
    shown = observed(GeometryObservation([room], categories_of([room])), positions)
    place = [COLUMNS.index("x"), COLUMNS.index("y")]
    np.testing.assert_array_equal(shown[:, 0, place], (positions - [(x0 + x1) / 2, (y0 + y1) / 2]).astype(np.float32))
    assert (shown[:, 0, COLUMNS.index("moving")] == 1).all()
    assert (shown[:, 1:, COLUMNS.index("moving")] == 0).all()
    shown[:, 0, place] = 0
    assert (shown == shown[:1]).all()


def test_every_element_of_a_small_room_is_shown_as_worked_out_by_hand():
    # The envelope reaches from (-0.2, -0.2) to (4.2, 3.2): its centre, (2, 1.5), is the origin.
    moving, *others = rows(small_room(), (1.0, 1.25))
    cos60, sin60 = 0.5, np.sqrt(3) / 2
    expected = [
        ("moving", (-1.0, -0.25), (2.0, 1.0), (1, 0), "bed"),
        ("wall", (-1.6, -1.6), (1.2, 0.2), (1, 0), None),
        ("wall", (1.1, -1.6), (2.2, 0.2), (1, 0), None),
        ("wall", (2.1, 0.1), (0.2, 3.2), (1, 0), None),
        ("wall", (1.75, 1.6), (0.5, 0.2), (1, 0), None),
        ("wall", (-1.0, 1.6), (2.0, 0.2), (1, 0), None),
        ("wall", (-2.1, 0.1), (0.2, 3.2), (1, 0), None),
        ("door", (-0.5, -1.6), (1.0, 0.2), (1, 0), None),
        ("window", (0.75, 1.6), (1.5, 0.2), (1, 0), None),
        ("item", (1.0, -0.5), (1.0, 0.5), (cos60, sin60), "chair"),
        ("item", (1.5, 1.0), (0.4, 0.4), (0, 0), "lamp"),
    ]
    table = [
        dict.fromkeys((*COLUMNS, *CATEGORIES), 0.0)
        | {"present": 1.0, kind: 1.0, "x": x, "y": y, "extent_x": width, "extent_y": depth, "cos2": cos2, "sin2": sin2}
        | ({category: 1.0} if category else {})
        | ({"circle": 1.0} if category == "lamp" else {})
        | ({"cos": 1.0} if kind == "moving" else {})
        | ({"cos": np.sqrt(3) / 2, "sin": 0.5} if category == "chair" else {})
        for kind, (x, y), (width, depth), (cos2, sin2), category in expected
    ]

    def order(row):
        return [round(row[name], 3) for name in ("wall", "door", "window", "item", "x", "y")]

    assert moving == pytest.approx(table[0], abs=1e-6)
    for row, right in zip(sorted(others, key=order), sorted(table[1:], key=order), strict=True):
        assert row == pytest.approx(right, abs=1e-5)


def test_an_item_that_faces_along_x_extends_as_far_along_x_as_it_is_deep():
    (moving, *_) = rows(rectangular_room(4, 3, Item("bed", (2.0, 1.5), (1.0, 1.0))), (1.0, 1.0))
    assert (moving["extent_x"], moving["extent_y"]) == (2.0, 1.5)


@given(SEEDS)
@settings(max_examples=20)
def test_the_row_of_an_item_rebuilds_its_footprint(seed):
    room = random_room(np.random.default_rng(seed))
    x0, y0, x1, y1 = room.envelope.bounds
    moving, *others = rows(room, room.moving.center, categories_of([room]))
    shown = [moving, *(row for row in others if row["item"])]
    for row, item in zip(shown, (room.moving, *room.others), strict=True):
        if row["circle"]:
            shape = shapely.Point(0, 0).buffer(row["extent_x"] / 2, quad_segs=64)
            assert row["extent_x"] == pytest.approx(row["extent_y"], abs=1e-5)
        else:
            half = np.array([row["extent_x"], row["extent_y"]]) / 2
            shape = rotate(
                shapely.box(*-half, *half), np.arctan2(row["sin2"], row["cos2"]) / 2, (0, 0), use_radians=True
            )
        shape = translate(shape, row["x"] + (x0 + x1) / 2, row["y"] + (y0 + y1) / 2)
        assert bool(row["circle"]) == (item.form == "circle")
        assert row[item.category] == 1
        assert shape.intersection(item.footprint).area / shape.union(item.footprint).area > 0.995


@given(SEEDS)
@settings(max_examples=20)
def test_every_wall_and_opening_lies_in_the_rectangle_of_its_row(seed):
    room = random_room(np.random.default_rng(seed))
    x0, y0, x1, y1 = room.envelope.bounds
    shown = rows(room, room.moving.center, categories_of([room]))
    for kind, shapes in (
        ("wall", room.wall_shapes),
        ("door", [o.shape for o in room.doors]),
        ("window", [o.shape for o in room.windows]),
    ):
        for row, shape in zip([row for row in shown if row[kind]], shapes, strict=True):
            half = np.array([row["extent_x"], row["extent_y"]]) / 2
            around = rotate(
                shapely.box(*-half, *half), np.arctan2(row["sin2"], row["cos2"]) / 2, (0, 0), use_radians=True
            )
            around = translate(around, row["x"] + (x0 + x1) / 2, row["y"] + (y0 + y1) / 2)
            assert around.area <= 1.01 * shapely.minimum_rotated_rectangle(shape).area
            assert shape.difference(around).area < 0.01 * shape.area


@given(st.floats(0, 180), st.tuples(st.floats(0.3, 1.4), st.floats(0.3, 1.4)))
@settings(max_examples=40)
def test_a_half_turned_rectangle_differs_in_where_it_faces_and_in_nothing_else(rotation, size):
    assume(abs(rotation % 90 - 45) > 1e-6)  # at exactly 45 degrees either side may be called the width
    shown = [
        np.array([list(row.values()) for row in rows(room, (2.0, 1.5))])
        for turn in (0, 180)
        for room in [
            rectangular_room(
                item=Item("bed", size, (2, 1.5), rotation + turn),
                others=(Item("chair", size, (1, 1), rotation + turn),),
            )
        ]
    ]
    faces = [COLUMNS.index("cos"), COLUMNS.index("sin")]
    np.testing.assert_allclose(*(np.delete(one, faces, 1) for one in shown), atol=1e-5)
    np.testing.assert_allclose(shown[0][:, faces], -shown[1][:, faces], atol=1e-5)
    facing = np.deg2rad(rotation)
    np.testing.assert_allclose(shown[0][0, faces], (np.cos(facing), np.sin(facing)), atol=1e-5)


@pytest.mark.parametrize("degrees", [-45.0, 45.0, 135.0, 225.0])
def test_a_rectangle_at_45_degrees_up_to_rounding_is_described_as_one_at_45(degrees):
    plain, off = (described(np.array([[2.0, 1.0]]), np.array([degrees + by])) for by in (0, 1e-10))
    np.testing.assert_allclose(off, plain, atol=1e-9)


@given(SEEDS)
@settings(max_examples=20)
def test_the_upright_box_of_an_item_is_that_around_its_footprint(seed):
    room = random_room(np.random.default_rng(seed))
    elements = observed(GeometryObservation([room], CATEGORIES), np.array([room.moving.center]))[0]
    _, half = upright_box(elements[elements[:, ITEM] > 0].T)
    bounds = shapely.bounds(np.array([item.footprint for item in room.others]))
    np.testing.assert_allclose(2 * half.T, bounds[:, 2:] - bounds[:, :2], atol=1e-3)


@given(SEEDS)
@settings(max_examples=20)
def test_no_entry_is_larger_than_the_limit_in_upright_rooms(seed):
    rng = np.random.default_rng(seed)
    width, depth = rng.uniform(1.5, 6, 2)
    room = rectangular_room(width, depth, Item("bed", (1.0, 0.4), (width / 2, depth / 2), float(rng.uniform(0, 360))))
    observation = GeometryObservation([room], ["bed"])
    assert observed(observation, positions_in(room, 4, rng)).abs().max() <= observation.space.high.max()


@given(SEEDS)
@settings(max_examples=10)
def test_a_room_is_shown_the_same_among_larger_ones_apart_from_rows_of_zeros(seed):
    rng = np.random.default_rng(seed)
    room, other = random_room(rng), random_room(rng)
    categories = categories_of([room, other])
    alone, both = GeometryObservation([room], categories), GeometryObservation([other, room], categories)
    positions = positions_in(room, 3, rng)
    shown, among = observed(alone, positions), observed(both, positions, room=1)
    assert shown.shape == (3, *alone.space.shape)
    assert among.shape == (3, *both.space.shape)
    assert torch.equal(among[:, : alone.space.shape[0]], shown)
    assert (among[:, alone.space.shape[0] :] == 0).all()
    assert (shown[..., COLUMNS.index("present")] == 1).all()


@given(SEEDS)
@settings(max_examples=8)
def test_a_batch_of_several_rooms_shows_each_pose_as_alone(seed):
    rng = np.random.default_rng(seed)
    several = [random_room(rng) for _ in range(3)]
    room = rng.integers(3, size=5)
    positions = np.concatenate([positions_in(several[k], 1, rng) for k in room])
    for observation in (GeometryObservation(several, categories_of(several)), ImageObservation(several)):
        together = observation(torch.as_tensor(room), torch.as_tensor(positions))
        for k, index in enumerate(room):
            assert torch.equal(together[k], observed(observation, positions[k][None], int(index))[0])


@given(SEEDS)
@settings(max_examples=15)
def test_the_image_equals_the_reference_picture_to_a_level(seed):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    x0, y0, x1, y1 = room.envelope.bounds
    positions = rng.uniform((x0, y0), (x1, y1), (3, 2))  # also poses at which the item reaches out of the picture
    for shown, position in zip(observed(ImageObservation([room]), positions).numpy(), positions, strict=True):
        assert shown.dtype == np.uint8
        assert np.abs(shown.astype(int) - picture(room, position)).max() <= 1


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("forms", [("upright",), ("turned",), ("circle",), ("upright", "turned", "circle")])
@given(seed=SEEDS)
@settings(max_examples=12)
def test_items_of_every_form_look_as_in_the_reference_picture(device, forms, seed):
    rng = np.random.default_rng(seed)
    several = [with_moving(random_room(rng), form, rng) for form in forms for _ in range(2)]
    room = rng.integers(len(several), size=6)
    low, high = np.split(np.array([several[k].envelope.bounds for k in room]), 2, axis=1)
    positions = rng.uniform(low, high)
    positions[:2] = np.where(rng.random((2, 2)) < 0.5, low[:2], high[:2])  # partly out of the picture, if large
    shown = ImageObservation(several, device)(
        torch.as_tensor(room, device=device), torch.as_tensor(positions, device=device)
    )
    assert shown.dtype == torch.uint8
    for image, k, position in zip(shown.cpu().numpy(), room, positions, strict=True):
        assert np.abs(image.astype(int) - picture(several[k], position)).max() <= 1


@pytest.mark.parametrize("item", [Item("bed", (1.3, 0.7), None, 0), Item("bed", (1.3, 0.7), None, 20)])
def test_blended_colours_are_those_of_the_reference_nearly_everywhere(item):
    room = rectangular_room(item=item)
    positions = np.random.default_rng(0).uniform((0.5, 0.5), (3.5, 2.5), (20, 2))
    reference = np.stack([picture(room, position) for position in positions])
    assert (observed(ImageObservation([room]), positions).numpy() != reference).mean() < 1e-5


@pytest.mark.parametrize("form", ["upright", "turned", "circle"])
def test_a_room_ten_kilometres_away_looks_the_same(form):
    rng = np.random.default_rng(0)
    room = with_moving(small_room(), form, rng)
    far = np.array([10_000.0, -10_000.0])

    def moved(ring):
        return tuple((x + far[0], y + far[1]) for x, y in ring)

    away = replace(
        room,
        outline=moved(room.outline),
        walls=tuple(map(moved, room.walls)),
        openings=tuple(replace(o, polygon=moved(o.polygon)) for o in room.openings),
        furniture=tuple(replace(i, center=i.center and moved([i.center])[0]) for i in room.furniture),
    )
    positions = rng.uniform((0, 0), (4, 3), (20, 2))
    near, shown = (observed(ImageObservation([r]), p).int() for r, p in ((room, positions), (away, positions + far)))
    assert (near - shown).abs().max() <= 1


def test_a_large_batch_shows_each_pose_as_a_small_one():
    rng = np.random.default_rng(0)
    rooms = [with_moving(small_room(), form, rng) for form in ("upright", "turned", "circle")]
    observation = ImageObservation(rooms)
    room = torch.as_tensor(rng.integers(3, size=2 * BLOCK + 3))
    positions = torch.as_tensor(rng.uniform((0, 0), (4, 3), (len(room), 2)))
    shown = observation(room, positions)
    assert shown.shape == (len(room), *observation.space.shape)
    for first in range(0, len(room), 100):
        part = slice(first, first + 100)
        assert torch.equal(shown[part], observation(room[part], positions[part]))
    assert observation(room[:0], positions[:0]).shape == (0, *observation.space.shape)


def test_an_image_is_made_without_waiting_for_any_value_of_the_batch():
    rng = np.random.default_rng(0)
    rooms = [with_moving(small_room(), form, rng) for form in ("upright", "turned", "circle")]
    # On this device tensors have no values: to ask for one, or for as many as a condition picks, raises.
    room = torch.zeros(5, dtype=torch.long, device="meta")
    positions = torch.zeros(5, 2, dtype=torch.float64, device="meta")
    assert ImageObservation(rooms, "meta")(room, positions).shape == (5, 128, 128, 3)


@pytest.mark.parametrize(
    "item", [Item("bed", (1, 1), None, 0), Item("bed", (1, 1), None, 20), Item("bed", (1, 1), None, 0, "circle")]
)
def test_a_move_of_a_tenth_of_a_pixel_changes_the_image_but_none_leaves_it(item):
    room = room_of(rectangle(0, 0, 4, 3), item)
    tenth = 0.1 / View(room).scale
    start = np.array([1.37, 1.21])
    moved = start + np.array([(0, 0), (tenth, 0), (-tenth, 0), (0, tenth), (0, -tenth)])
    still, *others = observed(ImageObservation([room]), moved)
    assert torch.equal(still, observed(ImageObservation([room]), moved)[0])
    assert all(not torch.equal(still, other) for other in others)


def test_an_item_is_in_line_where_it_shares_a_side_or_the_middle_with_something() -> None:
    case = Item("bookcase", (0.4, 1.0), (3.0, 2.0), 0.0)  # from 2.8 to 3.2, and from 1.5 to 2.5
    room = rectangular_room(4, 4, Item("bed", (2.0, 1.0), None, 0.0), others=(case,), walls=())
    places = {
        (1.81, 2.0): (-0.01, 0.0),  # its right side is at 2.81, its middle level with that of the case
        (2.95, 2.03): (0.05, -0.03),
        (2.15, 1.02): (0.05, -0.02),  # right sides, and lower side at upper
        (2.21, 1.96): (-0.01, 0.04),
    }
    off = out_of_line(observed(GeometryObservation([room], CATEGORIES), np.array(list(places))))
    np.testing.assert_allclose(off, list(places.values()), atol=1e-6)
    chairs = tuple(Item("chair", (0.5, 0.5), center, 0.0) for center in ((1.0, 0.7), (3.0, 3.4)))
    for category, expected in (("chair", (0.06, 0.05)), ("lamp", (-0.19, -0.55))):  # midway of two chairs: (2.0, 2.05)
        pair = replace(room, furniture=(room.moving, chairs[0], replace(chairs[1], category=category)))
        off = out_of_line(observed(GeometryObservation([pair], CATEGORIES), np.array([(1.94, 2.0)])))
        np.testing.assert_allclose(off, [expected], atol=1e-6)
    alone = GeometryObservation([replace(room, furniture=room.furniture[:1])], CATEGORIES)
    assert out_of_line(observed(alone, np.array([(1.0, 1.0)]))).isinf().all()


@given(SEEDS)
def test_what_is_moved_by_how_far_it_is_out_of_line_is_in_line_and_no_line_is_nearer(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    observe, places = GeometryObservation([room], CATEGORIES), positions_in(room, 8, rng)
    off = out_of_line(observed(observe, places))
    for axis in (0, 1):
        there = places.copy()
        there[:, axis] += off[:, axis].numpy()
        assert (out_of_line(observed(observe, there))[:, axis].abs() < 2e-6).all()
        for share in rng.uniform(-0.99, 0.99, 5):  # nowhere nearer
            there[:, axis] = places[:, axis] + share * off[:, axis].numpy()
            left = out_of_line(observed(observe, there))[:, axis].abs()
            assert (left >= (1 - abs(share)) * off[:, axis].abs() - 2e-6).all()
