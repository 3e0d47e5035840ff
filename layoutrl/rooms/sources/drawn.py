"""Rooms from what plans draw of a storey: floors, walls, doors, windows and pieces of furniture; metres, y up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from typing import Generic, TypeVar

import shapely
from shapely.geometry import Polygon

from layoutrl.rooms.brief import lifted
from layoutrl.rooms.categories import NO_ROOM, NOTED, Names
from layoutrl.rooms.clearances import HOSTS, PASSAGE
from layoutrl.rooms.collection import NOBODYS, ODD, UNTOLD, taken_for
from layoutrl.rooms.room import FILM, Item, Room, RoomError
from layoutrl.rooms.sources.floors import NARROW, ROOM, tidy
from layoutrl.rooms.sources.walls import ACROSS, LEAST, NEAR, DrawnOpening, Wall, room_of

MOST_OPENINGS = 30  # that are looked at about one room
HIGHEST = 0.3  # metres: what hangs higher is decor
FLATTEST = 0.1  # metres: carpets are lower


@dataclass(frozen=True)
class Piece:
    """A piece of furniture that stands on a floor: the item that it is, and whether its category is known."""

    item: Item
    known: bool


P = TypeVar("P", bound=Piece)


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
    untold: set[str] = field(default_factory=set)  # ids of finished rooms of which nothing tells the type
    why_odd: str = ""  # what is expected of the first of these of which it is known

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
    def or_left_out(self, called: str, decor: Callable[[], bool] = bool) -> Iterator[None]:
        """Leave out the piece that is read inside where a field of it is missing or odd: it costs itself alone. It is
        counted unless it is `decor`."""
        try:
            yield
        except ODD as error:  # a RoomError is one
            if not decor():
                self.odd[called] += 1
                self.why_odd = self.why_odd or (str(error) if isinstance(error, RoomError) else "")

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
        why_odd = f" (the first: {self.why_odd})" if self.why_odd else ""
        for what, found, why in (
            ("of unknown size", self.unsized, ""),
            ("with a missing or odd field", self.odd, why_odd),
        ):
            if found:
                called = ", ".join(f"{name[:40]} ({n})" for name, n in found.most_common(NOTED))
                more = ", ..." if len(found) > NOTED else ""
                said = f"pieces {what} are left out ({found.total()}), and others may be placed there"
                self.notes.append(f"{self.prefix}: {said}: {called}{more}{why}")
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
            gaps = sorted(near, key=lambda gap: gap.kind != "door")  # of two in one place the door counts
            del gaps[MOST_OPENINGS:]
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
                self.untold.add(room_id)
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


def _tucked(items: list[Item]) -> list[Item]:
    """The items, of which chairs that stand partly under a table or desk do so by intent."""
    hosts = [item.footprint for item in items if item.category in HOSTS and item.center]
    return [
        replace(item, tucked=True)
        if item.category in ("chair", "stool") and item.center and any(item.footprint.intersects(h) for h in hosts)
        else item
        for item in items
    ]
