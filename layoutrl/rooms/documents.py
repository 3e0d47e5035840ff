"""A room in JSON: lengths in metres, y up.

    {"id": "b-17", "room_type": "bedroom",
     "outline": [[0, 0], [3.6, 0], [3.6, 4.2], [0, 4.2]],
     "walls": [{"polygon": [[-0.2, -0.2], [3.8, -0.2], [3.8, 0], [-0.2, 0]]}],
     "doors": [{"polygon": [[2.5, -0.2], [3.4, -0.2], [3.4, 0], [2.5, 0]]}],
     "windows": [],
     "furniture": [{"category": "bed", "center": [1.05, 2.0], "size": [2.1, 1.5], "rotation": 0},
                   {"category": "stool", "shape": "circle", "center": [3, 3], "size": [0.4, 0.4]}],
     "target": 0}

An item's `size` is its depth, from front to back, and its width. With rotation 0 its front is to the right, along x;
degrees go counter-clockwise.

Optional are `holes`, `walls` (default: a band of 0.2 m), `target` (default: the item of the type's main category, if
there is just one) and `group`; of an item, `center` (without it, the item is to be placed), `rotation` (default: 0 for
an item with a center; else it is to be chosen), `shape`, `tucked` (whether the item may stand under another; default:
true for a chair to be placed in a room with a desk or table, else false) and `locked` (whether an item with a center
stays there, whatever is to move).
What is called a `rug`, a `carpet` or a `mat` is floor: furniture may stand on it.
Fields of other names are the user's own: they are not read, and are kept where layouts are written (`with_layout`). One
that is spelled much like a field of ours is refused, and so is an item's `position`, `pos`, `x`, `y` or `angle` in the
place of its `center` or `rotation`.
Errors name the field and what is expected there.
"""

from __future__ import annotations

import difflib
import json
import math
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import shapely
from shapely.geometry import Polygon
from shapely.validation import explain_validity

from layoutrl.rooms.categories import NO_ROOM, own_names
from layoutrl.rooms.clearances import may_tuck
from layoutrl.rooms.faults import FAULTS
from layoutrl.rooms.oddities import ODDITIES
from layoutrl.rooms.room import (
    MAIN_ITEM,
    TOLERANCE,
    WALL_THICKNESS,
    Item,
    Opening,
    Ring,
    Room,
    RoomError,
    sole,
    wall_band,
)
from layoutrl.rooms.units import UNITS

REQUIRED = ("id", "room_type", "outline", "doors", "windows", "furniture")
OPTIONAL = ("holes", "walls", "target", "group")
LARGEST = 1000.0  # limit of any number in a room, metres or degrees: refuses NaN, infinity, lengths in millimetres
SMALLEST = 1e-12  # metres: what is nearer to zero is read as zero, since geometry divides by it
WINDOW_DEPTH = math.sqrt(2) * WALL_THICKNESS  # metres, at most, without `walls`: homes have windows deeper than walls
MOST_INSIDE = 0.5  # share of a door or window that may lie inside the room
MOST = 1000  # corners of a polygon, or entries of any other list, at most
ITEM_REQUIRED = ("category", "size")
ITEM_OPTIONAL = ("center", "rotation", "shape", "tucked", "locked")
# Names that others give our fields: a room or an item that has one of them instead is refused.
MISNAMED_FIELDS = {
    "center": ("position", "pos", "x", "y"),
    "rotation": ("angle",),
    "category": ("type", "name"),
    "outline": ("boundary", "floor"),
    "room_type": ("type",),
}
EXPECTED = {  # what messages say of a field that is missing or has another name
    "id": "a name",
    "room_type": f"one of {', '.join(MAIN_ITEM)}",
    "outline": "the corners of the floor, as [[0, 0], [4, 0], [4, 3], [0, 3]] in metres",
    "doors": "a list, [] where there is none",
    "windows": "a list, [] where there is none",
    "furniture": "a list of items with category and size",
    "polygon": "its corners, in metres",
    "category": "a name, as bed",
    "size": "depth and width, in metres",
    "center": "center, as [1.8, 2.1] in metres",
    "rotation": "rotation, in degrees",
}
FAULTS_FIELD = "faults"  # an item's faults in a file that `place` has written
NO_JSON = "; it has no comments, no single quotes, and no comma before a closing bracket"
NOT_SIMPLE = "expected a simple polygon"  # how the problem of a ring that crosses itself begins
BEYOND = "lie within the room's outer walls"  # what messages expect of an item that does not
ALIKE = 0.8  # difflib's ratio: a name as similar to a field's is taken for a misspelling of it


def room_to_dict(room: Room) -> dict[str, Any]:
    """A room as plain lists and numbers, ready for JSON."""
    furniture: list[dict[str, Any]] = []
    for item in room.furniture:
        entry: dict[str, Any] = {"category": item.category}
        if item.form == "circle":
            entry["shape"] = "circle"
        if item.center is not None:
            entry["center"] = list(item.center)
        entry["size"] = list(item.size)
        if item.rotation is not None:
            entry["rotation"] = item.rotation
        if item.tucked or (item.center is None and may_tuck(item, room.furniture)):
            entry["tucked"] = item.tucked
        if item.locked:
            entry["locked"] = True
        furniture.append(entry)
    document: dict[str, Any] = {"id": room.id, "room_type": room.room_type, "outline": _lists(room.outline)}
    if room.holes:
        document["holes"] = [_lists(hole) for hole in room.holes]
    document["walls"] = [{"polygon": _lists(wall)} for wall in room.walls]
    document["doors"] = [{"polygon": _lists(door.polygon)} for door in room.doors]
    document["windows"] = [{"polygon": _lists(window.polygon)} for window in room.windows]
    document["furniture"] = furniture
    if room.target is not None:
        document["target"] = room.target
    if room.group != room.id:
        document["group"] = room.group
    return document


def with_layout(
    document: Mapping[str, Any],
    asked: Room,
    layout: Room,
    wrong: Iterable[tuple[int, str]],
    still: Collection[tuple[int, str]],
    unit: str = "m",
) -> dict[str, Any]:
    """Return a room's document with the poses that a layout gives to items without a center, and with faults.

    `asked` is the room as it was read, `wrong` lists (index of the item, fault), and `unit` is that of the document. Of
    the faults and oddities that the document has of items that stood, those in `still` are kept. All else is unchanged;
    an item that the layout does not place gets only its faults. Centers are rounded to a tenth of a millimetre.
    """
    entries = [_without_nulls(entry, (FAULTS_FIELD,)) for entry in document["furniture"]]
    for k, (entry, before, item) in enumerate(zip(entries, asked.furniture, layout.furniture, strict=True)):
        if isinstance(entry.get(FAULTS_FIELD), list):  # else it is a field of the user's own
            listed = entry.pop(FAULTS_FIELD)
            kept = [fault for fault in listed if fault not in (*FAULTS, *ODDITIES) or (k, fault) in still]
            if before.center is not None and kept:
                entry[FAULTS_FIELD] = kept
        if before.center is None and item.center is not None:
            entry["center"] = [round(round(metres, 4) * UNITS[unit], 4) for metres in item.center]
            if item.rotation is not None:
                entry["rotation"] = item.rotation
            if item.tucked:
                entry["tucked"] = True
    for k, fault in wrong:
        listed = entries[k].get(FAULTS_FIELD, [])
        if isinstance(listed, list) and fault not in listed:
            entries[k][FAULTS_FIELD] = [*listed, fault]
    return {**document, "furniture": entries}


def parsed(text: str | bytes, line: bool = False) -> Any:
    """Return the content of a JSON text, or a RoomError that says why it cannot be read.

    The text is a whole file or a `line` of one. In a list, each entry in which a key stands twice is a RoomError of its
    own.
    """
    try:
        text = text if isinstance(text, str) else text.decode("utf-8-sig")
        return json.loads(text, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        if not error.doc.strip():
            return RoomError("file", "is empty; expected a room, or a list of them")
        if error.pos < len(error.doc.rstrip()):
            where = f"line {error.lineno}, " if "\n" in error.doc.rstrip() else ""
            hint = NO_JSON if error.msg.startswith("Expecting") and "delimiter" not in error.msg else ""
            return RoomError(f"{where}column {error.colno}", f"expected JSON; {error.msg}{hint}")
        if not line:
            return RoomError("file", "expected whole JSON; the text breaks off")
        said = "expected one whole JSON object; the text breaks off (a room over several lines is a .json file)"
        return RoomError("line", said)
    except UnicodeDecodeError as error:
        return not_utf8(error)
    except (ValueError, RecursionError) as error:  # an integer of thousands of digits, brackets without end
        return RoomError("text", f"expected numbers and nesting of a usual size; {error}")


def not_utf8(error: UnicodeDecodeError) -> RoomError:
    """Return the error of a text that is not in UTF-8."""
    if error.object.startswith(b"PK"):
        return RoomError("text", "expected JSON; it is a ZIP file: if a home of Sweet Home 3D, name it .sh3d")
    return RoomError("text", f"expected UTF-8; {error.reason} at byte {error.start}")


def name_in(document: Any) -> str:
    """Return the id of a room's document as the beginning of a message, "room 'b-17': ", or "" if it has none."""
    return f"room {document['id']!r}: " if isinstance(document, dict) and "id" in document else ""


def check_room_type(name: str) -> None:
    """Raise RoomError unless it is a known room type, with a hint at what the name means in the table of names."""
    if name not in MAIN_ITEM:
        ours = own_names().room_type(name, ())
        hint = f", which is a {ours} here" if ours and ours != NO_ROOM else ""
        raise RoomError("room_type", f"expected one of {', '.join(MAIN_ITEM)}; got {name!r}{hint}")


def _room_type(said: str) -> str:
    """Return the room type that is written so: "Living room" is living_room. Raises RoomError for another name."""
    known = {name.replace("_", ""): name for name in MAIN_ITEM}
    if (letters := re.sub(r"[\s_-]", "", said.lower())) not in known:
        check_room_type(said)
    return known[letters]


def room_from_dict(document: Any) -> Room:
    """Return the room of a document of plain lists and numbers, as `room_to_dict` makes it.

    Raises RoomError where something is wrong with it, and one that `parsed` returned in place of the document.
    """
    if isinstance(document, RoomError):
        raise document
    if isinstance(document, dict) and "outline" not in document and isinstance(document.get("rooms"), list):
        raise RoomError("rooms", "unknown field; expected a room, or a list of them by itself")
    _check_fields(document, "room", REQUIRED, OPTIONAL)
    document = _without_nulls(document, OPTIONAL)
    room_id = _text(document["id"], "id")
    room_type = _room_type(_text(document["room_type"], "room_type"))

    outline = _ring(document["outline"], "outline")
    holes = tuple(_ring(h, f"holes[{k}]")[::-1] for k, h in enumerate(_list(document.get("holes", []), "holes")))
    for k, hole in enumerate(holes):
        if not Polygon(outline).covers(Polygon(hole)):
            raise RoomError(f"holes[{k}]", "expected a ring inside the outline")
    if not Polygon(outline, holes).is_valid:
        column = "; draw what stands at a wall as corners of the outline"
        raise RoomError("holes", f"expected rings that neither cross nor touch along a side{column}")

    openings = (
        *(Opening("door", ring) for ring in _polygons(document["doors"], "doors")),
        *(Opening("window", ring) for ring in _polygons(document["windows"], "windows")),
    )
    try:
        walls = _polygons(document["walls"], "walls") if "walls" in document else wall_band(outline, holes, openings)
    except shapely.errors.GEOSException:  # for a few in a hundred thousand outlines that lean by micrometres
        raise RoomError("walls", "cannot be drawn around this outline; expected them to be given") from None
    furniture = _furniture(_list(document["furniture"], "furniture"))
    target = _target(document.get("target"), furniture, MAIN_ITEM[room_type])
    group = _text(document.get("group", room_id), "group")
    room = Room(room_id, room_type, outline, walls, openings, furniture, target, holes, group)
    _check_places(room, "walls" in document)
    return room


def _check_places(room: Room, with_walls: bool) -> None:
    border = room.indoor.boundary
    corners = [point for wall in room.walls for point in wall] if with_walls else []
    # As far out as the corners of walls that are given, for the same reason as WINDOW_DEPTH.
    deepest = max([WALL_THICKNESS] + [shapely.distance(room.indoor, shapely.Point(point)) for point in corners])
    kinds = {"door": 0, "window": 0}
    for opening in room.openings:
        field = f"{opening.kind}s[{kinds[opening.kind]}]"
        kinds[opening.kind] += 1
        if opening.shape.distance(border) > TOLERANCE:
            raise RoomError(
                field, f"expected to lie in the walls; it is {opening.shape.distance(border):.2f} m off the outline"
            )
        reach = shapely.distance(room.indoor, shapely.points(opening.polygon)).max()
        thickness = deepest if with_walls or opening.kind == "door" else WINDOW_DEPTH
        if reach > thickness + TOLERANCE:
            hint = "" if with_walls else "; give walls that are thicker as `walls`, or say another unit"
            raise RoomError(
                field, f"expected to lie in the walls ({thickness:.2f} m); it reaches {reach:.2f} m out{hint}"
            )
        inside = opening.shape.intersection(room.indoor).area / opening.shape.area
        if inside > MOST_INSIDE:
            raise RoomError(field, f"expected to lie in the walls; {inside:.0%} of it is inside the room")
    for k, item in enumerate(room.furniture):
        if item.center is not None and not room.holds(item):
            raise RoomError(f"furniture[{k}].center", f"expected the {item.category} to {BEYOND}")


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any] | RoomError:
    """Return a JSON object, or a RoomError if it or its content has a key twice: json itself would take the last."""
    document = dict(pairs)
    found = next(_errors(document.values()), None)
    if len(document) < len(pairs):
        twice = next(name for name, count in Counter(name for name, _ in pairs).items() if count > 1)
        found = RoomError(twice, "stands there twice; expected once")
    if found is None:
        return document
    return RoomError(f"{name_in(document)}{found.field}", found.problem) if "outline" in document else found


def _errors(values: Iterable[Any]) -> Iterator[RoomError]:
    for value in values:
        if isinstance(value, RoomError):
            yield value
        elif isinstance(value, list):
            yield from _errors(value)


def _check_fields(entry: Any, field: str, required: tuple[str, ...], optional: tuple[str, ...]) -> None:
    if not isinstance(entry, dict):
        hint = "; a list of rooms is read from a .json file" if field == "room" and isinstance(entry, list) else ""
        raise RoomError(field, f"expected a JSON object; got {_show(entry)}{hint}")
    prefix = "" if field == "room" else f"{field}."
    known = required + optional
    for name in required:
        if name not in entry:
            others = {other.lower(): other for other in entry if other not in known}
            near = [*difflib.get_close_matches(name, others, 1, ALIKE), *MISNAMED_FIELDS.get(name, ())]
            found = [others[other] for other in near if other in others]
            hint = f"; got {found[0]!r}, which is no field" if found else ""
            raise RoomError(prefix + name, f"missing; expected {EXPECTED[name]}{hint}")
    for name in entry:
        if name not in known and (near := difflib.get_close_matches(name, known, 1, ALIKE)):
            raise RoomError(prefix + name, f"unknown field; expected {near[0]}, or a name that is not as near to it")


def _without_nulls(entry: dict[str, Any], optional: tuple[str, ...]) -> dict[str, Any]:
    """Return a copy of a JSON object without optional fields that are null: many programs write these so."""
    return {name: value for name, value in entry.items() if value is not None or name not in optional}


def _furniture(entries: Sequence[Any]) -> tuple[Item, ...]:
    items = [_item(entry, f"furniture[{k}]") for k, entry in enumerate(entries)]
    return tuple(
        item if item.center or entry.get("tucked") is not None else replace(item, tucked=may_tuck(item, items))
        for entry, item in zip(entries, items, strict=True)
    )


def _item(entry: Any, field: str) -> Item:
    _check_fields(entry, field, ITEM_REQUIRED, ITEM_OPTIONAL)
    for ours in ("center", "rotation"):  # else an item that stands would count as one to be placed
        if ours not in entry and (found := [name for name in MISNAMED_FIELDS[ours] if name in entry]):
            raise RoomError(f"{field}.{found[0]}", f"unknown field; expected {EXPECTED[ours]}")
    entry = _without_nulls(entry, ITEM_OPTIONAL)
    depth, width = _pair(entry["size"], f"{field}.size")
    if depth <= 0 or width <= 0:
        raise RoomError(f"{field}.size", f"expected two lengths above zero, in metres; got {_show(entry['size'])}")
    form = entry.get("shape", "rectangle")
    if form not in ("rectangle", "circle"):
        raise RoomError(f"{field}.shape", f"expected rectangle or circle; got {_show(form)}")
    if form == "circle" and depth != width:
        raise RoomError(f"{field}.size", f"expected the diameter twice for a circle; got {_show(entry['size'])}")
    tucked, locked = (_flag(entry.get(name, False), f"{field}.{name}") for name in ("tucked", "locked"))
    center, rotation = entry.get("center"), entry.get("rotation")
    if locked and center is None:
        raise RoomError(f"{field}.locked", "expected a center, too: what has none is to be placed")
    if center is not None and rotation is None:
        rotation = 0.0
    return Item(
        category=_text(entry["category"], f"{field}.category"),
        size=(depth, width),
        center=None if center is None else _pair(center, f"{field}.center"),
        rotation=None if rotation is None else _number(rotation, f"{field}.rotation", "degrees"),
        form=form,
        tucked=tucked,
        locked=locked,
    )


def _target(index: Any, furniture: tuple[Item, ...], main_item: str) -> int | None:
    if index is None:
        return sole(furniture, main_item)
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < len(furniture):
        which = f"0 to {len(furniture) - 1}" if furniture else "of which there is none"
        raise RoomError("target", f"expected the index of a piece of furniture, {which}; got {_show(index)}")
    return index


def _ring(value: Any, field: str) -> Ring:
    """Return a simple counter-clockwise ring. Repeated corners are dropped, and a clockwise order is reversed."""
    points = [_pair(point, f"{field}[{k}]") for k, point in enumerate(_list(value, field))]
    ring = tuple(p for p, previous in zip(points, points[-1:] + points[:-1], strict=True) if p != previous)
    if len(ring) < 3:
        raise RoomError(field, f"expected at least three different corners; got {len(ring)}")
    polygon = Polygon(ring)
    if not polygon.is_valid:
        meet = re.search(r"\[(\S+) (\S+)\]", explain_validity(polygon))
        raise RoomError(field, NOT_SIMPLE + (f"; its sides meet at [{meet[1]}, {meet[2]}]" if meet else ""))
    if polygon.area < TOLERANCE**2:
        raise RoomError(field, f"expected a polygon with an area; it has {polygon.area:.1g} m²: is the unit right?")
    return ring if polygon.exterior.is_ccw else ring[::-1]


def _polygons(value: Any, field: str) -> tuple[Ring, ...]:
    rings = []
    for k, entry in enumerate(_list(value, field)):
        _check_fields(entry, f"{field}[{k}]", ("polygon",), ())
        rings.append(_ring(entry["polygon"], f"{field}[{k}].polygon"))
    return tuple(rings)


def _flag(value: Any, field: str) -> bool:
    if not isinstance(value, bool):
        raise RoomError(field, f"expected true or false; got {_show(value)}")
    return value


def _pair(value: Any, field: str) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise RoomError(field, f"expected two numbers, in metres; got {_show(value)}")
    return (_number(value[0], field), _number(value[1], field))


def _number(value: Any, field: str, unit: str = "metres") -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= LARGEST:
        raise RoomError(field, f"expected a finite number of at most {LARGEST:g} ({unit}); got {_show(value)}")
    return float(value) if abs(value) > SMALLEST else 0.0


def _text(value: Any, field: str) -> str:
    if not isinstance(value, str) or not value.strip():
        raise RoomError(field, f"expected a name; got {_show(value)}")
    if any("\ud800" <= character <= "\udfff" for character in value):
        raise RoomError(field, f"expected text that can be written as UTF-8; got {_show(value)}")
    return value


def _list(value: Any, field: str) -> Sequence[Any]:
    if not isinstance(value, list | tuple):
        raise RoomError(field, f"expected a list; got {_show(value)}")
    if len(value) > MOST:
        raise RoomError(field, f"expected at most {MOST:,} entries; got {len(value):,}")
    return value


def _lists(ring: Ring) -> list[list[float]]:
    return [list(point) for point in ring]


def _show(value: Any) -> str:
    text = json.dumps(value, default=str)  # a value that is no JSON, such as a RoomError of `parsed`, as its text
    return text if len(text) <= 60 else text[:57] + "..."
