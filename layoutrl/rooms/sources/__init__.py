"""Where rooms come from: the designer, whose training and test rooms have seeds of their own, and files."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from layoutrl import InputError
from layoutrl.rooms.categories import names_of
from layoutrl.rooms.collection import Collection
from layoutrl.rooms.files import check_unsaid, read_rooms
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.rooms.sources import designer_rooms, floorplans, front3d, procthor, sweethome3d

READERS = {"sweethome3d": sweethome3d.read, "procthor": procthor.read, "front3d": front3d.read}  # of whole homes
FILES = ("floorplans", "designer_rooms", "json", *READERS)


def main_item(source: str, room_type: str) -> str:
    """The category that `main` chooses in rooms of a source: the paper's, or what floor plans hold."""
    return floorplans.MAIN_ITEM[room_type] if source == "floorplans" else MAIN_ITEM[room_type]


def read_files(
    source: str,
    room_type: str,
    root: Path | None,
    labels: Literal["snapped", "raw"],
    strict: bool,
    unit: str,
    categories: Path | None,
) -> Collection:
    """The rooms of one type that a source's files hold. Raises InputError where the source or its files are unknown."""
    if source not in FILES:
        raise InputError(f"data.source: expected one of designer, {', '.join(FILES)}; got {source}")
    if root is None:
        raise InputError(f"data.root: {source} expects the folder of its files, as data.root=<folder>")
    if source == "floorplans":
        return floorplans.read(root, room_type, labels)
    if source == "designer_rooms":
        return designer_rooms.read(root, room_type)
    collection = read_homes(source, root, categories, strict, unit)
    others = [room for room in collection.rooms if room.room_type != room_type]
    collection.left_out += [(room.id, f"the room is a {room.room_type}, not a {room_type}") for room in others]
    collection.rooms = [room for room in collection.rooms if room.room_type == room_type]
    return collection


def read_homes(
    source: str,
    root: Path,
    categories: Path | str | None,
    strict: bool = False,
    unit: str = "auto",
    room_type: str | None = None,
) -> Collection:
    """The rooms of all types in files of a source whose files do not say which type they hold.

    `room_type` is that of rooms of which nothing tells it. Raises InputError for categories of rooms in JSON.
    """
    if source == "json":
        check_unsaid(root, categories=categories)
        return read_rooms(root, strict, unit, room_type)
    return READERS[source](root, names_of(categories), room_type)
