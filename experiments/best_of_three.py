"""How near does the nearest of three layouts come to the designer's? One room type a call:

    python experiments/best_of_three.py bedroom [--rooms 200] [--seed 0] [--results <folder>]

For each held-out brief, the agent in the package makes up to three different layouts. It cannot know which of them a
person would take; here the one with the highest IoU is chosen, by knowledge of the answer.

Prints the numbers and writes experiments/results/best_of_three/<type>.json.
"""

from __future__ import annotations

import torch
from kept import RESULTS, numbers, options, print_and_write

from layoutrl.env.measures import measured
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.furnished import best_layouts
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.pretrained import load

KEPT = RESULTS / "best_of_three"


@answers_errors()
def main() -> None:
    said = options(__doc__, rooms=200, seed=0, results=KEPT)
    designs = design_rooms(said.room_type, "test", said.seed, said.rooms).rooms
    briefs = [brief_of(design) for design in designs]
    furnisher = load(said.room_type, torch.device("cpu"))
    alone = best_layouts(furnisher, briefs)
    choices = [[one.layout for one in those] for those in furnisher.furnish(briefs, 3, 0)]
    each = [measured(those, [design] * len(those)).iou for those, design in zip(choices, designs, strict=True)]
    rows = {
        "the only one": alone,
        "the nearest of three": [those[iou.argmax()] for those, iou in zip(choices, each, strict=True)],
    }
    found = ((name, numbers(layouts, designs)) for name, layouts in rows.items())
    print_and_write(said, found, layouts=sum(map(len, choices)) / len(choices))


if __name__ == "__main__":
    main()
