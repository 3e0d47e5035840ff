"""The evaluation of an agent that furnishes whole rooms: numbers, a table."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from layoutrl.env.measures import matched, measured
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.layouts import summary
from layoutrl.rivals.rooms.baselines import Library, nearest_layout, random_layout
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.furnished import best_layouts
from layoutrl.rooms.room import Room

SHOWN = {  # in the table: a measure, and its heading
    "iou": "IoU",
    "facing": "facing",
    "faultless": "faultless",
    "overlap": "overlap",
    "outside": "outside",
    "blocked": "blocked",
    "reached": "reached",
    "fronts": "fronts",
    "moved": "moved, m",
}
COMPARED = 200  # rooms for which the nearest training room is looked for, at a fifth of a second each


def evaluate_rooms(
    furnisher: Furnisher, designs: Sequence[Room], training: Library, seed: np.random.SeedSequence
) -> dict[str, Any]:
    """Furnish the briefs of designs, and measure the layouts beside the designer's and two untrained baselines.

    The result is plain numbers, ready for JSON: a row each, the IoU by category, and every layout. Raises InputError
    if an item fits in no way.
    """
    random_seed, nearest_seed = seed.spawn(2)
    briefs = [brief_of(room) for room in designs]
    began = time.perf_counter()
    layouts = best_layouts(furnisher, briefs)
    seconds = time.perf_counter() - began
    ways = {
        "agent": layouts,
        "designer": list(designs),
        "random": _each(briefs, random_seed, random_layout),
        "nearest room": _each(briefs[:COMPARED], nearest_seed, lambda b, rng: nearest_layout(b, training, rng)),
    }
    rows, ious = {}, {}
    for name, done in ways.items():
        measures = measured(done, designs[: len(done)])
        found, ious[name] = summary(measures), measures.iou
        rows[name] = {measure: value["mean"] for measure, value in found.items()}
        rows[name] |= {
            "mean_iou": found["iou"]["mean"],
            "iou_error": found["iou"]["standard_error"],
            "rooms": len(done),
        }
    items = matched(layouts, designs)
    return {
        "rooms": len(designs),
        "groups": len({room.group for room in designs}),
        "rows": rows,
        "items": {str(name): float(items.iou[items.category == name].mean()) for name in np.unique(items.category)},
        "ms_a_room": 1000 * seconds / len(designs),
        "layouts": [
            {
                "room": layout.id,
                "iou": float(ious["agent"][b]),
                "items": [[item.category, *(item.center or ()), item.rotation] for item in layout.furniture],
            }
            for b, layout in enumerate(layouts)
        ],
    }


def rooms_table(evaluation: dict[str, Any]) -> str:
    """The evaluation as text."""
    lines = [f"{'':14} {'rooms':>6} " + " ".join(f"{title:>9}" for title in SHOWN.values())]
    for name, row in evaluation["rows"].items():
        values = [f"{'-':>9}" if row[measure] is None else f"{row[measure]:9.3f}" for measure in SHOWN]
        lines.append(f"{name:14} {row['rooms']:6} " + " ".join(values))
    lines.append("agent, IoU by item: " + ", ".join(f"{name} {iou:.3f}" for name, iou in evaluation["items"].items()))
    lines.append(
        f"{evaluation['rooms']} rooms in {evaluation['groups']} groups; {evaluation['ms_a_room']:.0f} ms a room"
    )
    return "\n".join(lines)


def _each(
    briefs: Sequence[Room], seed: np.random.SeedSequence, furnish: Callable[[Room, np.random.Generator], Room]
) -> list[Room]:
    return [
        furnish(brief, np.random.default_rng(own)) for brief, own in zip(briefs, seed.spawn(len(briefs)), strict=True)
    ]
