"""Deep Q-learning with a target network (Mnih et al. 2015), as in section 4.4 of Di & Yu 2021.

Double Q-learning is an option (van Hasselt, Guez & Silver 2016).
"""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.nn.functional import smooth_l1_loss

from layoutrl.agents.replay import Transitions


class UpdateStats(NamedTuple):
    """Statistics of one update, on the device: reading them waits for it. Q is that of the moves made, before it."""

    loss: Tensor
    mean_q: Tensor
    max_q: Tensor

    @classmethod
    def of(cls, loss: Tensor, q: Tensor) -> UpdateStats:
        """Return those of a loss and the Q (B,) of the moves made."""
        return cls(loss.detach(), q.detach().mean(), q.detach().max())


PARTS = ("network", "target", "optimizer", "schedule")  # attributes of a DQN with a state_dict of their own


class DQN:
    """A Q-network, its target network and an optimiser, Adam.

    The target network is copied every `target_period` updates; the learning rate falls linearly from `learning_rate` to
    zero at `total_updates`. With `double` the network chooses the next action and the target network values it.
    """

    def __init__(
        self,
        network: nn.Module,
        learning_rate: float,
        total_updates: int,
        target_period: int,
        double: bool,
    ):
        self.network = network
        self.target = copy.deepcopy(network).requires_grad_(False).eval()
        self.optimizer = torch.optim.Adam(network.parameters(), lr=learning_rate, fused=True)
        self.schedule = torch.optim.lr_scheduler.LinearLR(self.optimizer, 1.0, 0.0, total_updates)
        self.target_period = target_period
        self.double = double
        self.updates = 0

    @torch.no_grad()
    def values(self, observation: Tensor) -> Tensor:
        """Q(s, a) for every action: (B, A)."""
        return self.network(observation)

    def update(self, batch: Transitions, observation: Tensor, next_observation: Tensor) -> UpdateStats:
        """One step of gradient descent on the Huber loss between Q(s, a) and r + discount max_a' Q'(s', a')."""
        q = self.network(observation).gather(1, batch.action.long()[:, None]).squeeze(1)
        target = self.td_target(batch, next_observation)
        assert q.shape == target.shape == batch.reward.shape
        loss = smooth_l1_loss(q, target)
        self._descend(loss)
        return UpdateStats.of(loss, q)

    def update_every_move(self, legal: Tensor, target: Tensor, observation: Tensor) -> tuple[Tensor, Tensor]:
        """Take one gradient step on the mean absolute error of the values of all moves (B, A).

        Illegal moves count as errors of 0. Return the loss, and the network's output (B, A) before the step.
        """
        learned = self.network(observation)
        assert learned.shape == target.shape == legal.shape
        loss = (learned - target).where(legal, 0.0).abs().mean()
        self._descend(loss)
        return loss.detach(), learned.detach()

    def _descend(self, loss: Tensor) -> None:
        """Take one gradient step on the loss."""
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        self.optimizer.step()
        self.schedule.step()
        self.updates += 1
        if self.updates % self.target_period == 0:
            self.target.load_state_dict(self.network.state_dict())

    @torch.no_grad()
    def td_target(self, batch: Transitions, next_observation: Tensor) -> Tensor:
        """Return r + discount max Q'(s', a') over the legal moves a' (B,); r where none is legal."""
        next_q = self.target(next_observation)
        chooser = self.network(next_observation) if self.double else next_q
        best = chooser.masked_fill(~batch.next_legal, -torch.inf).argmax(1, keepdim=True)
        value = next_q.gather(1, best).squeeze(1) * batch.next_legal.any(1)
        return batch.reward + batch.discount * value

    def state_dict(self) -> dict[str, Any]:
        """Both networks, the optimiser, its schedule, and the count of updates."""
        return {name: getattr(self, name).state_dict() for name in PARTS} | {"updates": self.updates}

    def load_state_dict(self, state: dict[str, Any]) -> None:
        """Restore what `state_dict` returned."""
        for name in PARTS:
            getattr(self, name).load_state_dict(state[name])
        self.updates = state["updates"]
