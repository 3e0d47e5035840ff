"""Houses of 3D-FRONT (Fu et al. 2021): a JSON file each; y is up, in metres.

Seen from above x is to the right and z is down. A piece faces along its own z. Sizes and categories that a house does
not give are those of the data set's `model_info.json`, if it lies beside the houses.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import shapely
from shapely.geometry import Polygon

from layoutrl import InputError
from layoutrl.rooms.categories import Names
from layoutrl.rooms.collection import BROKEN, ODD, Collection
from layoutrl.rooms.files import files_below, name_of
from layoutrl.rooms.room import TOLERANCE, WALL_THICKNESS, Item, RoomError
from layoutrl.rooms.sources.drawn import FLATTEST, HIGHEST, Piece, Storey
from layoutrl.rooms.sources.fields import lengths, loaded
from layoutrl.rooms.sources.walls import DrawnOpening, oblong

MODELS = "model_info.json"
LARGEST_FILE = 2**25  # bytes; houses take a tenth
SEAM = 0.005  # metres: floors are drawn in parts that all but touch
MOST = 5000  # triangles of a floor, and corners of a door
WIDTH = {"door": 0.8, "window": 1.5}  # metres, before scaling, of openings known by a title alone
OPENINGS: dict[str, Literal["door", "window"]] = {
    "Door": "door",
    "Window": "window",
    "BayWindow": "window",
    "Hole": "door",  # a passage without a leaf
}

# What the category ids mean, for pieces without a title: read off from files that have both.
SOURCE_CATEGORIES = {
    "1462419b-2462-4632-aaaa-246285c9c07f": "dresser",
    "14d0d6c8-6857-4bbf-8c4a-26bf6c25c968": "sideboard",
    "24670bf9-9c9f-41ae-b190-f5f65eab4ddb": "single bed",
    "2dd2368f-a3eb-43c2-8a6b-d585cd19d9a6": "armoire",
    "2e336e49-2a54-46cb-bcee-67d2e5361e61": "sideboard",
    "30c7fefc-a32e-48e1-9458-dfab61595dc7": "chair",
    "41ac92b5-5f88-46d0-a59a-e1ed31739154": "king-size bed",
    "5ad47fd2-b143-4af2-9961-e88a57b4a337": "side table",
    "5b4dc4ea-d84e-4b21-8cec-f2d090c61275": "ottoman",
    "5c76d84c-aa8c-4bb8-88fc-cbf8da81be71": "table",
    "81780f40-fa53-41c3-8579-65706f4ad50d": "multi seat sofa",
    "89404b8a-5bb6-42cf-95fa-73c9bfba4c97": "night table",
    "9161c9e8-49e8-48bd-9ee8-0c75dd267413": "dining table",
    "9eaee326-16c4-4244-87d5-38e7b57a4e38": "coffee table",
    "a1804c08-fbdc-4696-9c38-3d3b143c1b02": "media unit",
    "a5af8349-bd50-46aa-b97a-2940125aafae": "double seat sofa",
    "c2dcb449-4729-4cfe-9e38-1fc1453211a5": "single seat sofa",
    "c352426b-2cfd-4855-a75a-50014e437832": "plants",
    "d2a64592-caa7-4ab1-877e-561323315774": "multi seat sofa",
    "d6bba626-68d1-4bd7-a32a-bd21457e54a0": "ottoman",
    "e7a0801e-7abd-4634-b3bc-8777342d124e": "pendant light",
    "f2c08afc-68c8-42a7-b62c-1b648f87edba": "armchair",
    "f534e29f-904b-4000-ad45-fcb7869c99b6": "floor lamp",
}


def read(root: Path, names: Names, room_type: str | None = None) -> Collection:
    """Return the rooms of one file, or of all houses below a folder.

    `room_type` is assigned to rooms whose type nothing tells; without it they are left out. Raises InputError where
    there is no file of a house, and where model_info.json cannot be read.
    """
    folder = root.parent if root.is_file() else root
    files = files_below(root, (".json",), (MODELS,))
    if not files:
        raise InputError(f"no houses in {root.absolute()}: expected .json files of 3D-FRONT; name their folder")
    models = _models(folder / MODELS)
    collection = Collection(f"front3d {root}")
    for file in files:
        name = name_of(file, root)
        house: Storey[Piece] = Storey(name)
        with collection.or_left_out(str(file)):
            _draw(house, loaded(_text(file)), models, names)
            collection.rooms += [room for room, _ in house.make_rooms(names, name, room_type)]
        collection.left_out += house.left_out
        collection.notes += house.notes
    collection.notes += names.notes()
    return collection


def _text(file: Path) -> bytes:
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise RoomError("text", f"expected a house, of at most {LARGEST_FILE >> 20} MB")
        return file.read_bytes()
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})") from None


def _models(file: Path) -> dict[str, Any]:
    """Return models by their id, none where there is no such file. Raises InputError where it cannot be read."""
    if not file.is_file():
        return {}
    try:
        models = json.loads(file.read_bytes())
        return models if isinstance(models, dict) else {model["model_id"]: model for model in models}
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        raise InputError(f"{file}: expected the list of models of 3D-FUTURE, in JSON") from None


def _draw(house: Storey[Piece], document: Any, models: Mapping[str, Any], names: Names) -> None:
    """Add the floors, openings and pieces of a document to a house. Raises one of ODD for a broken document."""
    meshes = {mesh["uid"]: mesh for mesh in document["mesh"]}
    furniture: dict[Any, Any] = {}
    unnamed: list[Any] = []
    for piece in document["furniture"]:
        try:
            furniture[piece["uid"]] = piece
        except ODD:
            unnamed.append(piece)
    placed: list[tuple[Any, str | int | None]] = []
    for number, room in enumerate(document["scene"]["room"], 1):
        try:
            name, label = str(room["type"]), str(room["instanceid"])[:60].replace("/", "-")
            children = [(child, _ref(child)) for child in room["children"]]
        except ODD:
            house.left_out.append((f"{house.prefix}/room {number}", BROKEN))
            continue
        placed += children
        drawn = [meshes[ref] for _, ref in children if ref in meshes]
        floors = [mesh for mesh in drawn if mesh["type"] == "Floor"]
        house.add_room(name, label, partial(_floor, floors))
        house.openings += [opening for mesh in drawn if mesh["type"] in OPENINGS and (opening := _opening(mesh))]
    astray = sum(ref is not None and ref not in meshes and ref not in furniture for _, ref in placed)
    for piece in [each for each in unnamed if not names.is_decor(*_said(each))][:astray]:  # only so many can be placed
        house.odd[_called(piece)] += 1
    titled = [(child, furniture[ref]) for child, ref in placed if _title(furniture.get(ref)) in WIDTH]
    for child, given in titled if not house.openings else ():  # these count only where no mesh is an opening
        with house.or_left_out(_called(given)):
            house.openings.append(_titled(child, _title(given)))
    for child, ref in placed:
        given = furniture.get(ref)
        if ref is None:
            house.odd[_called(None)] += 1
        elif given and given.get("valid") is not False and _title(given) not in WIDTH:  # it is False for broken ones
            with house.or_left_out(_called(given), partial(names.is_decor, *_said(given))):
                if piece := _piece(child, given, models, names, house.unsized):
                    house.add_piece(piece)


def _ref(child: Any) -> str | int | None:
    """Return the uid of the mesh or piece that a child of a room refers to; None where there is none."""
    ref = child.get("ref") if isinstance(child, dict) else None
    return ref if isinstance(ref, str | int) else None


def _title(piece: Any) -> str:
    """Return the first part of a piece's title, up to a slash: what the piece is."""
    return str((piece or {}).get("title")).partition("/")[0]


def _said(piece: Any) -> list[str]:
    """Return the names that a house gives a piece, the most telling first; none if it is not a dictionary."""
    if not isinstance(piece, dict):
        return []
    given = (piece.get("title"), SOURCE_CATEGORIES.get(str(piece.get("sourceCategoryId"))), piece.get("category"))
    return [str(name) for name in given if name]


def _called(piece: Any) -> str:
    """Return the name of a piece for messages."""
    return (*_said(piece), "without a name")[0]


def _floor(meshes: list[Any]) -> Polygon:
    """Return the largest part of the union of all triangles: several levels of detail overlap.

    Raises RoomError where there is no area, or too many triangles.
    """
    triangles: list[np.ndarray] = []
    for mesh in meshes:
        corners = _corners(mesh)
        faces = mesh["faces"]
        if len(faces) > 3 * MOST:
            raise RoomError("floor", f"expected at most {MOST:,} triangles")
        index = np.array(faces, dtype=float)
        if index.ndim != 1 or len(index) % 3 or not ((index >= 0) & (index < len(corners))).all():
            raise RoomError("floor", "expected triangles between its corners")
        triangles += list(corners[index.astype(int)].reshape(-1, 3, 2))
    shapes = shapely.polygons(np.array(triangles).reshape(-1, 3, 2))
    shapes = shapes[shapely.area(shapes) > SEAM**2]
    with np.errstate(all="ignore"):  # GEOS divides by zero at a straight corner, to no harm
        whole = shapely.union_all(shapely.buffer(shapes, SEAM, join_style="mitre")).buffer(-SEAM, join_style="mitre")
    parts = [part for part in shapely.get_parts(whole) if isinstance(part, Polygon)]
    if not parts:
        raise RoomError("floor", "expected a mesh of type Floor with an area; there is none")
    return max(parts, key=lambda part: part.area)


def _corners(mesh: Any) -> np.ndarray:
    """Return the corners (n, 2) of a mesh in metres, seen from above with y up."""
    values = mesh["xyz"]
    if len(values) > 9 * MOST:
        raise RoomError("mesh", f"expected at most {MOST:,} triangles")
    points = np.array(lengths(values)).reshape(-1, 3)
    return points[:, [0, 2]] * (1, -1)


def _opening(mesh: Any) -> DrawnOpening | None:
    shape = shapely.MultiPoint(_corners(mesh)).minimum_rotated_rectangle
    if not isinstance(shape, Polygon) or shape.area < TOLERANCE**2:
        return None
    high = min(lengths(mesh["xyz"][1::3])) > HIGHEST  # a hatch
    return DrawnOpening("window" if high else OPENINGS[mesh["type"]], shape)


def _titled(child: Any, title: str) -> DrawnOpening:
    """Return the door or window that a piece is by its title, of the usual width (WIDTH) times its scale."""
    x, _, z = lengths(child["pos"])
    wide = WIDTH[title] * abs(lengths(child["scale"])[0])
    shape = oblong(x, -z, max(wide, WALL_THICKNESS + TOLERANCE), WALL_THICKNESS, _yaw(child))
    return DrawnOpening("door" if title == "door" else "window", shape)


def _yaw(child: Any) -> float:
    """How far a child is turned, in degrees, counter-clockwise seen from above."""
    a, b, c, d = lengths(child["rot"])
    return math.degrees(math.atan2(2 * (d * b + a * c), 1 - 2 * (a * a + b * b)))


def _piece(child: Any, piece: Any, models: Mapping[str, Any], names: Names, unsized: Counter[str]) -> Piece | None:
    """Return a piece that stands on the floor; None for decor, and if its size is unknown, which `unsized` counts."""
    x, y, z = lengths(child["pos"])
    if y > HIGHEST:
        return None
    model = models.get(str(piece.get("jid")), {})
    called = [*_said(piece), *(str(name) for name in (model.get("category"), model.get("super-category")) if name)]
    size = _size(piece, model)
    if size is None:
        if not names.is_decor(*called):
            unsized[called[0] if called else "without a name"] += 1
        return None
    scale = lengths(child["scale"])
    width, height, depth = lengths(abs(side * by) for side, by in zip(size, scale, strict=True))
    if height < FLATTEST or min(width, depth) < TOLERANCE:
        return None
    found = names.category(*called)
    if found is None:
        return None
    return Piece(Item(found[0], (depth, width), (x, -z), (270 + _yaw(child)) % 360), found[1])


def _size(piece: Any, model: Any) -> tuple[float, float, float] | None:
    """Return (width, height, depth) in metres; None where nothing tells it.

    A piece's `bbox` has this order. Its `size` has width, depth, height, as models have, which are in centimetres.
    """
    if piece.get("size"):
        width, depth, height = lengths(piece["size"])
        return width, height, depth
    if piece.get("bbox"):
        inner = piece["bbox"]
        width, height, depth = lengths(inner[0] if isinstance(inner[0], list) else inner)
        return width, height, depth
    if model and model.get("boundingBox"):
        width, depth, height = lengths(float(model["boundingBox"][axis]) / 100 for axis in ("xLen", "yLen", "zLen"))
        return width, height, depth
    return None
