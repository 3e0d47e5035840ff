"""Plan files of Raster-to-Vector, in pixels, y up: walls, the faces they enclose, and what lies in each face.

`FORMAT.md`, which lies beside the data, describes the format; the rules and numbers below are its own.
"""

from __future__ import annotations

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

from layoutrl import InputError
from layoutrl.rooms.room import is_drawn_before

# Kinds of rooms, as labelled.
WET_ROOMS = ("bathroom", "restroom", "washing_room")
KINDS = (*WET_ROOMS, "kitchen", "living_room", "bedroom", "balcony", "corridor", "closet", "PS")
FACING = {1: 90, 2: 0, 3: 270, 4: 180}  # side of the back (bottom, left, top, right): degrees of an item's +x axis
BASIN, DASHED = 1, 2  # styles of a washing_basin: a basin, an appliance drawn as a dashed square; others: a machine
ICONS = ("bathtub", "cooking_counter", "toilet", "washing_basin")
CATEGORIES = {"wall", "door", "entrance", "stairs", "special", "point", *ICONS, *KINDS}
HINGED = (1, 2)  # styles of a door that is hinged
LARGEST = 1e5  # pixels, of a corner; plans are some thousand wide

# Slack of the drawing: (pixels, share of a length); the larger of the two holds.
STRAIGHTEN = (3, 0.12)  # of the wall's length
ALIGN = (3, 0.008)  # of the plan's extent, as the next two
SNAP_END = (4, 0.02)
ENTRANCE = (6, 0.03)
HALF_WALL = 0.0098  # of the plan's extent: about 7 cm
CORNER = 0.5  # pixels: what lies closer to the line between its neighbours is no corner

# Known sizes in metres: the scale of a plan is the median over those that it shows.
ROOM_SIZE = {"restroom": (0.80, 1.32), "bathroom": (1.28, 1.73)}  # short and long side
DOOR_WIDTH = {"bathroom": 0.68, "restroom": 0.68, "washing_room": 0.68, "bedroom": 0.75}
LONG_SIDE = {"bathtub": 1.25, "toilet": 0.78}
COUNTER_DEPTH = 0.59
APPLIANCE_SIDE = 0.64
METRES_PER_PIXEL = 0.022  # of a plan that shows none of them

Run = tuple[float, float, float]  # an axis-parallel wall: its coordinate across, and those of its ends along
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
        """The upright rectangle that its two corners span, in pixels."""
        return box(min(self.x0, self.x1), min(self.y0, self.y1), max(self.x0, self.x1), max(self.y0, self.y1))

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Its two corners, in pixels, in their order, which tells how an oblique wall runs."""
        return (self.x0, self.y0), (self.x1, self.y1)

    @property
    def line(self) -> LineString:
        """The line between its two corners, in pixels."""
        return LineString(self.ends)


class FaceOpening(NamedTuple):
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
    labels: list[list[str]]  # for each face a list, such as ["bathroom-1", "restroom-1"]
    unplaced: list[str]  # labels that lie in no face

    @property
    def half_wall(self) -> float:
        """Half a wall's thickness, in pixels."""
        return HALF_WALL * self.extent

    @cached_property
    def pillars(self) -> shapely.Geometry:
        """The union of the `special` rows, which are no floor, in pixels."""
        return shapely.union_all([row.box for row in self.rows["special"]])

    @cached_property
    def metres_per_pixel(self) -> float:
        """The scale: the median over everything in the plan that has a known size."""
        scales = list(_scales(self))
        return median(scales) if scales else METRES_PER_PIXEL


class BadRow(ValueError):
    """A row that cannot be read: its line, and why."""

    def __init__(self, line: int, problem: str):
        super().__init__(problem)
        self.line = line


def near_copies(file: Path) -> dict[str, str]:
    """Return the representative of each plan that has near copies: the smallest id of its connected component.

    Raises InputError where the file is missing, or a line of it is malformed.
    """
    if not file.is_file():
        raise InputError(
            f"no list of near copies: expected {file}; set data.root to the folder that holds it "
            "(without it, copies of test plans would be trained on)"
        )
    _, *lines = file.read_text(encoding="utf-8", errors="replace").splitlines() or [""]
    pairs = [line.split("\t") for line in lines if line.strip()]
    if wrong := next((pair for pair in pairs if len(pair) != 3), None):
        raise InputError(f"{file}: expected plan_a, plan_b and wall_cosine, with tabs between them; got {wrong[0]!r}")
    return _components((first, second) for first, second, _ in pairs)


def _components(pairs: Iterable[tuple[T, T]]) -> dict[T, T]:
    """Return for every member of `pairs` the smallest member of its connected component."""
    parent: dict[T, T] = {}

    def find(member: T) -> T:
        while parent.setdefault(member, member) != member:
            member = parent[member]
        return member

    for pair in pairs:
        first, second = sorted(map(find, pair))
        parent[second] = first
    return {member: find(member) for member in list(parent)}


def parse(file: Path) -> dict[str, list[Row]]:
    """Return the rows of a plan file by category, with y flipped to point up. Raises BadRow."""
    rows: dict[str, list[Row]] = defaultdict(list)
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise BadRow(1, f"the file cannot be read ({error.strerror})") from None
    for number, text in enumerate(lines, start=1):
        if not text.strip():
            continue
        fields = text.strip().split("\t")
        if len(fields) not in (6, 7):
            raise BadRow(number, "expected x_min, y_min, x_max, y_max, category, d1, d2 with tabs between them")
        if fields[4] not in CATEGORIES:
            raise BadRow(number, "the category is unknown")
        try:
            x0, y0, x1, y1 = map(float, fields[:4])
            style, back = int(fields[5]), int(fields[6]) if len(fields) == 7 else 1
        except ValueError:
            raise BadRow(number, "expected numbers for the corners, d1 and d2") from None
        if not all(abs(value) <= LARGEST for value in (x0, y0, x1, y1)) or back not in FACING:
            raise BadRow(number, f"expected finite corners, at most {LARGEST:g} pixels away, and d2 from 1 to 4")
        rows[fields[4]].append(Row(x0, -y0, x1, -y1, style, back))
    return rows


# From walls to faces -------------------------------------------------------------------------------------------------


def read_plan(file: Path) -> Plan:
    """A plan, its faces (but for those thinner than a wall) and the labels in them. Raises BadRow."""
    rows = parse(file)
    corners = np.array([corner for row in rows["wall"] for corner in row.ends]).reshape(-1, 2)
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


def kind_of(label: str) -> str:
    """The kind of room that a label such as `kitchen-2` names."""
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
    for row in oblique:  # their ends go to the nearest corner, else wall, if one is near
        ends = []
        for end in map(Point, row.ends):
            to = min(corners, key=end.distance, default=end)
            if end.distance(to) > near:
                to = Point(shapely.shortest_line(straight, end).coords[0]) if end.distance(straight) <= near else end
            ends.append(to)
        corners += ends
        lines.append(LineString(ends))
    return lines


def _aligned(runs: list[Run], slack: float, near: float) -> list[Run]:
    """Move parallel walls that touch each other to one line: their mean, weighted by length."""
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
    """Move the ends of walls to the nearest of the perpendicular walls `crossing`, where one is near."""

    def moved(end: float, across: float) -> float:
        walls = [c for c, lo, hi in crossing if abs(c - end) <= near and lo - near <= across <= hi + near]
        return min(walls, key=lambda c: abs(c - end), default=end)

    return [(c, moved(lo, c), moved(hi, c)) for c, lo, hi in runs]


# What a face holds ---------------------------------------------------------------------------------------------------


def inner_area(plan: Plan, face: int) -> Polygon:
    """Return the indoor area: the face less half a wall and the pillars, without parts thinner than a wall.

    Of several parts it is the largest; it is empty where none is left.
    """
    half = plan.half_wall
    area = plan.faces[face].buffer(-half, join_style="mitre").difference(plan.pillars)
    parts = shapely.get_parts(area.buffer(-half, join_style="mitre").buffer(half, join_style="mitre"))
    largest = max(parts, key=lambda part: part.area, default=Polygon())
    # Normalised first: a ring that starts at its lowest left point starts at a true corner.
    return orient(largest.normalize().simplify(CORNER))


def openings_in(plan: Plan, face: int, inner: Polygon) -> Iterator[FaceOpening]:
    """The doors and windows in the walls of a face, each clipped to the wall that it lies in."""
    corners = np.array(inner.exterior.coords)
    lengths = np.hypot(*np.diff(corners, axis=0).T)
    along = np.diff(corners, axis=0) / lengths[:, None]
    outward = np.stack((along[:, 1], -along[:, 0]), axis=1)
    thickness = 2 * plan.half_wall
    for row in plan.rows["door"]:
        from_corner = np.array(row.ends) - corners[:-1, None]  # (walls, two ends, xy)
        reach = np.einsum("wex,wx->we", from_corner, along).clip(0, lengths[:, None])
        start, stop = reach.min(axis=1), reach.max(axis=1)
        aside = np.abs(np.einsum("wex,wx->we", from_corner, outward) - plan.half_wall).max(axis=1)
        fits = (aside <= _slack(SNAP_END, plan.extent)) & (stop - start >= thickness)
        if not fits.any():
            continue
        wall = np.where(fits, stop - start - aside, -np.inf).argmax()
        p, q = (corners[wall] + position[wall] * along[wall] for position in (start, stop))
        across = outward[wall] * thickness
        # Look at three depths, in wall thicknesses, since a sliver may lie between.
        behind = (_face_at(plan, *((p + q) / 2 + depth * across)) for depth in (1, 1.5, 2))
        beyond = next((other for other in behind if other is not None), None)
        if beyond == face:
            continue
        near = _slack(ENTRANCE, plan.extent)
        entrance = any(row.line.distance(entrance.box) <= near for entrance in plan.rows["entrance"])
        yield FaceOpening(
            "window" if beyond is None and not entrance else "door",
            Polygon((p, p + across, q + across, q)),
            [] if beyond is None else plan.labels[beyond],
            row,
        )


def icons_in(plan: Plan, face: int) -> list[tuple[str, Row]]:
    """Return (category, row) of the icons that lie by more than half in a face; of one drawn twice, the larger."""
    found: list[tuple[str, Row]] = []
    for category in ICONS:
        for row in sorted(plan.rows[category], key=lambda row: -row.box.area):
            shape = row.box
            twins = [other.box for name, other in found if (name, other.style) == (category, row.style)]
            if shape.intersection(plan.faces[face]).area > shape.area / 2 and not is_drawn_before(shape, twins):
                found.append((category, row))
    return found


def _scales(plan: Plan) -> Iterator[float]:
    """Yield metres per pixel, once for everything in a plan that has a known size."""
    for face, labels in enumerate(plan.labels):
        kinds = set(map(kind_of, labels))
        kind = kinds.pop() if len(kinds) == 1 else ""
        if kind not in DOOR_WIDTH or (inner := inner_area(plan, face)).is_empty:
            continue
        x0, y0, x1, y1 = inner.bounds
        sides = sorted((x1 - x0, y1 - y0))
        yield from (known / side for known, side in zip(ROOM_SIZE.get(kind, ()), sides, strict=False))
        for opening in openings_in(plan, face, inner):
            # Only hinged doors between rooms: those of closets and balconies are wider.
            between_rooms = not {"closet", "balcony"}.intersection(map(kind_of, opening.beyond))
            if opening.kind == "door" and opening.drawn.style in HINGED and between_rooms:
                yield DOOR_WIDTH[kind] / opening.drawn.line.length
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
