"""Relation graphs: hand-made rooms edge by edge, and what holds in every room."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely.geometry import LineString, box

from layoutrl import InputError
from layoutrl.rivals.planit.graph import (
    ADJACENT,
    BACK,
    DISTANT,
    FRONT,
    LEFT,
    MIRRORED,
    PROXIMAL,
    RIGHT,
    SUPPORT,
    TYPES,
    KeptTypes,
    Relation,
    Scene,
    edge_type,
    graph_of,
    graph_with_last,
    kept_types,
    placing_order,
    scene_of,
    turned,
)
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import MAIN_ITEM, Item, Room
from tests.builders import l_room, opening, rectangular_room

BED = Item("bed", (2.0, 1.6), (1.0, 2.0), rotation=0)  # its head at the left wall, it faces right


def bedroom(*others: Item, **fields: object) -> Room:
    """5 m by 4 m, with a bed in the middle of the left wall; a door below, a window on the right."""
    openings = (opening("door", 3.5, -0.2, 4.3, 0.0), opening("window", 5.0, 1.0, 5.2, 3.0))
    return rectangular_room(5.0, 4.0, BED, others=others, openings=openings, **fields)


def edges(room: Room) -> set[tuple[str, str, str]]:
    """By category; walls by the side of the room that they are on."""
    scene = scene_of(room)
    side = ("left wall", "lower wall", "right wall", "upper wall")
    names = [
        side[scene.facing[k]] if scene.category[k] == "wall" else scene.category[k] for k in range(len(scene.category))
    ]
    return {(names[r.anchor], names[r.target], TYPES[r.type]) for r in scene.relations}


def test_the_nodes_are_walls_then_openings_then_furniture_and_all_face_into_the_room() -> None:
    scene = scene_of(bedroom(Item("desk", (0.6, 1.2), (4.7, 2.0), rotation=180)))
    assert scene.category == ("wall",) * 4 + ("door", "window", "bed", "desk")
    assert (scene.fixed, list(scene.items)) == (6, [6, 7])
    assert scene.facing.tolist() == [1, 2, 3, 0, 1, 2, 0, 2]
    assert scene.box[7].tolist() == pytest.approx([4.4, 1.4, 5.0, 2.6])
    assert set(scene.frame) == {(0, 1, 1.0), (1, 2, 1.0), (2, 3, 1.0), (3, 0, 1.0), (0, 4, 0.0), (1, 5, 0.0)}


def test_an_inner_corner_turns_the_other_way() -> None:
    turns = [turn for _, _, turn in scene_of(l_room()).frame]
    assert sorted(turns) == [-1, 1, 1, 1, 1, 1]


def test_a_bed_alone_is_seen_by_what_is_opposite() -> None:
    assert edges(bedroom()) == {
        ("left wall", "bed", "front adjacent"),
        ("right wall", "bed", "front distant"),
        ("window", "bed", "front distant"),
        ("lower wall", "bed", "front distant"),
        ("upper wall", "bed", "front distant"),
    }


def test_what_stands_between_hides_what_is_behind() -> None:
    screen = Item("screen", (0.1, 3.9), (3.0, 2.0), rotation=0)
    found = edges(bedroom(screen))
    assert ("screen", "bed", "back distant") in found
    assert ("bed", "screen", "front distant") in found
    assert not any(anchor in ("right wall", "window") and target == "bed" for anchor, target, _ in found)


def test_what_is_hidden_by_less_than_seventy_percent_is_seen() -> None:
    half = Item("screen", (0.1, 1.2), (3.0, 1.5), rotation=0)
    assert ("right wall", "bed", "front distant") in edges(bedroom(half))


@pytest.mark.parametrize(
    ("item", "there", "back"),
    [
        (Item("nightstand", (0.4, 0.5), (0.2, 3.07), rotation=0), "left adjacent", "right adjacent"),
        (Item("nightstand", (0.4, 0.5), (0.2, 0.93), rotation=0), "right adjacent", "left adjacent"),
        (Item("nightstand", (0.4, 0.5), (0.2, 3.35), rotation=0), "left proximal", "right proximal"),
        (Item("chair", (0.5, 0.5), (2.5, 2.0), rotation=180), "front proximal", "front proximal"),
        (Item("chair", (0.5, 0.5), (4.0, 2.0), rotation=90), "front distant", "left distant"),
        (Item("pouf", (0.5, 0.5), (4.0, 2.0), form="circle"), "front distant", "front distant"),
        (Item("desk", (0.6, 1.0), (4.0, 2.0), rotation=270), "front distant", "right distant"),
    ],
)
def test_directions_are_the_anchors_own(item: Item, there: str, back: str) -> None:
    found = edges(bedroom(item))
    assert ("bed", item.category, there) in found
    assert (item.category, "bed", back) in found


def test_a_chair_under_a_table_is_beside_it_and_a_lamp_on_it_is_carried() -> None:
    table = Item("table", (1.0, 1.0), (3.5, 2.5), rotation=0)
    chair = Item("chair", (0.5, 0.5), (4.1, 2.5), rotation=180, tucked=True)
    lamp = Item("lamp", (0.2, 0.2), (3.5, 2.5), rotation=0)
    found = edges(bedroom(table, chair, lamp))
    assert ("table", "chair", "front adjacent") in found
    assert ("chair", "table", "front adjacent") in found
    assert ("table", "lamp", "support") in found


def test_furniture_has_no_edge_to_walls_doors_and_windows() -> None:
    for room in designed("bedroom"):
        scene = scene_of(room)
        assert all(relation.target >= scene.fixed for relation in scene.relations)


def test_a_slanting_room_is_refused_in_a_line() -> None:
    with pytest.raises(InputError, match=r"room room: the bed stands at an angle; expected an upright room"):
        scene_of(rectangular_room(item=replace(BED, rotation=30.0, center=(2.0, 1.5))))
    slanting = replace(rectangular_room(), outline=((0.0, 0.0), (4.0, 0.0), (3.5, 3.0), (0.0, 3.0)))
    with pytest.raises(InputError, match="a wall stands at an angle"):
        scene_of(slanting)


def designed(room_type: str, count: int = 12) -> list[Room]:
    return design_rooms(room_type, "train", 5, count).rooms


@pytest.mark.parametrize("room_type", list(MAIN_ITEM))
def test_edges_turn_and_mirror_with_the_room(room_type: str) -> None:
    for room in designed(room_type, 4):
        scene = scene_of(room)
        own = named(scene)
        for quarters, mirror in itertools.product(range(4), (False, True)):
            other = scene_of(room.turned(quarters, mirror))
            assert named(other, mirror) == own, (room.id, quarters, mirror)


def named(scene: Scene, mirror: bool = False) -> set[tuple[object, object, int]]:
    """Edges between furniture by its index, and from architecture by category and distance: its order may change."""
    first = scene.fixed
    found: set[tuple[object, object, int]] = set()
    for anchor, target, type in scene.relations:
        if anchor >= first:
            facing_mirrored = bool(scene.circle[anchor])
            found.add((anchor - first, target - first, int(MIRRORED[type]) if mirror and not facing_mirrored else type))
        else:
            found.add((scene.category[anchor], target - first, type))
    return found


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_what_intervals_see_is_what_rays_meet(seed: int) -> None:
    """Against shapely: a ray from the middle of each visible part ends at the node that the intervals name."""
    rng = np.random.default_rng(seed)
    boxes = []
    for _ in range(int(rng.integers(2, 6))):
        width, depth = rng.uniform(0.3, 1.2, 2)
        x, y = rng.uniform(0, 6 - width), rng.uniform(0, 6 - depth)
        boxes.append((x, y, x + width, y + depth))
    items = tuple(
        Item(f"item{k}", (b[2] - b[0], b[3] - b[1]), ((b[0] + b[2]) / 2, (b[1] + b[3]) / 2))
        for k, b in enumerate(boxes)
    )
    room = rectangular_room(6.0, 6.0, items[0], others=items[1:])
    scene = scene_of(room)
    shapes = [box(*b) for b in boxes]
    if any(a.intersection(b).area > 0 for a, b in itertools.combinations(shapes, 2)):
        return  # what intersects is told apart by how far it sticks out
    seen = {
        (r.anchor - scene.fixed, r.target - scene.fixed): r.type // 3
        for r in scene.relations
        if r.anchor >= scene.fixed
    }
    count = 400
    for a, b in itertools.permutations(range(len(boxes)), 2):
        shares = {}
        for way, quarters in ((FRONT, 0), (LEFT, 1), (BACK, 2), (RIGHT, 3)):
            frame = [turned(np.array(other), -quarters) for other in boxes]
            ends = shapely.linestrings(
                [
                    [(frame[a][2], y), (20.0, y)]
                    for y in np.linspace(frame[a][1], frame[a][3], count + 1)[:-1]
                    + (frame[a][3] - frame[a][1]) / count / 2
                ]
            )
            others = np.array([box(*f) for k, f in enumerate(frame) if k != a])
            names = [k for k in range(len(frame)) if k != a]
            met = shapely.intersection(others, ends[:, None])
            far = np.where(shapely.is_empty(met), np.inf, shapely.distance(shapely.get_point(ends, 0)[:, None], met))
            first = np.where(np.isfinite(far.min(1)), far.argmin(1), -1)
            visible = (first == names.index(b)).mean() * (frame[a][3] - frame[a][1])
            shares[way] = (visible / (frame[a][3] - frame[a][1]), visible / (frame[b][3] - frame[b][1]))
        best = max(shares.values(), key=max)
        if max(best) > 0.32:
            assert (a, b) in seen
            assert max(shares[seen[a, b]]) > 0.28
        elif max(best) < 0.28:
            assert (a, b) not in seen


def test_pruning_keeps_the_frequent_and_what_always_tells() -> None:
    rooms = designed("bedroom", 60)
    scenes = [scene_of(room) for room in rooms]
    left = kept_types(scenes)
    assert ("wall", "bed", edge_type(FRONT, ADJACENT)) in left
    assert ("bed", "nightstand", edge_type(LEFT, ADJACENT)) in left or (
        "bed",
        "nightstand",
        edge_type(LEFT, PROXIMAL),
    ) in left
    assert ("wall", "nightstand", edge_type(BACK, ADJACENT)) not in left
    counted: dict[tuple[str, str, int], int] = {}
    pairs = 0
    for scene in scenes:
        pairs += scene.category.count("wall") * scene.category.count("bed")
        for r in scene.relations:
            key = (scene.category[r.anchor], scene.category[r.target], r.type)
            counted[key] = counted.get(key, 0) + 1
    distant = ("wall", "bed", edge_type(FRONT, DISTANT))
    assert (distant in left) == (counted.get(distant, 0) / pairs >= 0.30)


def test_a_graph_leads_from_what_is_placed_before_and_ties_everything_up() -> None:
    for room_type in MAIN_ITEM:
        rooms = designed(room_type, 8)
        scenes = [scene_of(room) for room in rooms]
        for scene, types in ((s, k) for s in scenes for k in (kept_types(scenes), KeptTypes({}))):
            order = list(scene.items)[::-1]
            graph = graph_of(scene, types, order)
            assert list(graph) == order
            for k, (item, leading) in enumerate(graph.items()):
                assert all(r.target == item and (r.anchor < scene.fixed or r.anchor in order[:k]) for r in leading)
                if types.types:
                    assert leading, (room_type, scene.category[item])
                else:
                    assert len(leading) <= 1  # the cheapest alone


def test_the_cheapest_edge_ties_up_what_nothing_else_does() -> None:
    scene = scene_of(bedroom(Item("nightstand", (0.4, 0.5), (0.2, 3.07), rotation=0)))
    bed, nightstand = scene.items
    assert graph_of(scene, KeptTypes({}), [bed, nightstand])[nightstand][0].type % 3 == ADJACENT


def test_of_a_graph_with_one_item_last_the_others_do_not_know_of_it() -> None:
    """What the item hides from them is seen: their edges are the same wherever it stands, and without it."""
    for room_type in MAIN_ITEM:
        rooms = designed(room_type, 8)
        scenes = [scene_of(room) for room in rooms]
        types = kept_types(scenes)
        for room, scene in zip(rooms, scenes, strict=True):
            last = scene.items[0]
            others = [k for k in scene.items if k != last]
            graph = graph_with_last(scene, types, others[::-1], last)
            assert list(graph) == [*others[::-1], last]
            assert graph[last] == graph_of(scene, types, [*others, last])[last]
            bare = scene_of(replace(room, furniture=room.furniture[1:]))
            expected = graph_of(bare, types, [k - 1 for k in others[::-1]])

            def number(node: int, first: int = scene.fixed) -> int:
                return node - (node > first)

            found = {
                number(k): [Relation(number(r.anchor), number(r.target), r.type) for r in graph[k]]
                for k in others[::-1]
            }
            assert found == expected


def test_the_most_constrained_is_placed_first_and_of_equals_what_constrains_more() -> None:
    near, far = edge_type(FRONT, ADJACENT), edge_type(FRONT, DISTANT)
    graph = {
        10: [Relation(0, 10, far)],
        11: [Relation(0, 11, near)],
        12: [Relation(1, 12, near)],
        13: [Relation(12, 13, near), Relation(0, 13, near)],
    }
    size = dict.fromkeys(graph, 1.0)
    assert placing_order(graph, size) == [12, 13, 11, 10]
    assert SUPPORT == TYPES.index("support") == 12
    assert len(TYPES) == 13


def test_a_ray_is_blocked_by_a_wall() -> None:
    """Of two items in the two arms of an L neither sees the other through the corner's walls."""
    low = Item("bed", (0.5, 0.5), (3.7, 1.7), rotation=0)
    high = Item("desk", (0.5, 0.5), (1.5, 3.7), rotation=0)
    scene = scene_of(l_room(low, others=(high,)))
    ends = LineString([low.center, high.center])
    assert not room_covers(l_room(low, others=(high,)), ends)
    assert not any(r.anchor >= scene.fixed for r in scene.relations)
    above = Item("desk", (0.5, 0.5), (3.7, 0.4), rotation=0)
    assert any(r.anchor >= scene.fixed for r in scene_of(l_room(low, others=(above,))).relations)


def room_covers(room: Room, line: LineString) -> bool:
    return bool(room.indoor.covers(line))
