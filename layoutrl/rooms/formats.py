"""Files of rooms, of whichever format: read into rooms, and layouts written back as what they came from.

source = opened(Path("home.sh3d"), move="bed,wardrobe")
print(source.collection)           # what was read, and what was left out, and why
...                                # furnish rooms of source.collection.rooms that lack an item's center
source.write(layouts, Path("home-placed.sh3d"))
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol

from layoutrl import InputError
from layoutrl.rooms.collection import Collection
from layoutrl.rooms.files import read_rooms, write_rooms
from layoutrl.rooms.room import Room


class Source(Protocol):
    """Rooms that were read, and how layouts of them are written."""

    collection: Collection  # what is to be placed has no center
    suffix: str  # of the files that it writes, such as ".jsonl"

    def write(self, layouts: Iterable[Room], out: Path) -> None:
        """Write layouts to a new file: rooms of the collection, by their ids, with the same items in the same order.

        An item without a center is left where it was. Raises InputError where `out` is there already, has another
        suffix or cannot be written.
        """
        ...


@dataclass
class RoomsSource:
    """Rooms of a format that layouts are not written in: they are written as JSON, a room a line."""

    collection: Collection
    suffix: str = ".jsonl"

    def write(self, layouts: Iterable[Room], out: Path) -> None:
        """Write the layouts, and no other rooms. Raises InputError as every Source does."""
        check_new(out, self.suffix)
        try:
            write_rooms(out, layouts)
        except OSError as error:
            raise InputError(f"out: {out} cannot be written ({error.strerror})") from None


def opened(
    path: Path,
    *,
    move: str | None = None,
    room: str | None = None,  # noqa: ARG001 - of homes
    room_type: str | None = None,  # noqa: ARG001 - of homes
    categories: Path | None = None,  # noqa: ARG001 - of homes
    unit: str = "auto",  # noqa: ARG001
    strict: bool = False,
) -> Source:
    """The rooms of a file, or of all files of a folder. Raises InputError where there is none that can be read.

    The format is found out from the content: rooms in JSON (.json, .jsonl), homes of Sweet Home 3D (.sh3d).

    - `move`: what is to be placed anew, `all` or categories with commas between them. By default what the file marks:
      items without a center; in a home, what stands outside all rooms.
    - `room`: the id of the one room that furniture outside all rooms is for; by default the room whose type knows it.
    - `room_type`: of rooms that neither their name nor their furniture tells of; without it they are left out.
    - `categories`: a YAML file with names of furniture, beside those that are known.
    - `unit`: of rooms in JSON: m, cm, mm, or auto, which tells them by how large rooms and doors are.
    - `strict`: raise InputError for the first room in JSON that cannot be used, instead of leaving it out.
    """
    collection = read_rooms(path, strict)
    collection.rooms = [to_place(read, move) for read in collection.rooms]
    return RoomsSource(collection)


def to_place(room: Room, move: str | None) -> Room:
    """The room in which what `move` names, all or categories with commas between them, has no center or rotation."""
    if move is None:
        return room
    named = {name.strip() for name in move.split(",")}
    items = tuple(
        replace(item, center=None, rotation=None) if item.category in named or "all" in named else item
        for item in room.furniture
    )
    return replace(room, furniture=items)


def check_new(out: Path, suffix: str) -> None:
    """Raise InputError unless `out` is a new file of this suffix: nothing of a user's is ever overwritten."""
    if out.exists() or out.suffix != suffix:
        what = "is there already" if out.exists() else f"is no {suffix} file"
        raise InputError(f"out: {out} {what}; expected the name of a new {suffix} file, as out=<file>")
