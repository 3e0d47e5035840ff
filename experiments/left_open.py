"""How much of a layout does a brief leave open? One room type a call:

    python experiments/left_open.py study [--rooms 100] [--seed 0] [--results <folder>]

Who furnishes knows the room and the list of furniture, but not by which of the designer's templates the list came
about. Here every template that suits the room is asked for the same list, and what it makes of it is weighed by how
often it would (`designs_of`). One of these layouts is what the designer did; which, the brief does not tell. So no one
who furnishes from a brief can be sure to be nearer than the layout that is nearest to all others on average, as often
as they come: `the safest`.

Prints the numbers and writes experiments/results/left_open/<type>.json.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from cell_config import RESULTS
from packaged import options

from layoutrl.env.measures import matched, means
from layoutrl.evaluation.statistics import standard_error
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.clearances import passage
from layoutrl.rooms.designer.generator import ROOM_TYPES, Design, design_room, item_of
from layoutrl.rooms.designer.search import NoDesign, Step, design
from layoutrl.rooms.designer.shell import Dice
from layoutrl.rooms.room import Item, Room
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.files import write_json

KEPT = RESULTS / "left_open"
TRIES = 4000  # lists that are drawn of a template
DESIGNED = 40  # of those that may become the brief's, the likeliest, which are furnished
LUCK = 90  # percent of draws that fall on a size that is in the brief, where one can
ONE = 0.99  # IoU above which two layouts are one

T = TypeVar("T")


class Guessing(Dice):
    """Dice that mostly fall on sizes of a brief, in centimetres, and know how likely fair ones were to fall so."""

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
    """The layouts that designers make of one brief: K of them."""

    layouts: list[Room]
    template: np.ndarray  # (K,): by which template
    share: np.ndarray  # (K,): how often, in all 1
    iou: np.ndarray  # (K, K): of each with each


def left_open(designed: Design) -> LeftOpen | None:
    """What every template that suits the room makes of the same list; None where no draw came to it."""
    room, shell, kind = designed.room, designed.shell, ROOM_TYPES[designed.room.room_type]
    brief = brief_of(room).furniture
    suiting = {name: template for name, template in kind.templates.items() if template.suits(shell)}
    found: dict[tuple[str, tuple[Item, ...]], float] = defaultdict(float)
    for name, template in suiting.items():
        drawn: dict[tuple[object, ...], tuple[float, list[Step]]] = {}
        for k in range(TRIES):
            dice = Guessing({round(100 * side) for item in brief for side in item.size}, k)
            steps = list(template.steps(dice, shell))
            if may_become(steps, room):
                drawn[tuple(dice.drawn)] = dice.likelihood, steps
        for likelihood, steps in sorted(drawn.values(), key=lambda one: -one[0])[:DESIGNED]:
            try:
                choices = design(shell, steps, round(100 * passage(room.room_type)))
            except NoDesign:
                continue
            layout = replace(room, furniture=tuple(item_of(choice.place) for choice in choices))
            if brief_of(layout).furniture == brief:
                found[name, layout.furniture] += template.share * likelihood
    if not found:
        return None
    layouts, share = [replace(room, furniture=items) for _, items in found], np.array(list(found.values()))
    count = len(layouts)
    matches = matched([a for a in layouts for _ in layouts], layouts * count)
    iou = means(matches.iou, matches.room, count**2).reshape(count, count)
    return LeftOpen(layouts, np.array([name for name, _ in found]), share / share.sum(), iou)


def may_become(steps: Sequence[Step], room: Room) -> bool:
    """Whether these pieces are the room's furniture, but for optional ones that were left out."""
    asked = Counter((item.category, *(round(100 * side) for side in item.size)) for item in room.furniture)
    every, needed = (
        Counter((step.piece.category, step.piece.depth, step.piece.width) for step in some)
        for some in (steps, [step for step in steps if not step.optional])
    )
    return needed <= asked <= every


@answers_errors()
def main() -> None:
    said = options(__doc__, rooms=100, seed=0, results=KEPT)
    designs = [design_room(said.room_type, "test", said.seed, index) for index in range(said.rooms)]
    each = [(design, found) for design in designs if (found := left_open(design))]
    values: dict[str, list[float]] = defaultdict(list)
    for designed, found in each:
        share, iou = found.share, found.iou
        other = found.template[:, None] != found.template
        both = np.outer(share, share)
        values["layouts"].append(len(found.layouts))
        values["one layout"].append(float(iou[share.argmax()] @ share > ONE))
        values["several templates"].append(float(other.any()))
        values["IoU of two designs"].append(float((both * iou).sum()))
        if other.any():
            values["IoU of two templates"].append(float((both * iou)[other].sum() / both[other].sum()))
        values["the safest, expected"].append(float((iou @ share).max()))
        tried = [found.layouts[k] for k in ((iou @ share).argmax(), share.argmax())]
        matches = matched([*tried, *found.layouts], [designed.room] * (2 + len(found.layouts)))
        safest, likeliest, *all_of_them = means(matches.iou, matches.room, 2 + len(found.layouts))
        facing, *_ = means(matches.facing, matches.room, 2 + len(found.layouts))
        values["the safest"].append(safest)
        values["the safest, facing"].append(facing)
        values["the likeliest"].append(likeliest)
        values["the designer's own is found"].append(float(max(all_of_them) > ONE))
    result: dict[str, object] = {"rooms": len(designs), "seed": said.seed, "furnished": len(each)}
    for name, numbers in values.items():
        known = np.array(numbers)
        result[name] = {
            "mean": float(known.mean()),
            "standard_error": standard_error(known, np.arange(len(known))),
            "rooms": len(known),
        }
        print(f"{said.room_type}, {name}: {json.dumps(result[name])}", flush=True)
    write_json(said.results / f"{said.room_type}.json", result)


if __name__ == "__main__":
    main()
