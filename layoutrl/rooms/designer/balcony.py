"""Balconies: all glass on one long side, a sliding door on the other; laundry at one end, a seat at the other.

1.1-1.8 m deep, 2.4-4.5 m long, 3-6.5 square metres: sizes and shares are unsourced conventions.
"""

from __future__ import annotations

from collections.abc import Iterator

from layoutrl.rooms.designer.places import against, either_side, ends, only
from layoutrl.rooms.designer.rules import NO, YES, across_door, far_from, in_corner
from layoutrl.rooms.designer.search import Piece, Place, Plan, Step
from layoutrl.rooms.designer.shell import Box, Dice, Gap, Shell
from layoutrl.rooms.designer.template import RoomType, Template

DOOR_STRIP = 70  # kept empty along the door
POST = 15  # solid wall at either end of the glass; unsourced
CORNER = 65  # house wall on both sides of most doors: room for the laundry or a chair; unsourced
OFF_CENTRE = 20  # the least distance of a door's middle from the balcony's, so that one end is the far one; unsourced


def shell(dice: Dice) -> Shell:
    """Draw a bare balcony.

    Its first window is the glass front. Most have one short side glazed too, some a column in a corner by the house.
    """
    while True:
        depth, length = dice.between(110, 180, 5), dice.spread(240, 300, 360, 425, 450)
        if not 30000 <= depth * length <= 65000:
            continue
        house = dice.between(0, 3)  # the direction from the house to the glass
        width, height = (length, depth) if house % 2 else (depth, length)
        column = _column(dice, width, height, house) if dice.chance(30) else ()
        bare = Shell(width, height, column, dice.pick({20: 65, 12: 20, 10: 15}))
        wall = next(wall for wall in bare.walls if wall.normal == house and wall.length > 100)
        door_width = dice.pick({160: 50, 180: 30, 210: 15, 240: 5})
        off = dice.pick({CORNER: 95, 10: 5})
        if wall.length < door_width + 2 * off:
            continue
        low, high = wall.lo + off, wall.hi - off - door_width
        lo = dice.pick({low: 35, high: 35, dice.between(low, high): 30})
        if abs(2 * lo + door_width - length) < 2 * OFF_CENTRE:
            continue
        front = next(wall for wall in bare.walls if wall.normal == (house + 2) % 4)
        windows = [Gap(front, POST, length - POST)]
        if dice.chance(85):
            side = dice.pick({w: 1 for w in bare.walls if w.normal % 2 != house % 2 and bare.is_outer(w)})
            windows.append(Gap(side, side.lo + POST, side.hi - POST))
        door = Gap(wall, lo, lo + door_width, sliding=True)
        return Shell(width, height, column, bare.thickness, (door,), tuple(windows))


def _column(dice: Dice, width: int, height: int, house: int) -> tuple[Box]:
    """Return a column in one of the two corners by the house; `house` is the direction from there to the glass."""
    a, b = dice.between(25, 45, 5), dice.between(25, 45, 5)
    low, right = (dice.chance(50), house == 2) if house % 2 == 0 else (house == 1, dice.chance(50))
    x, y = width - a if right else 0, 0 if low else height - b
    return (Box(x, y, x + a, y + b),)


def off_the_way(plan: Plan, place: Place) -> int:
    """YES if it leaves the strip in front of the doors free."""
    return NO if any(place.box.overlaps(door.strip(DOOR_STRIP)) for door in plan.shell.doors) else YES


def at_house(plan: Plan, place: Place) -> int:
    """YES if its back is to the wall with the door."""
    return YES if place.wall == plan.shell.entrance.wall else NO


def solid_end(plan: Plan, place: Place) -> int:
    """YES if it touches no glazed short side."""
    return NO if any(place.box.gap(window.strip(1)) == 0 for window in plan.shell.windows[1:]) else YES


def looks_out(plan: Plan, place: Place) -> int:
    """YES if it faces the glass front."""
    return YES if place.facing == plan.shell.entrance.wall.normal else NO


def other_end(plan: Plan, place: Place) -> int:
    """YES if it touches a short side far from the laundry, but not with its back to the glass front."""
    ends = [w for w in plan.shell.walls if (w.normal - plan.shell.entrance.wall.normal) % 2]
    at_end = any(place.box.side((wall.normal + 2) % 4) == wall.at for wall in ends)
    away = place.box.gap(plan["laundry_cabinet"].box) > plan.shell.long // 4
    return YES if at_end and away and place.wall != plan.shell.windows[0].wall else NO


def opposite_door(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose places against the glass front, in view from the house, flush with either jamb of the door."""
    door, front = plan.shell.entrance, plan.shell.windows[0].wall
    for lo in (door.lo, door.hi - piece.width):
        yield against(piece, front, lo)


def across(dice: Dice, shell: Shell) -> list[Step]:
    """A laundry counter across one end, with a sink by the house where it leaves room; a seat at the other end."""
    deep = shell.short > 160
    cabinet = Piece("laundry_cabinet", shell.short - 45 if deep else shell.short, dice.pick({60: 70, 65: 30}), front=60)
    sink = Piece("sink", 45, cabinet.depth, front=50)
    return [
        Step(cabinet, only(off_the_way, only(across_door, ends)), (solid_end, far_from("door"))),
        *([Step(sink, only(off_the_way, either_side("laundry_cabinet")))] if deep else []),
        *seat(dice),
    ]


def long_cabinet(dice: Dice, shell: Shell) -> Piece:
    """Return a cabinet for the house wall that leaves room for what stands beside it, at the corner or the door."""
    width = min(dice.between(120, 150, 5), beside_door(shell) // 5 * 5 - 60)
    return Piece("laundry_cabinet", width, 60, front=60)


def along(dice: Dice, shell: Shell) -> list[Step]:
    """Washer in the corner and the cabinet beside it, both along the house wall; a seat at the other end."""
    washer = Piece("washer", 60, 60, front=60)
    return [
        Step(washer, only(off_the_way, only(at_house, ends)), (in_corner, solid_end, far_from("door"))),
        Step(long_cabinet(dice, shell), only(off_the_way, either_side("washer"))),
        *seat(dice),
    ]


def counter(dice: Dice, shell: Shell) -> list[Step]:
    """The cabinet in the corner along the house wall, a sink towards the door; a seat at the other end."""
    sink = Piece("sink", 45, 50, front=60)
    return [
        Step(
            long_cabinet(dice, shell), only(off_the_way, only(at_house, ends)), (in_corner, solid_end, far_from("door"))
        ),
        Step(sink, only(off_the_way, either_side("laundry_cabinet"))),
        *seat(dice),
    ]


def seat(dice: Dice) -> list[Step]:
    """At the other end a lounge chair, looking out where it can, and a round table; plants along the glass."""
    side = dice.pick({60: 40, 65: 40, 70: 20})
    chair = Piece("lounge_chair", side, side, front=40)
    table = Piece("side_table", 40, 40, circle=True)
    plants = Piece("plant_rack", 90, 30, front=DOOR_STRIP)
    return [
        Step(chair, only(off_the_way, only(other_end, ends)), (looks_out,), optional=True),
        Step(table, only(off_the_way, either_side("lounge_chair")), (far_from("laundry_cabinet"),), optional=True),
        Step(plants, opposite_door, (far_from("laundry_cabinet"),)),
    ]


def beside_door(shell: Shell) -> int:
    """The length of house wall at the longer side of the door."""
    door = shell.entrance
    return max(door.lo - door.wall.lo, door.wall.hi - door.hi)


BALCONY = RoomType(
    "balcony",
    shell,
    {
        "across": Template(across, 12, lambda shell: beside_door(shell) >= 65),
        "along": Template(along, 40, lambda shell: shell.short >= 130 and beside_door(shell) >= 180),
        "counter": Template(counter, 35, lambda shell: shell.short >= 130 and beside_door(shell) >= 180),
    },
)
