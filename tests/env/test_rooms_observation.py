"""What is seen of whole rooms, and what must not be."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from layoutrl.env.observation import COLUMNS, GeometryObservation
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_observation import ROOM_COLUMNS, STANDS, TUCKED, RoomsObservation
from layoutrl.env.rooms_simulator import RoomsSimulator, State
from layoutrl.env.simulator import Moves
from layoutrl.env.symmetry import Symmetry, symmetries
from layoutrl.rooms.brief import brief_of, categories_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import MAIN_ITEM, SYMMETRIES, Item, Room, symmetry
from tests.builders import rectangular_room


def simulator_of(rooms: list[Room], designs: list[Room]) -> RoomsSimulator:
    return RoomsSimulator(rooms, designs, Moves(), Reward())


def some_state(simulator: RoomsSimulator, seed: int, batch: int = 5) -> State[torch.Tensor]:
    rng = np.random.default_rng(seed)
    state = simulator.begin(rng.integers(len(simulator.rooms), size=batch), rng)
    state.stands[:] = (rng.random(state.stands.shape) < 0.6) & (
        np.arange(state.stands.shape[1]) < simulator.count[state.room][:, None]
    )
    moving = (rng.random(batch) * simulator.count[state.room]).astype(int)
    return State(*map(torch.as_tensor, state._replace(moving=moving)))


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_rooms_that_differ_only_in_the_designers_places_look_the_same(room_type: str) -> None:
    rng = np.random.default_rng(0)
    rooms = design_rooms(room_type, "train", 0, 3).rooms
    moved = [
        replace(
            room,
            furniture=tuple(
                replace(room.furniture[k], center=(1.0, 1.0), rotation=90.0 * rng.integers(4))
                for k in rng.permutation(len(room.furniture))
            ),
            target=None,
        )
        for room in rooms
    ]
    seen = []
    for designs in (rooms, moved):
        simulator = simulator_of([brief_of(room) for room in designs], designs)
        seen.append(RoomsObservation(simulator)(some_state(simulator, 1)))
    assert torch.equal(*seen)


def test_what_stands_looks_as_it_does_to_who_moves_one_item() -> None:
    rooms = design_rooms("bedroom", "train", 0, 3).rooms
    simulator = simulator_of([brief_of(room) for room in rooms], rooms)
    categories = categories_of(rooms)
    state = some_state(simulator, 3, batch=12)
    seen = RoomsObservation(simulator, categories)(state)
    there = State(*(values.numpy() for values in state))
    for b in range(12):
        layout = simulator.layout(there, b)
        n = there.moving[b]
        if not there.stands[b, n]:
            continue
        furniture = [simulator.item(there, b, n), *(i for i in layout.furniture if i.center is not None)]
        furniture.remove(furniture[0])
        alone = replace(
            layout, furniture=(simulator.item(there, b, n), *others_of(layout, simulator, there, b)), target=0
        )
        expected = GeometryObservation([alone], categories)(torch.tensor([0]), torch.tensor(there.center[b, n][None]))[
            0
        ]
        rows = seen[b][seen[b][:, STANDS] == 1]
        without = torch.cat([rows[:, :STANDS], rows[:, TUCKED + 1 :]], 1)
        assert sorted(map(tuple, without.numpy().round(4).tolist())) == sorted(
            map(tuple, expected.numpy().round(4).tolist())
        )


def others_of(layout: Room, simulator: RoomsSimulator, state: State[np.ndarray], b: int) -> list:
    moving = simulator.item(state, b, state.moving[b])
    others = [item for item in layout.furniture if item.center is not None]
    others.remove(moving)
    return others


def test_what_is_still_to_come_is_known_by_category_and_size_and_is_nowhere() -> None:
    rooms = design_rooms("bedroom", "train", 0, 2).rooms
    simulator = simulator_of([brief_of(room) for room in rooms], rooms)
    rng = np.random.default_rng(0)
    observe = RoomsObservation(simulator)
    categories = categories_of(simulator.rooms)
    begun = [State(*map(torch.as_tensor, simulator.begin(np.array([0]), rng))) for _ in range(2)]
    one, other = (observe(state)[0] for state in begun)
    assert torch.equal(one, other)  # the poses that are drawn for later do not show
    for row, item in zip(one, simulator.items[0], strict=False):
        shown = dict(zip((*ROOM_COLUMNS, *categories), row.tolist(), strict=True))
        assert (shown["extent_x"], shown["extent_y"]) == pytest.approx(item.size)
        assert shown["item"] == shown["present"] == shown[item.category] == 1
        for name in ("x", "y", "cos", "sin", "cos2", "sin2", "stands", "moving"):
            assert shown[name] == 0


def test_observations_lie_in_their_space() -> None:
    rooms = design_rooms("living_room", "train", 0, 3).rooms
    simulator = simulator_of([brief_of(room) for room in rooms], rooms)
    observe = RoomsObservation(simulator)
    for seed in range(5):
        seen = observe(some_state(simulator, seed)).numpy()
        assert all(observe.space.contains(one) for one in seen)


@pytest.mark.parametrize("k", range(8))
def test_turned_it_is_what_the_turned_room_looks_like(k: int) -> None:
    """Each item faces where its turned one does, whichever way that is called there."""
    rooms = design_rooms("bedroom", "train", 0, 4).rooms
    matrix = torch.tensor(symmetry(*SYMMETRIES[k])).double()
    turned = [room.turned(*SYMMETRIES[k]) for room in rooms]
    simulator, other = (simulator_of([brief_of(room) for room in those], those) for those in (rooms, turned))
    state = some_state(simulator, 3, batch=12)
    degrees = torch.tensor(simulator.degrees)[state.room].gather(2, state.quarter[..., None])[..., 0].deg2rad()
    way = torch.stack([degrees.cos(), degrees.sin()], -1) @ matrix.T
    quarter = (torch.atan2(way[..., 1], way[..., 0]) / (torch.pi / 2)).round().long() % 4
    there = state._replace(center=state.center @ matrix.T, quarter=quarter)
    seen = RoomsObservation(simulator).turned(RoomsObservation(simulator)(state), symmetries(Moves())[k])
    torch.testing.assert_close(sorted_rows(seen), sorted_rows(RoomsObservation(other)(there)), atol=1e-5, rtol=0)


def sorted_rows(seen: torch.Tensor) -> torch.Tensor:
    """The elements of each room in an order that does not hang on how they are listed."""
    rounded = (seen.double() * 1e4).round() + 0.0
    return torch.stack([one[np.lexsort(rows.numpy().T)] for one, rows in zip(seen, rounded, strict=True)])


def test_a_rotation_that_is_given_shows_before_the_item_stands_and_so_does_what_may_stand_under_others() -> None:
    bed, chair = Item("bed", (2.0, 1.5), None, 90.0), Item("chair", (0.5, 0.4), None, None, tucked=True)
    brief = rectangular_room(4, 3, bed, others=(chair,), target=None)
    simulator = RoomsSimulator([brief], None, Moves(), Reward())
    observe = RoomsObservation(simulator)
    state = State(*map(torch.as_tensor, simulator.begin(np.array([0]), np.random.default_rng(0))))
    seen = observe(state)
    shown = [dict(zip(ROOM_COLUMNS, row.tolist(), strict=False)) for row in seen[0]]
    assert (shown[0]["extent_x"], shown[0]["extent_y"], shown[0]["sin"], shown[0]["tucked"]) == pytest.approx(
        (1.5, 2, 1, 0)
    )
    assert (shown[1]["extent_x"], shown[1]["extent_y"], shown[1]["sin"], shown[1]["tucked"]) == pytest.approx(
        (0.5, 0.4, 0, 1)
    )


@pytest.mark.parametrize("category", ["bed", "table"])  # which has a front, and none
def test_what_waits_with_a_rotation_is_turned_with_the_room_and_what_waits_without_is_not(category: str) -> None:
    item, chair = Item(category, (2.0, 1.5), None, 90.0), Item("chair", (0.5, 0.4), None)
    brief = rectangular_room(4, 3, item, others=(chair,), target=None)
    simulator = RoomsSimulator([brief], None, Moves(), Reward())
    state = State(*map(torch.as_tensor, simulator.begin(np.array([0]), np.random.default_rng(0))))
    observe = RoomsObservation(simulator)
    seen = observe.turned(observe(state), Symmetry(1, False, Moves()))
    turned = RoomsObservation(RoomsSimulator([brief.turned(1)], None, Moves(), Reward()))(state)
    waiting = slice(COLUMNS.index("extent_x"), TUCKED + 1)
    torch.testing.assert_close(seen[0, :2, waiting], turned[0, :2, waiting], rtol=0, atol=1e-5)
