"""Are designed rooms well-posed, and not trivial? One type a call:

    python experiments/well_posed.py bedroom [--steps 12000] [--train 5000] [--test 1000] [--seed 0]

(a) Ambiguity: how good another place would have been to the designer. A room with a near tie is not used, so
    their share is 0 by construction; what counts is how many tries were thrown away for one, and how small margins
    are beyond.
(b) Yardsticks: places that need no learning.
(c) A supervised regressor on the geometry observation: can the place be inferred from what is seen?

Prints the numbers and writes experiments/results/well_posed/<type>.json.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from layoutrl.agents.networks import upright_box
from layoutrl.env.observation import COLUMNS, GeometryObservation, categories_of
from layoutrl.env.reward import Reward
from layoutrl.env.simulator import Moves, Simulator
from layoutrl.env.symmetry import symmetries
from layoutrl.evaluation.baselines import nearest_room_place, nearest_wall_place, random_wall_place
from layoutrl.rooms.designer.generator import design_room, design_rooms
from layoutrl.rooms.designer.search import TIE
from layoutrl.rooms.room import MAIN_ITEM, Room

STARTS = 4  # a room, of the yardsticks that hang on a start
RESULTS = Path(__file__).parent / "results" / "well_posed"


def ambiguity(room_type: str, seed: int, count: int) -> dict[str, float]:
    """What the designer's second-best place for the main item was worth, in the test rooms.

    Shares of rooms, but `tries_rejected_as_ties`: of tries, for any item. Margins in centimetres, 100 for yes or no.
    """
    designs = [design_room(room_type, "test", seed, index) for index in range(count)]
    choices = [next(c for c in d.choices if c.place.piece.category == MAIN_ITEM[room_type]) for d in designs]
    rivals = [choice for choice in choices if choice.runner_up is not None]
    ious = [choice.place.iou(choice.runner_up) for choice in rivals if choice.runner_up is not None]
    margins = np.array([choice.margin for choice in rivals if choice.margin is not None])
    ties = sum("as good" in reason for d in designs for _, reason in d.rejected)
    return {
        "rooms_with_a_second_place": len(rivals) / count,
        "iou_with_second_place": float(np.mean(ious)) if ious else 0.0,
        "near_ties": float((margins < TIE).sum() / count),
        "margin_below_20": float((margins < 20).sum() / count),
        "tries_rejected_as_ties": ties / (count + sum(len(d.rejected) for d in designs)),
    }


def yardsticks(training: list[Room], held_out: list[Room], seed: int) -> dict[str, float]:
    """Mean IoU of places that need no learning, on the held-out rooms."""
    simulator = Simulator(held_out, Moves(), Reward())
    rng = np.random.default_rng(seed)
    room = np.repeat(np.arange(len(held_out)), STARTS)
    starts = simulator.starts(room, rng)
    places = {
        "random_start": starts,
        "nearest_wall": nearest_wall_place(simulator, room, starts),
        "random_wall_or_corner": random_wall_place(simulator, room, starts, rng),
        "nearest_training_room": nearest_room_place(simulator, room, training),
    }
    return {name: float(simulator.reward(room, place).iou.mean()) for name, place in places.items()}


class Regressor(nn.Module):
    """A set network that points: the item's centre along each axis is a side or the middle of an element, give or
    take half the item, plus a learnt offset; which one, and how far off, is learnt (a mixture along each axis)."""

    def __init__(self, columns: int, width: int = 96, rounds: int = 3):
        super().__init__()
        self.embed = nn.Sequential(nn.Linear(columns + 4, width), nn.ReLU())
        self.own = nn.ModuleList(nn.Linear(width, width) for _ in range(rounds))
        self.heard = nn.ModuleList(nn.Linear(3 * width, width) for _ in range(rounds))
        self.out = nn.ModuleList(nn.Linear(width, width) for _ in range(rounds))
        self.head = nn.Linear(width, 2 * ANCHORS * 2)  # axes x anchors x (weight, offset)

    def forward(self, elements: Tensor) -> tuple[Tensor, Tensor]:
        """Log weights and centres of the mixture: (B, 2 axes, elements x anchors) each."""
        (x, y), (half_x, half_y) = upright_box(elements.movedim(-1, 0))
        present = elements[..., COLUMNS.index("present"), None]
        sides = torch.stack([x - half_x, x + half_x, y - half_y, y + half_y], -1)
        state = self.embed(torch.cat([elements, sides], -1))
        for own, heard, out in zip(self.own, self.heard, self.out, strict=True):
            # Every element hears of the moving item and of all others.
            pooled = torch.cat([state[:, 0], (state * present).amax(1), (state * present).mean(1)], -1)
            state = state + out((own(state) + heard(pooled)[:, None]).relu())
        weight, offset = self.head(state).unflatten(-1, (2, ANCHORS, 2)).unbind(-1)  # (B, N, 2, anchors)
        center = torch.stack([_anchors(x, half_x), _anchors(y, half_y)], -2) + offset
        weight = weight.masked_fill(present[..., None] == 0, -1e9)
        weight, center = (t.transpose(1, 2).flatten(2) for t in (weight, center))
        return weight.log_softmax(-1), center


ANCHORS = 5


def _anchors(center: Tensor, half: Tensor) -> Tensor:
    """The item's centre if it touches a side of an element, from within or without, or shares its middle."""
    item = half[:, :1]
    return torch.stack(
        [center - half - item, center - half + item, center, center + half - item, center + half + item], -1
    )


def regression(training: list[Room], held_out: list[Room], steps: int, seed: int) -> dict[str, Any]:
    """Train for so many steps on the training rooms and score on the held-out ones."""
    rng = np.random.default_rng(seed)
    categories = categories_of(training)
    sets = {}
    for name, rooms in (("training", training), ("held_out", held_out)):
        observe = GeometryObservation(rooms, categories)
        corners = np.array([room.envelope.bounds for room in rooms])
        middle = torch.tensor((corners[:, :2] + corners[:, 2:]) / 2)
        truth = (torch.tensor([room.moving.center for room in rooms]) - middle).float()
        # The item stands in the middle of the room: its own place tells nothing.
        sets[name] = observe(torch.arange(len(rooms)), middle), truth, middle
    elements, truth, _ = sets["training"]
    views = symmetries(Moves())
    with torch.random.fork_rng(devices=[]):  # layers draw their weights from torch's global generator
        torch.manual_seed(seed)
        network = Regressor(elements.shape[-1])
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-3)
    began = time.perf_counter()
    for step in range(steps):
        for group in optimiser.param_groups:
            group["lr"] = 1e-3 * min(1.0, (step + 1) / 200, 1.02 - step / steps)
        rows = torch.as_tensor(rng.integers(len(elements), size=256))
        view = views[rng.integers(len(views))]
        batch, goal = observe.turned(elements[rows], view), truth[rows] @ view.matrix.T
        weight, center = network(batch)
        error = (center - goal[..., None]).abs()
        loss = -torch.logsumexp(weight - error / 0.02, -1).mean()  # Laplace, 2 cm wide
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
    result: dict[str, Any] = {"steps": steps, "seconds": time.perf_counter() - began}
    for name, rooms in (("training", training[: len(held_out)]), ("held_out", held_out)):
        elements, _, middle = sets[name]
        with torch.no_grad():
            weight, center = network(elements[: len(rooms)])
        place = center.gather(-1, weight.argmax(-1, keepdim=True))[..., 0].double() + middle[: len(rooms)]
        iou = Simulator(rooms, Moves(), Reward()).reward(np.arange(len(rooms)), place.numpy()).iou
        result |= {f"iou_{name}": float(iou.mean()), f"median_{name}": float(np.median(iou))}
        result[f"share_090_{name}"] = float((iou >= 0.9).mean())
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("room_type", choices=list(MAIN_ITEM))
    parser.add_argument("--steps", type=int, default=12000, help="of training the regressor; 0 leaves it out")
    parser.add_argument("--train", type=int, default=5000, help="training rooms")
    parser.add_argument("--test", type=int, default=1000, help="held-out rooms")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()

    began = time.perf_counter()
    training = design_rooms(options.room_type, "train", options.seed, options.train)
    held_out = design_rooms(options.room_type, "test", options.seed, options.test)
    result: dict[str, Any] = {"room_type": options.room_type, "seed": options.seed, "train": options.train}
    result |= {"test": options.test, "design_seconds": time.perf_counter() - began}
    print(f"{training}\ndesigned in {result['design_seconds']:.1f} s")
    result["reject_rate"] = {name: training.reject_rate(name) for name in training.made}
    result["ambiguity"] = ambiguity(options.room_type, options.seed, options.test)
    print(json.dumps(result["ambiguity"], indent=1))
    result["yardsticks"] = yardsticks(training.rooms, held_out.rooms, options.seed)
    print(json.dumps(result["yardsticks"], indent=1))
    if options.steps > 0:
        result["regressor"] = regression(training.rooms, held_out.rooms, options.steps, options.seed)
        print(json.dumps(result["regressor"], indent=1))
    RESULTS.mkdir(parents=True, exist_ok=True)
    (RESULTS / f"{options.room_type}.json").write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
