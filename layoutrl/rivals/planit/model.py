"""PlanIT for one room type: statistics of the training rooms, and the networks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
import torch
from torch import nn

from layoutrl.agents.networks import weights_of
from layoutrl.rivals.planit.canvas import FIXED_CHANNELS, box_of, overlapping
from layoutrl.rivals.planit.generator import GraphNetwork
from layoutrl.rivals.planit.graph import ARCHITECTURE, KeptTypes, Scene, kept_types
from layoutrl.rivals.planit.networks import LocationNetwork, PictureNetwork, SizeNetwork
from layoutrl.rooms.brief import standing
from layoutrl.rooms.room import Room


@dataclass(frozen=True)
class Statistics:
    """Counts of the training rooms."""

    categories: list[str]  # of furniture, the most important (frequent and large) first
    kept: KeptTypes  # types of edges that pruning leaves
    sizes: dict[str, list[tuple[float, float, bool]]]  # of each category: depth, width (metres), round
    tucked: list[tuple[str, str]]  # categories of which the first stands partly under the second
    span: float  # metres: no training room is longer
    most: int  # items: no training room has more

    @property
    def nodes(self) -> list[str]:
        """The categories of nodes."""
        return [*ARCHITECTURE, *self.categories]


def counted(rooms: Sequence[Room], scenes: Sequence[Scene]) -> Statistics:
    """Count the furniture of rooms and the edges of their scenes."""
    items = [item for room in rooms for item in standing(room)]
    weight: Counter[str] = Counter()
    for item in items:
        weight[item.category] += item.size[0] * item.size[1]  # type: ignore[assignment]
    sizes: dict[str, set[tuple[float, float, bool]]] = {category: set() for category in weight}
    for item in items:
        sizes[item.category].add((*item.size, item.form == "circle"))
    bounds = np.array([room.envelope.bounds for room in rooms])
    return Statistics(
        [category for category, _ in sorted(weight.items(), key=lambda entry: (-entry[1], entry[0]))],
        kept_types(scenes),
        {category: sorted(found) for category, found in sorted(sizes.items())},
        sorted({pair for room in rooms for pair in _tucked(room)}),
        float((bounds[:, 2:] - bounds[:, :2]).max()),
        max(len(scene.items) for scene in scenes),
    )


def _tucked(room: Room) -> Iterator[tuple[str, str]]:
    """Yield (category of an item that stands partly under another, category of the other)."""
    for under, host in permutations(standing(room), 2):
        if under.tucked and not host.tucked and overlapping(box_of(under), box_of(host)):
            yield under.category, host.category


class PlanIT(nn.Module):
    """The networks of one room type, untrained; their weights depend on the seed alone."""

    def __init__(self, statistics: Statistics, seed: np.random.SeedSequence, device: torch.device | str = "cpu"):
        super().__init__()
        self.statistics, self.device = statistics, torch.device(device)
        categories = len(statistics.categories)
        channels = FIXED_CHANNELS + categories
        with weights_of(seed):
            self.location = LocationNetwork(channels + 1, categories)
            self.orientation = PictureNetwork(channels, categories, 4)
            self.size = SizeNetwork(channels, categories)
            self.graphs = GraphNetwork(len(ARCHITECTURE) + categories)
        self.to(self.device)
        self.eval()  # except while they are trained
