"""python -m layoutrl.gallery room=<type> [data=<source>] [rooms=24] [all_types=true] [out=<folder>]"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import hydra
from matplotlib import style
from matplotlib.figure import Figure
from omegaconf import DictConfig, OmegaConf

from layoutrl.figures import STYLE, draw_room, save
from layoutrl.rooms.room import MAIN_ITEM, Room
from layoutrl.rooms.sources.parts import Data, designed_rooms, read_parts
from layoutrl.runs.commands import answers_errors
from layoutrl.runs.config import GalleryConfig, RoomConfig, config_directory, register

COLUMNS = 6  # of a sheet
CELL = 2.4  # inches, width and height of one room


def sheet(rooms: Sequence[Room]) -> Figure:
    """Rooms in rows of six, each to its own scale."""
    rows = -(-len(rooms) // COLUMNS)
    figure = Figure(figsize=(CELL * COLUMNS, CELL * rows))
    grid = figure.subplots(rows, COLUMNS, squeeze=False)
    for axes in grid.flat:
        axes.axis("off")
    for axes, room in zip(grid.flat, rooms, strict=False):
        draw_room(axes, room)
        axes.set_title(room.id, fontsize=5)
    return figure


def run(config: GalleryConfig) -> list[Path]:
    """Draw the first rooms of the type, or of all types in turn; returns the files, PNG and SVG."""
    types = list(MAIN_ITEM) if config.all_types else [config.room.type]
    each = -(-config.rooms // len(types))
    rooms = [room for room_type in types for room in _rooms(replace(config.room, type=room_type), config.data, each)]
    name = "all_types" if config.all_types else config.room.type
    with style.context(STYLE):
        files = save(sheet(rooms), Path(config.out) / f"{name}-{config.data.source}-seed{config.data.seed}", dpi=120)
    for file in files:
        print(f"wrote {file}")
    return files


def _rooms(room: RoomConfig, data: Data, count: int) -> list[Room]:
    if data.source == "designer":
        return designed_rooms(room.type, room.item, replace(data, train_rooms=count), "train")
    training, held_out = read_parts(room.type, room.item, data, fold=0)
    return (training + held_out)[:count]


register()


@hydra.main(version_base="1.3", config_path=str(config_directory()), config_name="gallery")
@answers_errors
def main(config: DictConfig) -> None:
    run(OmegaConf.to_object(config))  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
