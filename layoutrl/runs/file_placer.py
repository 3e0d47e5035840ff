"""What `python -m layoutrl.place` does with a file's rooms: it reads, furnishes, reports, draws and writes them."""

from __future__ import annotations

import json
import re
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict
from importlib.util import find_spec
from itertools import islice
from pathlib import Path
from typing import IO, Any

from tqdm import tqdm

from layoutrl import InputError, __version__
from layoutrl.rooms.categories import ALL, names_in
from layoutrl.rooms.collection import naming, taken_for
from layoutrl.rooms.faults import MISSING
from layoutrl.rooms.files import FORMATS, files_below
from layoutrl.rooms.formats import Source, other_formats
from layoutrl.rooms.room import Room
from layoutrl.rooms.units import unit_line
from layoutrl.runs.answer import Answer
from layoutrl.runs.config import PlaceConfig
from layoutrl.runs.files import check_writable
from layoutrl.runs.room_placer import RoomPlacer
from layoutrl.runs.streams import (
    STANDARD,
    Entry,
    Growing,
    Tally,
    blocks,
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


class FilePlacer:
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
            left_out = self.source.collection.left_out if self.source else []
            if those := [f"{label} is left out: {why}" for label, why in left_out if naming(self.config.only, label)]:
                return f"{'; '.join(those)}; expected the id of a room that could be read"
            known = ", ".join(self._ids) + (", ..." if len(self._ids) == LISTED else "")
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
        rooms = [[answer.found(n) for n in range(len(answer.choices))] for block in self.answers() for answer in block]
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
        entries = self._source_entries(self.source, first) if self.source else self._json_entries(first)
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

    def _source_entries(self, source: Source, first: int) -> Iterator[Entry | None]:
        """Return the rooms of the source from `first` on, of this shard; say, and count, what it has besides."""
        others = tuple(f"  {room.id}: " for room in source.collection.rooms if not self.placer.means(room))
        for line in str(source.collection).splitlines():
            if not line.startswith(others):  # such a room stays as it is, whatever it would get
                self.say(line)
        if first == 0:
            homeless = [] if self.config.only else source.collection.homeless
            self.tally.items += sum(self.config.item in (None, c) for c in homeless)
            self.tally.unread = source.collection.unread(self.config.only)
        return islice(source_entries(source), first, None, self.config.shard_of[1])

    def _json_entries(self, first: int) -> Iterator[Entry | None]:
        """Return the rooms in JSON from `first` on, of this shard; say which files beside them are not read."""
        for line in other_formats(Path(self.config.rooms), "json") if self.config.rooms != STANDARD else []:
            self.say(line)
        return json_entries(self.config, first, self.config.shard_of[1])

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
        self._unmet -= naming(self.config.only, room.id)
        if len(self._ids) < LISTED:
            self._ids.append(room.id)
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
