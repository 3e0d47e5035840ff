"""Costs worked out for many layouts at once are those of polygons, one by one."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.rivals.rooms.annealer import Annealing
from layoutrl.rivals.rooms.cost import FAULT, PREFERENCES, RULES, Cost
from layoutrl.rivals.rooms.relations import Relations, mine
from layoutrl.rivals.rooms.scene import daylight, keep_free, scene_of
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.clearances import FRONT_DEPTH, MAY_STAND_BEFORE, RAISED, may_share_floor
from layoutrl.rooms.room import TOLERANCE, Item, Room
from tests.builders import random_room, rectangular_room
from tests.rivals.rooms.builders import configured, designed, random_poses

NOTHING = Relations({}, {}, frozenset({"wardrobe"}), 0.5)
WEIGHTS = configured(Annealing, "annealer").weights


def fault(a: shapely.Polygon, b: shapely.Polygon) -> float:
    """How deep two upright boxes are in each other, and FAULT where it is no noise."""
    shared = a.intersection(b)
    if shared.area == 0:
        return 0.0
    x0, y0, x1, y1 = shared.bounds
    deep = min(x1 - x0, y1 - y0)
    return deep + FAULT * (deep > TOLERANCE)


def slow_faults(layout: Room, solids, doors, windows) -> dict[str, float]:
    """The faults of a layout in an upright room, a pair at a time."""
    items = layout.furniture
    boxes = [shapely.box(*item.footprint.bounds) for item in items]
    found = dict.fromkeys(("outside", "overlap", "doors", "daylight", "fronts"), 0.0)
    for i, item in enumerate(items):
        found["outside"] += sum(fault(boxes[i], solid) for solid in solids)
        found["doors"] += sum(fault(boxes[i], door) for door in doors)
        if item.category in NOTHING.tall:
            found["daylight"] += sum(fault(boxes[i], window) for window in windows)
        for j in range(i):
            found["overlap"] += 0 if may_share_floor(item, items[j]) else fault(boxes[i], boxes[j])
        depth = FRONT_DEPTH.get(item.category, 0)
        if depth and item.form == "rectangle":
            x0, y0, x1, y1 = boxes[i].bounds
            sides = {0: (x1, y0, x1 + depth, y1), 90: (x0, y1, x1, y1 + depth)}
            sides |= {180: (x0 - depth, y0, x0, y1), 270: (x0, y0 - depth, x1, y0)}
            front = shapely.box(*sides[int(item.degrees) % 360])
            found["fronts"] += sum(fault(front, solid) for solid in solids)
            for j, other in enumerate(items):
                welcome = other.category in RAISED or other.category in MAY_STAND_BEFORE.get(item.category, ())
                found["fronts"] += 0 if j == i or welcome else fault(front, boxes[j])
    return found


@given(st.integers(0, 2**32 - 1))
def test_faults_are_those_of_polygons(seed):
    rng = np.random.default_rng(seed)
    scene = scene_of(brief_of(random_room(rng)))
    if scene.base:
        return
    cost = Cost(scene, NOTHING, WEIGHTS)
    center, quarter = random_poses(scene, rng, 3)
    found = cost.faults(center, quarter, cost.boxes(center, quarter))
    zones = [[shapely.box(*box) for box in boxes] for boxes in (scene.solids, keep_free(scene, 0.5), daylight(scene))]
    for c in range(3):
        slow = slow_faults(scene.layout(center[c], quarter[c]), *zones)
        for name, value in slow.items():
            np.testing.assert_allclose(found[name][c], value, atol=1e-6, err_msg=name)


def test_the_designer_breaks_no_rule():
    for room_type in ("bedroom", "dining_room", "kitchen"):
        rooms = designed(room_type, 8)
        clear = mine(rooms)
        for room in rooms:
            scene = scene_of(room)
            cost = Cost(scene, clear, WEIGHTS)
            center, quarter = scene.center[None], scene.quarter[None]
            found = cost.faults(center, quarter, cost.boxes(center, quarter))
            assert sum(found.values()) < 1e-6, (room.id, found)


@given(st.integers(0, 2**32 - 1))
def test_the_order_of_the_list_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    rooms = designed("dining_room", 4)
    room, relations = rooms[seed % 4], mine(rooms)
    order = rng.permutation(len(room.furniture))
    center, quarter = random_poses(scene_of(room), rng, 2)
    costs = []
    for items, at in ((room.furniture, slice(None)), (tuple(room.furniture[k] for k in order), order)):
        cost = Cost(
            scene_of(Room("a", room.room_type, room.outline, room.walls, room.openings, items)), relations, WEIGHTS
        )
        box = cost.boxes(center[:, at], quarter[:, at])
        costs.append(
            cost.preference(center[:, at], quarter[:, at], box) + cost.rules(center[:, at], quarter[:, at], box)
        )
    np.testing.assert_allclose(*costs)


@given(st.integers(0, 2**32 - 1))
def test_every_item_has_a_partner_in_every_category_the_one_that_suits_best(seed):
    rng = np.random.default_rng(seed)
    rooms = designed("dining_room", 4)
    scene = scene_of(rooms[seed % 4])
    cost = Cost(scene, mine(rooms), WEIGHTS)
    center, quarter = random_poses(scene, rng, 1)
    box, names = cost.boxes(center, quarter), [item.category for item in scene.brief.furniture]

    def between(i, j) -> float:
        ways = ((i, j), (j, i))
        return sum(
            cost.relation_costs.pairs(box[0, a], quarter[0, a], box[0, b], quarter[0, b], a, b) @ cost.pair_weights
            for a, b in ways
        )

    whole = 0.0
    for i in range(len(names)):
        for category in set(names):
            whole += min((between(i, j) for j in range(len(names)) if names[j] == category and j != i), default=0.0)
    np.testing.assert_allclose(cost.pairs(box, quarter), whole / 2)


def test_rules_are_the_weighted_sum_of_faults():
    rng = np.random.default_rng(6)  # by which there are faults of every kind
    scene = scene_of(brief_of(random_room(rng)))
    weights = WEIGHTS | {name: 1.0 + k for k, name in enumerate(RULES)}
    cost = Cost(scene, NOTHING, weights)
    center, quarter = random_poses(scene, rng, 5)
    box = cost.boxes(center, quarter)
    found = cost.faults(center, quarter, box)
    assert all(fault.any() for fault in found.values())
    np.testing.assert_allclose(
        cost.rules(center, quarter, box), sum(weights[name] * fault for name, fault in found.items())
    )


def test_balance_is_how_far_the_middle_of_what_stands_is_from_that_of_the_room():
    large, small = Item("box", (2.0, 1.0), (3.0, 2.0)), Item("globe", (1.0, 1.0), (1.0, 1.0))
    scene = scene_of(rectangular_room(4, 3, large, others=(small,)))
    cost = Cost(scene, NOTHING, dict.fromkeys((*RULES, *PREFERENCES), 0.0) | {"balance": 2.0})
    center, quarter = scene.center[None], scene.quarter[None]
    off = np.hypot((2 * 3 + 1) / 3 - 2, (2 * 2 + 1) / 3 - 1.5)  # from (2, 1.5); the large one counts twice
    assert cost.preference(center, quarter, cost.boxes(center, quarter)) == pytest.approx(2 * off)
