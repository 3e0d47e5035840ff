"""The Q-networks: state in, one value an action out."""

from __future__ import annotations

import copy
import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import torch
from torch import Tensor, nn

from layoutrl.env.observation import COLUMNS, ITEM, PRESENT, Y, upright_box
from layoutrl.env.simulator import TOUCHING

WALL, WINDOW = (COLUMNS.index(name) for name in ("wall", "window"))
TYPICAL = 8  # elements: what sums are divided by, to be about as large as maxima
FAR = 6.0  # metres: the clearance where nothing stands in a direction
SCALES = (2.0, 0.5, 0.1, 0.02)  # metres: a distance is shown at each, next to nothing best
WAVES = (1.0, 0.25)  # metres: and within each, so that a centimetre is seen far from everything, too
BLOCK = 32  # pictures
SHOWN = len(SCALES) + 2 * len(WAVES)  # numbers for a distance
RELATIONS = 6 * SHOWN  # numbers for four gaps and two offsets of an element
WAYS = (12 + 6 + 4) * SHOWN  # for clearances, how far off their middle, and slides


@contextmanager
def weights_of(seed: np.random.SeedSequence) -> Iterator[None]:
    """Layers that are made inside, on the host, draw their weights by the seed; global generators stay as they were."""
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(int(seed.generate_state(1)[0]))
        yield


class PaperNetwork(nn.Module):
    """Convolutions of 8, 16, 32 features, then fully connected 7200, 512, 512 (section 4.4, Figure 5).

    Input: uint8 pictures (B, 128, 128, 3). Output: (B, actions). Squares of three pixels in strides of two, without
    padding, as 7200 asks for, do not reach the last row and column.
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
        # As pictures are: on a CPU the way back takes half the time. (torch's types do not know the argument.)
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, image: Tensor) -> Tensor:
        """The value of each action (B, A), of pictures uint8 (B, 128, 128, 3)."""
        # In blocks on a CPU: what a layer writes is still in the cache when the next one reads it.
        blocks = image.split(BLOCK) if image.device.type == "cpu" else [image]
        convolve, connect = self.features[:7], self.features[7:]
        convolved = torch.cat([convolve(block.permute(0, 3, 1, 2).float().mul_(1 / 255)) for block in blocks])
        return self.head(connect(convolved))


class GeometryNetwork(nn.Module):
    """Values from the set of a room's elements, however many there are.

    Each element is described relative to the moving item and passes the same layers, twice: the second time it has
    heard of all others. The set is pooled by maximum and sum: its order does not matter. Beside it stands how far the
    item can go. Input: (B, elements, columns) as made by GeometryObservation or, of whole rooms, ScenesObservation.
    Output: (B, actions).
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
        self.others = nn.Linear(pooled + seen + WAYS, element_width)
        self.again = nn.Sequential(
            nn.ReLU(inplace=True), nn.Linear(element_width, element_width), nn.ReLU(inplace=True)
        )
        self.trunk = nn.Sequential(
            nn.Linear(2 * pooled + seen + WAYS, width),
            nn.ReLU(inplace=True),
            nn.Linear(width, width),
            nn.ReLU(inplace=True),
        )
        self.head = _head(width, actions, dueling)

    def knowing(self, more: int) -> GeometryNetwork:
        """A copy that is shown so many columns more, the last ones, of which it has learned nothing yet."""
        wider = copy.deepcopy(self)
        for layer, behind in ((wider.element[0], RELATIONS), (wider.others, WAYS), (wider.trunk[0], WAYS)):
            assert isinstance(layer, nn.Linear)
            seen, rest = layer.weight.tensor_split([-behind], 1)
            layer.weight = nn.Parameter(torch.cat([seen, seen.new_zeros(len(seen), more), rest], 1))
            layer.in_features += more
        return wider

    def forward(self, elements: Tensor) -> Tensor:
        """The value of each action (B, A), of two or more elements float32 (B, N, columns), the moving item first."""
        # A row of memory a column: what is worked out below has an inner axis of two to four, and would be slow on it.
        moving, others = elements.movedim(-1, 0).contiguous().tensor_split([1], -1)  # (columns, B, 1), (columns, B, N)
        gap = _gaps(moving, others)
        relations = torch.cat([gap, others[: Y + 1] - moving[: Y + 1]])
        described = torch.cat([elements[:, 1:, Y + 1 :], _shown(relations.movedim(0, -1))], -1)
        present = elements[:, 1:, PRESENT, None]  # rows of padding are none
        # Flat: activations in place on a view would cost copies on the way back.
        shape = described.shape[:2]
        described = self.element(described.flatten(0, 1)).unflatten(0, shape) * present

        border, item, ahead = _is_border(others), _is_item(others), gap == gap.amax(0)
        to_border, to_item = _clearances(gap, border, item, ahead)
        clearance = torch.stack([to_border, to_item, torch.minimum(to_border, to_item)])  # (of these, 4, B)
        uncentred = clearance[:, ::3] - clearance[:, 1:3]  # right less left, up less below
        slides = _slides(gap, border, item, ahead)
        ways = torch.cat([clearance.flatten(0, 1), uncentred.flatten(0, 1), slides]).T
        known = torch.cat([_pooled(described), elements[:, 0, Y + 1 :], _shown(ways)], -1)

        heard = self.itself(described.flatten(0, 1)).unflatten(0, shape) + self.others(known)[:, None]
        described = self.again(heard.flatten(0, 1)).unflatten(0, shape) * present
        return self.head(self.trunk(torch.cat([_pooled(described), known], -1)))


def _pooled(described: Tensor) -> Tensor:
    """Maximum and sum over the elements of (B, N, width): (B, 2 width)."""
    return torch.cat([described.amax(1), described.sum(1) / TYPICAL], -1)


def _gaps(moving: Tensor, others: Tensor) -> Tensor:
    """Signed distances from the moving item's right, left, lower and upper side to each element: (4, B, N).

    Negative where the element begins before the side ends; between the boxes around both.
    """
    (center, half), (its_center, its_half) = upright_box(moving), upright_box(others)
    beyond = (its_center - its_half) - (center + half)  # to the right, above
    before = (center - half) - (its_center + its_half)  # to the left, below
    return torch.stack([beyond[0], before[0], before[1], beyond[1]])


def _clearances(gap: Tensor, border: Tensor, item: Tensor, ahead: Tensor) -> tuple[Tensor, Tensor]:
    """How far the item can go right, left, below, up before it meets the border, and an item: (4, B) each.

    Only elements level with the item count, each in the direction in which it is furthest `ahead`. Negative
    where the item overlaps one.
    """
    distance = gap.where(_level(gap, 0.0) & ahead, FAR)
    return distance.where(border, FAR).amin(-1), distance.where(item, FAR).amin(-1)


def _slides(gap: Tensor, border: Tensor, item: Tensor, ahead: Tensor) -> Tensor:
    """About how far a slide to the right, left, below, up takes the item: (4, B).

    To where it touches an item's near or far side, or the near side of the border; the far side if it stands in it.
    """
    near = gap.where((gap > TOUCHING) & (item | ahead), FAR)
    far = -gap.unflatten(0, (2, 2)).flip(1).flatten(0, 1)  # left for right, and so on
    far = far.where((far > TOUCHING) & (item | (gap < -TOUCHING).all(0)), FAR)
    level = _level(gap, torch.where(border, -TOUCHING, TOUCHING)) & (border | item)
    return torch.minimum(near, far).where(level, FAR).amin(-1)


def _level(gap: Tensor, margin: Tensor | float) -> Tensor:
    """Whether an element is met on a way to the right, left, below, up, however far it is: bool (4, B, N)."""
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
