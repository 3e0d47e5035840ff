"""python -m layoutrl.place [run=<folder>] rooms=<file> [choices=<n>] [pictures=<folder>] [out=<file>]

Places the items of a file's rooms that have no center. By default the agents in the package do it, each in rooms of its
type, and the constraint search helps where one of their layouts has a fault or an oddity. With run= the agent of a
training run does it; with by=search or by=annealer, a rival. `furnish` does the same with rooms in memory.
"""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass, replace
from functools import cache
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import IO, Any

from tqdm import tqdm

from layoutrl import InputError, __version__
from layoutrl.env.arguments import check_rooms, is_whole
from layoutrl.rooms.categories import ALL, RUG, names_in, names_of, nearest
from layoutrl.rooms.collection import taken_for
from layoutrl.rooms.documents import room_to_dict
from layoutrl.rooms.faults import MISSING
from layoutrl.rooms.files import FORMATS, check_new, check_not_given, files_below, name_of
from layoutrl.rooms.formats import Source, format_of, opened, other_formats, to_place
from layoutrl.rooms.room import Item, Room
from layoutrl.rooms.units import unit_line
from layoutrl.runs.answer import Answer
from layoutrl.runs.commands import Incomplete, command
from layoutrl.runs.config import PlaceConfig, TrainConfig, composed
from layoutrl.runs.files import check_writable
from layoutrl.runs.folder import load_config
from layoutrl.runs.room_placer import RoomPlacer, matched
from layoutrl.runs.streams import (
    STANDARD,
    Entry,
    Growing,
    Tally,
    blocks,
    count,
    growing,
    inputs,
    json_entries,
    source_entries,
)
from layoutrl.runs.wording import any_of

JSON = ".jsonl"  # the suffix of files that grow room by room; others are written whole
PATIENCE = 10  # lines: if none of the first ones is a JSON object, it is no file of rooms
LISTED = 20  # ids of rooms, at most, in the message that `only` names none
LONGEST = 180  # bytes of a room's id in the name of its picture: file systems take 255
CONTROL = re.compile(r"[\x00-\x1f\x7f-\x9f]")
NOT_DECISIVE = ("out", "device", "pictures", "drawing")  # options that do not change what is placed where


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
    seed: int = 0,
) -> list[Answer]:
    """Furnish rooms in memory as the command does: return for each room up to `choices` layouts, best first.

    The options are those of conf/place.yaml. Items have categories; `move` may also have everyday names, separated by
    commas. `stood` is the furniture of each room as it stood, needed where items have lost their centers already
    (`Source.stood`). With it only items without a center are placed; give the same `move` as to `opened`, since after
    "all" what nobody can place stays. An item that cannot be placed stays where it stood, or has no center. Raises
    InputError for what is no list of rooms, for an invalid option, and if `run` is not the folder of a training run.
    """
    check_rooms(rooms)
    run = str(run) if isinstance(run, Path) else run
    for name, value in {"choices": choices, "seed": seed}.items():
        if not is_whole(value):
            raise InputError(f"{name}: expected a whole number; got {value!r:.60}")
    for name, text in {"move": move, "by": by, "run": run}.items():
        if not isinstance(text, str | None):
            raise InputError(f"{name}: expected text, or None; got {text!r:.60}")
    config = replace(in_memory(), choices=choices, move=move, by=by, run=run, seed=seed)
    check_who(config)
    config = by_category(config)
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
        Entry(room.id, brief, room_to_dict(room), stood=tuple(items))
        for room, brief, items in zip(rooms, briefs, stood, strict=True)
    ]
    return RoomPlacer(config).place(entries)


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
    work = Work(config, source, total, sys.stderr if piped else sys.stdout)
    if names_in(asked.move) != names_in(config.move):
        work.say(f"move: {asked.move} is taken for {config.move}, and all that is one moves")
    try:
        if suffix == JSON:
            work.write_each(files[0] if files else None)
        else:
            files = work.write_whole(files)
    finally:  # delete the pictures of rooms that were not written, so that the same command can make them again
        for picture in work.drawn:
            picture.unlink(missing_ok=True)
    work.say_unmet()
    if not work.asked:
        raise InputError(f"rooms: {work.nothing}")
    work.say(str(work.tally))
    for file in files:
        work.say(f"wrote {file}")
    return Done(files, work.tally)


class Work:
    """One run of the command: the rooms of a file, furnished a block at a time."""

    def __init__(self, config: PlaceConfig, source: Source | None, total: int | None, says: IO[str] | None):
        self.config, self.source, self.total = config, source, total
        self.placer = RoomPlacer(config)
        self.tally = Tally()
        self._says = says
        self._units = {"m", config.unit}  # no message about these
        self._seen: set[str] | None = set()  # categories so far; None in a resumed run, which has not seen them all
        self._unmet = {*config.only_rooms}  # the names in `only` that no room so far has
        self._ids: list[str] = []  # of the first rooms
        self._objects = 0  # entries that are JSON objects, right or wrong
        self.drawn = list[Path]()  # pictures of rooms that are not written yet

    def say(self, line: str) -> None:
        """Print a line above the progress bar, control characters escaped: a name must not command the terminal."""
        if self._says is None:  # the stream is closed
            return
        tqdm.write(CONTROL.sub(lambda found: repr(found[0])[1:-1], line), file=self._says)

    @property
    def asked(self) -> bool:
        """Whether anything was to be placed. Always true of one shard of several, which may have nothing."""
        return self.tally.rooms > 0 or self.config.shard_of != (0, 1)

    @property
    def nothing(self) -> str:
        """Why nothing was to be placed."""
        rooms, move, item = self.config.rooms, self.config.move, self.config.item
        if (self.source and not self.source.collection.rooms) or 0 < self.tally.left_out == self.tally.entries:
            return f"no room of {rooms} could be read, as is said above; expected one or more"
        if not self.tally.entries:
            return f"{rooms} is empty; expected one room or more"
        if self._none_meant:
            known = ", ".join(self._ids) + ", ..." * (len(self._ids) == LISTED)
            return f"{rooms} has no room called {' or '.join(sorted(self._unmet))}; expected the id of one: {known}"
        named = item or move or ALL
        what = "an item" if ALL in names_in(named) else any_of(sorted(names_in(named)))
        anew = "furniture without a center, or what is to be placed anew, as move=wardrobe or move=all"
        return f"{rooms} has no room with {what} to place; expected {'one or more' if move else anew}"

    @property
    def _none_meant(self) -> bool:
        """Whether `only` names rooms, and no room so far has any of the names."""
        return bool(self._unmet) and self._unmet == self.config.only_rooms

    def write_each(self, file: Path | None) -> None:
        """Write each block of rooms once it is furnished: to `file`, new or resumed, or if None to standard output."""
        if file is None:
            grown: AbstractContextManager[Growing] = nullcontext(Growing(sys.stdout.buffer, Tally()))
        else:
            grown = growing(file, about(self.config, self.source), again=self.config.rooms != STANDARD)
        with grown as sheet:
            self.tally = sheet.tally
            for block in self.answers():
                if block:  # a file of which no room can be read leaves no state to resume from
                    sheet.add(document for answer in block for document in answer.documents())
                self.drawn.clear()
            sheet.wanted = self.asked

    def write_whole(self, files: Sequence[Path]) -> list[Path]:
        """Furnish all rooms, then write the source once for each choice; return those of `files` that were written.

        A room with fewer layouts than that has its last one in the remaining files.
        """
        assert self.source is not None
        rooms = [[answer.found(n) for n in range(len(answer.layouts))] for block in self.answers() for answer in block]
        made = [*files[: max(map(len, rooms), default=0) if self.asked else 0]]
        for n, file in enumerate(made):
            file.parent.mkdir(parents=True, exist_ok=True)
            self.source.write([choices[min(n, len(choices) - 1)] for choices in rooms], file)
        self.drawn.clear()
        return made

    def say_unmet(self) -> None:
        """Print which items of `move` are locked, and which names in `move` and `only` no room has."""
        named = names_in(self.config.move)
        if locked := [f"{name} ({n})" for name, n in self.tally.locked.items()]:
            self.say(f"move: what is locked stays: {', '.join(locked)}")
        if self._seen is not None and (unmet := sorted(named - {ALL} - self._seen)) and not self._none_meant:
            self.say(f"move: no room that was read has {any_of(unmet)}")
        if self.tally.rooms and self._seen is not None and self._unmet:
            self.say(f"only: no room that was read is called {' or '.join(sorted(self._unmet))}")

    def answers(self) -> Iterator[list[Answer]]:
        """Furnish the rooms that are not done yet, in order; yield a block when it is counted, drawn and reported.

        Rooms that cannot be read are counted and reported, but not yielded. Raises InputError if none of the first
        PATIENCE lines is a JSON object.
        """
        shard, shards = self.config.shard_of
        done = self.tally.entries
        first = shard + done * shards
        folder = picture_folder(self.config, new=not done)
        if done:
            self.say(f"goes on after {done} rooms")
            self._seen = None
        entries: Iterator[Entry | None]
        if self.source:
            others = tuple(f"  {room.id}: " for room in self.source.collection.rooms if not self.placer.means(room))
            for line in str(self.source.collection).splitlines():
                if not line.startswith(others):  # such a room stays as it is, whatever it would get
                    self.say(line)
            if shard == 0 and not done:
                homeless = [] if self.config.only else self.source.collection.homeless
                self.tally.items += sum(self.config.item in (None, c) for c in homeless)
                self.tally.unread = self.source.collection.unread
            entries = islice(source_entries(self.source), first, None, shards)
        else:
            for line in other_formats(Path(self.config.rooms), "json") if self.config.rooms != STANDARD else []:
                self.say(line)
            entries = json_entries(self.config, first, shards)
        length = None if self.total is None else max(len(range(shard, self.total, shards)), done)
        nobody = True if sys.stderr is None else None  # None: tqdm shows no bar where stderr is no terminal
        with tqdm(None, "furnishing", length, initial=done, unit="room", disable=nobody) as bar:
            for block in blocks(entries):
                readable = iter(self.placer.place([entry for entry in block if entry.room]))
                answers = []
                for entry in block:
                    self.tally.entries += 1
                    self._objects += bool(entry.document)
                    if entry.room is None:
                        self._left_out(entry, new=not done)
                        continue
                    self._met(entry, entry.room)
                    answers.append(answer := next(readable))
                    self._told(answer, folder and folder / f"{shard + (self.tally.entries - 1) * shards + 1}")
                yield answers
                bar.update(len(block))

    def _left_out(self, entry: Entry, new: bool) -> None:
        """Count and report a room that cannot be read.

        Raises InputError if none of the first PATIENCE lines, in a run that is new, is a JSON object.
        """
        self.tally.left_out += 1
        self.say(f"{entry.where}: left out: {entry.problem}")
        by_line = self.config.rooms == STANDARD or self.config.rooms.lower().endswith(JSON)
        if by_line and new and self.tally.entries == PATIENCE and not self._objects:
            raise InputError(
                f"rooms: expected one room a line, in JSON; none of the first {PATIENCE} lines is one "
                "(a room over several lines is a .json file)"
            )

    def _met(self, entry: Entry, room: Room) -> None:
        """Note what the messages at the end need to know of a room, and report its unit if that is new."""
        named = names_in(self.config.move)
        self._unmet -= matched(self.config.only, room)
        self._ids += [room.id] if len(self._ids) < LISTED else []
        if self.placer.means(room):
            for name in (item.category for item in entry.stood if item.locked):
                if name in named or ALL in named:
                    self.tally.locked[name] = self.tally.locked.get(name, 0) + 1
            if self._seen is not None:
                self._seen |= {item.category for item in entry.stood}
        if entry.unit not in self._units:
            self._units.add(entry.unit)
            self.say(unit_line(entry.unit, [entry.document]))
        if not entry.told and self.placer.means(room):
            self.say(taken_for(room))

    def _told(self, answer: Answer, picture: Path | None) -> None:
        if not answer.request.wanted:
            return
        self.tally.rooms += 1
        self.tally.items += len(answer.request.wanted)
        self.tally.placed += answer.placed(0)
        for fault in [fault for _, fault in answer.wrong[0] if fault != MISSING]:
            self.tally.faults[fault] = self.tally.faults.get(fault, 0) + 1
        for line in answer.lines():
            self.say(line)
        if picture:
            self._draw(answer, picture)

    def _draw(self, answer: Answer, picture: Path) -> None:
        from layoutrl.figures.drawing import draw  # matplotlib, which takes a second

        picture.parent.mkdir(parents=True, exist_ok=True)
        for n, (layout, wrong) in enumerate(zip(answer.layouts, answer.wrong, strict=True), 1):
            room_id = re.sub(r"[^\w.-]+", "_", layout.id).encode()[:LONGEST].decode(errors="ignore")
            choice = f"-{n}" if n > 1 else ""
            file = picture.with_name(f"{picture.name}-{room_id}{choice}.{self.config.drawing}")
            self.drawn.append(file)
            draw(layout, wrong, file)


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


def picture_folder(config: PlaceConfig, new: bool) -> Path | None:
    """Return the folder for pictures, which is made with the first; None if none are asked for.

    Raises InputError if it is a file or cannot be made, if it is for a `new` run and not empty, and for DXF without
    ezdxf.
    """
    if config.pictures is None:
        return None
    if config.drawing == "dxf" and find_spec("ezdxf") is None:
        raise InputError("drawing: dxf needs ezdxf; expected it: in the checkout, pip install '.[dxf]'")
    shard, shards = config.shard_of
    folder = Path(config.pictures) / (f"{shard}of{shards}" if shards > 1 else "")
    if folder.is_file() or (folder.is_symlink() and not folder.exists()):
        raise InputError(f"pictures: {folder} is a file; expected a new folder, as pictures=<folder>")
    check_writable(folder, "pictures")
    if new and folder.exists() and any(folder.iterdir()):
        raise InputError(f"pictures: {folder} is not empty; expected a new folder, as pictures=<folder>")
    return folder


def about(config: PlaceConfig, source: Source | None) -> dict[str, Any]:
    """Return all that decides what is placed where, as JSON keeps it: a stopped run resumes only with the same."""
    if config.rooms == STANDARD:
        rooms: Any = time.time_ns()  # never the same: other rooms may come from standard input
    else:
        rooms = [*map(stamp, files_below(Path(config.rooms), FORMATS) if source else inputs(config))]
    read: dict[str, Any] = {
        "rooms": rooms,
        "categories": config.categories and stamp(Path(config.categories)),
        "run": config.run and [stamp(file) for file in sorted(Path(config.run).glob("checkpoints/*"))],
    }
    said = {name: value for name, value in asdict(config).items() if name not in NOT_DECISIVE}
    kept: dict[str, Any] = json.loads(json.dumps(said | read | {"version": __version__}))
    return kept


def stamp(file: Path) -> tuple[str, int, int]:
    """Return the absolute path of a file, its size in bytes, and when it was last changed, in nanoseconds."""
    return str(file.absolute()), file.stat().st_size, file.stat().st_mtime_ns


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
