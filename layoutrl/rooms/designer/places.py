"""Candidate places of a piece: each function proposes some, and the search drops those that do not fit.

Nobody places furniture at a random centimetre: a piece touches a corner, a neighbour or the edge of a
door's swing, or it is centred on something. So a handful of places per wall is enough to try.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from layoutrl.rooms.designer.search import Piece, Place, Plan, Rule, Where
from layoutrl.rooms.designer.shell import Box, Wall

LEFT, RIGHT = 1, -1  # quarter turns from the direction that a piece faces


def free_spans(plan: Plan, wall: Wall, depth: int, tall: bool = False) -> list[tuple[int, int]]:
    """Return the stretches (lo, hi) of a wall that have nothing within `depth` centimetres before them.

    Pieces, doors' swings and notches count, and the daylight of windows if `tall`. A stretch may still be too shallow,
    as the room may end sooner: Plan.fits decides.
    """
    strip = wall.box(wall.lo, wall.hi, depth)
    blocks = [place.box for place in plan.places] + list(plan.shell.swings) + list(plan.shell.notches)
    if tall:
        blocks += plan.shell.daylight
    taken = sorted(block.span(wall.normal) for block in blocks if block.overlaps(strip))
    spans, lo = [], wall.lo
    for start, end in [*taken, (wall.hi, wall.hi)]:
        if start > lo:
            spans.append((lo, start))
        lo = max(lo, end)
    return spans


def against(piece: Piece, wall: Wall, lo: int, sides: tuple[int, int] = (0, 0), host: Place | None = None) -> Place:
    """Return the place of a piece with its back to a wall, from `lo` along it on."""
    box = wall.box(lo, lo + piece.width, piece.depth)
    return Place(piece, box, wall.normal, wall, sides, host)


def ends(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose places against any wall, at either end of each free stretch."""
    for wall, lo, hi, sides in _stretches_that_fit(plan, piece):
        at_lo, at_hi = _along(wall, sides)
        yield against(piece, wall, lo + at_lo, sides)
        yield against(piece, wall, hi - at_hi - piece.width, sides)


def middles(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose places against any wall, in the middle of each free stretch."""
    for wall, lo, hi, sides in _stretches_that_fit(plan, piece):
        yield against(piece, wall, (lo + hi - piece.width) // 2, sides)


def walls(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose places against any wall, at either end and in the middle of each free stretch."""
    yield from ends(plan, piece)
    yield from middles(plan, piece)


def only(rule: Rule, where: Where) -> Where:
    """Keep the proposed places for which a yes-or-no rule says YES."""
    return lambda plan, piece: (place for place in where(plan, piece) if rule(plan, place))


def at_window(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose places under each window, centred on it."""
    for window in plan.shell.windows:
        yield against(piece, window.wall, (window.lo + window.hi - piece.width) // 2)


def beside(category: str, side: int, gap: int = 0) -> Where:
    """Propose places beside each placed piece of a category, `gap` centimetres from it, against the same wall.

    `side` is LEFT or RIGHT, as seen by someone who sits on that piece.
    """

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        for host in plan.all(category):
            if host.wall is None:
                continue
            lo, hi = host.box.span(host.facing)
            increasing = (host.facing + side) % 4 < 2
            yield against(piece, host.wall, hi + gap if increasing else lo - gap - piece.width, host=host)

    return where


def either_side(category: str, gap: int = 0) -> Where:
    """Propose places beside each placed piece of a category, left and right."""
    return lambda plan, piece: (p for side in (LEFT, RIGHT) for p in beside(category, side, gap)(plan, piece))


def round_corner(category: str) -> Where:
    """Propose places that make an L with a piece in a corner.

    They are against the wall that the piece's side touches, and begin at its front.
    """

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        for host in plan.all(category):
            front = host.box.side(host.facing)
            start = front if host.facing < 2 else front - piece.width
            for side in (LEFT, RIGHT):
                direction = (host.facing + side) % 4
                for wall in plan.shell.walls:
                    if (wall.normal - direction) % 4 == 2 and wall.at == host.box.side(direction):
                        yield against(piece, wall, start, host=host)

    return where


def filling(category: str) -> Where:
    """Propose to fill the stretch of wall between a placed piece and the next obstacle.

    The piece is made as wide as the stretch; its own width is the least.
    """

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        for host in plan.all(category):
            if host.wall is None:
                continue
            start, end = host.box.span(host.facing)
            for lo, hi in free_spans(plan, host.wall, piece.depth, piece.tall):
                if hi - lo >= piece.width and (hi == start or lo == end):
                    yield against(replace(piece, width=hi - lo), host.wall, lo)

    return where


def before(category: str, gap: int, turn: int = 2) -> Where:
    """Propose a place in front of each placed piece of a category, `gap` away (under it, if negative), centred on it.

    `turn` says where it faces, in quarters from the host: 2 looks back at it, 0 away from it.
    """

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        for host in plan.all(category):
            yield around(host, piece, 0, 50, gap, turn)

    return where


def around(host: Place, piece: Piece, side: int, percent: int, gap: int, turn: int = 2) -> Place:
    """Return the place of a piece `gap` away from one side of a host.

    `side` is in quarters from the host's front; the piece's middle is `percent` of the way along that side. `turn` says
    where it faces, in quarters from the direction of that side: 2 looks at the host, 0 away from it.
    """
    direction = (host.facing + side) % 4
    facing = (direction + turn) % 4
    across, out = (piece.width, piece.depth) if turn % 2 == 0 else (piece.depth, piece.width)
    lo, hi = host.box.span(direction)
    start = lo + (hi - lo) * percent // 100 - across // 2
    edge = host.box.side(direction)
    near = edge + gap if direction < 2 else edge - gap - out
    box = (
        Box(near, start, near + out, start + across)
        if direction % 2 == 0
        else Box(start, near, start + across, near + out)
    )
    return Place(piece, box, facing, host=host)


def opposite(category: str) -> Where:
    """Propose places against the walls that a placed piece faces, as near to its axis as there is room."""

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        for host in plan.all(category):
            axis = sum(host.box.span(host.facing)) // 2
            for wall, lo, hi, sides in _stretches_that_fit(plan, piece):
                if (wall.normal - host.facing) % 4 != 2 or not _lies_ahead(host, wall):
                    continue
                at_lo, at_hi = _along(wall, sides)
                start = min(max(axis - piece.width // 2, lo + at_lo), hi - at_hi - piece.width)
                yield against(piece, wall, start, sides)

    return where


def face_to_face(other: Piece, low: int, high: int) -> Where:
    """Propose places against a wall so that `other` can face the piece from the wall ahead, on the same axis.

    Between their fronts lie `low` to `high` centimetres. The axis is in the middle of what is free before both walls.
    """

    def where(plan: Plan, piece: Piece) -> Iterator[Place]:
        for wall, lo, hi, _ in _stretches_that_fit(plan, piece):
            for ahead in plan.shell.walls:
                away = (ahead.at - wall.at) * (1 if wall.normal < 2 else -1) - piece.depth - other.depth
                if (ahead.normal - wall.normal) % 4 != 2 or not low <= away <= high:
                    continue
                for start, end in free_spans(plan, ahead, other.depth, other.tall):
                    start, end = max(start, lo), min(end, hi)
                    if end - start >= max(piece.width, other.width):
                        yield against(piece, wall, (start + end - piece.width) // 2)

    return where


def in_the_middle(plan: Plan, piece: Piece) -> Iterator[Place]:
    """Propose free-standing places in the middle of each empty rectangle of floor, lengthwise in it."""
    for floor in free_floors(plan):
        width, height = floor.x1 - floor.x0, floor.y1 - floor.y0
        facing = 1 if width >= height else 0  # the width of a piece that faces up runs along x
        across, up = (piece.width, piece.depth) if facing == 1 else (piece.depth, piece.width)
        x, y = (floor.x0 + floor.x1 - across) // 2, (floor.y0 + floor.y1 - up) // 2
        yield Place(piece, Box(x, y, x + across, y + up), facing)


def free_floors(plan: Plan) -> list[Box]:
    """Return the maximal empty rectangles of floor (none lies within another), largest first."""
    shell = plan.shell
    blocks = [*(place.box for place in plan.places), *shell.swings, *shell.notches]
    floors = [Box(0, 0, shell.width, shell.height)]
    for block in blocks:
        cut = []
        for floor in floors:
            if not floor.overlaps(block):
                cut.append(floor)
                continue
            pieces = (
                floor._replace(x1=block.x0),
                floor._replace(x0=block.x1),
                floor._replace(y1=block.y0),
                floor._replace(y0=block.y1),
            )
            cut.extend(piece for piece in pieces if piece.x0 < piece.x1 and piece.y0 < piece.y1)
        floors = [f for f in dict.fromkeys(cut) if not any(f != g and _within(f, g) for g in cut)]
    return sorted(floors, key=lambda floor: (-floor.area, floor))


def _within(inner: Box, outer: Box) -> bool:
    return inner.shared(outer) == inner.area


def _stretches_that_fit(plan: Plan, piece: Piece) -> Iterator[tuple[Wall, int, int, tuple[int, int]]]:
    """Yield (wall, lo, hi, sides) of each free stretch that holds the piece and what `sides` keep free beside it."""
    for wall in plan.shell.walls:
        for lo, hi in free_spans(plan, wall, piece.depth, piece.tall):
            for sides in piece.sides:
                if hi - lo >= piece.width + sum(sides):
                    yield wall, lo, hi, sides


def _along(wall: Wall, sides: Sequence[int]) -> tuple[int, int]:
    """Convert (left, right), as seen by someone who looks away from the wall, to (at lo, at hi) along it."""
    left, right = sides
    return (right, left) if wall.normal in (0, 3) else (left, right)


def _lies_ahead(host: Place, wall: Wall) -> bool:
    """Return whether the wall lies ahead of the host and crosses the strip in front of it."""
    lo, hi = host.box.span(host.facing)
    front = host.box.side(host.facing)
    return wall.lo < hi and lo < wall.hi and (wall.at > front if host.facing < 2 else wall.at < front)
