"""The reference simulator: (next state, reward) = F(state, action), section 4.1 of Di & Yu 2021.

It steps B episodes at once: `room` is an index array (B,) into the rooms it was built with, and
`position` (B, 2) the centre of the moving item, in metres. `others` (B, K), where they are given, are footprints of
what else stands in each room now and could stand elsewhere: polygons, None for nothing. Areas are exact, by shapely.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from numbers import Real
from typing import Literal

import numpy as np
import shapely

from layoutrl import InputError
from layoutrl.env.geometry import CONTACT, GRID, padded, shrunk, snap
from layoutrl.env.render import View
from layoutrl.env.reward import Reward, RewardTerms
from layoutrl.rooms.fitting import edges, fitting_positions
from layoutrl.rooms.room import Room, envelopes, polygons

# Right, left, below, up: the paper's order. Opposite ones are neighbours, so that action ^ 1 goes back.
DIRECTIONS = np.array([(1, 0), (-1, 0), (0, -1), (0, 1)])
# Metres: a slide ends at the next contact that is further away than this. No distance on a decimal grid equals it, so
# that rounding never decides which contact is.
TOUCHING = 1e-4 + GRID / 3
TRIES = 10_000  # to draw a legal start from the box around all legal positions


@dataclass(frozen=True)
class Moves:
    """The actions: `steps` times four directions, then four slides if asked.

    Action 4 k + d moves by step k, counted from 0, in direction d of DIRECTIONS. The last four slide until a side of
    the item touches the outline, or its bounding box that of another item.
    Steps are in metres, or in pixels of the room's picture (1/120 of the envelope's longest side).

    Raises InputError for another unit, for a slide that is no bool, and for steps that are no list, or not finite
    lengths above zero (in metres above GRID; pixels are held against it in `lengths`), or not multiples of the
    shortest.
    """

    steps: tuple[float, ...] = (0.32, 0.08, 0.02, 0.005)
    unit: Literal["metre", "pixel"] = "metre"
    slide: bool = True

    def __post_init__(self) -> None:
        if self.unit not in ("metre", "pixel"):
            raise InputError(f"unit: expected one of metre, pixel; got {self.unit}")
        if not isinstance(self.slide, bool):
            raise InputError(f"slide: expected true or false; got {self.slide!r:.60}")
        least = GRID if self.unit == "metre" else 0.0  # shorter ones would lead nowhere
        listed = isinstance(self.steps, Sequence) and len(self.steps) > 0
        if not (listed and all(isinstance(step, Real) and least < step < math.inf for step in self.steps)):
            raise InputError(
                f"steps: expected a list of finite lengths above zero, in metres above {GRID:g}; got {self.steps!r:.60}"
            )
        ratios = np.array(self.steps) / min(self.steps)
        if not np.allclose(ratios, np.round(ratios)):
            raise InputError(
                f"steps: expected multiples of the shortest step, so that moves stay on a lattice; got {self.steps}"
            )
        object.__setattr__(self, "steps", tuple(self.steps))  # a list has no hash

    @property
    def count(self) -> int:
        """How many actions there are."""
        return self.first_slide + 4 * self.slide

    @property
    def first_slide(self) -> int:
        """The index of the first of the four slides, if there are any."""
        return 4 * len(self.steps)

    def lengths(self, room: Room) -> tuple[float, ...]:
        """Length of each step in this room, in metres. Raises InputError if one is not above GRID."""
        unit = float(snap(np.array(pixel_size(room)))) if self.unit == "pixel" else 1.0
        if (shortest := min(self.steps) * unit) <= GRID:
            raise InputError(
                f"steps: expected lengths above {GRID:g} m; one is {shortest:.1g} m in room {room.id}, where a pixel "
                f"is {unit:g} m"
            )
        return tuple(step * unit for step in self.steps)


def pixel_size(room: Room) -> float:
    """Side of one pixel of the room's picture, in metres."""
    return float(1 / View(room).scale)


class Simulator:
    """Legality, moves and rewards of B poses at once, in a fixed list of rooms with targets.

    A room in which another item moves is another entry of the list. Raises InputError where a target does not fit or a
    step is not above GRID, ValueError where a room has no target or the target has no center or rotation.
    """

    def __init__(self, rooms: Sequence[Room], moves: Moves, reward: Reward):
        self.rooms = list(rooms)
        self.moves = moves
        self.reward_function = reward
        templates = np.array([room.moving.template for room in rooms])
        self._corners = [shapely.get_coordinates(template) for template in templates]
        self.item_bounds = shapely.bounds(templates)  # (rooms, 4), around a centre at 0, 0
        self.item_area = shapely.area(templates)
        self.designer_position = np.array([room.moving.center for room in rooms])

        self.legal = fitting_positions(envelopes(rooms), templates)
        for room, region in zip(rooms, self.legal, strict=True):
            if region.is_empty:
                raise InputError(f"room {room.id}: the {room.moving.category} does not fit into it")
        shapely.prepare(self.legal)
        self._legal_bounds = shapely.bounds(self.legal)
        self.steps = np.array([moves.lengths(room) for room in rooms])  # (rooms, steps), metres
        self.shapes, self.room_of_shape, self.is_circle, is_other = _shapes_of(rooms)
        self._first = np.searchsorted(self.room_of_shape, np.arange(len(rooms)))
        indoor, others = self.shapes[self._first], self.shapes[is_other]
        self.contacts = _contacts_of(indoor, templates, others, self.room_of_shape[is_other])  # (rooms, borders, 4)
        self._bounds = padded(shapely.bounds(self.shapes), self.room_of_shape, len(rooms))
        self._areas = padded(shapely.area(self.shapes), self.room_of_shape, len(rooms))
        self._is_other = np.nan_to_num(padded(is_other, self.room_of_shape, len(rooms)))

    def starts(self, room: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Positions (B, 2) drawn uniformly from all those at which the item lies in the envelope."""
        position = np.empty((len(room), 2))
        left = np.arange(len(room))
        for _ in range(TRIES):
            if not len(left):
                return position
            low, high = self._legal_bounds[room[left], :2], self._legal_bounds[room[left], 2:]
            drawn = snap(rng.uniform(low, high))
            fits = self.is_legal(room[left], drawn)
            position[left[fits]] = drawn[fits]
            left = left[~fits]
        for b in left:  # the item hardly fits: nearly nothing of the box is legal
            drawn = _anywhere(self.legal[room[b]], rng)
            position[b] = snap(drawn) if self.is_legal(room[b], snap(drawn)) else drawn
        return position

    def is_legal(self, room: np.ndarray, position: np.ndarray) -> np.ndarray:
        """Whether the item lies within the envelope, walls included: bool (B,)."""
        return shapely.intersects_xy(self.legal[room], position[..., 0], position[..., 1])

    def destinations(
        self, room: np.ndarray, position: np.ndarray, others: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Where every action leads (B, A, 2), and whether it is legal (B, A)."""
        batch = len(room)
        steps = self.steps[room][:, :, None, None] * DIRECTIONS  # (B, steps, 4, 2)
        count = 4 * steps.shape[1]
        reached = snap(position[:, None] + steps.reshape(batch, count, 2))
        legal = self.is_legal(np.repeat(room, count), reached.reshape(-1, 2)).reshape(batch, count)
        if self.moves.slide:
            slid, touches = self._slides(room, position, others)
            reached, legal = np.concatenate([reached, slid], 1), np.concatenate([legal, touches], 1)
        return reached, legal

    def reward(
        self,
        room: np.ndarray,
        position: np.ndarray,
        others: np.ndarray | None = None,
        target_iou: np.ndarray | None = None,
        floor_taken: np.ndarray | None = None,
    ) -> RewardTerms[np.ndarray]:
        """The reward of standing at `position`: terms of shape (B,).

        `target_iou` (B,), where given, replaces the IoU with the designer's place in the room. `floor_taken` (B,) is
        how much of the floor before items is taken, by default 0.
        """
        shared = self._shared_areas(room, position)  # (B, shapes)
        item, areas = self.item_area[room], self._areas[room]
        iou = np.nan_to_num(shared / (item[:, None] + areas - shared))
        elements = iou[:, 2:].sum(1)
        if others is not None:
            elements += self.ious(room, position, others).sum(1)
        target = iou[:, 1] if target_iou is None else target_iou
        taken = np.zeros(len(target)) if floor_taken is None else floor_taken
        return self.reward_function(target, elements, shared[:, 0] / item, iou[:, 0], taken)

    def ious(self, room: np.ndarray, position: np.ndarray, footprints: np.ndarray) -> np.ndarray:
        """The item's IoU with footprints (B, K); 0 with None."""
        shared = shapely.area(shapely.intersection(self._footprints(room, position)[:, None], footprints))
        return np.nan_to_num(shared / (self.item_area[room][:, None] + shapely.area(footprints) - shared))

    def overlap_and_outside(self, room: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Shares of the item that other items cover, and that lie outside the indoor area: (B,) each."""
        shares = self._shared_areas(room, position) / self.item_area[room][:, None]
        return np.minimum((shares * self._is_other[room]).sum(1), 1), np.clip(1 - shares[:, 0], 0, 1)

    def _shared_areas(self, room: np.ndarray, position: np.ndarray) -> np.ndarray:
        """Area that the item shares with every shape of its room, (B, shapes), in square metres."""
        box = self.item_bounds[room] + np.tile(position, 2)
        bounds = self._bounds[room]
        near = np.all(bounds[..., :2] < box[:, None, 2:], -1) & np.all(bounds[..., 2:] > box[:, None, :2], -1)
        b, k = np.nonzero(near)
        items = self._footprints(room, position)
        shared = np.zeros(near.shape)
        shared[b, k] = shapely.area(shapely.intersection(items[b], self.shapes[self._first[room[b]] + k]))
        return shared

    def _footprints(self, room: np.ndarray, position: np.ndarray) -> np.ndarray:
        """The moving items' outlines at their positions: polygons (B,)."""
        rings = [self._corners[r] + p for r, p in zip(room, position, strict=True)]
        index = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings])
        return shapely.polygons(shapely.linearrings(np.concatenate(rings), indices=index))

    def _slides(
        self, room: np.ndarray, position: np.ndarray, others: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return where each slide ends, touching the outline from within or another item, and whether it is legal."""
        contacts = self.contacts[room]
        if others is not None:
            x0, y0, x1, y1 = np.moveaxis(shapely.bounds(others), -1, 0)
            left, below, right, up = self.item_bounds[room].T[..., None]
            a, b, c, d = (x0 - right).round(9), (y0 - up).round(9), (x1 - left).round(9), (y1 - below).round(9)
            sides = ((a, b, a, d), (c, b, c, d), (a, b, c, b), (a, d, c, d))
            contacts = np.concatenate([contacts, *(np.stack(side, -1) for side in sides)], 1)
        x0, y0, x1, y1 = np.moveaxis(contacts, -1, 0)  # (B, segments) each
        destinations = np.repeat(position[:, None], 4, 1)
        legal = np.zeros((len(room), 4), dtype=bool)
        for d, direction in enumerate(DIRECTIONS):
            axis = int(direction[1] != 0)
            along, across = position[:, axis, None], position[:, 1 - axis, None]
            (u0, u1), (v0, v1) = ((x0, x1), (y0, y1)) if axis == 0 else ((y0, y1), (x0, x1))
            crosses = (np.minimum(v0, v1) - TOUCHING <= across) & (across < np.maximum(v0, v1) + TOUCHING)
            with np.errstate(divide="ignore", invalid="ignore"):
                hit = u0 + np.clip((across - v0) / (v1 - v0), 0, 1) * (u1 - u0)
            distance = (hit - along) * direction[axis]
            # A border parallel to the slide does not stop it. One across it can be as short as twice CONTACT.
            distance = np.where(crosses & (v0 != v1) & (distance > TOUCHING), distance, np.inf)
            nearest = distance.min(1, initial=np.inf)
            legal[:, d] = np.isfinite(nearest)
            destinations[:, d, axis] += np.where(legal[:, d], nearest, 0.0) * direction[axis]
        # The next contact may lie beyond the outer walls: in a room with recesses, or behind an item. Legal or not is
        # decided for the contact itself, not for the place on the grid next to it.
        b, k = np.nonzero(legal)
        ways = shapely.linestrings(np.stack([position[b], destinations[b, k]], 1))
        legal[b, k] = shapely.covers(self.legal[room[b]], ways)
        return np.where(legal[..., None], snap(destinations), position[:, None]), legal


def _anywhere(region: shapely.Geometry, rng: np.random.Generator) -> np.ndarray:
    """A place (2,) drawn uniformly from a region, a grid's step off its border where that leaves any."""
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(shrunk(np.array([region]))))
    share = shapely.area(triangles)
    a, b, c, _ = shapely.get_coordinates(triangles[rng.choice(len(triangles), p=share / share.sum())])
    v, w = rng.random(2)
    if v + w > 1:  # in the other half of the parallelogram
        v, w = 1 - v, 1 - w
    return a + v * (b - a) + w * (c - a)


def _shapes_of(rooms: Sequence[Room]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the shapes (n,) of one room after another: indoor area, designer's footprint, elements, with items last.

    Also return the room of each (n,), whether it is a disc (n,), and whether it is an item that does not move (n,).
    """
    bands = [[*room.walls, *(opening.polygon for opening in room.openings)] for room in rooms]
    others = [room.others for room in rooms]
    corners, of = shapely.get_coordinates([item.template for item in chain(*others)], return_index=True)
    centers = np.array([item.center for item in chain(*others)]).reshape(-1, 2)
    items = shapely.polygons(shapely.linearrings(centers[of] + corners, indices=of))
    shapes = [
        np.array([room.indoor for room in rooms]),
        np.array([room.moving.footprint for room in rooms]),
        polygons(list(chain(*bands))),
        items,
    ]
    every = np.arange(len(rooms))
    room = np.concatenate([every, every, *(np.repeat(every, list(map(len, lists))) for lists in (bands, others))])
    is_other = np.arange(len(room)) >= len(room) - len(items)
    is_circle = np.zeros(len(room), dtype=bool)
    is_circle[is_other] = [item.form == "circle" for item in chain(*others)]
    by_room = np.argsort(room, kind="stable")
    return np.concatenate(shapes)[by_room], room[by_room], is_circle[by_room], is_other[by_room]


def _contacts_of(
    indoor: np.ndarray, templates: np.ndarray, others: np.ndarray, room_of_other: np.ndarray
) -> np.ndarray:
    """Return the segments at which slides of the item's middle end: (rooms, borders, 4), metres, padded with NaN.

    There a side of the item, `templates` (rooms,), touches the outline `indoor` (rooms,) from within, or its bounding
    box that of another item, `others` (n,).
    """
    inner = fitting_positions(indoor, templates, CONTACT)
    x0, y0, x1, y1 = shapely.bounds(others).T
    left, below, right, up = shapely.bounds(templates)[room_of_other].T
    around = shapely.box(x0 - right, y0 - up, x1 - left, y1 - below)
    contacts, region = edges(np.concatenate([inner, around]))
    # Make level what leans by no more than GRID. The batched simulator takes the contacts from here, rounded to
    # nanometres: where a wall leans by micrometres, one nanometre moves the end of a slide by millimetres.
    contacts = contacts.round(9)
    start, end = contacts[:, :2], contacts[:, 2:]
    contacts[:, 2:] = np.where(np.abs(end - start) > GRID, end, start)
    room = np.concatenate([np.arange(len(indoor)), room_of_other])[region]
    by_room = np.argsort(room, kind="stable")
    return padded(contacts[by_room], room[by_room], len(indoor))
