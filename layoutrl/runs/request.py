"""What is asked of a room of a file: which items are to be placed, which stay, and what nobody can place."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import shapely

from layoutrl.rooms.brief import missing
from layoutrl.rooms.categories import OBSTACLE
from layoutrl.rooms.clearances import HOSTS
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
    stood: frozenset[int]  # those of `wanted` that the file has in the room: without a new place they stay there


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
    kept = replace(room, furniture=tuple(item for k, item in enumerate(room.furniture) if k not in others))
    found = checked_brief(kept, known, types_placing) if wanted else CheckedBrief(kept, frozenset(), [])
    places = [k for k in range(len(room.furniture)) if k not in others]
    unseen = frozenset(places[k] for k in found.unseen)
    left = unseen & stood & {*wanted}
    checked = CheckedBrief(put_back(room, entry, left), others | unseen - left, found.lines)
    return Request(checked, wanted, left, stays, frozenset(stood.intersection(wanted)))


def staying(items: Sequence[Item], those: Collection[int], known: Collection[str]) -> frozenset[int]:
    """Return which of `those` standing items stay with move=all: unknown ones, and chairs tucked under such.

    An obstacle may be what is indoors of a table that reaches beyond the walls: a chair stays under it, too.
    """
    stays = {k for k in those if items[k].category not in known}
    hosts = [items[k].footprint for k in stays if items[k].category in (*HOSTS, OBSTACLE)]
    under = {k for k in those if items[k].tucked and any(items[k].footprint.intersects(host) for host in hosts)}
    return frozenset(stays | under)


def said_to_stay(room: Room, stays: Collection[int]) -> str:
    """Return the message about items that nobody places in such a room, and that stay."""
    counts = Counter(room.furniture[k].category for k in sorted(stays))
    names = ", ".join(name if n == 1 else f"{name} ({n})" for name, n in counts.items())
    return f"nobody places these in a {room.room_type}, and they stay: {names}"


def put_back(room: Room, entry: Entry, those: Collection[int]) -> Room:
    """The room with these items where the file has them."""
    return replace(room, furniture=tuple(entry.stood[k] if k in those else i for k, i in enumerate(room.furniture)))
