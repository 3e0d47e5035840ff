"""Rules by which the designer ranks places: each is a number, more is better, in centimetres or YES or NO."""

from __future__ import annotations

from layoutrl.rooms.designer.search import Place, Plan, Rule
from layoutrl.rooms.designer.shell import Box

YES, NO = 100, 0


def solid_behind(plan: Plan, place: Place) -> int:
    """YES if no window and no door is right behind it."""
    behind = place.box.beyond((place.facing + 2) % 4, 1)
    gaps = [gap.strip(-1) for gap in (*plan.shell.doors, *plan.shell.windows)]
    return NO if any(behind.overlaps(gap) for gap in gaps) else YES


def across_daylight(plan: Plan, place: Place) -> int:
    """YES if it faces at right angles to the light of the largest window, or if there is no window."""
    if not plan.shell.windows:
        return YES
    return YES if (place.facing - plan.shell.largest_window.wall.normal) % 2 else NO


def light_from_left(plan: Plan, place: Place) -> int:
    """YES if the largest window is on the left of someone who sits before it and looks at it; NO without one."""
    if not plan.shell.windows:
        return NO
    # Someone who sits at it looks against its facing, and light from the left travels to that person's right.
    return YES if (plan.shell.largest_window.wall.normal - place.facing) % 4 == 1 else NO


def in_corner(plan: Plan, place: Place) -> int:
    """YES if its left or right side touches a wall. Its back is taken to touch one."""
    return YES if any(not plan.shell.holds(place.box.beyond((place.facing + s) % 4, 1)) for s in (1, 3)) else NO


def faces_entrance_wall(plan: Plan, place: Place) -> int:
    """YES if it faces the wall of the entrance, its back to the opposite side."""
    return YES if (place.facing - plan.shell.entrance.wall.normal) % 4 == 2 else NO


def across_door(plan: Plan, place: Place) -> int:
    """YES if it faces at right angles to the wall of the entrance."""
    return YES if (place.facing - plan.shell.entrance.wall.normal) % 2 else NO


def looks_at_door(plan: Plan, place: Place) -> int:
    """YES if the entrance lies ahead of its front, at least in part."""
    return YES if _ahead(place, plan.shell.entrance.strip(1)) else NO


def looks_past_door(plan: Plan, place: Place) -> int:
    """YES unless the entrance lies straight ahead of it."""
    lo, hi = place.box.span(place.facing)
    door = plan.shell.entrance.strip(1)
    start, end = door.span(place.facing)
    return NO if _ahead(place, door) and start < hi and lo < end else YES


def touches(category: str) -> Rule:
    """Return a rule: YES if it touches a placed piece of the category."""
    return lambda plan, place: YES if any(place.box.gap(other.box) == 0 for other in plan.all(category)) else NO


def apart(clear: int) -> Rule:
    """Return a rule: YES if it is at least `clear` centimetres, along x plus along y, from every placed piece."""
    return lambda plan, place: NO if any(place.box.gap(other.box) < clear for other in plan.places) else YES


def far_from(what: str) -> Rule:
    """Return a rule: the distance, along x plus along y, to the nearest of `what`; 0 where there is none.

    `what` is "entrance", "door", "window" or a category of placed pieces.
    """
    return lambda plan, place: min((place.box.gap(box) for box in _boxes(plan, what)), default=0)


def near(what: str) -> Rule:
    """Return a rule: the distance of `far_from`, negated."""
    return lambda plan, place: -far_from(what)(plan, place)


def center_far_from(what: str) -> Rule:
    """Return a rule: the distance of its middle from that of the nearest of `what`, which is as in `far_from`.

    It is measured along x plus along y.
    """

    def rule(plan: Plan, place: Place) -> int:
        x, y = place.twice_center
        boxes = _boxes(plan, what)
        return min((abs(x - box.x0 - box.x1) + abs(y - box.y0 - box.y1) for box in boxes), default=0) // 2

    return rule


def no_slit(plan: Plan, place: Place) -> int:
    """YES if it leaves no gap that is too narrow to clean.

    Each piece, and each wall on its left and right, touches it or is at least a hand's breadth (15 cm, unsourced) away.
    """
    if any(0 < place.box.gap(other.box) < 15 for other in plan.places):
        return NO
    for side in (1, 3):
        direction = (place.facing + side) % 4
        if plan.shell.holds(place.box.beyond(direction, 1)) and not plan.shell.holds(place.box.beyond(direction, 15)):
            return NO
    return YES


def centred_on(category: str) -> Rule:
    """Return a rule: how far its middle is off the axis of the first placed piece of the category, negated."""

    def rule(plan: Plan, place: Place) -> int:
        hosts = plan.all(category)
        if not hosts:
            return 0
        axis = hosts[0]
        across = (axis.facing + 1) % 2
        return -abs(place.twice_center[across] - axis.twice_center[across]) // 2

    return rule


def long_wall(plan: Plan, place: Place) -> int:
    """The length of its wall; 0 if it has none."""
    return place.wall.length if place.wall else 0


def _boxes(plan: Plan, what: str) -> list[Box]:
    if what == "entrance":
        return [plan.shell.entrance.strip(1)]
    if what == "door":
        return [door.strip(1) for door in plan.shell.doors]
    if what == "window":
        return [window.strip(1) for window in plan.shell.windows]
    return [place.box for place in plan.all(what)]


def _ahead(place: Place, box: Box) -> bool:
    front = place.box.side(place.facing)
    return box.side(place.facing) > front if place.facing < 2 else box.side(place.facing) < front
