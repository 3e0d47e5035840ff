"""What a room is: outline, walls, doors, windows and furniture, in metres, y up.

The words are those of Di & Yu 2021, section 3: S = (walls, openings, furniture), each with a
centre and a size. Everything geometric is derived from polygons, with shapely.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from statistics import median
from typing import Literal

import numpy as np
import shapely
from shapely import box
from shapely.affinity import rotate, translate
from shapely.geometry import Polygon

from layoutrl import InputError

Point = tuple[float, float]
Ring = tuple[Point, ...]

WALL_THICKNESS = 0.2  # metres, of the band that is assumed where a room names no walls
FIT = 4e-6  # metres by which an item may overstep what holds it: rounding, far below anything that can be built
TOLERANCE = 0.01  # metres: gaps and overlaps below a centimetre are drawing noise
FILM = 0.002  # metres: no wall is thinner
TWIN = 0.5  # two openings, or icons, are one drawn twice when they share this much of the smaller
CIRCLE_SEGMENTS = 64  # a quarter: a 256-gon has 0.9999 of its circle's area

# The eight room types of the paper's Tables 1 and 2, and the item that moves by default in each.
MAIN_ITEM = {
    "bathroom": "toilet",
    "bedroom": "bed",
    "study": "desk",
    "tatami": "platform",
    "living_room": "sofa",
    "dining_room": "table",
    "kitchen": "cooktop",
    "balcony": "laundry_cabinet",
}


class RoomError(InputError):
    """Something in a room's description is wrong; `field` says where, `problem` what is expected."""

    def __init__(self, field: str, problem: str):
        super().__init__(f"{field}: {problem}")
        self.field = field
        self.problem = problem


@dataclass(frozen=True)
class Opening:
    """A door or a window: a polygon inside the wall band."""

    kind: Literal["door", "window"]
    polygon: Ring

    @cached_property
    def shape(self) -> Polygon:
        """The polygon, for shapely."""
        return Polygon(self.polygon)


@dataclass(frozen=True)
class Item:
    """One piece of furniture.

    `size` is (depth, width) in metres along the item's own x and y axis; `rotation` turns these
    axes, in degrees counter-clockwise. It faces along its x axis. `center` is None for an item that is still to be
    placed, `rotation` too for one whose facing is then to be chosen; of one with a center it is 0 if none is given.
    A circle's depth and width are both its diameter. A `tucked` item (a chair) stands partly under
    another by intent. One that is `locked` stays where it stands, whatever a user lets move (`formats.to_place`).
    """

    category: str
    size: tuple[float, float]
    center: Point | None = None
    rotation: float | None = None
    form: Literal["rectangle", "circle"] = "rectangle"
    tucked: bool = False
    locked: bool = False

    def __post_init__(self) -> None:
        if self.center is not None and self.rotation is None:
            object.__setattr__(self, "rotation", 0.0)

    def footprint_at(self, center: Point) -> Polygon:
        """The item's outline when its centre stands at `center`."""
        return translate(self.template, *center)

    @property
    def kind(self) -> tuple[str, tuple[float, float], str]:
        """Category, size and form: items that have these in common are interchangeable."""
        return self.category, self.size, self.form

    @property
    def degrees(self) -> float:
        """The rotation. Raises ValueError where it is still to be chosen."""
        if self.rotation is None:
            raise ValueError(f"{self.category} has no rotation: its facing is still to be chosen")
        return self.rotation

    @property
    def area(self) -> float:
        """Square metres of its footprint."""
        depth, width = self.size
        return math.pi / 4 * depth * width if self.form == "circle" else depth * width

    @cached_property
    def template(self) -> Polygon:
        """The footprint around the origin, rotated. Raises ValueError where the facing is still to be chosen."""
        depth, width = self.size
        if self.form == "circle":
            return shapely.Point(0, 0).buffer(depth / 2, quad_segs=CIRCLE_SEGMENTS)
        rectangle = box(-depth / 2, -width / 2, depth / 2, width / 2)
        if self.degrees % 90 == 0:  # exact, where sines of multiples of 90 degrees are not
            return rectangle if self.degrees % 180 == 0 else box(-width / 2, -depth / 2, width / 2, depth / 2)
        return rotate(rectangle, self.degrees, origin=(0, 0))

    @cached_property
    def footprint(self) -> Polygon:
        """Where the item stands. Raises ValueError for an item that is still to be placed."""
        if self.center is None:
            raise ValueError(f"{self.category} has no centre: it is still to be placed")
        return self.footprint_at(self.center)


@dataclass(frozen=True)
class Room:
    """A room and its furniture, as its designer placed it or still to be placed.

    `outline` (counter-clockwise) and `holes` bound the indoor area. `walls` are polygons around
    it, already cut by the openings. `target` is the index of the item that moves; None where
    nobody has chosen one. Rooms of one `group` (layouts of one room, copies of one plan) are
    never split between training and test.
    """

    id: str
    room_type: str
    outline: Ring
    walls: tuple[Ring, ...]
    openings: tuple[Opening, ...] = ()
    furniture: tuple[Item, ...] = ()
    target: int | None = None
    holes: tuple[Ring, ...] = ()
    group: str = ""

    def __post_init__(self) -> None:
        if not self.group:
            object.__setattr__(self, "group", self.id)

    @property
    def doors(self) -> tuple[Opening, ...]:
        """The openings that are doors."""
        return tuple(o for o in self.openings if o.kind == "door")

    @property
    def windows(self) -> tuple[Opening, ...]:
        """The openings that are windows."""
        return tuple(o for o in self.openings if o.kind == "window")

    @cached_property
    def indoor(self) -> Polygon:
        """The indoor area: the outline less its holes."""
        return Polygon(self.outline, self.holes)

    @cached_property
    def wall_shapes(self) -> tuple[Polygon, ...]:
        """The walls, for shapely."""
        return tuple(Polygon(wall) for wall in self.walls)

    @cached_property
    def envelope(self) -> Polygon:
        """Outline, walls and openings together: the outermost border, columns filled in."""
        return _envelopes([self])[0]

    def holds(self, item: Item, slack: float = TOLERANCE) -> bool:
        """Whether a placed item lies within the envelope, give or take `slack` metres."""
        return bool(self.envelope.buffer(slack, join_style="mitre").covers(item.footprint))

    @property
    def moving(self) -> Item:
        """The item that moves. Raises ValueError where no target is chosen."""
        if self.target is None:
            raise ValueError(f"room {self.id} has no target")
        return self.furniture[self.target]

    @property
    def others(self) -> tuple[Item, ...]:
        """The items that stand in the room while the target moves."""
        return tuple(i for k, i in enumerate(self.furniture) if k != self.target and i.center is not None)

    def turned(self, quarters: int, mirror: bool = False) -> Room:
        """The same room, mirrored in the y axis if asked, then turned by quarters of a circle.

        The eight results are the symmetries of the square: designs are as good in each.
        """
        (a, b), (c, d) = symmetry(quarters, mirror).tolist()
        turned = self._mapped(lambda x, y: (a * x + b * y, c * x + d * y), 90 * quarters, mirror)
        return replace(turned, id=f"{self.id}~{quarters % 4}{'m' if mirror else ''}")

    def rotated(self, degrees: float) -> Room:
        """The same room, turned around the origin by any angle.

        Coordinates are rounded to nanometres, so that walls that become level are exactly so.
        """
        (a, b), (c, d) = rotation(degrees).tolist()
        return self._mapped(lambda x, y: (round(a * x + b * y, 9), round(c * x + d * y, 9)), degrees, False)

    def _mapped(self, move: Callable[[float, float], Point], degrees: float, mirror: bool) -> Room:
        """Return the room with its points moved by `move`, which mirrors them if `mirror`, then turns by `degrees`."""

        def turn(rotation: float) -> float:
            return ((180 - rotation if mirror else rotation) + degrees) % 360

        def ring(points: Ring) -> Ring:
            moved = tuple(move(*p) for p in points)
            return moved[::-1] if mirror else moved

        return replace(
            self,
            outline=ring(self.outline),
            holes=tuple(ring(h) for h in self.holes),
            walls=tuple(ring(w) for w in self.walls),
            openings=tuple(replace(o, polygon=ring(o.polygon)) for o in self.openings),
            furniture=tuple(
                replace(
                    item,
                    center=None if item.center is None else move(*item.center),
                    rotation=None if item.rotation is None else turn(item.rotation),
                )
                for item in self.furniture
            ),
        )


# Quarters of a circle to turn by, after mirroring or not: the eight symmetries of the square, first the identity.
SYMMETRIES = [(quarters, mirror) for mirror in (False, True) for quarters in range(4)]


def symmetry(quarters: int, mirror: bool) -> np.ndarray:
    """The matrix (2, 2) that mirrors points in the y axis if asked, then turns them by quarters of a circle."""
    cosine, sine = ((1, 0), (0, 1), (-1, 0), (0, -1))[quarters % 4]
    return np.array([[-cosine if mirror else cosine, -sine], [-sine if mirror else sine, cosine]])


def rotation(degrees: float) -> np.ndarray:
    """The matrix (2, 2) that turns points counter-clockwise."""
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return np.array([[cosine, -sine], [sine, cosine]])


def sole(furniture: Sequence[Item], category: str) -> int | None:
    """The index of the item of a category; None where there is none, or several."""
    found = [k for k, item in enumerate(furniture) if item.category == category]
    return found[0] if len(found) == 1 else None


def wall_band(
    outline: Ring, holes: tuple[Ring, ...], openings: tuple[Opening, ...], thickness: float = WALL_THICKNESS
) -> tuple[Ring, ...]:
    """Return walls for a room that has none: a band along each edge of the outline, cut by the openings.

    Holes become solid columns. Each wall reaches around the corners at its ends; the earlier wall keeps the corner.
    """
    room = Polygon(outline)
    band = room.buffer(thickness, join_style="mitre").difference(room)
    taken = shapely.union_all([o.shape for o in openings])
    noise = TOLERANCE + FIT  # openings may be drawn so far off their walls: a sliver that is left there is no wall
    beside = taken.buffer(noise, join_style="mitre")
    walls: list[Ring] = [hole[::-1] for hole in holes]
    for (x0, y0), (x1, y1) in zip(outline, outline[1:] + outline[:1], strict=True):
        length = math.dist((x0, y0), (x1, y1))
        ax, ay = (x1 - x0) / length * thickness, (y1 - y0) / length * thickness  # along the edge
        x0, y0, x1, y1 = x0 - ax, y0 - ay, x1 + ax, y1 + ay
        strip = Polygon(((x0, y0), (x0 + ay, y0 - ax), (x1 + ay, y1 - ax), (x1, y1)))  # on its right: outside
        wall = strip.intersection(band).difference(taken)
        taken = taken.union(wall)
        solid = wall.buffer(0)  # without the lines along which it touches others: GEOS overlays no mixed collections
        near = solid.intersection(beside)
        if near.area > TOLERANCE**2:  # else no sliver in it is larger
            sliver = near.difference(without_narrow(solid, noise))
            if sliver.area > TOLERANCE**2:
                wall = solid.difference(sliver)
        walls.extend(rings(without_films(wall)))
    tips = band.difference(taken)  # of acute corners, which no edge's band reaches
    walls.extend(rings(without_films(tips)))
    return tuple(walls)


def without_films(wall: shapely.Geometry, grid: float = 1e-9) -> shapely.Geometry:
    """Return a wall without parts thinner than FILM, which rounding leaves where an opening is not quite as deep.

    Corners are rounded to a grid of so many metres.
    """
    return shapely.set_precision(without_narrow(wall, FILM), grid)


def without_narrow(shape: shapely.Geometry, width: float) -> shapely.Geometry:
    """A shape without what is narrower than `width` metres."""
    with np.errstate(all="ignore"):  # GEOS divides by zero at a straight corner, to no harm
        return shape.buffer(-width / 2, join_style="mitre").buffer(width / 2, join_style="mitre")


def polygons(rings: Sequence[Ring]) -> np.ndarray:
    """Rings as polygons (n,) without holes: all at once, since one by one they take many times as long."""
    corners = np.array([corner for ring in rings for corner in ring]).reshape(-1, 2)
    index = np.repeat(np.arange(len(rings)), [len(ring) for ring in rings])
    return shapely.polygons(shapely.linearrings(corners, indices=index))


def envelopes(rooms: Sequence[Room]) -> np.ndarray:
    """The envelopes (B,) of rooms. Those not known yet are worked out all at once, and their rooms keep them."""
    new = [room for room in rooms if "envelope" not in vars(room)]
    for room, envelope in zip(new, _envelopes(new), strict=True):
        vars(room)["envelope"] = envelope  # where the cached property looks for it
    return np.array([room.envelope for room in rooms])


def middles(rooms: Sequence[Room]) -> np.ndarray:
    """Return the centres (B, 2) of the bounding boxes of envelopes, in metres: the origins of observations."""
    return shapely.bounds(envelopes(rooms)).reshape(-1, 2, 2).mean(1)


def _envelopes(rooms: Sequence[Room]) -> np.ndarray:
    rings = [[room.outline, *room.walls, *(o.polygon for o in room.openings)] for room in rooms]
    room_of = np.repeat(np.arange(len(rooms)), [len(those) for those in rings])
    parts = polygons(list(chain(*rings)))
    rounded = shapely.transform(parts, lambda corners: np.round(corners, 6))
    corners, part = shapely.get_coordinates(rounded, return_index=True)
    slants = np.diff(corners, axis=0).all(1) & (part[1:] == part[:-1])
    broken = ~shapely.is_valid(rounded)  # as a ring with a spike is
    slanting = np.bincount(room_of[part[1:]], slants, len(rooms)) + np.bincount(room_of, broken, len(rooms)) > 0
    # On a grid, since a plain union can lose a part whose side nearly coincides with another's. Upright
    # sides between corners on the grid coincide or do not: their plain union, several times as fast, is safe.
    collections = shapely.geometrycollections(np.where(slanting[room_of], parts, rounded), indices=room_of)[:, None]
    unions = np.empty(len(rooms), dtype=object)
    unions[slanting] = shapely.union_all(collections[slanting], grid_size=1e-6, axis=1)
    unions[~slanting] = shapely.union_all(collections[~slanting], axis=1)
    # Grown and shrunk by the tolerance, so that a hairline between two walls is no way out.
    with np.errstate(all="ignore"):  # GEOS divides by zero at a straight corner, to no harm
        grown = shapely.buffer(unions, TOLERANCE, join_style="mitre")
        joined = shapely.buffer(grown, -TOLERANCE, join_style="mitre")
    for k in np.flatnonzero(shapely.get_num_geometries(joined) > 1):
        joined[k] = max(joined[k].geoms, key=lambda part: part.area)
    return shapely.polygons(shapely.get_exterior_ring(joined))


def is_drawn_before(shape: Polygon, others: Iterable[Polygon]) -> bool:
    """Whether a shape shares more than TWIN of the smaller area with one that was drawn before."""
    return any(shape.intersection(other).area > TWIN * min(shape.area, other.area) for other in others)


def along_and_through(
    opening: shapely.Geometry, border: shapely.Geometry | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """The sides of an opening's rectangle as vectors (2,) in metres: along its wall, and through it.

    The side along the wall is the one along which the room's `border` runs, since some windows are less wide than their
    wall is thick. Without a border there, it is the longer side, as of most openings.
    """
    corners = np.array(shapely.minimum_rotated_rectangle(opening).exterior.coords)
    one, other = np.diff(corners[:3], axis=0)
    along, through = (one, other) if np.hypot(*one) >= np.hypot(*other) else (other, one)
    if border is not None:
        beside = _share(border, opening, np.array([along, through]))
        if beside[1] > beside[0]:
            return through, along
    return along, through


def _share(border: shapely.Geometry, opening: shapely.Geometry, sides: np.ndarray) -> np.ndarray:
    """Return how far a border runs along each of two `sides` (2, 2) of an opening, up to 2 cm off it: metres (2,)."""
    near = shapely.intersection(border, opening.buffer(2 * TOLERANCE, join_style="mitre"))
    points, line = shapely.get_coordinates(shapely.get_parts(near), return_index=True)
    steps = np.diff(points, axis=0)[line[1:] == line[:-1]]
    return np.abs(steps @ (sides / np.hypot(*sides.T)[:, None]).T).sum(0)


def wall_thickness(room: Room) -> float:
    """Return the median thickness of the walls of a room's sides, in metres; WALL_THICKNESS if that is 1 cm or less."""
    sides = zip(room.outline, [*room.outline[1:], room.outline[0]], strict=True)
    border = room.envelope.exterior
    depth = median(shapely.distance(border, shapely.Point(np.mean(side, 0))) for side in sides)
    return depth if depth > TOLERANCE else WALL_THICKNESS


def rings(shape: shapely.Geometry) -> list[Ring]:
    """The exterior rings of every polygon in `shape`, counter-clockwise, without slivers or repeated corners."""
    polygons = [p for p in shapely.get_parts(shape) if isinstance(p, Polygon) and p.area > TOLERANCE**2]
    return [tuple(p.simplify(1e-9).normalize().exterior.coords[:-1][::-1]) for p in polygons]
