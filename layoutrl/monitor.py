"""What a user sees while an agent trains and after: progress bar, metrics.csv, TensorBoard (docs/tensorboard.md)."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from torch.utils.tensorboard import SummaryWriter
from torch.utils.tensorboard.summary import hparams
from tqdm import tqdm

from layoutrl.agents.training import Progress
from layoutrl.evaluation.probe import Probe
from layoutrl.evaluation.protocols import Greedy

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
    reports: Iterator[Progress],
    policy: Greedy,
    probes: dict[str, Probe],
    folder: Path,
    updates: int,
    evaluate_every: int,
) -> Iterator[Progress]:
    """Show every report; every `evaluate_every` updates and at the end, run the probes and yield.

    `probes` are named: "train" and "held_out", whose pictures and IoU are shown.
    """
    next_evaluation = evaluate_every
    held_out = float("nan")
    with (
        SummaryWriter(str(folder)) as board,
        (folder / "metrics.csv").open("w", newline="", encoding="utf-8") as file,
        tqdm(total=updates, unit="update", dynamic_ncols=True) as bar,
    ):
        ious = [f"iou_{name}" for name in probes]
        board.add_custom_scalars(LAYOUT)
        board.add_text("config", f"```yaml\n{(folder / 'config.yaml').read_text(encoding='utf-8')}```")
        columns = [name for name in Progress.__dataclass_fields__ if name != "seconds"]
        rows = csv.DictWriter(file, columns + [f"seconds_{stage}" for stage in STAGES] + ious)
        rows.writeheader()
        for progress in reports:
            row: dict[str, Any] = {name: getattr(progress, name) for name in columns}
            row |= {f"seconds_{stage}": progress.seconds.get(stage, 0.0) for stage in STAGES}
            for tag, value in row.items():
                board.add_scalar(tag.replace("seconds_", "seconds/"), value, progress.updates)
            evaluates = progress.updates >= next_evaluation or progress.updates == updates
            if evaluates:
                next_evaluation += evaluate_every
                for name, probe in probes.items():
                    iou, pictures = probe(policy)
                    row[f"iou_{name}"] = iou
                    board.add_scalar(f"iou/{name}", iou, progress.updates)
                    board.add_scalar(f"lattice_ceiling/{name}", probe.ceiling, progress.updates)
                    for k, picture in enumerate(pictures):
                        board.add_image(f"{name}/{k}", picture, progress.updates, dataformats="HWC")
                held_out = row["iou_held_out"]
            rows.writerow(row)
            file.flush()
            bar.update(progress.updates - bar.n)
            bar.set_postfix(
                moves=progress.moves, loss=f"{progress.loss:.4f}", eps=f"{progress.epsilon:.2f}",
                held_out=f"{held_out:.3f}", ceiling=f"{probes['held_out'].ceiling:.3f}",
            )  # fmt: skip
            if evaluates:
                yield progress


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
