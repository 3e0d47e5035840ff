"""Tables, from the files of filled cells and from nothing else: Markdown and LaTeX for people, CSV for programs."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from string import Formatter
from typing import Any

import numpy as np
from cell_config import compared_part, refuse_other_rooms
from packing import INDEX, unpacked, unpacked_iou

from layoutrl import InputError
from layoutrl.evaluation.statistics import bootstrap_interval, paired_p_value
from layoutrl.runs.files import write_json
from layoutrl.runs.folder import differences

NOT_RUN = "not run"
Record = Mapping[str, Any]  # one row of a CSV: a number or a name in each column, None where it was not run

# What the columns of the CSV files mean, in the order in which they stand.
FIELDS = {
    "room": "room type",
    "item": "the item that moves",
    "labels": "snapped: furniture is moved to the wall beside it, test rooms included; raw: as annotated",
    "trained": "for as many minutes as the agent took when this was measured, or for a fixed number of updates",
    "method": "what places the item",
    "trained_on": "which rooms the agent learned from",
    "told": "what PlanIT is told, and whether the size of the item is its own choice or the true one",
    "training_rooms": "how many rooms it learned from; a room counts once for each such item in it",
    "mean_iou": "mean IoU of the final position and the designer's, over n and seeds",
    "sd": "standard deviation of the IoU over n and seeds; of what is printed by Di & Yu, as they print it",
    "standard_error": "of the mean, over rooms",
    "n": "rooms, or starts, that each seed is scored in; the paper does not say how many",
    "seeds": "training seeds; of a single room, rooms",
    "se_over_seeds": "standard error of the mean over training seeds",
    "interval_low": "lower end of the 95% bootstrap interval of the mean, over rooms",
    "interval_high": "upper end of it",
    "p_regressor": "p-value of the difference to the supervised regressor, paired permutation test over rooms",
    "p_pointer": "p-value of the difference to the supervised pointer, the same test",
    "p_agent": "p-value of the difference to the agent trained on real rooms, the same test",
    "median_iou": "median IoU over rooms",
    "share_090": "share of rooms with an IoU of 0.9 or more",
    "best_of_3_mean_iou": "mean IoU of the best of the first three stopping places, chosen by knowledge of the answer",
    "best_of_3_sd": "standard deviation of it",
    "iou_error": "standard error of the mean IoU, over rooms",
    "p_iou": "p-value of the IoU's difference to the best rival's, paired permutation test over the rooms of both",
    "facing": "share of items that face as the designer's do, but for those that look alike from all sides",
    "faultless": "share of rooms in which nothing is missing, overlaps, stands out, blocks, is unreached or shut in",
    "faultless_error": "standard error of it, over rooms",
    "p_faultless": "p-value of its difference to the rival's that is best in it, the same test",
    "missing": "share of items without a place",
    "overlap": "share of the item that other furniture covers; of whole rooms, of items that overlap",
    "outside": "share of the item that is not indoors; of whole rooms, of items that stand out",
    "blocked": "share of rooms in which the item blocks a door or window; of whole rooms, of items that do",
    "reached": "share of items that who enters reaches",
    "fronts": "share of items with a front that is free",
    "overlap_area": "share of an item that other furniture covers",
    "outside_area": "share of an item that is not indoors",
    "walkable": "share of the free floor that is connected with the door (PhyScene)",
    "reach": "share of items reached from connected floor (PhyScene)",
    "moved": "metres from the designer's place, mean over matched items",
    "seconds": "core-seconds a room, without what is learned before",
    "training_minutes": "minutes of training of one seed",
    "updates": "updates of the network in training, of one seed",
    "moves": "moves of a greedy episode",
}
MEASURED = ("mean_iou", "sd", "n", "seeds")


@dataclass(frozen=True)
class Row:
    """The rows of one name in the cells of one setting: the results of one method, over all seeds that were run."""

    iou: np.ndarray  # (seeds, B)
    group: np.ndarray  # (B,)
    numbers: list[dict[str, Any]]  # of each seed, its row
    cells: dict[Path, dict[str, Any]]  # by file

    @property
    def mean(self) -> float:
        return float(self.iou.mean())

    def estimate(self, **more: float | None) -> Estimate:
        """Return mean and standard deviation of the IoU over rooms and seeds, how many these are, and `more`."""
        seeds, n = self.iou.shape
        return Estimate({"mean_iou": self.mean, "sd": float(self.iou.std()), "n": n, "seeds": seeds, **more}, self)

    def ceiling(self) -> Estimate:
        """Return the mean lattice ceiling of the moves, from the starts of these cells."""
        return Estimate({"mean_iou": float(np.mean([cell["ceiling"] for cell in self.cells.values()]))}, self)

    def error_over_seeds(self) -> float | None:
        means = self.iou.mean(1)
        return float(means.std(ddof=1) / np.sqrt(len(means))) if len(means) > 1 else None

    @cached_property
    def interval(self) -> dict[str, float]:
        """The 95% bootstrap interval of the mean, over rooms."""
        low, high = bootstrap_interval(self.iou.mean(0), self.group, seed=0)
        return {"interval_low": low, "interval_high": high}

    def interval_text(self) -> str:
        return "{interval_low:.3f} to {interval_high:.3f}".format(**self.interval)

    def check_same_rooms(self, other: Row) -> None:
        """Raise InputError where the two are not scored in the same rooms."""
        (ours, *_), (theirs, *_) = self.cells.items(), other.cells.items()
        refuse_other_rooms(f"{ours[0].stem} and {theirs[0].stem}", ours[1]["config"], theirs[1]["config"])

    def p_value(self, other: Row) -> float:
        """Return the p-value of the difference to another row, paired by room. Raises InputError if rooms differ."""
        self.check_same_rooms(other)
        return paired_p_value(self.iou.mean(0), other.iou.mean(0), self.group, seed=0)

    def number(self, name: str) -> float:
        """Return a number of the row, the mean over seeds."""
        return float(np.mean([numbers[name] for numbers in self.numbers]))

    def about(self, name: str) -> float | None:
        """Return a number that cells have beside their rows, the mean over seeds; None if no cell has it."""
        said = [cell[name] for cell in self.cells.values() if name in cell]
        return float(np.mean(said)) if said else None


def row(folder: Path, name: str, which: str = "agent") -> Row | None:
    """Return a row of the cells <name>-seed<k>.json; None if there are no such cells, or they have no such row.

    Raises InputError for cells of one name that were filled with different configurations.
    """
    cells = {file: json.loads(file.read_text(encoding="utf-8")) for file in sorted(folder.glob(f"{name}-seed*.json"))}
    cells = {file: cell for file, cell in cells.items() if which in cell["rows"]}
    if not cells:
        return None
    first, *others = (compared_part(cell["config"]) for cell in cells.values())
    if other := {name for config in others for name in differences(first, config)} - {"seed"}:
        raise InputError(f"{folder / name}: cells of different {', '.join(sorted(other))}; delete those of one")
    numbers = [cell["rows"][which] for cell in cells.values()]
    iou = np.stack([unpacked_iou(seed["iou"]) for seed in numbers])
    # Starts in one scene are independent of each other.
    scene = first["protocol"] == "scene"
    group = np.arange(iou.shape[1]) if scene else unpacked(numbers[0]["group"], INDEX)
    return Row(iou, group, numbers, cells)


@dataclass(frozen=True)
class Estimate:
    """A mean IoU, further numbers about it, and the row that it comes from; figures of the paper have no row."""

    numbers: Record
    row: Row | None = None

    def text(self) -> str:
        """Mean ± standard deviation, or with its standard error in brackets."""
        mean = f"{self.numbers['mean_iou']:.3f}"
        if (error := self.numbers.get("standard_error")) is not None:
            return f"{mean} ({error:.3f})"
        return mean if (sd := self.numbers.get("sd")) is None else f"{mean} ± {sd:.3f}"


@dataclass(frozen=True)
class Table:
    """The answer to one question: `header` and `lines` for people, `fields` and `records` for programs."""

    name: str  # of its CSV and JSON files
    title: str
    header: Sequence[str]
    lines: Sequence[Sequence[str]]
    fields: Sequence[str]
    records: Sequence[Record]
    rows: Sequence[Row]  # that it is made from

    def markdown(self) -> str:
        rule = ["---"] * len(self.header)
        rows = "\n".join(f"| {' | '.join(line)} |" for line in (self.header, rule, *self.lines))
        return f"**{self.title}**\n\n{rows}\n"

    def latex(self) -> str:
        def tex(text: str) -> str:
            for sign, command in (("&", r"\&"), ("%", r"\%"), ("_", r"\_"), ("±", r"$\pm$"), (">=", r"$\ge$")):
                text = text.replace(sign, command)
            return text.replace("<", "$<$")

        rows = [" & ".join(map(tex, line)) + r" \\" for line in (self.header, *self.lines)]
        body = "\n".join([r"\hline", rows[0], r"\hline", *rows[1:], r"\hline"])
        columns = "l" + "r" * (len(self.header) - 1)
        return (
            f"\\begin{{table}}\n\\centering\n\\begin{{tabular}}{{{columns}}}\n{body}\n\\end{{tabular}}\n"
            f"\\caption{{{tex(self.title)}}}\n\\end{{table}}\n"
        )


def estimates(rows: Iterable[Row | None]) -> list[Estimate | None]:
    return [found.estimate() if found else None for found in rows]


def ceiling(found: Row | None) -> Estimate | None:
    return found.ceiling() if found else None


def compared(
    name: str,
    title: str,
    keys: Sequence[str],
    columns: Sequence[str],
    lines: Sequence[tuple[Sequence[str], Sequence[Estimate | str | None]]],
    by: str = "method",
) -> Table:
    """Make a table with a line for each setting and a column for each method.

    A line is (the setting: a value for each key; an entry for each column). An entry is None if nothing was run. A text
    is shown, but not written to the CSV, which has a row for each setting and method; `by` is its field of the method.
    """
    shown, records, rows = [], [], []
    for setting, entries in lines:
        texts = (NOT_RUN if entry is None else entry if isinstance(entry, str) else entry.text() for entry in entries)
        shown.append([*(value.replace("_", " ") for value in setting), *texts])
        for method, entry in zip(columns, entries, strict=True):
            if not isinstance(entry, str):
                numbers = entry.numbers if entry else {}
                records.append({**dict(zip(keys, setting, strict=True)), by: method, **numbers})
                rows += [entry.row] if entry and entry.row else []
    known = {*keys, by, *MEASURED}.union(*records)
    return Table(name, title, ["", *keys[1:], *columns], shown, [f for f in FIELDS if f in known], records, rows)


def listed(name: str, title: str, columns: Mapping[str, str], records: Sequence[Record], rows: Sequence[Row]) -> Table:
    """Make a table with a line a record; a column is a template of str.format, with the conversion !p for p-values.

    The CSV has the fields that the templates name and, where records have them, those of MEASURED.
    """
    named = [field for template in columns.values() for _, field, *_ in Formatter().parse(template) if field]
    lines = [[Shown().vformat(template, (), record) for template in columns.values()] for record in records]
    fields = dict.fromkeys([*named, *(field for field in MEASURED if any(field in record for record in records))])
    return Table(name, title, list(columns), lines, list(fields), records, rows)


class Shown(Formatter):
    """A formatter that shows None as a dash, and as a single dash a text all of whose fields are None."""

    def vformat(self, template: str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> str:
        named = [field for _, field, *_ in self.parse(template) if field]
        return super().vformat(template, args, kwargs) if any(kwargs[field] is not None for field in named) else "-"

    def convert_field(self, value: Any, conversion: Any) -> Any:
        if conversion == "p":
            return value if value is None else p_text(value)
        return super().convert_field(value, conversion)

    def format_field(self, value: Any, spec: str) -> str:
        return "-" if value is None else format(value, spec).replace("_", " ")


def p_text(p: float) -> str:
    return "< 0.001" if p < 0.001 else f"{p:.3f}"


def show(tables: Sequence[Table]) -> None:
    """Print the tables that have lines."""
    for table in tables:
        if table.lines:
            print(f"\n{table.markdown()}")


def write(tables: Sequence[Table], stem: Path) -> None:
    """Write the tables as stem.md and stem.tex, and each as <name>.csv with its provenance in <name>.json beside it."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    made_from = provenance([found for table in tables for found in table.rows])
    files = [stem.with_suffix(".md"), stem.with_suffix(".tex")]
    files[0].write_text(
        "\n".join([*(table.markdown() for table in tables), f"{provenance_line(made_from)}\n"]), encoding="utf-8"
    )
    files[1].write_text("\n".join(table.latex() for table in tables), encoding="utf-8")
    for table in tables:
        with (file := stem.with_name(f"{table.name}.csv")).open("w", newline="", encoding="utf-8") as out:
            writer = csv.DictWriter(out, table.fields, lineterminator="\n")
            writer.writeheader()
            writer.writerows([{name: rounded(record.get(name)) for name in table.fields} for record in table.records])
        columns = {name: FIELDS[name] for name in table.fields}
        write_json(file.with_suffix(".json"), {"title": table.title, "columns": columns, **provenance(table.rows)})
        files.append(file)
    print(f"wrote {', '.join(map(str, files))}")


def rounded(value: str | float | None) -> str | float | None:
    """Round to six decimals: IoU is kept to fewer."""
    return round(value, 6) if isinstance(value, float) else value


def provenance(rows: Sequence[Row]) -> dict[str, Any]:
    """Return which cells these are, when, where and with which versions they were filled, and known training time."""
    cells = {file: cell for found in rows for file, cell in found.cells.items()}
    machines = [cell["machine"] for cell in cells.values()]
    # Cells that share a training, as those of two label sets may, have its seconds to the last digit; it counts once.
    trainings = {
        (c["config"]["column"], c["config"]["seed"], c["training_seconds"])
        for c in cells.values()
        if "training_seconds" in c
    }
    versions = {name: sorted({m[name] for m in machines if name in m}) for name in ("layoutrl", "torch", "numpy")}
    return {
        "minutes_of_training": round(sum(seconds for *_, seconds in trainings) / 60, 1) if trainings else None,
        "dates": sorted({cell["date"] for cell in cells.values()}),
        "machines": sorted({machine["gpu"] or f"{machine['cpu']}, {machine['cores']} cores" for machine in machines}),
        "versions": versions,
        "cells": sorted("/".join(file.parts[-3:]) for file in cells),
    }


def provenance_line(made_from: dict[str, Any]) -> str:
    """A provenance in one line."""
    versions = [f"layoutrl {version}" for version in made_from["versions"]["layoutrl"]]
    cells, minutes = f"{len(made_from['cells'])} cells", made_from["minutes_of_training"]
    if minutes is not None:
        cells += f", {minutes:.0f} minutes of training"
    return "; ".join([cells, *made_from["dates"], *made_from["machines"], *versions])
