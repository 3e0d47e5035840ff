"""Training and held-out rooms of any source, with the item that moves chosen."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from layoutrl import InputError
from layoutrl.rooms.collection import Collection, all_standing, choose_item, split
from layoutrl.rooms.designer.generator import Part
from layoutrl.rooms.disturbances import disturbed
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources import FILES, designer_cache, designer_rooms, floorplans, read_homes


@dataclass
class Data:
    """Configuration of the rooms: their source, number and seed. The values are in `conf/data/`."""

    source: str | None  # designer, floorplans, designer_rooms, json, sweethome3d, procthor or front3d
    root: str | None = None  # folder or file of the source's original data; designer: of its cache
    train_rooms: int | None = 5000  # designer: rooms to train on
    test_rooms: int | None = 1000  # designer: held-out rooms, from a seed of their own
    seed: int | None = 0  # designer: of the rooms
    disturbed: float | None = 0.0  # designer: share of the training rooms that are disturbed as flats are
    labels: Any = "snapped"  # floorplans: designer's places moved flush to walls, or as drawn (raw)
    strict: bool | None = False  # json: stop at the first room that cannot be used
    unit: str | None = "auto"  # json: m, cm, mm, in, ft, or auto, which infers m, cm or mm from how large rooms are
    categories: str | None = None  # sweethome3d, procthor, front3d: a YAML file of further names of furniture

    @property
    def path(self) -> Path | None:
        """The root as a path, `~` resolved."""
        return None if self.root is None else Path(self.root).expanduser()

    def read(self, room_type: str) -> Collection:
        """Return the rooms of one type in the source's files.

        Raises InputError for an unknown source, no root, a root without files, and a room type that the source lacks.
        """
        source, root = str(self.source), self.path
        if source not in FILES:
            raise InputError(f"data.source: expected one of designer, {', '.join(FILES)}; got {source}")
        if root is None:
            raise InputError(f"data.root: {source} expects the folder of its files, as data.root=<folder>")
        if source == "floorplans":
            return floorplans.read(root, room_type, self.labels)
        if source == "designer_rooms":
            return designer_rooms.read(root, room_type)
        categories = None if self.categories is None else Path(self.categories).expanduser()
        collection = read_homes(source, root, categories, bool(self.strict), self.unit or "auto")
        others = [room for room in collection.rooms if room.room_type != room_type]
        collection.left_out += [(room.id, f"the room is a {room.room_type}, not a {room_type}") for room in others]
        collection.rooms = [room for room in collection.rooms if room.room_type == room_type]
        return collection


def parts_of(scope: str, room_type: str, item: str, data: Data, fold: int) -> tuple[list[Room], list[Room]]:
    """Return (training, held-out) rooms: whole ones for scope `room`, those in which `item` moves for scope `item`."""
    return whole_parts(room_type, data, fold) if scope == "room" else read_parts(room_type, item, data, fold)


def read_parts(room_type: str, item: str, data: Data, fold: int) -> tuple[list[Room], list[Room]]:
    """Return (training, held-out) rooms in which `item` moves; print how many were read, kept and left out, and why.

    The designer makes the two parts from different seeds. Rooms of files are split by the hash of their group.
    Raises InputError where `item` moves in none of them.
    """
    if data.source == "designer":
        return designed_rooms(room_type, item, data, "train"), designed_rooms(room_type, item, data, "test")
    return split(_with_item(data.read(room_type), room_type, item), fold)


def whole_parts(room_type: str, data: Data, fold: int) -> tuple[list[Room], list[Room]]:
    """Return (training, held-out) rooms in which every item has a place; print what was left out, and why."""
    if data.source == "designer":
        return designs(room_type, data, "train").rooms, designs(room_type, data, "test").rooms
    chosen = all_standing(data.read(room_type))
    print(chosen)
    return split(chosen.rooms, fold)


def two_parts(room_type: str, item: str, data: Data, fold: int) -> tuple[list[Room], list[Room]]:
    """(training, held-out) rooms as `read_parts` has them. Raises InputError where either part is empty."""
    return none_empty(*read_parts(room_type, item, data, fold))


def none_empty(training: list[Room], held_out: list[Room]) -> tuple[list[Room], list[Room]]:
    """The two parts. Raises InputError where either is empty."""
    if not training or not held_out:
        raise InputError(
            f"fold: {len(training)} rooms to train on and {len(held_out)} held out; expected some of both "
            "(more rooms, or another fold)"
        )
    return training, held_out


def designed_rooms(room_type: str, item: str, data: Data, part: Part) -> list[Room]:
    """One part of the designer's rooms in which `item` moves; prints how each template fared."""
    return _with_item(designs(room_type, data, part), room_type, item)


def designs(room_type: str, data: Data, part: Part) -> Collection:
    """Return one part of the designer's rooms, whole; print how each template fared.

    Raises InputError where `data` has no count or seed, and where its root is a file.
    """
    count = {"train": data.train_rooms, "test": data.test_rooms}[part]
    if count is None or data.seed is None:
        raise InputError(f"data: the designer expects data.{part}_rooms and data.seed as numbers; got null")
    if data.path and data.path.is_file():
        raise InputError(
            f"data.root: {data.path} is a file; the designer expects the folder of its cache (data=json reads rooms)"
        )
    made = designer_cache.read(data.path, room_type, part, data.seed, count)
    print(f"designer, {part} rooms of seed {data.seed}\n{made}")
    if part == "train" and data.disturbed:
        _disturb(made.rooms, data.disturbed, data.seed)
    return Collection(f"designer, {part}", made.rooms, inside=True)


def _disturb(rooms: list[Room], share: float, seed: int) -> None:
    """Disturb about this share of the rooms, in place.

    What happens to a room depends on seed and index, not on how many rooms there are.
    """
    rngs = [np.random.default_rng([seed, k]) for k in range(len(rooms))]
    chosen = [k for k, rng in enumerate(rngs) if rng.random() < share]
    changed = disturbed([rooms[k] for k in chosen], [rngs[k] for k in chosen])
    for k, (room, _) in zip(chosen, changed, strict=True):
        rooms[k] = room
    print(f"  disturbed as flats are: {sum(bool(names) for _, names in changed)} rooms")


def _with_item(collection: Collection, room_type: str, item: str) -> list[Room]:
    chosen = choose_item(collection, item)
    print(chosen)
    if not collection.rooms:
        raise InputError(f"data: {collection.source} has no {room_type} that can be used")
    if not chosen.rooms:
        held = sorted({item.category for room in collection.rooms for item in room.furniture})
        raise InputError(
            f"room.item: no {room_type} of {collection.source} can be used with item {item}; "
            f"expected {', '.join(['main', 'all', *held])}"
        )
    return chosen.rooms
