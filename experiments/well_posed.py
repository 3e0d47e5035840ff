"""Are designed rooms well-posed? One type a call:

    python experiments/well_posed.py bedroom [--train 5000] [--test 1000] [--seed 0] [--results <folder>]

Ambiguity: how good another place would have been to the designer. A room with a near tie is not used; what counts is
how many tries were rejected for one, and how small the other margins are. That the place can be inferred from what is
seen, the supervised columns of Table 1 show, and that it is not trivial, the columns that need no learning.

Prints the numbers and writes experiments/results/well_posed/<type>.json; with --results=trial, trial/<type>.json.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from kept import RESULTS, check_kept, parser_of

from layoutrl.rooms.designer.generator import design_room, design_rooms
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.files import write_json
from layoutrl.runs.ranges import within

KEPT = RESULTS / "well_posed"
CLOSE = 20  # centimetres by which the designer's choice beats the second best: few would decide by less


def ambiguity(room_type: str, seed: int, count: int) -> dict[str, float]:
    """Return how good the designer's second-best place for the main item was, in `count` test rooms.

    The numbers are shares of rooms, but `iou_with_second_place` is a mean, and `tries_rejected_as_ties` a share of all
    tries, for any item. Margins are in centimetres, 100 if a yes-or-no rule decided.
    """
    designs = [design_room(room_type, "test", seed, index) for index in range(count)]
    choices = [next(c for c in d.choices if c.place.piece.category == MAIN_ITEM[room_type]) for d in designs]
    rivals = [choice for choice in choices if choice.runner_up is not None]
    ious = [choice.place.iou(choice.runner_up) for choice in rivals if choice.runner_up is not None]
    margins = np.array([choice.margin for choice in rivals if choice.margin is not None])
    ties = sum("as good" in reason for d in designs for _, reason in d.rejected)
    return {
        "rooms_with_a_second_place": len(rivals) / count,
        "iou_with_second_place": float(np.mean(ious)) if ious else 0.0,
        f"margin_below_{CLOSE}": float((margins < CLOSE).sum() / count),
        "tries_rejected_as_ties": ties / (count + sum(len(d.rejected) for d in designs)),
    }


@answers_errors()
def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("room_type", choices=list(MAIN_ITEM))
    parser.add_argument("--train", type=int, default=5000, help="training rooms")
    parser.add_argument("--test", type=int, default=1000, help="held-out rooms")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--results", type=Path, default=KEPT, help="folder of the file that is written")
    options = parser.parse_args()
    for name, count in (("--train", options.train), ("--test", options.test)):
        within(name, count, count >= 1, "1 or more")
    within("--seed", options.seed, options.seed >= 0, "0 or more")
    file = options.results / f"{options.room_type}.json"
    about = {"room_type": options.room_type, "seed": options.seed, "train": options.train, "test": options.test}
    check_kept(file, about)

    began = time.perf_counter()
    training = design_rooms(options.room_type, "train", options.seed, options.train)
    result: dict[str, Any] = about | {"design_seconds": time.perf_counter() - began}
    print(f"{training}\ndesigned in {result['design_seconds']:.1f} s")
    result["reject_rate"] = {name: training.reject_rate(name) for name in training.made}
    result["ambiguity"] = ambiguity(options.room_type, options.seed, options.test)
    print(json.dumps(result["ambiguity"], indent=1))
    options.results.mkdir(parents=True, exist_ok=True)
    write_json(file, result)


if __name__ == "__main__":
    main()
