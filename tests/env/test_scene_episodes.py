"""Rooms that are furnished in parallel: which item moves when, among what, and how it goes on."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
import torch

from layoutrl.env.episodes import Step
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_simulator import RoomsSimulator
from layoutrl.env.scene_episodes import LEAVE_SHARE, LEAVE_SHARE_FURNISHED, SceneEpisodes
from layoutrl.env.scenes import Scenes
from layoutrl.env.simulator import Moves
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import Item
from tests.builders import rectangular_room

MOST = 4  # moves of an item


@pytest.fixture(scope="module")
def simulator() -> RoomsSimulator:
    rooms = design_rooms("bedroom", "train", 0, 5).rooms
    return RoomsSimulator([brief_of(room) for room in rooms], rooms, Moves((0.32, 0.08)), Reward())


@pytest.fixture(scope="module")
def scenes(simulator: RoomsSimulator) -> Scenes:
    return Scenes(BatchRoomsSimulator(simulator))


def episodes(
    scenes: Scenes, simulator: RoomsSimulator, seed: int = 0, count: int = 30, near: float = 0.0, own: float = 1.0
) -> SceneEpisodes:
    generator = torch.Generator().manual_seed(seed)
    return SceneEpisodes(scenes, simulator, np.arange(count) % MOST, MOST, generator, near=near, own=own)


def played(running: SceneEpisodes, steps: int, epsilon: float, seed: int = 0) -> Iterator[Step]:
    """Steps of drawn legal moves, or of the first legal ones where nothing is drawn."""
    generator = torch.Generator().manual_seed(seed)
    for _ in range(steps):
        chance = torch.rand(len(running.room), generator=generator)
        drawn = torch.rand(running.legal.shape, generator=generator).masked_fill(~running.legal, -1).argmax(1)
        explores = chance < running.explore_at(epsilon)
        yield running.step(drawn.where(explores, running.legal.int().argmax(1)))


def test_a_step_tells_all_of_a_move_and_an_item_moves_as_often_as_it_may(scenes, simulator) -> None:
    running = episodes(scenes, simulator)
    age = np.arange(30) % MOST
    for _ in range(12):
        before, position = running.room, running.position
        length, _ = scenes.reach(before, position)
        (step,) = played(running, 1, 1.0)
        assert torch.equal(step.room, before)
        assert torch.equal(step.position, position)
        there = scenes.moved(before, position, step.action, length.gather(1, step.action[:, None])[:, 0])
        assert torch.equal(step.next_position, there)
        assert torch.equal(step.next_legal, scenes.reach(before, there)[1])
        assert step.legal.all()
        for one, other in zip(step.terms, scenes.reward(before, there), strict=True):
            assert torch.equal(one, other)
        age += 1
        assert step.ended.tolist() == np.flatnonzero(age == MOST).tolist()
        going_on = np.flatnonzero(age < MOST)
        assert torch.equal(running.room[going_on], before[going_on])
        assert torch.equal(running.position[going_on], there[going_on])
        age[age == MOST] = 0


def test_items_are_taken_until_all_stand_and_then_again_until_another_room_begins(scenes, simulator) -> None:
    running = episodes(scenes, simulator)
    count, began = torch.tensor(simulator.count), {True: [0, 0], False: [0, 0]}
    went_on = 0
    for step in played(running, 300, 1.0):
        if not len(step.ended):
            continue
        before = scenes.state(step.room[step.ended], step.next_position[step.ended])
        after = scenes.state(running.room[step.ended], running.position[step.ended])
        complete = before.stands.sum(1) == count[before.room]
        alone = (after.stands.sum(1) == 1) & (before.stands.sum(1) != 1)
        begins = alone | (after.room != before.room)
        goes_on = ~begins
        kept = after.stands.scatter(1, after.moving[:, None], False) | (before.stands & complete[:, None])
        assert ((kept == before.stands).all(1) | begins | (before.stands.sum(1) == 1)).all()
        waited = ~before.stands[torch.arange(len(before.room)), after.moving]
        assert (waited | complete | begins | (before.stands.sum(1) == 1)).all()
        for which in (True, False):
            rows = complete == which
            began[which][0] += int((begins & rows).sum())
            began[which][1] += int(rows.sum())
        room_index = scenes.simulator.room_index[after.room, after.moving, scenes.quarter(running.room[step.ended])]
        assert scenes.simulator.one_item.is_legal(room_index, running.position[step.ended]).all()
        went_on += int(goes_on.sum())
    assert went_on
    assert began[True][0] / began[True][1] == pytest.approx(LEAVE_SHARE_FURNISHED, abs=0.06)
    assert began[False][0] / began[False][1] == pytest.approx(LEAVE_SHARE, abs=0.06)  # at times the same room again


def test_items_begin_anywhere_or_near_the_designers_place(scenes, simulator) -> None:
    center, quarter = (torch.tensor(table) for table in simulator.designed())
    apart, turned = [], []
    for near in (0.0, 1.0):
        begun = episodes(scenes, simulator, count=500, near=near)
        room, item = begun.room[:, 0].long(), begun.room[:, 1].long()
        apart.append((begun.position - center[room, item]).norm(dim=1).median())
        turned.append((scenes.quarter(begun.room) == quarter[room, item]).double().mean())
    assert apart[1] < 0.9 < apart[0]
    assert turned[0] < 0.5
    assert turned[1] == 1


def test_near_starts_and_own_mistakes_have_the_shares_that_they_are_given(scenes, simulator) -> None:
    quarter = torch.tensor(simulator.designed()[1])
    turned = []
    for near in (0.0, 0.5):
        begun = episodes(scenes, simulator, count=4000, near=near)
        room, item = begun.room[:, 0].long(), begun.room[:, 1].long()
        turned.append((scenes.quarter(begun.room) == quarter[room, item]).double().mean().item())
    assert turned[1] == pytest.approx((1 + turned[0]) / 2, abs=0.05)
    for epsilon, share in ((0.0, 0.5), (0.5, 0.25)):  # of what begins, a share of the greedy share
        running = episodes(scenes, simulator, count=500, own=0.5)
        for _ in played(running, 150, epsilon):
            pass
        assert running._own.double().mean().item() == pytest.approx(share, abs=0.1)


def test_what_the_designer_turned_so_that_it_fits_no_way_along_the_walls_that_is_near_begins_as_it_fits() -> None:
    slanted = Item("bookcase", (0.3, 3.2), (1.6, 1.25), 45.0)  # along one side of the room alone it has a place
    room = rectangular_room(3.2, 2.5, slanted, walls=())
    simulator = RoomsSimulator([brief_of(room)], [room], Moves((0.32, 0.08)), Reward())
    scenes = Scenes(BatchRoomsSimulator(simulator))
    begun = episodes(scenes, simulator, count=20, near=1.0)
    assert scenes.is_legal(begun.room, begun.position).all()


@pytest.mark.parametrize("own", [False, True])
def test_what_stands_is_the_designers_or_where_the_agent_left_it(scenes, simulator, own: bool) -> None:
    running, epsilon = episodes(scenes, simulator), 0.0 if own else 1.0
    center, quarter = (torch.tensor(table) for table in simulator.designed())
    for _ in played(running, 150, epsilon):  # until the rooms that were begun before are done
        pass
    for step in played(running, 40, epsilon):
        if not len(step.ended):
            continue
        before = scenes.state(step.room[step.ended], step.next_position[step.ended])
        after = scenes.state(running.room[step.ended], running.position[step.ended])
        kept = after.stands.scatter(1, after.moving[:, None], False) & (after.room == before.room)[:, None]
        kept &= before.stands
        there, turned = (before.center, before.quarter) if own else (center[after.room], quarter[after.room])
        torch.testing.assert_close(after.center[kept], there[kept], rtol=0, atol=1e-6)
        assert torch.equal(after.quarter[kept], turned[kept])


def test_nothing_is_drawn_in_the_last_moves_of_an_item(scenes, simulator) -> None:
    running = episodes(scenes, simulator)
    assert running.explore_at(0.5).tolist() == [0.5 if k % MOST < 3 else 0.0 for k in range(30)]


def test_the_larger_an_item_the_sooner_it_is_taken(scenes, simulator) -> None:
    begun = episodes(scenes, simulator, count=2000).room
    room, item = begun[:, 0].long(), begun[:, 1].long()
    areas = [[item.area for item in items] for items in simulator.items]
    largest = np.array([np.argmax(areas[r]) == n for r, n in zip(room.tolist(), item.tolist(), strict=True)])
    smallest = np.array([np.argmin(areas[r]) == n for r, n in zip(room.tolist(), item.tolist(), strict=True)])
    assert largest.mean() > 0.4 > 0.15 > smallest.mean() > 0


def test_they_go_on_from_a_state_as_if_they_had_never_stopped(scenes, simulator) -> None:
    running, other = episodes(scenes, simulator), episodes(scenes, simulator, seed=5)
    list(played(running, 30, 0.5))
    other.load_state_dict(running.state_dict())
    for one, two in zip(played(running, 30, 0.5, seed=1), played(other, 30, 0.5, seed=1), strict=True):
        for a, b in zip([*one[:6], *one.terms], [*two[:6], *two.terms], strict=True):
            assert torch.equal(a, b)
