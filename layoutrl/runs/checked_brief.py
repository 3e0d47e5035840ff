"""Which items of a user's brief can be placed, and a message for each problem with the others or with the room."""

from __future__ import annotations

import difflib
import math
from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from layoutrl.rooms import fitting
from layoutrl.rooms.brief import distinct_rotations, missing
from layoutrl.rooms.categories import own_names
from layoutrl.rooms.clearances import RAISED, RUGS, passage
from layoutrl.rooms.documents import ALIKE
from layoutrl.rooms.doors import door_widths, with_a_free_door_first
from layoutrl.rooms.room import TOLERANCE, Item, Room
from layoutrl.rooms.sizes import doubt

SAME_PLACE = 0.5  # share of the smaller of two footprints: items that overlap by more count as stacked
SAME_TURN = 0.005  # share of a quarter turn by which a rotation in radians, often rounded, may be off one
NARROWEST = 0.5  # metres: doors are below it where inches were taken for centimetres


@dataclass(frozen=True)
class CheckedBrief:
    """A brief as it was asked, the part of it that can be furnished (`brief`), and a line for each problem.

    Rugs that lie in the room are not in `brief`: they are in nobody's way.
    """

    room: Room  # as it was asked, but items that stay are back where the file has them (`request_of`)
    # Indices of items of `room` that are not in `brief`: rugs, what nobody can place, and what is not to be placed.
    unseen: frozenset[int]
    lines: list[str]

    @property
    def brief(self) -> Room:
        """The room without what is `unseen`. Of its doors, one that what stands leaves free comes first."""
        kept = tuple(item for k, item in enumerate(self.room.furniture) if k not in self.unseen)
        return with_a_free_door_first(replace(self.room, furniture=kept, target=None))

    def merge(self, layout: Room) -> Room:
        """Return the room as it was asked, with the poses of a layout of `brief`; other items stay as they were.

        An item that the layout puts beyond the outer walls gets no place: with it there, the room could not be read
        again.
        """
        items = iter(layout.furniture)
        furniture = [i if k in self.unseen else next(items) for k, i in enumerate(self.room.furniture)]
        for k in missing(self.room):
            if furniture[k].center is not None and not self.room.holds(furniture[k]):
                furniture[k] = self.room.furniture[k]
        return replace(self.room, furniture=tuple(furniture))


def in_no_type(category: str) -> Sequence[str]:  # noqa: ARG001
    """Return no room types: the default where it is not known which agents place a category."""
    return ()


def checked_brief(
    room: Room,
    known: Collection[str],
    types_placing: Callable[[str], Sequence[str]] = in_no_type,
    words: Sequence[str] | None = None,
) -> CheckedBrief:
    """Find out which items of a room can be placed: those of `known` categories that fit into it.

    Lines also name doubtful sizes, items that stand stacked, and doors that are missing or too narrow. `types_placing`
    returns the room types whose agents place a category. `words` are what lines call the items: their categories, if
    none are given.
    """
    unseen, lines = set(), list[str]()
    words = [item.category for item in room.furniture] if words is None else words
    unknown = Counter(words[k] for k in missing(room) if room.furniture[k].category not in known)
    for k in missing(room):
        item, word = room.furniture[k], words[k]
        if item.category not in known:
            which = f"{word} ({n})" if (n := unknown.pop(word, 0)) > 1 else word
            if n:  # the first of them
                lines.append(f"the {which} is not placed: {_why(room, item.category, word, known, types_placing)}")
            unseen.add(k)
        elif not fits(room, item):
            size = " by ".join(f"{side:g}" for side in item.size)
            lines.append(f"the {word} of {size} m is not placed: it fits into the room in no way")
            unseen.add(k)
        if item.category in known and (asks := doubt(item, word)) and asks not in lines:
            lines.append(asks)
    unseen |= {k for k, item in enumerate(room.furniture) if item.category in RUGS and item.center is not None}
    stands = [(item, word) for item, word in zip(room.furniture, words, strict=True) if item.center is not None]
    for (one, its_word), (other, other_word) in combinations(stands, 2):
        if _stacked(one, other):
            x, y = one.footprint.centroid.coords[0]
            at = f"{round(x, 2):g}, {round(y, 2):g}"
            line = f"the {its_word} at {at} and the {other_word} overlap by more than half; both are kept"
            lines += [] if line in lines else [line]
    for item, word in zip(room.furniture, words, strict=True):
        quarters = (item.rotation or 0) / (math.pi / 2)
        if abs(round(quarters)) in (1, 2, 3) and abs(quarters - round(quarters)) < SAME_TURN:
            line = f"the {word} is turned by {item.rotation:g} degrees: are these radians?"
            lines += [] if line in lines else [line]
    if not room.doors:
        lines.append("it has no door: what can be reached is told from the largest free floor")
    elif (width := max(door_widths(room))) < NARROWEST:
        lines.append(f"its widest door is {width:.2f} m wide, and nobody fits through: is the unit right?")
    elif width < passage(room.room_type) - TOLERANCE:
        lines.append(f"its widest door is {width:.2f} m wide: what can be reached is told of who fits through")
    return CheckedBrief(room, frozenset(unseen), lines)


def _why(
    room: Room, category: str, word: str, known: Collection[str], types_placing: Callable[[str], Sequence[str]]
) -> str:
    """Return why a category that is not `known`, and that lines call by a `word`, is not placed in a room."""
    if not known:
        return f"nobody who is asked furnishes a {room.room_type}"
    ours = own_names().meant(category) or category
    if ours in known:
        return f"it is known as {ours}; expected that category"
    if types := types_placing(ours):
        agents, places = ("the agent", "places") if len(types) == 1 else ("the agents", "place")
        if ours != word:
            return (
                f"it is known as {ours}, which {agents} of {', '.join(types)} {places}, not that of a {room.room_type}"
            )
        return f"{agents} of {', '.join(types)} {places} it; that of a {room.room_type} does not"
    near = difflib.get_close_matches(ours, known, 1, ALIKE)
    hint = f"; did you mean {near[0]}?" if near else ""
    return f"who is asked places no {ours} in a {room.room_type}; expected one of {', '.join(sorted(known))}{hint}"


def unstacked(brief: Room, layout: Room) -> Room:
    """Return the layout without the poses of placed items that are stacked: there is no room for these.

    Of two placed items the smaller loses its pose. Items that stood before keep theirs.
    """
    placed = [k for k in missing(brief) if layout.furniture[k].center is not None]
    there = {k: item.footprint for k, item in enumerate(layout.furniture) if item.center is not None}
    for k in sorted(placed, key=lambda k: (there[k].area, -k)):
        if any(_stacked(layout.furniture[k], layout.furniture[j]) for j in there if j != k):
            del there[k]
    if gone := [k for k in placed if k not in there]:
        furniture = [brief.furniture[k] if k in gone else item for k, item in enumerate(layout.furniture)]
        return replace(layout, furniture=tuple(furniture))
    return layout


def _stacked(one: Item, other: Item) -> bool:
    """Whether two standing items overlap by more than SAME_PLACE of the smaller; never if one is tucked or RAISED."""
    if one.tucked or other.tucked or {one.category, other.category} & RAISED:
        return False
    shared = one.footprint.intersection(other.footprint).area
    return shared > SAME_PLACE * min(one.footprint.area, other.footprint.area)


def fits(room: Room, item: Item) -> bool:
    """Whether an item fits somewhere into the empty room, in one of the ways that it may face."""
    return fitting.fits(room.indoor, item, distinct_rotations(room, item))
