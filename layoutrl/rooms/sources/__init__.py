"""Where rooms come from."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from layoutrl.errors import InputError
from layoutrl.rooms.collection import Collection
from layoutrl.rooms.files import read_rooms
from layoutrl.rooms.sources import designer_rooms, floorplans

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SOURCES = ("examples", "floorplans", "designer_rooms", "json")


def read_source(
    source: str, room_type: str, root: Path | None, labels: Literal["snapped", "raw"] = "snapped", strict: bool = False
) -> Collection:
    """The rooms of one type that a source holds. Raises InputError where the source or its files are unknown."""
    if source == "examples":
        return replace(read_rooms(EXAMPLES / f"{room_type}.jsonl", strict=True), source="examples")
    if root is None:
        raise InputError(f"data.root: {source} expects the folder of its files, as data.root=<folder>")
    if source == "floorplans":
        return floorplans.read(root, room_type, labels)
    if source == "designer_rooms":
        return designer_rooms.read(root, room_type)
    if source == "json":
        collection = read_rooms(root, strict)
        others = [room for room in collection.rooms if room.room_type != room_type]
        collection.left_out += [(room.id, f"is a {room.room_type}, not a {room_type}") for room in others]
        collection.rooms = [room for room in collection.rooms if room.room_type == room_type]
        return collection
    raise InputError(f"data.source: expected one of {', '.join(SOURCES)}; got {source}")
