from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from layoutrl import InputError
from layoutrl.env.reward import REWARD_RANGE, Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.rooms.room import Item
from tests.builders import rectangular_room

shares = st.floats(0, 1)


def terms(
    reward: Reward, target_iou: float, elements: float, indoor: float, floor: float = 0.0
) -> tuple[float, float, float, float]:
    """r1, r2, r3 and total of one pose; the IoU with the whole room is not read here."""
    got = reward(*(np.array([value]) for value in (target_iou, elements, indoor, np.nan, floor)))
    return got.r1.item(), got.r2.item(), got.r3.item(), got.total.item()


def test_the_terms_are_the_weighted_ious_of_section_4_3() -> None:
    assert terms(Reward(), 1.0, 0.0, 1.0) == (100, 0, 0, 100)
    assert terms(Reward(), 0.5, 0.25, 0.75) == (50, -25, -25, 0)
    assert terms(Reward(), 0.0, 0.5, 0.0) == (0, -50, -100, -150)


def test_every_weight_scales_its_own_term_only() -> None:
    assert terms(Reward(10, -20, -40), 0.5, 0.5, 0.5) == (5, -10, -20, -25)
    assert terms(Reward(theta1=10), 0.5, 0.5, 0.5) == (5, -50, -50, -95)
    assert terms(Reward(theta2=-10), 0.5, 0.5, 0.5) == (50, -5, -50, -5)
    assert terms(Reward(theta3=-10), 0.5, 0.5, 0.5) == (50, -50, -5, -5)
    assert terms(Reward(theta4=-10), 0.5, 0.5, 0.5, 0.5) == (50, -50, -50, -55)


def test_the_sum_is_clipped_and_the_terms_are_not() -> None:
    assert REWARD_RANGE == (-200, 100)
    assert terms(Reward(), 0.0, 3.0, 0.0) == (0, -300, -100, -200)
    assert terms(Reward(theta1=300), 1.0, 0.0, 1.0) == (300, 0, 0, 100)
    assert terms(Reward(), 1.0, 2.5, 0.5) == (100, -250, -50, -200)


@given(shares, st.floats(0, 20), shares)
def test_the_reward_stays_in_its_range(target_iou: float, elements: float, indoor: float) -> None:
    r1, r2, r3, total = terms(Reward(), target_iou, elements, indoor)
    assert total == pytest.approx(min(max(r1 + r2 + r3, -200), 100))
    assert r1 >= 0
    assert r2 <= 0
    assert r3 <= 0


@given(shares, shares, st.floats(0, 3), shares)
def test_more_of_the_goal_pays_and_more_overlap_costs(a: float, b: float, elements: float, indoor: float) -> None:
    low, high = sorted((a, b))
    assert terms(Reward(), low, elements, indoor)[3] <= terms(Reward(), high, elements, indoor)[3]
    assert terms(Reward(), a, elements + 0.5, indoor)[3] <= terms(Reward(), a, elements, indoor)[3]
    assert terms(Reward(), a, elements, low)[3] <= terms(Reward(), a, elements, high)[3]


@pytest.mark.parametrize(
    ("inside", "center", "expected"),
    [
        ("share", (2.0, 1.5), 0.0),  # all of it indoors
        ("share", (0.0, 1.5), -50.0),  # half of it left of the outline
        ("share", (0.0, 0.0), -75.0),
        ("iou", (2.0, 1.5), -100 * 11 / 12),  # 1 of 12 square metres
        ("iou", (0.0, 1.5), -96.0),  # 0.5 shared of 12 + 1 - 0.5
    ],
)
def test_the_indoor_term_reads_the_share_of_the_item_or_the_literal_iou(
    inside: str, center: tuple[float, float], expected: float
) -> None:
    room = rectangular_room(4, 3, item=Item("bed", (1.0, 1.0), (2.0, 1.5)))
    simulator = Simulator([room], Moves(), Reward(inside=inside))
    r3 = simulator.reward(np.array([0]), np.array([center])).r3
    assert r3 == pytest.approx(expected)


def test_an_indoor_term_that_there_is_not_is_refused() -> None:
    with pytest.raises(ValueError, match="inside"):
        Reward(inside="shares")


@pytest.mark.parametrize("share", [-0.1, 1.1])
def test_facing_away_takes_a_share_of_the_iou(share: float) -> None:
    with pytest.raises(InputError, match=r"^reward\.faces_away: expected 0 to 1; got "):
        Reward(faces_away=share)


@pytest.mark.parametrize("name", ["theta1", "theta2", "theta3", "faces_away", "theta4"])
def test_weights_are_finite(name: str) -> None:
    with pytest.raises(ValueError, match=rf"^reward\.{name}: expected a finite number; got nan"):
        Reward(**{name: float("nan")})


@pytest.mark.parametrize("weight", ["1", None, [1.0]])
def test_weights_are_numbers(weight: Any) -> None:
    with pytest.raises(ValueError, match=r"^reward\.theta2: expected a finite number; got .+"):
        Reward(theta2=weight)


@pytest.mark.parametrize("array", [np.array, torch.tensor])
def test_a_batch_has_one_reward_each_as_arrays_or_tensors(array: Callable[[list[float]], Any]) -> None:
    ious = (
        array([1.0, 0.0, 0.5]),
        array([0.0, 3.0, 0.0]),
        array([1.0, 1.0, 0.5]),
        array([0.25, 0.75, 0.0]),
        array([0.0] * 3),
    )
    share, literal = Reward()(*ious), Reward(inside="iou")(*ious)
    assert share.total.tolist() == [100, -200, 0]
    assert share.iou.tolist() == [1, 0, 0.5]
    assert literal.r3.tolist() == [-75, -25, -100]
    assert literal.total.tolist() == [25, -200, -50]
    assert isinstance(share.total, type(ious[0]))
