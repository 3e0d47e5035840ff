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
from layoutrl.runs.answer import Answer
from layoutrl.runs.config import PlaceConfig
from layoutrl.runs.request import Request, put_back, request_of
from layoutrl.runs.streams import Entry

if TYPE_CHECKING:
    from layoutrl.runs.furnishers import FurnisherInfo


class RoomPlacer:
    """Furnishes rooms of files with the options of conf/place.yaml."""

    def __init__(self, config: PlaceConfig):
        self.config = config

    @cached_property
    def info(self) -> FurnisherInfo:
        """The furnisher and what it can place, loaded when first needed."""
        # Loads torch, which takes seconds: errors are reported before.
        from layoutrl.runs.furnishers import furnisher_for

        return furnisher_for(self.config)

    def place(self, entries: Sequence[Entry]) -> list[Answer]:
        """Furnish the rooms of entries, all of which have one, in one batch; return an answer for each."""
        requests = [self._request_of(entry) for entry in entries]
        briefs = [request.checked.brief for request in requests if missing(request.checked.brief)]
        layouts = iter(self.info.furnisher.furnish(briefs, self.config.choices, self.config.seed) if briefs else [])
        answers, before = [], list[Room]()
        for entry, request in zip(entries, requests, strict=True):
            found = next(layouts) if missing(request.checked.brief) else []
            rooms = [request.checked.merge(each.layout) for each in found] or [request.checked.room]
            unplaced = [[k for k in request.wanted if room.furniture[k].center is None] for room in rooms]
            stays = [request.stood.intersection(those) for those in unplaced]
            written = [put_back(room, entry, those) for room, those in zip(rooms, stays, strict=True)]
            before += [put_back(request.checked.room, entry, those) for those in stays]
            answers.append(Answer(entry, request, written, [each.by for each in found] or [""], unplaced, [], []))
        was = iter(faults_of_all(before))
        now = iter(faults_of_all([layout for answer in answers for layout in answer.layouts]))
        for answer in answers:
            for layout, those in zip(answer.layouts, answer.unplaced, strict=True):
                staying = answer.request.stood.intersection(those)
                wrong, odd = next(now), oddities(layout)
                placed = [(k, oddity) for k, oddity in odd if k in answer.request.wanted and k not in staying]
                answer.wrong.append([(k, MISSING) for k in sorted(staying)] + new_faults(wrong, next(was)) + placed)
                answer.still.append({*wrong, *odd})
        return answers

    def means(self, room: Room) -> bool:
        """Whether a room is to be furnished: all are, or the `only` ones."""
        return not self.config.only or bool(matched(self.config.only, room))

    def _request_of(self, entry: Entry) -> Request:
        """Return what is asked of a room. `info` is not loaded if there is nothing to place."""
        assert entry.room is not None
        moves_all = ALL in names_in(self.config.move)
        furniture = entry.room.furniture if self.means(entry.room) else ()
        meant = [k for k, item in enumerate(furniture) if self.config.item in (None, item.category)]
        if not missing(entry.room):
            return request_of(entry, meant, moves_all, ())
        info = self.info
        return request_of(entry, meant, moves_all, info.known(entry.room.room_type), info.types_placing)


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
