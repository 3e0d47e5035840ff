"""Table 2 of Di & Yu 2021: many random starts, (a) in the one room that it was trained in, (b) in rooms never seen.

    python experiments/table2.py [budget=smoke] [column=geometric] [hydra.launcher.n_jobs=2]

(a) is what the authors' own code does; a seed is a room (three of them; with budget=smoke one). (b) are the agents of
Table 1, whose cells are only read.
"""

from __future__ import annotations

import sys

from cells import asked, cells_of, given, multirun, seeds_of
from printing import NOT_RUN, Table, provenance, row, text, write

from layoutrl.build import answers_errors

# The paper's own, as printed there.
PAPER = {
    "bathroom": "0.953 ± 0.012",
    "bedroom": "0.959 ± 0.017",
    "study": "0.946 ± 0.014",
    "tatami": "0.949 ± 0.009",
    "living_room": "0.956 ± 0.018",
    "dining_room": "0.962 ± 0.005",
    "kitchen": "0.957 ± 0.015",
    "balcony": "0.961 ± 0.007",
}
AGENTS = ("geometric", "paper")
SWEEP = {
    "protocol": "scene",
    "budget": "scene",
    "column": ",".join(AGENTS),
    "room": ",".join(PAPER),
}
HEADER = (
    "", "theirs (Di & Yu)", "(a) geometric", "(a) paper's network and moves", "(b) geometric",
    "(b) paper's network and moves", "ceiling of (a) geometric", "ceiling of (a) paper's moves",
)  # fmt: skip


@answers_errors
def main(arguments: list[str]) -> int:
    chosen = given(arguments)
    sweep = SWEEP | chosen | {"seed": seeds_of("0,1,2", chosen)}
    status = multirun("table2", sweep)
    folder, unseen = cells_of("table2", sweep), cells_of("table1", chosen)
    lines, every = [], []
    for room, paper in PAPER.items():
        own = [row(folder, f"{room}-own-{column}") for column in AGENTS]
        others = [row(unseen, f"{room}-own-{column}", "random starts") for column in AGENTS]
        ceilings = [r.ceiling() if r else NOT_RUN for r in own]
        lines.append([room.replace("_", " "), paper, *map(text, (*own, *others)), *ceilings])
        every += [*own, *others]
    starts = max([r.iou.shape[1] for r in every if r], default=0)
    title = (
        f"Table 2, {starts} random starts, (a) in each of the scenes trained in, (b) over rooms never seen "
        f"({provenance(every)}; mean IoU ± standard deviation over starts, of all seeds)"
    )
    write([Table(title, HEADER, lines)], folder.with_name("table2"))
    return status


if __name__ == "__main__":
    sys.exit(main(asked(__doc__)))
