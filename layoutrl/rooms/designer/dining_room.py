"""Dining rooms: the table in the middle of the free floor, chairs around it, the sideboard away from the door.

Clearances before the table follow the NKBA's guidelines, floor areas without a window GB 50096; other sizes and
shares are unsourced conventions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from layoutrl.rooms.designer.places import LEFT, RIGHT, around, before, ends, in_the_middle, middles, only
from layoutrl.rooms.designer.rules import NO, YES, apart, far_from, in_corner, long_wall, solid_behind
from layoutrl.rooms.designer.search import Piece, Place, Plan, Step, Where
from layoutrl.rooms.designer.shell import Dice, Shell, Shells
from layoutrl.rooms.designer.template import RoomType, Template

CHAIR = Piece("chair", 45, 45, tucked=True)
UNDER = 20  # unsourced: how far a chair stands under the table
SEATED = 81  # from the table's edge to a wall behind a chair
SIDEBOARD_FRONT = 90
CLEAR = 45  # unsourced: between a small sideboard and everything else
END = 60  # unsourced: beside a table's end where nobody sits

SHELLS = Shells(
    short=(240, 245, 280, 345, 360),
    long=(260, 275, 345, 430, 450),
    area=(6.0, 15.0),
    corners={4: 48, 6: 30, 8: 22},
    notch=(25, 130),
    doors={1: 35, 2: 40, 3: 25},
    door_width={90: 65, 80: 35},
    windows={1: 75, 2: 15, 0: 10},
    window_width=(120, 240),
    window_wall={"opposite": 50, "beside": 50},
)


def shell(dice: Dice) -> Shell:
    """Draw a bare dining room; one without a window has at most 10 square metres (GB 50096)."""
    while True:
        drawn = SHELLS.draw(dice)
        if drawn.windows or drawn.area <= 100000:
            return drawn


def clear_around(plan: Plan, place: Place) -> int:
    """The distance to the nearest wall, placed piece or door's swing, along x plus along y."""
    sides = [wall.box(wall.lo, wall.hi, -1) for wall in plan.shell.walls]
    return min(place.box.gap(box) for box in (*sides, *plan.shell.swings, *(other.box for other in plan.places)))


def in_free_floor(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose the middles of the empty floor that no door sweeps, then those of all empty floor."""
    yield from in_the_middle(plan, piece)
    yield from in_the_middle(replace(plan, shell=replace(plan.shell, doors=())), piece)


def off_door_walls(plan: Plan, place: Place) -> int:
    """YES if there is no door anywhere in the wall behind it."""
    return NO if any(door.wall == place.wall for door in plan.shell.doors) else YES


def seat(percent: int, *sides: int) -> Where:
    """Propose a place for a chair at each of these sides of the table, facing it, `percent` of the way along."""

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        for side in sides:
            yield around(plan["table"], piece, side, percent, -UNDER)

    return where


def chairs(*seats: tuple[int, int]) -> list[Step]:
    """Return the steps for a chair at each (side, percent along it) of the table."""
    return [Step(CHAIR, seat(percent, side)) for side, percent in seats]


def sideboard(dice: Dice, shell: Shell) -> list[Step]:
    """Return the step for a sideboard at a solid wall away from the doors, or no step.

    There is none in narrow rooms, where the table needs the floor, and in a tenth of the others.
    """
    if shell.short < 270 or not dice.chance(90):
        return []
    piece = Piece("sideboard", dice.between(100, 180, 10), dice.pick({40: 60, 45: 40}), front=SIDEBOARD_FRONT)
    return [Step(piece, only(solid_behind, middles), (far_from("door"),), optional=True)]


def centred(dice: Dice, shell: Shell) -> list[Step]:
    """A rectangular table in the middle of the largest free floor, four or six chairs along its long sides."""
    board = sideboard(dice, shell)
    six = shell.long >= (400 if board else 330) and dice.chance(50)
    width, depth = (dice.between(160, 180, 5), 90) if six else (dice.between(120, 140, 5), dice.between(80, 90, 5))
    table = Piece("table", width, depth, front=SEATED, sides=((END, END),), back=SEATED)
    along = (18, 50, 82) if six else (27, 73)
    return [
        *board,
        Step(table, in_free_floor, (clear_around,)),
        *chairs(*((side, percent) for side in (0, 2) for percent in along)),
    ]


def heads(dice: Dice, shell: Shell) -> list[Step]:
    """As centred, for six: two chairs along each long side and one at each end."""
    table = Piece("table", dice.between(150, 180, 5), 90, front=SEATED, sides=((SEATED, SEATED),), back=SEATED)
    return [
        *sideboard(dice, shell),
        Step(table, in_free_floor, (clear_around,)),
        *chairs((0, 27), (0, 73), (2, 27), (2, 73), (1, 50), (3, 50)),
    ]


def round_table(dice: Dice, shell: Shell) -> list[Step]:
    """A round table in the middle of the largest free floor, four chairs around it."""
    size = dice.between(100, max(100, min(130, shell.short - 2 * SEATED - 40)), 5)
    table = Piece("table", size, size, front=SEATED, sides=((SEATED, SEATED),), back=SEATED, circle=True)
    return [
        *sideboard(dice, shell),
        Step(table, in_free_floor, (clear_around,)),
        *chairs((0, 50), (1, 50), (2, 50), (3, 50)),
    ]


def small(shell: Shell) -> bool:
    """Below 8.5 square metres."""
    return shell.area < 85000


def at_wall(dice: Dice, shell: Shell) -> list[Step]:
    """In a small room: the table with its end or a long side to the wall far from the door, chairs at the others."""
    long = dice.between(110, 125, 5)  # unsourced below 120: small rooms have small tables
    if shell.long < 310 or dice.chance(50):
        table = Piece("table", 80, long, END, ((SEATED, SEATED),))
        seats = ((1, 27), (1, 73), (3, 27), (3, 73))
    else:
        table = Piece("table", long, dice.pick({85: 50, 90: 50}), SEATED, ((SEATED, SEATED),))
        seats = ((0, 27), (0, 73), (1, 50), (3, 50))
    return [Step(table, middles, (far_from("door"),)), *chairs(*seats), cabinet(dice)]


def in_a_corner(dice: Dice, _: Shell) -> list[Step]:
    """In a small room: the table in a corner far from the door, two chairs along it and one at its end."""
    table = Piece("table", dice.between(110, 130, 5), dice.pick({85: 60, 90: 40}), SEATED, ((0, SEATED), (SEATED, 0)))
    end = Step(CHAIR, seat(50, LEFT, RIGHT))
    first = Step(table, only(in_corner, ends), (long_wall, far_from("door")))
    return [first, *chairs((0, 27), (0, 73)), end, cabinet(dice)]


def bench(dice: Dice, _: Shell) -> list[Step]:
    """A bench along the wall far from the door, the table before it, two chairs on its other side."""
    long = dice.between(120, 150, 5)
    table = Piece("table", long, dice.between(80, 90, 5), SEATED, ((END, END), (END, 0), (0, END)))
    settle = Piece("bench", long + dice.pick({0: 50, 20: 50}), 45)  # unsourced
    return [
        Step(settle, only(off_door_walls, middles), (far_from("door"),)),
        Step(table, before("bench", 5, 0)),
        *chairs((0, 27), (0, 73)),
        cabinet(dice),
    ]


def cabinet(dice: Dice) -> Step:
    """A short sideboard in another corner, where there is room."""
    piece = Piece("sideboard", dice.between(80, 120, 10), 40, front=SIDEBOARD_FRONT)
    return Step(piece, only(apart(CLEAR), only(in_corner, ends)), (solid_behind, far_from("door")), optional=True)


DINING_ROOM = RoomType(
    "dining_room",
    shell,
    {
        "centred": Template(centred, 35, lambda shell: shell.area >= 80000),
        "heads": Template(heads, 12, lambda shell: shell.area >= 110000),
        "round": Template(round_table, 20, lambda shell: shell.area >= 80000),
        "bench": Template(bench, 14, lambda shell: shell.area < 120000),
        "at_wall": Template(at_wall, 40, small),
        "in_a_corner": Template(in_a_corner, 30, small),
    },
)
