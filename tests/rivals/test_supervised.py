"""The supervised yardsticks: what they are trained on, that they learn it, and what they choose from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutrl.agents.networks import GeometryNetwork
from layoutrl.env.observation import GeometryObservation, X, Y
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.env.symmetry import symmetries
from layoutrl.rivals import supervised
from layoutrl.rivals.budgets import updates_budget
from layoutrl.rivals.supervised import (
    PointingNetwork,
    candidates,
    pointed_places,
    regressed_places,
    scored_places,
    train_pointer,
    train_regressor,
    train_scorer,
)
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.room import SYMMETRIES, Item, Room, symmetry
from tests.builders import assert_seeded, l_room, opening, random_room, rectangular_room, room_of

VIEWS = symmetries(Moves())


def simulator_of(*rooms: Room) -> Simulator:
    return Simulator(rooms, Moves(), Reward())


def observe_of(*rooms: Room) -> GeometryObservation:
    return GeometryObservation(rooms, categories_of(rooms))


def seeded(seed: int) -> np.random.SeedSequence:
    return np.random.SeedSequence(seed)


def room_with_a_rule(rng: np.random.Generator) -> Room:
    """The bed stands in the corner that is farthest from the door, which is anywhere in the wall below; turned."""
    width, depth = rng.uniform(3, 4.5), rng.uniform(2.5, 3.5)
    size = tuple(map(float, rng.uniform(0.8, 1.4, 2)))
    door = rng.choice([rng.uniform(0.0, width / 2 - 1.2), rng.uniform(width / 2 + 0.2, width - 0.9)])
    x = width - size[0] / 2 if door < width / 2 - 0.5 else size[0] / 2
    bed = Item("bed", size, (float(x), float(depth - size[1] / 2)))
    room = rectangular_room(width, depth, bed, openings=(opening("door", door, -0.2, door + 0.9, 0),))
    return room.turned(*SYMMETRIES[rng.integers(8)])


def lopsided() -> Room:
    """A room that no symmetry leaves as it is."""
    return l_room(
        Item("bed", (1.0, 0.6), (3.2, 0.5)),
        others=(Item("desk", (0.4, 0.7), (0.3, 3.0)), Item("lamp", (0.3, 0.3), (1.2, 1.9), form="circle")),
        openings=(opening("door", 1.0, -0.2, 1.9, 0),),
    )


def drawn_batch(monkeypatch: pytest.MonkeyPatch, train, rooms: list[Room], batch: int, seed: int = 0):
    """One batch that a network is trained on, (observations, what to say), instead of the training."""
    monkeypatch.setattr(supervised, "trained", lambda make, draw, *_: draw)
    draw = train(simulator_of(*rooms), observe_of(*rooms), updates_budget(1), seeded(0), batch=batch)
    return draw(torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("train", [train_regressor, train_pointer, train_scorer])
def test_training_ends_with_its_budget_and_the_rate_falls_with_it(train, monkeypatch):
    rates = []

    class Recorded(torch.optim.Adam):
        def step(self):
            rates.append(self.param_groups[0]["lr"])
            return super().step()

    monkeypatch.setattr(torch.optim, "Adam", Recorded)
    asked = []

    def spent(made: int) -> float:
        asked.append(made)
        return (0.0, 0.1, 0.6, 1.2)[made]

    train(simulator_of(lopsided()), observe_of(lopsided()), spent, seeded(0), batch=16, learning_rate=0.01)
    assert asked == [0, 1, 2, 3]
    np.testing.assert_allclose(rates, [0.01, 0.009, 0.004])


@pytest.mark.parametrize("train", [train_regressor, train_pointer, train_scorer])
def test_a_network_hangs_on_the_seed_and_on_no_other_randomness(train):
    rooms = [lopsided(), rectangular_room()]

    def weights(seed: int) -> torch.Tensor:
        network = train(simulator_of(*rooms), observe_of(*rooms), updates_budget(3), seeded(seed), batch=32)
        return torch.cat([p.detach().flatten() for p in network.parameters()])

    assert_seeded(weights)


@pytest.mark.parametrize("k", range(8))
def test_the_regressor_learns_the_way_to_the_designers_place_in_each_symmetry(k, monkeypatch):
    room = lopsided()
    seen, way = drawn_batch(monkeypatch, train_regressor, [room], batch=80)
    assert seen.shape[0] == way.shape[0] == 80
    turned = room.turned(*SYMMETRIES[k])
    simulator, observe = simulator_of(turned), observe_of(turned)
    index, mine = np.zeros(10, dtype=int), slice(10 * k, 10 * k + 10)
    origin = np.reshape(turned.envelope.bounds, (2, 2)).mean(0)
    starts = seen[mine, 0, X : Y + 1].double().numpy() + origin
    np.testing.assert_allclose(starts + way[mine].numpy(), [turned.moving.center] * 10, atol=1e-5)
    assert len(np.unique(starts, axis=0)) == 10
    assert simulator.is_legal(index, starts.round(3)).all()
    expected = observe(torch.as_tensor(index), torch.as_tensor(starts))
    torch.testing.assert_close(seen[mine], expected, atol=1e-5, rtol=0)


@pytest.mark.parametrize("k", range(8))
def test_the_pointer_learns_the_designers_place_in_each_symmetry_and_sees_the_item_in_the_middle(k, monkeypatch):
    room = lopsided()
    seen, goal = drawn_batch(monkeypatch, train_pointer, [room], batch=16)
    turned = room.turned(*SYMMETRIES[k])
    observe, mine = observe_of(turned), slice(2 * k, 2 * k + 2)
    origin = np.reshape(turned.envelope.bounds, (2, 2)).mean(0)
    np.testing.assert_allclose(origin + goal[mine].numpy(), [turned.moving.center] * 2, atol=1e-5)
    expected = observe(torch.zeros(2, dtype=torch.long), torch.as_tensor(origin).expand(2, 2))
    torch.testing.assert_close(seen[mine], expected, atol=1e-5, rtol=0)


@given(st.integers(0, 2**32 - 1))
def test_the_pointer_can_point_at_every_place_where_the_item_touches_something(seed):
    """With no offsets its places are those at which the item's upright box touches an element's, or is level with."""
    room = random_room(np.random.default_rng(seed))
    observe = observe_of(room)
    network = PointingNetwork(observe.space.shape[1])
    torch.nn.init.zeros_(network.head.weight)
    torch.nn.init.zeros_(network.head.bias)
    with torch.no_grad():
        weight, center = network(observe(torch.tensor([0]), observe.origin))
    np.testing.assert_allclose(weight.exp().sum(-1), [[1, 1]], rtol=1e-5)
    middle = np.reshape(room.envelope.bounds, (2, 2)).mean(0)
    half = np.reshape(room.moving.template.bounds, (2, 2))[1]
    for axis in range(2):
        possible = center[0, axis][weight[0, axis] > -100].numpy() + middle[axis]
        for other in room.others:
            low, high = np.reshape(other.footprint_at(other.center).bounds, (2, 2))[:, axis]
            h = half[axis]
            for place in (low - h, low + h, (low + high) / 2, high - h, high + h):
                assert np.abs(possible - place).min() < 2e-3  # a circle's polygon is a little smaller


def test_where_the_pointer_points_in_a_room_hangs_on_no_other_room():
    """Rooms with fewer elements are filled up."""
    bare = rectangular_room(4.0, 3.0, Item("bed", (1.0, 0.6), (3.2, 0.5)))
    categories = categories_of([bare, lopsided()])
    torch.manual_seed(0)
    network = PointingNetwork(GeometryObservation([bare], categories).space.shape[1])
    alone, beside = (
        pointed_places(network, GeometryObservation(rooms, categories), VIEWS)[0]
        for rooms in ([bare], [bare, lopsided()])
    )
    np.testing.assert_allclose(alone, beside, atol=1e-5)


def test_no_supervised_place_hangs_on_the_designers():
    """In rooms that are alike but for it."""
    first = lopsided()
    second = replace(first, furniture=(replace(first.moving, center=(0.9, 0.5)), *first.furniture[1:]))
    assert first.target == 0
    start, index = np.array([[2.0, 1.0]]), np.array([0])
    torch.manual_seed(0)
    columns = observe_of(first).space.shape[1]
    agents = [GeometryNetwork(columns, outputs, dueling=False) for outputs in (2, 1)]
    pointing = PointingNetwork(columns)
    places = [
        [
            regressed_places(agents[0], observe_of(room), index, start, VIEWS),
            scored_places(agents[1], simulator_of(room), observe_of(room), VIEWS),
            pointed_places(pointing, observe_of(room), VIEWS),
        ]
        for room in (first, second)
    ]
    np.testing.assert_array_equal(*places)
    np.testing.assert_array_equal(*(candidates(simulator_of(room)) for room in (first, second)))


def test_the_pointer_learns_a_rule_and_follows_it_in_rooms_that_it_never_saw():
    rng = np.random.default_rng(0)
    training, unseen = ([room_with_a_rule(rng) for _ in range(count)] for count in (60, 30))
    network = train_pointer(simulator_of(*training), observe_of(*training), updates_budget(1000), seeded(0))
    places = pointed_places(network, observe_of(*unseen), VIEWS)
    assert simulator_of(*unseen).reward(np.arange(30), places).iou.mean() > 0.85


@pytest.mark.parametrize("k", range(8))
def test_the_scorer_learns_the_iou_of_the_place_that_it_sees_in_each_symmetry(k, monkeypatch):
    room = lopsided()
    seen, iou = drawn_batch(monkeypatch, train_scorer, [room], batch=1600)
    assert iou.shape == (1600, 1)
    turned = room.turned(*SYMMETRIES[k])
    simulator, observe = simulator_of(turned), observe_of(turned)
    index, mine = np.zeros(200, dtype=int), slice(200 * k, 200 * k + 200)
    places = seen[mine, 0, X : Y + 1].double().numpy() + np.reshape(turned.envelope.bounds, (2, 2)).mean(0)
    np.testing.assert_allclose(iou[mine, 0], simulator.reward(index, places).iou, atol=1e-4)
    torch.testing.assert_close(seen[mine], observe(torch.as_tensor(index), torch.as_tensor(places)), atol=1e-5, rtol=0)
    assert simulator.is_legal(index, places.round(5)).mean() > 0.99
    # Of every kind of place there are some: candidates, around the designer's, anywhere.
    distance = np.linalg.norm(places - turned.moving.center, axis=1)
    from_candidate = np.linalg.norm(places[:, None] - candidates(simulator)[0], axis=-1).min(1)
    assert 0.4 < (from_candidate < 1e-5).mean() < 0.75
    assert ((distance > 1e-5) & (distance < 0.05)).mean() > 0.05
    assert ((distance > 0.5) & (from_candidate > 1e-5)).mean() > 0.15


def test_the_regressor_learns_a_rule_and_follows_it_in_rooms_that_it_never_saw():
    rng = np.random.default_rng(0)
    training, unseen = ([room_with_a_rule(rng) for _ in range(count)] for count in (60, 30))
    network = train_regressor(
        simulator_of(*training), observe_of(*training), updates_budget(300), seeded(0), batch=128, learning_rate=3e-3
    )
    simulator, room = simulator_of(*unseen), np.arange(30)
    starts = simulator.starts(room, rng)
    places = regressed_places(network, observe_of(*unseen), room, starts, VIEWS[:1])
    assert simulator.reward(room, starts).iou.mean() < 0.3
    assert simulator.reward(room, places).iou.mean() > 0.6


def test_the_scorer_learns_a_rule_and_finds_the_place_in_rooms_that_it_never_saw():
    rng = np.random.default_rng(0)
    training, unseen = ([room_with_a_rule(rng) for _ in range(count)] for count in (60, 30))
    network = train_scorer(
        simulator_of(*training), observe_of(*training), updates_budget(130), seeded(0), batch=128, learning_rate=3e-3
    )
    simulator = simulator_of(*unseen)
    places = scored_places(network, simulator, observe_of(*unseen), VIEWS[:1])
    assert simulator.reward(np.arange(30), places).iou.mean() > 0.85


def test_the_place_that_the_scorer_likes_best_is_taken_among_the_candidates_of_each_room():
    rooms = [rectangular_room(4, 3), lopsided(), rectangular_room(2, 2, Item("bed", (1, 1), (1, 1)))]
    simulator, observe = simulator_of(*rooms), observe_of(*rooms)
    network = train_scorer(simulator, observe, updates_budget(1), seeded(0), batch=16)
    places, every = scored_places(network, simulator, observe, VIEWS[:3]), candidates(simulator)
    for k, place in enumerate(places):
        own = every[k][~np.isnan(every[k, :, 0])]
        with torch.no_grad():
            seen = observe(torch.full((len(own),), k), torch.as_tensor(own))
            score = sum(network(observe.turned(seen, view))[:, 0] for view in VIEWS[:3])
        assert place.tolist() == own[score.argmax()].tolist()


def test_seen_from_all_sides_a_turned_room_gets_the_turned_answer(monkeypatch):
    monkeypatch.setattr(supervised, "BLOCK", 5)
    room, index = lopsided(), np.zeros(12, dtype=int)
    simulator, observe = simulator_of(room), observe_of(room)
    starts = simulator.starts(index, np.random.default_rng(0))
    regressor = train_regressor(simulator, observe, updates_budget(1), seeded(0), batch=16)
    pointer = train_pointer(simulator, observe, updates_budget(1), seeded(0))
    scorer = train_scorer(simulator, observe, updates_budget(1), seeded(0), batch=16)
    pointed = pointed_places(pointer, observe, VIEWS)
    places = regressed_places(regressor, observe, index, starts, VIEWS)
    place = scored_places(scorer, simulator, observe, VIEWS)
    for which in SYMMETRIES:
        turned, matrix = room.turned(*which), symmetry(*which)
        observe = observe_of(turned)
        found = regressed_places(regressor, observe, index, starts @ matrix.T, VIEWS)
        np.testing.assert_allclose(found, places @ matrix.T, atol=1e-5)
        np.testing.assert_allclose(pointed_places(pointer, observe, VIEWS), pointed @ matrix.T, atol=1e-5)
        found = scored_places(scorer, simulator_of(turned), observe, VIEWS)
        np.testing.assert_allclose(found, place @ matrix.T, atol=1e-5)


def test_candidates_touch_the_outline_or_an_item_along_both_axes_or_lie_on_the_grid():
    desk = Item("desk", (0.4, 0.6), (3.0, 1.0))  # from (2.8, 0.7) to (3.2, 1.3)
    room = rectangular_room(4, 3, Item("bed", (1.0, 0.6), (1.33, 1.77)), others=(desk,))
    places = candidates(simulator_of(room))[0]
    contacts = {(x, y) for x in (0.5, 2.3, 3.5) for y in (0.3, 0.4, 1.6, 2.7)}  # right of the desk it is too narrow
    contacts |= {(3.7, y) for y in (0.3, 0.4, 1.6, 2.7)}  # but for an item that may stand in the wall
    grid = {(round(0.5 + 0.3 * i, 4), round(0.3 + 0.24 * j, 4)) for i in range(11) for j in range(11)}
    found = [tuple(p) for p in np.round(places, 4).tolist()]
    assert set(found) == contacts | grid
    assert len(found) == 121 + 16 + 1  # one, here the middle, that is always legal


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_candidates_are_legal_and_do_not_hang_on_the_designers_place(seed):
    rng = np.random.default_rng(seed)
    rooms = [random_room(rng), random_room(rng)]
    simulator = simulator_of(*rooms)
    places = candidates(simulator)
    room, which = np.nonzero(~np.isnan(places[..., 0]))
    assert set(room) == {0, 1}
    assert simulator.is_legal(room, places[room, which]).all()
    elsewhere = simulator.starts(np.array([0, 1]), rng)
    moved = [
        replace(room, furniture=(replace(room.moving, center=tuple(center)), *room.furniture[1:]))
        for room, center in zip(rooms, elsewhere, strict=True)
    ]
    np.testing.assert_array_equal(places, candidates(simulator_of(*moved)))


def test_a_room_whose_walls_and_grid_have_no_candidate_has_one():
    # No wall is upright or level, and the bed fits only within 2 cm of (1.56, 1.56): between the lines of the grid.
    slanting = ((0.0, 0.0), (4.0, 1.0), (1.0, 4.0))
    room = room_of(slanting, Item("bed", (1.86, 1.86), (1.56, 1.56)), walls=(), id="slanting")
    simulator = simulator_of(rectangular_room(), room)
    places = candidates(simulator)[1]
    assert (~np.isnan(places[:, 0])).sum() == 1
    assert simulator.is_legal(np.array([1]), places[:1]).all()
