from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, Polygon

from layoutrl import InputError
from layoutrl.env.geometry import CONTACT, GRID
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import TOUCHING, Moves, Simulator, _anywhere, pixel_size
from layoutrl.rooms.fitting import fitting_positions
from layoutrl.rooms.room import FIT, Item, Room, wall_band
from tests.builders import l_room, opening, random_room, rectangle, rectangular_room

RIGHT, LEFT, BELOW, ABOVE = range(4)
VECTORS = np.array([(1, 0), (-1, 0), (0, -1), (0, 1)])
seeds = st.integers(0, 2**32 - 1)


def simulator_of(*rooms: Room, moves: Moves | None = None, reward: Reward | None = None) -> Simulator:
    return Simulator(rooms, moves or Moves((0.32, 0.08, 0.02)), reward or Reward())


def drawn(
    seed: int, rooms: int = 3, positions: int = 24, alone: bool = False
) -> tuple[list[Room], np.ndarray, np.ndarray]:
    """Random rooms, without other items if `alone`, an index array into them and a legal position for each entry."""
    rng = np.random.default_rng(seed)
    those = [random_room(rng) for _ in range(rooms)]
    if alone:
        those = [replace(room, furniture=(room.moving,), target=0) for room in those]
    index = rng.integers(rooms, size=positions)
    return those, index, simulator_of(*those).starts(index, rng)


def positions(areas: Sequence[Polygon], rooms: Sequence[Room]) -> np.ndarray:
    """Where the moving item of each room lies in an area."""
    return fitting_positions(np.array(areas), np.array([room.moving.template for room in rooms]))


def at(simulator: Simulator, *positions: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    return np.zeros(len(positions), dtype=int), np.array(positions, dtype=float)


# areas and rewards, by hand and against shapely


HAND_ROOM = rectangular_room(
    4,
    3,
    item=Item("bed", (1.0, 1.0), (1.0, 1.0)),  # 0.5 to 1.5 both ways
    others=(Item("table", (1.0, 1.0), (3.0, 2.0)),),  # 2.5 to 3.5 by 1.5 to 2.5
    openings=(opening("door", 1.0, -0.2, 2.0, 0.0), opening("window", 1.5, 3.0, 2.5, 3.2)),  # 0.2 each
    walls=(
        rectangle(-0.2, -0.2, 1.0, 0.0),
        rectangle(2.0, -0.2, 4.2, 0.0),
        rectangle(4.0, 0.0, 4.2, 3.2),
        rectangle(2.5, 3.0, 4.0, 3.2),  # 0.3
        rectangle(-0.2, 3.0, 1.5, 3.2),
        rectangle(-0.2, 0.0, 0.0, 3.0),  # 0.6
    ),
)


@pytest.mark.parametrize(
    ("center", "r1", "r2", "r3"),
    [
        ((1.0, 1.0), 100, 0, 0),  # the designer's place
        ((1.5, 1.0), 100 * 0.5 / 1.5, 0, 0),  # half of it
        ((2.75, 2.0), 0, -60, 0),  # 0.75 of the table: 0.75 / 1.25
        ((0.3, 1.5), 100 * 0.15 / 1.85, -100 * 0.2 / 1.4, -20),  # goal 0.3 x 0.5; 0.2 of the left wall
        ((1.5, 0.3), 100 * 0.15 / 1.85, -20, -20),  # goal 0.5 x 0.3; the whole door: 0.2 / 1
        ((2.0, 2.7), 0, -20, -20),  # the whole window: 0.2 / 1; the table is only touched
        ((3.0, 2.7), 0, -100 * (0.3 / 1.7 + 0.2 / 1.1), -20),  # 1 x 0.3 of the table; 0.2 of the upper wall
    ],
)
def test_the_reward_of_a_room_worked_out_by_hand(center: tuple[float, float], r1: float, r2: float, r3: float) -> None:
    simulator = simulator_of(HAND_ROOM)
    terms = simulator.reward(*at(simulator, center))
    assert (terms.r1.item(), terms.r2.item(), terms.r3.item()) == pytest.approx((r1, r2, r3))
    assert terms.iou.item() == pytest.approx(r1 / 100)
    assert terms.total.item() == pytest.approx(r1 + r2 + r3)


def test_the_coverage_of_a_room_worked_out_by_hand() -> None:
    simulator = simulator_of(HAND_ROOM)
    covered, outside = simulator.overlap_and_outside(*at(simulator, (1.0, 1.0), (2.75, 2.0), (3.0, 2.7), (0.0, 3.0)))
    assert covered == pytest.approx([0, 0.75, 0.3, 0])  # walls and openings are no items
    assert outside == pytest.approx([0, 0, 0.2, 0.75])


def naive_reward(room: Room, position: np.ndarray, reward: Reward) -> tuple[float, float, float]:
    """Section 4.3 word for word: every element, no short cuts."""
    item = room.moving.footprint_at(tuple(position))

    def overlap(shape: Polygon) -> float:
        return item.intersection(shape).area / item.union(shape).area

    elements = [Polygon(wall) for wall in room.walls] + [Polygon(o.polygon) for o in room.openings]
    elements += [other.footprint for k, other in enumerate(room.furniture) if k != room.target]
    share = item.intersection(room.indoor).area / item.area
    return (
        reward.theta1 * overlap(room.moving.footprint),
        reward.theta2 * sum(map(overlap, elements)),
        reward.theta3 * (1 - (share if reward.inside == "share" else overlap(room.indoor))),
    )


@given(seeds, st.sampled_from(["share", "iou"]))
def test_the_reward_agrees_with_the_direct_one_on_random_poses(seed: int, inside: str) -> None:
    rooms, index, position = drawn(seed)
    reward = Reward(90, -70, -40, inside)
    terms = simulator_of(*rooms, reward=reward).reward(index, position)
    expected = [naive_reward(rooms[r], p, reward) for r, p in zip(index, position, strict=True)]
    assert np.allclose(np.stack([terms.r1, terms.r2, terms.r3], 1), expected, atol=1e-6)


@given(seeds)
def test_the_coverage_agrees_with_the_direct_one_on_random_poses(seed: int) -> None:
    rooms, index, position = drawn(seed)
    covered, outside = simulator_of(*rooms).overlap_and_outside(index, position)
    for k, (r, p) in enumerate(zip(index, position, strict=True)):
        item = rooms[r].moving.footprint_at(tuple(p))
        shared = sum(item.intersection(other.footprint).area for other in rooms[r].furniture[1:])
        assert covered[k] == pytest.approx(min(shared / item.area, 1), abs=1e-9)  # others may overlap there
        assert outside[k] == pytest.approx(item.difference(rooms[r].indoor).area / item.area, abs=1e-9)


@given(seeds)
def test_the_reward_is_in_its_range_and_the_designers_place_has_iou_one(seed: int) -> None:
    rooms, index, position = drawn(seed)
    simulator = simulator_of(*rooms)
    total = simulator.reward(index, position).total
    assert total.min() >= -200
    assert total.max() <= 100
    every = np.arange(len(rooms))
    assert np.allclose(simulator.reward(every, simulator.designer_position).r1, 100)


def test_many_overlaps_are_clipped_at_the_bottom_of_the_range() -> None:
    pile = tuple(Item("box", (1.0, 1.0), (2.0, 1.5)) for _ in range(4))
    simulator = simulator_of(rectangular_room(4, 3, item=Item("bed", (1.0, 1.0), (1.0, 1.0)), others=pile))
    terms = simulator.reward(*at(simulator, (2.0, 1.5)))
    assert terms.r2.item() == pytest.approx(-400)
    assert terms.total.item() == -200


# legality


def test_walls_may_be_overlapped_and_the_outside_may_not() -> None:
    simulator = simulator_of(rectangular_room(4, 3))  # walls from -0.2 to 4.2 by 3.2; item 1 x 1
    positions = [(0.3, 0.3), (3.7, 2.7), (0.3, 1.5), (0.29, 1.5), (2.0, 0.29), (3.71, 1.5), (2.0, 2.71), (9.0, 9.0)]
    legal = simulator.is_legal(*at(simulator, *positions))
    assert legal.tolist() == [True] * 3 + [False] * 5


@given(seeds)
def test_a_position_is_legal_exactly_where_the_envelope_covers_the_item(seed: int) -> None:
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    x0, y0, x1, y1 = room.envelope.bounds
    position = rng.uniform((x0, y0), (x1, y1), (60, 2))
    legal = simulator_of(room).is_legal(np.zeros(60, dtype=int), position)
    items = [room.moving.footprint_at(tuple(p)) for p in position]
    assert not any(room.envelope.covers(item) for item in itertools.compress(items, ~legal))
    loose = room.envelope.buffer(10 * FIT, join_style="mitre")
    assert all(loose.covers(item) for item in itertools.compress(items, legal))


def test_an_item_that_does_not_fit_is_answered_with_room_and_item() -> None:
    fits = rectangular_room(4, 3, id="wide", item=Item("bed", (4.4, 3.4), (2.0, 1.5)))
    assert simulator_of(fits).is_legal(*at(simulator_of(fits), (2.0, 1.5))).all()
    too_long = rectangular_room(4, 3, id="narrow", item=Item("bed", (4.5, 1.0), (2.0, 1.5)))
    with pytest.raises(ValueError, match=r"narrow: the bed does not fit"):
        simulator_of(fits, too_long)


@pytest.mark.parametrize("spare", [0.0, -7.9e-6])
def test_starts_are_found_where_an_item_hardly_fits(spare: float) -> None:
    """A bed as wide as a corridor that leans: what a start is drawn from is a few micrometres of a box of 2 m."""
    corridor = replace(rectangular_room(4, 1, Item("bed", (1.0, 1.4 - spare), (2.0, 0.5))), walls=()).rotated(40)
    corridor = replace(corridor, walls=wall_band(corridor.outline, (), ()))
    simulator = simulator_of(corridor, rectangular_room())
    room = np.repeat([0, 1], 20)
    starts = simulator.starts(room, np.random.default_rng(0))
    assert simulator.is_legal(room, starts).all()
    along = starts[:20] @ (math.cos(math.radians(40)), math.sin(math.radians(40)))
    assert along.max() - along.min() > 2


# steps


@given(seeds, st.sampled_from(["metre", "pixel"]))
def test_every_move_goes_one_step_in_its_direction_and_is_legal_where_it_ends(seed: int, unit: str) -> None:
    steps = (8.0, 2.0, 1.0) if unit == "pixel" else (0.32, 0.08, 0.02)
    rooms, index, position = drawn(seed)
    simulator = simulator_of(*rooms, moves=Moves(steps, unit, slide=False))
    reached, legal = simulator.destinations(index, position)
    assert reached.shape == (len(index), 12, 2)
    x0, y0, x1, y1 = np.array([rooms[r].envelope.bounds for r in index]).T
    metres = np.maximum(x1 - x0, y1 - y0) / 120 if unit == "pixel" else np.ones(len(index))
    for k, d in itertools.product(range(3), range(4)):
        way = reached[:, 4 * k + d] - position
        assert np.allclose(
            way, steps[k] * metres[:, None] * VECTORS[d], rtol=0, atol=1e-6 * max(1, steps[k])
        )  # a pixel is whole micrometres
        assert np.array_equal(legal[:, 4 * k + d], simulator.is_legal(index, reached[:, 4 * k + d]))


def test_the_actions_are_right_left_below_above_for_every_step() -> None:
    simulator = simulator_of(rectangular_room(4, 3), moves=Moves((0.5, 0.25), slide=False))
    reached, legal = simulator.destinations(*at(simulator, (2.0, 1.5)))
    assert reached[0].tolist() == [
        [2.5, 1.5],
        [1.5, 1.5],
        [2.0, 1.0],
        [2.0, 2.0],
        [2.25, 1.5],
        [1.75, 1.5],
        [2.0, 1.25],
        [2.0, 1.75],
    ]
    assert legal.all()


def test_a_move_that_would_leave_the_envelope_is_illegal() -> None:
    simulator = simulator_of(rectangular_room(4, 3), moves=Moves((0.5, 0.25), slide=False))
    _, legal = simulator.destinations(*at(simulator, (0.5, 2.4)))  # 0.2 to the left and 0.3 above are left
    assert legal[0].tolist() == [True, False, True, False, True, False, True, True]


@given(seeds, st.sampled_from([("metre", (0.32, 0.08, 0.02)), ("metre", (0.05,)), ("pixel", (4.0, 1.0))]))
def test_a_move_and_its_opposite_return_to_exactly_equal_floats(seed: int, kind: tuple[str, tuple[float, ...]]) -> None:
    rooms, index, position = drawn(seed)
    simulator = simulator_of(*rooms, moves=Moves(kind[1], kind[0], slide=False))
    reached, _ = simulator.destinations(index, position)
    for action in range(4 * len(kind[1])):
        back, _ = simulator.destinations(index, reached[:, action])
        assert np.array_equal(back[:, action ^ 1], position)  # right and left, below and above are neighbours


def test_a_pixel_and_its_opposite_cancel_where_a_pixel_ends_in_half_a_micrometre() -> None:
    simulator = simulator_of(rectangular_room(4.0001, 3), moves=Moves((1.0,), "pixel", slide=False))  # 4.4001 / 120
    room = np.zeros(50, int)
    start = simulator.starts(room, np.random.default_rng(0))
    there, _ = simulator.destinations(room, start)
    back, _ = simulator.destinations(room, there[:, 0])
    np.testing.assert_array_equal(back[:, 1], start)


def test_a_pixel_is_a_120th_of_the_longest_side_of_the_envelope() -> None:
    wide, high = rectangular_room(4, 3), rectangular_room(2, 5)
    assert pixel_size(wide) == pytest.approx(4.4 / 120)
    assert pixel_size(high) == pytest.approx(5.4 / 120)
    simulator = simulator_of(wide, high, moves=Moves((3.0, 1.0), "pixel"))
    assert simulator.steps == pytest.approx(np.array([[13.2 / 120, 4.4 / 120], [16.2 / 120, 5.4 / 120]]), abs=3e-6)


def test_steps_in_pixels_that_would_lead_nowhere_in_a_room_are_refused() -> None:
    moves = Moves((1.0, 1e-5), "pixel")
    with pytest.raises(InputError, match=r"^steps: expected lengths above 1e-06 m; one is 4e-07 m in room room, where"):
        simulator_of(rectangular_room(4, 3), moves=moves)


@pytest.mark.parametrize(
    "steps", [(), (0.0,), (-0.1,), (4e-7,), (0.3, 0.2), (0.32, 0.08, 0.03), (0.1, 0.0), (math.inf,)]
)
def test_steps_that_are_no_multiples_of_the_shortest_are_refused(steps: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="expected"):
        Moves(steps)


@pytest.mark.parametrize("steps", [0.1, None, "0.1", ("0.1",), (None,), np.array([0.1, 0.2])])
def test_steps_that_are_no_list_of_numbers_are_refused(steps: Any) -> None:
    with pytest.raises(InputError, match=r"^steps: expected a list of finite lengths above zero, .*; got .+"):
        Moves(steps)


def test_a_list_of_steps_is_the_same_as_a_tuple() -> None:
    assert Moves([0.2, 0.1]) == Moves((0.2, 0.1))
    assert hash(Moves([0.2, 0.1])) == hash(Moves((0.2, 0.1)))


def test_a_slide_that_is_neither_true_nor_false_is_refused() -> None:
    with pytest.raises(InputError, match=r"^slide: expected true or false; got 'no'$"):
        Moves(slide="no")


def test_another_unit_than_metres_and_pixels_is_refused() -> None:
    with pytest.raises(InputError, match=r"^unit: expected one of metre, pixel; got inch$"):
        Moves(unit="inch")


def test_there_are_four_actions_a_step_and_four_slides() -> None:
    assert Moves().count == 20
    assert Moves((0.02, 0.3), slide=False).count == 8
    simulator = simulator_of(rectangular_room(4, 3))
    reached, legal = simulator.destinations(*at(simulator, (2.0, 1.5)))
    assert reached.shape == (1, 16, 2)
    assert legal.shape == (1, 16)


# slides


def slide(room: Room, start: tuple[float, float], direction: int) -> tuple[float, float] | None:
    """Where the slide ends; None where it is illegal."""
    simulator = simulator_of(room)
    reached, legal = simulator.destinations(*at(simulator, start))
    return tuple(reached[0, 12 + direction].tolist()) if legal[0, 12 + direction] else None


@pytest.mark.parametrize(
    ("start", "direction", "end"),
    [
        ((2.0, 1.5), RIGHT, (3.5, 1.5)),
        ((2.0, 1.5), LEFT, (0.5, 1.5)),
        ((2.0, 1.5), BELOW, (2.0, 0.5)),
        ((2.0, 1.5), ABOVE, (2.0, 2.5)),
        ((0.35, 1.5), RIGHT, (0.5, 1.5)),  # over the left wall: first until it is off the wall
        ((0.35, 1.5), LEFT, None),  # nothing is ahead
        ((2.0, 2.65), BELOW, (2.0, 2.5)),
        ((2.0, 2.65), ABOVE, None),
        ((0.35, 1.5), ABOVE, None),  # beside the contacts of the room
        ((3.5, 1.5), RIGHT, None),  # flush already
        ((3.5, 1.5), LEFT, (0.5, 1.5)),
        ((3.5, 1.5), ABOVE, (3.5, 2.5)),  # along the wall
        ((3.5, 2.5), BELOW, (3.5, 0.5)),  # from corner to corner
    ],
)
def test_a_slide_in_a_rectangle_ends_at_the_next_contact(
    start: tuple[float, float], direction: int, end: tuple[float, float] | None
) -> None:
    got = slide(rectangular_room(4, 3), start, direction)
    assert got == (None if end is None else pytest.approx(end, abs=1e-5))


@pytest.mark.parametrize(
    ("start", "direction", "end"),
    [
        ((1.0, 1.0), RIGHT, (3.5, 1.0)),  # through the lower arm
        ((1.0, 3.0), RIGHT, (1.5, 3.0)),  # to the inner wall of the upper arm
        ((3.0, 1.0), ABOVE, (3.0, 1.5)),
        ((1.0, 1.0), ABOVE, (1.0, 3.5)),
        ((1.6, 2.5), LEFT, (1.5, 2.5)),  # over the inner wall by 0.1
        ((1.6, 2.5), BELOW, (1.6, 1.5)),  # over the inner wall until it is off it
        ((1.6, 2.5), RIGHT, None),
    ],
)
def test_a_slide_in_an_l_ends_at_the_inner_walls(
    start: tuple[float, float], direction: int, end: tuple[float, float] | None
) -> None:
    got = slide(l_room(), start, direction)
    assert got == (None if end is None else pytest.approx(end, abs=1e-5))


def test_a_slide_stops_at_a_column_and_at_other_items_coming_and_going() -> None:
    column = rectangle(2.0, 1.0, 2.5, 1.5)[::-1]
    chair = Item("chair", (0.5, 0.5), (3.2, 2.4))
    room = rectangular_room(4, 3, item=Item("bed", (1.0, 1.0), (1.0, 1.0)), holes=(column,), others=(chair,))
    assert slide(room, (1.0, 1.2), RIGHT) == pytest.approx((1.5, 1.2), abs=1e-5)
    assert slide(room, (1.0, 2.2), RIGHT) == pytest.approx((2.45, 2.2), abs=1e-5)  # its right side at the chair's left
    assert slide(room, (2.45, 2.2), RIGHT) == pytest.approx((3.5, 2.2), abs=1e-5)  # over the chair, to the wall
    assert slide(room, (3.5, 2.2), LEFT) == pytest.approx((2.45, 2.2), abs=1e-5)
    assert slide(room, (2.45, 2.2), LEFT) == pytest.approx((0.5, 2.2), abs=1e-5)
    assert slide(room, (3.0, 0.5), ABOVE) == pytest.approx((3.0, 1.65), abs=1e-5)  # its upper side at the chair's lower
    assert slide(room, (0.6, 0.5), ABOVE) == pytest.approx((0.6, 2.5), abs=1e-5)  # past it


def test_a_slide_never_leaves_the_envelope_for_a_contact_behind_an_item() -> None:
    wardrobe = Item("wardrobe", (0.6, 1.0), (3.7, 1.0))  # to touch it from behind, one would stand outdoors
    room = rectangular_room(4, 3, item=Item("bed", (1.0, 1.0), (1.0, 1.0)), others=(wardrobe,))
    assert slide(room, (3.5, 1.0), RIGHT) is None


def test_a_slide_against_a_bevelled_wall_stops_where_a_corner_touches_it() -> None:
    outline = ((0.0, 0.0), (3.0, 0.0), (4.0, 1.0), (4.0, 3.0), (0.0, 3.0))
    room = rectangular_room(4, 3, item=Item("bed", (1.0, 1.0), (1.0, 1.5)))
    room = Room("r", "bedroom", outline, room.walls, (), room.furniture, 0)
    # the item's lower right corner (x + 0.5, 0.2) meets the bevel y = x - 3 at 3.2
    assert slide(room, (1.0, 0.7), RIGHT) == pytest.approx((2.7, 0.7), abs=1e-5)


def grazes(region: Polygon, position: np.ndarray, axis: int) -> bool:
    """Whether the slide passes a corner of the contacts by less than a tenth of a millimetre or two."""
    corners = shapely.get_coordinates(region)
    return bool((np.abs(corners[:, 1 - axis] - position[1 - axis]) < 2 * TOUCHING).any())


@given(seeds)
@settings(max_examples=40)
def test_a_slide_ends_flush_with_the_outline_and_inside_at_the_first_contact_ahead(seed: int) -> None:
    rooms, index, position = drawn(seed, rooms=2, positions=8, alone=True)
    reached, legal = simulator_of(*rooms).destinations(index, position)
    loose = [room.indoor.buffer(1e-5, join_style="mitre") for room in rooms]
    inner = positions([room.indoor for room in rooms], rooms)
    for k, d in itertools.product(range(len(index)), range(4)):
        room, region, start, end = rooms[index[k]], inner[index[k]], position[k], reached[k, 12 + d]
        if grazes(region, start, d // 2):
            continue
        ray = LineString([start + 2 * TOUCHING * VECTORS[d], start + 20 * VECTORS[d]])
        if not legal[k, 12 + d]:
            assert np.array_equal(end, start)
            if ray.intersects(region):  # a position ahead lies inside, but the way to it leads through the outside
                way = LineString(
                    [start, shapely.shortest_line(shapely.Point(start), ray.intersection(region)).coords[1]]
                )
                assert not positions([room.envelope], [room])[0].covers(way)
            continue
        assert (end - start)[1 - d // 2] == 0
        assert (end - start) @ VECTORS[d] > TOUCHING / 2
        item = room.moving.footprint_at(tuple(end))
        assert loose[index[k]].covers(item)
        assert item.exterior.distance(room.indoor.boundary) <= 1e-5
        if np.abs(end - start).sum() > 5 * TOUCHING:  # all of the way is inside or none: no contact was passed
            way = LineString([start + 2 * TOUCHING * VECTORS[d], end - 2 * TOUCHING * VECTORS[d]])
            inside = way.intersection(region).length
            assert inside == pytest.approx(way.length, abs=1e-6) or inside == pytest.approx(0, abs=1e-6)


@given(seeds)
@settings(max_examples=40)
def test_a_slide_ends_where_the_boxes_around_two_items_touch_or_where_it_would_without_the_others(seed: int) -> None:
    rooms, index, position = drawn(seed, rooms=2, positions=8)
    reached, legal = simulator_of(*rooms).destinations(index, position)
    alone = [replace(room, furniture=(room.moving,), target=0) for room in rooms]
    past, legal_past = simulator_of(*alone).destinations(index, position)
    for k, d in itertools.product(range(len(index)), range(12, 16)):
        room, end = rooms[index[k]], reached[k, d]
        if not legal[k, d]:
            assert not legal_past[k, d]
            continue
        x0, y0, x1, y1 = room.moving.footprint_at(tuple(end)).bounds
        gaps = [
            max(x0 - other[2], other[0] - x1, y0 - other[3], other[1] - y1)
            for other in (item.footprint.bounds for item in room.others)
        ]
        way = (end - position[k]) @ VECTORS[d - 12]
        way_past = (past[k, d] - position[k]) @ VECTORS[d - 12] if legal_past[k, d] else np.inf
        assert way <= way_past + 1e-9
        assert way == pytest.approx(way_past) or any(abs(gap) <= 2 * TOUCHING for gap in gaps)


@given(seeds)
def test_the_same_slide_again_is_illegal_or_goes_on_to_a_further_contact(seed: int) -> None:
    rooms, index, position = drawn(seed, rooms=2, positions=8, alone=True)
    simulator = simulator_of(*rooms)
    loose = [room.indoor.buffer(2 * TOUCHING, join_style="mitre") for room in rooms]
    reached, legal = simulator.destinations(index, position)
    for d in range(4):
        of, first = index[legal[:, 12 + d]], reached[legal[:, 12 + d], 12 + d]
        for _ in range(20):
            if not len(of):
                break
            reached_again, legal_again = simulator.destinations(of, first)
            again, still = reached_again[:, 12 + d], legal_again[:, 12 + d]
            assert np.array_equal(again[~still], first[~still])
            of, first, again = of[still], first[still], again[still]
            assert ((again - first) @ VECTORS[d] > TOUCHING / 2).all()
            for r, end in zip(of, again, strict=True):
                assert loose[r].covers(rooms[r].moving.footprint_at(tuple(end)))
            first = again
        assert not len(of)  # the outline is reached at last


@pytest.mark.parametrize(("lean", "end"), [(0.9 * GRID, 3.5), (4 * GRID, 1.5)])
def test_a_slide_runs_along_a_wall_that_leans_by_less_than_the_grid(lean: float, end: float) -> None:
    outline = ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0 - lean / 2), (0.0, 3.0 + lean / 2))
    room = replace(rectangular_room(4, 3), outline=outline)
    y = 2.5 + CONTACT  # a corner of the item, 1 m square, touches the wall in the wall's middle
    assert slide(room, (0.6, y), RIGHT) == pytest.approx((end, y), abs=1e-5)


def test_slides_are_illegal_everywhere_when_the_item_fits_only_over_the_walls() -> None:
    room = rectangular_room(4, 3, item=Item("bed", (4.2, 1.0), (2.0, 1.5)))
    assert [slide(room, (2.0, 1.5), d) for d in range(4)] == [None] * 4


def test_an_item_that_spans_the_room_slides_to_both_ends() -> None:
    simulator = simulator_of(rectangular_room(1.6, 2.013, Item("bathtub", (1.6, 0.7), (0.8, 0.35))))
    position = np.array([[0.8, 1.0]])
    reached, legal = simulator.destinations(np.array([0]), position)
    assert legal[0, -4:].tolist() == [False, False, True, True]
    np.testing.assert_allclose(reached[0, -2:], [[0.8, 0.35], [0.8, 2.013 - 0.35]], atol=1e-5)


def test_no_slide_crosses_the_outside() -> None:
    outline = ((0, 0), (6, 0), (6, 4), (4.5, 4), (4.5, 1), (1.5, 1), (1.5, 4), (0, 4))
    room = Room("u", "study", outline, wall_band(outline, (), ()), (), (Item("desk", (0.5, 0.5), (1, 1)),), 0)
    simulator = simulator_of(room)
    reached, legal = simulator.destinations(np.array([0, 0]), np.array([[1.25, 3.0], [1.25, 0.5]]))
    assert not legal[0, -4]  # across the court between the arms
    assert legal[1, -4]  # along the bottom
    assert reached[1, -4] == pytest.approx((5.75, 0.5), abs=1e-5)


# starts


@given(seeds)
def test_starts_are_legal_reproducible_and_differ_between_seeds(seed: int) -> None:
    rooms, index, _ = drawn(seed)
    simulator = simulator_of(*rooms)
    first = simulator.starts(index, np.random.default_rng(seed))
    assert simulator.is_legal(index, first).all()
    assert all(
        rooms[r].envelope.buffer(1e-5, join_style="mitre").covers(rooms[r].moving.footprint_at(tuple(p)))
        for r, p in zip(index, first, strict=True)
    )
    assert np.array_equal(first, simulator.starts(index, np.random.default_rng(seed)))
    assert not np.isclose(first, simulator.starts(index, np.random.default_rng(seed + 1))).all(1).any()


def test_starts_cover_a_rectangle_evenly() -> None:
    simulator = simulator_of(rectangular_room(4, 3))  # centres 0.3 to 3.7 by 0.3 to 2.7
    starts = simulator.starts(np.zeros(8000, dtype=int), np.random.default_rng(0))
    counts, *_ = np.histogram2d(*starts.T, bins=(5, 4), range=((0.3, 3.7), (0.3, 2.7)))
    assert counts.sum() == 8000
    assert ((counts - 400) ** 2 / 400).sum() < 43.8  # chi squared of 19 degrees of freedom: 1 in 1,000


def test_starts_cover_an_l_by_area_and_leave_out_what_the_item_does_not_reach() -> None:
    simulator = simulator_of(l_room())
    starts = simulator.starts(np.zeros(6000, dtype=int), np.random.default_rng(0))
    # centres: 0.3 to 3.7 by 0.3 to 1.7 and the like upright; 1.4 x 1.4 shared: 4.76 + 4.76 - 1.96 = 7.56
    right, upper = (starts[:, 0] > 1.7).mean(), (starts[:, 1] > 1.7).mean()
    assert right == pytest.approx(2.0 * 1.4 / 7.56, abs=0.02)
    assert upper == pytest.approx(2.0 * 1.4 / 7.56, abs=0.02)
    assert not (starts > 1.7 + 1e-5).all(1).any()


def test_an_item_that_fits_exactly_still_gets_a_start() -> None:
    simulator = simulator_of(rectangular_room(4, 3, item=Item("bed", (4.4, 1.0), (2.0, 1.5))))
    starts = simulator.starts(np.zeros(20, dtype=int), np.random.default_rng(0))
    assert np.allclose(starts[:, 0], 2.0, atol=1e-5)


def test_where_an_item_hardly_fits_places_are_drawn_by_area_however_large_triangles_are() -> None:
    region = Polygon([(0, 0), (9, 0), (9, 1), (1, 1), (1, 2), (0, 2)])  # a tenth of it is above y = 1
    rng = np.random.default_rng(0)
    places = np.array([_anywhere(region, rng) for _ in range(1000)])
    assert shapely.intersects_xy(region, places).all()
    assert (places[:, 1] > 1).mean() == pytest.approx(0.1, abs=0.03)


# many rooms at once


@given(seeds)
def test_a_room_among_others_answers_as_it_does_alone(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bare = rectangular_room(4, 3, walls=())
    crowded = rectangular_room(4, 3, others=tuple(Item("chair", (0.4, 0.4), (0.2 * k, 1.0)) for k in range(1, 20)))
    rooms = [bare, random_room(rng), crowded, random_room(rng)]
    together = simulator_of(*rooms)
    index = rng.permutation(np.repeat(np.arange(len(rooms)), 6))
    position = together.starts(index, rng)
    reached, legal = together.destinations(index, position)
    terms, coverage = together.reward(index, position), together.overlap_and_outside(index, position)
    for r, room in enumerate(rooms):
        mine = index == r
        zeros = np.zeros(mine.sum(), dtype=int)
        alone = simulator_of(room)
        for a, b in zip(alone.destinations(zeros, position[mine]), (reached, legal), strict=True):
            assert np.array_equal(a, b[mine])
        assert np.array_equal(alone.is_legal(zeros, position[mine]), together.is_legal(index, position)[mine])
        for a, b in zip(alone.reward(zeros, position[mine]), terms, strict=True):
            assert np.allclose(a, b[mine], rtol=0, atol=1e-9)
        for a, b in zip(alone.overlap_and_outside(zeros, position[mine]), coverage, strict=True):
            assert np.allclose(a, b[mine], rtol=0, atol=1e-9)


def test_two_entries_of_one_room_may_move_different_items() -> None:
    chair = Item("chair", (0.5, 0.5), (3.5, 0.5))
    bed_moves = rectangular_room(4, 3, others=(chair,))
    chair_moves = rectangular_room(4, 3, others=(chair,), target=1)
    simulator = simulator_of(bed_moves, chair_moves)
    terms = simulator.reward(np.array([0, 1, 1]), np.array([(2.0, 1.5), (3.5, 0.5), (2.0, 1.5)]))
    assert terms.r1 == pytest.approx([100, 100, 0])
    assert terms.r2 == pytest.approx([0, 0, -25])  # the chair over the bed: 0.25 of 0.25 + 1 - 0.25


def test_an_empty_batch_has_no_destinations() -> None:
    reached, legal = simulator_of(rectangular_room(4, 3)).destinations(np.zeros(0, int), np.zeros((0, 2)))
    assert (reached.shape, legal.shape) == ((0, 16, 2), (0, 16))
