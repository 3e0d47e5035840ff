"""Three supervised baselines, which learn from the same rooms and the same observation as the agent.

The regressor has the agent's network: it sees the item at a start and predicts the offset to the designer's place. The
pointer has a network of its own: it sees no start and points at a side or the middle of an element. The scorer has the
agent's network, too: it sees the item at a place and predicts how good that is; its answer is the best of many
candidates, none of which is drawn from the designer's place. Places are centres in metres.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np
import shapely
import torch
from torch import Tensor, nn
from torch.nn.functional import l1_loss, mse_loss

from layoutrl.agents.networks import GeometryNetwork, weights_of
from layoutrl.env.batch import BatchSimulator
from layoutrl.env.device import generator_of
from layoutrl.env.geometry import padded, snap
from layoutrl.env.observation import PRESENT, GeometryObservation, in_every_view, upright_box
from layoutrl.env.simulator import TOUCHING, Simulator
from layoutrl.env.symmetry import Symmetry, symmetries, vectors_in_every_view
from layoutrl.rivals.budgets import Spent
from layoutrl.rooms.fitting import center_range

SIDE = 11  # candidates along each side of the grid
NEAR = (0.005, 0.5)  # metres: least and greatest standard deviation of training places around the designer's
ALIGNED = 0.3  # chance that such a place is exact along an axis: at the right wall, or the very place
BLOCK = 4096  # poses in a forward pass, for the sake of memory, not speed
ANCHORS = 5  # along an axis: an item touches either side of an element, from inside or outside, or shares its middle
ROUNDS = 3  # in which elements exchange what they know
BREADTH = 0.02  # metres: scale of the Laplace density around each place of the pointer's mixture

Draw = Callable[[torch.Generator], tuple[Tensor, Any]]  # a batch: observations (B, ...) and their targets
Loss = Callable[[Any, Any], Tensor]
Network = TypeVar("Network", bound=nn.Module)


def train_regressor(
    simulator: Simulator,
    observe: GeometryObservation,
    spent: Spent,
    seed: np.random.SeedSequence,
    *,
    batch: int = 512,
    learning_rate: float = 1e-3,
    device: torch.device | str = "cpu",
) -> GeometryNetwork:
    """Train the agent's network to predict the offset from a random start in one of the rooms to the designer's place.

    It has two outputs, metres to the right and up, and minimises the absolute error: of two walls that designers
    choose it points at one, not between them. Each batch has an equal share in every symmetry; the offset is mirrored
    and turned like the room.
    """
    batch_simulator = BatchSimulator(simulator, device)
    designed = torch.tensor(simulator.designer_position, device=device)
    views = symmetries(simulator.moves, device)

    def draw(generator: torch.Generator) -> tuple[Tensor, Tensor]:
        room = torch.randint(len(designed), (batch,), generator=generator, device=device)
        start = batch_simulator.starts(room, generator)
        way = (designed[room] - start).float()
        return in_every_view(observe, views, observe(room, start)), vectors_in_every_view(views, way)

    return trained(lambda: _agents_network(observe, 2), draw, l1_loss, spent, seed, learning_rate, device)


def regressed_places(
    network: GeometryNetwork,
    observe: GeometryObservation,
    room: np.ndarray,
    starts: np.ndarray,
    views: Sequence[Symmetry],
) -> np.ndarray:
    """Where the regressor says the item goes from starts (B, 2) in rooms (B,), legal or not: (B, 2).

    Along each axis the median over the `views`.
    """
    return starts + _agreed(_outputs(network, observe, room, starts, views), views)


class PointingNetwork(nn.Module):
    """A network whose output is a mixture of places along each axis.

    Each place is where the item touches a side of an element, or shares its middle, plus a learned offset; its weight
    is learned, too. Every element is told of the moving item and of all others. Input: (B, elements, columns) of a
    GeometryObservation, with the item in the middle of the room, where it tells nothing. Output: log weights and
    centres, (B, 2, elements x ANCHORS) each; centres in metres from the middle of the room.
    """

    def __init__(self, columns: int, width: int = 96):
        super().__init__()
        self.embed = nn.Sequential(nn.Linear(columns + 4, width), nn.ReLU())
        self.own = nn.ModuleList(nn.Linear(width, width) for _ in range(ROUNDS))
        self.heard = nn.ModuleList(nn.Linear(3 * width, width) for _ in range(ROUNDS))
        self.out = nn.ModuleList(nn.Linear(width, width) for _ in range(ROUNDS))
        self.head = nn.Linear(width, 2 * ANCHORS * 2)

    def forward(self, elements: Tensor) -> tuple[Tensor, Tensor]:
        """Log weights and centres, (B, 2, elements x ANCHORS) each, of elements (B, elements, columns)."""
        return self.decode(elements, self.encode(elements))

    def encode(self, elements: Tensor) -> Tensor:
        """Return the state of each element after the rounds: (B, elements, width)."""
        middle, half = (t.movedim(0, -1) for t in upright_box(elements.movedim(-1, 0)))
        state = self.embed(torch.cat([elements, middle - half, middle + half], -1))
        for own, heard, out in zip(self.own, self.heard, self.out, strict=True):
            state = state + out((own(state) + heard(pooled(elements, state))[:, None]).relu())
        return state

    def decode(self, elements: Tensor, state: Tensor) -> tuple[Tensor, Tensor]:
        """Return log weights and centres, as `forward` does, from the elements' states (B, elements, width)."""
        middle, half = (t.movedim(0, -1)[..., None] for t in upright_box(elements.movedim(-1, 0)))  # (B, N, 2, 1)
        weight, offset = self.head(state).unflatten(-1, (2, ANCHORS, 2)).unbind(-1)  # (B, N, 2, ANCHORS)
        item = half[:, :1]
        touching = [middle - half - item, middle - half + item, middle, middle + half - item, middle + half + item]
        center = torch.cat(touching, -1) + offset
        weight = weight.masked_fill(elements[..., PRESENT, None, None] == 0, -1e9)
        weight, center = (t.transpose(1, 2).flatten(2) for t in (weight, center))
        return weight.log_softmax(-1), center

    def point(self, elements: Tensor) -> Tensor:
        """Return the place of the highest weight along each axis: (B, 2)."""
        weight, center = self(elements)
        return center.gather(-1, weight.argmax(-1, keepdim=True))[..., 0]


def pooled(elements: Tensor, state: Tensor) -> Tensor:
    """Pool the states (B, elements, width) of elements: the moving item's, the maximum, the mean; (B, 3 width)."""
    present = elements[..., PRESENT, None]
    highest = state.masked_fill(present == 0, -torch.inf).amax(1)
    return torch.cat([state[:, 0], highest, (state * present).sum(1) / present.sum(1)], -1)


def train_pointer(
    simulator: Simulator,
    observe: GeometryObservation,
    spent: Spent,
    seed: np.random.SeedSequence,
    *,
    batch: int = 64,
    learning_rate: float = 1e-3,
    device: torch.device | str = "cpu",
) -> PointingNetwork:
    """Train a pointer to give the designer's place a high likelihood under its mixture.

    Each batch has an equal share in every symmetry.
    """
    goal = torch.tensor(simulator.designer_position, device=device) - observe.origin
    views = symmetries(simulator.moves, device)

    def draw(generator: torch.Generator) -> tuple[Tensor, Tensor]:
        room = torch.randint(len(goal), (batch,), generator=generator, device=device)
        turned = vectors_in_every_view(views, goal[room].float())
        return in_every_view(observe, views, observe(room, observe.origin[room])), turned

    def loss(said: tuple[Tensor, Tensor], goal: Tensor) -> Tensor:
        weight, center = said
        return -torch.logsumexp(weight - (center - goal[..., None]).abs() / BREADTH, -1).mean()

    return trained(lambda: PointingNetwork(observe.space.shape[1]), draw, loss, spent, seed, learning_rate, device)


def pointed_places(network: PointingNetwork, observe: GeometryObservation, views: Sequence[Symmetry]) -> np.ndarray:
    """Where the pointer points in each room, legal or not: (rooms, 2). Along each axis the median over the `views`."""
    origin = observe.origin.cpu().numpy()
    return origin + _agreed(_outputs(network.point, observe, np.arange(len(origin)), origin, views), views)


def train_scorer(
    simulator: Simulator,
    observe: GeometryObservation,
    spent: Spent,
    seed: np.random.SeedSequence,
    *,
    batch: int = 512,
    learning_rate: float = 1e-3,
    device: torch.device | str = "cpu",
) -> GeometryNetwork:
    """Train the agent's network to predict the IoU of a place, at which it sees the item, with the designer's place.

    On average half of a batch's places are candidates as in a test, a quarter are drawn uniformly, and a quarter lie
    around the designer's, at scales that are log-uniform over NEAR. Each batch has an equal share in every symmetry.
    """
    batch_simulator = BatchSimulator(simulator, device)
    designed = torch.tensor(simulator.designer_position, device=device)
    table = torch.tensor(candidates(simulator), device=device)
    count = (~table[..., 0].isnan()).sum(1)
    views = symmetries(simulator.moves, device)

    def draw(generator: torch.Generator) -> tuple[Tensor, Tensor]:
        def chance(*shape: int) -> Tensor:
            return torch.rand(shape, generator=generator, device=device, dtype=torch.float64)

        room = torch.randint(len(designed), (batch,), generator=generator, device=device)
        start = batch_simulator.starts(room, generator)
        candidate = table[room, (chance(batch) * count[room]).long()]
        spread = NEAR[0] * (NEAR[1] / NEAR[0]) ** chance(batch, 1)
        off = torch.randn(batch, 2, generator=generator, device=device) * spread * (chance(batch, 2) >= ALIGNED)
        near = snap(designed[room] + off)
        near = torch.where(batch_simulator.is_legal(room, near)[:, None], near, start)
        kind = (4 * chance(batch, 1)).long()
        place = torch.where(kind < 2, candidate, torch.where(kind < 3, start, near))
        iou = batch_simulator.reward(room, place).iou
        return in_every_view(observe, views, observe(room, place)), iou[:, None]

    return trained(lambda: _agents_network(observe, 1), draw, mse_loss, spent, seed, learning_rate, device)


def scored_places(
    network: GeometryNetwork, simulator: Simulator, observe: GeometryObservation, views: Sequence[Symmetry]
) -> np.ndarray:
    """Return the candidate of each room that has the highest score, averaged over the `views`: (rooms, 2)."""
    places = candidates(simulator)
    room, which = np.nonzero(~np.isnan(places[..., 0]))
    score = np.full(places.shape[:2], -np.inf)
    score[room, which] = _outputs(network, observe, room, places[room, which], views).mean(0)[:, 0]
    return places[np.arange(len(places)), score.argmax(1)]


def candidates(simulator: Simulator) -> np.ndarray:
    """Return the places that the scorer chooses from in every room: (rooms, most, 2), shorter rows padded with NaN.

    These are all legal places at which a side of the item touches the outline or the box around another item along both
    axes, the legal ones of a grid of SIDE by SIDE over the outline's bounding box, and one that is always legal. None
    depends on the designer's place.
    """
    places, rooms = [], []
    for k, room in enumerate(simulator.rooms):
        places.append(shapely.get_coordinates(shapely.point_on_surface(simulator.legal[k])))
        rooms.append(np.array([k]))
        low, high = center_range(room, room.moving)
        for x, y in (_contact_coordinates(simulator.contacts[k]), np.linspace(low, high, SIDE).T):
            places.append(np.stack(np.meshgrid(x, y), -1).reshape(-1, 2))
            rooms.append(np.full(len(places[-1]), k))
    place, of = snap(np.concatenate(places)), np.concatenate(rooms)
    legal = simulator.is_legal(of, place)
    return padded(place[legal], of[legal], len(simulator.rooms))


def _contact_coordinates(borders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the x of upright and the y of level borders (n, 4), each once."""
    coordinates = []
    for start, end in (borders[:, [0, 2]].T, borders[:, [1, 3]].T):
        level = np.sort(start[np.abs(start - end) < TOUCHING])  # never true of NaN
        coordinates.append(level[np.diff(level, prepend=-np.inf) > TOUCHING])
    return coordinates[0], coordinates[1]


def _agents_network(observe: GeometryObservation, outputs: int) -> GeometryNetwork:
    return GeometryNetwork(observe.space.shape[1], outputs, dueling=False)


def trained(
    make: Callable[[], Network],
    draw: Draw,
    loss: Loss,
    spent: Spent,
    seed: np.random.SeedSequence,
    learning_rate: float,
    device: torch.device | str,
) -> Network:
    """Make a network and train it by Adam on new batches; the learning rate falls linearly to 0 with the budget."""
    weights, drawing = seed.spawn(2)
    with weights_of(weights):
        network = make().to(device)
    generator = generator_of(drawing, device)
    optimizer = torch.optim.Adam(network.parameters(), fused=True)
    updates = 0
    while (share := spent(updates)) < 1:
        for group in optimizer.param_groups:
            group["lr"] = learning_rate * (1 - share)
        observation, goal = draw(generator)
        optimizer.zero_grad(set_to_none=True)
        loss(network(observation), goal).backward()
        optimizer.step()
        updates += 1
    return network


@torch.no_grad()
def _outputs(
    network: Callable[[Tensor], Tensor],
    observe: GeometryObservation,
    room: np.ndarray,
    position: np.ndarray,
    views: Sequence[Symmetry],
) -> Tensor:
    """Return a network's outputs for rooms (B,) and positions (B, 2) in each view: (views, B, n), on the CPU."""
    device = observe.origin.device
    outputs = []
    for first in range(0, len(room), BLOCK):
        block = slice(first, first + BLOCK)
        seen = observe(torch.as_tensor(room[block], device=device), torch.as_tensor(position[block], device=device))
        outputs.append(torch.stack([network(observe.turned(seen, view)) for view in views]))
    return torch.cat(outputs, 1).cpu()


def _agreed(offsets: Tensor, views: Sequence[Symmetry]) -> np.ndarray:
    """Turn offsets (views, B, 2) back and return their median along each axis: a few at another wall have no say."""
    ways = [way @ view.matrix.cpu() for way, view in zip(offsets, views, strict=True)]  # the inverse is the transpose
    return np.median(torch.stack(ways).numpy(), 0)
