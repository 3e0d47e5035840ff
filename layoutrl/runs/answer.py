"""What `place` found for a room of a file, and how that is written and reported."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from typing import Any, NamedTuple

from layoutrl.rooms.brief import missing
from layoutrl.rooms.documents import with_layout
from layoutrl.rooms.faults import ILL_PLACED, MISSING, OVERLAPS, Fault
from layoutrl.rooms.furnished import same
from layoutrl.rooms.room import Room
from layoutrl.runs.request import Request, said_to_stay
from layoutrl.runs.streams import Entry

CROWDED_OUT = "not placed, as no room is left for it"  # whoever furnishes found no place


class Choice(NamedTuple):
    """A layout of a room, and what there is to say of it."""

    layout: Room
    by: str  # who made it; empty where it is who was asked
    unplaced: list[int]  # the wanted items that it has no place for
    wrong: list[Fault]  # (index of the item, fault or oddity) of what was not so before
    still: set[Fault]  # all of its faults and oddities


@dataclass(frozen=True)
class Answer:
    """A room that was read, and its layouts, best first, each with its faults and oddities.

    An item that found no place stays where the file has it, if that is in the room; else it has no center.
    """

    entry: Entry
    request: Request
    choices: list[Choice]
    wrong_where_stood: list[Fault] | None = None  # of the wanted items, where they all stood; None if they did not

    @property
    def layouts(self) -> list[Room]:
        """The layouts alone."""
        return [choice.layout for choice in self.choices]

    @property
    def wrong(self) -> list[list[Fault]]:
        """For each layout, (index of the item, fault or oddity) of what was not so before."""
        return [choice.wrong for choice in self.choices]

    @property
    def to_furnish_around(self) -> frozenset[int]:
        """The items that find no place in the best layout and stay where they stood, if something overlaps in it."""
        best = self.choices[0]
        overlaps = any(fault == OVERLAPS for _, fault in best.wrong)
        return self.request.stood.intersection(best.unplaced) if overlaps else frozenset()

    def joined(self, other: Answer, choices: int) -> Answer:
        """Return the answer with the best layouts of both, up to `choices`; of equals this answer's come first.

        Best are those with the fewest items that are ILL_PLACED, then those with the least wrong. The other answer is
        to the same room, furnished around what stays.
        """

        def ill_placed_and_wrong(choice: Choice) -> tuple[int, int]:
            return len({k for k, fault in choice.wrong if fault in ILL_PLACED}), len(choice.wrong)

        best: list[Choice] = []
        for choice in sorted([*self.choices, *other.choices], key=ill_placed_and_wrong):
            if not any(same(choice.layout, known.layout) for known in best):
                best.append(choice)
        return replace(self, choices=best[:choices])

    def placed(self, choice: int) -> int:
        """How many items a layout places."""
        return len(self.request.wanted) - len(self.request.left) - len(self.choices[choice].unplaced)

    def found(self, choice: int) -> Room:
        """Return a layout for writing: items that found no place have no center, and so stay as the file has them."""
        chosen, room = self.choices[choice], self.entry.room
        assert room is not None
        items = enumerate(chosen.layout.furniture)
        furniture = (room.furniture[k] if k in chosen.unplaced else item for k, item in items)
        return replace(chosen.layout, furniture=tuple(furniture))

    def documents(self) -> Iterator[dict[str, Any]]:
        """Yield the room's document with each layout, from the second on with an id of its own.

        If nothing was to be placed, it is yielded once, as it came.
        """
        if not self.request.wanted:
            yield self.entry.document
            return
        asked, unit = self.request.checked.room, self.entry.unit
        for n, choice in enumerate(self.choices, 1):
            written = with_layout(self.entry.document, asked, self.found(n - 1), choice.wrong, choice.still, unit)
            layout = choice.layout
            yield written if n == 1 else written | {"id": f"{layout.id} choice {n}", "group": layout.group}

    def lines(self) -> Iterator[str]:
        """Yield a line about each layout, the first with what there is to say about the room itself.

        Nothing is said about a room in which nothing was to be placed.
        """
        if not self.request.wanted:
            return
        words = self.entry.words
        for n, choice in enumerate(self.choices, 1):
            layout, by, wrong = choice.layout, choice.by, choice.wrong
            name = layout.id if len(self.choices) == 1 else f"{layout.id}, choice {n}"
            # Of what is unseen, the lines of the checked brief name all that was to be placed.
            told = [(k, fault) for k, fault in wrong if k not in self.request.checked.unseen]
            said = [
                f"the {numbered(words, k)}: {self._words(k, [fault for _, fault in some])}"
                for k, some in groupby(sorted(told, key=itemgetter(0)), key=itemgetter(0))
            ]
            room = self.request.checked.lines
            before = self.wrong_where_stood
            if n == 1 and before is not None and len(before) < len(wrong):
                said.append(f"less was wrong where all stood ({len(before)} instead of {len(wrong)})")
            if n == 1 and (left := len({*missing(layout)} - {*self.request.wanted})):
                has, was = ("has", "was") if left == 1 else ("have", "were")
                said.append(f"{left} more {has} no place, and {was} not asked for")
            nothing = "nothing else is wrong" if room else "nothing is wrong"
            found = "; ".join([*(room if n == 1 else []), *said]) or nothing
            placed = f"{self.placed(n - 1)} of {len(self.request.wanted)} placed{by and f' by {by}'}"
            stays = f"; {said_to_stay(layout, self.request, words)}" if self.request.stays else ""
            yield f"{name}: {placed}; {found}{stays}"

    def _words(self, item: int, faults: Sequence[str]) -> str:
        there = ", ".join(fault for fault in faults if fault != MISSING)
        if MISSING not in faults:
            return there
        if item not in self.request.stood:
            return CROWDED_OUT
        return f"{CROWDED_OUT}, and stays where it stood{there and f' ({there})'}"


def numbered(words: Sequence[str], item: int) -> str:
    """Return the word for an item and, if there are several of it, its number: `wardrobe (2 of 2)`."""
    alike = [k for k, other in enumerate(words) if other == words[item]]
    which = f" ({alike.index(item) + 1} of {len(alike)})" if len(alike) > 1 else ""
    return f"{words[item]}{which}"
