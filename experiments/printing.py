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

from layoutrl.evaluation.statistics import bootstrap_interval, paired_p_value

NOT_RUN = "not run"


@dataclass(frozen=True)
class Row:
    """One set of places in one task, over all seeds that were run."""

    iou: np.ndarray  # (seeds, B)
    group: np.ndarray  # (B,)
    numbers: list[dict[str, Any]]  # of each seed
    cells: list[dict[str, Any]]

    @property
    def mean(self) -> float:
        return float(self.iou.mean())

    def text(self) -> str:
        """Mean ± standard deviation over rooms."""
        return f"{self.mean:.3f} ± {self.iou.std():.3f}"

    def error_over_seeds(self) -> str:
        means = self.iou.mean(1)
        return f"{means.std(ddof=1) / np.sqrt(len(means)):.4f}" if len(means) > 1 else "-"

    def interval(self) -> str:
        """95%, of the mean, over rooms."""
        low, high = bootstrap_interval(self.iou.mean(0), self.group, np.random.default_rng(0))
        return f"{low:.3f} to {high:.3f}"

    def p_value(self, other: Row) -> str:
        """Paired: the same rooms and starts."""
        p = paired_p_value(self.iou.mean(0), other.iou.mean(0), self.group, np.random.default_rng(0))
        return "< 0.001" if p < 0.001 else f"{p:.3f}"

    def number(self, name: str) -> float:
        """Mean over seeds."""
        return float(np.mean([numbers[name] for numbers in self.numbers]))


def row(folder: Path, name: str, row: str = "agent") -> Row | None:
    """A row of the cells <name>-seed<k>.json, or None where there is none."""
    cells = [json.loads(file.read_text()) for file in sorted(folder.glob(f"{name}-seed*.json"))]
    if not cells:
        return None
    found = [cell["rows"][row] for cell in cells]
    iou = np.stack([unpacked(numbers["iou"], IOU) / 65535 for numbers in found])
    group = unpacked(found[0]["group"], INDEX)
    # Starts in one scene are independent of each other.
    return Row(iou, group if len(set(group)) > 1 else np.arange(len(group)), found, cells)


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
            for sign, command in (("%", r"\%"), ("_", r"\_"), ("±", r"$\pm$"), (">=", r"$\ge$"), ("<", "$<$")):
                text = text.replace(sign, command)
            return text

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
    text = "\n".join(table.markdown() for table in tables)
    stem.with_suffix(".md").write_text(text, encoding="utf-8")
    stem.with_suffix(".tex").write_text("\n".join(table.latex() for table in tables), encoding="utf-8")
    with stem.with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        for table in tables:
            csv.writer(file).writerows([[table.title], table.header, *table.lines, []])
    print(f"\n{text}\nwrote {stem.with_suffix('.md')}, .tex and .csv")


def minutes(rows: Sequence[Row | None]) -> str:
    """When, where and how long the cells were filled."""
    cells = [cell for row in rows if row for cell in row.cells]
    if not cells:
        return "nothing is run yet"
    dates = sorted({cell["date"] for cell in cells})
    about = [cell["machine"] for cell in cells]
    machines = sorted({machine["gpu"] or f"{machine['cpu']}, {machine['cores']} cores" for machine in about})
    total = sum(cell["minutes"] for cell in cells)
    return f"{len(cells)} cells, {total:.0f} core minutes, {' and '.join(dates)}, {' and '.join(machines)}"
