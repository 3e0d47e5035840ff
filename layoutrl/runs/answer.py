"""What `place` found for a room of a file, and how that is written and reported."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from operator import itemgetter
from typing import Any

from layoutrl.rooms.documents import with_layout
from layoutrl.rooms.faults import MISSING, OVERLAPS, Fault
from layoutrl.rooms.furnished import same
from layoutrl.rooms.room import Room
from layoutrl.runs.request import Request, said_to_stay
from layoutrl.runs.streams import Entry

CROWDED_OUT = "not placed, as no room is left for it"  # whoever furnishes found no place


@dataclass(frozen=True)
class Answer:
    """A room that was read, and its layouts, best first, each with its faults and oddities.

    An item that found no place stays where the file has it, if that is in the room; else it has no center.
    """

    entry: Entry
    request: Request
    layouts: list[Room]
    by: list[str]  # who made each layout; empty where it is who was asked
    unplaced: list[list[int]]  # for each layout, the wanted items that it has no place for
    wrong: list[list[Fault]]  # for each layout, (index of the item, fault or oddity) of what was not so before
    still: list[set[Fault]]  # for each layout, all of its faults and oddities
    wrong_where_stood: list[Fault] | None = None  # of the wanted items, where they all stood; None if they did not

    @property
    def to_furnish_around(self) -> frozenset[int]:
        """The items that find no place in the best layout and stay where they stood, if something overlaps in it."""
        overlaps = any(fault == OVERLAPS for _, fault in self.wrong[0])
        return self.request.stood.intersection(self.unplaced[0]) if overlaps else frozenset()

    def joined(self, other: Answer, choices: int) -> Answer:
        """Return the answer with the best layouts of both, up to `choices`; of equals this answer's come first.

        Best are those with the fewest items that have no place or overlap another, then those with the least wrong. The
        other answer is to the same room, furnished around what stays.
        """

        def ill_placed_and_wrong(which: tuple[Answer, int]) -> tuple[int, int]:
            answer, n = which
            overlap = (k for k, fault in answer.wrong[n] if fault == OVERLAPS)
            return len({*answer.unplaced[n], *overlap}), len(answer.wrong[n])

        best: list[tuple[Answer, int]] = []
        every = [(each, n) for each in (self, other) for n in range(len(each.layouts))]
        for answer, n in sorted(every, key=ill_placed_and_wrong):
            if not any(same(answer.layouts[n], known.layouts[m]) for known, m in best):
                best.append((answer, n))
        best = best[:choices]
        return replace(
            self,
            layouts=[answer.layouts[n] for answer, n in best],
            by=[answer.by[n] for answer, n in best],
            unplaced=[answer.unplaced[n] for answer, n in best],
            wrong=[answer.wrong[n] for answer, n in best],
            still=[answer.still[n] for answer, n in best],
        )

    def placed(self, choice: int) -> int:
        """How many items a layout places."""
        return len(self.request.wanted) - len(self.request.left) - len(self.unplaced[choice])

    def found(self, choice: int) -> Room:
        """Return a layout for writing: items that found no place have no center, and so stay as the file has them."""
        layout, room = self.layouts[choice], self.entry.room
        assert room is not None
        items = enumerate(layout.furniture)
        furniture = (room.furniture[k] if k in self.unplaced[choice] else item for k, item in items)
        return replace(layout, furniture=tuple(furniture))

    def documents(self) -> Iterator[dict[str, Any]]:
        """Yield the room's document with each layout, from the second on with an id of its own.

        If nothing was to be placed, it is yielded once, as it came.
        """
        if not self.request.wanted:
            yield self.entry.document
            return
        asked, unit = self.request.checked.room, self.entry.unit
        for n, (layout, wrong, still) in enumerate(zip(self.layouts, self.wrong, self.still, strict=True), 1):
            written = with_layout(self.entry.document, asked, self.found(n - 1), wrong, still, unit)
            yield written if n == 1 else written | {"id": f"{layout.id} choice {n}", "group": layout.group}

    def lines(self) -> Iterator[str]:
        """Yield a line about each layout, the first with what there is to say about the room itself.

        Nothing is said about a room in which nothing was to be placed.
        """
        if not self.request.wanted:
            return
        words = self.entry.words
        for n, (layout, by, wrong) in enumerate(zip(self.layouts, self.by, self.wrong, strict=True), 1):
            name = layout.id if len(self.layouts) == 1 else f"{layout.id}, choice {n}"
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
            nothing = "nothing else is wrong" if room else "nothing is wrong"
            found = "; ".join([*(room if n == 1 else []), *said]) or nothing
            placed = f"{self.placed(n - 1)} of {len(self.request.wanted)} placed{by and f' by {by}'}"
            stays = f"; {said_to_stay(layout, self.request, words)}" if self.request.stays else ""
            yield f"{name}: {placed}; {found}{stays}"

    def _words(self, item: int, faults: Sequence[str]) -> str:
        there = ", ".join(fault for fault in faults if fault != MISSING)
        if MISSING not in faults:
            return there
        stays = f", and stays where it stood{there and f' ({there})'}"
        return CROWDED_OUT + stays * (item in self.request.stood)


def numbered(words: Sequence[str], item: int) -> str:
    """Return the word for an item and, if there are several of it, its number: `wardrobe (2 of 2)`."""
    alike = [k for k, other in enumerate(words) if other == words[item]]
    which = f" ({alike.index(item) + 1} of {len(alike)})" if len(alike) > 1 else ""
    return f"{words[item]}{which}"
