"""Hard rules one by one, how the search decides, and what a walking disc reaches against a flooded grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from random import Random
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.rooms.designer.search import (
    TIE,
    TRIES,
    NoDesign,
    Piece,
    Place,
    Plan,
    Rule,
    Step,
    Where,
    design,
    unreached,
)
from layoutrl.rooms.designer.shell import Box, Dice, Shell
from tests.rooms.designer.test_generator import flooded
from tests.rooms.designer.test_shell import SHELLS, opened, seeds, turned_box, turned_shell, turned_wall

# 4 m by 3 m; the door swings over x 300 to 390, y 0 to 90, daylight falls on x 100 to 250, y 250 to 300.
ROOM = opened(Shell(400, 300), doors=((0, 300, 390),), windows=((2, 100, 250),))
L_ROOM = opened(Shell(400, 300, (Box(300, 200, 400, 300),)), doors=((0, 300, 390),))

HALF = replace(
    SHELLS, short=(120, 130, 160, 190, 200), long=(160, 190, 220, 260, 300), area=(2.0, 5.0), notch=(30, 75),
    thickness={10: 100}, door_width={45: 70, 40: 30}, window_width=(50, 120),
)  # fmt: skip


def random_plan(seed: int) -> Plan:
    """Up to five pieces that fit, against walls, in corners or free. Even numbers: what lies midway is whole."""
    rng = Random(seed)
    half = HALF.draw(Dice(seed))
    shell = Shell(2 * half.width, 2 * half.height, tuple(Box(*(2 * c for c in notch)) for notch in half.notches))
    gaps = [[(half.walls.index(g.wall), 2 * g.lo, 2 * g.hi) for g in gaps] for gaps in (half.doors, half.windows)]
    plan = Plan(opened(shell, *gaps))
    for category in "aabbc":
        front, *sides = (rng.choice((0, 0, 30, 60)) for _ in range(3))
        width, depth = rng.randrange(30, 240, 2), rng.randrange(30, 120, 2)
        circle = width == depth or rng.random() < 0.2
        piece = Piece(category, width, width if circle else depth, front, circle=circle)
        wall = rng.choice(plan.shell.walls)
        lo = rng.choice((wall.lo, wall.hi - width, 2 * rng.randint(wall.lo // 2, wall.hi // 2)))
        place = Place(piece, wall.box(lo, lo + width, piece.depth), wall.normal, wall, tuple(sides))
        if rng.random() < 0.3:
            x, y = rng.randrange(0, 200, 2), rng.randrange(0, 200, 2)
            place = Place(piece, Box(x, y, x + width, y + piece.depth), rng.choice((1, 3)), None, tuple(sides))
        plan = replace(plan, places=(*plan.places, place)) if plan.fits(place) else plan
    return plan


plans = st.builds(random_plan, seeds)


def turned_place(place: Place, shell: Shell) -> Place:
    box, facing = turned_box(place.box, shell.height), (place.facing + 1) % 4
    wall, host = place.wall and turned_wall(place.wall, shell), place.host and turned_place(place.host, shell)
    return replace(place, box=box, facing=facing, wall=wall, host=host)


def turned(plan: Plan) -> Plan:
    """A quarter counter-clockwise."""
    return Plan(turned_shell(plan.shell), tuple(turned_place(place, plan.shell) for place in plan.places))


def put(x0: int, y0: int, x1: int, y1: int, facing: int = 1, category: str = "b", **more: Any) -> Place:
    """A piece on this floor; `host` and `sides` as in Place, the rest as in Piece."""
    of_place = {key: more.pop(key) for key in ("host", "sides") if key in more}
    size = (x1 - x0, y1 - y0) if facing % 2 else (y1 - y0, x1 - x0)
    return Place(Piece(category, *size, **more), Box(x0, y0, x1, y1), facing, **of_place)


# hard rules

DESK, THIRD = put(0, 100, 100, 150, 1, "a", front=50, sides=(0, 30), back=10), put(50, 170, 90, 190)


SITUATIONS: dict[str, tuple[Shell, list[Place], list[Place], list[Place]]] = {  # placed; what fits; what does not
    "body indoors": (
        L_ROOM, [], [put(0, 0, 300, 100), put(200, 100, 300, 300)], [put(-1, 0, 99, 100), put(200, 100, 301, 201)],
    ),
    "its floor indoors": (
        ROOM, [], [put(0, 200, 90, 250, front=50), put(30, 0, 90, 50, sides=(30, 0)), put(0, 20, 90, 50, back=20)],
        [put(0, 200, 90, 251, front=50), put(29, 0, 90, 50, sides=(30, 0)), put(0, 19, 90, 50, back=20)],
    ),
    "swing": (ROOM, [], [put(200, 0, 300, 50), put(200, 0, 250, 50, sides=(0, 90))], [put(200, 0, 301, 50)]),
    "daylight": (
        ROOM, [], [put(200, 200, 300, 250, tall=True), put(200, 200, 300, 251)], [put(200, 200, 300, 251, tall=True)],
    ),
    "bodies and their floor": (
        ROOM, [DESK], [put(130, 100, 190, 150), put(0, 200, 90, 250), put(0, 60, 90, 90)],
        [put(129, 100, 190, 150), put(0, 199, 90, 250), put(0, 60, 90, 91), put(50, 140, 90, 180)],
    ),
    "its floor": (ROOM, [DESK], [put(160, 100, 200, 150, sides=(60, 0))], [put(160, 100, 200, 150, sides=(61, 0))]),
    "host": (
        ROOM, [DESK, THIRD], [put(0, 150, 50, 190, host=DESK), put(0, 140, 50, 190, host=DESK, tucked=True)],
        [put(0, 149, 50, 190, host=DESK), put(0, 140, 50, 190, tucked=True), put(0, 150, 51, 190, host=DESK)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", SITUATIONS)
def test_a_place_fits_where_it_breaks_no_hard_rule(name: str) -> None:
    shell, placed, fitting, breaking = SITUATIONS[name]
    for _ in range(4):
        plan = Plan(shell, tuple(placed))
        assert all(plan.fits(place) for place in fitting)
        assert not any(plan.fits(place) for place in breaking)
        shell, groups = turned_shell(shell), (placed, fitting, breaking)
        placed, fitting, breaking = ([turned_place(place, plan.shell) for place in group] for group in groups)


# decisions

CHEST = Piece("chest", 50, 50)


def spots(*xs: int) -> Where:
    """Against the wall below, at these x."""
    return lambda plan, piece: [Place(piece, Box(x, 0, x + piece.width, piece.depth), 1) for x in xs]


def worth(values: dict[int, int]) -> Rule:
    """What a place is worth by its x; 0 elsewhere."""
    return lambda plan, place: values.get(place.box.x0, 0)


def taken(*steps: Step) -> list[tuple[str, int]]:
    return [(choice.place.piece.category, choice.place.box.x0) for choice in design(ROOM, steps, 10)]


def test_of_what_fits_the_first_rule_decides_and_the_next_only_between_equals() -> None:
    rules = (worth({0: 10, 100: 50, 200: 50}), worth({0: 900, 100: 10, 200: 20}))
    assert taken(Step(CHEST, spots(0, 100, 200), rules)) == [("chest", 200)]
    assert taken(Step(CHEST, spots(0, 100, 200), rules[::-1])) == [("chest", 0)]
    # In the door's swing, at x = 280, it does not fit.
    assert taken(Step(CHEST, spots(0, 280, 100), (worth({280: 90, 100: 50}),))) == [("chest", 100)]


def test_a_piece_takes_its_next_best_place_if_the_rest_does_not_fit_otherwise() -> None:
    first = Step(CHEST, spots(0, 100, 200), (worth({0: 10, 100: 90, 200: 50}),))
    assert taken(first, Step(CHEST, spots(100))) == [("chest", 200), ("chest", 100)]
    assert taken(first, Step(CHEST, spots(100), optional=True)) == [("chest", 100)]


def test_only_so_many_places_of_a_piece_are_tried() -> None:
    xs = [*range(100, 100 + 10 * TRIES, 10), 0]  # all but the last, the worst, stand where the other must
    steps = [Step(CHEST, spots(*xs), (lambda plan, place: -10 * xs.index(place.box.x0),)), Step(CHEST, spots(130))]
    with pytest.raises(NoDesign, match="no place for the chest"):
        taken(*steps)
    assert taken(replace(steps[0], where=spots(*xs[1:])), steps[1]) == [("chest", 0), ("chest", 130)]


def test_an_optional_piece_is_left_out_where_it_does_not_fit_or_nothing_else_would() -> None:
    chest = Step(CHEST, spots(100), optional=True)
    assert taken(chest) == [("chest", 100)]
    assert taken(Step(CHEST, spots(300), optional=True)) == []
    assert taken(chest, Step(Piece("bed", 60, 60), spots(100))) == [("bed", 100)]


@pytest.mark.parametrize(("x", "sides"), [(60, (60, 60)), (40, (30, 60)), (10, (0, 0))])
def test_the_first_alternative_of_sides_that_fits_is_kept_free(x: int, sides: tuple[int, int]) -> None:
    bed = Piece("bed", 50, 50, sides=((60, 60), (30, 60), (0, 0), (0, 60)))
    assert [choice.place.sides for choice in design(ROOM, [Step(bed, spots(x))], 10)] == [sides]


BED = Step(Piece("bed", 80, 60), spots(30))
FURTHEST = (Step(CHEST, spots(200, 0)), BED, Step(Piece("sofa", 90, 50), spots(300)))  # at 0 the bed does not even fit


@pytest.mark.parametrize(
    ("steps", "reason"),
    [
        (FURTHEST, "no place for the sofa"),
        ((Step(Piece("screen", 10, 300), spots(100)), Step(CHEST, spots(0))), "the chest cannot be reached"),
        ((Step(CHEST, spots(0, 100), (worth({0: TIE - 1}),)),), "two places for the chest are as good"),
        ((Step(CHEST, spots(0, 100)),), "two places for the chest are as good"),
    ],
)
def test_no_design_says_why(steps: Sequence[Step], reason: str) -> None:
    with pytest.raises(NoDesign, match=reason):
        design(ROOM, steps, 60)


def test_the_runner_up_is_the_next_other_place_and_the_margin_what_first_tells_them_apart() -> None:
    rules = (worth({0: 10, 2: 10, 3: 10}), worth({0: 90, 2: 80, 3: 70, 100: 95}), worth({100: 900}))
    (choice,) = design(ROOM, [Step(CHEST, spots(200, 100, 3, 2, 0), rules)], 10)
    assert (choice.place.box.x0, choice.runner_up.box.x0, choice.margin) == (0, 3, 20)  # at 2 it shares 48 / 52
    (choice,) = design(ROOM, [Step(CHEST, spots(0, 2), (worth({2: 1}),))], 10)
    assert (choice.place.box.x0, choice.runner_up, choice.margin) == (2, None, None)
    assert taken(Step(CHEST, spots(0, 100), (worth({100: TIE}),))) == [("chest", 100)]


# reach

TWO_DOORS = opened(Shell(400, 300), doors=((0, 300, 390), (3, 100, 180)))
RECESS = Shell(400, 300, (Box(180, 0, 220, 200),))
BAR, CORNER = put(0, 100, 340, 110), put(0, 250, 50, 300, category="c")


@pytest.mark.parametrize(
    ("shell", "placed", "lost"),
    [
        pytest.param(ROOM, (put(100, 60, 110, 300), put(0, 0, 50, 50)), "", id="who fits exactly passes"),
        pytest.param(ROOM, (put(100, 58, 110, 300), put(0, 0, 50, 50, category="c")), "c", id="too narrow"),
        pytest.param(ROOM, (put(100, 58, 110, 300, tucked=True), CORNER), "", id="tucked aside"),
        pytest.param(ROOM, (put(100, 58, 110, 300, raised=True), CORNER), "", id="walked on"),
        pytest.param(ROOM, (put(50, 0, 100, 50, 1, "c"), put(100, 0, 110, 300)), "c", id="behind a thin thing"),
        pytest.param(TWO_DOORS, (put(100, 20, 150, 300), CORNER), "door", id="second door"),
        pytest.param(TWO_DOORS, (put(100, 70, 150, 300), CORNER), "", id="both doors"),
        pytest.param(ROOM, (BAR, put(340, 168, 400, 228), CORNER), "c", id="square"),
        pytest.param(ROOM, (BAR, put(340, 168, 400, 228, circle=True), CORNER), "", id="round a circle"),
        pytest.param(
            opened(RECESS, doors=((RECESS.outline.index((180, 0)), 50, 140),)),
            (put(180, 200, 220, 300), put(350, 250, 400, 300, category="c")), "c", id="not through a recess",
        ),
    ],
)  # fmt: skip
def test_what_is_lost_is_what_a_disc_of_60_cannot_touch(shell: Shell, placed: tuple[Place, ...], lost: str) -> None:
    assert unreached(Plan(shell, placed), 60) == lost


@given(plans, st.sampled_from([60, 80]))
def test_what_a_disc_reaches_is_what_a_flooded_grid_of_its_centres_touches(plan: Plan, passage: int) -> None:
    lost = unreached(plan, passage)
    assert lost == unreached(turned(plan), passage)
    assert any_lost(plan, passage / 2 - 3) <= bool(lost) <= any_lost(plan, passage / 2 + 3)


def any_lost(plan: Plan, radius: float, step: int = 4) -> bool:
    """Whether a disc that steps from the entrance stays more than a step away from a door or a piece."""
    shell = plan.shell
    x, y = np.meshgrid(np.arange(1, shell.width, step), np.arange(1, shell.height, step), indexing="ij")
    points, room = shapely.points(x, y), shapely.Polygon(shell.outline)
    doors = [shapely.box(*door.strip(-1)) for door in shell.doors]
    shapes = [shapely.box(*place.box) for place in plan.places]
    rounds = [place.piece.circle for place in plan.places]
    shapes = [s.centroid.buffer(s.length / 8) if is_round else s for s, is_round in zip(shapes, rounds, strict=True)]
    blocks = shapely.union_all([room.exterior - shapely.union_all(doors).buffer(0.1), *shapes])
    free = shapely.contains(room, points) & (shapely.distance(points, blocks) >= radius)
    near_doors = [shapely.distance(points, door) <= step for door in doors]
    reached = flooded(free, near_doors[0] & free)
    distances = [shapely.distance(points[reached], thing).min(initial=np.inf) for thing in shapes]
    return not all((reached & near).any() for near in near_doors) or max(distances, default=0) > radius + step
