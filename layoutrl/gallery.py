"""python -m layoutrl.gallery room=<type> [data=<source>] [rooms=24] [all_types=true] [out=<folder>]"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

from matplotlib import style
from matplotlib.figure import Figure

from layoutrl import InputError
from layoutrl.figures import NO_MATH, STYLE, draw_room, save
from layoutrl.rooms.collection import choose_item
from layoutrl.rooms.room import MAIN_ITEM, Room
from layoutrl.rooms.sources.parts import Data, designed_rooms
from layoutrl.runs.commands import command
from layoutrl.runs.config import GalleryConfig, RoomConfig
from layoutrl.runs.files import check_writable

OUT = "gallery"  # the folder without out=: only there are sheets overwritten
COLUMNS = 6  # of a sheet
CELL = 2.4  # inches, width and height of one room


def sheet(rooms: Sequence[Room]) -> Figure:
    """Rooms in rows of up to six, each to its own scale."""
    columns = min(COLUMNS, len(rooms))
    rows = -(-len(rooms) // columns)
    figure = Figure(figsize=(CELL * columns, CELL * rows))
    grid = figure.subplots(rows, columns, squeeze=False)
    for axes in grid.flat:
        axes.axis("off")
    for axes, room in zip(grid.flat, rooms, strict=False):
        draw_room(axes, room)
        missing = [item.category.replace("_", " ") for item in room.furniture if item.center is None]
        axes.set_title(f"{room.id}\nto be placed: {', '.join(missing)}" if missing else room.id, fontsize=5)
    return figure


def run(config: GalleryConfig) -> list[Path]:
    """Draw the first rooms of the type, or of all types in turn; returns the files, PNG and SVG.

    Raises InputError where `out` has such a file already, and where there is no room.
    """
    name = "all_types" if config.all_types else config.room.type
    source = config.data.source
    which = f"seed{config.data.seed}" if source == "designer" else Path(str(config.data.root)).resolve().stem
    base = Path(config.out or OUT) / f"{name}-{source}-{which}"
    for file in (base.with_name(f"{base.name}.{kind}") for kind in ("png", "svg")):
        if config.out and file.exists():
            raise InputError(f"out: {file} is there already; expected another folder, as out=<folder>")
    check_writable(base.parent, "out")
    types = list(MAIN_ITEM) if config.all_types else [config.room.type]
    each = -(-config.rooms // len(types))
    found = [_rooms(replace(config.room, type=room_type), config.data, each) for room_type in types]
    in_turn = [room for those in zip_longest(*found) for room in those if room is not None]
    rooms = sorted(in_turn[: config.rooms], key=lambda room: types.index(room.room_type))
    if not rooms:
        raise InputError(f"room: {source} has no {' or '.join(types)} to draw; expected another room=<type>")
    if source != "designer" and len(in_turn) > len(rooms):
        print(f"{len(rooms)} of {len(in_turn)} rooms are drawn; rooms={len(in_turn)} draws all")
    with style.context([STYLE, NO_MATH]):
        files = save(sheet(rooms), base, dpi=120)
    for file in files:
        print(f"wrote {file}")
    return files


def _rooms(room: RoomConfig, data: Data, count: int) -> list[Room]:
    """Return at least `count` rooms of a type, if there are. Rooms of files may have items still to be placed."""
    if data.source == "designer":
        return designed_rooms(room.type, room.item, replace(data, train_rooms=count), "train")
    collection = data.read(room.type)
    if room.item != "main":
        collection = choose_item(collection, room.item)
    print(collection)
    return collection.rooms


main = command("gallery", GalleryConfig, run)

if __name__ == "__main__":
    main()
