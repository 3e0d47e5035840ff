"""The batched simulator. The reference simulator is the oracle, at random poses in random rooms."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from shapely.geometry import Polygon

from layoutrl.env.batch import BatchSimulator
from layoutrl.env.geometry import GRID, snap
from layoutrl.env.observation import GeometryObservation
from layoutrl.env.reward import Reward, RewardTerms
from layoutrl.env.simulator import TOUCHING, Moves, Simulator
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import CIRCLE_SEGMENTS, MAIN_ITEM, Item, Ring, Room
from tests.builders import destinations, l_room, random_item, random_room, rectangular_room, room_of

MICRON = 1.001e-6  # metres, and what float64 adds to one
# The share of a disc that its polygon lacks. An IoU of a disc, or the share of it indoors, is off by no more.
DEFICIT = 1 - 2 * CIRCLE_SEGMENTS / math.pi * math.sin(math.pi / 2 / CIRCLE_SEGMENTS)

seeds = st.integers(0, 2**32 - 1)
dtypes = st.sampled_from([torch.float64, torch.float32])
kinds_of_moves = st.sampled_from(
    [Moves(), Moves(slide=False), Moves((0.05,)), Moves((0.5, 0.1)), Moves((8.0, 2.0, 1.0), "pixel")]
)
kinds_of_reward = st.sampled_from([Reward(), Reward(90, -70, -40, "iou")])


# rooms and poses


def skyline_room(rng: np.random.Generator) -> Room:
    """A bar, an L, a U, a T or a comb on decimetres, with items on half decimetres: much touches, or fits exactly."""
    widths, heights = rng.integers(6, 20, rng.integers(1, 5)) / 10, rng.integers(8, 40, 4) / 10
    sides = np.concatenate([[0.0], widths.cumsum().round(1)])
    tops = [(x, y) for k, y in enumerate(heights[: len(widths)]) for x in sides[k : k + 2]]
    skyline = Polygon([(0.0, 0.0), *tops, (sides[-1], 0.0)]).simplify(0)
    outline = ring(shapely.get_coordinates(skyline)[-1:0:-1])  # counter-clockwise
    bare = room_of(outline, Item("none", (1.0, 1.0)))
    spans = np.concatenate([widths, heights, sides[-1:]])

    def item(category: str) -> Item:
        while True:
            fits = rng.choice(spans, 2) + rng.choice([0.0, 0.4], 2)  # from wall to wall, indoors or over both walls
            size = tuple(map(float, np.where(rng.random(2) < 0.3, fits, rng.integers(2, 13, 2) / 10)))
            low, high = np.reshape(bare.envelope.bounds, (2, 2))
            center = tuple(map(float, (rng.uniform(low, high) * 20).round() / 20))
            placed = Item(category, size, center, float(rng.choice([0, 0, 90, 180, 270, 30, 45])))
            if rng.random() < 0.2:
                placed = Item(category, (min(size), min(size)), center, form="circle")
            if bare.holds(placed, 1e-9):
                return placed

    others = tuple(item("chair") for _ in range(rng.integers(4)))
    room = room_of(outline, item("bed"), others, walls=bare.walls)
    return room.turned(int(rng.integers(4)), mirror=bool(rng.integers(2)))


def ring(corners: np.ndarray) -> Ring:
    return tuple(map(tuple, corners.tolist()))


def elsewhere(room: Room, degrees: float, by: np.ndarray) -> Room:
    """The same room, turned around the origin and moved."""
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))

    def moved(corners: Ring) -> Ring:
        return ring(np.array(corners) @ [[cosine, sine], [-sine, cosine]] + by)

    return replace(
        room,
        outline=moved(room.outline),
        walls=tuple(map(moved, room.walls)),
        holes=tuple(map(moved, room.holes)),
        openings=tuple(replace(opening, polygon=moved(opening.polygon)) for opening in room.openings),
        furniture=tuple(
            replace(item, center=moved((item.center,))[0], rotation=item.rotation + degrees) for item in room.furniture
        ),
    )


def leaning_room(rng: np.random.Generator) -> Room:
    """A room that leans by 0.1 to 10 micrometres, each side by its own, some by whole ones; half of them have no walls.

    Its items lean with it, or stand at any angle.
    """

    def leaning(corners: Ring) -> Ring:
        by = rng.normal(size=(len(corners), 2)) * 10.0 ** rng.integers(-7, -4)
        return ring(np.array(corners) + (snap(by) if rng.random() < 0.5 else by))

    room = random_room(rng)
    if rng.random() < 0.5:
        item = replace(random_item(rng, "bed"), center=(1.0, 1.0))
        room = (l_room, rectangular_room)[rng.integers(2)](item=item, others=room.others, walls=())
    room = replace(room, outline=leaning(room.outline), holes=tuple(map(leaning, room.holes)))
    return elsewhere(room, rng.choice([0, 1e-5, -1e-4]), rng.integers(-100, 101, 2) * (rng.random() < 0.3))


def any_room(rng: np.random.Generator) -> Room:
    room = (random_room, skyline_room)[rng.integers(2)](rng)
    degrees = rng.choice([0, 0, 0, 90, 1e-5, rng.uniform(0, 360)])  # a cosine of 90 degrees is next to 0
    return elsewhere(room, degrees, rng.integers(-100, 101, 2) * (rng.random() < 0.3))


def some_rooms(seed: int) -> list[Room]:
    """Four rooms of all kinds, one of which is nothing but its outline."""
    rng = np.random.default_rng(seed)
    return [any_room(rng) for _ in range(3)] + [rectangular_room(*rng.uniform(2, 12, 2).tolist(), walls=())]


def visited(simulator: Simulator, seed: int, batch: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Rooms (n,) and positions (n, 2): starts, half of them on centimetres, and where four random moves lead."""
    rng = np.random.default_rng(seed)
    room = rng.integers(len(simulator.rooms), size=batch)
    position = BatchSimulator(simulator).starts(torch.tensor(room), torch.Generator().manual_seed(seed)).numpy()
    rounded = snap(position.round(2))
    keeps = rng.random(batch) < 0.5
    position[keeps] = np.where(simulator.is_legal(room, rounded)[:, None], rounded, position)[keeps]
    positions = [position]
    for _ in range(4):
        reached, legal = simulator.destinations(room, position)
        liking = rng.random(legal.shape)
        liking[:, -4:] *= 2  # slides, if there are any
        action = np.where(legal, liking, -1).argmax(1)
        every = np.arange(batch)
        position = np.where(legal[every, action, None], reached[every, action], position)
        positions.append(position)
    return np.tile(room, len(positions)), np.concatenate(positions)


def tensors(room: np.ndarray, position: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
    return torch.tensor(room), torch.tensor(position)


# the reward


def assert_rewards_agree(simulator: Simulator, dtype: torch.dtype, seed: int, rounding: float) -> None:
    """Every term is the reference's; the total is of that precision."""
    room, position = visited(simulator, seed)
    terms = BatchSimulator(simulator, dtype=dtype).reward(*tensors(room, position))
    assert terms.total.dtype == dtype
    assert_terms_agree(simulator, room, position, RewardTerms(*(term.numpy() for term in terms)), rounding)


def assert_terms_agree(
    simulator: Simulator, room: np.ndarray, position: np.ndarray, terms: RewardTerms[np.ndarray], rounding: float
) -> None:
    """Every term is the reference's, give or take rounding, and that the reference's discs are polygons."""
    expected = simulator.reward(room, position)
    is_disc = np.array([r.moving.form == "circle" for r in simulator.rooms])
    others = np.array([len(r.others) for r in simulator.rooms])
    discs = np.array([sum(other.form == "circle" for other in r.others) for r in simulator.rooms])
    weights = simulator.reward_function
    # Walls and openings lie apart, so that what a disc shares with all of them is off by no more than with one.
    for name, weight, lacking in (
        ("r1", weights.theta1, 2 * is_disc),
        ("iou", 1.0, 2 * is_disc),
        ("r2", weights.theta2, is_disc * (1 + others) + discs),
        ("r3", weights.theta3, is_disc),
    ):
        error = np.abs(getattr(terms, name) - getattr(expected, name))
        assert (error <= rounding + abs(weight) * 1.001 * DEFICIT * lacking[room]).all(), name
    total = terms.r1 + terms.r2 + terms.r3
    assert terms.total == pytest.approx(np.clip(total, -200, 100), abs=1e-4)


@given(seeds, kinds_of_reward)
def test_the_reward_is_that_of_the_reference(seed: int, reward: Reward) -> None:
    assert_rewards_agree(Simulator(some_rooms(seed), Moves(), reward), torch.float64, seed, 1e-9)


@given(seeds, kinds_of_reward)
def test_single_precision_costs_little_of_the_reward_even_of_items_of_20_centimetres(seed: int, reward: Reward) -> None:
    assert_rewards_agree(Simulator(some_rooms(seed), Moves(), reward), torch.float32, seed, 1e-3)


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_single_precision_costs_less_than_a_ten_thousandth_in_designed_rooms(room_type: str) -> None:
    rooms = design_rooms(room_type, "train", seed=1, count=12).rooms
    assert_rewards_agree(Simulator(rooms, Moves(), Reward()), torch.float32, 1, 1e-4)


@pytest.mark.parametrize("degrees", [0.0, 0.703125, 45.0])
def test_discs_are_true_circles_from_every_side(degrees: float) -> None:
    """A turned polygon of 256 corners would be up to 0.008 % less wide: by half a corner's angle, for one."""
    stool = Item("stool", (0.6, 0.6), (3.0, 2.0), form="circle")
    rug = Item("rug", (1.0, 1.0), (1.0, 1.0), rotation=degrees)
    for moving, other, indoors in ((rug, stool, 1.0), (stool, rug, 0.09 * math.pi)):
        simulator = Simulator([rectangular_room(4, 3, moving, others=(other,))], Moves(), Reward(inside="iou"))
        batch = BatchSimulator(simulator, dtype=torch.float64)
        terms = batch.reward(*tensors(np.zeros(1, int), np.array([other.center])))
        assert terms.r2.item() == pytest.approx(-9 * math.pi, abs=1e-9)
        assert terms.r3.item() == pytest.approx(100 * (indoors / 12 - 1), abs=1e-9)


def test_the_designers_place_has_iou_one() -> None:
    rooms = [any_room(np.random.default_rng(seed)) for seed in range(40)]
    simulator = Simulator(rooms, Moves(), Reward())
    terms = BatchSimulator(simulator).reward(*tensors(np.arange(40), snap(simulator.designer_position)))
    assert terms.iou.numpy() == pytest.approx(1, abs=2e-5)  # half a micrometre on the grid, of 20 cm, both ways


# legality


@given(seeds, dtypes)
def test_a_position_is_legal_where_the_reference_has_it_legal(seed: int, dtype: torch.dtype) -> None:
    rooms = some_rooms(seed)
    simulator = Simulator(rooms, Moves(), Reward())
    rng = np.random.default_rng(seed)
    room, position = [], []
    for k, region in enumerate(simulator.legal):
        corners = shapely.get_coordinates(region)
        border = shapely.get_coordinates(region.boundary.interpolate(rng.uniform(0, region.boundary.length, 30)))
        low, high = corners.min(0) - 0.3, corners.max(0) + 0.3
        aligned = np.stack([rng.choice(corners[:, 0], 30), rng.uniform(low[1], high[1], 30)], 1)  # with a corner
        level = np.stack([rng.uniform(low[0], high[0], 30), rng.choice(corners[:, 1], 30)], 1)
        away = rng.normal(size=(30, 2)) * 10.0 ** rng.uniform(-11, -1, (30, 1))
        position += [border + away, rng.choice(corners, 30) + away, aligned, level, rng.uniform(low, high, (30, 2))]
        room += [k] * 150
    room, position = np.array(room), np.concatenate(position)
    legal = BatchSimulator(simulator, dtype=dtype).is_legal(*tensors(room, position)).numpy()
    border = shapely.boundary(simulator.legal)[room]
    near = shapely.distance(border, shapely.points(position)) < (1e-6 if dtype == torch.float32 else 1e-11)
    assert np.array_equal(legal | near, simulator.is_legal(room, position) | near)


@given(seeds, kinds_of_moves)
@example(419, Moves((0.05,)))  # a wall that leans by a micrometre
@example(22580, Moves((0.32, 0.08, 0.02, 0.005), slide=True))  # and a start that touches it, or does not
def test_actions_are_legal_and_lead_as_the_reference_has_it(seed: int, moves: Moves) -> None:
    simulator = Simulator(some_rooms(seed), moves, Reward())
    assert_actions_agree(simulator, *visited(simulator, seed))


def assert_actions_agree(simulator: Simulator, room: np.ndarray, position: np.ndarray) -> None:
    """Every action is legal where it is for the reference, and leads to the same place, give or take rounding to it."""
    expected, expected_legal = simulator.destinations(room, position)
    reached, legal = destinations(BatchSimulator(simulator, dtype=torch.float64), room, position)
    assert np.array_equal(legal, expected_legal)
    assert np.abs(reached - expected)[legal].max(initial=0) <= MICRON
    steps = 4 * len(simulator.moves.steps)
    assert np.array_equal(reached[:, :steps], expected[:, :steps])


@given(seeds)
def test_walls_that_lean_by_micrometres_stop_slides_where_the_reference_has_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    simulator = Simulator([leaning_room(rng) for _ in range(4)], Moves((0.3,)), Reward())
    assert_actions_agree(simulator, *visited(simulator, seed))


def test_a_contact_just_beyond_the_envelope_is_out_of_reach_even_if_the_next_place_on_the_grid_is_not() -> None:
    bed = Item("bed", (0.9999994, 1.0), (2.0, 1.5))  # within the envelope up to 3.7000043, at the chair at 3.7000044
    chair = Item("chair", (0.5, 0.5), (4.4500041, 1.5))
    simulator = Simulator([rectangular_room(4, 3, bed, others=(chair,))], Moves((0.3,)), Reward())
    pose = np.zeros(1, int), np.array([[3.6, 1.5]])
    assert not simulator.destinations(*pose)[1][0, 4]
    assert_actions_agree(simulator, *pose)


micrometres = st.integers(-(10**8), 10**8)


@given(micrometres, micrometres)
def test_rounding_never_decides_which_contact_a_slide_ends_at(x: int, y: int) -> None:
    """Wherever the room lies. The item, 1 m square, touches the chair on a box from (1.25, 0.25) to (2.75, 1.75)."""
    by = snap(np.array([x, y]) * GRID)
    room = elsewhere(rectangular_room(5, 3, others=(Item("chair", (0.5, 0.5), (2.0, 1.0)),)), 0, by)
    simulator = Simulator([room], Moves((0.3,)), Reward())
    off = np.arange(95, 106)  # micrometres: TOUCHING is a tenth of a millimetre
    one = np.ones(len(off))
    before, beside = np.stack([1.25 - off * GRID, one], 1), np.stack([one, 1.75 + off * GRID], 1)
    poses = np.zeros(2 * len(off), int), snap(np.concatenate([before, beside]) + by)
    expected = np.concatenate([np.where(off > 100, 1.25, 2.75), np.where(off > 100, 4.5, 1.25)])
    for reached, legal in simulator.destinations(*poses), destinations(BatchSimulator(simulator), *poses):
        assert legal[:, 4].all()
        assert reached[:, 4, 0] - by[0] == pytest.approx(expected, abs=5e-6)


@given(seeds, kinds_of_moves)
def test_actions_in_single_precision_are_those_of_the_reference_a_micrometre_beside(seed: int, moves: Moves) -> None:
    simulator = Simulator(some_rooms(seed), moves, Reward())
    room, position = visited(simulator, seed)
    expected, expected_legal = simulator.destinations(room, position)
    reached, legal = destinations(BatchSimulator(simulator), room, position)
    steps = 4 * len(moves.steps)
    assert np.array_equal(reached[:, :steps], expected[:, :steps])
    b, a = np.nonzero((legal != expected_legal) | (legal & (np.abs(reached - expected).max(2) > MICRON)))
    room, start, end, legal = room[b], position[b], reached[b, a], legal[b, a]
    every = np.arange(len(b))
    ways = itertools.product((-GRID, 0, GRID), repeat=2)
    beside = [(at[every, a], there[every, a]) for at, there in (simulator.destinations(room, start + w) for w in ways)]
    assert np.any([there == legal for _, there in beside], 0).all()
    # A slide to a slanting wall may end further away, yet at the wall, and not beyond where it ends beside.
    ends = np.array([start, *(at for at, _ in beside)])
    assert ((ends.min(0) - MICRON <= end) & (end <= ends.max(0) + MICRON)).all()
    contacts = np.nan_to_num(simulator.contacts, nan=99.0)  # those that fill up the table: far away
    borders = shapely.linestrings(contacts.reshape(*contacts.shape[:2], 2, 2))[room]
    away = shapely.distance(borders, shapely.points(end)[:, None])
    assert (away.min(1)[legal] <= TOUCHING + MICRON).all()


def test_no_slide_crosses_the_outside() -> None:
    outline = ((0, 0), (6, 0), (6, 4), (4.5, 4), (4.5, 1), (1.5, 1), (1.5, 4), (0, 4))
    simulator = Simulator([room_of(outline, Item("desk", (0.5, 0.5), (1, 1)))], Moves(), Reward())
    batch = BatchSimulator(simulator)
    reached, legal = destinations(batch, np.zeros(2, int), np.array([[1.25, 3.0], [1.25, 0.5]]))
    assert not legal[0, -4]  # across the court between the arms
    assert legal[1, -4]  # along the bottom
    assert reached[1, -4] == pytest.approx((5.75, 0.5), abs=5e-6)


def test_slides_are_illegal_everywhere_when_the_item_fits_only_over_the_walls() -> None:
    room = rectangular_room(4, 3, item=Item("bed", (4.2, 1.0), (2.0, 1.5)))
    batch = BatchSimulator(Simulator([room], Moves((0.5,)), Reward()))
    _, legal = destinations(batch, np.zeros(1, int), np.array([[2.0, 1.5]]))
    assert legal[0].tolist() == [False] * 2 + [True] * 2 + [False] * 4


# starts


def starts(simulator: Simulator, room: np.ndarray, seed: int) -> np.ndarray:
    return BatchSimulator(simulator).starts(torch.tensor(room), torch.Generator().manual_seed(seed)).numpy()


@given(seeds)
def test_starts_are_legal_on_the_grid_and_those_of_their_seed(seed: int) -> None:
    simulator = Simulator(some_rooms(seed), Moves(), Reward())
    room = np.random.default_rng(seed).integers(4, size=40)
    first = starts(simulator, room, seed)
    assert simulator.is_legal(room, first).all()
    assert np.array_equal(snap(first), first)
    assert np.array_equal(starts(simulator, room, seed), first)
    assert not (starts(simulator, room, seed + 1) == first).all(1).any()


def test_starts_lie_in_every_part_of_a_region_as_often_as_its_area_says() -> None:
    rooms = [l_room(), *(any_room(np.random.default_rng(seed)) for seed in range(30))]
    simulator = Simulator(rooms, Moves(), Reward())
    room = np.random.default_rng(0).integers(len(rooms), size=2000 * len(rooms))
    position = starts(simulator, room, 0)
    excess, freedom = 0.0, 0
    for k, region in enumerate(simulator.legal):
        x0, y0, x1, y1 = region.bounds
        low = np.stack(np.meshgrid(np.linspace(x0, x1, 6)[:5], np.linspace(y0, y1, 6)[:5]), -1).reshape(-1, 2)
        cells = shapely.box(*low.T, *(low + np.array([x1 - x0, y1 - y0]) / 5).T)
        found = shapely.contains_xy(cells[:, None], *position[room == k].T).sum(1)
        expected = shapely.area(shapely.intersection(cells, region)) / region.area * (room == k).sum()
        assert (found[expected < 1e-6] == 0).all()
        counts = expected > 5
        excess += ((found - expected)[counts] ** 2 / expected[counts]).sum()
        freedom += counts.sum() - 1
    assert freedom > 300
    assert abs(excess - freedom) < 4 * math.sqrt(2 * freedom)  # chi squared: four standard deviations


def test_an_item_that_spans_the_room_exactly_starts_anywhere_between_the_ends() -> None:
    simulator = Simulator([l_room(), rectangular_room(4, 3, Item("bed", (4.4, 1.0), (2.0, 1.5)))], Moves(), Reward())
    room = np.ones(2000, dtype=int)
    position = starts(simulator, room, 0)
    assert simulator.is_legal(room, position).all()
    assert np.abs(position[:, 0] - 2).max() < 5e-6
    counts, _ = np.histogram(position[:, 1], 5, (0.3, 2.7))
    assert ((counts - 400) ** 2 / 400).sum() < 18.5  # chi squared of 4 degrees of freedom: 1 in 1,000


def test_an_item_with_no_place_on_the_grid_starts_a_micrometre_from_where_it_fits() -> None:
    """It exceeds the room by just less than what the reference allows."""
    simulator = Simulator(
        [l_room(), rectangular_room(4, 3, Item("bed", (4.400007, 1.0), (2.0, 1.5)))], Moves(), Reward()
    )
    for x, y in starts(simulator, np.ones(200, dtype=int), 0):
        assert shapely.distance(shapely.Point(x, y), simulator.legal[1]) < 2e-6


# batches


def test_all_answers_come_without_reading_a_value_from_the_device() -> None:
    """On the device `meta` tensors have a shape and no values: to wait for one is an error."""
    rooms = [any_room(np.random.default_rng(seed)) for seed in range(20)]
    batch = BatchSimulator(Simulator(rooms, Moves(), Reward()), "meta")
    room = torch.zeros(5, dtype=torch.int64, device="meta")
    position = torch.zeros(5, 2, dtype=torch.float64, device="meta")
    length, legal = batch.reach(room, position)
    assert (length.shape, legal.shape) == ((5, 20), (5, 20))
    assert batch.moved(room, position, room, length[:, 0]).shape == (5, 2)
    assert batch.reward(room, position).total.shape == (5,)
    assert batch.is_legal(room, position).shape == (5,)


@given(seeds)
@settings(max_examples=10)
def test_a_room_alone_and_a_pose_alone_answer_as_among_others(seed: int) -> None:
    crowd = tuple(Item("chair", (0.4, 0.4), (0.2 * k, 1.0), 10.0 * k) for k in range(1, 20))
    rooms = [*some_rooms(seed), rectangular_room(4, 3, walls=(), others=crowd)]
    together = Simulator(rooms, Moves(), Reward())
    room, position = visited(together, seed, batch=10)
    batch = BatchSimulator(together, dtype=torch.float64)
    reached, legal = destinations(batch, room, position)
    terms = batch.reward(*tensors(room, position))
    for k in range(len(rooms)):
        alone = BatchSimulator(Simulator([rooms[k]], Moves(), Reward()), dtype=torch.float64)
        mine = room == k
        zeros = np.zeros(mine.sum(), dtype=int)
        for a, b in zip(destinations(alone, zeros, position[mine]), (reached, legal), strict=True):
            assert np.array_equal(a, b[mine])
        for a, b in zip(alone.reward(*tensors(zeros, position[mine])), terms, strict=True):
            assert a.numpy() == pytest.approx(b.numpy()[mine], abs=1e-9)
    one = slice(3, 4)
    assert np.array_equal(destinations(batch, room[one], position[one])[0], reached[one])
    assert batch.reward(*tensors(room[one], position[one])).r2.item() == pytest.approx(terms.r2[3].item(), abs=1e-9)


def test_an_empty_batch_has_empty_answers() -> None:
    batch = BatchSimulator(Simulator([l_room(), random_room(np.random.default_rng(0))], Moves(), Reward()))
    room = torch.zeros(0, dtype=torch.int64)
    position = batch.starts(room, torch.Generator())
    length, legal = batch.reach(room, position)
    assert (position.shape, length.shape, legal.shape) == ((0, 2), (0, 20), (0, 20))
    assert batch.moved(room, position, room, length[:, 0]).shape == (0, 2)
    assert batch.reward(room, position).total.shape == (0,)


def test_answers_leave_arguments_and_each_other_as_they_are() -> None:
    simulator = Simulator(some_rooms(0), Moves(), Reward())
    batch = BatchSimulator(simulator)
    room, position = tensors(*visited(simulator, 0))
    action = torch.randint(16, (len(room),), generator=torch.Generator().manual_seed(0))

    def answers() -> list[torch.Tensor]:
        length, legal = batch.reach(room, position)
        moved = batch.moved(room, position, action, length[:, 0])
        start = batch.starts(room, torch.Generator().manual_seed(0))
        return [length, legal, moved, start, batch.is_legal(room, position), *batch.reward(room, position)]

    arguments = [room, position, action]
    copies = [tensor.clone() for tensor in arguments]
    first = answers()
    told = [tensor.clone() for tensor in first]
    again = answers()
    assert all(map(torch.equal, arguments, copies))
    assert all(map(torch.equal, first, told))
    assert all(map(torch.equal, again, told))


def test_what_is_seen_where_a_move_leads_is_what_is_seen_where_the_reference_leads() -> None:
    simulator = Simulator([any_room(np.random.default_rng(seed)) for seed in range(12)], Moves(), Reward())
    observe = GeometryObservation(simulator.rooms, categories_of(simulator.rooms))
    room, position = visited(simulator, 0)
    expected, legal = simulator.destinations(room, position)
    reached, _ = destinations(BatchSimulator(simulator, dtype=torch.float64), room, position)
    b, a = np.nonzero(legal)
    seen, expected_seen = (observe(*tensors(room[b], where[b, a])) for where in (reached, expected))
    assert torch.allclose(seen, expected_seen, rtol=0, atol=2e-6)
