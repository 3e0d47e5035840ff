"""Greedy rollouts: where the trained agent puts an item."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch

from layoutrl.agents.dqn import DQN, Observe
from layoutrl.env.batch import BatchSimulator


@dataclass(frozen=True)
class Rollout:
    """B greedy episodes: the way of each, and where it ends."""

    room: np.ndarray  # (B,) index
    path: np.ndarray  # (T + 1, B, 2), metres; an episode that ended stays where it was
    final: np.ndarray  # (B, 2), metres: the stopping place
    moves: np.ndarray  # (B,): moves until the stopping place is first reached
    looped: np.ndarray  # (B,): False where the budget of moves ended an episode before it repeated itself
    seconds: float


def rollout(
    agent: DQN,
    simulator: BatchSimulator,
    observe: Observe,
    room: np.ndarray,
    starts: np.ndarray,
    max_moves: int,
    on_illegal: Literal["stop", "mask"] = "mask",
) -> Rollout:
    """Follow the greedy policy from each start (B, 2) until it repeats itself.

    A deterministic policy ends in a loop of positions. The stopping place is the one in the loop
    that is entered by the move of highest Q; the designer's place is never consulted. With
    `on_illegal="stop"` (the paper's test rule, section 4.2) an illegal choice ends the episode
    where it stands; with `"mask"` the best legal move is taken.
    """
    began = time.perf_counter()
    batch = len(room)
    path = np.repeat(starts[None], max_moves + 1, 0)
    entered_by = np.full((max_moves + 1, batch), -np.inf)  # Q of the move that led to each position
    end = np.full(batch, max_moves)  # index into the path of the last position
    loop_start = np.full(batch, -1)
    active = np.arange(batch)
    for t in range(max_moves):
        here = torch.as_tensor(path[t, active], device=simulator.device)
        rooms = torch.as_tensor(room[active], device=simulator.device)
        length, legal = simulator.reach(rooms, here)
        q = agent.values(observe(rooms, here))
        if on_illegal == "mask":
            q = q.masked_fill(~legal, -torch.inf)
        highest, action = q.max(1, keepdim=True)
        stays = ~legal.gather(1, action)
        moved = simulator.moved(here, action.squeeze(1), length.gather(1, action).squeeze(1))
        there = torch.where(stays, here, moved).cpu().numpy()
        stops = stays.squeeze(1).cpu().numpy()
        path[t + 1 :, active] = there
        entered_by[t + 1, active] = highest.squeeze(1).cpu().numpy()
        seen = np.all(path[: t + 1, active] == there, -1)  # (t + 1, active)
        loops = seen.any(0) & ~stops
        loop_start[active[loops]] = seen[:, loops].argmax(0)
        end[active[stops]] = t
        end[active[loops]] = t + 1
        active = active[~(stops | loops)]
        if not len(active):
            break
    steps = np.arange(max_moves + 1)[:, None]
    in_loop = (steps > loop_start) & (steps <= end) & (loop_start >= 0)
    best = np.where(in_loop, entered_by, -np.inf).argmax(0)
    last = np.where(loop_start >= 0, best, end)
    final = path[last, np.arange(batch)]
    moves = np.all(path == final, -1).argmax(0)
    return Rollout(room, path, final, moves, (loop_start >= 0) | (end < max_moves), time.perf_counter() - began)
