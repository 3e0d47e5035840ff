"""Houses of ProcTHOR and AI2-THOR (Deitke et al. 2022): JSON, one house a line, gzipped or not; or a .json file that
holds one house or a list of them.

A house names its objects; their sizes are in the asset database, `asset-database.json` of repository allenai/procthor
(Apache-2.0), which has to lie beside the houses. Seen from above x is to the right and z is up. Furniture is placed
largely at random: these are rooms to furnish, not designs to learn from.
"""

from __future__ import annotations

import gzip
import json
import math
import re
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import IO, Any, Literal

from shapely.geometry import Polygon

from layoutrl import InputError
from layoutrl.rooms.categories import Names
from layoutrl.rooms.collection import Collection
from layoutrl.rooms.files import files_below, name_of
from layoutrl.rooms.room import TOLERANCE, WALL_THICKNESS, Item, RoomError
from layoutrl.rooms.sources.drawn import FLATTEST, HIGHEST, Piece, Storey
from layoutrl.rooms.sources.fields import length, lengths, loaded
from layoutrl.rooms.sources.floors import floor_of
from layoutrl.rooms.sources.walls import DrawnOpening, oblong

ASSETS = "asset-database.json"
SUFFIXES = (".json", ".jsonl", ".gz")
MOST = 200_000  # houses in a file
LARGEST_LINE = 2**23  # bytes; a house of ten rooms takes a tenth
LARGEST_WHOLE = 2**27  # bytes of a file that is read as one document
BENT = re.compile(r"Countertop_[CL]_")  # most of the bounding box of such a counter is floor: it is not moved
RATIO = 100  # a file may unpack to so many times its size; houses do to ten to twenty times

Size = tuple[float, float, float]  # metres along x, y (up) and z


def read(root: Path, names: Names, room_type: str | None = None) -> Collection:
    """Return the rooms of all houses in a file, or in all files below a folder.

    `room_type` is assigned to rooms whose type nothing tells; without it they are left out. Raises InputError where
    there is no file of houses, or no asset database beside it.
    """
    folder = root.parent if root.is_file() else root
    files = files_below(root, SUFFIXES, (ASSETS,))
    if not files:
        raise InputError(
            f"no houses in {root.absolute()}: expected .json, .jsonl or .jsonl.gz files; name their folder"
        )
    sizes = _sizes(folder / ASSETS)
    collection = Collection(f"procthor {root}")
    for file in files:
        name = name_of(file, root)
        try:
            for number, house in _whole(file) if file.suffix.lower() == ".json" else _lines(file):
                _add(collection, house, f"{name}/{number}", sizes, names, room_type)
        except RoomError as error:
            collection.left_out.append((str(file), str(error)))
        except (OSError, EOFError, zlib.error) as error:
            collection.left_out.append((str(file), f"the file cannot be read to its end ({str(error)[:60]})"))
    collection.notes += names.notes()
    return collection


def _sizes(file: Path) -> dict[str, tuple[str, Size]]:
    """Return (type, size) of every asset, by its id. Raises InputError where the file is missing or malformed."""
    try:
        database = json.loads(file.read_bytes())
        found = {}
        for kind, assets in database.items():
            for asset in assets:
                bounds = asset["boundingBox"]
                found[asset["assetId"]] = (kind, (float(bounds["x"]), float(bounds["y"]), float(bounds["z"])))
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError):
        raise InputError(
            f"{file}: expected the sizes of what stands in the houses there: procthor/databases/{ASSETS} of "
            "repository allenai/procthor"
        ) from None
    return found


def _whole(file: Path) -> Iterable[tuple[int, Any]]:
    """Return (number, house) of every house in a .json file: one, a list of them, or one on each line.

    Raises RoomError where it is none of these. A file larger than LARGEST_WHOLE is read by lines.
    """
    if file.stat().st_size > LARGEST_WHOLE:
        return _lines(file)
    text = file.read_bytes()
    try:
        document = loaded(text)
    except RoomError:
        loaded(text.lstrip().partition(b"\n")[0])  # raises RoomError unless the first line is JSON by itself
        return _lines(file)
    return enumerate((document if isinstance(document, list) else [document])[:MOST], 1)


def _lines(file: Path) -> Iterator[tuple[int, bytes]]:
    """Yield (number, text) of every line that is not empty.

    Raises OSError, EOFError or zlib.error for a file that breaks off or is damaged, or is larger than any house.
    """
    most = RATIO * file.stat().st_size + LARGEST_LINE
    if file.suffix.lower() == ".gz":
        with gzip.open(file) as packed:
            yield from _numbered(packed, most)
    else:
        with file.open("rb") as lines:
            yield from _numbered(lines, most)


def _numbered(lines: IO[bytes] | gzip.GzipFile, most: int) -> Iterator[tuple[int, bytes]]:
    read = 0
    for number in range(1, MOST + 1):
        line = lines.readline(LARGEST_LINE + 1)
        read += len(line)
        if not line:
            return
        if len(line) > LARGEST_LINE or read > most:
            raise OSError("a line, or the whole, is larger than any house")
        if line.strip():
            yield number, line


def _add(
    collection: Collection,
    house: Any,
    label: str,
    sizes: Mapping[str, tuple[str, Size]],
    names: Names,
    room_type: str | None,
) -> None:
    """Add the rooms of a house, which is a document or its text, or the reason why it is left out."""
    storey: Storey[Piece] = Storey(label)
    with collection.or_left_out(label):
        document = loaded(house) if isinstance(house, bytes) else house
        for room in document["rooms"]:
            number = str(room["id"]).rpartition("|")[2]
            storey.add_room(str(room["roomType"]), f"{room['roomType']} {number}"[:60], partial(_floor, room))
        storey.openings = list(_openings(document))
        for thing in document["objects"]:
            with storey.or_left_out(_called(thing)):
                if piece := _piece(thing, sizes, names, storey.unsized):
                    storey.add_piece(piece)
        collection.rooms += [room for room, _ in storey.make_rooms(names, label, room_type)]
    collection.left_out += storey.left_out
    collection.notes += storey.notes


def _floor(room: Any) -> Polygon:
    return floor_of([(length(corner["x"]), length(corner["z"])) for corner in room["floorPolygon"]])


def _foot(wall: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ends of a wall on the floor as AI2-THOR finds them: the outermost of its lowest corners, in order."""
    corners = [lengths(corner[axis] for axis in "xyz") for corner in wall["polygon"]]
    floor = sorted(y for _, y, _ in corners)[1] + TOLERANCE
    low = [(x, z) for x, y, z in corners if y <= floor]
    end = max(low, key=partial(math.dist, low[0]))
    first, last = sorted((end, max(low, key=partial(math.dist, end))), key=low.index)
    return first, last


def _openings(house: Any) -> Iterator[DrawnOpening]:
    """Yield the doors and windows. Walls have no thickness here: openings are as deep as the walls that are assumed."""
    kinds: tuple[Literal["door", "window"], ...] = ("door", "window")
    pierced = {opening["wall0"] for kind in kinds for opening in house[f"{kind}s"]}
    feet = {wall["id"]: _foot(wall) for wall in house["walls"] if wall["id"] in pierced}
    for kind in kinds:
        for opening in house[f"{kind}s"]:
            (x0, y0), (x1, y1) = feet[opening["wall0"]]
            # Houses from before schema 1.0.0 have a bounding box instead.
            hole = opening.get("holePolygon") or [opening["boundingBox"][end] for end in ("min", "max")]
            first, last = lengths(corner["x"] for corner in hole)
            side, along = math.dist((x0, y0), (x1, y1)), (first + last) / 2
            if side > 0 and abs(last - first) > WALL_THICKNESS:
                x, y = x0 + (x1 - x0) / side * along, y0 + (y1 - y0) / side * along
                degrees = math.degrees(math.atan2(y1 - y0, x1 - x0))
                yield DrawnOpening(kind, oblong(x, y, abs(last - first), WALL_THICKNESS, degrees))


def _called(thing: Any) -> str:
    """Return the name of an object for messages: its asset, else its id."""
    known = thing if isinstance(thing, dict) else {}
    return str(known.get("assetId") or known.get("id") or "without a name")


def _piece(thing: Any, sizes: Mapping[str, tuple[str, Size]], names: Names, unsized: Counter[str]) -> Piece | None:
    """Return an object that stands on the floor; None for decor, and if its size is unknown, which `unsized` counts."""
    x, y, z = lengths(thing["position"][axis] for axis in "xyz")
    degrees = length(thing["rotation"]["y"])
    if (asset := thing["assetId"]) not in sizes:
        if not names.is_decor(str(thing.get("id", asset)).partition("|")[0], str(asset)):
            unsized[str(asset)] += 1
        return None
    kind, (along, height, across) = sizes[asset]
    if y - height / 2 > HIGHEST or height < FLATTEST or min(along, across) < TOLERANCE:
        return None
    found = names.category("corner counter" if BENT.match(asset) else kind)
    return found and Piece(Item(found[0], (across, along), (x, z), (90 - degrees) % 360), found[1])
