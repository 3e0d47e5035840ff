"""The Q-networks: the paper's layers, and values of a set of elements that hang on neither order nor padding."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from layoutrl.agents.exploration import explore
from layoutrl.agents.networks import (
    FAR,
    GeometryNetwork,
    PaperNetwork,
    _clearances,
    _gaps,
    _is_border,
    _is_item,
    _slides,
)
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.episodes import Episodes
from layoutrl.env.observation import COLUMNS, GeometryObservation
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.room import Item, Opening, Room
from tests.builders import random_room, rectangle, rectangular_room

SEEDS = st.integers(0, 2**32 - 1)


def seeded(make) -> nn.Module:
    with torch.random.fork_rng():
        torch.manual_seed(0)
        return make()


def observed(rooms: list[Room], positions: list[tuple[float, float]], categories: list[str] | None = None):
    observation = GeometryObservation(rooms, categories_of(rooms) if categories is None else categories)
    return observation(torch.arange(len(rooms)), torch.tensor(positions, dtype=torch.float64))


@pytest.mark.parametrize("dueling", [False, True])
def test_the_papers_network_has_the_papers_layers(dueling):
    network = PaperNetwork(4, dueling)
    convolutions = [m for m in network.modules() if isinstance(m, nn.Conv2d)]
    assert [c.out_channels for c in convolutions] == [8, 16, 32]
    assert {(c.kernel_size, c.stride, c.padding) for c in convolutions} == {((3, 3), (2, 2), (0, 0))}
    linear = [(m.in_features, m.out_features) for m in network.modules() if isinstance(m, nn.Linear)]
    assert linear == [(7200, 512), (512, 512), *([(512, 1), (512, 4)] if dueling else [(512, 4)])]
    assert network(torch.zeros(2, 128, 128, 3, dtype=torch.uint8)).shape == (2, 4)


@pytest.mark.parametrize("side", [126, 135])
def test_pictures_that_do_not_flatten_to_7200_are_refused(side):
    with pytest.raises(RuntimeError, match="shape"):
        PaperNetwork(4)(torch.zeros(1, side, side, 3, dtype=torch.uint8))


def test_the_papers_network_reads_levels_of_255_as_1_and_channels_last():
    network = seeded(lambda: PaperNetwork(4))
    image = torch.as_tensor(np.random.default_rng(0).integers(0, 256, (2, 128, 128, 3)), dtype=torch.uint8)
    inputs = []
    next(m for m in network.modules() if isinstance(m, nn.Conv2d)).register_forward_pre_hook(
        lambda module, args: inputs.append(args[0])
    )
    network(image)
    torch.testing.assert_close(inputs[0], torch.movedim(image.double(), 3, 1).float() / 255)


def test_every_pixel_and_channel_but_the_last_row_and_column_can_change_the_papers_values():
    network = seeded(lambda: PaperNetwork(4))
    levels = []
    next(m for m in network.modules() if isinstance(m, nn.Conv2d)).register_forward_pre_hook(
        lambda module, args: levels.append(args[0].requires_grad_())
    )
    image = torch.as_tensor(np.random.default_rng(0).integers(0, 256, (4, 128, 128, 3)), dtype=torch.uint8)
    network(image).sum().backward()
    changes = (levels[0].grad != 0).any(0)
    assert changes[:, :127, :127].all()
    assert not changes[:, 127].any()
    assert not changes[:, :, 127].any()


@pytest.mark.parametrize("kind", ["paper", "geometry"])
def test_dueling_values_are_value_plus_advantage_less_its_mean(kind):
    if kind == "paper":
        network, state = seeded(lambda: PaperNetwork(5, dueling=True)), torch.zeros(2, 128, 128, 3, dtype=torch.uint8)
    else:
        network = seeded(lambda: GeometryNetwork(len(COLUMNS), 5, dueling=True))
        state = torch.rand(2, 3, len(COLUMNS))
    features = []
    network.head.register_forward_pre_hook(lambda module, args: features.append(args[0]))
    q = network(state)
    value, advantage = network.head.value(features[0]), network.head.advantage(features[0])
    torch.testing.assert_close(q, value + advantage - advantage.mean(1, keepdim=True))
    torch.testing.assert_close(q.mean(1, keepdim=True), value)
    with torch.no_grad():
        network.head.advantage.bias += 3.0  # what all actions share is the value's alone
    torch.testing.assert_close(network(state), q)


@given(st.integers(2, 40), st.integers(1, 4))
@settings(max_examples=10)
def test_the_geometry_network_takes_any_number_of_elements(elements, batch):
    q = GeometryNetwork(len(COLUMNS) + 2, 12)(torch.rand(batch, elements, len(COLUMNS) + 2))
    assert q.shape == (batch, 12)
    assert q.isfinite().all()


@given(SEEDS)
@settings(max_examples=15)
def test_padding_never_changes_the_geometry_networks_values(seed):
    rng = np.random.default_rng(seed)
    room, other = random_room(rng), random_room(rng)
    categories = categories_of([room, other])
    alone = observed([room], [room.moving.center], categories)
    among = observed([room, other], [room.moving.center, other.moving.center], categories)[:1]
    padded = torch.cat([among, torch.zeros(1, 7, among.shape[2])], 1)
    network = seeded(lambda: GeometryNetwork(alone.shape[2], 4))
    torch.testing.assert_close(network(among), network(alone), atol=1e-5, rtol=1e-5)
    torch.testing.assert_close(network(padded), network(alone), atol=1e-5, rtol=1e-5)


@given(SEEDS)
@settings(max_examples=15)
def test_the_order_of_the_elements_never_changes_the_geometry_networks_values(seed):
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    state = observed([room], [room.moving.center])
    shuffled = torch.cat([state[:, :1], state[:, 1:][:, torch.as_tensor(rng.permutation(state.shape[1] - 1))]], 1)
    network = seeded(lambda: GeometryNetwork(state.shape[2], 4))
    torch.testing.assert_close(network(shuffled), network(state), atol=1e-5, rtol=1e-5)


@pytest.mark.parametrize("more", [0, 3])
def test_a_network_that_is_shown_more_columns_values_as_before_whatever_is_in_them(more):
    state = torch.rand(5, 7, len(COLUMNS) + 2)
    network = GeometryNetwork(state.shape[2], 4, dueling=True)
    wider = GeometryNetwork(state.shape[2] + more, 4, dueling=True)  # made as any of its size: all else fits
    wider.load_state_dict(network.knowing(more).state_dict())
    shown = torch.cat([state, torch.rand(5, 7, more)], -1)
    torch.testing.assert_close(wider(shown), network(state))
    network(state).sum().backward()
    assert all(parameter.grad is None for parameter in network.knowing(more).parameters())  # a copy


@pytest.mark.parametrize("what", ["position", "wall", "door", "item", "category"])
def test_the_geometry_networks_values_change_with_every_part_of_the_state(what):
    def state(changed: str = "") -> torch.Tensor:
        shift = 0.02 * (changed == "wall"), 0.02 * (changed == "door"), 0.02 * (changed == "item")
        room = rectangular_room(
            item=Item("bed", (1, 1), (2, 1.5)),
            others=(Item("lamp" if changed == "category" else "chair", (0.5, 0.5), (3 + shift[2], 2)),),
            openings=(Opening("door", rectangle(1 + shift[1], -0.2, 2 + shift[1], 0)),),
            walls=(rectangle(4 - shift[0], 0, 4.2, 3), rectangle(-0.2, 0, 0, 3)),
        )
        return observed([room], [(1.02 if changed == "position" else 1.0, 1.2)], ["bed", "chair", "lamp"])

    network = seeded(lambda: GeometryNetwork(len(COLUMNS) + 3, 4))
    assert (network(state(what)) - network(state())).abs().max() > 1e-6


BORDER, ITEMS = range(2)


def clearances(room: Room, position: tuple[float, float], what: int) -> list[float]:
    """How far the item can go right, left, below, up before it meets the border, or an item."""
    moving, others = observed([room], [position]).movedim(-1, 0).tensor_split([1], -1)
    gap = _gaps(moving, others)
    return _clearances(gap, *told(gap, others))[what][:, 0].tolist()


def told(gap: torch.Tensor, others: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Which elements are borders and which items (B, N), and whether each is furthest in a direction (4, B, N)."""
    return _is_border(others), _is_item(others), gap == gap.amax(0)


@pytest.mark.parametrize("item", [Item("bed", (1.0, 0.6), (2, 1.5)), Item("bed", (0.6, 1.0), (2, 1.5), 90)])
def test_clearances_in_a_rectangular_room_are_the_distances_of_the_sides_to_the_walls(item):
    room = rectangular_room(4, 3, item)
    assert clearances(room, (1.2, 1.1), BORDER) == pytest.approx([2.3, 0.7, 0.8, 1.6], abs=1e-5)
    assert clearances(room, (3.6, 1.1), BORDER)[:2] == pytest.approx([-0.1, 3.1], abs=1e-5)  # in the right wall


def test_clearances_of_a_circle_and_of_a_turned_square_are_those_of_the_box_around_them():
    circle = rectangular_room(4, 3, Item("bed", (1.0, 1.0), (2, 1.5), form="circle"))
    assert clearances(circle, (1.2, 1.1), BORDER) == pytest.approx([2.3, 0.7, 0.6, 1.4], abs=1e-3)
    turned = rectangular_room(4, 3, Item("bed", (1.0, 0.4), (2, 1.5), 30))
    half_x = (np.cos(np.pi / 6) + 0.4 * np.sin(np.pi / 6)) / 2
    half_y = (np.sin(np.pi / 6) + 0.4 * np.cos(np.pi / 6)) / 2
    right = [2.8 - half_x, 1.2 - half_x, 1.1 - half_y, 1.9 - half_y]
    assert clearances(turned, (1.2, 1.1), BORDER) == pytest.approx(right, abs=1e-4)


def test_a_clearance_ends_at_an_item_in_between_and_at_no_item_beside_the_way():
    room = rectangular_room(
        4,
        3,
        Item("bed", (1.0, 0.6), (1, 1)),
        others=(Item("chair", (0.4, 0.4), (2.5, 1.2)), Item("chair", (0.4, 0.4), (3.2, 1.0))),
    )
    assert clearances(room, (1.0, 1.0), ITEMS) == pytest.approx([0.8, FAR, FAR, FAR], abs=1e-5)
    assert clearances(room, (1.0, 2.4), ITEMS) == pytest.approx([FAR] * 4)
    assert clearances(room, (2.4, 2.4), ITEMS) == pytest.approx([FAR, FAR, 0.7, FAR], abs=1e-5)
    assert clearances(room, (3.4, 0.35), ITEMS) == pytest.approx([FAR, FAR, FAR, 0.15], abs=1e-5)
    assert clearances(room, (1.0, 1.0), BORDER) == pytest.approx([2.5, 0.5, 0.7, 1.7], abs=1e-5)


def test_a_door_and_a_window_bound_the_clearance_like_walls():
    room = rectangular_room(
        4,
        3,
        Item("bed", (0.6, 0.6), (2, 1)),
        openings=(Opening("door", rectangle(1, -0.2, 2, 0)), Opening("window", rectangle(4, 0.5, 4.2, 1.5))),
        walls=(rectangle(-0.2, 0, 0, 3), rectangle(0, 3, 4, 3.2)),
    )
    assert clearances(room, (1.5, 1.0), BORDER) == pytest.approx([2.2, 1.2, 0.7, 1.7], abs=1e-5)


@given(SEEDS)
def test_between_four_walls_slides_are_the_simulators(seed: int) -> None:
    rng = np.random.default_rng(seed)

    def item() -> Item:
        center = rng.integers((60, 60), (340, 240)) / 100
        return Item("bed", tuple(rng.integers(20, 120, 2) / 100), tuple(center), float(rng.choice([0, 90])))

    simulator = BatchSimulator(Simulator([rectangular_room(item=item(), others=(item(), item()))], Moves(), Reward()))
    observe = GeometryObservation(simulator.rooms, ["bed"])
    generator = torch.Generator().manual_seed(seed)
    episodes = Episodes(simulator, np.zeros(30, dtype=int), 10**6, generator)
    for _ in range(6):
        length, legal = (column[:, -4:] for column in simulator.reach(episodes.room, episodes.position))
        state = observe(episodes.room, episodes.position).movedim(-1, 0)
        moving, others = state.tensor_split([1], -1)
        gap = _gaps(moving, others)
        indoors = (
            _clearances(gap, *told(gap, others))[BORDER].amin(0) >= 0
        )  # from within a wall, other walls are none to stop at
        legal &= indoors[:, None]
        torch.testing.assert_close(_slides(gap, *told(gap, others)).T[legal], length[legal], atol=1e-4, rtol=0)
        episodes.step(explore(torch.zeros(30, dtype=torch.int64), episodes.legal, 1.0, generator))
