"""Designed rooms by type, part, seed and index: the same in any order, by any number of processes, on any machine.

NumPy may change its streams of random numbers from one version to another; a test would tell.
"""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from typing import Literal

from layoutrl.rooms.designer.balcony import BALCONY
from layoutrl.rooms.designer.bathroom import BATHROOM
from layoutrl.rooms.designer.bedroom import BEDROOM
from layoutrl.rooms.designer.dining_room import DINING_ROOM
from layoutrl.rooms.designer.kitchen import KITCHEN
from layoutrl.rooms.designer.living_room import LIVING_ROOM
from layoutrl.rooms.designer.search import Choice, NoDesign, Place, design
from layoutrl.rooms.designer.shell import Dice, Gap, Shell
from layoutrl.rooms.designer.study import STUDY
from layoutrl.rooms.designer.tatami import TATAMI
from layoutrl.rooms.room import MAIN_ITEM, Item, Opening, Room, wall_band

ROOM_TYPES = {
    room_type.name: room_type
    for room_type in (BALCONY, BATHROOM, BEDROOM, DINING_ROOM, KITCHEN, LIVING_ROOM, STUDY, TATAMI)
}
Part = Literal["train", "test"]
PARTS: tuple[Part, ...] = ("train", "test")  # their seeds differ
NAMED = 3  # reasons named for each template in a summary
CHUNK = 100  # rooms a process designs at a time


@dataclass
class Design:
    """A room, its template, the decisions behind it, and (template, reason) of every try before it."""

    room: Room
    template: str
    shell: Shell
    choices: Sequence[Choice]
    rejected: list[tuple[str, str]] = field(default_factory=list)


def design_room(room_type: str, part: Part, seed: int, index: int) -> Design:
    """One room. Shells in which the template cannot be built are drawn anew, and the reasons kept."""
    kind = ROOM_TYPES[room_type]
    dice = Dice(seed, PARTS.index(part), list(MAIN_ITEM).index(room_type), index)
    rejected: list[tuple[str, str]] = []
    while True:
        shell = kind.shell(dice)
        suiting = {name: template.share for name, template in kind.templates.items() if template.suits(shell)}
        if not suiting:
            continue
        name = dice.pick(suiting)
        try:
            choices = design(shell, kind.templates[name].steps(dice, shell), kind.passage)
        except NoDesign as reason:
            rejected.append((name, str(reason)))
            continue
        room = _room(f"{room_type}-{name}-{part}{seed}-{index}", room_type, shell, [c.place for c in choices])
        return Design(room, name, shell, choices, rejected)


@dataclass
class Designs:
    """Designed rooms in order; how many each template made, and how often and why it failed."""

    rooms: list[Room] = field(default_factory=list)
    made: Counter[str] = field(default_factory=Counter)
    rejected: Counter[tuple[str, str]] = field(default_factory=Counter)

    def reject_rate(self, template: str) -> float:
        """The share of a template's tries that came to nothing."""
        failed = sum(count for (name, _), count in self.rejected.items() if name == template)
        return failed / (failed + self.made[template])

    def __str__(self) -> str:
        """A line a template: rooms, reject rate, and the most frequent reasons."""
        lines = []
        for name in dict.fromkeys([*self.made, *(template for template, _ in self.rejected)]):
            line = f"  {name}: {self.made[name]} rooms, {self.reject_rate(name):.0%} of its tries rejected"
            reasons = [f"{reason} ({n})" for (template, reason), n in self.rejected.most_common() if template == name]
            more = ["..."] if len(reasons) > NAMED else []
            lines.append(": ".join([line, "; ".join(reasons[:NAMED] + more)] if reasons else [line]))
        return "\n".join(lines)


def design_rooms(room_type: str, part: Part, seed: int, count: int) -> Designs:
    """Rooms 0 to count - 1 of a part, on all cores."""
    one = partial(_chunk, room_type, part, seed)
    chunks = [range(start, min(start + CHUNK, count)) for start in range(0, count, CHUNK)]
    if len(chunks) > 1:
        cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        with ProcessPoolExecutor(min(cores, len(chunks))) as pool:
            results = list(pool.map(one, chunks))
    else:
        results = [one(chunk) for chunk in chunks]
    whole = Designs()
    for some in results:
        whole.rooms += some.rooms
        whole.made += some.made
        whole.rejected += some.rejected
    return whole


def _chunk(room_type: str, part: Part, seed: int, indices: Sequence[int]) -> Designs:
    designs = [design_room(room_type, part, seed, index) for index in indices]
    return Designs(
        [design.room for design in designs],
        Counter(design.template for design in designs),
        Counter(reason for design in designs for reason in design.rejected),
    )


def _room(room_id: str, room_type: str, shell: Shell, places: Sequence[Place]) -> Room:
    """In metres, the origin in the lower left corner of the shell's box."""
    outline = tuple((x / 100, y / 100) for x, y in shell.outline)
    openings = (
        *(Opening("door", _band(shell, door)) for door in shell.doors),
        *(Opening("window", _band(shell, window)) for window in shell.windows),
    )
    furniture = tuple(_item(place) for place in places)
    (main,) = [k for k, item in enumerate(furniture) if item.category == MAIN_ITEM[room_type]]
    walls = wall_band(outline, (), openings, shell.thickness / 100)
    return Room(room_id, room_type, outline, walls, openings, furniture, main)


def _band(shell: Shell, gap: Gap) -> tuple[tuple[float, float], ...]:
    """The opening as a polygon through the wall."""
    x0, y0, x1, y1 = (c / 100 for c in gap.strip(-shell.thickness))
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def _item(place: Place) -> Item:
    piece = place.piece
    center = (place.twice_center[0] / 200, place.twice_center[1] / 200)
    form: Literal["rectangle", "circle"] = "circle" if piece.circle else "rectangle"
    return Item(piece.category, (piece.depth / 100, piece.width / 100), center, 90.0 * place.facing, form, piece.tucked)
