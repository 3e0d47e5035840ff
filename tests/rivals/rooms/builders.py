"""Layouts at random, and the settings that conf/ has, with tiny budgets."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TypeVar

import numpy as np
from omegaconf import OmegaConf

from layoutrl.rivals.rooms.scene import Scene
from layoutrl.rooms.designer.generator import design_rooms
from layoutrl.rooms.room import Room
from layoutrl.runs.config import config_directory

Settings = TypeVar("Settings")


def configured(schema: type[Settings], name: str) -> Settings:
    """What conf/rival/ says, in the shape of `schema`."""
    values = OmegaConf.load(config_directory() / "rival" / f"{name}.yaml")
    return OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(schema), values))


def random_poses(scene: Scene, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Centres (count, n, 2) in the room's bounding box, and facings (count, n)."""
    n = len(scene.center)
    return rng.uniform(scene.bounds[:2], scene.bounds[2:], (count, n, 2)), rng.integers(4, size=(count, n))


@cache
def designed(room_type: str, count: int) -> list[Room]:
    """Rooms by the designer, of no seed that is reported on."""
    return design_rooms(room_type, "train", 3, count).rooms


def disarranged(room: Room, rng: np.random.Generator) -> Room:
    """The room with its furniture in another order, elsewhere, turned."""
    items = [room.furniture[k] for k in rng.permutation(len(room.furniture))]
    there = [replace(i, center=(float(rng.uniform(0, 2)), 1.0), rotation=90.0 * int(rng.integers(4))) for i in items]
    return replace(room, furniture=tuple(there))
