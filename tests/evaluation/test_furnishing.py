"""How an agent furnishes whole rooms: whatever its values, what must hold of what it does with them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from shapely import union_all
from shapely.geometry import MultiPoint

from layoutrl.agents.learner import Agent, q_network
from layoutrl.agents.method import Method
from layoutrl.env.observation import out_of_line
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_simulator import RoomsSimulator
from layoutrl.env.scenes import QUARTERS
from layoutrl.env.simulator import Moves
from layoutrl.evaluation import choosing, furnishing, placing
from layoutrl.evaluation.choosing import FAULT, LARGEST_APART, TRIED_UP_TO, Chosen, Options, best_of, wrong
from layoutrl.evaluation.furnishing import Furnisher
from layoutrl.evaluation.placing import BACK, BETTER, GAP, SIDEWAYS, STARTS, Placing, spread
from layoutrl.rooms import oddities
from layoutrl.rooms.brief import brief_of, categories_of, missing
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.faults import Items, faults
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.room import Item, Room, rotation
from layoutrl.runs.config import composed
from layoutrl.watch import rooms_filling_up
from tests.builders import opening, rectangular_room
from tests.evaluation.test_choosing import small_room

CPU = torch.device("cpu")

pytestmark = pytest.mark.usefixtures("content_furnisher")


@pytest.fixture(scope="module")
def method() -> Method:
    return replace(composed("train", "room=bedroom", "scope=room").method, evaluation_moves=4)


@pytest.fixture(scope="module")
def designs() -> list[Room]:
    return design_rooms("bedroom", "test", 0, 3).rooms


@pytest.fixture(scope="module")
def furnisher(method: Method, designs: list[Room]) -> Furnisher:
    categories = categories_of(designs)
    return Furnisher(Agent(q_network(method, categories, np.random.SeedSequence(0), CPU), method, categories))


@pytest.fixture(scope="module")
def together(content_furnisher: None, furnisher: Furnisher, designs: list[Room]) -> list[Furnished]:
    """The rooms as they are furnished in one batch."""
    return [best for (best,) in furnisher.furnish([brief_of(room) for room in designs], 1, 0)]


@pytest.fixture(scope="module")
def alone(content_furnisher: None, furnisher: Furnisher, designs: list[Room]) -> list[Furnished]:
    """The same, one after the other."""
    return [furnisher.furnish([brief_of(room)], 1, 0)[0][0] for room in designs]


@pytest.fixture
def remembered(furnisher: Furnisher, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a room not be furnished twice in one order with the same layouts known: of one brief all begins alike."""
    found: dict[str, Any] = {}
    furnish = furnisher._furnished

    def once(world: Placing, which: np.ndarray, rank: np.ndarray, known: Any, walls: bool) -> Any:
        key = repr(([room.id for room in world.rooms.rooms], which.tolist(), rank.tolist(), known, walls))
        if key not in found:
            found[key] = furnish(world, which, rank, known, walls)
        return found[key]

    monkeypatch.setattr(furnisher, "_furnished", once)


@pytest.fixture
def thorough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let as many poses be looked at as usual."""
    monkeypatch.setattr(choosing, "TRIED_UP_TO", TRIED_UP_TO)


def test_all_items_are_placed_where_they_fit_and_what_stands_stays(furnisher: Furnisher, designs: list[Room]) -> None:
    standing = replace(designs[0], furniture=(designs[0].furniture[0], *brief_of(designs[0]).furniture[1:]))
    briefs = [*map(brief_of, designs[1:]), standing]
    for brief, (best,) in zip(briefs, furnisher.furnish(briefs, 1, 0), strict=True):
        assert missing(best.layout) == []
        assert replace(best.layout, furniture=()) == replace(brief, furniture=())
        for before, after in zip(brief.furniture, best.layout.furniture, strict=True):
            assert (before.category, before.size, before.form) == (after.category, after.size, after.form)
            assert before.center is None or before == after
            assert best.layout.envelope.buffer(1e-5).covers(after.footprint)


@pytest.mark.parametrize("lean", [0, 30])
def test_what_can_be_moved_nowhere_is_left_out_and_the_others_are_placed(furnisher: Furnisher, lean: float) -> None:
    bed, chair = Item("bed", (2.0, 1.0), (1.0, 0.5)), Item("chair", (0.4, 0.4), (1.0, 0.5))
    room = rectangular_room(2, 1, bed, others=(chair,), walls=()).rotated(lean)
    ((best, *more),) = furnisher.furnish([brief_of(room)], 2, 0)
    assert not more  # a layout is another by where its largest item stands
    assert missing(best.layout) == [0]
    assert {k for k, _, _ in best.path} == {1}
    for width, depth in ((2, 1), (1, 2)):  # the bed fits as it faces right, or up
        lonely = rectangular_room(width, depth, replace(bed, center=(width / 2, depth / 2)), walls=())
        ((empty,),) = furnisher.furnish([brief_of(lonely.rotated(lean))], 1, 0)
        assert missing(empty.layout) == [0]
        assert empty.value == 0


def test_the_way_ends_where_the_items_stand(together: list[Furnished]) -> None:
    best = together[0]
    ends = {k: (center, degrees) for k, center, degrees in best.path}
    assert sorted(ends) == list(range(len(best.layout.furniture)))
    for k, item in enumerate(best.layout.furniture):
        np.testing.assert_allclose(ends[k][0], item.center, atol=1e-6)
        assert ends[k][1] == item.rotation


@pytest.mark.parametrize("lean", [0.0, 30.0])
def test_it_is_told_where_an_item_is_taken_up_though_it_be_the_same_again(
    furnisher, designs, monkeypatch, lean
) -> None:
    # Along walls, and put in line, an untrained agent is right at once.
    monkeypatch.setattr(Placing, "_along_walls", lambda placing, state, starts: starts)
    monkeypatch.setattr(furnisher, "_policy", replace(furnisher._policy, snap=0.0))
    design = max(designs, key=lambda room: room.indoor.area)
    two = sorted(design.furniture, key=lambda item: -item.area)[:2]
    ((best,),) = furnisher.furnish([brief_of(replace(design, furniture=tuple(two), target=None)).rotated(lean)], 1)
    assert 0 in best.taken
    assert {n for n, (k, *_) in enumerate(best.path) if n and k != best.path[n - 1][0]} < best.taken
    (again,) = (n for n in best.taken if n and n < len(best.path) and best.path[n][0] == best.path[n - 1][0])
    assert best.path[again][1] != best.path[again - 1][1]
    episode = rooms_filling_up(furnisher, [design])[0]
    assert episode.taken
    assert episode.moves == len(episode.way) - len({n for n in episode.taken if n < len(episode.way)})


def test_layouts_are_the_same_wherever_the_designer_has_the_items_and_whatever_the_seed(
    furnisher, designs, together
) -> None:
    moved = [
        replace(room, furniture=tuple(replace(item, center=(1.0, 1.0), rotation=0.0) for item in room.furniture))
        for room in designs
    ]
    assert furnisher.furnish([brief_of(room) for room in moved], 1, 6) == [[best] for best in together]


def test_a_layout_does_not_hang_on_what_else_is_furnished(together: list[Furnished], alone: list[Furnished]) -> None:
    for one, other in zip(together, alone, strict=True):
        assert_same_places(one.layout, other.layout)


def test_more_rooms_than_a_block_are_furnished_as_in_one(furnisher, designs, monkeypatch) -> None:
    briefs, found = [brief_of(replace(room, furniture=room.furniture[:1], target=None)) for room in designs], []
    for block in (3, 2):
        monkeypatch.setattr(furnishing, "BLOCK", block)
        found.append(furnisher.furnish(briefs, 1, 0))
    for (one,), (other,) in zip(*found, strict=True):
        assert_same_places(one.layout, other.layout)


def test_what_is_to_stand_elsewhere_does_not_hang_on_what_else_is_furnished(furnisher, designs, alone) -> None:
    """A layout of each is known. Where one room looks for another place for its largest item, the other does not."""
    briefs = [brief_of(room) for room in designs[:2]]
    world = Placing(briefs, furnisher._policy, Moves(), furnisher._categories)
    rank = world.rooms.size_rank()
    # The largest item of the second room comes last: the rooms are at theirs at different steps.
    rank[1] = rank[1].max() - rank[1]
    known = [[found] for found in alone[:2]]
    for b, one in enumerate(furnisher._furnished(world, np.arange(2), rank, known)):
        (other,) = furnisher._furnished(world, np.array([b]), rank, known)
        assert one is not None
        assert other is not None
        assert_same_places(one.layout, other.layout)


def assert_same_places(one: Room, other: Room) -> None:
    """Up to a micrometre: what networks say of one room differs in its last digits with what is asked beside it."""
    for mine, theirs in zip(one.furniture, other.furniture, strict=True):
        np.testing.assert_allclose(mine.center, theirs.center, atol=1e-6)
        assert mine.rotation == theirs.rotation


def test_layouts_to_choose_from_differ_in_their_largest_item_and_come_by_faults_then_as_found(
    furnisher, designs, together
) -> None:
    briefs = [brief_of(room) for room in designs]
    for only, layouts in zip(together, furnisher.furnish(briefs, 3, 0), strict=True):
        assert 1 < len(layouts) <= 3
        rank = wrong([one.layout for one in layouts]).tolist()
        assert rank == sorted(rank)
        if rank[0] == wrong([only.layout]):
            assert layouts[0].layout == only.layout
        largest = [max(one.layout.furniture, key=lambda item: item.area) for one in layouts]
        for k, one in enumerate(largest):
            for other in largest[:k]:
                assert (
                    np.hypot(*np.subtract(one.center, other.center)) >= LARGEST_APART or one.rotation != other.rotation
                )


def test_a_layout_that_lacks_an_item_comes_after_an_odd_one(furnisher, monkeypatch) -> None:
    bed, wardrobe = Item("bed", (2.0, 1.5), (1.0, 0.75)), Item("wardrobe", (0.6, 1.0), (2.0, 2.0))
    odd = rectangular_room(4, 3, bed, others=(wardrobe,), target=None)
    lacking = replace(odd, furniture=(bed, replace(wardrobe, center=None, rotation=None)))
    monkeypatch.setattr(furnishing, "ELSEWHERE", 0)
    monkeypatch.setattr(
        furnisher, "_furnished", lambda _, __, ___, known, *____: [Furnished(odd if known[0] else lacking, 0.0)]
    )
    (found,) = furnisher.furnish([brief_of(odd)], 2, 0)
    assert [one.layout for one in found] == [odd, lacking]


def chosen_at(center: np.ndarray, harm: int) -> Chosen:
    """One item at centers (1, 2)."""
    way = np.empty(1, dtype=object)
    way[0] = center
    return Chosen(center, np.zeros(1, int), np.ones(1), way, np.array([harm]))


def slid(furnisher: Furnisher, brief: Room, chosen: Chosen, ways: tuple[int, ...]) -> Chosen:
    world = Placing([brief], furnisher._policy, Moves(), ["bed"])
    state = world.rooms.empty(np.zeros(1, int))
    return world._slid(state, wrong([world.rooms.layout(state, 0)]), chosen, np.array([0]), ways)


@pytest.mark.parametrize(("harm", "calls"), [(0, 3), (1, 4)])  # both items, the smaller again, and again
def test_each_sweep_looks_from_other_starts_and_the_last_where_something_is_wrong(
    furnisher, designs, monkeypatch, harm, calls
) -> None:
    brief = brief_of(replace(designs[0], furniture=designs[0].furniture[:2], target=None))
    world = Placing([brief], furnisher._policy, Moves(), furnisher._categories)
    chosen, first = Placing.chosen, []

    def noted(self, state: Any, stood: Any, uniform: np.ndarray, *more: Any) -> Chosen:
        first.append(uniform[0, 0])
        return chosen(self, state, stood, uniform, *more)

    monkeypatch.setattr(Placing, "chosen", noted)
    monkeypatch.setattr(furnishing, "wrong_at", lambda _, state: np.full(len(state.room), harm))
    furnisher._furnished(world, np.arange(1), world.rooms.size_rank(), [[]])
    assert (len(first), len({*first})) == (calls, calls - 1)


def test_what_stands_moves_only_where_it_gains_something(furnisher, designs) -> None:
    world = Placing([brief_of(designs[0])], furnisher._policy, Moves(), furnisher._categories)
    state = world.rooms.begin(np.zeros(1, int), np.random.default_rng(0))
    ends = Options(np.zeros((1, 1, 2)), np.zeros((1, 1), int), np.zeros((1, 1)), [[np.zeros((1, 2))]])
    stay = world._or_stay(state, np.ones(1, dtype=bool), ends)
    (value,) = world.value(state, np.zeros(1, int), state.quarter[:, 0], state.center[:, 0])
    assert stay.value[0].tolist() == [pytest.approx(value + BETTER), 0]
    assert stay.center[0, 0].tolist() == state.center[0, 0].tolist()


@pytest.mark.parametrize(("off", "behind", "ends"), [(0.1, 0.0, 1.0), (0.3, 0.0, 1.3), (0.1, 0.5, 1.5)])
def test_what_ends_just_before_a_wall_or_an_item_slides_back_to_it(furnisher, off, behind, ends) -> None:
    stands = (Item("box", (behind, 2.8), (behind / 2, 1.5), 0.0),) if behind else ()
    brief = rectangular_room(5, 3, Item("bed", (2.0, 1.5), None, 0.0), others=stands, target=None)
    chosen = chosen_at(np.array([[behind + 1.0 + off, 1.5]]), 1)  # off its wall
    backed = slid(furnisher, brief, chosen, BACK)
    assert backed.center.tolist() == [[pytest.approx(ends, abs=1e-5), 1.5]]
    assert backed.way[0][-1].tolist() == backed.center[0].tolist()
    assert backed.value == chosen.value


def test_nothing_slides_back_where_something_would_be_wrong_by_it(furnisher) -> None:
    door = opening("door", -0.2, 1.0, 0.0, 2.0)
    brief = rectangular_room(5, 3, Item("bed", (2.0, 1.5), None, 0.0), openings=(door,), target=None)
    # 35 cm before a door, of which 30 are to be free; and where something is wrong already, which may go on.
    for x, harm, ends in ((1.35, 1, 1.35), (1.1, FAULT, 1.0)):
        backed = slid(furnisher, brief, chosen_at(np.array([[x, 1.5]]), harm), BACK)
        assert backed.center[0, 0] == pytest.approx(ends, abs=1e-5)


@pytest.mark.parametrize(
    ("y", "next_at", "ends"), [(1.1, 2.0, 1.0), (1.4, 2.0, 1.5), (1.2, 2.0, 1.2), (1.0, 1.6, 1.0), (1.1, 1.6, 1.1)]
)
def test_a_narrow_gap_to_the_nearer_neighbour_is_closed_but_not_by_opening_another(furnisher, y, next_at, ends) -> None:
    stands = tuple(Item("counter", (0.6, 0.5), (0.3, y), 0.0) for y in (0.25, next_at + 0.25))
    brief = rectangular_room(5, 3, Item("cooktop", (0.6, 1.0), None, 0.0), others=stands, target=None)
    beside = slid(furnisher, brief, chosen_at(np.array([[0.3, y]]), 0), SIDEWAYS)
    assert beside.center.tolist() == [[0.3, pytest.approx(ends, abs=1e-5)]]


def test_only_what_belongs_at_a_wall_slides_sideways(furnisher, monkeypatch) -> None:
    there = np.array([[0.3, 1.4]])
    monkeypatch.setattr(
        Placing, "_ends", lambda *_: Options(there[None], np.zeros((1, 1), int), np.ones((1, 1)), [[there]])
    )
    for category, ends in (("bed", 1.5), ("desk", 1.4)):
        brief = rectangular_room(5, 2, Item(category, (0.6, 1.0), None, 0.0), target=None)
        world = Placing([brief], furnisher._policy, Moves(), furnisher._categories)
        state, nothing = world.rooms.empty(np.zeros(1, int)), np.zeros(1, dtype=bool)
        chosen = world.chosen(state, nothing, spread(0, 128), [()])
        assert chosen.center[0, 1] == pytest.approx(ends, abs=1e-5)


@pytest.mark.parametrize("tucked", [True, False])
def test_a_chair_under_a_table_does_not_slide_out(furnisher, monkeypatch, tucked) -> None:
    there = np.array([[1.0, 1.5]])  # 10 cm under a table
    monkeypatch.setattr(
        Placing, "_ends", lambda *_: Options(there[None], np.zeros((1, 1), int), np.ones((1, 1)), [[there]])
    )
    table = Item("table", (1.0, 1.0), (1.65, 1.5), 0.0)
    brief = rectangular_room(4, 3, Item("chair", (0.5, 0.5), None, 0.0, tucked=tucked), others=(table,), target=None)
    world = Placing([brief], furnisher._policy, Moves(), furnisher._categories)
    state, nothing = world.rooms.empty(np.zeros(1, int)), np.zeros(1, dtype=bool)
    (center,) = world.chosen(state, nothing, spread(0, 128), [()]).center.tolist()
    assert (center == there.tolist()[0]) == tucked


def test_places_along_walls_are_those_to_which_nothing_bars_the_way_and_beside_them(furnisher) -> None:
    bed, wardrobe = Item("bed", (2.0, 1.5), None, None), Item("wardrobe", (0.4, 1.0), None, None)
    brief = rectangular_room(5, 4, bed, others=(wardrobe,), target=None)
    world = Placing([brief], furnisher._policy, Moves(), furnisher._categories)
    first, second = np.zeros(1, int), np.ones(1, int)
    state = world.rooms.put(world.rooms.empty(first), second, np.array([[1.5, 2.5]]), first)._replace(moving=first)
    starts = world._starts(state, spread(0, QUARTERS * STARTS))
    options, found = world._along_walls(state, starts), set()

    def bed_at(center: np.ndarray, quarter: int) -> tuple[Room, Item]:
        layout = world.rooms.layout(world.rooms.put(state, first, center[None], np.array([quarter])), 0)
        return layout, layout.furniture[0]

    def rounded(item: Item) -> tuple[float, ...]:
        return (item.degrees, *np.round(item.center, 3).tolist())

    for k in np.flatnonzero(np.isfinite(options.value[0])):
        layout, there = bed_at(options.center[0, k], options.quarter[0, k])
        if brief.indoor.covers(bed_at(starts.center[0, k // 3], options.quarter[0, k])[1].footprint):
            assert oddities.sides_off_walls([layout], Items.of([layout]), first)[0, oddities.BACK] == pytest.approx(
                0, abs=1e-5
            )
        begin, *_, end = way = options.way[0][k].tolist()
        assert (begin, end) == (starts.center[0, k // 3].tolist(), options.center[0, k].tolist())
        assert (np.abs(np.diff(way, axis=0)).min(1) < 1e-5).all()  # each slide is along one wall
        found.add(rounded(there))
    assert len(found) == np.isfinite(options.value).sum()  # each once
    assert {(0.0, 1.0, 0.75), (90.0, 0.75, 1.0), (180.0, 4.0, 3.25), (270.0, 4.25, 3.0)} <= found  # into corners
    free, barred = set(), 0
    for center, quarter in zip(starts.center[0], starts.quarter[0], strict=True):
        layout, begins = bed_at(center, quarter)
        if not brief.indoor.covers(begins.footprint):
            continue  # one that begins in a wall may end before it
        x, y = center.tolist()
        ends = replace(begins, center={0: (1.0, y), 90: (x, 1.0), 180: (4.0, y), 270: (x, 3.0)}[begins.degrees])
        swept = union_all([begins.footprint, ends.footprint]).convex_hull
        if swept.intersection(layout.furniture[1].footprint).area > 1e-3:
            barred += 1
        else:
            free.add(rounded(ends))
    assert barred
    assert free <= found


def test_where_all_else_is_odd_an_item_goes_to_a_wall(furnisher, monkeypatch) -> None:
    there = np.array([[2.5, 2.0]])
    off = Options(there[None], np.zeros((1, 1), int), np.ones((1, 1)), [[there]])
    for name in ("_ends", "_beside", "_starts"):
        monkeypatch.setattr(Placing, name, lambda *_: off)
    brief = rectangular_room(5, 4, Item("bed", (2.0, 1.5)), target=None)
    world = Placing([brief], furnisher._policy, Moves(), furnisher._categories)
    state, nothing = world.rooms.empty(np.zeros(1, int)), np.zeros(1, dtype=bool)
    assert world.chosen(state, nothing, spread(0, 128), [()]).harm.tolist() == [1]
    # Of the places at the wall the lowest is valued most.
    monkeypatch.setattr(Placing, "best_values", lambda placing, scene, center: -np.asarray(center)[:, 1])
    chosen = world.chosen(state, nothing, spread(0, 128), [()], walls=True)
    assert (chosen.center.tolist(), chosen.harm.tolist()) == (
        [[pytest.approx(1.0, abs=1e-5), pytest.approx(0.75, abs=1e-5)]],
        [0],
    )
    monkeypatch.setattr(placing, "TOUCHING", -1.0)  # all are stopped on their way
    assert world.chosen(state, nothing, spread(0, 128), [()], walls=True).harm.tolist() == [1]
    without_slides = Placing([brief], furnisher._policy, Moves(slide=False), furnisher._categories)
    assert without_slides.chosen(state, nothing, spread(0, 128), [()], walls=True).harm.tolist() == [1]


def test_of_places_along_walls_every_one_is_tried(furnisher, monkeypatch) -> None:
    tried = []
    monkeypatch.setattr(placing, "best_of", lambda *args, **named: tried.append(named) or best_of(*args, **named))
    brief = rectangular_room(5, 4, Item("bed", (2.0, 1.5)), target=None)
    world = Placing([brief], furnisher._policy, Moves(), furnisher._categories)
    monkeypatch.setattr(choosing, "wrong_at", lambda rooms, state: np.full(len(state.room), FAULT))
    state, nothing = world.rooms.empty(np.zeros(1, int)), np.zeros(1, dtype=bool)
    world.chosen(state, nothing, spread(0, 128), [()], walls=True)
    assert [each.get("every_one", False) for each in tried[:4]] == [False, False, False, True]


def test_a_room_that_is_still_wrong_is_furnished_with_places_along_walls_from_the_usual_order(
    furnisher, monkeypatch
) -> None:
    bed, wardrobe = Item("bed", (2.0, 1.5), (1.0, 0.75)), Item("wardrobe", (0.6, 1.0), (2.0, 2.0))
    off = rectangular_room(4, 3, bed, others=(wardrobe,), target=None)
    well = replace(off, furniture=(bed, replace(wardrobe, center=(0.3, 2.5))))
    monkeypatch.setattr(furnishing, "AFRESH", 1)
    monkeypatch.setattr(furnishing, "ALONG_WALLS", 2)
    asked: list[tuple[bool, list[int]]] = []

    def furnished(world: Placing, which: np.ndarray, rank: np.ndarray, known: Any, walls: bool) -> list[Furnished]:
        asked.append((walls, rank[0].argsort(kind="stable").tolist()))
        return [Furnished(well if walls else off, 0.0)]

    monkeypatch.setattr(furnisher, "_furnished", furnished)
    ((best,),) = furnisher.furnish([brief_of(off)], 1, 0)
    assert asked == [(False, [0, 1]), (False, [1, 0]), (True, [0, 1])]
    assert best.layout == well


@pytest.fixture(scope="module")
def upright(content_furnisher: None, furnisher: Furnisher, designs: list[Room]) -> tuple[Room, Furnished]:
    """A brief in which the first item stands, and its layout."""
    room = replace(designs[0], furniture=designs[0].furniture[:3], target=None)
    first, *others = brief_of(room).furniture
    brief = replace(room, furniture=(*others, replace(first, center=room.furniture[0].center, rotation=0.0)))
    return brief, furnisher.furnish([brief], 1, 0)[0][0]


@pytest.mark.parametrize("lean", [12.0, 30.0, 60.0])
def test_a_room_that_leans_is_furnished_as_if_it_stood_upright(furnisher, upright, lean) -> None:
    brief, of_upright = upright
    ((leaning,),) = furnisher.furnish([brief.rotated(lean)], 1, 0)
    assert leaning.layout.outline == brief.rotated(lean).outline
    assert leaning.layout.furniture[-1] == brief.rotated(lean).furniture[-1]  # it stood there: as it was, exactly
    turned = of_upright.layout.rotated(lean)
    for one, other in zip(leaning.layout.furniture, turned.furniture, strict=True):
        np.testing.assert_allclose(one.center, other.center, atol=1e-3)
        assert one.degrees % 360 == pytest.approx(other.degrees % 360)
    (_, center, degrees), item = leaning.path[-1], leaning.layout.furniture[leaning.path[-1][0]]
    assert item.center == pytest.approx(center)
    assert item.degrees == pytest.approx(degrees)


def test_where_an_item_fits_one_way_alone_no_place_of_the_grid_may_be_of_another(furnisher) -> None:
    room = rectangular_room(2.05, 4, Item("bed", (2.0, 1.0), (1.025, 2.0), 0.0), target=None, walls=())
    centers, value, degrees = furnisher.values(room, 0, 0.6)  # along x it is 5 cm that the bed can stand at
    assert len(centers) == len(value) == len(degrees) > 0
    assert set(degrees) <= {90.0, 270.0}


@pytest.mark.parametrize("lean", [30.0])
def test_values_and_moves_of_a_room_that_leans_are_those_of_the_upright_one(furnisher, designs, lean) -> None:
    room = replace(designs[0], target=None)
    for (name, to, value), (other_name, other_to, other_value) in zip(
        furnisher.moves(room, 0), furnisher.moves(room.rotated(lean), 0), strict=True
    ):
        assert name == other_name
        assert other_to == pytest.approx(tuple(rotation(lean) @ to), abs=1e-4)
        assert value == pytest.approx(other_value, abs=1e-3)
    centers, _, degrees = furnisher.values(room.rotated(lean), 0, 0.4)
    assert room.rotated(lean).envelope.buffer(1e-6).covers(MultiPoint(centers))
    assert set(np.round(degrees % 90, 6)) == {lean}


def test_a_faulty_room_is_furnished_anew_and_the_best_kept(furnisher, thorough, remembered, monkeypatch) -> None:
    sizes = {"bed": (1.0, 1.0), "desk": (0.8, 0.5), "wardrobe": (0.5, 0.5)}
    items = [Item(category, size, rotation=0.0) for category, size in sizes.items()]
    easy = rectangular_room(6, 5, items[0], others=tuple(items[1:]), target=None)  # faultless at once
    briefs = [*(brief_of(room) for room in design_rooms("bathroom", "test", 0, 14).rooms[::3]), easy]
    monkeypatch.setattr(furnishing, "ELSEWHERE", 0)
    monkeypatch.setattr(furnisher, "_policy", replace(furnisher._policy, snap=0.0))  # in line, its bed is off its wall
    tried = [one.layout for one, *_ in furnisher.furnish(briefs, 1, 0)]
    monkeypatch.setattr(furnishing, "AFRESH", 0)
    once = [one.layout for one, *_ in furnisher.furnish(briefs, 1, 0)]
    before, after = wrong(once), wrong(tried)
    assert (after <= before).all()
    assert (after < before).any()
    assert before[-1] == 0
    assert tried[-1] == once[-1]


def test_where_a_fault_is_left_the_largest_item_goes_elsewhere_and_the_best_is_kept(
    furnisher, thorough, remembered, monkeypatch
) -> None:
    easy = rectangular_room(6, 5, Item("bed", (1.0, 1.0)), target=None)  # faultless at once
    briefs = [*(brief_of(room) for room in design_rooms("balcony", "test", 0, 6).rooms[2:]), easy]
    layouts = {}
    monkeypatch.setattr(furnishing, "AFRESH", 0)
    for times in (0, 1, 2):
        monkeypatch.setattr(furnishing, "ELSEWHERE", times)
        layouts[times] = [one.layout for one, *_ in furnisher.furnish(briefs, 1, 0)]
    faults_left = {times: wrong(found) for times, found in layouts.items()}
    assert (faults_left[2] <= faults_left[1]).all()
    assert (faults_left[1] <= faults_left[0]).all()
    assert (faults_left[2] < faults_left[0]).any()
    largest = RoomsSimulator(briefs, None, furnisher._moves, Reward()).size_rank().argmin(1)
    for k, (before, after) in enumerate(zip(layouts[0], layouts[2], strict=True)):
        assert (faults_left[2][k] < faults_left[0][k]) == (after != before)
        if after != before:
            assert before.furniture[largest[k]] != after.furniture[largest[k]]


@pytest.mark.parametrize(
    ("desk_at", "times"),
    [
        (None, 3),  # once, anew as the desk comes first, and with the bed elsewhere
        ((1.0, 0.75), 2),  # both are as wrong: the order stays, in which it was furnished once
    ],
)
def test_a_room_is_not_furnished_anew_in_an_order_that_led_nowhere(furnisher, monkeypatch, desk_at, times) -> None:
    bed, desk = Item("bed", (2.0, 1.5), (1.0, 0.75)), Item("desk", (1.0, 1.0), desk_at)
    room = rectangular_room(4, 3, bed, others=(desk,), target=None)
    monkeypatch.setattr(furnishing, "AFRESH", 2)
    answers = [[Furnished(room, 0.0)], *[[None]] * (times - 1)]
    monkeypatch.setattr(furnisher, "_furnished", lambda *_: answers.pop(0))
    ((found,),) = furnisher.furnish([brief_of(room)], 1, 0)
    assert found.layout == room
    assert not answers


@pytest.mark.parametrize(
    ("bed_at", "wardrobe_at"),
    [
        ((1.2, 2.25), (3.8, 2.0)),  # the bed is off its wall, the wardrobe in it
        ((1.0, 2.25), (3.4, 2.0)),  # the bed is at its wall, the wardrobe off it
    ],
)
def test_what_is_most_wrong_comes_first_when_a_room_is_furnished_anew(
    furnisher, monkeypatch, bed_at, wardrobe_at
) -> None:
    door = opening("door", 0.2, -0.2, 1.1, 0.0)
    bed, wardrobe = Item("bed", (2.0, 1.5), bed_at, 0.0), Item("wardrobe", (0.6, 1.0), wardrobe_at, 180.0)
    room = rectangular_room(4, 3, bed, others=(wardrobe,), openings=(door,), target=None)
    ranks = []
    monkeypatch.setattr(
        furnisher, "_furnished", lambda _, __, rank, *___: ranks.append(rank.copy()) or [Furnished(room, 0.0)]
    )
    furnisher.furnish([brief_of(room)], 1, 0)
    assert (ranks[1] < ranks[0]).tolist() == [[False, True]]


def test_a_room_in_which_nothing_is_to_be_placed_is_its_own_layout(furnisher: Furnisher, designs: list[Room]) -> None:
    whole = replace(designs[0], target=None)
    (done,), (best,) = furnisher.furnish([whole, brief_of(designs[1])], 1, 0)
    assert done.layout == whole
    assert missing(best.layout) == []


@pytest.mark.parametrize("beside", [True, False])
def test_where_every_end_is_faulty_a_move_more_is_made_or_a_drawn_place_taken(
    furnisher: Furnisher, thorough: None, monkeypatch: pytest.MonkeyPatch, beside: bool
) -> None:
    rooms, _ = small_room()
    way = np.array([(1.5, 1.2), (1.0, 0.75)])
    ends = Options(way[None, 1:], np.zeros((1, 1), dtype=int), np.array([[9.0]]), [[way]])
    monkeypatch.setattr(Placing, "_ends", lambda *_: ends)
    if not beside:
        monkeypatch.setattr(Placing, "_beside", lambda *_: ends)
    ((best,),) = furnisher.furnish([rooms.rooms[0]], 1, 0)
    assert faults(best.layout) == []
    places = [center for _, center, _ in best.path]
    assert best.layout.furniture[0].center == places[-1]
    if beside:
        assert places[:-1] == [tuple(place) for place in way.tolist()]
    else:  # drawn, and slid from there
        along, across = np.abs(np.diff(places, axis=0)).T
        assert len(places) <= 3
        assert (np.minimum(along, across) < 1e-5).all()
        assert (np.maximum(along, across) < GAP).all()
        assert not {*places} & {tuple(place) for place in way.tolist()}


def test_values_of_places_are_those_of_the_best_way_to_face_there(furnisher: Furnisher, designs: list[Room]) -> None:
    room = replace(designs[0], target=None)
    center, value, degrees = furnisher.values(room, 0, 0.5)
    assert len(center) > 10
    assert np.isfinite(value).all()
    item = room.furniture[0]
    for k in (0, len(center) // 2, len(center) - 1):
        here = replace(item, center=tuple(center[k].tolist()), rotation=float(degrees[k]))
        assert room.envelope.buffer(1e-5).covers(here.footprint)
        there = replace(room, furniture=(here, *room.furniture[1:]))
        best = furnisher.moves(there, 0)[0][2]
        assert best == pytest.approx(value[k], abs=1e-4)


def test_what_stands_is_thought_of_as_what_is_to_be_placed(method: Method) -> None:
    (design,) = design_rooms("study", "test", 0, 1).rooms
    categories = categories_of([design])
    furnisher = Furnisher(Agent(q_network(method, categories, np.random.SeedSequence(0), CPU), method, categories))
    k = next(k for k, item in enumerate(design.furniture) if item.category == "chair")
    thoughts = []
    for tucked in (False, True):  # whether it stands under something now is no matter
        furniture = (*design.furniture[:k], replace(design.furniture[k], tucked=tucked), *design.furniture[k + 1 :])
        room = replace(design, furniture=furniture, target=None)
        _, value, _ = furnisher.values(room, k, 0.5)
        thoughts.append([*value, *(value for _, _, value in furnisher.moves(room, k))])
    assert thoughts[0] == thoughts[1]


def test_what_stands_nowhere_has_no_moves(furnisher: Furnisher, designs: list[Room]) -> None:
    with pytest.raises(ValueError, match=r"^item 0 of room .* stands nowhere"):
        furnisher.moves(brief_of(designs[0]), 0)


def test_an_item_alone_in_a_room_without_walls_is_put_into_line(method: Method) -> None:
    room = rectangular_room(4, 3, Item("bed", (2.0, 1.5), (1.0, 1.0)), walls=(), target=None)
    snapping = replace(method, snap=0.015)
    furnisher = Furnisher(Agent(q_network(snapping, ["bed"], np.random.SeedSequence(0), CPU), snapping, ["bed"]))
    ((best,),) = furnisher.furnish([brief_of(room)], 1, 0)
    assert missing(best.layout) == []


def test_what_ends_a_little_off_a_line_is_put_in_line(furnisher: Furnisher, designs: list[Room]) -> None:
    world = Placing([brief_of(designs[0])], furnisher._policy, Moves(), furnisher._categories)
    state, first = world.rooms.empty(np.zeros(1, int)), np.zeros(32, int)
    scene = world.scenes_of(state, first, first)
    generator = torch.Generator().manual_seed(0)
    run = furnisher._policy.rollout(world.scenes, world.observe, scene, world.scenes.starts(scene, generator).numpy())
    off = out_of_line(world.observe(scene, torch.as_tensor(run.final))).abs()
    assert ((off < 1e-5) | (off > furnishing.SNAP)).all()
    assert (np.diff(run.settling, axis=0) != 0).any()


def test_moves_are_legal_lead_where_they_say_and_come_by_value(furnisher: Furnisher, designs: list[Room]) -> None:
    room = replace(designs[0], target=None)
    moves = furnisher.moves(room, 0)
    item = room.furniture[0]
    assert [value for _, _, value in moves] == sorted((value for _, _, value in moves), reverse=True)
    x, y = item.center
    turn = np.deg2rad(item.degrees)
    ahead = np.cos(turn), np.sin(turn)
    for name, center, _ in moves:
        assert room.envelope.buffer(1e-5).covers(replace(item, center=center).footprint)
        off = np.array(center) - (x, y)
        side = {"ahead": ahead, "back": (-ahead[0], -ahead[1])}.get(name.split()[-1])
        if side is not None:
            assert off @ side == pytest.approx(np.hypot(*off), abs=1e-6)
        if name[0].isdigit():
            assert np.hypot(*off) == pytest.approx(float(name.split()[0]) / 100, abs=1e-5)


@pytest.mark.parametrize("first", [0, 128, 12_800])
def test_starts_are_spread_evenly_and_each_sweep_looks_elsewhere(first: int) -> None:
    numbers = spread(first, 128)
    assert numbers.shape == (3, 128)
    assert ((numbers >= 0) & (numbers < 1)).all()
    quarter = np.digitize(numbers[1:], [0.25, 0.5, 0.75])  # of the square, sixteen cells of eight each
    counts = np.bincount(4 * quarter[0] + quarter[1], minlength=16)
    assert counts.min() >= 6
    assert counts.max() <= 10
    assert not np.isin(numbers, spread(first + 128, 128)).any()
