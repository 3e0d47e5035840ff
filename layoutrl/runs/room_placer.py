"""Furnish rooms of files together: find out what is asked of each, place it, and look for faults in the layouts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from layoutrl.rooms.brief import missing
from layoutrl.rooms.categories import ALL, names_in
from layoutrl.rooms.collection import naming
from layoutrl.rooms.faults import MISSING, Fault, new_faults
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.oddities import faults_and_oddities
from layoutrl.rooms.room import Room
from layoutrl.runs.answer import Answer, Choice
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
        drafts = [
            list(drafts_of(entry, request, next(layouts) if missing(request.checked.brief) else []))
            for entry, request in zip(entries, requests, strict=True)
        ]
        was = iter(faults_and_oddities([draft.before for those in drafts for draft in those]))
        now = iter(faults_and_oddities([draft.layout for those in drafts for draft in those]))
        return [
            Answer(entry, request, [judged(draft, next(was), next(now)) for draft in those])
            for entry, request, those in zip(entries, requests, drafts, strict=True)
        ]

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


class Draft(NamedTuple):
    """A layout that is not judged yet. What `stays` found no place, and is back where it stood."""

    layout: Room
    by: str
    unplaced: list[int]  # the wanted items that found no place
    stays: frozenset[int]  # those of `unplaced` that stood in the room
    before: Room  # the room without what was placed


def drafts_of(entry: Entry, request: Request, found: Sequence[Furnished]) -> Iterator[Draft]:
    """Yield a draft of each layout that was found for a room; of the room as it was asked, if none was."""
    room = request.checked.room
    for layout, by in [(request.checked.merge(each.layout), each.by) for each in found] or [(room, "")]:
        unplaced = [k for k in request.wanted if k in request.stuck or layout.furniture[k].center is None]
        stays = request.stood.intersection(unplaced)
        yield Draft(put_back(layout, entry, stays), by, unplaced, stays, put_back(room, entry, stays))


def judged(draft: Draft, was: Sequence[Fault], now: Sequence[Fault]) -> Choice:
    """Return a draft with what is wrong with it, by the faults and oddities that there were before and are `now`."""
    wrong = [(k, MISSING) for k in sorted(draft.stays)] + new_faults(now, was)
    return Choice(draft.layout, draft.by, draft.unplaced, wrong, {*now})


def with_what_was_wrong(answers: Sequence[Answer]) -> list[Answer]:
    """Return the answers, those to rooms in which all that is wanted stood with what was wrong with it there."""
    requests = [answer.request for answer in answers]
    whole = [n for n, each in enumerate(requests) if each.wanted and each.stood.issuperset(each.wanted)]
    lifted = [requests[n].checked.room for n in whole]
    stood = [put_back(room, answers[n].entry, requests[n].stood) for n, room in zip(whole, lifted, strict=True)]
    told = list(answers)
    for n, wrong, before in zip(whole, faults_and_oddities(stood), faults_and_oddities(lifted), strict=True):
        told[n] = replace(answers[n], wrong_where_stood=new_faults(wrong, before))
    return told
