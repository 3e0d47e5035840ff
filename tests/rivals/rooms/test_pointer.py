"""The pointer in sequence: what it is trained on, that it learns it, and how it furnishes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
import torch

from layoutrl import InputError
from layoutrl.env.measures import measured
from layoutrl.env.observation import COLUMNS, COS, SIN, X, Y
from layoutrl.env.rooms_observation import MOVING
from layoutrl.env.simulator import Moves
from layoutrl.env.symmetry import symmetries
from layoutrl.rivals.budgets import updates_budget
from layoutrl.rivals.rooms import pointer
from layoutrl.rivals.rooms.pointer import Poses, RoomsPointer, furnish, train_rooms_pointer
from layoutrl.rivals.supervised import Loss
from layoutrl.rooms.brief import brief_of, categories_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import SYMMETRIES, Item, Room
from tests.builders import assert_seeded, opening, rectangular_room

STANDS = len(COLUMNS)
ROOM_COLUMNS = (*COLUMNS, "stands", "tucked")
DOOR = opening("door", 0.3, -0.2, 1.2, 0)
MIDDLE = np.array([2.0, 1.5])  # of a room of 4 by 3 m
SEED = np.random.SeedSequence(0)


def bedroom() -> Room:
    """A bed at the wall above between two nightstands, and a wardrobe at the wall on the right; no symmetry."""
    stand = Item("nightstand", (0.4, 0.4), (0.4, 2.8), 270.0)
    return rectangular_room(
        4.0,
        3.0,
        Item("bed", (2.0, 1.4), (1.3, 2.0), 270.0),
        others=(
            stand,
            replace(stand, center=(2.2, 2.8)),
            Item("wardrobe", (0.6, 1.8), (3.7, 1.2), 180.0),
            Item("rug", (0.5, 0.5), (2.6, 0.9), form="circle"),
        ),
        openings=(DOOR,),
    )


def designed(count: int) -> list[Room]:
    return design_rooms("bedroom", "train", 0, count).rooms


def untrained(rooms: Sequence[Room], seed: int = 0) -> RoomsPointer:
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return RoomsPointer(categories_of(rooms), width=16)


def drawn_batch(
    monkeypatch: pytest.MonkeyPatch, rooms: list[Room], batch: int, mirrors_alike: bool = True
) -> tuple[torch.Tensor, Poses, Loss]:
    """One batch that a network is trained on, and its loss, instead of the training."""
    monkeypatch.setattr(pointer, "trained", lambda make, draw, loss, *_: (draw, loss))
    draw, loss = train_rooms_pointer(rooms, updates_budget(1), SEED, batch=batch, mirrors_alike=mirrors_alike)
    return *draw(torch.Generator().manual_seed(0)), loss


def test_it_is_trained_on_rooms_that_hold_the_largest_and_points_where_equals_may_stand(monkeypatch):
    room = bedroom()
    seen, right, _ = drawn_batch(monkeypatch, [room], 800)
    categories = categories_of([room])
    by_category = {item.category: item for item in room.furniture}
    largest_first = ["bed", "wardrobe", "rug", "nightstand", "nightstand"]
    assert seen.shape[:2] == (800, 4)
    met = set()
    for elements, center, quarter, free in zip(seen[:100], right.center, right.quarter, right.free, strict=False):
        assert (elements[:, 0, MOVING] == 1).all()
        assert (elements[:, 1:, MOVING] == 0).all()
        assert (elements[:, 0, X : Y + 1] == 0).all()
        rows = elements[0, 1:]
        rows = rows[rows[:, len(ROOM_COLUMNS) :].any(1)]
        names = [categories[int(row[len(ROOM_COLUMNS) :].argmax())] for row in rows]
        standing = [name for name, row in zip(names, rows, strict=True) if row[STANDS] == 1]
        to_come = [name for name, row in zip(names, rows, strict=True) if row[STANDS] == 0]
        mine = categories[int(elements[0, 0, len(ROOM_COLUMNS) :].argmax())]
        assert sorted(standing) == sorted(largest_first[: len(standing)])
        assert mine == largest_first[len(standing)]
        assert sorted(to_come) == sorted(largest_first[len(standing) + 1 :])

        places = {tuple(place) for place in np.round(center[free].numpy() + MIDDLE, 3).tolist()}
        if mine == "nightstand":
            taken = {
                tuple(np.round(row[X : Y + 1].numpy() + MIDDLE, 3).tolist())
                for name, row in zip(names, rows, strict=True)
                if name == mine and row[STANDS] == 1
            }
            assert places | taken == {(0.4, 2.8), (2.2, 2.8)}
            assert not places & taken
            met.add(frozenset(places))
        else:
            assert places == {by_category[mine].center}
        if mine != "rug":
            assert {90.0 * q for q in quarter[free].tolist()} == {by_category[mine].rotation}
    assert len(met) == 3  # both are free, the one, the other


@pytest.mark.parametrize(("alike", "k"), [(True, k) for k in range(8)] + [(False, k) for k in range(4)])
def test_in_each_symmetry_it_is_shown_the_turned_room_and_its_poses(alike, k, monkeypatch):
    room = bedroom()
    seen, right, _ = drawn_batch(monkeypatch, [room], 80 if alike else 40, alike)
    turned = room.turned(*SYMMETRIES[k])
    origin = np.reshape(turned.envelope.bounds, (2, 2)).mean(0)
    poses = {
        (item.category, *np.round(item.center, 3).tolist(), item.degrees % 360)
        for item in turned.furniture
        if item.form == "rectangle"
    }
    categories = categories_of([room])
    for b in range(10 * k, 10 * k + 10):
        name = categories[int(seen[b, 0, 0, len(ROOM_COLUMNS) :].argmax())]
        for n in np.flatnonzero(right.free[b]) if name != "rug" else ():
            cos, sin = seen[b, right.quarter[b, n], 0, [COS, SIN]].tolist()
            degrees = round(np.rad2deg(np.arctan2(sin, cos))) % 360
            x, y = (right.center[b, n].numpy() + origin).round(3).tolist()
            assert (name, x, y, degrees) in poses


def test_its_loss_is_least_at_a_free_place_of_the_designers_turned_as_there(monkeypatch):
    _, right, loss = drawn_batch(monkeypatch, designed(4), 64)
    for last in (False, True):  # any of the free places will do
        which = right.free.float()
        which = (which.flip(1).argmax(1) - which.shape[1] + 1).abs() if last else which.argmax(1)
        every = torch.arange(64)
        place = right.center[every, which][:, None, :, None].expand(-1, 4, -1, 1)
        score = 50 * torch.nn.functional.one_hot(right.quarter[every, which], 4).float()
        weight = torch.zeros_like(place)
        assert abs(loss((score, weight, place), right)) < 1e-3
        assert loss((score, weight, place + 0.1), right) > 9  # 10 cm along both axes, each BREADTH counts 1
        assert loss((score.roll(1, 1), weight, place), right) > 40
        assert loss((torch.zeros_like(score), weight, place), right) > 0.5


def test_a_network_hangs_on_the_seed_and_on_no_other_randomness():
    rooms = [bedroom()]

    def weights(seed: int) -> torch.Tensor:
        network = train_rooms_pointer(rooms, updates_budget(2), np.random.SeedSequence(seed), batch=16)
        return torch.cat([p.detach().flatten() for p in network.parameters()])

    assert_seeded(weights)


def test_it_learns_one_room_and_furnishes_it_again():
    room = bedroom()
    room = replace(room, furniture=room.furniture[:2])
    network = train_rooms_pointer([room], updates_budget(500), np.random.SeedSequence(1), batch=16)
    (layout,) = furnish(network, [brief_of(room)])
    found = measured([layout], [room])
    assert found.iou.item() > 0.9
    assert found.facing.item() == 1


def test_the_largest_is_placed_first_and_all_are(monkeypatch):
    states = []

    def spied(observe, state):
        states.append(state)
        return each_way(observe, state)

    each_way = pointer.each_way
    monkeypatch.setattr(pointer, "each_way", spied)
    brief = brief_of(bedroom())
    (layout,) = furnish(untrained([brief]), [brief])
    categories = [brief.furniture[int(state.moving)].category for state in states]
    assert categories == ["bed", "wardrobe", "rug", "nightstand", "nightstand"]
    assert [int(state.stands.sum()) for state in states] == [0, 1, 2, 3, 4]
    assert len({int(state.moving) for state in states}) == 5
    assert all(item.center is not None and item.rotation is not None for item in layout.furniture)


def test_layouts_are_briefs_with_poses_within_the_envelope():
    briefs = [brief_of(room) for room in designed(5)]
    layouts = furnish(untrained(briefs), briefs)
    for brief, layout in zip(briefs, layouts, strict=True):
        assert brief_of(layout).furniture == brief.furniture
        assert replace(layout, furniture=brief.furniture) == brief
        assert all(layout.holds(item) for item in layout.furniture)


def test_a_room_is_furnished_alike_whatever_others_are():
    rooms = designed(4)
    briefs = [brief_of(room) for room in rooms]
    network = untrained(rooms)
    together = furnish(network, briefs)
    for brief, layout in zip(briefs, together, strict=True):
        (alone,) = furnish(network, [brief])
        for item, other in zip(alone.furniture, layout.furniture, strict=True):
            assert item.rotation == other.rotation
            np.testing.assert_allclose(item.center, other.center, atol=1e-5)


def test_what_stands_stays_and_a_given_rotation_is_kept():
    room = bedroom()
    bed, *others = room.furniture
    brief = replace(room, furniture=(bed, *(replace(item, center=None, rotation=90.0) for item in others)), target=None)
    (layout,) = furnish(untrained([room]), [brief])
    assert layout.furniture[0] == bed
    for item, given in zip(layout.furniture[1:], brief.furniture[1:], strict=True):
        assert item.center is not None
        assert item.rotation == given.rotation


def test_what_fits_nowhere_is_refused():
    brief = brief_of(rectangular_room(2, 2, Item("bed", (9.0, 9.0), (1.0, 1.0))))
    with pytest.raises(InputError, match="the bed does not fit"):
        furnish(untrained([brief]), [brief])


class Pointing(torch.nn.Module):
    """It likes x and y, metres from the middle of the room, the first best, and to face right; it sees nothing."""

    def __init__(self, categories: Sequence[str], x: Sequence[float], y: Sequence[float]):
        super().__init__()
        self.categories, self.mirrors_alike = tuple(categories), True
        self.nothing = torch.nn.Parameter(torch.zeros(1))
        count = pointer.LIKELY
        self.center = torch.tensor([[*values, *[values[-1]] * (count - len(values))] for values in (x, y)])
        self.weight = -torch.arange(float(count)).expand(2, count)

    def forward(self, elements: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        shape = elements.shape[:2]
        score = -torch.arange(4.0).expand(shape)
        return score, *(table.expand(*shape, *table.shape) for table in (self.weight, self.center))


def pointed(monkeypatch: pytest.MonkeyPatch, brief: Room, x: Sequence[float], y: Sequence[float]) -> Room:
    """The brief, furnished by who likes these places, counted from the middle of the room, seen in one view."""
    one = symmetries(Moves())[:1]
    monkeypatch.setattr(pointer, "symmetries", lambda *_: one)
    (layout,) = furnish(Pointing(categories_of([brief]), x, y), [brief])
    return layout


def test_of_the_likely_places_the_first_is_taken_that_is_free_of_items_and_walls(monkeypatch):
    chair = Item("chair", (0.5, 0.5), None, 0.0)
    brief = rectangular_room(4.0, 3.0, Item("bed", (2.0, 1.4), (2.0, 1.5)), others=(chair,), target=None)
    for x, y, expected in (
        ([-1.0, 1.0], [-1.0, 1.0], (-1.0, -1.0)),
        ([0.0, 1.9, 1.5], [0.0, 0.1], (1.5, 0.0)),  # in the bed, in the wall
        ([0.0, 0.1], [0.0, 0.9, 0.945], (0.0, 0.945)),  # by 5 cm, by half a centimetre
        ([0.0], [0.0], (0.0, 0.0)),  # there is no other
    ):
        layout = pointed(monkeypatch, brief, x, y)
        assert layout.furniture[1].center == pytest.approx(MIDDLE + expected, abs=1e-5)
        assert layout.furniture[1].rotation == 0


@pytest.mark.parametrize("given", ["desk", "chair", None])
def test_a_tucked_chair_may_stand_under_its_desk_whichever_was_there_first(given, monkeypatch):
    items = {"desk": Item("desk", (0.6, 1.2)), "chair": Item("chair", (0.5, 0.5), tucked=True)}
    if given is not None:
        items[given] = replace(items[given], center=(2.0, 1.5))
    brief = rectangular_room(4.0, 3.0, items["desk"], others=(items["chair"],), openings=(DOOR,), target=None)
    layout = pointed(monkeypatch, brief, [0.0, 1.0], [0.0, 1.0])
    assert [item.center for item in layout.furniture] == [(2.0, 1.5), (2.0, 1.5)]
    loose = replace(brief, furniture=tuple(replace(item, tucked=False) for item in brief.furniture))
    layout = pointed(monkeypatch, loose, [0.0, 1.0], [0.0, 1.0])
    assert len({item.center for item in layout.furniture}) == 2


def test_what_stands_on_a_platform_does_not_overlap_it(monkeypatch):
    platform = Item("platform", (2.0, 2.0), (2.0, 1.5))
    brief = rectangular_room(4.0, 3.0, platform, others=(Item("dresser", (0.5, 1.0)),), target=None)
    assert pointed(monkeypatch, brief, [0.0, 1.5], [0.0, 1.0]).furniture[1].center == (2.0, 1.5)


def test_places_are_pushed_to_where_the_item_fits(monkeypatch):
    brief = rectangular_room(4.0, 3.0, Item("bed", (2.0, 1.4), None, 0.0), target=None)
    layout = pointed(monkeypatch, brief, [-9.0], [0.25])
    assert layout.furniture[0].center == pytest.approx((1.0 - 0.2, 1.75), abs=1e-4)  # into the wall, not beyond


@pytest.mark.parametrize("which", SYMMETRIES)
def test_a_turned_room_is_furnished_alike(which):
    room = bedroom()
    network = untrained([room])
    first, second = (furnish(network, [brief_of(one)])[0] for one in (room, room.turned(*which)))
    for item, other in zip(first.turned(*which).furniture, second.furniture, strict=True):
        np.testing.assert_allclose(item.center, other.center, atol=1e-4)
        assert item.form == "circle" or (item.degrees - other.degrees) % 360 == 0
