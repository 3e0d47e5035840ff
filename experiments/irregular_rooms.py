"""How well do the agents in the package furnish rooms that are not as those that they learned in? One type a call:

    python experiments/irregular_rooms.py bedroom [--rooms 100] [--seed 1]

Designed rooms are disturbed as flats are: once or twice a corner is cut off or built in, or a column or a pier is put
there. The designer's layout stands in them as it did, and nothing is wrong with it. The same furniture is placed in the
rooms as they were designed, and disturbed.

Prints the numbers and writes experiments/results/irregular/<type>.json.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import torch
from shapely.geometry import Polygon, box
from shapely.geometry.polygon import orient

from layoutrl.env.faults import Items, faults
from layoutrl.env.measures import measured
from layoutrl.evaluation.layouts import summary
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import MAIN_ITEM, TOLERANCE, Ring, Room, wall_band
from layoutrl.runs.box import boxed
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.machine import use_one_thread

TRIES = 60  # of a disturbance, in a room
CORNER = (0.3, 1.5)  # metres of each wall that a corner takes, and half of the wall at most
COLUMN = (0.2, 0.5)  # metres, of the sides of a column or a pier
MICROMETRE = 1e-6  # metres
AT_THE_WALL = 0.02  # metres from it, at most
ALWAYS = 0.95  # share of a category's items with a side at a wall, from which on they belong there
MEASURES = ("iou", "facing", "faultless")
RESULTS = Path(__file__).parent / "results" / "irregular"


def corner_cut(room: Room, rng: np.random.Generator) -> Polygon:
    """A triangle at a corner, of which a slanting wall is left."""
    corner, along, back = _corner(room, rng)
    return Polygon([corner, corner + along, corner + back])


def corner_built_in(room: Room, rng: np.random.Generator) -> Polygon:
    """A parallelogram at a corner: the room is L-shaped without it."""
    corner, along, back = _corner(room, rng)
    return Polygon([corner, corner + along, corner + along + back, corner + back])


def column(room: Room, rng: np.random.Generator) -> Polygon:
    """An upright rectangle anywhere."""
    x0, y0, x1, y1 = room.indoor.bounds
    x, y = rng.uniform((x0, y0), (x1, y1))
    width, depth = rng.uniform(*COLUMN, 2)
    return box(x, y, x + width, y + depth)


def pier(room: Room, rng: np.random.Generator) -> Polygon:
    """A rectangle with its back at a wall."""
    ring = np.array(room.outline)
    k = rng.integers(len(ring))
    start, way = ring[k], ring[(k + 1) % len(ring)] - ring[k]
    length = np.hypot(*way)
    along, inwards = way / length, np.array([-way[1], way[0]]) / length
    width, depth = rng.uniform(*COLUMN, 2)
    first = start + along * rng.uniform(0, max(length - width, 0))
    return Polygon([first, first + along * width, first + along * width + inwards * depth, first + inwards * depth])


def _corner(room: Room, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A corner, and how far what is taken there reaches along both of its walls."""
    ring = np.array(room.outline)
    k = rng.integers(len(ring))
    corner = ring[k]
    ways = np.array([ring[(k + 1) % len(ring)], ring[k - 1]]) - corner
    lengths = np.hypot(*ways.T)
    along, back = ways * rng.uniform(*(np.minimum(metres / lengths, 0.5) for metres in CORNER))[:, None]
    return corner, along, back


DISTURBANCES: tuple[Callable[[Room, np.random.Generator], Polygon], ...] = (
    corner_cut, corner_built_in, column, pier,
)  # fmt: skip


def disturbed(room: Room, rng: np.random.Generator) -> tuple[Room, list[str]]:
    """The room less one or two pieces, with the designer's layout as it was; and the names of what was done to it.

    It is the room itself, and no name, where nothing can be done without a fault.
    """
    wanted, names = rng.integers(1, 3), list[str]()
    for _ in range(TRIES):
        disturb = DISTURBANCES[rng.integers(len(DISTURBANCES))]
        found = without(room, disturb(room, rng))
        if found and not faults(found):
            room = found
            names.append(disturb.__name__)
            if len(names) == wanted:
                break
    return room, names


def without(room: Room, piece: Polygon) -> Room | None:
    """The room without a piece of its floor; None where an item or an opening is in the way, or nothing is taken."""
    left = shapely.set_precision(room.indoor.difference(piece), MICROMETRE)
    stands_there = any(item.footprint.buffer(TOLERANCE).intersects(piece) for item in room.furniture)
    if stands_there or not isinstance(left, Polygon) or left.area > room.indoor.area - TOLERANCE:
        return None
    before, after = (shapely.boundary(shape).buffer(TOLERANCE) for shape in (room.indoor, left))
    for opening in room.openings:
        if shapely.area(opening.shape.intersection(after)) < 0.99 * shapely.area(opening.shape.intersection(before)):
            return None
    outline, holes = _ring(left.exterior), tuple(_ring(hole)[::-1] for hole in left.interiors)
    return replace(room, outline=outline, holes=holes, walls=wall_band(outline, holes, room.openings))


def _ring(ring: shapely.LinearRing) -> Ring:
    return tuple((x, y) for x, y in orient(Polygon(ring)).exterior.coords[:-1])


def at_the_wall(layouts: Sequence[Room], designs: Sequence[Room]) -> float:
    """Of items of categories that the designer puts with their backs at a wall, the share that stands so."""
    designed, placed = (Counter(_sided(rooms)) for rooms in (designs, layouts))
    kinds = {kind for kind, _ in designed}
    belong = [kind for kind in kinds if designed[kind, True] >= ALWAYS * (designed[kind, True] + designed[kind, False])]
    there, off = (sum(placed[kind, stands] for kind in belong) for stands in (True, False))
    return there / (there + off)


def _sided(rooms: Sequence[Room]) -> Iterator[tuple[str, bool]]:
    """(category, whether its back, or of what has no front a side, is at a wall) of each rectangle that stands."""
    items = Items.of(rooms)
    those = np.flatnonzero(items.placed & ~items.round)
    corners = shapely.get_coordinates(items.footprint[those]).reshape(-1, 5, 2)  # the back is from the second on
    walls = shapely.boundary([room.indoor for room in rooms])[items.room[those]]
    off = shapely.distance(walls[:, None], shapely.points(corners))
    sides = np.maximum(off[:, :-1], off[:, 1:])
    back = np.where(items.period[those] == 360, sides[:, 1], sides.min(1))
    return zip(items.category[those].tolist(), (back <= AT_THE_WALL).tolist(), strict=True)


@answers_errors()
def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("room_type", choices=list(MAIN_ITEM))
    parser.add_argument("--rooms", type=int, default=100, help="rooms that can be disturbed")
    parser.add_argument("--seed", type=int, default=1, help="of the designs, none of which was learned from")
    options = parser.parse_args()

    use_one_thread()
    furnisher, rng = boxed(options.room_type, torch.device("cpu")), np.random.default_rng(options.seed)
    pairs, done = list[tuple[Room, Room]](), Counter[str]()
    for room in design_rooms(options.room_type, "test", options.seed, 2 * options.rooms).rooms:
        changed, names = disturbed(room, rng)
        if names:
            pairs.append((room, changed))
            done.update(names)
        if len(pairs) == options.rooms:
            break
    result: dict[str, Any] = {"rooms": len(pairs), "seed": options.seed, "disturbances": dict(done)}
    for name, designs in zip(("as designed", "disturbed"), zip(*pairs, strict=True), strict=True):
        layouts = [best.layout for best, *_ in furnisher.furnish([brief_of(room) for room in designs], 1)]
        found = summary(measured(layouts, designs))
        result[name] = {measure: found[measure] for measure in MEASURES}
        result[name]["at_the_wall"] = at_the_wall(layouts, designs)
        print(f"{options.room_type}, {name}: {json.dumps(result[name])}", flush=True)
    RESULTS.mkdir(parents=True, exist_ok=True)
    (RESULTS / f"{options.room_type}.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
