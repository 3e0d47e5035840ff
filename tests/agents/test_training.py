"""The training loop: what is done in which order, what is stored, how episodes end, and that the agent learns."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, replace
from itertools import islice, pairwise, product

import numpy as np
import pytest
import torch
from torch import nn

from layoutrl.agents.dqn import DQN, UpdateStats
from layoutrl.agents.exploration import LinearSchedule
from layoutrl.agents.gains import EveryMove
from layoutrl.agents.learner import Learner
from layoutrl.agents.networks import GeometryNetwork
from layoutrl.agents.replay import Replay, Transitions
from layoutrl.agents.training import Progress, Training
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.episodes import Episodes
from layoutrl.env.observation import GeometryObservation
from layoutrl.env.reward import REWARD_SCALE, Reward, RewardTerms
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.env.symmetry import Symmetry, symmetries
from layoutrl.evaluation.metrics import lattice_ceiling
from layoutrl.evaluation.policy import GreedyPolicy, greedy
from layoutrl.evaluation.rollout import MeanQ
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.room import Item, Room, symmetry
from layoutrl.runs.config import composed
from tests.builders import l_room, opening, rectangular_room, small_rooms

SETTINGS = {
    "updates": 6, "batch": 8, "episodes": 5, "max_moves": 4, "discount": 0.9, "goal_iou": None, "warmup_moves": 12,
    "report_every": 6,
}  # fmt: skip


def training(
    agent, simulator, observe, replay, epsilon, *, updates, episodes, max_moves, goal_iou, **settings
) -> Training:
    ages = np.arange(episodes) * max_moves // episodes

    def begin(generator: torch.Generator) -> Episodes:
        return Episodes(simulator, ages, max_moves, generator, goal_iou)

    return Training(agent, begin, observe, replay, epsilon, total_updates=updates, **settings)


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
        stats = super().update(batch, observation, next_observation)
        self.tape.append(("learn", (stats, batch, observation, next_observation)))
        return stats


@dataclass
class Run:
    """A whole training run, everything that happened in it, and the exact simulator to check it by."""

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

    def learned(self) -> list[tuple[UpdateStats, Transitions, torch.Tensor, torch.Tensor]]:
        """Every update, and what was learned from: transitions and what is seen before and after them."""
        return [what for name, what in self.tape if name == "learn"]

    def iou(self, step: Transitions) -> np.ndarray:
        """Of the places where a step led (B,)."""
        return self.simulator.reward(step.room.numpy(), step.next_position.numpy()).iou

    def endings(self, max_moves: int, goal_iou: float | None = None) -> list[tuple[np.ndarray, np.ndarray]]:
        """Which episodes (B,) terminated in every step, and which ended, as they should by what was stored."""
        count, endings = len(self.stored()[0].room), []
        age = np.arange(count) * max_moves // count
        for step in self.stored():
            age += 1
            terminated = self.iou(step) >= (math.inf if goal_iou is None else goal_iou)
            ended = terminated | (age == max_moves)
            age[ended] = 0
            endings.append((terminated, ended))
        return endings


def weights_of_one(columns: int, actions: int) -> GeometryNetwork:
    with torch.random.fork_rng():
        torch.manual_seed(1)
        return GeometryNetwork(columns, actions, element_width=8, width=16)


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
    moves = moves or Moves((0.4, 0.1))
    simulator = Simulator(rooms, moves, Reward())
    observe = GeometryObservation(rooms, categories_of(rooms))
    network = weights_of_one(observe.space.shape[1], moves.count)
    agent = RecordedDQN(network, learning_rate, settings["updates"], target_period=20, double=True)
    agent.tape = []
    run = Run(simulator, agent, RecordedReplay(capacity, moves.count, agent.tape), agent.tape)
    settings |= {"symmetries": symmetries(moves), "seed": np.random.SeedSequence(seed)}
    schedule = epsilon or LinearSchedule(1.0, 0.5, 3)
    run.reports += training(agent, BatchSimulator(simulator), observe, run.replay, schedule, **settings)
    return run


@pytest.mark.parametrize(
    ("warmup_moves", "capacity", "first"), [(0, 1000, 1), (5, 1000, 1), (6, 1000, 2), (12, 1000, 3), (999, 14, 3)]
)
def test_every_step_acts_and_stores_and_learns_once_the_memory_is_warm(warmup_moves, capacity, first):
    run = run_of(warmup_moves=warmup_moves, capacity=capacity)
    assert run.events() == ["act", "store"] * (first - 1) + ["act", "store", "learn"] * 6
    assert run.reports[-1].moves == 5 * (first - 1 + 6)
    assert run.reports[-1].updates == run.agent.updates == 6
    assert {len(batch.room) for _, batch, *_ in run.learned()} == {8}
    assert {len(batch.room) for batch in run.stored()} == {5}


def test_what_is_learned_from_includes_what_the_same_step_stored():
    run = run_of(warmup_moves=1, updates=1, report_every=1)
    learned = run.learned()[0][1]
    stored = {tuple(p) for p in run.stored()[0].next_position.tolist()}
    assert {tuple(p) for p in learned.next_position.tolist()} <= stored


@pytest.mark.parametrize("batch", [32, 27])
def test_each_symmetry_is_learned_in_an_equal_share_of_every_batch_as_if_the_rooms_were_turned(batch):
    rooms = [
        rectangular_room(2.4, 2.0, Item("bed", (0.6, 0.8), (0.4, 0.7), 30), others=(Item("desk", (0.4, 0.7), (2, 1)),)),
        l_room(Item("lamp", (0.4, 0.4), (1.0, 1.0), form="circle")),
    ]
    run = run_of(rooms, batch=batch, updates=8, report_every=8)
    shares = np.array_split(np.arange(batch), 8)
    for share, (mirror, quarters) in zip(shares, product((False, True), range(4)), strict=True):
        turned = [room.turned(quarters, mirror) for room in rooms]
        simulator, observe = (
            Simulator(turned, run.simulator.moves, Reward()),
            GeometryObservation(turned, categories_of(rooms)),
        )
        every = np.arange(len(share))
        for _, learned, *observations in run.learned():
            room, position, action, _, _, next_position, next_legal = (column[share] for column in learned)
            position, next_position = (p @ symmetry(quarters, mirror).T for p in (position, next_position))
            reached, legal = simulator.destinations(room.numpy(), position.numpy())
            assert legal[every, action].all()
            np.testing.assert_allclose(next_position, reached[every, action], rtol=0, atol=1.1e-6)
            np.testing.assert_array_equal(next_legal, simulator.destinations(room.numpy(), next_position.numpy())[1])
            for observation, where in zip(observations, (position, next_position), strict=True):
                torch.testing.assert_close(observation[share], observe(room, where))


def test_in_every_view_the_values_of_every_move_are_those_of_the_moves_there():
    rooms, moves = small_rooms(), Moves((0.4, 0.1))
    learned, told = [], []

    class Recorded(DQN):
        def update_every_move(self, legal, target, observation):
            learned.append((legal, target, observation))
            return super().update_every_move(legal, target, observation)

    class Told(EveryMove):
        def q_made(self, output, legal, action, reward, updates):
            told.append(super().q_made(learned[-1][1], legal, action, reward, updates))
            return super().q_made(output, legal, action, reward, updates)

    def run(symmetries: list[Symmetry]) -> None:
        simulator, observe = BatchSimulator(Simulator(rooms, moves, Reward())), GeometryObservation(rooms, ["bed"])
        network = weights_of_one(observe.space.shape[1], moves.count)
        settings = SETTINGS | {"updates": 1, "report_every": 1, "symmetries": symmetries, "batch": 16}
        learns = Told(simulator, 1, (0.0, 0.0))  # discount 0: what a move gains at once
        schedule, seed = LinearSchedule(1.0, 1.0, 0), np.random.SeedSequence(0)
        agent, replay = Recorded(network, 1e-3, 1, 20, double=False), Replay(1000, moves.count)
        list(training(agent, simulator, observe, replay, schedule, **settings, seed=seed, every_move=learns))

    run(symmetries(moves)[:1])
    run(symmetries(moves))
    (legal, target, observation), (turned_legal, turned_target, turned_observation) = learned
    observe = GeometryObservation(rooms, ["bed"])
    for k, view in enumerate(symmetries(moves)):
        two = slice(2 * k, 2 * k + 2)
        assert torch.equal(turned_legal[two, view.action], legal[two])
        torch.testing.assert_close(turned_target[two, view.action], target[two])
        torch.testing.assert_close(turned_observation[two], observe.turned(observation[two], view))
    torch.testing.assert_close(*told)


@pytest.mark.parametrize("rises_from", [0.8, 0.5])
def test_from_every_move_an_agent_learns_the_way_home(rises_from: float):
    method = replace(
        composed("train", "room=tatami").method, steps=[0.4], slide=False, climbs=0, every_move=True, discount=0.8
    )
    method = replace(
        method, discount_start=rises_from, batch=32, episodes=8, warmup_moves=32, near_share=0.5, symmetries=False
    )
    room = rectangular_room(2.4, 2.0, Item("bed", (0.8, 0.8), (0.4, 0.4)))
    one, other = np.random.SeedSequence(0).spawn(2)
    learner = Learner([room], method, Reward(), 150, one, other, torch.device("cpu"))
    list(learner.training(report_every=150))
    simulator = BatchSimulator(Simulator([room], method.moves, Reward()))
    starts = torch.tensor([(2.0, 1.6), (0.4, 1.6), (2.0, 0.4)], dtype=torch.float64)
    ends = (
        greedy(learner.dqn.network, method).rollout(simulator, learner.observe, torch.zeros(3, dtype=int), starts).final
    )
    np.testing.assert_allclose(ends, [(0.4, 0.4)] * 3, atol=1e-6)


def test_reports_come_every_so_many_updates_and_at_the_end():
    run = run_of(updates=7, report_every=3)
    assert [report.updates for report in run.reports] == [3, 6, 7]
    assert [report.moves for report in run.reports] == [25, 40, 45]


def test_loss_and_values_are_over_the_updates_since_the_last_report():
    run = run_of(updates=7, report_every=3)
    stats = [stats for stats, *_ in run.learned()]
    for report, since in zip(run.reports, (stats[:3], stats[3:6], stats[6:]), strict=True):
        losses, mean_qs, max_qs = zip(*(map(float, update) for update in since), strict=True)
        told = report.loss, report.mean_q, report.max_q
        assert told == pytest.approx((np.mean(losses), np.mean(mean_qs), np.max(max_qs)))


def test_stored_moves_are_legal_lead_where_the_simulator_says_and_earn_its_reward():
    run = run_of(updates=12, report_every=12)
    for batch in run.stored():
        room, position, action = batch.room.numpy(), batch.position.numpy(), batch.action.numpy()
        next_position = batch.next_position.numpy()
        reached, legal = run.simulator.destinations(room, position)
        right, slides = reached[np.arange(5), action], action >= 8
        assert legal[np.arange(5), action].all()
        assert run.simulator.is_legal(room, next_position).all()
        np.testing.assert_array_equal(next_position[~slides], right[~slides])
        np.testing.assert_allclose(next_position, right, rtol=0, atol=1.1e-6)  # a slide: to the micrometre
        np.testing.assert_array_equal(batch.next_legal, run.simulator.destinations(room, next_position)[1])
        total = run.simulator.reward(room, next_position).total
        np.testing.assert_allclose(batch.reward * 100, total, rtol=0, atol=1e-4)
    assert REWARD_SCALE == 100


@pytest.mark.parametrize("goal_iou", [None, 0.3])
def test_episodes_go_on_where_they_stood_until_they_end_and_then_start_anew(goal_iou):
    run = run_of([small_rooms()[0]], updates=80, report_every=80, goal_iou=goal_iou)
    ends, starts = {"truncated": 0, "terminated": 0}, []
    for (step, following), (terminated, ended) in zip(pairwise(run.stored()), run.endings(4, goal_iou), strict=False):
        went_on = (step.next_position == following.position).all(1).numpy()
        np.testing.assert_array_equal(went_on, ~ended)
        np.testing.assert_array_equal(step.discount, np.float32(np.where(terminated, 0.0, 0.9)))
        starts += map(tuple, following.position[ended].tolist())
        ends["truncated"] += (ended & ~terminated).sum()
        ends["terminated"] += terminated.sum()
    assert ends["truncated"] > 5
    assert (ends["terminated"] > 5) == (goal_iou is not None)
    assert len(set(starts)) == len(starts)


def test_the_budget_of_moves_does_not_end_all_episodes_in_the_same_step():
    steps = run_of(updates=9, report_every=9).stored()
    ended = [(step.next_position != following.position).any(1).nonzero()[:, 0] for step, following in pairwise(steps)]
    assert [e.tolist() for e in ended[:8]] == [[4], [3], [2], [0, 1]] * 2


def test_rooms_are_drawn_anew_with_every_episode_and_kept_within_it():
    run = run_of(updates=40, report_every=40)
    drawn = set()
    for (step, following), (_, ended) in zip(pairwise(run.stored()), run.endings(4), strict=False):
        np.testing.assert_array_equal(step.room[~ended], following.room[~ended])
        drawn |= set(zip(ended.nonzero()[0], step.room[ended].tolist(), following.room[ended].tolist(), strict=True))
    assert {(episode, new) for episode, _, new in drawn} == {(episode, room) for episode in range(5) for room in (0, 1)}
    assert {(last, new) for _, last, new in drawn} == {(0, 0), (0, 1), (1, 0), (1, 1)}


STUCK = rectangular_room(1.0, 1.0, Item("bed", (1.2, 1.2), (0.5, 0.5)), id="stuck")


def test_an_item_that_cannot_move_stays_where_it_is_until_its_episode_ends():
    run = run_of([STUCK, small_rooms()[0]], Moves((0.4,), slide=False), updates=20, report_every=20)
    assert not run.simulator.destinations(np.array([0]), np.array([[0.5, 0.5]]))[1].any()
    moved = 0
    for step in run.stored():
        stuck = step.room == 0
        assert torch.equal(step.next_position[stuck], step.position[stuck])
        assert (step.next_position != step.position).any(1)[~stuck].all()
        assert not step.next_legal[stuck].any()  # so that nothing is expected of what follows
        total = run.simulator.reward(step.room.numpy(), step.next_position.numpy()).total
        np.testing.assert_allclose(step.reward * 100, total, rtol=0, atol=1e-4)
        moved += int((~stuck).sum())
    assert 0.2 < moved / (5 * len(run.stored())) < 0.8


@pytest.mark.parametrize("goal_iou", [None, 0.3])
def test_returns_and_ious_are_means_over_the_whole_episodes_that_ended_since_the_last_report(goal_iou):
    run = run_of(updates=9, report_every=3, warmup_moves=5, max_moves=2, goal_iou=goal_iou)
    assert [report.moves for report in run.reports] == [15, 30, 45]
    steps, returns = zip(run.stored(), run.endings(2, goal_iou), strict=True), np.zeros(5)
    whole = np.arange(5) * 2 // 5 == 0  # the others begin at an age
    for report in run.reports:
        ended_returns, ended_ious = [], []
        for step, (_, ended) in islice(steps, 3):
            returns += 100 * step.reward.numpy()
            ended_returns.extend(returns[ended & whole])
            ended_ious.extend(run.iou(step)[ended & whole])
            returns[ended], whole = 0, whole | ended
        assert report.episode_return == pytest.approx(np.mean(ended_returns), abs=1e-3)
        assert report.episode_iou == pytest.approx(np.mean(ended_ious), abs=1e-6)


def test_where_no_episode_ended_there_is_no_return():
    report = run_of(max_moves=1000).reports[0]
    assert math.isnan(report.episode_return)
    assert math.isnan(report.episode_iou)


def test_epsilon_follows_the_schedule_by_updates():
    schedule = LinearSchedule(1.0, 0.2, 4)
    run = run_of(epsilon=schedule, updates=6, report_every=1)
    assert [report.epsilon for report in run.reports] == pytest.approx([0.8, 0.6, 0.4, 0.2, 0.2, 0.2])


@pytest.mark.parametrize("schedule", [(0.0, 0.0, 0), (1.0, 1.0, 0), (1.0, 0.0, 10)])
def test_greedy_choices_are_the_best_legal_moves_and_explored_ones_are_others(schedule):
    run = run_of(
        epsilon=LinearSchedule(*schedule), updates=20, report_every=20, episodes=20, warmup_moves=120, learning_rate=0.0
    )
    greedy = []
    for (name, q), (_, step) in pairwise(run.tape):
        if name == "act":
            legal = run.simulator.destinations(step.room.numpy(), step.position.numpy())[1]
            best = np.where(legal, q.numpy(), -np.inf).argmax(1)
            greedy.append((best == step.action.numpy()).mean())
    assert len(greedy) == 25  # the first five without an update
    if schedule == (0.0, 0.0, 0):
        np.testing.assert_array_equal(greedy, 1.0)
    elif schedule == (1.0, 1.0, 0):
        assert np.mean(greedy) < 0.5
    else:  # epsilon falls from the first update to the tenth
        assert np.mean(greedy[:6]) < 0.5
        assert np.mean(greedy[:6]) < np.mean(greedy[10:15]) < 1.0
        np.testing.assert_array_equal(greedy[15:], 1.0)


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
            assert torch.equal(torch.rand(3), torch.rand(3, generator=torch.Generator().manual_seed(seed)))
        assert np.random.random() == np.random.RandomState(seed).random()  # noqa: NPY002
    assert states[0] == states[1]


def test_time_is_told_by_stage():
    seconds = run_of().reports[0].seconds
    assert seconds.keys() == {"act", "simulate", "store", "sample", "learn"}
    assert all(spent > 0 for spent in seconds.values())


class OnePlace:
    """A world of one place that earns the full reward for every move, and whose IoU is 1."""

    rooms = ("only",)
    device = torch.device("cpu")

    def starts(self, room, generator):
        return torch.zeros(len(room), 2, dtype=torch.float64)

    def reach(self, room, position):
        return torch.zeros(len(room), 4), torch.ones(len(room), 4, dtype=torch.bool)

    def moved(self, room, position, action, length):
        return position

    def reward(self, room, position):
        one = torch.ones(len(room))
        return RewardTerms(100 * one, 0 * one, 0 * one, 0 * one, one)


class Nothing:
    """An observation that tells nothing."""

    def __call__(self, room, position):
        return torch.ones(len(room), 1)

    def turned(self, observation, symmetry):
        return observation


@pytest.mark.parametrize(("goal_iou", "value"), [(None, 1 / (1 - 0.75)), (0.5, 1.0)])
def test_values_bootstrap_through_the_budget_of_moves_and_end_with_the_goal(goal_iou, value):
    agent = DQN(nn.Linear(1, 4), 0.1, 500, target_period=5, double=False)
    settings = SETTINGS | {"updates": 500, "max_moves": 1, "discount": 0.75, "goal_iou": goal_iou, "report_every": 500}
    settings |= {"symmetries": symmetries(Moves((1.0,), slide=False)), "seed": np.random.SeedSequence(0)}
    list(training(agent, OnePlace(), Nothing(), Replay(100, 4), LinearSchedule(1.0, 1.0, 0), **settings))
    np.testing.assert_allclose(agent.values(torch.ones(1, 1)), value, atol=0.02)


def test_an_agent_learns_to_put_the_item_where_the_designer_did_also_in_a_turned_room_where_it_never_was():
    door = opening("door", 0.1, -0.2, 0.8, 0.0)  # tells which way the room is turned
    room = rectangular_room(1.9, 1.6, Item("bed", (0.7, 0.5), (0.4, 1.3)), openings=(door,))
    moves, rooms = Moves((0.2,), slide=False), [room, room.turned(1, mirror=True)]
    observe, turned = GeometryObservation([room], ["bed"]), GeometryObservation(rooms, ["bed"])
    with torch.random.fork_rng():
        torch.manual_seed(0)
        network = GeometryNetwork(observe.space.shape[1], 4, element_width=16, width=64)
    agent = DQN(network, 3e-3, 500, target_period=25, double=True)
    settings = SETTINGS | {"updates": 500, "batch": 128, "episodes": 16, "max_moves": 12, "warmup_moves": 200}
    views = [Symmetry(0, False, moves), Symmetry(1, True, moves)]
    settings |= {"symmetries": views, "seed": np.random.SeedSequence(0)}
    schedule, home = LinearSchedule(1.0, 0.5, 250), BatchSimulator(Simulator([room], moves, Reward()))
    list(training(agent, home, observe, Replay(10_000, 4), schedule, **settings))
    simulator, index = Simulator(rooms, moves, Reward()), np.repeat([0, 1], 60)
    starts = simulator.starts(index, np.random.default_rng(1))
    final = (
        GreedyPolicy(MeanQ(agent.network, views[:1]), 40, "mask")
        .rollout(BatchSimulator(simulator), turned, index, starts)
        .final
    )
    iou, ceiling = simulator.reward(index, final).iou, lattice_ceiling(simulator, index, starts)
    assert (iou <= ceiling + 1e-6).all()
    assert (iou.reshape(2, 60).mean(1) > 0.95 * ceiling.reshape(2, 60).mean(1)).all()
