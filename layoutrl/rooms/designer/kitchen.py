"""Kitchens: from the fridge by the door over the sink at the window and a counter to prepare on, to the cooktop.

The order, with counters between and beside, follows the NKBA's guidelines, but the legs of their work triangle are
not enforced; floor areas are as in GB 50096-2011. Shares, and sizes without a source, are unsourced conventions.
"""

from __future__ import annotations

from collections.abc import Iterator

from layoutrl.rooms.designer.places import (
    LEFT,
    RIGHT,
    against,
    at_window,
    beside,
    either_side,
    filling,
    free_spans,
    middles,
    only,
    round_corner,
)
from layoutrl.rooms.designer.rules import NO, YES, far_from, in_corner, near
from layoutrl.rooms.designer.search import Piece, Place, Plan, Rule, Step, Where
from layoutrl.rooms.designer.shell import Dice, Shell, Shells
from layoutrl.rooms.designer.template import RoomType, Template

DEPTH = 60  # of counters and of what is built into them
CORNER = 90  # width of a counter in a corner, so that a person before it reaches it
LANDING = 30  # the least counter on either side of the cooktop
PREPARATION = 60  # the least counter between sink and cooktop
OFF_WINDOW = 30  # from the cooktop, whose flame a draught would blow out, to a window
AISLE = 90  # from the front of a run to a wall or another run
SHORTEST_RUN = 300  # fridge, sink, counter, cooktop and counter, with a hand to spare

SHELLS = Shells(
    short=(150, 160, 195, 235, 240),
    long=(270, 300, 345, 400, 420),
    area=(4.2, 9.0),
    corners={4: 65, 6: 27, 8: 8},
    notch=(25, 60),  # shafts
    thickness={20: 45, 12: 30, 10: 25},
    doors={1: 85, 2: 15},
    door_width={80: 75, 90: 25},
    windows={0: 5, 1: 95},
    window_width=(80, 120),
    window_wall={"opposite": 50, "beside": 50},
)


def longest_run(shell: Shell) -> int:
    """Return the length of the longest wall without the entrance."""
    return max(wall.length for wall in shell.walls if wall != shell.entrance.wall)


def widest(shell: Shell) -> int:
    """Return the greatest width of an appliance: 60 where the longest run just holds all, up to 90 in longer ones."""
    return max(60, min(90, 60 + (longest_run(shell) - SHORTEST_RUN) // 4))


def fridge(dice: Dice, shell: Shell) -> Piece:
    """Deeper where the aisle allows it."""
    depth = 65 if shell.short >= 65 + AISLE else 60
    return Piece("fridge", dice.between(60, widest(shell), 5), depth, front=AISLE, tall=True)


def sink(dice: Dice, shell: Shell) -> Piece:
    """Return a sink, from 60 centimetres to as wide as the kitchen allows."""
    return Piece("sink", dice.between(60, widest(shell), 10), DEPTH, front=AISLE)


def cooktop(dice: Dice, shell: Shell, highest: int = 90) -> Piece:
    """60 to `highest` centimetres wide, as the kitchen allows."""
    return Piece("cooktop", dice.between(60, min(highest, widest(shell)), 5), DEPTH, front=AISLE)


def counter(least: int) -> Piece:
    """Return a counter, at least `least` centimetres wide: `filling` may widen it."""
    return Piece("counter", least, DEPTH)


def run_ends(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose where a run of counters may begin: at a wall's end, or where a door's swing cuts the wall short."""
    for wall in plan.shell.walls:
        for lo, hi in free_spans(plan, wall, piece.depth):
            for start in (lo, hi - piece.width):
                yield against(piece, wall, start)


def under_window(after: int, beyond: int) -> Where:
    """Propose places under each window, as near to its middle as the clearances allow.

    `beyond` is kept free on both sides, but on the fridge's wall only on the side away from the fridge; there the sink
    stands right beside the fridge, or leaves at least `after` for a counter between them.
    """

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        for place in at_window(plan, piece):
            assert place.wall is not None
            normal = place.wall.normal
            middle = sum(place.box.span(normal)) // 2
            near_end, far_end = plan["fridge"].box.span(normal)
            for lo, hi in free_spans(plan, place.wall, piece.depth):
                if not lo <= middle <= hi:
                    continue
                low, high = lo + beyond, hi - beyond - piece.width
                start = middle - piece.width // 2
                if place.wall == plan["fridge"].wall and lo == far_end:
                    start = min(start, high)
                    start = start if start - lo >= after else lo
                elif place.wall == plan["fridge"].wall and hi == near_end:
                    start = max(start, low)
                    start = start if hi - start - piece.width >= after else hi - piece.width
                else:
                    start = max(low, min(start, high))
                yield against(piece, place.wall, start)

    return where


def past_sink(preparation: int) -> Where:
    """Propose places against the sink's wall, `preparation` from it, or farther to be OFF_WINDOW past a window."""

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        for side in (LEFT, RIGHT):
            for place in beside("sink", side, preparation)(plan, piece):
                assert place.wall is not None
                lo, hi = place.box.span(place.facing)
                upward = lo > plan["sink"].box.span(place.facing)[0]
                for window in plan.shell.windows:
                    if window.wall == place.wall and window.lo - OFF_WINDOW < hi and lo < window.hi + OFF_WINDOW:
                        lo = window.hi + OFF_WINDOW if upward else window.lo - OFF_WINDOW - piece.width
                yield against(piece, place.wall, lo, host=place.host)

    return where


def off_window(plan: Plan, place: Place) -> int:
    """YES if it is at least OFF_WINDOW away from any window."""
    return YES if not plan.shell.windows or far_from("window")(plan, place) >= OFF_WINDOW else NO


def on_window_wall(plan: Plan, place: Place) -> int:
    """YES if its back is to a wall with a window."""
    return YES if any(window.wall == place.wall for window in plan.shell.windows) else NO


def beside_window_wall(plan: Plan, place: Place) -> int:
    """YES if its wall is at right angles to that of a window."""
    return YES if any((window.wall.normal - place.facing) % 2 for window in plan.shell.windows) else NO


def on_side_wall(plan: Plan, place: Place) -> int:
    """YES if its back is to a long side of the room."""
    along = 0 if plan.shell.height >= plan.shell.width else 1
    return YES if place.facing % 2 == along else NO


def sink_has_two_neighbours(plan: Plan, place: Place) -> int:
    """YES if the sink touches at least two other pieces, so that the run has no gap at it."""
    return YES if sum(plan["sink"].box.gap(other.box) == 0 for other in plan.places) > 2 else NO  # itself counts


def across_from(category: str) -> Rule:
    """Return a rule: YES if it and the first placed piece of the category face opposite ways."""
    return lambda plan, place: YES if (place.facing - plan[category].facing) % 4 == 2 else NO


def one_line(dice: Dice, shell: Shell) -> list[Step]:
    """All in one run on a long wall, the window's if it has one, from the fridge by the door to the cooktop."""
    stove = cooktop(dice, shell)
    return [
        Step(fridge(dice, shell), only(on_side_wall, run_ends), (on_window_wall, near("entrance"))),
        Step(sink(dice, shell), sink_in_line(PREPARATION + stove.width + LANDING), (on_window_wall,)),
        Step(counter(LANDING), filling("fridge"), optional=True),
        Step(stove, only(off_window, past_sink(dice.between(PREPARATION, 90, 10)))),
        Step(counter(PREPARATION), filling("sink")),
        Step(counter(LANDING), only(sink_has_two_neighbours, filling("cooktop"))),
    ]


def l_shaped(dice: Dice, shell: Shell) -> list[Step]:
    """Fridge by the door and sink under the window on one wall, the cooktop round the corner."""
    free = shell.short - DEPTH - 2 * LANDING
    preparation = dice.between(LANDING, min(PREPARATION, free - 30), 5)
    return [
        Step(fridge(dice, shell), only(on_window_wall, run_ends), (near("entrance"),)),
        Step(sink(dice, shell), sink_in_line(CORNER)),
        Step(counter(LANDING), filling("fridge"), optional=True),
        Step(counter(CORNER), only(in_corner, filling("sink"))),
        Step(counter(preparation), round_corner("counter")),
        Step(cooktop(dice, shell, free + LANDING - preparation), only(off_window, either_side("counter"))),
        Step(counter(LANDING), only(sink_has_two_neighbours, filling("cooktop"))),
    ]


def u_shaped(dice: Dice, shell: Shell) -> list[Step]:
    """Counters on three walls: the fridge by the door, the sink under the window between them, the cooktop opposite."""
    return [
        Step(fridge(dice, shell), only(beside_window_wall, run_ends), (near("entrance"),)),
        Step(counter(CORNER), only(in_corner, filling("fridge"))),
        Step(Piece("sink", 60, DEPTH, front=AISLE), only(on_window_wall, round_corner("counter"))),
        Step(counter(CORNER), only(in_corner, filling("sink"))),
        Step(counter(dice.between(LANDING, PREPARATION, 5)), only(across_from("fridge"), round_corner("counter"))),
        Step(cooktop(dice, shell), only(off_window, either_side("counter"))),
        Step(counter(LANDING), filling("cooktop")),
    ]


def two_line(dice: Dice, shell: Shell) -> list[Step]:
    """Two runs face each other: fridge and sink on one side, the cooktop amid counters on the other."""
    return [
        Step(fridge(dice, shell), only(on_side_wall, run_ends), (on_window_wall, near("entrance"))),
        Step(sink(dice, shell), sink_in_line(PREPARATION), (on_window_wall,)),
        Step(counter(LANDING), filling("fridge"), optional=True),
        Step(counter(PREPARATION), filling("sink")),
        Step(cooktop(dice, shell), only(off_window, only(across_from("sink"), middles)), (near("sink"),)),
        Step(counter(LANDING), filling("cooktop"), (near("fridge"),)),
        Step(counter(LANDING), only(sink_has_two_neighbours, filling("cooktop"))),
    ]


def sink_in_line(beyond: int) -> Where:
    """Propose places under the window of the fridge's wall, or beside the fridge where that wall has none.

    `beyond` is as in `under_window`.
    """

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        if on_window_wall(plan, plan["fridge"]):
            yield from (p for p in under_window(LANDING, beyond)(plan, piece) if p.wall == plan["fridge"].wall)
        else:
            yield from either_side("fridge")(plan, piece)

    return where


def clear_width(shell: Shell) -> int:
    """Return the width across the room, less the largest shaft."""
    if shell.width <= shell.height:
        return shell.width - max((notch.x1 - notch.x0 for notch in shell.notches), default=0)
    return shell.height - max((notch.y1 - notch.y0 for notch in shell.notches), default=0)


def suits_one_line(shell: Shell) -> bool:
    """Return whether the room is too narrow for two runs, but long enough for one.

    A window within the run takes some of its length.
    """
    needed = SHORTEST_RUN + (30 if any(window.wall.length > SHORTEST_RUN - 60 for window in shell.windows) else 0)
    return shell.short <= 200 and clear_width(shell) >= DEPTH + AISLE and longest_run(shell) >= needed


def suits_l(shell: Shell) -> bool:
    """Return whether the room is wide enough and a long wall has a window."""
    return clear_width(shell) >= 180 and any(window.wall.length >= 240 for window in shell.windows)


def suits_u(shell: Shell) -> bool:
    """Return whether a short wall with a window fits two runs and an aisle, and some wall is long enough for a run."""
    wide = DEPTH + AISLE + DEPTH
    end = any(wide <= window.wall.length < 250 for window in shell.windows)
    return end and clear_width(shell) >= 180 and longest_run(shell) >= SHORTEST_RUN


def suits_two_line(shell: Shell) -> bool:
    """Wide enough for two lines and the aisle between them."""
    return shell.short >= 65 + AISLE + DEPTH


KITCHEN = RoomType(
    "kitchen",
    SHELLS.draw,
    {
        "one_line": Template(one_line, 35, suits_one_line),
        "l_shaped": Template(l_shaped, 30, suits_l),
        "u_shaped": Template(u_shaped, 25, suits_u),
        "two_line": Template(two_line, 20, suits_two_line),
    },
)
