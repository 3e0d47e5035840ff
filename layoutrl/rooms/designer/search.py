"""The search for a design: pieces are placed one after another, each at the best place that leaves room for the rest.

A template is a list of steps. A step says which piece is placed, which places are candidates, and by which rules,
in order of priority, they are ranked. Places that break a hard rule (`Plan.fits`) are dropped. The search goes
depth-first, best places first, and the first complete layout is the design. Nothing in it is random.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import shapely

from layoutrl.rooms.designer.shell import Box, Shell, Wall

TRIES = 4  # places of a piece that are tried before giving up
NODES = 80  # places that are tried in a room, over all its pieces, before giving up
TIE = 5  # centimetres: a difference that no designer would decide by
SAME_PLACE = 0.9  # IoU from which two places count as one


@dataclass(frozen=True)
class Piece:
    """A piece of furniture and the floor that it needs. Centimetres.

    `width` runs along the wall behind it, `depth` away from it. `front` is kept free before it, `back` behind one that
    stands off the walls. `sides` are kept free on its left and right, as seen by someone who sits on it: alternatives,
    of which the first that fits is taken. Nothing `tall` stands before a window. A `tucked` piece stands under its
    host. A `raised` one is floor to walk on, like a platform. A `circle` is as deep as wide; no other piece may enter
    its square, but a person may walk through its corners.
    """

    category: str
    width: int
    depth: int
    front: int = 0
    sides: tuple[tuple[int, int], ...] = ((0, 0),)
    tall: bool = False
    tucked: bool = False
    circle: bool = False
    raised: bool = False
    back: int = 0


@dataclass(frozen=True)
class Place:
    """A piece at a place: `facing` is its direction, `host` the piece that it belongs to.

    It may stand on the floor that its host keeps free. `wall` is the wall that its back touches, or, for a desk that
    stands off a wall and faces it with its user in between, that wall. It is None for what stands in the middle of the
    floor or is placed around its host, even with a wall behind it.
    """

    piece: Piece
    box: Box
    facing: int
    wall: Wall | None = None
    sides: tuple[int, int] = (0, 0)
    host: Place | None = None

    @cached_property
    def keeps(self) -> tuple[Box, ...]:
        """The floor that it keeps free."""
        left, right = self.sides
        strips = (
            (self.facing, self.piece.front),
            ((self.facing + 1) % 4, left),
            ((self.facing - 1) % 4, right),
            ((self.facing + 2) % 4, self.piece.back),
        )
        return tuple(self.box.beyond(direction, depth) for direction, depth in strips if depth)

    def iou(self, other: Place) -> float:
        """Intersection over union of the two boxes."""
        shared = self.box.shared(other.box)
        return shared / (self.box.area + other.box.area - shared)

    @property
    def twice_center(self) -> tuple[int, int]:
        """Twice the centre of its box, so that it is in whole centimetres."""
        return self.box.x0 + self.box.x1, self.box.y0 + self.box.y1


@dataclass(frozen=True)
class Plan:
    """A shell and what has been placed in it so far."""

    shell: Shell
    places: tuple[Place, ...] = ()

    def __getitem__(self, category: str) -> Place:
        """Return the first placed piece of a category. Raises KeyError where there is none."""
        for place in self.places:
            if place.piece.category == category:
                return place
        raise KeyError(category)

    def all(self, category: str) -> list[Place]:
        """The placed pieces of a category."""
        return [place for place in self.places if place.piece.category == category]

    def fits(self, place: Place) -> bool:
        """Return whether the place breaks no hard rule.

        The piece and the floor that it keeps free lie indoors. The piece stays within the ends of its wall, off the
        doors' swings and, if tall, out of the daylight. It overlaps neither other pieces nor the floor that they keep
        free, and they do not overlap the floor that it keeps free. Its host is excepted: each may stand on the floor
        that the other keeps free, and a tucked piece stands under its host.
        """
        body, shell = place.box, self.shell
        if not shell.holds(body) or not all(shell.holds(keep) for keep in place.keeps):
            return False
        lo, hi = body.span(place.facing)
        if place.wall and not place.wall.lo <= lo <= hi <= place.wall.hi:
            return False
        if any(body.overlaps(swing) for swing in shell.swings):
            return False
        if place.piece.tall and any(body.overlaps(strip) for strip in shell.daylight):
            return False
        for other in self.places:
            if other == place.host:
                if not place.piece.tucked and body.overlaps(other.box):
                    return False
                continue
            if body.overlaps(other.box) or any(keep.overlaps(other.box) for keep in place.keeps):
                return False
            if any(body.overlaps(keep) for keep in other.keeps):
                return False
        return True


Where = Callable[[Plan, Piece], Iterable[Place]]
Rule = Callable[[Plan, Place], int]  # centimetres, or 100 for yes and 0 for no; more is better


@dataclass(frozen=True)
class Step:
    """Place `piece` at the candidate of `where` that is best by `rules`; earlier rules take priority.

    An `optional` piece is left out where it fits nowhere, or where the rest would not fit beside it.
    """

    piece: Piece
    where: Where
    rules: tuple[Rule, ...] = ()
    optional: bool = False


@dataclass(frozen=True)
class Choice:
    """A decision of the designer: the place taken, the next best other place, and by how much it is worse.

    `margin` is the difference in the first rule that tells the two apart, 0 if none does, None without another place.
    """

    place: Place
    runner_up: Place | None = None
    margin: int | None = None

    @property
    def is_tie(self) -> bool:
        """Whether another place was as good, within a difference that no designer would decide by."""
        return self.margin is not None and self.margin < TIE


class NoDesign(Exception):
    """The template cannot be built in this shell; the message is the reason."""


def design(shell: Shell, steps: Sequence[Step], passage: int) -> list[Choice]:
    """Return the first complete layout found within TRIES and NODES, as one choice per placed piece.

    `passage` is the diameter of a person who walks there, in centimetres.
    Raises NoDesign with the reason: a piece without a place, a piece or door that cannot be reached, or a tie.
    """
    search = _Search(passage)
    choices = search.complete(Plan(shell), tuple(steps))
    if choices is None:
        raise NoDesign(search.reason)
    for choice in choices:
        if choice.is_tie:
            raise NoDesign(f"two places for the {choice.place.piece.category} are as good")
    return choices


class _Search:
    def __init__(self, passage: int):
        self.passage = passage
        self.nodes = 0
        self.reason = ""
        self.deepest = -1

    def complete(self, plan: Plan, steps: tuple[Step, ...]) -> list[Choice] | None:
        """Return the choices for all steps that lead to the first complete layout; None where there is none."""
        if not steps:
            lost = unreached(plan, self.passage)
            if lost:
                self._give_up(len(plan.places), f"the {lost} cannot be reached")
                return None
            return []
        step, rest = steps[0], steps[1:]
        ranked = _ranked(plan, step)
        if not ranked and not step.optional:
            self._give_up(len(plan.places), f"no place for the {step.piece.category}")
        for k, (score, place) in enumerate(ranked[:TRIES]):
            self.nodes += 1
            if self.nodes > NODES:
                return None
            choices = self.complete(replace(plan, places=(*plan.places, place)), rest)
            if choices is not None:
                return [_choice(score, place, ranked[k + 1 :]), *choices]
        return self.complete(plan, rest) if step.optional else None

    def _give_up(self, depth: int, reason: str) -> None:
        """Keep the reason of the attempt that came furthest."""
        if depth > self.deepest:
            self.deepest, self.reason = depth, reason


Score = tuple[int, ...]


def _ranked(plan: Plan, step: Step) -> list[tuple[Score, Place]]:
    """Return the places that break no hard rule with their scores, best first.

    Each has the first alternative of its piece's sides that fits.
    """
    places: list[Place] = []
    for place in step.where(plan, step.piece):
        for sides in step.piece.sides:
            roomy = replace(place, sides=sides)
            if plan.fits(roomy):
                places.append(roomy)
                break
    scored = [(tuple(rule(plan, place) for rule in step.rules), place) for place in dict.fromkeys(places)]
    return sorted(scored, key=lambda entry: entry[0], reverse=True)


def _choice(score: Score, place: Place, others: Sequence[tuple[Score, Place]]) -> Choice:
    for other_score, other in others:
        if place.iou(other) < SAME_PLACE:
            differences = (mine - theirs for mine, theirs in zip(score, other_score, strict=True))
            return Choice(place, other, next((d for d in differences if d), 0))
    return Choice(place)


def unreached(plan: Plan, passage: int) -> str:
    """Return what a disc that enters by the entrance cannot reach: "door", a category, or "" if nothing.

    `passage` is its diameter in centimetres. Tucked and raised pieces are not in its way: they are moved aside or
    walked on. All doors must be reached.
    """
    radius = passage / 2
    room, doors, closed = _empty(plan.shell)
    in_the_way = [_footprint(place) for place in plan.places if not (place.piece.tucked or place.piece.raised)]
    blocks = shapely.union_all([closed, *in_the_way])
    # Where its centre can be. With half a centimetre of slack, a disc that fits exactly passes.
    walkable = room.difference(blocks.buffer(radius - 0.5, quad_segs=8))
    entered = [part for part in shapely.get_parts(walkable) if part.intersects(doors[0])]
    reach = shapely.union_all(entered)
    if not all(reach.intersects(door) for door in doors):
        return "door"
    for place in plan.places:
        if reach.distance(_footprint(place)) > radius:
            return place.piece.category
    return ""


@lru_cache(maxsize=1)  # a shell has many plans, one after the other
def _empty(shell: Shell) -> tuple[shapely.Polygon, list[shapely.Polygon], shapely.Geometry]:
    """Return a shell's floor, its doors, and the rest of its border.

    Doors are boxes that reach a centimetre to both sides of the border.
    """
    room = shapely.Polygon(shell.outline)
    doors = [shapely.box(*door.strip(1)).union(shapely.box(*door.strip(-1))) for door in shell.doors]
    return room, doors, room.exterior.difference(shapely.union_all(doors))


def _footprint(place: Place) -> shapely.Polygon:
    if not place.piece.circle:
        return shapely.box(*place.box)
    x, y = place.twice_center
    return shapely.Point(x / 2, y / 2).buffer(place.piece.width / 2)
