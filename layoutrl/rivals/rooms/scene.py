"""A brief as upright boxes, (x0, y0, x1, y1) in metres, so that many layouts of it are judged at once by arithmetic.

The room is turned so that most of its walls lie along an axis. Boxes cover what is not floor: exactly where all walls
are then upright; along a slanting wall in strips, so that an item that touches them may be up to STRIP off the wall.
A circle counts as its bounding square, an item at another angle as its bounding box. So what is legal here is legal.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
import shapely
from shapely.affinity import rotate

from layoutrl.rooms.brief import facings, with_poses
from layoutrl.rooms.clearances import RAISED, front_depth, may_share_floor, may_stand_before
from layoutrl.rooms.doors import DOOR_CLEARANCE, entrance, way_width
from layoutrl.rooms.faults import Items, along_walls
from layoutrl.rooms.room import TOLERANCE, Item, Opening, Room, along_and_through, rotation

STRIP = 0.05  # metres: width of the boxes along a slanting wall; unsourced: exactness against time
THICK = 10.0  # metres: of the boxes around the room, so that nothing jumps over them; any large number
BEFORE_WINDOW = 0.3  # metres: a tall item that is nearer to a window takes its light; unsourced
SLACK = 0.005  # metres off a passage's width, so that who fits exactly passes, as in the designer's own test
TOUCH = 1e-6  # metres of rounding
FACINGS = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)])  # the four facings, in the room's frame
Array = np.ndarray


@dataclass(frozen=True)
class Gate:
    """A door or a window: its `box`, the direction 0 to 3 into the room, and the middle (2,) of its inner side."""

    box: Array
    inward: int
    middle: Array
    width: float


@dataclass(frozen=True)
class Scene:
    """A brief in its own frame. n items; the arrays by facing have the four FACINGS on axis 1."""

    brief: Room
    base: float  # degrees by which the frame is turned
    solids: Array  # (m, 4) boxes that cover all that is not floor
    doors: tuple[Gate, ...]
    windows: tuple[Gate, ...]
    radius: float  # half a passage
    half: Array  # (n, 4, 2) half the item's extents
    front_half: Array  # (n, 4, 2) the same of the floor before it
    front_offset: Array  # (n, 4, 2) from its middle to that of the floor before it
    stands_aside: Array  # (n,) bool: not in the way of who walks: tucked or raised
    may_overlap: Array  # (n, n) bool: they may share floor
    may_stand_before: Array  # (n, n) bool: the second may stand in the floor before the first, or stands along a wall
    movable: Array  # indices of the items to place
    turnable: Array  # (n,) bool: its facing is to be chosen
    center: Array  # (n, 2) where the items stand; for movable ones a point on the floor
    quarter: Array  # (n,) index of the facing

    @property
    def bounds(self) -> Array:
        """The box (4,) around the floor."""
        x0, y0, x1, y1 = self.solids[:4].T
        return np.array([x1[0], y1[1], x0[2], y0[3]])

    @cached_property
    def barred(self) -> tuple[list[Array], Array]:
        """Where the solids, grown by half a passage, bar the way: at `stops` along x and y, bool (stops, stops).

        Stops are the sides of what is grown, in order, and the middles between them. Many layouts share the solids.
        """
        grown = self.solids + (self.radius - SLACK) * np.array([-1, -1, 1, 1])
        stops, inside = [], []
        for axis in (0, 1):
            lines = np.unique(np.clip(grown[:, axis::2], *self.bounds[axis::2]))
            stops.append(np.sort(np.concatenate([lines, (lines[:-1] + lines[1:]) / 2])))
            inside.append(_inside(grown[:, axis::2], stops[axis]))
        return stops, np.matmul(inside[0].T, inside[1]) > 0

    def layout(self, center: Array, quarter: Array, placed: Array | None = None) -> Room:
        """Return the brief with items at centres (n, 2) and facings (n,); those not `placed` (n,) get no centre."""
        back = rotation(self.base)
        poses = {}
        for k in self.movable:
            if placed is None or placed[k]:
                x, y = (back @ center[k]).tolist()
                given = self.brief.furniture[k].rotation
                turned = float(facings(self.brief)[int(quarter[k])]) if given is None else given
                poses[int(k)] = ((x, y), turned)
        return with_poses(self.brief, poses)


def scene_of(brief: Room) -> Scene:
    """The brief as boxes."""
    base, entered = facings(brief)[0], entrance(brief)
    indoor = _rounded(rotate(brief.indoor, -base, origin=(0, 0)))
    items = [_item(item, base) for item in brief.furniture]
    middle = np.array(indoor.representative_point().coords[0])
    standing = [item.center is not None for item in brief.furniture]
    center = [rotation(-base) @ item.center if item.center else middle for item in brief.furniture]
    front = np.array([front_depth(item) for item in brief.furniture]).reshape(-1, 1, 1)
    shared = np.array([[may_share_floor(a, b) for b in brief.furniture] for a in brief.furniture], dtype=bool)
    before = [[may_stand_before(a.category, b.category) for b in brief.furniture] for a in brief.furniture]
    takes_none = along_walls([brief], Items.of([brief]))
    aside = np.array([item.tucked or item.category in RAISED for item in brief.furniture], dtype=bool)
    half = np.array([h for h, _ in items]).reshape(-1, 4, 2)
    along = np.abs(FACINGS)
    return Scene(
        brief=brief,
        base=base,
        solids=solid_boxes(indoor),
        doors=tuple(_gate(door, base, indoor) for door in sorted(brief.doors, key=lambda door: door != entered)),
        windows=tuple(_gate(window, base, indoor) for window in brief.windows),
        radius=way_width(brief) / 2,
        half=half,
        front_half=half * (1 - along) + front / 2 * along,
        front_offset=FACINGS * (half + front / 2),
        stands_aside=aside,
        may_overlap=shared | np.eye(len(items), dtype=bool),
        may_stand_before=np.array(before, dtype=bool) | np.eye(len(items), dtype=bool) | takes_none,
        movable=np.flatnonzero(~np.array(standing, dtype=bool)),
        turnable=np.array([item.rotation is None for item in brief.furniture], dtype=bool),
        center=np.array(center).reshape(-1, 2),
        quarter=np.array([quarter for _, quarter in items], dtype=int),
    )


def _item(item: Item, base: float) -> tuple[Array, int]:
    """Return an item's half extents (4, 2) by facing, and its facing: the nearest if it leans, 0 if not chosen yet."""
    depth, width = item.size
    halves = np.array([(depth, width), (width, depth)] * 2) / 2
    if item.rotation is None:
        return halves, 0
    quarter = round((item.rotation - base) / 90)
    lean = item.rotation - base - 90 * quarter
    if abs(lean) > 1e-6 and item.form != "circle":
        x0, y0, x1, y1 = rotate(shapely.box(*-halves[0], *halves[0]), item.rotation - base, origin=(0, 0)).bounds
        halves = np.tile([(x1 - x0) / 2, (y1 - y0) / 2], (4, 1))
    return halves, quarter % 4


def _gate(opening: Opening, base: float, indoor: shapely.Polygon) -> Gate:
    shape = rotate(opening.shape, -base, origin=(0, 0))
    along, through = along_and_through(shape, indoor.boundary)
    middle = np.array(shape.centroid.coords[0])
    ends = middle + through / 2, middle - through / 2
    inner = min(ends, key=lambda end: indoor.distance(shapely.Point(end + 0.5 * (end - middle))))
    inward = int((FACINGS @ (inner - middle)).argmax())
    return Gate(np.array(shape.bounds), inward, inner, float(np.hypot(*along)))


def solid_boxes(indoor: shapely.Polygon) -> Array:
    """Boxes (m, 4) that cover all that is not floor; the first four lie left, below, right and above."""
    x0, y0, x1, y1 = indoor.bounds
    low, high = (x0 - THICK, y0 - THICK), (x1 + THICK, y1 + THICK)
    around = [(*low, x0, high[1]), (low[0], low[1], high[0], y0), (x1, low[1], *high), (low[0], y1, *high)]
    cuts = sorted({x for ring in (indoor.exterior, *indoor.interiors) for x, _ in ring.coords})
    edges = [pair for ring in (indoor.exterior, *indoor.interiors) for pair in pairwise(ring.coords)]
    boxes: list[tuple[float, ...]] = []
    for left, right in pairwise(cuts):
        slants = any(min(a, c) < right and max(a, c) > left and b != d for (a, b), (c, d) in edges)
        strips = np.linspace(left, right, 1 + (math.ceil((right - left) / STRIP) if slants else 1))
        for start, end in pairwise(strips.tolist()):
            outside = shapely.box(start, y0, end, y1).difference(indoor)
            for part in shapely.get_parts(outside):
                if part.area > 1e-9:
                    _, bottom, _, top = part.bounds
                    before = [box for box in boxes if box[1:] == (bottom, start, top)]  # one box with the new one
                    boxes = [box for box in boxes if box not in before]
                    boxes.append((before[0][0] if before else start, bottom, end, top))
    return np.array([*around, *boxes])


def keep_free(scene: Scene, depth: float) -> Array:
    """The floor (z, 4) that doors need: `depth` into the room, DOOR_CLEARANCE at least."""
    boxes = [_beyond(door, max(depth, DOOR_CLEARANCE)) for door in scene.doors]
    return np.array(boxes).reshape(-1, 4)


def daylight(scene: Scene) -> Array:
    """The floor (w, 4) before windows, on which nothing tall may stand."""
    return np.array([_beyond(window, BEFORE_WINDOW) for window in scene.windows]).reshape(-1, 4)


def _beyond(gate: Gate, depth: float) -> Array:
    """The box of an opening and of `depth` metres of floor before it."""
    box = gate.box.copy()
    side = {0: 2, 1: 3, 2: 0, 3: 1}[gate.inward]
    box[side] += depth * FACINGS[gate.inward].sum()
    return box


# --- arithmetic of boxes, (..., 4) each, which broadcast ---


def boxes_at(center: Array, half: Array) -> Array:
    """The boxes (..., 4) around centres (..., 2)."""
    return np.concatenate([center - half, center + half], -1)


def depth(a: Array, b: Array) -> Array:
    """How deep one box is in another: the shortest way out, in metres; 0 where they do not overlap."""
    across = np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2])
    return np.maximum(np.minimum(across[..., 0], across[..., 1]), 0.0)


def gap(a: Array, b: Array) -> Array:
    """The distance between two boxes, in metres."""
    apart = np.maximum(np.maximum(b[..., :2] - a[..., 2:], a[..., :2] - b[..., 2:]), 0.0)
    return np.sqrt(apart[..., 0] ** 2 + apart[..., 1] ** 2)


def ahead(a: Array, blocks: Array) -> Array:
    """How far a box (..., 4) slides in each of the FACINGS until it touches one of the blocks (..., k, 4): (..., 4).

    It is at most THICK. A block that it overlaps already, by more than TOLERANCE, does not stop it.
    """
    box = a[..., None, :]
    low = blocks[..., :2] - box[..., 2:]  # to blocks right or above
    high = box[..., :2] - blocks[..., 2:]  # left or below
    beside = np.maximum(low, high) < -TOUCH  # the spans along x, y overlap
    way = np.concatenate([low, high], -1)
    crossing = np.concatenate([beside[..., ::-1]] * 2, -1)
    return np.where(crossing & (way > -TOLERANCE), np.maximum(way, 0.0), np.inf).min(-2, initial=THICK)


def unreached(scene: Scene, boxes: Array) -> Array:
    """Count the items of layouts (C, n, 4) that cannot be reached from the `entrance`, the first of the doors: (C,).

    Obstacles are grown by half a passage, and the floor is cut into cells along their sides: exact for growth to the
    sides. An item is reached where free floor that is connected with the door lies straight before one of its sides.
    Without doors the count is 0.
    """
    count = boxes.shape[:2]
    if not scene.doors or not boxes.size:
        return np.zeros(count[0])
    stops, barred = scene.barred
    grown = boxes[:, ~scene.stands_aside] + (scene.radius - SLACK) * np.array([-1, -1, 1, 1])
    spans, at_stop, inside, near, beside = [], [], [], [], []
    for axis in (0, 1):
        sides = np.clip(grown[..., axis::2].reshape(count[0], -1), *scene.bounds[axis::2])
        lines = np.sort(np.concatenate([np.tile(stops[axis][::2], (count[0], 1)), sides], 1), 1)
        cells = np.stack([lines[:, :-1], lines[:, 1:]], -1)[:, None]  # (C, 1, cells, 2)
        middle = cells.mean(-1)
        spans.append(cells[:, 0])
        side = np.searchsorted(stops[axis][::2], middle[:, 0] + TOUCH, "right") - 1
        at_stop.append(2 * side + (middle[:, 0] - stops[axis][2 * side] > TOUCH))
        inside.append(_inside(grown[..., axis::2], middle))
        low, high = boxes[..., axis, None], boxes[..., axis + 2, None]
        within = scene.radius + TOLERANCE
        near.append((cells[..., 0] <= high + within) & (cells[..., 1] >= low - within))
        beside.append((cells[..., 0] <= high) & (cells[..., 1] >= low))
    free = np.matmul(inside[0].swapaxes(1, 2), inside[1]) == 0  # (C, cells along x, cells along y)
    free &= ~barred[at_stop[0][:, :, None], at_stop[1][:, None]]
    from scipy import ndimage  # here: it takes a third of a second to load, and every command's options import rivals

    parts, _ = ndimage.label(free, _WITHIN_A_LAYOUT)
    door = scene.doors[0]
    entry = door.middle + FACINGS[door.inward] * (scene.radius + TOUCH)
    at = [((s[..., 0] <= p + TOUCH) & (p - TOUCH <= s[..., 1])) for s, p in zip(spans, entry, strict=True)]
    entered = parts * (at[0][:, :, None] & at[1][:, None])
    component = entered.reshape(count[0], -1).max(1)
    walked = ((parts == component[:, None, None]) & free).astype(np.float32)
    reached = np.zeros(count, dtype=bool)
    for of_x, of_y in ((near[0], beside[1]), (beside[0], near[1])):
        columns = np.matmul(of_x.astype(np.float32), walked)  # (C, n, cells along y)
        reached |= (columns * of_y).sum(-1) > 0
    return (~reached).sum(1).astype(float)


def _inside(span: Array, point: Array) -> Array:
    """Whether points (..., p) are inside spans (..., k, 2): float32 (..., k, p), to be multiplied."""
    return ((span[..., :1] + TOUCH < point) & (point < span[..., 1:] - TOUCH)).astype(np.float32)


_WITHIN_A_LAYOUT = np.zeros((3, 3, 3), dtype=bool)
_WITHIN_A_LAYOUT[1] = True  # cells that meet at a corner are joined: boxes whose growths meet there lie a passage apart


def _rounded(shape: shapely.Polygon) -> shapely.Polygon:
    """Round the corners to a micrometre, so that upright edges are exactly upright."""
    return shapely.transform(shape, lambda corners: np.round(corners, 6))
