"""What experiments share: the folder of results, the options of those on one room type, and reporting."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from layoutrl import InputError
from layoutrl.env.measures import measured
from layoutrl.evaluation.layouts import summary
from layoutrl.evaluation.statistics import standard_error
from layoutrl.rooms.room import MAIN_ITEM, Room
from layoutrl.runs.files import write_json
from layoutrl.runs.ranges import within

RESULTS = Path(__file__).parent / "results"
MEASURES = ("iou", "facing", "faultless")


def check_kept(file: Path, about: Mapping[str, Any]) -> None:
    """Raise InputError if the file holds results with other settings than `about`, so that they are not overwritten."""
    if file.exists():
        kept = json.loads(file.read_text(encoding="utf-8"))
        if others := [name for name, value in about.items() if kept.get(name) != value]:
            raise InputError(f"{file} is of other {', '.join(others)}; expected the same, or to be moved away first")


def parser_of(description: str | None) -> argparse.ArgumentParser:
    """Return a parser of a command line whose --help shows the description as it is written."""
    return argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)


def options(description: str | None, *, rooms: int, seed: int, results: Path) -> argparse.Namespace:
    """Parse the command line (`room_type`, `rooms`, `seed` and `results`), and make the folder `results`.

    Raises InputError for a number out of range, and if the folder has results of other rooms or another seed.
    """
    parser = parser_of(description)
    parser.add_argument("room_type", choices=list(MAIN_ITEM))
    parser.add_argument("--rooms", type=int, default=rooms, help="how many of them count")
    parser.add_argument("--seed", type=int, default=seed, help="of the designs, none of which was learned from")
    parser.add_argument("--results", type=Path, default=results, help="folder of the file that is written")
    said = parser.parse_args()
    within("--rooms", said.rooms, said.rooms >= 1, "1 or more")
    within("--seed", said.seed, said.seed >= 0, "0 or more")
    check_kept(said.results / f"{said.room_type}.json", {"rooms": said.rooms, "seed": said.seed})
    said.results.mkdir(parents=True, exist_ok=True)
    return said


def means_over_rooms(values: Mapping[str, Sequence[float] | np.ndarray]) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield mean, standard error and number of each name's values that are not NaN.

    Without any, mean and error are None; so is the error of a single value.
    """
    for name, those in values.items():
        known = np.array(those)[~np.isnan(those)]
        mean, error = (
            (float(known.mean()), standard_error(known, np.arange(len(known)))) if len(known) else (None, None)
        )
        yield name, {"mean": mean, "standard_error": error, "rooms": len(known)}


def print_and_write(said: argparse.Namespace, found: Iterable[tuple[str, Any]], **about: Any) -> None:
    """Print each (name, result) as soon as it is found, and write them all, with `about`, to <type>.json."""
    result: dict[str, Any] = {"rooms": said.rooms, "seed": said.seed} | about
    for name, row in found:
        result[name] = row
        print(f"{said.room_type}, {name}: {json.dumps(row)}", flush=True)
    write_json(said.results / f"{said.room_type}.json", result)


def numbers(layouts: Sequence[Room], designs: Sequence[Room]) -> dict[str, Any]:
    """Return mean and standard error of the MEASURES of layouts, compared with the designer's."""
    found = summary(measured(layouts, designs))
    return {name: found[name] for name in MEASURES}
