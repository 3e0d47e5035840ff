"""What of a user's brief can be furnished, and a line for each thing that stands in the way."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import shapely

from layoutrl.env.geometry import fitting_positions
from layoutrl.rooms.brief import missing, ways
from layoutrl.rooms.clearances import RAISED
from layoutrl.rooms.room import Item, Room
from layoutrl.rooms.sources.categories import nearest

SAME_PLACE = 0.5  # share of the smaller of two footprints above which items stand at one place


@dataclass(frozen=True)
class Answerable:
    """A brief as it was asked, as far as it can be furnished (`brief`), and what is in the way, a line each."""

    asked: Room
    refused: frozenset[int]  # items of `asked` that are not in `brief`
    lines: list[str]

    @property
    def brief(self) -> Room:
        """The room without what cannot be placed."""
        kept = tuple(item for k, item in enumerate(self.asked.furniture) if k not in self.refused)
        return replace(self.asked, furniture=kept, target=None)

    def answer(self, layout: Room) -> Room:
        """The room as it was asked, with the poses of a layout of `brief`; what was refused has no center."""
        items = iter(layout.furniture)
        furniture = tuple(i if k in self.refused else next(items) for k, i in enumerate(self.asked.furniture))
        return replace(self.asked, furniture=furniture)


def nowhere(category: str) -> Sequence[str]:  # noqa: ARG001
    """No room type."""
    return ()


def answerable(room: Room, known: Collection[str], elsewhere: Callable[[str], Sequence[str]] = nowhere) -> Answerable:
    """Hold a room against what can be furnished: `known` categories, items that fit, one place each, a door.

    `elsewhere` tells the room types whose agents place a category.
    """
    refused, lines = set(), []
    for k in missing(room):
        item = room.furniture[k]
        if item.category not in known:
            if not known:
                why = f"who is asked does not furnish a {room.room_type}"
            elif types := elsewhere(item.category):
                agents = "the agent" if len(types) == 1 else "the agents"
                places = "places" if len(types) == 1 else "place"
                why = f"{agents} of {', '.join(types)} {places} it; that of a {room.room_type} does not"
            else:
                near = nearest(item.category, known) or sorted(known)
                why = f"who is asked does not know it; expected a category as {', '.join(near)}"
            lines.append(f"the {item.category} is not placed: {why}")
            refused.add(k)
        elif not fits(room, item):
            size = " by ".join(f"{side:g}" for side in item.size)
            lines.append(f"the {item.category} of {size} m is not placed: it fits into the room in no way")
            refused.add(k)
    standing = [item for item in room.furniture if item.center is not None]
    for one, other in combinations(standing, 2):
        if one.tucked or other.tucked or {one.category, other.category} & RAISED:
            continue
        shared = one.footprint.intersection(other.footprint).area
        if shared > SAME_PLACE * min(one.footprint.area, other.footprint.area):
            x, y = one.footprint.centroid.coords[0]
            lines.append(f"the {one.category} and the {other.category} stand at one place, {x:g}, {y:g}; both are kept")
    if not room.doors:
        lines.append("it has no door: who walks there begins on the largest free floor")
    return Answerable(room, frozenset(refused), lines)


def fits(room: Room, item: Item) -> bool:
    """Whether there is a place indoors at which an item lies in the room, empty, in one of the ways it may face."""
    templates = np.array([replace(item, rotation=degrees).template for degrees in ways(room, item)])
    return not shapely.is_empty(fitting_positions(np.array([room.indoor] * len(templates)), templates)).all()
