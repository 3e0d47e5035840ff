"""The perfect Q's places, against the same decision process solved by brute force with the shapely simulator."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.evaluation import oracle
from layoutrl.evaluation.metrics import lattice_ceiling
from layoutrl.evaluation.oracle import perfect_places
from layoutrl.rooms.room import Item
from tests.builders import l_room, random_room, rectangular_room

NEAR = 2e-5  # of IoU: what a few micrometres of grid and fit make
MERGED = 5e-6  # metres: places nearer than this are one here, however slides were rounded


class Solved:
    """All places that moves reach from a start, and their optimal values, by plain value iteration."""

    def __init__(self, simulator: Simulator, start: np.ndarray, discount: float, most: int = 20_000):
        known, self.position, leads_to = {self.cell(start): 0}, [tuple(start)], []
        while len(leads_to) < len(self.position) <= most:
            front = np.array(self.position[len(leads_to) :])
            reached, legal = simulator.destinations(np.zeros(len(front), dtype=int), front)
            for places, allowed in zip(reached, legal, strict=True):
                row = []
                for place in places[allowed]:
                    cell = self.cell(place)
                    if cell not in known:
                        known[cell] = len(self.position)
                        self.position.append(tuple(place))
                    row.append(known[cell])
                leads_to.append(row or [len(leads_to)])  # an item that cannot move stays
        assert len(leads_to) == len(self.position), "too many places for brute force"
        places = np.array(self.position)
        self.reward = simulator.reward(np.zeros(len(places), dtype=int), places).total / 100
        width = max(map(len, leads_to))
        self.leads_to = np.array([row + row[:1] * (width - len(row)) for row in leads_to])
        self.discount = discount
        self.value = np.zeros(len(places))
        for _ in range(int(np.log(1e-10) / np.log(discount))):
            self.value = self.q()[self.leads_to].max(1)

    @staticmethod
    def cell(place: np.ndarray) -> tuple[int, int]:
        x, y = np.round(np.asarray(place) / MERGED).astype(int)
        return int(x), int(y)

    def q(self) -> np.ndarray:
        """Of the move that enters each place."""
        return self.reward + self.discount * self.value

    def stops(self) -> tuple[list[int], float]:
        """The stopping places of all greedy policies that are tied, found by following each, and the margin of ties."""
        q = self.q()
        follows = [[int(n) for n in row if q[n] > q[row].max() - 1e-6] for row in self.leads_to]
        # What tied policies can visit, and of it what lies on a loop.
        reach = self._closure(follows, 0)
        loops = [s for s in reach if any(s in self._closure(follows, n) for n in follows[s])]
        return loops, 0.0

    @staticmethod
    def _closure(follows, start):
        seen, todo = {start}, [start]
        while todo:
            for n in follows[todo.pop()]:
                if n not in seen:
                    seen.add(n)
                    todo.append(n)
        return seen
