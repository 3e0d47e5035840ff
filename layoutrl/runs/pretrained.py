"""The agents in the package: one a room type, which furnish whole rooms. `layoutrl/weights/` has them.

`experiments/make_weights.py` makes them, and docs/agents.md says what they are. Only their networks need torch.
"""

from __future__ import annotations

import hashlib
import io
import json
from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from layoutrl import InputError
from layoutrl.agents.method import Method
from layoutrl.rooms.called import as_called_here, by_any_name, named_as
from layoutrl.rooms.furnished import Furnished
from layoutrl.rooms.room import Room

if TYPE_CHECKING:
    import torch

    from layoutrl.agents.learner import Agent
    from layoutrl.evaluation.furnishing import Furnisher

FOLDER = files("layoutrl") / "weights"
ABOUT = "weights.json"  # what each file is, and how it was made


@cache
def cards() -> dict[str, dict[str, Any]]:
    """What weights.json says of the agent of each room type."""
    return json.loads((FOLDER / ABOUT).read_text(encoding="utf-8"))["agents"]


def load(room_type: str, device: torch.device) -> Furnisher:
    """Return the furnisher of a room type: its agent in the package. Raises InputError as `agent` does."""
    from layoutrl.evaluation.furnishing import Furnisher

    return Furnisher(agent(room_type, device))


def agent(room_type: str, device: torch.device) -> Agent:
    """The agent of a room type. Raises InputError where there is none, or its file is damaged."""
    if (card := cards().get(room_type)) is None:
        raise InputError(f"room_type: no agent furnishes a {room_type}; expected one of {', '.join(cards())}")
    file = FOLDER / card["file"]
    content = file.read_bytes() if file.is_file() else b""
    if hashlib.sha256(content).hexdigest() != card["sha256"]:
        raise InputError(f"weights: {file} is damaged or missing; expected it as installed: install layoutrl again")
    return unpacked(content, card, device)


def unpacked(content: bytes, card: dict[str, Any], device: torch.device) -> Agent:
    """The agent that a file holds, built as its card says."""
    import torch

    from layoutrl.agents.learner import Agent, q_network

    method = Method(**card["method"])
    network = q_network(method, card["categories"], np.random.SeedSequence(0), device)
    network.load_state_dict(torch.load(io.BytesIO(content), map_location=device, weights_only=True))
    return Agent(network, method, card["categories"])


class Agents:
    """Furnishes rooms of several types, each by the agent of its type, which is loaded when it is first needed."""

    def __init__(self, device: torch.device):
        self.of = cache(lambda room_type: load(room_type, device))

    def furnish(self, briefs: Sequence[Room], choices: int, seed: int) -> list[list[Furnished]]:
        """See Furnishes. Raises InputError as `load` does."""
        briefs, asked = [as_known(brief) for brief in briefs], briefs
        found: list[list[Furnished]] = [[] for _ in briefs]
        for room_type in sorted({brief.room_type for brief in briefs}):
            which = [k for k, brief in enumerate(briefs) if brief.room_type == room_type]
            answers = self.of(room_type).furnish([briefs[k] for k in which], choices, seed)
            for k, answer in zip(which, answers, strict=True):
                found[k] = [replace(each, layout=named_as(asked[k], each.layout)) for each in answer]
        return found


def as_known(brief: Room) -> Room:
    """Return the brief with its items called as the agent of its room type knows them."""
    return with_a_sofa(as_called_here(brief))


def with_a_sofa(brief: Room) -> Room:
    """Return the brief of a living room with its widest loveseat as a sofa, if it has loveseats and no sofa.

    All of the designer's living rooms have a sofa: what the agent does not know as one does not face the television.
    """
    loveseats = [k for k, item in enumerate(brief.furniture) if item.category == "loveseat"]
    has_sofa = any(item.category == "sofa" for item in brief.furniture)
    if brief.room_type != "living_room" or has_sofa or not loveseats:
        return brief
    widest = max(loveseats, key=lambda k: brief.furniture[k].size[1])
    items = (replace(i, category="sofa") if k == widest else i for k, i in enumerate(brief.furniture))
    return replace(brief, furniture=tuple(items))


def known(room_type: str) -> Collection[str]:
    """The categories that the agent of a room type places; none where there is no agent."""
    return cards().get(room_type, {}).get("categories", ())


def placed(room_type: str) -> Collection[str]:
    """The categories that the agent of a room type places, as it is asked through `Agents`: `by_any_name`."""
    return by_any_name(room_type, known(room_type))


def types_with(category: str) -> list[str]:
    """The room types whose agents place a category."""
    return [room_type for room_type, card in cards().items() if category in card["categories"]]
