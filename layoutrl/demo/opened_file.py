"""A file that somebody opens on the page: what it is called, what is in it, and what messages about it say."""

from __future__ import annotations

from pathlib import Path

from layoutrl import InputError
from layoutrl.demo.home import NAME, TAKEN_FOR
from layoutrl.rooms.documents import parsed
from layoutrl.rooms.formats import Source, format_of, opened
from layoutrl.rooms.room import RoomError
from layoutrl.rooms.sources.sweethome3d import read_home

MOST_ENTRIES = 100_000  # files in a home: the list of them, some 60 MB then, is held in memory
LONGEST_NAME = 60  # letters of a room's name in a message, and of a file's at the start of its rooms' ids
NO_NAME = '/\\:*?"<>|'  # characters that no file's name has, on this system or another

# What messages about a file say about options of commands and suffixes, and what the page says instead.
OPTIONS = {
    " (categories=<file> names it)": "",
    " (into=<id>)": "",
    " (a room over several lines is a .json file)": "",
    "(unit=m if they are)": "(choose unit m if they are)",
    "(unit=in if lengths are inches)": "(choose unit in if lengths are inches)",
}


def stem_of(called: str) -> str:
    """Return a name for a temporary file, without suffix, from what the client calls it: never a path."""
    letters = (letter if letter.isprintable() and letter not in NO_NAME else "_" for letter in called[:LONGEST_NAME])
    return "".join(letters).strip(" .") or Path(NAME).stem


def suffix_of(content: bytes) -> str:
    """Return the suffix for content: .sh3d of a ZIP, .json of one document, even broken, .jsonl of an object a line."""
    if content.startswith(b"PK"):
        return ".sh3d"
    if content.lstrip().startswith(b"[") or not isinstance(parsed(content), RoomError):
        return ".json"
    lines = content.strip().split(b"\n")
    # Of an object over several lines none that begins at the margin is an object by itself.
    alone = any(line.startswith(b"{") and isinstance(parsed(line), dict) for line in lines)
    return ".jsonl" if alone or len(lines) == 1 else ".json"


def check_home(content: bytes) -> None:
    """Raise InputError if a ZIP has more files in it than can be listed soon; their size does not matter."""
    if content.count(b"PK\1\2") > MOST_ENTRIES:  # begins each entry of a ZIP's list of files
        raise InputError(f"file: expected at most {MOST_ENTRIES:,} files in a home")


def source_of(path: Path, unit: str) -> Source:
    """The rooms of a file, lengths in JSON in a unit. Raises InputError where it cannot be read."""
    if path.suffix == ".sh3d":
        return read_home(path, room_type=TAKEN_FOR)
    kind = format_of(path)
    if kind == "procthor":  # a house names its furniture, and another file says how large that is
        raise InputError(
            f"{path}: houses of ProcTHOR are read by `place`, beside their asset database; expected rooms in JSON, "
            "a home of Sweet Home 3D or a house of 3D-FRONT"
        )
    return opened(path, unit=unit if kind == "json" else "auto", room_type=TAKEN_FOR)


def in_words_of_the_page(line: str, path: Path, name: str = "file") -> str:
    """A line on a file, without its path, and without options of commands that the page does not have."""
    for option, words in OPTIONS.items():
        line = line.replace(option, words)
    return line.replace(str(path), name)
