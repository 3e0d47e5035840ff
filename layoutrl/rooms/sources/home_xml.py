"""Read Home.xml of a Sweet Home 3D home, a ZIP, into elements, and write it back with attributes changed.

Nothing else changes: every other byte of Home.xml, and every other entry of the ZIP, stays as it was.
"""

from __future__ import annotations

import cmath
import math
import re
import zipfile
import zlib
from collections import Counter
from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO
from xml.parsers import expat
from xml.sax.saxutils import escape

from layoutrl import InputError
from layoutrl.rooms.room import RoomError

HOME = "Home.xml"
LARGEST_XML = 2**23  # bytes unpacked; homes of many storeys take a tenth
MOST = {"room": 100, "wall": 400, "opening": 500, "piece": 2000, "point": 3000}  # in a home: more is no dwelling
MOST_ELEMENTS = 100_000
DEEPEST = 100  # nested elements
LARGEST = 1e5  # centimetres, of any length
OPENING, GROUP = "doorOrWindow", "furnitureGroup"
PIECES = ("pieceOfFurniture", "light", "shelfUnit")
BOX = {"x", "y", "width", "depth", "elevation", "height"}
SAME_PLACE, SAME_ANGLE = 0.02, 1e-5  # centimetres and radians: smaller differences are rounding
ATTRIBUTE = re.compile(rb"\s+([^\s=>/]+)\s*=\s*(\"[^\"]*\"|'[^']*')")


@dataclass
class Element:
    """An element of Home.xml, the byte offset `start` of its tag in the file, and the elements `inside` it."""

    tag: str
    attributes: dict[str, str]
    start: int
    inside: list[Element] = field(default_factory=list)

    def number(self, name: str, otherwise: float | None = None) -> float:
        """Return an attribute as a number: lengths are centimetres, angles radians; a missing one is `otherwise`.

        Raises RoomError if it is missing and `otherwise` is None, and unless it is a number of at most LARGEST.
        """
        text = self.attributes.get(name)
        if text is None and otherwise is not None:
            return otherwise
        try:
            value = float(text or "")
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST:
            found = "nothing" if text is None else repr(text[:40])
            raise RoomError(f"{self.called}: {name}", f"expected a number of at most {LARGEST:g}; got {found}")
        return value

    def equals(self, name: str, value: float) -> bool:
        """Whether an attribute has this value already, up to rounding and full turns; a missing one is 0."""
        off = self.number(name, 0.0) - value
        if name == "angle":
            return abs((off + math.pi) % math.tau - math.pi) < SAME_ANGLE
        return abs(off) < SAME_PLACE

    def flag(self, name: str, otherwise: bool) -> bool:
        """Return an attribute as a boolean, `otherwise` where it is missing."""
        return self.attributes.get(name, str(otherwise)).lower() == "true"

    @property
    def called(self) -> str:
        """The element for messages: its tag, and its name or id."""
        return f"{self.tag} {(self.attributes.get('name') or self.attributes.get('id') or '')[:40]!r}"

    @property
    def names(self) -> tuple[str | None, str | None]:
        """The names that may tell its category: that of the catalogue, in English, and the user's."""
        return self.attributes.get("catalogId"), self.attributes.get("name")


def xml_of(path: Path) -> bytes:
    """Return the bytes of Home.xml.

    Raises InputError for a file that cannot be read, is no home, or unpacks to more than LARGEST_XML.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            entries = [entry for entry in archive.infolist() if entry.filename == HOME]
            if len(entries) != 1:
                what = f"{len(entries)} of them" if entries else "none (saved before Sweet Home 3D 5.3? save it anew)"
                raise InputError(f"{path}: expected one {HOME} in it; got {what}")
            if entries[0].compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise InputError(f"{path}: {HOME}: expected it stored or deflated; save the home anew")  # bounds below
            with archive.open(entries[0]) as file:
                xml = file.read(LARGEST_XML + 1)
    except InputError:  # a ValueError, which would be caught below
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    except (zipfile.BadZipFile, zlib.error, EOFError, ValueError, RuntimeError) as error:
        reason = str(error)[:80] or "it breaks off"
        raise InputError(f"{path}: expected a home of Sweet Home 3D, which is a whole ZIP file; {reason}") from None
    if len(xml) > LARGEST_XML:
        raise InputError(f"{path}: {HOME}: expected at most {LARGEST_XML >> 20} MB; it unpacks to more")
    return xml


def elements_of(xml: bytes) -> list[Element]:
    """Return the elements right below the home.

    Raises ExpatError for what is no XML. Raises RoomError for another root than home, too many or too deeply nested
    elements, a DOCTYPE, and another encoding than UTF-8.
    """
    home: list[Element] = []
    stack: list[list[Element]] = []
    tags: list[str] = []  # of elements that are open
    number: Counter[str] = Counter()
    kinds = {**dict.fromkeys((*PIECES, GROUP), "piece"), OPENING: "opening"}
    parser = expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        kind = kinds.get(tag, tag)
        if kind == "point" and tags[-1:] != ["room"]:  # polylines may have any number of points
            kind = "other"
        most = MOST.get(kind, MOST_ELEMENTS)
        number[kind] += 1
        if number[kind] > most:
            raise RoomError(tag[:40], f"expected at most {most:,} in a home")
        if len(stack) > DEEPEST:
            raise RoomError(tag, f"expected at most {DEEPEST} elements in each other")
        if not stack and tag != "home":
            raise RoomError(tag, "expected the element home first")
        element = Element(tag, attributes, parser.CurrentByteIndex)
        if len(stack) > 0:
            stack[-1].append(element)
        stack.append(element.inside if stack else home)
        tags.append(tag)

    def end(_: str) -> None:
        stack.pop()
        tags.pop()

    def refused(*_: object) -> None:
        raise RoomError("DOCTYPE", "expected none: a home needs no entities")

    def declared(_: str, encoding: str | None, __: int) -> None:
        if encoding and encoding.upper() not in ("UTF-8", "UTF8", "US-ASCII"):
            raise RoomError("encoding", f"expected UTF-8; got {encoding[:20]}")

    if xml[:2] in (b"\xff\xfe", b"\xfe\xff"):  # places in the file are counted in bytes
        raise RoomError("encoding", "expected UTF-8; got UTF-16")
    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler, parser.XmlDeclHandler = refused, declared
    parser.Parse(xml, True)
    for element in home:
        _box(element)
    return home


def _box(element: Element) -> None:
    """Set the position and size of a group from its parts, where the file does not give them: it need not."""
    parts = [inner for inner in element.inside if inner.tag in (*PIECES, OPENING, GROUP)]
    for part in parts:
        _box(part)
    if element.tag != GROUP or not parts or element.attributes.keys() >= BOX:
        return
    turn = cmath.rect(1, element.number("angle", 0.0))
    corners = []  # along the axes of the group
    for part in parts:
        across, along = part.number("width") / 2, part.number("depth") / 2
        middle, turned = complex(part.number("x"), part.number("y")), cmath.rect(1, part.number("angle", 0.0))
        sides = (complex(x, y) for x in (-across, across) for y in (-along, along))
        corners += [(middle + side * turned) / turn for side in sides]
    (left, right), (back, front) = ((min(c), max(c)) for c in zip(*((c.real, c.imag) for c in corners), strict=True))
    middle = complex(left + right, back + front) / 2 * turn
    low = min(part.number("elevation", 0.0) for part in parts)
    high = max(part.number("elevation", 0.0) + part.number("height", 0.0) for part in parts)
    box = {"x": middle.real, "y": middle.imag, "width": right - left, "depth": front - back}
    for name, value in (box | {"elevation": low, "height": high - low}).items():
        element.attributes.setdefault(name, repr(value))


def within(element: Element) -> Iterator[Element]:
    """Yield all descendants of an element."""
    for inner in element.inside:
        yield inner
        yield from within(inner)


def changed(xml: bytes, changes: Mapping[int, Mapping[str, float | str]]) -> bytes:
    """Return Home.xml with attributes set in the tags that begin at these byte offsets (`Element.start`).

    All else is as it was.
    """
    parts, done = [], 0
    for start, values in sorted(changes.items()):
        tag = re.compile(rb"<[^\s/>]+").match(xml, start)
        assert tag is not None
        found, at = {}, tag.end()
        while attribute := ATTRIBUTE.match(xml, at):
            found[attribute[1].decode()], at = attribute, attribute.end()
        edits = []
        for name, value in values.items():
            text = _written(name, value)
            if attribute := found.get(name):
                edits.append((attribute.start(2) + 1, attribute.end(2) - 1, text))
            else:
                edits.append((at, at, b" " + name.encode() + b"='" + text + b"'"))
        for first, last, text in sorted(edits):
            parts += [xml[done:first], text]
            done = last
    return b"".join((*parts, xml[done:]))


def _written(name: str, value: float | str) -> bytes:
    """Encode a value so that it can stand between either kind of quotation marks, in any encoding that is read."""
    if isinstance(value, str):
        return escape(value, {"'": "&apos;", '"': "&quot;"}).encode("ascii", "xmlcharrefreplace")
    digits = 7 if name == "angle" else 4
    return f"{value:.{digits}f}".rstrip("0").rstrip(".").encode()


def write_home(path: Path, out: Path, xml: bytes) -> None:
    """Copy a home to `out` with another Home.xml. All other entries are copied packed, and never unpacked."""
    partial = out.with_name(f".{out.name}.part")
    try:
        with zipfile.ZipFile(path) as old, zipfile.ZipFile(partial, "w") as new, path.open("rb") as packed:
            entries = sorted(old.infolist(), key=lambda entry: entry.header_offset)
            ends = [*(entry.header_offset for entry in entries[1:]), old.start_dir]
            for entry, end in zip(entries, ends, strict=True):
                if entry.filename == HOME:
                    written = zipfile.ZipInfo(HOME, entry.date_time)
                    written.compress_type, written.external_attr = zipfile.ZIP_DEFLATED, entry.external_attr
                    new.writestr(written, xml)
                    continue
                assert new.fp is not None
                kept = copy(entry)
                kept.header_offset = new.start_dir
                packed.seek(entry.header_offset)
                new.fp.seek(new.start_dir)
                _copy(packed, new.fp, end - entry.header_offset)
                new.filelist.append(kept)
                new.NameToInfo[kept.filename] = kept
                new.start_dir = new.fp.tell()
        partial.replace(out)  # whole or not at all
    finally:
        partial.unlink(missing_ok=True)


def _copy(source: IO[bytes], to: IO[bytes], length: int) -> None:
    while length > 0 and (chunk := source.read(min(length, 2**20))):
        to.write(chunk)
        length -= len(chunk)
