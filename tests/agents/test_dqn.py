"""The learner: targets by hand, the legal mask, double DQN, the target network, the loss, the learning rate."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from layoutrl.agents.dqn import DQN, UpdateStats
from layoutrl.agents.replay import Transitions

A, B, C = 0, 1, 2  # the states of a chain; a state's index is its position


class Table(nn.Module):
    """Q as a table of states and actions."""

    def __init__(self, values: list[list[float]]):
        super().__init__()
        self.q = nn.Parameter(torch.tensor(values, dtype=torch.float32))

    def forward(self, state: Tensor) -> Tensor:
        return self.q[state]


def state_of(position: Tensor) -> Tensor:
    return position[:, 0].long()


def learn(agent: DQN, batch: Transitions) -> UpdateStats:
    return agent.update(batch, state_of(batch.position), state_of(batch.next_position))


def agent_of(online, target=None, *, double=False, learning_rate=0.1, total_updates=100, target_period=1000) -> DQN:
    agent = DQN(Table(online), learning_rate, total_updates, target_period, double)
    if target is not None:
        agent.target.q.copy_(torch.tensor(target, dtype=torch.float32))
    return agent


def transitions(*rows: tuple[int, int, float, float, int, list[bool]]) -> Transitions:
    """From (state, action, reward, discount, next state, legal moves there)."""
    state, action, reward, discount, next_state, legal = zip(*rows, strict=True)

    def position(states):
        return torch.tensor([(float(s), 0.0) for s in states], dtype=torch.float64)

    return Transitions(
        torch.zeros(len(rows), dtype=torch.int64),
        position(state),
        torch.tensor(action, dtype=torch.uint8),
        torch.tensor(reward, dtype=torch.float32),
        torch.tensor(discount, dtype=torch.float32),
        position(next_state),
        torch.tensor(legal),
    )


def td_target(agent: DQN, batch: Transitions) -> list[float]:
    return agent.td_target(batch, state_of(batch.next_position)).tolist()


ALL = [True, True]


@pytest.mark.parametrize("double", [False, True])
def test_the_target_on_a_chain_is_r_plus_the_discounted_best_next_value(double):
    q = [[1.0, 2.0], [3.0, 5.0], [8.0, 7.0]]
    batch = transitions(
        (A, 0, 0.5, 0.9, B, ALL),
        (B, 1, -1.0, 0.9, C, ALL),  # cut by the budget of moves: bootstraps like any other
        (B, 1, -1.0, 0.0, C, ALL),  # terminated: the reward and nothing else
    )
    assert td_target(agent_of(q, double=double), batch) == pytest.approx([0.5 + 0.9 * 5, -1 + 0.9 * 8, -1.0])


@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize("where", ["online", "target", "both"])
def test_a_high_value_of_an_illegal_action_never_enters_the_target(double, where):
    def table(high: bool) -> list[list[float]]:
        return [[0.0, 0.0, 0.0], [1.0, 1000.0 if high else 0.0, 2.0]]

    agent = agent_of(table(where != "target"), table(where != "online"), double=double)
    batch = transitions((0, 0, 0.0, 1.0, 1, [True, False, True]), (0, 0, 0.0, 1.0, 1, [True, False, False]))
    assert td_target(agent, batch) == [2.0, 1.0]


@pytest.mark.parametrize("double", [False, True])
def test_the_best_legal_value_may_be_negative(double):
    agent = agent_of([[0.0, 0.0], [-5.0, 3.0]], double=double)
    assert td_target(agent, transitions((0, 0, 1.0, 1.0, 1, [True, False]))) == [-4.0]


@pytest.mark.parametrize("double", [False, True])
def test_a_state_without_legal_moves_is_worth_nothing_more(double):
    agent = agent_of([[0.0, 0.0], [50.0, 70.0]], double=double)
    assert td_target(agent, transitions((0, 0, 0.25, 0.9, 1, [False, False]), (0, 0, 0.25, 0.9, 1, ALL))) == [
        0.25,
        63.25,
    ]


def test_double_lets_the_network_choose_and_the_target_value_and_vanilla_asks_the_target_alone():
    online, target = [[0.0, 0.0], [9.0, 1.0]], [[0.0, 0.0], [3.0, 4.0]]
    batch = transitions((0, 0, 0.0, 1.0, 1, ALL))
    assert td_target(agent_of(online, target, double=False), batch) == [4.0]  # max of the target
    assert td_target(agent_of(online, target, double=True), batch) == [3.0]  # the target's value of the online argmax


def test_each_next_state_has_its_own_mask():
    agent = agent_of([[1.0, 2.0], [3.0, 4.0]])
    batch = transitions(
        (A, 0, 0.0, 1.0, A, [True, False]), (A, 0, 0.0, 1.0, A, ALL), (A, 0, 0.0, 1.0, B, [True, False])
    )
    assert td_target(agent, batch) == [1.0, 2.0, 3.0]


def test_the_loss_is_the_mean_huber_loss_of_hand_worked_errors():
    # Errors Q - (r + discount max Q'): 0.5, 1 - (1 + 0.5 * 4) = -2 and 4 - 1 = 3.
    agent = agent_of([[0.5, 1.0], [4.0, 3.0]])
    batch = transitions((0, 0, 0.0, 0.0, 1, ALL), (0, 1, 1.0, 0.5, 1, ALL), (1, 0, 1.0, 0.0, 0, ALL))
    stats = learn(agent, batch)
    assert float(stats.loss) == pytest.approx((0.5 * 0.5**2 + (2 - 0.5) + (3 - 0.5)) / 3)
    assert float(stats.mean_q) == pytest.approx((0.5 + 1.0 + 4.0) / 3)
    assert float(stats.max_q) == pytest.approx(4.0)


def test_the_gradient_reaches_the_taken_actions_alone_and_never_the_target():
    agent = agent_of([[0.5, 1.0], [4.0, 3.0], [0.0, 6.0]], double=True)
    learn(agent, transitions((0, 0, 0.0, 0.9, 1, ALL), (1, 1, 1.0, 0.9, 2, ALL)))
    # d huber / d q = clip(q - target, -1, 1), over a mean of two: errors 0.5 - 3.6 and 3 - (1 + 5.4).
    torch.testing.assert_close(agent.network.q.grad, torch.tensor([[-0.5, 0.0], [0.0, -0.5], [0.0, 0.0]]))
    assert agent.target.q.grad is None


def test_gradients_do_not_add_up_over_updates():
    agent = agent_of([[0.5, 1.0]], learning_rate=0.0)
    batch = transitions((0, 0, 0.25, 0.0, 0, ALL))
    grads = []
    for _ in range(3):
        learn(agent, batch)
        grads.append(agent.network.q.grad.clone())
    assert torch.equal(grads[0], grads[2])
    assert grads[0].abs().sum() == 0.25


@pytest.mark.parametrize("field", ["reward", "discount"])
def test_a_column_in_place_of_a_vector_is_refused(field):
    batch = transitions((A, 0, 0.5, 0.9, B, ALL), (B, 1, -1.0, 0.9, C, ALL))
    with pytest.raises(AssertionError):
        learn(agent_of([[0.0, 0.0]] * 3), batch._replace(**{field: getattr(batch, field)[:, None]}))


@pytest.mark.parametrize("period", [1, 4])
def test_the_target_is_copied_after_every_period_of_updates_and_at_no_other_time(period):
    agent = agent_of([[0.5, 1.0]], target_period=period)
    batch = transitions((0, 0, 100.0, 0.0, 0, ALL))  # far away: every update moves the network
    last = agent.network.q.detach().clone()
    for update in range(1, 3 * period + 2):
        learn(agent, batch)
        assert agent.updates == update
        if update % period == 0:
            last = agent.network.q.detach().clone()
        assert torch.equal(agent.target.q, last)
        assert torch.equal(agent.target.q, agent.network.q) == (update % period == 0)


def test_the_target_is_a_copy_with_its_own_storage_that_nothing_trains():
    network = nn.Sequential(nn.Linear(2, 8), nn.Dropout(0.5), nn.BatchNorm1d(8), nn.Linear(8, 2))
    agent = DQN(network, 0.1, 10, 2, double=False)

    def frozen() -> bool:
        online, target = agent.network.state_dict(), agent.target.state_dict()
        assert online.keys() == target.keys()
        return all(torch.equal(online[k], target[k]) for k in online)

    assert frozen()
    trained = {id(p) for group in agent.optimizer.param_groups for p in group["params"]}
    assert trained == {id(p) for p in agent.network.parameters()}
    batch = transitions((0, 0, 5.0, 0.9, 1, ALL), (1, 1, 3.0, 0.9, 0, ALL))
    for update in range(1, 5):
        agent.update(batch, batch.position.float(), batch.next_position.float())
        assert frozen() == (update % 2 == 0)  # the running statistics of the normalisation too
        assert not agent.target.training
        assert all(not m.training for m in agent.target.modules())
        assert all(p.grad is None and not p.requires_grad for p in agent.target.parameters())
        pairs = zip(agent.network.state_dict().values(), agent.target.state_dict().values(), strict=True)
        assert all(a.data_ptr() != b.data_ptr() for a, b in pairs)


def test_the_target_values_what_it_was_copied_from_until_the_next_copy():
    agent = agent_of([[0.0, 1.0]], target_period=3)
    bootstrap = transitions((0, 0, 0.0, 1.0, 0, ALL))
    far = transitions((0, 1, 100.0, 0.0, 0, ALL))
    for _ in range(2):
        learn(agent, far)
        assert td_target(agent, bootstrap) == [1.0]
    learn(agent, far)
    assert td_target(agent, bootstrap) == [float(agent.network.q.detach()[0, 1])]
    assert float(agent.network.q.detach()[0, 1]) > 1.1


def test_the_learning_rate_falls_linearly_to_zero():
    agent = agent_of([[0.0, 0.0]], learning_rate=0.2, total_updates=8)
    rates = []
    for _ in range(8):
        rates.append(agent.optimizer.param_groups[0]["lr"])
        learn(agent, transitions((0, 0, 1.0, 0.0, 0, ALL)))
    assert rates == pytest.approx([0.2 * (1 - k / 8) for k in range(8)])
    assert agent.optimizer.param_groups[0]["lr"] == pytest.approx(0, abs=1e-9)


def test_values_are_those_of_the_network_and_carry_no_gradient():
    agent = agent_of([[1.0, 2.0], [3.0, 4.0]], [[0.0, 0.0], [0.0, 0.0]])
    values = agent.values(torch.tensor([1, 0, 1]))
    assert values.tolist() == [[3.0, 4.0], [1.0, 2.0], [3.0, 4.0]]
    assert not values.requires_grad


@pytest.mark.parametrize("double", [False, True])
@pytest.mark.parametrize(("discount", "value"), [(0.8, 5.0), (0.0, 1.0)])
def test_a_constant_reward_of_one_is_worth_1_over_1_less_the_discount(double, discount, value):
    agent = agent_of([[0.0, 0.0]], double=double, learning_rate=0.1, total_updates=1500, target_period=10)
    batch = transitions((0, 0, 1.0, discount, 0, ALL), (0, 1, 1.0, discount, 0, ALL))
    for _ in range(1500):
        learn(agent, batch)
    np.testing.assert_allclose(agent.network.q.detach(), value, atol=0.02)


def test_of_every_move_the_loss_is_the_absolute_error_of_those_that_are_legal():
    legal, target = torch.tensor([[True, True, False], [True, False, False]]), torch.tensor([[1.0, 2, 9], [3, 9, 9]])
    agent = agent_of([[2.0, 5.0, 7.0], [1.0, 7.0, 7.0]], learning_rate=0.0)
    loss, learned = agent.update_every_move(legal, target, torch.tensor([A, B]))
    stats = UpdateStats.of(loss, learned[:, 1] - 1)
    assert stats.loss.item() == pytest.approx((1 + 3 + 2) / 6)
    assert (stats.mean_q.item(), stats.max_q.item()) == (5.0, 6.0)


def test_of_every_move_values_of_illegal_ones_stay_and_the_others_are_found():
    legal, target = torch.tensor([[True, True, False]]), torch.tensor([[1.0, 2.0, 50.0]])
    agent = agent_of([[0.0, 0.0, 7.0]], learning_rate=0.1, total_updates=300)
    for _ in range(300):
        agent.update_every_move(legal, target, torch.tensor([A]))
    assert agent.network.q.tolist()[0] == pytest.approx([1.0, 2.0, 7.0], abs=0.02)
