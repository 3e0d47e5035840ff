"""Table 2 of Di & Yu 2021: 2,000 random starts, (a) in the one room that it was trained in, (b) in rooms never seen.

    python experiments/table2.py [budget=smoke] [column=geometric] [hydra.launcher.n_jobs=2]

(a) is what the authors' own code does; a seed is a room. (b) are the agents of Table 1, whose cells are only read.
"""

from __future__ import annotations

import sys

from cells import cells_of, multirun
from printing import NOT_RUN, Table, minutes, row, write

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
    "seed": "0,1,2",
    "room": ",".join(PAPER),
}
HEADER = (
    "", "ours (paper)",
    *(f"{part} {words}" for part in ("(a)", "(b)") for words in ("geometric", "paper's network and moves")),
    *(f"ceiling of (a) {column}" for column in AGENTS),
)  # fmt: skip


def main(arguments: list[str]) -> int:
    status = multirun("table2", SWEEP, arguments)
    folder, unseen = cells_of("table2", arguments, "scene"), cells_of("table1", arguments)
    lines, every = [], []
    for room, paper in PAPER.items():
        own = [row(folder, f"{room}-own-{column}") for column in AGENTS]
        others = [row(unseen, f"{room}-own-{column}", "random starts") for column in AGENTS]
        ceilings = [f"{sum(c['ceiling'] for c in r.cells) / len(r.cells):.3f}" if r else NOT_RUN for r in own]
        found = [r.text() if r else NOT_RUN for r in (*own, *others)]
        lines.append([room.replace("_", " "), paper, *found, *ceilings])
        every += own
    title = f"Table 2, 2,000 random starts ({minutes(every)}; mean IoU ± standard deviation over starts, of all seeds)"
    write([Table(title, HEADER, lines)], folder.with_name("table2"))
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
