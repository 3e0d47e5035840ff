"""Tables, from the files of filled cells and from nothing else: as text, Markdown, CSV and LaTeX."""

from __future__ import annotations

import csv
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from cells import INDEX, IOU, unpacked
from columns import refuse_other_rooms

from layoutrl import InputError
from layoutrl.evaluation.statistics import bootstrap_interval, paired_p_value
from layoutrl.runs.folder import differences

NOT_RUN = "not run"


@dataclass(frozen=True)
class Row:
    """One set of places in one setting, over all seeds that were run."""

    iou: np.ndarray  # (seeds, B)
    group: np.ndarray  # (B,)
    numbers: list[dict[str, Any]]  # of each seed
    cells: dict[Path, dict[str, Any]]

    @property
    def mean(self) -> float:
        return float(self.iou.mean())

    def text(self) -> str:
        """Mean ± standard deviation over rooms."""
        return f"{self.mean:.3f} ± {self.iou.std():.3f}"

    def ceiling(self) -> str:
        """The lattice ceiling of its moves, from its starts."""
        return f"{np.mean([cell['ceiling'] for cell in self.cells.values()]):.3f}"

    def error_over_seeds(self) -> str:
        means = self.iou.mean(1)
        return f"{means.std(ddof=1) / np.sqrt(len(means)):.4f}" if len(means) > 1 else "-"

    def interval(self) -> str:
        """95%, of the mean, over rooms."""
        low, high = bootstrap_interval(self.iou.mean(0), self.group, np.random.default_rng(0))
        return f"{low:.3f} to {high:.3f}"

    def p_value(self, other: Row) -> str:
        """Paired. Raises InputError where the rooms are not the same."""
        (ours, *_), (theirs, *_) = self.cells.items(), other.cells.items()
        refuse_other_rooms(f"{ours[0].stem} and {theirs[0].stem}", ours[1]["config"], theirs[1]["config"])
        p = paired_p_value(self.iou.mean(0), other.iou.mean(0), self.group, np.random.default_rng(0))
        return "< 0.001" if p < 0.001 else f"{p:.3f}"

    def number(self, name: str) -> float:
        """Mean over seeds."""
        return float(np.mean([numbers[name] for numbers in self.numbers]))

    def about(self, name: str) -> float | None:
        """Mean over seeds of what a cell says beside its rows, if it does."""
        said = [cell[name] for cell in self.cells.values() if name in cell]
        return float(np.mean(said)) if said else None


def row(folder: Path, name: str, which: str = "agent") -> Row | None:
    """A row of the cells <name>-seed<k>.json; None where there is no such cell, or they have no such row.

    Raises InputError for cells of one name that were filled with different configurations.
    """
    cells = {file: json.loads(file.read_text()) for file in sorted(folder.glob(f"{name}-seed*.json"))}
    cells = {file: cell for file, cell in cells.items() if which in cell["rows"]}
    if not cells:
        return None
    first, *others = cells.values()
    if other := {name for cell in others for name in differences(first["config"], cell["config"])} - {"seed"}:
        raise InputError(f"{folder / name}: cells of different {', '.join(sorted(other))}; delete those of one")
    numbers = [cell["rows"][which] for cell in cells.values()]
    iou = np.stack([unpacked(seed["iou"], IOU) / 65535 for seed in numbers])
    # Starts in one scene are independent of each other.
    scene = first["config"]["protocol"] == "scene"
    group = np.arange(iou.shape[1]) if scene else unpacked(numbers[0]["group"], INDEX)
    return Row(iou, group, numbers, cells)


def text(found: Row | None, missing: str = NOT_RUN) -> str:
    return found.text() if found else missing


@dataclass(frozen=True)
class Table:
    title: str
    header: Sequence[str]
    lines: Sequence[Sequence[str]]

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


def write(tables: Sequence[Table], stem: Path) -> None:
    """Write the tables as stem.md, .tex and .csv, and print them."""
    stem.parent.mkdir(parents=True, exist_ok=True)
    markdown = "\n".join(table.markdown() for table in tables)
    stem.with_suffix(".md").write_text(markdown, encoding="utf-8")
    stem.with_suffix(".tex").write_text("\n".join(table.latex() for table in tables), encoding="utf-8")
    with stem.with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        for table in tables:
            csv.writer(file).writerows([[table.title], table.header, *table.lines, []])
    print(f"\n{markdown}\nwrote {stem.with_suffix('.md')}, .tex and .csv")


def provenance(rows: Sequence[Row | None]) -> str:
    """When, where and with which version the cells were filled, and how long was trained for them."""
    cells = {file: cell for found in rows if found for file, cell in found.cells.items()}.values()
    machines = [cell["machine"] for cell in cells]
    dates = sorted({cell["date"] for cell in cells})
    hardware = sorted({machine["gpu"] or f"{machine['cpu']}, {machine['cores']} cores" for machine in machines})
    versions = sorted({f"layoutrl {machine['layoutrl']}" for machine in machines})
    # Cells that share a training, as those of two label sets may, have its seconds to the last digit.
    trainings = {(c["config"]["column"], c["config"]["seed"], c.get("training_seconds", 0)) for c in cells}
    minutes = sum(seconds for *_, seconds in trainings) / 60
    return "; ".join([f"{len(cells)} cells, {minutes:.0f} minutes of training", *dates, *hardware, *versions])
