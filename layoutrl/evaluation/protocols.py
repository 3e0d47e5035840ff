"""Greedy rollouts: where the trained agent puts an item."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch

from layoutrl.agents.dqn import DQN, Observe
from layoutrl.env.batch import BatchSimulator

DISTINCT = 0.1  # metres: stopping places nearer to each other are one choice


@dataclass(frozen=True)
class Rollout:
    """B greedy episodes: the way of each, and where it ends."""

    room: np.ndarray  # (B,) index
    path: np.ndarray  # (T + 1, B, 2), metres; an episode that ended stays where it was
    final: np.ndarray  # (B, 2), metres: the stopping place
    moves: np.ndarray  # (B,): moves until the stopping place is first reached
    value: np.ndarray  # (B,): Q of the move that entered the stopping place; -infinity where none did: it never moved
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
    value = entered_by[last, np.arange(batch)]
    looped = (loop_start >= 0) | (end < max_moves)
    return Rollout(room, path, final, moves, value, looped, time.perf_counter() - began)


def best_places(
    agent: DQN,
    simulator: BatchSimulator,
    observe: Observe,
    generator: torch.Generator,
    max_moves: int,
    on_illegal: Literal["stop", "mask"] = "mask",
    *,
    starts: int = 16,
    count: int = 3,
) -> np.ndarray:
    """The agent's own first, second and third choice in every room: (rooms, count, 2), metres.

    Real designs leave a choice open. Greedy episodes from `starts` places drawn uniformly in each room end
    in one or several stopping places; of those the distinct ones entered by the moves of highest Q. The designer's
    place is never consulted: which of them scores best is another's to say.
    """
    rooms = len(simulator.rooms)
    room = torch.arange(rooms, device=simulator.device).repeat_interleave(starts)
    drawn = simulator.starts(room, generator).cpu().numpy()
    run = rollout(agent, simulator, observe, room.cpu().numpy(), drawn, max_moves, on_illegal)
    return distinct_places(run.value.reshape(rooms, starts), run.final.reshape(rooms, starts, 2), count)


def distinct_places(value: np.ndarray, place: np.ndarray, count: int) -> np.ndarray:
    """Of places (rooms, n, 2) the `count` of highest value (rooms, n), best first: (rooms, count, 2).

    Places nearer to each other than DISTINCT are one, of the higher value. Where there are fewer, the best is repeated.
    """
    place = np.take_along_axis(place, np.argsort(-value, axis=1, kind="stable")[..., None], 1)  # best first
    left = np.ones(value.shape, dtype=bool)
    best = np.empty((len(value), count, 2))
    for k in range(count):
        best[:, k] = place[np.arange(len(value)), left.argmax(1)]  # the first that is left; of all if none is
        left &= np.linalg.norm(place - best[:, k, None], axis=-1) >= DISTINCT
    return best
