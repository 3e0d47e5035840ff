"""Answers to the page's questions: plain lists and numbers for JSON. Nothing is kept from one to the next."""

from __future__ import annotations

import math
import re
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path
from statistics import median_low
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from layoutrl import InputError
from layoutrl.demo.furnisher import Staff
from layoutrl.demo.home import fixed, new_home, written_back
from layoutrl.demo.opened_file import LONGEST_NAME, check_home, in_words_of_the_page, source_of, stem_of, suffix_of
from layoutrl.demo.shell import gaps, swings, with_opening, without_opening
from layoutrl.figures.drawing import svg
from layoutrl.rooms.brief import missing, without_poses
from layoutrl.rooms.categories import names_of, own_names
from layoutrl.rooms.clearances import FRONT_DEPTH, RAISED, RUGS
from layoutrl.rooms.documents import BEYOND, NOT_SIMPLE, parsed, room_from_dict, room_to_dict
from layoutrl.rooms.faults import (
    BLOCKS,
    FRONT_NOT_FREE,
    MISSING,
    OUT_OF_REACH,
    OUTSIDE,
    OVERLAPS,
    Fault,
)
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.oddities import (
    ASTRAY,
    BEFORE_WINDOW,
    CROWDED,
    IN_SWING,
    ODDITIES,
    OFF_ITS_BED,
    OFF_ITS_WALL,
    ON_PLATFORM,
    TURNED_AWAY,
    UNSEEN,
    WITHOUT_SEAT,
    WITHOUT_WORKTOP,
    faults_and_oddities,
)
from layoutrl.rooms.room import MAIN_ITEM, Item, Room, RoomError
from layoutrl.rooms.sources import designer_cache
from layoutrl.rooms.sources.sweethome3d import Home
from layoutrl.rooms.units import UNITS
from layoutrl.runs.answer import numbered
from layoutrl.runs.checked_brief import CheckedBrief, checked_brief
from layoutrl.runs.pretrained import as_known
from layoutrl.runs.request import request_of, said_to_stay
from layoutrl.runs.streams import Entry
from layoutrl.runs.wording import any_of

SAMPLES = 25  # designed rooms of each type, whose furniture has the sizes of the palette
SHOWN = 2  # of these rooms, in the gallery
SEED = 7  # of these rooms
USUAL = 0.6  # an item is usual if at least this share of the rooms has it
CHOICES = 3
LARGEST_BODY = 200_000  # bytes about one room: more corners would take too long
WIDEST = 25.0  # metres of a room's sides
MOST_ITEMS = 40
MOST_ROOMS = 100  # of a file
LARGEST_LINE = MOST_ROOMS * LARGEST_BODY  # bytes about the rooms of a home
STEPS = (0.05, 1.0)  # metres between the places of a heat map, at least and at most

# Faults and oddities in words, for people who have not read about them.
WORDS = {
    MISSING: "is still to be placed",
    OVERLAPS: "overlaps something",
    OUTSIDE: "stands in a wall or outside",
    BLOCKS: "blocks a door or window",
    OUT_OF_REACH: "cannot be reached from the door",
    FRONT_NOT_FREE: "needs free floor before it",
    OFF_ITS_WALL: "stands off its wall",
    ASTRAY: "does not stand at its table, facing it",
    BEFORE_WINDOW: "stands before a window",
    IN_SWING: "stands where a door opens",
    ON_PLATFORM: "stands on a platform, where it does not belong, or half on it",
    CROWDED: "has a wall or furniture too near",
    WITHOUT_SEAT: "stands before no sofa or armchair",
    OFF_ITS_BED: "does not stand beside the head of a bed",
    UNSEEN: "cannot be watched from a seat or bed",
    TURNED_AWAY: "looks at no other seat, table or television, has its back to one, or looks at the back of a seat",
    WITHOUT_WORKTOP: "has no worktop beside it",
}

CENTER = re.compile(r"furniture\[(\d+)\]\.center")  # the field in an error about an item BEYOND the walls

Reply = dict[str, Any]
# Of all questions, in JSON.
FIELDS = "room", "item", "kind", "at", "width", "remove", "movable", "seed", "choices", "step", "others"


class Answers:
    """Answers the questions of a page, whose rooms a `Staff` furnishes."""

    def __init__(self, staff: Staff):
        self.staff = staff
        samples = {kind: designer_cache.read(None, kind, "test", SEED, SAMPLES).rooms for kind in MAIN_ITEM}
        self.begin: Reply = {
            "gallery": [shown(room) for rooms in samples.values() for room in rooms[:SHOWN]],
            "palette": {room_type: palette(rooms) for room_type, rooms in samples.items()},
            "fronts": sorted(FRONT_DEPTH),
            "raised": sorted(RAISED),
            "oddities": [*ODDITIES],
            "units": [*UNITS],
        }
        self.questions: dict[str, Callable[[Any], Reply]] = {
            "look": self.look,
            "opening": self.opening,
            "furnish": self.furnish,
            "values": self.values,
            "moves": self.moves,
            "svg": self.svg,
        }

    def warm(self) -> None:
        """Load the agents before somebody asks, in a thread that ends with the program."""
        threading.Thread(target=self.staff.ready, daemon=True).start()

    def answer(self, about: str, body: bytes) -> Reply:
        """Answer a question, whose JSON has the `room`. Raises InputError if something is wrong with it."""
        return self.questions[about](question(body))

    def look(self, asked: Any) -> Reply:
        """Return the room as it is read, how to draw it, its faults, and if an `item` is named the gaps beside it."""
        try:
            room = room_in(asked)
        except RoomError as error:
            raise InputError(in_words(error, asked["room"])) from None
        item = None if asked.get("item") is None else item_in(asked, room)
        middle = room.indoor.representative_point()
        return shown(room) | {
            "swings": swings(room),
            "middle": [round(middle.x, 2), round(middle.y, 2)],
            "area": room.indoor.area,
            "faults": told(room),
            "gaps": [] if item is None else [[*way, metres] for way, metres in gaps(room, item)],
        }

    def opening(self, asked: Any) -> Reply:
        """Add an opening (`kind`, `at`, `width`) or remove one (`remove`: its index, doors first); answer as `look`."""
        room = room_in(asked)
        if "remove" in asked:
            room = without_opening(room, index_in(asked, "remove", len(room.openings)))
        else:
            at = asked.get("at")
            if not isinstance(at, list) or len(at) != 2:
                raise InputError("at: expected two numbers, in metres")
            x, y = (number(value, "at", -1000, 1000) for value in at)
            room = with_opening(room, str(asked.get("kind")), (x, y), number(asked.get("width"), "width", 0, 1000))
        return self.look({"room": room_to_dict(room)})

    def furnish(self, asked: Any) -> Reply:
        """Return up to `choices` layouts, best first, with the items of `movable` placed anew, and the path to each.

        Items that are locked, or that nobody places in such a room, stay where they stand, as obstacles. Items without
        a place that are not in `movable` get none. Known names of furniture become our categories. `lines` say which
        items stay or are not placed, and why.
        """
        room = room_to_furnish(asked)
        chosen = asked.get("movable")
        if not isinstance(chosen, list):
            raise InputError("movable: expected a list of indices of furniture")
        movable = {index_in({"movable": k}, "movable", len(room.furniture)) for k in chosen}
        movable -= {k for k, item in enumerate(room.furniture) if item.category in RUGS or item.locked}
        placed = {k for k in movable if room.furniture[k].center is not None}  # others keep the rotation that they have
        lifted = replace(room, furniture=without_poses(room.furniture, placed))
        entry = Entry(room.id, lifted, room_to_dict(room), stood=room.furniture)
        request = request_of(entry, movable, True, self.staff.known(room.room_type))
        lines = [said_to_stay(room, request, entry.words)] if request.stays else []
        if not request.wanted:
            mend = "add other furniture" if request.stays else "unlock or add some furniture"
            raise InputError("; ".join(["There is nothing to furnish", *lines, mend]))
        seed = whole(asked.get("seed", 0), "seed", 0, 2**31)
        choices = whole(asked.get("choices", CHOICES), "choices", 1, CHOICES)
        checked = request.checked
        (found,) = self.staff.furnisher().furnish([checked.brief], choices, seed) if missing(checked.brief) else [[]]
        return {"lines": lines + checked.lines, "choices": [choice(checked, furnished) for furnished in found]}

    def values(self, asked: Any) -> Reply:
        """Return the values of places of an `item`, `step` metres apart, and the best rotation at each."""
        room, item = self._thought_of(asked)
        step = number(asked.get("step", 0.2), "step", *STEPS)
        centers, values, degrees = self.staff.thinker(room.room_type).values(room, item, step)
        return {"centers": np.round(centers, 3).tolist(), "values": values.tolist(), "degrees": degrees.tolist()}

    def moves(self, asked: Any) -> Reply:
        """The legal moves of an `item`, those that the furnisher values highest first."""
        room, item = self._thought_of(asked)
        found = self.staff.thinker(room.room_type).moves(room, item)
        return {"moves": [{"name": name, "to": [*to], "value": float(value)} for name, to, value in found]}

    def _thought_of(self, asked: Any) -> tuple[Room, int]:
        """Return a question's room without what cannot be placed in it, and the index there of the question's item.

        Raises InputError if nobody places such an item there.
        """
        room = room_to_furnish(asked)
        item = item_in(asked, room)
        known = self.staff.known(room.room_type)
        checked = checked_brief(room, known)
        category = room.furniture[item].category
        if category not in known or item in checked.unseen:  # rugs: agents do not see them
            raise InputError(
                f"item: nobody places {any_of([category])} in a {room.room_type}; expected other furniture"
            )
        return as_known(checked.brief), item - sum(k < item for k in checked.unseen)

    def svg(self, asked: Any) -> Reply:
        """Return a drawing of the room to scale, with faults and oddities hatched as on the page."""
        room = room_in(asked)
        return {"svg": svg(room, wrong_with(room))}

    def read(self, content: bytes, unit: str = "auto", called: str = "") -> Reply:
        """Read a file that somebody opens; return its rooms, whether it is a `home`, and what is wrong with others.

        Lengths of rooms in JSON are in `unit`, or told by their size (auto); other formats define them. The name that
        the file is `called`, without its suffix, begins the ids of rooms that have none of their own.
        Known names of furniture are replaced by our categories. In a home, each room has the indices of its furniture
        that is `fixed`: the home is not written back with it elsewhere. Raises InputError if no room can be read.
        """
        if unit not in ("auto", *UNITS):
            raise InputError(f"unit: expected one of auto, {', '.join(UNITS)}; got {unit[:20]!r}")
        suffix = suffix_of(content)
        check_home(content)
        with TemporaryDirectory(prefix="layoutrl-") as folder:
            path = Path(folder) / f"{stem_of(called)}{suffix}"
            path.write_bytes(content)
            try:
                source = source_of(path, unit)
            except InputError as error:
                raise InputError(in_words_of_the_page(str(error), path)) from None
        collection = source.collection
        name = "line" if suffix == ".jsonl" else "file"
        left_out = [in_words_of_the_page(f"{where}: {wrong}", path, name) for where, wrong in collection.left_out]
        left_out += [in_words_of_the_page(note, path) for note in collection.notes]
        rooms, names = [], names_of()
        for room in collection.rooms[:MOST_ROOMS]:
            try:
                entry = shown(limited(room))
                if isinstance(source, Home):
                    entry["fixed"] = fixed(source, room)
                else:
                    entry["room"] = names.ours(entry["room"])
                rooms.append(entry)
            except InputError as error:
                left_out.append(f"{room.id}: {error}")
        if (more := len(collection.rooms) - MOST_ROOMS) > 0:
            left_out.append(f"{more} more rooms are left out; expected at most {MOST_ROOMS}")
        if not rooms:
            raise InputError(left_out[0] if left_out else "file: expected rooms; it is empty")
        return {"rooms": rooms, "left_out": left_out, "home": suffix == ".sh3d"}

    def home(self, body: bytes, called: str = "") -> tuple[bytes, str, list[int]]:
        """Save a room as a home of Sweet Home 3D; return it, a message, and indices of `others` that it has as before.

        The body is a line of JSON with the `room` and, below it, the home that it was read from, if any; that is
        `called` as when it was read. `others` are further rooms of the home to write back as they are now. Those that
        cannot be are left as the home has them, and the message names them.
        """
        line, _, content = body.partition(b"\n")
        asked = question(line, LARGEST_LINE if content else LARGEST_BODY)
        room, others = room_in(asked), asked.get("others", [])
        if not isinstance(others, list) or len(others) >= MOST_ROOMS:
            raise InputError(f"others: expected a list of rooms of the home, fewer than {MOST_ROOMS}")
        if len(line) > LARGEST_BODY * (1 + len(others)):
            raise InputError(f"room: expected at most {LARGEST_BODY // 1000} kB for each room")
        rooms, unread = [], []
        for k, other in enumerate(others):
            try:
                rooms.append(room_in({"room": other}))
            except InputError as error:
                if not isinstance(other, dict) or not isinstance(other.get("id"), str):
                    raise InputError(f"others[{k}]: {error}") from None
                unread.append(other["id"])
        if len({room.id, *unread, *(other.id for other in rooms)}) < 1 + len(others):
            raise InputError("others: expected each room of the home once")
        if others and not content:
            raise InputError("others: expected the home that they were read from, below the line")
        if not content:
            return new_home(room), "", []
        check_home(content)
        saved, unlike = written_back(room, content, rooms, f"{stem_of(called)}.sh3d")
        left = unlike + unread
        return saved, said_of_left(left), [k for k, other in enumerate(others) if other["id"] in left]


def said_of_left(names: Sequence[str]) -> str:
    """Return the message about rooms that a saved home has as they were before; empty if there are none."""
    if not names:
        return ""
    return (
        f"home: saved, but as it was before in {', '.join(repr(name[:LONGEST_NAME]) for name in names)}: "
        "there is other furniture now, or other walls or doors; undo that there, or save it as JSON"
    )


def question(body: bytes, largest: int = LARGEST_BODY) -> dict[str, Any]:
    """A question about a room, from its JSON. Raises InputError where it is none, or too large to answer soon."""
    if len(body) > largest:
        raise InputError(f"room: expected at most {largest // 1000} kB; got {len(body) // 1000} kB")
    asked = parsed(body)
    if isinstance(asked, RoomError):
        raise asked
    if not isinstance(asked, dict) or "room" not in asked:
        raise InputError("room: missing; expected a JSON object with a room")
    if unknown := [name for name in asked if name not in FIELDS]:
        raise InputError(f"{unknown[0][:20]}: unknown field; expected some of {', '.join(FIELDS)}")
    return asked


def room_in(asked: Any) -> Room:
    """The room of a question. Raises InputError where it is none, or too large to answer soon."""
    return limited(room_from_dict(asked["room"]))


def room_to_furnish(asked: Any) -> Room:
    """As `room_in`, with known names of furniture replaced by our categories."""
    return room_in({"room": own_names().ours(asked["room"])})


def limited(room: Room) -> Room:
    """The room. Raises InputError where it is too large to be answered soon."""
    x0, y0, x1, y1 = room.envelope.bounds
    if max(x1 - x0, y1 - y0) > WIDEST:
        raise InputError(f"outline: expected at most {WIDEST:g} m; got {x1 - x0:.1f} by {y1 - y0:.1f} m")
    if len(room.furniture) > MOST_ITEMS:
        raise InputError(f"furniture: expected at most {MOST_ITEMS} pieces; got {len(room.furniture)}")
    return room


def in_words(error: RoomError, document: Any) -> str:
    """Return what is wrong with an edited room: an item moved out of it, and its outline, without fields of JSON."""
    if error.field == "outline" and error.problem.startswith(NOT_SIMPLE):
        return "The outline crosses itself"
    found = CENTER.fullmatch(error.field)
    if found is None or not error.problem.endswith(BEYOND):
        return str(error)
    categories = [item["category"] for item in document["furniture"]]
    return f"The {named(categories, int(found[1]))} would reach beyond the walls"


def named(categories: Sequence[str], item: int) -> str:
    """An item in words, numbered as `place` does."""
    return numbered(categories, item).replace("_", " ")


def item_in(asked: Any, room: Room) -> int:
    """The index of the item that a question is about. Raises InputError where there is none, or it does not stand."""
    index = index_in(asked, "item", len(room.furniture))
    if room.furniture[index].center is None:
        raise InputError(f"item: the {room.furniture[index].category} is not placed; expected one that stands")
    return index


def index_in(asked: Any, field: str, count: int) -> int:
    """An index below a count. Raises InputError for anything else."""
    index = asked.get(field)
    if isinstance(index, bool) or not isinstance(index, int) or not 0 <= index < count:
        raise InputError(f"{field}: expected an index from 0 to {count - 1}" if count else f"{field}: there is none")
    return index


def number(value: Any, field: str, low: float, high: float) -> float:
    """A number in a range. Raises InputError for anything else."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise InputError(f"{field}: expected a number from {low:.10g} to {high:.10g}")
    return float(value)


def whole(value: Any, field: str, low: int, high: int) -> int:
    """A whole number in a range. Raises InputError for anything else."""
    if not number(value, field, low, high).is_integer():
        raise InputError(f"{field}: expected a whole number from {low} to {high}")
    return int(value)


def shown(room: Room) -> Reply:
    """A room, and the box [x0, y0, x1, y1] in metres that its picture shows."""
    return {"room": room_to_dict(room), "box": [*room.envelope.bounds]}


def wrong_with(room: Room) -> list[Fault]:
    """What is wrong with a room, and what is odd, item by item."""
    return sorted(faults_and_oddities([room])[0], key=lambda entry: entry[0])


def told(room: Room) -> list[list[Any]]:
    """What is wrong with a room, and what is odd: the item's index, the name, and words."""
    categories = [item.category for item in room.furniture]
    return [[k, name, f"{named(categories, k)} {WORDS[name]}"] for k, name in wrong_with(room)]


def choice(checked: CheckedBrief, furnished: Furnished) -> Reply:
    """A layout for the page, by the indices of the furniture as it was asked."""
    layout = checked.merge(furnished.layout)
    asked = [k for k in range(len(layout.furniture)) if k not in checked.unseen]
    return {
        "furniture": room_to_dict(layout)["furniture"],
        "by": furnished.by,
        "value": furnished.value if math.isfinite(furnished.value) else None,
        "faults": told(layout),
        "path": [[asked[k], [*center], degrees] for k, center, degrees in furnished.path],
    }


def palette(rooms: Sequence[Room]) -> list[Reply]:
    """Return the furniture in rooms of a type, most frequent first: each in its median size, and how many are usual."""
    kinds: dict[tuple[str, str], list[Item]] = {}
    for item in chain.from_iterable(room.furniture for room in rooms):
        kinds.setdefault((item.category, item.form), []).append(item)
    entries = []
    for (category, form), items in sorted(kinds.items(), key=lambda entry: -len(entry[1])):
        depths, widths = zip(*(item.size for item in items), strict=True)
        counts = Counter(sum((i.category, i.form) == (category, form) for i in room.furniture) for room in rooms)
        usual = max(n for n in counts if sum(c for m, c in counts.items() if m >= n) >= USUAL * len(rooms) or not n)
        item = Item(category, (median_low(depths), median_low(widths)), None, None, items[0].form, items[0].tucked)
        shell = replace(rooms[0], furniture=(item,), target=None)
        entries.append({"item": room_to_dict(shell)["furniture"][0], "usual": usual})
    return entries
