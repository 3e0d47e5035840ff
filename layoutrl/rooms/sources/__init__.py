"""Sources of rooms: the designer, whose training and test rooms have different seeds, and readers of files."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from layoutrl import InputError
from layoutrl.rooms.categories import names_of
from layoutrl.rooms.collection import Collection
from layoutrl.rooms.files import check_not_given, read_rooms
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.rooms.sources import designer_rooms, floorplans, front3d, procthor, sweethome3d

READERS = {"sweethome3d": sweethome3d.read, "procthor": procthor.read, "front3d": front3d.read}  # of whole homes
FILES = ("floorplans", "designer_rooms", "json", *READERS)


def main_item(source: str, room_type: str) -> str:
    """Return the category of the item that `main` chooses: the paper's, or for floor plans one that they hold."""
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
    """Return the rooms of one type in a source's files.

    `labels` is used by floorplans alone, `strict` and `unit` by json, `categories` by homes and houses. Raises
    InputError for an unknown source, no root, a root without files, and a room type that the source does not have.
    """
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
    """Return the rooms of all types in files of a source that mixes them: json or one of READERS.

    `room_type` is assigned to rooms whose type nothing tells; without it they are left out. Raises InputError where
    there are no files, and where `categories` are given for json.
    """
    if source == "json":
        check_not_given(root, categories=categories)
        return read_rooms(root, strict, unit, room_type)
    return READERS[source](root, names_of(categories), room_type)
