"""The Q-networks: state in, one value an action out."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from torch import Tensor, nn

from layoutrl.env.observation import ITEM, PRESENT, WALL, WINDOW, Y, upright_box
from layoutrl.env.simulator import TOUCHING

TYPICAL = 8  # elements: sums over elements are divided by it, to be about as large as maxima
FAR = 6.0  # metres: the clearance where nothing stands in a direction
SCALES = (2.0, 0.5, 0.1, 0.02)  # metres: a distance is encoded at each; small distances are resolved best
WAVES = (1.0, 0.25)  # metres: wavelengths of its sines, so that a centimetre is seen far from everything, too
BLOCK = 32  # pictures convolved at once on a CPU
SHOWN = len(SCALES) + 2 * len(WAVES)  # numbers for a distance
RELATIONS = 6 * SHOWN  # numbers for four gaps and two offsets of an element
CLEARANCE_NUMBERS = (12 + 6 + 4) * SHOWN  # for clearances, differences of opposite ones, and slides


@contextmanager
def weights_of(seed: np.random.SeedSequence) -> Iterator[None]:
    """Draw the weights of layers made inside, on the CPU, from the seed; torch's global generator is restored."""
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(int(seed.generate_state(1)[0]))
        yield


class PaperNetwork(nn.Module):
    """Convolutions of 8, 16, 32 features, then fully connected 7200, 512, 512 (section 4.4, Figure 5).

    Input: uint8 pictures (B, 128, 128, 3). Output: (B, actions). Kernels of 3 x 3 with stride 2 and no padding, which
    the 7200 features imply, do not reach the last row and column.
    """

    def __init__(self, actions: int, dueling: bool = False):
        super().__init__()
        self.features = nn.Sequential(
            nn.Conv2d(3, 8, 3, stride=2),
            nn.ReLU(inplace=True),
            nn.Conv2d(8, 16, 3, stride=2),
            nn.ReLU(inplace=True),
            nn.Conv2d(16, 32, 3, stride=2),
            nn.ReLU(inplace=True),
            nn.Flatten(),
            nn.Linear(7200, 512),
            nn.ReLU(inplace=True),
            nn.Linear(512, 512),
            nn.ReLU(inplace=True),
        )
        self.head = _head(512, actions, dueling)
        # Channels last, as in pictures: on a CPU the backward pass takes half the time. (torch's types lack this.)
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, image: Tensor) -> Tensor:
        """The value of each action (B, A), of pictures uint8 (B, 128, 128, 3)."""
        # In blocks on a CPU: what a layer writes is still in the cache when the next one reads it.
        blocks = image.split(BLOCK) if image.device.type == "cpu" else [image]
        convolve, connect = self.features[:7], self.features[7:]
        convolved = torch.cat([convolve(block.permute(0, 3, 1, 2).float().mul_(1 / 255)) for block in blocks])
        return self.head(connect(convolved))


class GeometryNetwork(nn.Module):
    """A Q-network on the set of a room's elements, of any number.

    Shared layers encode each element relative to the moving item, and then once more, given the pooled encodings of
    all (Zaheer et al. 2017; Qi et al. 2017). Pooling is by maximum and sum, so that order does not matter. The second
    encoding and the trunk are also given how far the item can go in each direction. Input: (B, elements, columns) as
    made by GeometryObservation or, of whole rooms, ScenesObservation. Output: (B, actions).
    """

    def __init__(self, columns: int, actions: int, element_width: int = 64, width: int = 256, dueling: bool = False):
        super().__init__()
        seen = columns - 2  # all but x and y: what counts is how things stand to each other
        pooled = 2 * element_width
        self.element = nn.Sequential(
            nn.Linear(seen + RELATIONS, element_width),
            nn.ReLU(inplace=True),
            nn.Linear(element_width, element_width),
            nn.ReLU(inplace=True),
        )
        self.itself = nn.Linear(element_width, element_width)
        self.others = nn.Linear(pooled + seen + CLEARANCE_NUMBERS, element_width)
        self.again = nn.Sequential(
            nn.ReLU(inplace=True), nn.Linear(element_width, element_width), nn.ReLU(inplace=True)
        )
        self.trunk = nn.Sequential(
            nn.Linear(2 * pooled + seen + CLEARANCE_NUMBERS, width),
            nn.ReLU(inplace=True),
            nn.Linear(width, width),
            nn.ReLU(inplace=True),
        )
        self.head = _head(width, actions, dueling)

    def knowing(self, more: int) -> GeometryNetwork:
        """Return a copy whose input has `more` further columns, the last ones, with weights of zero."""
        wider = copy.deepcopy(self)
        for layer, behind in (
            (wider.element[0], RELATIONS),
            (wider.others, CLEARANCE_NUMBERS),
            (wider.trunk[0], CLEARANCE_NUMBERS),
        ):
            assert isinstance(layer, nn.Linear)
            seen, rest = layer.weight.tensor_split([-behind], 1)
            layer.weight = nn.Parameter(torch.cat([seen, seen.new_zeros(len(seen), more), rest], 1))
            layer.in_features += more
        return wider

    def forward(self, elements: Tensor) -> Tensor:
        """The value of each action (B, A), of two or more elements float32 (B, N, columns), the moving item first."""
        # Columns first in memory: what is computed below would be slow on an inner axis of two to four.
        moving, others = elements.movedim(-1, 0).contiguous().tensor_split([1], -1)  # (columns, B, 1), (columns, B, N)
        gap = _gaps(moving, others)
        relations = torch.cat([gap, others[: Y + 1] - moving[: Y + 1]])
        # Rows of padding, a third of all, are left out of the layers. Where they were, the encodings are 0.
        row = others[PRESENT].flatten().nonzero().squeeze(1)
        pose = row // others.shape[-1]
        seen = elements[:, 1:, Y + 1 :].flatten(0, 1).index_select(0, row)
        described = self.element(torch.cat([seen, _shown(relations.flatten(1).index_select(1, row).T)], -1))

        border, item, ahead = _is_border(others), _is_item(others), gap == gap.amax(0)
        to_border, to_item = _clearances(gap, border, item, ahead)
        clearance = torch.stack([to_border, to_item, torch.minimum(to_border, to_item)])  # (3, 4, B)
        uncentred = clearance[:, ::3] - clearance[:, 1:3]  # right less left, up less below
        slides = _slides(gap, border, item, ahead)
        distances = torch.cat([clearance.flatten(0, 1), uncentred.flatten(0, 1), slides]).T
        pooled = _pooled(described, row, others.shape[1:])
        known = torch.cat([pooled, elements[:, 0, Y + 1 :], _shown(distances)], -1)

        described = self.again(self.itself(described) + self.others(known).index_select(0, pose))
        return self.head(self.trunk(torch.cat([_pooled(described, row, others.shape[1:]), known], -1)))


def _pooled(described: Tensor, row: Tensor, shape: torch.Size) -> Tensor:
    """Maximum and sum over the elements of B poses: (B, 2 width), of `described` (rows, width), which are not negative.

    They are the rows `row` of all B x N, in a `shape` of (B, N); the others count as zeros.
    """
    every = described.new_zeros(shape.numel(), described.shape[1]).index_copy_(0, row, described).unflatten(0, shape)
    return torch.cat([every.amax(1), every.sum(1) / TYPICAL], -1)


def _gaps(moving: Tensor, others: Tensor) -> Tensor:
    """Return signed distances from the moving item's right, left, lower and upper side to each element: (4, B, N).

    They are between the upright boxes around both, in metres, and negative where the element begins before that side.
    """
    (center, half), (its_center, its_half) = upright_box(moving), upright_box(others)
    beyond = (its_center - its_half) - (center + half)  # to the right, above
    before = (center - half) - (its_center + its_half)  # to the left, below
    return torch.stack([beyond[0], before[0], before[1], beyond[1]])


def _clearances(gap: Tensor, border: Tensor, item: Tensor, ahead: Tensor) -> tuple[Tensor, Tensor]:
    """Return how far the item can go right, left, below, up before it meets the border, and an item: (4, B) each.

    Only elements `_level` with the item count, each in the direction in which it is furthest `ahead`. Distances are
    in metres, negative where the item overlaps an element, and at most FAR.
    """
    distance = gap.where(_level(gap, 0.0) & ahead, FAR)
    return distance.where(border, FAR).amin(-1), distance.where(item, FAR).amin(-1)


def _slides(gap: Tensor, border: Tensor, item: Tensor, ahead: Tensor) -> Tensor:
    """Return about how far a slide to the right, left, below, up takes the item: (4, B), metres.

    A slide ends at the near or far side of an item, or at the near side of the border; at the far side of a border in
    which the moving item stands.
    """
    near = gap.where((gap > TOUCHING) & (item | ahead), FAR)
    far = -gap.unflatten(0, (2, 2)).flip(1).flatten(0, 1)  # left for right, and so on
    far = far.where((far > TOUCHING) & (item | (gap < -TOUCHING).all(0)), FAR)
    level = _level(gap, torch.where(border, -TOUCHING, TOUCHING)) & (border | item)
    return torch.minimum(near, far).where(level, FAR).amin(-1)


def _level(gap: Tensor, margin: Tensor | float) -> Tensor:
    """Return whether an element is in the band along which the item moves right, left, below, up: bool (4, B, N).

    It may be at any distance, ahead or behind. A negative `margin`, in metres, makes the band narrower.
    """
    x, y = (gap < margin).unflatten(0, (2, 2)).all(1)
    return torch.stack([y, y, x, x])


def _is_border(elements: Tensor) -> Tensor:
    """Walls and openings: bool (...) of elements (columns, ...)."""
    return (elements[WALL : WINDOW + 1] > 0).any(0)


def _is_item(elements: Tensor) -> Tensor:
    return elements[ITEM] > 0


def _shown(distance: Tensor) -> Tensor:
    """Distances in metres, (..., n), so that a room and a centimetre both are visible: (..., n x SHOWN), in -1 to 1."""
    level = torch.cat([distance / scale for scale in SCALES], -1).tanh_()
    phase = torch.cat([distance * (math.tau / wave) for wave in WAVES], -1)
    return torch.cat([level, phase.sin(), phase.cos()], -1)


class _Dueling(nn.Module):
    """Value plus advantage less its mean (Wang et al. 2016)."""

    def __init__(self, width: int, actions: int):
        super().__init__()
        self.value = nn.Linear(width, 1)
        self.advantage = nn.Linear(width, actions)

    def forward(self, features: Tensor) -> Tensor:
        advantage = self.advantage(features)
        return self.value(features) + advantage - advantage.mean(-1, keepdim=True)


def _head(width: int, actions: int, dueling: bool) -> nn.Module:
    return _Dueling(width, actions) if dueling else nn.Linear(width, actions)
