"""What is asked of a room of a file: which items are to be placed, which stay, and what nobody can place."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import shapely

from layoutrl.rooms.brief import missing
from layoutrl.rooms.categories import OBSTACLE
from layoutrl.rooms.clearances import HOSTS
from layoutrl.rooms.doors import before_doors, free_doors
from layoutrl.rooms.room import Item, Room
from layoutrl.runs.checked_brief import CheckedBrief, checked_brief, in_no_type
from layoutrl.runs.streams import Entry


@dataclass(frozen=True)
class Request:
    """What is asked of a room, items by their indices. Items that stay have the center that the file has for them."""

    checked: CheckedBrief  # what of the room can be furnished
    wanted: list[int]  # items that are to be placed
    left: frozenset[int]  # of these, those that nobody can place, and that stay where the file has them
    stays: frozenset[int]  # items that `move=all` leaves where they are: unknown ones, and chairs under such
    under: frozenset[int]  # of these, the chairs: somebody places them, but not here
    stood: frozenset[int]  # those of `wanted` that the file has in the room: without a new place they stay there
    stuck: frozenset[int] = frozenset()  # of these, those that found no place, and are furnished around (`staying_put`)


def request_of(
    entry: Entry,
    meant: Collection[int],
    moves_all: bool,
    known: Collection[str],
    types_placing: Callable[[str], Sequence[str]] = in_no_type,
) -> Request:
    """Find out what is asked of a room: to place those of the items `meant`, by their indices, that have no center.

    Items that the file has in the room and that cannot be placed stay there, as obstacles. With `moves_all`
    (move=all), items whose category is not `known` were not meant. `types_placing` is as in `checked_brief`.
    """
    assert entry.room is not None
    room = entry.room
    inside = {
        k for k, item in enumerate(entry.stood) if item.center and room.envelope.covers(shapely.Point(item.center))
    }
    # What reaches beyond the walls is in nobody's way.
    stood = {k for k in inside.intersection(missing(room)) if room.holds(entry.stood[k])}
    wanted = [k for k in missing(room) if k in meant]
    stays = staying(entry.stood, inside, known).intersection(wanted) if moves_all else frozenset[int]()
    wanted = [k for k in wanted if k not in stays]
    others = frozenset(missing(room)) - {*wanted}
    room = put_back(room, entry, others & stood)
    others -= stood
    places = [k for k in range(len(room.furniture)) if k not in others]
    kept, words = replace(room, furniture=tuple(room.furniture[k] for k in places)), entry.words
    theirs = [words[k] for k in places]
    found = checked_brief(kept, known, types_placing, theirs) if wanted else CheckedBrief(kept, frozenset(), [])
    unseen = frozenset(places[k] for k in found.unseen)
    left = unseen & stood & {*wanted}
    room = put_back(room, entry, left)
    lines = [*found.lines, *(said_to_bar(room, words) if wanted else [])]
    checked = CheckedBrief(room, others | unseen - left, lines)
    under = frozenset(k for k in stays if entry.stood[k].category in known)
    return Request(checked, wanted, left, stays, under, frozenset(stood.intersection(wanted)))


def staying(items: Sequence[Item], those: Collection[int], known: Collection[str]) -> frozenset[int]:
    """Return which of `those` standing items stay with move=all: unknown ones, and chairs tucked under such.

    An obstacle may be what is indoors of a table that reaches beyond the walls: a chair stays under it, too.
    """
    stays = {k for k in those if items[k].category not in known}
    hosts = [items[k].footprint for k in stays if items[k].category in (*HOSTS, OBSTACLE)]
    under = {k for k in those if items[k].tucked and any(items[k].footprint.intersects(host) for host in hosts)}
    return frozenset(stays | under)


def staying_put(request: Request, entry: Entry, those: frozenset[int]) -> Request:
    """Return the request with some of the items that are wanted back where they stood, to be furnished around."""
    checked = replace(request.checked, room=put_back(request.checked.room, entry, those))
    return replace(request, checked=checked, stuck=request.stuck | those)


def said_to_bar(room: Room, words: Sequence[str]) -> list[str]:
    """Return the message about what stands before the doors of a room, if none is free; `words` are of its items."""
    bars = before_doors(room)
    names = sorted({word for item, word in zip(room.furniture, words, strict=True) if item in bars})
    if not names or free_doors(room):
        return []
    past = " and ".join(f"the {name}" for name in names)
    return [f"nobody gets in past {past}: no door is free, and so nothing is within reach"]


def said_to_stay(room: Room, request: Request, words: Sequence[str]) -> str:
    """Return the message about items that stay with move=all; `words` are what the file calls all of them."""

    def counted(those: Collection[int]) -> str:
        counts = Counter(words[k] for k in sorted(those))
        return ", ".join(name if n == 1 else f"{name} ({n})" for name, n in counts.items())

    if not (unknown := request.stays - request.under):
        return f"these are tucked under what stays, and stay, too: {counted(request.under)}"
    said = f"nobody places these in a {room.room_type}, and they stay: {counted(unknown)}"
    return f"{said}; what is tucked under them stays, too: {counted(request.under)}" if request.under else said


def put_back(room: Room, entry: Entry, those: Collection[int]) -> Room:
    """The room with these items where the file has them."""
    return replace(room, furniture=tuple(entry.stood[k] if k in those else i for k, i in enumerate(room.furniture)))
