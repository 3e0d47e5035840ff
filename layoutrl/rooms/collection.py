"""Rooms as a source reads them, and what training takes from them: the item that moves, the held-out split."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

from layoutrl import InputError
from layoutrl.rooms.brief import LEVEL, distinct_rotations, facings
from layoutrl.rooms.clearances import angle_off
from layoutrl.rooms.fitting import fits
from layoutrl.rooms.room import FIT, Item, Room

FOLDS = 5  # one fifth of the groups is held out
NAMED = 3  # examples named for each reason in a summary
ODD = (LookupError, TypeError, ValueError, ArithmeticError, AttributeError)  # what a broken field raises
BROKEN = "a field is missing or is not of the expected kind"
NOBODYS = "nobody furnishes such a room"
UNTOLD = "nothing tells its type"


@dataclass
class Collection:
    """What a source read: the rooms it kept, and (id, reason) of each that it left out.

    `inside` says that no item reaches beyond the outer walls, so that this need not be checked. `notes` are lines with
    what else the user should know of the reading; `homeless` are the categories of items that are to be placed but
    found no room.
    """

    source: str
    rooms: list[Room] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)
    inside: bool = False
    notes: list[str] = field(default_factory=list)
    homeless: list[str] = field(default_factory=list)

    def unread(self, only: str | None = None) -> int:
        """How many rooms and files could not be read: all that are left out, but for NOBODYS.

        If `only` is given, rooms that it does not name do not count. Files do: they may hold one that it names.
        """
        reasons = [why for label, why in self.left_out if not only or naming(only, label) or Path(label).is_file()]
        return sum(why != NOBODYS for why in reasons)

    @contextmanager
    def or_left_out(self, label: str) -> Iterator[None]:
        """Leave out `label`, with the reason, if the body raises InputError or what a broken field raises (ODD)."""
        try:
            yield
        except InputError as error:
            self.left_out.append((label, str(error)))
        except ODD:
            self.left_out.append((label, BROKEN))

    def __str__(self) -> str:
        kept = {room.id for room in self.rooms}
        read = kept | {room_id for room_id, _ in self.left_out}
        items = f", {len(self.rooms)} items to move" if len(self.rooms) > len(kept) else ""
        lines = [f"{self.source}: read {len(read)} rooms, kept {len(kept)}{items}"]
        by_reason: dict[str, list[str]] = defaultdict(list)
        for room_id, reason in self.left_out:
            by_reason[reason].append(room_id)
        for reason, ids in sorted(by_reason.items(), key=lambda entry: -len(entry[1])):
            named = ", ".join(ids[:NAMED]) + (", ..." if len(ids) > NAMED else "")
            lines.append(f"  left out {len(ids)}: {reason} ({named})")
        return "\n".join(lines + [f"  {note}" for note in self.notes])


def taken_for(room: Room) -> str:
    """Return the note on a room whose type nothing tells: which type it is taken for."""
    return f"{room.id}: {UNTOLD}; it is taken for a {room.room_type.replace('_', ' ')}"


def naming(names: str | None, room_id: str) -> set[str]:
    """Return those of the comma-separated names that mean a room: its id, or what follows a slash in it.

    Case does not matter, and a dash may stand for a slash. A name may contain commas: then all of its parts are
    returned.
    """

    def folded(names: Sequence[str]) -> str:
        return ",".join(name.strip() for name in names).casefold().replace("/", "-")

    parts = room_id.split("/")
    calls = {folded("/".join(parts[first:]).split(",")) for first in range(len(parts))}
    said = [name.strip() for name in names.split(",")] if names else []
    runs = [said[k:n] for k in range(len(said)) for n in range(k + 1, len(said) + 1)]
    return {name for run in runs if folded(run) in calls for name in run}


def choose_item(collection: Collection, category: str) -> Collection:
    """Return the rooms with an item of `category` as their target, each room once for every such item.

    `main` keeps the source's choice; `all` takes every item. Rooms without such an item are left out, and so are items
    that have no center or reach beyond the outer walls.
    """
    chosen = _after(collection, f"item {category}")
    for room in collection.rooms:
        if category == "main":
            indices = [] if room.target is None else [room.target]
        else:
            indices = [k for k, item in enumerate(room.furniture) if category in (item.category, "all")]
        if not indices:
            what = {"main": "no main item, or several", "all": "no furniture"}.get(category, f"no {category}")
            chosen.left_out.append((room.id, f"the room holds {what}"))
        for index in indices:
            item = room.furniture[index]
            if item.center is None:
                reason = f"the {item.category} has no center, so the designer's place is unknown"
                chosen.left_out.append((room.id, reason))
            elif not (collection.inside or room.holds(item, FIT)):
                chosen.left_out.append((room.id, f"the {item.category} reaches beyond the outer walls"))
            else:
                chosen.rooms.append(replace(room, target=index))
    return chosen


def all_standing(collection: Collection) -> Collection:
    """Return the furnished rooms in which every item stands within the outer walls, and also fits along the walls."""
    chosen = _after(collection, "whole rooms")
    for room in collection.rooms:
        if not room.furniture:
            chosen.left_out.append((room.id, "the room holds no furniture"))
        elif some := [item.category for item in room.furniture if item.center is None]:
            chosen.left_out.append((room.id, f"the {some[0]} has no center, so the designer's place is unknown"))
        elif some := [i.category for i in room.furniture if not (collection.inside or room.holds(i, FIT))]:
            chosen.left_out.append((room.id, f"the {some[0]} reaches beyond the outer walls"))
        elif some := [item.category for item in room.furniture if not _fits_along_walls(room, item)]:
            chosen.left_out.append((room.id, f"the {some[0]} fits in no way along the walls, as items are placed"))
        else:
            chosen.rooms.append(room)
    return chosen


def _fits_along_walls(room: Room, item: Item) -> bool:
    """Whether an item that stands at any angle would fit into the empty room along its walls."""
    if angle_off(item.degrees - facings(room)[0], 90.0) < LEVEL:
        return True
    return fits(room.envelope, item, distinct_rotations(room, replace(item, rotation=None)))


def _after(collection: Collection, chosen: str) -> Collection:
    """Return a collection without rooms, with what was left out and noted before."""
    return Collection(f"{collection.source}, {chosen}", left_out=[*collection.left_out], notes=[*collection.notes])


def digest(rooms: Sequence[Room]) -> str:
    """Return a SHA-256 hash of rooms and all that they hold."""
    return hashlib.sha256(repr(rooms).encode()).hexdigest()


def split(rooms: Sequence[Room], fold: int = 0) -> tuple[list[Room], list[Room]]:
    """(training, held-out) rooms: a group is held out when the hash of its name falls into `fold` of five.

    The hash depends on nothing but the name, so that more rooms, another order or another
    machine never move a room to the other side.
    """
    held_out = [int(hashlib.sha256(room.group.encode()).hexdigest(), 16) % FOLDS == fold for room in rooms]
    return (
        [room for room, held in zip(rooms, held_out, strict=True) if not held],
        [room for room, held in zip(rooms, held_out, strict=True) if held],
    )
