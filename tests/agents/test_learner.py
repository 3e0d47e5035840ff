"""The learner: what is refused before any training, and that it trains as its method says."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from layoutrl import InputError
from layoutrl.agents.exploration import LinearSchedule
from layoutrl.agents.learner import Learner
from layoutrl.env.reward import Reward
from layoutrl.evaluation.policy import greedy
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import Item, Room
from layoutrl.runs.config import composed
from tests.builders import rectangular_room


def learner(room: Room, *options: str, updates: int = 1) -> Learner:
    seed = np.random.SeedSequence(0)
    method = composed("train", "method.slide=false", "method.steps=[0.4]", *options).method
    return Learner([room], method, Reward(), updates, seed, seed, torch.device("cpu"))


@pytest.mark.parametrize("scope", ["item", "room"])
def test_rooms_in_which_nothing_can_move_are_refused_before_any_training(scope: str) -> None:
    room = rectangular_room(1.0, 1.0, Item("bed", (1.2, 1.2), (0.5, 0.5)))
    with pytest.raises(InputError, match=r"^method\.steps: no item can move"):
        learner(room, f"scope={scope}")


def test_whole_rooms_that_lean_are_learned_from_upright_as_they_are_furnished() -> None:
    (room,) = design_rooms("tatami", "test", 7, 1).rooms
    seen = []
    for lean in (0.0, 30.0):
        made = learner(room.rotated(lean), "scope=room", "room=tatami")
        begun = made.training(1)._running
        seen.append((begun.room, made.observe(begun.room, begun.position)))
    for upright, leaning in zip(*seen, strict=True):
        torch.testing.assert_close(leaning, upright, rtol=0, atol=1e-4)


@pytest.mark.parametrize("scope", ["item", "room"])
def test_what_can_move_need_not_be_able_to_from_the_designers_place(scope: str) -> None:
    room = rectangular_room(1.0, 1.0, Item("bed", (0.8, 0.8), (0.5, 0.5)))  # 30 cm from the middle to the outer walls
    learner(room, f"scope={scope}")


@pytest.mark.parametrize(("scope", "own"), [("item", "method.goal_iou=0.9"), ("room", "method.own_share=0.2")])
def test_a_training_is_as_the_method_has_it(scope: str, own: str) -> None:
    given = "method.near_share=0.3", "method.max_moves=8", "method.episodes=4", "method.epsilon_share=0.25"
    made = learner(rectangular_room(4, 3), f"scope={scope}", *given, own, updates=40)
    training = made.training(1)
    begun = training._running
    assert begun._age.tolist() == [0, 2, 4, 6]
    assert training._epsilon == LinearSchedule(1.0, made.method.epsilon_end, 10)
    if scope == "item":
        near, designed = begun._near
        assert (near, designed.tolist(), begun._goal_iou) == (0.3, [[2.0, 1.5]], 0.9)
    else:
        assert (begun._near_share, begun._own_share) == (0.3, 0.2)


def test_a_training_and_its_network_have_every_setting_of_the_method() -> None:
    given = {
        "discount": 0.6, "batch": 7, "warmup_moves": 11, "replay_capacity": 99, "episodes": 4, "target_period": 13,
        "double": "true", "learning_rate": 0.002, "symmetries": "false",
    }  # fmt: skip
    made = learner(rectangular_room(4, 3), *(f"method.{name}={value}" for name, value in given.items()), updates=40)
    training, dqn = made.training(3), made.dqn
    assert (training._discount, training._batch, training._warm, training._report_every) == (0.6, 7, 11, 3)
    assert (made.replay.capacity, len(training._symmetries), training._total_updates) == (99, 1, 40)
    assert (dqn.target_period, dqn.double, dqn.optimizer.param_groups[0]["lr"]) == (13, True, 0.002)


def test_values_of_every_move_are_learned_with_a_rising_discount_and_used_with_the_last() -> None:
    options = "method=paper_every_move", "method.discount_start=0.2", "method.discount=0.6", "method.episodes=4"
    made = learner(rectangular_room(4, 3), *options, updates=40)
    every_move = made.training(1)._every_move
    assert every_move is not None
    assert [every_move.discount_at(updates) for updates in (0, 40)] == pytest.approx([0.2, 0.6])
    assert greedy(made.dqn.network, made.method).discount == 0.6
