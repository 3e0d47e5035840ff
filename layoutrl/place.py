"""python -m layoutrl.place [run=<folder>] rooms=<file> [choices=<n>] [pictures=<folder>] [out=<file>]

Places the items of a file's rooms that have no center. By default the agents in the package do it, each in rooms of its
type, and the constraint search helps where one of their layouts has a fault or an oddity. With run= the agent of a
training run does it; with by=search or by=annealer, a rival. `furnish` does the same with rooms in memory.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from numbers import Real
from pathlib import Path
from typing import Any

from layoutrl import InputError
from layoutrl.env.arguments import check_rooms, is_whole
from layoutrl.rooms.categories import ALL, RUG, names_in, names_of, nearest
from layoutrl.rooms.documents import room_from_dict, room_to_dict
from layoutrl.rooms.files import check_new, check_not_given, name_of
from layoutrl.rooms.formats import Source, format_of, opened, to_place
from layoutrl.rooms.room import Item, Room
from layoutrl.runs.answer import Answer
from layoutrl.runs.commands import Incomplete, command
from layoutrl.runs.config import PlaceConfig, TrainConfig, composed
from layoutrl.runs.file_placer import JSON, FilePlacer
from layoutrl.runs.folder import load_config
from layoutrl.runs.room_placer import RoomPlacer
from layoutrl.runs.streams import STANDARD, Entry, Tally, count


@dataclass(frozen=True)
class Done:
    """The files that were written, and what was placed."""

    files: list[Path]
    tally: Tally


def furnish(
    rooms: Sequence[Room],
    choices: int = 1,
    *,
    stood: Sequence[Sequence[Item]] | None = None,
    move: str | None = None,
    by: str | None = None,
    run: Path | str | None = None,
    item: str | None = None,
    seconds: float = PlaceConfig.seconds,
    seed: int = 0,
    device: str = PlaceConfig.device,
) -> list[Answer]:
    """Furnish rooms in memory as the command does: return for each room up to `choices` layouts, best first.

    The options are those of conf/place.yaml. Items have categories; `item` may also have an everyday name, and `move`
    several, separated by commas. `stood` is the furniture of each room as it stood, needed where items have lost their
    centers already (`Source.stood`). With it only items without a center are placed; give the same `move` as to
    `opened`, since after "all" what nobody can place stays. An item that cannot be placed stays where it stood, or has
    no center. Raises InputError for what is no list of rooms, for an invalid option, and if `run` is not the folder of
    a training run.
    """
    check_rooms(rooms)
    documents = [checked_document(room) for room in rooms]
    run = str(run) if isinstance(run, Path) else run
    for name, value in {"choices": choices, "seed": seed}.items():
        if not is_whole(value):
            raise InputError(f"{name}: expected a whole number; got {value!r:.60}")
    for name, text in {"move": move, "by": by, "run": run, "item": item}.items():
        if not isinstance(text, str | None):
            raise InputError(f"{name}: expected text, or None; got {text!r:.60}")
    if not isinstance(device, str):
        raise InputError(f"device: expected text; got {device!r:.60}")
    if isinstance(seconds, bool) or not isinstance(seconds, Real):
        raise InputError(f"seconds: expected a number; got {seconds!r:.60}")
    config = replace(
        in_memory(), choices=choices, move=move, by=by, run=run, item=item, seconds=seconds, seed=seed, device=device
    )
    check_who(config)
    config = by_category(config)
    check_item_moves(config)
    if run is not None:
        load_config(Path(run), TrainConfig)
    briefs = rooms
    if stood is None:
        briefs, stood = [to_place(room, config.move) for room in rooms], [room.furniture for room in rooms]
    elif [[item.category for item in items] for items in stood] != [
        [item.category for item in room.furniture] for room in rooms
    ]:  # sizes may differ: a source's rooms are rounded
        raise InputError("stood: expected the furniture of each room, every item as it stood; got other items")
    entries = [
        Entry(room.id, brief, document, stood=tuple(items))
        for room, brief, document, items in zip(rooms, briefs, documents, stood, strict=True)
    ]
    return RoomPlacer(config).place(entries)


def checked_document(room: Room) -> dict[str, Any]:
    """Return the document of a room. Raises InputError where no room could be read from it."""
    try:
        hash(room)
        document = room_to_dict(room)
    except TypeError:
        raise InputError(f"{room.id}: expected tuples of numbers, no lists or arrays") from None
    try:
        room_from_dict(document)
    except InputError as error:
        raise InputError(f"{room.id}: {error}") from None
    return document


@cache
def in_memory() -> PlaceConfig:
    """Return the default options of conf/, cached: composing them takes a sixth of a second."""
    return composed("place", f"rooms={STANDARD}")


def run(config: PlaceConfig) -> Done:
    """Place the items without a center in the rooms of a file, write the rooms, and print what was done.

    Raises InputError for an option or file that cannot be used, if nothing was to be placed, and if a file to write
    exists already.
    """
    check_who(config)
    if config.drawing != "svg" and config.pictures is None:
        raise InputError(f"drawing: nothing is drawn as {config.drawing} without pictures=; expected pictures=<folder>")
    asked, config = config, by_category(config)
    check_item_moves(config)
    source = source_of(config)
    suffix = source.suffix if source else JSON
    piped = (config.out or config.rooms) == STANDARD
    if piped and suffix != JSON:
        raise InputError(f"out: what comes as {suffix} is written to a file; expected the name of a new one")
    total = len(source.collection.rooms) if source else count(config)  # raises InputError if there is no such file
    if config.run is not None:
        load_config(Path(config.run), TrainConfig)  # report a bad run before any file is made
    files = [] if piped else out_files(config, suffix)
    folder = Path(config.rooms).resolve()
    if source and files and folder.is_dir() and folder in files[0].resolve().parents:
        raise InputError(f"out: {files[0]} lies in the folder that is read; expected it elsewhere, as out=<file>")
    if piped and sys.stdout is None:
        raise InputError("out: standard output is closed; expected somebody to read it, or out=<file>")
    placer = FilePlacer(config, source, total, sys.stderr if piped else sys.stdout)
    if names_in(asked.move) != names_in(config.move):
        placer.say(f"move: {asked.move} is taken for {config.move}, and all that is one moves")
    try:
        if suffix == JSON:
            placer.write_each(files[0] if files else None)
        else:
            files = placer.write_whole(files)
    finally:  # delete the pictures of rooms that were not written, so that the same command can make them again
        for picture in placer.drawn:
            picture.unlink(missing_ok=True)
    placer.say_unmet()
    if not placer.asked:
        raise InputError(f"rooms: {placer.nothing}")
    placer.say(str(placer.tally))
    for file in files:
        placer.say(f"wrote {file}")
    return Done(files, placer.tally)


def check_who(config: PlaceConfig) -> None:
    """Raise InputError if `run` and `by` are both given, or if other options do not go with the furnisher."""
    if config.run is not None and config.by is not None:
        raise InputError(
            "run: expected either run=<folder> of a training, or by=agents, by=search or by=annealer; "
            "without both, the agents in the package furnish, and the search where they fail"
        )
    rival = config.by in ("search", "annealer")
    if rival and config.item:
        raise InputError(f"item: by={config.by} places all items that have no center; expected no item=")
    if rival and config.device not in ("auto", "cpu"):
        raise InputError(f"device: by={config.by} works on the CPU alone; expected no device=; got {config.device}")
    if not rival and config.seconds != PlaceConfig.seconds:
        raise InputError("seconds: they are of by=search and by=annealer; expected either beside")
    if config.run is None and config.checkpoint != PlaceConfig.checkpoint:
        raise InputError("checkpoint: it is one of a training run; expected run=<folder> beside")


def by_category(config: PlaceConfig) -> PlaceConfig:
    """Return the options with the everyday names in `move` and `item` replaced by categories.

    With `run` they stay as they are: an agent of the user's own has its own categories. Raises InputError for a name
    that is unknown or means a rug.
    """
    if config.run is not None:
        return config
    names = names_of(Path(config.categories) if config.categories else None)

    def meant(option: str, name: str, expected: str) -> str:
        if (ours := names.meant(name)) in (None, RUG):
            near = ", ".join(nearest(name, names.categories))
            raise InputError(f"{option}: expected {expected}, as {near}; got {name!r}")
        return ours

    several = "all, or furniture with commas between"
    moved = [name if name == ALL else meant("move", name, several) for name in sorted(names_in(config.move))]
    if config.item and "," in config.item:
        raise InputError(f"item: expected one kind of furniture; got {config.item}; move= takes several")
    item = config.item and meant("item", config.item, "furniture")
    return replace(config, move=",".join(moved) if moved else None, item=item)


def check_item_moves(config: PlaceConfig) -> None:
    """Raise InputError for a `move` without effect: one without the `item` that alone is placed."""
    if config.item and config.move and not {ALL, config.item} & names_in(config.move):
        raise InputError(
            f"move: {config.move} has no effect with item={config.item}; expected {config.item} among them, or no move="
        )


def source_of(config: PlaceConfig) -> Source | None:
    """Read the file whole; return None for rooms in JSON, which are read one after the other.

    Raises InputError for an option that does not apply to the file's format, and if no file can be read.
    """
    path = Path(config.rooms)
    if config.rooms == STANDARD or format_of(path) == "json":
        check_not_given(config.rooms, into=config.into, categories=config.categories)
        return None
    return opened(
        path,
        move=config.move,
        into=config.into,
        room_type=config.room_type,
        categories=Path(config.categories) if config.categories else None,
        unit=config.unit,
    )


def out_files(config: PlaceConfig, suffix: str) -> list[Path]:
    """The files to write: one, or in formats that hold each room once, one for each choice.

    Raises InputError where one is there already.
    """
    source = Path(config.rooms)
    source = source.resolve() if source.is_dir() else source.absolute()  # resolved, as .. has no name to build on
    name = source.name if source.is_dir() else name_of(source, source)
    out = Path(config.out) if config.out else source.with_name(f"{name}-placed{suffix}")
    shard, shards = config.shard_of
    if shards > 1:
        out = out.with_name(f"{out.stem}-{shard}of{shards}{out.suffix}")
    last = 1 if suffix == JSON else config.choices
    files = [out if n == 1 else out.with_name(f"{out.stem}-{n}{out.suffix}") for n in range(1, last + 1)]
    for file in files:
        check_new(file, suffix)
    return files


def carry_out(config: PlaceConfig) -> None:
    """Place as configured. Raises Incomplete where something is not placed, or a room cannot be read."""
    tally = run(config).tally
    if tally.placed < tally.items:
        raise Incomplete("not everything is placed, as is said above")
    if tally.left_out or tally.unread:
        raise Incomplete("not all rooms could be read, as is said above")


main = command("place", PlaceConfig, carry_out)

if __name__ == "__main__":
    main()
