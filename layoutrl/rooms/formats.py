"""Read rooms from files of all formats, and write layouts back: a home as a home, all else as rooms in JSON.

    source = opened(Path("home.sh3d"), move="bed,wardrobe")
    print(source.collection)           # what was read, and what was left out, and why
    ...                                # furnish rooms of source.collection.rooms that lack an item's center
    source.write(layouts, Path("home-placed.sh3d"))

The format is detected from the content; that of a folder, from its first file.
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from shapely import Point

from layoutrl import InputError
from layoutrl.rooms.brief import without_poses
from layoutrl.rooms.categories import ALL, names_in, names_of
from layoutrl.rooms.collection import Collection
from layoutrl.rooms.documents import check_room_type
from layoutrl.rooms.files import FORMATS, HOMES, check_new, check_not_given, files_below, write_rooms
from layoutrl.rooms.files import SUFFIXES as JSON_SUFFIXES
from layoutrl.rooms.room import Item, Room
from layoutrl.rooms.sources import read_homes
from layoutrl.rooms.sources.front3d import MODELS
from layoutrl.rooms.sources.procthor import ASSETS
from layoutrl.rooms.sources.procthor import SUFFIXES as HOUSE_SUFFIXES
from layoutrl.rooms.sources.sweethome3d import read_folder, read_home

SUFFIXES = ".json, .jsonl, .jsonl.gz, .sh3d and .sh3x"
READ = {  # suffixes of the files that are read from a folder, by its format
    "json": JSON_SUFFIXES,
    "sweethome3d": HOMES,
    "procthor": HOUSE_SUFFIXES,
    "front3d": (".json",),
}
LOOK = 2**20  # bytes at the start of a file, from which its format is detected


class Source(Protocol):
    """Rooms that were read, and how layouts of them are written."""

    collection: Collection  # items that are to be placed have no center

    @property
    def suffix(self) -> str:
        """The suffix of the files that it writes, such as ".jsonl"."""
        ...

    @property
    def stood(self) -> list[tuple[Item, ...]]:
        """The furniture of each room as it stands in the file, including what is to be placed anew."""
        ...

    def write(self, layouts: Iterable[Room], out: Path | str) -> None:
        """Write layouts to a new file: rooms of the collection, by their ids, with the same items in the same order.

        An item without a center is left where it was. Raises InputError where `out` is there already, has another
        suffix or cannot be written.
        """
        ...


@dataclass
class RoomsSource:
    """Rooms in JSON, or in a format that is only read. Layouts of both are written as JSON, a room a line."""

    collection: Collection
    stood: list[tuple[Item, ...]]
    suffix: str = ".jsonl"

    def write(self, layouts: Iterable[Room], out: Path | str) -> None:
        """Write the layouts, and no other rooms.

        An item without a center is written where it stood, unless that is outside its room. Raises InputError as every
        Source does.
        """
        check_new(out, self.suffix)
        stood = {room.id: items for room, items in zip(self.collection.rooms, self.stood, strict=True)}
        layouts = list(layouts)
        if others := [layout.id for layout in layouts if layout.id not in stood]:
            raise InputError(f"layouts: expected those of rooms that were read; got one of {others[0]!r:.60}")
        try:
            write_rooms(out, (_or_as_it_stood(layout, stood[layout.id]) for layout in layouts))
        except OSError as error:
            raise InputError(f"out: {out} cannot be written ({error.strerror})") from None


def _or_as_it_stood(layout: Room, stood: Sequence[Item]) -> Room:
    """Return the layout with each item without a center as it stood, if that is in the room."""

    def stays(item: Item, before: Item) -> bool:
        return item.center is None and before.center is not None and layout.envelope.covers(Point(before.center))

    items = zip(layout.furniture, stood, strict=True)
    return replace(layout, furniture=tuple(before if stays(item, before) else item for item, before in items))


def opened(
    path: Path | str,
    *,
    move: str | None = None,
    into: str | None = None,
    room_type: str | None = None,
    categories: Path | str | None = None,
    unit: str = "auto",
) -> Source:
    """Read the rooms of a file, or of all files of a folder.

    Raises InputError where none can be read, for an unknown `room_type`, and for an option that does not apply to
    their format.

    The format is detected from the suffix and the content: rooms in JSON (.json, .jsonl), a home of Sweet Home 3D
    (.sh3d, .sh3x), houses of ProcTHOR (.json, .jsonl, .jsonl.gz) and of 3D-FRONT (.json).

    - `move`: what is to be placed anew, `all` or categories with commas between them. By default what the file marks:
      items without a center; in a home, what stands outside all rooms.
    - `into`: for a home, the id of the one room that gets the furniture outside all rooms; by default each piece goes
      to a room whose type knows it and that has floor for it.
    - `room_type`: the type of rooms whose type neither the file, nor their name or furniture tells; without it they are
      left out.
    - `categories`: a YAML file with more names of furniture; for all formats but rooms in JSON.
    - `unit`: of the lengths in JSON, as in `layoutrl.rooms.files.read_rooms`. Layouts are written in metres.
    """
    if room_type is not None:
        check_room_type(room_type)
    if not isinstance(move, str | None):
        raise InputError(f"move: expected text, or None; got {move!r:.60}")
    path = Path(path)
    kind = format_of(path)
    if kind == "json":
        check_not_given(path, into=into, categories=categories)
    elif unit != "auto":
        raise InputError(f"unit: {path} says itself how long a metre is; expected no unit=")
    if kind == "sweethome3d" and path.is_file():
        return read_home(path, move=move, into=into, room_type=room_type, names=names_of(categories))
    if into is not None:
        raise InputError(f"into: it is said of one home of Sweet Home 3D alone; got it for {path}")
    if kind == "sweethome3d":
        collection, stood = read_folder(path, names_of(categories), move=move, room_type=room_type)
    else:
        collection = read_homes(kind, path, categories, unit=unit, room_type=room_type)
        stood = [read.furniture for read in collection.rooms]
        collection.rooms = [to_place(read, move) for read in collection.rooms]
    collection.notes += other_formats(path, kind)
    return RoomsSource(collection, stood)


def other_formats(path: Path, kind: str) -> list[str]:
    """A line that says how many files below a folder are of another format than this one, if any are."""
    others = [file for file in files_below(path, FORMATS, (ASSETS, MODELS)) if file.suffix.lower() not in READ[kind]]
    if not others:
        return []
    files, are = ("1 file", "is") if len(others) == 1 else (f"{len(others)} files", "are")
    return [f"{files} of other formats {are} not read, such as {others[0]}; expected one format in a folder"]


def format_of(path: Path) -> str:
    """Return the format of a file, or of the first that can be one in a folder: json, sweethome3d, procthor or front3d.

    Raises InputError where there is none, it cannot be read, or it is packed and of json or front3d. A file of no known
    format is taken for json, a packed one for procthor: the reader then says what is wrong.
    """
    if not path.exists():
        raise InputError(f"{path}: no such file or folder; expected one of {SUFFIXES}")
    file = next(iter(files_below(path, FORMATS, (ASSETS, MODELS))), path)
    if file.suffix.lower() not in FORMATS or file.name in (ASSETS, MODELS):
        raise InputError(f"{path}: expected one of {SUFFIXES}, or a folder with some")
    if file.suffix.lower() in HOMES:
        return "sweethome3d"
    packed = file.suffix.lower() == ".gz"
    try:
        with gzip.open(file) if packed else file.open("rb") as text:
            told = _told(text.read(LOOK))
    except (OSError, EOFError, zlib.error) as error:
        if not packed and isinstance(error, OSError):
            raise InputError(f"{file}: cannot be read ({error.strerror})") from None
        return "procthor"  # its reader says what is wrong
    if packed and told in ("json", "front3d"):
        what = "rooms in JSON" if told == "json" else "a house of 3D-FRONT"
        raise InputError(f"{file}: {what} cannot be read from a packed file; unpack it, as with gunzip -k {file.name}")
    return told or ("procthor" if packed else "json")


def _told(start: bytes) -> str | None:
    """Return the format that the start of a file tells, or None.

    The order counts: "room_type" comes first, since rooms in JSON may have fields of the user's own, such as "jid" and
    "mesh"; "outline" comes later, since houses of 3D-FRONT may have one.
    """
    if b'"room_type"' in start:
        return "json"
    if b'"jid"' in start and b'"mesh"' in start:
        return "front3d"
    if b'"outline"' in start:
        return "json"
    return "procthor" if b'"floorPolygon"' in start or b'"assetId"' in start else None


def to_place(room: Room, move: str | None) -> Room:
    """Return the room with the items that `move` names still to be placed: without center and rotation.

    `move` is `all` or categories with commas between them; None leaves the room as it is. Locked items stay. An item
    that has no center keeps the rotation that is asked of it.
    """
    if move is None:
        return room
    named = names_in(move)
    stands = [
        (k, item.category) for k, item in enumerate(room.furniture) if item.center is not None and not item.locked
    ]
    those = {k for k, category in stands if category in named or ALL in named}
    return replace(room, furniture=without_poses(room.furniture, those))
