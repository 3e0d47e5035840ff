"""Boxes and bare rooms against shapely, dice against their weights, and what must hold for every drawn room."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import combinations, product
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from shapely.affinity import translate

from layoutrl.rooms.designer.shell import GLAZING, WINDOW_HEIGHT, Box, Dice, Gap, Shell, Shells, Wall

STEPS = ((1, 0), (0, 1), (-1, 0), (0, -1))  # one centimetre in each direction

boxes = st.builds(
    lambda x, y, width, height: Box(x, y, x + width, y + height),
    st.integers(-20, 20), st.integers(-20, 20), st.integers(1, 25), st.integers(1, 25),
)  # fmt: skip
seeds = st.integers(0, 10**6)

SHELLS = Shells(
    short=(240, 270, 320, 370, 400), long=(320, 380, 430, 520, 600), area=(9.0, 16.0), corners={4: 20, 6: 30, 8: 50},
    doors={1: 50, 2: 40, 3: 10}, windows={0: 10, 1: 60, 2: 30}, window_width=(100, 220),
)  # fmt: skip


def drawn(seed: int) -> Shell:
    return SHELLS.draw(Dice(seed))


shells = st.builds(drawn, seeds)


def shape(thing: Box | Shell) -> shapely.Polygon:
    return shapely.box(*thing) if isinstance(thing, Box) else shapely.Polygon(thing.outline)


def line(wall: Wall) -> shapely.LineString:
    return shapely.LineString([(wall.at, c) if wall.normal % 2 == 0 else (c, wall.at) for c in (wall.lo, wall.hi)])


Spots = tuple[tuple[int, int, int], ...]  # (number of the wall, lo, hi)


def opened(shell: Shell, doors: Spots, windows: Spots = ()) -> Shell:
    """With openings; a rectangle's walls are 0 below, 1 right, 2 above, 3 left."""
    gaps = [tuple(Gap(shell.walls[k], lo, hi) for k, lo, hi in spots) for spots in (doors, windows)]
    return replace(shell, doors=gaps[0], windows=gaps[1])


def turned_box(box: Box, height: int) -> Box:
    """A quarter counter-clockwise, in a room of this height before."""
    return Box(height - box.y1, box.x0, height - box.y0, box.x1)


def turned_wall(wall: Wall, shell: Shell) -> Wall:
    """The wall of the turned shell with the same floor before it."""
    floor = turned_box(wall.box(wall.lo, wall.hi, 1), shell.height)
    return next(w for w in turned_shell(replace(shell, doors=(), windows=())).walls if w.box(w.lo, w.hi, 1) == floor)


def turned_shell(shell: Shell) -> Shell:
    """A quarter counter-clockwise."""

    def turned_gap(gap: Gap) -> Gap:
        wall = turned_wall(gap.wall, shell)
        return Gap(wall, *turned_box(gap.strip(1), shell.height).span(wall.normal), gap.sliding)

    notches = tuple(turned_box(notch, shell.height) for notch in shell.notches)
    gaps = [tuple(turned_gap(gap) for gap in gaps) for gaps in (shell.doors, shell.windows)]
    return Shell(shell.height, shell.width, notches, shell.thickness, *gaps)


# boxes


@given(boxes, boxes)
def test_boxes_share_what_their_shapes_share_and_a_gap_is_the_distance_along_x_plus_along_y(a: Box, b: Box) -> None:
    common = shape(a).intersection(shape(b)).area
    assert (a.area, a.shared(b), a.overlaps(b)) == (shape(a).area, common, common > 0)
    lines = [shapely.LineString([(box.x0, 0), (box.x1, 0)]) for box in (a, b)]
    rows = [shapely.LineString([(0, box.y0), (0, box.y1)]) for box in (a, b)]
    assert a.gap(b) == shapely.distance(*lines) + shapely.distance(*rows)


@given(boxes, st.integers(0, 3), st.integers(1, 40))
def test_the_strip_beyond_a_side_is_what_the_box_sweeps_when_it_moves_there(box: Box, way: int, depth: int) -> None:
    dx, dy = STEPS[way]
    strip = shape(box.beyond(way, depth))
    assert strip.equals(shape(box).union(translate(shape(box), dx * depth, dy * depth)).envelope - shape(box))
    x0, y0, x1, y1 = shape(box).intersection(strip).bounds  # of the side
    assert (box.side(way), *box.span(way)) == ((x0, y0, y1) if way % 2 == 0 else (y0, x0, x1))


# shells


@given(shells)
def test_an_outline_is_a_counter_clockwise_ring_round_the_box_less_its_notches(shell: Shell) -> None:
    ring = shapely.LinearRing(shell.outline)
    assert (ring.is_simple, ring.is_ccw) == (True, True)
    assert shape(shell).equals(
        shapely.box(0, 0, shell.width, shell.height) - shapely.union_all([*map(shape, shell.notches)])
    )
    assert (shape(shell).area, shell.outline[0]) == (shell.area, min(shell.outline))


@given(shells)
def test_walls_make_up_the_outline_look_indoors_and_know_their_corners(shell: Shell) -> None:
    assert shapely.union_all([*map(line, shell.walls)]).equals(shape(shell).exterior)
    assert sum(wall.length for wall in shell.walls) == shape(shell).length
    for wall in shell.walls:
        assert shape(shell).covers(translate(line(wall), *STEPS[wall.normal]))
        assert shell.is_outer(wall) == shape(shell).envelope.exterior.covers(line(wall))
        for (x, y), convex in zip(line(wall).coords, wall.convex, strict=True):
            assert shape(shell).intersection(shapely.box(x - 1, y - 1, x + 1, y + 1)).area == (1 if convex else 3)


@given(shells, st.data())
def test_what_reaches_from_a_wall_lies_indoors_or_with_a_negative_depth_in_the_wall(shell: Shell, data: Any) -> None:
    wall = data.draw(st.sampled_from(shell.walls))
    lo, hi = sorted(data.draw(st.sets(st.integers(wall.lo, wall.hi), min_size=2, max_size=2)))
    depth = data.draw(st.integers(1, 20))
    for box, indoors in ((wall.box(lo, hi, depth), (hi - lo) * depth), (Gap(wall, lo, hi).strip(-depth), 0)):
        assert (box.area, shape(shell).intersection(shape(box)).area) == ((hi - lo) * depth, indoors)
        assert line(wall).intersection(shape(box)).length == hi - lo
        assert box.span(wall.normal) == (lo, hi)


@given(shells, *[st.integers(1, 300)] * 4)
def test_a_shell_holds_what_its_shape_covers(shell: Shell, x: int, y: int, width: int, height: int) -> None:
    in_corners = [(cx - width * i, cy - height * j) for cx, cy in shell.outline for i in (0, 1) for j in (0, 1)]
    for x0, y0 in ((x, y), *in_corners):
        box = Box(x0, y0, x0 + width, y0 + height)
        assert shell.holds(box) == shape(shell).covers(shape(box))


def test_a_leaf_sweeps_a_square_a_sliding_door_a_strip_and_daylight_reaches_half_a_metre() -> None:
    shell = opened(Shell(400, 300), doors=((0, 300, 390), (3, 100, 180)), windows=((2, 100, 250),))
    assert shell.swings == (Box(300, 0, 390, 90), Box(0, 100, 80, 180))
    assert shell.entrance._replace(sliding=True).swing == Box(300, 0, 390, 10)
    assert shell.daylight == (Box(100, 250, 250, 300),)


# dice


def test_the_same_seed_throws_the_same_and_another_does_not() -> None:
    first, again, *others = [Dice(*seed).between(0, 10**9) for seed in ((1, 2), (1, 2), (2, 1), (1,))]
    assert first == again
    assert len({first, *others}) == 3


def test_keys_are_picked_as_often_as_their_weights_say() -> None:
    dice = Dice(0)
    counts = Counter(dice.pick({"often": 70, "never": 0, "seldom": 25, "rarely": 5}) for _ in range(8000))
    assert {key: round(n / 80) for key, n in counts.items()} == pytest.approx(
        {"often": 70, "seldom": 25, "rarely": 5}, abs=2
    )
    shares = [sum(dice.chance(percent) for _ in range(8000)) / 80 for percent in (0, 30, 100)]
    assert shares == [0, pytest.approx(30, abs=2), 100]


@given(seeds, st.integers(-50, 50), st.integers(0, 9), st.integers(1, 7))
def test_between_throws_both_ends_and_every_step_between(seed: int, low: int, steps: int, step: int) -> None:
    dice, high = Dice(seed), low + steps * step
    assert {dice.between(low, high, step) for _ in range(300)} == set(range(low, high + 1, step))


def test_a_spread_has_the_quantiles_that_were_asked() -> None:
    dice = Dice(0)
    thrown = [dice.spread(100, 200, 250, 400, 1000) for _ in range(20000)]
    assert 100 <= min(thrown) <= max(thrown) <= 1000
    quantiles = np.quantile(thrown, [0, 0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 0.95, 1])
    assert quantiles == pytest.approx([100, 150, 200, 225, 250, 325, 400, 700, 1000], rel=0.04)


# drawn shells


@given(shells)
def test_drawn_shells_keep_to_what_their_type_says(shell: Shell) -> None:
    assert 9.0 <= shell.area / 1e4 <= 16.0
    assert 240 <= min(shell.width, shell.height) <= max(shell.width, shell.height) <= 600
    assert all(60 <= side <= 150 for n in shell.notches for side in (n.x1 - n.x0, n.y1 - n.y0))
    assert (len(shell.doors), len(shell.windows)) in product(SHELLS.doors, SHELLS.windows)
    assert {door.width for door in shell.doors} <= {*SHELLS.door_width}
    assert all(100 <= window.width <= 220 for window in shell.windows)


def test_all_forms_are_drawn() -> None:
    forms = {tuple(wall.normal for wall in drawn(seed).walls) for seed in range(400)}
    assert len(forms) == 1 + 4 + 4 + 4 + 2  # rectangle, L, bay, recess, Z


@given(shells)
def test_doors_swing_indoors_and_apart_and_openings_have_walls_of_their_own_far_from_corners(shell: Shell) -> None:
    assert all(shape(shell).covers(shape(swing)) for swing in shell.swings)
    assert not any(a.overlaps(b) for a, b in combinations(shell.swings, 2))
    openings = (*shell.doors, *shell.windows)
    assert len({opening.wall for opening in openings} & {*shell.walls}) == len(openings)
    for opening in openings:
        off = 20 if opening in shell.windows else 5
        assert opening.wall.lo + off <= opening.lo < opening.hi <= opening.wall.hi - off
        bands = [wall.box(wall.lo, wall.hi, -shell.thickness) for wall in shell.walls if wall != opening.wall]
        assert not any(opening.strip(-shell.thickness).overlaps(band) for band in bands)


@pytest.mark.parametrize(("where", "turns"), [("opposite", {2}), ("beside", {1, 3}), ("any", {1, 2, 3})])
def test_the_first_window_is_in_the_asked_wall_and_wide_enough_for_the_floor(where: str, turns: set[int]) -> None:
    kind = replace(SHELLS, notch=(150, 200), windows={1: 50, 2: 50}, window_wall={where: 100})
    lit = [kind.draw(Dice(seed)) for seed in range(60)]
    assert {(shell.windows[0].wall.normal - shell.entrance.wall.normal) % 4 for shell in lit} == turns
    assert all(shell.is_outer(window.wall) for shell in lit for window in shell.windows)
    for shell in lit:
        width = shell.windows[0].width
        assert width == 220 or width * WINDOW_HEIGHT * GLAZING >= shell.area


def test_a_door_in_a_narrow_recess_leads_nowhere() -> None:
    for width, leads_out in ((40, False), (109, False), (110, True)):
        shell = Shell(400, 300, (Box(100, 0, 100 + width, 200),))
        for normal in (0, 2):
            (wall,) = (w for w in shell.walls if w.normal == normal and not shell.is_outer(w))
            assert shell.leads_out(Gap(wall, 50, 140)) == leads_out
    assert all(shell.leads_out(Gap(wall, 50, 140)) for wall in shell.walls if shell.is_outer(wall))
