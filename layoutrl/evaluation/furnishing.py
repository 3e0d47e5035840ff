"""A trained agent furnishes whole rooms: item after item, each where its moves lead and their values are highest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import nn

from layoutrl.agents.method import Method
from layoutrl.env.geometry import snap
from layoutrl.env.rooms_simulator import State, rows
from layoutrl.env.scenes import QUARTERS
from layoutrl.evaluation.choosing import FAULT, blame, wrong, wrong_at
from layoutrl.evaluation.placing import STARTS, Placing, spread
from layoutrl.evaluation.policy import greedy
from layoutrl.evaluation.threads import one_thread
from layoutrl.rooms.brief import Pose, facings, lifted, missing, upright, with_poses
from layoutrl.rooms.furnished import Furnished, Placement
from layoutrl.rooms.room import Point, Room, rotation

SWEEPS = 1  # times that every item but the largest is lifted and placed again, among all others
REPAIRS = 1  # times more, in rooms in which something is wrong
AFRESH = 3  # times that a room is furnished anew, what was most wrong first, while something is wrong
ELSEWHERE = 2  # times then, with its largest item elsewhere, while a fault is left
Task = tuple[int, tuple[int, ...], tuple[int, ...]]  # a room, its items in turn, and the ids of layouts to differ from
WAYS = ("ahead", "back", "to its right", "to its left")  # the four directions, as the item is turned
BLOCK = 128  # rooms furnished at once: memory, not speed


class Furnisher:
    """Furnishes rooms as an agent of scope=room says, which knows these furniture categories.

    The largest item comes first. Of each, places are spread for every way that it can face; from those that the agent
    values highest it moves greedily, and it stays at the pose of the highest value by which nothing is wrong
    (`choosing`, geometry alone). Where there is none, it is put where one move more leads, or else at one of the
    places that were spread; what has no legal move anywhere is left out. What ends just before a wall or an item slides
    back to it, and what belongs at a wall slides sideways to a neighbour that is near. When all stand, each but the
    largest is lifted once more, and moved if another pose is better; and again where something is still wrong. Where
    that does not help, the room is furnished anew, what was most wrong first; and where a fault is left, with its
    largest item elsewhere.
    A room whose walls lean is furnished upright, since agents learn in upright ones, and turned back. The designer's
    layout is not known here. Nothing is left to chance: the same briefs always get the same layouts. (Beside others a
    brief's values are rounded otherwise, in the seventh digit.)
    """

    def __init__(self, network: nn.Module, method: Method, categories: Sequence[str]):
        self._policy = greedy(network, method)
        self._moves, self._categories = method.moves, list(categories)

    @one_thread()
    @torch.inference_mode()
    def furnish(self, briefs: Sequence[Room], choices: int, seed: int = 0) -> list[list[Furnished]]:  # noqa: ARG002
        """Of each brief up to so many different layouts; the seed is for who draws something.

        Those in which the fewest items have a fault come first, of these those in which the fewest are odd, and then
        the ones that were found first: there the largest item has the place that is valued highest. Raises InputError
        where an item fits in no way.
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
        """What the agent thinks of places of one item among what stands.

        Of centers (n, 2), `step` metres apart, the value (n,) of the best way to face there, and its degrees (n,).
        Raises InputError where it, or what else is still to be placed, fits into the room in no way.
        """
        placing, state, n, lean = self._one(room, item)
        x0, y0, x1, y1 = room.envelope.bounds
        grid = np.stack(np.meshgrid(np.arange(x0, x1, step) + step / 2, np.arange(y0, y1, step) + step / 2), -1)
        centers, turn = grid.reshape(-1, 2), rotation(lean)  # from the right, it turns points back
        value = np.full((4, len(centers)), -np.inf)
        for quarter in np.flatnonzero(placing.rooms.entry[0, n] >= 0):
            entry = np.repeat(placing.rooms.entry[0, n, quarter], len(centers))
            fits = placing.rooms.simulator.is_legal(entry, centers @ turn)
            here = centers[fits] @ turn
            scene = placing.scenes_of(state, np.zeros(1, int), np.array([quarter])).expand(len(here), -1)
            value[quarter, fits] = placing.best(scene, here)
        known = np.isfinite(value).any(0)
        return centers[known], value.max(0)[known], placing.rooms.degrees[0, n, value.argmax(0)][known] + lean

    @one_thread()
    @torch.inference_mode()
    def moves(self, room: Room, item: int) -> list[tuple[str, Point, float]]:
        """The legal moves of an item from where it stands, in words, where each leads in metres, and its value.

        The most valued first. Raises ValueError where the item stands nowhere, and InputError as `values` does.
        """
        center, degrees = room.furniture[item].center, room.furniture[item].rotation
        if center is None:
            raise ValueError(f"item {item} of room {room.id} stands nowhere: it has no moves")
        placing, state, _, lean = self._one(room, item, degrees)
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
        names = [f"{100 * s:g} cm {way}" for s in self._moves.lengths(placing.rooms.rooms[0]) for way in WAYS]
        names += [f"slide {way}" for way in WAYS]
        found = [(names[a], (x, y), q) for a, (x, y), q in zip(action.tolist(), reached, value, strict=True)]
        return sorted(found, key=lambda move: -move[2])

    def _one(self, room: Room, k: int, degrees: float | None = None) -> tuple[Placing, State[np.ndarray], int, float]:
        """A room in which item k is to be placed, facing one way where that is given, as the agent has it; which of
        what is to be placed that is; and by how many degrees the room leans."""
        furniture = list(lifted(room.furniture, [k]))
        furniture[k] = replace(furniture[k], rotation=degrees)
        brief = replace(room, furniture=tuple(furniture), target=None)
        brief, lean = upright(brief)
        placing = Placing([brief], self._policy, self._moves, self._categories)
        n = missing(brief).index(k)
        return placing, placing.rooms.empty(np.zeros(1, int))._replace(moving=np.array([n])), n, lean

    def _add_another(self, placing: Placing, known: list[list[Furnished]], made: dict[Task, Furnished | None]) -> None:
        """Add to the layouts of each brief one that is different from all of them, where there is one.

        What was made before of a room, in the same order and unlike the same others, is not made again.
        """
        best, least = dict[int, Furnished](), dict[int, int]()  # how wrong the best is
        latest = dict[int, np.ndarray]()  # how wrong what is in the layout that was found last

        def furnish(
            which: Sequence[int], rank: np.ndarray, others: Sequence[Sequence[Furnished]]
        ) -> dict[int, Furnished]:
            """Layouts of these rooms, different from the others; the best of a room is kept, the first of equals."""
            order = rank.argsort(1, kind="stable")  # `made` keeps the others, and so their ids are their own
            task = {b: (b, tuple(order[b].tolist()), tuple(map(id, others[b]))) for b in which}
            if new := [b for b in which if task[b] not in made]:
                layouts = self._furnished(placing, np.array(new), rank, others)
                made.update(zip((task[b] for b in new), layouts, strict=True))
            found = {b: layout for b in which if (layout := made[task[b]])}
            for b, layout in found.items():
                latest[b] = blame(layout.layout, placing.rooms.rooms[b])
                if b not in best or latest[b].sum() < least[b]:
                    best[b], least[b] = layout, latest[b].sum()
            return found

        rank = placing.rooms.sequence()
        found = furnish(range(len(known)), rank, known)
        for _ in range(AFRESH):
            if not (which := [b for b in found if least[b]]):
                break
            for b in which:
                rank[b, np.flatnonzero(latest[b] == latest[b].max())] -= rank.shape[1]
            found = furnish(which, rank, known)
        # Of further layouts the largest item is elsewhere anyhow.
        found, tried = {b: layout for b, layout in best.items() if not known[b]}, [list[Furnished]() for _ in known]
        for _ in range(ELSEWHERE):
            for b, layout in found.items():
                tried[b].append(layout)
            if not (which := [b for b in found if least[b] >= FAULT]):
                break
            found = furnish(which, placing.rooms.sequence(), tried)
        for b, layout in best.items():
            known[b].append(layout)

    def _furnished(
        self, placing: Placing, which: np.ndarray, rank: np.ndarray, known: Sequence[Sequence[Furnished]]
    ) -> list[Furnished | None]:
        """A layout of each of these rooms (R,), the items of each in the order of `rank` (rooms, N).

        Its largest item stands where it does in none of those that are known of the room; None where that is nowhere.
        Where none is known, an item without a place is left out.
        """
        rooms, paths, taken = placing.rooms, [list[Placement]() for _ in which], [list[int]() for _ in which]
        order, count = rank[which].argsort(1, kind="stable"), rooms.count[which]
        largest = rooms.sequence()[which].argmin(1)
        to_differ = np.array([bool(known[r]) for r in which])  # rooms in which the largest item is to stand elsewhere
        state = rooms.empty(which)

        def place(b: np.ndarray, item: np.ndarray, uniform: np.ndarray, others: Sequence[Sequence[Furnished]]) -> None:
            """Lift items (n,) of rooms b (n,), and put each where it is chosen to be."""
            now, every = rows(state, b)._replace(moving=item), np.arange(len(b))
            stood = now.stands[every, item]
            now.stands[every, item] = False
            chosen = placing.chosen(now, stood, uniform, others)
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
                # The largest item is lifted no more, or layouts would become alike. Where it is to stand elsewhere, it
                # looks in more places: apart, so that no room hangs on who is asked beside it.
                if not sweep and len(b := np.flatnonzero(moves & is_largest & to_differ)):
                    place(b, item[b], uniform, [known[r] for r in which[b]])
                    count[b[~state.stands[b, item[b]]]] = 0
                if len(b := np.flatnonzero(moves & ~(is_largest & (to_differ | (sweep > 0))))):
                    place(b, item[b], uniform, [()] * len(b))
        value = placing.mean_value(state)
        made = zip(value, paths, map(frozenset, taken), strict=True)
        return [Furnished(rooms.layout(state, r), *each) if count[r] else None for r, each in enumerate(made)]


def _turned_back(found: Furnished, brief: Room) -> Furnished:
    """A layout of the upright brief as one of the brief itself: what stood there stays as it was, exactly."""
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
