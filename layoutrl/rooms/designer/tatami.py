"""Tatami rooms: a raised platform built in between walls and wardrobe, a desk on the strip of floor that is left.

Sides, door, window, platform, wardrobe, desk and stool are as in the authors' 85 real rooms, but there the wardrobe
stands on the platform's end, and here beside it. Shares are unsourced.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from layoutrl.rooms.designer.places import LEFT, RIGHT, around, before, either_side, ends, only
from layoutrl.rooms.designer.rules import NO, YES, across_door, faces_entrance_wall, far_from, near, solid_behind
from layoutrl.rooms.designer.search import Piece, Place, Plan, Step
from layoutrl.rooms.designer.shell import Dice, Shell, Shells
from layoutrl.rooms.designer.template import RoomType, Template

SHELLS = Shells(
    short=(260, 265, 295, 320, 340),
    long=(260, 300, 330, 354, 370),
    area=(6.8, 11.9),
    corners={4: 90, 6: 10},
    notch=(25, 45),
    thickness={20: 100},
    door_width={90: 100},
    window_wall={"beside": 85, "opposite": 15},
)

WARDROBE = 60  # deep
STRIP = (100, 130)  # of floor beside the platform, where the desk fits from wall to wall


def shell(dice: Dice) -> Shell:
    """Draw a bare tatami room. Its window is 1.2 m wide, sometimes up to 1.5."""
    width = dice.pick({120: 75, 135: 10, 150: 15})
    return replace(SHELLS, window_width=(width, width)).draw(dice)


def extents(shell: Shell) -> tuple[int, int]:
    """Return the sides of the room: (from the door's wall to the opposite one, along the door's wall)."""
    sides = (shell.width, shell.height)
    return sides if shell.entrance.wall.normal % 2 == 0 else sides[::-1]


def platform(dice: Dice, length: int, across: int) -> Piece:
    """Return a platform `length` long and 160 to 210 deep that leaves the STRIP in a room `across` deep."""
    depth = dice.between(max(160, across - STRIP[1]), min(210, across - STRIP[0]))
    return Piece("platform", length, depth, raised=True)


def at_its_end(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose places at either end of the platform, looking along it."""
    for side in (LEFT, RIGHT):
        yield around(plan["platform"], piece, side, 50, 0)


def across_strip(plan: Plan, place: Place) -> int:
    """YES if its back is to an end of the strip: a wall at right angles to the one behind the platform."""
    return YES if (place.facing - plan["platform"].facing) % 2 else NO


def work(width: int) -> list[Step]:
    """Desk and stool at the end of the strip that is far from the door."""
    return [
        Step(Piece("desk", width, 60, front=60), only(across_strip, ends), (far_from("entrance"),)),
        Step(Piece("stool", 45, 45), before("desk", 0)),
    ]


def l_shape(dice: Dice, shell: Shell) -> list[Step]:
    """The platform along a side wall, the wardrobe over its far end, the desk beside it at the end of the way."""
    deep, wide = extents(shell)
    bed = platform(dice, deep - WARDROBE, wide)
    return [
        Step(bed, only(across_door, ends), (solid_behind, near("entrance"))),
        Step(Piece("wardrobe", bed.depth, WARDROBE, tall=True), at_its_end),
        *work(wide - bed.depth),
    ]


def across(dice: Dice, shell: Shell) -> list[Step]:
    """The platform along the wall opposite the door and up to the window, the wardrobe over its dark end."""
    deep, wide = extents(shell)
    bed = platform(dice, wide - WARDROBE, deep)
    return [
        Step(bed, only(faces_entrance_wall, ends), (near("window"), near("entrance"))),
        Step(Piece("wardrobe", bed.depth, WARDROBE, tall=True), at_its_end),
        *work(deep - bed.depth),
    ]


def beside_wardrobe(dice: Dice, shell: Shell) -> list[Step]:
    """A short platform in the corner by the window, the wardrobe against the rest of the wall opposite the door."""
    deep, wide = extents(shell)
    length = dice.between(180, min(200, wide - 90), 5)  # two mats of 0.9 x 1.8 m and a border
    bed = platform(dice, length, deep)
    return [
        Step(bed, only(faces_entrance_wall, ends), (near("window"), near("entrance"))),
        Step(Piece("wardrobe", wide - length, WARDROBE, front=60, tall=True), either_side("platform")),
        *work(deep - bed.depth),
    ]


def suits_l_shape(shell: Shell) -> bool:
    """Wardrobe and platform fit beside the door."""
    _, wide = extents(shell)
    door = shell.entrance
    return 260 <= wide <= 340 and max(door.lo, wide - door.hi) >= 160


def suits_across(shell: Shell) -> bool:
    """Return whether the room's depth suits a platform and the strip before it."""
    deep, _ = extents(shell)
    return 260 <= deep <= 340


def suits_beside_wardrobe(shell: Shell) -> bool:
    """Two mats and a wardrobe fit along the wall."""
    _, wide = extents(shell)
    return suits_across(shell) and wide >= 180 + 90


TATAMI = RoomType(
    "tatami",
    shell,
    {
        "l_shape": Template(l_shape, 34, suits_l_shape),
        "across": Template(across, 26, suits_across),
        "beside_wardrobe": Template(beside_wardrobe, 40, suits_beside_wardrobe),
    },
)
