"""How much depends on the place of the first item? One room type a call:

    python experiments/first_item.py living_room [--rooms 60] [--seed 0] [--results <folder>]

The agent in the package furnishes held-out briefs from nothing, the largest item first, and again with that item given
where the designer has it. The IoU of the other items is told apart by three cases: the agent put the first right (an
IoU of RIGHT or more), it put it wrong, and the first was given.

Prints the numbers and writes experiments/results/first_item/<type>.json.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from kept import RESULTS, means_over_rooms, options, print_and_write

from layoutrl.env.measures import iou_of, matched, means
from layoutrl.rooms.brief import brief_of, largest_first
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.furnished import best_layouts
from layoutrl.rooms.room import Item, Room
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.pretrained import load

KEPT = RESULTS / "first_item"
RIGHT = 0.8  # IoU


def same_kind_indices(item: Item, room: Room) -> list[int]:
    """Return the indices of the room's items of the same category, size and form as `item`."""
    return [k for k, other in enumerate(room.furniture) if other.kind == item.kind]


def without(room: Room, k: int) -> Room:
    """The room without one of its items."""
    return replace(room, furniture=(*room.furniture[:k], *room.furniture[k + 1 :]), target=None)


def compared(layout: Room, k: int, design: Room) -> tuple[float, float]:
    """Return the IoU of item k of a layout with the designer's, and the mean IoU of all other items.

    Among equal items of the design the one with the highest IoU counts. The IoU is 0 if item k has no place.
    """
    item = layout.furniture[k]
    same = same_kind_indices(item, design)
    if item.center is None:
        return 0.0, iou_of_others(layout, k, design, same[0])
    iou = iou_of(np.array([item.footprint] * len(same)), np.array([design.furniture[j].footprint for j in same]))
    return float(iou.max()), iou_of_others(layout, k, design, same[int(iou.argmax())])


def iou_of_others(layout: Room, k: int, design: Room, j: int) -> float:
    """Return the mean IoU of all items but k of the layout and j of the design; NaN if the design has no others."""
    found = matched([without(layout, k)], [without(design, j)])
    return float(means(found.iou, found.room, 1).item())


@answers_errors()
def main() -> None:
    said = options(__doc__, rooms=60, seed=0, results=KEPT)
    designs = design_rooms(said.room_type, "test", said.seed, said.rooms).rooms
    briefs = [brief_of(design) for design in designs]
    first = [largest_first(brief)[0] for brief in briefs]
    given = []
    for brief, k, design in zip(briefs, first, designs, strict=True):
        item = design.furniture[same_kind_indices(brief.furniture[k], design)[0]]
        given.append(replace(brief, furniture=(*brief.furniture[:k], item, *brief.furniture[k + 1 :])))
    furnisher = load(said.room_type, torch.device("cpu"))
    alone, helped = (best_layouts(furnisher, asked) for asked in (briefs, given))
    largest, rest = np.array([compared(*those) for those in zip(alone, first, designs, strict=True)]).T
    right = largest >= RIGHT
    numbers = {
        "the first item": largest,
        "it is right": right.astype(float),
        "the others, where it is right": rest[right],
        "the others, where it is wrong": rest[~right],
        "the others, where it is given": [compared(*those)[1] for those in zip(helped, first, designs, strict=True)],
    }
    print_and_write(said, means_over_rooms(numbers))


if __name__ == "__main__":
    main()
