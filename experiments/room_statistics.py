"""Designed bedrooms and tatami rooms beside the real ones that the paper's authors published:

    python experiments/room_statistics.py <folder of data=designer_rooms> [--rooms 1000] [--seed 0]

Prints 10%, 50% and 90% quantiles and draws experiments/results/room_statistics.png. A real room with several layouts
counts once.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from kept import RESULTS, parser_of
from matplotlib.figure import Figure

from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import Opening, Room
from layoutrl.rooms.sources import designer_rooms
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.ranges import within

QUANTILES = (0.1, 0.5, 0.9)


def measures(rooms: Sequence[Room]) -> dict[str, np.ndarray]:
    """Sides in metres, area in square metres, widths of openings in metres."""
    bounds = np.array([room.indoor.bounds for room in rooms])
    sides = np.sort(bounds[:, 2:] - bounds[:, :2], axis=1)
    return {
        "short side (m)": sides[:, 0],
        "long side (m)": sides[:, 1],
        "area (m2)": np.array([room.indoor.area for room in rooms]),
        "door (m)": np.array([_width(door) for room in rooms for door in room.doors]),
        "window (m)": np.array([_width(window) for room in rooms for window in room.windows]),
    }


def _width(opening: Opening) -> float:
    x0, y0, x1, y1 = opening.shape.bounds
    return max(x1 - x0, y1 - y0)


@answers_errors()
def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("root", type=Path)
    parser.add_argument("--rooms", type=int, default=1000, help="designed rooms of each type")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    within("--rooms", options.rooms, options.rooms >= 1, "1 or more")
    within("--seed", options.seed, options.seed >= 0, "0 or more")

    figure = Figure(figsize=(15, 5), layout="constrained")
    grid = figure.subplots(2, 5)
    for row, room_type in zip(grid, ("bedroom", "tatami"), strict=True):
        real_rooms = {room.group: room for room in designer_rooms.read(options.root, room_type).rooms}
        real = measures(list(real_rooms.values()))
        designed = measures(design_rooms(room_type, "train", options.seed, options.rooms).rooms)
        print(f"{room_type}: {len(real_rooms)} real rooms, {options.rooms} designed")
        for axes, name in zip(row, real, strict=True):
            values = {"real": real[name], "designed": designed[name]}
            for label, value in values.items():
                print(f"  {name:15} {label:9} " + " ".join(f"{q:6.2f}" for q in np.quantile(value, QUANTILES)))
            all_values = np.concatenate(list(values.values()))
            bins = np.linspace(all_values.min() - 0.01, all_values.max() + 0.01, 26)  # not empty if all are equal
            for label, value in values.items():
                axes.hist(value, bins=bins, weights=np.full(len(value), 1 / len(value)), alpha=0.6, label=label)
            axes.set_title(f"{room_type}: {name}", fontsize=9)
    grid[0, 0].legend()
    RESULTS.mkdir(exist_ok=True)
    figure.savefig(RESULTS / "room_statistics.png", dpi=80)


if __name__ == "__main__":
    main()
