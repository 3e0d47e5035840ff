"""A cache of the rule-based designer's rooms: each room is designed once, and read from a file afterwards.

A file holds up to 100 rooms. Its first line is the SHA-256 of its name and of the rest. The rest is JSON: the rooms
without their numbers, how often each template was made and rejected, and the numbers of all rooms as little-endian
float64 in base64, since decimals take longer to read.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import sys
import tempfile
from collections import Counter
from contextlib import closing
from functools import cache
from itertools import chain, islice
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from layoutrl.rooms import clearances, designer, room
from layoutrl.rooms.designer.generator import Designs, Part, design_each, joined
from layoutrl.rooms.documents import LARGEST
from layoutrl.rooms.room import Item, Opening, Ring, Room

BLOCK = 100  # rooms per file
LARGEST_FILE = 2**20  # bytes; 100 rooms take less than a fifth of it


def read(root: Path | None, room_type: str, part: Part, seed: int, count: int) -> Designs:
    """Return the first `count` rooms of a part, read from the cache or designed now.

    `root` is the cache's folder, None for `default_cache()`. Each block of rooms is written as soon as it is designed,
    so that a run that is stopped is continued by the next. A file that is incomplete, or not of the cache, is designed
    anew. If one cannot be written, standard error says so, and no more are written.
    """
    folder = default_cache() if root is None else root
    blocks = [range(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK)]
    name = f"{room_type}-{part}-seed{seed}-{{}}-{{}}-{rules_hash()}.json"
    files = {block: folder / name.format(block.start, block.stop) for block in blocks}
    designs = {block: _read(files[block], room_type, len(block)) for block in blocks}
    missing = [block for block in blocks if designs[block] is None]
    keeps = True
    with closing(design_each(room_type, part, seed, list(chain(*missing)))) as designed:
        for block in missing:
            designs[block] = some = joined(islice(designed, len(block)))
            keeps = keeps and _written(files[block], some)
    return joined(some for some in designs.values() if some is not None)


def default_cache() -> Path:
    """Return the folder `layoutrl` in $XDG_CACHE_HOME or ~/.cache, or in the temporary folder if there is no home."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "layoutrl"
    except RuntimeError:  # a user without a home
        return Path(tempfile.gettempdir()) / "layoutrl"


@cache
def rules_hash() -> str:
    """Return a hash of the code of designer, clearances and rooms, so that rooms of old rules are never read."""
    rules = sorted(Path(designer.__path__[0]).glob("*.py"))
    code = b"".join(file.read_bytes() for file in [*rules, Path(clearances.__file__), Path(room.__file__)])
    return hashlib.sha256(code).hexdigest()[:12]


def _read(file: Path, room_type: str, count: int) -> Designs | None:
    """Return the rooms of a file; None if it is missing, broken, or does not hold `count` rooms."""
    try:
        if not file.is_file() or file.stat().st_size > LARGEST_FILE:
            return None
        digest, _, content = file.read_bytes().partition(b"\n")
        if digest != _digest(file, content):
            return None
        designs = _unpacked(content, room_type)
    except Exception:  # a planted file can make JSON, numpy or a room raise anything
        return None
    return designs if len(designs.rooms) == count else None


def _written(file: Path, designs: Designs) -> bool:
    """Write rooms to a file, and return whether that worked."""
    content = _packed(designs)
    partial = file.with_suffix(f".{uuid4().hex}")  # other processes may design the same rooms now
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            partial.write_bytes(_digest(file, content) + b"\n" + content)
            partial.replace(file)  # whole or not at all
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        print(f"designed rooms are not kept: {error}", file=sys.stderr)  # standard output may carry rooms
        return False
    return True


def _digest(file: Path, content: bytes) -> bytes:
    return hashlib.sha256(file.name.encode() + b"\n" + content).hexdigest().encode()


def _packed(designs: Designs) -> bytes:
    numbers: list[float] = []

    def corners(ring: Ring) -> int:
        numbers.extend(chain(*ring))
        return len(ring)

    rooms = []
    for r in designs.rooms:
        rings = corners(r.outline), [corners(wall) for wall in r.walls]
        openings = [(opening.kind, corners(opening.polygon)) for opening in r.openings]
        for item in r.furniture:
            assert item.center is not None  # the designer places every item
            numbers += *item.size, *item.center, item.degrees
        furniture = [(item.category, item.form, item.tucked) for item in r.furniture]
        rooms.append((r.id, *rings, openings, furniture, r.target))
    rejected = [(*reason, times) for reason, times in designs.rejected.items()]
    encoded = base64.b64encode(np.array(numbers, dtype="<f8").tobytes()).decode()
    return json.dumps((rooms, designs.made, rejected, encoded)).encode()


def _unpacked(content: bytes, room_type: str) -> Designs:
    """Undo `_packed`. Raises an exception of any kind for content that `_packed` does not write."""
    packed, made, rejected, encoded = json.loads(content)
    array = np.frombuffer(base64.b64decode(encoded), dtype="<f8")
    if not (np.abs(array) <= LARGEST).all():  # fails for NaN, too
        raise ValueError
    numbers = iter(array.tolist())

    def ring(corners: int) -> Ring:
        flat = islice(numbers, 2 * corners)
        points = tuple(zip(flat, flat, strict=True))
        if len(points) < 3:
            raise ValueError
        return points

    def opening(kind: Any, corners: Any) -> Opening:
        if kind not in ("door", "window"):
            raise ValueError
        return Opening(kind, ring(corners))

    def item(category: Any, form: Any, tucked: Any) -> Item:
        depth, width, x, y, rotation = islice(numbers, 5)
        if form not in ("rectangle", "circle") or not isinstance(tucked, bool):
            raise ValueError
        return Item(_text(category), (depth, width), (x, y), rotation, form, tucked)

    def unpacked(name: Any, outline: Any, walls: Any, openings: Any, items: Any, target: Any) -> Room:
        return Room(
            _text(name),
            room_type,
            ring(outline),
            tuple([ring(wall) for wall in walls]),
            tuple([opening(*parts) for parts in openings]),
            tuple([item(*parts) for parts in items]),
            range(len(items))[target],  # raises where there is no such item
        )

    rooms = [unpacked(*parts) for parts in packed]
    if any(True for _ in numbers):
        raise ValueError
    return Designs(
        rooms,
        Counter({_text(template): _times(times) for template, times in made.items()}),
        Counter({(_text(template), _text(reason)): _times(times) for template, reason, times in rejected}),
    )


def _text(value: Any) -> str:
    if not isinstance(value, str) or not value.isprintable():
        raise ValueError
    return value


def _times(value: Any) -> int:
    if not isinstance(value, int) or value < 1:
        raise ValueError
    return value
