"""The perfect Q's places, against the same decision process solved by brute force.

Both ask the batched simulator in double precision: the process to solve is its. What it answers is held to the shapely
simulator elsewhere, but for discs, which there are polygons of 256 corners: over them the rewards of both differ by
3e-5, and the values of Q by up to 20 times that where the discount is 0.95.
"""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.geometry import GRID
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.evaluation import oracle
from layoutrl.evaluation.metrics import lattice_ceiling
from layoutrl.evaluation.oracle import SLACK, TOLERANCE, Search, best_rewards, perfect_places, perfect_values
from layoutrl.rooms.room import Item, Room
from tests.builders import destinations, l_room, random_room, rectangular_room

NEAR = 2e-5  # of IoU: what a few micrometres of grid and fit make
TIED = 2 * TOLERANCE  # of Q: twice what the search may leave out


class Solved:
    """All places that moves reach from a start, and their optimal values, by plain value iteration."""

    def __init__(self, simulator: BatchSimulator, start: np.ndarray, discount: float, most: int = 6000):
        self.position, leads_to, known = [tuple(start)], [], dict.fromkeys(cells(start[None]), 0)
        while len(leads_to) < len(self.position):
            assume(len(self.position) < most)
            front = np.array(self.position[len(leads_to) :])
            reached, legal = destinations(simulator, np.zeros(len(front), dtype=int), front)
            for k, may in enumerate(legal):
                row = []
                for place, cell in zip(reached[k, may].tolist(), cells(reached[k, may]), strict=True):
                    row.append(known.setdefault(cell, len(self.position)))
                    if row[-1] == len(self.position):
                        self.position.append(tuple(place))
                leads_to.append(row or [len(leads_to)])  # an item that cannot move stays
        places = np.array(self.position)
        room = torch.zeros(len(places), dtype=torch.int64)
        self.reward = reward = simulator.reward(room, torch.tensor(places)).total.numpy() / 100
        self.leads_to = np.array([(row * 16)[:16] for row in leads_to])
        value = np.zeros(len(places))
        for _ in range(int(np.log(1e-8) / np.log(discount))):
            value = (reward + discount * value)[self.leads_to].max(1)
        self.q = reward + discount * value  # of the move that enters each place

    def loops(self) -> list[int]:
        """The places on a loop of greedy policies, however ties are broken, that are the best of a loop."""
        on_the_way = self._reached([0], np.inf)
        return [k for k in on_the_way if k in self._reached(self._greedy(k), self.q[k] + TIED)]

    def _greedy(self, place: int) -> list[int]:
        row = self.leads_to[place]
        return row[self.q[row] > self.q[row].max() - TIED].tolist()

    def _reached(self, places: list[int], most: float) -> set[int]:
        """What greedy moves reach through places of at most this Q."""
        seen: set[int] = set()
        while places:
            new = {k for k in places if self.q[k] <= most} - seen
            seen |= new
            places = [n for k in new for n in self._greedy(k)]
        return seen


def cells(places: np.ndarray) -> list[tuple[int, ...]]:
    return [*map(tuple, np.round(places / GRID).astype(int).tolist())]


def assert_perfect(simulator: Simulator, start: np.ndarray, discount: float) -> None:
    batch_simulator = BatchSimulator(simulator, dtype=torch.float64)
    solved, room = Solved(batch_simulator, start, discount), np.zeros(1, dtype=int)
    bound = best_rewards(simulator, batch_simulator)
    assert solved.reward.max() <= bound[0] + TIED
    search = Search(simulator, batch_simulator, bound, room, start[None], discount)
    best = bound[0] / (1 - discount) - search.least_cost[0]
    assert best == pytest.approx(solved.q[solved.leads_to[0]].max(), abs=TIED)
    (q,) = perfect_values(simulator, room, start[None], discount, torch.float64)
    legal = batch_simulator.reach(torch.zeros(1, dtype=torch.int64), torch.tensor(start[None]))[1][0].numpy()
    np.testing.assert_array_equal(np.isfinite(q), legal)
    assert q[legal] == pytest.approx(solved.q[solved.leads_to[0]][: legal.sum()], abs=TIED)
    stops = np.array([solved.position[k] for k in solved.loops()])
    place = perfect_places(simulator, room, start[None], discount, torch.float64)[0]
    assert np.abs(stops - place).max(1).min() < GRID / 2


def some_room(rng: np.random.Generator, kind: str) -> Room:
    """A random room in which a rectangle moves."""
    if kind == "any":
        while (room := random_room(rng)).moving.form == "circle":
            pass
        return room
    item = Item("bed", tuple(map(float, rng.uniform(0.4, 1.0, 2))), (1.0, 1.0), float(rng.choice([0, 90, 30])))
    if kind == "L":
        return l_room(item)
    others = (Item("chair", (0.5, 0.4), tuple(map(float, rng.uniform((0.4, 0.4), (1.8, 1.4))))),)
    return rectangular_room(2.2, 1.8, item, others=others[: int(rng.integers(2))])


@given(
    st.sampled_from(["small", "L", "any"]),
    st.sampled_from(
        [Moves((0.5,)), Moves((0.4, 0.1)), Moves((0.6, 0.2), slide=False), Moves((8.0,), "pixel", slide=False)]
    ),
    st.sampled_from([0.5, 0.7, 0.95]),
    st.integers(0, 2**32 - 1),
)
@example("any", Moves((0.5,)), 0.95, 1)  # a round table stands in the way
@settings(max_examples=25)
def test_the_place_is_that_of_the_greedy_policy_of_brute_force(kind, moves, discount, seed):
    rng = np.random.default_rng(seed)
    simulator = Simulator([some_room(rng, kind)], moves, Reward())
    assert_perfect(simulator, simulator.starts(np.zeros(1, dtype=int), rng)[0], discount)


@given(st.sampled_from([Reward(inside="iou"), Reward(theta1=30), Reward(100, -20, 0)]), st.integers(0, 2**32 - 1))
@settings(max_examples=6)
def test_other_rewards_are_solved_as_well(reward, seed):
    rng = np.random.default_rng(seed)
    simulator = Simulator([some_room(rng, "small")], Moves((0.4,)), reward)
    assert_perfect(simulator, simulator.starts(np.zeros(1, dtype=int), rng)[0], 0.7)


def test_a_loop_may_be_longer_than_two():
    # Right contact 3 mm off, left contact 2 cm off: slide right, slide left and a step back cost least on average.
    others = (Item("shelf", (0.5, 0.2), (1.25, 1.5)), Item("shelf", (0.5, 0.2), (3.773, 1.5)))
    room = rectangular_room(5, 3, Item("bed", (2.0, 0.2), (2.52, 1.5)), others=others)
    simulator, start = Simulator([room], Moves((0.02,)), Reward()), np.array([[2.52, 1.5]])
    search = Search(simulator, BatchSimulator(simulator), np.ones(1), np.zeros(1, dtype=int), start, 0.9)
    np.testing.assert_allclose(search.stops(), start, atol=1e-6)
    off = np.array([0.003, 0.02, 0.0])
    costs = 1 - (2 - off) / (2 + off)
    assert search.least_cost[0] == pytest.approx(costs @ 0.9 ** np.arange(3) / (1 - 0.9**3), abs=NEAR)


def test_the_bound_is_what_a_move_that_aligns_the_better_coordinate_attains():
    simulator = Simulator(
        [rectangular_room()], Moves((0.5,), slide=False), Reward()
    )  # the item, 1 m square, at (2, 1.5)
    batch_simulator, room = BatchSimulator(simulator, dtype=torch.float64), np.zeros(2, dtype=int)
    search = Search(simulator, batch_simulator, np.ones(2), room, np.array([[2.5, 1.8], [1.8, 1.0]]), 1e-9)
    aligned = (1 - np.array([0.3, 0.2])) / (1 + np.array([0.3, 0.2]))
    np.testing.assert_allclose(search.least_cost, 1 - aligned, atol=NEAR)
    np.testing.assert_allclose(search._to_come[:2], 1 - aligned, atol=NEAR)


@given(st.booleans(), st.integers(0, 2**32 - 1))
@settings(max_examples=8)
def test_no_place_exceeds_the_ceiling_and_none_hangs_on_its_batch(slide, seed):
    rng = np.random.default_rng(seed)
    rooms = [some_room(rng, kind) for kind in ("small", "L", "small")]
    simulator = Simulator(rooms, Moves((0.4, 0.1), slide=slide), Reward())
    room = rng.integers(3, size=7)
    starts = simulator.starts(room, rng)
    places = perfect_places(simulator, room, starts, 0.7)
    upright = np.array([rooms[k].moving.rotation % 90 == 0 for k in room])
    ceiling = lattice_ceiling(simulator, room, starts)
    assert (simulator.reward(room, places).iou <= ceiling + NEAR)[upright].all()
    assert simulator.is_legal(room, places).all()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(oracle, "EPISODES", 3)
        patch.setattr(oracle, "AT_ONCE", 50)
        patch.setattr(oracle, "BEAM", 1)
        np.testing.assert_allclose(perfect_places(simulator, room, starts, 0.7), places, atol=1e-9)
    alone = [perfect_places(simulator, room[[b]], starts[[b]], 0.7)[0] for b in range(7)]
    np.testing.assert_allclose(alone, places, atol=1e-9)


def test_what_lies_behind_a_costly_way_is_left_where_the_future_counts_little():
    # The designer's place is behind a shelf that cannot be gone around: over it, each of two moves costs.
    shelf = Item("shelf", (1.0, 1.0), (2.5, 0.5))
    room = rectangular_room(5, 1, Item("bed", (0.9, 0.9), (4.0, 0.5)), walls=(), others=(shelf,))
    simulator, start = Simulator([room], Moves((0.5,), slide=False), Reward()), np.array([[1.0, 0.5]])
    index = np.zeros(1, dtype=int)
    np.testing.assert_allclose(perfect_places(simulator, index, start, 0.9), [[4.0, 0.5]], atol=1e-6)
    assert perfect_places(simulator, index, start, 0.1)[0, 0] < 1.6


def test_an_item_that_cannot_move_stays():
    room = rectangular_room(1.0, 1.0, Item("bed", (1.2, 1.2), (0.5, 0.5)))
    simulator, start = Simulator([room], Moves((0.5,), slide=False), Reward()), np.array([[0.5, 0.5]])
    np.testing.assert_array_equal(perfect_places(simulator, np.zeros(1, dtype=int), start, 0.7), start)


@pytest.mark.parametrize("solve", [perfect_places, perfect_values])
@pytest.mark.parametrize(
    ("reward", "discount", "said"),
    [
        (Reward(), 0.0, r"^discount: expected more than 0 and less than 1; got 0\.0$"),
        (Reward(), 1.0, r"^discount: expected more than 0 and less than 1; got 1\.0$"),
        (Reward(theta2=1.0), 0.7, r"^reward: expected theta1 above 0, theta2 and theta3 at most 0; got .*theta2=1\.0"),
        (Reward(theta1=0.0), 0.7, r"^reward: expected theta1 above 0"),
    ],
)
def test_what_has_no_solution_is_refused(solve, reward, discount, said):
    simulator, start = Simulator([rectangular_room()], Moves((0.5,), slide=False), reward), np.array([[2.0, 1.5]])
    with pytest.raises(InputError, match=said):
        solve(simulator, np.zeros(1, dtype=int), start, discount)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_no_reward_exceeds_the_bound_and_it_is_tight(seed):
    rng = np.random.default_rng(seed)
    table = Item("table", (1.2, 0.9), (2.0, 1.5))
    chairs = tuple(Item("chair", (0.4, 0.4), (x, y)) for x in (1.7, 2.3) for y in rng.uniform((0.9, 1.8), (1.2, 2.1)))
    simulator = Simulator([rectangular_room(4, 3, table, others=chairs)], Moves(), Reward())
    (bound,) = best_rewards(simulator, BatchSimulator(simulator, dtype=torch.float64))
    around = simulator.designer_position + rng.normal(size=(2000, 2)) * rng.choice([0.003, 0.03, 0.3], size=(2000, 1))
    reward = simulator.reward(np.zeros(2000, dtype=int), np.round(around, 6)).total / 100
    assert reward.max() <= bound < 0.98
    assert bound - SLACK - reward.max() < 0.02
