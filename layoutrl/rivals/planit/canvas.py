"""What PlanIT's image networks see: a room from above, centred and turned as asked, a channel for each kind of thing.

Every channel is a sum of upright boxes (round furniture is drawn as its box) with the exact share of each pixel that
they cover, so that all rooms of a batch are drawn in one product of matrices. A polygon is such a sum, too: of a box
without a lower end below each of its level edges, with a sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence

from layoutrl.rooms.room import TOLERANCE, Item, Ring, Room

ROOM, WALL, FURNITURE, SINE, COSINE, DOOR, WINDOW, FIXED_CHANNELS = range(8)  # then one a category
WALL_GREY, CATEGORY_GREY = 0.5, 0.5  # as PlanIT has them
ENDLESS = -1e4  # metres


class Canvas:
    """Draws pictures of R rooms. Furniture is passed with each picture: it is what changes."""

    def __init__(self, rooms: Sequence[Room], categories: Sequence[str], device: torch.device | str = "cpu"):
        self.categories = {category: k for k, category in enumerate(categories)}
        self.channels = FIXED_CHANNELS + len(categories)
        self.device = torch.device(device)
        tables = [torch.tensor(_architecture(room), dtype=torch.float32, device=device) for room in rooms]
        parts = pad_sequence(tables, batch_first=True)  # padded with boxes of value 0, which paint nothing
        self._box, self._channel, self._value = parts[..., :4], parts[..., 4].long(), parts[..., 5]

    def furniture(self, items: Sequence[Sequence[Item]]) -> Tensor:
        """Return items of B rooms as a table (B, most, 6): box, category, facing in quarters; padded with NaN."""
        rows = [
            torch.tensor([[*box_of(i), self.categories[i.category], i.degrees // 90] for i in room]).reshape(-1, 6)
            for room in items
        ]
        return pad_sequence(rows, batch_first=True, padding_value=torch.nan).float().to(self.device)

    def draw(
        self,
        room: Tensor,
        furniture: Tensor,
        center: Tensor,
        quarters: Tensor,
        mirrored: Tensor,
        *,
        reach: float,
        side: int,
        anchor: Tensor | None = None,
    ) -> Tensor:
        """Draw pictures (B, channels, side, side) of rooms (B,) and their furniture (B, n, 6).

        `center` (B, 2) is in the middle, and `reach` metres are seen to each side of it. The direction that lies
        `quarters` (B,) counter-clockwise from right points right, to the last columns; up is then the last rows, or
        the first where `mirrored` (B,). If there is an `anchor` (B, 4), one more channel shows its box, the last.
        """
        there = ~furniture[..., 4].isnan()
        furniture = furniture.nan_to_num(0.0)
        angle = (furniture[..., 5] - quarters[:, None]) * torch.pi / 2
        facing = torch.stack([angle.sin() * (1 - 2 * mirrored.float())[:, None], angle.cos()], -1)
        values = torch.zeros(*furniture.shape[:2], self.channels, device=self.device)
        values[..., FURNITURE] = 1.0
        values[..., SINE : COSINE + 1] = (facing + 1) / 2
        values.scatter_(2, FIXED_CHANNELS + furniture[..., 4, None].long(), CATEGORY_GREY)
        fixed = torch.zeros(len(room), self._box.shape[1], self.channels, device=self.device)
        fixed.scatter_(2, self._channel[room][..., None], self._value[room][..., None])
        boxes = [self._box[room], furniture[..., :4]]
        weights = torch.cat([fixed, values * there[..., None]], 1)
        if anchor is not None:
            boxes.append(anchor[:, None])
            weights = torch.nn.functional.pad(weights, (0, 1, 0, 1))
            weights[:, -1, -1] = 1.0
        box = in_frame(torch.cat(boxes, 1), center, quarters, mirrored)
        columns, rows = (_covered(box[..., k], box[..., k + 2], reach, side) for k in (0, 1))  # (B, n, side)
        painted = torch.einsum("bnc,bny->bcyn", weights, rows).flatten(1, 2)
        return torch.bmm(painted, columns).unflatten(1, (weights.shape[2], side))


def in_frame(box: Tensor, center: Tensor, quarters: Tensor, mirrored: Tensor) -> Tensor:
    """Boxes (B, n, 4) in the frame that `Canvas.draw` shows: x to the right, y up, 0 in the middle; metres."""
    corners = box.unflatten(-1, (2, 2)) - center[:, None, None]
    angle = -quarters * torch.pi / 2
    cosine, sine = angle.cos().round(), angle.sin().round()
    matrix = torch.stack([torch.stack([cosine, -sine], -1), torch.stack([sine, cosine], -1)], -2)
    matrix = torch.stack([matrix[:, 0], matrix[:, 1] * (1 - 2 * mirrored.float())[:, None]], 1)
    turned = torch.einsum("bij,bnkj->bnki", matrix.to(box.dtype), corners)
    return torch.cat([turned.amin(2), turned.amax(2)], -1)


def _covered(low: Tensor, high: Tensor, reach: float, side: int) -> Tensor:
    """The share of each of `side` pixels that intervals (B, n) cover: (B, n, side)."""
    pixel = 2 * reach / side
    edge = torch.arange(side + 1, device=low.device) * pixel - reach
    overlap = torch.minimum(high[..., None], edge[1:]) - torch.maximum(low[..., None], edge[:-1])
    return overlap.clamp(min=0) / pixel


def box_of(item: Item) -> tuple[float, float, float, float]:
    """Where an upright item stands: x0, y0, x1, y1."""
    assert item.center is not None
    (x, y), (width, depth) = item.center, item.size[:: 1 if item.degrees % 180 == 0 else -1]
    return x - width / 2, y - depth / 2, x + width / 2, y + depth / 2


def overlapping(box: Sequence[float], other: Sequence[float]) -> bool:
    """Whether two boxes share more than a centimetre along both axes."""
    return all(min(box[k + 2], other[k + 2]) - max(box[k], other[k]) > TOLERANCE for k in (0, 1))


def _architecture(room: Room) -> list[tuple[float, ...]]:
    """(x0, y0, x1, y1, channel, value) of boxes that add up to the room's floor, walls and openings."""
    floor = [(room.outline, ROOM, 1.0), *((hole, ROOM, -1.0) for hole in room.holes)]
    walls = [(wall, WALL, WALL_GREY) for wall in room.walls]
    openings = [(o.polygon, DOOR if o.kind == "door" else WINDOW, 1.0) for o in room.openings]
    openings += [(polygon, WALL, value) for polygon, _, value in openings]
    return [
        (*box, channel, value * sign)
        for polygon, channel, value in (*floor, *walls, *openings)
        for box, sign in _boxes_under(polygon)
    ]


def _boxes_under(ring: Ring) -> list[tuple[tuple[float, float, float, float], float]]:
    """Return boxes and signs whose sum is the polygon, one below each of its level edges."""
    edges = [(start, end) for start, end in pairwise((*ring, ring[0])) if start[0] != end[0]]
    boxes = [((min(a[0], b[0]), ENDLESS, max(a[0], b[0]), a[1]), float(np.sign(a[0] - b[0]))) for a, b in edges]
    area = sum(sign * (box[2] - box[0]) * (box[3] - ENDLESS) for box, sign in boxes)
    return [(box, sign if area > 0 else -sign) for box, sign in boxes]
