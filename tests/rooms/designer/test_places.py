"""Free walls and floors against brute force, and where each function puts a piece, whichever way the room is turned."""

from __future__ import annotations

from itertools import combinations, pairwise, product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.rooms.designer import places
from layoutrl.rooms.designer.places import LEFT, RIGHT, around, before, beside, free_floors, free_spans, only
from layoutrl.rooms.designer.search import Piece, Place, Plan, Where
from layoutrl.rooms.designer.shell import Box, Shell
from tests.rooms.designer.test_search import L_ROOM, ROOM, plans, turned, turned_place

pieces = st.builds(
    lambda half_width, half_depth, sides, tall: Piece("x", 2 * half_width, 2 * half_depth, sides=sides, tall=tall),
    st.integers(5, 60), st.integers(5, 40), st.sampled_from([((0, 0),), ((30, 10), (0, 20))]), st.booleans(),
)  # fmt: skip
AT_WALLS = [
    places.ends, places.middles, places.at_window, places.opposite("a"), places.filling("a"),
    places.face_to_face(Piece("y", 60, 40), 50, 500),
]  # fmt: skip
ANYWHERE = [
    *AT_WALLS, beside("a", LEFT, 10), beside("a", RIGHT), places.round_corner("a"), before("b", 20), before("b", -6, 0),
    places.either_side("b", 5), lambda plan, piece: (around(host, piece, 1, 50, 10, 1) for host in plan.places),
]  # fmt: skip


def is_empty(plan: Plan, box: Box, tall: bool = False) -> bool:
    blocks = [*(place.box for place in plan.places), *plan.shell.swings, *(plan.shell.daylight if tall else ())]
    return plan.shell.holds(box) and not any(box.overlaps(block) for block in blocks)


@given(plans, st.integers(1, 150), st.booleans())
def test_free_spans_are_the_runs_of_free_centimetres(plan: Plan, depth: int, tall: bool) -> None:
    box = Shell(plan.shell.width, plan.shell.height)
    for wall in (wall for wall in plan.shell.walls if box.holds(wall.box(wall.lo, wall.hi, depth))):
        spans = free_spans(plan, wall, depth, tall)
        free = [c for c in range(wall.lo, wall.hi) if is_empty(plan, wall.box(c, c + 1, depth), tall)]
        assert [c for lo, hi in spans for c in range(lo, hi)] == free
        assert all(first[1] < second[0] for first, second in pairwise(spans))


@given(plans)
def test_free_floors_are_all_empty_rectangles_that_lie_in_no_other_largest_first(plan: Plan) -> None:
    blocks = [*(place.box for place in plan.places), *plan.shell.swings, *plan.shell.notches]
    xs = sorted({0, plan.shell.width, *(x for block in blocks for x in (block.x0, block.x1))})
    ys = sorted({0, plan.shell.height, *(y for block in blocks for y in (block.y0, block.y1))})
    boxes = [Box(x0, y0, x1, y1) for (x0, x1), (y0, y1) in product(combinations(xs, 2), combinations(ys, 2))]
    empty = [box for box in boxes if is_empty(plan, box)]
    largest = [f for f in empty if not any(f != g and f.shared(g) == f.area for g in empty)]
    floors = free_floors(plan)
    assert sorted(floors) == sorted(largest)
    assert [floor.area for floor in floors] == sorted((floor.area for floor in largest), reverse=True)


@given(plans, pieces, st.sampled_from(AT_WALLS))
def test_what_stands_against_a_wall_does_so_with_its_whole_back(plan: Plan, piece: Piece, where: Where) -> None:
    for place in filter(plan.fits, where(plan, piece)):
        lo, hi = place.box.span(place.facing)
        assert (place.facing, place.box) == (place.wall.normal, place.wall.box(lo, hi, piece.depth))
        assert place.wall.lo <= lo < hi <= place.wall.hi
        if where not in AT_WALLS[:2]:
            continue
        start, end = next(s for s in free_spans(plan, place.wall, piece.depth, piece.tall) if s[0] <= lo < hi <= s[1])
        roomy = [lo, hi, *(side for keep in place.keeps for side in keep.span(place.facing))]
        assert lo - start == end - hi if where is places.middles else min(roomy) == start or max(roomy) == end


@given(plans, pieces, st.sampled_from(ANYWHERE))
def test_a_turned_room_has_turned_places(plan: Plan, piece: Piece, where: Where) -> None:
    assert set(where(turned(plan), piece)) == {turned_place(place, plan.shell) for place in where(plan, piece)}
    assert set(places.walls(plan, piece)) == {*places.ends(plan, piece), *places.middles(plan, piece)}


def standing(shell: Shell, category: str, number: int, lo: int, width: int, depth: int) -> Place:
    wall = shell.walls[number]
    return Place(Piece(category, width, depth), wall.box(lo, lo + width, depth), wall.normal, wall)


SOFA, SEAT = standing(ROOM, "a", 0, 100, 100, 80), standing(ROOM, "a", 0, 0, 100, 60)
BENCH = standing(ROOM, "a", 0, 60, 100, 80)
CHEST, SHELF = standing(ROOM, "c", 2, 0, 130, 30), standing(ROOM, "d", 3, 0, 160, 30)
AT_TOP, NEXT = standing(ROOM, "a", 2, 0, 100, 60), standing(ROOM, "d", 2, 200, 60, 30)
FACING = places.face_to_face(Piece("y", 100, 50), 150, 220)


@pytest.mark.parametrize(
    ("placed", "where", "expected"),
    [
        pytest.param([SOFA], beside("a", LEFT, 10), [(30, 0, 90, 40, 1)], id="left of who sits on it"),
        pytest.param([SOFA], beside("a", RIGHT), [(200, 0, 260, 40, 1)], id="right"),
        pytest.param([SOFA], before("a", 30), [(120, 110, 180, 150, 3)], id="looks back at it"),
        pytest.param([SOFA], before("a", -10, turn=0), [(120, 70, 180, 110, 1)], id="under it"),
        pytest.param([], lambda *_: [around(SOFA, _[1], LEFT, 25, 20)], [(40, -10, 80, 50, 0)], id="round its left"),
        pytest.param([], lambda *_: [around(SOFA, _[1], RIGHT, 50, 5, 1)], [(205, 20, 265, 60, 1)], id="turned"),
        pytest.param([SOFA], places.opposite("a"), [(120, 260, 180, 300, 3)], id="on its axis"),
        pytest.param([SOFA, CHEST], places.opposite("a"), [(130, 260, 190, 300, 3)], id="as near its axis as may be"),
        pytest.param([SEAT], places.round_corner("a"), [(0, 60, 40, 120, 0)], id="round the corner"),
        pytest.param([AT_TOP], places.round_corner("a"), [(0, 180, 40, 240, 0)], id="the other way"),
        pytest.param([CHEST, NEXT], places.filling("c"), [(130, 260, 200, 300, 3)], id="all that is free"),
        pytest.param([BENCH], only(lambda _, p: p.box.x1 == 60, places.middles), [(0, 0, 60, 40, 1)], id="exactly"),
        pytest.param([], places.at_window, [(145, 260, 205, 300, 3)], id="under the window"),
        pytest.param([], only(lambda _, p: p.wall.normal == 1, places.middles), [(120, 0, 180, 40, 1)], id="only"),
        pytest.param([standing(ROOM, "a", 3, 0, 300, 200)], places.in_the_middle, [(280, 165, 320, 225, 0)], id="free"),
        pytest.param([CHEST, SHELF], FACING, [(185, 0, 245, 40, 1), (185, 260, 245, 300, 3)], id="axis"),
    ],
)
def test_a_piece_of_60_by_40_comes_to_stand(placed: list[Place], where: Where, expected: list[tuple]) -> None:
    plan, piece = Plan(ROOM, tuple(placed)), Piece("x", 60, 40)
    found = [(*place.box, place.facing) for place in where(plan, piece)]
    assert sorted(found[:1] if where is places.in_the_middle else found) == expected


@pytest.mark.parametrize(
    ("host", "where"), [((3, 240, 60), beside("a", LEFT)), ((4, 200, 100), places.round_corner("a"))]
)
def test_nothing_stands_past_the_end_of_its_wall(host: tuple[int, int, int], where: Where) -> None:
    plan = Plan(L_ROOM, (standing(L_ROOM, "a", *host, 60),))
    assert not any(plan.fits(place) for place in where(plan, Piece("x", 60, 40)))


def test_opposite_is_the_wall_ahead_not_one_beside_it_that_faces_the_same_way() -> None:
    places_ahead = places.opposite("a")(Plan(L_ROOM, (standing(L_ROOM, "a", 0, 0, 100, 60),)), Piece("x", 60, 40))
    assert [place.box for place in places_ahead] == [Box(20, 260, 80, 300)]
