"""The relation graph of a room (Wang et al. 2019, section 4): what stands in front of, behind or beside what, how far.

Nodes are walls, doors, windows and furniture; an edge leads from an anchor to a target. Its type is a direction in the
anchor's frame with a distance, or support. What anchors see is found with rays, which between upright boxes are
intervals. A graph is made for an order of the furniture: its edges lead from items placed earlier to later ones.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np
from shapely.geometry import Polygon

from layoutrl import InputError
from layoutrl.rooms.brief import standing
from layoutrl.rooms.room import TOLERANCE, Room

ARCHITECTURE = ("wall", "door", "window")  # the first categories of nodes
FRONT, BACK, LEFT, RIGHT = range(4)  # of the anchor
TURN = (0, 2, 1, 3)  # quarters counter-clockwise from the anchor's front, of each of these
DISTANT, PROXIMAL, ADJACENT = range(3)
SUPPORT = 12  # the target stands on the anchor: within its footprint
TYPES = [f"{way} {far}" for way in ("front", "back", "left", "right") for far in ("distant", "proximal", "adjacent")]
TYPES.append("support")
MIRRORED = np.array([0, 1, 2, 3, 4, 5, 9, 10, 11, 6, 7, 8, 12])  # each type, seen in a mirror
COST = {DISTANT: 100, PROXIMAL: 2, ADJACENT: 1}  # of an edge: an item to which no kept edge leads gets its cheapest
WEIGHT = {DISTANT: 1, PROXIMAL: 2, ADJACENT: 3}  # how much an edge constrains its target
OFTEN = {DISTANT: 0.30, PROXIMAL: 0.08, ADJACENT: 0.03}  # relative frequency from which a type is kept
SEEN = 0.30  # share of the anchor's or the target's side that must be visible
RAY_START = (0.1, 0.45)  # where rays start inside the anchor: share of its length, and metres at most
ADJACENT_GAP = (0.05, 0.05)  # at most the smaller of the two: share of the larger diagonal, metres
PROXIMAL_GAP = (0.1, 0.45)  # at most the larger of the two: share of the larger diagonal, metres
WALL_DEPTH = 0.1  # metres that a wall's box reaches outwards


class Relation(NamedTuple):
    """An edge: nodes of the scene, and one of TYPES."""

    anchor: int
    target: int
    type: int


def edge_type(way: int, distance: int) -> int:
    """The number of an edge's kind: where it leads, and how far."""
    return 3 * way + distance


def distance_of(type: int) -> int:
    """The distance of an edge's type; support is adjacent."""
    return ADJACENT if type == SUPPORT else type % 3


@dataclass(frozen=True)
class Scene:
    """A room's N nodes: walls, doors and windows, `fixed` of them, then the furniture that stands in it."""

    category: tuple[str, ...]
    box: np.ndarray  # (N, 4): x0, y0, x1, y1 in metres
    facing: np.ndarray  # (N,): quarters counter-clockwise from right; architecture faces into the room
    circle: np.ndarray  # (N,): looks the same from all sides
    fixed: int
    frame: tuple[tuple[int, int, float], ...]  # from walls to the next, with the sine of the turn; to openings, with 0

    @property
    def items(self) -> range:
        """The nodes that are furniture."""
        return range(self.fixed, len(self.category))

    def without(self, item: int) -> Scene:
        """Return the scene without an item; the nodes after it move up by one."""
        left = np.arange(len(self.category)) != item
        names = tuple(name for name, there in zip(self.category, left, strict=True) if there)
        return Scene(names, self.box[left], self.facing[left], self.circle[left], self.fixed, self.frame)

    @cached_property
    def relations(self) -> tuple[Relation, ...]:
        """All edges of the scene, before any is pruned."""
        return tuple(chain(*(_seen_from(self, anchor) for anchor in range(len(self.category)))))


def scene_of(room: Room) -> Scene:
    """The nodes of a room. Raises InputError for one that is not upright: its graph would need other rays."""
    outline, *holes = room.outline, *(Polygon(hole).exterior.normalize().coords[:-1] for hole in room.holes)
    walls: list[tuple[np.ndarray, int]] = []
    frame: list[tuple[int, int, float]] = []
    for ring in (outline, *holes):  # counter-clockwise, and columns clockwise: the room is on the left
        first, ways = len(walls), []
        for start, end in pairwise((*ring, ring[0])):
            walls.append(_wall(room, np.array(start), np.array(end)))
            ways.append(walls[-1][1])
        for k, (way, following) in enumerate(pairwise((*ways, ways[0]))):
            frame.append((first + k, first + (k + 1) % len(ways), float(np.sin((following - way) * np.pi / 2).round())))
    boxes, facing = [box for box, _ in walls], [way for _, way in walls]
    openings = [*room.doors, *room.windows]
    for opening in openings:
        box = np.array(opening.shape.bounds)
        wall = int(np.argmin([_apart(box, wall) for wall, _ in walls]))
        frame.append((wall, len(boxes), 0.0))
        boxes.append(box)
        facing.append(facing[wall])
    items = standing(room)
    for polygon in (*room.walls, *(opening.polygon for opening in openings)):
        sides = np.diff(np.array([*polygon, polygon[0]]), axis=0)
        if (np.abs(sides).min(1) > TOLERANCE).any():
            raise InputError(f"planit: room {room.id}: a wall or opening stands at an angle; expected an upright room")
    for item in items:
        if item.form == "rectangle" and item.degrees % 90:
            raise InputError(
                f"planit: room {room.id}: the {item.category} stands at an angle; expected an upright room"
            )
        boxes.append(np.array(item.footprint.bounds))
        facing.append(int(item.degrees // 90) % 4)
    fixed = len(walls) + len(openings)
    categories = ["wall"] * len(walls) + [opening.kind for opening in openings] + [item.category for item in items]
    circle = [False] * fixed + [item.form == "circle" for item in items]
    return Scene(tuple(categories), np.array(boxes), np.array(facing), np.array(circle), fixed, tuple(frame))


def _wall(room: Room, start: np.ndarray, end: np.ndarray) -> tuple[np.ndarray, int]:
    """(box, facing) of one side of the outline, whose room is on the left."""
    along = end - start
    axis = int(np.abs(along).argmax())
    if abs(along[1 - axis]) > TOLERANCE:
        raise InputError(f"planit: room {room.id}: a wall stands at an angle; expected an upright room")
    way = (axis + 2 * int(along[axis] < 0)) % 4  # the direction that it runs in
    outwards = WALL_DEPTH * np.array(((0, -1), (1, 0), (0, 1), (-1, 0))[way])
    corners = np.stack([start, end, start + outwards, end + outwards])
    return np.concatenate([corners.min(0), corners.max(0)]), (way + 1) % 4


def _apart(box: np.ndarray, other: np.ndarray) -> float:
    """Return the distance between two boxes; where they touch, minus their longer overlap along an axis."""
    gap = np.maximum(box[:2], other[:2]) - np.minimum(box[2:], other[2:])
    return float(np.linalg.norm(gap.clip(0)) or gap.min())


def turned(box: np.ndarray, quarters: int) -> np.ndarray:
    """Boxes (..., 4) turned counter-clockwise around the origin."""
    for _ in range(quarters % 4):
        x0, y0, x1, y1 = np.moveaxis(box, -1, 0)
        box = np.stack([-y1, x0, -y0, x1], -1)
    return box


def gap(anchor: np.ndarray, target: np.ndarray, quarters: int) -> float:
    """Return metres from the anchor's side in this direction to the target's side facing it; < 0 if it lies behind."""
    axis, back = quarters % 2, quarters % 4 >= 2
    return float(anchor[axis] - target[axis + 2] if back else target[axis] - anchor[axis + 2])


def faces_across(anchor: np.ndarray, target: np.ndarray, quarters: int) -> bool:
    """Return whether the anchor's side in this direction and the target share more than a centimetre of its length."""
    axis = 1 - quarters % 2
    return bool(min(anchor[axis + 2], target[axis + 2]) - max(anchor[axis], target[axis]) > TOLERANCE)


def _seen_from(scene: Scene, anchor: int) -> list[Relation]:
    """Return one edge to each target that the anchor sees, in the direction in which most of both sides is visible."""
    fixed = anchor < scene.fixed
    best: dict[int, tuple[float, int]] = {}
    box, others = scene.box[anchor], np.arange(len(scene.box)) != anchor
    if not fixed:
        shared = np.minimum(scene.box[:, 2:], box[2:]) - np.maximum(scene.box[:, :2], box[:2])
        meets = others & (shared > TOLERANCE).all(1) & (np.arange(len(others)) >= scene.fixed)
        for target in np.flatnonzero(meets):
            beyond = np.concatenate([scene.box[target, 2:] - box[2:], box[:2] - scene.box[target, :2]])
            quarter = int(beyond.argmax())
            type = SUPPORT if beyond.max() <= TOLERANCE else edge_type(_way(scene, anchor, quarter), ADJACENT)
            best[int(target)] = (np.inf, type)
    diagonal = np.linalg.norm(scene.box[:, 2:] - scene.box[:, :2], axis=1)
    for way in range(1 if fixed else 4):
        quarter = int(scene.facing[anchor] + TURN[way]) % 4
        seen, far = _visible(turned(scene.box, -quarter), anchor)
        for target in np.flatnonzero(seen.max(1) > SEEN):
            if target < scene.fixed or best.get(int(target), (0.0, 0))[0] >= seen[target].min():
                continue
            larger = max(diagonal[anchor], diagonal[target])
            near = far[target] <= max(PROXIMAL_GAP[0] * larger, PROXIMAL_GAP[1])
            touches = far[target] <= min(ADJACENT_GAP[0] * larger, ADJACENT_GAP[1])
            distance = ADJACENT if touches else PROXIMAL if near else DISTANT
            best[int(target)] = (float(seen[target].min()), edge_type(_way(scene, anchor, quarter), distance))
    return [Relation(anchor, target, type) for target, (_, type) in sorted(best.items())]


def _way(scene: Scene, anchor: int, quarter: int) -> int:
    """Return a direction of the room in the anchor's frame; a round anchor has only a front."""
    return FRONT if scene.circle[anchor] else TURN.index((quarter - int(scene.facing[anchor])) % 4)


def _visible(box: np.ndarray, anchor: int) -> tuple[np.ndarray, np.ndarray]:
    """Cast rays to the right from an anchor. Return for each node the shares of the anchor's side and of its own that
    see each other (N, 2), and how far it is (N,)."""
    x0, y0, x1, y1 = box.T
    start = x1[anchor] - min(RAY_START[0] * (x1[anchor] - x0[anchor]), RAY_START[1])
    marks = np.unique(np.concatenate([y0, y1]).clip(y0[anchor], y1[anchor]))
    middle, length = (marks[1:] + marks[:-1]) / 2, np.diff(marks)
    meets = (y0[:, None] < middle) & (middle < y1[:, None]) & (x1 > x1[anchor] + 1e-6)[:, None]
    meets[anchor] = False
    reached = np.where(meets, np.maximum(x0, start)[:, None], np.inf)
    first = reached.argmin(0)
    visible = np.bincount(first, length * np.isfinite(reached.min(0)), len(box))
    sides = np.stack([np.full(len(box), y1[anchor] - y0[anchor]), y1 - y0], 1)
    return visible[:, None] / np.maximum(sides, 1e-9), (x0 - x1[anchor]).clip(0)


@dataclass(frozen=True)
class KeptTypes:
    """The types of edges that pruning leaves for a room type, by the categories of anchor and target."""

    types: Mapping[tuple[str, str], frozenset[int]]

    def __contains__(self, edge: tuple[str, str, int]) -> bool:
        anchor, target, type = edge
        return type in self.types.get((anchor, target), ())


def kept_types(scenes: Sequence[Scene]) -> KeptTypes:
    """Return the types of edges that pruning leaves: the frequent ones, and some that always tell.

    Frequencies are shares of all pairs of the two categories in one room. What always tells is support, adjacent to a
    wall or window, adjacent to an item of the same category, and proximal in front of an item that has a front.
    """
    seen: Counter[tuple[str, str, int]] = Counter()
    pairs: Counter[tuple[str, str]] = Counter()
    circles = {scene.category[k] for scene in scenes for k in scene.items if scene.circle[k]}
    for scene in scenes:
        counts = Counter(scene.category)
        furniture = Counter(scene.category[k] for k in scene.items)
        for anchor, many in counts.items():
            for target, others in furniture.items():
                pairs[anchor, target] += many * others - (others if anchor == target else 0)
        seen.update((scene.category[r.anchor], scene.category[r.target], r.type) for r in scene.relations)
    types: dict[tuple[str, str], set[int]] = {}
    for (anchor, target, type), count in seen.items():
        distance, has_front = distance_of(type), anchor not in circles and anchor not in ARCHITECTURE
        if (
            type == SUPPORT
            or (distance == ADJACENT and (anchor in ("wall", "window") or anchor == target))
            or (type == edge_type(FRONT, PROXIMAL) and has_front)
            or count / pairs[anchor, target] >= OFTEN[distance]
        ):
            types.setdefault((anchor, target), set()).add(type)
    return KeptTypes({pair: frozenset(found) for pair, found in types.items()})


Graph = dict[int, list[Relation]]  # the edges that lead to each item, in the order in which they are placed


def graph_of(scene: Scene, kept: KeptTypes, order: Sequence[int]) -> Graph:
    """Return the graph of items that are placed in this order; others are left out.

    An item to which no kept edge leads gets the cheapest of its edges.
    """
    graph: Graph = {}
    placed = set(range(scene.fixed))
    leading: dict[int, list[Relation]] = {}
    for relation in scene.relations:
        leading.setdefault(relation.target, []).append(relation)
    for item in order:
        edges = [relation for relation in leading.get(item, []) if relation.anchor in placed]
        telling = [r for r in edges if (scene.category[r.anchor], scene.category[item], r.type) in kept]
        graph[item] = telling or sorted(edges, key=lambda r: COST[distance_of(r.type)])[:1]
        placed.add(item)
    return graph


def graph_with_last(scene: Scene, kept: KeptTypes, order: Sequence[int], last: int) -> Graph:
    """Return the graph of items in this order, and of one more after all of them.

    The others' edges are those of the room without it: before it is placed, it hides nothing.
    """
    others = scene.without(last)

    def old(node: int) -> int:
        return node + (node >= last)

    def new(node: int) -> int:
        return node - (node > last)

    graph = graph_of(others, kept, [new(item) for item in order])
    found = {
        old(item): [Relation(old(r.anchor), old(r.target), r.type) for r in edges] for item, edges in graph.items()
    }
    return found | {last: graph_of(scene, kept, [*order, last])[last]}


def placing_order(graph: Graph, size: Mapping[int, float]) -> list[int]:
    """Return the order in which a graph's items are placed, each after its anchors.

    The most constrained item comes first, of equals the one that constrains most, weighed by `size` (square metres of
    each item).
    """
    reach = _constraining(graph, size)
    order: list[int] = []
    left = list(graph)
    while left:
        ready = [k for k in left if not any(r.anchor in left for r in graph[k])]
        order.append(min(ready, key=lambda k: (-_constrained(graph, k), -reach[k])))
        left.remove(order[-1])
    return order


def _constrained(graph: Graph, item: int) -> int:
    """Return the sum of the weights of all edges to an item."""
    return sum(WEIGHT[distance_of(relation.type)] for relation in graph[item])


def _constraining(graph: Graph, size: Mapping[int, float]) -> dict[int, float]:
    reached: dict[int, set[int]] = {}
    for item in reversed(graph):  # items placed after it are worked out already
        following = [k for k, edges in graph.items() if any(r.anchor == item for r in edges)]
        reached[item] = set(following).union(*(reached[k] for k in following))
    return {item: sum(size[k] ** 0.8 * _constrained(graph, k) for k in others) for item, others in reached.items()}
