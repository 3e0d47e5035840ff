"""Figures in one style: rooms, paths through them and maps over them, in metres, as PNG and SVG.

Furniture, walls and openings have the colours of the picture that the agent sees (env/render.py); the colours of what
is drawn over them are safe for colour-blind readers. The style is `plt.style.use(STYLE)`.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.patheffects import withStroke

from layoutrl import InputError
from layoutrl.env.render import BLACK, MOVING, OPENINGS, color_of
from layoutrl.env.simulator import Simulator
from layoutrl.rooms.clearances import RAISED, period
from layoutrl.rooms.faults import BLOCKS, FRONT_NOT_FREE, OUT_OF_REACH, OUTSIDE, OVERLAPS, faults
from layoutrl.rooms.room import Item, Room

STYLE = "layoutrl.figures.style"
NO_MATH: dict[str, Any] = {"text.parse_math": False}  # for texts that hold users' names: $ is a dollar, not math
BLUE, ORANGE, GREEN, PURPLE = "#0072b2", "#e69f00", "#009e73", "#cc79a7"
# How the designer's place is drawn, over all else.
DESIGNER: dict[str, Any] = {"fill": False, "edgecolor": BLUE, "linewidth": 1.6, "linestyle": (0, (3, 1.5))}

HALO = [withStroke(linewidth=1.5, foreground="white")]
# An outline over a map, whatever colours the map has.
OUTLINE: dict[str, Any] = {
    "fill": False,
    "linewidth": 1.0,
    "path_effects": [withStroke(linewidth=2.5, foreground="white")],
}
MARK = 0.7  # share of half an item's depth, at which the line to its front begins
LEGIBLE = 0.05  # metres: a name needs more, across and along
PARTS = 20  # of a box: the largest of those that are looked at

Box = tuple[float, float, float, float]  # x0, y0, x1, y1 in metres

# Letters of the faults that a picture can show: Overlaps, in a Wall, Blocks, not Reached, Front.
FAULT_MARKS = {OVERLAPS: "O", OUTSIDE: "W", BLOCKS: "B", OUT_OF_REACH: "R", FRONT_NOT_FREE: "F"}


def draw_room(axes: Axes, room: Room, moving: bool = True, names: float | None = 4, outlined: bool = False) -> None:
    """Draw a room as designed: walls black, doors green, windows blue, the target red; a line shows an item's front.

    Without `moving`, the target is left out. `names` is the size of the categories' names in points; None for no names.
    With `outlined`, doors and windows are white within a line of their colour, as on floor plans.
    """
    axes.set_aspect("equal")
    axes.axis("off")
    for wall in room.walls:
        axes.add_patch(Polygon(wall, color=rgb(BLACK), linewidth=0))
    for opening in room.openings:
        color = rgb(OPENINGS[opening.kind])
        fill, width = ("white", 1.6) if outlined else (color, 0.0)
        axes.add_patch(Polygon(opening.polygon, facecolor=fill, edgecolor=color, linewidth=width))
    drawn = [(k, item) for k, item in in_drawing_order(room) if moving or k != room.target]
    boxes = name_boxes(drawn) if names else {}
    for k, item in drawn:
        assert item.center is not None
        draw_item(axes, item, item.center, facecolor=rgb(MOVING if k == room.target else color_of(item.category)))
        if k in boxes:
            name = item.category.replace("_", "\n")
            axes.text(*middle(boxes[k]), name, fontsize=names, rotation=slope(boxes[k]), ha="center", va="center")
    axes.autoscale_view()


def slope(box: Box) -> int:
    """Return by how many degrees a name is turned so that it fits into a narrow box."""
    x0, y0, x1, y1 = box
    return 90 if y1 - y0 > 1.5 * (x1 - x0) else 0


def in_drawing_order(room: Room) -> list[tuple[int, Item]]:
    """Return (index, item) of the items that have a place, in the order to draw them.

    What others stand on comes first, then what is tucked under a table.
    """
    placed = [(k, item) for k, item in enumerate(room.furniture) if item.center is not None]
    return sorted(placed, key=lambda entry: (entry[1].category not in RAISED, not entry[1].tucked))


def name_boxes(drawn: Sequence[tuple[int, Item]]) -> dict[int, Box]:
    """Return where to write the name of each item that is seen: a box in metres, by the item's index.

    `drawn` is what is drawn, in order, as of `in_drawing_order`. The box of an item that is partly covered is the
    largest part of its bounding box that is found beside, above or below what covers it and the line to its front.
    There is none where no such part is larger than LEGIBLE, across and along: the name would stand on another item.
    """
    boxes: dict[int, Box] = {}
    over: list[Box] = []  # of what is drawn later
    for k, item in reversed(drawn):
        assert item.center is not None
        whole = item.footprint.bounds
        free = [whole]
        for box in over:
            free = _largest_beside(free, box)
        if free != [whole] and item.form != "circle":
            (x0, y0), (x1, y1) = front(item, item.center)
            free = _largest_beside(free, (min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1)))
        if free:
            boxes[k] = free[0]
        over.append(whole)
    return boxes


def middle(box: Box) -> tuple[float, float]:
    """Return the middle of a box."""
    x0, y0, x1, y1 = box
    return (x0 + x1) / 2, (y0 + y1) / 2


def _largest_beside(boxes: Sequence[Box], other: Box) -> list[Box]:
    """Return the parts of boxes beside another, the largest first, PARTS at most."""
    return sorted((part for box in boxes for part in _beside(box, other)), key=_area, reverse=True)[:PARTS]


def _beside(box: Box, other: Box) -> list[Box]:
    """Return the largest parts of a box that are on the left and right of, below and above another; it, if apart."""
    (a0, b0, a1, b1), (x0, y0, x1, y1) = box, other
    if x0 >= a1 or x1 <= a0 or y0 >= b1 or y1 <= b0:
        return [box]
    parts = (a0, b0, x0, b1), (x1, b0, a1, b1), (a0, b0, a1, y0), (a0, y1, a1, b1)
    return [part for part in parts if min(part[2] - part[0], part[3] - part[1]) > LEGIBLE]


def _area(box: Box) -> float:
    return (box[2] - box[0]) * (box[3] - box[1])


def draw_item(axes: Axes, item: Item, center: Sequence[float], **looks: Any) -> list[Artist]:
    """Draw an item centred at a point, with a line to its front if it is filled and has one; return what was drawn.

    `looks` are properties of matplotlib's patches.
    """
    usual: dict[str, Any] = {"edgecolor": "black", "linewidth": 0.5}
    outline = Polygon(np.asarray(item.footprint_at((center[0], center[1])).exterior.coords), **usual | looks)
    axes.add_patch(outline)
    if not has_front(item) or not outline.get_fill():
        return [outline]
    marks: dict[str, Any] = {
        "color": "black",
        "linewidth": 0.8,
        "alpha": looks.get("alpha"),
        "zorder": outline.get_zorder(),
    }
    return [outline, *axes.plot(*front(item, center).T, **marks)]  # what is drawn later covers both


def has_front(item: Item) -> bool:
    """Whether an item has a front: a table has none, and neither has what is round."""
    return period(item) == 360


def front(item: Item, center: Sequence[float]) -> np.ndarray:
    """Return a line (2, 2) to the middle of an item's front, for the item centred at a point. Metres."""
    angle = np.radians(item.degrees)
    return np.asarray(center) + np.outer((MARK, 1), (np.cos(angle), np.sin(angle))) * item.size[0] / 2


def draw_faults(axes: Axes, layout: Room) -> None:
    """Draw a whole room without names; hatch the items that have faults, and letter them as in FAULT_MARKS."""
    draw_room(axes, replace(layout, target=None), names=None)
    marks: dict[int, str] = {}
    for k, fault in faults(layout):
        marks[k] = marks.get(k, "") + FAULT_MARKS.get(fault, "")
    for k, letters in marks.items():
        item = layout.furniture[k]
        if item.center is None:
            continue
        draw_item(axes, item, item.center, fill=False, hatch="////", edgecolor=ORANGE, linewidth=1.2)
        axes.text(*item.center, letters, fontsize=4, weight="bold", ha="center", va="center", path_effects=HALO)


def draw_placed(axes: Axes, room: Room, place: Sequence[float], names: float | None = None) -> None:
    """A room with its target at a place (red), and where the designer put it (dashed)."""
    draw_room(axes, room, moving=False, names=names)
    draw_item(axes, room.moving, place, facecolor=rgb(MOVING), alpha=0.85)
    if room.moving.center is not None:
        draw_item(axes, room.moving, room.moving.center, **DESIGNER)


def draw_episode(axes: Axes, room: Room, path: np.ndarray) -> None:
    """Draw a greedy episode: its start (pale), its path (n, 2) in metres, and its end as in `draw_placed`."""
    draw_placed(axes, room, path[-1])
    draw_item(axes, room.moving, path[0], facecolor=rgb(MOVING), alpha=0.25)
    axes.plot(*path.T, color="black", linewidth=1.0, marker="o", markersize=2.2)


def room_legend(axes: Axes, rooms: Sequence[Room], **where: Any) -> None:
    """Draw the legend of the colours: furniture of these rooms, walls and openings, the item that moves."""
    kinds = {"wall": BLACK, **OPENINGS, rooms[0].moving.category: MOVING}
    kinds |= {item.category: color_of(item.category) for room in rooms for item in room.others}
    patches = [Patch(color=rgb(color), label=name.replace("_", " ")) for name, color in kinds.items()]
    axes.axis("off")
    looks: dict[str, Any] = {"loc": "center", "handlelength": 1.0}
    axes.legend(handles=patches, **looks | where)


def episode_legend() -> list[Line2D | Patch]:
    """The handles of what `draw_episode` draws."""
    return [
        Patch(facecolor=rgb(MOVING), alpha=0.25, label="start"),
        Line2D([], [], color="black", linewidth=1.0, marker="o", markersize=2.2, label="moves"),
        Patch(facecolor=rgb(MOVING), alpha=0.85, label="end"),
        Patch(label="designer's place", **DESIGNER),
    ]


def metres(axes: Axes) -> None:
    """Axes labelled in metres, for a room drawn alone."""
    axes.axis("on")
    axes.set_aspect("equal")
    axes.set(xlabel="x (m)", ylabel="y (m)")


def scale_bar(axes: Axes, *others: Axes) -> None:
    """Draw a bar of one metre under a room; `others`, which show the same room, get the same limits and scale."""
    x0, x1 = axes.get_xlim()
    y0, y1 = axes.get_ylim()
    gap = 0.06 * max(x1 - x0, y1 - y0)
    y = y0 - gap
    axes.plot([x0, x0 + 1], [y, y], color="black", linewidth=1.5, solid_capstyle="butt", clip_on=False)
    axes.text(x0 + 1.08, y, "1 m", fontsize=6, va="center")
    for same in (axes, *others):
        same.set(xlim=(x0, x1), ylim=(y - gap, y1))


def positions(simulator: Simulator, room: int, spacing: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a grid of positions of a room's item (rows, columns, 2), and which of them are legal (rows, columns).

    They are `spacing` apart. Metres.
    """
    x0, y0, x1, y1 = simulator.legal[room].bounds
    grid = np.stack(np.meshgrid(np.arange(x0, x1 + spacing, spacing), np.arange(y0, y1 + spacing, spacing)), -1)
    legal = simulator.is_legal(np.full(grid[..., 0].size, room), grid.reshape(-1, 2))
    return grid, legal.reshape(grid.shape[:2])


def draw_map(axes: Axes, grid: np.ndarray, values: np.ndarray, **looks: Any) -> QuadMesh:
    """Draw values (rows, columns) of standing at each position of a grid (rows, columns, 2); NaN is left blank."""
    return axes.pcolormesh(grid[..., 0], grid[..., 1], values, shading="nearest", rasterized=True, **looks)


def rgb(color: tuple[int, int, int]) -> tuple[float, float, float]:
    """Convert a colour of the picture (0 to 255) to matplotlib's (0 to 1)."""
    red, green, blue = (channel / 255 for channel in color)
    return red, green, blue


@contextmanager
def any_script() -> Iterator[None]:
    """Silence the warning about a script that the font lacks: a name in it shows as boxes in a PNG."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        yield


def save(figure: Figure, path: Path, dpi: float = 150, option: str = "out") -> list[Path]:
    """Write `<path>.png` and `<path>.svg`, the same every time, and return their paths.

    Raises InputError where one cannot be written; its message names `option`.
    """
    files = [path.with_name(f"{path.name}.{suffix}") for suffix in ("png", "svg")]
    for file in files:
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            with any_script():
                figure.savefig(file, dpi=dpi, metadata={"Date": None} if file.suffix == ".svg" else None)
        except OSError as error:
            raise InputError(
                f"{option}: cannot write {file} ({error.strerror}); expected a folder to write to"
            ) from None
    return files
