"""The Q-networks: state in, one value an action out."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from layoutrl.env.observation import COLUMNS, X, Y

FAR = 6.0  # metres: the clearance where nothing stands in a direction
SCALES = (2.0, 0.5, 0.1, 0.02)  # metres: a distance is shown at each, so that both a room and a move are visible


class PaperNetwork(nn.Module):
    """Convolutions of 8, 16, 32 features, then fully connected 7200, 512, 512 (section 4.4, Figure 5).

    Input: uint8 pictures (B, 128, 128, 3). Output: (B, actions).
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

    def forward(self, image: Tensor) -> Tensor:
        return self.head(self.features(image.permute(0, 3, 1, 2).float().mul_(1 / 255)))


class GeometryNetwork(nn.Module):
    """Values from the set of a room's elements, however many there are.

    Each element is described relative to the moving item, passes the same layers, and the set is
    pooled by maximum and sum: its order does not matter. Input: (B, elements, columns) as made
    by GeometryObservation. Output: (B, actions).
    """

    def __init__(self, columns: int, actions: int, element_width: int = 64, width: int = 256, dueling: bool = False):
        super().__init__()
        relations = 6 * len(SCALES)  # four gaps and two offsets an element
        clearances = 2 * 6 * len(SCALES)  # to the border and to items: four directions, two differences
        self.element = nn.Sequential(
            nn.Linear(columns - 2 + relations, element_width),
            nn.ReLU(inplace=True),
            nn.Linear(element_width, element_width),
            nn.ReLU(inplace=True),
        )
        self.trunk = nn.Sequential(
            nn.Linear(2 * element_width + columns - 2 + clearances, width),
            nn.ReLU(inplace=True),
            nn.Linear(width, width),
            nn.ReLU(inplace=True),
        )
        self.head = _head(width, actions, dueling)

    def forward(self, elements: Tensor) -> Tensor:
        moving, others = elements[:, 0], elements[:, 1:]
        gap = _gaps(moving, others)
        offset = others[..., X : Y + 1] - moving[:, None, X : Y + 1]
        described = self.element(torch.cat([_without_place(others), _scaled(gap), _scaled(offset)], -1))
        described = described * others[..., :1]  # rows of padding are none
        pooled = torch.cat([described.amax(1), described.sum(1) / 8], -1)

        wall, door, window, item = (others[..., COLUMNS.index(k)] for k in ("wall", "door", "window", "item"))
        clearance = torch.stack([_clearance(gap, wall + door + window), _clearance(gap, item)], 1)  # (B, 2, 4)
        uncentred = clearance[..., [0, 3]] - clearance[..., [1, 2]]  # right less left, up less below
        room_to_move = _scaled(torch.cat([clearance, uncentred], -1)).flatten(1)
        return self.head(self.trunk(torch.cat([pooled, _without_place(moving), room_to_move], -1)))


def _without_place(elements: Tensor) -> Tensor:
    """All columns but x and y: what counts is where things stand to each other, not in the picture."""
    return torch.cat([elements[..., :X], elements[..., Y + 1 :]], -1)


def _gaps(moving: Tensor, others: Tensor) -> Tensor:
    """Signed distances from the moving item's right, left, lower and upper side to each element: (B, N, 4).

    Negative where the element begins before the side ends; between the boxes around both.
    """
    (mx, my, mhx, mhy), (x, y, hx, hy) = upright_box(moving[:, None]), upright_box(others)
    return torch.stack([x - hx - mx - mhx, mx - mhx - x - hx, my - mhy - y - hy, y - hy - my - mhy], -1)


def upright_box(element: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Centre and half extents, along x and y, of the upright box around each element."""
    x, y, width, depth, cos2 = (element[..., COLUMNS.index(n)] for n in ("x", "y", "width", "depth", "cos2"))
    circle = element[..., COLUMNS.index("circle")] > 0
    cosine = torch.where(circle, torch.ones_like(cos2), ((1 + cos2) / 2).clamp(0, 1).sqrt())
    sine = (1 - cosine**2).clamp(min=0).sqrt()
    return x, y, (width * cosine + depth * sine) / 2, (width * sine + depth * cosine) / 2


def _clearance(gap: Tensor, among: Tensor) -> Tensor:
    """How far the item can go right, left, below, up before it meets one of the elements in `among`: (B, 4).

    Only elements level with the item count, each in the direction in which it is furthest. Negative
    where the item overlaps one.
    """
    right, left, below, up = gap.unbind(-1)
    side_by_side, one_above_other = (below < 0) & (up < 0), (right < 0) & (left < 0)
    level = torch.stack([side_by_side, side_by_side, one_above_other, one_above_other], -1)
    ahead = gap == gap.amax(-1, keepdim=True)
    counts = level & ahead & (among[..., None] > 0)
    return torch.where(counts, gap, FAR).amin(1)


def _scaled(distance: Tensor) -> Tensor:
    """Distances in metres, (..., n), at every scale: (..., n x scales), within -1 to 1."""
    return torch.cat([torch.tanh(distance / scale) for scale in SCALES], -1)


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
