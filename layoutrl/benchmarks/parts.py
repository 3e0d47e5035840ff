"""The parts of `layoutrl.bench`: the function that measures each, its rows in the table, and their targets."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from layoutrl.benchmarks.curves import SB3_IOU, TRAINING_IOU, check_sb3, image, sb3, training
from layoutrl.benchmarks.learning import memory, peak_bytes, speed
from layoutrl.benchmarks.serving import check_served, serving
from layoutrl.benchmarks.simulation import FURNISHED, ITEMS, furnishing, growth, well_furnished
from layoutrl.rooms.room import Room
from layoutrl.runs.config import BenchConfig

# Each measures with rooms to train on and rooms held out.
PARTS: dict[str, Callable[..., dict[str, Any]]] = {
    "speed": speed,
    "rooms": furnishing,
    "memory": memory,
    "growth": growth,
    "demo": serving,
    "training": training,
    "image": image,
    "sb3": sb3,
}
# Checks, made before any part is measured, of what it needs: of this machine, and of the training rooms.
NEEDS: dict[str, Callable[[BenchConfig], object]] = {
    "memory": lambda _: peak_bytes(),
    "demo": check_served,
    "sb3": check_sb3,
}
NEEDS_ROOMS: dict[str, Callable[[BenchConfig, Sequence[Room]], object]] = {"speed": well_furnished}
Targets = str | dict[str, str]  # to reach on two cores; a dict where a measurement has several values, by their names
ROWS: dict[str, dict[str, tuple[str, Targets]]] = {
    "speed": {
        "moves_a_second": (f"exact moves a second, rooms with {ITEMS} items or more", "500,000"),
        "shapely_moves_a_second": ("  by the shapely simulator", ""),
        "times_shapely": ("  ratio", "200"),
        "environment_steps_a_second": ("steps a second of one layoutrl/Layout-v0, resets included", "10,000"),
        "shapely_steps_a_second": ("  by the shapely simulator, without observations", ""),
        "observations_a_second": (
            "observations a second, geometry or image",
            {"geometric": "500,000", "paper": "20,000"},
        ),
        "learner_samples_a_second": ("learner, samples a second", {"geometric": "20,000", "paper": "1,500"}),
        "bare_samples_a_second": ("  bare passes of the networks", ""),
        "share_of_bare": ("  share", {"geometric": "0.8", "paper": "0.8"}),
        "training_samples_a_second": ("  with acting: the whole loop", ""),
        "setup_seconds": ("set-up for the training rooms, seconds", ""),
        "evaluation_seconds": ("evaluation of the held-out rooms, set-up included, seconds", "10"),
    },
    "rooms": {
        "actions_a_second": (f"actions a second in whole rooms of {FURNISHED} items, rewards included", "200,000"),
        "shapely_actions_a_second": ("  by the shapely simulator", ""),
        "times_shapely": ("  ratio", ""),
        "setup_seconds": ("set-up for the rooms, seconds", ""),
        "measures_seconds": ("all measures of the held-out rooms, seconds", "10"),
    },
    "memory": {
        "bytes_a_transition": ("bytes a transition", "48"),
        "peak_gigabytes": ("peak memory of training with a full replay, GB", "1.5"),
        "peak_device_gigabytes": ("  on the GPU, GB", ""),
    },
    "growth": {
        "moves_a_second_by_episodes": ("moves a second, by parallel episodes", {"65536": "(GPU: 20,000,000)"}),
        "moves_a_second_by_items": ("moves a second, by items a room", ""),
    },
    "demo": {
        "picture_seconds": ("first picture of the demo in a browser, seconds", "1"),
        "move_seconds": ("first move of furnishing a room, seconds", "1"),
        "look_milliseconds": ("faults and measures of a room, milliseconds", "30"),
        "looks_a_second": ("  answers a second, one after the other", "30"),
        "share_answered": ("clients at once, share without an error", "1"),
        "slowest_seconds": ("  slowest answer, seconds", ""),
        "megabytes": ("memory of the server, MB", ""),
    },
    "training": {
        "minutes_to_goal": (f"minutes to a mean IoU of {TRAINING_IOU} in the held-out rooms", "3"),
        "setup_minutes": ("  set-up in this", ""),
        "minutes": ("  minutes of all updates, set-up included", ""),
        "iou": ("  mean IoU after them", ""),
    },
    "image": {
        "iou": ("mean IoU of the paper's network with the method's moves", "0.93"),
        "minutes": ("  minutes of training", ""),
        "updates": ("  updates", ""),
    },
    "sb3": {
        "minutes_to_goal": (f"minutes to a mean IoU of {SB3_IOU} (SB3: no mask, illegal moves are dropped)", ""),
        "times_sb3": ("  ratio (at least, where SB3 did not reach it)", "10"),
        "updates": ("  updates", ""),
        "minutes": ("  minutes of them", ""),
        "iou": ("  mean IoU after them", ""),
    },
}


def table(about: dict[str, Any], parts: dict[str, dict[str, Any]]) -> str:
    """Return the table as text: what was measured, the value, and the value to reach."""
    rows = [("", "measured", "to reach on two cores")]
    for part, measured in parts.items():
        for key, (what, targets) in ROWS[part].items():
            values = measured.get(key, {})  # the GPU's are missing on a CPU
            for name, value in values.items() if isinstance(values, dict) else [("", values)]:
                target = targets.get(str(name), "") if isinstance(targets, dict) else targets
                rows.append((f"{what}, {name}" if name else what, _short(value), target))
    width = max(len(what) for what, _, _ in rows)
    lines = [", ".join(f"{name} {value}" for name, value in about.items() if value is not None)]
    lines += [f"{what:{width}}  {value:>12}  {target}".rstrip() for what, value, target in rows]
    return "\n".join(lines)


def _short(value: float | None) -> str:
    if value is None:
        return "not reached"
    return f"{value:,.0f}" if value >= 100 else f"{value:.3g}"
