"""Learning what every move of a pose gains: the regression targets, and the scale on which they are learned."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from layoutrl.agents.exploration import LinearSchedule
from layoutrl.agents.replay import Transitions
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.reward import REWARD_SCALE

UNIT = 0.01  # of rewards / 100: the scale is about linear below it and logarithmic above
LARGEST = 12.0  # on that scale: above all true values; a network's output is clamped to it
WIDENED = 0.9  # the gap between the best move and another is learned 1 / (1 - WIDENED) times as large
MAY_LOSE = 1e-4  # of rewards / 100: a move is repeated while a repetition loses no more than this


@dataclass(frozen=True)
class EveryMove:
    """The update that learns the values of all legal moves of a pose at once, by what each move gains.

    The gain of a move is the reward of the pose that it leads to, less that of the pose that it leaves. This is the
    paper's reward shaped by a potential, the return of staying in place (Ng, Harada & Russell 1999), all times
    1 - discount, so that the best moves stay the best. The discount rises over the first half of the updates.

    A room is a hundred moves long. To carry values from the goal in fewer steps, each move is repeated while it is
    legal and loses nothing, at most 1, 2, 4, ... or `repeats` times, drawn at random. Near the goal, where rewards
    change, it is made once; on free floor repetition makes the way back from a wrong move longer (persistent
    exploration: Dabney, Ostrovski & Barreto 2021; action repetition: Lakshminarayanan, Sharma & Ravindran 2017).

    Values fall by a share (1 - discount) with each move away from the goal, and moves of one pose differ by no more
    than that share of them. So the network learns h(Q) = asinh(Q / UNIT), on which a move makes as much difference far
    from the goal as near it (van Seijen, Fatemi & Tavakoli 2019; transitions are deterministic, so this changes no
    value). On this scale the gap to the best move is learned wider (advantage learning: Baird 1999; Bellemare et al.
    2016). `gains` undoes both.
    """

    simulator: BatchSimulator
    total_updates: int
    discount: tuple[float, float]  # first and last; in between, the horizon 1 / (1 - discount) rises linearly
    repeats: int = 32  # the most times that a move is made, a power of two

    def discount_at(self, updates: int) -> float:
        """The discount after so many updates."""
        first, last = (1 / (1 - discount) for discount in self.discount)
        return 1 - 1 / LinearSchedule(first, last, self.total_updates // 2)(updates)

    def transitions(
        self, room: Tensor, position: Tensor, updates: int, generator: torch.Generator
    ) -> tuple[Tensor, Transitions]:
        """Return which moves are legal, bool (B, A), and transitions (B x A,) of all moves, repeated.

        An illegal move stays in place and gains 0. `updates` is how many were made so far: it sets the discount.
        """
        simulator, discount = self.simulator, self.discount_at(updates)
        legal = simulator.reach(room, position)[1]
        pose, action = torch.ones_like(legal).nonzero().unbind(1)
        room, before = room[pose], position[pose]
        times = 2 ** torch.randint(self.repeats.bit_length(), room.shape, generator=generator, device=room.device)
        after, stands = before.clone(), self.reward(room, before)
        gained, discounts = torch.zeros_like(stands), torch.ones_like(stands)
        goes = torch.arange(len(room), device=room.device)  # the moves that are still repeated
        for made in range(self.repeats):
            goes = goes[made < times[goes]]
            if not len(goes):
                break
            reach = simulator.reach(room[goes], after[goes])
            length, can = (each.gather(1, action[goes, None]).squeeze(1) for each in reach)
            goes, length = goes[can], length[can]
            there = simulator.moved(room[goes], after[goes], action[goes], length)
            reward = self.reward(room[goes], there)
            keeps = reward - stands[goes] >= (-MAY_LOSE if made else -torch.inf)
            goes, there, reward = goes[keeps], there[keeps], reward[keeps]
            gained[goes] += discounts[goes] * (reward - stands[goes])
            discounts[goes] *= discount
            after[goes], stands[goes] = there, reward
        return legal, Transitions(room, before, action, gained, discounts, after, simulator.reach(room, after)[1])

    def reward(self, room: Tensor, position: Tensor) -> Tensor:
        """Return the rewards of poses (B,), divided by REWARD_SCALE."""
        return self.simulator.reward(room, position).total / REWARD_SCALE

    def q_made(self, learned: Tensor, legal: Tensor, action: Tensor, reward: Tensor, updates: int) -> Tensor:
        """Return Q (B,) of one action (B,) of each pose, of rewards / 100, as `DQN.update` learns it.

        It follows from the network's output `learned` (B, A) and the `reward` (B,) of the poses: Q of the gains is
        (1 - discount) Q - reward. Where no move is legal, nothing is gained.
        """
        gained = gains(learned, legal).gather(1, action[:, None]).squeeze(1).where(legal.any(1), 0.0)
        return (reward + gained) / (1 - self.discount_at(updates))

    @torch.no_grad()
    def target(
        self, network: nn.Module, legal: Tensor, moves: Transitions, observation: Tensor, next_observation: Tensor
    ) -> Tensor:
        """Return the regression targets of all moves (B, A); `network` is the target network.

        They are h(gain + discount max Q(s', a')) - WIDENED (max h(Q(s)) - h(Q(s, a))).
        """
        following = unscaled(_best(network(next_observation), moves.next_legal).squeeze(1))
        following = following.where(moves.next_legal.any(1), 0.0)
        learned = network(observation)
        wider = WIDENED * (_best(learned, legal) - learned)
        return rescaled(moves.reward + moves.discount * following).view_as(legal) - wider


def gains(learned: Tensor, legal: Tensor) -> Tensor:
    """Return Q of the gains (B, A), in rewards / 100, from the output of the network that learned them (B, A)."""
    best = _best(learned, legal)
    return unscaled(best - (1 - WIDENED) * (best - learned))


def rescaled(value: Tensor) -> Tensor:
    """Return h(value), on the scale on which values are learned."""
    return (value / UNIT).asinh()


def unscaled(scaled: Tensor) -> Tensor:
    """Invert `rescaled`, with `scaled` clamped to LARGEST."""
    return UNIT * scaled.clamp(-LARGEST, LARGEST).sinh()


def _best(q: Tensor, legal: Tensor) -> Tensor:
    """Return the value of the best legal move: (B, 1), -inf where none is legal."""
    return q.masked_fill(~legal, -torch.inf).amax(1, keepdim=True)
