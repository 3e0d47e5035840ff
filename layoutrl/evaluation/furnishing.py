"""A trained agent furnishes whole rooms: item after item, each where its moves lead and their values are highest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from layoutrl.agents.dqn import DQN
from layoutrl.agents.method import Method
from layoutrl.env.faults import Items, item_faults
from layoutrl.env.geometry import snap
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_observation import RoomsObservation
from layoutrl.env.rooms_simulator import RoomsSimulator, State
from layoutrl.env.scenes import QUARTERS, Scenes, ScenesObservation
from layoutrl.env.simulator import Moves
from layoutrl.evaluation.protocols import greedy
from layoutrl.rooms.brief import missing
from layoutrl.rooms.furnished import Furnished, Pose
from layoutrl.rooms.room import Item, Point, Room

STARTS = 32  # places drawn for each way that an item can face, and valued
TRIED = 4  # of these, the most valued, from which the item moves
SWEEPS = 1  # times that every item is lifted and placed again, among all others
BETTER = 0.02  # of value: for no less is an item moved that stands
WAYS = ("ahead", "back", "to its right", "to its left")  # the four directions, as the item is turned
BLOCK = 128  # rooms furnished at once: memory, not speed
APART = 0.5  # metres: layouts are different whose largest item stands so far away, or faces another way


class Options(NamedTuple):
    """Of each of B items K poses at which it could stay."""

    center: np.ndarray  # (B, K, 2), metres
    quarter: np.ndarray  # (B, K)
    value: np.ndarray  # (B, K), -inf for none
    way: list[list[np.ndarray]]  # to each: centers (moves + 1, 2)


class Furnisher:
    """Furnishes rooms as an agent of scope=room says, which knows these furniture categories.

    The largest item comes first. Of each, places are drawn for every way that it can face; from those that the agent
    values highest it moves greedily, and it stays at the pose of the highest value. A pose by which something is
    wrong (`layoutrl.env.faults`, geometry alone) is taken only where there is none without. When all stand, each is
    lifted once more, and moved if another pose is better. The designer's layout is not known here.
    """

    def __init__(self, agent: DQN, method: Method, categories: Sequence[str]):
        self._policy = greedy(agent, method)
        self._moves, self._categories = method.moves, list(categories)

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        """Of each brief up to so many different layouts, the most valued first.

        What is drawn hangs on the seed alone, and not on what else is furnished. Raises InputError where an item fits
        in no way.
        """
        found = {k: [Furnished(brief, 0.0)] for k, brief in enumerate(briefs) if not missing(brief)}
        asked = [k for k in range(len(briefs)) if k not in found]
        for first in range(0, len(asked), BLOCK):
            block = asked[first : first + BLOCK]
            world = _World([briefs[k] for k in block], self._moves, self._categories, self._policy.device)
            layouts: list[list[Furnished]] = [[] for _ in block]
            for _ in range(choices):
                self._add_another(world, seed, layouts)
            for k, those in zip(block, layouts, strict=True):
                found[k] = sorted(those, key=lambda one: -one.value)
        return [found[k] for k in range(len(briefs))]

    def values(self, room: Room, item: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What the agent thinks of places of one item among what stands.

        Of centers (n, 2), `step` metres apart, the value (n,) of the best way to face there, and its degrees (n,).
        """
        world, state, n = self._one(replace(room.furniture[item], center=None, rotation=None), room, item)
        x0, y0, x1, y1 = room.envelope.bounds
        grid = np.stack(np.meshgrid(np.arange(x0, x1, step) + step / 2, np.arange(y0, y1, step) + step / 2), -1)
        centers = grid.reshape(-1, 2)
        value = np.full((4, len(centers)), -np.inf)
        for quarter in np.flatnonzero(world.rooms.entry[0, n] >= 0):
            fits = world.rooms.simulator.is_legal(np.repeat(world.rooms.entry[0, n, quarter], len(centers)), centers)
            here = centers[fits]
            only = np.zeros(len(here), dtype=int)
            value[quarter, fits] = self._value(world, state, only, only + quarter, here)
        known = np.isfinite(value).any(0)
        return centers[known], value.max(0)[known], world.rooms.degrees[0, n, value.argmax(0)][known]

    def moves(self, room: Room, item: int) -> list[tuple[str, Point, float]]:
        """The legal moves of an item from where it stands, in words, where each leads in metres, and its value.

        The most valued first.
        """
        center = room.furniture[item].center
        assert center is not None
        world, state, _ = self._one(replace(room.furniture[item], center=None), room, item)
        scene = world.scenes_of(state, np.zeros(1, int), np.zeros(1, int))
        here = snap(torch.tensor([center], dtype=torch.float64, device=scene.device))
        length, legal = world.scenes.reach(scene, here)
        action = legal[0].nonzero()[:, 0]
        if not len(action):
            return []
        every = scene.expand(len(action), -1), here.expand(len(action), -1)
        reached = world.scenes.moved(*every, action, length[0, action]).tolist()
        value = self._policy.values(world.observe, scene, here)[0, action].tolist()
        names = [f"{100 * s:g} cm {way}" for s in self._moves.lengths(room) for way in WAYS]
        names += [f"slide {way}" for way in WAYS]
        found = [(names[a], (x, y), q) for a, (x, y), q in zip(action.tolist(), reached, value, strict=True)]
        return sorted(found, key=lambda move: -move[2])

    def _one(self, item: Item, room: Room, k: int) -> tuple[_World, State[np.ndarray], int]:
        """A room in which item k is to be placed, as the agent has it, and which of what is to be placed that is."""
        brief = replace(room, furniture=(*room.furniture[:k], item, *room.furniture[k + 1 :]), target=None)
        world = _World([brief], self._moves, self._categories, self._policy.device)
        n = missing(brief).index(k)
        return world, world.rooms.empty(np.zeros(1, int))._replace(moving=np.array([n])), n

    def _add_another(self, world: _World, seed: int, known: list[list[Furnished]]) -> None:
        """Add to the layouts of each brief one that is different from all of them, where there is one."""
        rooms, paths = world.rooms, [list[Pose]() for _ in known]
        order, count = rooms.sequence().argsort(1, kind="stable"), rooms.count.copy()
        state = rooms.empty(np.arange(len(known)))
        # The first item is not lifted again: it is what makes layouts different.
        sweeps = [(sweep, step) for sweep in range(1 + SWEEPS) for step in range(sweep > 0, order.shape[1])]
        for sweep, step in sweeps:
            which = np.flatnonzero(count > step)
            if not len(which):
                continue
            first = (sweep, step) == (0, 0)
            uniform = np.random.default_rng([seed, sweep, step]).random((3, QUARTERS * STARTS))
            item, every = order[which, step], np.arange(len(which))
            now = State(*(values[which] for values in state))._replace(moving=item)
            stands = now.stands[every, item]
            now.stands[every, item] = False
            options = self._options(world, now, uniform, first and any(known))
            if first:
                options = _others(rooms, now, options, [known[b] for b in which])
                count[which[np.isneginf(options.value).all(1)]] = 0
            elif stands.any():
                options = self._or_stay(world, now, stands, options)
            best = _best(rooms, now, options)
            new = rooms.put(now, item, options.center[every, best], options.quarter[every, best])
            for values, those in zip(state, new, strict=True):
                values[which] = those
            for n, b in enumerate(which):
                k, degrees = missing(rooms.rooms[b])[item[n]], rooms.item(state, b, item[n]).degrees
                paths[b] += [(k, (float(x), float(y)), degrees) for x, y in options.way[n][best[n]]]
        value = self._mean_value(world, state)
        for b in np.flatnonzero(count):
            known[b].append(Furnished(rooms.layout(state, b), value[b], paths[b]))

    def _options(self, world: _World, state: State[np.ndarray], uniform: np.ndarray, all_ways: bool) -> Options:
        """Poses of the moving items, which do not stand, among what does: the best, or the best of each way to face.

        They start from where random numbers (3, QUARTERS * STARTS) say, in every room from the same.
        """
        scenes, policy, batch = world.scenes, self._policy, len(state.room)
        b, quarter = np.nonzero(world.rooms.entry[state.room, state.moving] >= 0)
        scene = world.scenes_of(state, b, quarter).repeat_interleave(STARTS, 0)
        column = (quarter[:, None] * STARTS + np.arange(STARTS)).ravel()
        start = scenes.starts_at(scene, torch.as_tensor(uniform[:, column], device=scene.device))
        value = np.full((batch, QUARTERS * STARTS), -np.inf)
        value[b.repeat(STARTS), column] = policy.best_value(scenes, world.observe, scene, start).cpu().numpy()
        index = np.zeros(value.shape, dtype=int)
        index[b.repeat(STARTS), column] = np.arange(len(column))
        parts = np.split(np.arange(value.shape[1]), QUARTERS) if all_ways else [np.arange(value.shape[1])]
        best = [part[np.argsort(-value[:, part], 1, kind="stable")[:, :TRIED]] for part in parts]
        tried = np.take_along_axis(index, np.concatenate(best, 1), 1).ravel()
        count = TRIED * len(parts)
        scene, start = scene[tried], start[tried]
        run = policy.rollout(scenes, world.observe, scene, start.cpu().numpy())
        there = torch.as_tensor(run.final, device=scene.device)
        reached = policy.best_value(scenes, world.observe, scene, there).cpu().numpy()
        ways = [run.path[: moves + 1, n] for n, moves in enumerate(run.moves)]
        # A way that does not fit has no start: another item's stands in for it, and counts for nothing.
        started = np.take_along_axis(value, np.concatenate(best, 1), 1).ravel() > -np.inf
        return Options(
            run.final.reshape(batch, count, 2),
            scenes.quarter(scene).cpu().numpy().reshape(batch, count),
            np.where(started, reached, -np.inf).reshape(batch, count),
            [ways[n : n + count] for n in range(0, len(ways), count)],
        )

    def _or_stay(self, world: _World, state: State[np.ndarray], stood: np.ndarray, options: Options) -> Options:
        """The options, and of items that `stood` (B,) the poses at which they are, as if they were BETTER."""
        every = np.arange(len(stood))
        center, quarter = state.center[every, state.moving], state.quarter[every, state.moving]
        value = np.where(stood, self._value(world, state, every, quarter, center) + BETTER, -np.inf)
        nowhere = np.empty((0, 2))
        return Options(
            np.concatenate([center[:, None], options.center], 1),
            np.column_stack([quarter, options.quarter]),
            np.column_stack([value, options.value]),
            [[nowhere, *ways] for ways in options.way],
        )

    def _mean_value(self, world: _World, state: State[np.ndarray]) -> np.ndarray:
        """What the agent thinks of layouts, (rooms,)."""
        b, item = np.nonzero(state.stands)
        those = State(*(values[b] for values in state))._replace(moving=item)
        value = self._value(world, those, np.arange(len(b)), state.quarter[b, item], state.center[b, item])
        return np.bincount(b, value, len(state.room)) / np.maximum(np.bincount(b, minlength=len(state.room)), 1)

    def _value(
        self, world: _World, state: State[np.ndarray], b: np.ndarray, quarter: np.ndarray, center: np.ndarray
    ) -> np.ndarray:
        """Of poses (n,) of the moving items of states b (n,)."""
        place = torch.as_tensor(center, device=world.scenes.device)
        scene = world.scenes_of(state, b, quarter)
        return self._policy.best_value(world.scenes, world.observe, scene, place).cpu().numpy()


class _World:
    """Briefs as the agent has them: on the host to choose in, as tensors to move in."""

    def __init__(self, briefs: Sequence[Room], moves: Moves, categories: Sequence[str], device: torch.device):
        self.rooms = RoomsSimulator(briefs, None, moves, Reward())
        self.scenes = Scenes(BatchRoomsSimulator(self.rooms, device))
        self.observe = ScenesObservation(self.scenes, RoomsObservation(self.rooms, categories, device))

    def scenes_of(self, state: State[np.ndarray], b: np.ndarray, quarter: np.ndarray) -> Tensor:
        """The scenes in which the moving items of states b (n,) are turned by quarters (n,)."""
        turned = State(*(torch.as_tensor(values[b], device=self.scenes.device) for values in state))
        quarters = torch.as_tensor(quarter, device=self.scenes.device)[:, None]
        return self.scenes.of(turned._replace(quarter=turned.quarter.scatter(1, turned.moving[:, None], quarters)))


def _best(rooms: RoomsSimulator, state: State[np.ndarray], options: Options) -> np.ndarray:
    """Of each item (B,) the option of the highest value by which nothing is wrong that was not before, or the least."""
    every = np.arange(len(state.room))
    before = wrong([rooms.layout(state, b) for b in every])
    order = np.argsort(-options.value, 1, kind="stable")
    best, fewest = order[:, 0].copy(), np.full(len(every), np.iinfo(int).max)
    for option in order.T:
        b = np.flatnonzero((fewest > before) & np.isfinite(options.value[every, option]))
        if not len(b):
            break
        k = option[b]
        there = rooms.put(
            State(*(values[b] for values in state)), state.moving[b], options.center[b, k], options.quarter[b, k]
        )
        found = wrong([rooms.layout(there, n) for n in range(len(b))])
        better = found < fewest[b]
        best[b[better]], fewest[b[better]] = k[better], found[better]
    return best


def wrong(layouts: Sequence[Room]) -> np.ndarray:
    """With how many of the items that stand something is wrong, in each layout: (B,)."""
    standing = [
        replace(room, furniture=tuple(item for item in room.furniture if item.center), target=None) for room in layouts
    ]
    items = Items.of(standing)
    found, _, _ = item_faults(standing, items)
    return np.bincount(items.room, np.any(list(found.values()), axis=0), len(layouts)).astype(int)


def _others(
    rooms: RoomsSimulator, state: State[np.ndarray], options: Options, known: Sequence[Sequence[Furnished]]
) -> Options:
    """The options without those of layouts that are known already."""
    value = options.value.copy()
    for b, layouts in enumerate(known):
        room, n = int(state.room[b]), int(state.moving[b])
        for layout in layouts:
            stands = layout.layout.furniture[missing(rooms.rooms[room])[n]]
            assert stands.center is not None
            near = np.linalg.norm(options.center[b] - stands.center, axis=1) < APART
            value[b, near & (rooms.degrees[room, n, options.quarter[b]] == stands.rotation)] = -np.inf
    return options._replace(value=value)
