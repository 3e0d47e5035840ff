"""The training loop: what is done in which order, what is stored, how episodes end, and that the agent learns."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from itertools import pairwise

import numpy as np
import pytest
import torch
from torch import nn

from layoutrl.agents.dqn import DQN
from layoutrl.agents.exploration import LinearSchedule
from layoutrl.agents.networks import GeometryNetwork
from layoutrl.agents.replay import Replay, Transitions
from layoutrl.agents.training import REWARD_SCALE, Progress, train
from layoutrl.env.observation import GeometryObservation, categories_of
from layoutrl.env.reward import Reward, RewardTerms
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.evaluation.metrics import lattice_ceiling
from layoutrl.evaluation.protocols import rollout
from layoutrl.rooms.room import Item, Room
from tests.builders import l_room, rectangular_room

SETTINGS = {
    "updates": 6, "batch": 8, "episodes": 5, "max_moves": 4, "discount": 0.9, "goal_iou": None, "warmup_moves": 12,
    "report_every": 6,
}  # fmt: skip


class RecordedReplay(Replay):
    def __init__(self, capacity: int, actions: int, tape: list):
        super().__init__(capacity, actions)
        self.tape = tape

    def add(self, transitions: Transitions) -> None:
        self.tape.append(("store", Transitions(*(column.clone() for column in transitions))))
        super().add(transitions)


class RecordedDQN(DQN):
    tape: list

    def values(self, observation):
        q = super().values(observation)
        self.tape.append(("act", q))
        return q

    def update(self, batch, observation, next_observation):
        self.tape.append(("learn", batch))
        return super().update(batch, observation, next_observation)


@dataclass
class Run:
    """A whole training run, and everything that happened in it."""

    simulator: Simulator
    agent: DQN
    replay: Replay
    tape: list
    reports: list[Progress] = field(default_factory=list)

    def events(self) -> list[str]:
        return [name for name, _ in self.tape]

    def stored(self) -> list[Transitions]:
        """What was stored, an entry a step."""
        return [what for name, what in self.tape if name == "store"]


def small_rooms() -> list[Room]:
    return [rectangular_room(2.4, 2.0, Item("bed", (0.6, 0.8), (0.3, 0.4)), id="a"), l_room(id="b")]


def run_of(
    rooms: list[Room] | None = None,
    moves: Moves | None = None,
    epsilon: LinearSchedule | None = None,
    seed: int = 0,
    capacity: int = 1000,
    learning_rate: float = 1e-3,
    **settings,
) -> Run:
    rooms, settings = rooms or small_rooms(), SETTINGS | settings
    simulator = Simulator(rooms, moves or Moves((0.4, 0.1)), Reward())
    observe = GeometryObservation(rooms, categories_of(rooms))
    with torch.random.fork_rng():
        torch.manual_seed(1)
        network = GeometryNetwork(observe.shape[1], simulator.moves.count, element_width=8, width=16)
    agent = RecordedDQN(network, learning_rate, settings["updates"], target_period=20, double=True)
    agent.tape = []
    run = Run(simulator, agent, RecordedReplay(capacity, simulator.moves.count, agent.tape), agent.tape)
    schedule = epsilon or LinearSchedule(1.0, 0.5, 3)
    seeds = np.random.SeedSequence(seed)
    run.reports += train(agent, simulator, observe, run.replay, schedule, **settings, seed=seeds)
    return run


@pytest.mark.parametrize(
    ("warmup_moves", "capacity", "first"), [(0, 1000, 1), (5, 1000, 1), (6, 1000, 2), (12, 1000, 3), (999, 14, 3)]
)
def test_every_step_acts_and_stores_and_learns_once_the_memory_is_warm(warmup_moves, capacity, first):
    run = run_of(warmup_moves=warmup_moves, capacity=capacity)
    assert run.events() == ["act", "store"] * (first - 1) + ["act", "store", "learn"] * 6
    assert run.reports[-1].moves == 5 * (first - 1 + 6)
    assert run.reports[-1].updates == run.agent.updates == 6
    assert {len(batch.room) for name, batch in run.tape if name == "learn"} == {8}
    assert {len(batch.room) for batch in run.stored()} == {5}


def test_what_is_learned_from_includes_what_the_same_step_stored():
    run = run_of(warmup_moves=1, updates=1, report_every=1)
    learned = next(batch for name, batch in run.tape if name == "learn")
    stored = {tuple(p) for p in run.stored()[0].next_position.tolist()}
    assert {tuple(p) for p in learned.next_position.tolist()} <= stored


def test_reports_come_every_so_many_updates_and_at_the_end():
    run = run_of(updates=7, report_every=3)
    assert [report.updates for report in run.reports] == [3, 6, 7]
    assert [report.moves for report in run.reports] == [25, 40, 45]


def test_stored_moves_are_legal_lead_where_the_simulator_says_and_earn_its_reward():
    run = run_of(updates=12, report_every=12)
    for batch in run.stored():
        room, position, action = batch.room.numpy(), batch.position.numpy(), batch.action.numpy()
        reached, legal = run.simulator.destinations(room, position)
        assert legal[np.arange(5), action].all()
        assert run.simulator.is_legal(room, batch.next_position.numpy()).all()
        np.testing.assert_array_equal(batch.next_position, reached[np.arange(5), action])
        np.testing.assert_array_equal(
            batch.next_legal, run.simulator.destinations(room, batch.next_position.numpy())[1]
        )
        np.testing.assert_allclose(batch.reward * 100, run.simulator.reward(room, batch.next_position.numpy()).total)
    assert REWARD_SCALE == 100


@pytest.mark.parametrize("goal_iou", [None, 0.3])
def test_episodes_go_on_where_they_stood_until_they_end_and_then_start_anew(goal_iou):
    run = run_of([small_rooms()[0]], updates=40, report_every=40, goal_iou=goal_iou)
    steps, made, ends = run.stored(), np.zeros(5, dtype=int), {"truncated": 0, "terminated": 0}
    for step, following in pairwise(steps):
        made += 1
        iou = run.simulator.reward(step.room.numpy(), step.next_position.numpy()).iou
        terminated = iou >= goal_iou if goal_iou is not None else np.zeros(5, dtype=bool)
        ended = terminated | (made == 4)
        went_on = (step.next_position == following.position).all(1).numpy()
        np.testing.assert_array_equal(went_on, ~ended)
        np.testing.assert_array_equal(step.discount, np.where(terminated, 0.0, 0.9))
        ends["truncated"] += (ended & ~terminated).sum()
        ends["terminated"] += terminated.sum()
        made[ended] = 0
    assert ends["truncated"] > 5
    assert (ends["terminated"] > 5) == (goal_iou is not None)


def test_rooms_are_drawn_anew_with_every_episode_and_kept_within_it():
    run = run_of(updates=40, report_every=40)
    rooms = torch.stack([step.room for step in run.stored()])  # (steps, episodes)
    whole = rooms[: len(rooms) // 4 * 4].reshape(-1, 4, 5)
    assert (whole == whole[:, :1]).all()
    assert all(set(whole[:, 0, e].tolist()) == {0, 1} for e in range(5))


def test_an_item_that_cannot_move_makes_no_transition():
    stuck = rectangular_room(1.0, 1.0, Item("bed", (1.2, 1.2), (0.5, 0.5)), id="stuck")
    run = run_of([stuck, small_rooms()[0]], Moves((0.4,), slide=False), updates=20, report_every=20, max_moves=1)
    assert not run.simulator.destinations(np.array([0]), np.array([[0.5, 0.5]]))[1].any()
    assert {k for step in run.stored() for k in step.room.tolist()} == {1}


def test_returns_and_ious_are_means_over_the_episodes_that_ended_since_the_last_report():
    run = run_of(updates=9, report_every=3, warmup_moves=5, max_moves=2)
    steps = run.stored()
    assert [report.moves for report in run.reports] == [15, 30, 45]
    for report, ended in zip(run.reports, ([1], [3, 5], [7]), strict=True):
        returns = [100 * (steps[k - 1].reward + steps[k].reward) for k in ended]
        ious = [run.simulator.reward(steps[k].room.numpy(), steps[k].next_position.numpy()).iou for k in ended]
        assert report.episode_return == pytest.approx(float(torch.cat(returns).mean()))
        assert report.episode_iou == pytest.approx(np.concatenate(ious).mean())


def test_where_no_episode_ended_there_is_no_return():
    report = run_of(max_moves=1000).reports[0]
    assert math.isnan(report.episode_return)
    assert math.isnan(report.episode_iou)


def test_epsilon_follows_the_schedule_by_updates():
    schedule = LinearSchedule(1.0, 0.2, 4)
    run = run_of(epsilon=schedule, updates=6, report_every=1)
    assert [report.epsilon for report in run.reports] == pytest.approx([0.8, 0.6, 0.4, 0.2, 0.2, 0.2])


@pytest.mark.parametrize(("schedule", "share"), [((0.0, 0.0, 0), 1.0), ((1.0, 1.0, 0), None), ((1.0, 0.0, 10), None)])
def test_greedy_choices_are_the_best_legal_moves_and_explored_ones_are_others(schedule, share):
    run = run_of(epsilon=LinearSchedule(*schedule), updates=20, report_every=20, episodes=20, learning_rate=0.0)
    greedy = []
    for (name, q), (_, step) in pairwise(run.tape):
        if name == "act":
            legal = run.simulator.destinations(step.room.numpy(), step.position.numpy())[1]
            best = np.where(legal, q.numpy(), -np.inf).argmax(1)
            greedy.append((best == step.action.numpy()).mean())
    if schedule == (1.0, 0.0, 10):  # epsilon is 0 from update 10 on, one update a step
        assert np.mean(greedy[:5]) < 0.7
        np.testing.assert_array_equal(greedy[11:], 1.0)
    elif share is None:
        assert np.mean(greedy) < 0.5
    else:
        np.testing.assert_array_equal(greedy, 1.0)


def told(run: Run) -> list[dict]:
    """The reports without their times, and with NaN as a word, so that they can be compared."""
    return [{k: v if v == v else "nan" for k, v in asdict(r).items() if k != "seconds"} for r in run.reports]


def test_equal_seeds_give_equal_runs_and_other_seeds_others():
    runs = [run_of(seed=seed, updates=8, report_every=2) for seed in (3, 3, 4)]
    assert told(runs[0]) == told(runs[1])
    assert told(runs[0]) != told(runs[2])
    weights = [torch.cat([p.detach().flatten() for p in run.agent.network.parameters()]) for run in runs]
    assert torch.equal(weights[0], weights[1])
    assert not torch.equal(weights[0], weights[2])


def test_the_global_random_streams_are_neither_read_nor_moved():
    states = []
    for seed in (0, 1):
        np.random.seed(seed)  # noqa: NPY002
        with torch.random.fork_rng():
            torch.manual_seed(seed)
            states.append(told(run_of(updates=3, report_every=1)))
        assert np.random.random() == np.random.RandomState(seed).random()  # noqa: NPY002
    assert states[0] == states[1]


def test_time_is_told_by_stage():
    seconds = run_of().reports[0].seconds
    assert seconds.keys() == {"act", "simulate", "observe", "store", "learn"}
    assert all(spent > 0 for spent in seconds.values())


class OnePlace:
    """A world of one place that earns the full reward for every move, and whose IoU is 1."""

    rooms = ("only",)

    def starts(self, room, rng):
        return np.zeros((len(room), 2))

    def destinations(self, room, position):
        return np.repeat(position[:, None], 2, 1), np.ones((len(room), 2), dtype=bool)

    def reward(self, room, position):
        one = np.ones(len(room))
        return RewardTerms(100 * one, 0 * one, 0 * one, one)


@pytest.mark.parametrize(("goal_iou", "value"), [(None, 1 / (1 - 0.75)), (0.5, 1.0)])
def test_values_bootstrap_through_the_budget_of_moves_and_end_with_the_goal(goal_iou, value):
    network = nn.Linear(1, 2)
    agent = DQN(network, 0.1, 500, target_period=5, double=False)

    def observe(room, position):
        return torch.ones(len(room), 1)

    settings = SETTINGS | {"updates": 500, "max_moves": 1, "discount": 0.75, "goal_iou": goal_iou, "report_every": 500}
    schedule, seed = LinearSchedule(1.0, 1.0, 0), np.random.SeedSequence(0)
    list(train(agent, OnePlace(), observe, Replay(100, 2), schedule, **settings, seed=seed))
    np.testing.assert_allclose(agent.values(torch.ones(1, 1)), value, atol=0.02)


def test_an_agent_learns_to_put_the_item_where_the_designer_did():
    rooms = [rectangular_room(1.9, 1.6, Item("bed", (0.7, 0.5), (0.4, 1.3)))]
    simulator = Simulator(rooms, Moves((0.2,), slide=False), Reward())
    observe = GeometryObservation(rooms, ["bed"])
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network = GeometryNetwork(observe.shape[1], 4, element_width=16, width=64)
    agent = DQN(network, 3e-3, 400, target_period=25, double=True)
    settings = SETTINGS | {"updates": 400, "batch": 128, "episodes": 16, "max_moves": 12, "warmup_moves": 200}
    schedule, seed = LinearSchedule(1.0, 0.5, 200), np.random.SeedSequence(0)
    list(train(agent, simulator, observe, Replay(10_000, 4), schedule, **settings, seed=seed))
    room = np.zeros(60, dtype=int)
    starts = simulator.starts(room, np.random.default_rng(1))
    iou = simulator.reward(room, rollout(agent, simulator, observe, room, starts, 40).final).iou
    ceiling = lattice_ceiling(simulator, room, starts)
    assert (iou <= ceiling + 1e-6).all()
    assert iou.mean() > 0.95 * ceiling.mean()
