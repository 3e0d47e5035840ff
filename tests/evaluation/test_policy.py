"""Greedy rollouts: where an episode stops, and that the designer's place is never asked."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutrl.agents.networks import GeometryNetwork
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import GeometryObservation
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_observation import RoomsObservation
from layoutrl.env.rooms_simulator import RoomsSimulator, State
from layoutrl.env.scenes import Scenes, ScenesObservation
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.env.symmetry import symmetries
from layoutrl.evaluation.policy import SHORTLIST, GreedyPolicy
from layoutrl.evaluation.rollout import MeanQ, Rollout
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.room import Item, Room
from tests.builders import l_room, random_room, rectangular_room
from tests.evaluation.builders import RIGHT, STEPS, Flat, Place, Scripted, nearing, unturned, wide_room


def follow(agent, start, max_moves=20, on_illegal="mask", room: Room | None = None) -> Rollout:
    simulator = BatchSimulator(Simulator([room or wide_room()], STEPS, Reward()))
    policy = GreedyPolicy(MeanQ(agent, unturned(STEPS)), max_moves, on_illegal)
    return policy.rollout(simulator, Place(), np.array([0]), np.array([start]))


def test_an_episode_stops_where_the_moves_lead_that_are_valued_highest():
    run = follow(nearing((2.0, 1.5)), (1.0, 1.5), max_moves=4)
    assert run.final.tolist() == [[2.0, 1.5]]  # the designer's place is 2.5
    assert run.moves.tolist() == [2]
    assert run.value[:3, 0].tolist() == [-np.inf, -0.5, 0.0]


def test_one_overrated_move_does_not_make_its_place_the_stopping_place():
    run = follow(nearing((2.0, 1.5), {(1.0, 1.5, RIGHT): 1.0}), (1.0, 1.5), max_moves=4)
    assert run.value[:3, 0].tolist() == [-np.inf, 0.5, 0.0]
    assert run.final.tolist() == [[2.0, 1.5]]
    often = follow(nearing((2.0, 1.5), {(1.0, 1.5, RIGHT): 3.0}), (1.0, 1.5), max_moves=4)
    assert often.final.tolist() == [[1.5, 1.5]]  # on average of the four moves into it


def test_after_it_has_looked_it_climbs_by_the_shortest_moves_to_what_promises_more():
    agent, simulator = nearing((2.0, 1.5)), BatchSimulator(Simulator([wide_room()], STEPS, Reward()))
    index, start = np.array([0]), np.array([(1.0, 1.5)])
    for climbs, ends in ((0, 1.5), (1, 2.0), (4, 2.0)):  # two moves from it, of which it looks for one
        run = GreedyPolicy(MeanQ(agent, unturned(STEPS)), 1, "mask", climbs).rollout(simulator, Place(), index, start)
        assert run.final.tolist() == [[ends, 1.5]]
        assert run.way(0)[:, 0].tolist() == [1.0, 1.5, 2.0][: len(run.way(0))]
        assert run.moves.tolist() == [len(run.way(0)) - 1]


@pytest.mark.parametrize(("start", "snap", "ends"), [
    ((1.79, 2.0), 0.015, (1.8, 2.0)),
    ((1.79, 2.0), 0.005, (1.79, 2.0)),
    ((1.78, 2.007), 0.015, (1.78, 2.0)),  # along one axis
    ((1.79, 2.0), 0.0, (1.79, 2.0)),
    ((2.21, 0.79), 0.015, (2.2, 0.79)),  # with a side outside, in a room whose wall is in line with nothing that fits
])  # fmt: skip
def test_last_it_is_put_in_line_with_what_is_near(start, snap, ends):
    """A bed of 2 m by 1 m, and a bookcase from 2.8 to 3.2, and from 1.5 to 2.5."""
    case = Item("bookcase", (0.4, 1.0), (3.0, 2.0), 0.0)
    room = rectangular_room(4, 4, Item("bed", (2.0, 1.0), (1.5, 2.0)), others=(case,))
    simulator = BatchSimulator(Simulator([room], STEPS, Reward()))
    policy = GreedyPolicy(MeanQ(Flat(), unturned(STEPS)), 0, "mask", snap=snap)
    run = policy.rollout(simulator, GeometryObservation([room], ["bed"]), np.array([0]), np.array([start]))
    np.testing.assert_allclose(run.final, [ends], atol=1e-6)
    np.testing.assert_array_equal(run.way(0)[-1], run.final[0])
    assert run.moves.tolist() == [int(ends != start)]


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_it_is_put_in_line_the_same_way_however_the_item_is_turned(seed):
    """In a scene, directions are those of the item as it is turned; where it is put is the same."""
    rng = np.random.default_rng(seed)
    room = replace(random_room(rng), target=None)
    (item, *others), rotation = room.furniture, float(rng.choice([0.0, 90.0, 180.0, 270.0]))
    item = replace(item, form="rectangle", rotation=rotation)
    rooms = RoomsSimulator([replace(room, furniture=(replace(item, center=None), *others))], None, STEPS, Reward())
    scenes = Scenes(BatchRoomsSimulator(rooms))
    one = Simulator([replace(room, furniture=(item, *others), target=0)], STEPS, Reward())
    start = one.starts(np.zeros(8, dtype=int), rng)
    state = rooms.empty(np.zeros(8, dtype=int))
    scene = scenes.of(State(*map(torch.as_tensor, state)))
    names = categories_of(one.rooms)
    observe = ScenesObservation(scenes, RoomsObservation(rooms, names))
    policy = GreedyPolicy(MeanQ(Flat(), unturned(STEPS)), 0, "mask", snap=0.1)
    here = GeometryObservation(one.rooms, names)
    expected = policy.rollout(BatchSimulator(one), here, np.zeros(8, dtype=int), start)
    assert (expected.final != start).any()
    np.testing.assert_allclose(policy.rollout(scenes, observe, scene, start).final, expected.final, atol=2.1e-6)


def test_at_the_border_fewer_moves_are_averaged_over():
    home = (3.5, 1.5)  # from the right there is no way to it
    assert follow(nearing(home), (2.0, 1.5), max_moves=6).final.tolist() == [list(home)]


def test_it_never_goes_back_to_where_it_has_been():
    def values(x, y):  # to x = 2 and back, over and over; then up
        return [9.0, 1.0, 0.0, 5.0] if x < 1.9 else [1.0, 9.0, 0.0, 5.0]

    run = follow(Scripted(values), (1.0, 1.5), max_moves=5)
    assert run.path[:, 0].tolist() == [[1.0, 1.5], [1.5, 1.5], [2.0, 1.5], [2.0, 2.0], [1.5, 2.0], [1.5, 2.5]]


def test_it_ends_where_every_way_leads_back():
    room = rectangular_room(1.0, 1.0, Item("bed", (0.6, 1.2), (0.5, 0.5)))  # from 0.1 to 0.9, and from 0.4 to 0.6
    for on_illegal, highest in (("mask", [1.0, 0.0, 9.0, 9.0]), ("stop", [9.0, 8.0, 0.0, 0.0])):
        run = follow(Scripted(lambda x, y, q=highest: q), (0.2, 0.5), room=room, on_illegal=on_illegal)
        assert run.path[:, 0, 0].tolist() == pytest.approx([0.2] + 20 * [0.7])
        assert run.moves.tolist() == [1]


def test_stop_ends_an_episode_where_its_choice_is_illegal():
    agent = nearing((9.0, 1.5))
    run = follow(agent, (2.5, 1.5), on_illegal="stop")
    assert run.final.tolist() == [[3.5, 1.5]]
    assert run.moves.tolist() == [2]
    assert run.path[2:, 0, 0].tolist() == [3.5] * 19
    assert (run.value[3:] == -np.inf).all()
    at_once = follow(agent, (3.5, 1.5), on_illegal="stop")
    assert at_once.final.tolist() == [[3.5, 1.5]]
    assert at_once.moves.tolist() == [0]


def test_mask_takes_the_best_legal_move_in_place_of_an_illegal_one():
    def values(x, y):  # to the right, where the room ends at 3.7; the second best goes up
        return [10.0, 1.0, 0.0, 5.0]

    run = follow(Scripted(values), (3.0, 2.0), on_illegal="mask", max_moves=2)
    assert run.path[:, 0].tolist() == [[3.0, 2.0], [3.5, 2.0], [3.5, 2.5]]


def test_an_item_that_cannot_move_at_all_stays():
    room = rectangular_room(1.0, 1.0, Item("bed", (1.2, 1.2), (0.5, 0.5)))
    for on_illegal in ("mask", "stop"):
        run = follow(Scripted(lambda x, y: [1.0, 2.0, 3.0, 4.0]), (0.5, 0.5), room=room, on_illegal=on_illegal)
        assert run.final.tolist() == [[0.5, 0.5]]
        assert run.moves.tolist() == [0]


def test_a_place_that_no_shortest_move_leads_into_is_worth_what_led_there():
    moves = Moves((3.3,), slide=True)  # of a room that the item spans, 4 m long: from end to end at most 3.4 m
    simulator = Simulator([rectangular_room(4, 1, Item("bed", (1.0, 1.0), (2.0, 0.5)))], moves, Reward())
    agent = Scripted(lambda x, y: [1.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0, 0.0])  # steps, then slides
    policy = GreedyPolicy(MeanQ(agent, unturned(moves)), 2, "mask")
    run = policy.rollout(BatchSimulator(simulator), Place(), np.array([0]), np.array([(0.35, 0.5)]))
    np.testing.assert_allclose(run.path[:, 0], [[0.35, 0.5], [3.65, 0.5], [3.5, 0.5]], atol=1e-5)
    assert run.final.tolist() == [[3.65, 0.5]]
    assert run.promise.tolist() == [1.0]


def hashed(seed: int, actions: int):
    """Values that look random, and are the same for the same position."""

    @cache
    def values(x: float, y: float) -> list[float]:
        rng = np.random.default_rng([seed, round(x * 1e6) + 2**40, round(y * 1e6) + 2**40])
        return rng.normal(size=actions).tolist()

    return values


def one_by_one(
    values, simulator: BatchSimulator, room: int, start: np.ndarray, max_moves: int, on_illegal: str, climbs: int
) -> list[tuple[float, float]]:
    """From the start of one episode to its stopping place, followed step by step."""
    way, entered_by = [tuple(start)], [-np.inf]
    for _ in range(max_moves):
        here = torch.tensor([way[-1]], dtype=torch.float64)
        length, legal = (x[0] for x in simulator.reach(torch.tensor([room]), here))
        q = np.float32(values(*way[-1])).astype(float)
        there = [*map(tuple, simulator.moved(torch.tensor([room]), here, torch.arange(len(q)), length).tolist())]
        for action in range(len(q)):
            if (legal[action] and there[action] in way) or (on_illegal == "mask" and not legal[action]):
                q[action] = -np.inf
        action = int(np.argmax(q))
        if q[action] == -np.inf or not legal[action]:
            break
        way.append(there[action])
        entered_by.append(q[action])
    shortest = 4 * int(np.argmin(simulator.moves.steps))

    def beside(place):
        """Where the shortest moves lead that are legal: {direction: place}."""
        here = torch.tensor([place], dtype=torch.float64)
        length, legal = (x[0] for x in simulator.reach(torch.tensor([room]), here))
        moves = torch.arange(shortest, shortest + 4)
        reached = simulator.moved(torch.tensor([room]), here, moves, length[moves]).tolist()
        return {way: tuple(reached[way]) for way, move in enumerate(moves) if legal[move]}

    def promise(place, otherwise):
        into = [np.float32(values(*at)[shortest + (way ^ 1)]) for way, at in beside(place).items()]
        return np.mean(into) if into else otherwise

    tried = [int(k) for k in np.argsort(entered_by)[::-1][:SHORTLIST] if k] or [0]
    moves = max(tried, key=lambda k: promise(way[k], entered_by[k]))
    way = way[: moves + 1]
    for _ in range(climbs):
        near = list(beside(way[-1]).values())
        highest = max(near, key=lambda place: promise(place, -np.inf), default=way[-1])
        if promise(highest, -np.inf) <= promise(way[-1], -np.inf):
            break
        way.append(highest)
    return way


@given(
    st.integers(0, 2**32 - 1),
    st.sampled_from(["mask", "stop"]),
    st.sampled_from([3, 60]),
    st.booleans(),
    st.sampled_from([0, 3]),
)
@settings(max_examples=20)
def test_rollouts_of_a_batch_agree_with_episodes_followed_one_by_one(seed, on_illegal, max_moves, slide, climbs):
    rng = np.random.default_rng(seed)
    rooms = [wide_room(), l_room(), random_room(rng)]
    exact = Simulator(rooms, Moves((0.6, 0.2), slide=slide), Reward())
    simulator = BatchSimulator(exact)
    room = rng.integers(3, size=8)
    starts = exact.starts(room, rng)
    values = hashed(seed, exact.moves.count)
    policy = GreedyPolicy(MeanQ(Scripted(values), unturned(exact.moves)), max_moves, on_illegal, climbs)
    run = policy.rollout(simulator, Place(), room, starts)
    np.testing.assert_array_equal(run.path[0], starts)
    for b in range(8):
        way = one_by_one(values, simulator, room[b], starts[b], max_moves, on_illegal, climbs)
        np.testing.assert_array_equal(run.way(b), way)
        assert tuple(run.final[b]) == way[-1]
        assert run.moves[b] == len(way) - 1
        # Every step is a legal one of the exact simulator, to the few micrometres that a slide may be off.
        before, after = run.path[:-1, b], run.path[1:, b]
        reached, legal = exact.destinations(np.repeat(room[b], max_moves), before)
        led = (np.abs(reached - after[:, None]).max(-1) < 3.1e-6) & legal
        assert (led.any(1) | (before == after).all(1)).all()
        assert exact.is_legal(np.repeat(room[b], max_moves), after).all()


@pytest.mark.parametrize("climbs", [0, 4])
def test_an_episode_promises_what_the_shortest_moves_into_its_last_place_are_worth(climbs):
    """By which episodes of other starts and facings are compared."""
    simulator = BatchSimulator(Simulator([wide_room()], STEPS, Reward()))
    policy = GreedyPolicy(MeanQ(nearing((2.0, 1.5)), unturned(STEPS)), 3, "mask", climbs)
    starts = np.array([(2.0, 1.5), (1.0, 1.5), (3.5, 1.5), (1.0, 0.5)])
    run = policy.rollout(simulator, Place(), np.zeros(4, dtype=int), starts)
    assert run.promise == pytest.approx(-np.linalg.norm(run.final - (2.0, 1.5), axis=1))
    assert (run.promise.min() == 0) == bool(climbs)  # else that which begins there ends beside


def network(columns: int, actions: int) -> GeometryNetwork:
    return GeometryNetwork(columns, actions, element_width=8, width=16)


@given(st.integers(0, 2**32 - 1), st.sampled_from(["mask", "stop"]))
@settings(max_examples=10)
def test_rollouts_never_hang_on_the_designers_place(seed, on_illegal):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    simulator = Simulator([room], Moves((0.6, 0.2)), Reward())
    index = np.zeros(6, dtype=int)
    starts = simulator.starts(index, rng)
    places = [room.moving.center, tuple(starts[0]), tuple(starts[1])]
    runs = []
    with torch.random.fork_rng():
        for place in places:
            moved = replace(room, furniture=(replace(room.moving, center=place), *room.furniture[1:]))
            batch_simulator = BatchSimulator(Simulator([moved], simulator.moves, Reward()))
            observe = GeometryObservation([moved], [room.moving.category])
            torch.manual_seed(seed)
            learned = network(observe.space.shape[1], simulator.moves.count)
            policy = GreedyPolicy(MeanQ(learned, symmetries(simulator.moves)), 30, on_illegal)
            runs.append(policy.rollout(batch_simulator, observe, index, starts))
    for run in runs[1:]:
        np.testing.assert_array_equal(run.path, runs[0].path)
        np.testing.assert_array_equal(run.value, runs[0].value)


def test_neither_starts_nor_network_are_changed_by_a_rollout():
    room = wide_room()
    simulator, observe = Simulator([room], STEPS, Reward()), GeometryObservation([room], ["bed"])
    batch_simulator = BatchSimulator(simulator)
    learned = network(observe.space.shape[1], 4)
    policy = GreedyPolicy(MeanQ(learned, unturned(STEPS)), 10, "mask")
    starts = simulator.starts(np.zeros(5, dtype=int), np.random.default_rng(0))
    copies, weights = starts.copy(), [p.clone() for p in learned.parameters()]
    runs = [policy.rollout(batch_simulator, observe, np.zeros(5, dtype=int), starts) for _ in range(2)]
    np.testing.assert_array_equal(starts, copies)
    np.testing.assert_array_equal(runs[0].path, runs[1].path)
    assert all(torch.equal(a, b) for a, b in zip(learned.parameters(), weights, strict=True))
    assert all(p.grad is None for p in learned.parameters())
