"""How well do the agents in the package furnish rooms that are not as those that they learned in? One type a call:

    python experiments/irregular_rooms.py bedroom [--rooms 100] [--seed 1] [--results <folder>]

Held-out designed rooms are disturbed as layoutrl/rooms/disturbances.py says. The same furniture is placed in them and,
for comparison, in the same rooms as designed.

Prints the numbers and writes experiments/results/irregular/<type>.json.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import torch
from kept import RESULTS, numbers, options, print_and_write

from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.disturbances import disturbed
from layoutrl.rooms.faults import Items
from layoutrl.rooms.furnished import best_layouts
from layoutrl.rooms.oddities import BACK, sides_off_walls
from layoutrl.rooms.room import Room
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.pretrained import load
from layoutrl.runs.ranges import within

AT_THE_WALL = 0.02  # metres from it, at most
ALWAYS = 0.95  # share of a category's designed items at a wall, from which the category belongs there
KEPT = RESULTS / "irregular"


def at_the_wall(layouts: Sequence[Room], designs: Sequence[Room]) -> float | None:
    """Return the share of items at a wall, of categories that the designer puts there; None if there are none."""
    designed, placed = (Counter(_sided(rooms)) for rooms in (designs, layouts))
    kinds = {kind for kind, _ in designed}
    belong = [kind for kind in kinds if designed[kind, True] >= ALWAYS * (designed[kind, True] + designed[kind, False])]
    there, off = (sum(placed[kind, stands] for kind in belong) for stands in (True, False))
    return there / (there + off) if there + off else None


def _sided(rooms: Sequence[Room]) -> Iterator[tuple[str, bool]]:
    """Return (category, whether its back, or any side if it has no front, is at a wall) of each placed rectangle."""
    items = Items.of(rooms)
    those = np.flatnonzero(items.placed & ~items.round)
    sides = sides_off_walls(rooms, items, those)
    back = np.where(items.period[those] == 360, sides[:, BACK], sides.min(1))
    return zip(items.category[those].tolist(), (back <= AT_THE_WALL).tolist(), strict=True)


@answers_errors()
def main() -> None:
    said = options(__doc__, rooms=100, seed=1, results=KEPT)
    designs = design_rooms(said.room_type, "test", said.seed, 2 * said.rooms).rooms
    changed = disturbed(designs, [np.random.default_rng([said.seed, k]) for k in range(len(designs))])
    those = [k for k, (_, names) in enumerate(changed) if names][: said.rooms]
    enough = len(those) == said.rooms
    within("--rooms", said.rooms, enough, f"fewer, as {len(those)} of {len(designs)} rooms could be disturbed")
    furnisher = load(said.room_type, torch.device("cpu"))
    done = Counter(name for k in those for name in changed[k][1])

    def furnished(rooms: Sequence[Room]) -> dict[str, Any]:
        some = [rooms[k] for k in those]
        layouts = best_layouts(furnisher, [brief_of(room) for room in some])
        return numbers(layouts, some) | {"at_the_wall": at_the_wall(layouts, some)}

    rooms = {"as designed": designs, "disturbed": [room for room, _ in changed]}
    found = ((name, furnished(some)) for name, some in rooms.items())
    print_and_write(said, found, disturbances=dict(done))


if __name__ == "__main__":
    main()
