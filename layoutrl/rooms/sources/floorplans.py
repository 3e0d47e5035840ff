"""Real bathrooms and kitchens: the floor plans of Raster-to-Vector (Liu et al., ICCV 2017).

Rooms are the faces that a plan's walls enclose, inset by half a wall and scaled by what has a known size.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Literal

import numpy as np
from shapely.geometry import Polygon

from layoutrl import InputError
from layoutrl.rooms.collection import Collection
from layoutrl.rooms.room import Item, Opening, Ring, Room, is_drawn_before, sole, wall_band
from layoutrl.rooms.sources.plans import (
    BASIN,
    DASHED,
    FACING,
    WET_ROOMS,
    BadRow,
    Plan,
    icons_in,
    inner_area,
    kind_of,
    near_copies,
    openings_in,
    read_plan,
)

MAIN_ITEM = {"bathroom": "bathtub", "kitchen": "counter"}  # the items that move by default here

PLANS = Path("data/floorplan_representation")
NEAR_COPIES = "near_duplicates.tsv"
TYPE_OF = {**dict.fromkeys(WET_ROOMS, "bathroom"), "kitchen": "kitchen"}
DIGITS = 4  # corners are rounded to a tenth of a millimetre

# The rule of labels=snapped, in metres.
SNAP_GAP = 0.12
CENTRE_GAP = 0.07
TOILET_SIDE_GAP = 0.04

Bounds = tuple[float, float, float, float]  # x_min, y_min, x_max, y_max


def read(root: Path, room_type: str, labels: Literal["snapped", "raw"] = "snapped") -> Collection:
    """All rooms of `room_type` ("bathroom" or "kitchen") under `root`, in metres, y up.

    Bath rooms, toilet rooms and washing rooms are bathrooms; the id tells which: `<plan>#restroom-1`. `labels`
    says where the furniture stands: "raw" as drawn, "snapped" without the slack of the drawing (`_snapped`). Snapping
    edits the truth, so every number has to say which labels it uses. Plans that are near copies of each other share a
    `group`.

    A plan with a bad row is left out as a whole, since it may lack a wall. Raises InputError for a room type that
    the source does not have, for other labels and for a root without its files.
    """
    if room_type not in MAIN_ITEM:
        raise InputError(f"room: expected {' or '.join(MAIN_ITEM)} for data=floorplans; got {room_type}")
    if labels not in ("snapped", "raw"):
        raise InputError(f"data.labels: expected snapped or raw; got {labels}")
    folder = Path(root) / PLANS
    files = sorted(folder.rglob("*.txt"), key=lambda file: file.parts)  # the same order on all systems
    if not files:
        raise InputError(f"no floor plans: expected .txt files under {folder}; set data.root to the folder above data/")
    group_of = near_copies(Path(root) / NEAR_COPIES)
    collection = Collection(f"floorplans, labels={labels}")
    for file in files:
        plan_id = file.relative_to(folder).with_suffix("").as_posix()
        try:
            plan = read_plan(file)
        except BadRow as error:
            collection.left_out.append((f"{file}:{error.line}", f"the plan has a bad row: {error}"))
            continue
        for label in plan.unplaced:
            if TYPE_OF.get(kind_of(label)) == room_type:
                collection.left_out.append((f"{plan_id}#{label}", "its label lies in no closed face"))
        for face, found in enumerate(plan.labels):
            own = [label for label in found if TYPE_OF.get(kind_of(label)) == room_type]
            if own:
                room_id = f"{plan_id}#{own[0]}"
                room = _room(room_id, plan, face, room_type, labels == "snapped", group_of.get(plan_id, plan_id))
                if isinstance(room, Room):
                    collection.rooms.append(room)
                else:
                    collection.left_out.append((room_id, room))
    return collection


def _room(room_id: str, plan: Plan, face: int, room_type: str, snapped: bool, group: str) -> Room | str:
    """Return the room in a face, or the reason why it cannot be used."""
    if len(set(map(kind_of, plan.labels[face]))) > 1:
        return "open plan: several kinds of room share the face"
    inner = inner_area(plan, face)
    if inner.is_empty:
        return "the face is thinner than its walls"
    icons = icons_in(plan, face)
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
    for in_plan in openings_in(plan, face, inner):
        opening = Opening(in_plan.kind, metres(in_plan.shape.exterior.coords))
        if not is_drawn_before(opening.shape, [other.shape for other in openings]):
            openings.append(opening)
    drawn, moved = [], []
    for category, row in icons:
        name = _item_name(category, row.style, room_type)
        bounds: Bounds = Polygon(metres(row.box.exterior.coords)).bounds
        facing = FACING[_back(bounds, row.back, name, (outline, *holes))]
        drawn.append(_item(name, bounds, facing))
        moved.append(_item(name, _snapped(bounds, name == "toilet", (outline, *holes)), facing))
    room = Room(
        id=room_id,
        room_type=room_type,
        outline=outline,
        walls=wall_band(outline, holes, tuple(openings), 2 * plan.half_wall * scale),
        openings=tuple(openings),
        furniture=tuple(moved if snapped else drawn),
        target=sole(drawn, MAIN_ITEM[room_type]),
        holes=holes,
        group=group,
    )
    # Check both label sets, so that they hold the same rooms.
    if not all(room.holds(item) for item in drawn + moved):
        return "its furniture reaches beyond the outer walls"
    return room


def _item_name(category: str, style: int, room_type: str) -> str:
    """Return the category of an icon.

    A washing_basin is a vanity or a washing machine by its style; a dashed one is a fridge in kitchens.
    """
    if category != "washing_basin":
        return {"cooking_counter": "counter"}.get(category, category)
    if style == BASIN:
        return "vanity"
    return "fridge" if style == DASHED and room_type == "kitchen" else "washing_machine"


def _item(name: str, bounds: Bounds, rotation: float) -> Item:
    x0, y0, x1, y1 = bounds
    along_x, along_y = round(x1 - x0, DIGITS), round(y1 - y0, DIGITS)
    size = (along_x, along_y) if rotation % 180 == 0 else (along_y, along_x)
    return Item(name, size, (round((x0 + x1) / 2, DIGITS + 1), round((y0 + y1) / 2, DIGITS + 1)), rotation)


def _back(bounds: Bounds, drawn: int, name: str, rings: tuple[Ring, ...]) -> int:
    """Return the side of an icon's back, a key of FACING: as drawn for toilets and basins, else nearest to a wall.

    For a bathtub or a counter, whose back is a long side, the drawing tells only the axis; for an appliance it
    mostly tells nothing.
    """
    if name in ("toilet", "vanity"):
        return drawn
    left, right = _spaces(bounds, 0, rings)
    bottom, top = _spaces(bounds, 1, rings)
    spaces = {1: bottom, 2: left, 3: top, 4: right}
    if name in ("bathtub", "counter"):
        wide = bounds[2] - bounds[0] >= bounds[3] - bounds[1]
        spaces = {side: space for side, space in spaces.items() if (side in (1, 3)) == wide}
    return min(spaces, key=lambda side: (abs(spaces[side]), side != drawn))


def _snapped(bounds: Bounds, toilet: bool, rings: tuple[Ring, ...]) -> Bounds:
    """Return an icon's bounds without the slack of the drawing, by a fixed rule that looks at icon and room only.

    An icon is moved flush to a near wall, or stretched between two; a toilet is centred between those at its sides.
    """
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
    """Return the signed distances of an icon's lower and upper side to the nearest wall that faces it, or inf."""
    below, above = [math.inf], [math.inf]
    for ring in rings:
        for p, q in zip(ring, ring[1:] + ring[:1], strict=True):
            start, stop = sorted((p[1 - axis], q[1 - axis]))
            overlap = min(stop, bounds[3 - axis]) - max(start, bounds[1 - axis])
            if p[axis] != q[axis] or overlap <= SNAP_GAP:  # oblique, or facing the icon by no more than the slack
                continue
            # The indoor area lies on the left of an edge, so the edge's direction tells which side it bounds.
            if (q[1 - axis] > p[1 - axis]) == (axis == 1):
                below.append(bounds[axis] - p[axis])
            else:
                above.append(p[axis] - bounds[axis + 2])
    return min(below, key=abs), min(above, key=abs)
