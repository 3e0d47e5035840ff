"""Q is the mean over views of a room; the choices that an episode leaves lie apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from layoutrl.agents.learner import q_network
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import observation_of
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Simulator
from layoutrl.env.symmetry import symmetries
from layoutrl.evaluation.rollout import BLOCK, MeanQ, Remembered, Rollout
from layoutrl.rooms.brief import categories_of
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.runs.config import composed
from tests.evaluation.builders import BELOW, LEFT, RIGHT, STEPS, UP, Place, Scripted, nearing, unturned, wide_room


def test_choices_are_the_places_of_highest_value_that_lie_apart():
    x = np.array([0.0, 1.0, 1.5, 1.9, 3.0, 2.95, 5.0, 2.96, 5.5])
    path = np.stack([x, np.zeros(9)], 1)[:, None]
    value = np.array([-np.inf, 7.0, 9.0, 3.0, 8.0, 1.0, 2.0, 1.5, 1.7])[:, None]
    run = Rollout(path, value, np.array([2]), path[[2]], value[2], 0.0)
    # 1.0 is on the way to 1.5, 1.9 and 2.96 on that to others; the start was not chosen.
    assert run.choices(4)[0, :, 0].tolist() == [1.5, 3.0, 5.0, 5.5]
    assert run.choices(5)[0, :, 0].tolist() == [1.5, 3.0, 5.0, 5.5, 1.5]
    assert run.final.tolist() == run.choices(1)[:, 0].tolist()
    near = replace(run, path=np.where(path == 3.0, 1.55, path))
    assert near.choices(3)[0, :, 0].tolist() == [1.5, 5.0, 5.5]


def test_who_never_moved_has_one_choice():
    stayed = np.ones((4, 1, 2))
    run = Rollout(stayed, np.full((4, 1), -np.inf), np.array([0]), stayed[:1], np.zeros(1), 0.0)
    assert run.choices(3).tolist() == [[[1, 1]] * 3]


def test_values_are_the_mean_over_all_views_of_a_room():
    """Seen in all eight views, nothing is left of a preference for one direction; a wish to be right remains."""
    views = symmetries(STEPS)
    right = Scripted(lambda x, y: [8.0, 0.0, 0.0, 0.0])
    q = MeanQ(right, views)(Place(), torch.zeros(1), torch.tensor([[1.0, 2.0]], dtype=torch.float64))
    np.testing.assert_allclose(q, [[2.0] * 4])
    # What an agent wants that sees all rooms alike is what it wants in each view, turned back: to the origin.
    home = Scripted(lambda x, y: [-x, x, y, -y])
    for place, best in (((3.0, 1.0), LEFT), ((-3.0, 1.0), RIGHT), ((1.0, 3.0), BELOW), ((1.0, -3.0), UP)):
        q = MeanQ(home, views)(Place(), torch.zeros(1), torch.tensor([place], dtype=torch.float64))
        assert q.argmax().item() == best
        np.testing.assert_allclose(q, home(torch.tensor([place], dtype=torch.float64)))


@pytest.mark.parametrize("kind", ["geometry", "image"])
def test_the_view_that_changes_nothing_is_not_turned_and_no_bit_is_another(kind):
    rooms = design_rooms("bedroom", "test", 0, 3).rooms
    method = composed("train", "method=paper" if kind == "image" else "method=geometric").method
    observe, views = observation_of(kind, rooms), symmetries(method.moves)
    network = q_network(method, categories_of(rooms), np.random.SeedSequence(0), torch.device("cpu"))
    room = torch.arange(30) % 3
    position = torch.as_tensor(np.random.default_rng(0).uniform(0.5, 2.5, (30, 2)))
    turned = []

    class Counting:
        def __call__(self, *poses):
            return observe(*poses)

        def turned(self, observation, symmetry):
            turned.append(symmetry)
            return observe.turned(observation, symmetry)

    q = MeanQ(network, views)(Counting(), room, position)
    assert turned == views[1:]
    slow = network(torch.cat([observe.turned(observe(room, position), view) for view in views])).tensor_split(8)
    assert torch.equal(q, torch.stack([each[:, view.action] for each, view in zip(slow, views, strict=True)]).mean(0))


def test_values_of_however_many_places_are_those_of_each_and_no_more_than_a_block_is_seen_at_once():
    places = torch.as_tensor(np.random.default_rng(0).random((2 * BLOCK + 1, 2)))
    home = Scripted(lambda x, y: [-x, x, y, -y])
    expected = home(places)
    blocks = []
    counting = lambda block: blocks.append(len(block)) or home(block)  # noqa: E731
    q = MeanQ(counting, symmetries(STEPS))(Place(), torch.zeros(len(places)), places)
    np.testing.assert_allclose(q, expected, atol=1e-6)
    assert max(blocks) <= BLOCK
    assert sum(blocks) == 8 * len(places)


def test_the_best_move_is_legal_and_leads_to_where_the_agent_wants_to_be():
    simulator = BatchSimulator(Simulator([wide_room()], STEPS, Reward()))
    q = MeanQ(nearing((2.0, 1.5)), unturned(STEPS))
    places = np.array([(1.0, 1.5), (3.0, 1.5), (2.0, 2.5), (2.0, 0.5)])
    moves, values = q.best_moves(simulator, Place(), np.zeros(4, int), places)
    assert moves.tolist() == [RIGHT, LEFT, BELOW, UP]
    assert values.tolist() == [-0.5, -0.5, -0.5, -0.5]
    beyond = MeanQ(nearing((9.0, 1.5)), unturned(STEPS))
    assert beyond.best_moves(simulator, Place(), np.zeros(1, int), np.array([(3.5, 1.5)]))[0] != RIGHT


def test_a_place_is_looked_at_once_whoever_comes_to_it_and_in_whichever_room():
    asked = []

    def network(block: torch.Tensor) -> torch.Tensor:
        asked.extend(map(tuple, block.tolist()))
        return Scripted(lambda x, y: [-x, x, y, -y])(block).view(-1, 4)

    q, rng = MeanQ(network, unturned(STEPS)), np.random.default_rng(0)
    known, seen = Remembered(q, Place()), set()
    assert known(torch.zeros(0, dtype=torch.int64), torch.zeros(0, 2, dtype=torch.float64)).shape[0] == 0
    for _ in range(5):
        rooms = torch.as_tensor(rng.integers(0, 2, 12))
        places = torch.as_tensor(rng.integers(0, 3, (12, 2)), dtype=torch.float64)
        seen |= {(room, *place) for room, place in zip(rooms.tolist(), places.tolist(), strict=True)}
        np.testing.assert_array_equal(known(rooms, places), Scripted(lambda x, y: [-x, x, y, -y])(places))
    assert len(asked) == len(seen)
