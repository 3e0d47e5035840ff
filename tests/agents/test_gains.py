"""Learning what moves gain: exact gains, the scale, the widened gap, and that optimal values stay optimal."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutrl.agents.gains import MAY_LOSE, UNIT, WIDENED, EveryMove, gains, rescaled, unscaled
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.reward import REWARD_SCALE, Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.evaluation.oracle import perfect_values
from layoutrl.rooms.room import Item
from tests.builders import learned_gains, perfect_at_gains, rectangular_room, small_rooms


def test_every_move_of_a_pose_is_a_transition_and_none_that_is_illegal_leads_anywhere():
    rooms, moves = small_rooms(), Moves((0.4, 0.1))
    exact = Simulator(rooms, moves, Reward())
    learns = EveryMove(BatchSimulator(exact), 20, (0.5, 0.8), repeats=1)
    rng = np.random.default_rng(0)
    room = rng.integers(2, size=20)
    position = exact.starts(room, rng)
    for updates, discount in ((0, 0.5), (10, 0.8)):
        legal, found = learns.transitions(torch.tensor(room), torch.tensor(position), updates, torch.Generator())
        reached, allowed = exact.destinations(room, position)
        np.testing.assert_array_equal(legal, allowed)
        reached = np.where(allowed[..., None], reached, position[:, None]).reshape(-1, 2)
        whose = np.repeat(room, moves.count)
        np.testing.assert_allclose(found.next_position, reached, atol=1.1e-6)
        np.testing.assert_array_equal(found.room, whose)
        np.testing.assert_array_equal(found.next_legal, exact.destinations(whose, reached)[1])
        left = np.repeat(position, moves.count, 0)
        gained = exact.reward(whose, reached).total - exact.reward(whose, left).total
        np.testing.assert_allclose(found.reward, gained / REWARD_SCALE, atol=1e-5)
        np.testing.assert_allclose(found.discount, np.where(allowed.ravel(), discount, 1.0), rtol=1e-6)


def test_a_move_is_repeated_as_often_as_is_drawn_while_it_is_legal_and_loses_nothing():
    rooms, moves, discount = small_rooms(), Moves((0.1, 0.02), slide=False), 0.9
    exact = Simulator(rooms, moves, Reward())
    learns = EveryMove(BatchSimulator(exact, dtype=torch.float64), 0, (discount, discount), repeats=4)
    rng = np.random.default_rng(0)
    room = rng.integers(2, size=40)
    position = exact.starts(room, rng)
    _, found = learns.transitions(torch.tensor(room), torch.tensor(position), 0, torch.Generator().manual_seed(0))
    times = 2 ** torch.randint(3, found.action.shape, generator=torch.Generator().manual_seed(0))
    ends = Counter[str]()
    for k, action in enumerate(found.action):
        whose, here, gained, made, why = room[k // moves.count, None], position[k // moves.count, None], 0.0, 0, "drawn"
        while made < times[k]:
            reached, legal = exact.destinations(whose, here)
            there = reached[:, action]
            gain = (exact.reward(whose, there).total - exact.reward(whose, here).total)[0] / REWARD_SCALE
            if not legal[0, action]:
                why = "illegal"
                break
            if made and gain < -MAY_LOSE:
                why = "loses"
                break
            here, gained, made = there, gained + discount**made * gain, made + 1
        ends[why] += 1
        np.testing.assert_allclose(found.next_position[k], here[0], atol=1.1e-6)
        np.testing.assert_allclose(found.reward[k], gained, atol=1e-6)
        np.testing.assert_allclose(found.discount[k], discount**made)
    assert min(ends[why] for why in ("drawn", "illegal", "loses")) > 5


@pytest.mark.parametrize(("loss", "times"), [(0.9e-4, 4), (1.1e-4, 1)])
def test_a_move_is_repeated_while_it_loses_no_more_than_a_hundredth_of_a_reward(loss, times):
    class Falling(EveryMove):
        def reward(self, room, position):
            return position[:, 0] / 0.1 * loss

    exact = Simulator([rectangular_room(4, 3)], Moves((0.1,), slide=False), Reward())
    learns = Falling(BatchSimulator(exact, dtype=torch.float64), 0, (0.9, 0.9), repeats=4)
    place = torch.tensor([[2.0, 1.5]] * 20, dtype=torch.float64)
    _, found = learns.transitions(torch.zeros(20, dtype=torch.int64), place, 0, torch.Generator().manual_seed(0))
    assert found.next_position[:, 0].min().item() == pytest.approx(2.0 - 0.1 * times)


def test_the_horizon_rises_over_the_first_half():
    learns = EveryMove(BatchSimulator(Simulator(small_rooms(), Moves(), Reward())), 100, (0.5, 0.9))
    assert [learns.discount_at(n) for n in (0, 25, 50, 100)] == pytest.approx([0.5, 1 - 1 / 6, 0.9, 0.9])


def test_values_far_below_the_unit_are_shown_in_it_and_tenths_of_larger_ones_at_equal_distances():
    small = torch.tensor([-1e-5, 0.0, 1e-5])
    torch.testing.assert_close(rescaled(small), small / UNIT, rtol=1e-3, atol=0)
    falling = rescaled(0.9 ** torch.arange(20.0))
    torch.testing.assert_close(-falling.diff(), torch.full((19,), 0.1054), rtol=1e-2, atol=0)


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_what_is_learned_says_what_moves_gain_and_keeps_their_order(seed):
    rng = np.random.default_rng(seed)
    q = torch.tensor(rng.normal(size=(6, 4)) * 10.0 ** rng.uniform(-5, 0, (6, 1)))
    legal = torch.tensor(rng.random((6, 4)) < 0.7)
    legal[:, 0] = True
    learned = learned_gains(q, legal)
    torch.testing.assert_close(gains(learned, legal), q, rtol=1e-6, atol=1e-12)
    assert torch.equal(gains(learned, legal).argsort(1), learned.argsort(1))
    best = rescaled(q).masked_fill(~legal, -torch.inf).amax(1, keepdim=True)
    torch.testing.assert_close((best - learned) * (1 - WIDENED), best - rescaled(q))


def test_whatever_a_network_says_is_a_finite_value():
    assert unscaled(torch.tensor([-1e9, 1e9])).isfinite().all()


def test_the_optimal_values_of_the_papers_reward_are_what_the_target_has_them_be():
    """Exact Q by branch and bound, told as gains, on the scale, widened: one update would change nothing."""
    room, discount, moves = rectangular_room(4, 3, Item("bed", (1.0, 1.0), (2.5, 1.5))), 0.6, Moves((0.5,), slide=False)
    exact = Simulator([room], moves, Reward())
    simulator = BatchSimulator(exact, dtype=torch.float64)

    network = perfect_at_gains(exact, discount)
    whose, place = (
        torch.zeros(4, dtype=torch.int64),
        torch.tensor([(0.5, 0.5), (2.0, 1.5), (2.5, 1.5), (3.5, 2.5)]).double(),
    )
    learns = EveryMove(simulator, 0, (discount, discount), repeats=1)
    legal, found = learns.transitions(whose, place, 0, torch.Generator())
    target = learns.target(network, legal, found, place, found.next_position)
    torch.testing.assert_close(target[legal].float(), network(place)[legal], rtol=0, atol=2e-2)
    assert not legal.all()


def test_what_is_learned_tells_the_q_of_the_papers_reward():
    room, discount, moves = rectangular_room(4, 3, Item("bed", (1.0, 1.0), (2.5, 1.5))), 0.6, Moves((0.5,), slide=False)
    exact = Simulator([room], moves, Reward())
    place = torch.tensor([(0.5, 0.5), (2.0, 1.5), (2.5, 1.5), (3.5, 2.5)]).double()
    whose, learns = torch.zeros(4, dtype=torch.int64), EveryMove(BatchSimulator(exact), 0, (0.5, discount))
    legal = torch.tensor(exact.destinations(whose.numpy(), place.numpy())[1])
    action, reward = legal.int().argmax(1), learns.reward(whose, place)
    q = torch.tensor(perfect_values(exact, whose.numpy(), place.numpy(), discount)).gather(1, action[:, None])[:, 0]
    learned = perfect_at_gains(exact, discount)(place)
    torch.testing.assert_close(learns.q_made(learned, legal, action, reward, 0), q.float(), rtol=0, atol=1e-4)
    nowhere = learns.q_made(learned, torch.zeros_like(legal), action, reward, 0)  # it stays for ever
    torch.testing.assert_close(nowhere, reward / (1 - discount))


def test_where_no_move_is_legal_nothing_follows():
    simulator = BatchSimulator(Simulator(small_rooms(), Moves((0.4,)), Reward()))
    learns = EveryMove(simulator, 0, (0.5, 0.5))
    legal, found = learns.transitions(
        torch.tensor([0]), torch.tensor([[1.2, 1.0]], dtype=torch.float64), 0, torch.Generator()
    )
    found = found._replace(next_legal=torch.zeros_like(found.next_legal))
    network = lambda seen: torch.zeros(len(seen), legal.shape[1])  # noqa: E731
    target = learns.target(network, legal, found, torch.zeros(1), torch.zeros(len(found.reward)))
    torch.testing.assert_close(target.flatten(), rescaled(found.reward))
