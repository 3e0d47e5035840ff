"""Rooms for tests: small ones to work out by hand, and random ones for properties; and what is asked of many."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch
from hypothesis import strategies as st
from shapely.affinity import rotate
from shapely.geometry import Polygon, box

from layoutrl.agents.gains import WIDENED, rescaled
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.measures import Measures, measured
from layoutrl.env.reward import REWARD_SCALE
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.oracle import perfect_values
from layoutrl.rooms.faults import faults
from layoutrl.rooms.room import MAIN_ITEM, WALL_THICKNESS, Item, Opening, Ring, Room, wall_band


def rectangle(x0: float, y0: float, x1: float, y1: float) -> Ring:
    """The ring of an upright rectangle, counter-clockwise from its lower left corner."""
    return ((x0, y0), (x1, y0), (x1, y1), (x0, y1))


def opening(kind: str, x0: float, y0: float, x1: float, y1: float) -> Opening:
    """A door or a window that is an upright rectangle."""
    return Opening(kind, rectangle(x0, y0, x1, y1))


def room_of(outline: Ring, item: Item, others: tuple[Item, ...] = (), **fields: Any) -> Room:
    """A room with a 0.2 m wall band, in which `item` moves; `fields` are those of Room."""
    holes, openings = fields.pop("holes", ()), fields.pop("openings", ())
    walls = fields.pop("walls", None)
    return Room(
        id=fields.pop("id", "room"),
        room_type=fields.pop("room_type", "bedroom"),
        outline=outline,
        walls=wall_band(outline, holes, openings) if walls is None else walls,
        openings=openings,
        furniture=(item, *others),
        target=fields.pop("target", 0),
        holes=holes,
        **fields,
    )


def rectangular_room(width: float = 4.0, depth: float = 3.0, item: Item | None = None, **fields: Any) -> Room:
    """A room from (0, 0) to (width, depth); its item, 1 m square, stands in the middle unless another is given.

    `others`, `openings`, `holes`, `walls` and further fields of Room may follow.
    """
    item = item or Item("bed", (1.0, 1.0), (width / 2, depth / 2))
    return room_of(rectangle(0.0, 0.0, width, depth), item, **fields)


L_OUTLINE: Ring = ((0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (2.0, 2.0), (2.0, 4.0), (0.0, 4.0))


def l_room(item: Item | None = None, **fields: Any) -> Room:
    """An L of 4 m by 4 m whose two arms are 2 m wide; the inner corner is at (2, 2)."""
    return room_of(L_OUTLINE, item or Item("bed", (1.0, 1.0), (1.0, 1.0)), **fields)


def random_outline(rng: np.random.Generator) -> tuple[Ring, tuple[Ring, ...]]:
    """(outline, holes): a rectangle with plain, bevelled or notched corners, perhaps a bump or a column."""
    width, depth = rng.uniform(3, 6, 2)
    points: list[tuple[float, float]] = []
    for cx, cy, first_along_x in ((0, 0, False), (width, 0, True), (width, depth, False), (0, depth, True)):
        a, b = rng.uniform(0.1, 0.4, 2) * (width, depth)
        ax, by = (a if cx == 0 else width - a), (b if cy == 0 else depth - b)
        on_x_side, on_y_side = (ax, cy), (cx, by)  # where the cut meets the two sides
        ends = [on_x_side, on_y_side] if first_along_x else [on_y_side, on_x_side]
        kind = rng.integers(3)
        points += [(cx, cy)] if kind == 0 else ends if kind == 1 else [ends[0], (ax, by), ends[1]]
        if cx == 0 and cy == 0 and rng.random() < 0.4:  # the next side runs to the right: let it bump into the room
            left, right, height = 0.42 * width, 0.58 * width, rng.uniform(0.1, 0.5) * depth
            points += [(left, 0), (left, height), (right, height), (right, 0)]
    holes = []
    if rng.random() < 0.4:
        holes.append(box(0.5 * width - 0.12, 0.75 * depth - 0.2, 0.5 * width + 0.15, 0.75 * depth + 0.1))
    angle = rng.choice([0.0, 0.0, 90.0])
    outline, *columns = (rotate(p, angle, origin=(0, 0)) if angle else p for p in (Polygon(points), *holes))
    return _ring(outline), tuple(_ring(column)[::-1] for column in columns)


def random_openings(rng: np.random.Generator, outline: Ring, count: int) -> tuple[Opening, ...]:
    """Up to `count` doors and windows in the band of upright walls, none over another; doors come first."""
    room, taken, openings = Polygon(outline), Polygon(), []
    for _ in range(count):
        k = rng.integers(len(outline))
        start, end = np.array(outline[k]), np.array(outline[(k + 1) % len(outline)])
        length = math.dist(start, end)
        size = rng.uniform(0.5, 1.2)
        if size + 0.2 > length or (end - start).all():
            continue
        along = (end - start) / length
        out = np.array((along[1], -along[0])) * WALL_THICKNESS  # the right hand of a counter-clockwise side
        a = start + along * rng.uniform(0.1, length - size - 0.1)
        b = a + along * size
        ring = tuple((float(x), float(y)) for x, y in (a, a + out, b + out, b))
        if Polygon(ring).intersection(room).area < 1e-9 and not Polygon(ring).intersects(taken):
            taken = taken.union(Polygon(ring))
            openings.append(Opening(("door", "window")[rng.integers(2)], ring))
    return tuple(sorted(openings, key=lambda door_or_window: door_or_window.kind))


def random_item(rng: np.random.Generator, category: str) -> Item:
    """A rectangle or circle of 0.2 to 1.4 m a side, upright or turned by any angle; not placed yet."""
    if rng.random() < 0.2:
        diameter = float(rng.uniform(0.3, 1.0))
        return Item(category, (diameter, diameter), form="circle")
    rotation = float(rng.choice([0.0, 90.0, 180.0, 270.0, rng.uniform(0, 360)]))
    return Item(category, tuple(map(float, rng.uniform(0.2, 1.4, 2))), rotation=rotation)


def random_room(rng: np.random.Generator, **fields: Any) -> Room:
    """A room of any type: concave outline, doors, windows, up to five items in the envelope; the first moves.

    Items stand at any angle, walls are upright or bevelled; doors and windows are in upright walls.
    """
    outline, holes = random_outline(rng)
    openings = random_openings(rng, outline, int(rng.integers(4)))
    room_type = str(rng.choice(list(MAIN_ITEM)))
    categories = [MAIN_ITEM[room_type], "chair", "wardrobe", "shower", "shelf"][: int(rng.integers(1, 6))]
    bare = room_of(outline, Item("none", (1, 1)), holes=holes, openings=openings)
    placed = tuple(_placed(rng, random_item(rng, category), bare) for category in categories)
    fields = {"id": f"random-{rng.integers(1 << 30)}", "room_type": room_type} | fields
    return room_of(outline, placed[0], placed[1:], holes=holes, openings=openings, walls=bare.walls, **fields)


def random_brief(rng: np.random.Generator, room: Room) -> Room:
    """The room with some of its items to be placed, at least one; of some of these the rotation is given."""
    to_place = rng.random(len(room.furniture)) < 0.7
    to_place[rng.integers(len(to_place))] = True
    items = [
        replace(item, center=None, rotation=item.rotation if rng.random() < 0.3 else None) if taken else item
        for item, taken in zip(room.furniture, to_place, strict=True)
    ]
    return replace(room, furniture=tuple(items), target=None)


def rooms(**fields: Any) -> st.SearchStrategy[Room]:
    """Hypothesis strategy of random rooms; the seed that failed is what it prints."""
    return st.integers(0, 2**32 - 1).map(lambda seed: random_room(np.random.default_rng(seed), **fields))


def _placed(rng: np.random.Generator, item: Item, room: Room) -> Item:
    x0, y0, x1, y1 = room.envelope.bounds
    while True:
        center = (float(rng.uniform(x0, x1)), float(rng.uniform(y0, y1)))
        if room.envelope.covers(item.footprint_at(center)):
            return Item(item.category, item.size, center, item.rotation, item.form)


def _ring(polygon: Polygon) -> Ring:
    ring = tuple((float(x), float(y)) for x, y in polygon.exterior.coords[:-1])
    return ring if polygon.exterior.is_ccw else ring[::-1]


def destinations(batch: BatchSimulator, room: np.ndarray, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where every action leads (B, A, 2), and whether it is legal (B, A), like Simulator.destinations."""
    at = torch.tensor(position)
    length, legal = batch.reach(torch.tensor(room), at)
    reached = [batch.moved(room, at, torch.full((len(room),), a), length[:, a]) for a in range(batch.moves.count)]
    return torch.stack(reached, 1).numpy(), legal.numpy()


def assert_seeded(weights: Callable[[int], torch.Tensor]) -> None:
    """What is made of a seed hangs on it, on no other randomness, and leaves torch's global generator alone."""
    torch.manual_seed(3)
    state = torch.get_rng_state()
    first = weights(0)
    assert torch.equal(torch.get_rng_state(), state)
    torch.manual_seed(4)
    assert torch.equal(first, weights(0))
    assert not torch.equal(first, weights(1))


def small_rooms() -> list[Room]:
    """Two in which an item is home after a few moves."""
    return [rectangular_room(2.4, 2.0, Item("bed", (0.6, 0.8), (0.3, 0.4)), id="a"), l_room(id="b")]


def learned_gains(q: torch.Tensor, legal: torch.Tensor) -> torch.Tensor:
    """What a network has learned that knows what each move gains (B, A): on its scale, the gap to the best widened."""
    scaled = rescaled(q)
    best = scaled.masked_fill(~legal, -torch.inf).amax(1, keepdim=True)
    return best - (best - scaled) / (1 - WIDENED)


def perfect_at_gains(simulator: Simulator, discount: float) -> Callable[[torch.Tensor], torch.Tensor]:
    """The optimal values of the paper's reward in room 0, as they are learned when each move pays what it gains."""

    def values(place: torch.Tensor) -> torch.Tensor:
        index = np.zeros(len(place), int)
        q = perfect_values(simulator, index, place.numpy(), discount, dtype=torch.float64)
        stands = simulator.reward(index, place.numpy()).total / REWARD_SCALE
        legal = torch.tensor(simulator.destinations(index, place.numpy())[1])
        return learned_gains(torch.tensor((1 - discount) * q - stands[:, None]), legal).float()

    return values


DOOR = opening("door", -0.2, 1.0, 0.0, 2.0)
MEASURES = [field.name for field in fields(Measures) if field.name != "group"]


def room_with(*items: Item, **fields: Any) -> Room:
    """4 m by 3 m, a door in the left wall from y = 1 to 2."""
    return rectangular_room(4.0, 3.0, items[0], others=items[1:], **{"openings": (DOOR,)} | fields)


def of(layout: Room, designed: Room | None = None) -> SimpleNamespace:
    """All measures of one room, as numbers."""
    found = measured([layout], [designed or layout])
    return SimpleNamespace(**{name: getattr(found, name)[0] for name in MEASURES})


def named(layout: Room, fault: str) -> list[int]:
    """The items with this fault."""
    return [k for k, name in faults(layout) if name == fault]


def shaken(room: Room, seed: int, lost: float = 0.2) -> Room:
    """The items half a metre or so away, some turned by a quarter, some not placed."""
    rng = np.random.default_rng(seed)
    items = []
    for item in room.furniture:
        center = tuple(np.add(item.center, rng.normal(0, 0.4, 2)))
        turned = replace(item, center=center, rotation=item.rotation + 90 * rng.integers(4))
        items.append(replace(item, center=None, rotation=None) if rng.random() < lost else turned)
    return replace(room, furniture=tuple(items))
