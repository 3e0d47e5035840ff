"""Rooms of the rule-based designer, kept in a cache file: designed once, read ever after."""

from __future__ import annotations

import hashlib
import os
import pickle
from contextlib import suppress
from functools import cache
from pathlib import Path

from layoutrl.rooms import designer, room
from layoutrl.rooms.designer.generator import Designs, Part, design_rooms


def read(root: Path | None, room_type: str, part: Part, seed: int, count: int) -> Designs:
    """The first `count` rooms of a part; `root` is the cache's folder, by default below the user's own cache.

    A cache file that cannot be read is made anew; one that cannot be written is done without. The files are
    pickles: name no folder that others can write to.
    """
    folder = default_cache() if root is None else root
    file = folder / f"{room_type}-{part}-seed{seed}-{count}-{rules_hash()}.pickle"
    try:
        kept = pickle.loads(file.read_bytes())
    except Exception:  # a broken pickle can raise anything
        kept = None
    if isinstance(kept, Designs):
        return kept
    designs = design_rooms(room_type, part, seed, count)
    partial = file.with_suffix(f".{os.getpid()}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        partial.write_bytes(pickle.dumps(designs))
        partial.replace(file)  # whole or not at all
    except OSError as error:
        print(f"designed rooms are not kept: {error}")
        with suppress(OSError):
            partial.unlink()
    return designs


def default_cache() -> Path:
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "layoutrl"


@cache
def rules_hash() -> str:
    """Of the designer's source code and of what a room is: a changed rule never meets old rooms."""
    rules = sorted(Path(designer.__path__[0]).glob("*.py"))
    code = b"".join(file.read_bytes() for file in [*rules, Path(room.__file__)])
    return hashlib.sha256(code).hexdigest()[:12]
