"""Studies: the desk where daylight falls in from the side, its user's back to a wall of books or facing it.

Sizes and clearances follow Time-Saver Standards and measured tables of furniture; shares are unsourced conventions.
"""

from __future__ import annotations

from collections.abc import Iterator

from layoutrl.rooms.designer.places import LEFT, RIGHT, before, beside, ends, free_spans, only, opposite
from layoutrl.rooms.designer.rules import (
    NO,
    YES,
    across_daylight,
    far_from,
    in_corner,
    light_from_left,
    long_wall,
    near,
    solid_behind,
)
from layoutrl.rooms.designer.search import Piece, Place, Plan, Step
from layoutrl.rooms.designer.shell import Dice, Shell, Shells
from layoutrl.rooms.designer.template import RoomType, Template

SHELLS = Shells(
    short=(220, 240, 275, 315, 330),
    long=(260, 295, 345, 395, 420),
    area=(6.0, 14.0),
    corners={4: 68, 6: 26, 8: 6},
    notch=(40, 110),
    doors={1: 94, 2: 6},
    door_width={90: 75, 80: 25},
    windows={1: 82, 2: 18},
    window_width=(120, 200),
    window_wall={"opposite": 55, "beside": 45},
)

SEAT = 90  # between a desk and what stands behind its user
BOOKS = 30  # depth of a bookcase
BESIDE = 60  # to walk round a desk
TO_BED = 120  # from the front of a desk to a bed


def desk(width: int, depth: int, front: int = SEAT) -> Piece:
    """Return a desk; `front` is the depth of floor for its user."""
    return Piece("desk", width, depth, front=front)


def bookcase(width: int) -> Piece:
    """Return a bookcase of this width in centimetres."""
    return Piece("bookcase", width, BOOKS, front=60, tall=True)


SIDE_TABLE = Piece("side_table", 45, 45, circle=True)
CHAIR = Step(Piece("chair", 50, 50, tucked=True), before("desk", -20))


def into_the_room(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose places for a desk that stands off a wall and faces it, its user and books in between.

    It is in the middle of a free stretch if that leaves BESIDE on each side, or else at either end with BESIDE on the
    other.
    """
    off = SEAT + BOOKS
    for wall in plan.shell.walls:
        for lo, hi in free_spans(plan, wall, off + piece.depth):
            room = hi - lo - piece.width
            starts = [lo + room // 2] if room >= 2 * BESIDE else [lo, hi - piece.width] if room >= BESIDE else []
            for start in starts:
                box = wall.box(start, start + piece.width, off).beyond(wall.normal, piece.depth)
                yield Place(piece, box, (wall.normal + 2) % 4, wall)


def off_desk(plan: Plan, place: Place) -> int:
    """YES if it is at least BESIDE away from the desk."""
    return YES if place.box.gap(plan["desk"].box) >= BESIDE else NO


def user_sees_door(plan: Plan, place: Place) -> int:
    """YES if the whole entrance lies ahead of the user, beyond the near edge of the desk."""
    door = plan.shell.entrance.strip(1)
    ahead = (place.facing + 2) % 4
    edge, start = place.box.side(place.facing), door.side(place.facing)
    return YES if (start >= edge if ahead < 2 else start <= edge) else NO


def user_backs_on_wall(plan: Plan, place: Place) -> int:
    """YES if there is no window and no door behind the user, up to the wall SEAT + BOOKS away."""
    behind = place.box.beyond(place.facing, SEAT + BOOKS + 1)
    gaps = [gap.strip(-1) for gap in (*plan.shell.doors, *plan.shell.windows)]
    return NO if any(behind.overlaps(gap) for gap in gaps) else YES


def command(dice: Dice, shell: Shell) -> list[Step]:
    """The desk out in the room, its user before a wall of books and facing the door; an armchair for a guest."""
    return [
        Step(
            desk(dice.between(140, 160, 10), dice.pick({70: 60, 80: 40})),
            into_the_room,
            (user_backs_on_wall, user_sees_door, across_daylight, far_from("entrance")),
        ),
        CHAIR,
        Step(bookcase(dice.between(120, 200, 20)), opposite("desk")),
        *guest(dice),
    ]


def at_wall(dice: Dice, shell: Shell) -> list[Step]:
    """The desk at a wall by the window, light from the left; one or two bookcases in corners near it."""
    return [
        Step(desk(dice.between(120, 160, 10), dice.pick({60: 70, 70: 30})), ends, BY_THE_WINDOW),
        CHAIR,
        Step(bookcase(dice.between(100, 200, 20)), ends, BOOKS_AT_HAND),
        *guest(dice),
    ]


def with_sofa_bed(dice: Dice, shell: Shell) -> list[Step]:
    """A desk by the window and, well away from it, a sofa bed for guests."""
    sofa_bed = Piece("sofa_bed", dice.between(180, 200, 10), 90, front=60)
    return [
        Step(desk(dice.between(100, 140, 10), 60, front=TO_BED), ends, BY_THE_WINDOW),
        CHAIR,
        Step(
            sofa_bed,
            only(off_desk, ends),
            (solid_behind, in_corner, far_from("desk"), far_from("entrance"), long_wall),
        ),
        Step(bookcase(dice.between(80, 120, 10)), ends, BOOKS_AT_HAND, optional=True),
        Step(SIDE_TABLE, beside("sofa_bed", LEFT), optional=True),
        Step(SIDE_TABLE, beside("sofa_bed", RIGHT), optional=True),
    ]


BY_THE_WINDOW = (across_daylight, light_from_left, near("window"), far_from("entrance"))
BOOKS_AT_HAND = (solid_behind, in_corner, near("desk"), long_wall)


def guest(dice: Dice) -> list[Step]:
    """An armchair in a corner by the window, a small round table at its side, where there is room."""
    side = dice.between(70, 85, 5)
    armchair = Piece("armchair", side, side, front=50, sides=((40, 0), (0, 40)))
    return [
        Step(armchair, ends, (in_corner, near("window"), far_from("desk"), long_wall), optional=True),
        Step(SIDE_TABLE, beside("armchair", LEFT), optional=True),
    ]


STUDY = RoomType(
    "study",
    SHELLS.draw,
    {
        "command": Template(command, 35),
        "at_wall": Template(at_wall, 35),
        "with_sofa_bed": Template(with_sofa_bed, 35),
    },
)
