"""Furnish rooms of files together: find out what is asked of each, place it, and look for faults in the layouts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

from layoutrl.rooms.brief import missing
from layoutrl.rooms.categories import ALL, names_in
from layoutrl.rooms.faults import MISSING, faults_of_all, new_faults
from layoutrl.rooms.oddities import oddities
from layoutrl.rooms.room import Room
from layoutrl.runs.answered import Answered
from layoutrl.runs.asked import Asked, asked_of, put_back
from layoutrl.runs.config import PlaceConfig
from layoutrl.runs.streams import Entry

if TYPE_CHECKING:
    from layoutrl.runs.furnishers import Hired


class Answering:
    """Furnishes rooms of files with the options of conf/place.yaml."""

    def __init__(self, config: PlaceConfig):
        self.config = config

    @cached_property
    def who(self) -> Hired:
        """The agents or rival that furnish, loaded when they are first needed."""
        from layoutrl.runs.furnishers import hired  # loads torch, which takes seconds: errors are reported before

        return hired(self.config)

    def answer(self, entries: Sequence[Entry]) -> list[Answered]:
        """Furnish the rooms of entries, all of which have one, in one batch; return an answer for each."""
        asked = [self._asked(entry) for entry in entries]
        briefs = [what.can.brief for what in asked if missing(what.can.brief)]
        layouts = iter(self.who.furnisher.furnish(briefs, self.config.choices, self.config.seed) if briefs else [])
        answers, before = [], list[Room]()
        for entry, what in zip(entries, asked, strict=True):
            found = next(layouts) if missing(what.can.brief) else []
            rooms = [what.can.answer(each.layout) for each in found] or [what.can.asked]
            unplaced = [[k for k in what.wanted if room.furniture[k].center is None] for room in rooms]
            stays = [what.stood.intersection(those) for those in unplaced]
            written = [put_back(room, entry, those) for room, those in zip(rooms, stays, strict=True)]
            before += [put_back(what.can.asked, entry, those) for those in stays]
            answers.append(Answered(entry, what, written, [each.by for each in found] or [""], unplaced, []))
        was = iter(faults_of_all(before))
        now = iter(faults_of_all([layout for answer in answers for layout in answer.layouts]))
        for answer in answers:
            for layout, those in zip(answer.layouts, answer.unplaced, strict=True):
                staying = answer.asked.stood.intersection(those)
                odd = oddities(layout, {*answer.asked.wanted}.difference(staying))
                answer.wrong.append([(k, MISSING) for k in sorted(staying)] + new_faults(next(now), next(was)) + odd)
        return answers

    def means(self, room: Room) -> bool:
        """Whether a room is to be furnished: all are, or the `only` ones."""
        return not self.config.only or bool(matched(self.config.only, room))

    def _asked(self, entry: Entry) -> Asked:
        """Return what is asked of a room. `who` is not loaded if there is nothing to place."""
        assert entry.room is not None
        moves_all = ALL in names_in(self.config.move)
        furniture = entry.room.furniture if self.means(entry.room) else ()
        meant = [k for k, item in enumerate(furniture) if self.config.item in (None, item.category)]
        if not missing(entry.room):
            return asked_of(entry, meant, moves_all, ())
        return asked_of(entry, meant, moves_all, self.who.known(entry.room.room_type), self.who.elsewhere)


def matched(only: str | None, room: Room) -> set[str]:
    """Return those of the comma-separated names in `only` that mean a room: its id, or what follows a slash in it.

    Case does not matter, and a dash may stand for a slash. A name may contain commas: then all of its parts are
    returned.
    """

    def folded(names: Sequence[str]) -> str:
        return ",".join(name.strip() for name in names).casefold().replace("/", "-")

    parts = room.id.split("/")
    calls = {folded("/".join(parts[first:]).split(",")) for first in range(len(parts))}
    said = [name.strip() for name in only.split(",")] if only else []
    runs = [said[k:n] for k in range(len(said)) for n in range(k + 1, len(said) + 1)]
    return {name for run in runs if folded(run) in calls for name in run}
