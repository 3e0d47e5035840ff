"""Real rooms: trained on real rooms, on designed ones alone, and on both; rooms never seen, one random start each.

    python experiments/real_rooms.py floorplans=<folder> designer_rooms=<folder> [budget=smoke] [task=toilet,bed]

The folders are what data.root is for each source; a source without one is left out. One fifth of the rooms is held out
(fold). `labels=snapped` edits the truth, test rooms included: both label sets stand side by side.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

from cells import asked, cells_of, given, in_turn, multirun, some_of
from printing import NOT_RUN, Row, Table, provenance, row, text, write

from layoutrl.runs.commands import answers_errors

TASKS = {
    "floorplans": {"bathtub": "bathroom", "toilet": "bathroom", "vanity": "bathroom", "counter": "kitchen"},
    "designer_rooms": {"bed": "bedroom", "platform": "tatami"},
}
LABELS = {"floorplans": ("snapped", "raw"), "designer_rooms": ("snapped",)}  # designer_rooms has one set only
# What stands in the table: trained on, column, row of its cells, words.
COLUMNS = (
    ("own", "geometric", "agent", "trained on real rooms"),
    ("designer", "geometric", "agent", "on designed rooms"),
    ("both", "geometric", "agent", "on both"),
    ("own", "geometric", "best of 3", "real, best of 3"),
    ("both", "geometric", "best of 3", "both, best of 3"),
    ("own", "scorer", "agent", "supervised scorer"),
    ("own", "rules", "hand rule", "hand rule"),
    ("own", "rules", "nearest room", "nearest room"),
    ("own", "rules", "best wall or corner", "best wall or corner"),
    ("own", "rules", "random start", "random start"),
)
HEADER = (
    "", "labels", "rooms (training)", *(words for *_, words in COLUMNS), "lattice ceiling", "95% interval, real",
    "p, real against scorer",
)  # fmt: skip


def stages(source: str, chosen: Mapping[str, str]) -> list[dict[str, str]]:
    """The sweeps of a source, one after the other. Raises InputError for tasks that there are not."""
    every = [task for tasks in TASKS.values() for task in tasks]
    tasks = [task for task in some_of("task", chosen, every) if task in TASKS[source]]
    if not tasks:
        return []
    common = {name: value for name, value in chosen.items() if name not in TASKS}
    common |= {"data.root": str(Path(chosen[source]).absolute()), "task": ",".join(tasks)}
    labels = {"data.labels": ",".join(LABELS[source])}
    sweeps = [("geometric", {"trained_on": "own,designer,both"}), ("rules,scorer", {"trained_on": "own"})]
    if "column" in chosen:
        sweeps = [(columns, {}) for columns in in_turn(chosen["column"])]
    return [labels | trained_on | common | {"column": columns} for columns, trained_on in sweeps]


@answers_errors()
def main(arguments: list[str]) -> int:
    chosen, status = given(arguments), 0
    for source in TASKS:
        if source not in chosen:
            print(f"{source}: left out; {source}=<folder> says where its files are")
            continue
        for sweep in stages(source, chosen):
            status = max(status, multirun("real", sweep))

    folder = cells_of("real", chosen)
    lines, every = [], []
    for source, tasks in TASKS.items():
        for item, room in tasks.items():
            for labels in LABELS[source]:
                name = f"{room}-{item}-{source}-{labels}"
                rows = [row(folder, f"{name}-{on}-{column}", which) for on, column, which, _ in COLUMNS]
                lines.append([item, labels if source == "floorplans" else "", *line(item, rows)])
                every += rows
    title = f"Real rooms never seen ({provenance(every)}; mean IoU ± standard deviation over rooms)"
    write([Table(title, HEADER, lines)], folder.with_name("real"))
    return status


def line(item: str, rows: list[Row | None]) -> list[str]:
    """Of one item and label set."""
    found = {(on, column, which): row for (on, column, which, _), row in zip(COLUMNS, rows, strict=True)}
    own, scorer = found["own", "geometric", "agent"], found["own", "scorer", "agent"]
    any_own = own or found["own", "rules", "random start"]
    size = f"{any_own.about('rooms'):.0f} ({any_own.about('training_rooms'):.0f})" if any_own else NOT_RUN
    return [
        size,
        *(
            text(row, "-" if which == "hand rule" and item != "bathtub" else NOT_RUN)
            for (*_, which), row in found.items()
        ),
        any_own.ceiling() if any_own else NOT_RUN,
        own.interval() if own else NOT_RUN,
        own.p_value(scorer) if own and scorer else NOT_RUN,
    ]


if __name__ == "__main__":
    sys.exit(main(asked(__doc__)))
