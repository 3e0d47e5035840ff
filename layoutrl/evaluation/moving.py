"""Furnishes rooms with an agent trained to move one item: it moves each that has no center, the largest first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import shapely
import torch

from layoutrl.agents.learner import Agent
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.observation import observation_of
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Simulator
from layoutrl.evaluation.placing import spread
from layoutrl.evaluation.policy import greedy
from layoutrl.evaluation.threads import one_thread
from layoutrl.rooms.brief import distinct_rotations, largest_first, with_poses
from layoutrl.rooms.fitting import fitting_positions
from layoutrl.rooms.furnished import Furnished, laid_out, rng_of, several
from layoutrl.rooms.room import Room

STARTS_PER_FACING = 4  # starts for each facing, spread evenly so that little depends on the seed


class Mover:
    """A trained agent that moves one item. Of several it moves the largest first, each among what stands by then."""

    def __init__(self, agent: Agent, reward: Reward):
        self.agent, self.reward = agent, reward

    @one_thread()
    @torch.inference_mode()
    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        """See Furnishes. The value of a layout is the mean of the agent's values of its items' places.

        Raises InputError if an item does not fit into its room in any facing.
        """
        return several(self._layouts, briefs, choices, seed)

    def _layouts(self, briefs: Sequence[Room], seeds: Sequence[int]) -> list[Furnished]:
        layouts, values = list(briefs), [np.zeros(0) for _ in briefs]
        rngs = [rng_of(brief, seeds) for brief in briefs]
        orders = [largest_first(brief) for brief in briefs]
        for turn in range(max(map(len, orders), default=0)):
            asked = [(k, order[turn]) for k, order in enumerate(orders) if turn < len(order)]
            turned = [(k, facing) for k, item in asked for facing in in_all_facings(layouts[k], item)]
            fits = fitting([room for _, room in turned])
            able = {k for (k, _), fit in zip(turned, fits, strict=True) if fit}
            # An item that fits in no facing keeps all of them: the simulator names it.
            turned = [(k, room) for (k, room), fit in zip(turned, fits, strict=True) if fit or k not in able]
            rooms = [room for _, room in turned]
            place, value = self._moved(rooms, [rngs[k] for k, _ in turned])
            for k, item in asked:
                ends = [n for n, (of, _) in enumerate(turned) if of == k]
                best = max(ends, key=lambda n: value[n])
                center = (round(float(place[best][0]), 4), round(float(place[best][1]), 4))
                layouts[k] = with_poses(layouts[k], {item: (center, rooms[best].moving.degrees)})
                values[k] = np.append(values[k], value[best])
        made = zip(briefs, layouts, values, strict=True)
        return [laid_out(brief, layout, float(value.mean()) if value.size else 0.0) for brief, layout, value in made]

    def _moved(self, rooms: Sequence[Room], rngs: Sequence[np.random.Generator]) -> tuple[np.ndarray, np.ndarray]:
        """Return where the agent moves the targets (B, 2) and the values of these places (B,): the best over starts."""
        network, method, categories = self.agent
        policy, index = greedy(network, method), np.arange(len(rooms)).repeat(STARTS_PER_FACING)
        device = policy.q.device
        simulator = BatchSimulator(Simulator(rooms, method.moves, self.reward), device)
        moved_on = np.stack([rng.random(3) for rng in rngs], 1).repeat(STARTS_PER_FACING, 1)
        numbers = torch.as_tensor((np.tile(spread(0, STARTS_PER_FACING), len(rooms)) + moved_on) % 1, device=device)
        run = policy.rollout(
            simulator,
            observation_of(method.observation, rooms, device, categories),
            index,
            simulator.starts_at(torch.as_tensor(index, device=device), numbers).cpu().numpy(),
        )
        value = run.promise.reshape(-1, STARTS_PER_FACING)
        best = np.arange(len(rooms)), value.argmax(1)
        return run.final.reshape(-1, STARTS_PER_FACING, 2)[best], value[best]


def in_all_facings(room: Room, item: int) -> list[Room]:
    """Return a copy of the room for each facing of an item, its target.

    The simulator asks for the designer's place of a target. Here there is none: a corner of the outline stands in for
    it, and nothing reads it.
    """
    return [
        replace(with_poses(room, {item: (room.outline[0], degrees)}), target=item)
        for degrees in distinct_rotations(room, room.furniture[item])
    ]


def fitting(rooms: Sequence[Room]) -> np.ndarray:
    """Return which rooms have a place indoors for their target as it is turned: bool (B,)."""
    indoor, templates = (np.array(each) for each in zip(*[(r.indoor, r.moving.template) for r in rooms], strict=True))
    return ~shapely.is_empty(fitting_positions(indoor, templates))
