"""Designed rooms whose main item moves, and PlanIT untrained."""

from __future__ import annotations

from functools import cache

import numpy as np

from layoutrl.rivals.planit.graph import scene_of
from layoutrl.rivals.planit.model import PlanIT, counted
from layoutrl.rivals.planit.placement import Placer
from layoutrl.rooms.collection import Collection, choose_item
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import Room


@cache
def designed(room_type: str, count: int) -> list[Room]:
    rooms = design_rooms(room_type, "train", 5, count).rooms
    return choose_item(Collection("designer", rooms, inside=True), "main").rooms


def placer_of(rooms: list[Room], seed: int = 0) -> Placer:
    """Untrained: its heat says nothing, so that most trials fail."""
    scenes = [scene_of(room) for room in rooms]
    model = PlanIT(counted(rooms, scenes), np.random.SeedSequence(seed))
    model.eval()
    return Placer(model, rooms, scenes)
