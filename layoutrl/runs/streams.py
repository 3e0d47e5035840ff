"""Rooms of files, read one by one, and files of answers that grow with them: no .jsonl file is too long for memory."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from itertools import chain, islice
from pathlib import Path
from typing import IO, Any, TypeVar

from layoutrl import InputError
from layoutrl.rooms.categories import Names, names_of
from layoutrl.rooms.documents import name_in, parsed, room_from_dict, room_to_dict
from layoutrl.rooms.files import PART, documents_of, room_files, with_type
from layoutrl.rooms.formats import Source, to_place
from layoutrl.rooms.room import Item, Room, RoomError
from layoutrl.rooms.units import UNITS, in_metres, read_as, unit_of
from layoutrl.runs.config import PlaceConfig
from layoutrl.runs.files import LOCK, locked, write_json

STANDARD = "-"  # the name of standard input and output
HEAD = 100  # first rooms of a file, which tell its unit
READ = 2**16  # bytes of standard input, at most, that are taken at once
MOST = 256  # rooms that are furnished in one batch
SOON = 2.0  # seconds that a batch should take: about as much is lost where a run is stopped
T = TypeVar("T")


@dataclass(frozen=True)
class Entry:
    """A room of a file, with its document; or what is wrong with it (`room` is None).

    The document is empty if it is not a JSON object.
    """

    where: str  # file and line or entry, or the room's id
    room: Room | None
    document: dict[str, Any]
    problem: str = ""
    unit: str = "m"  # of the document
    told: bool = True  # whether the document tells the type of the room
    stood: tuple[Item, ...] = ()  # its furniture as the file has it, before `move` took any pose

    @property
    def words(self) -> list[str]:
        """What the document calls each item of the room: in JSON what its writer does, else categories."""
        return [each["category"] for each in self.document["furniture"]]


def json_entries(config: PlaceConfig, first: int, step: int) -> Iterator[Entry | None]:
    """Yield the rooms in JSON of a file, a folder, or standard input (STANDARD): from `first` on, each `step`-th.

    Yields None where the writer to standard input may be waiting for an answer.
    """
    seen, names = 0, None if config.run else names_of()  # an agent of the user's own has words of its own
    for given in _documents(config):
        if given is None:
            yield None
            continue
        if seen >= first and (seen - first) % step == 0:
            yield _entry(*given, config, names)
        seen += 1


def _entry(where: str, document: Any, unit: str, config: PlaceConfig, names: Names | None) -> Entry:
    document, told = with_type(document, config.room_type)
    try:
        known = names.ours(document) if names else document
        room = room_from_dict(in_metres(known, UNITS[unit]))
        return Entry(where, to_place(room, config.move), document, unit=unit, told=told, stood=room.furniture)
    except RoomError as error:
        problem = f"{name_in(document)}{error}{read_as(unit, error)}"
        return Entry(where, None, document if isinstance(document, dict) else {}, problem)


def _documents(config: PlaceConfig) -> Iterator[tuple[str, Any, str] | None]:
    """Yield (where, document, unit) of each room, or None as `standard_input` does. The first rooms tell unit=auto."""
    for file in [None] if config.rooms == STANDARD else inputs(config):
        documents = documents_of(file) if file else standard_input()
        first = list(islice((each for each in documents if each), HEAD if file else 1))  # input must not wait
        unit = unit_of(document for _, document in first) if config.unit == "auto" else config.unit
        yield from (each and (*each, unit) for each in chain(first, documents))


def inputs(config: PlaceConfig) -> list[Path]:
    """Return the files of rooms to read, without those that this command writes into the same folder."""
    path = Path(config.rooms)
    files = room_files(path)
    if path.is_file() or not config.out:
        return files
    out = Path(config.out).resolve()
    own = re.compile(rf"{re.escape(out.stem)}(-\d+of\d+)?{re.escape(out.suffix)}")
    return [file for file in files if file.resolve().parent != out.parent or not own.fullmatch(file.name)]


def standard_input() -> Iterator[tuple[str, Any] | None]:
    """Yield (where, what `parsed` makes of it) for each line, and None after each chunk read: the writer may be waiting
    for an answer. Raises InputError if standard input is closed."""
    if sys.stdin is None:
        raise InputError("rooms: standard input is closed; expected rooms there, or rooms=<file>")
    stream: Any = sys.stdin.buffer
    number = 1
    begun: list[bytes] = []  # parts of the line of this number
    for read in iter(lambda: stream.read1(READ), b""):
        *ends, begins = read.split(b"\n")
        for end in ends:
            if line := b"".join([*begun, end]).strip():
                yield f"standard input:{number}", parsed(line, line=True)
            number, begun = number + 1, []
        begun.append(begins)
        yield None
    if line := b"".join(begun).strip():
        yield f"standard input:{number}", parsed(line, line=True)


def source_entries(source: Source) -> Iterator[Entry]:
    """Yield the rooms of a file of another format. Its collection says which are left out."""
    for room, stood in zip(source.collection.rooms, source.stood, strict=True):
        yield Entry(room.id, room, room_to_dict(replace(room, furniture=stood)), stood=stood)


def count(config: PlaceConfig) -> int | None:
    """Count the rooms in JSON; a blank line counts as one. None for standard input."""
    if config.rooms == STANDARD:
        return None
    total = 0
    for file in inputs(config):
        if file.suffix.lower() != ".jsonl":
            total += sum(1 for _ in documents_of(file))
            continue
        lines, last = 0, b"\n"
        with file.open("rb") as stream:
            for block in iter(lambda: stream.read(1 << 20), b""):
                lines, last = lines + block.count(b"\n"), block[-1:]
        total += lines + (last != b"\n")
    return total


def blocks(entries: Iterable[T | None]) -> Iterator[list[T]]:
    """Group entries into blocks: one, then twice as many while a block takes less than SOON, up to MOST.

    None ends a block.
    """
    size, block = 1, list[T]()
    for entry in chain(entries, [None]):
        if entry is not None:
            block.append(entry)
        full = len(block) == size
        if full or (entry is None and block):
            began = time.monotonic()
            yield block
            if full and time.monotonic() - began < SOON:
                size = min(2 * size, MOST)
            block = []


@dataclass
class Tally:
    """What was done so far."""

    entries: int = 0
    left_out: int = 0  # entries that could not be read
    unread: int = 0  # rooms and files of homes and houses that could not be read
    rooms: int = 0  # in which something was to be placed
    items: int = 0  # to be placed
    placed: int = 0
    faults: dict[str, int] = field(default_factory=dict)  # of the best layout of each room
    locked: dict[str, int] = field(default_factory=dict)  # by category: items that `move` names, and that are locked

    def __str__(self) -> str:
        rooms = "1 room" if self.rooms == 1 else f"{self.rooms} rooms"
        said = [f"placed {self.placed} of {self.items} items in {rooms}"]
        said += [f"{number} {fault}" for fault, number in self.faults.items()]
        if self.left_out:
            said.append(f"{self.left_out} of {self.entries} rooms could not be read, and are not in what is written")
        return "; ".join(said)


class Growing:
    """An output file that grows line by line, and the tally of what is in it."""

    def __init__(
        self, stream: IO[bytes], tally: Tally, state: Path | None = None, about: Any = None, again: bool = False
    ):
        self.tally = tally
        self.wanted = True  # whether the file is kept once it is whole
        self._stream, self._state, self._about, self._again = stream, state, about, again

    def add(self, documents: Iterable[dict[str, Any]]) -> None:
        """Append rooms, and note that they are done, so that a resumed run does not do them again.

        Raises InputError if they cannot be written, as on a full disk.
        """
        lines = "".join(json.dumps(document) + "\n" for document in documents)
        try:
            self._stream.write(lines.encode())
            self._stream.flush()
            if self._state:
                kept = {"about": self._about, "bytes": self._stream.tell(), "tally": asdict(self.tally)}
                os.fsync(self._stream.fileno())  # on the disk before the state says that they are done
                write_json(self._state, kept)
        except BrokenPipeError:  # nobody reads any more
            raise
        except OSError as error:
            then = ": the same command goes on then" if self._again else ""
            raise InputError(
                f"out: cannot write {self._stream.name} ({error.strerror}); expected a disk with room{then}"
            ) from None


@contextmanager
def growing(out: Path, about: dict[str, Any], *, again: bool = True) -> Iterator[Growing]:
    """Yield a file that grows in the folder <name>.part, and gets its own name once it is whole.

    If a stopped run has left that folder, and was `about` the same, it is resumed; `again` says whether the same
    command can do that. Raises InputError if the folder is damaged, about something else or in use by another process,
    and if the file exists at the end.
    """
    folder = out.with_name(f"{out.name}{PART}")
    if folder.is_file():
        raise InputError(f"out: {folder} is a file; expected another out=<file>, or that it is removed")
    folder.mkdir(parents=True, exist_ok=True)
    lines, state = folder / "rooms.jsonl", folder / "state.json"
    with locked(folder / LOCK, wait=False):
        kept = _kept(state, lines, about)
        try:
            with lines.open("ab") as stream:
                stream.truncate(kept["bytes"])
                grown = Growing(stream, Tally(**kept["tally"]), state, about, again)
                yield grown
        except BaseException as error:
            if not state.exists():
                shutil.rmtree(folder, ignore_errors=True)
            elif isinstance(error, KeyboardInterrupt):
                said = "the same command goes on where it was" if again else f"the rooms are in {lines}"
                print(said, file=sys.stderr)
            raise
        if grown.wanted:
            if out.exists():
                raise InputError(f"out: {out} was made meanwhile; expected no file there; the rooms are in {lines}")
            lines.rename(out)
        shutil.rmtree(folder, ignore_errors=True)  # on Windows the lock stays


def _kept(state: Path, lines: Path, about: dict[str, Any]) -> dict[str, Any]:
    """Return the state that a stopped run has left, or an empty one. Raises InputError if it cannot be resumed."""
    if not state.exists():
        return {"bytes": 0, "tally": asdict(Tally())}
    mend = f"another out=<file>, or that {state.parent} is removed"
    try:
        kept: dict[str, Any] = json.loads(state.read_text())
        other = [name for name, value in about.items() if kept["about"].get(name) != value]
        whole = lines.stat().st_size >= kept["bytes"] and Tally(**kept["tally"]).entries >= 0
    except (ValueError, LookupError, TypeError, AttributeError, FileNotFoundError):
        other, whole = [], False
    if other:
        raise InputError(f"out: a run was stopped there, with another {', '.join(other)}; expected the same, or {mend}")
    if not whole:
        raise InputError(f"out: what a run that was stopped has left is damaged; expected {mend}")
    return kept
