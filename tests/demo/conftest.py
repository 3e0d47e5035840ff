"""One server's answers for all tests of the demo: a search that is soon done, and that claims to think."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Thread
from typing import TYPE_CHECKING

import numpy as np
import pytest

from layoutrl.demo import listening
from layoutrl.demo.furnisher import Move, Staff
from layoutrl.rivals.budgets import updates_budget
from layoutrl.rivals.rooms.rival import SearchOrAnnealer
from layoutrl.rooms.room import Room
from layoutrl.runs.config import composed

if TYPE_CHECKING:
    from layoutrl.demo.answers import Answers

RESTARTS = 2  # of a search: in so long a time machines find different layouts


class Thinking(SearchOrAnnealer):
    """Thinks most of places near the origin, and of the way there."""

    def values(self, room: Room, item: int, step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        x0, y0, x1, y1 = room.indoor.bounds
        centers = np.stack(np.meshgrid(np.arange(x0, x1, step), np.arange(y0, y1, step)), -1).reshape(-1, 2)
        return centers, -np.hypot(*centers.T), np.zeros(len(centers))

    def moves(self, room: Room, item: int) -> list[Move]:
        center: Sequence[float] = room.furniture[item].center or (0, 0)
        return [("left", (center[0] - 0.5, center[1]), 2.0), ("down", (center[0], center[1] - 0.3), 1.0)]


def staffed(one: Thinking) -> Staff:
    """One for rooms of all types."""
    return Staff(lambda: one, lambda room_type: one, lambda room_type: one.relations(room_type).alone)


@pytest.fixture(scope="session")
def answers() -> Answers:
    from layoutrl.demo.answers import Answers

    return Answers(staffed(Thinking(composed("demo").search, lambda: updates_budget(RESTARTS))))


@contextmanager
def served(answers: Answers) -> Iterator[str]:
    """The address of a page that is served from a thread."""
    from layoutrl.demo.server import server_of

    with listening(0) as listener:
        server = server_of(answers, listener, timeout=60)
        thread = Thread(target=server.run, args=([listener],))
        thread.start()
        host, port = listener.getsockname()
        try:
            yield f"http://{host}:{port}"
        finally:
            server.should_exit = True
            thread.join()
