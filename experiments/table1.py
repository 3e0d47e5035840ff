"""Table 1 of Di & Yu 2021, and what it leaves out: eight room types, rooms never seen, one random start each.

    python experiments/table1.py [budget=smoke] [column=paper room=bedroom,tatami] [hydra.launcher.n_jobs=2]

Fills the cells that are not filled, side by side, and prints the tables that all filled ones make. Without a GPU the
paper's network is trained in two types, and with one seed, unless it is asked for; the supervised networks have one
seed, and so has PlanIT in six types. With budget=smoke everything has one seed.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from cells import PLANIT, asked, cells_of, given, in_turn, multirun, seeds_of, some_of, trains_pictures
from printing import NOT_RUN, Row, Table, provenance, row, text, write

from layoutrl.runs.commands import answers_errors

# Of the paper: PlanIT's and its own IoU, as printed there.
PAPER = {
    "bathroom": ("0.623 ± 0.008", "0.961 ± 0.014"),
    "bedroom": ("0.647 ± 0.009", "0.952 ± 0.026"),
    "study": ("0.619 ± 0.006", "0.957 ± 0.018"),
    "tatami": ("0.637 ± 0.006", "0.948 ± 0.049"),
    "living_room": ("0.603 ± 0.006", "0.953 ± 0.037"),
    "dining_room": ("0.611 ± 0.006", "0.949 ± 0.029"),
    "kitchen": ("0.636 ± 0.006", "0.953 ± 0.041"),
    "balcony": ("0.651 ± 0.006", "0.951 ± 0.035"),
}
# What is beside it: the file's column, its row, the words in the table.
COLUMNS = (
    ("geometric", "agent", "geometric"),
    ("paper", "agent", "paper's network and moves"),
    ("planit", PLANIT, "PlanIT, as long as geometric"),
    ("planit", "given graph, argmax, true size", "PlanIT, told the relations"),
    ("regressor", "agent", "supervised regressor"),
    ("pointer", "agent", "supervised pointer"),
    ("oracle", "oracle", "perfect Q"),
    ("rules", "nearest room", "nearest room"),
    ("rules", "nearest wall", "nearest wall"),
    ("rules", "random start", "random start"),
)
HEADER = (
    "", "PlanIT (Di & Yu)", "theirs (Di & Yu)", *(words for _, _, words in COLUMNS), "lattice ceiling",
    "ceiling of the paper's moves",
)  # fmt: skip
SUPERVISED = ("regressor", "pointer")
AGENTS = ("geometric", "paper", *SUPERVISED)
DETAILS = (
    "", "", "seeds", "mean IoU", "s.e. over seeds", "95% interval over rooms", "median", ">= 0.9", "best of 3",
    "illegal moves masked", "overlap", "outside", "blocked", "moves", "minutes of training", "p, against the regressor",
    "p, against the pointer",
)  # fmt: skip
PLANIT_ROWS = (
    "sampled graph, sampled, own size", "sampled graph, argmax, own size", "given categories, sampled, own size",
    "given categories, argmax, own size", "given categories, sampled, true size", "given categories, argmax, true size",
    "given graph, sampled, own size", "given graph, argmax, own size", "given graph, sampled, true size",
    "given graph, argmax, true size",
)  # fmt: skip
SEEDLESS = {"rules", "oracle"}  # draw nothing but the starts, which are always the same
WITHOUT_GPU = ("bedroom", "tatami")  # where the paper's network is trained on a processor
SWEEPS = (
    ("oracle,rules", "0", tuple(PAPER)),  # before agents: they design the rooms
    ("geometric", "0,1,2", tuple(PAPER)),
    ("regressor,pointer,planit", "0", tuple(PAPER)),  # after: they train for as long
    ("planit", "1,2", ("bathroom", "bedroom")),
    ("planit_long", "0", ("kitchen", "balcony")),  # whether the agent's minutes are too few for it
)  # columns, seeds, types


def stages(chosen: dict[str, str]) -> list[dict[str, str]]:
    """Sweeps, one after the other. Raises InputError for rooms that it does not have."""
    rooms = some_of("room", chosen, PAPER)
    sweeps = [*SWEEPS, ("paper", "0,1,2", tuple(PAPER)) if trains_pictures(chosen) else ("paper", "0", WITHOUT_GPU)]
    if "column" in chosen:
        groups = in_turn(chosen["column"])
        sweeps = [(group, "0" if {*group.split(",")} <= SEEDLESS else "0,1,2", tuple(PAPER)) for group in groups]
    return [
        chosen | {"column": columns, "seed": seeds_of(seeds, chosen), "room": ",".join(among)}
        for columns, seeds, types in sweeps
        if (among := [room for room in rooms if room in types])
    ]


@answers_errors()
def main(arguments: list[str]) -> int:
    chosen = given(arguments)
    status = max([multirun("table1", sweep) for sweep in stages(chosen)])
    folder = cells_of("table1", chosen)

    def found(room: str, column: str, which: str = "agent") -> Row | None:
        return row(folder, f"{room}-own-{column}", which)

    lines, details, every = [], [], []
    for room, (planit, theirs) in PAPER.items():
        rows = [found(room, column, which) for column, which, _ in COLUMNS]
        agents = {column: found(room, column) for column in AGENTS}
        ceilings = [r.ceiling() if r else NOT_RUN for r in (agents["geometric"] or rows[-1], agents["paper"])]
        lines.append([room.replace("_", " "), planit, theirs, *map(text, rows), *ceilings])
        every += rows
        for column, agent in agents.items():
            if agent:
                rivals = [None if column in SUPERVISED else agents[rival] for rival in SUPERVISED]
                others = [found(room, column, which) for which in ("best of 3", "illegal moves masked")]
                details.append([room.replace("_", " "), column, *detail(agent, others, rivals)])
    about = f"{provenance(every)}; mean IoU ± standard deviation over rooms, of all seeds"
    tables = [
        Table(f"Table 1, rooms never seen ({about})", HEADER, lines),
        Table("Table 1, how sure and how good", DETAILS, details),
        *planit_tables(folder),
    ]
    write(tables, folder.with_name("table1"))
    return status


def planit_tables(folder: Path) -> list[Table]:
    """What PlanIT is worth by how much it is told and how it chooses: one item among the others, and whole rooms."""
    one, every = [], []
    for room in PAPER:
        for column in ("planit", "planit_long"):
            rows = {words: row(folder, f"{room}-own-{column}", words) for words in PLANIT_ROWS}
            known = [found for found in rows.values() if found]
            if not known:
                continue
            seconds, updates = known[0].about("training_seconds"), known[0].about("updates")
            about = [str(len(known[0].cells)), f"{(seconds or 0) / 60:.1f}", f"{updates or 0:.0f}"]
            name = [room.replace("_", " ") + (", fixed updates" if column == "planit_long" else ""), *about]
            one.append([*name, *map(text, rows.values())])
            furnished = [cell["all items"] for cell in known[0].cells.values()]
            every.append([*name, *(of_all([cell[words] for cell in furnished]) for words in rows)])
    header = ["", "seeds", "minutes of training", "updates", *PLANIT_ROWS]
    return [
        Table("PlanIT, the moving item among all others (mean IoU ± standard deviation over rooms)", header, one),
        Table("PlanIT, all items of a room placed from nothing (mean IoU, standard error over rooms)", header, every),
    ]


def of_all(cells: list[dict[str, Any]]) -> str:
    """Mean over seeds; the error is that of one."""
    mean = np.mean([cell["mean_iou"] for cell in cells])
    errors = [cell["standard_error"] for cell in cells]
    return f"{mean:.3f}" if None in errors else f"{mean:.3f} ({np.mean(errors):.3f})"


def detail(agent: Row, others: Sequence[Row | None], rivals: Sequence[Row | None]) -> list[str]:
    """What the mean does not say."""
    moves, seconds = agent.about("moves"), agent.about("training_seconds")
    return [
        str(len(agent.cells)),
        f"{agent.mean:.4f}",
        agent.error_over_seeds(),
        agent.interval(),
        f"{agent.number('median_iou'):.3f}",
        f"{agent.number('share_090'):.1%}",
        *(text(other, "-") for other in others),
        f"{agent.number('overlap'):.4f}",
        f"{agent.number('outside'):.4f}",
        f"{agent.number('blocked'):.1%}",
        "-" if moves is None else f"{moves:.1f}",
        "-" if seconds is None else f"{seconds / 60:.1f}",
        *(agent.p_value(rival) if rival else "-" for rival in rivals),
    ]


if __name__ == "__main__":
    sys.exit(main(asked(__doc__)))
