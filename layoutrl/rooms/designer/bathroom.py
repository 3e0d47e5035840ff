"""Bathrooms: the vanity by the door, the shower or bathtub at the far end, the toilet between them.

Sizes and clearances follow the NKBA's guidelines and Chinese practice; floor areas are as in GB 50096-2011.
Shares, and sizes without a source, are unsourced conventions.
"""

from __future__ import annotations

from layoutrl.rooms.designer.places import ends, middles, only
from layoutrl.rooms.designer.rules import (
    NO,
    YES,
    center_far_from,
    faces_entrance_wall,
    far_from,
    in_corner,
    looks_past_door,
    near,
    no_slit,
    solid_behind,
    touches,
)
from layoutrl.rooms.designer.search import Piece, Place, Plan, Rule, Step
from layoutrl.rooms.designer.shell import Dice, Shell, Shells, Wall
from layoutrl.rooms.designer.template import RoomType, Template

TOILET_AXIS = 40  # from the toilet's axis to what stands beside it
LINE = 230  # the shortest wall for a vanity of 60, a toilet and a shower of 80 side by side, with a hand to spare

SHELLS = Shells(
    short=(150, 155, 175, 205, 220),
    long=(180, 200, 245, 300, 320),
    area=(2.8, 6.0),
    corners={4: 60, 6: 30, 8: 10},
    notch=(25, 60),  # shafts
    thickness={20: 45, 12: 30, 10: 25},
    door_width={70: 50, 75: 20, 80: 30},
    windows={0: 35, 1: 65},
    window_width=(50, 90),
    window_wall={"opposite": 60, "beside": 40},
)


def toilet(dice: Dice) -> Piece:
    """Return a toilet that keeps TOILET_AXIS free on both sides of its axis."""
    width = dice.between(38, 42, 2)
    side = TOILET_AXIS - width // 2
    return Piece("toilet", width, dice.between(65, 75, 5), front=60, sides=((side, side),))


def shower(dice: Dice, widest: int) -> Piece:
    """Return a square or round shower, 80 to 100 centimetres wide and at most `widest`, which is 90 or more."""
    if dice.chance(33):
        side = dice.pick({90: 60, 100: 40}) if widest >= 100 else 90
        return Piece("shower", side, side, front=60, circle=True)
    side = dice.between(80, min(widest, 100), 10)
    return Piece("shower", side, side, front=60)


def bathtub(dice: Dice, length: int) -> Piece:
    """Return a bathtub of this length in centimetres."""
    return Piece("bathtub", length, dice.between(70, 80, 5))


def washing_machine(dice: Dice) -> Piece:
    """60 centimetres wide."""
    return Piece("washing_machine", 60, dice.pick({55: 40, 60: 60}), front=60)


def vanity(dice: Dice, lowest: int, highest: int) -> Piece:
    """`lowest` to `highest` centimetres wide, but within 60 to 120."""
    low = min(max(60, -(-lowest // 5) * 5), 120)
    width = dice.between(low, max(low, min(120, highest)), 5)
    return Piece("vanity", width, dice.pick({45: 30, 50: 50, 55: 20}), front=60)


def on_wall_of(category: str) -> Rule:
    """Return a rule: YES if its back is to the same wall as a placed piece of the category."""
    return lambda plan, place: YES if any(place.wall == host.wall for host in plan.all(category)) else NO


def on_long_wall(plan: Plan, place: Place) -> int:
    """YES if its back is to a wall as long as the room, but for a shaft."""
    assert place.wall is not None
    return YES if place.wall.length >= plan.shell.long - SHELLS.notch[1] else NO


def fills_wall(plan: Plan, place: Place) -> int:
    """YES if it reaches from one end of its wall to the other."""
    return YES if place.wall and place.wall.length == place.piece.width else NO


def deeper_than_vanity(plan: Plan, place: Place) -> int:
    """YES if it is farther from the entrance than the vanity."""
    return YES if far_from("entrance")(plan, place) > far_from("entrance")(plan, plan["vanity"]) else NO


def before_bathing(plan: Plan, place: Place) -> int:
    """YES if it is nearer to the entrance than the shower or bathtub, which is placed first."""
    return YES if near("entrance")(plan, place) > near("entrance")(plan, plan.places[0]) else NO


def beside_something(plan: Plan, place: Place) -> int:
    """YES if, on one of its sides, a wall or a fixture is as near as its clearance allows."""
    for keep in (place.box.beyond((place.facing + side) % 4, place.sides[0] + 1) for side in (1, -1)):
        if not plan.shell.holds(keep) or any(keep.overlaps(other.box) for other in plan.places):
            return YES
    return NO


def wet_wall(plan: Plan, place: Place) -> int:
    """YES if another fixture stands against the same wall."""
    assert place.wall is not None
    behind = place.wall.box(place.wall.lo, place.wall.hi, 1)
    return YES if any(behind.overlaps(other.box) for other in plan.places) else NO


def row(shell: Shell) -> int:
    """Return how long a row of fixtures may be: the shortest long wall without the entrance; 0 if there is none."""
    lowest = shell.long - SHELLS.notch[1]
    return min((w.length for w in shell.walls if w.length >= lowest and w != shell.entrance.wall), default=0)


def far_end(shell: Shell) -> Wall:
    """The short outer wall farthest from the door."""
    along = 0 if shell.width >= shell.height else 1
    walls = [wall for wall in shell.walls if wall.normal % 2 == along and shell.is_outer(wall)]
    return max(walls, key=lambda wall: wall.box(wall.lo, wall.hi, 1).gap(shell.entrance.strip(1)))


def line(dice: Dice, shell: Shell) -> list[Step]:
    """Vanity, toilet and shower in one row on a long wall, away from the door; or a bathtub across the far end."""
    length, end = row(shell), far_end(shell).length
    if 150 <= end <= 180 and dice.chance(50):
        last = Step(bathtub(dice, end), only(deeper_than_vanity, only(fills_wall, middles)), (far_from("entrance"),))
        taken = last.piece.depth
    else:
        last = Step(
            shower(dice, shell.short - 60),
            only(deeper_than_vanity, only(in_corner, only(on_wall_of("vanity"), ends))),
            (far_from("entrance"),),
        )
        taken = last.piece.width
    washer = length - taken >= 200 and dice.chance(60)
    left = length - taken - 2 * TOILET_AXIS - (60 if washer else 0)
    steps = [
        Step(vanity(dice, left - 40, left), only(on_long_wall, ends), (in_corner, solid_behind, near("entrance"))),
        last,
    ]
    if washer:
        steps.append(Step(washing_machine(dice), only(touches("vanity"), only(on_wall_of("vanity"), ends))))
    return [*steps, Step(toilet(dice), only(on_wall_of("vanity"), middles), (looks_past_door,))]


def square(dice: Dice, shell: Shell) -> list[Step]:
    """Shower or bathtub in the corner farthest from the door, the vanity near the door, the toilet out of its sight."""
    bath = shell.long >= 230 and dice.chance(40)
    fixture = bathtub(dice, dice.between(150, 170, 10)) if bath else shower(dice, 100)
    steps = [
        Step(fixture, only(no_slit, only(in_corner, ends)), (faces_entrance_wall, center_far_from("entrance"))),
        Step(
            vanity(dice, 60, 80), only(before_bathing, only(no_slit, ends)), (solid_behind, in_corner, near("entrance"))
        ),
        Step(
            toilet(dice),
            only(beside_something, only(no_slit, ends)),
            (looks_past_door, wet_wall, center_far_from("entrance")),
        ),
    ]
    if shell.area >= 45000 and dice.chance(50):
        steps.append(Step(washing_machine(dice), only(no_slit, ends), (in_corner, near("vanity")), optional=True))
    return steps


def is_squarish(shell: Shell) -> bool:
    """Nearly square, and large."""
    return shell.short >= 165 and shell.long - shell.short <= 80 and shell.area >= 33000


BATHROOM = RoomType(
    "bathroom",
    SHELLS.draw,
    {
        "line": Template(line, 60, lambda shell: row(shell) >= LINE),
        "square": Template(square, 40, is_squarish),
    },
)
