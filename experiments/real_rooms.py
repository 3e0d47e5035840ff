"""Real rooms: trained on real rooms, on designed ones alone, and on both; rooms never seen, one random start each.

    python experiments/real_rooms.py floorplans=<folder> designer_rooms=<folder> [budget=smoke] [task=toilet]

The folders are what data.root is for each source; a source without one is left out. One fifth of the rooms is held out
(fold). `labels=snapped` edits the truth, test rooms included: both label sets stand side by side.
"""

from __future__ import annotations

import sys
from pathlib import Path

from cells import cells_of, given, multirun
from printing import NOT_RUN, Table, minutes, row, write

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
)
HEADER = (
    "",
    "labels",
    "rooms (training)",
    *(words for *_, words in COLUMNS),
    "95% interval, real",
    "p, real against scorer",
)


def main(arguments: list[str]) -> int:
    roots = {source: folder for source, folder in given(arguments).items() if source in TASKS}
    arguments = [argument for argument in arguments if argument.split("=")[0] not in TASKS]
    folder, status = cells_of("real", arguments), 0
    for source, tasks in TASKS.items():
        if source not in roots:
            print(f"{source}: left out; {source}=<folder> says where its files are")
            continue
        for columns, trained_on in (("geometric", "own,designer,both"), ("rules,scorer", "own")):
            sweep = {
                "data.root": str(Path(roots[source]).absolute()),
                "column": columns,
                "trained_on": trained_on,
                "data.labels": ",".join(LABELS[source]),
                "task": ",".join(tasks),
            }
            status = multirun("real", sweep, arguments) or status

    lines, every = [], []
    for source, tasks in TASKS.items():
        for item, room in tasks.items():
            for labels in LABELS[source]:
                name = f"{room}-{item}-{source}-{labels}"
                found = {
                    (on, column, which): row(folder, f"{name}-{on}-{column}", which) for on, column, which, _ in COLUMNS
                }
                own, scorer = found["own", "geometric", "agent"], found["own", "scorer", "agent"]
                size = f"{own.cells[0]['rooms']} ({own.cells[0]['training_rooms']})" if own else NOT_RUN
                texts = [r.text() if r else NOT_RUN for r in found.values()]
                sure = own.interval() if own else NOT_RUN
                p = own.p_value(scorer) if own and scorer else NOT_RUN
                lines.append([item, labels if source == "floorplans" else "", size, *texts, sure, p])
                every += found.values()
    title = f"Real rooms never seen ({minutes(every)}; mean IoU ± standard deviation over rooms)"
    write([Table(title, HEADER, lines)], folder.with_name("real"))
    return status


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
