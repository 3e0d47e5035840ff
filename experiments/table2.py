"""Table 2 of Di & Yu 2021: many random starts, (a) in the one room that it was trained in, (b) in rooms never seen.

    python experiments/table2.py [budget=smoke] [column=geometric] [hydra.launcher.n_jobs=2]

(a) is what the authors' own code does, with a budget of its own; a seed is a room. There are three (one for the paper's
network without a GPU, unless it is asked for, and with budget=smoke). (b) are the agents of Table 1, whose cells are
only read.
"""

from __future__ import annotations

import sys

from cells import asked, cells_of, given, multirun, seeds_of, some_of, trains_pictures
from printing import NOT_RUN, Table, provenance, row, text, write

from layoutrl.runs.commands import answers_errors

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
HEADER = (
    "", "theirs (Di & Yu)", "(a) geometric", "(a) paper's network and moves", "the same, illegal moves masked",
    "(b) geometric", "(b) paper's network and moves", "ceiling of (a) geometric", "ceiling of (a) paper's moves",
)  # fmt: skip


def stages(chosen: dict[str, str]) -> list[dict[str, str]]:
    """Sweeps, one after the other. Raises InputError for rooms and budgets that it does not have."""
    some_of("budget", chosen, ("smoke", "default", "full"))
    scene = {"protocol": "scene", "budget": "smoke" if chosen.get("budget") == "smoke" else "scene"}
    seeds = {"geometric": "0,1,2", "paper": "0,1,2" if trains_pictures(chosen) else "0"}
    if "column" in chosen:
        seeds = {chosen["column"]: "0,1,2"}
    room = ",".join(some_of("room", chosen, PAPER))
    return [
        chosen | scene | {"column": columns, "seed": seeds_of(usual, chosen), "room": room}
        for columns, usual in seeds.items()
    ]


@answers_errors()
def main(arguments: list[str]) -> int:
    chosen = given(arguments)
    sweeps = stages(chosen)
    status = max([multirun("table2", sweep) for sweep in sweeps])
    folder, unseen = cells_of("table2", sweeps[0]), cells_of("table1", chosen)
    lines, every = [], []
    for room, paper in PAPER.items():
        own = [row(folder, f"{room}-own-{column}") for column in AGENTS]
        masked = row(folder, f"{room}-own-paper", "illegal moves masked")
        others = [row(unseen, f"{room}-own-{column}", "random starts") for column in AGENTS]
        ceilings = [r.ceiling() if r else NOT_RUN for r in own]
        lines.append([room.replace("_", " "), paper, *map(text, (*own, masked, *others)), *ceilings])
        every += [*own, *others]
    starts = max([r.iou.shape[1] for r in every if r], default=0)
    title = (
        f"Table 2, {starts} random starts, (a) in each of the scenes trained in, (b) over rooms never seen "
        f"({provenance(every)}; mean IoU ± standard deviation over starts, of all seeds)"
    )
    write([Table(title, HEADER, lines)], unseen.with_name("table2"))
    return status


if __name__ == "__main__":
    sys.exit(main(asked(__doc__)))
