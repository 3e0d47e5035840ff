"""Table 1 of Di & Yu 2021, and what it leaves out: eight room types, held-out rooms, one random start each.

    python experiments/table1.py [room=kitchen,study] [column=paper] [budget=smoke] [hydra.launcher.n_jobs=2]

Fills the missing cells in parallel, and prints the tables of all filled cells, for the rooms that were asked for; the
files have all rooms. Without a GPU the paper's network has one seed (three in bedrooms where it learns every move), and
with method=paper it is trained in two types only, unless it is asked for. The supervised networks have one seed, and so
has PlanIT in six types. The agent has three seeds, of which only the first is kept: column=geometric seed=0 asks for no
more. With budget=smoke everything has one seed.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from cell_config import PLANIT
from printing import Estimate, Row, Table, ceiling, compared, estimates, listed, row, show, write
from sweeps import (
    cells_of,
    command_line,
    has_gpu_or_cluster,
    in_turn,
    multirun,
    parsed_options,
    seeds_of,
    some_of,
    sweeps_of,
)

from layoutrl.rivals.planit.scoring import how_many
from layoutrl.runs.commands import answers_errors


def printed(mean: float, sd: float) -> Estimate:
    """Return a figure of the paper, which does not say what its ± means."""
    return Estimate({"mean_iou": mean, "sd": sd})


# IoU of PlanIT and of the paper's own method, as the paper prints them.
PAPER = {
    "bathroom": (printed(0.623, 0.008), printed(0.961, 0.014)),
    "bedroom": (printed(0.647, 0.009), printed(0.952, 0.026)),
    "study": (printed(0.619, 0.006), printed(0.957, 0.018)),
    "tatami": (printed(0.637, 0.006), printed(0.948, 0.049)),
    "living_room": (printed(0.603, 0.006), printed(0.953, 0.037)),
    "dining_room": (printed(0.611, 0.006), printed(0.949, 0.029)),
    "kitchen": (printed(0.636, 0.006), printed(0.953, 0.041)),
    "balcony": (printed(0.651, 0.006), printed(0.951, 0.035)),
}
# The methods by their names in the tables: the column and the row of their cells.
AGENT, PAPER_NETWORK, REGRESSOR, POINTER = "agent", "paper's network", "supervised regressor", "supervised pointer"
MASKED, EVERY_MOVE = "paper's network, illegal moves masked", "paper's network, learns every move"
RIVAL, INFORMED = "PlanIT", "PlanIT, told the relations"
METHODS = {
    AGENT: ("geometric", "agent"),
    PAPER_NETWORK: ("paper", "agent"),
    MASKED: ("paper", "illegal moves masked"),
    EVERY_MOVE: ("paper_every_move", "agent"),
    REGRESSOR: ("regressor", "agent"),
    POINTER: ("pointer", "agent"),
    RIVAL: ("planit", PLANIT),
    INFORMED: ("planit", "given graph, argmax, true size"),
    "perfect Q": ("oracle", "oracle"),
    "nearest room": ("rules", "nearest room"),
    "nearest wall": ("rules", "nearest wall"),
    "random start": ("rules", "random start"),
}
THEIRS, CEILING = "Di & Yu, as printed", "ceiling of the moves"
MAIN = (AGENT, POINTER, RIVAL)
LEARNED = (AGENT, PAPER_NETWORK, EVERY_MOVE, REGRESSOR, POINTER, RIVAL, INFORMED)
PICTURES = (PAPER_NETWORK, MASKED, EVERY_MOVE)
BOUNDS = ("random start", "nearest wall", "nearest room", "perfect Q")
SPREAD = "mean IoU ± standard deviation over rooms"
# Three tables of what the mean does not say: their methods, their numbers' names in cells, and their columns.
DETAILED = (AGENT, PAPER_NETWORK, EVERY_MOVE, REGRESSOR, POINTER)
SUPERVISED = {REGRESSOR: "p_regressor", POINTER: "p_pointer"}
NUMBERS = ("median_iou", "share_090", "overlap", "outside", "blocked")
SURE = {
    "": "{room}",
    "method": "{method}",
    "seeds": "{seeds}",
    "mean IoU": "{mean_iou:.4f}",
    "s.e. over seeds": "{se_over_seeds:.4f}",
    "95% interval over rooms": "{interval_low:.3f} to {interval_high:.3f}",
    "p, against the regressor": "{p_regressor!p}",
    "p, against the pointer": "{p_pointer!p}",
}
PLACES = {
    "": "{room}",
    "method": "{method}",
    "median": "{median_iou:.3f}",
    ">= 0.9": "{share_090:.1%}",
    "best of 3": "{best_of_3_mean_iou:.3f} ± {best_of_3_sd:.3f}",
    "overlap": "{overlap:.4f}",
    "outside": "{outside:.4f}",
    "blocked": "{blocked:.1%}",
}
COST = {
    "": "{room}",
    "method": "{method}",
    "minutes of training": "{training_minutes:.1f}",
    "moves": "{moves:.1f}",
}
# PlanIT's variants: how it is trained, what it is told and whose size the item has, and how it chooses.
TRAINED = {"planit": "agent's minutes", "planit_long": "fixed updates"}
TOLD = (
    ("sampled graph", "own size"), ("given categories", "own size"), ("given categories", "true size"),
    ("given graph", "own size"), ("given graph", "true size"),
)  # fmt: skip
CHOICES = {"argmax": "at the likeliest place", "sampled": "at a sampled place"}
PLANIT_ROWS = tuple(f"{told}, {choice}, {size}" for told, size in TOLD for choice in CHOICES)
PLANIT_COST = {
    "": "{room}",
    "trained": "{trained}",
    "seeds": "{seeds}",
    "minutes of training": "{training_minutes:.1f}",
    "updates": "{updates:.0f}",
}
WITHOUT_GPU = ("bedroom", "tatami")  # types in which method=paper is trained on a CPU
# Of paper_every_move, where they are more than 8,000.
UPDATES = dict.fromkeys([room for room in PAPER if room != "tatami"], "12000")
SWEEPS = (
    ("oracle,rules", "0", tuple(PAPER)),  # before the agents: they design the rooms
    ("geometric", "0,1,2", tuple(PAPER)),
    ("regressor,pointer,planit", "0", tuple(PAPER)),  # after the agents: they train for as long
    ("planit", "1,2", ("bathroom", "bedroom")),
    ("planit_long", "0", ("kitchen", "balcony")),  # whether the agent's minutes are too few for it
)  # columns, seeds, types


def stages(chosen: dict[str, str]) -> list[dict[str, str]]:
    """Return the sweeps, in order. Raises InputError for rooms and columns that the table does not have."""
    rooms = some_of("room", chosen, PAPER)
    some_of("column", chosen, dict.fromkeys([*(column for column, _ in METHODS.values()), *TRAINED]))
    seeds, types = ("0,1,2", tuple(PAPER)) if has_gpu_or_cluster(chosen) else ("0", WITHOUT_GPU)
    sweeps = [*SWEEPS, ("paper", seeds, types), ("paper_every_move", seeds, tuple(PAPER))]
    if seeds == "0":
        sweeps.append(("paper_every_move", "1,2", ("bedroom",)))  # how much seeds differ
    if "column" in chosen:
        sweeps = [(group, "0,1,2", tuple(PAPER)) for group in in_turn(chosen["column"])]
    made = []
    for columns, seeds, types in sweeps:
        sweep = chosen | {"column": columns, "seed": seeds_of(columns, seeds, chosen)}
        among = [room for room in rooms if room in types]
        made += sweeps_of(sweep, columns.split(","), among, "paper_every_move", "method.updates.default", UPDATES)
    return made


@answers_errors()
def main(arguments: list[str]) -> int:
    chosen = parsed_options(arguments)
    status = max([multirun("table1", sweep) for sweep in stages(chosen)])
    folder = cells_of("table1", chosen)
    show(tables(folder, some_of("room", chosen, PAPER)))
    write(tables(folder), folder.with_name("table1"))
    return status


Rows = Mapping[str, Row | None]  # by the names in METHODS


def tables(folder: Path, rooms: Iterable[str] = PAPER) -> list[Table]:
    """Return a table for each question, made from a folder's filled cells of these rooms."""
    found = {room: measured(folder, room) for room in rooms}
    return [main_table(found), *comparisons(found), *details(folder, found), *planit_tables(folder, list(found))]


def measured(folder: Path, room: str) -> Rows:
    return {words: row(folder, f"{room}-own-{column}", which) for words, (column, which) in METHODS.items()}


def main_table(found: Mapping[str, Rows]) -> Table:
    """Return the README's table, which is also drawn, with its intervals, as a figure."""
    lines = [
        (
            [room],
            [
                PAPER[room][1],
                *(method.estimate(**method.interval) if method else None for method in map(rows.get, MAIN)),
                ceiling(rows[AGENT] or rows["random start"]),
            ],
        )
        for room, rows in found.items()
    ]
    title = f"Table 1: how good is the agent in held-out rooms? ({SPREAD})"
    return compared("table1-main", title, ["room"], [THEIRS, *MAIN, CEILING], lines)


def comparisons(found: Mapping[str, Rows]) -> list[Table]:
    """Return the tables of other learned methods, of what needs no learning, and of the paper's network."""
    learned, bounds, papers = [], [], []
    for room, rows in found.items():
        best = ceiling(rows[AGENT] or rows["random start"])
        learned.append(([room], estimates(map(rows.get, LEARNED))))
        bounds.append(([room], [*estimates(map(rows.get, BOUNDS)), best]))
        network = rows[PAPER_NETWORK] or rows[EVERY_MOVE]
        papers.append(([room], [*PAPER[room], *estimates(map(rows.get, PICTURES)), ceiling(network)]))
    return [
        compared(
            "table1-learned", f"Table 1: which learned method is best in held-out rooms? ({SPREAD})", ["room"],
            LEARNED, learned,
        ),
        compared(
            "table1-bounds", f"Table 1: how far do rules come, and how far could the moves? ({SPREAD})", ["room"],
            [*BOUNDS, CEILING], bounds,
        ),
        compared(
            "table1-paper", f"Table 1: does the paper's network reach the paper's figures? ({SPREAD})", ["room"],
            ["PlanIT, as printed", THEIRS, *PICTURES, "ceiling of the paper's moves"], papers,
        ),
    ]  # fmt: skip


def details(folder: Path, found: Mapping[str, Rows]) -> list[Table]:
    """Return the tables of what the mean does not say, for learned methods."""
    records, used = [], []
    for room, rows in found.items():
        for method in DETAILED:
            if agent := rows[method]:
                best = row(folder, f"{room}-own-{METHODS[method][0]}", "best of 3")
                rivals = {} if method in SUPERVISED else {name: rows[words] for words, name in SUPERVISED.items()}
                seconds = agent.about("training_seconds")
                records.append({
                    "room": room,
                    "method": method,
                    **agent.estimate(**agent.interval).numbers,
                    "se_over_seeds": agent.error_over_seeds(),
                    **dict.fromkeys(SUPERVISED.values()),
                    **{name: agent.p_value(rival) for name, rival in rivals.items() if rival},
                    **{name: agent.number(name) for name in NUMBERS},
                    "best_of_3_mean_iou": best.mean if best else None,
                    "best_of_3_sd": float(best.iou.std()) if best else None,
                    "training_minutes": None if seconds is None else seconds / 60,
                    "moves": agent.about("moves"),
                })  # fmt: skip
                used.append(agent)
    return [
        listed("table1-sure", "Table 1: how sure are the means and their differences?", SURE, records, used),
        listed("table1-places", "Table 1: how good are the final positions?", PLACES, records, used),
        listed(
            "table1-cost", "Table 1: how long was the training, how many moves has an episode?", COST, records, used
        ),
    ]


def planit_tables(folder: Path, rooms: Iterable[str]) -> list[Table]:
    """Return PlanIT's tables: its training; one item and whole rooms, by what it is told and how it chooses."""
    found = {}
    for room in rooms:
        for column, trained in TRAINED.items():
            rows = {words: row(folder, f"{room}-own-{column}", words) for words in PLANIT_ROWS}
            if any(rows.values()):
                found[room, trained] = rows
    records, used = [], []
    for (room, trained), rows in found.items():
        first = next(known for known in rows.values() if known)
        about = {"training_minutes": (first.about("training_seconds") or 0) / 60, "updates": first.about("updates")}
        records.append({"room": room, "trained": trained, "seeds": len(first.cells), **about})
        used.append(first)
    made = [listed("planit-training", "PlanIT: for how long was it trained?", PLANIT_COST, records, used)]
    for choice, where in CHOICES.items():
        told = {f"{graph}, {size}": f"{graph}, {choice}, {size}" for graph, size in TOLD}
        one = [(setting, estimates(map(rows.get, told.values()))) for setting, rows in found.items()]
        every = [(setting, [of_all(rows[words], words) for words in told.values()]) for setting, rows in found.items()]
        for name, title, lines in (
            ("item", f"one item among all others, {where} ({SPREAD})", one),
            ("rooms", f"all items of a room from nothing, {where} (mean IoU, standard error over rooms)", every),
        ):
            keys = ("room", "trained")
            made.append(compared(f"planit-{name}-{choice}", f"PlanIT: {title}", keys, list(told), lines, by="told"))
    return made


def of_all(found: Row | None, words: str) -> Estimate | None:
    """Return PlanIT's mean IoU and standard error in the whole rooms that it furnishes, each the mean over seeds."""
    if not found:
        return None
    every = [cell["all items"][words] for cell in found.cells.values()]
    errors = [cell["standard_error"] for cell in every]
    mean = float(np.mean([cell["mean_iou"] for cell in every]))
    error = None if None in errors else float(np.mean(errors))
    [n] = {how_many(cell["config"]["budget"]["evaluation_rooms"], cell["rooms"]) for cell in found.cells.values()}
    return Estimate({"mean_iou": mean, "standard_error": error, "n": n, "seeds": len(every)}, found)


if __name__ == "__main__":
    sys.exit(main(command_line(__doc__)))
