"""What a user sees while an agent trains and after: progress bar, metrics.csv, TensorBoard (docs/tensorboard.md)."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Never

from torch.utils.tensorboard import SummaryWriter
from torch.utils.tensorboard.summary import hparams
from tqdm import tqdm

from layoutrl import InputError
from layoutrl.agents.training import Progress, Training
from layoutrl.evaluation.probe import Probe
from layoutrl.evaluation.protocols import Greedy

COLUMNS = [name for name in Progress.__dataclass_fields__ if name != "seconds"]  # of metrics.csv, the first ones
STAGES = ("act", "simulate", "store", "sample", "learn")
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
            board.add_custom_scalars(LAYOUT)
        for progress in training:
            if not math.isfinite(progress.loss):
                raise InputError(
                    f"method: the loss is {progress.loss} after {progress.updates} updates; the last checkpoint is of "
                    "before; expected a lower method.learning_rate"
                )
            row: dict[str, Any] = {name: getattr(progress, name) for name in COLUMNS}
            row |= {f"seconds_{stage}": progress.seconds.get(stage, 0.0) for stage in STAGES}
            for tag, value in row.items():
                board.add_scalar(tag.replace("seconds_", "seconds/"), value, progress.updates)
            evaluates = progress.updates // evaluate_every > before // evaluate_every or progress.updates == updates
            before = progress.updates
            if evaluates:
                for name, probe in probes.items():
                    iou, pictures = probe(policy)
                    row[f"iou_{name}"] = iou
                    board.add_scalar(f"iou/{name}", iou, progress.updates)
                    board.add_scalar(f"lattice_ceiling/{name}", probe.ceiling, progress.updates)
                    for k, picture in enumerate(pictures):
                        board.add_image(f"{name}/{k}", picture, progress.updates, dataformats="HWC")
                held_out = row["iou_held_out"]
                board.flush()
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
) -> Iterator[tuple[SummaryWriter, csv.DictWriter[str], tqdm[Never], int]]:
    """TensorBoard, metrics.csv and the progress bar of a training, and of which update the table's last row is.

    What the folder shows of later updates than the `made` ones is dropped.
    """
    with (
        SummaryWriter(str(folder), purge_step=made + 1) as board,
        metrics(folder / "metrics.csv", header, made) as (rows, before),
        tqdm(total=updates, initial=made, unit="update", dynamic_ncols=True) as bar,
    ):
        if not made:
            board.add_text("config", f"```yaml\n{(folder / 'config.yaml').read_text(encoding='utf-8')}```")
        yield board, rows, bar, before


@contextmanager
def metrics(path: Path, header: Sequence[str], made: int) -> Iterator[tuple[csv.DictWriter[str], int]]:
    """The table to go on with after `made` updates, and the updates of its last row; what is of later is dropped."""
    kept: list[dict[str, str]] = []
    if made and path.exists():
        with path.open(newline="", encoding="utf-8") as file:
            kept = [row for row in csv.DictReader(file) if int(row["updates"]) <= made]
    partial = path.with_suffix(".partial")
    with partial.open("w", newline="", encoding="utf-8", buffering=1) as file:  # a line at a time
        rows = csv.DictWriter(file, header)
        rows.writeheader()
        rows.writerows(kept)
        partial.replace(path)
        yield rows, int(kept[-1]["updates"]) if kept else 0


def record_result(folder: Path, settings: dict[str, Any], result: dict[str, Any], updates: int) -> None:
    """Show a run's evaluation beside its settings, so that TensorBoard's table of hyper-parameters compares runs."""
    final = {f"final/{name}": float(result["rows"]["agent"][name]) for name in FINAL}
    final |= {f"final/{name}": float(result[name]) for name in ("lattice_ceiling", "moves", "ms_a_room")}
    shown = {name: value for name, value in flat(settings).items() if isinstance(value, bool | int | float | str)}
    with SummaryWriter(str(folder)) as board:
        for summary in hparams(shown, final):
            board.file_writer.add_summary(summary)
        for tag, value in final.items():
            board.add_scalar(tag, value, updates)


def flat(settings: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested settings under dotted names; a list as its text."""
    found: dict[str, Any] = {}
    for name, value in settings.items():
        if isinstance(value, dict):
            found |= flat(value, f"{prefix}{name}.")
        else:
            found[prefix + name] = str(value) if isinstance(value, list) else value
    return found
