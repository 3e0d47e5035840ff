"""What a user sees while an agent trains and after: progress bar, metrics.csv, TensorBoard (docs/tensorboard.md)."""

from __future__ import annotations

import csv
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Never, Protocol

import numpy as np
from tensorboard.compat.proto.event_pb2 import Event, SessionLog
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.record_writer import RecordWriter
from torch.utils.tensorboard.summary import custom_scalars, hparams, image, scalar, text
from tqdm import tqdm

from layoutrl import InputError
from layoutrl.agents.training import Progress, Training

STAGES = ("act", "simulate", "store", "sample", "learn")
CURVES = [  # of an agent's training
    *(name for name in Progress.__dataclass_fields__ if name != "seconds"),
    *(f"seconds/{stage}" for stage in STAGES),
]
BAR = {  # what the progress bar says, beside losses
    "moves": "moves",
    "epsilon": "eps",
    "loss": "loss",
    "iou/held_out": "held_out",
    "lattice_ceiling/held_out": "ceiling",
}
# Evaluates the agent: numbers by name, "iou" among them, and pictures.
Probe = Callable[[], tuple[dict[str, float], list[np.ndarray]]]
Board = Callable[[Summary, int], None]  # shows a summary at so many updates
LONGEST = 10_000  # characters in a line of metrics.csv
FINAL = (  # of evaluation.json: of one item, of whole rooms, or of both
    "mean_iou", "median_iou", "share_090", "facing", "faultless", "overlap", "outside", "blocked", "reached", "fronts",
)  # fmt: skip
# Charts in TensorBoard's tab of custom scalars: curves to be read together.
LAYOUT = {
    "learning": {
        "IoU": ["Multiline", ["iou/train", "iou/held_out", "lattice_ceiling/held_out", "episode_iou"]],
        "Q": ["Multiline", ["mean_q", "max_q"]],
        "loss": ["Multiline", ["loss"]],
        "epsilon": ["Multiline", ["epsilon"]],
    },
    "speed": {"seconds between two reports, by stage": ["Multiline", [f"seconds/{stage}" for stage in STAGES]]},
}


class Reporting(Protocol):
    """A training: iterating yields reports, dataclasses of `updates` and other numbers or dicts of numbers."""

    @property
    def updates(self) -> int: ...

    def __iter__(self) -> Iterator[Any]: ...


def watched(
    training: Training,
    probes: dict[str, Probe],
    folder: Path,
    updates: int,
    evaluations: int,
) -> Iterator[float]:
    """Train an agent, and yield, as `reported` does.

    The probes are named "train" and "held_out".
    """

    def look(board: Board, made: int) -> dict[str, float]:
        found: dict[str, float] = {}
        for name, probe in probes.items():
            numbers, pictures = probe()
            found |= {f"{tag}/{name}": value for tag, value in numbers.items()}
            for k, picture in enumerate(pictures):
                board(image(f"{name}/{k}", picture, dataformats="HWC"), made)
        return found

    yield from reported(training, CURVES, look, folder, updates, evaluations, LAYOUT)


def reported(
    training: Reporting,
    curves: Sequence[str],
    look: Callable[[Board, int], dict[str, float]],
    folder: Path,
    updates: int,
    evaluations: int,
    layout: dict[str, Any] | None = None,
) -> Iterator[float]:
    """Train and show every report; evaluate at about `evaluations` of them, and the last, and yield iou/train.

    A training that ends at another update than `updates`, as one limited by seconds does, is not evaluated for that.
    `curves` are the tags of a report's numbers. `look` evaluates: it returns numbers by tag, iou/train and iou/held_out
    among them, and may show more on the board. metrics.csv has a column for each curve and these two. What the folder
    shows of later updates than the training has made is dropped. Raises InputError if a loss is not finite.
    """
    made, evaluate_every = training.updates, max(1, updates // evaluations)
    tags = {tag: tag.replace("/", "_") for tag in (*curves, "iou/train", "iou/held_out")}
    said: dict[str, float] = {}  # in the progress bar
    with shown(folder, list(tags.values()), made, updates) as (board, rows, bar, before):
        if layout and not made:
            board(custom_scalars(layout), 0)
        for report in training:
            found: dict[str, Any] = flat(vars(report), between="/")
            for tag, value in found.items():
                if is_loss(tag) and not math.isfinite(value):
                    raise InputError(
                        f"method: the {tag} is {value} after {report.updates} updates; expected a number: begin "
                        "another run with a lower method.learning_rate"
                    )
            evaluates = report.updates // evaluate_every > before // evaluate_every or report.updates == updates
            before = report.updates
            if evaluates:
                found |= look(board, report.updates)
            for tag, value in found.items():
                board(scalar(tag, value), report.updates)
            known = {tag: value for tag, value in found.items() if not math.isnan(value)}  # before an episode ends
            rows.writerow({column: known.get(tag, "") for tag, column in tags.items()})
            bar.update(report.updates - bar.n)
            said |= {BAR.get(tag, tag): value for tag, value in found.items() if tag in BAR or is_loss(tag)}
            bar.set_postfix(said)
            if evaluates:
                yield found["iou/train"]


@contextmanager
def shown(
    folder: Path, header: Sequence[str], made: int, updates: int
) -> Iterator[tuple[Board, csv.DictWriter[str], tqdm[Never], int]]:
    """Open TensorBoard, metrics.csv and the progress bar of a training; yield these and the update of the last row.

    What the folder shows of later updates than `made` is dropped.
    """
    with (
        board_of(folder, purged_from=made + 1) as board,
        metrics(folder / "metrics.csv", header, made) as (rows, before),
        tqdm(total=updates, initial=made, unit="update", dynamic_ncols=True, disable=sys.stderr is None) as bar,
    ):
        if not made:
            board(text("config", f"```yaml\n{(folder / 'config.yaml').read_text(encoding='utf-8')}```"), 0)
        yield board, rows, bar, before


@contextmanager
def board_of(folder: Path, purged_from: int | None = None) -> Iterator[Board]:
    """Open a new file for TensorBoard, which drops what earlier files show from the update `purged_from` on.

    Torch's SummaryWriter would write in a thread of its own, where an error, as on a full disk, ends in a traceback.
    """
    with (folder / f"events.out.tfevents.{time.time_ns()}").open("xb") as file:
        records = RecordWriter(file)

        def written(event: Event) -> None:
            event.wall_time = time.time()
            records.write(event.SerializeToString())
            file.flush()

        written(Event(file_version="brain.Event:2"))
        if purged_from is not None:
            written(Event(step=purged_from, session_log=SessionLog(status=SessionLog.START)))
        yield lambda summary, updates: written(Event(step=updates, summary=summary))


@contextmanager
def metrics(path: Path, header: Sequence[str], made: int) -> Iterator[tuple[csv.DictWriter[str], int]]:
    """Open a table to go on after `made` updates, later rows dropped; yield its writer and the last row's updates."""
    partial, before = path.with_suffix(".partial"), 0
    try:
        with partial.open("w", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, header).writeheader()
            for updates, line in kept_lines(path, header, made):
                file.write(line)
                before = updates
        partial.replace(path)
    finally:
        partial.unlink(missing_ok=True)
    with path.open("a", newline="", encoding="utf-8", buffering=1) as file:  # a line at a time
        yield csv.DictWriter(file, header), before


def kept_lines(path: Path, header: Sequence[str], made: int) -> Iterator[tuple[int, str]]:
    """Yield (updates, line) for each row of a table up to `made` updates; if one is damaged, say so and end there.

    At most one row is in memory at once.
    """
    if not made or not path.exists():
        return
    with path.open(newline="", encoding="utf-8", errors="replace") as file:
        damaged = file.readline(LONGEST).rstrip("\r\n") != ",".join(header)
        number, before = 1, 0
        while not damaged and (line := file.readline(LONGEST)):
            number += 1
            first, *others = line.rstrip("\r\n").split(",")
            try:
                updates = int(first)
                [float(value) for value in others if value]
            except ValueError:
                updates = 0
            damaged = updates <= before or len(others) != len(header) - 1 or not line.endswith("\n")
            if not damaged:
                if updates > made:
                    return
                before = updates
                yield updates, line
    if damaged:
        print(f"{path} is damaged in line {number}; what it says from there on is left out")


def record_result(folder: Path, settings: dict[str, Any], result: dict[str, Any], updates: int) -> None:
    """Show a run's evaluation beside its settings, so that TensorBoard's table of hyper-parameters compares runs."""
    rows = result["rows"]["agent"]
    final = {f"final/{name}": float(rows[name]) for name in FINAL if rows.get(name) is not None}
    others = [name for name in ("lattice_ceiling", "moves", "ms_a_start", "ms_a_room") if name in result]
    final |= {f"final/{name}": float(result[name]) for name in others}
    shown = {name: value for name, value in flat(settings).items() if isinstance(value, bool | int | float | str)}
    with board_of(folder) as board:
        for summary in hparams(shown, final):
            board(summary, 0)
        for tag, value in final.items():
            board(scalar(tag, value), updates)


def is_loss(tag: str) -> bool:
    """Whether a curve is of a loss: `loss`, or one of several, as `loss/orient`."""
    return tag.split("/")[0] == "loss"


def flat(settings: dict[str, Any], prefix: str = "", between: str = ".") -> dict[str, Any]:
    """Flatten nested settings: names joined with `between`, lists as text."""
    found: dict[str, Any] = {}
    for name, value in settings.items():
        if isinstance(value, dict):
            found |= flat(value, f"{prefix}{name}{between}", between)
        else:
            found[prefix + name] = str(value) if isinstance(value, list) else value
    return found
