"""Layouts to choose from: when two are one, and how many that differ are made."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.furnished import APART, TRIES, Furnished, same, several
from layoutrl.rooms.room import Item, Room
from tests.builders import random_room, rectangular_room

seeds = st.integers(0, 2**32 - 1)


def test_two_items_in_the_place_of_one_are_not_the_same() -> None:
    near, nearer, between, far = (Item("nightstand", (0.4, 0.4), (x, 1.0)) for x in (1.0, 1.45, 1.22, 3.0))
    one = rectangular_room(4, 3, near, others=(nearer,), target=None)
    other = rectangular_room(4, 3, between, others=(far,), target=None)
    assert not same(one, other)
    assert not same(other, one)


def test_layouts_are_the_same_where_every_item_has_one_like_it_in_its_place() -> None:
    (room,) = design_rooms("bedroom", "test", 3, 1).rooms
    items = room.furniture
    assert same(room, replace(room, furniture=items[::-1]))
    assert isinstance(items[0].center, tuple)
    x, y = items[0].center
    for change, alike in (
        ({"center": (x + 0.29, y)}, True),
        ({"center": (x + 0.31, y)}, False),
        ({"rotation": items[0].degrees + 360}, True),
        ({"rotation": items[0].degrees + 90}, False),
        ({"center": None}, False),
    ):
        assert same(room, replace(room, furniture=(replace(items[0], **change), *items[1:]))) == alike


@given(seeds, st.floats(0, 2), st.booleans())
def test_layouts_differ_as_soon_as_an_item_stands_apart_wherever_the_others_are(
    seed: int, far: float, small: bool
) -> None:
    rng = np.random.default_rng(seed)
    room = random_room(rng)
    far *= APART * 0.49 if small else APART
    way = rng.normal(size=(len(room.furniture), 2))
    way *= far / np.linalg.norm(way, axis=1, keepdims=True)
    moved = [
        replace(item, center=tuple(np.add(item.center, step))) for item, step in zip(room.furniture, way, strict=True)
    ]
    for count in (1, len(moved)):
        some = rng.permutation(len(moved))[:count]
        items = [moved[k] if k in some else item for k, item in enumerate(room.furniture)]
        order = rng.permutation(len(items))
        other = replace(room, furniture=tuple(items[k] for k in order), target=None)
        assert same(room, other) == same(other, room) == (far < APART)


class Drawn:
    """Makes layouts of a bed that stands at one of some places, by the room and the attempt; each has a value."""

    def __init__(self, table: dict[str, list[int]]):
        self.table, self.asked = table, dict.fromkeys(table, 0)

    def __call__(self, briefs: Sequence[Room], drawn: Sequence[int]) -> Iterable[Furnished]:
        seed, attempt = drawn
        assert seed == 7
        for brief in briefs:
            self.asked[brief.id] += 1
            place = self.table[brief.id][attempt % len(self.table[brief.id])]
            (bed,) = brief.furniture
            yield Furnished(replace(brief, furniture=(replace(bed, center=(0.5 + place, 1.0)),)), float(place % 3))


TABLES = st.lists(st.lists(st.integers(0, 5), min_size=1, max_size=12), max_size=4)


@given(TABLES, st.integers(1, 4))
def test_of_each_brief_the_first_layouts_that_differ_are_kept_whatever_else_is_asked(
    places: list[list[int]], choices: int
) -> None:
    table = {str(k): some for k, some in enumerate(places)}
    briefs = [rectangular_room(8, 3, id=name) for name in table]
    make = Drawn(table)
    found = several(make, briefs, choices, 7)
    assert len(found) == len(briefs)
    for answers, (name, some) in zip(found, table.items(), strict=True):
        tries = TRIES * choices if choices > 1 else 1
        drawn = [some[k % len(some)] for k in range(tries)]
        firsts = list(dict.fromkeys(drawn))[:choices]
        assert [answer.layout.id for answer in answers] == [name] * len(firsts)
        stand = [round(answer.layout.furniture[0].center[0] - 0.5) for answer in answers]
        assert stand == sorted(firsts, key=lambda place: -(place % 3))  # of equals the one that came first
        assert not any(same(one.layout, other.layout) for one, other in combinations(answers, 2))
        enough = drawn.index(firsts[-1]) + 1 if len(firsts) == choices else tries
        assert make.asked[name] == enough  # none is made in vain
