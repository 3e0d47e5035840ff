"""A trained agent furnishes whole rooms: item after item, each where its moves lead and their values are highest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch

from layoutrl.agents.learner import Agent
from layoutrl.env.geometry import snap
from layoutrl.env.rooms_simulator import QUARTERS, State, rows
from layoutrl.evaluation.choosing import FAULT, blame, wrong, wrong_at
from layoutrl.evaluation.placing import STARTS, Placing, spread
from layoutrl.evaluation.policy import greedy
from layoutrl.evaluation.threads import one_thread
from layoutrl.rooms.brief import Pose, facings, missing, upright, with_poses, without_poses
from layoutrl.rooms.furnished import Furnished, Placement
from layoutrl.rooms.room import Point, Room, rotation

SNAP = 0.03  # metres, in place of `method.snap`: values are too imprecise for tables to end in line with anything
SWEEPS = 1  # times that every item but the largest is lifted and placed again, among all others
REPAIRS = 1  # further such sweeps, in rooms in which something is wrong
AFRESH = 3  # times that a room is furnished anew, its most wrong items first, while something is wrong
ALONG_WALLS = 3  # further times, from the usual order again, with places along walls to fall back on
ELSEWHERE = 2  # further times, with its largest item elsewhere, while a fault is left
# A room, the order of its items, the ids of layouts to differ from, and whether places along walls are tried.
Task = tuple[int, tuple[int, ...], tuple[int, ...], bool]
DIRECTION_NAMES = ("ahead", "back", "to its right", "to its left")  # the four directions, as seen from the item
BLOCK = 128  # rooms furnished at once, for the sake of memory, not speed


class Furnisher:
    """Furnishes rooms with an agent of scope=room.

    Items are placed one after another, the largest first. For each, start places are spread over the room in every
    facing; from those that the agent values highest the item moves greedily, and it stays at the pose of highest value
    at which nothing is wrong (`choosing`, geometry alone). If there is none, the places one move further are tried, and
    then the start places. An item that has no legal move anywhere is left out. An item whose back ends just before a
    wall or another item slides back to it, and one that belongs at a wall slides sideways to a neighbour that is near.
    Once all stand, each but the largest is lifted once more, and moved if another pose is better; and again where
    something is still wrong. If that does not help, the room is furnished anew, its most wrong items first; then
    with places along walls to fall back on; and if a fault is left, with its largest item elsewhere.

    A room whose walls lean is furnished upright, since agents learn in upright ones, and turned back. The designer's
    layout is not known here. Nothing is random: the same briefs always get the same layouts. (Among other briefs the
    values of a brief are rounded differently, in the seventh digit.)
    """

    def __init__(self, agent: Agent):
        self._policy = greedy(agent.network, replace(agent.method, snap=SNAP))
        self._moves, self._categories = agent.method.moves, list(agent.categories)

    @one_thread()
    @torch.inference_mode()
    def furnish(self, briefs: Sequence[Room], choices: int, seed: int = 0) -> list[list[Furnished]]:  # noqa: ARG002
        """Return up to `choices` different layouts of each brief, and at least one; the seed is not used.

        Those with the fewest items that have a fault or no place come first, of these those with the fewest odd items,
        and then those that were found first: there the largest item has the place that is valued highest. Raises
        InputError if an item does not fit into its room in any facing.
        """
        found = {k: [Furnished(brief, 0.0)] for k, brief in enumerate(briefs) if not missing(brief)}
        asked = [k for k in range(len(briefs)) if k not in found]
        for first in range(0, len(asked), BLOCK):
            block = asked[first : first + BLOCK]
            turned = [upright(briefs[k])[0] for k in block]
            placing = Placing(turned, self._policy, self._moves, self._categories)
            layouts: list[list[Furnished]] = [[] for _ in block]
            made = dict[Task, Furnished | None]()
            for _ in range(choices):
                self._add_another(placing, layouts, made)
            for k, those in zip(block, layouts, strict=True):
                unplaced = np.array([len(missing(one.layout)) for one in those])
                in_order = np.argsort(wrong([one.layout for one in those]) + FAULT * unplaced, kind="stable")
                found[k] = [_turned_back(those[n], briefs[k]) for n in in_order]
        return [found[k] for k in range(len(briefs))]

    @one_thread()
    @torch.inference_mode()
    def values(self, room: Room, item: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return how the agent values places of one item among what stands: centers, values, degrees.

        Centers (n, 2) are on a grid with `step` metres between them, where the item fits and has a legal move. Values
        (n,) are those of the best facing there, and degrees (n,) that facing. Raises InputError if the item, or another
        that is still to be placed, does not fit into the room in any facing.
        """
        placing, state, n, lean = self._placing_of_item(room, item)
        x0, y0, x1, y1 = room.envelope.bounds
        grid = np.stack(np.meshgrid(np.arange(x0, x1, step) + step / 2, np.arange(y0, y1, step) + step / 2), -1)
        centers, turn = grid.reshape(-1, 2), rotation(lean)  # from the right, it turns points back
        value = np.full((QUARTERS, len(centers)), -np.inf)
        for quarter in np.flatnonzero(placing.rooms.room_index[0, n] >= 0):
            room_index = np.repeat(placing.rooms.room_index[0, n, quarter], len(centers))
            fits = placing.rooms.one_item.is_legal(room_index, centers @ turn)
            here = centers[fits] @ turn
            scene = placing.scenes_of(state, np.zeros(1, int), np.array([quarter])).expand(len(here), -1)
            value[quarter, fits] = placing.best_values(scene, here)
        known = np.isfinite(value).any(0)
        return centers[known], value.max(0)[known], placing.rooms.degrees[0, n, value.argmax(0)][known] + lean

    @one_thread()
    @torch.inference_mode()
    def moves(self, room: Room, item: int) -> list[tuple[str, Point, float]]:
        """Return the legal moves of an item from where it stands: name, center it leads to in metres, and value.

        Moves of higher value come first. Raises ValueError if the item stands nowhere, and InputError as `values` does.
        """
        center, degrees = room.furniture[item].center, room.furniture[item].rotation
        if center is None:
            raise ValueError(f"item {item} of room {room.id} stands nowhere: it has no moves")
        placing, state, _, lean = self._placing_of_item(room, item, degrees)
        turn = rotation(lean)
        scene = placing.scenes_of(state, np.zeros(1, int), np.zeros(1, int))
        here = snap(torch.tensor(np.array([center]) @ turn, dtype=torch.float64, device=scene.device))
        length, legal = placing.scenes.reach(scene, here)
        action = legal[0].nonzero()[:, 0]
        if not len(action):
            return []
        every = scene.expand(len(action), -1), here.expand(len(action), -1)
        reached = (placing.scenes.moved(*every, action, length[0, action]).cpu().numpy() @ turn.T).tolist()
        value = self._policy.q(placing.observe, scene, here)[0, action].tolist()
        lengths = self._moves.lengths(placing.rooms.rooms[0])
        names = [f"{100 * s:g} cm {direction}" for s in lengths for direction in DIRECTION_NAMES]
        names += [f"slide {direction}" for direction in DIRECTION_NAMES]
        found = [(names[a], (x, y), q) for a, (x, y), q in zip(action.tolist(), reached, value, strict=True)]
        return sorted(found, key=lambda move: -move[2])

    def _placing_of_item(
        self, room: Room, k: int, degrees: float | None = None
    ) -> tuple[Placing, State[np.ndarray], int, float]:
        """Prepare a room in which item k is to be placed, at a rotation of `degrees` if given.

        Returns the upright room as a `Placing`, its state with item k moving, the index of that item among those to
        place, and by how many degrees the room leans.
        """
        furniture = list(without_poses(room.furniture, [k]))
        furniture[k] = replace(furniture[k], rotation=degrees)
        brief = replace(room, furniture=tuple(furniture), target=None)
        brief, lean = upright(brief)
        placing = Placing([brief], self._policy, self._moves, self._categories)
        n = missing(brief).index(k)
        return placing, placing.rooms.empty(np.zeros(1, int))._replace(moving=np.array([n])), n, lean

    def _add_another(self, placing: Placing, known: list[list[Furnished]], made: dict[Task, Furnished | None]) -> None:
        """Add to the known layouts of each brief one that differs from all of them, where one is found.

        A layout of the same room, order of items and layouts to differ from is taken from `made`, not made again.
        """
        best, least = dict[int, Furnished](), dict[int, int]()  # the best layout of a room, and how wrong it is
        latest = dict[int, np.ndarray]()  # how wrong each item is in the layout that was found last

        def furnish(
            which: Sequence[int], rank: np.ndarray, others: Sequence[Sequence[Furnished]], walls: bool
        ) -> dict[int, Furnished]:
            """Return layouts of these rooms that differ from the others; keep a room's best, of equals the first."""
            order = rank.argsort(1, kind="stable")  # `made` keeps the others alive, so their ids stay unique
            task = {b: (b, tuple(order[b].tolist()), tuple(map(id, others[b])), walls) for b in which}
            if new := [b for b in which if task[b] not in made]:
                layouts = self._furnished(placing, np.array(new), rank, others, walls)
                made.update(zip((task[b] for b in new), layouts, strict=True))
            found = {b: layout for b in which if (layout := made[task[b]])}
            for b, layout in found.items():
                latest[b] = blame(layout.layout, placing.rooms.rooms[b])
                if b not in best or latest[b].sum() < least[b]:
                    best[b], least[b] = layout, latest[b].sum()
            return found

        which = list(range(len(known)))
        for walls, times in ((False, 1 + AFRESH), (True, ALONG_WALLS)):
            rank = placing.rooms.size_rank()
            for _ in range(times):
                found = furnish(which, rank, known, walls)
                which = [b for b in found if least[b]]
                for b in which:
                    rank[b, np.flatnonzero(latest[b] == latest[b].max())] -= rank.shape[1]
            which = [b for b in best if least[b]]
        # In further layouts the largest item stands elsewhere anyway.
        found, tried = {b: layout for b, layout in best.items() if not known[b]}, [list[Furnished]() for _ in known]
        for _ in range(ELSEWHERE):
            for b, layout in found.items():
                tried[b].append(layout)
            if not (which := [b for b in found if least[b] >= FAULT]):
                break
            found = furnish(which, placing.rooms.size_rank(), tried, walls=True)
        for b, layout in best.items():
            known[b].append(layout)

    def _furnished(
        self,
        placing: Placing,
        which: np.ndarray,
        rank: np.ndarray,
        known: Sequence[Sequence[Furnished]],
        walls: bool = False,
    ) -> list[Furnished | None]:
        """Return a layout of each of these rooms (R,), its items placed in the order of `rank` (rooms, N).

        Its largest item stands elsewhere than in every `known` layout of the room; the layout is None if there is no
        such place. Any other item without a place is left out, and where no layout is known the largest, too.
        """
        rooms, paths, taken = placing.rooms, [list[Placement]() for _ in which], [list[int]() for _ in which]
        order, count = rank[which].argsort(1, kind="stable"), rooms.count[which]
        largest = rooms.size_rank()[which].argmin(1)
        to_differ = np.array([bool(known[r]) for r in which])  # rooms in which the largest item is to stand elsewhere
        state = rooms.empty(which)

        def place(b: np.ndarray, item: np.ndarray, uniform: np.ndarray, others: Sequence[Sequence[Furnished]]) -> None:
            """Lift items (n,) of rooms b (n,), and put each where it is chosen to be."""
            now, every = rows(state, b)._replace(moving=item), np.arange(len(b))
            stood = now.stands[every, item]
            now.stands[every, item] = False
            chosen = placing.chosen(now, stood, uniform, others, walls)
            found = np.isfinite(chosen.value)
            put = rooms.put(rows(now, found), item[found], chosen.center[found], chosen.quarter[found])
            for values, those in zip(state, put, strict=True):
                values[b[found]] = those
            for n, r in zip(np.flatnonzero(found), b[found], strict=True):
                k, degrees = missing(rooms.rooms[which[r]])[item[n]], rooms.item(state, r, item[n]).degrees
                taken[r].append(len(paths[r]))
                paths[r] += [(k, (float(x), float(y)), degrees) for x, y in chosen.way[n]]

        for sweep in range(1 + SWEEPS + REPAIRS):
            uniform = spread(sweep * QUARTERS * STARTS, QUARTERS * STARTS)  # each sweep looks elsewhere
            goes_on = count > 0
            if sweep > SWEEPS:
                goes_on &= wrong_at(rooms, state) > 0
            for step in range(order.shape[1]):
                item, moves = order[:, step], goes_on & (step < count)
                is_largest = item == largest
                # The largest item is not lifted again, or layouts would become alike. Where it is to stand elsewhere,
                # it moves from more starts: in a call of its own, so that no room depends on others in the block.
                if not sweep and len(b := np.flatnonzero(moves & is_largest & to_differ)):
                    place(b, item[b], uniform, [known[r] for r in which[b]])
                    count[b[~state.stands[b, item[b]]]] = 0
                if len(b := np.flatnonzero(moves & ~(is_largest & (to_differ | (sweep > 0))))):
                    place(b, item[b], uniform, [()] * len(b))
        value = placing.mean_value(state)
        made = zip(value, paths, map(frozenset, taken), strict=True)
        return [Furnished(rooms.layout(state, r), *each) if count[r] else None for r, each in enumerate(made)]


def _turned_back(found: Furnished, brief: Room) -> Furnished:
    """Turn a layout of the upright brief back into one of the brief. What stood there keeps its pose exactly."""
    lean, *_ = facings(brief)
    if not lean:
        return found
    turn = rotation(lean)

    def back(k: int, center: Point, degrees: float) -> Pose:
        x, y = (turn @ center).tolist()
        given = brief.furniture[k].rotation
        return (x, y), (degrees + lean) % 360 if given is None else given

    path = [(k, *back(k, center, degrees)) for k, center, degrees in found.path]
    items = found.layout.furniture
    poses = {k: back(k, center, items[k].degrees) for k in missing(brief) if (center := items[k].center)}
    return replace(found, layout=with_poses(brief, poses), path=path)
