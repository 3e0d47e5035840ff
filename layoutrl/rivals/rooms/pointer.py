"""The supervised pointer for whole rooms: it places one item after the other, the largest first.

For each item it predicts how likely each way to face is and, for each of them, where the item stands: at a side or the
middle of an element, as in one-item rooms. It is trained on rooms in which the first few of the designer's items
stand, in the order in which it places them. When it furnishes, it takes the likeliest pose that overlaps as little as
may be, averaged over all eight symmetries, or over four where mirrored rooms are furnished differently. Places are
centres in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
import torch
from torch import Tensor, nn

from layoutrl.env.geometry import snap
from layoutrl.env.observation import CIRCLE, SIN2, upright_box
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_observation import ROOM_COLUMNS, STANDS, RoomsObservation, moving_first_
from layoutrl.env.rooms_simulator import QUARTERS, RoomsSimulator, State, rows
from layoutrl.env.simulator import Moves
from layoutrl.env.symmetry import Symmetry, shares, symmetries, vectors_in_every_view
from layoutrl.rivals.budgets import Spent
from layoutrl.rivals.supervised import BREADTH, PointingNetwork, pooled, trained
from layoutrl.rooms.brief import brief_of, categories_of
from layoutrl.rooms.clearances import may_share_floor
from layoutrl.rooms.room import TOLERANCE, Room

LEARNING_RATE = 3e-3  # at first
BLOCK = 64  # rooms furnished at once: memory, not speed
LIKELY = 24  # places of the highest weight that are tried along each axis; unsourced: more take more time
PENALTY = 1e3  # of log-likelihood for each overlap: any number larger than all differences
SLANTED = 1e-3  # sine of the double rotation, above which a rectangle leans: rounding


class RoomsPointer(nn.Module):
    """A network that gives the likelihood of every pose of an item. It sees the item in the middle, turned each way.

    It knows furniture by these `categories`, and whether mirrored rooms are furnished alike. Input: (B, QUARTERS,
    elements, columns) as made by `each_way`. Output: a logit for each way (B, QUARTERS), and log weights and centres
    (B, QUARTERS, 2, elements x ANCHORS) of the pointer's mixtures; centres in metres from the middle of the room.
    """

    def __init__(self, categories: Sequence[str], mirrors_alike: bool = True, width: int = 96):
        super().__init__()
        self.categories, self.mirrors_alike = tuple(categories), mirrors_alike
        columns = len(ROOM_COLUMNS) + len(categories)
        self.pointing = PointingNetwork(columns, width)
        self.own = nn.Linear(width, width)
        self.turned = nn.Linear(columns, width)
        self.out = nn.Linear(width, width)
        self.facing = nn.Linear(3 * width, 1)

    def forward(self, elements: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return logits of the ways, log weights and centres, in the shapes that the class states.

        Elements exchange what they know only once, about the mean of the ways: an item that faces nowhere and is as
        wide as deep. Then each is told how the item is turned.
        """
        shape = elements.shape[:2]
        encoded = self.pointing.encode(elements.mean(1))[:, None]
        encoded = encoded + self.out((self.own(encoded) + self.turned(elements[:, :, :1])).relu())
        elements, encoded = elements.flatten(0, 1), encoded.flatten(0, 1)
        outputs = self.facing(pooled(elements, encoded))[:, 0], *self.pointing.decode(elements, encoded)
        score, weight, center = (t.unflatten(0, shape) for t in outputs)
        return score, weight, center


class Poses(NamedTuple):
    """The right poses of B next items: for each up to N, any of which is right."""

    ways: Tensor  # bool (B, QUARTERS): those that the item can face
    center: Tensor  # (B, N, 2), metres from the middle of the room
    quarter: Tensor  # int64 (B, N)
    free: Tensor  # bool (B, N): whether the pose is a right one


def train_rooms_pointer(
    designs: Sequence[Room],
    spent: Spent,
    seed: np.random.SeedSequence,
    *,
    batch: int = 64,
    device: torch.device | str = "cpu",
    mirrors_alike: bool = True,
) -> RoomsPointer:
    """Train a pointer to give the designer's pose of the next item a high likelihood.

    A random number of the designer's items stand already, the first in the order of `RoomsSimulator.size_rank`. Of
    items that are the same (category, size, form) and still to come, each may stand where any of them does. Each batch
    has an equal share in every symmetry, or in the four that only turn where mirrored rooms are not furnished alike.
    """
    simulator = RoomsSimulator([brief_of(room) for room in designs], designs, Moves(), Reward())
    categories = categories_of(designs)
    observe = RoomsObservation(simulator, categories, device)
    views = symmetries(simulator.moves, device, mirrors_alike)
    center, quarter = (torch.tensor(table, device=device) for table in simulator.designed())
    tables = simulator.size_rank(), simulator.count, np.arange(QUARTERS) < simulator.ways[..., None]
    rank, count, ways = (torch.tensor(table, device=device) for table in tables)

    def draw(generator: torch.Generator) -> tuple[Tensor, Poses]:
        room = torch.randint(len(designs), (batch,), generator=generator, device=device)
        turn = rank[room] + torch.rand(rank[room].shape, generator=generator, device=device)  # equals in any order
        standing = (torch.rand(batch, generator=generator, device=device) * count[room]).long()[:, None]
        stands = turn.argsort(1).argsort(1) < standing
        moving = turn.argsort(1).gather(1, standing)
        equal = rank[room] == rank[room].gather(1, moving)
        state = State(room, center[room], quarter[room], stands, moving[:, 0])
        seen = each_way(observe, state)
        seen = torch.cat([observe.turned(share, view) for view, share in shares(views, seen)])
        goal = (center[room] - observe.origin[room][:, None]).float()
        return seen, Poses(ways[room, moving[:, 0]], vectors_in_every_view(views, goal), quarter[room], equal & ~stands)

    def loss(said: tuple[Tensor, Tensor, Tensor], right: Poses) -> Tensor:
        score, weight, center = said
        facing = score.masked_fill(~right.ways, -torch.inf).log_softmax(1).gather(1, right.quarter)
        index = right.quarter[..., None, None].expand(-1, -1, *weight.shape[2:])
        off = (center.gather(1, index) - right.center[..., None]).abs()
        place = torch.logsumexp(weight.gather(1, index) - off / BREADTH, -1).sum(-1)  # (B, N)
        return -torch.logsumexp((facing + place).masked_fill(~right.free, -torch.inf), 1).mean()

    return trained(lambda: RoomsPointer(categories, mirrors_alike), draw, loss, spent, seed, LEARNING_RATE, device)


def each_way(observe: RoomsObservation, state: State[Tensor]) -> Tensor:
    """Observe states as if the moving item stood in the middle, turned each way: (B, QUARTERS, elements, columns).

    The moving item is the first element.
    """
    moving = state.moving[:, None]
    middle = observe.origin.index_select(0, state.room)[:, None]
    state = state._replace(
        center=state.center.scatter(1, moving[..., None].expand(-1, 1, 2), middle),
        stands=state.stands.scatter(1, moving, True),
    )
    turned = (state._replace(quarter=state.quarter.scatter(1, moving, q)) for q in range(QUARTERS))
    return torch.stack([moving_first_(observe(each), state.moving) for each in turned], 1)


def furnish(network: RoomsPointer, briefs: Sequence[Room]) -> list[Room]:
    """Furnish briefs: place every item in its likeliest free pose, pushed to where it fits into the envelope.

    What stands already stays. Raises InputError where an item fits in no way, and where no brief has an item to place.
    """
    device = next(network.parameters()).device
    simulator = RoomsSimulator(briefs, None, Moves(), Reward())
    observe = RoomsObservation(simulator, network.categories, device)
    views = symmetries(simulator.moves, device, network.mirrors_alike)
    order = simulator.size_rank().argsort(1, kind="stable")
    can_face, stays_off = simulator.room_index >= 0, _stays_off(simulator, observe.space.shape[0])
    every = np.arange(len(briefs))
    state = simulator.empty(every)
    for n in range(order.shape[1]):
        rooms = every[simulator.count > n]
        for room in np.array_split(rooms, -(-len(rooms) // BLOCK)):
            item = order[room, n]
            now = rows(state, room)._replace(moving=item)
            told = State(*(torch.as_tensor(values, device=device) for values in now))
            ways, solid = (torch.as_tensor(table[room, item], device=device) for table in (can_face, stays_off))
            center, quarter = (t.cpu().numpy() for t in _pointed(network, observe, told, ways, solid, views))
            center = _pushed(simulator.one_item.legal[simulator.room_index[room, item, quarter]], center)
            for values, new in zip(state, simulator.put(now, item, center, quarter), strict=True):
                values[room] = new
    return [simulator.layout(state, b) for b in range(len(briefs))]


@torch.no_grad()
def _pointed(
    network: RoomsPointer,
    observe: RoomsObservation,
    state: State[Tensor],
    ways: Tensor,
    solid: Tensor,
    views: Sequence[Symmetry],
) -> tuple[Tensor, Tensor]:
    """Return the likeliest centers (B, 2) and quarters (B,) of the moving items, which can face `ways` (B, QUARTERS).

    LIKELY places along each axis are tried. Of these, poses come first in which the item's bounding box overlaps the
    bounding boxes of the fewest `solid` elements (B, elements). Likelihoods of ways, and of places along an axis, are
    means over the views.
    """
    seen = each_way(observe, state)
    facing, weights, centers = [], [], []
    for view in views:
        score, weight, center = network(observe.turned(seen, view))
        facing.append(score.masked_fill(~ways, -torch.inf).log_softmax(1))
        weights.append(torch.einsum("ji,bqjm->bqim", view.matrix.abs(), weight))  # the inverse is the transpose
        centers.append(torch.einsum("ji,bqjm->bqim", view.matrix, center))
    weight, which = torch.cat(weights, -1).topk(LIKELY)
    center = torch.cat(centers, -1).gather(-1, which)
    off = (center[..., None] - center[..., None, :]).abs()
    x, y = torch.logsumexp(weight[..., None, :] - off / BREADTH, -1).unbind(2)  # (B, QUARTERS, LIKELY)
    likelihood = torch.stack(facing).logsumexp(0)[..., None, None] + x[..., None] + y[..., None, :]

    boxes = upright_box(seen.movedim(-1, 0))
    middle, half = (t.movedim(0, 2)[..., None, :] for t in boxes)  # (B, QUARTERS, 2, 1, elements)
    depth = half[..., :1] + half - (center[..., None] - middle).abs()
    stands = (seen[:, 0, :, STANDS] == 1) & moving_first_(solid, state.moving) & _fills_its_box(seen[:, 0])
    stands[:, 0] = False  # itself
    deep = ((depth > TOLERANCE) & stands[:, None, None, None]).float()
    overlaps = deep[:, :, 0] @ deep[:, :, 1].transpose(2, 3)  # (B, QUARTERS, LIKELY, LIKELY)
    best = (likelihood - PENALTY * overlaps).flatten(1).argmax(1)

    quarter, column, row = best // LIKELY**2, best // LIKELY % LIKELY, best % LIKELY
    every = torch.arange(len(best), device=best.device)
    place = torch.stack([center[every, quarter, 0, column], center[every, quarter, 1, row]], 1)
    return place.double() + observe.origin[state.room], quarter


def _fills_its_box(elements: Tensor) -> Tensor:
    """Return whether elements (..., columns) are upright or round, and no leaning rectangles: bool (...)."""
    return (elements[..., SIN2].abs() < SLANTED) | (elements[..., CIRCLE] == 1)


def _stays_off(simulator: RoomsSimulator, elements: int) -> np.ndarray:
    """Return which of the observed elements each item must not overlap: bool (rooms, N, elements).

    These are all but those with which it may share floor.
    """
    off = np.ones((*simulator.ways.shape, elements), dtype=bool)
    for r, (room, items) in enumerate(zip(simulator.rooms, simulator.items, strict=True)):
        first = off.shape[1] + len(room.walls) + len(room.openings)
        others = [*enumerate(items), *enumerate((item for item in room.furniture if item.center), first)]
        for n, item in enumerate(items):
            for k, other in others:
                off[r, n, k] = not may_share_floor(item, other)
    return off


def _pushed(regions: np.ndarray, center: np.ndarray) -> np.ndarray:
    """Return the points (B, 2) of regions (B,) that are nearest to centers (B, 2)."""
    way = shapely.shortest_line(regions, shapely.points(center))
    return snap(shapely.get_coordinates(way)[::2])
