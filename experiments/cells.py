"""The cells of the tables: one column, one room type or task, one seed each. Filled once, kept as a JSON file.

    python experiments/cells.py table=table1 column=geometric room=bedroom,study seed=0,1,2

Hydra's multirun fills them in parallel. A cell whose file exists is not filled again. A cell that fails leaves a .error
file that says why, and the others go on. The scripts of the tables know which cells each table has.
"""

from __future__ import annotations

import contextlib
import json
import os
import traceback
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import torch
from cell_config import AGENTS, LAYOUTS, PLANIT, SEEDLESS, CellConfig, compared_part, folder_of, name_of
from cell_trainings import clock_of
from item_columns import FILLS, setting_of
from packing import FLAG, INDEX, METRES, packed, packed_iou
from room_columns import FURNISHES, whole_rooms_of

from layoutrl.env.measures import measured
from layoutrl.evaluation.layouts import summary
from layoutrl.evaluation.metrics import lattice_ceiling, score
from layoutrl.rivals.planit.canvas import box_of
from layoutrl.rooms.documents import room_to_dict
from layoutrl.runs.commands import command, in_a_line, mendable
from layoutrl.runs.files import write_json
from layoutrl.runs.folder import differences
from layoutrl.runs.folder import stated as stated_of_run
from layoutrl.runs.machine import device_of, machine
from layoutrl.runs.ranges import one_of

DRAWN_ROOMS = 2  # layouts that are kept, to be drawn


def fill(config: CellConfig) -> None:
    """Fill a cell, unless it is filled. Errors are written to a .error file beside it and do not stop other cells.

    Raises InputError for an unknown `fill`.
    """
    one_of("fill", config.fill, *FILLS, *FURNISHES)
    folder, name = folder_of(config), name_of(config)
    if config.column in SEEDLESS and config.protocol == "unseen" and config.seed:
        print(f"{config.table}: {name} left out: {config.column} has one cell, seed 0, since it draws nothing")
        return
    file, error = folder / f"{name}.json", folder / f"{name}.error"
    if file.exists():
        error.unlink(missing_ok=True)
        kept = json.loads(file.read_text(encoding="utf-8"))
        if others := differences(compared_part(kept["config"]), stated(config)):
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
    """Compute a cell, and return the content of its file: provenance, and a row of numbers for each way of placing."""
    began, device = datetime.now(UTC), device_of(config.device)
    if device.type == "cpu":
        torch.set_num_threads(1)  # jobs run in parallel, and rivals are timed in CPU seconds
    about = machine(device)
    return {
        **(whole_rooms if config.fill in FURNISHES else items)(config, device),
        "date": f"{began:%Y-%m-%d}",
        "minutes": (datetime.now(UTC) - began).total_seconds() / 60,
        "machine": about,
        "config": stated(config),
    }


def whole_rooms(config: CellConfig, device: torch.device) -> dict[str, Any]:
    """Furnish whole rooms, and return their measures; those that tables compare also for each room."""
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
    """Place one item in each room, and return a row of scores for each way of placing."""
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
    for row, put in found.pop("items", {}).items():  # an item for each room, as its size may differ from the designer's
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
    """Return a cell's configuration as plain values: no paths and, unless it trains an agent, no updates of one."""
    said = stated_of_run(replace(config, results=None))
    if config.fill not in AGENTS:  # TIMED columns depend on an agent's seconds instead
        said["method"]["updates"] = {}
    return said


main = command("cell", CellConfig, fill, sweeps=True)

if __name__ == "__main__":
    # Jobs on a cluster do not start from this file: they find the modules that it imports by PYTHONPATH.
    path = str(Path(__file__).parent), os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, path))
    main()
