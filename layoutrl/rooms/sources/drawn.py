"""Build the rooms of a storey from a drawing of floors, walls, doors, windows and furniture; metres, y up."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import count
from typing import Generic, TypeVar

import shapely
from shapely.geometry import Polygon

from layoutrl.rooms.brief import without_poses
from layoutrl.rooms.categories import DESIGNED, NO_ROOM, NOTED, Names
from layoutrl.rooms.clearances import HOSTS, PASSAGE
from layoutrl.rooms.collection import NOBODYS, ODD, UNTOLD, taken_for
from layoutrl.rooms.room import FILM, Item, Room, RoomError
from layoutrl.rooms.sources.floors import MIN_FLOOR_WIDTH, MIN_ROOM_AREA, tidy
from layoutrl.rooms.sources.walls import ACROSS, LEAST, NEAR, DrawnOpening, Wall, room_of

MOST_OPENINGS = 30  # that are considered for one room
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
    label: str  # its part of the room's id: the name, or a number
    traced: Polygon
    floor: Polygon
    pieces: list[P] = field(default_factory=list)


@dataclass
class Storey(Generic[P]):
    """The drawing of one storey. The ids of its rooms begin with `prefix`.

    Fill it in this order, since unions of shapes are cached: all `walls`, all rooms (`add_room`), all pieces
    (`add_piece`). Set `openings` before `make_rooms` is called.
    """

    prefix: str
    walls: list[Wall] | None = None  # None where the format draws none
    openings: list[DrawnOpening] = field(default_factory=list)
    rooms: list[DrawnRoom[P]] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unsized: Counter[str] = field(default_factory=Counter)  # pieces left out since their size is unknown, by name
    odd: Counter[str] = field(default_factory=Counter)  # pieces left out since a field is missing or odd, by name
    untold: set[str] = field(default_factory=set)  # ids of rooms that were made although nothing tells their type
    why_odd: str = ""  # the first RoomError of an odd piece

    @cached_property
    def _bodies(self) -> shapely.Geometry | None:
        return shapely.union_all([wall.body for wall in self.walls]) if self.walls else None

    @property
    def enclosed(self) -> list[Polygon]:
        """The areas that walls enclose, the largest first, without those of at most MIN_ROOM_AREA.

        Gaps in walls that are narrower than MIN_FLOOR_WIDTH count as closed, as in `tidy`.
        """
        if self._bodies is None:
            return []
        half = MIN_FLOOR_WIDTH / 2
        closed = self._bodies.buffer(half, join_style="mitre").buffer(-half, join_style="mitre")
        floors = shapely.get_parts(_filled(closed).difference(closed))
        return sorted((part for part in floors if part.area > MIN_ROOM_AREA), key=lambda part: -part.area)

    def add_room(self, name: str | None, label: str, floor: Callable[[], Polygon]) -> None:
        """Add a room, or several where walls cut its floor.

        `floor` returns the floor as traced; where it raises RoomError, the room is left out.
        """
        try:
            traced = floor()
            self.rooms += [DrawnRoom(name, label, traced, part) for part in tidy(traced, self._bodies)]
        except RoomError as error:
            self.left_out.append((f"{self.prefix}/{label}", str(error)))

    @cached_property
    def _traced(self) -> shapely.STRtree:
        return shapely.STRtree([room.traced for room in self.rooms])

    def add_piece(self, piece: P) -> bool:
        """Put a piece into the room that its centre is in, and return whether there is one.

        Where rooms overlap, it is the one whose tidied floor is nearest, then one with a name, then the smallest:
        people draw slabs and ceilings as rooms, too.
        """
        center = shapely.Point(piece.item.center)
        inside = [self.rooms[k] for k in self._traced.query(center, predicate="intersects")]
        if not inside:
            return False
        room = min(inside, key=lambda room: (room.floor.distance(center), not room.name, room.traced.area))
        room.pieces.append(piece)
        return True

    @contextmanager
    def or_left_out(self, called: str, decor: Callable[[], bool] = lambda: False) -> Iterator[None]:
        """Leave out the piece that is read in this context, and nothing else, where a field of it is missing or odd.

        It is counted in `odd` as `called`, unless `decor()` is true.
        """
        try:
            yield
        except ODD as error:  # includes RoomError
            if not decor():
                self.odd[called] += 1
                self.why_odd = self.why_odd or (str(error) if isinstance(error, RoomError) else "")

    @cached_property
    def building(self) -> shapely.Geometry:
        """The union of all rooms, all walls and what walls enclose."""
        return shapely.union_all([_filled(self._bodies), *(room.traced for room in self.rooms)])

    def add_immovable(self, piece: P) -> None:
        """Add a piece that stands in no room to the room that it reaches into most, if by more than LEAST.

        It is marked as not known, so that it stays where it is.
        """
        shape = piece.item.footprint
        beside = [self.rooms[k] for k in self._traced.query(shape, predicate="intersects")]
        shared = {k: room.floor.intersection(shape).area for k, room in enumerate(beside)}
        most = max(shared, key=shared.__getitem__, default=None)
        if most is not None and shared[most] > LEAST:
            beside[most].pieces.append(replace(piece, known=False))

    def _passages(
        self, room: DrawnRoom[P], walls: Sequence[Wall], openings: Sequence[DrawnOpening]
    ) -> list[DrawnOpening]:
        """Return where a floor adjoins another room's with no wall or opening between, as doors.

        Each lies along one side of the floor, is at least PASSAGE wide, and keeps NEAR off corners, walls and openings.
        """
        near = [self.rooms[k] for k in sorted(self._traced.query(room.floor.buffer(NEAR), predicate="intersects"))]
        floors = [other.floor for other in near if other is not room]
        # Without slabs and ceilings.
        beside = [floor for floor in floors if floor.intersection(room.floor).area < MIN_ROOM_AREA]
        solid = [*(wall.body for wall in walls), *(opening.shape for opening in openings)]
        border = room.floor.exterior.intersection(shapely.union_all(beside).buffer(NEAR))
        ends = shapely.MultiPoint(room.floor.exterior.coords)
        ways = shapely.get_parts(border.difference(shapely.union_all([*solid, ends]).buffer(NEAR)))
        return [DrawnOpening("door", way.buffer(FILM, cap_style="flat"), way) for way in ways if way.length >= PASSAGE]

    def make_rooms(
        self,
        names: Names,
        group: str,
        room_type: str | None,
        moves: Callable[[P], bool] = lambda _: False,
        named: Collection[str] = (),
        or_else: str = "",
    ) -> Iterator[tuple[Room, list[P]]]:
        """Yield (room, its pieces) for every room that has a type and can be made; add the others to `left_out`.

        Pieces for which `moves` is true have no pose in the room: they are to be placed. Of what reaches beyond the
        walls, these are only the categories that the designer gives such a room, or that are `named`: all else is in
        the way. `room_type` is assigned to rooms whose type neither name nor furniture tells. If it is None, they are
        left out, and `or_else` ends the reason with an option that would help.
        """
        self._note_left_out()
        taken: set[str] = set()
        bodies = shapely.STRtree([wall.body for wall in self.walls or ()])
        shapes = shapely.STRtree([opening.shape for opening in self.openings])
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
            anew = {k for k, piece in enumerate(pieces) if moves(piece)}
            sure = {k for k in anew if pieces[k].item.category in DESIGNED[kind].union(named)}
            items = without_poses(standing, sure)
            walls, openings = self._around(drawn, bodies, shapes)
            try:
                room, held = room_of(room_id, kind, drawn.floor, walls, openings, items, group)
            except RoomError as error:
                self.left_out.append((room_id, str(error)))
                continue
            cut = {k: item for k, item in held.items() if item is not items[k]}
            beyond = [item for k, item in enumerate(items) if k not in held]
            self._note_beyond(room_id, "stays as an obstacle as far as it is indoors", [items[k] for k in cut])
            self._note_beyond(room_id, "left out", beyond)
            for k, item in cut.items():
                pieces[k] = replace(pieces[k], item=item, known=False)
            # Of the others, what is not cut by a wall loses its pose only now.
            free = {n for n, k in enumerate(held) if k in anew - sure and pieces[k].known}
            room = replace(room, furniture=without_poses(room.furniture, free))
            if told is None:
                self.untold.add(room_id)
                self.notes.append(taken_for(room))
            yield room, [pieces[k] for k in held]

    def _around(
        self, room: DrawnRoom[P], bodies: shapely.STRtree, shapes: shapely.STRtree
    ) -> tuple[list[Wall] | None, list[DrawnOpening]]:
        """Return the walls and openings near a room, passages included; None for walls where the format draws none."""
        about = room.floor.buffer(NEAR + ACROSS)
        near = [self.openings[k] for k in sorted(shapes.query(about, predicate="intersects"))]
        # Doors first: of two in one place the first counts.
        openings = sorted(near, key=lambda opening: opening.kind != "door")[:MOST_OPENINGS]
        walls = self.walls and [self.walls[k] for k in sorted(bodies.query(about, predicate="intersects"))]
        if walls:
            openings += self._passages(room, walls, openings)
        return walls, openings

    def _note_left_out(self) -> None:
        """Note which pieces are left out: those of unknown size, and those with a missing or odd field."""
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

    def _note_beyond(self, room_id: str, what: str, items: Sequence[Item]) -> None:
        """Note what became of items that reach beyond the walls, if there are any."""
        if called := ", ".join(sorted({item.category for item in items})):
            self.notes.append(f"{room_id}: {what}, since it reaches beyond the walls: {called}")


def _filled(walls: shapely.Geometry | None) -> shapely.Geometry:
    """Walls, and all that they enclose."""
    return shapely.union_all([Polygon(part.exterior) for part in shapely.get_parts(walls)])


def unused(name: str, taken: set[str]) -> str:
    """Return the name, with a number behind it if it is in `taken`, and add the result to `taken`."""
    numbered = (f"{name} ({k})" if k > 1 else name for k in count(1))
    found = next(each for each in numbered if each not in taken)
    taken.add(found)
    return found


def _tucked(items: list[Item]) -> list[Item]:
    """Return the items, with chairs and stools marked as tucked that overlap a table or desk."""
    hosts = [item.footprint for item in items if item.category in HOSTS and item.center]
    return [
        replace(item, tucked=True)
        if item.category in ("chair", "stool") and item.center and any(item.footprint.intersects(h) for h in hosts)
        else item
        for item in items
    ]
