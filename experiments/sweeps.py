"""What the scripts of the tables share: which cells they ask for, and how these are filled in parallel."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import torch
from cell_config import SEEDLESS, CellConfig, table_folder

from layoutrl import InputError
from layoutrl.runs.commands import groups, nearest
from layoutrl.runs.config import config_directory, expanded
from layoutrl.runs.wording import options

TIMED = ("regressor", "pointer", "scorer", "planit")  # columns that are trained for as long as the agent
# Episodes do not climb or snap into line where most cells were filled before they could: all are to be alike.
ENDS = {"method.climbs": "0", "method.snap": "0"}


def multirun(table: str, chosen: Mapping[str, str]) -> int:
    """Fill the cells of a sweep, given as option values by name. Return the exit status: not 0 if a cell failed."""
    overrides = [f"{name}={value}" for name, value in chosen.items()]
    command = [sys.executable, str(Path(__file__).resolve().with_name("cells.py")), f"table={table}", *overrides]
    folder, began, status, filled_before = cells_of(table, chosen), time.time(), 1, -1
    # On this machine a job that is killed takes the others with it: try again, as long as each attempt finishes a cell.
    while status and (filled_now := len(list(folder.glob("*.json")))) > filled_before:
        filled_before, status = filled_now, subprocess.run(command, check=False).returncode
        if "hydra/launcher" in chosen:  # a cluster's jobs are on their own
            break
    failed = [error for error in sorted(folder.glob("*.error")) if error.stat().st_mtime >= began]
    for error in failed:
        print(f"{error.stem} failed: {error.read_text(encoding='utf-8').splitlines()[-1]}", file=sys.stderr)
    return abs(status) or int(bool(failed))  # less than 0: the number of the signal that ended it


def some_of(name: str, chosen: Mapping[str, str], known: Iterable[str]) -> list[str]:
    """Return the values that were chosen for an option, by default all. Raises InputError for unknown ones."""
    every = list(known)
    values = chosen.get(name, ",".join(every)).split(",")
    if unknown := sorted({*values} - {*every}):
        raise InputError(f"{name}: expected some of {','.join(every)}; got {','.join(unknown)}")
    return values


def in_turn(columns: str) -> list[str]:
    """Split columns into sweeps: those without a seed, the others, and last those trained for as long as the agent."""
    given = columns.split(",")
    seedless = [column for column in given if column in SEEDLESS]
    timed = [column for column in given if column in TIMED]
    others = [column for column in given if column not in (*SEEDLESS, *TIMED)]
    return [",".join(group) for group in (seedless, others, timed) if group]


def has_gpu_or_cluster(chosen: Mapping[str, str]) -> bool:
    """Whether there is a GPU or a cluster to train the paper's network in every type and with every seed."""
    return torch.cuda.is_available() or "hydra/launcher" in chosen


def seeds_of(columns: str, usual: str, chosen: Mapping[str, str]) -> str:
    """Return the seeds of a sweep: those that were chosen or the usual ones; with budget=smoke, the first of these.

    If no column depends on the seed it is 0, and a line is printed if others were chosen.
    """
    if {*columns.split(",")} <= {*SEEDLESS}:
        if chosen.get("seed", "0") != "0":
            print(f"{columns}: seed={chosen['seed']} is left out, since nothing is drawn; one cell each, seed 0")
        return "0"
    return chosen.get("seed", usual.split(",")[0] if chosen.get("budget") == "smoke" else usual)


def cells_of(table: str, chosen: Mapping[str, str]) -> Path:
    """Return the folder of a table's cells, for the chosen results folder and budget."""
    return table_folder(chosen.get("results"), chosen.get("budget", "default"), table)


def parsed_options(arguments: Sequence[str], *own: str) -> dict[str, str]:
    """Parse name=value arguments: options of cells, and the script's `own`. Raises InputError for anything else, before
    a sweep begins.
    """
    for argument in arguments:
        if "=" not in argument:
            raise InputError(f"{argument}: expected options as name=value; --help says which")
    pairs = (argument.split("=", 1) for argument in arguments)
    chosen = {name: expanded(value) for name, value in pairs}  # only paths begin with ~
    known = [*(group for group in groups("cell") if group != "task"), *options(CellConfig), *own]
    for name in chosen:
        if name not in known and not name.startswith("hydra"):
            raise InputError(f"{name}: unknown; {nearest(name, known)}")
    some_of("column", chosen, sorted(file.stem for file in Path(config_directory(), "column").glob("*.yaml")))
    return chosen


def command_line(script: str | None) -> list[str]:
    """Return the command line's arguments; with --help, print the script's docstring and exit."""
    if {"-h", "--help"} & set(sys.argv):
        print(script)
        sys.exit()
    return sys.argv[1:]


def sweeps_of(
    sweep: Mapping[str, str],
    columns: Sequence[str],
    rooms: Sequence[str],
    column: str,
    option: str,
    values: Mapping[str, str],
) -> list[dict[str, str]]:
    """Return the sweeps of columns and rooms, where one column has other values of an option in some of the rooms."""
    special = [room for room in rooms if room in values and column in columns]
    made = []
    if usual := [room for room in rooms if room not in special]:
        made.append({**sweep, "column": ",".join(columns), "room": ",".join(usual)})
    for room in special:
        for each in columns:
            more = {option: values[room]} if each == column else {}
            made.append(more | {**sweep, "column": each, "room": room})
    return made
