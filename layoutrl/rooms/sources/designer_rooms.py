"""Bedroom and tatami rooms that the paper's authors published (CODE-SUBMIT/Room_Layout_Suggestion, Apache-2.0).

A file holds one or more JSON objects one after another, in millimetres and with y up; each is a
layout of one room: `walls`, `doors` and `windows` as rectangles, `functionZones_layout` as furniture.

Left as published: tatami platforms run on under the wardrobe, a few nightstands stick into a wardrobe,
and in three tatami rooms desk, wardrobe and stool are turned by a quarter against the wall they stand at.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely
from shapely.affinity import translate
from shapely.geometry import LineString, MultiPoint, Polygon
from shapely.geometry.polygon import orient
from shapely.ops import split

from layoutrl import InputError
from layoutrl.rooms.collection import Collection
from layoutrl.rooms.room import MAIN_ITEM, SYMMETRIES, TOLERANCE, Item, Opening, Ring, Room, rings, sole

FILES = {"bedroom": "bedroom/*/*.json", "tatami": "tatami/*.json"}

# The meaning of the ids was not published: it was read off from sizes and places in every layout.
# In bedrooms 2, 9, 10 and the pair 7 and 8 are the wardrobe of the templates one-line, L-shape, U-shape and two-line.
CATEGORIES = {
    "bedroom": {
        1: "bed",
        2: "wardrobe",
        3: "nightstand",
        4: "tv_unit",
        5: "bench",
        7: "wardrobe",
        8: "wardrobe",
        9: "wardrobe",
        10: "wardrobe",
    },
    "tatami": {1: "platform", 2: "wardrobe", 3: "desk", 4: "stool"},
}

CORNER_GAP = 0.06  # metres: where a wall of 0.1 meets one of 0.2, they are drawn up to 0.05 apart
LARGEST = 1e6  # millimetres, of a coordinate


class Unreadable(InputError):
    """A layout cannot be used. The message is a fixed sentence, so that equal reasons can be counted."""


def read(root: Path, room_type: str) -> Collection:
    """Return every layout of `room_type` under `root` that can be used, in metres.

    Layouts of one room, and of rooms that are the same up to rotation and mirroring, share a `group`.
    Raises InputError for a room type that this source lacks and for a `root` without its files.
    """
    if room_type not in FILES:
        raise InputError(f"room: expected {' or '.join(FILES)} for data=designer_rooms; got {room_type}")
    root = Path(root)
    paths = sorted(root.glob(FILES[room_type]), key=lambda path: path.parts)  # the same order on all systems
    if not paths:
        raise InputError(
            f"no {room_type} layouts in {root.absolute()}: expected files {FILES[room_type]} of the repository "
            "CODE-SUBMIT/Room_Layout_Suggestion; name the folder that holds them with data.root=..."
        )
    collection = Collection("designer_rooms")
    seen = set()
    for path in paths:
        name, _, number = path.stem.removesuffix("_layout").partition(".json_layout")
        folder = path.parent.relative_to(root).as_posix()
        for k, layout in enumerate(layouts_in(path)):
            label = f"{folder}/{name}#{number or 0}" + (f".{k}" if k else "")
            with collection.or_left_out(label):
                room = room_of(layout, room_type, label, group=f"{room_type}/{' '.join(name.split())}")
                content = (room.outline, room.walls, room.openings, room.furniture)
                if content in seen:
                    raise Unreadable("it is an exact duplicate of a layout already read")
                seen.add(content)
                collection.rooms.append(room)
    collection.rooms = grouped(collection.rooms)
    return collection


def layouts_in(path: Path) -> Iterator[Any]:
    """Yield the JSON objects of a file; None at the end where the file, or the rest of it, cannot be read as JSON."""
    try:
        text = path.read_text(encoding="utf-8-sig").strip()
        if not text:
            yield None
        while text:
            layout, end = json.JSONDecoder().raw_decode(text)
            yield layout
            text = text[end:].lstrip()
    except (OSError, ValueError, RecursionError):
        yield None


def room_of(layout: Any, room_type: str, label: str, group: str) -> Room:
    """One layout as a room. Raises Unreadable with the reason to leave it out."""
    if layout is None:
        raise Unreadable("the file cannot be read as JSON")
    if not layout["functionZones_layout"]:
        raise Unreadable("it has no furniture")
    walls = [rectangle(wall["wallPoints" if "wallPoints" in wall else "points"]) for wall in layout["walls"]]
    outline = enclosed(walls)
    walls = with_corners(walls, outline)
    openings = [
        opening
        for kind in ("door", "window")
        for drawn in layout[f"{kind}s"]
        for opening in clipped(kind, rectangle(drawn["points"]), walls)
    ]
    furniture = [item for zone in layout["functionZones_layout"] for item in items_of(zone, CATEGORIES[room_type])]
    room = Room(
        id=label,
        room_type=room_type,
        outline=rings(outline)[0],
        walls=tuple(cut(walls, openings)),
        openings=tuple(openings),
        furniture=tuple(furniture),
        target=sole(furniture, MAIN_ITEM[room_type]),
        group=group,
    )
    if room.target is not None and not room.holds(room.moving):
        raise Unreadable(f"its {MAIN_ITEM[room_type]} is not inside the room")
    return room


def metres(value: float) -> float:
    """Millimetres as metres, to a micrometre, so that equal drawings give equal rooms."""
    if not abs(value) <= LARGEST:
        raise Unreadable("a coordinate is not a number, or is kilometres away")
    return round(value / 1000, 6)


def rectangle(points: Any) -> Polygon:
    """A wall or opening from its four corners, in whatever order: bedrooms list them as two diagonals."""
    hull = MultiPoint([(metres(p["x"]), metres(p["y"])) for p in points]).convex_hull
    if not isinstance(hull, Polygon):
        raise Unreadable("a wall, door or window has no area")
    return hull


def enclosed(walls: list[Polygon]) -> Polygon:
    """The area that the walls enclose."""
    # Walls that meet in a point, or not quite, still have to close the room: grow the walls, then grow the room back.
    union = shapely.union_all([wall.buffer(CORNER_GAP / 2, join_style="mitre") for wall in walls])
    inside = [Polygon(hole) for part in shapely.get_parts(union) for hole in part.interiors]
    if not inside:
        raise Unreadable("its walls do not close")
    grown = max(inside, key=lambda hole: hole.area).buffer(CORNER_GAP / 2, join_style="mitre")
    return shapely.set_precision(grown, 1e-6)


def with_corners(walls: list[Polygon], outline: Polygon) -> list[Polygon]:
    """Extend walls around corners that all of them leave open: tatami rooms draw walls only as long as the room."""
    thinnest = min(min(math.dist(a, b) for a, b in pairwise(wall.exterior.coords)) for wall in walls)
    band = outline.buffer(thinnest, join_style="mitre").difference(outline)
    walls = list(walls)
    for corner in map(Polygon, rings(band.difference(shapely.union_all(walls)))):
        for k, wall in enumerate(walls):
            if wall.intersection(corner).length > TOLERANCE:
                walls[k] = shapely.set_precision(wall.union(corner), 1e-6)
                break
    return walls


def clipped(kind: Literal["door", "window"], drawn: Polygon, walls: list[Polygon]) -> list[Opening]:
    """An opening cut to the wall it lies in: it is drawn thicker than the wall, and may reach past a corner."""
    wall = max(walls, key=lambda wall: wall.intersection(drawn).area)
    parts = rings(wall.intersection(drawn))
    if not parts:
        raise Unreadable("a door or window lies in no wall")
    return [Opening(kind, part) for part in parts]


def cut(walls: list[Polygon], openings: list[Opening]) -> list[Ring]:
    """The walls without the openings and without what an earlier wall covers already."""
    taken = shapely.union_all([o.shape for o in openings])
    parts: list[Ring] = []
    for wall in walls:
        parts += rings(wall.difference(taken))
        taken = taken.union(wall)
    return parts


def items_of(zone: dict[str, Any], categories: dict[int, str]) -> list[Item]:
    """The furniture of one function zone: one item, or as many as a polygon splits into."""
    if zone["id"] not in categories:
        raise Unreadable("an item's id has no known meaning")
    category = categories[zone["id"]]
    if "points" in zone:
        return runs(Polygon([(metres(x), metres(y)) for x, y in zone["points"]]), category)
    if zone["rot"] % 90 != 0:
        raise Unreadable("an item is not turned by quarters of a circle")
    # `bound` is the extent along the room's x and y, whatever `rot`: only so do all platforms touch three walls.
    dx, dy = metres(zone["bound"]["dx"]), metres(zone["bound"]["dy"])
    if min(dx, dy) <= 0:
        raise Unreadable("an item has no area")
    center = (metres(zone["center"]["x"]), metres(zone["center"]["y"]))
    size = (dx, dy) if zone["rot"] % 180 == 0 else (dy, dx)
    return [Item(category, size, center, float(zone["rot"] % 360))]


def runs(shape: Polygon, category: str) -> list[Item]:
    """Split an L- or U-shaped item into its straight runs, each of which faces the hollow between them."""
    steps = pairwise(shape.exterior.coords)
    if not shape.is_valid or not shape.area or any(ax != bx and ay != by for (ax, ay), (bx, by) in steps):
        raise Unreadable("an item's polygon is not made of axis-parallel edges")
    hollow = shape.convex_hull.difference(shape).centroid
    if hollow.is_empty:
        raise Unreadable("an item's polygon is a rectangle: it does not tell which way the item faces")
    items = []
    for part in rectangles(orient(shape)):
        x0, y0, x1, y1 = part.bounds
        width, depth = round(x1 - x0, 6), round(y1 - y0, 6)
        x, y = round((x0 + x1) / 2, 6), round((y0 + y1) / 2, 6)
        if width <= depth:
            items.append(Item(category, (width, depth), (x, y), 180.0 if hollow.x < x else 0.0))
        else:
            items.append(Item(category, (depth, width), (x, y), 270.0 if hollow.y < y else 90.0))
    return items


def rectangles(shape: Polygon) -> list[Polygon]:
    """Split a counter-clockwise polygon of axis-parallel edges into as few rectangles as possible.

    Of several such splits, return the one whose smallest rectangle is largest. A least split cuts from
    reflex corners only; all orders of cuts are tried, since there are only one or two such corners.
    """
    corners = shape.exterior.coords[:-1]
    reach = 2 * max(abs(v) for v in shape.bounds) + 1
    options = []
    for (ax, ay), (x, y), (bx, by) in zip(corners[-1:] + corners[:-1], corners, corners[1:] + corners[:1], strict=True):
        if (x - ax) * (by - y) - (y - ay) * (bx - x) < 0:  # a right turn of a counter-clockwise ring
            # Each cut goes on where an edge ends at the corner, until it leaves the polygon.
            for dx, dy in ((x - ax, y - ay), (x - bx, y - by)):
                length = math.hypot(dx, dy)
                ray = LineString([(x, y), (x + dx / length * reach, y + dy / length * reach)]).intersection(shape)
                cut = next(part for part in shapely.get_parts(ray) if part.distance(shapely.Point(x, y)) < 1e-9)
                halves = [orient(half.simplify(0)) for half in shapely.get_parts(split(shape, cut))]
                options.append([part for half in halves for part in rectangles(half)])
    return min(options, key=lambda parts: (len(parts), -min(p.area for p in parts)), default=[shape])


def grouped(rooms: list[Room]) -> list[Room]:
    """Merge the groups of rooms that are the same (`same_room`) under different names, and return the rooms."""
    group = {room.group: room.group for room in rooms}
    distinct: list[Room] = []
    for room in rooms:
        twin = next((other for other in distinct if same_room(room, other)), None)
        if twin is None:
            distinct.append(room)
        elif group[room.group] != group[twin.group]:
            old, new = sorted((group[room.group], group[twin.group]), reverse=True)
            group = {name: new if g == old else g for name, g in group.items()}
    return [replace(room, group=group[room.group]) for room in rooms]


def same_room(a: Room, b: Room) -> bool:
    """Whether outline, doors and windows agree within a centimetre, up to rotation, mirroring and place."""
    if len(a.doors) != len(b.doors) or len(a.windows) != len(b.windows):
        return False
    if abs(a.indoor.area - b.indoor.area) > TOLERANCE * a.indoor.length:
        return False
    if np.abs(sides_of(a) - sides_of(b)).max() > 2 * TOLERANCE:  # a quick test that settles most pairs
        return False
    borders, bare = borders_of(a), replace(b, walls=(), furniture=(), target=None)
    turns = (bare.turned(quarters, mirror) for quarters, mirror in SYMMETRIES)
    return any(
        all(x.hausdorff_distance(y) <= TOLERANCE for x, y in zip(borders, borders_of(turned), strict=True))
        for turned in turns
    )


def sides_of(room: Room) -> np.ndarray:
    """Return the side lengths (2,) of the indoor area's bounding box in metres, the shorter first."""
    x0, y0, x1, y1 = room.indoor.bounds
    return np.sort([x1 - x0, y1 - y0])


def borders_of(room: Room) -> list[shapely.Geometry]:
    """The borders of outline, doors and windows, moved so that the outline's lower left corner is the origin."""
    x, y, _, _ = room.indoor.bounds
    parts = [[room.indoor], [o.shape for o in room.doors], [o.shape for o in room.windows]]
    return [translate(shapely.union_all(part).boundary, -x, -y) for part in parts if part]
