"""Real bathrooms and kitchens: the floor plans of Raster-to-Vector (Liu et al., ICCV 2017).

A plan file holds centre lines of walls, openings on them, icons and label boxes, in pixels. Rooms are the
faces that the walls enclose, inset by half a wall and scaled by things of known size. The format and the
numbers below are those of `FORMAT.md`, which lies beside the data.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from statistics import median
from typing import Literal, NamedTuple, TypeVar

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon, box
from shapely.geometry.polygon import orient
from shapely.ops import nearest_points

from layoutrl.rooms.collection import Collection
from layoutrl.rooms.room import Item, Opening, Ring, Room, wall_band

MAIN_ITEM = {"bathroom": "bathtub", "kitchen": "cooking_counter"}  # the items that move by default here

Labels = Literal["snapped", "raw"]

PLANS = Path("data/floorplan_representation")
NEAR_COPIES = "near_duplicates.tsv"
ROOM_TYPES = {"bathroom": "bathroom", "restroom": "bathroom", "washing_room": "bathroom", "kitchen": "kitchen"}
ROOM_LABELS = {*ROOM_TYPES, "living_room", "bedroom", "balcony", "corridor", "closet", "PS"}
ICONS = {"bathtub", "toilet", "cooking_counter", "washing_basin"}
CATEGORIES = {"wall", "door", "entrance", "stairs", "special", "point"} | ICONS | ROOM_LABELS
FACING = {1: 90, 2: 0, 3: 270, 4: 180}  # side of the back (bottom, left, top, right): degrees of the item's +x axis

# Tolerances of the drawing: (pixels, share of a length); the larger of the two holds.
STRAIGHTEN = (3, 0.12)  # of the wall's length
ALIGN = (3, 0.008)  # of the plan's extent, like the next two
SNAP_END = (4, 0.02)
ENTRANCE = (6, 0.03)
HALF_WALL = 0.0098  # of the plan's extent; about 7.5 cm
STRAIGHT = 0.5  # pixels: a corner that lies closer to the line between its neighbours is none
TWIN_IOU = 0.3  # two icons of one category that overlap more are one icon drawn twice

# Sizes that are known, in metres: the scale of a plan is the median over those it shows.
ROOM_SIZE = {"restroom": (0.80, 1.32), "bathroom": (1.28, 1.73)}  # short and long side
BATHTUB_LENGTH = 1.25
TOILET_LENGTH = 0.78
DOOR_WIDTH = {"wet": 0.68, "bedroom": 0.75}
COUNTER_DEPTH = 0.59
APPLIANCE_SIDE = 0.64
HINGED = {1, 2}  # the styles of hinged doors
DASHED = 2  # the style of an appliance that is drawn as a dashed square
METRES_PER_PIXEL = 0.022  # of a plan that shows none of them

DIGITS = 4  # corners are rounded to a tenth of a millimetre

# The rule of labels=snapped, in metres.
SNAP_GAP = 0.12
CENTRE_GAP = 0.07
TOILET_SIDE_GAP = 0.04

Bounds = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max
T = TypeVar("T", int, str)


class Row(NamedTuple):
    """A line of a plan: two corners in pixels, y up; `style` and `back` are the format's d1 and d2."""

    x0: float
    y0: float
    x1: float
    y1: float
    category: str
    style: int
    back: int

    @property
    def box(self) -> Polygon:
        return box(min(self.x0, self.x1), min(self.y0, self.y1), max(self.x0, self.x1), max(self.y0, self.y1))

    @property
    def line(self) -> LineString:
        return LineString(((self.x0, self.y0), (self.x1, self.y1)))


class Plan(NamedTuple):
    """A plan in pixels, y up: the faces that its walls enclose, the labels in each, and what is drawn on them."""

    faces: list[Polygon]
    labels: list[list[str]]  # a list a face, such as ["bathroom-1", "restroom-1"]
    unplaced: list[str]  # labels that lie in no face
    extent: float
    rows: dict[str, list[Row]]  # by category

    @property
    def half_wall(self) -> float:
        return HALF_WALL * self.extent

    def inner(self, face: int) -> Polygon:
        """The indoor area of a face: less half a wall and the pillars, without slivers thinner than a wall."""
        pillars = shapely.union_all([row.box for row in self.rows["special"]])
        inset = self.faces[face].buffer(-self.half_wall, join_style="mitre").difference(pillars)
        inset = inset.buffer(-self.half_wall, join_style="mitre").buffer(self.half_wall, join_style="mitre")
        parts = shapely.get_parts(inset)
        largest = parts[shapely.area(parts).argmax()] if len(parts) else Polygon()
        # Normalised first: a ring that starts at its lowest left point starts at a true corner.
        return orient(largest.normalize().simplify(STRAIGHT))


def read(root: Path, room_type: str, labels: Labels = "snapped") -> Collection:
    """All rooms of `room_type` ("bathroom" or "kitchen") under `root`, in metres.

    Bath rooms, toilet rooms and washing rooms are bathrooms; the id tells which: "<plan>#restroom-1". `labels`
    says where the furniture stands: "raw" as drawn, "snapped" with the drafting slack taken out, which edits the
    truth and is to be said beside every number. Rooms of plans that are near copies share a `group`.

    Raises ValueError for a room type that the source does not have and for a root without its files.
    """
    if room_type not in ROOM_TYPES.values():
        raise ValueError(f"room_type={room_type}: the floor plans have {' and '.join(sorted(set(MAIN_ITEM)))} only")
    if labels not in ("snapped", "raw"):
        raise ValueError(f"labels={labels}: expected snapped or raw")
    files = sorted((root / PLANS).rglob("*.txt"))
    if not files:
        raise ValueError(
            f"no floor plans: expected *.txt files under {root / PLANS}; set data.root=<folder with data/>"
        )
    group_of = _near_copies(root / NEAR_COPIES)
    collection = Collection("floorplans")
    for file in files:
        plan_id = file.relative_to(root / PLANS).with_suffix("").as_posix()
        try:
            rows = _parse(file)
        except BadRow as bad:
            collection.left_out.append((f"{file}:{bad.line}", f"plan with a bad row: {bad.problem}"))
            continue
        for room in _rooms(plan_id, _plan(rows), rows, room_type, labels, group_of.get(plan_id, plan_id)):
            if isinstance(room, Room):
                collection.rooms.append(room)
            else:
                collection.left_out.append(room)
    return collection


class BadRow(ValueError):
    """A row that cannot be read: its line, and what is wrong with it."""

    def __init__(self, line: int, problem: str):
        super().__init__(f"line {line}: {problem}")
        self.line = line
        self.problem = problem


def _parse(file: Path) -> dict[str, list[Row]]:
    """The rows of a plan file by category, y turned up. Raises BadRow: without one wall a plan is another plan."""
    rows: dict[str, list[Row]] = defaultdict(list)
    for number, text in enumerate(file.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        if not text.strip():
            continue
        values = text.strip().split("\t")
        if len(values) not in (6, 7):
            raise BadRow(number, "expected x_min, y_min, x_max, y_max, category, d1, d2 between tabs")
        if values[4] not in CATEGORIES:
            raise BadRow(number, "unknown category")
        try:
            x0, y0, x1, y1 = map(float, values[:4])
            style, back = int(values[5]), int(values[6]) if len(values) == 7 else 1
        except ValueError:
            raise BadRow(number, "a coordinate, d1 or d2 is not a number") from None
        if not all(map(math.isfinite, (x0, y0, x1, y1))):
            raise BadRow(number, "a coordinate, d1 or d2 is not a number")
        rows[values[4]].append(Row(x0, -y0, x1, -y1, values[4], style, back))
    return rows


def _near_copies(file: Path) -> dict[str, str]:
    """The representative of each plan that has near copies: the smallest id that a chain of copies reaches."""
    if not file.is_file():
        raise ValueError(
            f"no list of near copies: expected {file}; set data.root=<folder with it>, or copies leak into the test set"
        )
    lines = file.read_text(encoding="utf-8").splitlines()[1:]
    return _components((line.split("\t")[0], line.split("\t")[1]) for line in lines)


def _components(pairs: Iterable[tuple[T, T]]) -> dict[T, T]:
    """The smallest member of its connected component, for everything in `pairs`."""
    parent: dict[T, T] = {}

    def find(member: T) -> T:
        while parent.setdefault(member, member) != member:
            member = parent[member]
        return member

    for pair in pairs:
        first, second = sorted(map(find, pair))
        parent[second] = first
    return {member: find(member) for member in list(parent)}


# From walls to faces -------------------------------------------------------------------------------------------------

Run = tuple[float, float, float]  # an axis-parallel wall: where it lies across, and from where to where it reaches


def _tolerance(limit: tuple[float, float], length: float) -> float:
    return max(limit[0], limit[1] * length)


def _plan(rows: dict[str, list[Row]]) -> Plan | None:
    """The faces that the walls enclose; None where they enclose none."""
    corners = np.array([(r.x0, r.y0, r.x1, r.y1) for r in rows["wall"]]).reshape(-1, 2)
    if not len(corners):
        return None
    extent = float(np.ptp(corners, axis=0).mean())
    enclosed = shapely.get_parts(shapely.polygonize(shapely.get_parts(shapely.union_all(_walls(rows["wall"], extent)))))
    plan = Plan([face for face in enclosed if not face.buffer(-HALF_WALL * extent).is_empty], [], [], extent, rows)
    plan.labels.extend([] for _ in plan.faces)
    for kind in sorted(ROOM_LABELS):
        for number, row in enumerate(rows[kind], start=1):
            holds = shapely.contains_xy(plan.faces, (row.x0 + row.x1) / 2, (row.y0 + row.y1) / 2)
            (plan.labels[holds.argmax()] if holds.any() else plan.unplaced).append(f"{kind}-{number}")
    return plan if plan.faces else None


def _walls(rows: list[Row], extent: float) -> list[LineString]:
    """The centre lines without the slack of the drawing: straight, aligned, and ending on each other."""
    across: tuple[list[Run], list[Run]] = ([], [])  # walls along x, walls along y
    oblique = []
    for row in rows:
        dx, dy = abs(row.x1 - row.x0), abs(row.y1 - row.y0)
        if min(dx, dy) > _tolerance(STRAIGHTEN, max(dx, dy)):
            oblique.append(row)
        elif dx >= dy:
            across[0].append(((row.y0 + row.y1) / 2, min(row.x0, row.x1), max(row.x0, row.x1)))
        else:
            across[1].append(((row.x0 + row.x1) / 2, min(row.y0, row.y1), max(row.y0, row.y1)))
    near = _tolerance(SNAP_END, extent)
    along_x, along_y = (_aligned(runs, _tolerance(ALIGN, extent), near) for runs in across)
    lines = [LineString(((lo, y), (hi, y))) for y, lo, hi in _ends_on(along_x, along_y, near) if hi > lo]
    lines += [LineString(((x, lo), (x, hi))) for x, lo, hi in _ends_on(along_y, along_x, near) if hi > lo]
    corners = [Point(end) for line in lines for end in line.coords]
    straight = shapely.union_all(lines)
    for row in oblique:
        ends = []
        for end in map(Point, row.line.coords):
            corner = min(corners, key=end.distance, default=end)
            if end.distance(corner) > near and end.distance(straight) <= near:
                corner = nearest_points(straight, end)[0]
            ends.append(corner if end.distance(corner) <= near else end)
        corners += ends
        lines.append(LineString(ends))
    return lines


def _aligned(runs: list[Run], slack: float, near: float) -> list[Run]:
    """Parallel walls that touch each other lie on one line: the mean of theirs, by length."""
    pairs = [(i, i) for i in range(len(runs))]
    for i, (c, lo, hi) in enumerate(runs):
        for j, (other, start, stop) in enumerate(runs[:i]):
            if abs(c - other) <= slack and start <= hi + near and stop >= lo - near:
                pairs.append((i, j))
    group = _components(pairs)
    weights: Counter[int] = Counter()
    moments: Counter[int] = Counter()
    for i, (c, lo, hi) in enumerate(runs):
        weights[group[i]] += hi - lo + 1
        moments[group[i]] += c * (hi - lo + 1)
    return [(moments[group[i]] / weights[group[i]], lo, hi) for i, (_, lo, hi) in enumerate(runs)]


def _ends_on(runs: list[Run], crossing: list[Run], near: float) -> list[Run]:
    """Walls whose ends lie on the nearest perpendicular wall, where there is one."""

    def moved(end: float, c: float) -> float:
        walls = [other for other, lo, hi in crossing if lo - near <= c <= hi + near and abs(other - end) <= near]
        return min(walls, key=lambda other: abs(other - end), default=end)

    return [(c, moved(lo, c), moved(hi, c)) for c, lo, hi in runs]


# Openings and scale --------------------------------------------------------------------------------------------------


class Gap(NamedTuple):
    """An opening in the wall of one face, in pixels."""

    kind: Literal["door", "window"]
    ring: Ring  # across the wall band, just outside the inner outline
    beyond: list[str]  # labels of what lies behind it
    drawn: Row


def _gaps(plan: Plan, face: int, inner: Polygon) -> Iterator[Gap]:
    """The doors and windows in the walls of a face, each clipped to the wall that it lies in."""
    if not plan.rows["door"]:
        return
    corners = np.array(inner.exterior.coords)
    along = np.diff(corners, axis=0)
    length = np.hypot(*along.T)
    along /= length[:, None]
    outward = np.stack((along[:, 1], -along[:, 0]), axis=1)
    ends = np.array([((r.x0, r.y0), (r.x1, r.y1)) for r in plan.rows["door"]])
    from_corner = ends[None] - corners[:-1, None, None]  # (walls, openings, ends, xy)
    position = np.einsum("wdex,wx->wde", from_corner, along).clip(0, length[:, None, None])
    start, stop = position.min(-1), position.max(-1)
    aside = np.abs(np.einsum("wdex,wx->wde", from_corner, outward) - plan.half_wall).max(-1)
    thickness = 2 * plan.half_wall
    fits = (aside <= _tolerance(SNAP_END, plan.extent)) & (stop - start >= thickness)
    wall_of = np.where(fits, stop - start - aside, -np.inf).argmax(axis=0)
    for row, wall, a, b, fit in zip(
        plan.rows["door"],
        wall_of,
        *(np.take_along_axis(values, wall_of[None], axis=0)[0] for values in (start, stop, fits)),
        strict=True,
    ):
        if not fit:
            continue
        p, q = corners[wall] + a * along[wall], corners[wall] + b * along[wall]
        across = outward[wall] * thickness
        beyond = _beyond(plan, (p + q) / 2, across)
        if beyond == face:
            continue
        outside = beyond is None and not any(
            row.line.distance(entrance.box) <= _tolerance(ENTRANCE, plan.extent) for entrance in plan.rows["entrance"]
        )
        ring = tuple((float(x), float(y)) for x, y in (p, p + across, q + across, q))
        labels = [] if beyond is None else plan.labels[beyond]
        yield Gap("window" if outside else "door", ring, labels, row)


def _beyond(plan: Plan, foot: np.ndarray, across: np.ndarray) -> int | None:
    """The face behind a wall; None outside. Looked for in three depths, since slivers were dropped."""
    for depth in (1, 1.5, 2):
        holds = shapely.contains_xy(plan.faces, *(foot + depth * across))
        if holds.any():
            return int(holds.argmax())
    return None


def _metres_per_pixel(plan: Plan) -> float:
    """The median over all things of known size in a plan."""
    scales = []
    for face, labels in enumerate(plan.labels):
        kinds = {_kind(label) for label in labels}
        if len(kinds) != 1:
            continue
        kind = kinds.pop()
        inner = plan.inner(face)
        if inner.is_empty:
            continue
        x0, y0, x1, y1 = inner.bounds
        if kind in ROOM_SIZE:
            scales += [known / side for known, side in zip(ROOM_SIZE[kind], sorted((x1 - x0, y1 - y0)), strict=True)]
        width = DOOR_WIDTH.get("wet" if ROOM_TYPES.get(kind) == "bathroom" else kind)
        if width:
            scales += [width / gap.drawn.line.length for gap in _gaps(plan, face, inner) if _is_anchor(gap)]
    for row in (row for category in ICONS for row in plan.rows[category]):
        short, long = sorted((abs(row.x1 - row.x0), abs(row.y1 - row.y0)))
        if not short:
            continue
        if row.category == "bathtub":
            scales.append(BATHTUB_LENGTH / long)
        elif row.category == "toilet":
            scales.append(TOILET_LENGTH / long)
        elif row.category == "cooking_counter":
            scales.append(COUNTER_DEPTH / short)
        elif row.style == DASHED:
            scales.append(APPLIANCE_SIDE * 2 / (short + long))
    return median(scales) if scales else METRES_PER_PIXEL


def _is_anchor(gap: Gap) -> bool:
    """Whether an opening is a door of ordinary width: sliding ones, and those of closets and balconies, are wider."""
    other = {"closet", "balcony"}.intersection(map(_kind, gap.beyond))
    return gap.kind == "door" and gap.drawn.style in HINGED and not other


def _kind(label: str) -> str:
    return label.rpartition("-")[0]


# From faces to rooms -------------------------------------------------------------------------------------------------


def _rooms(
    plan_id: str, plan: Plan | None, rows: dict[str, list[Row]], room_type: str, labels: Labels, group: str
) -> Iterator[Room | tuple[str, str]]:
    """The rooms of one type in a plan, and (id, reason) of those that cannot be used."""
    if plan is None:
        for kind in sorted(ROOM_LABELS):
            for number in range(1, len(rows[kind]) + 1):
                if ROOM_TYPES.get(kind) == room_type:
                    yield f"{plan_id}#{kind}-{number}", "the plan's walls enclose no room"
        return
    yield from (
        (f"{plan_id}#{label}", "its label lies in no closed face")
        for label in plan.unplaced
        if ROOM_TYPES.get(_kind(label)) == room_type
    )
    scale = None
    for face, names in enumerate(plan.labels):
        own = [name for name in names if ROOM_TYPES.get(_kind(name)) == room_type]
        if not own:
            continue
        room_id = f"{plan_id}#{own[0]}"
        if len({_kind(name) for name in names}) > 1:
            yield room_id, "open plan: several kinds of room share the face"
            continue
        scale = scale or _metres_per_pixel(plan)
        inner = plan.inner(face)
        if inner.is_empty:
            yield room_id, "the face is thinner than its walls"
            continue
        icons = _icons(plan, face)
        if not icons:
            yield room_id, "no furniture is drawn in it"
            continue
        yield _room(room_id, plan, face, inner, icons, scale, room_type, labels, group)


def _icons(plan: Plan, face: int) -> list[Row]:
    """The icons that a face holds more than half of, without twins."""
    icons: list[Row] = []
    shapely.prepare(plan.faces[face])
    for row in (row for category in sorted(ICONS) for row in plan.rows[category]):
        if not row.box.area or row.box.intersection(plan.faces[face]).area <= row.box.area / 2:
            continue
        twins = (i for i in icons if (i.category, i.style) == (row.category, row.style))
        if not any(_iou(row.box, twin.box) > TWIN_IOU for twin in twins):
            icons.append(row)
    return icons


def _iou(a: Polygon, b: Polygon) -> float:
    shared = a.intersection(b).area
    return shared / (a.area + b.area - shared)


def _room(
    room_id: str,
    plan: Plan,
    face: int,
    inner: Polygon,
    icons: list[Row],
    scale: float,
    room_type: str,
    labels: Labels,
    group: str,
) -> Room:
    origin = np.array(inner.bounds[:2]) * scale

    def metres(corners: Iterable[Iterable[float]]) -> Ring:
        return tuple((float(x), float(y)) for x, y in np.round(np.array(list(corners)) * scale - origin, DIGITS))

    outline = metres(inner.exterior.coords[:-1])
    holes = tuple(metres(ring.coords[:-1]) for ring in inner.interiors)
    openings = tuple(Opening(gap.kind, metres(gap.ring)) for gap in _gaps(plan, face, inner))
    furniture = []
    for row in icons:
        (x0, y0), _, (x1, y1), _ = metres(row.box.exterior.coords[:-1])
        bounds = (min(x0, x1), min(y0, y1), max(x0, x1), max(y0, y1))
        if labels == "snapped":
            bounds = _snap(bounds, row.category == "toilet", (outline, *holes))
        furniture.append(_item(_category(row, room_type), bounds, FACING[row.back]))
    main = [k for k, item in enumerate(furniture) if item.category == MAIN_ITEM[room_type]]
    return Room(
        id=room_id,
        room_type=room_type,
        outline=outline,
        walls=wall_band(outline, holes, openings, 2 * plan.half_wall * scale),
        openings=openings,
        furniture=tuple(furniture),
        target=main[0] if len(main) == 1 else None,
        holes=holes,
        group=group,
    )


def _category(row: Row, room_type: str) -> str:
    """A washing_basin is a basin, a refrigerator or a washing machine: by its style, and by the room for a dashed one."""
    if row.category != "washing_basin" or row.style == 1:
        return row.category
    return "refrigerator" if row.style == DASHED and room_type == "kitchen" else "washing_machine"


def _item(category: str, bounds: Bounds, rotation: float) -> Item:
    x0, y0, x1, y1 = bounds
    width, height = round(x1 - x0, DIGITS), round(y1 - y0, DIGITS)
    size = (width, height) if rotation % 180 == 0 else (height, width)
    return Item(category, size, (round((x0 + x1) / 2, DIGITS + 1), round((y0 + y1) / 2, DIGITS + 1)), rotation)


def _snap(bounds: Bounds, toilet: bool, rings: tuple[Ring, ...]) -> Bounds:
    """Where an icon stands without the slack of the drawing, by a fixed rule that looks at icon and room only."""
    placed = []
    long_axis = int(bounds[3] - bounds[1] > bounds[2] - bounds[0])
    for axis in (0, 1):
        low, high = bounds[axis], bounds[axis + 2]
        below, above = _space_beside(bounds, axis, rings)
        nearer = -below if abs(below) <= abs(above) else above  # the shift that closes the smaller space
        if toilet and axis != long_axis:
            off_centre = (below - above) / 2
            if abs(off_centre) <= CENTRE_GAP:
                shift = -off_centre
            else:
                shift = nearer if abs(nearer) <= TOILET_SIDE_GAP else 0.0
        elif not toilet and max(abs(below), abs(above)) <= SNAP_GAP:
            placed.append((low - below, high + above))
            continue
        else:
            shift = nearer if abs(nearer) <= SNAP_GAP else 0.0
        placed.append((low + shift, high + shift))
    (x0, x1), (y0, y1) = placed
    return x0, y0, x1, y1


def _space_beside(bounds: Bounds, axis: int, rings: tuple[Ring, ...]) -> tuple[float, float]:
    """The signed distances of an icon's lower and upper side to the nearest wall that faces it, inf without one."""
    spaces: tuple[list[float], list[float]] = ([], [])
    for ring in rings:
        for p, q in zip(ring, ring[1:] + ring[:1], strict=True):
            start, stop = p[1 - axis], q[1 - axis]
            overlap = min(max(start, stop), bounds[3 - axis]) - max(min(start, stop), bounds[1 - axis])
            if p[axis] != q[axis] or overlap <= SNAP_GAP:
                continue
            # The indoor area lies on the left of an edge, so its direction tells which side it bounds.
            if (stop > start) == (axis == 1):
                spaces[0].append(bounds[axis] - p[axis])
            else:
                spaces[1].append(p[axis] - bounds[axis + 2])
    below, above = (min(side, key=abs, default=math.inf) for side in spaces)
    return below, above
