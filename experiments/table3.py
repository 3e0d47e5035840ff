"""Table 3: whole rooms, furnished from nothing; eight room types, held-out briefs, all measures.

    python experiments/table3.py [room=kitchen,study] [column=annealer] [designer_rooms=<folder>] [budget=smoke]

Fills the missing cells in parallel, and prints the tables of all filled cells, for the rooms that were asked for; the
files have all rooms. The agents are those in the package. The quick methods furnish all held-out rooms, those that take
a second a room or more a fifth of them, the untrained agent a twentieth. With `designer_rooms`, the folder of the
authors' real bedrooms and tatami rooms, the held-out fifth of these is furnished, too; agent and pointer are trained
anew for it, on designed rooms, on real ones and on both. Search and annealer with ten seconds a room, PlanIT and the
untrained agent furnish designed rooms alone, unless they are asked for (column=...).
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from cell_config import LAYOUTS
from packing import FLAG, unpacked
from printing import Row, Table, listed, row, show, write
from sweeps import cells_of, command_line, multirun, parsed_options, seeds_of, some_of, sweeps_of

from layoutrl import InputError
from layoutrl.evaluation.statistics import paired_p_value
from layoutrl.rooms.room import MAIN_ITEM
from layoutrl.runs.commands import answers_errors

# The methods by their names in the tables: the column of their cells.
METHODS = {
    "designer": "designer",
    "agent": "rooms_package",
    "untrained agent": "rooms_untrained",
    "pointer in sequence": "rooms_pointer",
    "annealer, 10 s": "annealer_long",
    "annealer, 1 s": "annealer",
    "search, 10 s": "search_long",
    "search, 1 s": "search",
    "PlanIT": "rooms_planit",
    "nearest room": "nearest",
    "random": "random",
}
NO_RIVALS = ("designer", "untrained agent")  # nothing is compared with them; the second is a part of the agent
REAL = ("bedroom", "tatami")  # the types of which there are real rooms
TRAINED_ON = {"designer": "designed rooms", "own": "real rooms", "both": "both"}  # of LEARNS, in real rooms
LEARNS = {"agent": "rooms_agent", "pointer in sequence": "rooms_pointer"}  # columns trained anew for real rooms
# Columns that furnish real rooms only where they are asked for.
DESIGNED_ALONE = ("rooms_untrained", "annealer_long", "search_long", "rooms_planit")
# Of training, where more than elsewhere.
POINTER_MINUTES = dict.fromkeys(("bathroom", "bedroom", "study", "tatami", "kitchen"), "24.0")
REAL_UPDATES = {"bedroom": "30000", "tatami": "24000"}  # of agents of real rooms, fewer than the package's made
SWEEPS = (
    "designer,random,nearest,rooms_package", "rooms_agent", "annealer,search", "rooms_untrained", "rooms_pointer",
    "annealer_long,search_long", "rooms_planit",
)  # fmt: skip
BEST = {
    "": "{room}",
    "method": "{method}",
    "mean IoU": "{mean_iou:.3f} ({iou_error:.3f})",
    "p, to the best rival": "{p_iou!p}",
    "facing": "{facing:.3f}",
    "faultless": "{faultless:.3f} ({faultless_error:.3f})",
    "p, to the best rival of these": "{p_faultless!p}",
    "seconds a room": "{seconds:.3f}",
}
FAULTS = {
    "": "{room}",
    "method": "{method}",
    "no place": "{missing:.3f}",
    "overlap": "{overlap:.3f}",
    "outside": "{outside:.3f}",
    "blocked": "{blocked:.3f}",
    "reached": "{reached:.3f}",
    "front free": "{fronts:.3f}",
}
FLOOR = {
    "": "{room}",
    "method": "{method}",
    "overlapping area": "{overlap_area:.3f}",
    "area outside": "{outside_area:.3f}",
    "walkable": "{walkable:.3f}",
    "reach": "{reach:.3f}",
    "moved, m": "{moved:.2f}",
}
NUMBERS = (
    "iou_error", "facing", "faultless", "faultless_error", "missing", "overlap", "outside", "blocked", "reached",
    "fronts", "overlap_area", "outside_area", "walkable", "reach", "moved", "seconds",
)  # fmt: skip


def stages(chosen: Mapping[str, str]) -> list[dict[str, str]]:
    """Return the sweeps of designed and of real rooms, in order.

    Raises InputError for unknown types and columns, and for a column that only real rooms have if no real rooms are
    asked for.
    """
    rooms = some_of("room", chosen, MAIN_ITEM)
    some_of("column", chosen, dict.fromkeys([*METHODS.values(), *LEARNS.values()]))
    common = {
        name: value for name, value in chosen.items() if name not in ("floorplans", "designer_rooms", "trained_on")
    }
    trained_on = {"trained_on": chosen.get("trained_on", ",".join(TRAINED_ON))}
    made = []
    for columns in [chosen["column"]] if "column" in chosen else SWEEPS:
        sweep = common | {"column": columns, "seed": seeds_of(columns, "0", chosen)}
        if designed := [column for column in columns.split(",") if column in METHODS.values()]:
            pointer = LEARNS["pointer in sequence"], "training_minutes.default", POINTER_MINUTES
            made += sweeps_of(sweep, designed, rooms, *pointer)
        if "designer_rooms" in chosen and (real := [room for room in rooms if room in REAL]):
            root = str(Path(chosen["designer_rooms"]).absolute())
            own = {"data": "designer_rooms", "data.root": root, "share_of_rooms": "1.0"}
            sweep = {name: value for name, value in sweep.items() if name != "data.root"} | own
            learn = [column for column in columns.split(",") if column in LEARNS.values()]
            left_out = {*learn} if "column" in chosen else {*learn, *DESIGNED_ALONE}
            others = [column for column in columns.split(",") if column not in left_out]
            agent = LEARNS["agent"], "method.updates.default", REAL_UPDATES
            made += sweeps_of(trained_on | sweep, learn, real, *agent) if learn else []
            made += [sweep | {"column": ",".join(others), "room": ",".join(real)}] if others else []
    used = {column for sweep in made for column in sweep["column"].split(",")}
    if missed := [column for column in chosen.get("column", "").split(",") if column and column not in used]:
        raise InputError(
            f"column: {', '.join(missed)} learns in real rooms; expected designer_rooms=<folder>, and room="
            f"{' or '.join(REAL)}"
        )
    return made


@answers_errors()
def main(arguments: list[str]) -> int:
    chosen = parsed_options(arguments, "designer_rooms")
    status = max([multirun("table3", sweep) for sweep in stages(chosen)])
    folder = cells_of("table3", chosen)
    show(tables(folder, some_of("room", chosen, MAIN_ITEM)))
    write(tables(folder), folder.with_name("table3"))
    return status


def tables(folder: Path, rooms: Iterable[str] = MAIN_ITEM) -> list[Table]:
    """Return a table for each question, of designed and of real rooms, from a folder's filled cells of these types."""
    rooms = list(rooms)
    made: list[Table] = []
    designed = {words: f"own-{column}" for words, column in METHODS.items()}
    real: dict[str, str] = {}
    for words, column in METHODS.items():
        if column not in LEARNS.values():
            real[words] = f"own-{column}"
        if learner := LEARNS.get(words):
            real |= {f"{words}, trained on {what}": f"{trained}-{learner}" for trained, what in TRAINED_ON.items()}
    for name, title, suffix, types, methods in (
        ("table3", "Table 3", "", rooms, designed),
        ("table3-real", "Table 3, real rooms", "-designer_rooms-snapped", [r for r in rooms if r in REAL], real),
    ):
        records: list[dict[str, Any]] = []
        used: list[Row] = []
        for room in types:
            found = {words: row(folder, f"{room}{suffix}-{cell}", LAYOUTS) for words, cell in methods.items()}
            known = {words: rows for words, rows in found.items() if rows}
            records += [record(room, words, known) for words in known]
            used += known.values()
        made += [
            listed(f"{name}-best", f"{title}: how good are whole rooms, furnished from nothing?", BEST, records, used),
            listed(f"{name}-faults", f"{title}: what is wrong with them? (share of items)", FAULTS, records, used),
            listed(f"{name}-floor", f"{title}: how much, and can one walk there?", FLOOR, records, used),
        ]
    return made


def record(room: str, method: str, known: Mapping[str, Row]) -> dict[str, Any]:
    """Return a line of the tables. Each method but the designer is compared with its best rival, none of NO_RIVALS."""
    own = known[method]
    rivals = {words: rows for words, rows in known.items() if words not in (method, *NO_RIVALS)}
    numbers = {name: None if own.numbers[0][name] is None else own.number(name) for name in NUMBERS}
    return {
        "room": room,
        "method": method,
        "mean_iou": own.mean,
        "sd": float(own.iou.std()),
        **numbers,
        "n": own.iou.shape[1],
        "seeds": own.iou.shape[0],
        "p_iou": None,
        "p_faultless": None,
        **(compared_with(own, rivals) if rivals and method != "designer" else {}),
    }


def compared_with(own: Row, rivals: Mapping[str, Row]) -> dict[str, float]:
    """Return the p-values against the rival with the best IoU, and against the one with the most faultless rooms.

    Raises InputError where a rival furnished other rooms.
    """
    for rival in rivals.values():
        own.check_same_rooms(rival)
    return {
        "p_iou": p_value(own.iou.mean(0), [rival.iou.mean(0) for rival in rivals.values()], own),
        "p_faultless": p_value(faultless(own), [faultless(rival) for rival in rivals.values()], own),
    }


def p_value(ours: np.ndarray, rivals: Sequence[np.ndarray], own: Row) -> float:
    """Return the p-value against the best rival, paired over the rooms that both furnished.

    Those are the first of the held-out ones. The best rival is the best in the rooms that all furnished.
    """
    every = min(map(len, [ours, *rivals]))
    best = max(rivals, key=lambda values: values[:every].mean())
    both = min(len(ours), len(best))
    return paired_p_value(ours[:both], best[:both], own.group[:both], seed=0)


def faultless(found: Row) -> np.ndarray:
    """Return the share of seeds in which each room is faultless: (B,)."""
    return np.mean([unpacked(numbers["faultless_rooms"], FLAG) for numbers in found.numbers], axis=0, dtype=float)


if __name__ == "__main__":
    sys.exit(main(command_line(__doc__)))
