"""Convert elements of a Sweet Home 3D home to floors, walls, openings and pieces of furniture; metres, y up."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry import LineString, Polygon

from layoutrl.rooms.categories import DESIGNED, Names, plain
from layoutrl.rooms.room import FILM, TOLERANCE, Item
from layoutrl.rooms.sources.drawn import FLATTEST, Piece
from layoutrl.rooms.sources.floors import floor_of
from layoutrl.rooms.sources.home_xml import GROUP, OPENING, PIECES, Element, within
from layoutrl.rooms.sources.walls import DrawnOpening, Wall, oblong

HIGHEST = 0.4  # metres: what hangs higher in a home is in nobody's way
HUNG = 1.2  # metres, instead of HIGHEST, for furniture of bathrooms: it hangs on their walls
FLAT = ("bathtub", "shower")  # count as furniture however low they are
STEP, HEADROOM = 0.1, 1.8  # metres: a window that begins below STEP and is at least HEADROOM high is walked through
TOP = 0.02  # metres by which what stands on a piece may be off its top
ALIKE = 0.02  # metres by which width and depth of what is round may differ
# In names of what lies in a piece, below its highest part.
CUSHIONS = (
    *("pillow", "cushion", "kissen", "coussin", "oreiller", "cojin", "almohada", "cuscin", "almofad", "kussen", "枕"),
)
ARC_STEP = math.radians(15)  # at most, between corners of round walls
WINDOWS = (  # words for it in the languages of furniture names, anywhere in a name
    "window", "bay", "shutter", "fenster", "fenetre", "ventana", "finestra", "janela", "raam", "venster", "窗",
)  # fmt: skip
ROUND = re.compile(r"\b(round|rund|rond|redond|rotond|tond)|圆(?!角)")  # in these languages, at the start of a word


@dataclass(frozen=True)
class HomePiece(Piece):
    """A piece of furniture of a home, and its element in the file.

    `on` are the elements that stand on it and move with it. `level` is the id of the level that it moves to, "" for one
    without an id; None if it stays on its level.
    """

    element: Element
    on: tuple[Element, ...] = ()
    level: str | None = None

    @property
    def may_move(self) -> bool:
        """Whether the home lets it move: parts of the building may not."""
        return self.element.flag("movable", True)

    @property
    def stood(self) -> Item:
        """The item as the home has it; without a pose if it stood on another level than that of its room."""
        return self.item if self.level is None else replace(self.item, center=None, rotation=None)


def traced(element: Element) -> Polygon:
    """The floor of a room as it is drawn. Raises RoomError where it has none."""
    return floor_of([(p.number("x") / 100, -p.number("y") / 100) for p in element.inside if p.tag == "point"])


def walls_of(element: Element) -> list[Wall]:
    """Return a wall around its centre line, a polyline if it is round; nothing for a threshold.

    An end at which another wall goes on is extended by half the thickness.
    """
    start = np.array((element.number("xStart"), -element.number("yStart"))) / 100
    end = np.array((element.number("xEnd"), -element.number("yEnd"))) / 100
    thickness = element.number("thickness") / 100
    length = float(np.hypot(*(end - start)))
    height = element.number("height", 100.0)
    height = max(height, element.number("heightAtEnd", height)) / 100
    if min(thickness, length) < FILM or height < FLATTEST:  # thresholds are drawn as walls, too
        return []
    arc = -element.number("arcExtent", 0.0)  # y is up here
    points = [start, end] if abs(arc) < 1e-3 else _arc(start, end, arc)
    first, last = points[1] - points[0], points[-1] - points[-2]
    if "wallAtStart" in element.attributes:
        points[0] = points[0] - first / np.hypot(*first) * thickness / 2
    if "wallAtEnd" in element.attributes:
        points[-1] = points[-1] + last / np.hypot(*last) * thickness / 2
    body = LineString(points).buffer(thickness / 2, cap_style="flat", join_style="mitre")
    return [Wall(part, thickness) for part in shapely.get_parts(body) if isinstance(part, Polygon)]


def _arc(start: np.ndarray, end: np.ndarray, extent: float) -> list[np.ndarray]:
    """Return points along a round wall, y up.

    Where `extent` (radians) is positive, it turns counter-clockwise from start to end, around a centre on its left.
    """
    half = max(-math.pi + 1e-3, min(math.pi - 1e-3, extent / 2))
    middle, along = (start + end) / 2, (end - start) / 2
    center = middle + np.array((-along[1], along[0])) / math.tan(half)
    turns = np.linspace(0, 2 * half, max(3, 1 + math.ceil(abs(2 * half) / ARC_STEP)))
    x, y = start - center
    turned = np.array((x * np.cos(turns) - y * np.sin(turns), x * np.sin(turns) + y * np.cos(turns)))
    return list(center + turned.T)


def visible(element: Element) -> Iterator[Element]:
    """Yield an element and its descendants, without invisible ones and what is in these."""
    if element.flag("visible", True):
        yield element
        for inner in element.inside:
            yield from visible(inner)


def opens(element: Element) -> bool:
    """Whether an element is a door or window: imported ones may be pieces with a flag for it."""
    return element.tag == OPENING or element.flag("doorOrWindow", False)


def openings_of(element: Element) -> list[DrawnOpening]:
    """Return the part of a door or window that lies in its wall, without an open leaf or a sill of the model.

    The list is empty where that part is too small.
    """
    width, depth = element.number("width") / 100, element.number("depth") / 100
    wide, deep = element.number("wallWidth", 1.0), element.number("wallThickness", 1.0)
    if min(width * wide, depth * deep) < TOLERANCE:
        return []
    across = width * (element.number("wallLeft", 0.0) + wide / 2 - 0.5)
    across *= -1 if element.flag("modelMirrored", False) else 1
    back = depth * (element.number("wallDistance", 0.0) + deep / 2 - 0.5)
    angle = element.number("angle", 0.0)
    x = element.number("x") / 100 + across * math.cos(angle) - back * math.sin(angle)
    y = element.number("y") / 100 + across * math.sin(angle) + back * math.cos(angle)
    words = " ".join(filter(None, element.names)).casefold().replace("ê", "e")
    elevation, height = element.number("elevation", 0.0) / 100, element.number("height", 0.0) / 100
    window = any(word in words for word in WINDOWS) and not (elevation < STEP and height >= HEADROOM)
    high = elevation > HIGHEST
    shape = oblong(x, -y, width * wide, depth * deep, -math.degrees(angle))
    middle, to_side = np.array((x, -y)), width * wide / 2 * np.array((math.cos(angle), -math.sin(angle)))
    axis = LineString((middle - to_side, middle + to_side))
    return [DrawnOpening("window" if window or high else "door", shape, axis)]


def find_supports(elements: list[Element], carried: set[int], standing_on: dict[int, list[Element]]) -> None:
    """Find which pieces others carry: add these to `carried`, and to `standing_on` those that stand on each.

    Both know pieces by `Element.start`. A piece is carried if its centre is over another that begins lower and reaches
    up to it. It stands on that one if it begins no lower than its top, or than its `dropOnTopElevation`: of several, on
    the largest. One of the CUSHIONS that stands on none lies in the smallest that it begins within. It moves with that
    piece only if the home lets it move.
    """

    def all_of(name: str, otherwise: float | None = None) -> np.ndarray:
        return np.array([element.number(name, otherwise) for element in elements])

    width, depth, middle = all_of("width"), all_of("depth"), all_of("x") + 1j * all_of("y")
    turn = np.exp(-1j * all_of("angle", 0.0))
    low = all_of("elevation", 0.0) / 100
    high, share = low + all_of("height", 100.0) / 100, all_of("dropOnTopElevation", 1.0)
    top = np.where((share > 0) & (share < 1), low + share * (high - low), high)
    host, hung = np.full(len(elements), -1), np.zeros(len(elements), bool)
    within = host.copy()
    for k in np.argsort(width * depth, kind="stable"):  # the largest last, which wins: a piece stands on one alone
        off = (middle - middle[k]) * turn[k]
        over = (abs(off.real) <= width[k] / 2) & (abs(off.imag) <= depth[k] / 2)
        reached = over & (low > low[k]) & (low < high[k] + TOP)
        hung |= reached
        host[reached & (low > max(top[k] - TOP, FLATTEST))] = k
        within[reached & (within < 0)] = k
    names = (plain(" ".join(filter(None, element.names))) for element in elements)
    cushion = np.array([any(word in name for word in CUSHIONS) for name in names], dtype=bool)
    lies = cushion & (host < 0) & (low > FLATTEST)
    host[lies] = within[lies]
    carried |= {elements[k].start for k in np.flatnonzero(hung)}
    for element, k in zip(elements, host, strict=True):
        if k >= 0 and element.flag("movable", True):
            standing_on.setdefault(elements[k].start, []).append(element)


def all_standing_on(start: int, standing_on: Mapping[int, list[Element]]) -> list[Element]:
    """Return what stands on a piece, directly or on what stands on it."""
    found = [*standing_on.get(start, ())]
    for each in found:  # also those that are added here
        found += standing_on.get(each.start, ())
    return found


def piece_of(element: Element, names: Names, carried: bool, resting: bool) -> HomePiece | None:
    """Return a piece that stands on the floor, or None. One that is `resting` on another counts if it is furniture.

    A group is one piece, its bounding box, called by its own name or, if that is unknown, as its largest known part.
    What hangs over the floor of bathrooms is in the way there, unless it is `carried` by another piece. Bathtubs and
    shower trays count however low they are: they are no rugs.
    """
    elevation, height = element.number("elevation", 0.0) / 100, element.number("height", 100.0) / 100
    inner = [e for e in within(element) if e.tag in PIECES and not opens(e)]
    if element.tag == GROUP and not inner:  # a group of doors and windows
        return None
    width = element.number("widthInPlan", element.number("width")) / 100
    depth = element.number("depthInPlan", element.number("depth")) / 100
    if min(width, depth) < TOLERANCE:
        return None
    parts = sorted(inner, key=lambda e: -e.number("width") * e.number("depth"))
    called = next((part for part in (element, *parts) if names.knows(*part.names)), element)
    kind = names.kind(*called.names)
    highest = HUNG if kind in DESIGNED["bathroom"] and height >= FLATTEST and not carried else HIGHEST
    if elevation > highest or (height < FLATTEST and kind not in FLAT) or (resting and kind is None):
        return None
    found = names.category(*called.names)
    if found is None:
        return None
    category, known = found
    round_ = abs(width - depth) < ALIKE and any(ROUND.search(plain(name or "")) for name in element.names)
    center = (element.number("x") / 100, -element.number("y") / 100)
    rotation = (270 - math.degrees(element.number("angle", 0.0))) % 360
    size = ((width + depth) / 2,) * 2 if round_ else (depth, width)
    return HomePiece(Item(category, size, center, rotation, "circle" if round_ else "rectangle"), known, element)
