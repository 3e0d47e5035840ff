"""Baselines that methods for whole rooms must beat: random places, and the layout of the most similar training room."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np
import shapely

from layoutrl.env.geometry import CONTACT
from layoutrl.rooms.brief import Pose, facings, missing, standing, with_poses
from layoutrl.rooms.clearances import angle_off
from layoutrl.rooms.fitting import fitting_positions, relative_place
from layoutrl.rooms.room import SYMMETRIES, Item, Room, symmetry

DRAWS = 100  # points drawn in the box around all places, before the nearest place is taken; unsourced: seldom reached
OTHER_CATEGORY = 2.0  # metres for an item or opening without counterpart, and for outlines sharing no floor; unsourced


def random_layout(brief: Room, rng: np.random.Generator) -> Room:
    """Place every item at random indoors, facing a random way. One that fits nowhere has no center."""
    return with_poses(brief, {k: pose for k in missing(brief) if (pose := _drawn(brief, k, rng))})


def nearest_layout(brief: Room, training: Library, rng: np.random.Generator) -> Room:
    """Furnish a brief as the training room that is most like it, in the best of the library's views.

    Each item takes the pose of its counterpart, the item of its category that is nearest in size, at the same relative
    place in the outline's bounding box, and is pushed indoors. One that has no counterpart, or does not fit at its
    facing, goes to a random place.
    """
    room, view = training.nearest(brief)
    model = room.turned(*view)
    poses: dict[int, Pose] = {}
    asked = missing(brief)
    items = [brief.furniture[k] for k in asked]
    others = _counterparts(items, standing(model))
    for k, item, other in zip(asked, items, others, strict=True):
        if pose := (other and _pushed(brief, item, model, other)) or _drawn(brief, k, rng):
            poses[k] = pose
    return with_poses(brief, poses)


class Library:
    """Training rooms, with what is compared first: how many items of each category, and the outline's extents.

    Rooms are compared in eight `views`, or in four where mirrored rooms are not furnished alike.
    """

    def __init__(self, rooms: Sequence[Room], mirrors_alike: bool = True):
        self.rooms = list(rooms)
        self.views = [(quarters, mirror) for quarters, mirror in SYMMETRIES if mirrors_alike or not mirror]
        self._categories = sorted({item.category for room in rooms for item in room.furniture})
        self._counts = np.array([self._counted(room) for room in rooms])  # (rooms, categories)
        self._extents = np.array([_extents(room) for room in rooms])  # (rooms, 2), metres
        self._groups = np.array([room.group for room in rooms])

    def nearest(self, brief: Room) -> tuple[Room, tuple[int, bool]]:
        """Return the room most like the brief, the first of equals, and the view in which it is.

        Rooms of the brief's own group hold its answer and are left out, unless there are no others.
        """
        lacks = np.abs(self._counts - self._counted(brief)).sum(1)
        lacks += sum(item.category not in self._categories for item in brief.furniture)
        size = _extents(brief)
        apart = np.minimum(*(np.abs(size - extents).sum(1) for extents in (self._extents, self._extents[:, ::-1])))
        least = OTHER_CATEGORY * lacks + apart  # a lower bound of how unlike each is in any view
        if not (own := self._groups == brief.group).all():
            least[own] = np.inf
        best, found = np.inf, (self.rooms[0], self.views[0])
        for k in np.argsort(least, kind="stable"):
            if least[k] >= best:
                break
            unlike = _unlikeness(brief, self.rooms[k], self.views)
            if unlike.min() < best:
                best, found = float(unlike.min()), (self.rooms[k], self.views[unlike.argmin()])
        return found

    def _counted(self, room: Room) -> np.ndarray:
        counts = Counter(item.category for item in room.furniture)
        return np.array([counts[category] for category in self._categories])


def _unlikeness(brief: Room, room: Room, views: Sequence[tuple[int, bool]]) -> np.ndarray:
    """Return how unlike the brief a room is in each of n views, (n,) in metres: outline, openings and furniture.

    Outlines differ by their extents, and by how much they do not cover each other when stretched to one square.
    """
    items = _list_distance(brief.furniture, room.furniture)
    ours, theirs = ({kind: _middles(one, kind) for kind in ("door", "window")} for one in (brief, room))
    size, extents = _extents(brief), _extents(room)
    turns = [symmetry(*view) for view in views]
    result = []
    for turn in turns:
        openings = sum(_set_distance(ours[kind], theirs[kind] @ turn.T) for kind in ours)
        result.append(np.abs(size - np.abs(turn) @ extents).sum() + openings + items)
    return np.array(result) + OTHER_CATEGORY * (1 - _outline_iou(brief, room, turns))


def _outline_iou(brief: Room, room: Room, turns: Sequence[np.ndarray]) -> np.ndarray:
    """Return the IoU of the floors, each stretched to a square, the second turned by each matrix: (len(turns),)."""
    shares = [one.indoor.area / _extents(one).prod() for one in (brief, room)]
    if max(shares) > 1 - 1e-9:  # one is a rectangle, and so holds the other
        return np.full(len(turns), min(shares))
    ours, theirs = _stretched(brief), _stretched(room)
    shared = shapely.area(
        shapely.intersection(ours, [shapely.transform(theirs, lambda xy, t=turn: xy @ t.T) for turn in turns])
    )
    return shared / (sum(shares) - shared)


def _stretched(room: Room) -> shapely.Polygon:
    """Return the floor with its bounding box stretched to the unit square around the origin."""
    x0, y0, x1, y1 = room.indoor.bounds
    return shapely.transform(room.indoor, lambda xy: (xy - ((x0 + x1) / 2, (y0 + y1) / 2)) / (x1 - x0, y1 - y0))


def _extents(room: Room) -> np.ndarray:
    x0, y0, x1, y1 = room.indoor.bounds
    return np.array([x1 - x0, y1 - y0])


def _middles(room: Room, kind: str) -> np.ndarray:
    """Return the centres (k, 2) of the openings of a kind, from the middle of the outline's bounding box."""
    x0, y0, x1, y1 = room.indoor.bounds
    found = [opening.shape.centroid.coords[0] for opening in room.openings if opening.kind == kind]
    return np.array(found).reshape(-1, 2) - ((x0 + x1) / 2, (y0 + y1) / 2)


def _set_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Sum the distances of every point to the nearest of the others, both ways; OTHER_CATEGORY each without others."""
    if not len(a) or not len(b):
        return OTHER_CATEGORY * (len(a) + len(b))
    apart = np.hypot(*(a[:, None] - b[None]).transpose(2, 0, 1))
    return float(apart.min(0).sum() + apart.min(1).sum())


def _list_distance(ours: Sequence[Item], theirs: Sequence[Item]) -> float:
    """Sum the differences between the sizes of counterparts, and OTHER_CATEGORY for each item without one."""
    pairs = zip(ours, _counterparts(ours, theirs), strict=True)
    differences = [math.dist(item.size, other.size) for item, other in pairs if other]
    return sum(differences) + OTHER_CATEGORY * (len(ours) + len(theirs) - 2 * len(differences))


def _counterparts(ours: Sequence[Item], theirs: Sequence[Item]) -> list[Item | None]:
    """Match each item in turn with the nearest in size of its category among those left; None where there is none."""
    left, found = list(theirs), list[Item | None]()
    for item in ours:
        alike = [other for other in left if other.category == item.category]
        other = min(alike, key=lambda other: math.dist(item.size, other.size), default=None)
        if other:
            left.remove(other)
        found.append(other)
    return found


def _pushed(brief: Room, item: Item, model: Room, other: Item) -> Pose | None:
    """The counterpart's pose in the brief's room, pushed to where the item fits; None where it fits nowhere."""
    assert other.center is not None
    degrees = _nearest_facing(brief, other.degrees) if item.rotation is None else item.rotation
    fits = _fitting(brief, item, degrees)
    if fits.is_empty:
        return None
    share = np.clip(relative_place(model, other), 0, 1)
    x0, y0, x1, y1 = fits.bounds
    wanted = shapely.Point(np.array([x0, y0]) + share * (x1 - x0, y1 - y0))
    x, y = shapely.shortest_line(fits, wanted).coords[0]
    return (x, y), degrees


def _nearest_facing(room: Room, degrees: float) -> float:
    return min(facings(room), key=lambda facing: angle_off(facing - degrees, 360))


def _fitting(room: Room, item: Item, degrees: float) -> shapely.Geometry:
    """Return the region of centres at which the item, turned by `degrees`, lies indoors."""
    turned = Item(item.category, item.size, None, degrees, item.form)
    return fitting_positions(np.array([room.indoor]), np.array([turned.template]), CONTACT)[0]


def _drawn(room: Room, k: int, rng: np.random.Generator) -> Pose | None:
    """Draw a facing and a place indoors, uniformly; None where the item fits nowhere."""
    item = room.furniture[k]
    for degrees in rng.permutation(facings(room)) if item.rotation is None else [item.rotation]:
        fits = _fitting(room, item, float(degrees))
        if fits.is_empty:
            continue
        x0, y0, x1, y1 = fits.bounds
        drawn = shapely.points(rng.uniform((x0, y0), (x1, y1), (DRAWS, 2)))
        inside = drawn[shapely.covers(fits, drawn)]
        point = inside[0] if len(inside) else shapely.shortest_line(fits, drawn[0]).interpolate(0)
        return (float(point.x), float(point.y)), float(degrees)
    return None
