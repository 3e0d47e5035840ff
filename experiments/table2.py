"""Table 2 of Di & Yu 2021: many random starts, (a) in the one room that it was trained in, (b) in held-out rooms.

    python experiments/table2.py [room=kitchen,study] [column=geometric] [budget=smoke] [hydra.launcher.n_jobs=2]

(a) is what the authors' own code does. It has a budget of its own, and a seed is a room: there are three (one for the
paper's network without a GPU, unless it is asked for, and with budget=smoke). (b) only reads the cells of Table 1's
agents. The printed tables have the rooms that were asked for; the files have all.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

from printing import Table, ceiling, compared, estimates, row, show, write
from sweeps import ENDS, cells_of, command_line, has_gpu_or_cluster, multirun, parsed_options, seeds_of, some_of
from table1 import AGENT, EVERY_MOVE, MASKED, METHODS, PAPER_NETWORK, THEIRS, printed

from layoutrl.runs.commands import answers_errors

UNSEEN = (AGENT, PAPER_NETWORK, EVERY_MOVE)
# IoU of the paper's own method, as the paper prints it.
PAPER = {
    "bathroom": printed(0.953, 0.012),
    "bedroom": printed(0.959, 0.017),
    "study": printed(0.946, 0.014),
    "tatami": printed(0.949, 0.009),
    "living_room": printed(0.956, 0.018),
    "dining_room": printed(0.962, 0.005),
    "kitchen": printed(0.957, 0.015),
    "balcony": printed(0.961, 0.007),
}


def stages(chosen: dict[str, str]) -> list[dict[str, str]]:
    """Return the sweeps, in order. Raises InputError for rooms, columns and budgets that the table does not have."""
    some_of("budget", chosen, ("smoke", "default", "full"))
    scene = {"protocol": "scene", "budget": "smoke" if chosen.get("budget") == "smoke" else "scene"}
    seeds = {"geometric": "0,1,2", "paper": "0,1,2" if has_gpu_or_cluster(chosen) else "0"}
    some_of("column", chosen, seeds)
    if "column" in chosen:
        seeds = {chosen["column"]: "0,1,2"}
    room = ",".join(some_of("room", chosen, PAPER))
    return [
        ENDS | chosen | scene | {"column": columns, "seed": seeds_of(columns, usual, chosen), "room": room}
        for columns, usual in seeds.items()
    ]


@answers_errors()
def main(arguments: list[str]) -> int:
    chosen = parsed_options(arguments)
    sweeps = stages(chosen)
    status = max([multirun("table2", sweep) for sweep in sweeps])
    folders = cells_of("table2", sweeps[0]), cells_of("table1", chosen)
    show(tables(*folders, some_of("room", chosen, PAPER)))
    write(tables(*folders), folders[1].with_name("table2"))
    return status


def tables(scenes: Path, unseen: Path, rooms: Iterable[str] = PAPER) -> list[Table]:
    """Return tables (a) and (b), made from filled cells of these rooms in the folders `scenes` and `unseen`."""
    own, others = [], []
    for room in rooms:
        agent, paper_network, masked = (
            row(scenes, f"{room}-own-{column}", which)
            for column, which in (METHODS[words] for words in (AGENT, PAPER_NETWORK, MASKED))
        )
        measured = estimates([agent, paper_network, masked])
        own.append(([room], [PAPER[room], *measured, ceiling(agent), ceiling(paper_network)]))
        held_out = [row(unseen, f"{room}-own-{METHODS[words][0]}", "random starts") for words in UNSEEN]
        others.append(([room], [PAPER[room], *estimates(held_out)]))
    title = "Table 2 ({}): {}, many random starts (mean IoU ± standard deviation over starts)"
    return [
        compared(
            "table2-scenes", title.format("a", "trained and tested in the same room"), ["room"],
            [THEIRS, AGENT, PAPER_NETWORK, MASKED, "ceiling of the agent's moves", "ceiling of the paper's moves"], own,
        ),
        compared("table2-unseen", title.format("b", "in held-out rooms"), ["room"], [THEIRS, *UNSEEN], others),
    ]  # fmt: skip


if __name__ == "__main__":
    sys.exit(main(command_line(__doc__)))
