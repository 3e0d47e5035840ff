"""Real bathrooms and kitchens: the floor plans of Raster-to-Vector (Liu et al., ICCV 2017).

A plan file holds, in pixels, the centre lines of walls, openings on them, icons and room labels. Rooms are the
faces that the walls enclose, inset by half a wall and scaled by what has a known size. `FORMAT.md`, which lies
beside the data, describes the format; the rules and numbers below are its own.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from statistics import median
from typing import Literal, NamedTuple, TypeVar

import numpy as np
import shapely
from shapely.geometry import LineString, Point, Polygon, box
from shapely.geometry.polygon import orient

from layoutrl.rooms.collection import Collection
from layoutrl.rooms.room import TOLERANCE, InputError, Item, Opening, Ring, Room, wall_band

MAIN_ITEM = {"bathroom": "bathtub", "kitchen": "cooking_counter"}  # the items that move by default here

PLANS = Path("data/floorplan_representation")
NEAR_COPIES = "near_duplicates.tsv"
TYPE_OF = {"bathroom": "bathroom", "restroom": "bathroom", "washing_room": "bathroom", "kitchen": "kitchen"}
KINDS = (*TYPE_OF, "living_room", "bedroom", "balcony", "corridor", "closet", "PS")  # of rooms, as labelled
ICONS = ("bathtub", "cooking_counter", "toilet", "washing_basin")
CATEGORIES = {"wall", "door", "entrance", "stairs", "special", "point", *ICONS, *KINDS}
FACING = {1: 90, 2: 0, 3: 270, 4: 180}  # side of the back (bottom, left, top, right): degrees of an item's +x axis
BASIN, DASHED = 1, 2  # styles of a washing_basin: a basin, an appliance drawn as a dashed square; above, a machine
HINGED = (1, 2)  # styles of a door

# Slack of the drawing: (pixels, share of a length); the larger of the two holds.
STRAIGHTEN = (3, 0.12)  # of the wall's length
ALIGN = (3, 0.008)  # of the plan's extent, as the next two
SNAP_END = (4, 0.02)
ENTRANCE = (6, 0.03)
HALF_WALL = 0.0098  # of the plan's extent: about 7 cm
CORNER = 0.5  # pixels: what lies closer to the line between its neighbours is no corner
TWIN = 0.5  # two icons, or openings, are one drawn twice when they share this much of the smaller

# The scale of a plan is the median over what it shows of these, in metres.
ROOM_SIZE = {"restroom": (0.80, 1.32), "bathroom": (1.28, 1.73)}  # short and long side
DOOR_WIDTH = {"bathroom": 0.68, "restroom": 0.68, "washing_room": 0.68, "bedroom": 0.75}
LONG_SIDE = {"bathtub": 1.25, "toilet": 0.78}
COUNTER_DEPTH = 0.59
APPLIANCE_SIDE = 0.64
METRES_PER_PIXEL = 0.022  # of a plan that shows none of them
DIGITS = 4  # corners are rounded to a tenth of a millimetre

# The rule of labels=snapped, in metres.
SNAP_GAP = 0.12
CENTRE_GAP = 0.07
TOILET_SIDE_GAP = 0.04

Bounds = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max
Run = tuple[float, float, float]  # an axis-parallel wall: where it lies across, and from where to where it reaches
T = TypeVar("T", int, str)


class Row(NamedTuple):
    """A line of a plan: two corners in pixels, y up; `style` and `back` are the format's d1 and d2."""

    x0: float
    y0: float
    x1: float
    y1: float
    style: int
    back: int

    @property
    def box(self) -> Polygon:
        return box(min(self.x0, self.x1), min(self.y0, self.y1), max(self.x0, self.x1), max(self.y0, self.y1))

    @property
    def line(self) -> LineString:  # keeps the order of the corners, which tells how an oblique wall runs
        return LineString(((self.x0, self.y0), (self.x1, self.y1)))


class Gap(NamedTuple):
    """A door or window in the wall of one face, in pixels: a band just outside the inner outline."""

    kind: Literal["door", "window"]
    shape: Polygon
    beyond: list[str]  # labels of the face behind it
    drawn: Row


@dataclass
class Plan:
    """A plan in pixels, y up: its rows by category, the faces its walls enclose, and the labels in each."""

    rows: dict[str, list[Row]]
    extent: float  # mean of width and height
    faces: list[Polygon]
    labels: list[list[str]]  # a list a face, such as ["bathroom-1", "restroom-1"]
    unplaced: list[str]  # labels that lie in no face

    @property
    def half_wall(self) -> float:
        return HALF_WALL * self.extent

    @cached_property
    def metres_per_pixel(self) -> float:
        """The median over everything in the plan that has a known size."""
        scales = list(_scales(self))
        return median(scales) if scales else METRES_PER_PIXEL


class BadRow(ValueError):
    """A row that cannot be read: its line, and why."""

    def __init__(self, line: int, problem: str):
        super().__init__(problem)
        self.line = line


def read(root: Path, room_type: str, labels: Literal["snapped", "raw"] = "snapped") -> Collection:
    """All rooms of `room_type` ("bathroom" or "kitchen") under `root`, in metres, y up.

    Bath rooms, toilet rooms and washing rooms are bathrooms; the id tells which: "<plan>#restroom-1". `labels`
    says where the furniture stands: "raw" as drawn, "snapped" without the slack of the drawing, which edits the
    truth and has to be said beside every number. Plans that are near copies of each other share a `group`.

    A plan with a bad row is left out as a whole, since it may lack a wall. Raises InputError, a ValueError, for a
    room type that the source does not have and for a root without its files.
    """
    if room_type not in MAIN_ITEM:
        raise InputError(f"room_type={room_type}: floorplans has rooms of type {' and '.join(MAIN_ITEM)} only")
    if labels not in ("snapped", "raw"):
        raise InputError(f"labels={labels}: expected snapped or raw")
    folder = Path(root) / PLANS
    files = sorted(folder.rglob("*.txt"))
    if not files:
        raise InputError(f"no floor plans: expected .txt files under {folder}; set data.root to the folder above data/")
    group_of = _near_copies(Path(root) / NEAR_COPIES)
    collection = Collection(f"floorplans, labels={labels}")
    for file in files:
        plan_id = file.relative_to(folder).with_suffix("").as_posix()
        try:
            plan = _plan(_parse(file))
        except BadRow as error:
            collection.left_out.append((f"{file}:{error.line}", f"plan with a bad row: {error}"))
            continue
        for label in plan.unplaced:
            if TYPE_OF.get(_kind(label)) == room_type:
                collection.left_out.append((f"{plan_id}#{label}", "its label lies in no closed face"))
        for face, found in enumerate(plan.labels):
            own = [label for label in found if TYPE_OF.get(_kind(label)) == room_type]
            if own:
                room_id = f"{plan_id}#{own[0]}"
                room = _room(room_id, plan, face, room_type, labels == "snapped", group_of.get(plan_id, plan_id))
                if isinstance(room, Room):
                    collection.rooms.append(room)
                else:
                    collection.left_out.append((room_id, room))
    return collection


def _near_copies(file: Path) -> dict[str, str]:
    """The representative of each plan that has near copies: the smallest id among those that copies lead to."""
    if not file.is_file():
        raise InputError(
            f"no list of near copies: expected {file}; set data.root to the folder that holds it "
            "(without it, copies of test plans would be trained on)"
        )
    lines = file.read_text(encoding="utf-8").splitlines()[1:]
    return _components((first, second) for first, second, _ in (line.split("\t") for line in lines))


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


def _parse(file: Path) -> dict[str, list[Row]]:
    """The rows of a plan file by category, y turned up. Raises BadRow."""
    rows: dict[str, list[Row]] = defaultdict(list)
    for number, text in enumerate(file.read_text(encoding="utf-8", errors="replace").splitlines(), start=1):
        if not text.strip():
            continue
        fields = text.strip().split("\t")
        if len(fields) not in (6, 7):
            raise BadRow(number, "expected x_min, y_min, x_max, y_max, category, d1, d2 between tabs")
        if fields[4] not in CATEGORIES:
            raise BadRow(number, "the category is unknown")
        try:
            x0, y0, x1, y1 = map(float, fields[:4])
            style, back = int(fields[5]), int(fields[6]) if len(fields) == 7 else 1
        except ValueError:
            raise BadRow(number, "expected numbers for the corners, d1 and d2") from None
        if not all(map(math.isfinite, (x0, y0, x1, y1))) or back not in FACING:
            raise BadRow(number, "expected finite corners, and d2 from 1 to 4")
        rows[fields[4]].append(Row(x0, -y0, x1, -y1, style, back))
    return rows


# From walls to faces -------------------------------------------------------------------------------------------------


def _plan(rows: dict[str, list[Row]]) -> Plan:
    """The faces that the walls enclose, but for those thinner than a wall, and the labels in them."""
    corners = np.array([corner for row in rows["wall"] for corner in row.line.coords]).reshape(-1, 2)
    extent = float(np.ptp(corners, axis=0).mean()) if len(corners) else 0.0
    lines = shapely.get_parts(shapely.union_all(_walls(rows["wall"], extent)))
    enclosed = shapely.get_parts(shapely.polygonize(lines))
    faces = [face for face in enclosed if not face.buffer(-HALF_WALL * extent).is_empty]
    plan = Plan(rows, extent, faces, labels=[[] for _ in faces], unplaced=[])
    for kind in KINDS:
        for number, row in enumerate(rows[kind], start=1):
            face = _face_at(plan, (row.x0 + row.x1) / 2, (row.y0 + row.y1) / 2)
            (plan.unplaced if face is None else plan.labels[face]).append(f"{kind}-{number}")
    return plan


def _kind(label: str) -> str:
    return label.rpartition("-")[0]


def _face_at(plan: Plan, x: float, y: float) -> int | None:
    holds = shapely.contains_xy(plan.faces, x, y)
    return int(holds.argmax()) if holds.any() else None


def _slack(limit: tuple[float, float], length: float) -> float:
    return max(limit[0], limit[1] * length)


def _walls(rows: list[Row], extent: float) -> list[LineString]:
    """The centre lines without the slack of the drawing: straight, aligned, ending on each other."""
    along_x: list[Run] = []
    along_y: list[Run] = []
    oblique: list[Row] = []
    for row in rows:
        x0, y0, x1, y1 = row.box.bounds
        if min(x1 - x0, y1 - y0) > _slack(STRAIGHTEN, max(x1 - x0, y1 - y0)):
            oblique.append(row)
        elif x1 - x0 >= y1 - y0:
            along_x.append(((y0 + y1) / 2, x0, x1))
        else:
            along_y.append(((x0 + x1) / 2, y0, y1))
    near = _slack(SNAP_END, extent)
    along_x, along_y = (_aligned(runs, _slack(ALIGN, extent), near) for runs in (along_x, along_y))
    lines = [LineString(((lo, y), (hi, y))) for y, lo, hi in _ending_on(along_y, along_x, near) if lo < hi]
    lines += [LineString(((x, lo), (x, hi))) for x, lo, hi in _ending_on(along_x, along_y, near) if lo < hi]
    straight = shapely.union_all(lines)
    corners = [Point(end) for line in lines for end in line.coords]
    for row in oblique:  # their ends go to a corner, else to a wall
        ends = []
        for end in map(Point, row.line.coords):
            to = min(corners, key=end.distance, default=end)
            if end.distance(to) > near:
                to = Point(shapely.shortest_line(straight, end).coords[0]) if end.distance(straight) <= near else end
            ends.append(to)
        corners += ends
        lines.append(LineString(ends))
    return lines


def _aligned(runs: list[Run], slack: float, near: float) -> list[Run]:
    """Parallel walls that touch each other, on one line: their mean by length."""
    touching = _components(
        (i, j)
        for i, (a, lo, hi) in enumerate(runs)
        for j, (b, start, stop) in enumerate(runs[: i + 1])
        if abs(a - b) <= slack and start <= hi + near and stop >= lo - near
    )
    members = defaultdict(list)
    for i, run in enumerate(runs):
        members[touching[i]].append(run)
    line = {
        first: sum(c * (hi - lo + 1) for c, lo, hi in group) / sum(hi - lo + 1 for _, lo, hi in group)
        for first, group in members.items()
    }
    return [(line[touching[i]], lo, hi) for i, (_, lo, hi) in enumerate(runs)]


def _ending_on(crossing: list[Run], runs: list[Run], near: float) -> list[Run]:
    """Walls whose ends lie on the nearest perpendicular wall, where there is one."""

    def moved(end: float, across: float) -> float:
        walls = [c for c, lo, hi in crossing if abs(c - end) <= near and lo - near <= across <= hi + near]
        return min(walls, key=lambda c: abs(c - end), default=end)

    return [(c, moved(lo, c), moved(hi, c)) for c, lo, hi in runs]


# What a face holds ---------------------------------------------------------------------------------------------------


def _inner(plan: Plan, face: int) -> Polygon:
    """The indoor area: the face less half a wall and the pillars, without parts thinner than a wall."""
    half = plan.half_wall
    pillars = shapely.union_all([row.box for row in plan.rows["special"]])
    area = plan.faces[face].buffer(-half, join_style="mitre").difference(pillars)
    parts = shapely.get_parts(area.buffer(-half, join_style="mitre").buffer(half, join_style="mitre"))
    largest = max(parts, key=lambda part: part.area, default=Polygon())
    # Normalised first: a ring that starts at its lowest left point starts at a true corner.
    return orient(largest.normalize().simplify(CORNER))


def _gaps(plan: Plan, face: int, inner: Polygon) -> Iterator[Gap]:
    """The doors and windows in the walls of a face, each clipped to the wall that it lies in."""
    corners = np.array(inner.exterior.coords)
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    along = np.diff(corners, axis=0) / lengths[:, None]
    outward = np.stack((along[:, 1], -along[:, 0]), axis=1)
    thickness = 2 * plan.half_wall
    for row in plan.rows["door"]:
        from_corner = np.array(row.line.coords) - corners[:-1, None]  # (walls, two ends, xy)
        reach = np.einsum("wex,wx->we", from_corner, along).clip(0, lengths[:, None])
        start, stop = reach.min(axis=1), reach.max(axis=1)
        aside = np.abs(np.einsum("wex,wx->we", from_corner, outward) - plan.half_wall).max(axis=1)
        fits = (aside <= _slack(SNAP_END, plan.extent)) & (stop - start >= thickness)
        if not fits.any():
            continue
        wall = np.where(fits, stop - start - aside, -np.inf).argmax()
        p, q = (corners[wall] + position[wall] * along[wall] for position in (start, stop))
        across = outward[wall] * thickness
        # Looked for in three depths, in wall thicknesses, since a sliver may lie between.
        behind = (_face_at(plan, *((p + q) / 2 + depth * across)) for depth in (1, 1.5, 2))
        beyond = next((other for other in behind if other is not None), None)
        if beyond == face:
            continue
        near = _slack(ENTRANCE, plan.extent)
        entrance = any(row.line.distance(entrance.box) <= near for entrance in plan.rows["entrance"])
        yield Gap(
            "window" if beyond is None and not entrance else "door",
            Polygon((p, p + across, q + across, q)),
            [] if beyond is None else plan.labels[beyond],
            row,
        )


def _icons(plan: Plan, face: int) -> list[tuple[str, Row]]:
    """The icons that a face holds more than half of, the larger one of twins."""
    found: list[tuple[str, Row]] = []
    for category in ICONS:
        for row in sorted(plan.rows[category], key=lambda row: -row.box.area):
            shape = row.box
            twins = [other.box for name, other in found if (name, other.style) == (category, row.style)]
            if shape.intersection(plan.faces[face]).area > shape.area / 2 and not _drawn_before(shape, twins):
                found.append((category, row))
    return found


def _drawn_before(shape: Polygon, others: Iterable[Polygon]) -> bool:
    return any(shape.intersection(other).area > TWIN * min(shape.area, other.area) for other in others)


def _scales(plan: Plan) -> Iterator[float]:
    """Metres a pixel, once for everything in a plan that has a known size."""
    for face, labels in enumerate(plan.labels):
        kinds = set(map(_kind, labels))
        kind = kinds.pop() if len(kinds) == 1 else ""
        if kind not in DOOR_WIDTH or (inner := _inner(plan, face)).is_empty:
            continue
        x0, y0, x1, y1 = inner.bounds
        sides = sorted((x1 - x0, y1 - y0))
        yield from (known / side for known, side in zip(ROOM_SIZE.get(kind, ()), sides, strict=False))
        for gap in _gaps(plan, face, inner):
            # Only hinged doors between rooms: those of closets and balconies are wider.
            between_rooms = not {"closet", "balcony"}.intersection(map(_kind, gap.beyond))
            if gap.kind == "door" and gap.drawn.style in HINGED and between_rooms:
                yield DOOR_WIDTH[kind] / gap.drawn.line.length
    for category in ICONS:
        for row in plan.rows[category]:
            short, long = sorted((abs(row.x1 - row.x0), abs(row.y1 - row.y0)))
            if not short:
                continue
            if category in LONG_SIDE:
                yield LONG_SIDE[category] / long
            elif category == "cooking_counter":
                yield COUNTER_DEPTH / short
            elif row.style == DASHED:
                yield APPLIANCE_SIDE / ((short + long) / 2)


# From faces to rooms -------------------------------------------------------------------------------------------------


def _room(room_id: str, plan: Plan, face: int, room_type: str, snapped: bool, group: str) -> Room | str:
    """The room that a face is, or why it cannot be used."""
    if len(set(map(_kind, plan.labels[face]))) > 1:
        return "open plan: several kinds of room share the face"
    inner = _inner(plan, face)
    if inner.is_empty:
        return "the face is thinner than its walls"
    icons = _icons(plan, face)
    if not icons:
        return "no furniture is drawn in it"
    scale = plan.metres_per_pixel
    origin = inner.bounds[:2]

    def metres(ring: Iterable[Iterable[float]]) -> Ring:
        corners = np.round((np.array(list(ring)[:-1]) - origin) * scale, DIGITS)
        return tuple((float(x), float(y)) for x, y in corners)

    outline = metres(inner.exterior.coords)
    holes = tuple(metres(hole.coords) for hole in inner.interiors)
    openings: list[Opening] = []
    for gap in _gaps(plan, face, inner):
        opening = Opening(gap.kind, metres(gap.shape.exterior.coords))
        if not _drawn_before(opening.shape, [other.shape for other in openings]):
            openings.append(opening)
    drawn, moved = [], []
    for category, row in icons:
        name = _item_name(category, row.style, room_type)
        bounds: Bounds = Polygon(metres(row.box.exterior.coords)).bounds
        facing = FACING[_back(bounds, row.back, name, (outline, *holes))]
        drawn.append(_item(name, bounds, facing))
        moved.append(_item(name, _snapped(bounds, name == "toilet", (outline, *holes)), facing))
    main = [k for k, item in enumerate(drawn) if item.category == MAIN_ITEM[room_type]]
    room = Room(
        id=room_id,
        room_type=room_type,
        outline=outline,
        walls=wall_band(outline, holes, tuple(openings), 2 * plan.half_wall * scale),
        openings=tuple(openings),
        furniture=tuple(moved if snapped else drawn),
        target=main[0] if len(main) == 1 else None,
        holes=holes,
        group=group,
    )
    # Both label sets are asked, so that they hold the same rooms.
    reach = room.envelope.buffer(TOLERANCE)
    if not all(reach.covers(item.footprint) for item in drawn + moved):
        return "its furniture reaches beyond the outer walls"
    return room


def _item_name(category: str, style: int, room_type: str) -> str:
    """A washing_basin is a basin, a refrigerator or a washing machine: its style tells, and the room if dashed."""
    if category != "washing_basin" or style == BASIN:
        return category
    return "refrigerator" if style == DASHED and room_type == "kitchen" else "washing_machine"


def _item(name: str, bounds: Bounds, rotation: float) -> Item:
    x0, y0, x1, y1 = bounds
    along_x, along_y = round(x1 - x0, DIGITS), round(y1 - y0, DIGITS)
    size = (along_x, along_y) if rotation % 180 == 0 else (along_y, along_x)
    return Item(name, size, (round((x0 + x1) / 2, DIGITS + 1), round((y0 + y1) / 2, DIGITS + 1)), rotation)


def _back(bounds: Bounds, drawn: int, name: str, rings: tuple[Ring, ...]) -> int:
    """The side of an icon's back: as drawn for toilets and basins, else the side nearest to a wall.

    The drawing tells no more than the axis for a bathtub or a counter, whose back is a long side, and mostly
    nothing for an appliance.
    """
    if name in ("toilet", "washing_basin"):
        return drawn
    left, right = _spaces(bounds, 0, rings)
    bottom, top = _spaces(bounds, 1, rings)
    spaces = {1: bottom, 2: left, 3: top, 4: right}
    if name in ("bathtub", "cooking_counter"):
        wide = bounds[2] - bounds[0] >= bounds[3] - bounds[1]
        spaces = {side: space for side, space in spaces.items() if (side in (1, 3)) == wide}
    return min(spaces, key=lambda side: (abs(spaces[side]), side != drawn))


def _snapped(bounds: Bounds, toilet: bool, rings: tuple[Ring, ...]) -> Bounds:
    """Where an icon stands without the slack of the drawing: a fixed rule that looks at icon and room only."""
    long_axis = int(bounds[3] - bounds[1] > bounds[2] - bounds[0])
    placed = []
    for axis in (0, 1):
        low, high = bounds[axis], bounds[axis + 2]
        below, above = _spaces(bounds, axis, rings)
        flush = -below if abs(below) <= abs(above) else above  # the shift to the nearer wall
        if toilet and axis != long_axis:
            centred = (above - below) / 2
            shift = centred if abs(centred) <= CENTRE_GAP else flush if abs(flush) <= TOILET_SIDE_GAP else 0.0
        else:
            shift = flush if abs(flush) <= SNAP_GAP else 0.0
            if not toilet and max(abs(below), abs(above)) <= SNAP_GAP:
                low, high, shift = low - below, high + above, 0.0
        placed.append((low + shift, high + shift))
    (x0, x1), (y0, y1) = placed
    return x0, y0, x1, y1


def _spaces(bounds: Bounds, axis: int, rings: tuple[Ring, ...]) -> tuple[float, float]:
    """Signed distances of an icon's lower and upper side to the nearest wall that faces it; inf without one."""
    below, above = [math.inf], [math.inf]
    for ring in rings:
        for p, q in zip(ring, ring[1:] + ring[:1], strict=True):
            start, stop = sorted((p[1 - axis], q[1 - axis]))
            overlap = min(stop, bounds[3 - axis]) - max(start, bounds[1 - axis])
            if p[axis] != q[axis] or overlap <= SNAP_GAP:  # oblique, or beside the icon but for the slack
                continue
            # The indoor area lies on the left of an edge, so the edge's direction tells which side it bounds.
            if (q[1 - axis] > p[1 - axis]) == (axis == 1):
                below.append(bounds[axis] - p[axis])
            else:
                above.append(p[axis] - bounds[axis + 2])
    return min(below, key=abs), min(above, key=abs)
