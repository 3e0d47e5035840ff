"""A room from what plans draw of it: floor, walls, doors, windows and pieces of furniture; metres, y up."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count, pairwise
from typing import Any, Generic, Literal, TypeVar

import numpy as np
import shapely
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, Polygon, box
from shapely.geometry.polygon import orient

from layoutrl.rooms.brief import lifted
from layoutrl.rooms.categories import NO_ROOM, NOTED, OBSTACLE, Names
from layoutrl.rooms.clearances import HOSTS, PASSAGE
from layoutrl.rooms.collection import NOBODYS, ODD, UNTOLD, taken_for
from layoutrl.rooms.documents import LARGEST, MOST, room_from_dict
from layoutrl.rooms.room import (
    FILM,
    TOLERANCE,
    WALL_THICKNESS,
    Item,
    Ring,
    Room,
    RoomError,
    along_and_through,
    is_drawn_before,
    rings,
    rotation,
    without_films,
    without_narrow,
)

NARROW = 0.18  # metres: what is narrower of a floor is none
JOG = 0.04  # metres: jogs of a floor's border that are smaller are slips of the hand
LEAN = 1.0  # degrees by which a side of a floor may lean from the axes by a slip
ROOM = 1.0  # square metres, of a part of a floor that walls cut, or of what they enclose: smaller ones are no rooms
LINING = 0.06  # metres, of the wall where a side has none: rooms that are open to each other
NEAR = 0.1  # metres from a floor to a wall that is its own
ACROSS = 0.12  # metres by which an opening is drawn out to both sides, to be cut to the wall
MOST_WALLS, MOST_OPENINGS = 40, 30  # that are looked at along one side, and about one room
MOST_CROSSING = 100  # corners of a border that may cross itself
LEAST = 0.01  # square metres indoors, of what reaches through a wall: less is in nobody's way
SHARES = (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3)  # of a box that is cut to a room, the largest that fits
DIGITS = 4  # lengths are rounded to a tenth of a millimetre
HIGHEST = 0.3  # metres: what hangs higher is decor
FLATTEST = 0.1  # metres: carpets are lower


@dataclass(frozen=True)
class Piece:
    """A piece of furniture that stands on a floor: the item that it is, and whether its category is known."""

    item: Item
    known: bool


P = TypeVar("P", bound=Piece)


@dataclass(frozen=True)
class Wall:
    """A wall as it is drawn, without what is cut out of it."""

    body: Polygon
    thickness: float


@dataclass(frozen=True)
class DrawnOpening:
    """A door or window as it is drawn: where it lies in some wall, along it and across.

    `axis` is a line through it along the wall, where the format says how the wall runs.
    """

    kind: Literal["door", "window"]
    shape: Polygon
    axis: LineString | None = None

    @cached_property
    def sides(self) -> tuple[np.ndarray, np.ndarray]:
        """Its sides along the wall and through it, as vectors (2,) in metres."""
        return along_and_through(self.shape, self.axis)


@dataclass
class DrawnRoom(Generic[P]):
    """A room as it is drawn: what it is called, its floor as traced and tidied, and what stands there."""

    name: str | None
    label: str  # in its id: its name, or a number
    traced: Polygon
    floor: Polygon
    pieces: list[P] = field(default_factory=list)


@dataclass
class Storey(Generic[P]):
    """What is drawn of the rooms of one level; `prefix` begins their ids."""

    prefix: str
    walls: list[Wall] | None = None  # None where the format draws none
    gaps: list[DrawnOpening] = field(default_factory=list)
    rooms: list[DrawnRoom[P]] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unsized: Counter[str] = field(default_factory=Counter)  # names of pieces of which no size is known
    odd: Counter[str] = field(default_factory=Counter)  # and of those of which a field is missing or odd

    @cached_property
    def _bodies(self) -> shapely.Geometry | None:
        return shapely.union_all([wall.body for wall in self.walls]) if self.walls else None

    @property
    def enclosed(self) -> list[Polygon]:
        """The floors that walls enclose, the largest first, as `tidy` has floors: no slit leads out of them."""
        if self._bodies is None:
            return []
        closed = self._bodies.buffer(NARROW / 2, join_style="mitre").buffer(-NARROW / 2, join_style="mitre")
        floors = shapely.get_parts(_filled(closed).difference(closed))
        return sorted((part for part in floors if part.area > ROOM), key=lambda part: -part.area)

    def draw(self, name: str | None, label: str, floor: Callable[[], Polygon]) -> None:
        """Add a room, or several where walls cut its floor; or the reason to leave it out. Walls are there before."""
        try:
            traced = floor()
            self.rooms += [DrawnRoom(name, label, traced, part) for part in tidy(traced, self._bodies)]
        except RoomError as error:
            self.left_out.append((f"{self.prefix}/{label}", str(error)))

    @cached_property
    def _traced(self) -> shapely.STRtree:
        return shapely.STRtree([room.traced for room in self.rooms])

    def put(self, piece: P) -> bool:
        """Put a piece into the room that it stands in; whether there is one. Rooms are there before.

        Of rooms in each other it is one with a name, then the smallest: people draw slabs and ceilings as rooms, too.
        """
        center = shapely.Point(piece.item.center)
        inside = [self.rooms[k] for k in self._traced.query(center, predicate="intersects")]
        if inside:
            min(inside, key=lambda room: (room.floor.distance(center), not room.name, room.traced.area)).pieces.append(
                piece
            )
        return bool(inside)

    @contextmanager
    def or_left_out(self, called: str) -> Iterator[None]:
        """Leave out the piece that is read inside where a field of it is missing or odd: it costs itself alone."""
        try:
            yield
        except ODD:  # a RoomError is one
            self.odd[called] += 1

    @cached_property
    def building(self) -> shapely.Geometry:
        """All rooms and walls, and what walls enclose. Rooms are there before."""
        return shapely.union_all([_filled(self._bodies), *(room.traced for room in self.rooms)])

    def leave(self, piece: P) -> None:
        """Leave a piece that stands in no room where it is: in the way of the room that it reaches into most."""
        shape = piece.item.footprint
        beside = [self.rooms[k] for k in self._traced.query(shape, predicate="intersects")]
        shared = {k: room.floor.intersection(shape).area for k, room in enumerate(beside)}
        most = max(shared, key=shared.__getitem__, default=None)
        if most is not None and shared[most] > LEAST:
            beside[most].pieces.append(replace(piece, known=False))

    def _passages(self, room: DrawnRoom[P], walls: Sequence[Wall], gaps: Sequence[DrawnOpening]) -> list[DrawnOpening]:
        """Where a floor goes on into another room's with none of the walls between: ways through, as doors are.

        Each lies along one side, and begins a little beyond its ends.
        """
        near = [self.rooms[k] for k in sorted(self._traced.query(room.floor.buffer(NEAR), predicate="intersects"))]
        floors = [other.floor for other in near if other is not room]
        beside = [floor for floor in floors if floor.intersection(room.floor).area < ROOM]  # no slabs, nor ceilings
        solid = [*(wall.body for wall in walls), *(gap.shape for gap in gaps)]
        border = room.floor.exterior.intersection(shapely.union_all(beside).buffer(NEAR))
        ends = shapely.MultiPoint(room.floor.exterior.coords)
        ways = shapely.get_parts(border.difference(shapely.union_all([*solid, ends]).buffer(NEAR)))
        return [DrawnOpening("door", way.buffer(FILM, cap_style="flat"), way) for way in ways if way.length >= PASSAGE]

    def finished(
        self,
        names: Names,
        group: str,
        room_type: str | None = None,
        moves: Callable[[P], bool] = lambda _: False,
        or_else: str = "",
    ) -> Iterator[tuple[Room, list[P]]]:
        """(room, its pieces) of every room of a type that is furnished; `left_out` and `notes` tell of the others.

        What `moves` says yes to has no pose. `room_type` is that of rooms of which nothing tells it; `or_else` ends
        what is said of these, with an option that would.
        """
        for what, found in (("of unknown size", self.unsized), ("with a missing or odd field", self.odd)):
            if found:
                called = ", ".join(f"{name[:40]} ({n})" for name, n in found.most_common(NOTED))
                more = ", ..." if len(found) > NOTED else ""
                said = f"pieces {what} are left out ({found.total()}), and others may be placed there"
                self.notes.append(f"{self.prefix}: {said}: {called}{more}")
        taken: set[str] = set()
        bodies = shapely.STRtree([wall.body for wall in self.walls or ()])
        shapes = shapely.STRtree([gap.shape for gap in self.gaps])
        for drawn in self.rooms:
            room_id = f"{self.prefix}/{unused(drawn.label, taken)}"
            told = names.room_type(drawn.name, [piece.item.category for piece in drawn.pieces])
            kind = told or room_type
            if kind is None or kind == NO_ROOM:
                unknown = f"{UNTOLD}; expected a name or furniture that does{or_else}"
                self.left_out.append((room_id, NOBODYS if kind else unknown))
                continue
            standing = _tucked([piece.item for piece in drawn.pieces])
            pieces = [replace(piece, item=item) for piece, item in zip(drawn.pieces, standing, strict=True)]
            items = lifted(standing, {k for k, piece in enumerate(pieces) if moves(piece)})
            about = drawn.floor.buffer(NEAR + ACROSS)
            near = [self.gaps[k] for k in sorted(shapes.query(about, predicate="intersects"))]
            gaps = sorted(near, key=lambda gap: gap.kind != "door")[
                :MOST_OPENINGS
            ]  # of two in one place the door counts
            walls = self.walls and [self.walls[k] for k in sorted(bodies.query(about, predicate="intersects"))]
            if walls:
                gaps += self._passages(drawn, walls, gaps)
            try:
                room, held = room_of(room_id, kind, drawn.floor, walls, gaps, items, group)
            except RoomError as error:
                self.left_out.append((room_id, str(error)))
                continue
            cut = {items[k].category for k, item in held.items() if item is not items[k]}
            beyond = {item.category for k, item in enumerate(items) if k not in held}
            for what, those in (("stays as an obstacle as far as it is indoors", cut), ("left out", beyond)):
                if those:
                    called = ", ".join(sorted(those))
                    self.notes.append(f"{room_id}: {what}, since it reaches beyond the walls: {called}")
            for k, item in held.items():
                if item is not items[k]:
                    pieces[k] = replace(pieces[k], item=item, known=False)
            if told is None:
                self.notes.append(taken_for(room))
            yield room, [pieces[k] for k in held]


def _filled(walls: shapely.Geometry | None) -> shapely.Geometry:
    """Walls, and all that they enclose."""
    return shapely.union_all([Polygon(part.exterior) for part in shapely.get_parts(walls)])


def unused(name: str, taken: set[str]) -> str:
    """The name, with a number behind it where it is taken; from now on it is taken."""
    numbered = (f"{name} ({k})" if k > 1 else name for k in count(1))
    found = next(each for each in numbered if each not in taken)
    taken.add(found)
    return found


def oblong(x: float, y: float, width: float, depth: float, degrees: float) -> Polygon:
    """A rectangle around (x, y), `width` along its own x, turned counter-clockwise."""
    return translate(rotate(box(-width / 2, -depth / 2, width / 2, depth / 2), degrees, origin=(0, 0)), x, y)


def floor_of(points: Sequence[tuple[float, float]]) -> Polygon:
    """The floor that a ring of points bounds, whichever way round; where it crosses itself, its largest part.

    Raises RoomError where there is none.
    """
    if len(points) > MOST:
        raise RoomError("outline", f"expected at most {MOST:,} corners; got {len(points):,}")
    for point in points:
        lengths(point)
    if len(points) < 3:
        raise RoomError("outline", f"expected three corners or more; got {len(points)}")
    polygon = Polygon(points)
    if len(points) > MOST_CROSSING and not polygon.is_valid:  # mending takes as long as there are crossings
        raise RoomError("outline", "expected a border that does not cross itself")
    return _parts(shapely.make_valid(polygon))[0]


def tidy(floor: Polygon, walls: shapely.Geometry | None) -> list[Polygon]:
    """A floor without what walls take of it, what is too narrow to be floor, and slips of the hand; largest part first.

    People trace thresholds of doors and jogs of a few centimetres, and one floor through a door frame, on both sides of
    a wall. Raises RoomError where nothing is left.
    """
    free = floor if walls is None else floor.difference(walls)
    first, *others = _parts(without_narrow(free, NARROW))
    return [_straight(part) for part in (first, *(part for part in others if part.area > ROOM))]


def _straight(part: Polygon) -> Polygon:
    # Normalised first: a ring that starts at its lowest left point starts at a true corner.
    simple = part.normalize().simplify(JOG)
    straight = Polygon(_upright(simple.exterior.coords[:-1]), [h.coords for h in simple.interiors])
    return orient(straight if straight.is_valid else simple)


def _parts(shape: shapely.Geometry) -> list[Polygon]:
    """The parts of a floor, the largest first."""
    parts = [part for part in shapely.get_parts(shape) if isinstance(part, Polygon) and part.area > NARROW**2]
    if not parts:
        raise RoomError("outline", "expected a floor; it has no area to stand on")
    return sorted(parts, key=lambda part: -part.area)


def _upright(ring: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """The ring with sides that all but lie along an axis laid along it: a jog that was cut off makes others lean."""
    corners = np.array(ring)
    for k in range(len(corners)):
        n = (k + 1) % len(corners)
        step = np.abs(corners[n] - corners[k])
        across = int(step.argmin())
        if step[across] < math.tan(math.radians(LEAN)) * step[1 - across]:
            corners[[k, n], across] = corners[[k, n], across].mean()
    return [(float(x), float(y)) for x, y in corners]


def room_of(
    room_id: str,
    room_type: str,
    floor: Polygon,
    walls: Sequence[Wall] | None,
    gaps: Iterable[DrawnOpening],
    furniture: Sequence[Item],
    group: str,
) -> tuple[Room, dict[int, Item]]:
    """A room around a tidy floor, and what it holds of `furniture`, by its index: `cut_to`.

    `walls` are all that are near, of which each side takes the one that it lies along; None where none are drawn.
    Of `gaps` those that lie in its walls are its doors and windows. Raises RoomError where no room can be made.
    """
    floor = shapely.set_precision(floor, 10.0**-DIGITS)
    floor = orient(_parts(floor)[0])
    outline, holes = _ring(floor.exterior.coords), [_ring(hole.coords) for hole in floor.interiors]
    strips = _strips(outline, walls)
    band = shapely.union_all(strips).difference(Polygon(outline))
    openings: list[DrawnOpening] = []
    for gap in gaps:
        width = math.hypot(*gap.sides[0])
        for ring in rings(_drawn_out(gap).intersection(band)):
            shape = Polygon(ring)
            beside = shape.buffer(TOLERANCE).intersection(floor.exterior).length
            if beside > width / 2 and not is_drawn_before(shape, [other.shape for other in openings]):
                openings.append(DrawnOpening(gap.kind, shape))
    document: dict[str, object] = {
        "id": room_id,
        "room_type": room_type,
        "outline": [list(corner) for corner in outline],
        "holes": [[list(corner) for corner in hole] for hole in holes],
        "walls": [{"polygon": wall} for wall in _walls(strips, floor, openings)],
        "doors": [{"polygon": _list(gap.shape)} for gap in openings if gap.kind == "door"],
        "windows": [{"polygon": _list(gap.shape)} for gap in openings if gap.kind == "window"],
        "furniture": [],
        "group": group,
    }
    bare = room_from_dict(document)
    held = {k: kept for k, item in enumerate(furniture) if (kept := cut_to(bare, item))}
    return room_from_dict(document | {"furniture": [_document(item) for item in held.values()]}), held


def cut_to(room: Room, item: Item) -> Item | None:
    """The item, where it is to be placed or the room holds it; else what of it lies indoors, as an obstacle.

    People draw furniture a few centimetres through a wall: nothing else may stand there. None where next to nothing of
    it is indoors.
    """
    if item.center is None or room.holds(item):
        return item
    indoors = rotate(item.footprint.intersection(room.indoor), -item.degrees, origin=(0, 0))
    if indoors.area < LEAST:
        return None
    middle = np.array(indoors.representative_point().coords[0])
    low, high = np.array(indoors.bounds).reshape(2, 2)
    for share in SHARES:  # where it leans to a wall, a corner of its box may still reach through
        start, end = middle + share * (low - middle), middle + share * (high - middle)
        x, y = rotation(item.degrees) @ ((start + end) / 2)
        depth, width = (end - start).tolist()
        part = Item(OBSTACLE, (depth, width), (float(x), float(y)), item.rotation, tucked=item.tucked)
        if min(part.size) > TOLERANCE and room.holds(part, 0.0):
            return part
    return None


def _strips(outline: Ring, walls: Sequence[Wall] | None) -> list[Polygon]:
    """For each side of an outline the wall outside it, as thick as what is drawn there, round its corners."""
    sides = list(pairwise((*outline, outline[0])))
    bodies = shapely.STRtree([wall.body for wall in walls or ()])
    depths = [WALL_THICKNESS if walls is None else _depth(*side, walls, bodies) for side in sides]
    strips = []
    for k, ((x0, y0), (x1, y1)) in enumerate(sides):
        length = math.dist((x0, y0), (x1, y1))
        ax, ay = (x1 - x0) / length, (y1 - y0) / length
        before, depth, after = depths[k - 1], depths[k], depths[(k + 1) % len(depths)]
        start, end = (x0 - ax * before, y0 - ay * before), (x1 + ax * after, y1 + ay * after)
        out = (ay * depth, -ax * depth)  # on the right of a counter-clockwise side
        strips.append(Polygon((start, (start[0] + out[0], start[1] + out[1]), (end[0] + out[0], end[1] + out[1]), end)))
    return strips


def _depth(
    start: tuple[float, float], end: tuple[float, float], walls: Sequence[Wall], bodies: shapely.STRtree
) -> float:
    """How far the wall outside a side reaches: that along most of it."""
    (x0, y0), (x1, y1) = start, end
    length = math.dist(start, end)
    out = ((y1 - y0) / length * NEAR, (x0 - x1) / length * NEAR)
    strip = Polygon((start, (x0 + out[0], y0 + out[1]), (x1 + out[0], y1 + out[1]), end))
    near = [walls[k] for k in sorted(bodies.query(strip, predicate="intersects"))[:MOST_WALLS]]
    shared = [(wall.body.intersection(strip).area, wall) for wall in near]
    area, wall = max(shared, key=lambda found: found[0], default=(0.0, None))
    if wall is None or area < 0.2 * strip.area:
        return LINING
    middle = shapely.LineString((start, end))
    return max(LINING, wall.body.intersection(strip).distance(middle) + wall.thickness)


def _walls(strips: list[Polygon], floor: Polygon, openings: list[DrawnOpening]) -> list[list[list[float]]]:
    """The strips, cut by floor, openings and earlier strips; columns are solid."""
    taken = shapely.union_all([Polygon(floor.exterior), *(gap.shape for gap in openings)])
    walls = [[list(corner) for corner in hole.coords[:-1]] for hole in floor.interiors]
    for strip in strips:
        kept = without_films(strip.difference(taken), 1e-6)
        walls += [[list(corner) for corner in ring] for ring in rings(kept)]
        taken = taken.union(strip)
    return walls


def _drawn_out(gap: DrawnOpening) -> Polygon:
    """An opening, deeper by ACROSS on both sides."""
    along, through = gap.sides
    degrees = math.degrees(math.atan2(along[1], along[0]))
    center = gap.shape.minimum_rotated_rectangle.centroid
    return oblong(center.x, center.y, math.hypot(*along), math.hypot(*through) + 2 * ACROSS, degrees)


def _tucked(items: list[Item]) -> list[Item]:
    """The items, of which chairs that stand partly under a table or desk do so by intent."""
    hosts = [item.footprint for item in items if item.category in HOSTS and item.center]
    return [
        replace(item, tucked=True)
        if item.category in ("chair", "stool") and item.center and any(item.footprint.intersects(h) for h in hosts)
        else item
        for item in items
    ]


def _document(item: Item) -> dict[str, object]:
    entry: dict[str, object] = {
        "category": item.category,
        "size": [round(side, DIGITS) for side in item.size],
        "shape": item.form,
        "tucked": item.tucked,
    }
    if item.center is not None and item.rotation is not None:
        entry |= {
            "center": [round(c, DIGITS) for c in item.center],
            "rotation": round(item.rotation, DIGITS) % 360,
        }
    return entry


def _ring(coords: Iterable[Sequence[float]]) -> Ring:
    return tuple((round(x, DIGITS), round(y, DIGITS)) for x, y in list(coords)[:-1])


def _list(shape: Polygon) -> list[list[float]]:
    return [list(corner) for corner in shape.exterior.coords[:-1]]


# Documents -----------------------------------------------------------------------------------------------------------


def loaded(text: bytes) -> Any:
    """A document of JSON. Raises RoomError for what is none."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:  # brackets or digits without end, too
        reason = error.msg if isinstance(error, json.JSONDecodeError) else "numbers and nesting of a usual size"
        raise RoomError("text", f"expected whole JSON; {reason}") from None


def lengths(values: Iterable[Any]) -> tuple[float, ...]:
    """Numbers of a document, metres. Raises RoomError for what is none, or is no length in a house."""
    return tuple(map(length, values))


def length(number: Any) -> float:
    """A number of a document, as `lengths` has them."""
    if isinstance(number, bool) or not isinstance(number, int | float) or not abs(number) <= LARGEST:
        raise RoomError("a number", f"expected a finite one of at most {LARGEST:g} (metres); got {_short(number)}")
    return float(number)


def _short(value: Any) -> str:
    return "a huge integer" if isinstance(value, int) else repr(value)[:40]
