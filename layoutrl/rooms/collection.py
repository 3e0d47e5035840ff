"""Rooms as a source hands them over, and what training takes from them: the item, the split, the copies."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from layoutrl.rooms.room import FIT, Room

FOLDS = 5  # one fifth of the groups is held out
NAMED = 3  # examples named for each reason in a summary


@dataclass
class Collection:
    """What a source read: the rooms it kept, and (id, reason) of each that it left out."""

    source: str
    rooms: list[Room] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)

    def __str__(self) -> str:
        lines = [f"{self.source}: read {len(self.rooms) + len(self.left_out)} rooms, kept {len(self.rooms)}"]
        by_reason: dict[str, list[str]] = defaultdict(list)
        for room_id, reason in self.left_out:
            by_reason[reason].append(room_id)
        for reason, ids in sorted(by_reason.items(), key=lambda entry: -len(entry[1])):
            named = ", ".join(ids[:NAMED]) + (", ..." if len(ids) > NAMED else "")
            lines.append(f"  left out {len(ids)}: {reason} ({named})")
        return "\n".join(lines)


def choose_item(collection: Collection, category: str) -> Collection:
    """The rooms in which one item of `category` can move, as their target.

    `main` keeps the source's choice; `all` gives every room once for each of its items.
    """
    chosen = Collection(f"{collection.source}, item {category}", left_out=list(collection.left_out))
    for room in collection.rooms:
        if category == "main":
            indices = [] if room.target is None else [room.target]
        else:
            indices = [k for k, item in enumerate(room.furniture) if category in (item.category, "all")]
        if not indices or (len(indices) > 1 and category != "all"):
            several = "several" if indices else "none or several" if category == "main" else "no"
            what = "item" if category == "all" else f"{category} item"
            chosen.left_out.append((room.id, f"holds {several} {what}"))
            continue
        for target in indices:
            candidate = replace(room, target=target)
            name = candidate.moving.category
            if candidate.moving.center is None:
                chosen.left_out.append((room.id, f"the {name} item has no center, so the designer's place is unknown"))
            elif not candidate.holds(candidate.moving, FIT):
                chosen.left_out.append((room.id, f"the {name} item reaches beyond the outer walls"))
            else:
                chosen.rooms.append(candidate)
    return chosen


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


def with_copies(rooms: Sequence[Room]) -> list[Room]:
    """Every room in its eight mirrored and turned copies (the first is the room itself)."""
    return [room.turned(quarters, mirror) for room in rooms for mirror in (False, True) for quarters in range(4)]
