"""Files of rooms in JSON: a room a line in a .jsonl file, one or a list of them in a .json file.

`layoutrl.rooms.documents` has every field. Errors name the file, the line, the room, the field and what is expected.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from layoutrl import InputError
from layoutrl.rooms.categories import NO_ROOM, own_names
from layoutrl.rooms.collection import Collection, taken_for
from layoutrl.rooms.documents import check_room_type, name_in, parsed, room_from_dict, room_to_dict
from layoutrl.rooms.room import Room, RoomError
from layoutrl.rooms.units import UNITS, in_metres, read_as, unit_line, unit_of

SUFFIXES = (".json", ".jsonl")
HOMES = (".sh3d", ".sh3x")  # of Sweet Home 3D: of the program, and of its online edition
FORMATS = (".json", ".jsonl", ".gz", *HOMES)  # that rooms and homes are read from
PART = ".part"  # suffix of a folder in which a file is still being written


def read_rooms(path: Path | str, strict: bool = False, unit: str = "auto", room_type: str | None = None) -> Collection:
    """Read one .json or .jsonl file, or every such file below a folder.

    Lengths are in `unit`: m, cm, mm, in, ft, or auto, which infers one of the first three from the size of a file's
    rooms and doors, and notes it unless it is m. `room_type`, if given, is the type of rooms that say none, unless
    their id or furniture tells another. A room that cannot be used is left out and named; with `strict` it raises
    InputError.
    Raises InputError where there is no file to read, or no such unit or type.
    """
    if unit not in ("auto", *UNITS):
        raise InputError(f"unit: expected one of auto, {', '.join(UNITS)}; got {unit}")
    if room_type is not None:
        check_room_type(room_type)
    collection = Collection(f"json {path}")
    seen: set[str] = set()
    for file in room_files(Path(path)):
        read = list(documents_of(file))
        documents = [document for _, document in read]
        in_file = unit_of(documents) if unit == "auto" else unit
        if in_file != unit and in_file != "m":
            collection.notes.append(f"{file}: {unit_line(in_file, documents)}")
        for where, document in read:
            typed, told = with_type(document, room_type)
            try:
                room = room_from_dict(in_metres(typed, UNITS[in_file]))
                if room.id in seen:
                    raise RoomError("id", f"expected a name of its own; got {room.id!r}, as an earlier room has it")
            except RoomError as error:
                message = f"{name_in(document)}{error}{read_as(in_file, error)}"
                if strict:
                    raise InputError(f"{where}: {message}") from None
                collection.left_out.append((where, message))
            else:
                seen.add(room.id)
                collection.rooms.append(room)
                if not told:
                    collection.notes.append(taken_for(room))
    return collection


def with_type(document: Any, room_type: str | None) -> tuple[Any, bool]:
    """Return the document of a room with a type, and whether the document itself tells it.

    If it says none, null or "", its id or its furniture tells the type, else it is `room_type`. The document of a room
    that nobody furnishes, or of no room, is unchanged; so are all where `room_type` is None.
    """
    says_none = isinstance(document, dict) and "outline" in document and document.get("room_type") in (None, "")
    if room_type is None or not says_none:
        return document, True
    furniture = own_names().ours(document).get("furniture")
    entries = furniture if isinstance(furniture, list) else []
    held = [str(entry.get("category")) for entry in entries if isinstance(entry, dict)]
    told = own_names().room_type(str(document.get("id")), held)
    return (document if told == NO_ROOM else document | {"room_type": told or room_type}), told is not None


def write_rooms(path: Path | str, rooms: Iterable[Room]) -> None:
    """Write rooms to a .jsonl file, one a line; or to a .json file, one by itself, others as a list.

    A file that is there is overwritten. Raises InputError for two rooms of one id, of which only one could be read.
    """
    rooms = list(rooms)
    twice = [room_id for room_id, count in Counter(room.id for room in rooms).items() if count > 1]
    if twice:
        raise InputError(
            f"rooms: {twice[0]!r:.60} is the id of several; expected one of its own for each, as Answer.documents gives"
        )
    lines = [json.dumps(room_to_dict(room)) for room in rooms]
    if Path(path).suffix.lower() == ".json" and len(lines) != 1:
        lines = ["[" + ",\n".join(lines) + "]"]
    Path(path).write_text("".join(f"{line}\n" for line in lines), encoding="utf-8", newline="\n")


def check_not_given(rooms: Path | str, **given: object) -> None:
    """Raise InputError for an option that is given (not None) though rooms in JSON say it themselves."""
    for name, value in given.items():
        if value is not None:
            raise InputError(f"{name}: rooms of {rooms} say themselves what and where they are; expected no {name}=")


def check_new(out: Path | str, suffix: str) -> None:
    """Raise InputError unless `out` is a new file of this suffix: what `out` names is never overwritten."""
    out = Path(out)
    if out.exists() or out.suffix != suffix:
        what = "is there already" if out.exists() else f"is no {suffix} file"
        raise InputError(f"out: {out} {what}; expected the name of a new {suffix} file, as out=<file>")


def room_files(path: Path) -> list[Path]:
    """The files of rooms at `path`, in order of their names. Raises InputError where there is none."""
    if not path.exists():
        raise InputError(f"{path}: no such file or folder; expected a .json or .jsonl file of rooms")
    files = files_below(path, SUFFIXES)
    if not files:
        what = "files of rooms in this folder; found none" if path.is_dir() else "file, or a folder; it is neither"
        raise InputError(f"{path}: expected {' or '.join(SUFFIXES)} {what}")
    return files


def files_below(path: Path, suffixes: Sequence[str], but: Sequence[str] = ()) -> list[Path]:
    """Return a file, or the files below a folder with these suffixes, without the names `but`, in a fixed order.

    The order is the same on all systems. A file in a folder <name>.part is still being written, and is left out.
    Of .gz files in a folder only .json.gz and .jsonl.gz are returned, no archives.
    """

    def suits(file: Path) -> bool:
        growing = any(Path(part).suffix == PART for part in file.relative_to(path).parts[:-1])
        archive = file.suffix.lower() == ".gz" and Path(file.stem).suffix.lower() not in SUFFIXES  # as .tar.gz
        named = file.suffix.lower() in suffixes and file.name not in but and not archive
        return named and file.is_file() and not growing

    found = [path] if path.is_file() else filter(suits, path.rglob("*"))
    return sorted(found, key=lambda file: file.parts)  # paths by themselves are in another order on Windows


def name_of(file: Path, root: Path) -> str:
    """Return the name of a file at or below `root`: its path from there, with slashes and without the suffix."""
    way = Path(file.name) if file == root else file.relative_to(root)
    while way.suffix.lower() in FORMATS:  # both of .jsonl.gz; what follows another dot belongs to the name
        way = way.with_suffix("")
    return way.as_posix()


def documents_of(file: Path) -> Iterator[tuple[str, Any]]:
    """Yield (where it is, what `parsed` returns) for each room in a file. Raises InputError if it cannot be read."""
    try:
        with file.open("rb") as stream:
            if file.suffix.lower() == ".jsonl":
                yield from (
                    (f"{file}:{n}", parsed(line, line=True)) for n, line in enumerate(stream, 1) if line.strip()
                )
                return
            document = parsed(stream.read())
        if isinstance(document, list):
            yield from ((f"{file}[{k}]", entry) for k, entry in enumerate(document))
        else:
            yield f"{file}:1", document
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror})") from None
