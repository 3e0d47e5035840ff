"""How much of a layout does a brief leave open? One room type a call:

    python experiments/left_open.py study [--rooms 40] [--seed 0] [--results <folder>]

A brief tells the room and the list of furniture, but not by which of the designer's templates the list came about.
Every template that suits the room is asked for the same list. What it makes of it counts as often as it would be drawn
(`left_open`). One of these layouts is the designer's; the brief does not tell which. `the safest` is the layout that is
nearest to all of them, on average. `mirrored` is the IoU of the design with what the same template makes of the
mirrored room, mirrored back: where it is low, training in mirrored rooms teaches what is wrong.

Prints the numbers and writes experiments/results/left_open/<type>.json.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from kept import RESULTS, means_over_rooms, options, print_and_write

from layoutrl.env.measures import matched, means
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.clearances import passage
from layoutrl.rooms.designer.generator import ROOM_TYPES, Design, design_room, item_of
from layoutrl.rooms.designer.search import NoDesign, Step, design
from layoutrl.rooms.designer.shell import Box, Dice, Gap, Shell
from layoutrl.rooms.room import Item, Room
from layoutrl.runs.commands import answers_errors

KEPT = RESULTS / "left_open"
TRIES = 4000  # lists that are drawn from each template
DESIGNED = 40  # lists that may become the brief's: only the likeliest are furnished
LUCK = 90  # percent of draws that are confined to sizes in the brief, if any is possible
ONE = 0.99  # IoU above which two layouts count as the same
CUT_TO_FIT = "counter"  # its width is what is free between two others, whatever was drawn

T = TypeVar("T")


class Guessing(Dice):
    """Dice that mostly fall on sizes of a brief, in centimetres, and track how likely fair dice fall the same."""

    def __init__(self, sizes: set[int], *seed: int):
        super().__init__(*seed)
        self._sizes = sizes
        self.drawn: list[object] = []
        self.likelihood = 1.0

    def between(self, low: int, high: int, step: int = 1) -> int:
        return self.pick(dict.fromkeys(range(low, high + 1, step), 1))

    def pick(self, weights: Mapping[T, int]) -> T:
        known: Mapping[T, int] = {choice: weight for choice, weight in weights.items() if choice in self._sizes}
        if not known or not super().chance(LUCK):
            known = weights
        choice = super().pick(known)
        self.drawn.append(choice)
        self.likelihood *= weights[choice] / sum(weights.values())
        return choice

    def chance(self, percent: int) -> bool:
        return self.pick({True: percent, False: 100 - percent})


@dataclass
class LeftOpen:
    """The K layouts that the designer's templates make of one brief."""

    layouts: list[tuple[Item, ...]]
    template: np.ndarray  # (K,): names of the templates that made them
    share: np.ndarray  # (K,): how likely each is; the sum is 1
    iou: np.ndarray  # (K, K): mean IoU of each with each

    @property
    def safest(self) -> int:
        """The index of the layout with the highest mean IoU with all, weighted by `share`."""
        return int((self.iou @ self.share).argmax())


def left_open(room: Room, shell: Shell) -> LeftOpen | None:
    """Return what every template that suits the shell makes of the room's furniture; None if no draw led to one."""
    brief, kind = brief_of(room), ROOM_TYPES[room.room_type]
    suiting = {name: template for name, template in kind.templates.items() if template.suits(shell)}
    found: dict[tuple[str, tuple[Item, ...]], float] = defaultdict(float)
    for name, template in suiting.items():
        drawn: dict[tuple[object, ...], tuple[float, list[Step]]] = {}
        for k in range(TRIES):
            dice = Guessing({round(100 * side) for item in room.furniture for side in item.size}, k)
            steps = list(template.steps(dice, shell))
            if may_become(steps, room):
                drawn[tuple(dice.drawn)] = dice.likelihood, steps
        for likelihood, steps in sorted(drawn.values(), key=lambda one: -one[0])[:DESIGNED]:
            try:
                choices = design(shell, steps, round(100 * passage(room.room_type)))
            except NoDesign:
                continue
            layout = tuple(item_of(choice.place) for choice in choices)
            if brief_of(replace(room, furniture=layout)) == brief:
                found[name, layout] += template.share * likelihood
    if not found:
        return None
    layouts, share = [layout for _, layout in found], np.array(list(found.values()))
    iou = np.array([matches_of(layouts, replace(room, furniture=layout))[0] for layout in layouts]).T
    return LeftOpen(layouts, np.array([name for name, _ in found]), share / share.sum(), iou)


def matches_of(layouts: Sequence[tuple[Item, ...]], room: Room) -> tuple[np.ndarray, np.ndarray]:
    """Return IoU and facing of K layouts compared with the room's own: (K,) each."""
    count = len(layouts)
    found = matched([replace(room, furniture=layout) for layout in layouts], [room] * count)
    return means(found.iou, found.room, count), means(found.facing, found.room, count)


def may_become(steps: Sequence[Step], room: Room) -> bool:
    """Whether the pieces of these steps are the room's furniture, perhaps with optional ones left out."""
    asked = Counter(_drawn_as(item.category, *(round(100 * side) for side in item.size)) for item in room.furniture)
    every, needed = (
        Counter(_drawn_as(step.piece.category, step.piece.depth, step.piece.width) for step in some)
        for some in (steps, [step for step in steps if not step.optional])
    )
    return needed <= asked <= every


def _drawn_as(category: str, depth: int, width: int) -> tuple[str, int, int]:
    return category, depth, 0 if category == CUT_TO_FIT else width


def mirrored(shell: Shell) -> Shell:
    """Return the shell mirrored left to right."""
    notches = tuple(_mirrored(notch, shell.width) for notch in shell.notches)
    bare = replace(shell, notches=notches, doors=(), windows=())

    def gap(those: Gap) -> Gap:
        """Return the mirrored opening, in the wall of the mirrored shell in which it lies."""
        strip = _mirrored(those.strip(1), shell.width)
        found = next(
            w
            for w in bare.walls
            if w.box(*strip.span(w.normal), 1) == strip and w.lo <= strip.span(w.normal)[0] <= w.hi
        )
        return Gap(found, *strip.span(found.normal), those.sliding)

    return replace(bare, doors=tuple(map(gap, shell.doors)), windows=tuple(map(gap, shell.windows)))


def _mirrored(box: Box, width: int) -> Box:
    return Box(width - box.x1, box.y0, width - box.x0, box.y1)


def image_of(items: Sequence[Item], width: float) -> tuple[Item, ...]:
    """Return the placed items of a shell `width` metres wide as they stand in the mirrored shell."""
    return tuple(
        replace(item, center=(width - item.center[0], item.center[1]), rotation=(180 - item.degrees) % 360)
        for item in items
        if item.center is not None
    )


def numbers_of(designed: Design, found: LeftOpen) -> dict[str, float]:
    """Return the numbers of one brief, by name."""
    both, other = np.outer(found.share, found.share), found.template[:, None] != found.template
    iou, facing = matches_of(found.layouts, designed.room)
    result = {
        "layouts": len(found.layouts),
        "several templates make it": other.any(),
        "the safest, IoU": iou[found.safest],
        "the safest, facing": facing[found.safest],
        "the designer's own is found": iou.max() > ONE,
    }
    if other.any():
        result["IoU of two templates"] = (both * found.iou)[other].sum() / both[other].sum()
    again = left_open(designed.room, mirrored(designed.shell))
    if again and (its_own := np.flatnonzero(again.template == designed.template)).size:
        likeliest = again.layouts[its_own[again.share[its_own].argmax()]]
        back = image_of(likeliest, designed.shell.width / 100)
        result["mirrored"] = matches_of([back], designed.room)[0].item()
    return {name: float(value) for name, value in result.items()}


@answers_errors()
def main() -> None:
    said = options(__doc__, rooms=40, seed=0, results=KEPT)
    designs = [design_room(said.room_type, "test", said.seed, index) for index in range(said.rooms)]
    values: dict[str, list[float]] = defaultdict(list)
    for designed in designs:
        if found := left_open(designed.room, designed.shell):
            for name, value in numbers_of(designed, found).items():
                values[name].append(value)
    print_and_write(said, means_over_rooms(values))


if __name__ == "__main__":
    main()
