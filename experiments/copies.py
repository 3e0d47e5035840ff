"""How many held-out rooms are copies of training rooms: turned or, where a mirrored room is furnished alike, mirrored?
One type a call:

    python experiments/copies.py balcony [--rooms 1000] [--seed 0] [--results <folder>]

Two rooms are the same if walls, doors, windows and the list of furniture are, to a centimetre. With seed 0 it also says
what the IoU of methods of Table 3 is with and without the copies.

Prints the numbers and writes experiments/results/copies/<type>.json.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
from cell_config import LAYOUTS
from kept import RESULTS, options, print_and_write
from printing import row
from table3 import METHODS

from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import SYMMETRIES, Room, symmetry
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.config import composed

KEPT = RESULTS / "copies"
TRAINING = 5000  # rooms that agents and rivals learned from
LEARNED = ("agent", "pointer in sequence", "nearest room")  # methods of Table 3 that use the training rooms


def key(room: Room) -> tuple[Any, ...]:
    """Return a key, in whole centimetres, that a room shares with its turned (or mirrored) and refurnished copies."""
    rings = [("outline", room.outline), *((opening.kind, opening.polygon) for opening in room.openings)]
    sizes = [np.rint(np.multiply(item.size, 100)).astype(int).tolist() for item in room.furniture]
    listed = sorted((item.category, item.form, *size) for item, size in zip(room.furniture, sizes, strict=True))
    return min(tuple(sorted(seen)) for seen in _views(rings, mirrors_alike(room.room_type))), tuple(listed)


@cache
def mirrors_alike(room_type: str) -> bool:
    """Whether training also uses mirrored rooms of this type."""
    return bool(composed("train", f"room={room_type}").room.mirrors_alike)


def _views(rings: list[tuple[str, Any]], mirrors: bool) -> Iterator[list[tuple[Any, ...]]]:
    """Yield for each view the kind and sorted corners of each ring, in centimetres from the lower left of the first."""
    for quarters, mirror in [view for view in SYMMETRIES if mirrors or not view[1]]:
        turned = [np.array(ring) @ symmetry(quarters, mirror).T for _, ring in rings]
        corners = [np.rint(100 * (ring - turned[0].min(0))).astype(int) for ring in turned]
        yield [(kind, *sorted(map(tuple, ring.tolist()))) for (kind, _), ring in zip(rings, corners, strict=True)]


@answers_errors()
def main() -> None:
    said = options(__doc__, rooms=1000, seed=0, results=KEPT)
    learned = {key(room) for room in design_rooms(said.room_type, "train", said.seed, TRAINING).rooms}
    copied = np.array(
        [key(room) in learned for room in design_rooms(said.room_type, "test", said.seed, said.rooms).rooms]
    )
    found: list[tuple[str, Any]] = [("copies", int(copied.sum()))]
    for name in LEARNED if said.seed == 0 else ():
        if kept := row(RESULTS / "default/table3", f"{said.room_type}-own-{METHODS[name]}", LAYOUTS):
            iou = kept.iou[0, : said.rooms]
            alone = iou[~copied[: len(iou)]]
            without = float(alone.mean()) if len(alone) else None
            found.append((name, {"all": float(iou.mean()), "without": without}))
    print_and_write(said, found)


if __name__ == "__main__":
    main()
