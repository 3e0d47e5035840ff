"""python -m layoutrl.gallery room=<type> [data=<source>] [rooms=24] [all_types=true] [out=<folder>]"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import hydra
import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from omegaconf import DictConfig, OmegaConf

from layoutrl import build
from layoutrl.config import DataConfig, GalleryConfig, RoomConfig, config_directory, register
from layoutrl.env.render import BLACK, DOOR, MOVING, WINDOW, color_of
from layoutrl.errors import InputError
from layoutrl.rooms.room import MAIN_ITEM, Room

COLUMNS = 6  # of a sheet
CELL = 2.4  # inches, width and height of one room


def draw(axes: Axes, room: Room) -> None:
    """A room as designed: walls black, doors green, windows blue, the target red; a line shows an item's front."""
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title(room.id, fontsize=5)
    for wall in room.walls:
        axes.add_patch(Polygon(wall, color=_rgb(BLACK), linewidth=0))
    for opening in room.openings:
        color = DOOR if opening.kind == "door" else WINDOW
        axes.add_patch(Polygon(opening.polygon, color=_rgb(color), linewidth=0))
    placed = [(k, item) for k, item in enumerate(room.furniture) if item.center is not None]
    for k, item in sorted(placed, key=lambda entry: not entry[1].tucked):  # a tucked chair lies under its table
        assert item.center is not None
        face = _rgb(MOVING if k == room.target else color_of(item.category))
        corners = np.asarray(item.footprint.exterior.coords)
        axes.add_patch(Polygon(corners, facecolor=face, edgecolor="black", linewidth=0.5))
        if item.form == "rectangle":
            angle = np.deg2rad(item.rotation)
            front = np.array(item.center) + np.outer((0.7, 1), (np.cos(angle), np.sin(angle))) * item.size[0] / 2
            axes.plot(*front.T, color="black", linewidth=0.8)
        axes.text(*item.center, item.category.replace("_", "\n"), fontsize=4, ha="center", va="center")
    axes.autoscale_view()


def sheet(rooms: Sequence[Room]) -> Figure:
    """Rooms in rows of six, each to its own scale."""
    rows = -(-len(rooms) // COLUMNS)
    figure = Figure(figsize=(CELL * COLUMNS, CELL * rows), layout="constrained")
    grid = figure.subplots(rows, COLUMNS, squeeze=False)
    for axes in grid.flat:
        axes.axis("off")
    for axes, room in zip(grid.flat, rooms, strict=False):
        draw(axes, room)
    return figure


def run(config: GalleryConfig) -> list[Path]:
    """Draw the first training rooms of the type, or of all types in turn; returns the files, PNG and SVG."""
    types = list(MAIN_ITEM) if config.all_types else [config.room.type]
    each = -(-config.rooms // len(types))
    rooms = [room for room_type in types for room in _rooms(replace(config.room, type=room_type), config.data, each)]
    figure = sheet(rooms)
    name = "all_types" if config.all_types else config.room.type
    files = [
        Path(config.out) / f"{name}-{config.data.source}-seed{config.data.seed}.{suffix}" for suffix in ("png", "svg")
    ]
    try:
        Path(config.out).mkdir(parents=True, exist_ok=True)
        with mpl.rc_context({"svg.fonttype": "none", "svg.hashsalt": name}):  # small, and the same every time
            figure.savefig(files[0], dpi=120)
            figure.savefig(files[1], metadata={"Date": None})
    except OSError as error:
        raise InputError(f"out: cannot write {files[0]} ({error.strerror}); expected a folder to write to") from None
    for file in files:
        print(f"wrote {file}")
    return files


def _rooms(room: RoomConfig, data: DataConfig, count: int) -> list[Room]:
    if data.source == "designer":
        return build.designed_rooms(room, replace(data, train_rooms=count), "train")
    return build.rooms(room, data, fold=0)[0][:count]


def _rgb(color: tuple[int, int, int]) -> tuple[float, float, float]:
    red, green, blue = (channel / 255 for channel in color)
    return red, green, blue


register()


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="gallery")
@build.answers_errors
def main(config: DictConfig) -> None:
    run(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
