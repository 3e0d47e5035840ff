"""A trained agent furnishes whole rooms: item after item, each where its moves lead and their values are highest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from threading import RLock

import numpy as np
import torch
from torch import Tensor, nn

from layoutrl.agents.method import Method
from layoutrl.env.geometry import snap
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_observation import RoomsObservation
from layoutrl.env.rooms_simulator import RoomsSimulator, State, rows
from layoutrl.env.scenes import QUARTERS, Scenes, ScenesObservation, destinations
from layoutrl.env.simulator import TOUCHING, Moves
from layoutrl.evaluation.choosing import FAULT, Chosen, Options, best_of, blame, unlike, wrong, wrong_at
from layoutrl.evaluation.policy import greedy
from layoutrl.rooms.brief import Pose, facings, lifted, missing, upright, with_poses
from layoutrl.rooms.furnished import Furnished, Placement
from layoutrl.rooms.oddities import AT_A_WALL
from layoutrl.rooms.room import Point, Room, rotation

STARTS = 32  # places spread for each way that an item can face, and valued
TRIED = 4  # of these, the most valued, from which the item moves
SWEEPS = 1  # times that every item but the largest is lifted and placed again, among all others
REPAIRS = 1  # times more, in rooms in which something is wrong
AFRESH = 3  # times that a room is furnished anew, what was most wrong first, while something is wrong
ELSEWHERE = 2  # times then, with its largest item elsewhere, while a fault is left
GAP = 0.15  # metres: a narrower one behind an item is closed, and beside one that belongs at a wall
BETTER = 0.02  # of value: for no less is an item moved that stands
Task = tuple[int, tuple[int, ...], tuple[int, ...]]  # a room, its items in turn, and the ids of layouts to differ from
WAYS = ("ahead", "back", "to its right", "to its left")  # the four directions, as the item is turned
BACK, SIDEWAYS = (1,), (2, 3)  # of WAYS
BLOCK = 128  # rooms furnished at once: memory, not speed
ALONE = RLock()  # held by who furnishes
GOLDEN = 1.2207440846057596  # of three dimensions: multiples of its powers fill a cube evenly (Roberts 2018)


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch work on one core inside, and one caller at a time: how many it works on is the whole process's.

    Who furnishes makes many small operations. On an idle machine a second thread saves a tenth of their time; on a busy
    one, where threads wait for each other, they take up to sixty times as long.
    """
    with ALONE:
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(threads)


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
            world = _World(turned, self._moves, self._categories, self._policy.q.device)
            layouts: list[list[Furnished]] = [[] for _ in block]
            made = dict[Task, Furnished | None]()
            for _ in range(choices):
                self._add_another(world, layouts, made)
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
        world, state, n, lean = self._one(room, item)
        x0, y0, x1, y1 = room.envelope.bounds
        grid = np.stack(np.meshgrid(np.arange(x0, x1, step) + step / 2, np.arange(y0, y1, step) + step / 2), -1)
        centers, turn = grid.reshape(-1, 2), rotation(lean)  # from the right, it turns points back
        value = np.full((4, len(centers)), -np.inf)
        for quarter in np.flatnonzero(world.rooms.entry[0, n] >= 0):
            entry = np.repeat(world.rooms.entry[0, n, quarter], len(centers))
            fits = world.rooms.simulator.is_legal(entry, centers @ turn)
            here = centers[fits] @ turn
            only = np.zeros(len(here), dtype=int)
            value[quarter, fits] = self._value(world, state, only, only + quarter, here)
        known = np.isfinite(value).any(0)
        return centers[known], value.max(0)[known], world.rooms.degrees[0, n, value.argmax(0)][known] + lean

    @one_thread()
    @torch.inference_mode()
    def moves(self, room: Room, item: int) -> list[tuple[str, Point, float]]:
        """The legal moves of an item from where it stands, in words, where each leads in metres, and its value.

        The most valued first. Raises ValueError where the item stands nowhere, and InputError as `values` does.
        """
        center, degrees = room.furniture[item].center, room.furniture[item].rotation
        if center is None:
            raise ValueError(f"item {item} of room {room.id} stands nowhere: it has no moves")
        world, state, _, lean = self._one(room, item, degrees)
        turn = rotation(lean)
        scene = world.scenes_of(state, np.zeros(1, int), np.zeros(1, int))
        here = snap(torch.tensor(np.array([center]) @ turn, dtype=torch.float64, device=scene.device))
        length, legal = world.scenes.reach(scene, here)
        action = legal[0].nonzero()[:, 0]
        if not len(action):
            return []
        every = scene.expand(len(action), -1), here.expand(len(action), -1)
        reached = (world.scenes.moved(*every, action, length[0, action]).cpu().numpy() @ turn.T).tolist()
        value = self._policy.q(world.observe, scene, here)[0, action].tolist()
        names = [f"{100 * s:g} cm {way}" for s in self._moves.lengths(world.rooms.rooms[0]) for way in WAYS]
        names += [f"slide {way}" for way in WAYS]
        found = [(names[a], (x, y), q) for a, (x, y), q in zip(action.tolist(), reached, value, strict=True)]
        return sorted(found, key=lambda move: -move[2])

    def _one(self, room: Room, k: int, degrees: float | None = None) -> tuple[_World, State[np.ndarray], int, float]:
        """A room in which item k is to be placed, facing one way where that is given, as the agent has it; which of
        what is to be placed that is; and by how many degrees the room leans."""
        furniture = list(lifted(room.furniture, [k]))
        furniture[k] = replace(furniture[k], rotation=degrees)
        brief = replace(room, furniture=tuple(furniture), target=None)
        brief, lean = upright(brief)
        world = _World([brief], self._moves, self._categories, self._policy.q.device)
        n = missing(brief).index(k)
        return world, world.rooms.empty(np.zeros(1, int))._replace(moving=np.array([n])), n, lean

    def _add_another(self, world: _World, known: list[list[Furnished]], made: dict[Task, Furnished | None]) -> None:
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
                layouts = self._furnished(world, np.array(new), rank, others)
                made.update(zip((task[b] for b in new), layouts, strict=True))
            found = {b: layout for b in which if (layout := made[task[b]])}
            for b, layout in found.items():
                latest[b] = blame(layout.layout, world.rooms.rooms[b])
                if b not in best or latest[b].sum() < least[b]:
                    best[b], least[b] = layout, latest[b].sum()
            return found

        rank = world.rooms.sequence()
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
            found = furnish(which, world.rooms.sequence(), tried)
        for b, layout in best.items():
            known[b].append(layout)

    def _furnished(
        self, world: _World, which: np.ndarray, rank: np.ndarray, known: Sequence[Sequence[Furnished]]
    ) -> list[Furnished | None]:
        """A layout of each of these rooms (R,), the items of each in the order of `rank` (rooms, N).

        Its largest item stands where it does in none of those that are known of the room; None where that is nowhere.
        Where none is known, an item without a place is left out.
        """
        rooms, paths, taken = world.rooms, [list[Placement]() for _ in which], [list[int]() for _ in which]
        order, count = rank[which].argsort(1, kind="stable"), rooms.count[which]
        largest = rooms.sequence()[which].argmin(1)
        to_differ = np.array([bool(known[r]) for r in which])  # rooms in which the largest item is to stand elsewhere
        state = rooms.empty(which)

        def place(b: np.ndarray, item: np.ndarray, uniform: np.ndarray, others: Sequence[Sequence[Furnished]]) -> None:
            """Lift items (n,) of rooms b (n,), and put each where it is chosen to be."""
            now, every = rows(state, b)._replace(moving=item), np.arange(len(b))
            stood = now.stands[every, item]
            now.stands[every, item] = False
            chosen = self._chosen(world, now, stood, uniform, others)
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
        value = self._mean_value(world, state)
        made = zip(value, paths, map(frozenset, taken), strict=True)
        return [Furnished(rooms.layout(state, r), *each) if count[r] else None for r, each in enumerate(made)]

    def _chosen(
        self,
        world: _World,
        state: State[np.ndarray],
        stood: np.ndarray,
        uniform: np.ndarray,
        known: Sequence[Sequence[Furnished]],
    ) -> Chosen:
        """Where each moving item, which does not stand, or `stood` (B,) there until now, is put among what does.

        It starts from where numbers (3, QUARTERS * STARTS) from 0 to 1 say, in every room from the same. It is put
        where it stands in none of the layouts that are `known`, of all rooms or of none.
        """
        before = wrong_at(world.rooms, state)
        starts = self._starts(world, state, uniform)
        ends = self._ends(world, state, starts, any(known))
        or_stay = self._or_stay(world, state, stood, ends) if stood.any() else ends
        chosen = best_of(world.rooms, state, before, unlike(world.rooms, state, or_stay, known))
        can_move = np.isfinite(starts.value).any(1)
        for beside in (True, False):
            b = np.flatnonzero((chosen.harm > 0) & can_move)
            if not len(b):
                break
            some = rows(state, b)
            options = self._beside(world, some, ends.of(b)) if beside else starts.of(b)
            options = unlike(world.rooms, some, options, [known[n] for n in b.tolist()])
            chosen = chosen.less_wrong(b, best_of(world.rooms, some, before[b], options))
        if not self._moves.slide:
            return chosen
        placed = np.flatnonzero(np.isfinite(chosen.value))
        items = (world.rooms.items[r][n] for r, n in zip(state.room[placed], state.moving[placed], strict=True))
        belongs_at_wall = np.array([item.category in AT_A_WALL for item in items], dtype=bool)
        backed = self._slid(world, state, before, chosen, placed, BACK)
        return self._slid(world, state, before, backed, placed[belongs_at_wall], SIDEWAYS)

    def _slid(
        self,
        world: _World,
        state: State[np.ndarray],
        before: np.ndarray,
        chosen: Chosen,
        b: np.ndarray,
        ways: Sequence[int],
    ) -> Chosen:
        """What is chosen, but items b (n,), which have a place, slid the nearest of the ways until they touch.

        They slide where that is not far, and nothing more is wrong by it. What touches already, on either of two ways,
        stays.

        Values are too imprecise for the last centimetres to a wall, or to the next in a line of cupboards.
        """
        if not len(b):
            return chosen
        scenes, those = world.scenes, chosen.of(b)
        scene = world.scenes_of(state, b, those.quarter)
        here = torch.as_tensor(those.center, device=scene.device)
        slides = self._moves.first_slide + torch.tensor(ways, device=scene.device)
        length, legal = (values[:, slides] for values in scenes.reach(scene, here))
        length, nearest = length.where(legal, torch.inf).min(1)
        near = length < GAP
        place = scenes.moved(scene, here, slides[nearest], length.where(near, 0.0))
        if ways == SIDEWAYS:  # slides lead to what is not touched yet: what is touched is met on the way back
            opposite = slides[1 - nearest][:, None]
            length_back, legal = (values.gather(1, opposite)[:, 0] for values in scenes.reach(scene, place))
            near &= ~(legal & (length_back < length + TOUCHING))
        goes = near.cpu().numpy()
        b, those, there = b[goes], those.of(goes), place.cpu().numpy()[goes]
        paths = [[np.concatenate([way, end[None]])] for way, end in zip(those.way, there, strict=True)]
        options = Options(there[:, None], those.quarter[:, None], those.value[:, None], paths)
        slid = best_of(world.rooms, rows(state, b), before[b], options)
        taken = slid.harm <= those.harm
        return chosen.replaced(b[taken], slid.of(taken))

    def _starts(self, world: _World, state: State[np.ndarray], uniform: np.ndarray) -> Options:
        """Places that numbers (3, QUARTERS * STARTS) stand for: STARTS for each way to face, one after another.

        Of a way in which the item does not fit, they are at 0, 0, and of no value.
        """
        b, quarter = np.nonzero(world.rooms.entry[state.room, state.moving] >= 0)
        scene = world.scenes_of(state, b, quarter).repeat_interleave(STARTS, 0)
        b, column = b.repeat(STARTS), (quarter[:, None] * STARTS + np.arange(STARTS)).ravel()
        start = world.scenes.starts_at(scene, torch.as_tensor(uniform[:, column], device=scene.device))
        value = np.full((len(state.room), QUARTERS * STARTS), -np.inf)
        center = np.zeros((*value.shape, 2))
        center[b, column] = start.cpu().numpy()
        value[b, column] = self._policy.q.best_moves(world.scenes, world.observe, scene, start)[1]
        quarters = np.tile(np.arange(QUARTERS).repeat(STARTS), (len(center), 1))
        return Options(center, quarters, value, [list(those[:, None]) for those in center])

    def _ends(self, world: _World, state: State[np.ndarray], starts: Options, all_ways: bool) -> Options:
        """Where items end that move from the TRIED best starts: of all, or of each way to face."""
        parts = np.split(np.arange(starts.value.shape[1]), QUARTERS) if all_ways else [np.arange(starts.value.shape[1])]
        best = [part[np.argsort(-starts.value[:, part], 1, kind="stable")[:, :TRIED]] for part in parts]
        tried = np.concatenate(best, 1)
        started = np.take_along_axis(starts.value, tried, 1) > -np.inf
        # A way that does not fit has no start: the best of all stands in for it, and counts for nothing.
        tried = np.where(started, tried, starts.value.argmax(1)[:, None])
        every = np.arange(len(tried))[:, None]
        center, quarter, value = (
            starts.center[every, tried],
            starts.quarter[every, tried],
            np.full(tried.shape, -np.inf),
        )
        ways = [[place[None] for place in places] for places in center]
        b, k = np.nonzero(started)
        scene = world.scenes_of(state, b, quarter[b, k])
        run = self._policy.rollout(world.scenes, world.observe, scene, center[b, k])
        center[b, k], value[b, k] = run.final, self._value(world, state, b, quarter[b, k], run.final)
        for n, (row, column) in enumerate(zip(b, k, strict=True)):
            ways[row][column] = run.way(n)
        return Options(center, quarter, value, ways)

    def _beside(self, world: _World, state: State[np.ndarray], ends: Options) -> Options:
        """Where one move more leads from the best of the ends."""
        scenes, every, best = world.scenes, np.arange(len(ends.value)), ends.value.argmax(1)
        quarter = ends.quarter[every, best]
        scene = world.scenes_of(state, every, quarter)
        here = torch.as_tensor(ends.center[every, best], device=scene.device)
        reached, legal = destinations(scenes, scene, here)
        whose = scene.repeat_interleave(legal.shape[1], 0)
        value = self._policy.q.best_moves(scenes, world.observe, whose, reached.flatten(0, 1))[1].reshape(legal.shape)
        center = reached.cpu().numpy()
        return Options(
            center,
            quarter[:, None].repeat(legal.shape[1], 1),
            np.where(legal.cpu().numpy(), value, -np.inf),
            [
                [np.concatenate([ways[k], place[None]]) for place in places]
                for ways, k, places in zip(ends.way, best, center, strict=True)
            ],
        )

    def _or_stay(self, world: _World, state: State[np.ndarray], stood: np.ndarray, options: Options) -> Options:
        """The options, and of items that `stood` (B,) the poses at which they are, as if they were BETTER."""
        every, b = np.arange(len(stood)), np.flatnonzero(stood)
        center, quarter = state.center[every, state.moving], state.quarter[every, state.moving]
        value = np.full(len(stood), -np.inf)
        value[b] = self._value(world, state, b, quarter[b], center[b]) + BETTER
        nowhere = np.empty((0, 2))
        return Options(
            np.concatenate([center[:, None], options.center], 1),
            np.column_stack([quarter, options.quarter]),
            np.column_stack([value, options.value]),
            [[nowhere, *ways] for ways in options.way],
        )

    def _mean_value(self, world: _World, state: State[np.ndarray]) -> np.ndarray:
        """What the agent thinks of layouts, (rooms,): 0 of one in which nothing stands."""
        b, item = np.nonzero(state.stands)
        if not len(b):
            return np.zeros(len(state.room))
        those = rows(state, b)._replace(moving=item)
        value = self._value(world, those, np.arange(len(b)), state.quarter[b, item], state.center[b, item])
        return np.bincount(b, value, len(state.room)) / np.maximum(np.bincount(b, minlength=len(state.room)), 1)

    def _value(
        self, world: _World, state: State[np.ndarray], b: np.ndarray, quarter: np.ndarray, center: np.ndarray
    ) -> np.ndarray:
        """Of poses (n,) of the moving items of states b (n,)."""
        place = torch.as_tensor(center, device=world.scenes.device)
        scene = world.scenes_of(state, b, quarter)
        return self._policy.q.best_moves(world.scenes, world.observe, scene, place)[1]


class _World:
    """Briefs as the agent has them: on the host to choose in, as tensors to move in."""

    def __init__(self, briefs: Sequence[Room], moves: Moves, categories: Sequence[str], device: torch.device):
        self.rooms = RoomsSimulator(briefs, None, moves, Reward())
        self.scenes = Scenes(BatchRoomsSimulator(self.rooms, device))
        self.observe = ScenesObservation(self.scenes, RoomsObservation(self.rooms, categories, device))

    def scenes_of(self, state: State[np.ndarray], b: np.ndarray, quarter: np.ndarray) -> Tensor:
        """The scenes in which the moving items of states b (n,) are turned by quarters (n,)."""
        turned = State(*(torch.as_tensor(values, device=self.scenes.device) for values in rows(state, b)))
        quarters = torch.as_tensor(quarter, device=self.scenes.device)[:, None]
        return self.scenes.of(turned._replace(quarter=turned.quarter.scatter(1, turned.moving[:, None], quarters)))


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


def spread(first: int, count: int) -> np.ndarray:
    """Numbers from 0 to 1 (3, count) that fill the cube evenly, from the `first` of their sequence on."""
    return np.arange(first + 1, first + count + 1) * GOLDEN ** -np.arange(1.0, 4.0)[:, None] % 1
