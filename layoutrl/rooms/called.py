"""What rooms of a type have under another name: the designer's rooms, and so agents and rivals, know one name alone."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from layoutrl.rooms.room import Room

# By room type and category: what is furnished there as that category is, a thing of the same use and size that faces
# the same way. How much floor it keeps free may differ: a layout is judged by what a thing is.
CALLED = {
    ("balcony", "armchair"): "lounge_chair",
    ("balcony", "washing_machine"): "washer",
    ("bathroom", "sink"): "vanity",
    ("bathroom", "washer"): "washing_machine",
    ("living_room", "lounge_chair"): "armchair",
    ("living_room", "sofa_bed"): "sofa",
    ("study", "lounge_chair"): "armchair",
    ("study", "sofa"): "sofa_bed",
}


def by_any_name(room_type: str, known: Collection[str]) -> Collection[str]:
    """The `known` categories of those who furnish rooms of a type, and those that are CALLED one of these there."""
    return {*known, *(name for (where, name), here in CALLED.items() if where == room_type and here in known)}


def as_called_here(brief: Room) -> Room:
    """Return the brief with its items as they are CALLED in rooms of its type."""
    items = (replace(i, category=CALLED.get((brief.room_type, i.category), i.category)) for i in brief.furniture)
    return replace(brief, furniture=tuple(items))


def named_as(brief: Room, layout: Room) -> Room:
    """Return the layout with the categories of the brief."""
    items = zip(layout.furniture, brief.furniture, strict=True)
    return replace(layout, furniture=tuple(replace(item, category=asked.category) for item, asked in items))
