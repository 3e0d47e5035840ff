"""Living rooms: the sofa on a long solid wall looks across the coffee table at the television, daylight from the side.

At least 10 square metres (GB 50096); other sizes, distances and shares are unsourced conventions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import shapely

from layoutrl.rooms.designer.places import (
    LEFT,
    RIGHT,
    around,
    before,
    either_side,
    ends,
    face_to_face,
    middles,
    only,
    opposite,
)
from layoutrl.rooms.designer.rules import (
    NO,
    YES,
    across_daylight,
    apart,
    centred_on,
    far_from,
    in_corner,
    long_wall,
    looks_at_door,
    near,
    solid_behind,
)
from layoutrl.rooms.designer.search import Piece, Place, Plan, Step, Where
from layoutrl.rooms.designer.shell import LEAF_OFF_CORNER, Box, Dice, Gap, Shell, Shells
from layoutrl.rooms.designer.template import RoomType, Template

TO_TV = (200, 350)  # from the sofa's front to the television's
TO_TABLE = 40  # from the sofa to the coffee table
SQUEEZE = 60  # unsourced: less than this behind a seat is no way through, so the seat moves back to the wall
BETWEEN = 10  # two armchairs side by side
TO_SIDE_TABLE = 5  # unsourced: from the sofa to a side table
CLEAR = 45  # unsourced: between a shelf in a corner and everything else
FAR_SEAT = 90  # unsourced: the most between a seat and the coffee table

PLAIN = Shells(
    short=(330, 345, 385, 430, 450),
    long=(360, 410, 490, 570, 600),
    area=(11.0, 27.0),
    corners={4: 50, 6: 28, 8: 22},
    notch=(40, 170),
    doors={1: 38, 2: 38, 3: 24},
    door_width={90: 75, 80: 25},
    windows={1: 78, 2: 18, 3: 4},
    window_width=(150, 300),
    window_wall={"opposite": 50, "beside": 50},
)


@dataclass(frozen=True)
class Corridors(Shells):
    """Living rooms that a corridor leads to: an arm at one corner, with the doors in it."""

    arm: tuple[int, int] = (110, 140)  # its width
    reach: tuple[int, int] = (110, 280)  # its length

    def _outline(self, dice: Dice) -> Shell:
        """A rectangle, made longer in one direction by the arm; the rest of the new strip is cut out."""
        room = super()._outline(dice)
        size = [room.width, room.height]
        along = dice.between(0, 1)  # the arm runs along x or y
        cut = [dice.between(*self.reach)] * 2
        cut[1 - along] = size[1 - along] - dice.between(*self.arm)
        size[along] += cut[along]
        x, y = (dice.pick({0: 50, size[k] - cut[k]: 50}) for k in (0, 1))
        return Shell(size[0], size[1], (Box(x, y, x + cut[0], y + cut[1]),), room.thickness)

    def _doors(self, shell: Shell, dice: Dice) -> tuple[Gap, ...] | None:
        arm = corridor(shell)
        doors: list[Gap] = []
        for _ in range(dice.pick(self.doors)):
            width = dice.pick(self.door_width)
            spots: dict[Gap, int] = {}
            for wall in shell.walls:
                if wall.at != arm.side((wall.normal + 2) % 4) or any(wall == door.wall for door in doors):
                    continue
                off = LEAF_OFF_CORNER if all(wall.convex) else shell.thickness
                low, high = max(wall.lo, arm.span(wall.normal)[0]) + off, min(wall.hi, arm.span(wall.normal)[1]) - off
                for lo in (low, high - width) if high - low >= width else ():
                    spots[Gap(wall, lo, lo + width)] = 50
            if not spots:
                return None
            doors.append(dice.pick(spots))
            if not shell.holds(doors[-1].swing) or any(doors[-1].swing.overlaps(d.swing) for d in doors[:-1]):
                return None
        return tuple(doors)


def corridor(shell: Shell) -> Box:
    """Return the arm: the narrower of the strips of floor beside the notch."""
    (notch,) = shell.notches
    flanks = (
        Box(notch.x0, notch.y1, notch.x1, shell.height),
        Box(notch.x0, 0, notch.x1, notch.y0),
        Box(notch.x1, notch.y0, shell.width, notch.y1),
        Box(0, notch.y0, notch.x0, notch.y1),
    )
    return min((flank for flank in flanks if flank.area), key=lambda f: min(f.x1 - f.x0, f.y1 - f.y0))


CORRIDORS = Corridors(
    short=(320, 335, 365, 420, 440),
    long=(350, 380, 440, 510, 540),
    area=(13.0, 29.0),
    doors={1: 20, 2: 45, 3: 35},
    door_width={90: 50, 80: 50},
    windows={1: 85, 2: 15},
    window_width=(150, 300),
)


def shell(dice: Dice) -> Shell:
    """Draw a bare living room: one in five is entered through a corridor, most are lit from a short side. Unsourced."""
    kind = CORRIDORS if dice.chance(20) else PLAIN
    from_any_side = dice.chance(30)
    while True:
        drawn = kind.draw(dice)
        if from_any_side or lit_from_short_side(drawn):
            return drawn


def lit_from_short_side(shell: Shell) -> bool:
    """The largest window lies in one of the shorter sides."""
    wall = shell.largest_window.wall
    along, across = (shell.height, shell.width) if wall.normal % 2 == 0 else (shell.width, shell.height)
    return along <= across


def off_the_route(plan: Plan, place: Place) -> int:
    """YES if no door opens, and no straight way from door to door runs, between it and what it faces."""
    view = shapely.box(*place.box.beyond(place.facing, TO_TV[1]))
    doors = [shapely.box(*swing).centroid for swing in plan.shell.swings]
    ways = [*doors, *(shapely.LineString(pair) for pair in combinations(doors, 2))]
    return NO if any(view.intersects(way) for way in ways) else YES


def at_right_angles(along: int = 0) -> Where:
    """Propose seats that face the coffee table from one of its ends, clear of the sofa.

    A seat with SQUEEZE or more behind it keeps that free. Another moves back against the wall, or is not proposed if
    that is farther than FAR_SEAT from the table. `along` is how far its middle lies off the coffee table's, away from
    the sofa.
    """

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        sofa, table = plan["sofa"], plan["coffee_table"]
        gap = max(TO_TABLE, (sofa.piece.width - table.piece.width) // 2 + 5)
        for side in (LEFT, RIGHT):
            seat = around(table, piece, side, 50, gap)
            seat = replace(seat, box=moved(seat.box, sofa.facing, along), host=sofa)
            room = behind(plan.shell, seat)
            if room >= SQUEEZE:
                yield replace(seat, piece=replace(piece, back=SQUEEZE))
            elif gap + room <= FAR_SEAT:
                yield replace(seat, box=moved(seat.box, (seat.facing + 2) % 4, room))

    return where


def next_armchair(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose the place beside the first armchair, away from the sofa, if it is as far from the wall."""
    first = plan["armchair"]
    second = replace(first, box=moved(first.box, plan["sofa"].facing, piece.width + BETWEEN))
    if behind(plan.shell, second) == behind(plan.shell, first):
        yield second


def moved(box: Box, direction: int, by: int) -> Box:
    """The box, moved by so many centimetres."""
    dx, dy = ((by, 0), (0, by), (-by, 0), (0, -by))[direction]
    return Box(box.x0 + dx, box.y0 + dy, box.x1 + dx, box.y1 + dy)


def behind(shell: Shell, place: Place) -> int:
    """Return the distance from its back to the wall, at most SQUEEZE."""
    back = (place.facing + 2) % 4
    return next((d for d in range(SQUEEZE) if not shell.holds(place.box.beyond(back, d + 1))), SQUEEZE)


def sofa(dice: Dice, shell: Shell) -> Piece:
    """Return a sofa, shorter in a narrow room, with a hand's breadth free at its ends."""
    widest = max(180, min(240, shell.short * 55 // 100))
    return Piece("sofa", dice.between(180, widest, 10), dice.between(85, 100, 5), front=TO_TABLE, sides=((20, 20),))


def coffee_table(dice: Dice) -> Piece:
    """Round or rectangular."""
    if dice.chance(20):
        size = dice.between(70, 90, 10)  # unsourced
        return Piece("coffee_table", size, size, circle=True)
    return Piece("coffee_table", dice.between(100, 120, 10), dice.pick({50: 35, 55: 20, 60: 45}))


def television(dice: Dice) -> Piece:
    """A low unit with a screen above it."""
    return Piece("tv_unit", dice.between(150, 220, 10), dice.pick({35: 25, 40: 45, 45: 30}), front=75, tall=True)


def side_table(dice: Dice) -> Piece:
    """Round or square."""
    size = dice.pick({45: 50, 50: 50})
    return Piece("side_table", size, size, circle=dice.chance(60))


def shelf(dice: Dice) -> Step:
    """Return the step for books in a corner far from the entrance, or for plants in one by the window."""
    if dice.chance(60):
        bookcase = Piece("bookcase", dice.between(80, 160, 10), dice.pick({30: 60, 35: 40}), front=75, tall=True)
        return Step(bookcase, only(apart(CLEAR), only(in_corner, ends)), (far_from("entrance"),), optional=True)
    rack = Piece("plant_rack", dice.between(70, 100, 10), 30, front=45, tall=True)
    return Step(rack, only(apart(CLEAR), only(in_corner, ends)), (near("window"), far_from("entrance")), optional=True)


def face_to_tv(dice: Dice, shell: Shell) -> list[Step]:
    """Sofa, coffee table and television on one axis, sofa and television at walls."""
    tv = television(dice)
    best = (solid_behind, off_the_route, across_daylight, long_wall, far_from("entrance"))
    return [
        Step(sofa(dice, shell), face_to_face(tv, *TO_TV), best),
        Step(coffee_table(dice), before("sofa", TO_TABLE)),
        Step(tv, opposite("sofa"), (centred_on("sofa"), near("sofa"))),
    ]


def parallel(dice: Dice, shell: Shell) -> list[Step]:
    """Sofa and television face each other, the coffee table between them, a side table at the sofa's quieter end."""
    steps = face_to_tv(dice, shell)
    if dice.chance(70):
        steps.append(Step(side_table(dice), either_side("sofa", TO_SIDE_TABLE), (far_from("door"),), optional=True))
    if dice.chance(60):
        steps.append(shelf(dice))
    return steps


def vertical(dice: Dice, shell: Shell) -> list[Step]:
    """As parallel, with a loveseat or armchairs at right angles to the sofa, which look towards the entrance."""
    steps = face_to_tv(dice, shell)
    best = (looks_at_door, far_from("entrance"))
    seats = dice.pick({"loveseat": 40, "armchair": 35, "armchairs": 25})
    if seats == "loveseat":
        seat = Piece("loveseat", dice.between(130, 160, 10), dice.between(80, 90, 5))
        steps.append(Step(seat, at_right_angles(), best))
    else:
        seat = Piece("armchair", dice.between(80, 90, 10), dice.between(80, 90, 5))
        pair = seats == "armchairs"
        steps.append(Step(seat, at_right_angles(-(seat.width + BETWEEN) // 2 if pair else 0), best))
        if pair:
            steps.append(Step(seat, next_armchair))
    if dice.chance(60):
        steps.append(Step(side_table(dice), either_side("sofa", TO_SIDE_TABLE), (near(seat.category),), optional=True))
    if dice.chance(50):
        steps.append(shelf(dice))
    return steps


def island(dice: Dice, shell: Shell) -> list[Step]:
    """In a deep room: the television on a far wall, the sofa free-standing before it, a passage behind its back."""
    free = replace(sofa(dice, shell), sides=((60, 60), (60, 0), (0, 60)), back=90)
    steps = [
        Step(television(dice), middles, (across_daylight, solid_behind, off_the_route, far_from("entrance"))),
        Step(free, before("tv_unit", 280)),
        Step(coffee_table(dice), before("sofa", TO_TABLE)),
    ]
    if dice.chance(50):
        seat = Piece("armchair", dice.between(80, 90, 10), dice.between(80, 90, 5))
        steps.append(Step(seat, at_right_angles(), (looks_at_door, far_from("entrance")), optional=True))
    if dice.chance(60):
        steps.append(shelf(dice))
    return steps


def is_deep(shell: Shell) -> bool:
    """Return whether the room is too long to watch from wall to wall, and lit from the side as one looks along it."""
    return shell.long >= 520 and not lit_from_short_side(shell)


def is_shallow(shell: Shell) -> bool:
    """Not deep."""
    return not is_deep(shell)


LIVING_ROOM = RoomType(
    "living_room",
    shell,
    {
        "parallel": Template(parallel, 50, is_shallow),
        "vertical": Template(vertical, 50, is_shallow),
        "island": Template(island, 100, is_deep),
    },
)
