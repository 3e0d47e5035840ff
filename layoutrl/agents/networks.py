"""The Q-networks: state in, one value an action out."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from layoutrl.env.observation import COLUMNS, DEPTH, WIDTH, Y
from layoutrl.env.simulator import TOUCHING

PRESENT, WALL, WINDOW, ITEM, COS2, CIRCLE = (
    COLUMNS.index(name) for name in ("present", "wall", "window", "item", "cos2", "circle")
)
TYPICAL = 8  # elements: what sums are divided by, to be about as large as maxima
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
        # As pictures are: on a CPU the way back takes half the time. (torch's types do not know the argument.)
        self.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def forward(self, image: Tensor) -> Tensor:
        return self.head(self.features(image.permute(0, 3, 1, 2).float().mul_(1 / 255)))


class GeometryNetwork(nn.Module):
    """Values from the set of a room's elements, however many there are.

    Each element is described relative to the moving item, passes the same layers, and the set is
    pooled by maximum and sum: its order does not matter. Beside it stands how far the item can go.
    Input: (B, elements, columns) as made by GeometryObservation. Output: (B, actions).
    """

    def __init__(self, columns: int, actions: int, element_width: int = 64, width: int = 256, dueling: bool = False):
        super().__init__()
        seen = columns - 2  # all but x and y: what counts is how things stand to each other
        relations = 6 * len(SCALES)  # four gaps and two offsets an element
        ways = (8 + 4 + 4) * len(SCALES)  # clearances, how far off their middle, slides
        self.element = nn.Sequential(
            nn.Linear(seen + relations, element_width),
            nn.ReLU(inplace=True),
            nn.Linear(element_width, element_width),
            nn.ReLU(inplace=True),
        )
        self.trunk = nn.Sequential(
            nn.Linear(2 * element_width + seen + ways, width),
            nn.ReLU(inplace=True),
            nn.Linear(width, width),
            nn.ReLU(inplace=True),
        )
        self.head = _head(width, actions, dueling)

    def forward(self, elements: Tensor) -> Tensor:
        moving, others = elements[:, :1], elements[:, 1:]
        gap = _gaps(moving, others)
        offset = others[..., : Y + 1] - moving[..., : Y + 1]
        described = torch.cat([others[..., Y + 1 :], _scaled(torch.cat([gap, offset], -1))], -1)
        # Flat: activations in place on a view would cost copies on the way back.
        described = self.element(described.flatten(0, 1)).unflatten(0, others.shape[:2])
        described = described * others[..., PRESENT, None]  # rows of padding are none
        pooled = torch.cat([described.amax(1), described.sum(1) / TYPICAL], -1)

        clearance = torch.stack(_clearances(gap, others), 1)  # (B, border or items, 4)
        uncentred = clearance[..., ::3] - clearance[..., 1:3]  # right less left, up less below
        ways = torch.cat([clearance.flatten(1), uncentred.flatten(1), _slides(gap, others)], 1)
        return self.head(self.trunk(torch.cat([pooled, moving[:, 0, Y + 1 :], _scaled(ways)], -1)))


def _gaps(moving: Tensor, others: Tensor) -> Tensor:
    """Signed distances from the moving item's right, left, lower and upper side to each element: (B, N, 4).

    Negative where the element begins before the side ends; between the boxes around both.
    """
    (center, half), (its_center, its_half) = upright_box(moving), upright_box(others)
    beyond = (its_center - its_half) - (center + half)  # to the right, above
    before = (center - half) - (its_center + its_half)  # to the left, below
    return torch.stack([beyond[..., 0], before[..., 0], before[..., 1], beyond[..., 1]], -1)


def upright_box(element: Tensor) -> tuple[Tensor, Tensor]:
    """Centre and half sides, (..., 2) each, of the upright box around each element (..., columns)."""
    center, size = element[..., : Y + 1], element[..., WIDTH : DEPTH + 1]
    cosine = ((1 + element[..., COS2, None]) / 2).clamp_(0, 1).sqrt_()
    cosine = cosine.where(element[..., CIRCLE, None] == 0, 1.0)
    sine = (1 - cosine.square()).clamp_(min=0).sqrt_()
    return center, (size * cosine + size.flip(-1) * sine) / 2


def _clearances(gap: Tensor, others: Tensor) -> tuple[Tensor, Tensor]:
    """How far the item can go right, left, below, up before it meets the border, and an item: (B, 4) each.

    Only elements level with the item count, each in the direction in which it is furthest. Negative
    where the item overlaps one.
    """
    ahead = gap == gap.amax(-1, keepdim=True)
    distance = gap.where(_level(gap, 0.0) & ahead, FAR)
    return distance.where(_is_border(others), FAR).amin(1), distance.where(_is_item(others), FAR).amin(1)


def _slides(gap: Tensor, others: Tensor) -> Tensor:
    """About how far a slide to the right, left, below, up takes the item: (B, 4).

    To where it touches an item's near or far side, or the near side of the border; the far side if it stands in it.
    """
    border, present = _is_border(others), others[..., PRESENT, None] > 0
    level = _level(gap, torch.where(border, -TOUCHING, TOUCHING)) & present
    near = gap.where((gap > TOUCHING) & (_is_item(others) | (gap == gap.amax(-1, keepdim=True))), FAR)
    far = -gap.unflatten(-1, (2, 2)).flip(-1).flatten(-2)  # left for right, and so on
    far = far.where((far > TOUCHING) & (_is_item(others) | (gap < -TOUCHING).all(-1, keepdim=True)), FAR)
    return torch.minimum(near, far).where(level, FAR).amin(1)


def _level(gap: Tensor, margin: Tensor | float) -> Tensor:
    """Whether an element is met on a way to the right, left, below, up, however far it is: bool (B, N, 4)."""
    x, y = (gap[..., :2] < margin).all(-1), (gap[..., 2:] < margin).all(-1)
    return torch.stack([y, y, x, x], -1)


def _is_border(elements: Tensor) -> Tensor:
    """Walls and openings: bool (B, N, 1)."""
    return (elements[..., WALL : WINDOW + 1] > 0).any(-1, keepdim=True)


def _is_item(elements: Tensor) -> Tensor:
    return elements[..., ITEM, None] > 0


def _scaled(distance: Tensor) -> Tensor:
    """Distances in metres, (..., n), at every scale: (..., n x scales), within -1 to 1."""
    return torch.cat([distance / scale for scale in SCALES], -1).tanh_()


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
