"""What a user sees while an agent trains and after: progress bar, metrics.csv, TensorBoard (docs/tensorboard.md)."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Never

from tensorboard.compat.proto.event_pb2 import Event, SessionLog
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.record_writer import RecordWriter
from torch.utils.tensorboard.summary import custom_scalars, hparams, image, scalar, text
from tqdm import tqdm

from layoutrl import InputError
from layoutrl.agents.training import Progress, Training
from layoutrl.evaluation.probe import Probe
from layoutrl.evaluation.protocols import Greedy

COLUMNS = [name for name in Progress.__dataclass_fields__ if name != "seconds"]  # of metrics.csv, the first ones
STAGES = ("act", "simulate", "store", "sample", "learn")
Board = Callable[[Summary, int], None]  # shows a summary at so many updates
LONGEST = 10_000  # characters in a line of metrics.csv
FINAL = ("mean_iou", "median_iou", "share_090", "overlap", "outside", "blocked")  # of evaluation.json
# Curves that are read together: charts of TensorBoard's tab of custom scalars.
LAYOUT = {
    "learning": {
        "IoU": ["Multiline", ["iou/train", "iou/held_out", "lattice_ceiling/held_out", "episode_iou"]],
        "Q": ["Multiline", ["mean_q", "max_q"]],
        "loss": ["Multiline", ["loss"]],
        "epsilon": ["Multiline", ["epsilon"]],
    },
    "speed": {"seconds between two reports, by stage": ["Multiline", [f"seconds/{stage}" for stage in STAGES]]},
}


def watched(
    training: Training,
    policy: Greedy,
    probes: dict[str, Probe],
    folder: Path,
    updates: int,
    evaluate_every: int,
) -> Iterator[float]:
    """Train and show every report; every `evaluate_every` updates and at the end, run the probes and yield.

    `probes` are named: "train" and "held_out", whose pictures and IoU are shown; what is yielded is the first's IoU.
    What the folder shows of later updates than the training has made is dropped. Raises InputError when the loss is no
    number.
    """
    made = training.agent.updates
    held_out = float("nan")
    header = [*COLUMNS, *(f"seconds_{stage}" for stage in STAGES), *(f"iou_{name}" for name in probes)]
    with shown(folder, header, made, updates) as (board, rows, bar, before):
        if not made:
            board(custom_scalars(LAYOUT), 0)
        for progress in training:
            if not math.isfinite(progress.loss):
                raise InputError(
                    f"method: the loss is {progress.loss} after {progress.updates} updates; the last checkpoint is of "
                    "before; expected a lower method.learning_rate"
                )
            row: dict[str, Any] = {name: getattr(progress, name) for name in COLUMNS}
            row |= {f"seconds_{stage}": progress.seconds.get(stage, 0.0) for stage in STAGES}
            for tag, value in row.items():
                board(scalar(tag.replace("seconds_", "seconds/"), value), progress.updates)
            evaluates = progress.updates // evaluate_every > before // evaluate_every or progress.updates == updates
            before = progress.updates
            if evaluates:
                for name, probe in probes.items():
                    iou, pictures = probe(policy)
                    row[f"iou_{name}"] = iou
                    board(scalar(f"iou/{name}", iou), progress.updates)
                    board(scalar(f"lattice_ceiling/{name}", probe.ceiling), progress.updates)
                    for k, picture in enumerate(pictures):
                        board(image(f"{name}/{k}", picture, dataformats="HWC"), progress.updates)
                held_out = row["iou_held_out"]
            rows.writerow(row)
            bar.update(progress.updates - bar.n)
            bar.set_postfix(
                moves=progress.moves, loss=f"{progress.loss:.4f}", eps=f"{progress.epsilon:.2f}",
                held_out=f"{held_out:.3f}", ceiling=f"{probes['held_out'].ceiling:.3f}",
            )  # fmt: skip
            if evaluates:
                yield row["iou_train"]


@contextmanager
def shown(
    folder: Path, header: Sequence[str], made: int, updates: int
) -> Iterator[tuple[Board, csv.DictWriter[str], tqdm[Never], int]]:
    """TensorBoard, metrics.csv and the progress bar of a training, and of which update the table's last row is.

    What the folder shows of later updates than the `made` ones is dropped.
    """
    with (
        board_of(folder, purged_from=made + 1) as board,
        metrics(folder / "metrics.csv", header, made) as (rows, before),
        tqdm(total=updates, initial=made, unit="update", dynamic_ncols=True) as bar,
    ):
        if not made:
            board(text("config", f"```yaml\n{(folder / 'config.yaml').read_text(encoding='utf-8')}```"), 0)
        yield board, rows, bar, before


@contextmanager
def board_of(folder: Path, purged_from: int | None = None) -> Iterator[Board]:
    """Write a file for TensorBoard, which drops what earlier files of the folder show from an update on.

    Torch's SummaryWriter writes in a thread of its own, where what goes wrong, as on a full disk, ends in a traceback.
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
    """The table to go on with after `made` updates, and the updates of its last row; what is of later is dropped."""
    partial, before = path.with_suffix(".partial"), 0
    try:
        with partial.open("w", newline="", encoding="utf-8", buffering=1) as file:  # a line at a time
            rows = csv.DictWriter(file, header)
            rows.writeheader()
            for updates, line in kept_lines(path, header, made):
                file.write(line)
                before = updates
            partial.replace(path)
            yield rows, before
    finally:
        partial.unlink(missing_ok=True)


def kept_lines(path: Path, header: Sequence[str], made: int) -> Iterator[tuple[int, str]]:
    """The rows of a table up to so many updates, with the updates of each; says where one is damaged, and ends there.

    Not more than a row is in memory at once.
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
            if updates > made:
                return
            damaged = updates <= before or len(others) != len(header) - 1 or not line.endswith("\n")
            if not damaged:
                before = updates
                yield updates, line
    if damaged:
        print(f"{path} is damaged in line {number}; what it says from there on is left out")


def record_result(folder: Path, settings: dict[str, Any], result: dict[str, Any], updates: int) -> None:
    """Show a run's evaluation beside its settings, so that TensorBoard's table of hyper-parameters compares runs."""
    final = {f"final/{name}": float(result["rows"]["agent"][name]) for name in FINAL}
    final |= {f"final/{name}": float(result[name]) for name in ("lattice_ceiling", "moves", "ms_a_room")}
    shown = {name: value for name, value in flat(settings).items() if isinstance(value, bool | int | float | str)}
    with board_of(folder) as board:
        for summary in hparams(shown, final):
            board(summary, 0)
        for tag, value in final.items():
            board(scalar(tag, value), updates)


def flat(settings: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested settings under dotted names; a list as its text."""
    found: dict[str, Any] = {}
    for name, value in settings.items():
        if isinstance(value, dict):
            found |= flat(value, f"{prefix}{name}.")
        else:
            found[prefix + name] = str(value) if isinstance(value, list) else value
    return found
