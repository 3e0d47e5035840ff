"""Why a type falls short: the ten worst rooms of a cell as pictures, and what went wrong in all that failed.

    python experiments/worst_rooms.py bathroom-own-geometric-seed0 [--table table1] [--budget default] [--root FOLDER]

The name is that of a filled cell; `--root` is where the rooms' files are, if they are not the designer's. A room fails
with an IoU below 0.9; the first of these reasons that is true counts:
  imprecise   the agent's place is off by less than a quarter of the item, along both axes
  ambiguous   it is the designer's own second choice, by a margin of less than 20 cm
  knew better the agent values the designer's place higher than its own: it was not led there
  wrong place it values its own higher
"""

from __future__ import annotations

import json
import textwrap
from collections import Counter
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from kept import RESULTS, parser_of
from matplotlib import style
from matplotlib.figure import Figure
from omegaconf import OmegaConf
from packing import FLAG, METRES, unpacked, unpacked_iou
from well_posed import CLOSE

from layoutrl import InputError
from layoutrl.env.simulator import Simulator
from layoutrl.figures import STYLE, draw_placed
from layoutrl.rooms.designer.generator import design_room
from layoutrl.rooms.room import Room
from layoutrl.rooms.sources.parts import two_parts
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.config import TrainConfig

FAILED = 0.9
SLIGHTLY = 0.25  # of the item's breadth along an axis
WORST = 10


def why(room: Room, place: np.ndarray, knew_better: bool, config: TrainConfig) -> str:
    """Why the item was not put where the designer did."""
    bounds = np.array(room.moving.template.bounds)
    off = np.abs(place - room.moving.center)
    if (off < SLIGHTLY * (bounds[2:] - bounds[:2])).all():
        return "imprecise"
    if config.data.source == "designer" and second_choice(room, place, config):
        return "ambiguous"
    return "knew better" if knew_better else "wrong place"


def kind_of(room: Room) -> str:
    """Return what a floor plan calls the room, as its id tells: a bathroom here may be a washing room there."""
    return room.id.partition("#")[2].rpartition("-")[0]


def second_choice(room: Room, place: np.ndarray, config: TrainConfig) -> bool:
    """Whether a place is the designer's second choice, which was worse by a margin below CLOSE."""
    assert config.data.seed is not None
    index = int(room.id.rpartition("-")[2])
    for choice in design_room(config.room.type, "test", config.data.seed, index).choices:
        if choice.place.piece.category == room.moving.category and choice.runner_up and choice.margin is not None:
            x, y = (half / 200 for half in choice.runner_up.twice_center)  # half centimetres
            return choice.margin < CLOSE and bool(np.hypot(place[0] - x, place[1] - y) < 0.1)
    return False


def worst(rooms: list[Room], iou: np.ndarray) -> list[int]:
    """Return the indices of the rooms with the lowest IoU, rounded, ties by id: in the same order on every machine."""
    return sorted(range(len(rooms)), key=lambda k: (round(float(iou[k]), 4), rooms[k].id))[:WORST]


def pictures(rooms: list[Room], places: np.ndarray, iou: np.ndarray, reasons: dict[int, str]) -> Figure:
    """The worst rooms: the agent's place red, the designer's dashed."""
    figure = Figure(figsize=(12, 5.5))
    for axes in (grid := figure.subplots(2, WORST // 2)).flat:
        axes.axis("off")
    for axes, k in zip(grid.flat, worst(rooms, iou), strict=False):
        draw_placed(axes, rooms[k], places[k], names=4)
        name = textwrap.fill(rooms[k].id, 28)
        axes.set_title(f"{name}\nIoU {iou[k]:.2f}, {reasons.get(k, '')}", fontsize=7)
    return figure


@answers_errors()
def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("cell")
    parser.add_argument("--table", default="table1")
    parser.add_argument("--budget", default="default")
    parser.add_argument("--root", help="data.root of the rooms")
    parser.add_argument("--results", type=Path, default=RESULTS)
    options = parser.parse_args()
    folder = options.results / options.budget
    file = folder / options.table / f"{options.cell}.json"
    if not file.exists():
        raise InputError(f"{options.cell}: no such cell; expected one of {file.parent}")
    cell: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    if "knew_better" not in cell:
        raise InputError(f"{options.cell}: expected the cell of an agent; got {cell['config']['fill']}")
    # Only the agent's part of the cell's configuration: the rest got new options while cells were filled. Cells leave
    # out where runs lie.
    trained = {part.name: cell["config"][part.name] for part in fields(TrainConfig)} | {"runs": TrainConfig.runs}
    config: TrainConfig = OmegaConf.to_object(OmegaConf.merge(TrainConfig, trained))  # type: ignore[assignment]
    config.data.root = options.root
    rooms = two_parts(config.room.type, config.room.item, config.data, config.fold)[1]
    places = unpacked(cell["rows"]["agent"]["place"], METRES).reshape(-1, 2).astype(float)
    stored = unpacked_iou(cell["rows"]["agent"]["iou"])
    iou = np.zeros(len(rooms))
    if len(rooms) == len(places):
        iou = Simulator(rooms, config.method.moves, config.reward).reward(np.arange(len(rooms)), places).iou
    if len(rooms) != len(places) or np.abs(iou - stored).max() > 1e-3:
        raise InputError(f"{options.cell}: was filled with other rooms; expected those rules again, or another --root")
    knew_better = unpacked(cell["knew_better"], FLAG).astype(bool)
    reasons = {int(k): why(rooms[k], places[k], knew_better[k], config) for k in np.flatnonzero(iou < FAILED)}

    lost = Counter[str]()
    for k, reason in reasons.items():
        lost[reason] += (1 - iou[k]) / len(rooms)
    print(f"{options.cell}: mean IoU {iou.mean():.3f}, {len(reasons)} of {len(rooms)} rooms below {FAILED}")
    for reason, count in Counter(reasons.values()).most_common():
        print(f"  {reason:12} {count:4} rooms, {lost[reason]:.3f} of IoU")
    print(f"  {'the others':12} {len(rooms) - len(reasons):4} rooms, {1 - iou.mean() - lost.total():.3f} of IoU")
    kinds = Counter(kind_of(room) for room in rooms)
    for kind, count in kinds.most_common() if len(kinds) > 1 else ():
        mean = np.mean([iou[k] for k, room in enumerate(rooms) if kind_of(room) == kind])
        print(f"  mean IoU {mean:.3f} in {count} rooms that the plan calls {kind}")
    picture = folder / "worst" / f"{options.cell}.png"
    picture.parent.mkdir(parents=True, exist_ok=True)
    with style.context(STYLE):
        pictures(rooms, places, iou, reasons).savefig(picture, dpi=80)
    print(f"wrote {picture}")


if __name__ == "__main__":
    main()
