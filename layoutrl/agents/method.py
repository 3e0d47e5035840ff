"""The configuration of an agent. It loads no torch, so that a wrong option is answered at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from layoutrl.env.simulator import Moves

if TYPE_CHECKING:
    import torch

    from layoutrl.env.symmetry import Symmetry

MOST_ACTIONS = 31  # one bit each of a positive int32, as the replay keeps them


@dataclass(kw_only=True)
class Method:
    """What an agent sees, how it moves and how it learns; `conf/method/` has the values.

    A field of type Any is a Literal, which OmegaConf cannot express.
    """

    name: str
    observation: Any  # geometry or image
    steps: list[float]
    unit: Any  # of the steps: metre or pixel
    slide: bool
    max_moves: int  # moves of a training episode
    evaluation_moves: int  # most moves of a greedy episode
    climbs: int = 0  # after these, at most so many of the shortest moves, to higher values (`GreedyPolicy`)
    snap: float = 0.0  # metres: an item no further than this from being in line with something is put there
    on_illegal: Any  # in test: stop or mask
    goal_iou: float | None = None  # with scope=item: an episode terminates at this IoU; None: never
    double: bool
    dueling: bool = False
    discount: float
    learning_rate: float
    symmetries: bool  # learn from an equal share of each batch in each mirrored and turned view
    batch: int  # transitions an update
    episodes: int  # stepped at once
    warmup_moves: int
    replay_capacity: int
    target_period: int  # updates
    epsilon_start: float
    epsilon_end: float
    epsilon_share: float  # share of the updates over which epsilon falls
    updates: dict[str, int]  # by budget
    scope: Any = "item"  # what is furnished: one item of a room, or the whole room (room)
    every_move: bool = False  # learn what every legal move of a pose gains, not only the one that was made
    discount_start: float = 0.5  # with every_move: rises to `discount` over the first half of the updates
    near_share: float = 0.0  # share of episodes that begin near the designer's place, where that is legal
    # With scope=room:
    own_share: float = 0.5  # share of rooms, times 1 - epsilon, in which items stay where the agent put them

    @property
    def moves(self) -> Moves:
        """The actions."""
        return Moves(tuple(self.steps), self.unit, self.slide)

    def views(self, device: torch.device) -> list[Symmetry]:
        """Return the symmetries to learn from and to average over in test; without `symmetries` the identity alone.

        A whole room is observed in the frame of the moving item, so that only mirroring is left; conf/scope/room.yaml
        takes `symmetries` from the type of the room (`room.mirrors_alike`).
        """
        from layoutrl.env.symmetry import mirrored, symmetries

        views = mirrored if self.scope == "room" else symmetries
        return views(self.moves, device)[: None if self.symmetries else 1]
