"""Where a trained agent puts one item of a whole room: its moves lead there, and its values are highest there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from layoutrl.env.reward import Reward
from layoutrl.env.rooms_batch import BatchRoomsSimulator
from layoutrl.env.rooms_observation import RoomsObservation
from layoutrl.env.rooms_simulator import QUARTERS, RoomsSimulator, State, rows
from layoutrl.env.scenes import Scenes, ScenesObservation, destinations
from layoutrl.env.simulator import TOUCHING, Moves
from layoutrl.evaluation.choosing import Chosen, Options, best_of, unlike, wrong_at
from layoutrl.evaluation.policy import Policy
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.oddities import AT_A_WALL
from layoutrl.rooms.room import Room

STARTS = 32  # start places spread and valued for each facing of an item
TRIED = 4  # of these, the ones of highest value, from which the item moves
GAP = 0.15  # metres: narrower gaps are closed, behind an item and beside one that belongs at a wall
BETTER = 0.02  # of value: an item that stands is moved only to gain more than this
BACK, SIDEWAYS = (1,), (2, 3)  # slides, in the order of an item's four directions
GOLDEN = 1.2207440846057596  # golden ratio in 3 dimensions: multiples of its powers fill a cube evenly (Roberts 2018)


class Placing:
    """Briefs in which items are placed: on the host (`rooms`) to choose poses, as tensors (`scenes`) to move items."""

    def __init__(self, briefs: Sequence[Room], policy: Policy, moves: Moves, categories: Sequence[str]):
        self.policy, self.moves, device = policy, moves, policy.q.device
        self.rooms = RoomsSimulator(briefs, None, moves, Reward())
        self.scenes = Scenes(BatchRoomsSimulator(self.rooms, device))
        self.observe = ScenesObservation(self.scenes, RoomsObservation(self.rooms, categories, device))

    def chosen(
        self,
        state: State[np.ndarray],
        stood: np.ndarray,
        uniform: np.ndarray,
        known: Sequence[Sequence[Furnished]],
        walls: bool = False,
    ) -> Chosen:
        """Choose a pose for the moving item of each state (B,), which does not stand, among the items that do.

        Where it `stood` (B,) until now, that pose is an option, too. Numbers `uniform` (3, QUARTERS * STARTS) from 0 to
        1 give the start places, the same numbers in every room. The pose is `unlike` that in each of the layouts
        `known` of the room; either all rooms have some, or none has. With `walls`, if items slide, places along walls
        are tried last.
        """
        before = wrong_at(self.rooms, state)
        starts = self._starts(state, uniform)
        ends = self._ends(state, starts, any(known))
        or_stay = self._or_stay(state, stood, ends) if stood.any() else ends
        chosen = best_of(self.rooms, state, before, unlike(self.rooms, state, or_stay, known))
        can_move = np.isfinite(starts.value).any(1)
        for others in ("beside", "starts", "walls") if walls and self.moves.slide else ("beside", "starts"):
            b = np.flatnonzero((chosen.harm > 0) & can_move)
            if not len(b):
                break
            some, options = rows(state, b), starts.take(b)
            if others == "beside":
                options = self._beside(some, ends.take(b))
            elif others == "walls":
                options = self._along_walls(some, options)
            options = unlike(self.rooms, some, options, [known[n] for n in b.tolist()])
            best = best_of(self.rooms, some, before[b], options, every_one=others == "walls")
            chosen = chosen.replaced_where_better(b, best)
        if not self.moves.slide:
            return chosen
        items = [self.rooms.items[r][n] for r, n in zip(state.room, state.moving, strict=True)]
        # A chair would slide out from under its table.
        slides = np.isfinite(chosen.value) & np.array([not item.tucked for item in items])
        at_wall = slides & np.array([item.category in AT_A_WALL for item in items])
        backed = self._slid(state, before, chosen, np.flatnonzero(slides), BACK)
        return self._slid(state, before, backed, np.flatnonzero(at_wall), SIDEWAYS)

    def _slid(
        self,
        state: State[np.ndarray],
        before: np.ndarray,
        chosen: Chosen,
        b: np.ndarray,
        ways: Sequence[int],
    ) -> Chosen:
        """Return `chosen` with items b (n,), which have a pose, slid into contact along the nearest of the `ways`.

        An item slides only over less than GAP, and if no more is wrong afterwards. One that touches something already,
        on either of its two sides, does not slide sideways.

        Values are too imprecise for the last centimetres to a wall, or to the next in a line of cupboards.
        """
        if not len(b):
            return chosen
        scenes, those = self.scenes, chosen.take(b)
        scene = self.scenes_of(state, b, those.quarter)
        here = torch.as_tensor(those.center, device=scene.device)
        slides = self.moves.first_slide + torch.tensor(ways, device=scene.device)
        length, legal = (values[:, slides] for values in scenes.reach(scene, here))
        length, nearest = length.where(legal, torch.inf).min(1)
        near = length < GAP
        place = scenes.moved(scene, here, slides[nearest], length.where(near, 0.0))
        if ways == SIDEWAYS:  # a slide skips what is touched already: the slide back would meet it
            opposite = slides[1 - nearest][:, None]
            length_back, legal = (values.gather(1, opposite)[:, 0] for values in scenes.reach(scene, place))
            near &= ~(legal & (length_back < length + TOUCHING))
        goes = near.cpu().numpy()
        b, those, there = b[goes], those.take(goes), place.cpu().numpy()[goes]
        paths = [[np.concatenate([way, end[None]])] for way, end in zip(those.way, there, strict=True)]
        options = Options(there[:, None], those.quarter[:, None], those.value[:, None], paths)
        slid = best_of(self.rooms, rows(state, b), before[b], options)
        taken = slid.harm <= those.harm
        return chosen.replaced(b[taken], slid.take(taken))

    def _starts(self, state: State[np.ndarray], uniform: np.ndarray) -> Options:
        """Return the start places that numbers (3, QUARTERS * STARTS) give: STARTS for each facing, in order.

        Those of a facing in which the item does not fit are at 0, 0, with value -inf.
        """
        b, quarter = np.nonzero(self.rooms.room_index[state.room, state.moving] >= 0)
        scene = self.scenes_of(state, b, quarter).repeat_interleave(STARTS, 0)
        b, column = b.repeat(STARTS), (quarter[:, None] * STARTS + np.arange(STARTS)).ravel()
        start = self.scenes.starts_at(scene, torch.as_tensor(uniform[:, column], device=scene.device))
        value = np.full((len(state.room), QUARTERS * STARTS), -np.inf)
        center = np.zeros((*value.shape, 2))
        center[b, column] = start.cpu().numpy()
        value[b, column] = self.best_values(scene, start)
        quarters = np.tile(np.arange(QUARTERS).repeat(STARTS), (len(center), 1))
        return Options(center, quarters, value, [list(those[:, None]) for those in center])

    def _ends(self, state: State[np.ndarray], starts: Options, every_facing: bool) -> Options:
        """Return where items end that move from the TRIED best starts: of `every_facing`, or of all together."""
        columns = np.arange(starts.value.shape[1])
        parts = np.split(columns, QUARTERS) if every_facing else [columns]
        best = [part[np.argsort(-starts.value[:, part], 1, kind="stable")[:, :TRIED]] for part in parts]
        tried = np.concatenate(best, 1)
        started = np.take_along_axis(starts.value, tried, 1) > -np.inf
        # A facing that does not fit has no start: the best start of all stands in for it, with value -inf.
        tried = np.where(started, tried, starts.value.argmax(1)[:, None])
        every = np.arange(len(tried))[:, None]
        center, quarter, value = (
            starts.center[every, tried],
            starts.quarter[every, tried],
            np.full(tried.shape, -np.inf),
        )
        ways = [[place[None] for place in places] for places in center]
        b, k = np.nonzero(started)
        scene = self.scenes_of(state, b, quarter[b, k])
        run = self.policy.rollout(self.scenes, self.observe, scene, center[b, k])
        center[b, k], value[b, k] = run.final, self.value(state, b, quarter[b, k], run.final)
        for n, (row, column) in enumerate(zip(b, k, strict=True)):
            ways[row][column] = run.way(n)
        return Options(center, quarter, value, ways)

    def _beside(self, state: State[np.ndarray], ends: Options) -> Options:
        """Where one move more leads from the best of the ends."""
        scenes, every, best = self.scenes, np.arange(len(ends.value)), ends.value.argmax(1)
        quarter = ends.quarter[every, best]
        scene = self.scenes_of(state, every, quarter)
        here = torch.as_tensor(ends.center[every, best], device=scene.device)
        reached, legal = destinations(scenes, scene, here)
        whose = scene.repeat_interleave(legal.shape[1], 0)
        value = self.best_values(whose, reached.flatten(0, 1)).reshape(legal.shape)
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

    def _along_walls(self, state: State[np.ndarray], starts: Options) -> Options:
        """Where items end that slide back from their start places as far as they would alone, and from there sideways.

        That is at a wall, as a rule, or at what stood there before. Of equal places only the first has a value.
        """
        back, *sides = (self.moves.first_slide + way for way in (*BACK, *SIDEWAYS))
        b, k = np.nonzero(np.isfinite(starts.value))
        quarter = starts.quarter[b, k]
        scene = self.scenes_of(state, b, quarter)
        start = torch.as_tensor(starts.center[b, k], device=scene.device)
        alone = self.scenes_of(state._replace(stands=np.zeros_like(state.stands)), b, quarter)
        (wall, legal), (farthest, _) = (
            [values[:, back] for values in destinations(self.scenes, each, start)] for each in (scene, alone)
        )
        reached = legal & ((wall - farthest).norm(dim=1) < TOUCHING)
        scene, wall = scene[reached], wall[reached]
        b, k, quarter = (values[reached.cpu().numpy()] for values in (b, k, quarter))
        aside, legal = (values[:, sides] for values in destinations(self.scenes, scene, wall))
        places = torch.cat([wall[:, None], aside.where(legal[..., None], wall[:, None])], 1).cpu().numpy()  # (n, 3, 2)
        once = np.column_stack([np.column_stack([b, quarter]).repeat(3, 0), places.reshape(-1, 2).round(3)])
        n, place = np.divmod(np.unique(once, return_index=True, axis=0)[1], 3)  # at the wall, and aside on either hand
        center, value = np.repeat(starts.center[:, :, None], 3, 2), np.full((*starts.value.shape, 3), -np.inf)
        center[b, k] = places
        value[b[n], k[n], place] = self.best_values(scene[n], places[n, place])
        ways = [
            [
                np.concatenate([path, ends[[0, k] if k else [0]]])
                for path, ends in zip(paths, room_ends, strict=True)
                for k in range(3)
            ]
            for paths, room_ends in zip(starts.way, center, strict=True)
        ]
        center, value = (each.reshape(len(each), -1, *each.shape[3:]) for each in (center, value))
        return Options(center, starts.quarter.repeat(3, 1), value, ways)

    def _or_stay(self, state: State[np.ndarray], stood: np.ndarray, options: Options) -> Options:
        """Return the options and, for items that `stood` (B,), their present pose, with BETTER added to its value."""
        every, b = np.arange(len(stood)), np.flatnonzero(stood)
        center, quarter = state.center[every, state.moving], state.quarter[every, state.moving]
        value = np.full(len(stood), -np.inf)
        value[b] = self.value(state, b, quarter[b], center[b]) + BETTER
        nowhere = np.empty((0, 2))
        return Options(
            np.concatenate([center[:, None], options.center], 1),
            np.column_stack([quarter, options.quarter]),
            np.column_stack([value, options.value]),
            [[nowhere, *ways] for ways in options.way],
        )

    def mean_value(self, state: State[np.ndarray]) -> np.ndarray:
        """Return the mean `value` of the items that stand in each state: (B,), 0 where none stands."""
        b, item = np.nonzero(state.stands)
        if not len(b):
            return np.zeros(len(state.room))
        those = rows(state, b)._replace(moving=item)
        value = self.value(those, np.arange(len(b)), state.quarter[b, item], state.center[b, item])
        return np.bincount(b, value, len(state.room)) / np.maximum(np.bincount(b, minlength=len(state.room)), 1)

    def value(self, state: State[np.ndarray], b: np.ndarray, quarter: np.ndarray, center: np.ndarray) -> np.ndarray:
        """Return the value (n,) of the best move from poses (n,) of the moving items of states b (n,)."""
        return self.best_values(self.scenes_of(state, b, quarter), center)

    def best_values(self, scene: Tensor, center: np.ndarray | Tensor) -> np.ndarray:
        """The values of the best moves from centers (n, 2) of the moving items of scenes (n, ...)."""
        return self.policy.q.best_moves(self.scenes, self.observe, scene, center)[1]

    def scenes_of(self, state: State[np.ndarray], b: np.ndarray, quarter: np.ndarray) -> Tensor:
        """The scenes in which the moving items of states b (n,) are turned by quarters (n,)."""
        turned = State(*(torch.as_tensor(values, device=self.scenes.device) for values in rows(state, b)))
        quarters = torch.as_tensor(quarter, device=self.scenes.device)[:, None]
        return self.scenes.of(turned._replace(quarter=turned.quarter.scatter(1, turned.moving[:, None], quarters)))


def spread(first: int, count: int) -> np.ndarray:
    """Return points (3, count) of a sequence that fills the unit cube evenly, from index `first` on."""
    return np.arange(first + 1, first + count + 1) * GOLDEN ** -np.arange(1.0, 4.0)[:, None] % 1
