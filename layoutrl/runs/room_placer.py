"""Furnish rooms of files together: find out what is asked of each, place it, and look for faults in the layouts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

from layoutrl.rooms.brief import missing
from layoutrl.rooms.categories import ALL, names_in
from layoutrl.rooms.collection import naming
from layoutrl.rooms.faults import MISSING, faults_of_all, new_faults
from layoutrl.rooms.oddities import oddities
from layoutrl.rooms.room import Room
from layoutrl.runs.answer import Answer
from layoutrl.runs.config import PlaceConfig
from layoutrl.runs.request import Request, put_back, request_of, staying_put
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
        """Furnish the rooms of entries, all of which have one, in one batch; return an answer for each.

        An item that finds no place stays where it stood, where others may stand by now. Such a room is furnished again,
        around what stayed, and its best layouts are kept.
        """
        requests = [self._request_of(entry) for entry in entries]
        answers = self._answers(entries, requests)
        stay = {n: answer.to_furnish_around for n, answer in enumerate(answers) if answer.to_furnish_around}
        while stay:
            for n, those in stay.items():
                requests[n] = staying_put(requests[n], entries[n], those)
            again = dict(zip(stay, self._answers([entries[n] for n in stay], [requests[n] for n in stay]), strict=True))
            for n, answer in again.items():
                answers[n] = answers[n].joined(answer, self.config.choices)
            stay = {n: more for n, answer in again.items() if (more := answer.to_furnish_around - requests[n].stuck)}
        return with_what_was_wrong(answers)

    def _answers(self, entries: Sequence[Entry], requests: Sequence[Request]) -> list[Answer]:
        """Place what is requested of each entry, all in one batch."""
        briefs = [request.checked.brief for request in requests if missing(request.checked.brief)]
        layouts = iter(self.info.furnisher.furnish(briefs, self.config.choices, self.config.seed) if briefs else [])
        answers, before = [], list[Room]()
        for entry, request in zip(entries, requests, strict=True):
            found = next(layouts) if missing(request.checked.brief) else []
            rooms = [request.checked.merge(each.layout) for each in found] or [request.checked.room]
            stuck = request.stuck
            unplaced = [[k for k in request.wanted if k in stuck or room.furniture[k].center is None] for room in rooms]
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
        return not self.config.only or bool(naming(self.config.only, room.id))

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


def with_what_was_wrong(answers: Sequence[Answer]) -> list[Answer]:
    """Return the answers, those to rooms in which all that is wanted stood with what was wrong with it there."""
    requests = [answer.request for answer in answers]
    whole = [n for n, each in enumerate(requests) if each.wanted and each.stood.issuperset(each.wanted)]
    lifted = [requests[n].checked.room for n in whole]
    stood = [put_back(room, answers[n].entry, requests[n].stood) for n, room in zip(whole, lifted, strict=True)]
    told = list(answers)
    for n, room, wrong, before in zip(whole, stood, faults_of_all(stood), faults_of_all(lifted), strict=True):
        odd = oddities(room, requests[n].wanted)
        told[n] = replace(answers[n], wrong_where_stood=new_faults(wrong, before) + odd)
    return told
