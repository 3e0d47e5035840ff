"""Bedrooms: the headboard on a solid wall at right angles to the window, the wardrobe by the door.

Sides of rooms and widths of doors and windows are as in the authors' 41 real bedrooms; clearances follow HUD 1973
and Neufert. Shares, and sizes without a source, are unsourced conventions.
"""

from __future__ import annotations

from layoutrl.rooms.designer.places import (
    LEFT,
    RIGHT,
    before,
    beside,
    ends,
    middles,
    only,
    opposite,
    round_corner,
    walls,
)
from layoutrl.rooms.designer.rules import (
    across_daylight,
    centred_on,
    far_from,
    in_corner,
    light_from_left,
    near,
    solid_behind,
)
from layoutrl.rooms.designer.search import Piece, Step
from layoutrl.rooms.designer.shell import Dice, Shell, Shells
from layoutrl.rooms.designer.template import RoomType, Template

SHELLS = Shells(
    short=(265, 275, 314, 362, 390),
    long=(330, 360, 385, 545, 620),
    area=(9.0, 24.0),
    corners={4: 43, 6: 34, 8: 23},
    notch=(30, 130),
    doors={1: 80, 2: 20},
    door_width={90: 70, 80: 30},
    windows={1: 80, 2: 20},
    window_width=(150, 240),
    window_wall={"opposite": 55, "beside": 45},
)


def is_roomy(shell: Shell) -> bool:
    """At least 3 m wide."""
    return shell.short >= 300


def longest_solid_wall(shell: Shell) -> int:
    """The length in centimetres of the longest wall without an opening; 0 where there is none."""
    pierced = {gap.wall for gap in (*shell.doors, *shell.windows)}
    return max((wall.length for wall in shell.walls if wall not in pierced), default=0)


def double_bed(dice: Dice, shell: Shell) -> Piece:
    """Return a double bed with floor to walk on at both sides and before its foot, where a narrow room has less."""
    width = dice.pick({150: 60, 180: 40}) if is_roomy(shell) else 150
    front = 80 if is_roomy(shell) else 60
    return Piece("bed", width, dice.between(200, 210, 5), front, sides=((60, 60), (60, 30), (30, 60)))


def wardrobe(dice: Dice, shell: Shell, shortest: int = 150, longest: int = 240) -> Piece:
    """Return a wardrobe, `shortest` to `longest` centimetres wide.

    In a narrow room it is 120 to 180 wide instead, with a narrower passage before it.
    """
    if is_roomy(shell):
        return Piece("wardrobe", dice.between(shortest, longest, 5), dice.pick({60: 70, 55: 30}), front=90, tall=True)
    return Piece("wardrobe", dice.between(120, 180, 5), dice.pick({60: 50, 55: 50}), front=75, tall=True)


def nightstands(dice: Dice) -> list[Step]:
    """One on each side of the bed where there is room."""
    stand = Piece("nightstand", 50, dice.pick({50: 50, 45: 50}))
    return [Step(stand, beside("bed", side), optional=True) for side in (LEFT, RIGHT)]


def tv_unit(dice: Dice, longest: int) -> Step:
    """At a solid wall opposite the bed, where there is room."""
    piece = Piece("tv_unit", dice.between(120, longest, 5), 40)
    return Step(piece, only(solid_behind, opposite("bed")), (centred_on("bed"),), optional=True)


BED_RULES = (across_daylight, far_from("entrance"))
WARDROBE_RULES = (in_corner, near("entrance"), far_from("window"))


def typical(dice: Dice, shell: Shell) -> list[Step]:
    """The wardrobe in a corner by the door, the bed in the middle of a wall, a TV unit opposite."""
    return [
        Step(wardrobe(dice, shell), ends, WARDROBE_RULES),
        Step(double_bed(dice, shell), only(solid_behind, middles), BED_RULES),
        *nightstands(dice),
        tv_unit(dice, 150),
    ]


def l_shaped(dice: Dice, shell: Shell) -> list[Step]:
    """Wardrobes round the corner by the door, as a dressing corner; the bed in the middle of a wall."""
    return [
        Step(wardrobe(dice, shell, 180), ends, WARDROBE_RULES),
        Step(
            Piece("wardrobe", dice.between(90, 150, 5), 60, front=75, tall=True),
            round_corner("wardrobe"),
            (near("entrance"),),
        ),
        Step(double_bed(dice, shell), only(solid_behind, middles), BED_RULES),
        *nightstands(dice),
    ]


def u_shaped(dice: Dice, shell: Shell) -> list[Step]:
    """The bed in the middle of a long wall between two narrow wardrobes, a TV unit opposite."""
    closet = Piece("wardrobe", dice.between(60, 80, 5), 55, front=60, tall=True)
    return [
        Step(double_bed(dice, shell), only(solid_behind, middles), BED_RULES),
        *(Step(closet, beside("bed", side, gap=50)) for side in (LEFT, RIGHT)),
        *(Step(Piece("nightstand", 50, 50), beside("bed", side)) for side in (LEFT, RIGHT)),
        tv_unit(dice, 180),
    ]


def two_line(dice: Dice, shell: Shell) -> list[Step]:
    """The bed against one wall, wardrobe and dresser in line against the wall opposite."""
    dresser = Piece("dresser", dice.between(80, 120, 5), 45)
    return [
        Step(double_bed(dice, shell), only(solid_behind, middles), BED_RULES),
        Step(wardrobe(dice, shell, 120, 180), opposite("bed"), (centred_on("bed"),)),
        *nightstands(dice),
        *(Step(dresser, beside("wardrobe", side), optional=True) for side in (LEFT, RIGHT)),
    ]


def child(dice: Dice, shell: Shell) -> list[Step]:
    """A single bed lengthwise in a corner far from the door, a desk with daylight, the wardrobe by the door."""
    bed = Piece("bed", 120, dice.between(200, 210, 5), front=60, sides=((0, 60), (60, 0)))
    desk = Piece("desk", dice.between(100, 120, 5), 60, front=80)
    return [
        Step(wardrobe(dice, shell), ends, WARDROBE_RULES),
        Step(bed, ends, (in_corner, solid_behind, *BED_RULES)),
        Step(desk, walls, (light_from_left, near("window"), far_from("entrance"))),
        Step(Piece("chair", 45, 45, tucked=True), before("desk", -15)),
        *nightstands(dice),
    ]


BEDROOM = RoomType(
    "bedroom",
    SHELLS.draw,
    {
        "typical": Template(typical, 45),
        "l_shaped": Template(l_shaped, 15, lambda shell: shell.area > 140000 and is_roomy(shell)),
        "u_shaped": Template(u_shaped, 10, lambda shell: longest_solid_wall(shell) >= 430),
        "two_line": Template(two_line, 15, lambda shell: shell.long >= 430 and is_roomy(shell)),
        "child": Template(child, 20, lambda shell: shell.area < 160000),
    },
)
