"""The replay of poses gives back what was stored: the last `capacity` transitions, exactly and uniformly."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutrl.agents.replay import Replay, Transitions
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import GeometryObservation, ImageObservation
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.room import Item
from tests.builders import l_room, rectangular_room


def numbered(first: int, count: int, actions: int = 6) -> Transitions:
    """`count` transitions that tell their number, from `first` on, in the reward and everywhere else."""
    number = np.arange(first, first + count)
    rng = np.random.default_rng(first)
    return Transitions(
        torch.as_tensor(number % 7),
        torch.as_tensor(np.stack([number, -number], 1) * 1e-6),
        torch.as_tensor(number % actions),
        torch.as_tensor(number.astype(float)),
        torch.as_tensor(number % 2 * 0.9),
        torch.as_tensor(np.stack([number + 0.5, number], 1)),
        torch.as_tensor(rng.random((count, actions)) < 0.5),
    )


def seeded(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def numbers(replay: Replay, draws: int = 2000) -> set[int]:
    return set(replay.sample(draws, seeded(0)).reward.int().tolist())


@pytest.mark.parametrize("observation", ["image", "geometry"])
def test_it_gives_what_a_replay_of_stored_pictures_would_give(observation):
    rooms = [
        rectangular_room(item=Item("bed", (1.3, 0.8), (2, 1.5), 20)),
        l_room(others=(Item("lamp", (0.4, 0.4), (3, 1), form="circle"),)),
    ]
    simulator = Simulator(rooms, Moves((0.3, 0.05)), Reward())
    geometry = GeometryObservation(rooms, categories_of(rooms))
    observe = ImageObservation(rooms) if observation == "image" else geometry
    rng = np.random.default_rng(0)
    capacity, naive = 20, []
    replay = Replay(capacity, simulator.moves.count)
    room = rng.integers(2, size=5)
    position = simulator.starts(room, rng)
    for _ in range(7):
        reached, legal = simulator.destinations(room, position)
        action = np.where(legal, rng.random(legal.shape), -1).argmax(1)
        next_position = reached[np.arange(5), action]
        next_legal = simulator.destinations(room, next_position)[1]
        columns = (room, position, action, rng.random(5), rng.random(5), next_position, next_legal)
        batch = Transitions(*map(torch.as_tensor, columns))
        replay.add(batch)
        pictures, next_pictures = observe(batch.room, batch.position), observe(batch.room, batch.next_position)
        for k in range(5):
            naive.append((pictures[k], action[k], batch.reward[k], batch.discount[k], next_pictures[k], next_legal[k]))
        position = next_position
    naive = naive[-capacity:]
    number = {float(row[2].float()): k for k, row in enumerate(naive)}  # rewards differ and so tell them apart
    drawn = replay.sample(64, seeded(1))
    before, after = observe(drawn.room, drawn.position), observe(drawn.room, drawn.next_position)
    for b in range(64):
        picture, action, reward, discount, next_picture, next_legal = naive[number[float(drawn.reward[b])]]
        assert torch.equal(before[b], picture)
        assert torch.equal(after[b], next_picture)
        assert int(drawn.action[b]) == action
        assert drawn.reward[b] == reward.float()
        assert drawn.discount[b] == discount.float()
        np.testing.assert_array_equal(drawn.next_legal[b].numpy(), next_legal)
    assert len(number) == capacity


@pytest.mark.parametrize("chunk", [1, 3, 8])
@pytest.mark.parametrize("stored", [5, 6, 7, 15, 16, 17, 31, 32, 33])
def test_it_holds_the_last_capacity_transitions_whatever_the_number_stored(stored, chunk):
    replay = Replay(16, 6)
    for first in range(0, stored, chunk):
        replay.add(numbered(first, min(chunk, stored - first)))
    assert replay.size == min(stored, 16)
    assert numbers(replay) == set(range(max(0, stored - 16), stored))


@given(st.integers(1, 9), st.lists(st.integers(0, 9), min_size=1, max_size=12))
@settings(max_examples=30)
def test_it_agrees_with_a_list_for_any_sequence_of_additions(capacity, counts):
    replay, stored = Replay(capacity, 6), 0
    for count in (min(count, capacity) for count in counts):
        replay.add(numbered(stored, count))
        stored += count
        assert replay.size == min(stored, capacity)
        if stored:
            assert numbers(replay, 300) == set(range(max(0, stored - capacity), stored))


def test_a_transition_stays_whole_when_the_memory_wraps_around():
    replay = Replay(8, 6)
    for first in range(0, 20, 5):
        replay.add(numbered(first, 5))
    drawn = replay.sample(100, seeded(0))
    for b in range(100):
        number = int(drawn.reward[b])
        right = numbered(number - number % 5, 5)
        for name in Transitions._fields:
            torch.testing.assert_close(
                getattr(drawn, name)[b].double(), getattr(right, name)[number % 5].double(), atol=1e-7, rtol=1e-6
            )


def test_shapes_and_types_are_as_documented():
    replay = Replay(8, 6)
    replay.add(numbered(0, 5))
    drawn = replay.sample(3, seeded(0))
    assert [tuple(c.shape) for c in drawn] == [(3,), (3, 2), (3,), (3,), (3,), (3, 2), (3, 6)]
    assert [c.dtype for c in drawn] == [
        torch.int64, torch.float64, torch.uint8, torch.float32, torch.float32, torch.float64, torch.bool
    ]  # fmt: skip


def test_unfilled_slots_are_never_drawn():
    replay = Replay(1000, 6)
    replay.add(numbered(100, 3))
    assert numbers(replay) == {100, 101, 102}


def test_every_stored_transition_is_as_likely_as_another():
    replay, draws = Replay(64, 6), 64_000
    for first in range(0, 96, 32):
        replay.add(numbered(first, 32))
    drawn = replay.sample(draws, seeded(3)).reward.int().numpy() - 32
    counts = np.bincount(drawn, minlength=64)
    chi_square = ((counts - draws / 64) ** 2 / (draws / 64)).sum()
    assert len(counts) == 64
    assert chi_square < 112  # 63 degrees of freedom: exceeded by one seed in ten thousand


def test_draws_hang_on_the_given_generator_alone():
    replay = Replay(64, 6)
    replay.add(numbered(0, 64))
    first, second, other = (replay.sample(32, seeded(seed)).reward for seed in (0, 0, 1))
    assert torch.equal(first, second)
    assert not torch.equal(first, other)
    generator = seeded(0)
    assert not torch.equal(replay.sample(32, generator).reward, replay.sample(32, generator).reward)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=15)
def test_positions_come_back_to_the_bit(seed):
    generator = seeded(seed)
    reference = Simulator([rectangular_room(9.7, 3.1), l_room()], Moves((0.37, 0.037)), Reward())
    simulator = BatchSimulator(reference)
    room = torch.randint(2, (20,), generator=generator)
    action = torch.randint(reference.moves.count, (20,), generator=generator)
    position = simulator.starts(room, generator)
    reached = simulator.moved(room, position, action, simulator.reach(room, position)[0][torch.arange(20), action])
    replay = Replay(20, reference.moves.count)
    legal = torch.ones(20, reference.moves.count)
    replay.add(Transitions(room, position, action, torch.arange(20.0), torch.zeros(20), reached, legal))
    drawn = replay.sample(100, generator)
    assert torch.equal(drawn.position, position[drawn.reward.long()])
    assert torch.equal(drawn.next_position, reached[drawn.reward.long()])


@pytest.mark.parametrize("actions", [1, 4, 16, 31])
def test_masks_of_legal_moves_come_back(actions):
    rng = np.random.default_rng(actions)
    legal = rng.random((200, actions)) < rng.random((200, 1))
    legal[0], legal[1] = True, False
    replay = Replay(200, actions)
    replay.add(numbered(0, 200, actions)._replace(next_legal=torch.as_tensor(legal)))
    drawn = replay.sample(1000, seeded(0))
    np.testing.assert_array_equal(drawn.next_legal.numpy(), legal[drawn.reward.long().numpy()])


def test_more_actions_than_bits_are_refused():
    with pytest.raises(ValueError, match="31"):
        Replay(8, 32)


def test_a_transition_takes_at_most_48_bytes():
    replay = Replay(1000, 31)
    assert replay.bytes_per_transition <= 48
    held = [t for t in vars(replay).values() if isinstance(t, torch.Tensor)] + list(replay._columns)
    assert sum(t.numel() * t.element_size() for t in held) <= 1000 * 48


def test_neither_what_was_stored_nor_what_was_drawn_is_shared():
    replay, stored = Replay(8, 6), numbered(0, 8)
    replay.add(stored)
    before = replay.sample(50, seeded(0))
    copies = [column.clone() for column in before]
    for column in (*stored, *before):
        column.zero_()
    after = replay.sample(50, seeded(0))
    assert all(torch.equal(a, b) for a, b in zip(after, copies, strict=True))


@pytest.mark.parametrize("stored", [3, 20])
def test_what_is_saved_takes_no_more_room_than_what_is_stored(stored):
    replay = Replay(20, 6)
    replay.add(numbered(0, stored))
    columns = replay.state_dict()["columns"]  # torch saves all that a view is a view of
    assert {len(column) for column in columns} == {stored}
    assert all(column.untyped_storage().nbytes() == column.nbytes for column in columns)


def test_nothing_stored_changes_nothing():
    replay = Replay(4, 6)
    replay.add(numbered(0, 3))
    replay.add(numbered(3, 0))
    assert replay.size == 3
    assert numbers(replay) == {0, 1, 2}


def test_more_than_it_holds_at_once_is_refused() -> None:
    with pytest.raises(ValueError, match="at most 10"):
        Replay(10, 4).add(Transitions(*(torch.zeros(11, *shape) for shape in ((), (2,), (), (), (), (2,), (4,)))))
