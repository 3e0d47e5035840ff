"""python -m layoutrl.bench [parts=[speed,rooms,memory,growth,demo,training,image,sb3]] [device=cpu]

Measures on one machine, in one run, what the project promises; prints a table and writes bench.json.
"""

from __future__ import annotations

from dataclasses import asdict, replace
from datetime import datetime
from pathlib import Path
from typing import Any

from layoutrl import InputError
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources.parts import two_parts
from layoutrl.runs.commands import command
from layoutrl.runs.config import BenchConfig


def run(config: BenchConfig) -> Path:
    """Measure the configured parts; return the folder of bench.json and, with part `growth`, of growth.png.

    Raises InputError before it measures: if the methods cannot be compared, a part lacks what it needs, or the folder
    cannot be written to.
    """
    # Imported here: they load torch, which takes seconds, and a wrong option is reported before that.
    from layoutrl.benchmarks.parts import NEEDS, NEEDS_ROOMS, PARTS, table
    from layoutrl.benchmarks.simulation import plot
    from layoutrl.runs.files import check_writable, write_json
    from layoutrl.runs.folder import make_folder
    from layoutrl.runs.machine import device_of, keep_freed_memory, machine

    device = device_of(config.device)
    keep_freed_memory()
    if config.method.name == config.paper.name:
        raise InputError(f"method: expected another than {config.paper.name}, which is measured beside it")
    for part in filter(NEEDS.__contains__, config.parts):
        NEEDS[part](config)
    wanted = Path(config.runs) / "bench" / (config.name or datetime.now().strftime("%Y-%m-%d-%H%M%S"))
    check_writable(wanted.parent, "runs")
    rooms, held_out = two_parts(config.room.type, config.room.item, config.data, config.fold)
    for part in filter(NEEDS_ROOMS.__contains__, config.parts):
        NEEDS_ROOMS[part](config, rooms)
    folder = make_folder(wanted)
    about = machine(device)
    measured: dict[str, dict[str, Any]] = {}
    for part in config.parts:
        print(f"measuring {part}", flush=True)
        measured[part] = PARTS[part](config, *(list(map(fresh, each)) for each in (rooms, held_out)), device)
        write_json(folder / "bench.json", {"machine": about, "config": asdict(config), **measured})
    if "growth" in measured:
        plot(measured["growth"]).savefig(folder / "growth.png", dpi=120)
    print(table(about, measured))
    print(f"wrote {folder}")
    return folder


def fresh(room: Room) -> Room:
    """Return a copy of a room without cached values: rooms, openings and items cache what is derived from them."""
    return replace(room, openings=tuple(map(replace, room.openings)), furniture=tuple(map(replace, room.furniture)))


main = command("bench", BenchConfig, run)

if __name__ == "__main__":
    main()
