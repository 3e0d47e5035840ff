"""Learning what each move of a pose gains: of which numbers it is learned, and on which scale."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from layoutrl.agents.exploration import LinearSchedule
from layoutrl.agents.replay import REWARD_SCALE, Transitions
from layoutrl.env.batch import BatchSimulator

UNIT = 0.01  # of rewards / 100: smaller values are learned as they are, larger ones by their logarithm
LARGEST = 12.0  # on that scale: more than any value has, whatever a network says
WIDENED = 0.9  # share of the gap between the best move and another: it is learned 1 / (1 - WIDENED) times as large
MAY_LOSE = 1e-4  # of rewards / 100: what a repeated move may lose, and still goes on


@dataclass(frozen=True)
class EveryMove:
    """How values of all legal moves are learned at once, of every pose that is sampled: by what each move gains.

    A move gains the reward of the pose that it leads to, less that of the pose that it leaves. That is the paper's
    reward shaped by a potential, what staying would pay (Ng, Harada & Russell 1999; all of it times 1 - discount), so
    that the best moves stay the best. The discount rises over the first half of the updates.

    A room is a hundred moves long. So that a value has fewer steps to come from the goal, each move is repeated: up to
    1, 2, 4, ... or `repeats` times, which is drawn, while it is legal and loses nothing. Near the goal, where rewards
    change, that is once; on free floor the way back from a wrong move is so much the longer (persistent exploration:
    Dabney, Ostrovski & Barreto 2021; action repetition: Lakshminarayanan, Sharma & Ravindran 2017).

    Values fall by a share (1 - discount) with each move away from the goal, and moves of one pose differ by no more
    than that share of them. They are learned as h(Q) = asinh(Q / UNIT), in which each move counts as much, near and far
    (van Seijen, Fatemi & Tavakoli 2019; nothing here hangs on chance, so that this changes no value). In these numbers
    the gap to the best move is learned wider (advantage learning: Baird 1999; Bellemare et al. 2016). `gains` takes
    both back.
    """

    simulator: BatchSimulator
    updates: int
    discount: tuple[float, float]  # first and last: what rises linearly is the horizon, 1 / (1 - discount)
    repeats: int = 32  # of a move at most, a power of two

    def discount_at(self, updates: int) -> float:
        """The discount after so many updates."""
        first, last = (1 / (1 - discount) for discount in self.discount)
        return 1 - 1 / LinearSchedule(first, last, self.updates // 2)(updates)

    def transitions(
        self, room: Tensor, position: Tensor, updates: int, generator: torch.Generator
    ) -> tuple[Tensor, Transitions]:
        """Which moves are legal (B, A), and all as transitions (B x A,), repeated; what is not legal leads nowhere."""
        simulator, discount = self.simulator, self.discount_at(updates)
        legal = simulator.reach(room, position)[1]
        pose, action = torch.ones_like(legal).nonzero().unbind(1)
        room, before = room[pose], position[pose]
        times = 2 ** torch.randint(self.repeats.bit_length(), room.shape, generator=generator, device=room.device)
        after, stands = before.clone(), self.worth(room, before)
        gained, discounts = torch.zeros_like(stands), torch.ones_like(stands)
        goes = torch.arange(len(room), device=room.device)  # which of them go on
        for made in range(self.repeats):
            goes = goes[made < times[goes]]
            if not len(goes):
                break
            reach = simulator.reach(room[goes], after[goes])
            length, can = (each.gather(1, action[goes, None]).squeeze(1) for each in reach)
            goes, length = goes[can], length[can]
            there = simulator.moved(room[goes], after[goes], action[goes], length)
            worth = self.worth(room[goes], there)
            keeps = worth - stands[goes] >= (-MAY_LOSE if made else -torch.inf)
            goes, there, worth = goes[keeps], there[keeps], worth[keeps]
            gained[goes] += discounts[goes] * (worth - stands[goes])
            discounts[goes] *= discount
            after[goes], stands[goes] = there, worth
        return legal, Transitions(room, before, action, gained, discounts, after, simulator.reach(room, after)[1])

    def worth(self, room: Tensor, position: Tensor) -> Tensor:
        """What poses pay (B,), in rewards / 100."""
        return self.simulator.reward(room, position).total / REWARD_SCALE

    def q_made(self, learned: Tensor, legal: Tensor, action: Tensor, worth: Tensor, updates: int) -> Tensor:
        """Q of rewards, as `DQN.update` learns it, of a move (B,) each of poses of this `worth` (B,), in rewards / 100.

        Of what is learned of all their moves (B, A): what a move gains in the end is (1 - discount) Q less the worth of
        the pose. Where no move is legal, nothing is gained.
        """
        gained = gains(learned, legal).gather(1, action[:, None]).squeeze(1).where(legal.any(1), 0.0)
        return (worth + gained) / (1 - self.discount_at(updates))

    @torch.no_grad()
    def target(
        self, network: nn.Module, legal: Tensor, moves: Transitions, observation: Tensor, next_observation: Tensor
    ) -> Tensor:
        """h(gain + discount max Q(s', a')) - WIDENED (max h(Q(s)) - h(Q(s, a))) of all moves, by the target: (B, A)."""
        following = unscaled(_best(network(next_observation), moves.next_legal).squeeze(1))
        following = following.where(moves.next_legal.any(1), 0.0)
        learned = network(observation)
        wider = WIDENED * (_best(learned, legal) - learned)
        return rescaled(moves.reward + moves.discount * following).view_as(legal) - wider


def gains(learned: Tensor, legal: Tensor) -> Tensor:
    """Q of what moves gain, in rewards / 100, of what a network has learned: (B, A) each."""
    best = _best(learned, legal)
    return unscaled(best - (1 - WIDENED) * (best - learned))


def rescaled(value: Tensor) -> Tensor:
    """Values on the scale on which they are learned."""
    return (value / UNIT).asinh()


def unscaled(scaled: Tensor) -> Tensor:
    """Values back from that scale."""
    return UNIT * scaled.clamp(-LARGEST, LARGEST).sinh()


def _best(q: Tensor, legal: Tensor) -> Tensor:
    """Of the best legal move: (B, 1)."""
    return q.masked_fill(~legal, -torch.inf).amax(1, keepdim=True)
