"""What no designer would do: told of layouts, and never of the designer's."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from layoutrl.rooms.clearances import FRONT_DEPTH
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.faults import Items, faults
from layoutrl.rooms.oddities import (
    ASTRAY,
    AT_A_WALL,
    BACK,
    BEFORE_WINDOW,
    CROWDED,
    IN_SWING,
    LOUNGING,
    NEAR,
    OFF_ITS_BED,
    OFF_ITS_WALL,
    ON_PLATFORM,
    TURNED_AWAY,
    UNSEEN,
    WITHOUT_SEAT,
    WITHOUT_WORKTOP,
    faults_and_oddities,
    item_oddities,
    oddities,
    oddities_of_all,
    sides_off_walls,
)
from layoutrl.rooms.room import MAIN_ITEM, Item, Opening, Room
from tests.builders import rectangular_room


def furnished(*items: Item, **changes) -> Room:
    return replace(rectangular_room(4, 3), furniture=items, target=None, **changes)


def first_is(oddity: str, turned: int, *items: Item) -> bool:
    """Whether the first of the items in a room, turned by so many quarters, has an oddity."""
    return (0, oddity) in oddities(furnished(*items).turned(turned, False))


@pytest.mark.parametrize("room_type", MAIN_ITEM)
def test_nothing_that_the_designer_does_is_odd(room_type: str) -> None:
    for room in design_rooms(room_type, "test", 0, 40).rooms:
        assert not oddities(room)


@pytest.mark.parametrize(("center", "rotation", "odd"), [
    ((0.3, 1.5), 0, False),  # its back at the left wall
    ((0.3 + NEAR / 2, 1.5), 0, False),
    ((0.4, 1.5), 0, True),
    ((0.3, 1.5), 180, True),  # its front
    ((0.9, 0.3), 90, False),  # at the lower one
    ((0.9, 0.3), 0, True),  # a side of it
    ((3.7, 1.5), 180, False),
    ((2.0, 1.5), 0, True),
])  # fmt: skip
def test_what_belongs_at_a_wall_has_its_back_there(center: tuple[float, float], rotation: int, odd: bool) -> None:
    room = furnished(Item("wardrobe", (0.6, 1.2), center, rotation))
    assert oddities(room) == [(0, OFF_ITS_WALL)] * odd
    assert not oddities(furnished(Item("sofa", (0.6, 1.2), center, rotation)))  # people have sofas in mid-room


def test_what_the_designer_always_puts_at_a_wall_belongs_there_but_for_what_people_lounge_on() -> None:
    rooms = [room for room_type in MAIN_ITEM for room in design_rooms(room_type, "test", 0, 12).rooms]
    items = Items.of(rooms)
    those = np.flatnonzero(~items.round)
    off = sides_off_walls(rooms, items, those)[:, BACK] > NEAR
    always = {*items.category[those]} - {*items.category[those[off]]}
    assert always & {*FRONT_DEPTH} <= AT_A_WALL | LOUNGING


def test_what_stands_across_a_corner_is_off_its_wall_and_what_stands_before_a_niche_is_not() -> None:
    wide = 1.8  # metres; across the lower left corner of the room both ends of the back are at walls
    out = (wide / 2 + 0.3) / 2**0.5
    assert oddities(furnished(Item("wardrobe", (0.6, wide), (out, out), 45))) == [(0, OFF_ITS_WALL)]
    niche = ((0, 0), (4, 0), (4, 3), (0, 3), (0, 2), (-0.3, 2), (-0.3, 1), (0, 1))
    assert not oddities(furnished(Item("bed", (2.0, 1.6), (1.0, 1.5), 0), outline=niche))
    assert oddities(furnished(Item("bed", (2.0, 1.6), (1.2, 1.5), 0), outline=niche)) == [(0, OFF_ITS_WALL)]


def test_a_chair_is_astray_that_stands_under_no_table_though_there_is_one() -> None:
    table, chair = Item("table", (1.0, 1.0), (2.0, 1.5)), Item("chair", (0.4, 0.4), (2.6, 1.5), 180, tucked=True)
    away = replace(chair, center=(3.5, 0.5))
    assert not oddities(furnished(table, chair))
    assert oddities(furnished(table, away)) == [(1, ASTRAY)]
    assert not oddities(furnished(away))
    assert not oddities(furnished(table, replace(away, tucked=False)))
    assert not [name for k, name in oddities(furnished(table, away)) if k == 0]


@pytest.mark.parametrize(("ahead", "odd"), [(0.45, False), (0.41, False), (0.39, True), (0.1, True)])
def test_a_chair_that_is_nearly_all_under_a_round_table_is_astray(ahead, odd) -> None:
    table = Item("table", (1.0, 1.0), (2.0, 1.5), form="circle")
    chair = Item("chair", (0.4, 0.6), (2.0 + ahead, 1.5), 180, tucked=True)  # of which no corner is under it
    assert oddities(furnished(table, chair)) == [(1, ASTRAY)] * odd


@pytest.mark.parametrize("quarter", [0, 1, 2, 3])
@pytest.mark.parametrize(("ahead", "beside", "turned", "odd"), [
    (0.6, 0.0, 0, False),  # half under the table, and looks at it
    (0.7 + 0.8 * NEAR, 0.0, 0, False),  # drawn up to it
    (0.7 + 1.2 * NEAR, 0.0, 0, True),
    (0.6, 0.4 + 0.8 * NEAR, 0, False),  # at the end of a side
    (0.6, 0.4 + 1.2 * NEAR, 0, True),  # round the corner
    (0.2, 0.0, 0, True),  # wholly under it
    (0.6, 0.0, 90, True),  # looks along it
    (0.6, 0.0, 180, True),  # looks away
])  # fmt: skip
def test_who_sits_on_a_chair_looks_at_the_table(
    quarter: int, ahead: float, beside: float, turned: int, odd: bool
) -> None:
    x, y = np.round([np.cos(quarter * np.pi / 2), np.sin(quarter * np.pi / 2)])
    center = (2.0 - ahead * x - beside * y, 1.5 - ahead * y + beside * x)
    chair = Item("chair", (0.4, 0.4), center, 90.0 * quarter + turned, tucked=True)
    assert oddities(furnished(Item("table", (1.0, 1.0), (2.0, 1.5)), chair)) == [(1, ASTRAY)] * odd


@pytest.mark.parametrize("wide", [0.6, 0.8, 1.2])
def test_a_chair_that_touches_a_round_table_sits_at_it(wide: float) -> None:
    table = Item("table", (wide, wide), (2.0, 1.5), 0, "circle")
    chair = Item("chair", (0.5, 0.5), (2.0 + wide / 2 + 0.24, 1.5), 180, tucked=True)
    assert not oddities(furnished(table, chair))
    assert oddities(furnished(table, replace(chair, rotation=90))) == [(1, ASTRAY)]
    assert oddities(furnished(table, replace(chair, center=(2.0 + wide / 2 + 0.32, 1.5)))) == [(1, ASTRAY)]


def test_a_chair_may_sit_where_two_desks_meet() -> None:
    desks = [Item("desk", (0.6, 0.8), (0.3, y)) for y in (1.0, 1.8)]
    assert not oddities(furnished(*desks, Item("chair", (0.5, 0.5), (0.75, 1.4), 180, tucked=True)))


@pytest.mark.parametrize("rotation", [0, 90, 180, 270])
def test_a_square_stool_looks_nowhere(rotation: int) -> None:
    table, stool = Item("table", (1.0, 1.0), (2.0, 1.5)), Item("stool", (0.4, 0.4), (2.6, 1.5), rotation, tucked=True)
    assert not oddities(furnished(table, stool))


def test_a_round_stool_sits_at_the_table_that_it_is_under() -> None:
    table, stool = Item("table", (1.0, 1.0), (2.0, 1.5)), Item("stool", (0.4, 0.4), (2.6, 1.5), 0, "circle", True)
    assert not oddities(furnished(table, stool))
    assert oddities(furnished(table, replace(stool, center=(2.8, 1.5)))) == [(1, ASTRAY)]


def test_what_is_tall_closes_a_window_and_a_bed_does_not() -> None:
    window = Opening("window", ((1.0, 3.0), (2.5, 3.0), (2.5, 3.2), (1.0, 3.2)))
    tall = (("wardrobe", 1.7, True), ("bookcase", 1.7, True), ("fridge", 1.7, True))
    for category, x, odd in (*tall, ("bed", 1.7, False), ("wardrobe", 3.3, False)):
        room = furnished(Item(category, (0.6, 1.2), (x, 2.7), 270), openings=(window,))
        assert not faults(room)
        assert oddities(room) == [(0, BEFORE_WINDOW)] * odd
    for off, wide, odd in ((0.04, 0.25, True), (0.04, 0.15, False), (0.06, 1.0, False)):  # metres before the window
        room = furnished(Item("wardrobe", (0.6, wide), (1.7, 2.7 - off), 270), openings=(window,))
        assert (BEFORE_WINDOW in [what for _, what in oddities(room)]) == odd


DOOR = Opening("door", ((1.0, -0.2), (1.8, -0.2), (1.8, 0.0), (1.0, 0.0)))


@pytest.mark.parametrize(("x", "y", "odd"), [
    (1.4, 0.5, [0]),  # before the middle of it
    (0.85, 0.45, []),  # hung at the other end it opens
    (1.95, 0.45, []),
    (1.0, 0.45, [0]),  # in the way of both, though at one side
    (1.4, 0.95, [0]),  # at arm's length
    (1.4, 1.05, []),
])  # fmt: skip
@pytest.mark.parametrize("turned", [0, 1, 2, 3])
def test_a_door_opens_to_one_side_at_least(x: float, y: float, odd: list[int], turned: int) -> None:
    table = Item("side_table", (0.4, 0.4), (x, y), 0)
    room = furnished(table, openings=(DOOR,)).turned(turned, False)
    assert oddities(room) == [(k, IN_SWING) for k in odd]
    for floor in ("rug", "platform"):
        assert not oddities(replace(room, furniture=(replace(room.furniture[0], category=floor),)))


def test_two_items_may_keep_a_door_shut_that_one_alone_does_not() -> None:
    left, right = (Item("side_table", (0.4, 0.4), (x, 0.45), 0) for x in (0.85, 1.95))
    assert oddities(furnished(left, right, openings=(DOOR,))) == [(0, IN_SWING), (1, IN_SWING)]
    elsewhere = furnished(left, openings=(DOOR,)), furnished(right, openings=(DOOR,))
    assert not item_oddities(elsewhere, Items.of(elsewhere))[IN_SWING].any()
    wide = replace(DOOR, polygon=((0.5, -0.2), (2.3, -0.2), (2.3, 0.0), (0.5, 0.0)))
    assert not oddities(furnished(left, right, openings=(wide,)))  # it slides


PLATFORM = Item("platform", (2.0, 3.0), (1.0, 1.5), 0)  # it ends at x = 2 m


@pytest.mark.parametrize(("x", "odd"), [
    (1.0, False),  # all of it is on the platform
    (1.8, False),
    (1.8 + 0.9 * NEAR, False),  # but for less than that
    (1.8 + 1.1 * NEAR, True),
    (2.0, True),
    (2.2 - 1.1 * NEAR, True),
    (2.2 - 0.9 * NEAR, False),
    (2.2, False),  # beside it
])  # fmt: skip
@pytest.mark.parametrize("form", ["rectangle", "circle"])
@pytest.mark.parametrize("turned", [0, 1, 2, 3])
def test_what_stands_half_on_a_platform_is_odd(x: float, odd: bool, form: str, turned: int) -> None:
    table = Item("side_table", (0.4, 0.4), (x, 1.5), 0, form=form)
    assert oddities(furnished(PLATFORM, table).turned(turned, False)) == [(1, ON_PLATFORM)] * odd
    assert not oddities(furnished(replace(PLATFORM, category="rug"), table).turned(turned, False))
    assert not oddities(furnished(PLATFORM, replace(table, category="rug")).turned(turned, False))
    assert not oddities(furnished(replace(PLATFORM, center=None), table).turned(turned, False))


@pytest.mark.parametrize(("x", "odd"), [(1.0, True), (2.0, True), (2.2 - 1.1 * NEAR, True), (2.2 - 0.9 * NEAR, False)])
@pytest.mark.parametrize("category", ["desk", "stool", "chair"])
def test_a_desk_and_what_stands_at_it_is_odd_on_a_platform(x: float, odd: bool, category: str) -> None:
    room = furnished(PLATFORM, Item(category, (0.4, 0.4), (x, 1.5), 0))
    assert oddities(room) == [(1, ON_PLATFORM)] * odd


def test_two_platforms_side_by_side_are_one() -> None:
    mats = [Item("platform", (2.0, 1.0), (1.0, y), 0) for y in (0.5, 1.5)]
    table = Item("side_table", (0.4, 0.4), (1.0, 1.0), 0)
    assert not oddities(furnished(*mats, table))
    assert oddities(furnished(mats[0], table)) == [(1, ON_PLATFORM)]


@pytest.mark.parametrize("category", ["tv_unit", "dresser"])
@pytest.mark.parametrize(("gap", "odd"), [(0.1, True), (0.57, True), (0.6, False), (1.5, False)])
@pytest.mark.parametrize("turned", [0, 1, 2, 3])
def test_nothing_stands_right_before_a_television_or_drawers(category: str, gap: float, odd: bool, turned: int) -> None:
    unit = Item(category, (0.4, 1.6), (0.2, 1.5), 0)
    other = Item("side_table", (0.4, 0.4), (0.4 + gap + 0.2, 2.2), 0)
    assert oddities(furnished(unit, other).turned(turned, False)) == [(0, CROWDED)] * odd
    assert not oddities(furnished(unit, replace(other, category="rug")).turned(turned, False))
    aside = replace(other, center=(0.4 + gap + 0.2, 0.45))
    assert not oddities(furnished(unit, aside).turned(turned, False))


def test_a_dresser_that_faces_a_wall_is_crowded() -> None:
    assert (0, CROWDED) in oddities(furnished(Item("dresser", (0.4, 1.0), (3.6, 1.5), 0)))


@pytest.mark.parametrize(
    ("center", "odd"),
    [
        ((1.6, 1.5), False),  # 40 cm before the sofa
        ((1.75, 1.5), False),
        ((1.9, 1.5), True),  # 70 cm
        ((1.6, 2.6), False),  # before an end of it
        ((1.6, 2.8), True),  # beside that
        ((3.0, 1.5), True),  # across the room
    ],
)
@pytest.mark.parametrize("seat", ["sofa", "armchair", "loveseat", "lounge_chair", "sofa_bed"])
@pytest.mark.parametrize("turned", [0, 1, 2, 3])
def test_a_coffee_table_stands_before_a_seat(center: tuple[float, float], odd: bool, seat: str, turned: int) -> None:
    table = Item("coffee_table", (0.6, 0.6), center, 0)
    sofa = Item(seat, (0.9, 2.0), (0.45, 1.5), 0)
    assert oddities(furnished(table, sofa).turned(turned, False)) == [(0, WITHOUT_SEAT)] * odd
    if not odd:
        assert (0, WITHOUT_SEAT) in oddities(furnished(table, replace(sofa, rotation=180)).turned(turned, False))
    assert not oddities(furnished(table).turned(turned, False))  # in a room without seats
    assert not oddities(furnished(replace(table, category="side_table"), sofa).turned(turned, False))


@pytest.mark.parametrize(("off", "odd"), [(0.0, False), (0.29, False), (0.31, True), (1.0, True)])
def test_a_nightstand_stands_beside_a_bed(off: float, odd: bool) -> None:
    bed, stand = Item("bed", (2.0, 1.4), (1.0, 0.7), 0), Item("nightstand", (0.4, 0.4), (0.2, 1.6 + off), 0)
    assert oddities(furnished(bed, stand)) == [(1, OFF_ITS_BED)] * odd
    assert not oddities(furnished(stand))
    other = replace(bed, center=(1.0, 2.3))
    assert not oddities(furnished(bed, other, replace(stand, center=(0.2, 1.4))))  # beside one of two


def test_what_is_not_placed_is_not_odd() -> None:
    assert not oddities(furnished(Item("wardrobe", (0.6, 1.2), None, None)))


@pytest.mark.parametrize("turned", [0, 1, 2, 3])
@pytest.mark.parametrize("seat", ["sofa", "armchair", "bed"])
def test_a_television_is_watched_from_a_seat_or_a_bed(seat: str, turned: int) -> None:
    unit, sofa = Item("tv_unit", (0.4, 1.2), (0.2, 1.5), 0), Item(seat, (0.9, 1.4), (3.0, 1.5), 180)

    odd = partial(first_is, UNSEEN, turned)
    assert not odd(unit, sofa)
    assert not odd(unit, replace(sofa, center=(2.6, 2.3)))  # not straight before it
    assert odd(unit, replace(sofa, rotation=90))  # which looks along the wall
    assert odd(unit, replace(sofa, center=(0.8, 2.8), rotation=270))  # beside it
    assert odd(unit, replace(sofa, center=(1.2, 2.7), rotation=230))  # 50 degrees aside of where it faces
    assert odd(unit, replace(sofa, rotation=0))
    assert not odd(unit, replace(sofa, rotation=0), replace(sofa, center=(2.6, 0.7)))  # there is another
    assert not odd(unit)
    assert not odd(unit, replace(sofa, center=None))


@pytest.mark.parametrize("turned", [0, 1, 2, 3])
@pytest.mark.parametrize("company", ["armchair", "tv_unit", "coffee_table"])
def test_a_seat_faces_what_there_is_to_face(company: str, turned: int) -> None:
    sofa, other = Item("sofa", (0.9, 2.0), (0.5, 1.5), 0), Item(company, (0.6, 0.6), (2.5, 1.5), 180)

    odd = partial(first_is, TURNED_AWAY, turned)
    assert not odd(sofa, other)
    assert odd(sofa, replace(other, center=(0.5, 2.8)))  # beside it
    assert odd(replace(sofa, center=(1.0, 1.5), rotation=180), other)
    assert not odd(sofa)
    assert not odd(sofa, replace(other, category="bookcase", center=(0.5, 2.8)))
    assert odd(sofa, replace(other, center=(1.8, 1.5), rotation=0)) == (company == "armchair")  # at its back
    assert not odd(sofa, replace(other, center=(2.9, 1.5), rotation=0))  # far enough


@pytest.mark.parametrize(("center", "odd"), [((1.15, 1.5), True), ((1.15, 2.4), False), ((1.5, 1.5), False)])
@pytest.mark.parametrize("turned", [0, 1, 2, 3])
def test_a_seat_has_room_for_the_feet(center: tuple[float, float], odd: bool, turned: int) -> None:
    sofa, chest = Item("sofa", (0.9, 2.0), (0.45, 1.5), 0), Item("bookcase", (0.4, 1.4), center, 0)
    there = oddities(furnished(sofa, chest).turned(turned, False))
    assert ((0, CROWDED) in there) == odd
    assert (0, CROWDED) not in oddities(furnished(sofa, replace(chest, category="rug")))


def test_half_a_seat_may_be_closed_by_several() -> None:
    sofa, table = Item("sofa", (0.9, 2.0), (0.45, 1.5), 0), Item("side_table", (0.6, 0.6), (1.2, 0.9), 0)
    assert (0, CROWDED) not in oddities(furnished(sofa, table))
    assert (0, CROWDED) in oddities(furnished(sofa, table, replace(table, center=(1.2, 2.1))))


@pytest.mark.parametrize(("gap", "odd"), [(0.14, True), (0.16, False)])
def test_half_of_30_centimetres_is_enough_for_the_feet(gap: float, odd: bool) -> None:
    sofa, chest = Item("sofa", (0.9, 2.0), (0.45, 1.5), 0), Item("bookcase", (0.4, 2.4), (1.1 + gap, 1.5), 0)
    assert ((0, CROWDED) in oddities(furnished(sofa, chest))) == odd
    assert (0, CROWDED) not in oddities(furnished(sofa, replace(chest, category="stool")))  # for the feet


@pytest.mark.parametrize(("x", "odd"), [(2.65, True), (2.75, False)])
def test_nearer_than_a_metre_and_a_half_a_seat_looks_at_no_back(x: float, odd: bool) -> None:
    sofa, other = Item("sofa", (0.9, 2.0), (0.45, 1.5), 0), Item("armchair", (0.6, 0.6), (x, 1.5), 0)
    assert ((0, TURNED_AWAY) in oddities(furnished(sofa, other))) == odd


@pytest.mark.parametrize("turned", [0, 1, 2, 3])
@pytest.mark.parametrize(("one", "another", "odd"), [(0, 30, True), (0, 60, False), (15, 60, False), (0, 180, False)])
def test_a_back_is_one_that_faces_nearly_alike(one: int, another: int, odd: bool, turned: int) -> None:
    sofa, other = Item("sofa", (0.6, 1.2), (1.0, 1.5), one), Item("armchair", (0.8, 0.8), (2.2, 1.6), another)
    assert ((0, TURNED_AWAY) in oddities(furnished(sofa, other).turned(turned, False))) == odd


@pytest.mark.parametrize("turned", [0, 1, 2, 3])
def test_sixty_degrees_are_in_view_however_the_room_is_turned(turned: int) -> None:
    sofa = Item("sofa", (0.6, 1.2), (1.0, 1.5), 30)
    table = Item("coffee_table", (0.4, 0.4), (1.0, 2.7), 0)  # at 90 degrees
    assert (0, TURNED_AWAY) not in oddities(furnished(sofa, table).turned(turned, False))


def test_a_round_bed_has_no_head() -> None:
    bed, stand = Item("bed", (2.0, 2.0), (1.2, 1.2), None, "circle"), Item("nightstand", (0.4, 0.4), (2.3, 1.2), 0)
    assert (1, OFF_ITS_BED) not in oddities(furnished(bed, stand))
    assert (1, OFF_ITS_BED) in oddities(furnished(bed, replace(stand, center=(3.5, 2.5))))


def test_layouts_are_judged_together_as_one_by_one() -> None:
    layouts = []
    for room_type in MAIN_ITEM:
        for design in design_rooms(room_type, "test", 0, 6).rooms:
            places = [item.center for item in design.furniture]
            for by in (1, 2):  # every item where another belongs
                moved = zip(design.furniture, places[by:] + places[:by], strict=True)
                layouts.append(replace(design, furniture=tuple(replace(item, center=center) for item, center in moved)))
            layouts.append(replace(design, furniture=tuple(replace(item, center=None) for item in design.furniture)))
    found = oddities_of_all(layouts)
    assert found == [oddities(layout) for layout in layouts]
    assert {name for wrong in found for _, name in wrong} >= {TURNED_AWAY, UNSEEN, WITHOUT_SEAT, OFF_ITS_BED, CROWDED}
    assert faults_and_oddities(layouts) == [faults(layout) + oddities(layout) for layout in layouts]
    assert oddities_of_all([]) == []


def test_a_corner_of_a_coffee_table_before_a_seat_is_too_little() -> None:
    table, sofa = Item("coffee_table", (0.6, 1.0), (1.6, 2.9), 0), Item("sofa", (0.9, 2.0), (0.45, 1.5), 0)
    assert (0, WITHOUT_SEAT) in oddities(furnished(table, sofa))
    assert (0, WITHOUT_SEAT) in oddities(furnished(replace(table, center=(1.6, 2.8)), sofa))  # a fifth
    assert (0, WITHOUT_SEAT) not in oddities(furnished(replace(table, center=(1.6, 2.7)), sofa))


@pytest.mark.parametrize(("along", "odd"), [(0.2, False), (0.9, False), (1.2, False), (1.6, True), (1.9, True)])
def test_a_nightstand_stands_at_the_head_of_the_bed(along: float, odd: bool) -> None:
    bed, stand = Item("bed", (2.0, 1.4), (1.0, 0.7), 0), Item("nightstand", (0.4, 0.4), (along, 1.6), 0)
    assert ((1, OFF_ITS_BED) in oddities(furnished(bed, stand))) == odd


@pytest.mark.parametrize(("gap", "odd"), [(0.0, False), (0.29, False), (0.31, True)])
def test_a_bench_stands_at_a_table(gap: float, odd: bool) -> None:
    table, bench = Item("table", (0.8, 1.6), (0.85 + gap, 1.5), 0), Item("bench", (0.45, 1.4), (0.225, 1.5), 0)
    assert oddities(furnished(table, bench)) == [(1, ASTRAY)] * odd
    assert not oddities(furnished(bench))
    assert not oddities(furnished(replace(table, category="desk", rotation=180), bench))


@pytest.mark.parametrize("turned", [0, 1, 2, 3])
@pytest.mark.parametrize(("aside", "odd"), [(0.33, True), (0.36, False)])
def test_a_toilet_has_room_for_the_elbows_on_both_sides(aside: float, odd: bool, turned: int) -> None:
    toilet = partial(Item, "toilet", (0.65, 0.4))
    in_a_corner = toilet((0.325, aside), 0)
    assert first_is(CROWDED, turned, in_a_corner) == odd
    beside = Item("vanity", (0.5, 1.0), (0.25, 1.5 + aside + 0.5), 0)
    assert first_is(CROWDED, turned, toilet((0.325, 1.5), 0), beside) == odd
    assert not first_is(CROWDED, turned, toilet((0.325, 1.5), 0), replace(beside, center=(3.0, 1.5)))
    wide = Item("toilet", (0.65, 2 * aside + 0.04), (0.325, aside + 0.02), 0)  # with its arms, it stands in a corner
    assert not first_is(CROWDED, turned, wide)


@pytest.mark.parametrize("turned", [0, 1, 2, 3])
@pytest.mark.parametrize(("behind", "odd"), [(0.18, True), (0.22, False)])
def test_who_sits_at_a_desk_can_rise(behind: float, odd: bool, turned: int) -> None:
    desk, chair = Item("desk", (0.6, 1.2), (1.3 + behind, 1.5), 180), Item("chair", (0.5, 0.5), None, 0, tucked=True)
    at_desk = replace(chair, center=(desk.center[0] - 0.55, 1.5))
    against_wall = replace(at_desk, center=(behind + 0.25, 1.5)), replace(desk, center=(behind + 0.8, 1.5))
    assert first_is(CROWDED, turned, *against_wall) == odd
    back_to_back = replace(at_desk, center=(at_desk.center[0] - 0.5 - behind, 1.5), rotation=180)
    its_desk = replace(desk, center=(back_to_back.center[0] - 0.55, 1.5), rotation=0)
    assert first_is(CROWDED, turned, at_desk, desk, back_to_back, its_desk) == odd
    assert not first_is(CROWDED, turned, against_wall[0])  # it is at no desk
    assert not first_is(CROWDED, turned, against_wall[0], replace(desk, center=None))


def test_what_stands_before_an_armchair_crowds_it_though_it_may_be_tucked_under_tables() -> None:
    chair, case = Item("armchair", (0.8, 0.8), (0.4, 1.5), 0), Item("sideboard", (0.4, 1.6), (1.05, 1.5), 180)
    assert first_is(CROWDED, 0, chair, case)
    assert first_is(CROWDED, 0, replace(chair, tucked=True), case)


@pytest.mark.parametrize("turned", [0, 1, 2, 3])
@pytest.mark.parametrize(("between", "odd"), [("armchair", True), ("wardrobe", True), ("coffee_table", False)])
def test_no_television_is_watched_through_another_seat(between: str, odd: bool, turned: int) -> None:
    unit, sofa = Item("tv_unit", (0.4, 1.2), (0.2, 1.5), 0), Item("sofa", (0.9, 1.4), (3.4, 1.5), 180)
    there = Item(between, (0.6, 0.6), (2.0, 1.5), 90)
    assert first_is(UNSEEN, turned, unit, sofa, there) == odd
    assert not first_is(UNSEEN, turned, unit, sofa, replace(there, center=(2.0, 2.5)))


@pytest.mark.parametrize("turned", [0, 1, 2, 3])
@pytest.mark.parametrize(("rotation", "odd"), [(0, True), (40, True), (60, False), (180, False)])
def test_no_seat_before_a_television_has_its_back_to_it(rotation: float, odd: bool, turned: int) -> None:
    sofa, unit = Item("sofa", (0.8, 1.2), (1.8, 1.5), rotation), Item("tv_unit", (0.4, 1.2), (0.2, 1.5), 0)
    beyond = Item("coffee_table", (0.5, 0.5), (3.0, 1.5), 0)
    assert first_is(TURNED_AWAY, turned, sofa, unit, beyond) == odd
    assert not first_is(TURNED_AWAY, turned, sofa, replace(unit, rotation=180), beyond)  # which faces the wall
    watched = replace(unit, center=(3.8, 1.5), rotation=180)
    assert not first_is(TURNED_AWAY, turned, replace(sofa, rotation=0), unit, watched)


@pytest.mark.parametrize("turned", [0, 1, 2, 3])
@pytest.mark.parametrize("category", ["sink", "cooktop"])
def test_a_sink_and_a_cooktop_have_a_worktop_beside_them(category: str, turned: int) -> None:
    one, counter = Item(category, (0.6, 0.6), (0.3, 1.0), 0), Item("counter", (0.6, 1.2), (0.3, 1.9), 0)
    odd = partial(first_is, WITHOUT_WORKTOP, turned)
    assert not odd(one, counter)
    assert not odd(one, replace(counter, center=(0.3, 1.94)))
    assert odd(one, replace(counter, center=(0.3, 2.0)))
    assert odd(one, replace(counter, center=(0.9, 1.9)))  # they meet at a corner
    assert not odd(one)  # no counter is to be beside it
    other = Item("sink" if category == "cooktop" else "cooktop", (0.6, 0.6), (0.3, 0.4), 0)
    away = replace(counter, center=(3.7, 1.9), rotation=180)
    assert odd(one, away)
    washer = Item("dishwasher", (0.6, 0.6), (0.3, 1.6), 0)  # which is built in below a worktop
    assert not odd(one, away, washer)
    assert not odd(one, away, replace(washer, center=None))  # it may come here
    assert odd(one, away, Item("fridge", (0.6, 0.6), (0.3, 1.6), 0))
    assert not odd(one, replace(counter, center=(3.7, 1.9), rotation=180), other)
    assert not odd(one, replace(counter, center=(3.7, 1.9), rotation=180), replace(other, center=None))  # it waits
