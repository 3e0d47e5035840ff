"""Bare rooms: outline, walls, doors and windows, drawn from what is usual for a type.

The designer works in whole centimetres, so that every comparison is exact and the same seed
gives the same room on any machine. Directions are quarter turns: 0 +x, 1 +y, 2 -x, 3 -y.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, TypeVar

import numpy as np
import shapely

T = TypeVar("T")

LEAF_OFF_CORNER = 5  # the least distance from a door to a convex corner
CLEAR_OUTSIDE = 90  # unsourced: depth of clear floor outside a door, beyond the wall
WINDOW_OFF_CORNER = 20
WINDOW_DEPTH = 50  # so far in front of a window nothing tall may stand (SceneEval)
SLIDING_DEPTH = 10  # kept free before a sliding door, which swings nowhere
WINDOW_HEIGHT = 150  # unsourced: of a window's glass, to turn its area into a width
GLAZING = 7  # the floor is at most seven times the glazing (GB 50096, 7.1)


class Box(NamedTuple):
    """An axis-aligned rectangle, x0 < x1 and y0 < y1, in centimetres."""

    x0: int
    y0: int
    x1: int
    y1: int

    @property
    def area(self) -> int:
        """Square centimetres."""
        return (self.x1 - self.x0) * (self.y1 - self.y0)

    def overlaps(self, other: Box) -> bool:
        """Return whether the boxes share area; touching is not enough."""
        return self.x0 < other.x1 and other.x0 < self.x1 and self.y0 < other.y1 and other.y0 < self.y1

    def shared(self, other: Box) -> int:
        """Area in common."""
        width = min(self.x1, other.x1) - max(self.x0, other.x0)
        height = min(self.y1, other.y1) - max(self.y0, other.y0)
        return max(0, width) * max(0, height)

    def gap(self, other: Box) -> int:
        """Return the distance along x plus that along y; 0 where the boxes touch or overlap."""
        dx = max(self.x0 - other.x1, other.x0 - self.x1, 0)
        dy = max(self.y0 - other.y1, other.y0 - self.y1, 0)
        return dx + dy

    def beyond(self, direction: int, depth: int) -> Box:
        """Return the strip outside the side in this direction, `depth` deep."""
        return (
            Box(self.x1, self.y0, self.x1 + depth, self.y1),
            Box(self.x0, self.y1, self.x1, self.y1 + depth),
            Box(self.x0 - depth, self.y0, self.x0, self.y1),
            Box(self.x0, self.y0 - depth, self.x1, self.y0),
        )[direction]

    def side(self, direction: int) -> int:
        """Return the coordinate of the side in this direction: x for 0 and 2, y for 1 and 3."""
        return (self.x1, self.y1, self.x0, self.y0)[direction]

    def span(self, direction: int) -> tuple[int, int]:
        """Return the extent (low, high) across `direction`: along y for 0 and 2, along x for 1 and 3."""
        return (self.y0, self.y1) if direction % 2 == 0 else (self.x0, self.x1)


class Wall(NamedTuple):
    """A straight part of the outline, from `lo` to `hi` along the line `at`; `normal` points into the room."""

    normal: int
    at: int
    lo: int
    hi: int
    convex: tuple[bool, bool]  # the corners at lo and hi

    @property
    def length(self) -> int:
        """Centimetres."""
        return self.hi - self.lo

    def box(self, lo: int, hi: int, depth: int) -> Box:
        """Return the box between lo and hi that reaches `depth` into the room, or out of it if negative."""
        near, far = sorted((self.at, self.at + (depth if self.normal < 2 else -depth)))
        return Box(near, lo, far, hi) if self.normal % 2 == 0 else Box(lo, near, hi, far)


class Gap(NamedTuple):
    """A door or a window: between `lo` and `hi` along its wall."""

    wall: Wall
    lo: int
    hi: int
    sliding: bool = False

    @property
    def width(self) -> int:
        """Centimetres."""
        return self.hi - self.lo

    def strip(self, depth: int) -> Box:
        """Return the box as wide as the opening that reaches `depth` into the room, or out of it if negative."""
        return self.wall.box(self.lo, self.hi, depth)

    @property
    def swing(self) -> Box:
        """The floor that a door needs to open: a square of its width, or a narrow strip if it slides."""
        return self.strip(SLIDING_DEPTH if self.sliding else self.width)


@dataclass(frozen=True)
class Shell:
    """A bare room: the box from (0, 0) to (width, height) less its notches. The first door is the entrance."""

    width: int
    height: int
    notches: tuple[Box, ...] = ()
    thickness: int = 20
    doors: tuple[Gap, ...] = ()
    windows: tuple[Gap, ...] = ()

    @cached_property
    def outline(self) -> tuple[tuple[int, int], ...]:
        """The corners, counter-clockwise, from the leftmost on, or the lowest of these."""
        shape = shapely.box(0, 0, self.width, self.height).difference(
            shapely.union_all([_shape(n) for n in self.notches])
        )
        ring = [(round(x), round(y)) for x, y in shape.simplify(0).normalize().exterior.coords[:-1]][::-1]
        first = ring.index(min(ring))
        return (*ring[first:], *ring[:first])

    @cached_property
    def walls(self) -> tuple[Wall, ...]:
        """The sides of the outline, in its order."""
        corners = self.outline
        count = len(corners)
        directions = [_direction(corners[k], corners[(k + 1) % count]) for k in range(count)]
        walls = []
        for k, along in enumerate(directions):
            (x0, y0), (x1, y1) = corners[k], corners[(k + 1) % count]
            # Counter-clockwise, so a turn to the left is a convex corner.
            convex = ((along - directions[k - 1]) % 4 == 1, (directions[(k + 1) % count] - along) % 4 == 1)
            at, lo, hi = (y0, min(x0, x1), max(x0, x1)) if along % 2 == 0 else (x0, min(y0, y1), max(y0, y1))
            walls.append(Wall((along + 1) % 4, at, lo, hi, convex if along < 2 else convex[::-1]))
        return tuple(walls)

    @cached_property
    def area(self) -> int:
        """Square centimetres."""
        return self.width * self.height - sum(notch.area for notch in self.notches)

    @property
    def short(self) -> int:
        """The shorter side of its bounding box, centimetres."""
        return min(self.width, self.height)

    @property
    def long(self) -> int:
        """The longer side of its bounding box, centimetres."""
        return max(self.width, self.height)

    @cached_property
    def swings(self) -> tuple[Box, ...]:
        """What the doors' leaves sweep."""
        return tuple(door.swing for door in self.doors)

    @cached_property
    def daylight(self) -> tuple[Box, ...]:
        """The strips in front of the windows, where nothing tall may stand."""
        return tuple(window.strip(WINDOW_DEPTH) for window in self.windows)

    @property
    def entrance(self) -> Gap:
        """The first door."""
        return self.doors[0]

    @property
    def largest_window(self) -> Gap:
        """The widest window. Raises ValueError where there is none."""
        return max(self.windows, key=lambda window: window.width)

    def holds(self, box: Box) -> bool:
        """Whether the box lies indoors."""
        if box.x0 < 0 or box.y0 < 0 or box.x1 > self.width or box.y1 > self.height:
            return False
        return not any(box.overlaps(notch) for notch in self.notches)

    def leads_out(self, door: Gap) -> bool:
        """Return whether the door leads out of the room.

        It does not where another part of the room lies close behind it, beyond a narrow recess.
        """
        beyond = door.strip(-self.thickness - CLEAR_OUTSIDE)
        indoors = beyond.shared(Box(0, 0, self.width, self.height))
        return indoors == sum(beyond.shared(notch) for notch in self.notches)

    def is_outer(self, wall: Wall) -> bool:
        """Whether the wall lies on the border of the bounding box, as facades do."""
        return wall.at == (0, 0, self.width, self.height)[wall.normal]


class Dice:
    """A seeded generator of random whole numbers."""

    def __init__(self, *seed: int):
        self._rng = np.random.default_rng(seed)

    def between(self, low: int, high: int, step: int = 1) -> int:
        """Return one of low, low + step, ... up to high, each as likely."""
        return low + step * int(self._rng.integers((high - low) // step + 1))

    def pick(self, weights: Mapping[T, int]) -> T:
        """Return a key, drawn in proportion to the weights."""
        drawn = int(self._rng.integers(sum(weights.values())))
        for choice, weight in weights.items():
            drawn -= weight
            if drawn < 0:
                return choice
        raise AssertionError("weights are above zero")

    def chance(self, percent: int) -> bool:
        """Return True with a probability of `percent`."""
        return int(self._rng.integers(100)) < percent

    def spread(self, lowest: int, p10: int, median: int, p90: int, highest: int) -> int:
        """Draw a number with these quantiles, uniform between neighbouring ones."""
        low, high = self.pick({(lowest, p10): 10, (p10, median): 40, (median, p90): 40, (p90, highest): 10})
        return self.between(low, high)


@dataclass(frozen=True)
class Shells:
    """The distribution of bare rooms of a type. Lengths are in centimetres; mappings give each value its weight.

    `short` and `long` are the minimum, 10% quantile, median, 90% quantile and maximum of the two sides.
    `area` is the range of the floor in square metres; a shell outside it is drawn anew.
    """

    short: tuple[int, int, int, int, int]
    long: tuple[int, int, int, int, int]
    area: tuple[float, float]
    corners: Mapping[int, int] = field(default_factory=lambda: {4: 100})
    notch: tuple[int, int] = (60, 150)  # the least and the greatest side of what is cut out
    thickness: Mapping[int, int] = field(default_factory=lambda: {20: 65, 12: 20, 10: 15})
    doors: Mapping[int, int] = field(default_factory=lambda: {1: 100})
    door_width: Mapping[int, int] = field(default_factory=lambda: {90: 70, 80: 30})
    windows: Mapping[int, int] = field(default_factory=lambda: {1: 100})
    window_width: tuple[int, int] = (120, 240)
    window_wall: Mapping[str, int] = field(default_factory=lambda: {"opposite": 50, "beside": 50})

    def draw(self, dice: Dice) -> Shell:
        """Draw bare rooms until the area is in range and all doors and windows fit; return the first such."""
        while True:
            shell = self._outline(dice)
            if not self.area[0] <= shell.area / 10000 <= self.area[1]:
                continue
            doors = self._doors(shell, dice)
            windows = None if doors is None else self._windows(shell, doors, dice)
            if doors is not None and windows is not None:
                return Shell(shell.width, shell.height, shell.notches, shell.thickness, doors, windows)

    def _outline(self, dice: Dice) -> Shell:
        sides = sorted((dice.spread(*self.short), dice.spread(*self.long)))
        width, height = sides if dice.chance(50) else sides[::-1]
        corners = dice.pick(self.corners)
        notches: list[Box] = []
        if corners > 4:

            def cut(side: int) -> int:
                return dice.between(min(self.notch[0], side * 45 // 100), min(self.notch[1], side * 45 // 100))

            a, b = (cut(width), cut(height)), (cut(width), cut(height))
            # One corner (L); two corners of one side (bay) or opposite ones (across, Z); the middle of a side (recess).
            form = "corner" if corners == 6 else dice.pick({"bay": 40, "recess": 40, "across": 20})
            turn = dice.between(0, 3)
            if form == "recess":
                notches = [_recess(width, height, a, turn, dice)]
            else:
                notches = [_corner(width, height, a, turn)]
                if form == "bay":
                    notches.append(_corner(width, height, b, (turn + 1) % 4))
                elif form == "across":
                    notches.append(_corner(width, height, b, (turn + 2) % 4))
        return Shell(width, height, tuple(notches), dice.pick(self.thickness))

    def _doors(self, shell: Shell, dice: Dice) -> tuple[Gap, ...] | None:
        doors: list[Gap] = []
        for _ in range(dice.pick(self.doors)):
            width = dice.pick(self.door_width)
            walls = [
                w for w in shell.walls if w.length >= width + 2 * LEAF_OFF_CORNER and all(w != d.wall for d in doors)
            ]
            if not walls:
                return None
            wall = dice.pick({w: w.length for w in walls})
            low, high = _opening_range(shell, wall, LEAF_OFF_CORNER)
            if high - low < width:
                return None
            off = min(dice.between(0, 10), high - low - width)  # most doors stand near a corner
            lo = dice.pick({low + off: 40, high - width - off: 40, dice.between(low, high - width): 20})
            doors.append(Gap(wall, lo, lo + width))
            swing = doors[-1].swing
            if not shell.holds(swing) or any(swing.overlaps(door.swing) for door in doors[:-1]):
                return None
            if not shell.leads_out(doors[-1]):
                return None
        return tuple(doors)

    def _windows(self, shell: Shell, doors: tuple[Gap, ...], dice: Dice) -> tuple[Gap, ...] | None:
        windows: list[Gap] = []
        taken = {door.wall for door in doors}
        for k in range(dice.pick(self.windows)):
            where = dice.pick(self.window_wall) if k == 0 else "any"
            turn = {"opposite": (2,), "beside": (1, 3), "any": (1, 2, 3)}[where]
            low, high = self.window_width
            if k == 0:
                low = min(high, max(low, -(-shell.area // (GLAZING * WINDOW_HEIGHT))))
            walls = {}
            for wall in shell.walls:
                start, end = _opening_range(shell, wall, WINDOW_OFF_CORNER)
                if (
                    (wall.normal - doors[0].wall.normal) % 4 in turn
                    and end - start >= low
                    and wall not in taken
                    and shell.is_outer(wall)
                ):
                    walls[wall] = wall.length
            if not walls:
                return None
            wall = dice.pick(walls)
            taken.add(wall)
            start, end = _opening_range(shell, wall, WINDOW_OFF_CORNER)
            width = dice.between(low, min(high, end - start))
            lo = (start + end - width) // 2 if dice.chance(50) else dice.between(start, end - width)
            windows.append(Gap(wall, lo, lo + width))
        return tuple(windows)


def _opening_range(shell: Shell, wall: Wall, off: int) -> tuple[int, int]:
    """Return from where to where along a wall an opening may lie.

    It keeps `off` from corners, and from a reflex corner at least the walls' thickness, as the walls overlap behind it.
    """
    margins = [off if convex else max(off, shell.thickness) for convex in wall.convex]
    return wall.lo + margins[0], wall.hi - margins[1]


def _corner(width: int, height: int, size: tuple[int, int], corner: int) -> Box:
    """A notch in one of the four corners, counter-clockwise from the origin."""
    a, b = size
    x = 0 if corner in (0, 3) else width - a
    y = 0 if corner in (0, 1) else height - b
    return Box(x, y, x + a, y + b)


def _recess(width: int, height: int, size: tuple[int, int], side: int, dice: Dice) -> Box:
    """Return a notch of this size in the middle three fifths of a side; `side` is the normal of its wall."""
    a, b = size
    if side % 2:
        x = dice.between(width // 5, max(width // 5, width * 4 // 5 - a))
        y = 0 if side == 1 else height - b
    else:
        x = 0 if side == 0 else width - a
        y = dice.between(height // 5, max(height // 5, height * 4 // 5 - b))
    return Box(x, y, x + a, y + b)


def _direction(a: tuple[int, int], b: tuple[int, int]) -> int:
    return (0 if b[0] > a[0] else 2) if a[1] == b[1] else (1 if b[1] > a[1] else 3)


def _shape(box: Box) -> shapely.Polygon:
    return shapely.box(*box)
