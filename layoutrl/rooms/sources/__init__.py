"""Sources of rooms: the designer, whose training and test rooms have different seeds, and readers of files."""

from __future__ import annotations

from pathlib import Path

from layoutrl.rooms.categories import names_of
from layoutrl.rooms.collection import Collection
from layoutrl.rooms.files import check_not_given, read_rooms
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.rooms.sources import floorplans, front3d, procthor, sweethome3d

READERS = {"sweethome3d": sweethome3d.read, "procthor": procthor.read, "front3d": front3d.read}  # of whole homes
FILES = ("floorplans", "designer_rooms", "json", *READERS)


def main_item(source: str, room_type: str) -> str:
    """Return the category of the item that `main` chooses: the paper's, or for floor plans one that they hold."""
    return floorplans.MAIN_ITEM[room_type] if source == "floorplans" else MAIN_ITEM[room_type]


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
