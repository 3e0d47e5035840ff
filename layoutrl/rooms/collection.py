"""Rooms as a source hands them over, and what training takes from them: choice of the item, split, copies."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

from layoutrl.rooms.room import MAIN_ITEM, Room

FOLDS = 5  # one fifth of the groups is held out


@dataclass
class Collection:
    """What a source read: the rooms it kept, and (id, reason) of each that it left out."""

    source: str
    rooms: list[Room] = field(default_factory=list)
    left_out: list[tuple[str, str]] = field(default_factory=list)

    def __str__(self) -> str:
        lines = [f"{self.source}: read {len(self.rooms) + len(self.left_out)}, kept {len(self.rooms)}"]
        reasons = Counter(reason for _, reason in self.left_out)
        lines += [f"  left out {count:4d}: {reason}" for reason, count in reasons.most_common()]
        return "\n".join(lines)
