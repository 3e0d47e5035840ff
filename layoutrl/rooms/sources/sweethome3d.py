"""Read homes of Sweet Home 3D (.sh3d, .sh3x) as rooms, and write them back whole with placed furniture moved.

A home is a ZIP with `Home.xml`: centimetres, y down, radians clockwise. A piece's width is along its own x, its depth
along its own y, and it faces along y: down, where it is not turned.
"""

from __future__ import annotations

import cmath
import math
import shutil
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from xml.parsers import expat

from shapely.geometry import Polygon

from layoutrl import InputError
from layoutrl.rooms.brief import without_poses
from layoutrl.rooms.categories import ALL, DESIGNED, HOLDS, Names, names_in, names_of
from layoutrl.rooms.collection import Collection, naming
from layoutrl.rooms.files import HOMES, check_new, files_below, name_of
from layoutrl.rooms.room import Item, Room, RoomError
from layoutrl.rooms.sources.drawn import Storey, unused
from layoutrl.rooms.sources.home_parts import (
    HomePiece,
    all_standing_on,
    find_supports,
    openings_of,
    opens,
    piece_of,
    traced,
    visible,
    walls_of,
)
from layoutrl.rooms.sources.home_xml import (
    GROUP,
    HOME,
    OPENING,
    PIECES,
    Element,
    changed,
    elements_of,
    within,
    write_home,
    xml_of,
)

MOST_PAIRS = 15_000  # rooms times walls of a home


@dataclass
class Home:
    """A home that was read: its rooms, and how to write it back."""

    path: Path
    collection: Collection
    pieces: dict[str, list[HomePiece]]  # by room id, in the order of the room's furniture
    xml: bytes

    @property
    def suffix(self) -> str:
        """The suffix of the files that it is written to: that of the home."""
        return self.path.suffix.lower()

    @property
    def rooms(self) -> list[Room]:
        """The rooms; items that are to be placed have no center."""
        return self.collection.rooms

    @property
    def stood(self) -> list[tuple[Item, ...]]:
        """The furniture of each room as the home has it: what the room got from outside all rooms still stands there.

        What comes from another level than the room's has no pose.
        """
        return [tuple(piece.stood for piece in self.pieces[room.id]) for room in self.rooms]

    def write(self, layouts: Iterable[Room], out: Path | str) -> None:
        """Write the whole home, with the items that were placed moved to where these layouts have them.

        Nothing else changes: every other entry of the file is the same, byte for byte, and so is every attribute but
        x, y and angle of what was placed, and level where it goes to another. Raises InputError where `out` is there
        already, has another suffix or cannot be written.
        """
        check_new(out, self.suffix)
        changes: dict[int, dict[str, float | str]] = {}
        asked = {room.id: room for room in self.rooms}
        for layout in layouts:
            pieces = self.pieces[layout.id]
            for piece, before, item in zip(pieces, asked[layout.id].furniture, layout.furniture, strict=True):
                if before.center is None and item.center is not None:
                    changes |= _moved(piece, item)
        xml = changed(self.xml, changes)
        try:
            if xml == self.xml:
                shutil.copyfile(self.path, out)
            else:
                write_home(self.path, Path(out), xml)
        except OSError as error:
            raise InputError(f"out: {out} cannot be written ({error.strerror})") from None


def read_home(
    path: Path,
    *,
    move: str | None = None,
    into: str | None = None,
    room_type: str | None = None,
    names: Names | None = None,
) -> Home:
    """Read a home. Every room of every level is a room of its own, whose id begins with the file's name.

    `move`, `into` and `room_type` are those of `layoutrl.rooms.formats.opened`. Raises InputError for a file that is
    no home, and for an `into` that is none of its rooms.
    """
    names = names or names_of()
    home = _home(path, path.stem, names, move, room_type, into, alone=True)
    home.collection.notes += names.notes()
    return home


def _home(
    path: Path,
    name: str,
    names: Names,
    move: str | None,
    room_type: str | None,
    into: str | None = None,
    *,
    alone: bool = False,
) -> Home:
    """Read a home as `read_home` does, without notes on unknown names: the caller takes them from `names`.

    Where it is read `alone`, messages suggest the options `room_type` and `into`.
    """
    or_else = ", or room_type=<type>" if alone else ""
    xml = xml_of(path)
    try:
        elements = elements_of(xml)
        storeys, outside, walled = _storeys(elements, name, names)
    except RoomError as error:
        raise InputError(f"{path}: {HOME}: {error}") from None
    except expat.ExpatError as error:
        what = expat.errors.messages.get(error.code, "no XML")
        raise InputError(f"{path}: {HOME}, line {error.lineno}: expected whole XML; got {what}") from None
    home = Home(path, Collection(f"home {path}"), {}, xml)
    moved = None if move is None else names_in(move)
    levels: dict[str, str | None] = {}  # of rooms, by their ids
    for level, storey in storeys.items():
        made = storey.make_rooms(names, name, room_type, lambda each: _moves(each, moved, False), moved or (), or_else)
        for read, pieces in made:
            home.collection.rooms.append(read)
            home.pieces[read.id] = pieces
            levels[read.id] = level
        home.collection.left_out += storey.left_out
        home.collection.notes += storey.notes
    if not any(element.tag == "room" for element in elements) and not any(s.rooms for s in storeys.values()):
        why = "no room is drawn in it, and walls enclose none; expected some, drawn by Create rooms"
        home.collection.left_out.append((str(path), why))
    parked = [(level, piece) for level, piece in outside if _moves(piece, moved, True)]
    if moved is None or ALL in moved:
        still = [piece for _, piece in outside if piece.known and not _moves(piece, moved, True)]
        said = "outside all rooms stays there: the home does not let it move"
        home.collection.notes += [f"the {piece.item.category} {said}" for piece in still]
    if stay := sorted({piece.item.category for piece in walled if _moves(piece, moved, True)}):
        said = "stays where it is, at or within walls but in no drawn room"
        home.collection.notes.append(f"{said}: {', '.join(stay)} (draw its room, or park it away from all walls)")
    untold = {room_id for storey in storeys.values() for room_id in storey.untold}
    _park(home, levels, untold, parked, into, alone)
    return home


def read(root: Path, names: Names, room_type: str | None = None) -> Collection:
    """Return the rooms of one home, or of all below a folder, with all furniture where it stands."""
    return read_folder(root, names, move="", room_type=room_type)[0]


def read_folder(
    root: Path, names: Names, *, move: str | None, room_type: str | None
) -> tuple[Collection, list[tuple[Item, ...]]]:
    """Return the rooms of one home, or of all below a folder, as `read_home` reads them, and `Home.stood` of each.

    A home that cannot be read is left out. Raises InputError where there is no file of a home.
    """
    files = files_below(root, HOMES)
    if not files:
        raise InputError(
            f"no homes in {root.absolute()}: expected .sh3d or .sh3x files; name their folder with data.root=..."
        )
    collection = Collection(f"homes {root}")
    stood: list[tuple[Item, ...]] = []
    for file in files:
        name = name_of(file, root)
        try:
            home = _home(file, name, names, move, room_type)
        except InputError as error:
            collection.left_out.append((str(file), str(error).removeprefix(f"{file}: ")))
            continue
        collection.rooms += home.rooms
        collection.left_out += home.collection.left_out
        own = f"{name}/", f"{name}: "  # notes that name the home themselves
        collection.notes += [n if n.startswith(own) else f"{name}: {n}" for n in home.collection.notes]
        collection.homeless += home.collection.homeless
        stood += home.stood
    collection.notes += names.notes()
    return collection, stood


# From elements to storeys and rooms ----------------------------------------------------------------------------------


def _storeys(
    elements: list[Element], name: str, names: Names
) -> tuple[dict[str | None, Storey[HomePiece]], list[tuple[str | None, HomePiece]], list[HomePiece]]:
    """Return the storeys; (level, piece) of what is outside the building; and the pieces in it, but in no room.

    Storeys hold the pieces in their rooms. They are named by the id of their first level, None for what has no level.
    Levels of one elevation are layers of one storey. One that is hidden beside one that is not is left out: it shows
    how the home was before, or may be. Raises RoomError for malformed numbers, and for too many rooms and walls.
    """
    named = {e.attributes.get("id"): e for e in elements if e.tag == "level"}
    heights = {k: e.number("elevation") if "elevation" in e.attributes else k for k, e in named.items()}
    shown = {heights[level] for level, element in named.items() if element.flag("viewable", True)}
    hidden = [k for k, e in named.items() if not e.flag("viewable", True) and heights[k] in shown]
    elements = [element for element in elements if element.attributes.get("level") not in hidden]
    first: dict[float | str | None, str | None] = {}  # level at each elevation
    joined = {level: first.setdefault(heights[level], level) for level in named if level not in hidden}
    storeys: dict[str | None, Storey[HomePiece]] = {}
    taken: set[str] = set()  # prefixes
    level_of: dict[int, str | None] = {}  # of each element, by its start
    for element in elements:
        level = joined.get(element.attributes.get("level"))
        if level not in storeys:
            called = "" if level is None else f"/{_label(named[level].attributes.get('name') or level)}"
            storeys[level] = Storey(unused(name + called, taken), [])
        level_of[element.start] = level
        storey = storeys[level]
        if element.tag == "wall" and storey.walls is not None:
            storey.walls += walls_of(element)
        for each in visible(element):
            if opens(each):
                storey.openings += openings_of(each)
    for level in hidden:
        if beside := storeys.get(first[heights[level]]):
            name = named[level].attributes.get("name") or str(level)
            beside.notes.append(f"{beside.prefix}: the level {name!r} of its elevation is hidden, and is not read")
    _draw_rooms(elements, storeys, level_of)
    furniture = [e for e in elements if e.tag in (*PIECES, GROUP) and not opens(e) and e.flag("visible", True)]
    carried: set[int] = set()
    standing_on: dict[int, list[Element]] = {}
    for level in storeys:
        find_supports([element for element in furniture if level_of[element.start] == level], carried, standing_on)
    resting = {each.start for those in standing_on.values() for each in those}
    seen = ((e.start, piece_of(e, names, e.start in carried, e.start in resting)) for e in furniture)
    pieces = {start: piece for start, piece in seen if piece}  # a bed may rest on a platform
    outside, walled = [], []
    for start, piece in pieces.items():
        level = level_of[start]
        storey = storeys[level]
        piece = replace(piece, on=tuple(e for e in all_standing_on(start, standing_on) if e.start not in pieces))
        if storey.add_piece(piece):
            continue
        if storey.building.intersects(piece.item.footprint):
            if piece.known:  # others, as a rail or a gutter, are part of the building
                storey.add_immovable(piece)
            walled.append(piece)
        else:
            outside.append((level, piece))
    return storeys, outside, walled


def _draw_rooms(
    elements: list[Element], storeys: dict[str | None, Storey[HomePiece]], level_of: dict[int, str | None]
) -> None:
    """Draw the rooms of each storey; where none are drawn, the areas that walls enclose: many people draw walls alone.

    Raises RoomError where there are too many rooms and walls.
    """
    rooms = [element for element in elements if element.tag == "room"]
    walls = sum(element.tag == "wall" for element in elements)
    drawn = {level_of[element.start] for element in rooms}
    enclosed = {level: storey.enclosed for level, storey in storeys.items() if level not in drawn}
    count = len(rooms) + sum(map(len, enclosed.values()))
    if count * walls > MOST_PAIRS:
        raise RoomError("room", f"expected at most {MOST_PAIRS // walls} rooms beside {walls} walls; got {count}")
    for number, element in enumerate(rooms, 1):
        called = (element.attributes.get("name") or "").strip()
        storeys[level_of[element.start]].add_room(called, _label(called or f"room {number}"), partial(traced, element))
    for level, floors in enclosed.items():
        storey = storeys[level]
        for number, floor in enumerate(floors, 1):
            storey.add_room("", f"room {number}", partial(Polygon, floor))
        if floors:
            said = "no room is drawn; what walls enclose is taken for one (Create rooms draws them, with names)"
            storey.notes.append(f"{storey.prefix}: {said}")


def _label(name: str) -> str:
    """A name as a part of an id."""
    return name[:60].replace("/", "-")


# From drawn rooms to rooms -------------------------------------------------------------------------------------------


def _moves(piece: HomePiece, move: set[str] | None, parked: bool) -> bool:
    """Whether a piece is to be placed: one that `move` names or, if it is None, one `parked` outside all rooms.

    An unknown piece never is. One that the home does not let move is only if `move` names its own category.
    """
    called = parked if move is None else ALL in move
    named = move is not None and piece.item.category in move
    return piece.known and (named or (called and piece.may_move))


def _park(
    home: Home,
    levels: dict[str, str | None],
    untold: set[str],
    parked: list[tuple[str | None, HomePiece]],
    into: str | None,
    alone: bool,
) -> None:
    """Give each piece outside all rooms to a room: to `into` or, the largest piece first, to one that suits it.

    A room suits if its type holds such a piece and it has the floor for it. Preferred is one whose type is not
    `untold`, then one on its level, then one whose type the designer gives such pieces, so that agents can place it,
    then one without such a piece, then the one with the most floor free. A piece that no room suits stays, with a note.
    Raises InputError where `into` is no room of the home.
    """
    into = None if into is None else _room_meant(home, into)
    rooms = {room.id: room for room in home.rooms}
    held = {room.id: {item.category for item in room.furniture} for room in home.rooms}
    free = {room.id: room.indoor.area - sum(item.area for item in room.furniture) for room in home.rooms}
    given: dict[str, list[Item]] = defaultdict(list)
    for level, piece in sorted(parked, key=lambda entry: -entry[1].item.area):
        item = piece.item
        knowing = [k for k, room in rooms.items() if item.category in HOLDS[room.room_type]]
        fitting = [k for k in knowing if free[k] > item.area]
        if into is not None:
            chosen = into
        elif fitting:
            theirs = {k: item.category in DESIGNED[rooms[k].room_type] for k in fitting}
            chosen = min(
                fitting,
                key=lambda k: (k in untold, levels[k] != level, not theirs[k], item.category in held[k], -free[k]),
            )
        else:
            note = f"the {item.category} outside all rooms stays there: no room's type knows it, with floor for it"
            hinted = alone and (knowing or not rooms)
            home.collection.notes.append(f"{note} (into=<id>)" if hinted else note)
            home.collection.homeless.append(item.category)
            continue
        given[chosen].append(item)
        held[chosen].add(item.category)
        free[chosen] -= item.area
        stays = levels[chosen] == level
        home.pieces[chosen].append(piece if stays else replace(piece, level=levels[chosen] or ""))
    # Not of a part of the base plan that is named, and so goes to a room.
    none_fixed = all(piece.may_move for _, piece in parked)
    but_fixed = "; what is part of the base plan stays there" if none_fixed else ""
    for chosen, parts in given.items():
        called = ", ".join(sorted({item.category for item in parts}))
        home.collection.notes.append(f"{chosen}: gets {called} from outside all rooms{but_fixed}")
    for k, room in enumerate(home.rooms):
        items = (*room.furniture, *given[room.id])
        home.rooms[k] = replace(room, furniture=without_poses(items, range(len(room.furniture), len(items))))


def _room_meant(home: Home, into: str) -> str:
    """Return the id of the room that `into` names. Raises InputError unless it names one room of the home."""
    if into in home.pieces:
        return into
    whole = names_in(into)  # an id may have commas
    meant = [room_id for room_id in home.pieces if naming(into, room_id) == whole]
    if len(meant) == 1:
        return meant[0]
    why = "; ".join(dict.fromkeys(reason for _, reason in home.collection.left_out))
    mend = f"expected one of {', '.join(meant or home.pieces)}" if home.pieces else f"none could be read: {why}"
    has = "several rooms" if meant else "no room"
    raise InputError(f"into: {home.path} has {has} {into!r} to furnish; {mend}")


def _moved(piece: HomePiece, item: Item) -> dict[int, dict[str, float | str]]:
    """Return the values of x, y, angle and level that change when a piece goes to the pose of `item`.

    They are those of its element and of all in it and on it, by `Element.start`. Elevations count from the level, and
    stay.
    """
    assert item.center is not None
    element = piece.element
    old = complex(element.number("x"), element.number("y"))
    new = complex(item.center[0], -item.center[1]) * 100
    stays = item.rotation is None or item.form == "circle"
    turn = 0.0 if stays else math.radians(270 - item.degrees) - element.number("angle", 0.0)
    together = (element, *piece.on)
    inner = [e for whole in together for e in within(whole) if e.tag in (*PIECES, OPENING, GROUP)]
    changes: dict[int, dict[str, float | str]] = {}
    for each in (*together, *inner):
        place = new + (complex(each.number("x"), each.number("y")) - old) * cmath.rect(1, turn)
        angle = (each.number("angle", 0.0) + turn) % math.tau
        values = {"x": place.real, "y": place.imag, "angle": angle}
        changes[each.start] = {name: value for name, value in values.items() if not each.equals(name, value)}
        if piece.level is not None:
            changes[each.start]["level"] = piece.level
    return changes
