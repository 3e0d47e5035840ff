"""The supervised pointer furnishes whole rooms: one item after the other, the largest first.

Of each item it says how likely each way to face is, and for each of them where the item stands then: it points at a
side or the middle of something, as in one-item rooms. It is trained on rooms that hold the first of the designer's
items, in its own order. Places are centres in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely
import torch
from torch import Tensor, nn

from layoutrl.agents.training import in_every_view
from layoutrl.env.geometry import snap
from layoutrl.env.observation import COLUMNS, categories_of
from layoutrl.env.reward import Reward
from layoutrl.env.rooms_observation import RoomsObservation
from layoutrl.env.rooms_simulator import RoomsSimulator, State, faces_alike
from layoutrl.env.simulator import Moves
from layoutrl.env.symmetry import Symmetry, shares, symmetries
from layoutrl.rivals.budgets import Spent
from layoutrl.rivals.supervised import BREADTH, PointingNetwork, pooled, trained
from layoutrl.rooms.brief import brief_of
from layoutrl.rooms.room import Item, Room

QUARTERS = 4
BLOCK = 64  # rooms furnished at once: memory, not speed
LIKELY = 24  # places along each axis, of the highest weight, that are looked at


class RoomsPointer(nn.Module):
    """The log-likelihood of every pose of an item, seen in the middle of the room and turned each way.

    It knows furniture by these `categories`. Input: (B, QUARTERS, elements, columns) as made by `each_way`. Output:
    how good each way is, (B, QUARTERS), and log weights and centres (B, QUARTERS, 2, elements x ANCHORS) of the
    pointer's mixtures; metres from the middle of the room.
    """

    def __init__(self, categories: Sequence[str], width: int = 96):
        super().__init__()
        self.categories = tuple(categories)
        columns = len(COLUMNS) + 1 + len(categories)
        self.pointing = PointingNetwork(columns, width)
        self.own = nn.Linear(width, width)
        self.turned = nn.Linear(columns, width)
        self.out = nn.Linear(width, width)
        self.facing = nn.Linear(3 * width, 1)

    def forward(self, elements: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Scores of the ways, log weights and centres, as the class says.

        The elements tell each other what they know once, of an item that faces nowhere and is as wide as deep, the mean
        of the ways; then each hears how it is turned.
        """
        shape = elements.shape[:2]
        told = self.pointing.told(elements.mean(1))[:, None]
        told = told + self.out((self.own(told) + self.turned(elements[:, :, :1])).relu())
        elements, told = elements.flatten(0, 1), told.flatten(0, 1)
        said = self.facing(pooled(elements, told))[:, 0], *self.pointing.places(elements, told)
        score, weight, center = (t.unflatten(0, shape) for t in said)
        return score, weight, center


class Poses(NamedTuple):
    """Of B next items the poses of which any is right, N at most."""

    ways: Tensor  # bool (B, QUARTERS): those that the item can face
    center: Tensor  # (B, N, 2), metres from the middle of the room
    quarter: Tensor  # int64 (B, N)
    free: Tensor  # bool (B, N): whether it is one


def train_rooms_pointer(
    designs: Sequence[Room],
    spent: Spent,
    seed: np.random.SeedSequence,
    *,
    batch: int = 64,
    learning_rate: float = 1e-3,
    device: torch.device | str = "cpu",
) -> RoomsPointer:
    """A network that points at the designer's pose of the next item, by its likelihood.

    The rooms hold the first of the designer's items, `sequence` says in which order, any number of them. An item may
    stand where any of those stands that are the same (category, size, form) and are still to come. Each batch has an
    equal share in every symmetry.
    """
    simulator = RoomsSimulator([brief_of(room) for room in designs], designs, Moves(), Reward())
    categories = categories_of(designs)
    observe = RoomsObservation(simulator, categories, device)
    views = symmetries(simulator.moves, device)
    center, quarter = (torch.tensor(table, device=device) for table in designed_poses(simulator))
    order = sequence(simulator)
    rank, count, ways = (torch.tensor(t, device=device) for t in (order, simulator.count, _ways(simulator)))

    def draw(generator: torch.Generator) -> tuple[Tensor, Poses]:
        room = torch.randint(len(designs), (batch,), generator=generator, device=device)
        turn = rank[room] + torch.rand(rank[room].shape, generator=generator, device=device)  # equals in any order
        standing = (torch.rand(batch, generator=generator, device=device) * count[room]).long()[:, None]
        stands = turn.argsort(1).argsort(1) < standing
        moving = turn.argsort(1).gather(1, standing)
        equal = rank[room] == rank[room].gather(1, moving)
        state = State(room, center[room], quarter[room], stands, moving[:, 0])
        seen = in_every_view(observe, views, each_way(observe, state))
        goal = (center[room] - observe.origin[room][:, None]).float()
        goal = torch.cat([share @ view.matrix.T for view, share in shares(views, goal)])
        return seen, Poses(ways[room, moving[:, 0]], goal, quarter[room], equal & ~stands)

    def loss(said: tuple[Tensor, Tensor, Tensor], right: Poses) -> Tensor:
        score, weight, center = said
        facing = score.masked_fill(~right.ways, -torch.inf).log_softmax(1).gather(1, right.quarter)
        index = right.quarter[..., None, None].expand(-1, -1, *weight.shape[2:])
        off = (center.gather(1, index) - right.center[..., None]).abs()
        place = torch.logsumexp(weight.gather(1, index) - off / BREADTH, -1).sum(-1)  # (B, N)
        return -torch.logsumexp((facing + place).masked_fill(~right.free, -torch.inf), 1).mean()

    return trained(lambda: RoomsPointer(categories), draw, loss, spent, seed, learning_rate, device)


def designed_poses(simulator: RoomsSimulator) -> tuple[np.ndarray, np.ndarray]:
    """Where the designer has each item: centers (rooms, N, 2) and quarters (rooms, N).

    Of items that are the same the first has the place of the designer's first.
    """
    center, quarter = np.zeros((*simulator.ways.shape, 2)), np.zeros(simulator.ways.shape, dtype=int)
    for r, items in enumerate(simulator.items):
        for n, item in enumerate(items):
            target = simulator.targets[r][n][items[:n].count(item)]
            alike = [faces_alike(target, simulator.degrees[r, n, q]) for q in range(simulator.ways[r, n])]
            center[r, n], quarter[r, n] = target.center, np.argmax(alike)
    return center, quarter


def sequence(simulator: RoomsSimulator) -> np.ndarray:
    """When each item is placed, (rooms, N): how many are before it, the largest footprint first.

    Items that are the same have one rank, as have rows that are none, the last.
    """
    rank = np.full(simulator.ways.shape, simulator.ways.shape[1])
    for r, items in enumerate(simulator.items):
        first = sorted(items, key=lambda item: -footprint_area(item))  # of the same size, as the brief has them
        rank[r, : len(items)] = [first.index(item) for item in items]
    return rank


def footprint_area(item: Item) -> float:
    """Square metres."""
    width, depth = item.size
    return np.pi / 4 * width * depth if item.form == "circle" else width * depth


def each_way(observe: RoomsObservation, state: State[Tensor]) -> Tensor:
    """What is seen as the moving item stands in the middle and is turned each way, (B, QUARTERS, elements, columns).

    The moving item is the first element.
    """
    moving = state.moving[:, None]
    middle = observe.origin.index_select(0, state.room)[:, None]
    state = state._replace(
        center=state.center.scatter(1, moving[..., None].expand(-1, 1, 2), middle),
        stands=state.stands.scatter(1, moving, True),
    )
    seen = torch.stack(
        [observe(state._replace(quarter=state.quarter.scatter(1, moving, q))) for q in range(QUARTERS)], 1
    )
    order = torch.arange(seen.shape[2], device=seen.device).repeat(len(moving), 1).scatter(1, moving, 0)
    order[:, :1] = moving
    return seen.gather(2, order[:, None, :, None].expand_as(seen))


def furnish(
    network: RoomsPointer, briefs: Sequence[Room], views: Sequence[Symmetry] | None = None, free: bool = True
) -> list[Room]:
    """Layouts of briefs: every item at the likeliest free place, pushed to where it fits into the envelope.

    What stands already stays. With `views` the likelihood is the mean over them. Raises InputError where an item fits
    in no way.
    """
    device = next(network.parameters()).device
    simulator = RoomsSimulator(briefs, None, Moves(), Reward())
    observe = RoomsObservation(simulator, network.categories, device)
    views = symmetries(simulator.moves, device)[:1] if views is None else views
    order, ways, hosted = sequence(simulator).argsort(1, kind="stable"), _ways(simulator), _hosted(simulator)
    every = np.arange(len(briefs))
    begun = np.zeros(simulator.ways.shape, dtype=int)
    state = State(every, np.zeros((*begun.shape, 2)), begun, begun > 0, 0 * every)
    for n in range(order.shape[1]):
        for room in np.array_split(every[simulator.count > n], max(1, len(every) // BLOCK)):
            item = order[room, n]
            now = State(*(values[room] for values in state))._replace(moving=item)
            center, quarter = _pointed(
                network, observe, State(*map(_on(device), now)), *map(_on(device), (ways[room, item], hosted[room, item])), views, free
            )
            center = _pushed(simulator.simulator.legal[simulator.entry[room, item, quarter]], center)
            for values, new in zip(state, simulator.put(now, item, center, quarter), strict=True):
                values[room] = new
    return [simulator.layout(state, b) for b in every]

def _on(device): return lambda t: torch.as_tensor(t, device=device)

def _hosted(simulator: RoomsSimulator) -> np.ndarray:
    from layoutrl.rooms.clearances import HOSTS
    under=np.zeros((*simulator.ways.shape, simulator.ways.shape[1]),dtype=bool)
    for r, items in enumerate(simulator.items):
        for n, item in enumerate(items):
            under[r, n, :len(items)] = [item.tucked and other.category in HOSTS and not other.tucked for other in items]
    return under | under.transpose(0,2,1)


@torch.no_grad()
def _pointed(
    network: RoomsPointer,
    observe: RoomsObservation,
    state: State[Tensor],
    ways: Tensor,
    hosted: Tensor,
    views: Sequence[Symmetry],
    free: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """The likeliest centers (B, 2) and quarters (B,) of the moving items, of the `ways` (B, QUARTERS) they can face."""
    seen = each_way(observe, state)
    facing, weight, center = [], [], []
    for view in views:
        score, w, c = network(observe.turned(seen, view))
        facing.append(score.masked_fill(~ways, -torch.inf).log_softmax(1))
        weight.append(torch.einsum("ji,bqjm->bqim", view.matrix.abs(), w))
        center.append(torch.einsum("ji,bqjm->bqim", view.matrix, c))
    score = torch.stack(facing).logsumexp(0)
    likely, which = torch.cat(weight, -1).topk(LIKELY)
    center = torch.cat(center, -1).gather(-1, which)
    off = (center[..., None] - center[..., None, :]).abs()
    density = torch.logsumexp(likely[..., None, :] - off / BREADTH, -1)  # (B, QUARTERS, 2, LIKELY)
    x, y = density.unbind(2)
    joint = score[..., None, None] + x[..., :, None] + y[..., None, :]
    if free:
        from layoutrl.agents.networks import upright_box, PRESENT, COS2, CIRCLE
        from layoutrl.rooms.room import TOLERANCE
        middle, half = (t.movedim(0, -1) for t in upright_box(seen.movedim(-1, 0)))
        rest = seen[:, 0, 1:]
        solid = (rest[..., len(COLUMNS)] == 1) & ((rest[..., CIRCLE]==1)|(rest[..., COS2] > 0.9999))
        h = hosted.clone().scatter(1, state.moving[:, None], hosted[:, :1])[:, 1:]
        solid[:, :h.shape[1]] &= ~h
        depth = (half[:, :, :1] + half[:, :, 1:]).transpose(2, 3)[..., None, :] - (center[..., None] - middle[:, :, 1:].transpose(2, 3)[..., None, :]).abs()
        deep = ((depth > TOLERANCE) & solid[:, None, None, None]).float()
        joint = joint - 1e3 * (deep[:, :, 0] @ deep[:, :, 1].transpose(2, 3))
    best = joint.flatten(1).argmax(1)
    k = joint.shape[-1]
    quarter, i, j = best // k**2, best // k % k, best % k
    every = torch.arange(len(best), device=best.device)
    place = torch.stack([center[every, quarter, 0, i], center[every, quarter, 1, j]], 1)
    return (place.double() + observe.origin[state.room]).cpu().numpy(), quarter.cpu().numpy()


def _pushed(regions: np.ndarray, center: np.ndarray) -> np.ndarray:
    """The places (B, 2) nearest to centers (B, 2) in regions (B,)."""
    way = shapely.shortest_line(regions, shapely.points(center))
    return snap(shapely.get_coordinates(way)[::2])


def _ways(simulator: RoomsSimulator) -> np.ndarray:
    """Which ways items can face, and look different: bool (rooms, N, QUARTERS)."""
    return (np.arange(QUARTERS) < simulator.ways[..., None]) & (simulator.entry >= 0)
