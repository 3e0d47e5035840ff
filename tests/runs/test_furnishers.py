"""Who furnishes rooms of a user's own, and who helps where something is wrong."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from layoutrl.agents.learner import Agent, q_network
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.moving import Mover
from layoutrl.evaluation.threads import one_thread
from layoutrl.rooms.brief import brief_of, categories_of, with_poses
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.faults import faults
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.room import Item, Room
from layoutrl.runs import furnishers
from layoutrl.runs.config import composed
from layoutrl.runs.furnishers import HALL, Helped, best_apart, furnisher_for, shortcomings
from layoutrl.runs.pretrained import Agents
from tests.builders import rectangular_room

DESIGNS = design_rooms("bedroom", "test", 0, 2).rooms


class Known:
    """Answers each brief with the layouts that it was given for the room of that name."""

    def __init__(self, *layouts: Room):
        self.layouts, self.asked = layouts, list[str]()

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        self.asked += [brief.id for brief in briefs]
        return [[Furnished(each, 0.0) for each in self.layouts if each.id == brief.id][:choices] for brief in briefs]


def turned_round(design: Room) -> Room:
    """Every item at the designer's place, its front at the wall."""
    poses = {k: (item.center, (item.rotation + 180) % 360) for k, item in enumerate(design.furniture)}
    return with_poses(design, poses)


def lacking(layout: Room) -> Room:
    """The layout without its first item's place."""
    first, *others = layout.furniture
    return replace(layout, furniture=(replace(first, center=None, rotation=None), *others))


def test_another_is_asked_where_something_is_wrong_and_heeded_where_it_does_better() -> None:
    good, bad = DESIGNS[0], turned_round(DESIGNS[1])
    assert not faults(good)
    assert faults(bad)
    one, another = Known(good, bad), Known(DESIGNS[1])
    found = Helped(one, another).furnish([brief_of(design) for design in DESIGNS], 2, 0)
    assert another.asked == [bad.id]
    assert [[each.layout for each in answers] for answers in found] == [[good], [DESIGNS[1], bad]]
    assert [[each.by for each in answers] for answers in found] == [[""], ["the search", ""]]
    (only,) = Helped(one, another).furnish([brief_of(DESIGNS[1])], 1, 0)
    assert [each.layout for each in only] == [DESIGNS[1]]


def test_of_layouts_to_choose_from_the_worse_give_way_to_those_of_the_search_and_none_is_there_twice() -> None:
    design, bad = DESIGNS[0], turned_round(DESIGNS[0])
    middle = np.array(design.indoor.centroid.coords[0])
    inwards = [0.8 * np.array(item.center) + 0.2 * middle for item in design.furniture]
    moved = with_poses(design, {k: (tuple(inwards[k]), item.rotation) for k, item in enumerate(design.furniture)})
    one, another = Known(design, bad), Known(moved, lacking(design), design)
    (found,) = Helped(one, another).furnish([brief_of(design)], 3, 0)
    alone = [[Furnished(each, 0.0)] for each in (bad, lacking(design))]
    worse, worst = sorted(shortcomings([brief_of(design)] * 2, alone))
    assert [each.layout for each in found][:1] == [design]
    assert [each.by for each in found].count("") == 2
    assert shortcomings([brief_of(design)], [found]) == [[(0, 0, 0), *worse, *worst]]
    (found,) = Helped(one, another).furnish([brief_of(design)], 2, 0)
    assert shortcomings([brief_of(design)], [found]) == [[(0, 0, 0), *worse]]


def test_who_searches_longer_is_asked_where_each_layout_has_a_fault() -> None:
    bad, lacks, brief = turned_round(DESIGNS[1]), lacking(DESIGNS[1]), brief_of(DESIGNS[1])
    longer = Known(DESIGNS[1])
    ((best,),) = Helped(Known(bad), Known(lacks), longer).furnish([brief], 1, 0)
    assert best.layout == DESIGNS[1]
    assert longer.asked == [brief.id]
    Helped(Known(bad), Known(DESIGNS[1]), longer).furnish([brief], 1, 0)
    assert longer.asked == [brief.id]


def test_who_furnishes_is_asked_for_three_where_each_layout_has_something_wrong(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    bad, brief = turned_round(DESIGNS[1]), brief_of(DESIGNS[1])
    one = Known(bad, bad, DESIGNS[1])
    ((best,),) = Helped(one, Known(bad)).furnish([brief], 1, 0)
    assert (best.layout, best.by, one.asked) == (DESIGNS[1], "", [brief.id] * 2)
    one = Known(bad, bad, bad, DESIGNS[1])
    assert [each.layout for each in Helped(one).furnish([brief], 3, 0)[0]] == [bad]  # three are what was asked
    assert one.asked == [brief.id]
    monkeypatch.setattr(furnishers, "MANY", len(brief.furniture) - 1)
    one = Known(bad, bad, DESIGNS[1])
    ((worst,),) = Helped(one, Known(bad)).furnish([brief], 1, 0)
    assert (worst.layout, one.asked) == (bad, [brief.id])


def test_what_is_put_where_something_stands_has_no_place() -> None:
    design = DESIGNS[1]
    (center,) = design.indoor.centroid.coords
    piled = with_poses(brief_of(design), dict.fromkeys(range(len(design.furniture)), (center, 0.0)))
    ((answer,),) = Helped(Known(piled), Known(brief_of(design))).furnish([brief_of(design)], 1, 0)
    areas = [item.area for item in brief_of(design).furniture]
    assert [item.center is not None for item in answer.layout.furniture] == [area == max(areas) for area in areas]


def test_who_lacks_an_item_does_not_do_better() -> None:
    bad = turned_round(DESIGNS[1])
    (found,) = Helped(Known(bad), Known(lacking(DESIGNS[1]))).furnish([brief_of(DESIGNS[1])], 1, 0)
    assert [each.layout for each in found] == [bad]


@pytest.mark.parametrize(("center", "degrees", "lacks"), [((1.8, 1.7), 90.0, True), ((3.7, 2.2), 0.0, False)])
def test_what_stands_in_something_is_no_better_than_what_has_no_place(center, degrees, lacks) -> None:
    bed, wardrobe = Item("bed", (2.0, 1.5), (1.0, 0.75)), Item("wardrobe", (0.6, 1.2), center, degrees)
    layout = replace(rectangular_room(4, 3), furniture=(wardrobe, bed), target=None)
    assert ("overlaps" in {name for _, name in faults(layout)}) == lacks
    assert faults(layout)
    (found,) = Helped(Known(layout), Known(lacking(layout))).furnish([brief_of(layout)], 1, 0)
    assert (found[0].layout.furniture[0].center is None) == lacks


def test_what_was_wrong_before_anything_was_placed_asks_for_nobody() -> None:
    first, *others = DESIGNS[1].furniture
    stands = replace(DESIGNS[1], furniture=(first, *(replace(item, center=others[0].center) for item in others)))
    brief = lacking(stands)
    assert faults(stands)
    assert {index for index, _ in faults(stands)} <= {index for index, _ in faults(brief)}
    another = Known(DESIGNS[1])
    Helped(Known(stands), another).furnish([brief], 1, 0)
    assert not another.asked


def test_a_layout_with_something_odd_in_it_asks_the_search_too() -> None:
    desk, chair = Item("desk", (0.6, 1.2), (0.5, 1.0)), Item("chair", (0.4, 0.4), (0.9, 1.0), 180, tucked=True)
    layout = replace(rectangular_room(4, 3), furniture=(desk, chair), target=None)
    away = replace(layout, furniture=(desk, replace(chair, center=(2.0, 1.0))))
    assert not faults(layout)
    assert not faults(away)
    another = Known(layout)
    (found,) = Helped(Known(away), another).furnish([brief_of(layout)], 1, 0)
    assert [each.by for each in found] == ["the search"]


def test_no_help_is_asked_for_in_a_hall() -> None:
    bad, another = turned_round(DESIGNS[1]), Known(DESIGNS[1])
    side = HALL**0.5 + 0.1
    hall = replace(bad, outline=((0, 0), (side, 0), (side, side), (0, side)))
    (found,) = Helped(Known(hall), another).furnish([brief_of(hall)], 1, 0)
    assert not another.asked
    assert [each.layout for each in found] == [hall]


@pytest.mark.parametrize(
    ("by", "kind"), [("", Helped), ("by=agents", Agents), ("by=search", furnishers.SearchOrAnnealer)]
)
def test_without_a_name_the_search_helps_the_agents(by: str, kind: type) -> None:
    asked = composed("place", "rooms=any.jsonl", "device=cpu", *filter(None, [by]))
    assert isinstance(furnisher_for(asked).furnisher, kind)


@pytest.mark.parametrize("scope", ["item", "room"])
def test_who_furnishes_waits_for_no_other_core(scope: str) -> None:
    before, device = torch.get_num_threads(), torch.device("cpu")
    trained = composed("train", "room=bedroom", f"scope={scope}", "method.evaluation_moves=2")
    categories = categories_of(DESIGNS)
    network = q_network(trained.method, categories, np.random.SeedSequence(0), device)
    threads = set()
    network.register_forward_hook(lambda *_: threads.add(torch.get_num_threads()))
    first, *stands = DESIGNS[0].furniture
    brief = replace(DESIGNS[0], furniture=(replace(first, center=None), *stands), target=None)
    agents = {
        "item": Mover(Agent(network, trained.method, categories), trained.reward),
        "room": Furnisher(Agent(network, trained.method, categories)),
    }
    torch.set_num_threads(2)
    try:
        assert agents[scope].furnish([brief], 1, 0)
        assert torch.get_num_threads() == 2
    finally:
        torch.set_num_threads(before)
    assert threads == {1}


def test_two_who_furnish_at_once_leave_the_threads_as_they_were() -> None:
    before = torch.get_num_threads()
    first_is_in, second_is_in, first_is_out = (threading.Event() for _ in range(3))
    torch.set_num_threads(2)

    def first() -> None:
        with one_thread():
            first_is_in.set()
            second_is_in.wait(0.2)
        first_is_out.set()

    def second() -> None:
        first_is_in.wait(60)
        with one_thread():
            second_is_in.set()
            first_is_out.wait(60)
            assert torch.get_num_threads() == 1

    try:
        with ThreadPoolExecutor(2) as pool:
            for done in [pool.submit(first), pool.submit(second)]:
                done.result()
        with ThreadPoolExecutor(1) as another:  # a thread that has used torch before keeps its own number
            assert another.submit(torch.get_num_threads).result() == 2
    finally:
        torch.set_num_threads(before)


def test_help_does_not_hang_on_the_machines_speed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("layoutrl.rivals.rooms.rival.DESIGNED", 20)
    brief, helped = brief_of(DESIGNS[1]), furnisher_for(composed("place", "rooms=any.jsonl", "device=cpu")).furnisher
    assert isinstance(helped, Helped)
    for search, restarts in zip(helped.searches, furnishers.RESTARTS, strict=True):
        assert isinstance(search, furnishers.SearchOrAnnealer)
        spent = search.budget()
        assert [spent(made) for made in (0, restarts)] == [0, 1]
    helped.one = Known(turned_round(DESIGNS[1]))
    ((found,),) = helped.furnish([brief], 1, 0)
    assert not faults(found.layout)


@given(st.lists(st.tuples(st.integers(0, 4), st.tuples(*[st.integers(0, 2)] * 3)), max_size=9), st.integers(1, 4))
def test_the_best_apart_lack_least_and_leave_out_what_one_of_them_is_or_what_is_too_many(
    drawn: list[tuple[int, tuple[int, int, int]]], choices: int
) -> None:
    room = rectangular_room(8, 3)
    layouts = [
        Furnished(replace(room, furniture=(replace(room.moving, center=(0.5 + place, 1.0)),)), float(k))
        for k, (place, _) in enumerate(drawn)
    ]
    best = best_apart(layouts, [lack for _, lack in drawn], choices)
    kept = [int(each.value) for each in best]
    least = {place: min((lack, k) for k, (its, lack) in enumerate(drawn) if its == place) for place, _ in drawn}
    assert kept == [k for _, k in sorted(least.values())][:choices]
