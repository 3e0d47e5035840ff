"""The cells of the tables: one column, one room type or task, one seed each. Filled once, kept as a JSON file.

    python experiments/cells.py table=table1 column=geometric room=bedroom,study seed=0,1,2

Hydra's multirun fills them side by side. A cell whose file is there is not filled again; one that fails says why beside
it, and the others go on. The tables' own scripts know which cells there are.
"""

from __future__ import annotations

import base64
import contextlib
import json
import os
import subprocess
import sys
import time
import traceback
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import torch
from cell_config import RESULTS, CellConfig, folder_of, name_of
from cell_trainings import clock_of
from item_columns import FILLS, setting_of
from room_columns import FURNISHES, whole_rooms_of

from layoutrl import InputError
from layoutrl.env.measures import measured
from layoutrl.evaluation.layouts import summary
from layoutrl.evaluation.metrics import lattice_ceiling, score
from layoutrl.rivals.planit.canvas import box_of
from layoutrl.rooms.documents import room_to_dict
from layoutrl.runs import resume
from layoutrl.runs.commands import command, groups, in_a_line, mendable, nearest
from layoutrl.runs.config import config_directory, expanded
from layoutrl.runs.files import write_json
from layoutrl.runs.folder import differences
from layoutrl.runs.machine import device_of, machine
from layoutrl.runs.ranges import one_of
from layoutrl.runs.wording import options

LAYOUTS = "layouts"  # the row of whole rooms
DRAWN_ROOMS = 2  # layouts that are kept, to be drawn
PLANIT = "given categories, argmax, true size"  # told what the agent is told
SEEDLESS = ("rules", "oracle", "rooms_package")  # columns that draw nothing but the starts, which are always the same
TIMED = ("regressor", "pointer", "scorer", "planit")  # columns that are trained for as long as the agent
IOU, METRES, INDEX, FLAG = (np.dtype(kind) for kind in ("<u2", "<f4", "<u2", "u1"))  # of what is packed; IoU in 1/65535


def fill(config: CellConfig) -> None:
    """Fill a cell, unless it is. What goes wrong is written beside it and does not stop other cells.

    Raises InputError where nobody knows how to fill it.
    """
    one_of("fill", config.fill, *FILLS, *FURNISHES)
    folder, name = folder_of(config), name_of(config)
    if config.column in SEEDLESS and config.protocol == "unseen" and config.seed:
        print(f"{config.table}: {name} left out: {config.column} has one cell, seed 0, since it draws nothing")
        return
    file, error = folder / f"{name}.json", folder / f"{name}.error"
    if file.exists():
        error.unlink(missing_ok=True)
        if others := differences(json.loads(file.read_text(encoding="utf-8"))["config"], stated(config)):
            what = f"filled with another {', '.join(others)}; expected a new folder (results=...), or delete the cell"
            error.write_text(f"error: {name} is {what}\n", encoding="utf-8")
            print(f"{config.table}: {name} is {what}", flush=True)
        else:
            print(f"{config.table}: {name} is filled already", flush=True)
        return
    log = Path(config.runs) / config.table / f"{config.budget.name}-{name}.log"
    for needed in (folder, log.parent):
        needed.mkdir(parents=True, exist_ok=True)
    print(f"{config.table}: {name} begins", flush=True)
    error.write_text(f"{name} began and did not end: it was killed, or is running\n", encoding="utf-8")
    try:
        with log.open("w", encoding="utf-8") as out, contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            result = filled(config)
    except Exception as problem:  # whatever it is: the other cells shall not suffer
        said = in_a_line(problem)
        error.write_text(f"error: {said}\n" if mendable(problem) else traceback.format_exc(), encoding="utf-8")
        print(f"{config.table}: {name} failed ({said}); see {error}", flush=True)
        return
    write_json(file, result)
    error.unlink(missing_ok=True)
    rows = ", ".join(f"{row} {values['mean_iou']:.3f}" for row, values in result["rows"].items())
    print(f"{config.table}: {name} done in {result['minutes']:.1f} minutes: {rows}", flush=True)


def filled(config: CellConfig) -> dict[str, Any]:
    """All that is kept of a cell: where it comes from, and a row of numbers for each set of places."""
    began, device = datetime.now(UTC), device_of(config.device)
    if device.type == "cpu":
        torch.set_num_threads(1)  # jobs run side by side, and rivals count the processor's seconds
    about = machine(device)
    return {
        **(whole_rooms if config.fill in FURNISHES else items)(config, device),
        "date": f"{began:%Y-%m-%d}",
        "minutes": (datetime.now(UTC) - began).total_seconds() / 60,
        "machine": about,
        "config": stated(config),
    }


def whole_rooms(config: CellConfig, device: torch.device) -> dict[str, Any]:
    """Whole rooms: their measures, and what they are for each room where tables compare it."""
    rooms = whole_rooms_of(config, device)
    furnish = FURNISHES[config.fill](config, rooms)
    clock = clock_of(device)
    began = clock()
    layouts = furnish()
    seconds = clock() - began
    found = measured(layouts, rooms.designs)
    told = summary(found)
    numbers = {name: value["mean"] for name, value in told.items()}
    errors = {f"{name}_error": value["standard_error"] for name, value in told.items()}
    names = sorted({*found.group})
    row = (
        numbers
        | errors
        | {
            "mean_iou": numbers["iou"],
            "iou": packed_iou(found.iou),
            "faultless_rooms": packed(found.faultless, FLAG),
            "group": packed([names.index(group) for group in found.group], INDEX),
            "seconds": seconds / len(layouts),
        }
    )
    return {
        "rows": {LAYOUTS: row},
        "layouts": [room_to_dict(layout) for layout in layouts[:DRAWN_ROOMS]],
        "rooms": len(layouts),
        "training_rooms": len(rooms.training),
    }


def items(config: CellConfig, device: torch.device) -> dict[str, Any]:
    """One item in each room: a row for each set of places."""
    setting = setting_of(config, device)
    found = FILLS[config.fill](config, setting)
    simulator = setting.simulator
    groups = {group: k for k, group in enumerate(sorted({room.group for room in simulator.rooms}))}
    rows = {}
    for row, (room, place) in found.pop("places", {}).items():
        iou = simulator.reward(room, place).iou
        rows[row] = score(simulator, room, place).as_dict() | {
            "iou": packed_iou(iou),
            "place": packed(place, METRES),
            "group": packed([groups[simulator.rooms[k].group] for k in room], INDEX),
        }
    for row, put in found.pop("items", {}).items():  # one in each room, of a size of its own
        rows[row] = put.score.as_dict() | {
            "missing": put.missing,
            "iou": packed_iou(put.iou),
            "group": packed([groups[room.group] for room in simulator.rooms], INDEX),
        }
        if row == PLANIT:
            boxes = [box_of(item) if item else (np.nan,) * 4 for item in put.items]
            rows[row]["box"] = packed(np.round(boxes, 3), METRES)
    if "knew_better" in found:
        found["knew_better"] = packed(found["knew_better"], FLAG)
    return {
        "rows": rows,
        "ceiling": float(lattice_ceiling(simulator, setting.room, setting.starts).mean()),
        **found,
        "rooms": len(simulator.rooms),
        "training_rooms": len(setting.training),
    }


def stated(config: CellConfig) -> dict[str, Any]:
    """The configuration of a cell, as JSON has it, but for where files lie; how long agents train, of agents alone."""
    said = resume.stated(replace(config, results=None))
    if config.fill not in ("agent", "rooms_agent"):  # TIMED columns hang on an agent's seconds instead
        said["method"]["updates"] = {}
    return said


def packed(values: Sequence[float] | np.ndarray, kind: np.dtype[Any]) -> str:
    """An array as text: compressed, in base64."""
    return base64.b64encode(zlib.compress(np.asarray(values).astype(kind).tobytes(), 9)).decode()


def unpacked(text: str, kind: np.dtype[Any]) -> np.ndarray:
    return np.frombuffer(zlib.decompress(base64.b64decode(text)), kind)


def packed_iou(iou: np.ndarray) -> str:
    return packed(np.round(iou * 65535), IOU)


def unpacked_iou(text: str) -> np.ndarray:
    return unpacked(text, IOU) / 65535


def multirun(table: str, chosen: Mapping[str, str]) -> int:
    """Fill the cells of a sweep, given as values by name; the exit status: 1 where a cell failed."""
    overrides = [f"{name}={value}" for name, value in chosen.items()]
    command = [sys.executable, str(Path(__file__).resolve()), f"table={table}", *overrides]
    folder, began, status, filled_before = cells_of(table, chosen), time.time(), 1, -1
    # On this machine a job that is killed takes the others with it: they begin again, as long as any is finished.
    while status and (filled_now := len(list(folder.glob("*.json")))) > filled_before:
        filled_before, status = filled_now, subprocess.run(command, check=False).returncode
        if "hydra/launcher" in chosen:  # a cluster's jobs are on their own
            break
    failed = [error for error in sorted(folder.glob("*.error")) if error.stat().st_mtime >= began]
    for error in failed:
        print(f"{error.stem} failed: {error.read_text(encoding='utf-8').splitlines()[-1]}", file=sys.stderr)
    return status or int(bool(failed))


def some_of(name: str, chosen: Mapping[str, str], known: Iterable[str]) -> list[str]:
    """The values that were chosen for an option, or all. Raises InputError for others."""
    every = list(known)
    values = chosen.get(name, ",".join(every)).split(",")
    if unknown := sorted({*values} - {*every}):
        raise InputError(f"{name}: expected some of {','.join(every)}; got {','.join(unknown)}")
    return values


def in_turn(columns: str) -> list[str]:
    """The columns in sweeps: those without a seed, and those that are trained for as long as the agent after it."""
    given = columns.split(",")
    seedless = [column for column in given if column in SEEDLESS]
    timed = [column for column in given if column in TIMED]
    others = [column for column in given if column not in (*SEEDLESS, *TIMED)]
    return [",".join(group) for group in (seedless, others, timed) if group]


def trains_pictures(chosen: Mapping[str, str]) -> bool:
    """Whether the paper's network is trained in every type and with every seed: on a GPU or a cluster."""
    return torch.cuda.is_available() or "hydra/launcher" in chosen


def seeds_of(columns: str, usual: str, chosen: Mapping[str, str]) -> str:
    """The seeds of a sweep: those that were chosen or the usual ones; with budget=smoke, the first of these.

    Columns without a seed have seed 0, and a line says so where others were chosen.
    """
    if {*columns.split(",")} <= {*SEEDLESS}:
        if chosen.get("seed", "0") != "0":
            print(f"{columns}: seed={chosen['seed']} is left out, since nothing is drawn; one cell each, seed 0")
        return "0"
    return chosen.get("seed", usual.split(",")[0] if chosen.get("budget") == "smoke" else usual)


def cells_of(table: str, chosen: Mapping[str, str]) -> Path:
    """The folder of a table's cells, by what was chosen."""
    return Path(chosen.get("results", RESULTS)) / chosen.get("budget", "default") / table


OF_SCRIPTS = ("floorplans", "designer_rooms", "weights", "version", "scores")  # options that are none of a cell


def given(arguments: Sequence[str]) -> dict[str, str]:
    """What the user gives, as name=value. Raises InputError for anything else, before a sweep begins."""
    for argument in arguments:
        if "=" not in argument:
            raise InputError(f"{argument}: expected options as name=value; --help says which")
    pairs = (argument.split("=", 1) for argument in arguments)
    chosen = {name: expanded(value) for name, value in pairs}  # of what begins with ~, all are paths
    known = [*groups("cell"), *options(CellConfig), *OF_SCRIPTS]
    for name in chosen:
        if name not in known and not name.startswith("hydra"):
            raise InputError(f"{name}: unknown; {nearest(name, known)}")
    some_of("column", chosen, sorted(file.stem for file in Path(config_directory(), "column").glob("*.yaml")))
    return chosen


def asked(script: str | None) -> list[str]:
    """The command line's arguments; --help is answered with what the script says of itself."""
    if {"-h", "--help"} & set(sys.argv):
        print(script)
        sys.exit()
    return sys.argv[1:]


main = command("cell", CellConfig, fill, sweeps=True)

if __name__ == "__main__":
    # A cluster's jobs do not begin here: they find the modules that this one imports by the path.
    path = str(Path(__file__).parent), os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, path))
    main()
