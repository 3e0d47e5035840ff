"""Save rooms as a home of Sweet Home 3D: into the home that they were read from, or one room as a new home.

Home.xml has centimetres, y down, radians clockwise. A piece without a model is shown as a box.
"""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
import shapely
from shapely.geometry import Polygon
from shapely.geometry.polygon import orient

from layoutrl import InputError
from layoutrl.figures.drawing import in_xml
from layoutrl.rooms.brief import without_poses
from layoutrl.rooms.clearances import RUGS
from layoutrl.rooms.room import Item, Room, along_and_through, wall_thickness
from layoutrl.rooms.sources.sweethome3d import Home, read_home

VERSION = "5300"
WALL_HEIGHT, DOOR_HEIGHT, SILL, WINDOW_HEIGHT = 250.0, 208.5, 90.0, 120.0  # centimetres, as the program draws them
HEIGHTS = {  # centimetres, of furniture
    **dict.fromkeys(RUGS, 1.0),
    "platform": 40.0,
    "bench": 45.0,
    "coffee_table": 45.0,
    "stool": 45.0,
    "bed": 50.0,
    "nightstand": 50.0,
    "tv_unit": 50.0,
    "bathtub": 55.0,
    "side_table": 55.0,
    "armchair": 85.0,
    "loveseat": 85.0,
    "lounge_chair": 85.0,
    "sofa": 85.0,
    "sofa_bed": 85.0,
    "dresser": 85.0,
    "sideboard": 85.0,
    "cooktop": 85.0,
    "laundry_cabinet": 85.0,
    "sink": 85.0,
    "vanity": 85.0,
    "washer": 85.0,
    "washing_machine": 85.0,
    "chair": 90.0,
    "counter": 90.0,
    "plant_rack": 120.0,
    "fridge": 185.0,
    "bookcase": 200.0,
    "shower": 200.0,
    "wardrobe": 200.0,
}
HEIGHT = 75.0  # centimetres, of what is not named, such as tables, desks and toilets
APART = 0.3  # metres between items that are parked beside a room
TAKEN_FOR = "bedroom"  # the type of a room of which nothing tells it
NAME = "file.sh3d"  # default name of a home that is read: it begins the ids of its rooms


def fixed(home: Home, room: Room) -> list[int]:
    """Return the indices of a room's furniture that has to stay where the home has it: it is unknown, or the home does
    not let it move."""
    return [k for k, piece in enumerate(home.pieces[room.id]) if not (piece.known and piece.may_move)]


def written_back(room: Room, content: bytes, others: Sequence[Room] = (), name: str = NAME) -> tuple[bytes, list[str]]:
    """Return the home that a room was read from, with the furniture of the room and of `others` where it stands now.

    `name` is what the home was called when it was read. Raises InputError if the room has another floor, other doors,
    windows or furniture than the home's, or if `fixed` furniture was moved. If that is so of one of `others`, it stays
    as the home has it, and its id is returned, too.
    """
    with TemporaryDirectory(prefix="layoutrl-") as folder:
        path, out = Path(folder) / name, Path(folder) / f"out-{name}"
        path.write_bytes(content)
        try:
            home = read_home(path, room_type=TAKEN_FOR)
        except InputError as error:  # names the temporary file, which the page does not know
            raise InputError(str(error).replace(str(path), name)) from None
        before = {room.id: room for room in home.rooms}
        _check(room, before.get(room.id), home)
        rooms, left = [room], []
        for other in others:
            try:
                _check(other, before.get(other.id), home)
                rooms.append(other)
            except InputError:
                left.append(other.id)
        for k, read in enumerate(home.rooms):  # Home.write only moves items without a center here
            moves = {*range(len(read.furniture))} - {*fixed(home, read)}
            home.rooms[k] = replace(read, furniture=without_poses(read.furniture, moves))
        home.write(rooms, out)
        return out.read_bytes(), left


def _check(room: Room, before: Room | None, home: Home) -> None:
    """Raise InputError if a room differs from `before`, as the home has it, in floor, openings or list of furniture."""
    pieces = [] if before is None else [*before.furniture]
    if before is None or [item.kind for item in pieces] != [item.kind for item in room.furniture]:
        raise InputError(
            "home: expected the furniture that was read from it, no more or less, in the same sizes and shapes; "
            f"{room.id!r} has other: save it as JSON"
        )
    if (room.outline, room.holes, room.openings) != (before.outline, before.holes, before.openings):
        raise InputError(
            "home: expected the walls, doors and windows that were read from it; "
            f"{room.id!r} has other: save it as JSON"
        )
    for k in fixed(home, room):
        piece, item = pieces[k], room.furniture[k]
        if (piece.center, piece.rotation) != (item.center, item.rotation):
            raise InputError(
                f"home: expected the {item.category} where it was in {room.id!r}: nobody knows it, or it is fixed"
            )


def new_home(room: Room) -> bytes:
    """Return a home of this room alone. Items without a place stand in a row on the right of it.

    Raises InputError for a hole that is not a rectangle.
    """
    home = Element("home", version=VERSION, name=room.id, camera="topCamera", wallHeight=f"{WALL_HEIGHT:g}")
    for number, opening in enumerate(room.openings):
        piece = SubElement(home, "doorOrWindow", id=f"opening{number}", catalogId=f"layoutrl#{opening.kind}")
        low, high = (0.0, DOOR_HEIGHT) if opening.kind == "door" else (SILL, WINDOW_HEIGHT)
        along, through = along_and_through(opening.shape, room.indoor.boundary)
        center = shapely.minimum_rotated_rectangle(opening.shape).centroid.coords[0]
        angle, width, depth = -math.atan2(along[1], along[0]), np.hypot(*along), np.hypot(*through)
        _set(piece, opening.kind, center, angle, width, depth, high)
        piece.set("elevation", f"{low:g}")
    for number, item in enumerate(_parked(room)):
        piece = SubElement(home, "pieceOfFurniture", id=f"piece{number}", catalogId=f"layoutrl#{item.category}")
        if item.locked:
            piece.set("movable", "false")
        name = f"{'round ' if item.form == 'circle' else ''}{item.category.replace('_', ' ')}"
        high = HEIGHTS.get(item.category, HEIGHT)
        assert item.center is not None
        _set(piece, name, item.center, math.radians(270 - item.degrees) % math.tau, item.size[1], item.size[0], high)
    thickness = wall_thickness(room)
    line = orient(Polygon(room.outline).buffer(thickness / 2, join_style="mitre")).exterior.coords[:-1]
    for k, (start, end) in enumerate(zip(line, [*line[1:], line[0]], strict=True)):
        wall = _wall(home, f"wall{k}", thickness, start, end)
        wall.set("wallAtStart", f"wall{(k - 1) % len(line)}")
        wall.set("wallAtEnd", f"wall{(k + 1) % len(line)}")
    for number, hole in enumerate(room.holes):  # a column: a wall as thick as it is
        column = shapely.minimum_rotated_rectangle(Polygon(hole))
        if column.area - Polygon(hole).area > 1e-6:
            raise InputError("home: a hole that is no rectangle cannot be written; expected the room as JSON")
        along, through = along_and_through(column)
        center = np.array(column.centroid.coords[0])
        _wall(home, f"column{number}", np.hypot(*through), center - along / 2, center + along / 2)
    floor = SubElement(home, "room", id="room", name=room.room_type.replace("_", " "))
    for x, y in room.outline:
        SubElement(floor, "point", x=_cm(x), y=_cm(-y))
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("Home.xml", f"<?xml version='1.0' encoding='utf-8'?>\n{in_xml(tostring(home, 'unicode'))}")
    return content.getvalue()


def _parked(room: Room) -> list[Item]:
    """Return the furniture, with items without a center in a row on the right; read again, these are to be placed."""
    _, bottom, right, _ = room.envelope.bounds
    items = []
    for item in room.furniture:
        if item.center is None:
            item = replace(item, rotation=item.rotation or 0.0)
            x0, y0, x1, _ = item.template.bounds
            item = replace(item, center=(right + APART - x0, bottom - y0))
            right += APART + x1 - x0
        items.append(item)
    return items


def _wall(home: Element, name: str, thickness: float, start: Iterable[float], end: Iterable[float]) -> Element:
    wall = SubElement(home, "wall", id=name, height=f"{WALL_HEIGHT:g}", thickness=_cm(thickness))
    for which, (x, y) in (("Start", start), ("End", end)):
        wall.set(f"x{which}", _cm(x))
        wall.set(f"y{which}", _cm(-y))
    return wall


def _set(
    piece: Element, name: str, center: Iterable[float], angle: float, width: float, depth: float, height: float
) -> None:
    x, y = center
    piece.set("name", name)
    piece.set("angle", f"{angle:.6f}")
    piece.set("height", f"{height:g}")
    for key, metres in (("x", x), ("y", -y), ("width", width), ("depth", depth)):
        piece.set(key, _cm(metres))


def _cm(metres: float) -> str:
    return f"{100 * float(metres):.4f}"
