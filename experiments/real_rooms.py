"""Real rooms: trained on real rooms, on designed ones alone, and on both; held-out rooms, one random start each.

    python experiments/real_rooms.py floorplans=<folder> designer_rooms=<folder> [room=kitchen] [task=toilet,bed]

The folders are what data.root is for each source; a source without one is left out. One fifth of the rooms is held out
(fold). `labels=snapped` edits the truth, test rooms included: both label sets stand side by side. The room types that
were asked for are printed; the files have all.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from itertools import product
from pathlib import Path

from printing import NOT_RUN, Estimate, Row, Table, ceiling, compared, estimates, p_text, row, show, write
from sweeps import ENDS, cells_of, command_line, in_turn, multirun, parsed_options, seeds_of, some_of

from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.runs.commands import answers_errors

TASKS = {
    "floorplans": {"bathtub": "bathroom", "toilet": "bathroom", "vanity": "bathroom", "counter": "kitchen"},
    "designer_rooms": {"bed": "bedroom", "platform": "tatami"},
}
LABELS = {"floorplans": ("snapped", "raw"), "designer_rooms": ("snapped",)}  # designer_rooms has one set only
# The methods by their names in the tables: what they are trained on, and the column and row of their cells.
METHODS = {
    "real rooms": ("own", "geometric", "agent"),
    "designed rooms": ("designer", "geometric", "agent"),
    "both": ("both", "geometric", "agent"),
    "real rooms, best of 3": ("own", "geometric", "best of 3"),
    "both, best of 3": ("both", "geometric", "best of 3"),
    "supervised scorer": ("own", "scorer", "agent"),
    "hand rule": ("own", "rules", "hand rule"),
    "nearest room": ("own", "rules", "nearest room"),
    "best wall or corner": ("own", "rules", "best wall or corner"),
    "random start": ("own", "rules", "random start"),
}
TRAINED_ON = ("real rooms", "designed rooms", "both")
RULES = ("hand rule", "nearest room")
BOUNDS = ("real rooms, best of 3", "both, best of 3", "best wall or corner", "random start")
SPREAD = "mean IoU ± standard deviation over rooms"


def stages(source: str, chosen: Mapping[str, str]) -> list[dict[str, str]]:
    """Return the sweeps of a source, in order. Raises InputError for unknown tasks and room types."""
    rooms = some_of("room", chosen, MAIN_ITEM)
    named = some_of("task", chosen, [task for tasks in TASKS.values() for task in tasks])
    tasks = [task for task in named if TASKS[source].get(task) in rooms]
    if not tasks:
        return []
    common = {name: value for name, value in chosen.items() if name not in (*TASKS, "room")}
    common |= {"data.root": str(Path(chosen[source]).absolute()), "task": ",".join(tasks)}
    usual = ENDS | {"data.labels": ",".join(LABELS[source])}
    sweeps = [("rules", "own"), ("geometric", "own,designer,both"), ("scorer", "own")]
    if "column" in chosen:
        sweeps = [(columns, "own") for columns in in_turn(chosen["column"])]
    return [
        usual | {"trained_on": trained_on} | common | {"column": columns, "seed": seeds_of(columns, "0", chosen)}
        for columns, trained_on in sweeps
    ]


@answers_errors()
def main(arguments: list[str]) -> int:
    chosen, status = parsed_options(arguments, *TASKS, "task"), 0
    for source in TASKS:
        if source not in chosen:
            print(f"{source}: left out; {source}=<folder> says where its files are")
            continue
        for sweep in stages(source, chosen):
            status = max(status, multirun("real", sweep))
    folder = cells_of("real", chosen)
    show(tables(folder, some_of("room", chosen, MAIN_ITEM)))
    write(tables(folder), folder.with_name("real"))
    return status


def tables(folder: Path, rooms: Iterable[str] = MAIN_ITEM) -> list[Table]:
    """Return a table for each question, made from a folder's filled cells of these room types."""
    rooms = list(rooms)
    trained, simpler, bounds = [], [], []
    for source, tasks in TASKS.items():
        for item, labels in product((item for item, room in tasks.items() if room in rooms), LABELS[source]):
            name = f"{tasks[item]}-{item}-{source}-{labels}"
            rows = {words: row(folder, f"{name}-{on}-{cells}", which) for words, (on, cells, which) in METHODS.items()}
            setting = [item, labels if source == "floorplans" else ""]
            trained.append((setting, of_training(rows)))
            simpler.append((setting, of_simpler(rows, item)))
            bounds.append((setting, of_bounds(rows)))
    keys = ("item", "labels")
    return [
        compared(
            "real-training", f"Real rooms: what should the agent be trained on? ({SPREAD})", keys,
            ["rooms (training)", *TRAINED_ON, "95% interval, real rooms"], trained, by="trained_on",
        ),
        compared(
            "real-simpler", f"Real rooms: is the agent better than what is simpler? ({SPREAD})", keys,
            ["agent", "supervised scorer", "p, agent against scorer", *RULES], simpler,
        ),
        compared(
            "real-bounds", f"Real rooms: how good could a choice be that knows the answer? ({SPREAD})", keys,
            [*BOUNDS, "ceiling of the moves"], bounds,
        ),
    ]  # fmt: skip


Rows = Mapping[str, Row | None]  # by the names in METHODS
Entries = list[Estimate | str | None]


def of_training(rows: Rows) -> Entries:
    """Return the numbers of rooms, the agent's results by what it was trained on, and the interval of real rooms."""
    known = rows["real rooms"] or rows["random start"]
    size = f"{known.about('rooms'):.0f} ({known.about('training_rooms'):.0f})" if known else NOT_RUN
    agents = [
        found.estimate(**found.interval, training_rooms=round(found.about("training_rooms") or 0)) if found else None
        for found in map(rows.get, TRAINED_ON)
    ]
    return [size, *agents, own.interval_text() if (own := rows["real rooms"]) else NOT_RUN]


def of_simpler(rows: Rows, item: str) -> Entries:
    """Return the results of agent, scorer and rules; the hand rule is for bathtubs only."""
    own, scorer = rows["real rooms"], rows["supervised scorer"]
    hand, nearest = estimates(map(rows.get, RULES))
    if not (own and scorer):
        return [*estimates([own, scorer]), NOT_RUN, hand if item == "bathtub" else "-", nearest]
    p = own.p_value(scorer)
    return [own.estimate(), scorer.estimate(p_agent=p), p_text(p), hand if item == "bathtub" else "-", nearest]


def of_bounds(rows: Rows) -> Entries:
    return [*estimates(map(rows.get, BOUNDS)), ceiling(rows["real rooms"] or rows["random start"])]


if __name__ == "__main__":
    sys.exit(main(command_line(__doc__)))
