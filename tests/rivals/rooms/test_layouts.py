"""What annealer and search hand back: a layout of the brief, by its seed."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import Point

from layoutrl.rivals.budgets import updates_budget
from layoutrl.rivals.rooms.annealer import Annealing, Chains, anneal
from layoutrl.rivals.rooms.relations import Relations, mine
from layoutrl.rivals.rooms.scene import scene_of
from layoutrl.rivals.rooms.search import Finder, Searching, search
from layoutrl.rooms.brief import brief_of, facings
from layoutrl.rooms.clearances import may_share_floor
from layoutrl.rooms.doors import kept_free
from layoutrl.rooms.faults import FRONT_NOT_FREE, faults
from layoutrl.rooms.room import TOLERANCE, Item, Room
from tests.builders import opening, random_room, rectangular_room
from tests.rivals.rooms.builders import configured, designed

ANNEALING = replace(configured(Annealing, "annealer"), chains=8)
SEARCHING = configured(Searching, "search")
TYPES = ("bathroom", "bedroom", "tatami", "dining_room")


@cache
def relations_of(room_type: str) -> Relations:
    return mine(designed(room_type, 20))


def annealed(brief: Room, seed: int = 0, steps: int = 2400) -> Room:
    return anneal(brief, relations_of(brief.room_type), ANNEALING, updates_budget(steps), np.random.default_rng(seed))


def searched(brief: Room, seed: int = 0, restarts: int = 2) -> Room:
    return search(
        brief, relations_of(brief.room_type), SEARCHING, updates_budget(restarts), np.random.default_rng(seed)
    )


both = pytest.mark.parametrize("method", [annealed, searched])


@both
@pytest.mark.parametrize("room_type", TYPES)
def test_all_items_find_places_indoors_off_each_other_and_off_the_doors(method, room_type):
    room = designed(room_type, 2)[1]
    brief = brief_of(room)
    layout = method(brief)
    assert [replace(item, center=None, rotation=None) for item in layout.furniture] == list(brief.furniture)
    for k, item in enumerate(layout.furniture):
        assert item.center is not None
        assert item.degrees in facings(brief)
        assert room.indoor.buffer(TOLERANCE).covers(item.footprint)
        core = item.footprint.buffer(-2 * TOLERANCE)
        assert not core.intersects(kept_free(room))
        for other in layout.furniture[:k]:
            assert may_share_floor(item, other) or not core.intersects(other.footprint)
    if method is searched:
        assert not faults(layout)


@both
def test_the_same_seed_and_budget_give_the_same_layout(method):
    brief = brief_of(designed("study", 1)[0])
    assert method(brief, 0) == method(brief, 0)


@pytest.mark.parametrize(("make", "settings", "times"), [(search, SEARCHING, [0, 1]), (anneal, ANNEALING, [0, 0])])
def test_the_clock_runs_while_the_first_layout_is_made(make, settings, times):
    asked = []

    def spent(made):
        asked.append(made)
        return len(asked) - 1  # nothing at first, then all

    make(brief_of(designed("bedroom", 1)[0]), relations_of("bedroom"), settings, spent, np.random.default_rng(0))
    assert asked == times


def test_another_seed_gives_another_layout():
    brief = brief_of(designed("study", 1)[0])
    assert annealed(brief, 0, 800) != annealed(brief, 1, 800)


def test_the_first_restart_is_greedy_others_are_drawn_and_the_best_is_kept():
    relations, brief = relations_of("study"), brief_of(designed("study", 1)[0])
    found = []
    for seed in range(3):
        finder = Finder(scene_of(brief), relations, SEARCHING, np.random.default_rng(seed))
        scores, best = [], []
        for _ in range(4):
            kept, finder.lowest = finder.lowest, (9, np.inf)
            finder.restart(lambda: False)
            scores.append(finder.lowest)
            finder.lowest = min(kept, finder.lowest)
            assert not finder.placed.any()  # an empty room again
        found.append(scores)
        finder = Finder(scene_of(brief), relations, SEARCHING, np.random.default_rng(seed))
        for k in range(4):
            finder.restart(lambda: False)
            best.append(finder.lowest)
            assert best[k] == min(scores[: k + 1])
        box = finder.cost.boxes(finder.best[0][None], finder.best[1][None])
        assert best[-1] == (0, finder.cost.preference(finder.best[0][None], finder.best[1][None], box)[0])
    assert len({scores[0] for scores in found}) == 1
    assert len({scores[1] for scores in found}) > 1


@both
def test_what_stands_stays_and_a_given_rotation_is_kept(method):
    bed, desk = Item("bed", (2.0, 1.5), (1.0, 0.75), 0.0), Item("desk", (0.6, 1.2), None, 90.0)
    brief = rectangular_room(4, 3, bed, others=(desk,), openings=(opening("door", 3, 3, 3.8, 3.2),), target=None)
    layout = method(brief)
    assert layout.furniture[0] == bed
    assert layout.furniture[1].rotation == 90
    assert brief.indoor.covers(layout.furniture[1].footprint)
    assert not layout.furniture[1].footprint.buffer(-TOLERANCE).intersects(bed.footprint)


@both
def test_a_room_with_nothing_to_place_is_left_alone(method):
    room = designed("bedroom", 1)[0]
    assert method(room) == room


@both
def test_a_room_without_door_and_window_and_categories_never_seen_are_furnished(method):
    items = Item("throne", (1.0, 1.0), None, None), Item("globe", (0.5, 0.5), None, None, "circle")
    layout = method(rectangular_room(3, 3, items[0], others=items[1:], target=None))
    a, b = layout.furniture
    assert layout.indoor.covers(a.footprint.union(b.footprint).buffer(-TOLERANCE))
    assert a.footprint.intersection(b.footprint).area < 1e-6


@both
@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1))
def test_any_room_is_furnished_and_search_breaks_no_rule(method, seed):
    brief = brief_of(random_room(np.random.default_rng(seed)))
    layout = method(brief, 0, 1 if method is searched else 400)
    assert [item.category for item in layout.furniture] == [item.category for item in brief.furniture]
    if method is searched:
        placed = [item for item in layout.furniture if item.center is not None]
        for k, item in enumerate(placed):
            assert brief.indoor.buffer(2e-5, join_style="mitre").covers(item.footprint)
            assert kept_free(brief).intersection(item.footprint).area < 1e-4
            others = [other for other in placed[:k] if not may_share_floor(item, other)]
            assert not any(item.footprint.intersection(other.footprint).area > 1e-4 for other in others)
        assert FRONT_NOT_FREE not in {fault for _, fault in faults(layout)}


def test_what_the_annealer_finds_no_room_for_stays_about_the_room():
    beds, wardrobe = [Item("bed", (2.1, 1.5), None, None)] * 3, Item("wardrobe", (0.6, 3.0), None, None)
    room = rectangular_room(3.6, 4.2, beds[0], others=(*beds[1:], wardrobe), target=None)
    for seed in range(4):
        layout = annealed(room, seed)
        assert all(room.indoor.buffer(TOLERANCE).covers(Point(item.center)) for item in layout.furniture)


def test_search_keeps_the_floor_before_an_item_free_of_what_stands():
    globe, wardrobe = Item("globe", (0.5, 0.5), (0.9, 0.5)), Item("wardrobe", (0.6, 1.0), None, 0.0)
    brief = rectangular_room(4, 3, globe, others=(wardrobe,), target=None)
    nothing = Relations({}, {}, frozenset(), 0.0)  # so that the first free place is best: the corner behind the globe
    layout = search(brief, nothing, SEARCHING, updates_budget(1), np.random.default_rng(0))
    assert layout.furniture[1].center is not None
    assert not faults(layout)


def test_search_finds_a_gap_that_an_item_just_fills():
    left, right = Item("globe", (0.9, 3.0), (0.45, 1.5)), Item("globe", (1.5, 3.0), (3.25, 1.5))
    between = Item("globe", (1.6, 0.5), None, 0.0)  # as wide as the gap, up to how numbers are rounded
    brief = rectangular_room(4, 3, left, others=(right, between), target=None)
    layout = search(brief, Relations({}, {}, frozenset(), 0.0), SEARCHING, updates_budget(1), np.random.default_rng(0))
    assert layout.furniture[2].center is not None
    assert layout.furniture[2].center[0] == pytest.approx(1.7)


def test_search_leaves_out_what_fits_nowhere_and_places_the_rest():
    items = Item("wardrobe", (0.6, 9.0), None, None), Item("bed", (2.0, 1.5), None, None)
    for openings in ((), (opening("door", 3, 3, 3.8, 3.2),)):
        wardrobe, bed = searched(
            rectangular_room(4, 3, items[0], others=items[1:], openings=openings, target=None)
        ).furniture
        assert (wardrobe.center, wardrobe.rotation) == (None, None)
        assert bed.center is not None


def test_search_places_what_cannot_be_reached_where_there_is_no_way_in():
    bed, barred = Item("bed", (2.0, 1.5), None, None), Item("wardrobe", (0.6, 1.2), (0.7, 1.5), 180.0)
    door = opening("door", -0.2, 1, 0, 1.9)
    layout = searched(rectangular_room(4, 3, bed, others=(barred,), openings=(door,), target=None))
    assert layout.furniture[0].center is not None


def test_search_keeps_to_what_is_reached_where_something_that_stands_is_not():
    across, barred = Item("bed", (1.0, 3.0), (1.5, 1.5)), Item("wardrobe", (0.6, 1.0), (0.3, 1.5))
    globes = [Item("globe", (0.5, 0.5), None, 0.0) for _ in range(2)]
    door = opening("door", 4, 1, 4.2, 1.9)
    brief = rectangular_room(4, 3, across, others=(barred, *globes), openings=(door,), target=None)
    nothing = Relations({}, {}, frozenset(), 0.0)  # so that the first free place is best, beyond the bed
    layout = search(brief, nothing, SEARCHING, updates_budget(1), np.random.default_rng(0))
    assert [name for _, name in faults(layout)].count("out of reach") == 1
    assert all(item.center[0] > 2 for item in layout.furniture[2:])


def test_annealing_ends_no_worse_than_it_began_and_the_more_moves_the_better():
    room = designed("study", 1)[0]
    relations = relations_of("study")
    lowest = []
    for steps in (0, 400, 3200):
        chains = Chains(scene_of(brief_of(room)), relations, ANNEALING, np.random.default_rng(0))
        first = chains.lowest
        while chains.made < steps:
            chains.step(chains.made / steps)
        assert chains.lowest <= first
        lowest.append(chains.lowest)
    assert lowest[0] > lowest[1] > lowest[2]


def taken_though_worse(first: float, last: float, share: float, steps: int) -> int:
    """How many moves that cost more are taken where a share is spent of a budget that cools from first to last."""
    settings = replace(ANNEALING, first_temperature=first, last_temperature=last, first_rules=1.0, last_rules=1.0)
    scene = scene_of(brief_of(designed("dining_room", 1)[0]))
    chains, count = Chains(scene, relations_of("dining_room"), settings, np.random.default_rng(0)), 0
    for _ in range(steps):
        before = chains.preference + chains.rules
        chains.step(share)
        count += (chains.preference + chains.rules > before + 1e-6).sum()
    return count


def test_in_the_cold_no_chain_takes_what_costs_more_and_the_hotter_it_is_the_more_do():
    cold, warm, hot = (taken_though_worse(heat, heat, 0.5, 150) for heat in (1e-9, 1.0, 1e9))
    assert 0 == cold < warm < hot


def test_it_cools():
    begun, over = (taken_though_worse(1e9, 1e-9, share, 50) for share in (0.0, 1.0))
    assert begun > 0 == over


def test_a_swap_exchanges_places_and_facings():
    swaps = replace(ANNEALING, moves={"swap": 1.0}, first_temperature=1e9, last_temperature=1e9)
    beds = [Item("bed", (2.0, 1.5))] * 3
    brief = rectangular_room(9, 9, beds[0], others=tuple(beds[1:]), target=None)
    chains, seen = Chains(scene_of(brief), relations_of("bedroom"), swaps, np.random.default_rng(0)), []
    for _ in range(20):
        seen.append(np.dstack([chains.center, chains.quarter]).tolist())
        chains.step(0.0)
    assert seen[-1] != seen[0]
    assert [*map(sorted, seen[-1])] == [*map(sorted, seen[0])]


def test_chains_remember_the_best_that_they_met_and_know_the_costs_of_where_they_are():
    room = designed("dining_room", 1)[0]
    brief = brief_of(room)
    given = replace(brief.furniture[-1], rotation=90.0)
    brief = replace(brief, furniture=(room.furniture[0], *brief.furniture[1:-1], given))
    scene = scene_of(brief)
    chains = Chains(scene, relations_of("dining_room"), ANNEALING, np.random.default_rng(0))
    lowest = chains.lowest
    for k in range(300):
        chains.step(0.7 * (k < 200))  # then hot, so that they leave the best behind
        lowest = min(lowest, (chains.preference + ANNEALING.last_rules * chains.rules).min())
        assert chains.lowest == lowest
    cost, (center, quarter) = chains.cost, (chains.center, chains.quarter)
    box = cost.boxes(center, quarter)
    np.testing.assert_allclose(chains.preference, cost.preference(center, quarter, box))
    np.testing.assert_allclose(chains.rules, cost.rules(center, quarter, box) + cost.unreached(box))
    assert (center[:, 0] == scene.center[0]).all()
    assert (quarter[:, [0, -1]] == scene.quarter[[0, -1]]).all()
    assert (quarter[:, 1:-1].std(0) > 0).all()
    center, quarter = (best[None] for best in chains.best)
    box = cost.boxes(center, quarter)
    rules = cost.rules(center, quarter, box) + cost.unreached(box)
    np.testing.assert_allclose(chains.lowest, cost.preference(center, quarter, box) + ANNEALING.last_rules * rules)


def test_search_keeps_a_given_rotation_in_mind():
    desk = Item("desk", (0.6, 1.2), None, 90.0)
    finder = Finder(
        scene_of(rectangular_room(4, 3, desk, target=None)), relations_of("study"), SEARCHING, np.random.default_rng(0)
    )
    assert set(finder.poses[0].quarter.tolist()) == {1}
